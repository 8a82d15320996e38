//! Cameras in files of their own: what a scene makes of them, and what is refused.

use std::fs;
use std::path::Path;

use etendue_files::{Opener, Reach};
use etendue_scene::file::SensorFile;
use etendue_scene::{LoadOptions, SceneError, SceneFile, Setting, Wanted};
use serde_json::json;

const LENS: &str = r#"{"glass_catalogs": ["own.agf"], "elements": [
    {"type": "surface", "radius": 50, "thickness": 5, "glass": "OWN-1", "semi_diameter": 4, "stop": true},
    {"type": "surface", "radius": -50, "semi_diameter": 4}]}"#;

const AGF: &str = "CC made up\nNM OWN-1 2 0 1.6 60 0 1\nCD 1.5 0.01 0 0 0 0\nLD 0.35 2.5\n";

/// A folder with a scene of which all but the camera is absent, and a camera.
fn folder(named: &str, camera: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("cameras")).unwrap();
    let scene = json!({"etendue": 1, "camera": named}).to_string();
    fs::write(folder.path().join("scene.json"), scene).unwrap();
    fs::write(folder.path().join(named), camera).unwrap();
    folder
}

fn settings(all: &[(&str, &str)]) -> Vec<Setting> {
    all.iter().map(|&(path, value)| Setting::new(path, value)).collect()
}

fn read(folder: &Path, all: &[(&str, &str)]) -> Result<SceneFile, SceneError> {
    SceneFile::read(&folder.join("scene.json"), &settings(all))
}

fn message(folder: &Path, all: &[(&str, &str)]) -> String {
    read(folder, all).unwrap_err().to_string()
}

