//! The words of a line of text, and the numbers among them.

use std::ops::Range;

/// The words of a line.
#[derive(Clone, Debug)]
pub(crate) struct Words<'a>(&'a [u8]);

impl<'a> Words<'a> {
    pub(crate) fn new(line: &'a [u8]) -> Self {
        Self(line)
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    #[inline]
    fn next(&mut self) -> Option<&'a [u8]> {
        let word = first_word(self.0)?;
        let (before, rest) = self.0.split_at(word.end);
        self.0 = rest;
        Some(&before[word.start..])
    }
}

/// The place of the first word of a text.
#[inline]
pub(crate) fn first_word(text: &[u8]) -> Option<Range<usize>> {
    let is_blank = |byte: &u8| matches!(byte, b' ' | b'\t'..=b'\r');
    let start = text.iter().position(|byte| !is_blank(byte))?;
    let length = text[start..].iter().position(is_blank);
    Some(start..length.map_or(text.len(), |length| start + length))
}

/// The number of a word, rounded to the nearest `f32`; `None` for any other word.
pub(crate) fn number(word: &[u8]) -> Option<f32> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// The whole number of a word; `None` for any other word, and for one beyond `i64`.
#[inline]
pub(crate) fn integer(word: &[u8]) -> Option<i64> {
    let (is_negative, digits) = match word {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] | digits => (false, digits),
    };
    // Eighteen digits cannot exceed `i64`.
    if digits.is_empty() || digits.len() > 18 {
        return std::str::from_utf8(word).ok()?.parse().ok();
    }
    let mut number = 0;
    for digit in digits {
        if !digit.is_ascii_digit() {
            return None;
        }
        number = 10 * number + i64::from(digit - b'0');
    }
    Some(if is_negative { -number } else { number })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_between_blanks() {
        let words: Vec<&[u8]> = Words::new(b" \ta  bc\x0b\x0cd\r").collect();
        assert_eq!(words, [b"a".as_slice(), b"bc", b"d"]);
        assert_eq!(Words::new(b"  ").next(), None);
    }

    #[test]
    fn integers_are_those_of_the_standard_library() {
        for word in [
            "0",
            "-0",
            "+7",
            "-12",
            "123456789012345678",
            "9223372036854775807",
            "-9223372036854775808",
            "9223372036854775808",
            "",
            "-",
            "+",
            "1.0",
            "1e3",
            "0x1",
            "--1",
            "000000000000000000000001",
            "é",
        ] {
            assert_eq!(integer(word.as_bytes()), word.parse().ok(), "{word}");
        }
    }
}
