//! Simpler models of a lens: `plan --models`, and `lens --fit-opencv`.

use serde_json::{Value, json};

use crate::run::{Bench, text, under};

/// A scene with the double Gauss of the examples.
fn bench() -> Bench {
    let bench = Bench::new();
    let lens = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/lenses/double-gauss.json");
    bench.write("lens.json", &std::fs::read(lens).unwrap());
    bench.write("scene.json", scene(&camera()).to_string().as_bytes());
    bench
}

fn camera() -> Value {
    json!({ "type": "lens", "lens": "lens.json", "f_number": 8, "focus_distance": "1.6 m",
        "sensor_height": "24 mm", "pose": { "from": [0, 0.5, 1.9], "look_at": [0, 0.3, 0] },
        "sensor": { "resolution": [90, 60] } })
}

fn scene(camera: &Value) -> Value {
    json!({ "etendue": 1, "camera": camera, "tracer": { "type": "facing" }, "layers": ["depth"],
        "objects": [{ "shape": "rectangle", "width": 9, "height": 9 },
                    { "shape": "sphere", "radius": 0.2, "transform": { "translate": [0, 0.3, 0.4] } }] })
}

fn printed(bench: &Bench, arguments: &[&str]) -> Value {
    let output = bench.run(arguments);
    assert!(output.status.success(), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

#[test]
fn a_fit_is_written_and_is_a_camera_of_a_scene() {
    let bench = bench();
    let fit = printed(&bench, &["lens", "scene.json", "--fit-opencv", "--json", "-o", "out"]);
    assert_eq!(fit["version"], 1);
    let written = std::fs::read(bench.path("out/opencv.json")).unwrap();
    assert_eq!(serde_json::from_slice::<Value>(&written).unwrap(), fit);
    assert_eq!(
        (&fit["model"], fit["coefficients"].as_array().unwrap().len()),
        (&json!("brown_conrady"), 5)
    );
    let largest = fit["residuals"]["largest"].as_f64().unwrap();
    assert!(largest < 0.5 && fit["holds"]["share"] == 1.0, "{fit}");
    bench.write("fitted.json", scene(&fit["camera"]).to_string().as_bytes());
    let output = bench.run(&["render", "fitted.json", "-o", "fitted", "--outputs", "npy"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let words = text(&bench.run(&["lens", "lens.json", "--fit-opencv"]).stdout);
    for word in ["distortion", "residuals", "holds", "\"intrinsics\""] {
        assert!(words.contains(word), "{words}");
    }
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let bench = bench();
    let commands: [&[&str]; 9] = [
        &["lens", "scene.json", "--fit-opencv", "--f-number", "4"],
        &["lens", "lens.json", "--fit-opencv", "--tolerance", "0 px"],
        &["lens", "lens.json", "--fit-opencv", "--resolution", "40"],
        &["lens", "lens.json", "--fit-opencv", "--resolution", "0x0"],
        &["lens", "lens.json", "--fit-opencv", "--resolution", "40x0"],
        &["lens", "lens.json", "--tolerance", "1 px"],
        &["plan", "scene.json", "--models", "--tolerance", "1 m"],
        &["plan", "scene.json", "--models", "--tolerance", "1 px,5"],
        &["plan", "scene.json", "--models", "--set", "camera={\"type\": \"pinhole\"}"],
    ];
    let messages = commands.map(|arguments| under(&arguments.join(" "), &bench.refusal(arguments)));
    insta::assert_snapshot!(messages.concat());
}

#[test]
fn plan_names_the_cheapest_model_within_a_tolerance() {
    let bench = bench();
    let all = printed(&bench, &["plan", "scene.json", "--models", "--json"]);
    let names: Vec<&str> =
        all["models"].as_array().unwrap().iter().map(|m| m["model"].as_str().unwrap()).collect();
    assert_eq!(names, ["pinhole", "opencv", "falloff", "thin", "thick", "undispersed", "full"]);
    // A pixel is an eighth of that of the example: nothing that the train does shows but distortion and blur.
    assert_eq!(all["cheapest"], "opencv", "{all}");
    assert!(all["saving"].as_f64().is_some_and(f64::is_finite), "{all}");
    // By waves there is less modulation than by rays, and nowhere more than there can be.
    let waves = all["waves"].as_array().unwrap();
    assert!(waves.len() >= 3, "{waves:?}");
    for finding in waves {
        for axis in [0, 1] {
            let [rays, waves] = ["rays", "waves"].map(|key| finding[key][axis].as_f64().unwrap());
            // A hundredth of what is left of waves that are not in focus may come back.
            assert!((0.0..1.0 + 1e-6).contains(&waves) && waves < rays + 0.01, "{finding}");
        }
    }
    let middle = &waves[0];
    assert!(middle["waves"][0].as_f64() < middle["rays"][0].as_f64(), "{middle}");
    let words = bench.run(&["plan", "scene.json", "--models", "--tolerance", "0.5 px,2 %"]);
    let words = text(&words.stdout);
    // Every model tells the keys that take it.
    for key in [
        r#"{"plan":{"dispersion":false}} takes it"#,
        r#""falloff":{"#,
        r#""type":"thin_lens""#,
        r#"{"camera":{"diffraction":true}} takes it"#,
    ] {
        assert!(words.contains(key), "{key}: {words}");
    }
    assert!(words.contains("cheapest within 0.5 px and 2 % of light: "), "{words}");
    let opencv = &all["scenes"][1];
    let mut taken: Value =
        serde_json::from_slice(&std::fs::read(bench.path("scene.json")).unwrap()).unwrap();
    taken["camera"] = opencv["camera"].clone();
    bench.write("taken.json", taken.to_string().as_bytes());
    let output = bench.run(&["render", "taken.json", "-o", "taken", "--outputs", "npy"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
}
