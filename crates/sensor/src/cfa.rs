//! Colour filter arrays: which filter lies over which pixel.

use std::fmt;

use etendue_report::Refusal;
use schemars::JsonSchema;
use serde::de::{self, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::SensorError;

/// A rectangle of filter letters that repeats over the sensor from its top left pixel.
///
/// In JSON: a word of four letters for two by two pixels read row by row (`"rggb"`, `"grbg"`,
/// `"rgbw"`), a list of rows (`["rgbw", "bwrg"]`), or one of the [names](Self::NAMED).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CfaSpec {
    /// Rows of equal length, at least one letter each.
    rows: Vec<Vec<char>>,
}

/// The longest side of a pattern (pixels).
const LONGEST_SIDE: usize = 64;

impl CfaSpec {
    /// Patterns that have a name: four pixels of a colour together; Fujifilm's of six by six pixels; one of RGB-IR
    /// sensors, of which `i` wants a curve; and one of cars', with clear pixels in place of green ones.
    pub const NAMED: [(&str, &[&str]); 4] = [
        ("quad_bayer", &["rrgg", "rrgg", "ggbb", "ggbb"]),
        ("x_trans", &["gbggrg", "rgrbgb", "gbggrg", "grggbg", "bgbrgr", "grggbg"]),
        ("rgb_ir", &["bgrg", "gigi", "rgbg", "gigi"]),
        ("rccb", &["rw", "wb"]),
    ];

    /// A pattern by its name, or of two by two letters.
    ///
    /// # Errors
    ///
    /// As [`Self::two_by_two`].
    pub fn of_word(word: &str) -> Result<Self, SensorError> {
        let named = Self::NAMED.iter().find(|(name, _)| *name == word);
        match named {
            Some((_, rows)) => {
                Self::from_rows(rows.iter().map(|row| row.chars().collect()).collect())
            }
            None => Self::two_by_two(word),
        }
    }

    /// Two by two letters, read row by row.
    ///
    /// # Errors
    ///
    /// When there are not four letters.
    pub fn two_by_two(word: &str) -> Result<Self, SensorError> {
        let letters: Vec<char> = word.chars().collect();
        if letters.len() != 4 {
            let why = format!(
                "`{word}` has {} letters; a pattern of two by two pixels has four, others are a \
                 list of rows or one of {}",
                letters.len(),
                Self::NAMED.map(|(name, _)| name).join(", ")
            );
            return Err(Refusal::new(why).at("cfa").into());
        }
        Self::from_rows(letters.chunks(2).map(<[char]>::to_vec).collect())
    }

    /// A pattern of any size.
    ///
    /// # Errors
    ///
    /// When rows are empty, of different lengths, or more than 64 a side, or a letter is none.
    pub fn from_rows(rows: Vec<Vec<char>>) -> Result<Self, SensorError> {
        let fault = |why: String| Err(Refusal::new(why).at("cfa").into());
        let width = rows.first().map_or(0, Vec::len);
        if width == 0 || rows.len() > LONGEST_SIDE || width > LONGEST_SIDE {
            return fault(format!("a pattern has 1 to {LONGEST_SIDE} rows and columns"));
        }
        if let Some(row) = rows.iter().position(|row| row.len() != width) {
            return fault(format!("row {row} has {} letters, row 0 has {width}", rows[row].len()));
        }
        if let Some(other) = rows.iter().flatten().find(|letter| !letter.is_alphanumeric()) {
            return fault(format!("`{other}` is neither a letter nor a digit"));
        }
        Ok(Self { rows })
    }

    /// Rows and columns until the pattern repeats.
    #[must_use]
    pub fn period(&self) -> [usize; 2] {
        [self.rows.len(), self.rows[0].len()]
    }

    /// The letter over a pixel.
    #[must_use]
    pub fn at(&self, row: usize, column: usize) -> char {
        let letters = &self.rows[row % self.rows.len()];
        letters[column % letters.len()]
    }

