//! The window's state, and how news and input change it.

mod actions;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use eframe::egui::{self, Context};
use etendue::{Inspector, LensView, Options, Screen, Still, Viewpoint};
use serde_json::Value;

use crate::document::{Document, Edit, FirstScene, View};
use crate::form::Form;
use crate::panels::lens_curves::LensCurves;
use crate::panels::light_field::{LightFieldPanel, LightFieldPart};
use crate::state::{Listing, PathPrompt, PictureCanvas, PixelQuery, ShownPicture, Tool};
use crate::worker::{Kind, News, ScreenPicture, Task, Wake, Wish, Worker};

/// All of the window.
pub(crate) struct App {
    worker: Worker,
    pub(crate) form: Form,
    pub(crate) document: Option<Document>,
    /// The image that is looked at instead of a scene, and its file.
    pub(crate) still: Option<(PathBuf, Arc<Still>)>,
    pub(crate) view: View,
    pub(crate) part: Option<String>,
    pub(crate) tool: Tool,
    pub(crate) canvas: PictureCanvas,
    pub(crate) picture: Option<ShownPicture>,
    pub(crate) inspector: Option<Inspector>,
    pub(crate) asked: Option<PixelQuery>,
    /// The camera's lens, while its panel is open.
    pub(crate) lens: Option<Result<LensView, String>>,
    pub(crate) shows_lens: bool,
    /// Its curves in waves.
    pub(crate) lens_curves: LensCurves,
    /// The lens as the scene or its file has it, and whether that is a file's.
    pub(crate) written_lens: Option<(Value, bool)>,
    pub(crate) light_field: LightFieldPanel,
    /// Frames of the scene, and the one that is shown.
    pub(crate) frames: Option<usize>,
    pub(crate) frame: Option<usize>,
    pub(crate) error: Option<String>,
    /// The error is of a wish, and goes with the next one that makes sense.
    is_refusal: bool,
    pub(crate) said: Option<String>,
    pub(crate) busy: Option<(&'static str, f64)>,
    /// The user has stopped what there was to do since the last wish.
    pub(crate) is_stopped: bool,
    pub(crate) asking: Option<(PathPrompt, String)>,
    /// Entries to choose from, while a path is asked for.
    pub(crate) listing: Listing,
    /// The window's title.
    pub(crate) titled: String,
    /// The number of the last wish, and of the last one that was accepted.
    number: u64,
    accepted: Option<(u64, Arc<Value>)>,
}

/// Pixels are seen as squares when they are enlarged.
const PIXELS: egui::TextureOptions = egui::TextureOptions {
    magnification: egui::TextureFilter::Nearest,
    minification: egui::TextureFilter::Linear,
    ..egui::TextureOptions::NEAREST
};

fn image_of(screen: &Screen) -> egui::ColorImage {
    egui::ColorImage::from_rgba_unmultiplied(screen.size, &screen.rgba)
}

impl App {
    pub(crate) fn new(
        path: Option<PathBuf>,
        options: Options,
        wake: Wake,
    ) -> std::io::Result<Self> {
        let worker = Worker::start(options, wake)?;
        if let Some(path) = path {
            worker.ask(Task::Open(path));
        }
        Ok(Self {
            worker,
            form: Form::new(etendue::scene_schema()),
            document: None,
            still: None,
            view: View::default(),
            part: None,
            tool: Tool::default(),
            canvas: PictureCanvas::default(),
            picture: None,
            inspector: None,
            asked: None,
            lens: None,
            shows_lens: false,
            lens_curves: LensCurves::default(),
            written_lens: None,
            light_field: LightFieldPanel::default(),
            frames: None,
            frame: None,
            error: None,
            is_refusal: false,
            said: None,
            busy: None,
            is_stopped: false,
            asking: None,
            listing: Listing::default(),
            titled: String::new(),
            number: 0,
            accepted: None,
        })
    }

    /// The file, whether all of it is saved, and whether its picture is whole.
    pub(crate) fn title(&self) -> String {
        let name_of = |path: &Path| path.file_name().unwrap_or_default().display().to_string();
        let document = match (&self.document, &self.still) {
            (Some(document), _) => document,
            (None, Some((path, _))) => return format!("{} - etendue", name_of(path)),
            (None, None) => return "etendue".to_owned(),
        };
        let name = name_of(&document.path);
        let changed = if document.is_changed() { "*" } else { "" };
        let working = if self.is_settled() { "" } else { " (rendering)" };
        format!("{name}{changed}{working} - etendue")
    }

