//! The tokenizer of AFF files.

use crate::LoadError;
use crate::error::quoted;
use crate::report::Place;

/// The tokens of a file, separated by white space and braces, without comments.
#[derive(Debug)]
pub(super) struct Tokens<'a> {
    pub(super) file: &'a str,
    rest: &'a [u8],
    line: usize,
    /// Line of the last token taken, from 1.
    pub(super) last_line: usize,
}

impl<'a> Tokens<'a> {
    pub(super) fn new(file: &'a str, bytes: &'a [u8]) -> Self {
        Self {
            file,
            rest: bytes,
            line: 1,
            last_line: 1,
        }
    }

    /// The file and the place of the last token taken.
    pub(super) fn place(&self) -> (&'a str, Option<Place>) {
        (self.file, Some(Place::Line(self.last_line)))
    }

    /// The next token, without taking it.
    pub(super) fn peek(&mut self) -> Option<&'a [u8]> {
        self.skip_blanks();
        let is_end = |byte: &u8| byte.is_ascii_whitespace() || b"{}#%".contains(byte);
        let length = match self.rest.first()? {
            b'{' | b'}' => 1,
            _ => self.rest.iter().position(is_end).unwrap_or(self.rest.len()),
        };
        Some(&self.rest[..length])
    }

    /// Takes the next token.
    pub(super) fn next(&mut self) -> Option<&'a [u8]> {
        let token = self.peek()?;
        self.last_line = self.line;
        self.rest = &self.rest[token.len()..];
        Some(token)
    }

    /// Skips the rest of the line.
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

    /// An error in the line of the last token.
    pub(super) fn error(&self, problem: impl Into<String>) -> LoadError {
        LoadError::BadLine {
            file: self.file.to_owned(),
            line: self.last_line,
            problem: problem.into(),
        }
    }

    /// Takes a required token; `what` names it in the error.
    pub(super) fn token(&mut self, what: &str) -> Result<&'a [u8], LoadError> {
        match self.next() {
            Some(token) => Ok(token),
            None => Err(self.error(format!("expected {what}, found the end of the file"))),
        }
    }

    /// Takes a token as text.
    pub(super) fn text(&mut self, what: &str) -> Result<String, LoadError> {
        Ok(String::from_utf8_lossy(self.token(what)?).into_owned())
    }

    /// Takes a token that must be `expected`.
    pub(super) fn expect(&mut self, expected: &str) -> Result<(), LoadError> {
        let token = self.token(&format!("`{expected}`"))?;
        if token == expected.as_bytes() {
            return Ok(());
        }
        Err(self.error(format!("expected `{expected}`, found {}", quoted(token))))
    }

    /// Takes the next token if it is `token`.
    pub(super) fn take_if(&mut self, token: &str) -> bool {
        let is_next = self.peek() == Some(token.as_bytes());
        if is_next {
            self.next();
        }
        is_next
    }

    /// Takes a finite number; `what` names it in the error.
    pub(super) fn number(&mut self, what: &str) -> Result<f64, LoadError> {
        let token = self.token(what)?;
        match parse(token) {
            Some(number) if number.is_finite() => Ok(number),
            Some(_) => Err(self.error(format!("{what}: {} is not finite", quoted(token)))),
            None => Err(self.error(format!("{what}: {} is not a number", quoted(token)))),
        }
    }

    /// Takes `N` finite numbers.
    pub(super) fn numbers<const N: usize>(&mut self, what: &str) -> Result<[f64; N], LoadError> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.number(what)?;
        }
        Ok(numbers)
    }

    /// Takes a non-negative integer.
    pub(super) fn count(&mut self, what: &str) -> Result<usize, LoadError> {
        let token = self.token(what)?;
        let text = std::str::from_utf8(token).ok();
        let count = text.and_then(|text| text.parse().ok());
        count.ok_or_else(|| self.error(format!("{what}: {} is not a count", quoted(token))))
    }

    /// Whether a number comes next.
    pub(super) fn is_number_next(&mut self) -> bool {
        self.peek().is_some_and(|token| parse(token).is_some())
    }
}

fn parse(token: &[u8]) -> Option<f64> {
    // `inf` and `nan` are not numbers in AFF.
    let has_digit = token.iter().any(u8::is_ascii_digit);
    let text = std::str::from_utf8(token).ok().filter(|_| has_digit)?;
    text.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_end_at_blanks_braces_and_comments() {
        let text = b"xs 1#one\n{i 0 a.aff}% \xf6 \n\t-8.9E-6 }";
        let mut tokens = Tokens::new("a.aff", text);
        let mut all = vec![];
        while let Some(token) = tokens.next() {
            all.push((
                String::from_utf8_lossy(token).into_owned(),
                tokens.last_line,
            ));
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
        assert_eq!(all, expected.map(|(token, line)| (token.to_owned(), line)));
    }

    #[test]
    fn invalid_numbers_are_errors_with_their_line() {
        for (text, expected) in [
            ("1 x", "a.aff: line 1: y: `x` is not a number"),
            ("1\nnan", "a.aff: line 2: y: `nan` is not a number"),
            ("1\n\n1e999", "a.aff: line 3: y: `1e999` is not finite"),
            (
                "1\n#2",
                "a.aff: line 1: expected y, found the end of the file",
            ),
        ] {
            let mut tokens = Tokens::new("a.aff", text.as_bytes());
            let error = tokens.numbers::<2>("y").expect_err(text);
            assert_eq!(error.to_string(), expected);
        }
    }
}
