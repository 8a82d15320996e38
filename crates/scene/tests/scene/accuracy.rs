//! Numbers that trade accuracy for speed: their limits, their rows in the plan, and what contradicts them.

use std::path::Path;

use etendue_camera::LensAccuracy;
use etendue_report::DecisionKind;
use etendue_scene::file::{AccuracySetting, AccuracySpec, SceneFile};
use etendue_scene::{LoadOptions, Wanted};
use serde_json::{Value, json};

fn read(scene: Value) -> Result<AccuracySpec, String> {
    let opener = LoadOptions::default().opener;
    let file = SceneFile::from_json(&opener, Path::new("."), scene);
    file.map(|file| file.spec.accuracy).map_err(|error| error.to_string())
}

#[test]
fn every_setting_lies_within_its_limits_and_is_refused_beyond_them() {
    for AccuracySetting { name, path, default, range: [least, most], .. } in
        AccuracySpec::default().settings()
    {
        assert!(least <= default && default <= most, "{name}");
        let set = |value: f64| {
            // Whole numbers as the format writes them.
            let value: Value = serde_json::from_str(&value.to_string()).unwrap();
            read(json!({ "accuracy": { name: value } }))
        };
        for value in [least, most] {
            let found = set(value).unwrap();
            let own = found.settings().into_iter().find(|own| own.name == name).unwrap();
            assert_eq!(own.value, value, "{name}");
        }
        for value in [least - 1.0, 2.0 * most + 1.0] {
            let error = set(value).unwrap_err();
            assert!(error.contains(path), "{error}");
        }
    }
    assert!(read(json!({ "accuracy": { "pathnoise": 1 } })).unwrap_err().contains("path_noise"));
}

#[test]
fn what_is_set_is_a_row_of_the_plan_and_nothing_else_is() {
    assert_eq!(AccuracySpec::default().decisions(), []);
    let spec = AccuracySpec { view_psnr: 40.0, ..AccuracySpec::default() };
    let [row] = &spec.decisions()[..] else { panic!("one row") };
    assert_eq!((row.kind, row.key), (DecisionKind::Accuracy, Some("accuracy.view_psnr")));
    assert!(row.is_forced && row.reason.ends_with("43 by itself"), "{}", row.reason);
}

#[test]
fn what_the_scene_says_elsewhere_is_contradicted_by_name() {
    let precision =
        json!({ "accuracy": { "path_noise": 1 }, "plan": { "light_precision": "double" } });
    let error = read(precision).unwrap_err();
    assert!(error.contains("accuracy.path_noise") && error.contains("light_precision"), "{error}");
    let bands = json!({ "from": 400, "to": 700, "count": 6 });
    let sensor = |kind: &str| {
        let sensor = json!({ "type": kind, "resolution": [4, 4], "bands": bands });
        json!({ "accuracy": { "band_error": 0.01 }, "camera": { "type": "pinhole", "sensor": sensor } })
    };
    let error = read(sensor("raw")).unwrap_err();
    assert!(error.contains("accuracy.band_error") && error.contains("`bands`"), "{error}");
    // A multispectral sensor's bands are its channels, which are divided further.
    assert!(read(sensor("multispectral")).is_ok());
    let shared =
        json!({ "accuracy": { "band_place_error": 0.1 }, "plan": { "shared_paths": false } });
    let error = read(shared).unwrap_err();
    assert!(
        error.contains("accuracy.band_place_error") && error.contains("`plan.shared_paths`"),
        "{error}"
    );
    let points =
        json!({ "accuracy": { "texture_lookups": 16 }, "plan": { "texture_filter": false } });
    let error = read(points).unwrap_err();
    assert!(
        error.contains("accuracy.texture_lookups") && error.contains("`plan.texture_filter`"),
        "{error}"
    );
}

#[test]
fn a_lens_is_measured_as_the_scene_says() {
    let scene = json!({
        "accuracy": { "pupil_margin": 0.01, "pupil_checks": 2048, "wavefront_error": 0.01, "fit_places": 9,
                      "band_place_error": 0.1 },
        "camera": { "type": "thin_lens", "focal_length": 50, "f_number": 2, "focus_distance": 2,
                    "sensor_height": 24, "pose": { "from": [0, 0, 2], "look_at": [0, 0, 0] },
                    "sensor": { "resolution": [8, 8] } },
        "objects": [{ "shape": "sphere" }],
    });
    let options = LoadOptions::default();
    let file = SceneFile::from_json(&options.opener, Path::new("."), scene).unwrap();
    let scene = file.load(Wanted::NOTHING, &options).unwrap();
    let mut expected = LensAccuracy::DEFAULT;
    (expected.pupil.margin, expected.pupil.checks) = (0.01, 2048);
    (expected.waves.error, expected.fit_places, expected.sharing.places) = (0.01, 9, 0.1);
    assert_eq!(scene.camera.lens().unwrap().accuracy(), expected);
}
