//! What a schema allows, as a sentence says it.

use serde_json::Value;

use super::{Checker, show, words_for};

/// Words that are listed before the rest is left out.
const LISTED: usize = 40;

impl<'a> Checker<'a> {
    /// What would do where `schema` rules: ``1``, `an array of 3 numbers`, ``one of `a`, `b` ``;
    /// `None` for what takes too many words.
    pub(super) fn allowed(&self, schema: &'a Value) -> Option<String> {
        let schema = self.resolve(schema);
        if let Some(word) = schema.get("const") {
            return Some(quoted(word));
        }
        if let Some(words) = schema.get("enum").and_then(Value::as_array) {
            return Some(one_of(words.iter().filter(|word| !word.is_null())));
        }
        if let Some(unit) = schema.get("x-unit").and_then(Value::as_str) {
            return Some(format!("a number (in {unit}) or a string with its unit"));
        }
        let branches = schema.get("oneOf").or_else(|| schema.get("anyOf"));
        if let Some(branches) = branches.and_then(Value::as_array) {
            return self.allowed_by_any(branches);
        }
        let kinds = kinds_of(schema)?;
        match kinds[..] {
            ["array"] => Some(self.allowed_array(schema)),
            ["integer" | "number"] => Some(words_for(&kinds) + &range(schema)),
            [] => None,
            _ => Some(words_for(&kinds)),
        }
    }

    /// What several branches allow together.
    fn allowed_by_any(&self, branches: &'a [Value]) -> Option<String> {
        let branches: Vec<&Value> = branches.iter().map(|b| self.resolve(b)).collect();
        let is_null = |branch: &&&Value| kinds_of(branch).as_deref() == Some(&["null"]);
        let branches: Vec<&Value> = branches.iter().filter(|b| !is_null(b)).copied().collect();
        let words: Vec<&Value> = branches.iter().filter_map(|b| b.get("const")).collect();
        if !words.is_empty() && words.len() == branches.len() {
            return Some(one_of(words.into_iter()));
        }
        let tags = branches.iter().filter_map(|branch| {
            let members = branch.get("properties")?.as_object()?;
            members.iter().find_map(|(key, member)| Some((key, member.get("const")?)))
        });
        let tags: Vec<(&String, &Value)> = tags.collect();
        if let Some((key, _)) = tags.first().filter(|_| tags.len() == branches.len()) {
            let words = one_of(tags.iter().map(|(_, word)| *word));
            return Some(format!("an object whose `{key}` is {words}"));
        }
        let mut ways: Vec<String> = Vec::new();
        for way in branches.iter().filter_map(|branch| self.allowed(branch)) {
            if !ways.contains(&way) {
                ways.push(way);
            }
        }
        (!ways.is_empty()).then(|| ways.join(" or "))
    }

    fn allowed_array(&self, schema: &'a Value) -> String {
        let bound = |key: &str| schema.get(key).and_then(Value::as_u64);
        let items = schema.get("items").map(|items| self.resolve(items));
        let of = match items.and_then(kinds_of).as_deref() {
            Some(["number"]) => "numbers",
            Some(["integer"]) => "whole numbers",
            Some(["string"]) => "strings",
            Some(["array"]) => "arrays",
            Some(["object"]) => "objects",
            _ => "values",
        };
        match (bound("minItems"), bound("maxItems")) {
            (Some(least), Some(most)) if least == most => format!("an array of {least} {of}"),
            (Some(least), _) if least > 0 => format!("an array of at least {least} {of}"),
            _ => format!("an array of {of}"),
        }
    }
}

/// The kinds that a schema names itself, without the null of optional keys.
fn kinds_of(schema: &Value) -> Option<Vec<&str>> {
    match schema.get("type")? {
        Value::String(one) => Some(vec![one]),
        Value::Array(many) => {
            let kinds: Vec<&str> = many.iter().filter_map(Value::as_str).collect();
            Some(kinds.into_iter().filter(|kind| *kind != "null").collect())
        }
        _ => None,
    }
}

/// ` from 1 to 9`, where the schema has limits.
fn range(schema: &Value) -> String {
    let limit = |key: &str| schema.get(key).filter(|limit| limit.is_number());
    match (limit("minimum"), limit("maximum")) {
        (Some(least), Some(most)) => format!(" from {least} to {most}"),
        (Some(least), None) => format!(" from {least}"),
        (None, Some(most)) => format!(" up to {most}"),
        (None, None) => String::new(),
    }
}

fn one_of<'a>(words: impl Iterator<Item = &'a Value>) -> String {
    let words: Vec<String> = words.map(quoted).collect();
    let more = if words.len() > LISTED { ", …" } else { "" };
    format!("one of {}{more}", words[..words.len().min(LISTED)].join(", "))
}

fn quoted(word: &Value) -> String {
    word.as_str().map_or_else(|| word.to_string(), |word| format!("`{word}`"))
}

/// That `value` is not the only one allowed, and what makes it that one.
pub(super) fn not_the_one(value: &Value, expected: &Value) -> String {
    let remedy = match (value, expected.as_f64()) {
        (Value::Number(number), Some(expected)) if number.as_f64() == Some(expected) => {
            "write it without a point".to_owned()
        }
        (Value::String(text), Some(_)) if text.parse().ok().as_ref() == Some(expected) => {
            "write it without quotes".to_owned()
        }
        _ => format!("{} is all that this version reads", quoted(expected)),
    };
    format!("{} is not {expected}; {remedy}", show(value))
}

/// That `value` is of none of the kinds `expected`.
pub(super) fn wrong_kind(value: &Value, expected: &[&str]) -> String {
    let whole = value.as_f64().is_some_and(|number| number.fract() == 0.0 && number.abs() < 1e15);
    let hint = match expected.contains(&"integer") && value.is_f64() && whole {
        true => "; write it without a point",
        false => "",
    };
    format!("expected {}, found {}{hint}", words_for(expected), show(value))
}
