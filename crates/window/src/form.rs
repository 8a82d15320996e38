//! Widgets for any value that a JSON Schema describes: the panels follow the scene format by themselves.

mod leaf;

use eframe::egui::{self, Ui};
use etendue::ScenePath;
use serde_json::{Map, Value, json};

use self::leaf::hint;
use crate::document::Edit;

pub(crate) use self::leaf::mark;
#[cfg(test)]
pub(crate) use self::leaf::marked;

/// Keys that no panel shows: what the format allows for editors and remarks.
const HIDDEN: [&str; 2] = ["$schema", "comment"];

/// Keys that tell variants of an object apart.
const TAGS: [&str; 2] = ["type", "shape"];

/// A schema with its definitions.
#[derive(Debug)]
pub(crate) struct Form {
    schema: Value,
}

/// A value in a form: where it is, and what it is there (null where it is absent).
#[derive(Debug, Clone, Copy)]
struct FormField<'a> {
    schema: &'a Value,
    path: &'a ScenePath,
    value: &'a Value,
    is_required: bool,
}

impl Form {
    pub(crate) fn new(schema: Value) -> Self {
        Self { schema }
    }

    /// Widgets for the key `key` of the top, whose value is `value`. What the user changes is added to
    /// `edits`.
    pub(crate) fn show(&self, ui: &mut Ui, key: &str, value: &Value, edits: &mut Vec<Edit>) {
        let path = &ScenePath::default().key(key);
        let schema = &self.schema["properties"][key];
        let field = FormField { schema, path, value, is_required: true };
        self.inner(ui, field, edits);
    }

    /// The schema itself, past references, and without null.
    fn resolved<'a>(&'a self, schema: &'a Value) -> &'a Value {
        let mut schema = schema;
        // References of references; a schema that names itself alone describes nothing.
        for _ in 0..16 {
            if let Some(name) = schema["$ref"].as_str() {
                schema = self.schema.pointer(name.trim_start_matches('#')).unwrap_or(&Value::Null);
                continue;
            }
            let choices = ["anyOf", "oneOf"].iter().find_map(|key| schema[*key].as_array());
            let real: Vec<&Value> =
                choices.into_iter().flatten().filter(|one| one["type"] != "null").collect();
            match real.as_slice() {
                [one] => schema = one,
                _ => return schema,
            }
        }
        schema
    }

    /// Schema of objects, where the name of a file that holds one would do as well.
    fn of_objects<'a>(&'a self, schema: &'a Value) -> &'a Value {
        let choices = schema["anyOf"].as_array();
        let mut others = choices.into_iter().flatten().filter(|one| one["type"] != "string");
        match (others.next(), others.next()) {
            (Some(one), None) => self.resolved(one),
            _ => schema,
        }
    }

    /// A labelled value: a line, or a heading with what is below it.
    fn field(&self, ui: &mut Ui, key: &str, field: FormField<'_>, edits: &mut Vec<Edit>) {
        let schema = self.resolved(field.schema);
        let about = field.schema["description"].as_str().or(schema["description"].as_str());
        let label = key.replace('_', " ");
        let is_nested = field.value.is_object()
            || field.value.as_array().is_some_and(|list| list.iter().any(|v| !v.is_number()));
        if is_nested {
            let heading = egui::CollapsingHeader::new(&label).id_salt(field.path);
            let shown = heading.default_open(key == "sensor").show(ui, |ui| {
                self.inner(ui, field, edits);
                if field.is_required {
                    return;
                }
                // Below what it removes, often beside the one of what that is in.
                let remove = ui.small_button(format!("remove {label}"));
                mark(ui.ctx(), &format!("{}-", field.path.pointer()), remove.rect);
                if remove.clicked() {
                    edits.push(Edit::Remove(field.path.clone()));
                }
            });
            hint(shown.header_response, about);
            return;
        }
        ui.horizontal(|ui| {
            hint(ui.label(&label), about);
            self.inner(ui, field, edits);
            if !field.is_required && !field.value.is_null() {
                let default = ui
                    .small_button("\u{d7}")
                    .on_hover_text(format!("{label}: back to the default"));
                if default.clicked() {
                    edits.push(Edit::Remove(field.path.clone()));
                }
            }
        });
    }

    fn inner(&self, ui: &mut Ui, field: FormField<'_>, edits: &mut Vec<Edit>) {
        let schema = match self.resolved(field.schema) {
            schema if field.value.is_object() => self.of_objects(schema),
            schema => schema,
        };
        let field = FormField { schema, ..field };
        if let Some(choice) = variants(schema) {
            return self.tagged(ui, field, &choice, edits);
        }
        match field.value {
            Value::Object(members) => self.members(ui, field, members, edits),
            Value::Array(list) if list.iter().any(|v| !v.is_number()) => {
                self.list(ui, field, list, edits);
            }
            Value::Null => self.absent(ui, field, edits),
            _ => leaf::show(ui, schema, field.path, field.value, edits),
        }
    }

