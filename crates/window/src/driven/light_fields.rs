//! The panel of light fields.

use super::*;
use crate::panels::light_field::LightFieldPart;

fn camera(folder: &Path) -> Driver {
    camera_with(folder, json!({"pitch": "90 um"}))
}

fn camera_with(folder: &Path, microlenses: Value) -> Driver {
    let mut scene = scene();
    scene["camera"] = json!({
        "type": "light_field", "focal_length": "35 mm", "f_number": 2, "focus_distance": "2 m",
        "microlenses": microlenses,
        "pose": {"from": [0, 0, 2], "look_at": [0, 0, 0]},
        "sensor": {"resolution": [240, 180], "pixel_pitch": "6 um"}
    });
    scene["render"]["samples"] = json!(2);
    let path = folder.join("plenoptic.json");
    fs::write(&path, scene.to_string()).unwrap();
    let mut window = Driver::open(&path);
    window.settle();
    window
}

#[test]
fn views_are_moved_through_by_the_pupil() {
    let folder = tempfile::tempdir().unwrap();
    let mut window = camera(folder.path());
    let raw = window.pixels();
    window.click("light field=view");
    let corner = window.pixels();
    assert_ne!(corner, raw, "a view in place of the raw picture");
    window.step(Vec::new());
    let pupil = marked(&window.ctx, "pupil").unwrap();
    window.drag(pupil.min + Vec2::splat(3.0), pupil.size() - Vec2::splat(6.0));
    let LightFieldPart::View([u, v]) = window.app.light_field.shows else {
        panic!("no view is shown")
    };
    assert!(u == v && u > 2, "the drag ended in the pupil's other corner: {u}, {v}");
    assert_ne!(window.pixels(), corner, "seen from elsewhere");
    window.click("light field=raw");
    assert_eq!(window.pixels(), raw);
}

#[test]
fn all_views_are_focused_anew_by_the_slider() {
    let folder = tempfile::tempdir().unwrap();
    let mut window = camera(folder.path());
    window.click("light field=refocus");
    let LightFieldPart::Focused(at) = window.app.light_field.shows else {
        panic!("no focus is shown")
    };
    assert!((at - 2.0).abs() < 1e-6, "where the camera is focused: {at}");
    let sharp = window.pixels();
    window.step(Vec::new());
    let slider = marked(&window.ctx, "refocus").unwrap();
    let knob = slider.left_center() + Vec2::new(0.3 * slider.width(), 0.0);
    window.drag(knob, Vec2::new(-0.2 * slider.width(), 0.0));
    let LightFieldPart::Focused(near) = window.app.light_field.shows else {
        panic!("no focus is shown")
    };
    assert!(near < 1.5, "{near}");
    assert_ne!(window.pixels(), sharp);
    assert_eq!(window.app.error, None);
}

/// A focused camera has no views, and its planes are put together from patches.
#[test]
fn a_focused_camera_is_focused_anew_and_shows_no_views() {
    let folder = tempfile::tempdir().unwrap();
    let microlenses = json!({"pitch": "90 um", "picture_distance": "0.85 mm"});
    let mut window = camera_with(folder.path(), microlenses);
    let raw = window.pixels();
    window.click("light field=refocus");
    assert_eq!(marked(&window.ctx, "light field=view"), None);
    let LightFieldPart::Focused(at) = window.app.light_field.shows else {
        panic!("no focus is shown")
    };
    assert!((at - 2.0).abs() < 1e-6, "where the camera is focused: {at}");
    let sharp = window.pixels();
    assert_ne!(sharp, raw);
    window.step(Vec::new());
    let slider = marked(&window.ctx, "refocus").unwrap();
    window.drag(
        slider.left_center() + Vec2::new(0.3 * slider.width(), 0.0),
        Vec2::new(-0.3 * slider.width(), 0.0),
    );
    let LightFieldPart::Focused(near) = window.app.light_field.shows else {
        panic!("no focus is shown")
    };
    // Nearer pictures are nearer to the lenslets, until patches leave gaps.
    assert!(near < 2.0 && near > 1.0, "{near}");
    assert_ne!(window.pixels(), sharp);
    assert_eq!(window.app.error, None);
}

/// Of every kind that has views one is shown.
#[test]
fn views_of_every_kind_are_shown() {
    let folder = tempfile::tempdir().unwrap();
    for microlenses in [
        json!({"pitch": "90 um", "rotation": 17}),
        json!({"pitch": "90 um", "grid": "hexagonal"}),
        json!({"pitch": "90 um", "types": [{"focal_length": 0.188}, {"focal_length": 0.191}], "pattern": [[0, 1]]}),
    ] {
        let mut window = camera_with(folder.path(), microlenses.clone());
        let raw = window.pixels();
        window.click("light field=view");
        assert!(matches!(window.app.light_field.shows, LightFieldPart::View(_)), "{microlenses}");
        assert_ne!(window.pixels(), raw, "{microlenses}");
        assert_eq!(window.app.error, None, "{microlenses}");
    }
}
