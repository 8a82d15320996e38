//! Keys that the whole window heeds, and files that are dropped on it.
//!
//! Questions about a place of the picture, and about the lens.
//!
//! An image that is looked at instead of a scene.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use eframe::egui::{self, Context, Key, KeyboardShortcut, Modifiers};

use super::App;
use crate::document::Edit;
use crate::panels::light_field::LightFieldPanel;
use crate::state::{PathPrompt, PictureCanvas, PixelQuery};
use crate::worker::ScreenPicture;
use etendue::Still;
use serde_json::Value;

const UNDO: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::Z);
const REDO: KeyboardShortcut =
    KeyboardShortcut::new(Modifiers::COMMAND.plus(Modifiers::SHIFT), Key::Z);
const REDO_TOO: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::Y);
const SAVE: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::S);
const OPEN: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::O);
const RENDER: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::R);
const THEME: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::T);
const CLOSE: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::Q);

impl App {
    pub(crate) fn take_drops(&mut self, ctx: &Context) {
        let dropped = ctx.input(|input| input.raw.dropped_files.first().cloned());
        if let Some(path) = dropped.and_then(|file| file.path) {
            self.open(&path);
        }
    }

    pub(crate) fn take_shortcuts(&mut self, ctx: &Context) {
        let pressed = |shortcut: &KeyboardShortcut| ctx.input_mut(|i| i.consume_shortcut(shortcut));
        // The longer one first, of which the shorter is a part.
        if pressed(&REDO) || pressed(&REDO_TOO) {
            self.redo();
        }
        if pressed(&UNDO) {
            self.undo();
        }
        if pressed(&SAVE) {
            self.save();
        }
        if pressed(&OPEN) {
            self.ask_what_to_open();
        }
        if pressed(&RENDER) && self.document.is_some() {
            self.asking = Some((PathPrompt::Render, "out".to_owned()));
        }
        if pressed(&THEME) {
            let theme =
                if ctx.style().visuals.dark_mode { egui::Theme::Light } else { egui::Theme::Dark };
            ctx.set_theme(theme);
        }
        if pressed(&CLOSE) {
            ctx.send_viewport_cmd(egui::ViewportCommand::Close);
        }
    }
}

impl App {
    /// Asks what is seen at a place of the picture.
    pub(crate) fn ask(&mut self, place: [f64; 2]) {
        let probe = self.inspector.as_ref().and_then(|inspector| inspector.probe(place));
        self.asked = Some(PixelQuery { place, probe });
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
        self.lens_curves.forget();
        let document = self.document.as_ref().filter(|_| self.lens.is_some());
        self.written_lens =
            document.and_then(|document| written_lens(document.at("camera.lens"), &document.path));
    }

    /// Asks the pixel at the same place again, after the scene has changed.
    pub(super) fn ask_again(&mut self) {
        if let Some(asked) = &self.asked {
            self.ask(asked.place);
        }
    }

    /// Focuses the lens on what is seen at a place of the picture.
    pub(crate) fn focus(&mut self, ctx: &Context, place: [f64; 2]) {
        let Some(inspector) = &self.inspector else { return };
        if inspector.scene().camera.lens().is_none() {
            let why =
                "this camera has no lens to focus\nhint: choose a type that has, such as thin_lens";
            self.error = Some(why.to_owned());
            return;
        }
        let Some(probe) = inspector.probe(place) else {
            self.said = Some("nothing is there to focus on".to_owned());
            return;
        };
        let edits = [
            Edit::Remove("camera.sensor_distance".into()),
            Edit::set("camera.focus_distance", probe.depth),
        ];
        self.edit(ctx, &edits);
        self.ask(place);
    }
}

impl App {
    /// Shows an image in place of a scene.
    pub(super) fn looked(&mut self, ctx: &Context, path: PathBuf, still: Arc<Still>) {
        let is_same = self.still.as_ref().is_some_and(|(before, _)| *before == path);
        if !is_same {
            self.canvas = PictureCanvas::default();
            (self.asked, self.part, self.error) = (None, None, None);
        }
        (self.document, self.accepted, self.inspector) = (None, None, None);
        (self.frames, self.frame, self.lens) = (None, None, None);
        self.light_field = LightFieldPanel::default();
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
                let shown = ScreenPicture {
                    number,
                    screen,
                    factor: 1,
                    layer,
                    layers,
                    preview,
                    samples,
                    is_final,
                };
                self.show_picture(ctx, shown);
            }
            Err(error) => self.error = Some(error.to_string()),
        }
    }
}

/// The lens as the scene has it, or its file does; whether it is a file's.
fn written_lens(lens: &Value, scene: &Path) -> Option<(Value, bool)> {
    match lens {
        Value::Object(_) => Some((lens.clone(), false)),
        Value::String(path) => {
            let folder = scene.parent().unwrap_or(Path::new(""));
            Some((etendue::lens_values(&folder.join(path)).ok()?, true))
        }
        _ => None,
    }
}