    pub(crate) fn take_news(&mut self, ctx: &Context) {
        let news: Vec<News> = self.worker.news().collect();
        for news in news {
            match news {
                News::Opened(path, kind, scene) => self.opened(path, kind, scene),
                News::Looked(path, still) => self.looked(ctx, path, still),
                News::TakenUp(saved, scene) => {
                    if let Some(document) = &mut self.document {
                        document.take_up(saved, scene);
                        self.said = Some("the file has changed, and was read again".to_owned());
                    }
                }
                News::Accepted(number, scene, inspector, frames) => {
                    self.accepted = Some((number, scene));
                    self.inspector = Some(inspector);
                    self.frames = frames;
                    if number == self.number && self.is_refusal {
                        self.error = None;
                    }
                    self.ask_again();
                    self.look_at_lens();
                }
                News::Refused(number, why) => self.refused(number, why),
                News::Shown(shown) => self.shown(ctx, *shown),
                News::Busy(phase, share) => self.busy = Some((phase, share)),
                News::Idle => self.busy = None,
                News::Saved(path, scene) => {
                    self.said = Some(format!("saved {}", path.display()));
                    if let Some(document) = &mut self.document {
                        document.saved_to(path, &scene);
                    }
                    self.refine();
                }
                News::Written(folder, count) => {
                    self.said = Some(format!("wrote {count} files into {}", folder.display()));
                    // The session rendered the whole scene; back to what is looked at.
                    self.wish();
                }
                News::Fault(why) => {
                    (self.error, self.is_refusal) = (Some(why), false);
                    self.refine();
                }
            }
        }
    }

    fn opened(&mut self, path: PathBuf, kind: Kind, scene: Arc<Value>) {
        let is_same = self.document.as_ref().is_some_and(|document| **document.value() == *scene);
        if is_same {
            // It was saved under this name.
            if let Some(document) = &mut self.document {
                (document.path, document.is_scene) = (path, kind == Kind::Scene);
            }
        } else {
            self.document = Some(Document::new(path, kind == Kind::Scene, scene));
            self.still = None;
            // Who opens a lens wants to see it.
            self.shows_lens |= kind == Kind::Lens;
            (self.asked, self.frame, self.part, self.error) = (None, None, None, None);
            (self.view, self.accepted) = (View::default(), None);
            self.light_field = LightFieldPanel::default();
            self.canvas = PictureCanvas::default();
        }
        self.wish();
    }

    fn refused(&mut self, number: u64, why: String) {
        if number < self.number {
            return;
        }
        (self.error, self.is_refusal) = (Some(why), true);
        if let (Some(document), Some((last, accepted))) = (&mut self.document, &self.accepted)
            && *last != number
        {
            document.refuse(accepted);
        }
    }

    fn shown(&mut self, ctx: &Context, shown: ScreenPicture) {
        if self.document.is_none() {
            return;
        }
        self.show_picture(ctx, shown);
        self.light_field.renew();
        if self.light_field.shows != LightFieldPart::Raw {
            self.show_light_field(ctx);
        }
    }

    fn show_picture(&mut self, ctx: &Context, shown: ScreenPicture) {
        let ScreenPicture { number, screen, factor, samples, layer, is_final, preview, .. } = shown;
        let before = self.picture.take();
        let layers = match (preview.is_some(), &before) {
            // Between two passes the layers are those of the picture before.
            (false, Some(before)) if shown.layers.is_empty() => before.layers.clone(),
            _ => shown.layers,
        };
        let image = image_of(&screen);
        let texture = match before {
            Some(before) => {
                let mut texture = before.texture;
                texture.set(image, PIXELS);
                texture
            }
            None => ctx.load_texture("picture", image, PIXELS),
        };
        self.picture = Some(ShownPicture {
            screen,
            factor,
            samples,
            number,
            layer,
            layers,
            is_final,
            preview,
            texture,
        });
    }

    /// Shows what is wanted of a light field in place of its raw picture.
    pub(crate) fn show_light_field(&mut self, ctx: &Context) {
        let Some(picture) = &mut self.picture else { return };
        let preview = picture.preview.as_deref();
        let screen = self.light_field.screen(preview).and_then(|screen| match (screen, preview) {
            (Some(screen), _) => Ok(Some(screen)),
            (None, Some(preview)) => preview.screen(&picture.layer).map(Some),
            (None, None) => Ok(None),
        });
        match screen {
            Ok(Some(screen)) => {
                picture.texture.set(image_of(&screen), PIXELS);
                picture.screen = screen;
            }
            Ok(None) => {}
            Err(error) => self.error = Some(error.to_string()),
        }
        ctx.request_repaint();
    }

    /// Asks for a file to open, beside the one that is.
    pub(crate) fn ask_what_to_open(&mut self) {
        let file = self.document.as_ref().map(|document| &document.path);
        let file = file.or(self.still.as_ref().map(|(path, _)| path));
        let folder =
            file.and_then(|path| path.parent()).filter(|folder| **folder != *Path::new(""));
        let folder = folder.map(|folder| folder.join("").display().to_string());
        self.asking = Some((PathPrompt::Open, folder.unwrap_or_default()));
    }

