//! Lines, words and numbers of text formats, from bytes and without copies.

use std::borrow::Cow;
use std::path::Path;

use etendue_report::Refusal;

use super::error::wrong_text;

/// A place in a text that is wrong, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct TextFault {
    /// Byte of the text.
    pub at: usize,
    pub reason: String,
}

impl TextFault {
    pub(super) fn new(at: usize, reason: impl Into<String>) -> Self {
        Self { at, reason: reason.into() }
    }

    /// The fault with its line and column in `text`.
    pub(super) fn locate(self, file: &Path, text: &[u8]) -> Refusal {
        let at = self.at.min(text.len());
        // A carriage return ends a line, too, unless a newline follows.
        let ends = |i: usize| {
            text[i] == b'\n' || text[i..].starts_with(b"\r") && !text[i..].starts_with(b"\r\n")
        };
        let start = (0..at).rev().find(|&i| ends(i)).map_or(0, |end| end + 1);
        let end = (start..text.len()).find(|&i| ends(i)).unwrap_or(text.len());
        let line = &text[start..end];
        let number = (0..at).filter(|&i| ends(i)).count() + 1;
        let column = self.at.saturating_sub(start) + 1;
        let shown = String::from_utf8_lossy(&line[..line.len().min(80)]);
        wrong_text(file, number, column, self.reason, shown.trim_end())
    }
}

/// A part of a text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct TextSlice<'a> {
    /// Byte of the text where it starts.
    pub start: usize,
    pub text: &'a [u8],
}

/// Splits `text` into pieces of about `size` bytes that end with whole lines: behind a newline that
/// no backslash continues.
pub(super) fn pieces(text: &[u8], size: usize) -> Vec<TextSlice<'_>> {
    let mut pieces = Vec::with_capacity(text.len() / size + 1);
    let mut start = 0;
    while start < text.len() {
        let mut end = (start + size).min(text.len());
        while end < text.len() && !ends_line(&text[..end]) {
            end += 1;
        }
        pieces.push(TextSlice { start, text: &text[start..end] });
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
pub(super) struct WordReader<'a> {
    text: &'a [u8],
    at: usize,
}

impl<'a> WordReader<'a> {
    pub(super) fn new(text: &'a [u8]) -> Self {
        Self { text, at: 0 }
    }

    /// The byte that comes next.
    pub(super) fn at(&self) -> usize {
        self.at
    }

    /// True if the text is at its end.
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

    /// True if a backslash is here that joins the next line.
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
    short_number(word)
        .or_else(|| std::str::from_utf8(word).ok()?.parse().ok())
        .or_else(|| not_finite(word))
}

/// Value of a word that Microsoft's C library prints for numbers that are not finite: `1.#INF`,
/// `-1.#IND`, `1.#QNAN0`, cut or filled to the digits asked for; newer ones print `-nan(ind)`.
#[cold]
fn not_finite(word: &[u8]) -> Option<f64> {
    let (negative, rest) = match word {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, word),
    };
    let is_filled = |tail: &[u8]| tail.iter().all(|byte| *byte == b'0');
    if let Some(name) = rest.strip_prefix(b"1.#") {
        let infinity = if negative { f64::NEG_INFINITY } else { f64::INFINITY };
        if name.strip_prefix(b"INF").is_some_and(is_filled) {
            return Some(infinity);
        }
        // One and two places leave `1.#J` (both rounded up) and `1.#IO`, or `1.#R` of QNAN.
        let names: [&[u8]; 7] = [b"IND", b"QNAN", b"SNAN", b"J", b"IO", b"R", b"QO"];
        let is_name = |known: &&[u8]| name.strip_prefix(*known).is_some_and(is_filled);
        return names.iter().any(is_name).then_some(f64::NAN);
    }
    let inside = rest.to_ascii_lowercase();
    let inside = inside.strip_prefix(b"nan(")?.strip_suffix(b")")?.to_vec();
    inside.iter().all(u8::is_ascii_alphanumeric).then_some(f64::NAN)
}

/// The text behind a byte order mark, which some programs put before UTF-8.
pub(super) fn without_mark(text: &[u8]) -> &[u8] {
    text.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(text)
}

/// The text with newlines where all its lines end with carriage returns alone, byte for byte.
pub(super) fn with_newlines(text: &[u8]) -> Cow<'_, [u8]> {
    // Most texts have a newline near their start; without one there is no line to speak of.
    if text.contains(&b'\n') || !text.contains(&b'\r') {
        return Cow::Borrowed(text);
    }
    Cow::Owned(text.iter().map(|&byte| if byte == b'\r' { b'\n' } else { byte }).collect())
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
        // Of Microsoft's C library.
        for text in ["1.#IND", "-1.#IND00", "1.#QNAN", "1.#QNAN0", "1.#J", "-nan(ind)", "nan(snan)"]
        {
            assert!(number(text.as_bytes()).is_some_and(f64::is_nan), "{text}");
        }
        assert_eq!(number(b"1.#INF00"), Some(f64::INFINITY));
        assert_eq!(number(b"-1.#INF"), Some(f64::NEG_INFINITY));
        for text in
            ["", "-", ".", "1.2.3", "1,5", "0x10", "e5", "--1", "1.#", "1.#IN", "2.#IND", "nan()x"]
        {
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
        let mut words = WordReader::new(text);
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
        let piece = |start: usize, end: usize| TextSlice { start, text: &text[start..end] };
        assert_eq!(pieces(text, 7), [piece(0, 19), piece(19, text.len())]);
        let joined: Vec<u8> =
            pieces(text, 1).iter().flat_map(|piece| piece.text.iter().copied()).collect();
        assert_eq!(joined, text);
    }
}
