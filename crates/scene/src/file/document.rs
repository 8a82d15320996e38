//! A JSON text, its values, and where in the text each of them stands.
//!
//! `--set camera.fov=30`: single values of a scene file, changed from the command line.

use std::collections::HashSet;

use serde_json::{Map, Value};

use crate::words::{kind_of, plain};

/// A place in a text, both counted from 1; the column in characters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// The line.
    pub line: usize,
    /// The column.
    pub column: usize,
}

/// Why a text is no JSON document for us.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Fault {
    pub(crate) place: Place,
    pub(crate) reason: String,
}

/// The longest key (bytes). Keys stand in the paths of all that is below them.
const LONGEST_KEY: usize = 1000;

/// A parsed text, without its values.
#[derive(Debug, Clone)]
pub(crate) struct Document {
    text: String,
}

impl Document {
    /// Parses `text` into the document and its values; refused when it is not JSON, or an object
    /// has a key twice.
    pub(crate) fn parse(text: String) -> Result<(Self, Value), Fault> {
        let value: Value = serde_json::from_str(&text).map_err(|error| {
            let place = character_place(&text, error.line(), error.column());
            Fault { place, reason: plain(&error) }
        })?;
        let mut scanner = Scanner { text: &text, at: 0, wanted: None, found: None };
        if let Err(Wrong { at, reason }) = scanner.value("") {
            return Err(Fault { place: place_of(&text, at), reason });
        }
        Ok((Self { text }, value))
    }

    /// Where the value at `path` stands in the text.
    pub(crate) fn place(&self, path: &str) -> Option<Place> {
        let mut scanner = Scanner { text: &self.text, at: 0, wanted: Some(path), found: None };
        // The text was walked through before, so nothing is wrong with it.
        let _ = scanner.value("");
        scanner.found.map(|at| place_of(&self.text, at))
    }
}

/// A JSON path one step longer: `objects[2]` and `transform` give `objects[2].transform`.
pub(crate) fn join(path: &str, key: &str) -> String {
    let plain = !key.is_empty() && key.chars().all(|c| c.is_alphanumeric() || c == '_' || c == '-');
    match (path.is_empty(), plain) {
        (true, true) => key.to_owned(),
        (false, true) => format!("{path}.{key}"),
        (_, false) => format!("{path}[{key:?}]"),
    }
}

/// A JSON path one step longer, into an array.
pub(crate) fn join_index(path: &str, index: usize) -> String {
    format!("{path}[{index}]")
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

/// The place of `serde_json`'s line and byte column.
fn character_place(text: &str, line: usize, column: usize) -> Place {
    let content = text.split('\n').nth(line.saturating_sub(1)).unwrap_or_default();
    let mut end = column.saturating_sub(1).min(content.len());
    while !content.is_char_boundary(end) {
        end -= 1;
    }
    Place { line: line.max(1), column: content[..end].chars().count() + 1 }
}

fn place_of(text: &str, at: usize) -> Place {
    let before = text.get(..at).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |i| i + 1);
    Place {
        line: before.matches('\n').count() + 1,
        column: before[line_start..].chars().count() + 1,
    }
}

/// Walks over a text that is known to be JSON.
struct Scanner<'a> {
    text: &'a str,
    at: usize,
    /// The path to look for; without one, keys are checked.
    wanted: Option<&'a str>,
    /// The byte where the wanted value's key (or the value, in an array) starts.
    found: Option<usize>,
}

/// A key that may not be there: its byte, and why.
struct Wrong {
    at: usize,
    reason: String,
}

