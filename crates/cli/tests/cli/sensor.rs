//! `etendue sensor`: presets, curves, and the image series of a characterisation.

use std::collections::BTreeSet;

use serde_json::{Value, json};

use crate::run::{Bench, text, under};

/// A sensor whose every stage does something, small enough for a test.
fn small() -> Value {
    json!({
        "type": "raw", "resolution": [32, 24], "quantum_efficiency": 0.55, "system_gain": 0.8,
        "read_noise": 3.0, "dark_current": 2.0, "full_well": 5000, "black_level": 50,
        "bit_depth": 12, "prnu": 0.01, "dsnu": 1.0, "serial": 5
    })
}

fn with(keys: &Value) -> String {
    let mut sensor = small();
    for (key, value) in keys.as_object().expect("an object") {
        sensor[key] = value.clone();
    }
    serde_json::to_string_pretty(&sensor).expect("JSON")
}

#[test]
fn presets_are_listed() {
    let bench = Bench::new();
    let output = bench.run(&["sensor"]);
    assert!(output.status.success());
    let table = text(&output.stdout);
    assert!(table.contains("IMX183") && table.contains("5496 × 3672 p"), "{table}");
    let cards: Vec<Value> =
        serde_json::from_slice(&bench.run(&["sensor", "--json"]).stdout).expect("JSON");
    assert!(cards.len() >= 10);
    for card in &cards {
        assert!(card["sources"].as_str().is_some_and(|text| !text.is_empty()));
        let facts = card["facts"].as_array().expect("figures");
        let assumed: Vec<&Value> = facts
            .iter()
            .filter(|fact| fact["origin"] == "assumed")
            .map(|fact| &fact["key"])
            .collect();
        assert_eq!(card["assumed"].as_array().unwrap().iter().collect::<Vec<_>>(), assumed);
        assert!(assumed.iter().any(|key| **key == "dsnu"), "{card}");
        // Whatever the list calls it, the command takes.
        assert!(table.contains(card["name"].as_str().unwrap()));
    }
}

