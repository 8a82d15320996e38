//! JSON as Python writes it, with words for infinite numbers and for none, and the numbers in it.

use serde_json::Value;

/// The most numbers of a list.
const MOST_TERMS: usize = 10_000;

/// Python's words for infinite numbers and for none as texts.
pub(super) fn as_json(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let (mut quoted, mut escaped) = (false, false);
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let word = ["-Infinity", "Infinity", "NaN"]
            .into_iter()
            .find(|word| !quoted && rest.starts_with(word));
        if let Some(word) = word {
            out.extend(['"'].into_iter().chain(word.chars()).chain(['"']));
            rest = &rest[word.len()..];
            continue;
        }
        match c {
            '"' if !escaped => quoted = !quoted,
            _ => {}
        }
        escaped = quoted && c == '\\' && !escaped;
        out.push(c);
        rest = &rest[c.len_utf8()..];
    }
    out
}

/// A number, infinite ones too, also as the only one of a list.
pub(super) fn number(value: &Value) -> Option<f64> {
    match value {
        Value::String(word) if word == "Infinity" => Some(f64::INFINITY),
        Value::String(word) if word == "-Infinity" => Some(f64::NEG_INFINITY),
        Value::Array(list) => match &list[..] {
            [one] if !one.is_array() => number(one),
            _ => None,
        },
        value => value.as_f64(),
    }
}

/// The finite number of a key, or 0 where it is missing.
pub(super) fn finite(value: &Value, key: &str) -> Result<f64, String> {
    match &value[key] {
        Value::Null => Ok(0.0),
        written => number(written)
            .filter(|number| number.is_finite())
            .ok_or_else(|| format!("{key}: expected a finite number")),
    }
}

pub(super) fn list(value: &Value, key: &str) -> Result<Vec<f64>, String> {
    let error = || format!("{key}: expected a list of finite numbers");
    let list = match &value[key] {
        Value::Null => return Ok(Vec::new()),
        written => written.as_array().ok_or_else(error)?,
    };
    if list.len() > MOST_TERMS {
        return Err(format!("{key}: more than {MOST_TERMS} numbers"));
    }
    let finite =
        |value: &Value| number(value).filter(|number| number.is_finite()).ok_or_else(error);
    list.iter().map(finite).collect()
}
