//! The window before there is a picture: scenes to begin with, broken files, files that take long, names of what goes.

use super::*;
use crate::document::FIRST_SCENES;

#[test]
fn every_first_scene_becomes_a_picture_and_is_saved_where_one_says() {
    let folder = tempfile::tempdir().unwrap();
    for first in &FIRST_SCENES {
        let mut window = Driver::start(None);
        window.click(&format!("first={}", first.name));
        window.until("a picture", |app| app.picture.is_some() || app.error.is_some());
        assert_eq!(window.app.error, None, "{}", first.name);
        window.press(Key::S, Modifiers::COMMAND);
        assert!(window.app.asking.is_some(), "it stands in no file, so a place is asked for");
        let path = folder.path().join(first.name);
        window.app.asking = None;
        window.app.save_as(&path);
        window.until("a file", |app| app.said.is_some() || app.error.is_some());
        assert_eq!(window.app.error, None, "{}", first.name);
        let saved: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
        let built_in: Value = serde_json::from_str(first.json).unwrap();
        assert_eq!(saved["objects"], built_in["objects"]);
        Session::open(&path).unwrap();
    }
}

#[test]
fn a_broken_file_at_first_says_what_the_command_line_says() {
    let folder = tempfile::tempdir().unwrap();
    let broken = folder.path().join("broken.json");
    fs::write(&broken, "{\n  \"etendue\": 1,\n  \"camera\": { \"fov\": \"wide\" }\n}\n").unwrap();
    let mut window = Driver::open(&broken);
    window.until("an error", |app| app.error.is_some());
    let error = window.app.error.clone().unwrap();
    assert!(error.contains("broken.json, line 3, column"), "{error}");
    let message = match Session::open(&broken)
        .and_then(|mut session| session.scene(&Progress::none()).map(|_| ()))
    {
        Err(error) => error.message(),
        Ok(()) => panic!("it is broken"),
    };
    assert_eq!(error, message);
    // There still is something to begin with.
    window.click(&format!("first={}", FIRST_SCENES[0].name));
    window.until("a picture", |app| app.picture.is_some());
    assert_eq!(window.app.error, None);
}

#[test]
fn a_heavy_file_is_left_and_taken_up_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("heavy.json");
    let heavy = json!({ "etendue": 1, "tracer": { "type": "facing" }, "objects": [
        { "shape": "blob", "triangles": 3_000_000, "seed": 1 }] });
    fs::write(&path, heavy.to_string()).unwrap();
    let mut window = Driver::open(&path);
    window.until("what is done", |app| app.document.is_some() && app.busy.is_some());
    assert!(marked(&window.ctx, "leave").is_some() || window.app.picture.is_none());
    window.step(Vec::new());
    window.click("leave");
    window.until("a stop, or a picture that was quicker", |app| {
        app.busy.is_none() || app.picture.is_some()
    });
    if window.app.picture.is_none() {
        assert_eq!(window.app.error, None, "a stop is no fault");
        window.click("go on");
    }
    window.until("its picture", |app| app.picture.is_some());
}

#[test]
fn what_removes_a_section_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut window = Driver::open(&scene_file(folder.path()));
    window.settle();
    let mut words = Vec::new();
    for _ in 0..2 {
        let time = window.time;
        let input = egui::RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, Vec2::new(1200.0, 800.0))),
            time: Some(time),
            ..Default::default()
        };
        let app = &mut window.app;
        let output = window.ctx.clone().run(input, |ctx| crate::panels::show(app, ctx));
        words = output
            .shapes
            .iter()
            .filter_map(|shape| match &shape.shape {
                egui::Shape::Text(text) => Some(text.galley.text().to_owned()),
                _ => None,
            })
            .collect();
    }
    let removes: Vec<_> = words.iter().filter(|word| word.starts_with("remove")).collect();
    assert!(removes.iter().all(|word| word.len() > "remove ".len()), "{removes:?}");
    assert!(removes.iter().any(|word| **word == "remove sensor"), "{words:?}");
}