#[test]
fn a_preset_gives_curves_as_table_json_and_svg() {
    let bench = Bench::new();
    let output = bench.run(&["sensor", "KAF-8300", "-o", "out"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let table = text(&output.stdout);
    for word in [
        "full_well",
        "assumed, without a source: dark_current_temperature",
        "SNR at most",
        "normal approximation",
        "photons",
    ] {
        assert!(table.contains(word), "{word} in {table}");
    }
    let svg = std::fs::read_to_string(bench.path("out/curves.svg")).expect("curves");
    assert!(svg.starts_with("<svg") && svg.contains("ideal sensor"));
    let found = bench.json("out/curves.json");
    assert_eq!(found["sensor"]["model"], "kaf8300");
    let gain = found["curves"]["system_gain_measured"].as_f64().unwrap();
    // K as the slope of 40 variances of 65 536 pixels.
    assert!((gain * 0.37 - 1.0).abs() < 4e-3, "{gain}");
    let printed = bench.run(&["sensor", "kaf8300", "--json", "--quiet"]);
    assert_eq!(serde_json::from_slice::<Value>(&printed.stdout).expect("JSON"), found);
}

#[test]
fn a_sensor_file_and_a_scene_with_the_same_sensor_are_the_same() {
    let bench = Bench::new();
    bench.write("sensor.json", with(&json!({})).as_bytes());
    let scene = json!({ "etendue": 1, "camera": { "type": "pinhole", "sensor": small() } });
    bench.write("scene.json", scene.to_string().as_bytes());
    let curves = |arguments: &[&str]| -> Value {
        let output = bench.run(&[&["sensor", "--json"], arguments].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        serde_json::from_slice(&output.stdout).expect("JSON")
    };
    let alone = curves(&["sensor.json"]);
    assert_eq!(alone, curves(&["scene.json"]));
    let noise = |found: &Value| found["curves"]["dark_noise"].as_f64().unwrap();
    assert!((noise(&alone) - (9.0f64 + 0.02).sqrt()).abs() < 1e-12);
    let louder = curves(&["sensor.json", "--set", "read_noise=30"]);
    assert!((noise(&louder) - (900.0f64 + 0.02).sqrt()).abs() < 1e-12);
}

#[test]
fn a_series_has_the_files_that_its_manifest_names() {
    let bench = Bench::new();
    bench.write("sensor.json", with(&json!({})).as_bytes());
    let output = bench.run(&[
        "sensor",
        "sensor.json",
        "--emva",
        "out",
        "--wavelength",
        "600",
        "--steps",
        "21",
    ]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let manifest = bench.json("out/manifest.json");
    let keys = |value: &Value| -> BTreeSet<String> {
        value.as_object().unwrap().keys().cloned().collect()
    };
    let set = |keys: &[&str]| keys.iter().map(|key| (*key).to_owned()).collect::<BTreeSet<_>>();
    assert_eq!(keys(&manifest), set(&["bits", "spatial", "steps"]));
    assert_eq!(manifest["bits"], 12);
    let steps = manifest["steps"].as_array().unwrap();
    assert_eq!(steps.len(), 21);
    let mut names = set(&["manifest.json", "emva1288.txt", "etendue-manifest.json"]);
    for (step, count) in steps.iter().map(|s| (s, 2)).chain([(&manifest["spatial"], 16)]) {
        assert_eq!(keys(step), set(&["bright", "dark", "exposure_s", "photons"]));
        for kind in ["bright", "dark"] {
            let files = step[kind].as_array().unwrap();
            assert_eq!(files.len(), count);
            names.extend(files.iter().map(|file| file.as_str().unwrap().to_owned()));
        }
    }
    let found: BTreeSet<String> = std::fs::read_dir(bench.path("out"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    assert_eq!(found, names);
    // 600 nm and 525 nm differ in nothing but what a flat curve does not tell apart.
    let descriptor = std::fs::read_to_string(bench.path("out/emva1288.txt")).unwrap();
    assert!(descriptor.contains("n 12 32 24"), "{descriptor}");
}

/// Settings of a scene are refused of a sensor: what is set of a scene's sensor would make a scene
/// of it, whose sensor has nothing else.
#[test]
fn paths_of_a_scene_are_refused_of_a_sensor() {
    let bench = Bench::new();
    bench.write("sensor.json", with(&json!({})).as_bytes());
    let mut all = String::new();
    for name in ["imx183", "sensor.json"] {
        for setting in ["camera.sensor.exposure=1", "camera.fov=1"] {
            let arguments = ["sensor", name, "--set", setting];
            all += &under(&arguments.join(" "), &bench.refusal(&arguments));
        }
    }
    insta::assert_snapshot!(all);
}

#[test]
fn what_is_no_sensor_is_refused_by_file_path_and_remedy() {
    let sensors = [
        json!({ "quantum_efficiency": 1.2 }),
        json!({ "quantum_efficiency": -0.1 }),
        json!({ "quantum_efficiency": [] }),
        json!({ "quantum_efficiency": [[500, 0.5], [400, 0.5]] }),
        json!({ "system_gain": 0 }),
        json!({ "system_gain": -1 }),
        json!({ "full_well": 0.5 }),
        json!({ "bit_depth": 0 }),
        json!({ "bit_depth": 17 }),
        json!({ "exposure": 0 }),
        json!({ "temperature": -1 }),
        json!({ "read_nose": 1 }),
        json!({ "noise": "gauss" }),
        json!({ "model": "imx184" }),
        json!({ "cfa": "rggx" }),
        json!({ "cfa": "rgb" }),
        json!({ "cfa": "rggb", "filters": { "x": 1 } }),
        json!({ "read_noise": 1e300 }),
        json!({ "quantum_efficiency": [[900, 0.5], [1000, 0.5]], "cfa": "rggb" }),
    ];
    let messages = sensors.map(|keys| {
        let bench = Bench::new();
        bench.write("sensor.json", with(&keys).as_bytes());
        let message = bench.refusal(&["sensor", "sensor.json"]);
        assert_eq!(bench.refusal(&["sensor", "sensor.json", "--emva", "o"]), message);
        assert!(!bench.path("o").exists(), "{keys}: something was left behind");
        under(&keys.to_string(), &message)
    });
    insta::assert_snapshot!(messages.concat());
}

#[test]
fn what_cannot_be_characterised_is_refused() {
    let bench = Bench::new();
    bench.write("none.json", with(&json!({ "noise": "none" })).as_bytes());
    bench.write("ideal.json", br#"{ "type": "raw" }"#);
    bench.write("scene.json", br#"{ "etendue": 1, "camera": { "type": "pinhole" } }"#);
    bench.write("inside.json", br#"{ "etendue": 1, "camera": { "sensor": { "bit_depth": 20 } } }"#);
    let commands: [&[&str]; 11] = [
        &["none.json", "--emva", "o"],
        &["ideal.json"],
        &["scene.json"],
        &["inside.json"],
        &["imx999"],
        &["nowhere.json"],
        &["imx183", "--emva", "o", "--steps", "5"],
        &["imx183", "--emva", "o", "--wavelength", "1500"],
        &["imx183", "--wavelength", "-3"],
        &["imx183", "--set", "exposure=0"],
        &["--emva", "o"],
    ];
    let messages = commands.map(|arguments| {
        let message = bench.refusal(&[&["sensor"], arguments].concat());
        assert!(!bench.path("o").exists(), "{arguments:?}: something was left behind");
        under(&arguments.join(" "), &message)
    });
    insta::assert_snapshot!(messages.concat());
}
