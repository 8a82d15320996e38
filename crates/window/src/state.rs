//! State of the window besides the scene: the picture that is shown and the hand on it, the pixel
//! that was asked, what is being asked for, and the folder that is listed.

use std::path::{MAIN_SEPARATOR, PathBuf};
use std::sync::Arc;

use eframe::egui::{self, Key, Rect, ScrollArea, Ui, Vec2};
use etendue::{Preview, Probe, Screen, Viewpoint};

use crate::form::mark;

/// Tool: the action of a click on the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Tool {
    /// Asks the pixel.
    #[default]
    Inspect,
    /// Focuses the lens there.
    Focus,
}

/// The picture that is shown.
pub(crate) struct ShownPicture {
    pub(crate) screen: Screen,
    pub(crate) factor: u32,
    pub(crate) samples: Option<[u32; 2]>,
    /// The wish that it answers, and whether there is none finer to come.
    pub(crate) number: u64,
    pub(crate) layer: String,
    pub(crate) layers: Vec<String>,
    pub(crate) is_final: bool,
    /// Preview that it was made of.
    pub(crate) preview: Option<Arc<Preview>>,
    pub(crate) texture: egui::TextureHandle,
}

/// Query of a pixel: what was asked of it.
#[derive(Debug, Clone)]
pub(crate) struct PixelQuery {
    /// Column and row coordinates (pixels from the picture's corner).
    pub(crate) place: [f64; 2],
    pub(crate) probe: Option<Probe>,
}

/// A window in the window that asks for a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PathPrompt {
    Open,
    SaveAs,
    Render,
}

/// Canvas on which the picture is shown, and the hand on it.
#[derive(Default)]
pub(crate) struct PictureCanvas {
    /// Points per pixel of the screen's fit; 1 shows all of the picture.
    pub(crate) zoom: Option<f32>,
    /// Shift of the picture's middle from the canvas' (points).
    pub(crate) shift: Vec2,
    /// The camera in the hand, and when it was moved last (s).
    pub(crate) hand: Option<(Viewpoint, f64)>,
    /// Keys that are held to fly.
    pub(crate) flying: Vec<Key>,
    /// The left half shows this picture, for comparison.
    pub(crate) before: Option<egui::TextureHandle>,
    /// Position where the two meet, as a share of the width.
    pub(crate) split: f32,
}

impl PictureCanvas {
    /// Lets go of the camera.
    pub(crate) fn release(&mut self) {
        self.hand = None;
    }

    /// Rectangle of the picture of this many columns and rows.
    pub(crate) fn place(&self, canvas: Rect, size: [f32; 2]) -> Rect {
        let fit = (canvas.width() / size[0]).min(canvas.height() / size[1]);
        let size = Vec2::from(size) * fit * self.zoom.unwrap_or(1.0);
        Rect::from_center_size(canvas.center() + self.shift, size)
    }
}

/// More are not read of a folder.
const MOST: usize = 2000;

/// The height of the list (points).
const HEIGHT: f32 = 280.0;

/// The files and folders beside the place that a path names, listed by this program itself, so that it is the same
/// over a remote display, where there is no desktop to ask.
#[derive(Debug, Default)]
pub(crate) struct Listing {
    /// The part of the path up to its last separator, as it was read last.
    folder: Option<String>,
    /// Names and whether each is a folder: folders first, then by name.
    entries: Vec<(String, bool)>,
}

/// A path's folder, with the separator at its end, and the name after it.
fn parts(path: &str) -> (&str, &str) {
    path.split_at(path.rfind(['/', MAIN_SEPARATOR]).map_or(0, |at| at + 1))
}

