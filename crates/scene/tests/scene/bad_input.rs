//! Every way to write a scene wrongly: what the message says.

use std::fs;
use std::path::{Path, PathBuf};

use etendue_files::{Opener, Reach};
use etendue_scene::{LoadOptions, SceneError, SceneFile, Setting, Wanted};
use serde_json::{Value, json};
use tempfile::TempDir;

/// A folder with `scene.json` in it.
fn folder(text: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    fs::write(&path, text).unwrap();
    (folder, path)
}

fn load(path: &Path, settings: &[(&str, &str)]) -> Result<etendue_scene::Scene, SceneError> {
    let settings: Vec<Setting> =
        settings.iter().map(|&(path, value)| Setting::new(path, value)).collect();
    SceneFile::read(path, &settings)?.load(Wanted::NOTHING, &LoadOptions::default())
}

/// The message of a scene with this text, which must name the file.
fn message(text: &str) -> String {
    message_with(text, &[])
}

fn message_with(text: &str, settings: &[(&str, &str)]) -> String {
    let (_folder, path) = folder(text);
    let error = match load(&path, settings) {
        Ok(_) => panic!("this scene must be refused: {text}"),
        Err(error) => error.to_string(),
    };
    if settings.is_empty() {
        assert!(error.contains("scene.json"), "names the file: {error}");
    }
    error
}

/// Asserts that the message of `text` has all of `parts`.
fn assert_says(text: &str, parts: &[&str]) {
    let message = message(text);
    for part in parts {
        assert!(message.contains(part), "expected `{part}` in: {message}");
    }
}

#[test]
fn broken_json_shows_the_line() {
    let text = "{\n  \"etendue\": 1,\n  \"camera\": { \"type\": \"pinhole\" \"fov\": 3 }\n}";
    assert_says(
        text,
        &[
            "scene.json, line 3, column 33: broken JSON: expected `,` or `}`",
            "3 |   \"camera\": { \"type\": \"pinhole\" \"fov\": 3 }",
            "    |                                 ^",
        ],
    );
    assert_says("", &["line 1, column 1", "EOF"]);
    assert_says("{\"etendue\": 1, \"etendue\": 1}", &["column 16", "second time"]);
    assert_says("{\"etendue\": 1, \"camera\": NaN}", &["column 26"]);
    assert_says("{\"etendue\": 1e999}", &["out of range"]);
    assert_says(&"[".repeat(1000), &["recursion limit"]);
}

#[test]
fn other_files_are_no_scenes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    fs::write(&path, [0x67, 0x6c, 0xff, 0x46]).unwrap();
    let error = load(&path, &[]).unwrap_err().to_string();
    assert!(error.contains("not UTF-8 text (byte 2)") && error.contains(".glb"), "{error}");
    let error = load(folder.path(), &[]).unwrap_err().to_string();
    assert!(error.contains("not a regular file"), "{error}");
}

#[test]
fn a_missing_scene_names_the_nearest() {
    let (folder, _) = folder("{\"etendue\": 1}");
    let error = load(&folder.path().join("scnee.json"), &[]).unwrap_err().to_string();
    assert!(error.contains("no such file\nhint: did you mean \"scene.json\"?"), "{error}");
}