    /// A choice among kinds of objects, and the keys of the chosen one.
    fn tagged(
        &self,
        ui: &mut Ui,
        field: FormField<'_>,
        KindChoice { tag, variants }: &KindChoice<'_>,
        edits: &mut Vec<Edit>,
    ) {
        let now = field.value.get(*tag).and_then(Value::as_str);
        let id = egui::Id::new((field.path, *tag));
        let place = field.path.key(tag).pointer();
        let combo = egui::ComboBox::from_id_salt(id).selected_text(now.unwrap_or("none"));
        let shown = combo.show_ui(ui, |ui| {
            for KindVariant { name, schema: variant } in variants {
                let choice = ui.selectable_label(now == Some(*name), *name);
                mark(ui.ctx(), &format!("{place}={name}"), choice.rect);
                if hint(choice, variant["description"].as_str()).clicked() {
                    let object = self.changed_to(field.value, tag, name, variant);
                    edits.push(Edit::set(field.path, object));
                }
            }
        });
        mark(ui.ctx(), &place, shown.response.rect);
        let chosen = variants.iter().find(|variant| Some(variant.name) == now);
        if let (Some(KindVariant { schema, .. }), Value::Object(members)) = (chosen, field.value) {
            self.members(ui, FormField { schema, ..field }, members, edits);
        }
    }

    /// An object of another kind, with what the two have in common, and what the new one has to have.
    fn changed_to(&self, before: &Value, tag: &str, name: &str, variant: &Value) -> Value {
        let mut object = Map::new();
        object.insert(tag.to_owned(), json!(name));
        let known = variant["properties"].as_object();
        for (key, value) in before.as_object().into_iter().flatten() {
            if key != tag && known.is_some_and(|known| known.contains_key(key)) {
                object.insert(key.clone(), value.clone());
            }
        }
        for key in required(variant).filter(|key| *key != tag) {
            let schema = &variant["properties"][key];
            object.entry(key).or_insert_with(|| self.something(schema));
        }
        Value::Object(object)
    }

    /// A value that fits a schema, to begin with.
    fn something(&self, schema: &Value) -> Value {
        if let Some(default) = schema.get("default").filter(|default| !default.is_null()) {
            return default.clone();
        }
        let schema = self.resolved(schema);
        if let Some(KindChoice { tag, variants }) = variants(schema) {
            let first = variants.first();
            return first.map_or(Value::Null, |KindVariant { name, schema }| {
                self.changed_to(&Value::Null, tag, name, schema)
            });
        }
        if let Some(default) = schema.get("default").filter(|default| !default.is_null()) {
            return default.clone();
        }
        if let Some(first) = leaf::words(schema).first() {
            return json!(first);
        }
        let kind = schema["type"].as_str().or_else(|| schema["type"].get(0)?.as_str());
        match kind {
            Some("object") => {
                let keys = required(schema);
                let member =
                    |key: &str| (key.to_owned(), self.something(&schema["properties"][key]));
                Value::Object(keys.map(member).collect())
            }
            Some("array") => {
                let count = schema["minItems"].as_u64().unwrap_or(0);
                Value::Array((0..count).map(|_| self.something(&schema["items"])).collect())
            }
            Some("boolean") => json!(false),
            Some("string") => json!(""),
            Some("integer") => schema.get("minimum").cloned().unwrap_or(json!(1)),
            Some("number") => json!(1.0),
            _ => match ["anyOf", "oneOf"].iter().find_map(|key| schema[*key].get(0)) {
                Some(first) => self.something(first),
                None => json!(1.0),
            },
        }
    }

    fn members(
        &self,
        ui: &mut Ui,
        field: FormField<'_>,
        members: &Map<String, Value>,
        edits: &mut Vec<Edit>,
    ) {
        let schema = self.shape_of(field.schema, members);
        let needed: Vec<&str> = required(schema).collect();
        let named = schema["properties"].as_object();
        let is_tag = |key: &str| schema["properties"][key].get("const").is_some();
        let known = named.into_iter().flatten();
        let known = known.filter(|(key, _)| !HIDDEN.contains(&&***key) && !is_tag(key));
        let (there, absent): (Vec<_>, Vec<_>) =
            known.partition(|(key, _)| members.get(*key).is_some_and(|value| !value.is_null()));
        for (key, schema) in there {
            let path = &field.path.key(key);
            let is_required = needed.contains(&&**key);
            let below = FormField { schema, path, value: &members[key], is_required };
            self.field(ui, key, below, edits);
        }
        // Names that the user gives: materials.
        let others = &schema["additionalProperties"];
        if others.is_object() {
            for (key, value) in members {
                let path = &field.path.key(key);
                let below = FormField { schema: others, path, value, is_required: false };
                self.field(ui, key, below, edits);
            }
        }
        if !absent.is_empty() {
            self.additions(ui, field.path, &absent, edits);
        }
    }

