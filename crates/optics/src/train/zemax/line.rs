//! The lines of a Zemax file: its bytes to text, a command and its values, the value of one configuration.
//!
//! OpticStudio writes UTF-16 with a byte order mark, older versions one byte a character.

/// Error of another program's lens file that cannot be converted.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}{why}", match line { 0 => String::new(), line => format!("line {line}: ") })]
pub struct ZemaxError {
    /// The line, from 1; 0 where the words name the place.
    pub line: usize,
    /// Description of the error, and of what would be valid.
    pub why: String,
}

impl ZemaxError {
    pub(super) fn new(line: usize, why: impl Into<String>) -> Self {
        Self { line, why: why.into() }
    }
}

/// One line, taken apart.
pub(super) struct SheetLine<'a> {
    pub(super) number: usize,
    pub(super) command: &'a str,
    pub(super) rest: &'a str,
}

impl SheetLine<'_> {
    pub(super) fn error(&self, why: impl std::fmt::Display) -> ZemaxError {
        ZemaxError::new(self.number, format!("{}: {why}", self.command))
    }

    pub(super) fn word(&self, i: usize) -> Option<&str> {
        self.rest.split_whitespace().nth(i)
    }

    pub(super) fn number(&self, i: usize) -> Result<f64, ZemaxError> {
        let word = self.word(i).ok_or_else(|| self.error("a number is missing"))?;
        self.parse(word)
    }

    /// The number at `i`, or `absent`.
    pub(super) fn number_or(&self, i: usize, absent: f64) -> Result<f64, ZemaxError> {
        self.word(i).map_or(Ok(absent), |word| self.parse(word))
    }

    fn parse(&self, word: &str) -> Result<f64, ZemaxError> {
        word.parse::<f64>()
            .ok()
            .filter(|number| number.is_finite())
            .ok_or_else(|| self.error(format!("`{word}` is not a number")))
    }

    pub(super) fn numbers(&self) -> Result<Vec<f64>, ZemaxError> {
        self.rest.split_whitespace().map(|word| self.parse(word)).collect()
    }

    pub(super) fn index(&self, i: usize) -> Result<usize, ZemaxError> {
        let word = self.word(i).ok_or_else(|| self.error("a whole number is missing"))?;
        word.parse().map_err(|_| self.error(format!("`{word}` is not a whole number")))
    }
}

/// Operands whose values are taken, and what others do to the light's way.
pub(super) const TAKEN: [&str; 11] =
    ["THIC", "CRVT", "CONN", "SDIA", "APER", "XFIE", "YFIE", "GLSS", "WAVE", "WLWT", "FLWT"];
const NOT_TAKEN: [&str; 13] = [
    "STPS", "PRAM", "EDVA", "MABB", "MIND", "CADX", "CADY", "CATX", "CATY", "CATZ", "CAOR", "PRWV",
    "IGNR",
];

/// A value of one configuration.
#[derive(Debug, Clone)]
pub(super) struct ConfigurationValue {
    pub(super) line: usize,
    pub(super) operand: &'static str,
    /// Of the surface or field.
    pub(super) index: usize,
    pub(super) configuration: usize,
    pub(super) value: String,
}

impl ConfigurationValue {
    /// The value in a line; `None` when it is none of an operand.
    pub(super) fn read(line: &SheetLine<'_>) -> Result<Option<Self>, ZemaxError> {
        let operand = TAKEN.iter().chain(&NOT_TAKEN).find(|operand| **operand == line.command);
        let Some(&operand) = operand else { return Ok(None) };
        let (Ok(index), Ok(configuration), Some(value)) =
            (line.index(0), line.index(1), line.word(2))
        else {
            return Err(line.error("expected a surface or field, a configuration, and a value"));
        };
        let value = value.to_owned();
        Ok(Some(Self { line: line.number, operand, index, configuration, value }))
    }

    pub(super) fn error(&self, why: &str) -> ZemaxError {
        ZemaxError::new(self.line, format!("{}: {why}", self.operand))
    }

    pub(super) fn number(&self) -> Result<f64, ZemaxError> {
        let number = self.value.parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| self.error(&format!("`{}` is not a number", self.value)))
    }
}

/// The text of a file in UTF-8 or UTF-16 of either order, by its byte order mark or, without one, by
/// where its zero bytes are. What is no UTF-8 is taken for Latin-1, as old versions write it.
pub(super) fn decode(bytes: &[u8]) -> Result<String, ZemaxError> {
    match bytes {
        [] => Err(ZemaxError::new(1, "the file is empty")),
        [0xff, 0xfe, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => utf16(rest, u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, rest @ ..] => utf8(rest),
        [first, 0, ..] if *first != 0 => utf16(bytes, u16::from_le_bytes),
        [0, second, ..] if *second != 0 => utf16(bytes, u16::from_be_bytes),
        _ => utf8(bytes),
    }
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Result<String, ZemaxError> {
    let (pairs, odd) = bytes.as_chunks::<2>();
    let text: Result<String, _> =
        char::decode_utf16(pairs.iter().map(|&pair| unit(pair))).collect();
    match text {
        Ok(text) if odd.is_empty() => Ok(text),
        _ => Err(ZemaxError::new(1, "the file is broken UTF-16; save it again")),
    }
}

fn utf8(bytes: &[u8]) -> Result<String, ZemaxError> {
    if bytes.contains(&0) {
        return Err(ZemaxError::new(1, "the file is no text"));
    }
    Ok(match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().map(|&byte| char::from(byte)).collect(),
    })
}
