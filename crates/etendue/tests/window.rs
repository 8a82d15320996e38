//! Parts of the library that a window uses: previews, places, scenes that are saved.
#![allow(clippy::disallowed_methods, reason = "tests set their stage by hand")]

use std::fs;
use std::path::Path;

use etendue::{Progress, Roughness, Screen, Session};
use serde_json::{Value, json};

/// A ball of radius 0.5 at the origin before a wall at z = −2, seen by a lens of 50 mm from z = 3.
fn scene() -> Value {
    json!({
        "etendue": 1,
        "tracer": {"type": "direct"},
        "render": {"samples": 4},
        "layers": ["depth"],
        "camera": {
            "type": "thin_lens", "focal_length": "50 mm", "f_number": 4, "focus_distance": 3,
            "pose": {"from": [0, 0, 3], "look_at": [0, 0, 0]},
            "sensor": {"type": "raw", "model": "imx183", "pixel_pitch": 750, "resolution": [48, 32]}
        },
        "objects": [
            {"name": "ball", "shape": "sphere", "radius": 0.5, "material": "grey"},
            {"name": "wall", "shape": "rectangle", "width": 20, "height": 20, "material": "grey",
             "transform": {"translate": [0, 0, -2]}}
        ],
        "materials": {"grey": {"type": "matte", "color": [0.5, 0.5, 0.5]}},
        "lights": [{"type": "point", "at": [2, 3, 2], "intensity": [40, 40, 40]}]
    })
}

fn opened(folder: &Path) -> Session {
    let path = folder.join("scene.json");
    fs::write(&path, scene().to_string()).unwrap();
    Session::open(path).unwrap()
}

fn bits(layer: &etendue::Layer) -> Vec<u64> {
    let channels = layer.channels.iter().map(|channel| &channel.values);
    channels.flat_map(|values| (0..values.len()).map(|i| values.at(i).to_bits())).collect()
}

#[test]
fn the_finest_preview_is_the_render() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = opened(folder.path());
    let preview = session.preview(Roughness::NONE, &Progress::none()).unwrap();
    let render = session.render(&Progress::none()).unwrap();
    for (shown, rendered) in preview.layers().iter().zip(render.layers()) {
        assert_eq!(bits(shown), bits(rendered), "{}", shown.title());
    }
    let shot = render.exposures().next().unwrap();
    assert_eq!(preview.raw().unwrap(), render.raw(shot).unwrap().as_ref());
    assert_eq!((preview.factor(), preview.samples()), (1, [4, 4]));
}

#[test]
fn a_rough_preview_sees_the_same_on_larger_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = opened(folder.path());
    let before = session.values().clone();
    let rough = Roughness { factor: 4, samples: Some(1) };
    let preview = session.preview(rough, &Progress::none()).unwrap();
    assert_eq!((preview.resolution(), preview.samples()), ([12, 8], [1, 4]));
    assert_eq!(session.values(), &before, "looking changes nothing");
    let depth = preview.layers().iter().find(|layer| layer.name == "Depth").unwrap();
    // The corner sees the wall, 5 m away along the axis.
    assert!((depth.channels[0].values.at(0) - 5.0).abs() < 1e-12);
    let raw = preview.raw().unwrap().unwrap();
    assert_eq!((raw.width, raw.height), (12, 8));
    // Four by four pixels of the picture make one of these: the lit wall is as bright in both.
    let fine = session.preview(Roughness::NONE, &Progress::none()).unwrap();
    let mean = |preview: &etendue::Preview| {
        let screen = preview.screen("").unwrap();
        let sum: u64 = screen.rgba.iter().map(|&byte| u64::from(byte)).sum();
        sum as f64 / screen.rgba.len() as f64
    };
    // One sample of 96 pixels of a smooth picture: a few of 255.
    assert!((mean(&preview) - mean(&fine)).abs() < 6.0, "{} {}", mean(&preview), mean(&fine));
}

