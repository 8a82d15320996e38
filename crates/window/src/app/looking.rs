//! What is asked of a place of the picture, and of the lens.

use eframe::egui::Context;

use super::{App, Asked};
use crate::document::Edit;
use crate::panels;

impl App {
    /// Asks what is seen at a place of the picture.
    pub(crate) fn ask(&mut self, place: [f64; 2]) {
        let probe = self.inspector.as_ref().and_then(|inspector| inspector.probe(place));
        self.asked = Some(Asked { place, probe });
    }

    /// Opens or closes the panel of the lens.
    pub(crate) fn show_lens(&mut self, shows: bool) {
        self.shows_lens = shows;
        self.look_at_lens();
    }

    pub(super) fn look_at_lens(&mut self) {
        let inspector = self.inspector.as_ref().filter(|_| self.shows_lens);
        let lens = inspector.and_then(|inspector| inspector.lens().transpose());
        self.lens = lens.map(|lens| lens.map_err(|error| error.to_string()));
        let document = self.document.as_ref().filter(|_| self.lens.is_some());
        self.written_lens = document.and_then(|document| {
            panels::lens::written(document.at("/camera/lens"), &document.path)
        });
    }

    /// The same place, after the scene has changed.
    pub(super) fn ask_again(&mut self) {
        if let Some(asked) = &self.asked {
            self.ask(asked.place);
        }
    }

    /// Focuses the lens on what is seen at a place of the picture.
    pub(crate) fn focus(&mut self, ctx: &Context, place: [f64; 2]) {
        let Some(inspector) = &self.inspector else { return };
        if inspector.scene().camera.lens().is_none() {
            let why = "this camera has no lens to focus: choose a type that has, such as thin_lens";
            self.error = Some(why.to_owned());
            return;
        }
        let Some(probe) = inspector.probe(place) else {
            self.said = Some("nothing is there to focus on".to_owned());
            return;
        };
        let edits = [
            Edit::Remove("/camera/sensor_distance".to_owned()),
            Edit::set("/camera/focus_distance", probe.depth),
        ];
        self.edit(ctx, &edits);
        self.ask(place);
    }
}
