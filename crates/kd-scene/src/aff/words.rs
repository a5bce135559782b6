//! An AFF file as words.

use crate::LoadError;
use crate::error::quoted;

/// The words of a file: what stands between white space and braces, comments left out.
#[derive(Debug)]
pub(super) struct Words<'a> {
    pub(super) file: &'a str,
    rest: &'a [u8],
    line: usize,
    /// The line of the word that was taken last.
    pub(super) last_line: usize,
}

impl<'a> Words<'a> {
    pub(super) fn new(file: &'a str, bytes: &'a [u8]) -> Self {
        Self {
            file,
            rest: bytes,
            line: 1,
            last_line: 1,
        }
    }

    /// The next word, which stays.
    pub(super) fn peek(&mut self) -> Option<&'a [u8]> {
        self.skip_blanks();
        let is_end = |byte: &u8| byte.is_ascii_whitespace() || b"{}#%".contains(byte);
        let length = match self.rest.first()? {
            b'{' | b'}' => 1,
            _ => self.rest.iter().position(is_end).unwrap_or(self.rest.len()),
        };
        Some(&self.rest[..length])
    }

    pub(super) fn next(&mut self) -> Option<&'a [u8]> {
        let word = self.peek()?;
        self.last_line = self.line;
        self.rest = &self.rest[word.len()..];
        Some(word)
    }

    /// Everything up to the end of the line.
    pub(super) fn skip_line(&mut self) {
        let end = self.rest.iter().position(|byte| *byte == b'\n');
        self.rest = &self.rest[end.unwrap_or(self.rest.len())..];
    }

    fn skip_blanks(&mut self) {
        while let Some(byte) = self.rest.first() {
            match byte {
                b'\n' => self.line += 1,
                b'#' | b'%' => {
                    self.skip_line();
                    continue;
                }
                byte if byte.is_ascii_whitespace() => {}
                _ => return,
            }
            self.rest = &self.rest[1..];
        }
    }

    /// What is wrong in the line of the last word.
    pub(super) fn error(&self, problem: impl Into<String>) -> LoadError {
        LoadError::BadLine {
            file: self.file.to_owned(),
            line: self.last_line,
            problem: problem.into(),
        }
    }

    /// A word that has to be there; `what` says which.
    pub(super) fn word(&mut self, what: &str) -> Result<&'a [u8], LoadError> {
        match self.next() {
            Some(word) => Ok(word),
            None => Err(self.error(format!("the file ends where {what} should be"))),
        }
    }

    /// A word as text.
    pub(super) fn text(&mut self, what: &str) -> Result<String, LoadError> {
        Ok(String::from_utf8_lossy(self.word(what)?).into_owned())
    }

    /// The one word that may be here.
    pub(super) fn expect(&mut self, expected: &str) -> Result<(), LoadError> {
        let word = self.word(&format!("`{expected}`"))?;
        if word == expected.as_bytes() {
            return Ok(());
        }
        Err(self.error(format!("{} where `{expected}` should be", quoted(word))))
    }

    /// Takes a word if it is the next one.
    pub(super) fn take_if(&mut self, word: &str) -> bool {
        let is_next = self.peek() == Some(word.as_bytes());
        if is_next {
            self.next();
        }
        is_next
    }

    /// A finite number.
    pub(super) fn number(&mut self, what: &str) -> Result<f64, LoadError> {
        let word = self.word(what)?;
        match parse(word) {
            Some(number) if number.is_finite() => Ok(number),
            Some(_) => Err(self.error(format!("{what}: {} is not finite", quoted(word)))),
            None => Err(self.error(format!("{what}: {} is not a number", quoted(word)))),
        }
    }

    /// Some finite numbers.
    pub(super) fn numbers<const N: usize>(&mut self, what: &str) -> Result<[f64; N], LoadError> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.number(what)?;
        }
        Ok(numbers)
    }

    /// A number that counts something.
    pub(super) fn count(&mut self, what: &str) -> Result<usize, LoadError> {
        let word = self.word(what)?;
        let text = std::str::from_utf8(word).ok();
        let count = text.and_then(|text| text.parse().ok());
        count.ok_or_else(|| self.error(format!("{what}: {} is not a count", quoted(word))))
    }

    /// Whether a number comes next.
    pub(super) fn is_number_next(&mut self) -> bool {
        self.peek().is_some_and(|word| parse(word).is_some())
    }
}

fn parse(word: &[u8]) -> Option<f64> {
    // Words such as `inf` and `nan` are no numbers of a file.
    let has_digit = word.iter().any(u8::is_ascii_digit);
    let text = std::str::from_utf8(word).ok().filter(|_| has_digit)?;
    text.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_end_at_blanks_braces_and_comments() {
        let text = b"xs 1#one\n{i 0 a.aff}% \xf6 \n\t-8.9E-6 }";
        let mut words = Words::new("a.aff", text);
        let mut all = vec![];
        while let Some(word) = words.next() {
            all.push((String::from_utf8_lossy(word).into_owned(), words.last_line));
        }
        let expected = [
            ("xs", 1),
            ("1", 1),
            ("{", 2),
            ("i", 2),
            ("0", 2),
            ("a.aff", 2),
            ("}", 2),
            ("-8.9E-6", 3),
            ("}", 3),
        ];
        assert_eq!(all, expected.map(|(word, line)| (word.to_owned(), line)));
    }

    #[test]
    fn what_is_no_number_is_told_with_its_line() {
        for (text, expected) in [
            ("1 x", "a.aff: line 1: y: `x` is not a number"),
            ("1\nnan", "a.aff: line 2: y: `nan` is not a number"),
            ("1\n\n1e999", "a.aff: line 3: y: `1e999` is not finite"),
            ("1\n#2", "a.aff: line 1: the file ends where y should be"),
        ] {
            let mut words = Words::new("a.aff", text.as_bytes());
            let error = words.numbers::<2>("y").expect_err(text);
            assert_eq!(error.to_string(), expected);
        }
    }
}
