//! A JSON text, its values, and where in the text each of them stands: read once.

use std::str::FromStr;

use serde_json::{Map, Number, Value};

use super::path::{PathStep, ScenePath};

/// A place in a text, both counted from 1; the column in characters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// The line.
    pub line: usize,
    /// The column.
    pub column: usize,
}

/// Place where a value was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Origin {
    /// In the file's text.
    Text(Place),
    /// On the command line, or in one of the frames: where, and as it was written there.
    Setting(String),
    /// Nowhere: it is missing, or the file is a model.
    Nowhere,
}

/// Fault of a text that is no JSON document for us.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct JsonFault {
    pub(crate) place: Place,
    pub(crate) reason: String,
}

/// The longest key (bytes). Keys stand in the paths of all that is below them.
const LONGEST_KEY: usize = 1000;

/// The most arrays and objects that may stand in each other, as `serde_json` has it.
const MOST_LEVELS: usize = 127;

/// A parsed text, and the places of its values.
#[derive(Debug, Clone)]
pub(crate) struct JsonDocument {
    text: String,
    /// All values in the order of the text, each before those inside it.
    values: Vec<ValueSpan>,
}

/// A value in the text, of at most 4 GiB.
#[derive(Debug, Clone, Copy)]
struct ValueSpan {
    /// The byte where it starts, or its key where it has one.
    start: u32,
    /// The number of the next value that is not inside it.
    next: u32,
    is_member: bool,
}

impl JsonDocument {
    /// Parses `text` into the document and its values; refused when it is not JSON (RFC 8259), or an object
    /// has a key twice.
    pub(crate) fn parse(text: String) -> Result<(Self, Value), JsonFault> {
        let mut reader =
            JsonReader { text: &text, at: 0, values: Vec::new(), path: Vec::new(), levels: 0 };
        match reader.document() {
            Ok(value) => {
                let values = reader.values;
                Ok((Self { text, values }, value))
            }
            Err(Wrong { at, reason }) => Err(JsonFault { place: place_of(&text, at), reason }),
        }
    }

    /// Place in the text of the value at `path`, or of the nearest that holds it; `None` for the whole.
    pub(crate) fn near(&self, path: &ScenePath) -> Option<Place> {
        path.holders().find_map(|path| self.place(&path))
    }

    /// Place in the text of the value at `path`; `None` for the whole.
    pub(crate) fn place(&self, path: &ScenePath) -> Option<Place> {
        if path.steps().is_empty() {
            return None;
        }
        let mut here = 0;
        for step in path.steps() {
            let mut inside = self.inside(here);
            here = match (self.values.get(here + 1)?.is_member, step) {
                (true, PathStep::Key(key)) => inside.find(|&at| self.key(at).as_ref() == Some(key)),
                (true, PathStep::Index(_)) => None,
                (false, step) => inside.nth(step.as_index()?),
            }?;
        }
        Some(place_of(&self.text, self.values[here].start as usize))
    }

    /// The numbers of the values right inside the value `number`.
    fn inside(&self, number: usize) -> impl Iterator<Item = usize> + '_ {
        let end = self.values[number].next as usize;
        let next = move |at: &usize| self.values.get(*at).map(|value| value.next as usize);
        std::iter::successors(Some(number + 1), next).take_while(move |&at| at < end)
    }

    /// The key of the value `number`.
    fn key(&self, number: usize) -> Option<String> {
        let text = self.text.get(self.values[number].start as usize..)?;
        serde_json::Deserializer::from_str(text).into_iter().next()?.ok()
    }
}

/// The line at `place` with its number, and a caret below the column.
pub(crate) fn excerpt(text: &str, place: Place) -> String {
    const BEFORE: usize = 60;
    const SHOWN: usize = 100;
    let line: Vec<char> = text.lines().nth(place.line - 1).unwrap_or_default().chars().collect();
    // A file without line breaks is one very long line: show the part around the place.
    let start = (place.column - 1).saturating_sub(BEFORE);
    let shown: String = line
        .iter()
        .skip(start)
        .take(SHOWN)
        .map(|&c| if c.is_control() { ' ' } else { c })
        .collect();
    let number = place.line.to_string();
    let margin = " ".repeat(number.len());
    let indent = " ".repeat(place.column - 1 - start);
    format!("  {number} | {shown}\n  {margin} | {indent}^")
}

