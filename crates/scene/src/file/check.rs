//! A scene's values against its own JSON Schema, so that what is wrong is named by its path.
//!
//! serde alone would do for correctness, but the choices by `type` tag are buffered inside it, and
//! with that it forgets where it was. The schema knows every key, so a typing error can be answered
//! with the key that was meant. Only the words of JSON Schema (2020-12) that our types produce are
//! understood.
//!
//! What a schema allows, as a sentence says it.

mod choice;

use serde_json::{Map, Value};

use super::path::ScenePath;
use crate::words::{kind_of, nearest, suggest};
use etendue_geometry::units::Dimension;
use etendue_optics::train::NOTES;

/// Problem with a value, and its place.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Problem {
    /// The value.
    pub(crate) path: ScenePath,
    /// Description of the error, and of what was expected.
    pub(crate) reason: String,
    /// The key at the end of the path is none that is known there.
    is_unknown_key: bool,
}

/// The first value of `value` that `schema` does not allow.
pub(crate) fn check(schema: &Value, value: &Value) -> Result<(), Problem> {
    let definitions = schema.get("$defs").and_then(Value::as_object);
    Checker { definitions }.visit(schema, value, &ScenePath::default())
}

struct Checker<'a> {
    definitions: Option<&'a Map<String, Value>>,
}

type Outcome = Result<(), Problem>;

fn problem(path: &ScenePath, reason: String) -> Outcome {
    Err(Problem { path: path.clone(), reason, is_unknown_key: false })
}

