//! The bar at the top: files, steps, and what of the scene is looked at.
//!
//! The line at the bottom: what is being done, what was, and the frames of a sequence.

use eframe::egui::{self, Context, Ui};

use crate::app::App;
use crate::document::View;
use crate::form::mark;
use crate::state::{PathPrompt, Tool};

pub(crate) fn show_bar(app: &mut App, ctx: &Context) {
    egui::TopBottomPanel::top("bar").show(ctx, |ui| {
        ui.horizontal_wrapped(|ui| {
            files(app, ui);
            ui.separator();
            steps(app, ui);
            ui.separator();
            views(app, ui);
            ui.separator();
            tools(app, ui);
            ui.separator();
            compare(app, ui);
            egui::widgets::global_theme_preference_switch(ui);
        });
    });
}

fn files(app: &mut App, ui: &mut Ui) {
    let is_open = app.document.is_some();
    if button(
        ui,
        "open",
        "Open",
        "Open a scene, a model, a lens or an image (Ctrl+O); or drop one on the window",
    ) {
        app.ask_what_to_open();
    }
    ui.add_enabled_ui(is_open, |ui| {
        if button(ui, "save", "Save", "Write the scene to its file (Ctrl+S)") {
            app.save();
        }
        if button(ui, "save as", "Save as", "Write the scene to another file") {
            let path = app.document.as_ref().map(crate::document::Document::own_file);
            let path = path.map(|path| path.display().to_string()).unwrap_or_default();
            app.asking = Some((PathPrompt::SaveAs, path));
        }
        let about = "Render the whole scene as the command line does, and write PNG, EXR and all other files";
        if button(ui, "render", "Render", about) {
            app.asking = Some((PathPrompt::Render, "out".to_owned()));
        }
    });
}

fn steps(app: &mut App, ui: &mut Ui) {
    let can =
        |test: fn(&crate::document::Document) -> bool| app.document.as_ref().is_some_and(test);
    let (back, on) = (can(|document| document.can_undo()), can(|document| document.can_redo()));
    ui.add_enabled_ui(back, |ui| {
        if button(ui, "undo", "Undo", "Ctrl+Z") {
            app.undo();
        }
    });
    ui.add_enabled_ui(on, |ui| {
        if button(ui, "redo", "Redo", "Ctrl+Shift+Z") {
            app.redo();
        }
    });
}

fn views(app: &mut App, ui: &mut Ui) {
    if app.still.is_some() {
        parts(app, ui);
        return;
    }
    let mut view = app.view.clone();
    let combo = egui::ComboBox::from_id_salt("view").selected_text(view.title());
    let shown = combo.height(420.0).show_ui(ui, |ui| {
        let layers = etendue::layer_names().iter().map(|name| View::Layer((*name).to_owned()));
        for choice in [View::Picture, View::Sensor, View::Numbers].into_iter().chain(layers) {
            let title = choice.title();
            let one = ui.selectable_value(&mut view, choice, &title);
            mark(ui.ctx(), &format!("view={title}"), one.rect);
        }
    });
    mark(ui.ctx(), "view", shown.response.rect);
    app.look_at(view);
    parts(app, ui);
}

/// The parts of a layer that has several: ids of objects, of triangles ….
fn parts(app: &mut App, ui: &mut Ui) {
    let Some(picture) = &app.picture else { return };
    let has_parts = app.still.is_some() || matches!(app.view, View::Layer(_));
    if picture.layers.len() < 2 || !has_parts {
        return;
    }
    let title =
        |layer: &str| if layer.is_empty() { "Picture".to_owned() } else { layer.to_owned() };
    let mut part = picture.layer.clone();
    let combo = egui::ComboBox::from_id_salt("part").selected_text(title(&part)).height(420.0);
    let shown = combo.show_ui(ui, |ui| {
        for layer in &picture.layers {
            let one = ui.selectable_value(&mut part, layer.clone(), title(layer));
            mark(ui.ctx(), &format!("part={}", title(layer)), one.rect);
        }
    });
    mark(ui.ctx(), "part", shown.response.rect);
    if part != picture.layer {
        app.part = Some(part);
        match app.still.is_some() {
            true => app.show_still(ui.ctx()),
            false => app.wish(),
        }
    }
}

fn tools(app: &mut App, ui: &mut Ui) {
    let about = "A click asks the pixel";
    let one = ui.selectable_value(&mut app.tool, Tool::Inspect, "Inspect").on_hover_text(about);
    mark(ui.ctx(), "tool=inspect", one.rect);
    let about = "A click focuses the lens on what is there";
    let one = ui.selectable_value(&mut app.tool, Tool::Focus, "Focus").on_hover_text(about);
    mark(ui.ctx(), "tool=focus", one.rect);
    let mut shows = app.shows_lens;
    let about = "The lens in section with the rays of the pixel that was clicked, and its spots";
    let switch = ui.toggle_value(&mut shows, "Lens").on_hover_text(about);
    mark(ui.ctx(), "lens", switch.rect);
    if switch.changed() {
        app.show_lens(shows);
    }
}

fn compare(app: &mut App, ui: &mut Ui) {
    let Some(picture) = &app.picture else { return };
    let mut compares = app.canvas.before.is_some();
    let about = "Keep the picture as it is now on the left of a line, to compare";
    let switch = ui.toggle_value(&mut compares, "Before | after").on_hover_text(about);
    mark(ui.ctx(), "compare", switch.rect);
    if switch.changed() {
        app.canvas.before = compares.then(|| {
            let image =
                egui::ColorImage::from_rgba_unmultiplied(picture.screen.size, &picture.screen.rgba);
            ui.ctx().load_texture("before", image, egui::TextureOptions::LINEAR)
        });
        app.canvas.split = 0.5;
    }
}

/// A button that explains itself; whether it was clicked.
pub(crate) fn button(ui: &mut Ui, name: &str, title: &str, about: &str) -> bool {
    let response = ui.button(title).on_hover_text(about);
    mark(ui.ctx(), name, response.rect);
    response.clicked()
}

pub(crate) fn show_status(app: &mut App, ctx: &Context) {
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