#[test]
fn a_place_tells_what_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = opened(folder.path());
    let inspector = session.inspector(&Progress::none()).unwrap();
    let ball = inspector.probe([24.0, 16.0]).unwrap();
    assert_eq!((&*ball.object, &*ball.material), ("ball", "grey"));
    // A tessellated sphere of some thousand triangles is inside its radius by less than this.
    assert!((ball.depth - 2.5).abs() < 2e-3 && ball.normal.z > 0.99, "{ball:?}");
    let wall = inspector.probe([1.0, 1.0]).unwrap();
    assert_eq!(wall.object, "wall");
    // Five roundings of numbers up to 5.
    assert!((wall.depth - 5.0).abs() < 1e-12 && wall.distance > 5.0, "{wall:?}");
    // The paraxial magnification of a thin lens in focus at 3 m: the picture is 24 mm high behind it.
    let view = inspector.viewpoint(Some(&wall));
    assert!((view.look_at.z + 2.0).abs() < 1e-12, "{view:?}");
    let rays = inspector.ray_paths([1.0, 1.0], 5);
    assert_eq!(rays.len(), 5, "a thin lens lets all of its opening's rays through");
    assert!(inspector.lens().unwrap().unwrap().section.sensor.is_some());
}

#[test]
fn a_saved_scene_is_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = opened(folder.path());
    let mut values = session.values().clone();
    values["camera"]["f_number"] = json!(8);
    values["camera"].as_object_mut().unwrap().remove("focus_distance");
    session.replace(&values).unwrap();
    assert_eq!(session.values(), &values);
    let other = folder.path().join("other.json");
    session.save(&other).unwrap();
    session.save(folder.path().join("scene.json")).unwrap();
    for name in ["other.json", "scene.json"] {
        let mut again = Session::open(folder.path().join(name)).unwrap();
        assert_eq!(again.values(), &values, "{name}");
        let hash = |session: &mut Session| {
            session.render(&Progress::none()).unwrap().report().image_hash.clone()
        };
        assert_eq!(hash(&mut again), hash(&mut session), "{name}");
    }
}

#[test]
fn a_scene_that_names_files_stays_in_their_folder() {
    let [home, away] = [0, 1].map(|_| tempfile::tempdir().unwrap());
    let model = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    fs::write(home.path().join("tile.obj"), model).unwrap();
    let mut session = Session::open(home.path().join("tile.obj")).unwrap();
    let error = session.save(away.path().join("scene.json")).unwrap_err();
    assert!(error.is_refused() && error.to_string().contains("tile.obj"), "{error}");
    let error = session.save(home.path().join("tile.obj")).unwrap_err();
    assert!(error.to_string().contains("tile.obj"), "a model is not written over: {error}");
    assert_eq!(fs::read_to_string(home.path().join("tile.obj")).unwrap(), model);
    session.save(home.path().join("scene.json")).unwrap();
    Session::open(home.path().join("scene.json")).unwrap().render(&Progress::none()).unwrap();
}

#[test]
fn edits_of_one_version_are_made_to_another() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = opened(folder.path());
    let before = session.values().clone();
    let mut mine = before.clone();
    mine["camera"]["f_number"] = json!(11);
    session.set("render.samples", 16).unwrap();
    session.set_changes(&before, &mine).unwrap();
    assert_eq!(session.values()["camera"]["f_number"], 11);
    assert_eq!(session.values()["render"]["samples"], 16);
    mine["camera"]["f_number"] = json!("wide");
    let error = session.set_changes(&before, &mine).unwrap_err();
    assert!(error.to_string().contains("camera.f_number"), "{error}");
}

#[test]
fn sensors_have_screens() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = opened(folder.path());
    let preview = session.preview(Roughness::NONE, &Progress::none()).unwrap();
    let (sensor, raw) = (preview.sensor_light().unwrap().sensor(), preview.raw().unwrap().unwrap());
    for screen in [Screen::of_sensor(sensor, raw), Screen::of_numbers(sensor, raw)] {
        assert_eq!((screen.size, screen.rgba.len()), ([48, 32], 48 * 32 * 4));
        assert!(screen.rgba.chunks_exact(4).any(|pixel| pixel[1] > 30), "light arrives");
    }
    let reading = preview.reading([24.0, 16.0]).unwrap();
    let names: Vec<&str> = reading.iter().map(|(name, _)| &**name).collect();
    assert!(names.contains(&"raw") && names.contains(&"Depth"), "{names:?}");
    assert!(preview.reading([4800.0, 0.0]).unwrap().is_empty());
}
