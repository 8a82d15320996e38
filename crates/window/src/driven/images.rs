//! Images by themselves: their layers, their pixels, and files that are none.

use etendue::Outputs;

use super::*;

/// Renders the scene into a folder.
fn rendered(folder: &Path, change: impl FnOnce(&mut Value)) -> PathBuf {
    let mut scene = scene();
    scene["layers"] = json!(["depth", "ids"]);
    change(&mut scene);
    let mut session = Session::from_json(folder, scene).unwrap();
    let out = folder.join("out");
    session.render(&Progress::none()).unwrap().write(&out, Outputs::ALL).unwrap();
    out
}

/// Value that the window gives of the pixel that was clicked.
fn said(window: &Driver, name: &str) -> Option<String> {
    let (_, still) = window.app.still.as_ref().unwrap();
    let place = window.app.asked.as_ref().unwrap().place;
    still.reading(place).into_iter().find(|(of, _)| of == name).map(|(_, value)| value)
}

#[test]
fn an_exr_shows_its_layers_and_their_values() {
    let folder = tempfile::tempdir().unwrap();
    let out = rendered(folder.path(), |_| {});
    let mut window = Driver::open(&out.join("layers.exr"));
    window.until("the image", |app| app.picture.is_some());
    assert_eq!(window.app.title(), "layers.exr - etendue");
    let layers = window.app.picture.as_ref().unwrap().layers.clone();
    assert!(layers.starts_with(&[String::new()]), "the picture comes first: {layers:?}");
    for name in ["Depth", "Id.object"] {
        assert!(layers.contains(&name.to_owned()), "{name} in {layers:?}");
    }
    let picture = window.pixels();
    window.click("part");
    window.click("part=Depth");
    assert_ne!(window.pixels(), picture);
    assert!(window.app.picture.as_ref().unwrap().screen.scale.is_some(), "distances have a scale");
    window.click_at(window.at(0.5, 0.5));
    let depth = said(&window, "Depth").unwrap();
    // A tessellated sphere lies within its radius, by less than this for its thousands of triangles.
    let metres: f64 = depth.strip_suffix(" m").unwrap().parse().unwrap();
    assert!((metres - 1.75).abs() < 1e-3, "{depth}");
    assert_eq!(said(&window, "Id.object").as_deref(), Some("1.0000"));
    window.click("part");
    window.click("part=Picture");
    assert_eq!(window.pixels(), picture);
}

#[test]
fn a_png_tells_the_numbers_of_its_file_and_is_read_again_when_it_changes() {
    let folder = tempfile::tempdir().unwrap();
    let out = rendered(folder.path(), |_| {});
    let file = out.join("picture.png");
    let mut window = Driver::open(&file);
    window.until("the image", |app| app.picture.is_some());
    window.click_at(window.at(0.5, 0.5));
    let shown = window.pixels();
    let middle = 4 * (32 * 96 + 48);
    let [red, green, blue] = [0, 1, 2].map(|k| shown[middle + k]);
    // Through linear light and back, 8 bits are as they were.
    assert_eq!(said(&window, "file").unwrap(), format!("{red}, {green}, {blue} of 255"));
    rendered(folder.path(), |scene| scene["materials"]["red"]["color"] = json!([0.1, 0.1, 0.9]));
    window.until("the new colours", |app| app.picture.as_ref().unwrap().screen.rgba != shown);
    assert_eq!(window.app.error, None);
}

#[test]
fn a_scene_follows_an_image_and_the_other_way_round() {
    let folder = tempfile::tempdir().unwrap();
    let out = rendered(folder.path(), |_| {});
    let mut window = Driver::open(&scene_file(folder.path()));
    window.settle();
    window.drop_file(&out.join("layers.exr"));
    window.until("the image", |app| app.still.is_some());
    assert!(window.app.document.is_none() && window.app.inspector.is_none());
    // There is nothing to turn.
    window.drag(window.at(0.5, 0.5), Vec2::new(30.0, 0.0));
    window.drop_file(&folder.path().join("scene.json"));
    window.until("the scene", |app| app.document.is_some());
    window.settle();
    assert!(window.app.still.is_none());
    assert_eq!(window.value("camera.pose.from"), json!([0, 0, 2]));
}

#[test]
fn a_broken_image_leaves_what_was_open() {
    let folder = tempfile::tempdir().unwrap();
    let out = rendered(folder.path(), |_| {});
    let mut window = Driver::open(&out.join("layers.exr"));
    window.until("the image", |app| app.picture.is_some());
    let bytes = fs::read(out.join("layers.exr")).unwrap();
    fs::write(out.join("half.exr"), &bytes[..bytes.len() / 2]).unwrap();
    window.drop_file(&out.join("half.exr"));
    window.until("an error", |app| app.error.is_some());
    let error = window.app.error.clone().unwrap();
    assert!(error.contains("half.exr"), "{error}");
    assert!(window.app.still.as_ref().unwrap().0.ends_with("layers.exr"));
}
