//! One pass of the user interface: the picture in the middle, and what stands around it.

use eframe::egui::{self, Context};

use crate::app::App;

pub(crate) mod asking;
pub(crate) mod bar;
pub(crate) mod canvas;
pub(crate) mod inspect;
pub(crate) mod lens;
pub(crate) mod lens_curves;
pub(crate) mod light_field;
pub(crate) mod start;

/// Takes what has come, shows all, and changes what the user changes.
pub(crate) fn show(app: &mut App, ctx: &Context) {
    app.take_news(ctx);
    app.take_drops(ctx);
    app.take_shortcuts(ctx);
    bar::show_bar(app, ctx);
    bar::show_status(app, ctx);
    lens::show(app, ctx);
    inspect::show_scene(app, ctx);
    inspect::show_inspect(app, ctx);
    egui::CentralPanel::default().frame(egui::Frame::NONE).show(ctx, |ui| {
        canvas::show(app, ui);
    });
    asking::show(app, ctx);
    let title = app.title();
    if title != app.titled {
        ctx.send_viewport_cmd(egui::ViewportCommand::Title(title.clone()));
        app.titled = title;
    }
}

impl eframe::App for App {
    fn update(&mut self, ctx: &Context, _frame: &mut eframe::Frame) {
        show(self, ctx);
    }
}
