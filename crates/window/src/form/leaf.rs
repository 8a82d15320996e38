//! Widgets for single values: numbers with and without units, words, switches, vectors; and notes where widgets are.

use eframe::egui::{self, DragValue, Ui};
use etendue::ScenePath;
use serde_json::{Value, json};

use crate::document::Edit;

/// The widget of a value that is there.
pub(super) fn show(
    ui: &mut Ui,
    schema: &Value,
    path: &ScenePath,
    value: &Value,
    edits: &mut Vec<Edit>,
) {
    let words = words(schema);
    match value {
        Value::Bool(on) => {
            let mut on = *on;
            let check = ui.checkbox(&mut on, "");
            mark(ui.ctx(), &path.pointer(), check.rect);
            if check.changed() {
                edits.push(Edit::set(path, on));
            }
        }
        Value::String(word) if !words.is_empty() && words.contains(&&**word) => {
            choice(ui, schema, path, word, &words, edits);
        }
        Value::String(text) => match quantity(text) {
            Some((number, unit)) => {
                if let Some(number) = drag(ui, path, number, schema, &format!(" {unit}")) {
                    edits.push(Edit::set(path, format!("{number} {unit}")));
                }
            }
            None => line(ui, path, text, edits),
        },
        Value::Number(number) => {
            let is_whole = number.is_u64() || number.is_i64();
            let unit = schema["x-unit"].as_str().map(|unit| format!(" {unit}")).unwrap_or_default();
            let new = drag(ui, path, number.as_f64().unwrap_or(0.0), schema, &unit);
            if let Some(new) = new {
                edits.push(Edit::set(path, as_number(new, is_whole && is_integer(schema))));
            }
        }
        Value::Array(list) => {
            let items = &schema["items"];
            for (i, value) in list.iter().enumerate() {
                show(ui, items, &path.index(i), value, edits);
            }
        }
        Value::Null | Value::Object(_) => {}
    }
}

fn is_integer(schema: &Value) -> bool {
    schema["type"] == "integer"
        || schema["type"].as_array().is_some_and(|kinds| kinds.contains(&json!("integer")))
}

/// A number as JSON: whole where it has to be, without digits that dragging has not set.
fn as_number(number: f64, is_whole: bool) -> Value {
    #[expect(clippy::cast_possible_truncation, reason = "within what a drag reaches")]
    match is_whole {
        true => json!(number.round() as i64),
        false => json!(number),
    }
}

/// A number to be dragged or typed; the new one when it was changed.
fn drag(ui: &mut Ui, path: &ScenePath, now: f64, schema: &Value, unit: &str) -> Option<f64> {
    let mut number = now;
    let bound = |key: &str, none: f64| schema[key].as_f64().unwrap_or(none);
    let range = bound("minimum", f64::NEG_INFINITY)..=bound("maximum", f64::INFINITY);
    let speed = match is_integer(schema) {
        true => 0.25,
        false => (now.abs() * 0.01).max(1e-3),
    };
    let widget = DragValue::new(&mut number).speed(speed).suffix(unit).range(range).max_decimals(6);
    let widget = widget.update_while_editing(false);
    let widget = if is_integer(schema) { widget.fixed_decimals(0) } else { widget };
    let response = ui.add(widget);
    mark(ui.ctx(), &path.pointer(), response.rect);
    (response.changed() && number.is_finite() && number != now).then_some(number)
}

/// The number and the unit of "50 mm".
fn quantity(text: &str) -> Option<(f64, &str)> {
    let (number, unit) = text.trim().split_once(' ')?;
    let number = number.parse::<f64>().ok().filter(|number| number.is_finite())?;
    Some((number, unit.trim()))
}

/// The words that a value may be.
pub(super) fn words(schema: &Value) -> Vec<&str> {
    if let Some(all) = schema["enum"].as_array() {
        return all.iter().filter_map(Value::as_str).collect();
    }
    let choices = ["oneOf", "anyOf"].iter().find_map(|key| schema[*key].as_array());
    choices.into_iter().flatten().filter_map(|choice| choice["const"].as_str()).collect()
}

fn choice(
    ui: &mut Ui,
    schema: &Value,
    path: &ScenePath,
    now: &str,
    words: &[&str],
    edits: &mut Vec<Edit>,
) {
    let about = |word: &str| {
        let choices = schema["oneOf"].as_array();
        let one = choices.into_iter().flatten().find(|choice| choice["const"] == word);
        one.and_then(|one| one["description"].as_str())
    };
    let combo = egui::ComboBox::from_id_salt(path).selected_text(now);
    let shown = combo.show_ui(ui, |ui| {
        for &word in words {
            let one = ui.selectable_label(word == now, word);
            mark(ui.ctx(), &format!("{}={word}", path.pointer()), one.rect);
            if hint(one, about(word)).clicked() {
                edits.push(Edit::set(path, word));
            }
        }
    });
    mark(ui.ctx(), &path.pointer(), shown.response.rect);
}

/// A text, taken when it is complete.
fn line(ui: &mut Ui, path: &ScenePath, text: &str, edits: &mut Vec<Edit>) {
    let id = egui::Id::new(("text", path));
    let mut typed: String = ui.data(|data| data.get_temp(id)).unwrap_or_else(|| text.to_owned());
    let response = ui.add(egui::TextEdit::singleline(&mut typed).desired_width(140.0));
    mark(ui.ctx(), &path.pointer(), response.rect);
    if response.lost_focus() {
        ui.data_mut(|data| data.remove::<String>(id));
        if typed != text {
            // A number where words may stand, too, is a number.
            let number = typed.trim().parse::<f64>().ok().filter(|number| number.is_finite());
            let value = number.map_or_else(|| json!(typed), |number| json!(number));
            edits.push(Edit::set(path, value));
        }
    } else if response.has_focus() {
        ui.data_mut(|data| data.insert_temp(id, typed));
    }
}

/// A response that explains itself.
pub(super) fn hint(response: egui::Response, about: Option<&str>) -> egui::Response {
    match about {
        Some(about) => response.on_hover_text(about.replace('\n', " ")),
        None => response,
    }
}

/// Notes where a widget is, by a name: for those who drive the window.
pub(crate) fn mark(ctx: &egui::Context, name: &str, place: egui::Rect) {
    ctx.data_mut(|data| data.insert_temp(egui::Id::new(("mark", name)), place));
}

/// Rectangle of a widget.
#[cfg(test)]
pub(crate) fn marked(ctx: &egui::Context, name: &str) -> Option<egui::Rect> {
    ctx.data(|data| data.get_temp(egui::Id::new(("mark", name))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_keep_their_unit() {
        assert_eq!(quantity("50 mm"), Some((50.0, "mm")));
        assert_eq!(quantity(" 1.5  m"), Some((1.5, "m")));
        assert_eq!(quantity("infinity"), None);
        assert_eq!(quantity("inf m"), None);
        assert_eq!(quantity("rggb"), None);
    }

    #[test]
    fn words_come_from_both_manners_of_a_schema() {
        assert_eq!(words(&json!({"enum": ["a", "b"]})), ["a", "b"]);
        assert_eq!(words(&json!({"oneOf": [{"const": "c"}, {"type": "number"}]})), ["c"]);
        assert!(words(&json!({"type": "number"})).is_empty());
    }
}