#[test]
fn a_camera_in_a_file_is_the_camera_in_the_scene() {
    let folder = folder("mine.json", r#"{"comment": "mine", "type": "pinhole", "fov": 30}"#);
    let of_file = read(folder.path(), &[]).unwrap();
    let inline = json!({"etendue": 1, "camera": {"type": "pinhole", "fov": 30}});
    let inline = SceneFile::from_json(&Opener::default(), folder.path(), inline).unwrap();
    assert_eq!(of_file.value(), inline.value());
    // Settings go on from it, and take its place.
    let camera = |all: &[(&str, &str)]| read(folder.path(), all).unwrap().value()["camera"].clone();
    assert_eq!(camera(&[("camera.fov", "50")])["fov"], 50);
    fs::write(folder.path().join("other.json"), r#"{"type": "orthographic"}"#).unwrap();
    let other = camera(&[("camera", "other.json"), ("camera.height", "3")]);
    assert_eq!(other, json!({"type": "orthographic", "height": 3}));
    let of_file = of_file.with(&settings(&[("camera", "other.json")])).unwrap();
    assert_eq!(of_file.value()["camera"]["type"], "orthographic");
    // Its sensor is the scene's.
    fs::write(
        folder.path().join("mine.json"),
        r#"{"type": "pinhole", "sensor": {"model": "imx183"}}"#,
    )
    .unwrap();
    let path = folder.path().join("scene.json");
    let sensor = SensorFile::read(&Opener::default(), &path, &[]).unwrap().sensor;
    assert_eq!(sensor.bit_depth(), 12);
}

#[test]
fn paths_in_a_camera_file_start_at_its_folder() {
    let camera = r#"{"type": "lens", "lens": "lens.json", "focus_distance": 3, "sensor_height": 4,
                     "sensor": {"resolution": [4, 4]}}"#;
    let folder = folder("cameras/mine.json", camera);
    fs::write(folder.path().join("cameras/lens.json"), LENS).unwrap();
    fs::write(folder.path().join("cameras/own.agf"), AGF).unwrap();
    let file = read(folder.path(), &[]).unwrap();
    let scene = file.load(Wanted::NOTHING, &LoadOptions::default()).unwrap();
    for name in ["cameras/lens.json", "cameras/own.agf"] {
        assert!(scene.inputs.contains(&folder.path().join(name)), "{name}: {:?}", scene.inputs);
    }
    // The lens itself in the camera's file.
    let camera = camera.replace("\"lens.json\"", LENS);
    fs::write(folder.path().join("cameras/mine.json"), camera).unwrap();
    let file = read(folder.path(), &[]).unwrap();
    let catalogue = &file.value()["camera"]["lens"]["glass_catalogs"][0];
    assert_eq!(catalogue, "cameras/own.agf", "as the scene's folder has it");
    file.load(Wanted::NOTHING, &LoadOptions::default()).unwrap();
}

#[test]
fn what_is_wrong_in_a_camera_file_is_named_in_it() {
    let wrong = |text: &str| {
        let folder = folder("mine.json", text);
        message(folder.path(), &[])
    };
    let error = wrong("{\n\"type\": \"pinhole\",\n  \"fvo\": 3}");
    assert!(error.contains("mine.json, line 3, column 3: fvo: unknown key"), "{error}");
    assert!(error.contains("did you mean `fov`?"), "{error}");
    let error = wrong("{\"type\": \"pinhole\", \"fov\": ");
    assert!(error.contains("mine.json, line 1") && error.contains("broken JSON"), "{error}");
    let error = wrong(r#"{"type": "pinhole", "fov": 40, "sensor": {"resolution": [0, 3]}}"#);
    assert!(error.contains("mine.json, line 1, column 43: sensor.resolution"), "{error}");
    // What a setting says is named by it.
    let folder = folder("mine.json", r#"{"type": "pinhole"}"#);
    let error = message(folder.path(), &[("camera.fov", "\"wide\"")]);
    assert!(error.starts_with("--set camera.fov=\"wide\": camera.fov:"), "{error}");
    // The file that a setting names is read as the scene's is.
    fs::write(folder.path().join("other.json"), r#"{"type": "pinhole", "fvo": 3}"#).unwrap();
    let error = message(folder.path(), &[("camera", "other.json")]);
    assert!(error.contains("other.json, line 1, column 21: fvo: unknown key"), "{error}");
    let error = message(folder.path(), &[("camera", "none.json")]);
    assert!(error.starts_with("--set camera=none.json: camera: no such file"), "{error}");
}

#[test]
fn what_is_no_camera_file_is_refused_with_a_remedy() {
    for (text, why) in [
        (r#"{"etendue": 1, "camera": {"type": "pinhole"}}"#, "\"mine.json\" is a whole scene"),
        (r#"{"objects": []}"#, "is a whole scene"),
        (r#"["pinhole"]"#, "holds an array, not an object"),
        ("3", "holds a number, not an object"),
    ] {
        let folder = folder("mine.json", text);
        let error = message(folder.path(), &[]);
        assert!(error.contains("scene.json, line 1, column 2: camera: "), "{text}: {error}");
        let remedy = "name a JSON file that holds what a scene's `camera` does";
        assert!(error.contains(why) && error.contains(remedy), "{text}: {error}");
    }
    let folder = folder("mine.json", "{}");
    let scene = json!({"etendue": 1, "camera": "mnie.json"}).to_string();
    fs::write(folder.path().join("scene.json"), scene).unwrap();
    let error = message(folder.path(), &[]);
    assert!(
        error.contains("camera: no such file: \"mnie.json\"\nhint: did you mean \"mine.json\"?"),
        "{error}"
    );
}

#[test]
fn a_camera_file_outside_of_the_folder_is_read_where_that_is_allowed() {
    let folder = folder("mine.json", r#"{"type": "pinhole", "fov": 30}"#);
    let path = folder.path().join("cameras/scene.json");
    fs::write(&path, json!({"etendue": 1, "camera": "../mine.json"}).to_string()).unwrap();
    let error = SceneFile::read(&path, &[]).unwrap_err().to_string();
    assert!(error.contains("camera: \"../mine.json\" leaves the scene's folder"), "{error}");
    assert!(error.contains("--allow-outside"), "{error}");
    let opener = Opener::new(Reach::Anywhere);
    let file = SceneFile::read_with(&opener, &path, &[]).unwrap();
    assert_eq!(file.value()["camera"]["fov"], 30);
    assert_eq!(opener.found(), [folder.path().join("cameras/../mine.json")]);
}
