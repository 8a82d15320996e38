//! Catalogues of glasses of the user's: each session has its own.

use std::fs;
use std::path::Path;
use std::sync::Barrier;

use etendue::{Options, Progress, Session};
use serde_json::{Value, json};

/// n² = 1 + b λ²/(λ² − 0.01), as a catalogue and as a scene has it.
fn catalogue(b: f64) -> String {
    format!("CC made up\nNM OWN-1 2 0 1.6 60 0 1\nCD {b} 0.01 0 0 0 0\nLD 0.35 2.5\n")
}

fn scene(glass: &Value) -> Value {
    json!({
        "etendue": 1,
        "camera": {
            "type": "lens", "focus_distance": 3, "sensor_height": 4, "sensor": {"resolution": [6, 4]},
            "pose": {"from": [0, 0, 3], "look_at": [0, 0, 0]},
            "lens": {"elements": [
                {"type": "surface", "radius": 50, "thickness": 5, "glass": glass, "semi_diameter": 4, "stop": true},
                {"type": "surface", "radius": -50, "semi_diameter": 4}]}
        },
        "objects": [{"shape": "sphere"}]
    })
}

/// The camera's focal length (pixels).
fn focal_length(folder: &Path, scene: &Value, catalogue: Option<&str>) -> f64 {
    let glass_catalogs = catalogue.map(|name| folder.join(name)).into_iter().collect();
    let options = Options { glass_catalogs, ..Options::default() };
    let mut session = Session::from_json_with(folder, scene.clone(), options).unwrap();
    session.scene(&Progress::none()).unwrap().camera.opencv().k.unwrap()[0][0]
}

#[test]
fn two_sessions_in_two_threads_have_glasses_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let own = scene(&json!("OWN-1"));
    let cases = [("light.agf", 1.2), ("heavy.agf", 1.9)];
    let expected = cases.map(|(name, b)| {
        fs::write(path.join(name), catalogue(b)).unwrap();
        let glass = json!({"sellmeier": {"b": [b], "c": [0.01]}});
        focal_length(path, &scene(&glass), None)
    });
    assert!((expected[0] - expected[1]).abs() > 1.0, "{expected:?}");
    let barrier = Barrier::new(2);
    std::thread::scope(|scope| {
        for ((name, _), expected) in cases.iter().zip(expected) {
            let (own, barrier) = (&own, &barrier);
            scope.spawn(move || {
                for _ in 0..5 {
                    barrier.wait();
                    let found = focal_length(path, own, Some(name));
                    assert!((found / expected - 1.0).abs() < 1e-12, "{name}: {found}, {expected}");
                }
            });
        }
    });
    // And none has another's.
    let error = Session::from_json(path, own).unwrap().scene(&Progress::none()).unwrap_err();
    assert!(error.to_string().contains("unknown glass \"OWN-1\""), "{error}");
    // Materials look in the same catalogues.
    let mut glassy = scene(&json!("N-BK7"));
    glassy["objects"] = json!([{"shape": "sphere", "material": "own"}]);
    glassy["materials"] = json!({"own": {"type": "dielectric", "ior": "OWN-1"}});
    focal_length(path, &glassy, Some("heavy.agf"));
    let options = Options { glass_catalogs: vec![path.join("none.agf")], ..Options::default() };
    let error = Session::from_json_with(path, glassy, options).unwrap_err().to_string();
    assert!(error.contains("none.agf"), "{error}");
}
