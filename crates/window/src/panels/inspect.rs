//! Readings on the left of the window: the pixel that was asked, and the histogram.
//!
//! The scene's values on the right, as its schema has them.

use eframe::egui::{self, Color32, Context, Pos2, Rect, Sense, Ui, Vec2};
use serde_json::{Value, json};

use etendue::Inspector;

use crate::app::App;
use crate::document::Edit;
use crate::form::{mark, short};

pub(crate) fn show_inspect(app: &mut App, ctx: &Context) {
    if app.document.is_none() && app.still.is_none() {
        return;
    }
    egui::SidePanel::left("inspect").default_width(250.0).show(ctx, |ui| {
        egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            section(ui, "Pixel", |ui| pixel(app, ui));
            let camera = app.inspector.as_ref().map(|inspector| &inspector.scene().camera);
            if camera.is_some_and(|camera| camera.light_field().is_some()) {
                section(ui, "Light field", |ui| light_field(app, ui));
            }
            section(ui, "Histogram", |ui| histogram(app, ui));
            section(ui, "Notes", |ui| notes(app, ui));
            egui::CollapsingHeader::new("Decisions").show(ui, |ui| decisions(app, ui));
        });
    });
}

fn light_field(app: &mut App, ui: &mut Ui) {
    let scene = app.inspector.as_ref().map(Inspector::scene);
    if let Some(why) = scene.and_then(|scene| scene.camera.no_views()) {
        ui.weak(format!("no views: {why}"));
    }
    let picture = app.picture.as_ref().filter(|picture| picture.is_final);
    match app.light_field.show(ui, picture.and_then(|of| of.preview.as_deref())) {
        Ok(true) => app.show_light_field(ui.ctx()),
        Ok(false) => {}
        Err(error) => app.error = Some(error.to_string()),
    }
}

fn section(ui: &mut Ui, title: &str, show: impl FnOnce(&mut Ui)) {
    egui::CollapsingHeader::new(title).default_open(true).show(ui, show);
}

fn pixel(app: &App, ui: &mut Ui) {
    let Some(asked) = &app.asked else {
        ui.weak("Click on the picture.");
        return;
    };
    let [column, row] = asked.place.map(f64::floor);
    let mut rows = vec![("pixel".to_owned(), format!("{column}, {row}"))];
    let mut add = |name: &str, value: String| rows.push((name.to_owned(), value));
    if let Some(reading) =
        app.picture.as_ref().and_then(|picture| picture.preview.as_ref()?.reading(asked.place).ok())
    {
        reading.into_iter().for_each(|(name, value)| add(&name, value));
    }
    if let Some((_, still)) = &app.still {
        still.reading(asked.place).into_iter().for_each(|(name, value)| add(&name, value));
    }
    match &asked.probe {
        None if app.still.is_some() => {}
        None => add("hit", "nothing".to_owned()),
        Some(probe) => {
            add("depth", format!("{} m", short(probe.depth)));
            add("distance", format!("{} m", short(probe.distance)));
            add("position", vector(probe.position.to_array(), " m"));
            add("normal", vector(probe.normal.to_array(), ""));
            add("object", probe.object.clone());
            if !probe.node.is_empty() && probe.node != probe.object {
                add("node", probe.node.clone());
            }
            add("material", probe.material.clone());
            add("triangle", probe.triangle.to_string());
        }
    }
    egui::Grid::new("pixel").num_columns(2).striped(true).show(ui, |ui| {
        for (name, value) in rows {
            ui.weak(name);
            ui.label(value);
            ui.end_row();
        }
    });
}

fn vector(values: [f64; 3], unit: &str) -> String {
    let values = values.map(short);
    format!("{}{unit}", values.join(", "))
}

