//! The scene's values on the right, as its schema has them.

use eframe::egui::{self, Context, Ui};
use serde_json::{Value, json};

use crate::app::App;
use crate::document::Edit;
use crate::form::mark;

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

pub(crate) fn show(app: &mut App, ctx: &Context) {
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

/// What is reached for most: noise on and off.
fn shortcuts(ui: &mut Ui, scene: &Value, edits: &mut Vec<Edit>) {
    let sensor = &scene["camera"]["sensor"];
    let is_real = ["type", "model", "system_gain"].iter().any(|key| !sensor[*key].is_null());
    if !is_real {
        return;
    }
    let has_gain = !sensor["model"].is_null() || !sensor["system_gain"].is_null();
    let mut is_noisy = has_gain && sensor["noise"] != "none";
    let switch = ui.add_enabled(has_gain, egui::Checkbox::new(&mut is_noisy, "noise"));
    let switch =
        switch.on_disabled_hover_text("without a model or a system_gain there are no electrons");
    mark(ui.ctx(), "noise", switch.rect);
    if switch.changed() {
        edits.push(match is_noisy {
            true => Edit::set("/camera/sensor/noise", json!("poisson")),
            false => Edit::set("/camera/sensor/noise", json!("none")),
        });
    }
}
