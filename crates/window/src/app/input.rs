//! Keys that the whole window heeds, and files that are dropped on it.

use eframe::egui::{self, Context, Key, KeyboardShortcut, Modifiers};

use super::{App, Asking};

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
    pub(super) fn take_drops(&mut self, ctx: &Context) {
        let dropped = ctx.input(|input| input.raw.dropped_files.first().cloned());
        if let Some(path) = dropped.and_then(|file| file.path) {
            self.open(&path);
        }
    }

    pub(super) fn take_shortcuts(&mut self, ctx: &Context) {
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
            self.asking = Some((Asking::Render, "out".to_owned()));
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
