//! Tests that files, written as JSON and read again, say the same.

use std::fmt::Debug;
use std::fs;
use std::path::{Path, PathBuf};

use etendue_camera::CameraSpec;
use etendue_files::Opener;
use etendue_optics::train::LensFile;
use etendue_scene::SceneFile;
use etendue_scene::file::SensorFile;
use etendue_sensor::Model;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

/// The JSON files of `scenes/`, with their values.
fn examples() -> Vec<(PathBuf, Value)> {
    let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes")];
    let mut found = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("the example scenes") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|end| end == "json") {
                let text = fs::read_to_string(&path).expect("text");
                found.push((path, serde_json::from_str(&text).expect("JSON")));
            }
        }
    }
    assert!(found.len() > 40, "{} files", found.len());
    found
}

/// Writes `value` as text, and reads that.
fn again<T: Serialize + DeserializeOwned + PartialEq + Debug>(what: &str, value: &T) {
    let text = serde_json::to_string(value).expect("a value that JSON has");
    let read: T = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{what}: {e}\n{text}"));
    assert_eq!(&read, value, "{what}: {text}");
}

#[test]
fn scenes_lenses_and_sensors_written_and_read_again_are_the_same() {
    let mut counts = [0; 3];
    for (path, value) in examples() {
        let name = path.display().to_string();
        if value.get("etendue").is_none() && value.get("elements").is_none() {
            // A camera or a sensor in a file of its own.
            if value.get("pose").is_some() {
                let camera: Result<CameraSpec, _> = serde_json::from_value(value);
                again(&name, &camera.unwrap_or_else(|error| panic!("{name}: {error}")));
            } else {
                let sensor = SensorFile::read(&Opener::default(), &path, &[]);
                again(&name, &sensor.unwrap_or_else(|error| panic!("{name}: {error}")).spec);
            }
            continue;
        }
        if value.get("etendue").is_none() {
            let lens = LensFile::from_json(&value.to_string());
            again(&name, &lens.unwrap_or_else(|error| panic!("{name}: {error}")));
            counts[1] += 1;
            continue;
        }
        let file = SceneFile::read(&path, &[]).unwrap_or_else(|error| panic!("{name}: {error}"));
        again(&name, &file.spec);
        // Also as a scene that a program hands over: by the schema's checks.
        let written = serde_json::to_value(&file.spec).expect("a value that JSON has");
        let read = SceneFile::from_json(&Opener::default(), file.folder(), written);
        assert_eq!(read.unwrap_or_else(|error| panic!("{name}: {error}")).spec, file.spec);
        counts[0] += 1;
        if file.sensor.is_some() {
            let sensor = SensorFile::read(&Opener::default(), &path, &[]);
            again(&name, &sensor.unwrap_or_else(|error| panic!("{name}: {error}")).spec);
            counts[2] += 1;
        }
    }
    for model in Model::ALL {
        let value = json!({ "type": "raw", "model": model });
        let sensor = SensorFile::of_value(Path::new(model.preset().name), value, &[]);
        again(model.preset().name, &sensor.expect("a preset").spec);
    }
    // 37 scenes and 7 lenses; five of the paper's figures have a sensor.
    assert!(counts[0] > 30 && counts[1] > 5 && counts[2] > 3, "{counts:?}");
}