impl<'a> Checker<'a> {
    /// Follows references to the schema that says something.
    fn resolve(&self, mut schema: &'a Value) -> &'a Value {
        while let Some(name) = schema.get("$ref").and_then(Value::as_str) {
            let name = name.rsplit('/').next().unwrap_or_default();
            match self.definitions.and_then(|all| all.get(name)) {
                Some(next) => schema = next,
                None => break,
            }
        }
        schema
    }

    fn visit(&self, schema: &'a Value, value: &Value, path: &ScenePath) -> Outcome {
        let schema = self.resolve(schema);
        if let (Some(dimension), Some(text)) = (schema.get("x-quantity"), value.as_str()) {
            // Words that stand for a quantity, such as "infinity".
            let also = schema.get("x-also").and_then(Value::as_array);
            if also.is_some_and(|words| words.contains(value)) {
                return Ok(());
            }
            return self.quantity(schema, dimension, text, path);
        }
        for choice in ["oneOf", "anyOf"] {
            if let Some(branches) = schema.get(choice).and_then(Value::as_array) {
                self.choose(branches, value, path)?;
            }
        }
        if let Some(expected) = schema.get("const")
            && expected != value
        {
            return problem(path, not_the_one(value, expected));
        }
        if let Some(words) = schema.get("enum").and_then(Value::as_array)
            && !words.contains(value)
        {
            return Self::no_such_word(&words.iter().collect::<Vec<_>>(), value, path);
        }
        self.kind(schema, value, path)?;
        match value {
            Value::Object(members) => self.object(schema, members, path),
            Value::Array(elements) => self.array(schema, elements, path),
            Value::Number(_) => Self::range(schema, value, path),
            _ => Ok(()),
        }
    }

    fn quantity(&self, schema: &Value, dimension: &Value, text: &str, path: &ScenePath) -> Outcome {
        let dimension = dimension.as_str().and_then(Dimension::from_name);
        let unit = schema.get("x-unit").and_then(Value::as_str);
        match (dimension, unit) {
            (Some(dimension), Some(unit)) => match dimension.parse(text, unit) {
                Ok(_) => Ok(()),
                Err(error) => problem(path, error.to_string()),
            },
            _ => Ok(()),
        }
    }

    fn kind(&self, schema: &Value, value: &Value, path: &ScenePath) -> Outcome {
        let Some(expected) = schema.get("type") else { return Ok(()) };
        let expected: Vec<&str> = match expected {
            Value::String(one) => vec![one],
            Value::Array(many) => many.iter().filter_map(Value::as_str).collect(),
            _ => return Ok(()),
        };
        if expected.iter().any(|kind| is_kind(kind, value)) {
            return Ok(());
        }
        let wrong = wrong_kind(value, &expected);
        let hint = if wrong.contains("\nhint: ") { String::new() } else { number_hint(schema) };
        problem(path, wrong + &hint)
    }

    fn range(schema: &Value, value: &Value, path: &ScenePath) -> Outcome {
        let Some(number) = value.as_f64() else { return Ok(()) };
        let least = schema.get("minimum").and_then(Value::as_f64);
        let most = match schema.get("format").and_then(Value::as_str) {
            Some("uint32") => Some(f64::from(u32::MAX)),
            _ => None,
        };
        let most = schema.get("maximum").and_then(Value::as_f64).or(most);
        match (least, most) {
            (Some(least), _) if number < least => {
                problem(path, format!("{value} is below the least, {least}{}", number_hint(schema)))
            }
            (_, Some(most)) if number > most => {
                problem(path, format!("{value} is above the most, {most}{}", number_hint(schema)))
            }
            _ => Ok(()),
        }
    }

    fn array(&self, schema: &'a Value, elements: &[Value], path: &ScenePath) -> Outcome {
        let bound = |key: &str| schema.get(key).and_then(Value::as_u64);
        let len = elements.len() as u64;
        match (bound("minItems"), bound("maxItems")) {
            (Some(least), Some(most)) if least == most && len != least => {
                return problem(path, format!("expected {least} values, found {len}"));
            }
            (Some(least), _) if len < least => {
                return problem(path, format!("expected at least {least} values, found {len}"));
            }
            (_, Some(most)) if len > most => {
                return problem(path, format!("expected at most {most} values, found {len}"));
            }
            _ => {}
        }
        let Some(items) = schema.get("items").filter(|items| items.is_object()) else {
            return Ok(());
        };
        for (index, element) in elements.iter().enumerate() {
            self.visit(items, element, &path.index(index))?;
        }
        Ok(())
    }

    fn object(&self, schema: &'a Value, members: &Map<String, Value>, path: &ScenePath) -> Outcome {
        let known = schema.get("properties").and_then(Value::as_object);
        let others = schema.get("additionalProperties");
        for (key, member) in members {
            let inside = path.key(key);
            match (known.and_then(|known| known.get(key)), others) {
                (Some(schema), _) => self.visit(schema, member, &inside)?,
                (None, Some(Value::Bool(false))) => {
                    let reason = format!("unknown key{}", suggest(key, keys_of(schema)));
                    return Err(Problem { path: inside, reason, is_unknown_key: true });
                }
                (None, Some(schema @ Value::Object(_))) => self.visit(schema, member, &inside)?,
                (None, _) => {}
            }
        }
        let required = schema.get("required").and_then(Value::as_array);
        for key in required.into_iter().flatten().filter_map(Value::as_str) {
            if !members.contains_key(key) {
                return problem(path, self.missing(schema, key));
            }
        }
        Ok(())
    }

    /// That `key` is missing, what it is for, and what it may be.
    fn missing(&self, schema: &'a Value, key: &str) -> String {
        let member = schema.get("properties").and_then(|all| all.get(key));
        let about = member
            .and_then(|member| {
                member.get("description").or_else(|| self.resolve(member).get("description"))
            })
            .and_then(Value::as_str)
            .map(|text| text.replace('\n', " "));
        let about =
            about.map_or_else(String::new, |text| format!(": {}", text.trim_end_matches('.')));
        let allowed = member.and_then(|member| self.allowed(member));
        let allowed =
            allowed.map_or_else(String::new, |allowed| format!("\nhint: give it {allowed}"));
        format!("the key `{key}` is missing{about}{allowed}")
    }

    /// True if `value` is of a kind that `schema` takes at all.
    fn may_be(&self, schema: &'a Value, value: &Value) -> bool {
        let kinds = self.kinds(schema);
        kinds.is_empty() || kinds.iter().any(|kind| is_kind(kind, value))
    }

    /// The kinds of values that `schema` takes.
    fn kinds(&self, schema: &'a Value) -> Vec<&'a str> {
        let schema = self.resolve(schema);
        match schema.get("type") {
            Some(Value::String(one)) => return vec![one],
            Some(Value::Array(many)) => return many.iter().filter_map(Value::as_str).collect(),
            _ => {}
        }
        let branches = schema.get("oneOf").or_else(|| schema.get("anyOf"));
        let branches = branches.and_then(Value::as_array);
        branches.into_iter().flatten().flat_map(|branch| self.kinds(branch)).collect()
    }
}

/// The keys that the schema of an object knows, but for those of notes.
fn keys_of(schema: &Value) -> impl Iterator<Item = &str> {
    let keys = schema.get("properties").and_then(Value::as_object);
    let keys = keys.into_iter().flatten().map(|(key, _)| key.as_str());
    keys.filter(|key| !NOTES.contains(key))
}

fn is_kind(kind: &str, value: &Value) -> bool {
    match kind {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "integer" => value.is_u64() || value.is_i64(),
        "number" => value.is_number(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        _ => true,
    }
}

/// `a number or a string`, without the null that every optional key takes.
fn words_for(kinds: &[&str]) -> String {
    let mut words: Vec<&str> = Vec::new();
    for kind in kinds {
        let word = match *kind {
            "null" => continue,
            "boolean" => "true or false",
            "integer" => "a whole number",
            "number" => "a number",
            "string" => "a string",
            "array" => "an array",
            _ => "an object",
        };
        if !words.contains(&word) {
            words.push(word);
        }
    }
    words.join(" or ")
}

/// The value itself when it is short, else its kind.
fn show(value: &Value) -> String {
    let text = value.to_string();
    if text.chars().count() <= 40 { text } else { kind_of(value).to_owned() }
}

/// Words that are listed before the rest is left out.
const LISTED: usize = 40;

impl<'a> Checker<'a> {
    /// Words for what is valid where `schema` rules: ``1``, `an array of 3 numbers`, ``one of `a`,
    /// `b` ``; `None` for what takes too many words.
    fn allowed(&self, schema: &'a Value) -> Option<String> {
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

    /// Words for what several branches allow together.
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

/// The hint `give a number from 1 to 9, or leave it out for 5`, of a schema of numbers with limits or a value that stands
/// where none is given; nothing of any other.
fn number_hint(schema: &Value) -> String {
    if let Some(unit) = schema.get("x-unit").and_then(Value::as_str) {
        return format!("\nhint: give a number (in {unit}) or a string with its unit");
    }
    let noun = match kinds_of(schema).as_deref() {
        Some(["integer"]) => "a whole number",
        Some(["number"]) => "a number",
        _ => return String::new(),
    };
    let (range, default) = (range(schema), schema.get("default").and_then(plain));
    let default =
        default.map_or_else(String::new, |default| format!(", or leave it out for {default}"));
    match range.is_empty() && default.is_empty() {
        true => String::new(),
        false => format!("\nhint: give {noun}{range}{default}"),
    }
}

/// A number without a point that says nothing; `None` of what is none.
fn plain(number: &Value) -> Option<String> {
    let value = number.as_f64()?;
    let is_whole = value.fract() == 0.0 && value.abs() < 1e15;
    Some(if is_whole { format!("{value:.0}") } else { number.to_string() })
}

/// ` from 1 to 9`, where the schema has limits.
fn range(schema: &Value) -> String {
    let limit = |key: &str| schema.get(key).and_then(plain);
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
fn not_the_one(value: &Value, expected: &Value) -> String {
    let remedy = match (value, expected.as_f64()) {
        (Value::Number(number), Some(expected)) if number.as_f64() == Some(expected) => {
            "write it without a point".to_owned()
        }
        (Value::String(text), Some(_)) if text.parse().ok().as_ref() == Some(expected) => {
            "write it without quotes".to_owned()
        }
        _ => format!("{} is all that this version reads", quoted(expected)),
    };
    format!("{} is not {expected}\nhint: {remedy}", show(value))
}

/// That `value` is of none of the kinds `expected`.
fn wrong_kind(value: &Value, expected: &[&str]) -> String {
    let whole = value.as_f64().is_some_and(|number| number.fract() == 0.0 && number.abs() < 1e15);
    let hint = match expected.contains(&"integer") && value.is_f64() && whole {
        true => "\nhint: write it without a point",
        false => "",
    };
    format!("expected {}, found {}{hint}", words_for(expected), show(value))
}
