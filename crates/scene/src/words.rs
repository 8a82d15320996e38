//! The words of messages about values: what serde says of one, and what was probably meant.
//!
//! serde speaks of Rust's types (`expected usize`, `invalid type: map`); who wrote the file knows
//! JSON's.

use std::fmt::Display;

use serde_json::Value;

/// The longest value that a message repeats (characters).
const LONGEST: usize = 40;

/// `error` without its place in the text and without the names of Rust's types.
pub(crate) fn plain(error: &impl Display) -> String {
    let text = error.to_string();
    // serde_json puts the place behind its sentence; ours stands in front.
    let text = text.rsplit_once(" at line ").map_or(text.as_str(), |(head, _)| head);
    for start in ["invalid type: ", "invalid value: ", "invalid length "] {
        let Some((found, expected)) =
            text.strip_prefix(start).and_then(|rest| rest.rsplit_once(", expected "))
        else {
            continue;
        };
        let found = match start {
            "invalid length " => format!("{found} values"),
            _ => value(found),
        };
        return format!("expected {}, found {found}", kind(expected));
    }
    choice(text, "unknown variant ", "is not known here")
        .or_else(|| choice(text, "unknown field ", "is an unknown key"))
        .or_else(|| key(text, "missing field ", "is missing"))
        .or_else(|| key(text, "duplicate field ", "stands here twice"))
        .unwrap_or_else(|| syntax(text))
}

/// What a value is, as a sentence says it.
pub(crate) fn kind_of(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "true or false",
        Value::Number(_) => "a number",
        Value::String(_) => "a string",
        Value::Array(_) => "an array",
        Value::Object(_) => "an object",
    }
}

/// The hint `did you mean …? known: …`, with the nearest of `known` when one is near.
pub(crate) fn suggest<'a>(wrong: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let mut known: Vec<&str> = known.into_iter().collect();
    known.sort_unstable();
    known.dedup();
    let listed: Vec<String> = known.iter().take(40).map(|k| format!("`{k}`")).collect();
    let all = match listed.len() {
        0 => return String::new(),
        n if n < known.len() => format!("known: {}, …", listed.join(", ")),
        _ => format!("known: {}", listed.join(", ")),
    };
    match nearest(wrong, known) {
        Some(near) => format!("\nhint: did you mean `{near}`? {all}"),
        None => format!("\nhint: {all}"),
    }
}

/// The word that was probably meant.
pub(crate) fn nearest<'a>(
    wrong: &str,
    known: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    // Nobody mistypes a word of that length, and comparing takes its time.
    if wrong.len() > 200 {
        return None;
    }
    let wrong = wrong.to_lowercase();
    let distance = |word: &str| strsim::damerau_levenshtein(&wrong, &word.to_lowercase());
    let best = known.into_iter().min_by_key(|word| distance(word))?;
    // A third of the letters may be wrong: `colour`, `resoluton`, `focus_distnace`.
    (distance(best) * 3 <= wrong.chars().count().max(best.chars().count()).max(3)).then_some(best)
}

/// What was found.
fn value(found: &str) -> String {
    let bare = found.split_once('`').and_then(|(_, rest)| rest.strip_suffix('`'));
    let shown = match (found, found.strip_prefix("string "), bare) {
        ("map", ..) => "an object",
        ("sequence", ..) => "an array",
        ("unit value", ..) => "null",
        (_, Some(text), _) | (_, None, Some(text)) => text,
        _ => found,
    };
    match shown.chars().count() {
        0..=LONGEST => shown.to_owned(),
        _ => "a long string".to_owned(),
    }
}

/// What would do.
fn kind(expected: &str) -> String {
    let count = |prefix: &str| expected.strip_prefix(prefix);
    if let Some(n) = count("an array of length ").or_else(|| count("a tuple of size ")) {
        return format!("an array of {n} values");
    }
    if let Some(words) = count("any of: [").and_then(|words| words.strip_suffix(']')) {
        return format!("one of {words}");
    }
    let word = expected.split(' ').next().unwrap_or_default();
    match (expected, word) {
        ("usize" | "u8" | "u16" | "u32" | "u64" | "index into child of root", _) => {
            "a whole number from 0"
        }
        ("isize" | "i8" | "i16" | "i32" | "i64", _) => "a whole number",
        ("f32" | "f64", _) => "a number",
        ("a sequence", _) => "an array",
        ("a map", _) | (_, "struct") => "an object",
        ("a boolean", _) => "true or false",
        ("unit", _) => "null",
        (_, "tuple") => "an array",
        (_, "variant") | (_, "enum") => "a word",
        _ => expected,
    }
    .to_owned()
}

