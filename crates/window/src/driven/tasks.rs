//! Tasks that are done once: comparing, stopping, writing files.

use super::*;

#[test]
fn before_and_after_share_the_canvas_by_a_line() {
    let folder = tempfile::tempdir().unwrap();
    let mut window = Driver::open(&scene_file(folder.path()));
    window.settle();
    window.click("compare");
    assert!(window.app.canvas.before.is_some());
    window.enter("/camera/f_number", "16");
    window.settle();
    window.step(Vec::new());
    let (pose, split) = (window.value("camera.pose"), window.app.canvas.split);
    window.drag(window.place_of("split"), Vec2::new(-120.0, 0.0));
    assert!(window.app.canvas.split < split - 0.05, "{} of {split}", window.app.canvas.split);
    assert_eq!(window.value("camera.pose"), pose, "the line is dragged, and not the camera");
    window.click("compare");
    assert!(window.app.canvas.before.is_none());
}

/// A scene that would take hours.
fn slow(folder: &Path) -> PathBuf {
    let mut slow = scene();
    slow["tracer"] = json!({"type": "path"});
    slow["render"]["samples"] = json!(1_000_000);
    let path = folder.join("slow.json");
    fs::write(&path, slow.to_string()).unwrap();
    path
}

#[test]
fn stop_leaves_the_picture_so_far() {
    let folder = tempfile::tempdir().unwrap();
    let mut window = Driver::open(&slow(folder.path()));
    window.until("a picture that is refined", |app| {
        app.busy.is_some() && app.picture.as_ref().is_some_and(|picture| picture.factor == 1)
    });
    window.click("cancel");
    window.until("nothing is done any more", |app| app.busy.is_none());
    let picture = window.app.picture.as_ref().unwrap();
    assert!(picture.samples.is_some_and(|[has, of]| 0 < has && has < of), "{:?}", picture.samples);
    assert_eq!(window.app.error, None, "stopping is no fault");
}

#[test]
fn a_file_dropped_during_a_render_is_opened_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let mut window = Driver::open(&slow(folder.path()));
    window.until("a first picture", |app| app.picture.is_some());
    window.drop_file(&scene_file(folder.path()));
    window.until("the other scene", |app| app.title().starts_with("scene.json"));
    window.settle();
}

#[test]
fn files_are_written_as_the_command_line_writes_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = scene_file(folder.path());
    let mut window = Driver::open(&path);
    window.settle();
    let out = folder.path().join("shown");
    window.press(Key::R, Modifiers::COMMAND);
    window.press(Key::A, Modifiers::COMMAND);
    window.step(vec![Event::Text(out.display().to_string())]);
    window.click("do it");
    window.until("files", |app| app.said.as_ref().is_some_and(|said| said.starts_with("wrote")));
    let own = folder.path().join("own");
    let rendering = Session::open(&path).unwrap().render(&Progress::none()).unwrap();
    rendering.write(&own, etendue::Outputs::ALL).unwrap();
    for name in ["picture.png", "layers.exr", "depth.npy", "raw.png"] {
        let [shown, own] = [&out, &own].map(|folder| fs::read(folder.join(name)).unwrap());
        assert!(shown == own, "{name} is another");
    }
}

#[test]
fn a_place_that_takes_no_files_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let mut window = Driver::open(&scene_file(folder.path()));
    window.settle();
    // A file stands where the folder would.
    window.app.render(&folder.path().join("scene.json"));
    window.until("an error", |app| app.error.is_some());
    let error = window.app.error.clone().unwrap();
    assert!(error.contains("scene.json"), "{error}");
    assert!(window.app.document.is_some());
}

#[test]
fn a_file_is_chosen_from_what_its_folder_has() {
    let folder = tempfile::tempdir().unwrap();
    let mut window = Driver::open(&scene_file(folder.path()));
    window.settle();
    fs::create_dir(folder.path().join("other")).unwrap();
    fs::write(folder.path().join("other/moved.json"), scene().to_string()).unwrap();
    fs::write(folder.path().join("other/notes.txt"), "").unwrap();
    window.press(Key::O, Modifiers::COMMAND);
    window.click("entry=other");
    let text = |window: &Driver| window.app.asking.clone().unwrap().1;
    assert_eq!(Path::new(&text(&window)), folder.path().join("other"));
    // What is written of a name leaves those that have it.
    window.press(Key::End, Modifiers::NONE);
    window.step(vec![Event::Text("OVE".to_owned())]);
    window.click("entry=moved.json");
    assert!(text(&window).ends_with("moved.json"), "{}", text(&window));
    window.click("do it");
    window.until("the other file", |app| app.title().starts_with("moved.json"));
    assert!(window.app.asking.is_none());
}
