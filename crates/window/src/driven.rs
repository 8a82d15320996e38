//! The window, driven as by a user: events go in, and what it shows and says is looked at. Nothing is
//! drawn; that is for a real window (`scripts/window.sh`).

mod images;
mod lenses;
mod light_fields;
mod measured;
mod start;
mod tasks;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use eframe::egui::{self, Event, Key, Modifiers, PointerButton, Pos2, Rect, Vec2};
use etendue::{Options, Progress, Session};
use serde_json::{Value, json};

use crate::app::App;
use crate::document::{Edit, View};
use crate::form::marked;
use crate::panels;
use crate::state::Tool;

/// Time that anything may take before a test gives up.
const PATIENCE: Duration = Duration::from_secs(60);

/// A window of 1200 by 800 points that nobody sees.
struct Driver {
    app: App,
    ctx: egui::Context,
    time: f64,
}

impl Driver {
    fn open(path: &Path) -> Self {
        Self::start(Some(path.to_owned()))
    }

    fn start(path: Option<PathBuf>) -> Self {
        let app = App::new(path, Options::default(), Arc::new(|| {})).unwrap();
        let mut driver = Self { app, ctx: egui::Context::default(), time: 0.0 };
        driver.step(Vec::new());
        driver
    }

    /// One pass with events, a sixtieth of a second after the last.
    fn step(&mut self, events: Vec<Event>) {
        self.pass(egui::RawInput { events, ..Default::default() });
    }

    fn pass(&mut self, input: egui::RawInput) {
        self.time += 1.0 / 60.0;
        let screen_rect = Some(Rect::from_min_size(Pos2::ZERO, Vec2::new(1200.0, 800.0)));
        let input = egui::RawInput { screen_rect, time: Some(self.time), ..input };
        let app = &mut self.app;
        let _ = self.ctx.clone().run(input, |ctx| panels::show(app, ctx));
    }