/// ``unknown variant `x`, expected one of `a`, `b` ``, with the nearest.
fn choice(text: &str, start: &str, what: &str) -> Option<String> {
    let (given, rest) = text.strip_prefix(start)?.strip_prefix('`')?.split_once('`')?;
    let known: Vec<&str> = rest.split('`').skip(1).step_by(2).collect();
    Some(format!("\"{given}\" {what}{}", suggest(given, known)))
}

fn key(text: &str, start: &str, what: &str) -> Option<String> {
    let name = text.strip_prefix(start)?;
    Some(format!("the key {name} {what}"))
}

/// What is wrong with a text that is no JSON.
fn syntax(text: &str) -> String {
    let end = text.strip_prefix("EOF while parsing ").map(|inside| {
        let inside = match inside {
            "an object" | "a string" => inside,
            "a list" => "an array",
            _ => "a value",
        };
        format!("the text ends inside {inside} (EOF)")
    });
    let words = match text {
        "expected value" => {
            "a value should stand here: a string in quotes, a number, true, false, null, [ or {"
        }
        "expected ident" => "a word that JSON does not know; strings stand in quotes",
        "key must be a string" => "a key in double quotes should stand here",
        "trailing comma" => "a comma with nothing behind it",
        "trailing characters" => "the document has ended, but text goes on",
        "recursion limit exceeded" => "nested too deeply (recursion limit: 128)",
        "invalid escape" => "a backslash before a character that JSON does not escape",
        "number out of range" => "a number out of range: the largest is about 1.8e308",
        other => other,
    };
    end.unwrap_or_else(|| words.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;
    use serde::de::DeserializeOwned;

    #[derive(Debug, Deserialize)]
    struct Inner {
        #[serde(rename = "count")]
        _count: usize,
    }

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "snake_case")]
    enum Word {
        Sphere,
        Box,
    }

    fn said<T: DeserializeOwned + std::fmt::Debug>(text: &str) -> String {
        plain(&serde_json::from_str::<T>(text).unwrap_err())
    }

    #[test]
    fn no_type_of_rust_is_named() {
        assert_eq!(said::<usize>("-1"), "expected a whole number from 0, found -1");
        assert_eq!(said::<u32>("1.5"), "expected a whole number from 0, found 1.5");
        assert_eq!(said::<f64>("\"x, expected y\""), "expected a number, found \"x, expected y\"");
        assert_eq!(said::<[f64; 4]>("{}"), "expected an array of 4 values, found an object");
        assert_eq!(said::<[f64; 4]>("[1, 2]"), "expected an array of 4 values, found 2 values");
        assert_eq!(said::<(f64, f64)>("3"), "expected an array of 2 values, found 3");
        assert_eq!(said::<Vec<f64>>("true"), "expected an array, found true");
        assert_eq!(said::<String>("null"), "expected a string, found null");
        assert_eq!(said::<Inner>("7"), "expected an object, found 7");
        assert_eq!(said::<Inner>("{}"), "the key `count` is missing");
        let long = format!("\"{}\"", "x".repeat(1000));
        assert_eq!(said::<u8>(&long), "expected a whole number from 0, found a long string");
        let word = said::<Word>("\"shpere\"");
        assert!(
            word.starts_with("\"shpere\" is not known here\nhint: did you mean `sphere`?"),
            "{word}"
        );
        assert!(word.contains("`box`"), "{word}");
    }

    #[test]
    fn broken_texts_are_told_in_plain_words() {
        assert_eq!(said::<Inner>("{\"count\": "), "the text ends inside a value (EOF)");
        assert_eq!(said::<Inner>("{\"count\": 1"), "the text ends inside an object (EOF)");
        assert!(said::<Inner>("{\"count\": .5}").starts_with("a value should stand here"));
        assert_eq!(said::<Inner>("{\"count\": 1} x"), "the document has ended, but text goes on");
    }
}
