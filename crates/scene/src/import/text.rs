//! Lines, words and numbers of text formats, from bytes and without copies.

use std::path::Path;

use super::ImportError;

/// A place in a text that is wrong, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Fault {
    /// Byte of the text.
    pub at: usize,
    pub reason: String,
}

impl Fault {
    pub(super) fn new(at: usize, reason: impl Into<String>) -> Self {
        Self { at, reason: reason.into() }
    }

    /// The fault with its line and column in `text`.
    pub(super) fn locate(self, file: &Path, text: &[u8]) -> ImportError {
        let before = &text[..self.at.min(text.len())];
        let start = before.iter().rposition(|&b| b == b'\n').map_or(0, |newline| newline + 1);
        let line = text[start..].split(|&b| b == b'\n').next().unwrap_or_default();
        ImportError::Text {
            file: file.to_owned(),
            line: before.iter().filter(|&&b| b == b'\n').count() + 1,
            column: self.at.saturating_sub(start) + 1,
            reason: self.reason,
            text: String::from_utf8_lossy(&line[..line.len().min(80)]).trim_end().to_owned(),
        }
    }
}

/// Splits `text` into pieces of about `size` bytes that end with whole lines: behind a newline that
/// no backslash continues. Pieces come with their starts.
pub(super) fn pieces(text: &[u8], size: usize) -> Vec<(usize, &[u8])> {
    let mut pieces = Vec::with_capacity(text.len() / size + 1);
    let mut start = 0;
    while start < text.len() {
        let mut end = (start + size).min(text.len());
        while end < text.len() && !ends_line(&text[..end]) {
            end += 1;
        }
        pieces.push((start, &text[start..end]));
        start = end;
    }
    pieces
}

fn ends_line(text: &[u8]) -> bool {
    match text.strip_suffix(b"\n") {
        Some(line) => !line.strip_suffix(b"\r").unwrap_or(line).ends_with(b"\\"),
        None => false,
    }
}

/// Walks through the words of a text, line by line.
#[derive(Debug, Clone)]
pub(super) struct Words<'a> {
    text: &'a [u8],
    at: usize,
}

impl<'a> Words<'a> {
    pub(super) fn new(text: &'a [u8]) -> Self {
        Self { text, at: 0 }
    }

    /// The byte that comes next.
    pub(super) fn at(&self) -> usize {
        self.at
    }

    /// Whether the text is at its end.
    pub(super) fn is_done(&self) -> bool {
        self.at >= self.text.len()
    }

    /// The next word of this line; `None` at its end. A backslash before the end of the line joins
    /// the next one.
    #[inline]
    pub(super) fn word(&mut self) -> Option<&'a [u8]> {
        self.skip_blanks();
        let start = self.at;
        while let Some(&byte) = self.text.get(self.at) {
            if matches!(byte, b' ' | b'\t' | b'\n' | b'\r') || self.continues() {
                break;
            }
            self.at += 1;
        }
        (self.at > start).then(|| &self.text[start..self.at])
    }

    /// Goes to the start of the next line.
    #[inline]
    pub(super) fn end_line(&mut self) {
        while let Some(&byte) = self.text.get(self.at) {
            if self.continues() {
                self.skip_continuation();
                continue;
            }
            self.at += 1;
            if byte == b'\n' {
                return;
            }
        }
    }

    /// The rest of this line without blanks around it; the walk is then at the next line.
    pub(super) fn rest(&mut self) -> &'a [u8] {
        self.skip_blanks();
        let start = self.at;
        self.end_line();
        self.text[start..self.at].trim_ascii()
    }

    #[inline]
    fn skip_blanks(&mut self) {
        while let Some(&byte) = self.text.get(self.at) {
            if self.continues() {
                self.skip_continuation();
            } else if matches!(byte, b' ' | b'\t' | b'\r') {
                self.at += 1;
            } else {
                return;
            }
        }
    }

    /// Whether a backslash is here that joins the next line.
    #[inline]
    fn continues(&self) -> bool {
        self.text[self.at] == b'\\'
            && matches!(self.text[self.at + 1..], [b'\n', ..] | [b'\r', b'\n', ..])
    }

    fn skip_continuation(&mut self) {
        while self.text.get(self.at).is_some_and(|&byte| byte != b'\n') {
            self.at += 1;
        }
        self.at += 1;
    }
}