    fn until(&mut self, what: &str, is_so: impl Fn(&App) -> bool) {
        let start = Instant::now();
        loop {
            self.step(Vec::new());
            if is_so(&self.app) {
                return;
            }
            let state = self.app.state();
            assert!(start.elapsed() < PATIENCE, "never: {what}; the window says {state}");
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    fn settle(&mut self) {
        self.until("a finished picture", |app| app.is_settled() || app.error.is_some());
        assert_eq!(self.app.error, None);
        // Layout takes in what was told.
        self.step(Vec::new());
    }

    fn place_of(&self, name: &str) -> Pos2 {
        marked(&self.ctx, name).unwrap_or_else(|| panic!("no widget {name}")).center()
    }

    fn click(&mut self, name: &str) {
        // A panel that has just appeared finds its size in the next pass.
        self.step(Vec::new());
        self.click_at(self.place_of(name));
    }

    fn click_at(&mut self, pos: Pos2) {
        let button = |pressed| Event::PointerButton {
            pos,
            button: PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        };
        self.step(vec![Event::PointerMoved(pos)]);
        self.step(vec![button(true)]);
        self.step(vec![button(false)]);
        self.step(Vec::new());
        // The next click is no double click.
        self.time += 1.0;
    }

    fn drag(&mut self, from: Pos2, by: Vec2) {
        let button = |pos, pressed| Event::PointerButton {
            pos,
            button: PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        };
        self.step(vec![Event::PointerMoved(from)]);
        self.step(vec![button(from, true)]);
        for share in 1..=10_u8 {
            self.step(vec![Event::PointerMoved(from + by * (f32::from(share) / 10.0))]);
        }
        self.step(vec![button(from + by, false)]);
        self.step(Vec::new());
    }

    /// Types a number into a widget for numbers.
    fn enter(&mut self, name: &str, text: &str) {
        self.click(name);
        self.press(Key::A, Modifiers::COMMAND);
        self.step(vec![Event::Text(text.to_owned())]);
        self.press(Key::Enter, Modifiers::NONE);
    }

    fn press(&mut self, key: Key, modifiers: Modifiers) {
        for pressed in [true, false] {
            let event = Event::Key { key, physical_key: None, pressed, repeat: false, modifiers };
            self.pass(egui::RawInput { events: vec![event], modifiers, ..Default::default() });
        }
        self.step(Vec::new());
    }

    fn drop_file(&mut self, path: &Path) {
        let file = egui::DroppedFile { path: Some(path.to_owned()), ..Default::default() };
        self.pass(egui::RawInput { dropped_files: vec![file], ..Default::default() });
    }

    fn value(&self, path: &str) -> Value {
        self.app.document.as_ref().unwrap().at(path).clone()
    }

    fn pixels(&self) -> Vec<u8> {
        self.app.picture.as_ref().unwrap().screen.rgba.clone()
    }

    /// A place of the picture (shares of its sides) in the window.
    fn at(&self, x: f32, y: f32) -> Pos2 {
        let place = marked(&self.ctx, "picture").expect("a picture is shown");
        place.min + place.size() * Vec2::new(x, y)
    }
}

/// A ball before a patterned wall, seen by a lens that is wide open.
fn scene() -> Value {
    json!({
        "etendue": 1,
        "camera": {
            "type": "thin_lens", "focal_length": "50 mm", "f_number": 1.4, "focus_distance": "2 m",
            "pose": {"from": [0, 0, 2], "look_at": [0, 0, 0]},
            "sensor": {"type": "raw", "model": "imx183", "pixel_pitch": 375, "resolution": [96, 64]}
        },
        "tracer": {"type": "facing"},
        "layers": ["depth"],
        "render": {"samples": 8},
        "objects": [
            {"name": "ball", "shape": "sphere", "radius": 0.25, "material": "red"},
            {"name": "wall", "shape": "rectangle", "width": 8, "height": 8, "material": "squares",
             "transform": {"translate": [0, 0, -4]}}
        ],
        "materials": {
            "red": {"type": "matte", "color": [0.8, 0.1, 0.1]},
            "squares": {"type": "checker", "colors": [[0.9, 0.9, 0.9], [0.1, 0.1, 0.1]], "squares": 40}
        }
    })
}

fn scene_file(folder: &Path) -> PathBuf {
    let path = folder.join("scene.json");
    fs::write(&path, scene().to_string()).unwrap();
    path
}

#[test]
fn a_smaller_opening_changes_the_picture_and_can_be_undone() {
    let folder = tempfile::tempdir().unwrap();
    let mut window = Driver::open(&scene_file(folder.path()));
    window.settle();
    let wide = window.pixels();
    window.enter("/camera/f_number", "16");
    assert_eq!(window.value("camera.f_number"), json!(16.0));
    window.settle();
    let narrow = window.pixels();
    assert_ne!(wide, narrow, "the wall behind the plane in focus is sharper");
    window.press(Key::Z, Modifiers::COMMAND);
    assert_eq!(window.value("camera.f_number"), json!(1.4));
    window.settle();
    assert_eq!(window.pixels(), wide, "to the bit as before");
    window.press(Key::Z, Modifiers::COMMAND | Modifiers::SHIFT);
    window.settle();
    assert_eq!(window.pixels(), narrow);
}

#[test]
fn a_click_focuses_and_the_pixel_tells_what_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let mut window = Driver::open(&scene_file(folder.path()));
    window.settle();
    window.click("tool=focus");
    assert_eq!(window.app.tool, Tool::Focus);
    // Beside the ball, on the wall: 6 m away along the axis.
    window.click_at(window.at(0.9, 0.2));
    let distance = window.value("camera.focus_distance").as_f64().unwrap();
    assert!((distance - 6.0).abs() < 1e-9, "a plane across the axis: {distance}");
    window.settle();
    let asked = window.app.asked.clone().unwrap().probe.unwrap();
    assert_eq!((&*asked.object, &*asked.material), ("wall", "squares"));
    window.click("tool=inspect");
    window.click_at(window.at(0.5, 0.5));
    let asked = window.app.asked.clone().unwrap();
    let probe = asked.probe.unwrap();
    assert_eq!(probe.object, "ball");
    // A tessellated sphere lies within its radius, by less than this for its thousands of triangles.
    assert!((probe.depth - 1.75).abs() < 1e-3, "{}", probe.depth);
    let reading = window.app.picture.as_ref().unwrap().preview.as_ref().unwrap();
    let reading = reading.reading(asked.place).unwrap();
    assert!(reading.iter().any(|(_, value)| value.ends_with(" DN")), "{reading:?}");
    assert!(reading.iter().any(|(_, value)| value.ends_with(" e\u{207b}")), "{reading:?}");
}

#[test]
fn keys_fly_and_shortcuts_do_not() {
    let folder = tempfile::tempdir().unwrap();
    let mut window = Driver::open(&scene_file(folder.path()));
    window.settle();
    window.step(vec![Event::PointerMoved(window.at(0.5, 0.5))]);
    let key = |pressed, modifiers| {
        let (key, physical_key, repeat) = (Key::S, None, false);
        let event = Event::Key { key, physical_key, pressed, repeat, modifiers };
        egui::RawInput { events: vec![event], modifiers, ..Default::default() }
    };
    // Ctrl is let go before S.
    window.pass(key(true, Modifiers::COMMAND));
    (0..5).for_each(|_| window.step(Vec::new()));
    window.pass(key(false, Modifiers::NONE));
    assert_eq!(window.value("camera.pose.from"), json!([0, 0, 2]));
    window.pass(key(true, Modifiers::NONE));
    (0..5).for_each(|_| window.step(Vec::new()));
    window.pass(key(false, Modifiers::NONE));
    let back = window.value("camera.pose.from");
    assert!(back[2].as_f64().unwrap() > 2.0, "{back}");
    (0..5).for_each(|_| window.step(Vec::new()));
    assert_eq!(window.value("camera.pose.from"), back, "it stops when the key is let go");
}

#[test]
fn what_is_saved_renders_to_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let mut window = Driver::open(&scene_file(folder.path()));
    window.settle();
    window.enter("/camera/f_number", "5.6");
    window.drag(window.at(0.5, 0.5), Vec2::new(40.0, 16.0));
    assert_ne!(window.value("camera.pose.from"), json!([0, 0, 2]), "the drag turned the camera");
    window.settle();
    assert_eq!(window.app.title(), "scene.json* - etendue");
    window.press(Key::S, Modifiers::COMMAND);
    window.until("saved", |app| app.document.as_ref().is_some_and(|d| !d.is_changed()));
    let saved = folder.path().join("scene.json");
    let again = Session::open(&saved).unwrap().render(&Progress::none()).unwrap();
    let shown = window.app.picture.as_ref().unwrap().preview.clone().unwrap();
    let planes = |layers: &[etendue::Layer]| -> Vec<Vec<u64>> {
        let bits = |values: &etendue::Values| {
            (0..values.len()).map(|i| values.at(i).to_bits()).collect::<Vec<_>>()
        };
        let picture = layers.iter().find(|layer| layer.name.is_empty()).unwrap();
        picture.channels.iter().map(|channel| bits(&channel.values)).collect()
    };
    assert_eq!(planes(again.layers()), planes(shown.layers()));
    let shot = again.exposures().next().unwrap();
    assert_eq!(
        again.raw(shot).unwrap().as_ref(),
        shown.raw().unwrap(),
        "the sensor's numbers, too"
    );
    assert!(again.layer("Depth").is_some(), "layers that were not looked at are in the file");
}