impl Scanner<'_> {
    fn peek(&mut self) -> u8 {
        let bytes = self.text.as_bytes();
        while bytes.get(self.at).is_some_and(u8::is_ascii_whitespace) {
            self.at += 1;
        }
        bytes.get(self.at).copied().unwrap_or(b'\0')
    }

    fn value(&mut self, path: &str) -> Result<(), Wrong> {
        match self.peek() {
            b'{' => self.object(path),
            b'[' => self.array(path),
            b'"' => {
                self.string();
                Ok(())
            }
            _ => {
                let rest = &self.text[self.at..];
                let end = rest.find([',', ']', '}']).unwrap_or(rest.len());
                self.at += end;
                Ok(())
            }
        }
    }

    fn object(&mut self, path: &str) -> Result<(), Wrong> {
        self.at += 1;
        let mut keys = HashSet::new();
        while self.peek() != b'}' && self.at < self.text.len() {
            if self.peek() == b',' {
                self.at += 1;
                continue;
            }
            let start = self.at;
            let key = self.string();
            let member = self.step(start, || join(path, &key));
            // Keys that stand twice, or are too long to be shown.
            if self.wanted.is_none() {
                let wrong = |reason| Wrong { at: start, reason };
                if key.len() > LONGEST_KEY {
                    let long = key.len();
                    return Err(wrong(format!("a key of {long} bytes; {LONGEST_KEY} is the most")));
                }
                if keys.contains(&key) {
                    let member = join(path, &key);
                    let reason = format!(
                        "the key {member} stands here a second time\nhint: remove one of them"
                    );
                    return Err(wrong(reason));
                }
                keys.insert(key);
            }
            if self.peek() == b':' {
                self.at += 1;
            }
            self.value(&member)?;
        }
        self.at += 1;
        Ok(())
    }

    fn array(&mut self, path: &str) -> Result<(), Wrong> {
        self.at += 1;
        let mut index = 0;
        while self.peek() != b']' && self.at < self.text.len() {
            if self.peek() == b',' {
                self.at += 1;
                continue;
            }
            let element = self.step(self.at, || join_index(path, index));
            self.value(&element)?;
            index += 1;
        }
        self.at += 1;
        Ok(())
    }

    /// The path of the value that starts at byte `at`.
    fn step(&mut self, at: usize, path: impl FnOnce() -> String) -> String {
        let path = path();
        if self.wanted == Some(&*path) {
            self.found.get_or_insert(at);
        }
        path
    }

    /// Passes over a string and gives what it says.
    fn string(&mut self) -> String {
        let start = self.at;
        self.at += 1;
        let bytes = self.text.as_bytes();
        while let Some(&byte) = bytes.get(self.at) {
            self.at += if byte == b'\\' { 2 } else { 1 };
            if byte == b'"' {
                break;
            }
        }
        let raw = self.text.get(start..self.at).unwrap_or_default();
        serde_json::from_str(raw).unwrap_or_else(|_| raw.to_owned())
    }
}

/// The most steps of a path: half as many as the levels of a JSON text.
const MOST_STEPS: usize = 64;

/// Why a setting cannot be applied.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OverrideError {
    /// The path cannot be read.
    #[error(
        "`{path}` is no path\nhint: write keys with dots between and indices in brackets, such as \
             objects[0].transform.scale"
    )]
    Path {
        /// The path as given.
        path: String,
    },
    /// More steps than a scene has levels.
    #[error("the path has {steps} steps; the format needs no more than {MOST_STEPS}")]
    TooDeep {
        /// Its steps.
        steps: usize,
    },
    /// An index past the end.
    #[error("{array} has {len} entries, so there is no {array}[{index}]")]
    Index {
        /// The array's path.
        array: String,
        /// Its length.
        len: usize,
        /// The index asked for.
        index: String,
    },
    /// A number that 64 bits do not hold.
    #[error("{text} is beyond the numbers that a computer holds (1.8e308)")]
    TooLarge {
        /// The number as given.
        text: String,
    },
    /// JSON that no scene file may hold.
    #[error("{reason}")]
    Refused {
        /// Why.
        reason: String,
    },
    /// A value on the way that has nothing inside.
    #[error("{parent} is {found}, which has no `{step}`")]
    Leaf {
        /// The value's path.
        parent: String,
        /// What it is.
        found: &'static str,
        /// The step asked for.
        step: String,
    },
}

