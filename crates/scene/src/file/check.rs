//! A scene's values against its own JSON Schema, so that what is wrong is named by its path.
//!
//! serde alone would do for correctness, but the choices by `type` tag are buffered inside it, and
//! with that it forgets where it was. The schema knows every key, so a typing error can be answered
//! with the key that was meant. Only the words of JSON Schema (2020-12) that our types produce are
//! understood.

mod allowed;
mod choice;

use etendue_geometry::units::Dimension;
use etendue_optics::train::NOTES;
use serde_json::{Map, Value};

use super::document::{join, join_index};

/// What is wrong, and where.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Problem {
    /// The JSON path; empty for the whole file.
    pub(crate) path: String,
    /// What is wrong, what was expected.
    pub(crate) reason: String,
}

/// The first value of `value` that `schema` does not allow.
pub(crate) fn check(schema: &Value, value: &Value) -> Result<(), Problem> {
    let definitions = schema.get("$defs").and_then(Value::as_object);
    Checker { definitions }.visit(schema, value, "")
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

/// `; did you mean …? known: …`, with the nearest of `known` when one is near.
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
        Some(near) => format!("; did you mean `{near}`? {all}"),
        None => format!("; {all}"),
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

struct Checker<'a> {
    definitions: Option<&'a Map<String, Value>>,
}

type Outcome = Result<(), Problem>;

fn problem(path: &str, reason: String) -> Outcome {
    Err(Problem { path: path.to_owned(), reason })
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

    fn visit(&self, schema: &'a Value, value: &Value, path: &str) -> Outcome {
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
            return problem(path, allowed::not_the_one(value, expected));
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

    fn quantity(&self, schema: &Value, dimension: &Value, text: &str, path: &str) -> Outcome {
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

    fn kind(&self, schema: &Value, value: &Value, path: &str) -> Outcome {
        let Some(expected) = schema.get("type") else { return Ok(()) };
        let expected: Vec<&str> = match expected {
            Value::String(one) => vec![one],
            Value::Array(many) => many.iter().filter_map(Value::as_str).collect(),
            _ => return Ok(()),
        };
        if expected.iter().any(|kind| is_kind(kind, value)) {
            return Ok(());
        }
        problem(path, allowed::wrong_kind(value, &expected))
    }

    fn range(schema: &Value, value: &Value, path: &str) -> Outcome {
        let Some(number) = value.as_f64() else { return Ok(()) };
        let least = schema.get("minimum").and_then(Value::as_f64);
        let most = match schema.get("format").and_then(Value::as_str) {
            Some("uint32") => Some(f64::from(u32::MAX)),
            _ => None,
        };
        let most = schema.get("maximum").and_then(Value::as_f64).or(most);
        match (least, most) {
            (Some(least), _) if number < least => {
                problem(path, format!("{value} is below the least, {least}"))
            }
            (_, Some(most)) if number > most => {
                problem(path, format!("{value} is above the most, {most}"))
            }
            _ => Ok(()),
        }
    }

    fn array(&self, schema: &'a Value, elements: &[Value], path: &str) -> Outcome {
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
            self.visit(items, element, &join_index(path, index))?;
        }
        Ok(())
    }

    fn object(&self, schema: &'a Value, members: &Map<String, Value>, path: &str) -> Outcome {
        let known = schema.get("properties").and_then(Value::as_object);
        let others = schema.get("additionalProperties");
        for (key, member) in members {
            let inside = join(path, key);
            match (known.and_then(|known| known.get(key)), others) {
                (Some(schema), _) => self.visit(schema, member, &inside)?,
                (None, Some(Value::Bool(false))) => {
                    let keys = known.into_iter().flatten().map(|(key, _)| key.as_str());
                    let keys = keys.filter(|key| !NOTES.contains(key));
                    return problem(&inside, format!("unknown key{}", suggest(key, keys)));
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
        let allowed = allowed.map_or_else(String::new, |allowed| format!("; give it {allowed}"));
        format!("the key `{key}` is missing{about}{allowed}")
    }

    /// Whether `value` is of a kind that `schema` takes at all.
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
