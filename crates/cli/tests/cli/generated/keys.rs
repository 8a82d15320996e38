//! `docs/reference/keys.md`: the keys of all files, as tables, from their JSON Schemas.

use std::fmt::Write as _;

use serde_json::{Map, Value};

const HEAD: &str = "\
# Keys

Every key of scene files, lens files and files of rays, with its values and its default: what the JSON Schemas in
[`schema/`](../../schema) say, as tables. [scene-format.md](scene-format.md), [lens-files.md](lens-files.md) and
[sensors.md](sensors.md) explain. Written by `make generated`.

In every object, `\"$schema\"` and `\"comment\"` are allowed, too.
";

/// Keys that are allowed everywhere and mean nothing.
const NOTES: [&str; 2] = ["$schema", "comment"];

/// The page of three schemas. A definition of several is shown with the first that has it.
pub(super) fn page(scene: &Value, lens: &Value, rays: &Value) -> String {
    let mut page = HEAD.to_owned();
    let mut shown: Vec<&str> = Vec::new();
    for (title, schema) in [("Scene files", scene), ("Lens files", lens), ("Files of rays", rays)] {
        let _ = write!(page, "\n## {title}\n");
        section(&mut page, schema);
        for (name, definition) in members(schema, "$defs") {
            if !shown.contains(&name.as_str()) {
                shown.push(name);
                let _ = write!(page, "\n### {name}\n");
                section(&mut page, definition);
            }
        }
    }
    page
}

fn members<'a>(schema: &'a Value, key: &str) -> impl Iterator<Item = (&'a String, &'a Value)> {
    schema.get(key).and_then(Value::as_object).into_iter().flatten()
}

fn list<'a>(schema: &'a Value, key: &str) -> &'a [Value] {
    schema.get(key).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

/// Writes the section of a schema: its sentence, and a table of its keys, words or alternatives.
fn section(page: &mut String, schema: &Value) {
    if let Some(words) = description(schema) {
        let _ = write!(page, "\n{words}\n");
    }
    if schema.get("properties").is_some() {
        keys(page, schema);
        return;
    }
    let branches = [list(schema, "oneOf"), list(schema, "anyOf")].concat();
    let (objects, values): (Vec<Value>, Vec<Value>) =
        branches.into_iter().partition(|branch| branch.get("properties").is_some());
    if !values.is_empty() {
        page.push_str("\n| value | what it is |\n|---|---|\n");
        for value in &values {
            let words = description(value).unwrap_or_default();
            let _ = writeln!(page, "| {} | {} |", kind(value), cell(&words));
        }
    } else if objects.is_empty() {
        let _ = write!(page, "\n{}\n", kind(schema));
    }
    for object in &objects {
        // Of one word, the branch's kind; else the keys that tell it from the others.
        let tag = members(object, "properties")
            .find_map(|(key, value)| value.get("const").map(|word| format!("`\"{key}\": {word}`")));
        let tag = tag.unwrap_or_else(|| {
            let keys: Vec<String> = list(object, "required")
                .iter()
                .filter_map(Value::as_str)
                .map(|key| format!("`{key}`"))
                .collect();
            if keys.is_empty() {
                "An object".to_owned()
            } else {
                format!("With {}", keys.join(", "))
            }
        });
        let _ = write!(page, "\n#### {tag}\n");
        section(page, object);
    }
}

fn keys(page: &mut String, schema: &Value) {
    let required = list(schema, "required");
    let rows: Vec<_> = members(schema, "properties")
        .filter(|(key, value)| !NOTES.contains(&key.as_str()) && value.get("const").is_none())
        .collect();
    if rows.is_empty() {
        return;
    }
    page.push_str("\n| key | value | default | what it is |\n|---|---|---|---|\n");
    for (key, value) in rows {
        let default = match value.get("default") {
            _ if required.contains(&Value::from(key.as_str())) => "required".to_owned(),
            None | Some(Value::Null) => String::new(),
            Some(default) => code(default),
        };
        let words = description(value).unwrap_or_default();
        let _ = writeln!(page, "| `{key}` | {} | {default} | {} |", kind(value), cell(&words));
    }
}

/// A description without its line ends, and with the program's own links as words.
fn description(schema: &Value) -> Option<String> {
    let words = schema.get("description")?.as_str()?.split_whitespace().collect::<Vec<_>>();
    Some(words.join(" "))
}

fn cell(text: &str) -> String {
    text.replace('|', "\\|")
}

fn code(value: &Value) -> String {
    match value {
        Value::String(word) => cell(&format!("`\"{word}\"`")),
        value => cell(&format!("`{value}`")),
    }
}

/// The kind of a value: a link to its definition, its words, or its type with its range.
fn kind(schema: &Value) -> String {
    if let Some(name) = schema.get("$ref").and_then(Value::as_str) {
        let name = name.rsplit('/').next().unwrap_or_default();
        return format!("[{name}](#{})", name.to_lowercase());
    }
    if let Some(word) = schema.get("const") {
        return code(word);
    }
    let words = list(schema, "enum");
    if !words.is_empty() {
        return words.iter().map(code).collect::<Vec<_>>().join(", ");
    }
    let branches = [list(schema, "oneOf"), list(schema, "anyOf")].concat();
    if !branches.is_empty() {
        return join(branches.iter().filter(|branch| branch["type"] != "null").map(kind));
    }
    match schema.get("type") {
        Some(Value::String(name)) => named(name, schema),
        Some(Value::Array(names)) => {
            let names = names.iter().filter_map(Value::as_str).filter(|&name| name != "null");
            join(names.map(|name| named(name, schema)))
        }
        _ => "any value".to_owned(),
    }
}

fn join(kinds: impl Iterator<Item = String>) -> String {
    let mut kinds: Vec<String> = kinds.collect();
    kinds.dedup();
    kinds.join(" or ")
}

/// A type of JSON by its name, with what limits its values.
fn named(name: &str, schema: &Value) -> String {
    match name {
        "array" => {
            let item = schema.get("items").map_or_else(|| "any value".to_owned(), kind);
            match (schema.get("minItems"), schema.get("maxItems")) {
                (Some(least), Some(most)) if least == most => format!("{least} × ({item})"),
                (Some(least), _) if least != 0 => format!("list of at least {least}: {item}"),
                _ => format!("list of {item}"),
            }
        }
        "object" if schema.get("properties").is_some() => {
            let keys: Map<String, Value> =
                members(schema, "properties").map(|(k, v)| (k.clone(), v.clone())).collect();
            let keys = keys.keys().filter(|key| !NOTES.contains(&key.as_str()));
            format!("{{{}}}", keys.map(|key| format!("`{key}`")).collect::<Vec<_>>().join(", "))
        }
        "object" => match schema.get("additionalProperties") {
            Some(value @ Value::Object(_)) => format!("by name, {}", kind(value)),
            _ => "object".to_owned(),
        },
        "boolean" => "true or false".to_owned(),
        "integer" => format!("whole number{}", range(schema)),
        "number" => format!("number{}", range(schema)),
        name => name.to_owned(),
    }
}

fn range(schema: &Value) -> String {
    match (schema.get("minimum"), schema.get("maximum")) {
        (Some(least), Some(most)) => format!(" {least} to {most}"),
        (Some(least), None) => format!(" ≥ {least}"),
        (None, Some(most)) => format!(" ≤ {most}"),
        (None, None) => String::new(),
    }
}