    pub(crate) fn open(&mut self, path: &Path) {
        self.worker.ask(Task::Open(path.to_owned()));
    }

    /// Opens a scene that is built in: it stands in no file until it is saved.
    pub(crate) fn begin(&mut self, first: &FirstScene) {
        self.error = None;
        self.worker.ask(Task::Begin(first.name, first.json));
    }

    pub(crate) fn save(&mut self) {
        let Some(document) = &self.document else { return };
        let own = document.own_file();
        match document.is_scene {
            true => self.save_as(&own),
            // A model or a lens is no scene: a new file is made beside it.
            false => self.asking = Some((PathPrompt::SaveAs, own.display().to_string())),
        }
    }

    pub(crate) fn save_as(&mut self, path: &Path) {
        if let Some(document) = &self.document {
            self.worker.ask(Task::Save(path.to_owned(), Arc::clone(document.value())));
        }
    }

    pub(crate) fn render(&mut self, folder: &Path) {
        if let Some(document) = &self.document {
            let scene = Arc::clone(document.value());
            self.worker.ask(Task::Render(folder.to_owned(), scene, self.frame));
        }
    }

    pub(crate) fn cancel(&mut self) {
        self.is_stopped = true;
        self.worker.cancel();
    }

    pub(crate) fn undo(&mut self) {
        if let Some(document) = &mut self.document {
            document.undo();
            self.canvas.release();
            self.wish();
        }
    }

    pub(crate) fn redo(&mut self) {
        if let Some(document) = &mut self.document {
            document.redo();
            self.canvas.release();
            self.wish();
        }
    }

    /// Changes the scene, and asks for its picture.
    pub(crate) fn edit(&mut self, ctx: &Context, edits: &[Edit]) {
        let now = ctx.input(|input| input.time);
        if let Some(document) = &mut self.document
            && document.apply(edits, now)
        {
            self.wish();
        }
    }

    /// Asks for the picture of the scene as it is now.
    pub(crate) fn wish(&mut self) {
        let Some(document) = &self.document else { return };
        self.number += 1;
        self.is_stopped = false;
        self.worker.wish(Wish {
            number: self.number,
            scene: Arc::clone(document.value()),
            view: self.view.clone(),
            part: self.part.clone(),
            frame: self.frame,
        });
    }

    /// Goes on with a picture that a task has interrupted.
    fn refine(&mut self) {
        if !self.is_settled() {
            self.wish();
        }
    }

    pub(crate) fn look_at(&mut self, view: View) {
        if self.view != view {
            (self.view, self.part) = (view, None);
            self.wish();
        }
    }

    /// True if the picture is that of the scene as it is now, as fine as it gets.
    pub(crate) fn is_settled(&self) -> bool {
        self.picture.as_ref().is_some_and(|p| p.is_final && p.number == self.number)
    }

    /// Description of what it is at, for those who wait.
    #[cfg(test)]
    pub(crate) fn state(&self) -> String {
        let picture = self.picture.as_ref().map(|p| (p.number, p.factor, p.is_final));
        let accepted = self.accepted.as_ref().map(|(number, _)| number);
        let (number, busy, error) = (self.number, self.busy, &self.error);
        format!("wish {number}, accepted {accepted:?}, picture {picture:?}, {busy:?}, {error:?}")
    }

    /// True if the renderer has not reached the last wish.
    pub(crate) fn is_behind(&self) -> bool {
        self.accepted.as_ref().is_none_or(|(number, _)| *number < self.number)
    }

    /// Viewpoint of the camera, as the picture shows it or as it was asked for since.
    pub(crate) fn viewpoint(&self) -> Option<Viewpoint> {
        let inspector = self.inspector.as_ref()?;
        Some(inspector.viewpoint(self.asked.as_ref().and_then(|asked| asked.probe.as_ref())))
    }

    /// Moves the camera.
    pub(crate) fn stand(&mut self, ctx: &Context, viewpoint: &Viewpoint) {
        let Some(document) = &self.document else { return };
        let mut edits = vec![Edit::set("camera.pose", viewpoint.pose())];
        // A camera that frames the scene by itself focuses by itself: it stays focused where it is.
        let camera = document.at("camera");
        let is_free = camera["focus_distance"].is_null() && camera["sensor_distance"].is_null();
        let lens = self.inspector.as_ref().and_then(|inspector| inspector.scene().camera.lens());
        if let (true, true, Some(lens)) = (camera["pose"].is_null(), is_free, lens) {
            let distance = lens.focused().object_distance();
            if distance.is_finite() && distance > 0.0 {
                edits.push(Edit::set("camera.focus_distance", distance));
            }
        }
        self.edit(ctx, &edits);
    }
}