/// Sets `path` of `root` to `text`: JSON when it is JSON, else a string. Objects on the way that
/// are missing are made. Returns the path as messages write it.
///
/// # Errors
///
/// When the path cannot be read or leads nowhere.
pub(crate) fn apply(root: &mut Value, path: &str, text: &str) -> Result<String, OverrideError> {
    let steps = split(path).ok_or_else(|| OverrideError::Path { path: path.to_owned() })?;
    if steps.len() > MOST_STEPS {
        return Err(OverrideError::TooDeep { steps: steps.len() });
    }
    // From the root along the steps; missing objects are made.
    let mut here = root;
    let mut walked = String::new();
    for step in &steps {
        let parent = if walked.is_empty() { "the scene".to_owned() } else { walked.clone() };
        if here.is_null() {
            *here = Value::Object(Map::new());
        }
        here = match here {
            Value::Object(members) => {
                walked = join(&walked, step);
                members.entry(step.clone()).or_insert(Value::Null)
            }
            Value::Array(elements) => {
                let len = elements.len();
                let index = step.parse::<usize>().ok().filter(|&index| index < len);
                let Some(index) = index else {
                    let index = step.clone();
                    return Err(OverrideError::Index { array: parent, len, index });
                };
                walked = join_index(&walked, index);
                &mut elements[index]
            }
            leaf => {
                let found = kind_of(leaf);
                return Err(OverrideError::Leaf { parent, found, step: step.clone() });
            }
        };
    }
    // JSON where it reads as such, else a string.
    let is_number = text.trim_start().starts_with(|c: char| c.is_ascii_digit() || c == '-');
    *here = match serde_json::from_str::<Value>(text) {
        // As strictly as files are read.
        Ok(_) => match Document::parse(text.to_owned()) {
            Ok((_, value)) => value,
            Err(fault) => return Err(OverrideError::Refused { reason: fault.reason }),
        },
        Err(_) if is_number && text.trim().parse().is_ok_and(f64::is_infinite) => {
            return Err(OverrideError::TooLarge { text: text.trim().to_owned() });
        }
        Err(_) => Value::String(text.to_owned()),
    };
    Ok(walked)
}