fn histogram(app: &App, ui: &mut Ui) {
    let Some(picture) = &app.picture else { return };
    let counts = picture.screen.histogram();
    let (response, painter) =
        ui.allocate_painter(Vec2::new(ui.available_width(), 90.0), Sense::hover());
    let place = response.rect;
    painter.rect_filled(place, 2.0, ui.visuals().extreme_bg_color);
    let is_grey = counts[0] == counts[1] && counts[1] == counts[2];
    let colors = match is_grey {
        true => vec![(0, ui.visuals().text_color())],
        false => vec![
            (0, Color32::from_rgba_unmultiplied(230, 60, 60, 150)),
            (1, Color32::from_rgba_unmultiplied(40, 190, 70, 150)),
            (2, Color32::from_rgba_unmultiplied(70, 110, 250, 150)),
        ],
    };
    // Black and white often are all of a background: they are cut off rather than flatten the rest.
    let inner = counts.iter().flat_map(|channel| &channel[1..255]);
    let top = f64::from(inner.copied().max().unwrap_or(0).max(1));
    let width = place.width() / 256.0;
    for (channel, color) in colors {
        for (value, &count) in (0_u8..=255).zip(&counts[channel]) {
            #[expect(clippy::cast_possible_truncation, reason = "points on the screen")]
            let height = place.height() * (f64::from(count) / top).sqrt().min(1.0) as f32;
            let left = place.left() + width * f32::from(value);
            let bar = Rect::from_min_max(
                Pos2::new(left, place.bottom() - height),
                Pos2::new(left + width, place.bottom()),
            );
            painter.rect_filled(bar, 0.0, color);
        }
    }
    response.on_hover_text("Pixels by their value from black to white (root of the counts)");
}

/// The plan's decisions; the reason and the key of each beside the mouse.
fn decisions(app: &App, ui: &mut Ui) {
    let decisions = app.inspector.as_ref().map_or(&[][..], Inspector::decisions);
    egui::Grid::new("decisions").num_columns(2).striped(true).show(ui, |ui| {
        for decision in decisions {
            let key = decision.key.map_or_else(String::new, |key| format!(" [{key}]"));
            let why = format!("{}{key}", decision.reason);
            ui.weak(decision.kind.name()).on_hover_text(&why);
            ui.label(decision.value.to_string()).on_hover_text(&why);
            ui.end_row();
        }
    });
}

fn notes(app: &App, ui: &mut Ui) {
    if let Some(picture) = &app.picture {
        ui.weak(&picture.screen.note);
        let preview = picture.preview.as_ref().map(|preview| preview.notes());
        let still = app.still.as_ref().map(|(_, still)| still.notes());
        for note in preview.or(still).unwrap_or_default() {
            ui.label(note);
        }
    }
}

/// The parts of a scene with what they are called, and whether they are open at first.
const PARTS: [(&str, &str, bool); 9] = [
    ("camera", "Camera", true),
    ("tracer", "Tracer", true),
    ("render", "Render", false),
    ("lights", "Lights", false),
    ("objects", "Objects", false),
    ("materials", "Materials", false),
    ("layers", "Layers to write", false),
    ("plan", "Plan", false),
    ("accuracy", "Accuracy", false),
];

pub(crate) fn show_scene(app: &mut App, ctx: &Context) {
    let Some(scene) = app.document.as_ref().map(|document| document.value().clone()) else {
        return;
    };
    let mut edits = Vec::new();
    egui::SidePanel::right("scene").default_width(330.0).show(ctx, |ui| {
        egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            for (key, title, is_open) in PARTS {
                let heading = egui::CollapsingHeader::new(title).default_open(is_open);
                let shown = heading.show(ui, |ui| {
                    if key == "camera" {
                        shortcuts(ui, &scene, &mut edits);
                    }
                    app.form.show(ui, key, &scene[key], &mut edits);
                });
                mark(ui.ctx(), &format!("part={key}"), shown.header_response.rect);
            }
        });
    });
    if !edits.is_empty() {
        app.edit(ctx, &edits);
    }
}

/// Shortcuts to what is reached for most: noise on and off.
fn shortcuts(ui: &mut Ui, scene: &Value, edits: &mut Vec<Edit>) {
    let sensor = &scene["camera"]["sensor"];
    let has_any = |keys: &[&str]| keys.iter().any(|key| !sensor[*key].is_null());
    let has_gain = has_any(&["model", "system_gain", "iso_settings"]);
    if !has_gain && !has_any(&["type"]) {
        return;
    }
    let mut is_noisy = has_gain && sensor["noise"] != "none";
    let switch = ui.add_enabled(has_gain, egui::Checkbox::new(&mut is_noisy, "noise"));
    let switch =
        switch.on_disabled_hover_text("without a model or a system_gain there are no electrons");
    mark(ui.ctx(), "noise", switch.rect);
    if switch.changed() {
        edits.push(match is_noisy {
            true => Edit::set("camera.sensor.noise", json!("poisson")),
            false => Edit::set("camera.sensor.noise", json!("none")),
        });
    }
}