/// The number that `word` is, rounded correctly.
///
/// Up to 19 digits with a small power of ten are exact in f64 arithmetic (Clinger, *How to read
/// floating point numbers accurately*, 1990); the rest is left to the standard library.
#[inline]
pub(super) fn number(word: &[u8]) -> Option<f64> {
    short_number(word).or_else(|| std::str::from_utf8(word).ok()?.parse().ok())
}

/// Powers of ten that f64 holds exactly.
const TENS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

#[inline]
#[expect(clippy::cast_precision_loss, reason = "checked: no more than 53 bits")]
fn short_number(word: &[u8]) -> Option<f64> {
    let (negative, digits) = match word {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, word),
    };
    if digits.len() > 18 {
        return None;
    }
    let (mut mantissa, mut seen, mut behind_point, mut point) = (0_u64, 0, 0_usize, false);
    for &byte in digits {
        match byte {
            b'0'..=b'9' => {
                mantissa = mantissa * 10 + u64::from(byte - b'0');
                seen += 1;
                behind_point += usize::from(point);
            }
            b'.' if !point => point = true,
            _ => return None,
        }
    }
    if seen == 0 || mantissa >= 1 << 53 {
        return None;
    }
    let value = mantissa as f64 / TENS[behind_point];
    Some(if negative { -value } else { value })
}

/// The whole number that `word` is.
#[inline]
pub(super) fn whole(word: &[u8]) -> Option<i64> {
    let (negative, digits) = match word {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, word),
    };
    if digits.is_empty() || digits.len() > 18 {
        return None;
    }
    let mut value = 0_i64;
    for &byte in digits {
        if !byte.is_ascii_digit() {
            return None;
        }
        value = value * 10 + i64::from(byte - b'0');
    }
    Some(if negative { -value } else { value })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_the_standard_library_does() {
        for text in [
            "0",
            "-0",
            "1",
            "-1.5",
            "+2.25",
            ".8e-1",
            "-.7e+2",
            "3.",
            "0.1",
            "123456789.123456789",
            "9007199254740993",
            "1e308",
            "4.9e-324",
            "0.000000000000000001",
            "inf",
            "-nan",
            "3.14159265358979323846264338327950288",
        ] {
            let has = number(text.as_bytes()).map(f64::to_bits);
            let expected = text.parse::<f64>().ok().map(f64::to_bits);
            assert_eq!(has, expected, "{text}");
        }
        for text in ["", "-", ".", "1.2.3", "1,5", "0x10", "e5", "--1"] {
            assert_eq!(number(text.as_bytes()), None, "{text}");
        }
        assert_eq!(whole(b"-12"), Some(-12));
        assert_eq!(whole(b"+7"), Some(7));
        for text in ["", "-", "1.0", "9999999999999999999", "1/2"] {
            assert_eq!(whole(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn lines_continue_behind_a_backslash() {
        let text = b"f 1 2\\\r\n 3\\\n 4 a\\b\n\nx";
        let mut words = Words::new(text);
        let mut line = Vec::new();
        while let Some(word) = words.word() {
            line.push(std::str::from_utf8(word).unwrap());
        }
        assert_eq!(line, ["f", "1", "2", "3", "4", "a\\b"]);
        words.end_line();
        assert_eq!(words.word(), None);
        words.end_line();
        assert_eq!(words.rest(), b"x");
        assert!(words.is_done());
        assert_eq!(pieces(text, 7), [(0, &text[..19]), (19, &text[19..])]);
        let joined: Vec<u8> =
            pieces(text, 1).iter().flat_map(|(_, piece)| piece.iter().copied()).collect();
        assert_eq!(joined, text);
    }
}
