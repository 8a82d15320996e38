//! Lenses: opened by themselves, and changed by dragging their surfaces.

use super::*;
use crate::panels::lens_curves::LensPlot;

/// A copy of an example lens, in a folder of its own.
fn lens_file(folder: &Path) -> PathBuf {
    let lenses = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/lenses");
    let path = folder.join("achromat.json");
    fs::copy(lenses.join("achromat.json"), &path).unwrap();
    path
}

#[test]
fn a_lens_by_itself_is_looked_through() {
    let folder = tempfile::tempdir().unwrap();
    let mut window = Driver::open(&lens_file(folder.path()));
    window.until("the lens", |app| app.lens.is_some() && app.picture.is_some());
    assert_eq!(window.app.error, None);
    assert!(window.app.shows_lens, "its panel is open");
    assert_eq!(window.value("camera.lens"), json!("achromat.json"));
    let view = window.app.lens.as_ref().unwrap().as_ref().unwrap();
    let focal_length = view.report.paraxial.efl.unwrap();
    // 100 mm by its catalogue, and to a percent by its rounded radii.
    assert!((focal_length - 100.0).abs() < 1.0, "{focal_length}");
    // The board stands at forty focal lengths; the middle of the picture sees it through the lens.
    window.click_at(window.at(0.52, 0.52));
    let probe = window.app.asked.clone().unwrap().probe.unwrap();
    assert_eq!(probe.object, "board");
    assert!((probe.depth - 0.04 * focal_length).abs() < 1e-3, "{}", probe.depth);
}

#[test]
fn surfaces_are_dragged_and_the_lens_file_stays() {
    let folder = tempfile::tempdir().unwrap();
    let path = lens_file(folder.path());
    let before = fs::read(&path).unwrap();
    let mut window = Driver::open(&path);
    window.until("the lens", |app| app.lens.is_some() && app.written_lens.is_some());
    window.step(Vec::new());
    let drag = |window: &mut Driver, element: usize, by: Vec2| {
        let from = window.place_of(&format!("element {element}"));
        window.drag(from, by);
        window.time += 1.0;
        window.until("the changed lens", |app| !app.is_behind());
        assert_eq!(window.app.error, None);
    };
    drag(&mut window, 0, Vec2::new(0.0, 30.0));
    let radius = window.value("camera.lens.elements[0].radius").as_f64().unwrap();
    assert!(radius > 62.8, "across the axis a drag bends the surface: {radius}");
    drag(&mut window, 1, Vec2::new(12.0, 0.0));
    let gap = window.value("camera.lens.elements[0].thickness").as_f64().unwrap();
    assert!(gap > 4.0, "along the axis it moves the gap before it: {gap}");
    assert_eq!(window.value("camera.lens.elements[1].radius"), json!(-45.7));
    assert_eq!(fs::read(&path).unwrap(), before, "the lens' own file is as it was");
    window.press(Key::Z, Modifiers::COMMAND);
    assert_eq!(window.value("camera.lens.elements[0].thickness").as_f64(), Some(4.0));
}

/// Curves in waves come when they are chosen, and go with the lens that they are of.
#[test]
fn fans_and_modulation_are_looked_at_beside_the_lens() {
    let folder = tempfile::tempdir().unwrap();
    let mut window = Driver::open(&lens_file(folder.path()));
    window.until("the lens", |app| app.lens.is_some() && app.written_lens.is_some());
    window.step(Vec::new());
    assert!(window.app.lens_curves.found.is_none(), "nothing is traced before it is asked for");
    for (name, plot) in [
        ("lens MTF", LensPlot::Modulation),
        ("lens OPD", LensPlot::WaveFans),
        ("lens ray fans", LensPlot::RayFans),
    ] {
        window.click(name);
        window.until("curves", |app| app.lens_curves.found.is_some());
        assert_eq!(window.app.lens_curves.plot, plot);
    }
    let waves = window.app.lens_curves.found.clone().unwrap().unwrap();
    let first = &waves.fields[0];
    assert!((first.modulation[0][1] - 1.0).abs() < 1e-3, "{:?}", first.modulation[0]);
    assert!(first.modulation.last().unwrap()[1] < 0.01);
    assert!(first.fans.tangential.len() > 20);
    // A bent surface is another lens.
    let from = window.place_of("element 0");
    window.drag(from, Vec2::new(0.0, 30.0));
    window.time += 1.0;
    window.until("the changed lens", |app| !app.is_behind());
    window.until("its curves", |app| app.lens_curves.found.is_some());
    let bent = window.app.lens_curves.found.clone().unwrap().unwrap();
    assert_ne!(bent.fields[0].fans, waves.fields[0].fans);
    window.click("lens spots");
    assert_eq!(window.app.lens_curves.plot, LensPlot::Spots);
}

#[test]
fn a_scene_made_for_a_lens_is_saved_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = lens_file(folder.path());
    let before = fs::read(&path).unwrap();
    let mut window = Driver::open(&path);
    window.until("the lens", |app| app.lens.is_some());
    window.press(Key::S, Modifiers::COMMAND);
    assert!(window.app.asking.is_some(), "it asks where to");
    window.click("do it");
    let saved = folder.path().join("achromat-scene.json");
    window.until("saved", |app| app.document.as_ref().is_some_and(|d| d.is_scene));
    assert_eq!(window.app.document.as_ref().unwrap().path, saved);
    assert_eq!(fs::read(&path).unwrap(), before, "the lens' own file is as it was");
    let values = Session::open(&saved).unwrap().values().clone();
    assert_eq!(values["camera"]["lens"], json!("achromat.json"));
}

#[test]
fn a_lens_without_a_picture_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("diverging.json");
    let lens =
        json!({"elements": [{"type": "thin_lens", "focal_length": -50, "semi_diameter": 10}]});
    fs::write(&path, lens.to_string()).unwrap();
    let mut window = Driver::open(&path);
    window.until("an error", |app| app.error.is_some());
    let error = window.app.error.clone().unwrap();
    assert!(error.contains("diverging.json") && error.contains("etendue lens"), "{error}");
}