    /// The one of several descriptions of objects that these members fit.
    fn shape_of<'a>(&'a self, schema: &'a Value, members: &Map<String, Value>) -> &'a Value {
        let choices = ["anyOf", "oneOf"].iter().find_map(|key| schema[*key].as_array());
        let fits = |shape: &&Value| {
            let known = shape["properties"].as_object();
            known.is_some_and(|known| members.keys().all(|key| known.contains_key(key)))
        };
        let shapes = choices.into_iter().flatten().map(|choice| self.resolved(choice));
        shapes.into_iter().find(fits).unwrap_or(schema)
    }

    /// A menu of what is not there.
    fn additions(
        &self,
        ui: &mut Ui,
        path: &ScenePath,
        absent: &[(&String, &Value)],
        edits: &mut Vec<Edit>,
    ) {
        let menu = ui.menu_button("add", |ui| {
            egui::ScrollArea::vertical().max_height(360.0).show(ui, |ui| {
                for (key, schema) in absent {
                    let about = schema["description"].as_str();
                    let button = ui.button(key.replace('_', " "));
                    let place = path.key(key);
                    mark(ui.ctx(), &format!("{}+", place.pointer()), button.rect);
                    if hint(button, about).clicked() {
                        edits.push(Edit::set(place, self.something(schema)));
                        ui.close();
                    }
                }
            });
        });
        mark(ui.ctx(), &format!("{}+", path.pointer()), menu.response.rect);
    }

    fn list(&self, ui: &mut Ui, field: FormField<'_>, list: &[Value], edits: &mut Vec<Edit>) {
        let items = &field.schema["items"];
        for (i, value) in list.iter().enumerate() {
            let path = &field.path.index(i);
            let name =
                ["name", "file", "shape", "type"].iter().find_map(|key| value[*key].as_str());
            let title = format!("{} {}", i + 1, name.unwrap_or_default());
            let below = FormField { schema: items, path, value, is_required: false };
            self.field(ui, &title, below, edits);
        }
        if items.is_object() && ui.small_button("add one").clicked() {
            edits.push(Edit::set(field.path.index(list.len()), self.something(items)));
        }
    }

    fn absent(&self, ui: &mut Ui, field: FormField<'_>, edits: &mut Vec<Edit>) {
        ui.weak("default");
        if ui.small_button("set").clicked() {
            edits.push(Edit::set(field.path, self.something(field.schema)));
        }
    }
}

/// A choice among kinds of objects.
struct KindChoice<'a> {
    /// The key that says which it is.
    tag: &'static str,
    variants: Vec<KindVariant<'a>>,
}

/// One kind of them.
struct KindVariant<'a> {
    name: &'a str,
    schema: &'a Value,
}

/// The choice among objects that a schema is.
fn variants(schema: &Value) -> Option<KindChoice<'_>> {
    let choices = ["oneOf", "anyOf"].iter().find_map(|key| schema[*key].as_array())?;
    TAGS.into_iter().find_map(|tag| {
        let named: Option<Vec<_>> = choices
            .iter()
            .map(|schema| {
                let name = schema["properties"][tag]["const"].as_str()?;
                Some(KindVariant { name, schema })
            })
            .collect();
        Some(KindChoice { tag, variants: named? })
    })
}

fn required(schema: &Value) -> impl Iterator<Item = &str> {
    schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str)
}

/// A number with four significant digits.
pub(crate) fn short(number: f64) -> String {
    match number.abs() {
        0.0 => "0".to_owned(),
        size if !(1e-3..1e6).contains(&size) => format!("{number:.3e}"),
        size => {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 6")]
            let digits = (3.0 - size.log10().floor()).clamp(0.0, 6.0) as usize;
            let text = format!("{number:.digits$}");
            match text.contains('.') {
                true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
                false => text,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_right() {
        let cases = [(0.0, "0"), (1.5, "1.5"), (1234.56, "1235"), (0.012_345, "0.01235")];
        for (number, text) in cases {
            assert_eq!(short(number), text);
        }
        assert_eq!(short(2.5e-7), "2.500e-7");
        assert_eq!(short(100_000.0), "100000", "zeros of a whole number stay");
    }
}
