//! A small window that asks for a path: written, or chosen from what is there.

use std::path::PathBuf;

use eframe::egui::{self, Context, Key};

use super::bar::button;
use crate::app::App;
use crate::form::mark;
use crate::state::{Kinds, Listing, PathPrompt};

pub(crate) fn show(app: &mut App, ctx: &Context) {
    let Some((asking, mut path)) = app.asking.take() else { return };
    let (title, action, kinds) = match asking {
        PathPrompt::Open => ("Open a scene, a model, a lens or an image", "Open", Kinds::Open),
        PathPrompt::SaveAs => ("Save the scene as", "Save", Kinds::Save),
        PathPrompt::Render => ("Render into the folder", "Render", Kinds::Folders),
    };
    let mut is_done = false;
    let mut is_cancelled = ctx.input(|input| input.key_pressed(Key::Escape));
    let modal = egui::Modal::new(egui::Id::new("asking")).show(ctx, |ui| {
        ui.set_width(460.0);
        ui.heading(title);
        let field = ui.add(egui::TextEdit::singleline(&mut path).desired_width(f32::INFINITY));
        mark(ctx, "path", field.rect);
        if !field.has_focus() && !field.lost_focus() {
            field.request_focus();
        }
        let entered = field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
        let chosen = app.listing.show(ui, &mut path, kinds);
        ui.horizontal(|ui| {
            is_done = button(ui, "do it", action, "Enter") || entered || chosen;
            is_cancelled |= button(ui, "let it be", "Cancel", "Escape");
        });
    });
    is_cancelled |= modal.should_close();
    if is_done && !path.trim().is_empty() {
        let path = PathBuf::from(path.trim());
        match asking {
            PathPrompt::Open => app.open(&path),
            PathPrompt::SaveAs => app.save_as(&path),
            PathPrompt::Render => app.render(&path),
        }
    } else if !is_cancelled && !is_done {
        app.asking = Some((asking, path));
        return;
    }
    // The next one looks anew.
    app.listing = Listing::default();
}