/// The steps of `a.b[0]["c.d"]`; `None` when it is no path.
fn split(path: &str) -> Option<Vec<String>> {
    let mut steps = Vec::new();
    let mut rest = path;
    while !rest.is_empty() {
        if let Some(inside) = rest.strip_prefix('[') {
            let (step, tail) = if inside.starts_with('"') {
                let mut strings = serde_json::Deserializer::from_str(inside).into_iter::<String>();
                let step = strings.next()?.ok()?;
                (step, &inside[strings.byte_offset()..])
            } else {
                let end = inside.find(']')?;
                inside[..end].parse::<usize>().ok()?;
                (inside[..end].to_owned(), &inside[end..])
            };
            steps.push(step);
            rest = tail.strip_prefix(']')?;
        } else {
            let rest_of_key = if steps.is_empty() { rest } else { rest.strip_prefix('.')? };
            let end = rest_of_key.find(['.', '[']).unwrap_or(rest_of_key.len());
            if end == 0 {
                return None;
            }
            steps.push(rest_of_key[..end].to_owned());
            rest = &rest_of_key[end..];
        }
    }
    (!steps.is_empty()).then_some(steps)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn every_value_knows_its_place() {
        let text = "{\n  \"a\": [1, {\"b\": \"}\\\"\"}],\n  \"é\": 2, \"x y\": {\"c\": null}\n}";
        let (document, _) = Document::parse(text.to_owned()).unwrap();
        let place = |path| document.place(path).map(|p| (p.line, p.column));
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
        let fault = Document::parse(text.to_owned()).unwrap_err();
        assert_eq!(fault.place, Place { line: 3, column: 3 });
        assert!(fault.reason.contains("expected `,` or `}`"), "{}", fault.reason);
        assert_eq!(excerpt(text, fault.place), "  3 |   \"x\": 1\n    |   ^");
        let end = Document::parse("{\"a\": ".to_owned()).unwrap_err();
        assert!(end.reason.contains("EOF"), "{}", end.reason);
        let wide = Document::parse("{\"é\": tru }".to_owned()).unwrap_err();
        assert_eq!(wide.place.line, 1);
        assert!(Document::parse(String::new()).is_err());
        let deep = "[".repeat(100_000);
        assert!(Document::parse(deep).unwrap_err().reason.contains("recursion"));
    }

    #[test]
    fn a_key_given_twice_is_refused() {
        let fault = Document::parse("{\"a\": {\"b\": 1,\n\"b\": 2}}".to_owned()).unwrap_err();
        assert_eq!(fault.place, Place { line: 2, column: 1 });
        assert!(fault.reason.contains("a.b"), "{}", fault.reason);
    }

    #[test]
    fn a_key_that_all_below_would_repeat_is_refused() {
        let text = |length: usize| format!("{{\"{}\": [1, 2, 3]}}", "k".repeat(length));
        let fault = Document::parse(text(1001)).unwrap_err();
        assert_eq!(fault.place, Place { line: 1, column: 2 });
        assert!(fault.reason.contains("1001 bytes"), "{}", fault.reason);
        assert!(Document::parse(text(1000)).is_ok());
    }

    #[test]
    fn a_long_line_is_shown_around_the_place() {
        let text = "x".repeat(5000);
        let shown = excerpt(&text, Place { line: 1, column: 3000 });
        assert!(shown.lines().all(|line| line.len() < 120), "{shown}");
        assert!(shown.ends_with('^'));
    }

    fn set(path: &str, text: &str) -> Result<Value, String> {
        let mut scene = json!({
            "camera": {"fov": 40, "type": "pinhole"},
            "objects": [{"file": "a.obj"}, {"file": "b.obj"}],
            "materials": {"a.b": {"type": "matte"}}
        });
        apply(&mut scene, path, text).map_err(|error| error.to_string())?;
        Ok(scene)
    }

    #[test]
    fn values_are_json_or_bare_strings() {
        assert_eq!(set("camera.fov", "30.5").unwrap()["camera"]["fov"], json!(30.5));
        assert_eq!(set("camera.fov", "50 deg").unwrap()["camera"]["fov"], json!("50 deg"));
        assert_eq!(set("camera.type", "orthographic").unwrap()["camera"]["type"], "orthographic");
        assert_eq!(set("layers", "[\"depth\"]").unwrap()["layers"], json!(["depth"]));
    }

    #[test]
    fn paths_reach_arrays_and_make_objects() {
        assert_eq!(set("objects[1].file", "c.obj").unwrap()["objects"][1]["file"], "c.obj");
        assert_eq!(set("objects.0.file", "c.obj").unwrap()["objects"][0]["file"], "c.obj");
        let made = set("camera.sensor.resolution", "[4, 3]").unwrap();
        assert_eq!(made["camera"]["sensor"], json!({"resolution": [4, 3]}));
        let dotted = set("materials[\"a.b\"].type", "checker").unwrap();
        assert_eq!(dotted["materials"]["a.b"]["type"], "checker");
    }

    #[test]
    fn paths_that_lead_nowhere_are_refused() {
        let error = |path: &str| set(path, "1").unwrap_err();
        assert_eq!(error("objects[2].file"), "objects has 2 entries, so there is no objects[2]");
        assert!(error("objects.first").contains("no objects[first]"));
        assert_eq!(error("camera.fov.x"), "camera.fov is a number, which has no `x`");
        assert!(error("a.".repeat(60_000).trim_end_matches('.')).contains("60000 steps"));
        for path in ["", ".", "a..b", "a.", "a[", "a[x]", "a[0]b", "[\"a\"", ".a"] {
            assert!(error(path).contains("is no path"), "{path}: {}", error(path));
        }
    }
}