impl Listing {
    /// Lists what is beside `path`; a click puts a name there. Whether a file was double-clicked.
    pub(crate) fn show(&mut self, ui: &mut Ui, path: &mut String, kinds: Kinds) -> bool {
        let (folder, name) = parts(path);
        if self.folder.as_deref() != Some(folder) {
            self.read(folder);
        }
        let (mut next, mut is_done) = (None, false);
        let wanted = name.to_lowercase();
        let is_named = |entry: &str| kinds != Kinds::Open || entry.to_lowercase().contains(&wanted);
        ScrollArea::vertical().max_height(HEIGHT).auto_shrink([false, true]).show(ui, |ui| {
            if let Some(above) = above(folder)
                && row(ui, "..", true, false).clicked()
            {
                next = Some(above);
            }
            for (entry, is_folder) in &self.entries {
                if (kinds == Kinds::Folders && !is_folder) || !is_named(entry) {
                    continue;
                }
                let row = row(ui, entry, *is_folder, entry == name);
                if row.clicked() {
                    let end = if *is_folder { MAIN_SEPARATOR.to_string() } else { String::new() };
                    next = Some(format!("{folder}{entry}{end}"));
                }
                is_done |= row.double_clicked() && !is_folder;
            }
        });
        if let Some(next) = next {
            *path = next;
        }
        is_done
    }

    /// A folder that cannot be read has nothing in it.
    fn read(&mut self, folder: &str) {
        let place = if folder.is_empty() { PathBuf::from(".") } else { PathBuf::from(folder) };
        let entries = place.read_dir().into_iter().flatten().take(MOST).flatten();
        let entries = entries.filter_map(|entry| {
            let name = entry.file_name().into_string().ok()?;
            (!name.starts_with('.')).then(|| (name, entry.path().is_dir()))
        });
        self.entries = entries.collect();
        self.entries.sort_by_cached_key(|(name, is_folder)| (!is_folder, name.to_lowercase()));
        self.folder = Some(folder.to_owned());
    }
}

/// Kinds of path that are asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kinds {
    /// A file that is there, whose name has what was written of it.
    Open,
    /// A file that may be there.
    Save,
    Folders,
}

fn row(ui: &mut Ui, name: &str, is_folder: bool, is_chosen: bool) -> eframe::egui::Response {
    let title = if is_folder { format!("{name}{MAIN_SEPARATOR}") } else { name.to_owned() };
    let row = ui.selectable_label(is_chosen, title);
    mark(ui.ctx(), &format!("entry={name}"), row.rect);
    row
}

/// The folder that `folder` lies in, if there is one.
fn above(folder: &str) -> Option<String> {
    let place =
        if folder.is_empty() { std::env::current_dir().ok()? } else { PathBuf::from(folder) };
    let above = place.canonicalize().ok()?.parent()?.join("");
    Some(above.to_str()?.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_a_folder_and_a_name() {
        assert_eq!(parts("scenes/cube.json"), ("scenes/", "cube.json"));
        assert_eq!(parts("/cube.json"), ("/", "cube.json"));
        assert_eq!(parts("cube"), ("", "cube"));
        assert_eq!(parts("a/b/"), ("a/b/", ""));
    }

    #[test]
    fn a_folder_is_listed_with_folders_first_and_without_what_is_hidden() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.json", "A.json", ".hidden"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        std::fs::create_dir(folder.path().join("z")).unwrap();
        let mut listing = Listing::default();
        listing.read(folder.path().join("").to_str().unwrap());
        let names: Vec<_> = listing.entries.iter().map(|(name, _)| &**name).collect();
        assert_eq!(names, ["z", "A.json", "b.json"]);
        let above = above(folder.path().join("z").join("").to_str().unwrap()).unwrap();
        assert_eq!(PathBuf::from(above), folder.path().canonicalize().unwrap());
        listing.read("/no/such/folder/");
        assert!(listing.entries.is_empty());
    }

    #[test]
    fn a_picture_fits_into_the_canvas() {
        let canvas = Rect::from_min_size(egui::Pos2::new(100.0, 50.0), Vec2::new(400.0, 400.0));
        let place = PictureCanvas::default().place(canvas, [200.0, 100.0]);
        assert_eq!(place.center(), canvas.center());
        assert_eq!(place.size(), Vec2::new(400.0, 200.0));
    }
}