#[test]
fn views_show_layers_and_the_sensor() {
    let folder = tempfile::tempdir().unwrap();
    let mut window = Driver::open(&scene_file(folder.path()));
    window.settle();
    let picture = window.pixels();
    let layers = ["normal", "ids"].map(|name| View::Layer(name.to_owned()));
    for view in [View::Sensor, View::Numbers].into_iter().chain(layers) {
        window.app.look_at(view.clone());
        window.settle();
        assert_ne!(window.pixels(), picture, "{view:?}");
        assert_eq!(window.app.error, None, "{view:?}");
    }
    window.app.look_at(View::Layer("depth".into()));
    window.settle();
    let scale = window.app.picture.as_ref().unwrap().screen.scale.unwrap();
    assert!(scale.near < 1.9 && (scale.far - 6.0).abs() < 1e-9, "{scale:?}");
    assert_eq!(window.value("layers"), json!(["depth"]), "looking changes no scene");
}

#[test]
fn what_makes_no_sense_is_refused_and_said() {
    let folder = tempfile::tempdir().unwrap();
    let mut window = Driver::open(&scene_file(folder.path()));
    window.settle();
    window.enter("/camera/f_number", "-3");
    window.until("an error", |app| app.error.is_some());
    let error = window.app.error.clone().unwrap();
    assert!(error.contains("f_number"), "{error}");
    assert_eq!(window.value("camera.f_number"), json!(1.4), "the scene is as it was");
    assert!(!window.app.document.as_ref().unwrap().can_undo());
}

