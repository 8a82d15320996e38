//! Start page, which stands in the middle as long as there is no picture: scenes to begin with,
//! what is being read, what went wrong.

use eframe::egui::{self, RichText, Ui};

use super::bar::button;
use crate::app::App;
use crate::document::FIRST_SCENES;

/// In the middle of the canvas.
pub(crate) fn show(app: &mut App, ui: &mut Ui) {
    let wait = app.busy;
    let is_open = app.document.is_some() || app.still.is_some();
    let place = ui.max_rect();
    let middle = egui::Rect::from_center_size(place.center(), egui::vec2(420.0, 320.0));
    ui.scope_builder(egui::UiBuilder::new().max_rect(middle), |ui| {
        ui.vertical_centered(|ui| match (is_open, wait) {
            (true, Some((phase, share))) => {
                ui.label(RichText::new(format!("{phase} …")).size(17.0));
                #[expect(clippy::cast_possible_truncation, reason = "a share")]
                ui.add(egui::ProgressBar::new(share as f32).desired_width(260.0).show_percentage());
                if button(ui, "leave", "Stop", "Stop reading it; another file may be opened") {
                    app.cancel();
                }
            }
            (true, None) if app.is_stopped => {
                ui.label(RichText::new("stopped").size(17.0));
                if button(ui, "go on", "Go on", "Read it after all") {
                    app.wish();
                }
            }
            (true, _) => {}
            (false, _) => begin(app, ui),
        });
    });
}

fn begin(app: &mut App, ui: &mut Ui) {
    let words = "Drop a scene, a model, a lens or an image here, or open one (Ctrl+O)";
    ui.label(RichText::new(words).size(17.0).weak());
    ui.add_space(18.0);
    ui.weak("or begin with");
    ui.add_space(6.0);
    let mut chosen = None;
    for first in &FIRST_SCENES {
        if button(ui, &format!("first={}", first.name), first.title, first.about) {
            chosen = Some(first);
        }
        ui.small(first.about);
        ui.add_space(4.0);
    }
    if let Some(first) = chosen {
        app.begin(first);
    }
}