fn place_of(text: &str, at: usize) -> Place {
    let before = text.get(..at).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |i| i + 1);
    Place {
        line: before.matches('\n').count() + 1,
        column: before[line_start..].chars().count() + 1,
    }
}

/// Reads a text once, from its start.
struct JsonReader<'a> {
    text: &'a str,
    at: usize,
    values: Vec<ValueSpan>,
    /// The place of the value that is read.
    path: Vec<PathStep>,
    levels: usize,
}

/// Fault in a text: its byte, and the reason.
struct Wrong {
    at: usize,
    reason: String,
}

/// Message where a value is missing.
const A_VALUE: &str =
    "a value should stand here: a string in quotes, a number, true, false, null, [ or {";

impl JsonReader<'_> {
    /// The next byte that is no blank; 0 at the end.
    fn peek(&mut self) -> u8 {
        let bytes = self.text.as_bytes();
        while let Some(b' ' | b'\n' | b'\t' | b'\r') = bytes.get(self.at) {
            self.at += 1;
        }
        bytes.get(self.at).copied().unwrap_or(b'\0')
    }

    /// The error at the next byte, which should be another; `inside` what the text ends where it has ended.
    fn wrong<T>(&self, reason: &str, inside: &str) -> Result<T, Wrong> {
        let reason = match self.at < self.text.len() {
            true => reason.to_owned(),
            false => format!("the text ends inside {inside} (EOF)"),
        };
        Err(Wrong { at: self.at, reason })
    }

    fn document(&mut self) -> Result<Value, Wrong> {
        self.peek();
        let value = self.value(self.at, false)?;
        self.peek();
        match self.at < self.text.len() {
            true => self.wrong("the document has ended, but text goes on", ""),
            false => Ok(value),
        }
    }

    /// The value at the next byte, whose key stands at `start` where it `is_member` of an object.
    fn value(&mut self, start: usize, is_member: bool) -> Result<Value, Wrong> {
        let number = self.values.len();
        let place = |byte: usize| u32::try_from(byte).unwrap_or(u32::MAX);
        self.values.push(ValueSpan { start: place(start), next: 0, is_member });
        let value = match self.peek() {
            b'{' => self.nested(Self::object).map(Value::Object),
            b'[' => self.nested(Self::array).map(Value::Array),
            b'"' => self.string().map(Value::String),
            b'-' | b'0'..=b'9' => self.number(),
            b't' => self.word("true", Value::Bool(true)),
            b'f' => self.word("false", Value::Bool(false)),
            b'n' => self.word("null", Value::Null),
            _ => self.wrong(A_VALUE, "a value"),
        }?;
        self.values[number].next = place(self.values.len());
        Ok(value)
    }

    fn nested<T>(&mut self, read: impl FnOnce(&mut Self) -> Result<T, Wrong>) -> Result<T, Wrong> {
        if self.levels == MOST_LEVELS {
            let reason = format!("nested too deeply (recursion limit: {})", MOST_LEVELS + 1);
            return Err(Wrong { at: self.at, reason });
        }
        self.levels += 1;
        self.at += 1;
        let value = read(self)?;
        self.levels -= 1;
        Ok(value)
    }

    fn object(&mut self) -> Result<Map<String, Value>, Wrong> {
        let mut members = Map::new();
        if self.peek() == b'}' {
            self.at += 1;
            return Ok(members);
        }
        loop {
            match self.peek() {
                b'"' => {}
                b'}' => return self.wrong("a comma with nothing behind it", "an object"),
                _ => return self.wrong("a key in double quotes should stand here", "an object"),
            }
            let start = self.at;
            let key = self.string()?;
            let wrong = |reason| Err(Wrong { at: start, reason });
            if key.len() > LONGEST_KEY {
                let long = key.len();
                return wrong(format!("a key of {long} bytes; {LONGEST_KEY} is the most"));
            }
            if self.peek() != b':' {
                return self.wrong("expected `:`", "an object");
            }
            self.at += 1;
            self.path.push(PathStep::Key(key.clone()));
            if members.contains_key(&key) {
                let key = self.path.drain(..).collect::<ScenePath>();
                return wrong(format!(
                    "the key {key} stands here a second time\nhint: remove one of them"
                ));
            }
            self.peek();
            let value = self.value(start, true)?;
            self.path.pop();
            members.insert(key, value);
            match self.peek() {
                b',' => self.at += 1,
                b'}' => break,
                _ => return self.wrong("expected `,` or `}`", "an object"),
            }
        }
        self.at += 1;
        Ok(members)
    }

    fn array(&mut self) -> Result<Vec<Value>, Wrong> {
        let mut elements = Vec::new();
        if self.peek() == b']' {
            self.at += 1;
            return Ok(elements);
        }
        loop {
            if self.peek() == b']' {
                return self.wrong("a comma with nothing behind it", "an array");
            }
            self.path.push(PathStep::Index(elements.len()));
            elements.push(self.value(self.at, false)?);
            self.path.pop();
            match self.peek() {
                b',' => self.at += 1,
                b']' => break,
                _ => return self.wrong("expected `,` or `]`", "an array"),
            }
        }
        self.at += 1;
        Ok(elements)
    }

    fn string(&mut self) -> Result<String, Wrong> {
        let start = self.at;
        let bytes = self.text.as_bytes();
        let mut end = start + 1;
        let mut is_plain = true;
        // To the quote that ends it.
        loop {
            match bytes.get(end) {
                Some(b'"') => break,
                Some(b'\\') => {
                    is_plain = false;
                    end += 2;
                }
                Some(0..=0x1f) => {
                    let reason = "a line break or another control character inside a string";
                    return Err(Wrong { at: end, reason: reason.to_owned() });
                }
                Some(_) => end += 1,
                None => {
                    self.at = bytes.len();
                    return self.wrong("", "a string");
                }
            }
        }
        self.at = end + 1;
        if is_plain {
            return Ok(self.text[start + 1..end].to_owned());
        }
        serde_json::from_str(&self.text[start..=end]).map_err(|error| {
            let reason = "a backslash before a character that JSON does not escape".to_owned();
            // Its column is the last byte that was looked at.
            Wrong { at: (start + error.column()).saturating_sub(1).min(end), reason }
        })
    }

    fn number(&mut self) -> Result<Value, Wrong> {
        let start = self.at;
        let is_part = |c: char| c.is_ascii_digit() || matches!(c, '+' | '-' | '.' | 'e' | 'E');
        let rest = &self.text[start..];
        let text = &rest[..rest.find(|c| !is_part(c)).unwrap_or(rest.len())];
        self.at += text.len();
        Number::from_str(text).map(Value::Number).map_err(|_| {
            let reason = match text.parse().is_ok_and(f64::is_infinite) {
                true => "a number out of range: the largest is about 1.8e308".to_owned(),
                false => format!("{text} is no number as JSON writes it"),
            };
            Wrong { at: start, reason }
        })
    }

    fn word(&mut self, word: &str, value: Value) -> Result<Value, Wrong> {
        if !self.text[self.at..].starts_with(word) {
            let reason = "a word that JSON does not know; strings stand in quotes";
            return Err(Wrong { at: self.at, reason: reason.to_owned() });
        }
        self.at += word.len();
        Ok(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_knows_its_place() {
        let text = "{\n  \"a\": [1, {\"b\": \"}\\\"\"}],\n  \"é\": 2, \"x y\": {\"c\": null}\n}";
        let (document, _) = JsonDocument::parse(text.to_owned()).unwrap();
        let place = |path: &str| document.place(&path.into()).map(|p| (p.line, p.column));
        assert_eq!(place("a"), Some((2, 3)));
        assert_eq!(place("a[0]"), Some((2, 9)));
        assert_eq!(place("a[1].b"), Some((2, 13)));
        assert_eq!(place("é"), Some((3, 3)));
        assert_eq!(place("[\"x y\"].c"), Some((3, 19)), "columns count characters, not bytes");
        assert_eq!(place("b"), None);
    }

    #[test]
    fn broken_text_says_where() {
        let text = "{\n  \"fov\": 30\n  \"x\": 1\n}";
        let fault = JsonDocument::parse(text.to_owned()).unwrap_err();
        assert_eq!(fault.place, Place { line: 3, column: 3 });
        assert!(fault.reason.contains("expected `,` or `}`"), "{}", fault.reason);
        assert_eq!(excerpt(text, fault.place), "  3 |   \"x\": 1\n    |   ^");
        let end = JsonDocument::parse("{\"a\": ".to_owned()).unwrap_err();
        assert!(end.reason.contains("EOF"), "{}", end.reason);
        let wide = JsonDocument::parse("{\"é\": tru }".to_owned()).unwrap_err();
        assert_eq!(wide.place.line, 1);
        assert!(JsonDocument::parse(String::new()).is_err());
        let deep = "[".repeat(100_000);
        assert!(JsonDocument::parse(deep).unwrap_err().reason.contains("recursion"));
    }

    #[test]
    fn a_key_given_twice_is_refused() {
        let fault = JsonDocument::parse("{\"a\": {\"b\": 1,\n\"b\": 2}}".to_owned()).unwrap_err();
        assert_eq!(fault.place, Place { line: 2, column: 1 });
        assert!(fault.reason.contains("a.b"), "{}", fault.reason);
    }

    #[test]
    fn a_key_that_all_below_would_repeat_is_refused() {
        let text = |length: usize| format!("{{\"{}\": [1, 2, 3]}}", "k".repeat(length));
        let fault = JsonDocument::parse(text(1001)).unwrap_err();
        assert_eq!(fault.place, Place { line: 1, column: 2 });
        assert!(fault.reason.contains("1001 bytes"), "{}", fault.reason);
        assert!(JsonDocument::parse(text(1000)).is_ok());
    }

    #[test]
    fn a_long_line_is_shown_around_the_place() {
        let text = "x".repeat(5000);
        let shown = excerpt(&text, Place { line: 1, column: 3000 });
        assert!(shown.lines().all(|line| line.len() < 120), "{shown}");
        assert!(shown.ends_with('^'));
    }

    /// Checks that `text` is read as `serde_json` reads it: the independent reference.
    fn check_against_serde(text: &str) {
        match (serde_json::from_str::<Value>(text), JsonDocument::parse(text.to_owned())) {
            (Ok(theirs), Ok((_, ours))) => assert_eq!(ours, theirs, "{text}"),
            // What JSON leaves open and we do not.
            (Ok(_), Err(fault)) => {
                let is_ours = fault.reason.contains("a second time");
                assert!(is_ours, "{text}: {}", fault.reason);
            }
            (Err(_), Err(_)) => {}
            (Err(theirs), Ok(_)) => panic!("{text}: {theirs}"),
        }
    }

    #[test]
    fn texts_are_read_as_serde_json_reads_them() {
        let texts = [
            "-",
            "-0",
            "-0.0",
            "01",
            "1.",
            ".5",
            "1e",
            "1e+",
            "1e5",
            "1E-400",
            "1e400",
            "+1",
            "0x1",
            "18446744073709551615",
            "18446744073709551616",
            "-9223372036854775809",
            "123456789.125e-3",
            "nul",
            "nulll",
            "true1",
            "True",
            "NaN",
            "\"\\u00e9\\ud83d\\ude00\"",
            "\"\\ud83d\"",
            "\"\\x\"",
            "\"\\u12\"",
            "\"a\nb\"",
            "\"a\\\"",
            "\"\\\\\"",
            "[1,]",
            "[,]",
            "[1 2]",
            "{,}",
            "{\"a\":1,}",
            "{\"a\" 1}",
            "{a:1}",
            "{\"a\":}",
            "[]]",
            " [\t1\r\n] ",
            "\u{a0}1",
            "\u{feff}1",
            "1\u{0}",
            "",
            "{\"a\":{\"b\":[]},\"c\":[{},[[]]]}",
            "{\"\\u0061\":1,\"a\":2}",
        ];
        texts.iter().for_each(|text| check_against_serde(text));
        for levels in 126..=129 {
            check_against_serde(&("[".repeat(levels) + &"]".repeat(levels)));
            check_against_serde(&("{\"a\":".repeat(levels) + "1" + &"}".repeat(levels)));
        }
    }

    #[test]
    fn changed_texts_are_read_as_serde_json_reads_them() {
        let text = include_str!("../../../../scenes/mirror-lens.json");
        check_against_serde(text);
        let alphabet = b"{}[]:,\"\\ \n0123456789-+.eEtrufalsn";
        let mut state = 1_u64;
        // Numerical Recipes' generator (Press et al., 2007, section 7.1): the same changes in each run.
        let mut random = |below: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 33) as usize % below
        };
        for _ in 0..2000 {
            let mut bytes = text.as_bytes().to_vec();
            for _ in 0..=random(2) {
                let (at, byte) = (random(bytes.len()), alphabet[random(alphabet.len())]);
                match random(3) {
                    0 => bytes[at] = byte,
                    1 => bytes.insert(at, byte),
                    _ => drop(bytes.remove(at)),
                }
            }
            if let Ok(text) = String::from_utf8(bytes) {
                check_against_serde(&text);
            }
        }
    }
}
