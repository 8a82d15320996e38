//! An image that is looked at instead of a scene.

use std::path::PathBuf;
use std::sync::Arc;

use eframe::egui::Context;
use etendue::Still;

use super::App;
use crate::canvas::Canvas;
use crate::panels::light_field::LightField;
use crate::worker::Shown;

impl App {
    /// Shows an image in place of a scene.
    pub(super) fn looked(&mut self, ctx: &Context, path: PathBuf, still: Arc<Still>) {
        let is_same = self.still.as_ref().is_some_and(|(before, _)| *before == path);
        if !is_same {
            self.canvas = Canvas::default();
            (self.asked, self.part, self.error) = (None, None, None);
        }
        (self.document, self.accepted, self.inspector) = (None, None, None);
        (self.frames, self.frame, self.lens) = (None, None, None);
        self.light_field = LightField::default();
        self.still = Some((path, still));
        self.show_still(ctx);
    }

    /// Shows the layer of the image that was chosen, else its first.
    pub(crate) fn show_still(&mut self, ctx: &Context) {
        let Some((_, still)) = self.still.clone() else { return };
        let layers: Vec<String> = still.layers().iter().map(|layer| layer.name.clone()).collect();
        let wanted = self.part.clone().filter(|name| layers.contains(name));
        let layer = wanted.or(layers.first().cloned()).unwrap_or_default();
        match still.screen(&layer) {
            Ok(screen) => {
                let number = self.number;
                let (samples, preview, is_final) = (None, None, true);
                let shown =
                    Shown { number, screen, factor: 1, layer, layers, preview, samples, is_final };
                self.show_picture(ctx, shown);
            }
            Err(error) => self.error = Some(error.to_string()),
        }
    }
}
