//! Additions that people and editors write beside the format.

use crate::run::{Bench, text, under};

#[test]
fn comments_and_schema_addresses_are_allowed_anywhere() {
    let plain = r#"{"etendue": 1, "camera": {"type": "pinhole", "sensor": {"resolution": [8, 8]}},
        "objects": [{"shape": "box", "material": "clay"}], "materials": {"clay": {"type": "matte", "color": [0.5, 0.5, 0.5]}}}"#;
    let remarked = r#"{"$schema": "scene.schema.json", "comment": ["a box", "of clay"], "etendue": 1,
        "camera": {"comment": "frames it", "type": "pinhole",
                   "sensor": {"comment": "small", "resolution": [8, 8]}},
        "objects": [{"comment": "1 m", "shape": "box", "material": "clay",
                     "transform": {"comment": "as it is"}}],
        "materials": {"clay": {"comment": "grey", "type": "matte", "color": [0.5, 0.5, 0.5]}},
        "render": {"comment": "quick", "samples": 1}}"#;
    let hash = |scene: &str| {
        let bench = Bench::with_scene(scene);
        bench.render(&["--report", "report.json"]);
        bench.json("report.json")["image_hash"].clone()
    };
    assert_eq!(hash(plain), hash(remarked));
    // Only these words, and only as text.
    let refused = |remark: &str| {
        let wrong = remarked.replace("\"comment\": \"1 m\"", remark);
        Bench::with_scene(&wrong).refusal(&["check", "scene.json"])
    };
    insta::assert_snapshot!(refused("\"coment\": \"1 m\""), @"
    error: scene.json, line 4, column 22: objects[0].coment: unknown key
    hint: known: `animation`, `instances`, `material`, `materials`, `motion`, `name`, `shape`, `size`, `transform`, `up`
    ");
    insta::assert_snapshot!(refused("\"comment\": 7"), @"error: scene.json, line 4, column 22: objects[0].comment: expected a string or an array, found 7");
}

#[test]
fn lens_and_sensor_files_may_be_remarked_too() {
    let bench = Bench::new();
    bench.write(
        "lens.json",
        br#"{"$schema": "lens.schema.json", "comment": "a plain one", "elements": [
            {"comment": "crown", "type": "surface", "radius": 50, "thickness": 5,
             "glass": {"comment": "made up", "n": 1.5}, "semi_diameter": 10},
            {"type": "surface", "radius": -50, "semi_diameter": 10}]}"#,
    );
    let output = bench.run(&["lens", "lens.json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    bench.write(
        "sensor.json",
        br#"{"$schema": "sensor.schema.json", "comment": "mine", "type": "raw", "model": "imx183",
            "resolution": "640x480"}"#,
    );
    let output = bench.run(&["sensor", "sensor.json", "--json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
}

#[test]
fn schemas_know_what_is_allowed_beside_the_format() {
    let bench = Bench::new();
    for of in ["scene", "lens", "rays"] {
        let output = bench.run(&["schema", of]);
        let schema: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        for key in ["$schema", "comment"] {
            assert!(schema["properties"][key].is_object(), "{of}: {key}");
        }
    }
}

#[test]
fn resolutions_may_be_words() {
    let bench = Bench::with_scene(
        r#"{"etendue": 1, "camera": {"type": "pinhole", "sensor": {"resolution": "12x7"}},
            "layers": ["depth"], "objects": [{"shape": "box"}]}"#,
    );
    bench.render(&[]);
    assert_eq!(bench.array("depth").len(), 12 * 7);
    bench.render(&["--set", "camera.sensor.resolution=9 x 5"]);
    assert_eq!(bench.json("out/camera.json")["resolution"], serde_json::json!([9, 5]));
    let messages = ["640*480", "640", "-3x4", "1x2x3", "4294967296x1"].map(|wrong| {
        let setting = format!("camera.sensor.resolution=\"{wrong}\"");
        under(wrong, &bench.refusal(&["check", "scene.json", "--set", &setting]))
    });
    insta::assert_snapshot!(messages.concat());
}

#[test]
fn a_lens_is_looked_at_without_a_word_when_asked() {
    let bench = Bench::new();
    let lens = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/lenses/double-gauss.json");
    let loud = bench.run(&["lens", lens, "-o", "drawn"]);
    assert!(text(&loud.stderr).contains("wrote"), "{}", text(&loud.stderr));
    let quiet = bench.run(&["lens", lens, "-o", "drawn", "--quiet", "--wavelengths", "2000"]);
    assert!(quiet.status.success() && quiet.stderr.is_empty(), "{}", text(&quiet.stderr));
    assert!(!quiet.stdout.is_empty(), "results still go to standard output");
}