    /// The letters in order of first appearance.
    #[must_use]
    pub fn letters(&self) -> Vec<char> {
        let mut letters = Vec::new();
        for &letter in self.rows.iter().flatten() {
            if !letters.contains(&letter) {
                letters.push(letter);
            }
        }
        letters
    }
}

impl fmt::Display for CfaSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rows: Vec<String> = self.rows.iter().map(|row| row.iter().collect()).collect();
        f.write_str(&rows.join(if self.period() == [2, 2] { "" } else { "/" }))
    }
}

impl Serialize for CfaSpec {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.period() == [2, 2] {
            return serializer.serialize_str(&self.to_string());
        }
        let rows: Vec<String> = self.rows.iter().map(|row| row.iter().collect()).collect();
        rows.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for CfaSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(CfaVisitor)
    }
}

struct CfaVisitor;

impl<'de> Visitor<'de> for CfaVisitor {
    type Value = CfaSpec;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(
            "a word of four filter letters such as \"rggb\", a name, or a list of rows of letters",
        )
    }

    fn visit_str<E: de::Error>(self, word: &str) -> Result<CfaSpec, E> {
        CfaSpec::of_word(word).map_err(|error| E::custom(error.why()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<CfaSpec, A::Error> {
        let mut rows = Vec::new();
        while let Some(row) = list.next_element::<String>()? {
            rows.push(row.chars().collect());
        }
        CfaSpec::from_rows(rows).map_err(|error| de::Error::custom(error.why()))
    }
}

impl JsonSchema for CfaSpec {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Cfa".into()
    }

    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let rows = generator.subschema_for::<Vec<String>>();
        schemars::json_schema!({
            "description": "Filter letters: two by two pixels read row by row, a named pattern, or a list of rows.",
            "anyOf": [
                { "type": "string", "minLength": 4, "maxLength": 4 },
                { "enum": Self::NAMED.map(|(name, _)| name) },
                rows,
            ],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_repeat() {
        let bayer: CfaSpec = serde_json::from_str("\"rggb\"").unwrap();
        assert_eq!(bayer.period(), [2, 2]);
        assert_eq!(bayer.letters(), ['r', 'g', 'b']);
        let over = |r, c| bayer.at(r, c);
        assert_eq!(
            [over(0, 0), over(0, 1), over(1, 0), over(1, 1), over(4, 7)],
            ['r', 'g', 'g', 'b', 'g']
        );
        assert_eq!(serde_json::to_string(&bayer).unwrap(), "\"rggb\"");
        let wide: CfaSpec = serde_json::from_str(r#"["rgbw", "bwrg"]"#).unwrap();
        assert_eq!((wide.period(), wide.at(3, 5)), ([2, 4], 'w'));
        let text = serde_json::to_string(&wide).unwrap();
        assert_eq!(serde_json::from_str::<CfaSpec>(&text).unwrap(), wide);
        // Of Fujifilm's 36 pixels 20 are green, and each row and column has all three colours.
        let fuji = CfaSpec::of_word("x_trans").unwrap();
        let count = |letter| (0..36).filter(|k| fuji.at(k / 6, k % 6) == letter).count();
        assert_eq!(['r', 'g', 'b'].map(count), [8, 20, 8]);
        for k in 0..6 {
            for letter in ['r', 'g', 'b'] {
                assert!((0..6).any(|x| fuji.at(k, x) == letter));
                assert!((0..6).any(|y| fuji.at(y, k) == letter));
            }
        }
        assert_eq!(CfaSpec::of_word("rccb").unwrap().to_string(), "rwwb");
    }

    #[test]
    fn what_is_no_pattern_is_refused() {
        for (text, word) in [
            ("\"rgb\"", "has 3 letters"),
            ("\"rg b\"", "neither a letter"),
            ("[]", "1 to 64"),
            (r#"["rg", "b"]"#, "row 1 has 1 letters"),
            (r#"[""]"#, "1 to 64"),
            ("5", "a word of four filter letters"),
        ] {
            let error = serde_json::from_str::<CfaSpec>(text).unwrap_err().to_string();
            assert!(error.contains(word), "{text}: {error}");
        }
    }
}