#[test]
fn a_broken_file_leaves_what_was_open() {
    let folder = tempfile::tempdir().unwrap();
    let mut window = Driver::open(&scene_file(folder.path()));
    window.settle();
    let broken = folder.path().join("broken.json");
    fs::write(&broken, "{ \"etendue\": 1, \"camera\": ").unwrap();
    window.drop_file(&broken);
    window.until("an error", |app| app.error.is_some());
    let error = window.app.error.clone().unwrap();
    assert!(error.contains("broken.json"), "{error}");
    assert_eq!(window.app.document.as_ref().unwrap().path, folder.path().join("scene.json"));
    window.until("the picture stays, or is refined again", App::is_settled);
    assert!(window.app.error.is_some(), "what was said stays");
    window.click("dismiss");
    assert_eq!(window.app.error, None);
}

#[test]
fn another_camera_comes_with_what_it_needs() {
    let folder = tempfile::tempdir().unwrap();
    let mut window = Driver::open(&scene_file(folder.path()));
    window.settle();
    window.click("/camera/type");
    window.click("/camera/type=pinhole");
    let camera = window.value("camera");
    assert_eq!(camera["type"], "pinhole");
    assert_eq!(camera["pose"], scene()["camera"]["pose"], "what both have stays");
    assert!(camera.get("f_number").is_none(), "{camera}");
    window.settle();
    assert_eq!(window.app.error, None);
}

#[test]
fn a_file_that_changes_is_taken_up_under_the_edits() {
    let folder = tempfile::tempdir().unwrap();
    let path = scene_file(folder.path());
    let mut window = Driver::open(&path);
    window.settle();
    window.enter("/camera/f_number", "8");
    window.settle();
    let mut changed = scene();
    changed["materials"]["red"]["color"] = json!([0.1, 0.8, 0.1]);
    changed["comment"] = json!("of another length, so that no clock has to tell");
    fs::write(&path, changed.to_string()).unwrap();
    window.until("the new colour", |app| {
        let document = app.document.as_ref().unwrap();
        document.at("materials.red.color") == &json!([0.1, 0.8, 0.1])
    });
    assert_eq!(window.value("camera.f_number"), json!(8.0), "the edit stays");
    assert!(window.app.document.as_ref().unwrap().is_changed());
}

#[test]
fn frames_are_a_timeline() {
    let folder = tempfile::tempdir().unwrap();
    let mut moving = scene();
    moving["frames"] = json!([{"camera.pose.from": [0, 0, 2]}, {"camera.pose.from": [1, 0, 2]}]);
    let path = folder.path().join("moving.json");
    fs::write(&path, moving.to_string()).unwrap();
    let mut window = Driver::open(&path);
    window.settle();
    assert_eq!(window.app.frames, Some(2), "{:?}", window.app.error);
    let first = window.pixels();
    window.app.frame = Some(1);
    window.app.wish();
    window.settle();
    assert_ne!(window.pixels(), first);
}

#[test]
fn closing_during_a_render_ends_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("slow.json");
    let mut slow = scene();
    slow["tracer"] = json!({"type": "path"});
    slow["render"]["samples"] = json!(1_000_000);
    fs::write(&path, slow.to_string()).unwrap();
    let mut window = Driver::open(&path);
    window.until("a first picture", |app| app.picture.is_some());
    assert!(!window.app.is_settled());
    // Its samples would take hours.
    let start = Instant::now();
    drop(window);
    assert!(start.elapsed() < PATIENCE);
}