#[test]
fn unknown_keys_name_the_nearest() {
    assert_says(
        "{\n\"etendue\": 1,\n  \"objcets\": []}",
        &[
            "line 3, column 3: objcets: unknown key\nhint: did you mean `objects`?",
            "known: `accuracy`, `camera`",
        ],
    );
    assert_says(
        r#"{"etendue": 1, "camera": {"type": "pinhole", "fvo": 3}}"#,
        &["line 1, column 46: camera.fvo: unknown key\nhint: did you mean `fov`?", "`intrinsics`"],
    );
    assert_says(
        r#"{"etendue": 1, "camera": {"type": "pinhole", "sensor": {"resolutoin": [1, 1]}}}"#,
        &["camera.sensor.resolutoin", "did you mean `resolution`?"],
    );
    assert_says(
        r#"{"etendue": 1, "objects": [{"shape": "box"}, {"shape": "box", "sise": 3}]}"#,
        &["objects[1].sise", "did you mean `size`?", "`material`"],
    );
    assert_says(
        r#"{"etendue": 1, "materials": {"a b": {"type": "matte", "colour": [1, 1, 1]}}}"#,
        &["materials[\"a b\"].colour", "did you mean `color`?"],
    );
    assert_says(
        r#"{"etendue": 1, "layers": ["depth", {"type": "normal", "spcae": "camera"}]}"#,
        &["layers[1].spcae", "did you mean `space`?"],
    );
    // What later versions know is refused like any other key.
    assert_says(r#"{"etendue": 1, "lamps": []}"#, &["lamps: unknown key"]);
}

#[test]
fn unknown_words_name_the_nearest() {
    assert_says(
        r#"{"etendue": 1, "camera": {"type": "pinhol"}}"#,
        &["camera.type: unknown type \"pinhol\"\nhint: did you mean `pinhole`?", "`orthographic`"],
    );
    assert_says(r#"{"etendue": 1, "layers": ["dept"]}"#, &["layers[0]", "did you mean `depth`?"]);
    assert_says(
        r#"{"etendue": 1, "objects": [{"shape": "shpere"}]}"#,
        &["objects[0].shape: unknown shape \"shpere\"\nhint: did you mean `sphere`?"],
    );
    assert_says(
        r#"{"etendue": 1, "objects": [{"material": "m"}]}"#,
        &["objects[0]: says not what it is", "`file`", "`shape` (one of ", "`blob`"],
    );
    assert_says(r#"{"etendue": 1, "render": {"accel": "embre"}}"#, &["did you mean `embree`?"]);
}

#[test]
fn wrong_types_say_what_is_expected() {
    let cases = [
        (r#"[1, 2]"#, "expected an object, found [1,2]"),
        (r#"{"etendue": "1"}"#, "etendue: \"1\" is not 1"),
        (r#"{"etendue": 2}"#, "etendue: 2 is not 1"),
        (r#"{"camera": {"type": "pinhole"}}"#, "the key `etendue` is missing"),
        (r#"{"etendue": 1, "objects": {}}"#, "objects: expected an array, found {}"),
        (
            r#"{"etendue": 1, "camera": {"type": "pinhole", "fov": [3]}}"#,
            "camera.fov: expected a number or a string, found [3]",
        ),
        (
            r#"{"etendue": 1, "camera": {"type": "pinhole", "fov": "30 mm"}}"#,
            "camera.fov: \"30 mm\": unknown unit `mm`, known: arcmin, arcsec, deg, mrad, rad",
        ),
        (
            r#"{"etendue": 1, "camera": {"type": "orthographic", "height": "2"}}"#,
            "camera.height: \"2\" has no unit",
        ),
        (
            r#"{"etendue": 1, "camera": {"type": "pinhole", "sensor": {"resolution": [1.5, 2]}}}"#,
            "camera.sensor.resolution[0]: expected a whole number, found 1.5",
        ),
        (
            r#"{"etendue": 1, "camera": {"type": "pinhole", "sensor": {"resolution": [1, -2]}}}"#,
            "camera.sensor.resolution[1]: -2 is below the least, 0",
        ),
        (
            r#"{"etendue": 1, "camera": {"type": "pinhole", "sensor": {"resolution": [1, 5e9]}}}"#,
            "camera.sensor.resolution[1]: expected a whole number",
        ),
        (
            r#"{"etendue": 1, "camera": {"type": "pinhole", "sensor": {"resolution": [1]}}}"#,
            "camera.sensor.resolution: expected 2 values, found 1",
        ),
        (r#"{"etendue": 1, "render": {"samples": 0}}"#, "render.samples: 0 is below the least, 1"),
        (r#"{"etendue": 1, "layers": "depth"}"#, "layers: expected an array, found \"depth\""),
        (
            r#"{"etendue": 1, "camera": {"type": "pinhole", "pose": {"from": [0, 0, 1]}}}"#,
            "camera.pose: the key `look_at` is missing",
        ),
        (
            r#"{"etendue": 1, "camera": {"type": "pinhole", "intrinsics": {"fx": 1, "fy": 1,
            "cx": 0, "cy": 0}}}"#,
            "camera.intrinsics: the key `pixel_origin` is missing",
        ),
        (r#"{"etendue": 1, "camera": {"fov": 3}}"#, "camera: says not what it is"),
        (r#"{"etendue": 1, "camera": null, "objects": [7]}"#, "objects[0]: expected an object"),
    ];
    for (text, part) in cases {
        assert_says(text, &[part]);
    }
}

#[test]
fn samples_that_would_never_stop_or_are_none_are_refused_by_path() {
    let noise = |more: &str| format!(r#"{{"samples": {{"until": "sensor-noise"{more}}}}}"#);
    let cases = [
        (noise(r#", "fraction": 0"#), "render.samples.fraction: sampling would never stop"),
        (noise(r#", "fraction": 1e-300"#), "render.samples.fraction: sampling would never stop"),
        (noise(r#", "fraction": -0.5"#), "render.samples.fraction: -0.5 is below the least, 0"),
        (noise(r#", "fraction": 1.5"#), "render.samples.fraction: 1.5 is above the most, 1"),
        (
            noise(r#", "min": 64, "max": 16"#),
            "render.samples.min: at least 64 samples and at most 16",
        ),
        (noise(r#", "max": 3"#), "render.samples.max: at least 4 samples and at most 3"),
        (noise(r#", "min": 0"#), "render.samples.min: 0 is below the least, 1"),
        (noise(r#", "frac": 1"#), "render.samples.frac: unknown key\nhint: known: `fraction`"),
        (noise(r#"}, "sampler": {"a": 1"#), "render.sampler"),
        (r#"{"samples": {"until": "noise"}}"#.to_owned(), "render.samples.until: \"noise\" is not"),
        (r#"{"samples": {"relative_error": 0}}"#.to_owned(), "would never stop"),
        (r#"{"samples": {"time": "0 s"}}"#.to_owned(), "no samples are taken in no time"),
        (r#"{"samples": {"time": "10 m"}}"#.to_owned(), "unknown unit `m`"),
        (
            r#"{"samples": {"relative_error": 0.1}, "sampler": "stratified"}"#.to_owned(),
            "render.sampler: has to be told the number of samples beforehand",
        ),
    ];
    for (render, part) in cases {
        assert_says(&format!(r#"{{"etendue": 1, "render": {render}}}"#), &[part]);
    }
    for samples in ["64", r#"{"time": 1}"#] {
        let render =
            format!(r#""layers": ["depth", "variance"], "render": {{"samples": {samples}}}"#);
        let part =
            "layers: the layer `variance` is of samples that go on until an error is reached";
        assert_says(&format!(r#"{{"etendue": 1, {render}}}"#), &[part]);
    }
}

#[test]
fn overrides_of_the_plan_that_contradict_each_other_are_refused_by_path() {
    let cases = [
        (
            r#""render": {"accel": "bvh"}, "plan": {"refine": false}"#,
            "plan.refine: `bvh` works in f64",
        ),
        (
            r#""render": {"accel": "exact"}, "plan": {"refine": false}"#,
            "plan.refine: `exact` works",
        ),
        (
            r#""plan": {"refine": false, "light_precision": "double"}"#,
            "plan.refine: contradicts `light_precision` \"double\"",
        ),
        (
            r#""plan": {"textures": false, "texture_filter": true}"#,
            "plan.texture_filter: contradicts `textures` false",
        ),
        (r#""plan": {"build_quality": "best"}"#, "plan.build_quality: \"best\" is not known here"),
        (r#""plan": {"textur": true}"#, "plan.textur: unknown key\nhint: did you mean `textures`?"),
    ];
    for (text, part) in cases {
        assert_says(&format!(r#"{{"etendue": 1, {text}}}"#), &[part]);
    }
}

#[test]
fn impossible_cameras_are_refused_by_path() {
    let cases = [
        (
            r#""sensor": {"resolution": [0, 480]}"#,
            "camera.sensor.resolution: expected 1 to 65535 pixels a side, found 0",
        ),
        (r#""sensor": {"resolution": [70000, 4]}"#, "camera.sensor.resolution"),
        (r#""sensor": {"resolution": [65535, 65535]}"#, "over 2147483648 pixels in all"),
        (r#""fov": 180"#, "camera.fov: 180 is outside 0 to 180"),
        (r#""fov": 0"#, "camera.fov: 0 is outside"),
        (r#""fov": -3"#, "camera.fov"),
        (
            r#""pose": {"from": [1, 2, 3], "look_at": [1, 2, 3]}"#,
            "camera.pose.look_at: is the same point as `from`",
        ),
        (r#""pose": {"from": [0, 5, 0], "look_at": [0, 0, 0]}"#, "camera.pose.up: lies along"),
        (r#""pose": {"from": [1e300, 5, 0], "look_at": [0, 0, 0]}"#, "pose: a number is too large"),
        (
            r#""pose": {"matrix": [[0,0,0,0],[0,0,0,0],[0,0,0,0],[0,0,0,1]],
                "maps": "world_from_camera", "convention": "gltf"}"#,
            "camera.pose.matrix",
        ),
    ];
    for (camera, part) in cases {
        let text = format!(r#"{{"etendue": 1, "camera": {{"type": "pinhole", {camera}}}}}"#);
        assert_says(&text, &[part, "line 1, column "]);
    }
}

#[test]
fn impossible_objects_are_refused_by_path() {
    let cases = [
        (r#""transform": {"scale": 0}"#, "objects[0].transform.scale: is zero"),
        (r#""transform": {"rotate": [0, 0, 0, 5]}"#, "objects[0].transform.rotate"),
        (
            r#""transform": {"matrix": [[1,1,0,0],[1,1,0,0],[0,0,1,0],[0,0,0,1]]}"#,
            "objects[0].transform.matrix: is singular",
        ),
        (r#""transform": {"scale": [1, 2]}"#, "objects[0].transform.scale: expected 3 values"),
        (
            r#""material": "cley""#,
            "objects[0].material: unknown material \"cley\"\nhint: did you mean `clay`?",
        ),
        (r#""size": [1, 0, 1]"#, "objects[0].size"),
        (r#""size": ["1 m", "1 mn", 1]"#, "objects[0].size[1]: \"1 mn\": unknown unit `mn`"),
    ];
    for (object, part) in cases {
        let text = format!(
            r#"{{"etendue": 1, "objects": [{{"shape": "box", {object}}}],
                "materials": {{"clay": {{"type": "matte", "color": [1, 1, 1]}}}}}}"#
        );
        assert_says(&text, &[part]);
    }
    assert_says(
        r#"{"etendue": 1, "objects": [{"shape": "box", "material": "clay"}]}"#,
        &["the scene has no `materials`"],
    );
    assert_says(
        r#"{"etendue": 1, "materials": {"m": {"type": "matte", "color": [1.5, 0, 0]}}}"#,
        &["materials.m.color", "outside 0 to 1"],
    );
    // Bytes of sRGB: ((v / 255 + 0.055) / 1.055)^2.4.
    assert_says(
        r#"{"etendue": 1, "materials": {"m": {"type": "matte", "color": [200, 100, 50]}}}"#,
        &["materials.m.color", "of 255 are [0.578, 0.127, 0.032]"],
    );
    for tracer in [r#"{"type": "depth"}"#, r#""depth""#] {
        let text = format!(r#"{{"etendue": 1, "tracer": {tracer}}}"#);
        assert_says(&text, &["tracer", "`depth` is a layer", r#""layers": ["depth"]"#]);
    }
    assert_says(
        r#"{"etendue": 1, "materials": {"m": {"type": "checker", "squares": 0}}}"#,
        &["materials.m.squares"],
    );
}

#[test]
fn a_missing_model_names_the_nearest() {
    let (folder, path) = folder(r#"{"etendue": 1, "objects": [{"file": "bunyn.obj"}]}"#);
    fs::write(folder.path().join("bunny.obj"), "v 0 0 0\n").unwrap();
    let error = load(&path, &[]).unwrap_err().to_string();
    for part in ["line 1, column 29", "objects[0].file", "no such file", "mean \"bunny.obj\"?"] {
        assert!(error.contains(part), "{part}: {error}");
    }
}

#[test]
fn a_path_may_not_leave_the_folder() {
    let outer = tempfile::tempdir().unwrap();
    let inner = outer.path().join("inner");
    fs::create_dir(&inner).unwrap();
    fs::write(outer.path().join("secret.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(outer.path().join("secret.obj"), inner.join("link.obj")).unwrap();
    let absolute = outer.path().join("secret.obj").display().to_string();
    let mut written =
        vec!["../secret.obj", "a/../../secret.obj", "./../inner/../secret.obj", &absolute];
    if cfg!(unix) {
        written.push("link.obj");
    }
    for file in written {
        let text = format!(r#"{{"etendue": 1, "objects": [{{"file": "{file}"}}]}}"#);
        let path = inner.join("scene.json");
        fs::write(&path, text).unwrap();
        let error = load(&path, &[]).unwrap_err().to_string();
        assert!(error.contains("objects[0].file") && error.contains("--allow-outside"), "{error}");
        if file != "a/../../secret.obj" {
            let options =
                LoadOptions { opener: Opener::new(Reach::Anywhere), ..LoadOptions::default() };
            let scene = SceneFile::read(&path, &[]).unwrap().load(Wanted::NOTHING, &options);
            assert_eq!(scene.unwrap().geometry.triangles(), 1, "{file}: allowed when asked for");
        }
    }
    // What is not there cannot be asked after either.
    let text = r#"{"etendue": 1, "objects": [{"file": "../nothing.obj"}]}"#;
    fs::write(inner.join("scene.json"), text).unwrap();
    let error = load(&inner.join("scene.json"), &[]).unwrap_err().to_string();
    assert!(error.contains("leaves") && !error.contains("no such file"), "{error}");
}

#[test]
fn settings_say_that_they_are_wrong() {
    let text = r#"{"etendue": 1, "camera": {"type": "pinhole", "fov": 30}, "objects": []}"#;
    let error = message_with(text, &[("camera.fov", "190")]);
    assert!(error.starts_with("--set camera.fov=190: camera.fov: 190 is outside"), "{error}");
    let error = message_with(text, &[("camera.fvo", "19")]);
    assert!(error.contains("--set camera.fvo=19") && error.contains("`fov`"), "{error}");
    let error = message_with(text, &[("objects[3].file", "a.obj")]);
    assert!(error.contains("objects has 0 entries"), "{error}");
    let error = message_with(text, &[("camera..fov", "3")]);
    assert!(error.contains("is no path"), "{error}");
    let error = message_with(text, &[("camera", r#"{"type": "pinhole", "fov": 200}"#)]);
    assert!(error.starts_with("--set camera={"), "{error}");
}

#[test]
fn a_camera_that_is_not_there_lists_those_that_are() {
    let (_folder, path) = folder(r#"{"etendue": 1}"#);
    let options = LoadOptions { camera: Some("front"), ..LoadOptions::default() };
    let error = SceneFile::read(&path, &[]).unwrap().load(Wanted::NOTHING, &options).unwrap_err();
    assert_eq!(error.to_string(), "--camera front: no model of the scene has a camera");
}

/// Curves that are none, each with its place and what would mend it.
#[test]
fn curves_that_are_none_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("two.csv"), "nm,a,b\n400,0.1,0.2\n700,0.3,1.4\n").unwrap();
    std::fs::write(
        folder.path().join("n.yml"),
        "DATA:\n - type: tabulated n\n   data: |\n 0.4 1.5\n 0.7 1.6\n",
    )
    .unwrap();
    let matte = |color: Value| json!({ "type": "matte", "color": color });
    for (material, place, word) in [
        (matte(json!({ "curve": [[500, 0.1], [400, 0.2]] })), "color.curve", "sort"),
        (matte(json!({ "curve": [[500, 0.1], [500, 0.2]] })), "color.curve", "once"),
        (matte(json!({ "curve": [[-5, 0.1], [500, 0.2]] })), "color.curve", "positive"),
        (matte(json!({ "curve": [[0.4, 0.1], [0.7, 0.2]] })), "color.curve", "did you mean nm"),
        (matte(json!({ "curve": [[400, 0.1], [700, 1.2]] })), "color", "fluorescence"),
        (matte(json!({ "curve": [[400, -0.1], [700, 0.2]] })), "color", "below zero"),
        (matte(json!({ "file": "two.csv" })), "color.file", "`column`"),
        (matte(json!({ "file": "two.csv", "column": "c" })), "color.file", "\"a\", \"b\""),
        (matte(json!({ "file": "two.csv", "column": "b" })), "color", "1.4 at 700 nm"),
        (matte(json!({ "file": "none.csv" })), "color.file", "none.csv"),
        (json!({ "type": "metal", "metal": { "file": "n.yml" } }), "metal.file", "no table of k"),
        (
            json!({ "type": "dielectric", "absorption": {
                "color": { "curve": [[400, 0.5], [700, 1.5]] }, "distance": 1 } }),
            "absorption.color",
            "1.5 at 700 nm",
        ),
        (
            json!({ "type": "emissive", "radiance": { "curve": [[400, -1], [700, 1]] } }),
            "radiance",
            "no less than 0",
        ),
        (
            json!({ "type": "emissive", "radiance": { "line": 532 }, "illuminant": "d65" }),
            "illuminant",
            "leave one of them out",
        ),
    ] {
        let scene = json!({
            "objects": [{ "shape": "box", "material": "m" }], "materials": { "m": material }
        });
        let file = SceneFile::from_json(&Opener::default(), folder.path(), scene);
        let error =
            file.and_then(|file| file.load(Wanted::NOTHING, &LoadOptions::default()).map(|_| ()));
        let text = error.unwrap_err().to_string();
        let place = format!("materials.m.{place}");
        assert!(text.contains(&place) && text.contains(word), "{place} {word}: {text}");
    }
}
