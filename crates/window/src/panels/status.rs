//! The line at the bottom: what is being done, what was, and the frames of a sequence.

use eframe::egui::{self, Context, Ui};

use super::bar::button;
use crate::app::App;

pub(crate) fn show(app: &mut App, ctx: &Context) {
    egui::TopBottomPanel::bottom("status").show(ctx, |ui| {
        timeline(app, ui);
        ui.horizontal(|ui| {
            work(app, ui);
            if let Some(document) = &app.document {
                let mark = if document.is_changed() { " (not saved)" } else { "" };
                ui.label(format!("{}{mark}", document.path.display()));
            }
            if let Some((path, _)) = &app.still {
                ui.label(path.display().to_string());
            }
            if let Some(said) = &app.said {
                ui.separator();
                ui.label(said);
            }
        });
    });
    if app.error.is_some() {
        egui::TopBottomPanel::bottom("error").show(ctx, |ui| error(app, ui));
    }
}

fn work(app: &mut App, ui: &mut Ui) {
    match app.busy {
        Some((phase, share)) => {
            #[expect(clippy::cast_possible_truncation, reason = "a share")]
            let bar = egui::ProgressBar::new(share as f32).desired_width(110.0).text(phase);
            ui.add(bar);
            if button(ui, "cancel", "Stop", "Stop what is being done") {
                app.cancel();
            }
        }
        None => {
            ui.weak(if app.is_settled() { "done" } else { "ready" });
        }
    }
    if let Some(picture) = &app.picture {
        let [width, height] = picture.screen.size;
        let samples = match picture.samples {
            Some([has, of]) if has < of => format!(", {has} of {of} samples"),
            Some([_, of]) if of > 1 => format!(", {of} samples"),
            _ => String::new(),
        };
        let rough = if picture.factor > 1 { " (rough)" } else { "" };
        ui.label(format!("{width} \u{d7} {height}{rough}{samples}"));
    }
}

fn timeline(app: &mut App, ui: &mut Ui) {
    let Some(count) = app.frames.filter(|count| *count > 0) else { return };
    ui.horizontal(|ui| {
        ui.label("frame");
        let mut frame = app.frame.unwrap_or(0);
        ui.spacing_mut().slider_width = (ui.available_width() - 80.0).max(60.0);
        let slider = ui.add(egui::Slider::new(&mut frame, 0..=count - 1));
        crate::form::mark(ui.ctx(), "frame", slider.rect);
        if slider.changed() {
            app.frame = Some(frame);
            app.wish();
        }
    });
}

fn error(app: &mut App, ui: &mut Ui) {
    let Some(why) = app.error.clone() else { return };
    ui.horizontal_wrapped(|ui| {
        let color = ui.visuals().error_fg_color;
        ui.colored_label(color, egui::RichText::new(why).monospace());
        if button(ui, "dismiss", "\u{d7}", "Take this away") {
            app.error = None;
        }
    });
}
