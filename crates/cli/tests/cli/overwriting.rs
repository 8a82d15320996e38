//! Files that are already there: inputs, files of an earlier run, files of others, and folders that fail.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::json;

use crate::frames::scene;
use crate::run::{Bench, text, under};

const BOX: &str = r#"{"etendue": 1, "layers": ["depth", "ids"],
    "camera": {"type": "pinhole", "sensor": {"resolution": [8, 8]}},
    "objects": [{"shape": "box", "size": [1, 1, 1]}]}"#;

/// A scene whose only object is a model with a texture.
const MODEL: &[u8] = b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\n\
                       f 1/1 2/2 3/3\n";

/// Every file below a folder with its bytes.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry")) {
        let name = entry.file_name().to_string_lossy().into_owned();
        if entry.path().is_dir() {
            let below = contents(&entry.path()).into_iter();
            found.extend(below.map(|(inner, bytes)| (format!("{name}/{inner}"), bytes)));
        } else {
            found.insert(name, fs::read(entry.path()).unwrap_or_default());
        }
    }
    found
}

/// Runs a command that has to be refused, and has to change nothing; what it says, below it.
fn refused(bench: &Bench, arguments: &[&str]) -> String {
    let before = contents(&bench.path(""));
    let message = bench.refusal(arguments);
    assert!(contents(&bench.path("")) == before, "{arguments:?} changed something");
    under(&arguments.join(" "), &message)
}

#[test]
fn no_command_writes_over_what_it_reads() {
    let bench = Bench::new();
    for name in ["camera.json", "layers.json", "bench.json", "scene.json"] {
        bench.write(name, BOX.as_bytes());
    }
    bench.write("model.obj", MODEL);
    bench.write("m.mtl", b"newmtl m\nmap_Kd picture.png\n");
    bench.write("picture.png", b"an image of the model's own, broken or not");
    bench.write("curves.json", br#"{"type": "raw", "model": "imx183"}"#);
    let achromat = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/lenses/achromat.json");
    fs::copy(achromat, bench.path("lens.json")).expect("a lens");
    bench.write("rays.json", br#"{"from": "object", "rays": []}"#);

    let commands: [&[&str]; 9] = [
        &["render", "camera.json", "-o", "."],
        &["render", "layers.json", "-o", "."],
        &["render", "model.obj", "-o", "."],
        &["render", "scene.json", "-o", "o", "--report", "scene.json"],
        &["render", "model.obj", "-o", "o", "--report", "m.mtl"],
        &["bench", "bench.json", "-o", ".", "--quick"],
        &["sensor", "curves.json", "-o", "."],
        &["lens", "lens.json", "--save", "lens.json"],
        &["lens", "lens.json", "--rays", "rays.json", "--save", "rays.json"],
    ];
    insta::assert_snapshot!(commands.map(|arguments| refused(&bench, arguments)).concat());
    assert!(!bench.path("o").exists());
}

#[test]
#[cfg(unix)]
fn links_to_inputs_are_inputs() {
    let bench = Bench::with_scene(BOX);
    fs::create_dir(bench.path("out")).expect("a folder");
    let link = bench.path("out/layers.json");
    std::os::unix::fs::symlink("../scene.json", &link).expect("a link");
    let render = ["render", "scene.json", "-o", "out"];
    let mut all = refused(&bench, &render);
    fs::remove_file(&link).expect("a link");
    fs::hard_link(bench.path("scene.json"), bench.path("out/depth.npy")).expect("a link");
    all += &refused(&bench, &render);
    fs::rename(bench.path("out/depth.npy"), bench.path("report")).expect("a file");
    all += &refused(&bench, &["render", "scene.json", "-o", "out", "--report", "report"]);
    insta::assert_snapshot!(all);
}

/// Two poses that look at the box, as nerfstudio has them.
const TRANSFORMS: &[u8] = br#"{"fl_x": 8, "fl_y": 8, "cx": 4, "cy": 4, "w": 8, "h": 8, "frames": [
    {"file_path": "a", "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,3],[0,0,0,1]]},
    {"file_path": "b", "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}]}"#;

/// The same as COLMAP has them.
const COLMAP: [(&str, &[u8]); 2] = [
    ("cameras.txt", b"1 PINHOLE 8 8 8 8 4 4\n"),
    ("images.txt", b"1 1 0 0 0 0 0 3 1 a\n\n2 1 0 0 0 0 0 4 1 b\n\n"),
];

fn along(file: &str) -> String {
    let mut scene: serde_json::Value = serde_json::from_str(BOX).unwrap();
    scene["frames"] = json!({"type": "trajectory", "file": file});
    scene.to_string()
}

#[test]
#[cfg(unix)]
fn trajectories_are_inputs() {
    let bench = Bench::new();
    bench.write("transforms.json", TRANSFORMS);
    fs::create_dir(bench.path("colmap")).unwrap();
    for (name, bytes) in COLMAP {
        bench.write(&format!("colmap/{name}"), bytes);
    }
    bench.write("scene.json", along("transforms.json").as_bytes());
    std::os::unix::fs::symlink(".", bench.path("linked")).unwrap();
    let mut all = refused(&bench, &["render", "scene.json", "-o", "."]);
    all += &refused(&bench, &["render", "scene.json", "-o", "linked"]);
    let report = ["render", "scene.json", "-o", "o", "--report", "transforms.json"];
    all += &refused(&bench, &report);
    bench.write("scene.json", along("colmap/images.txt").as_bytes());
    all += &refused(&bench, &["render", "scene.json", "-o", "."]);
    let report = ["render", "scene.json", "-o", "o", "--report", "linked/colmap/cameras.txt"];
    all += &refused(&bench, &report);
    insta::assert_snapshot!(all);
    assert!(!bench.path("o").exists());
}

#[test]
fn a_file_of_any_frame_is_refused_before_the_first_is_written() {
    let mut scene: serde_json::Value = serde_json::from_str(BOX).unwrap();
    scene["objects"][0]["material"] = json!("paint");
    scene["tracer"] = json!({"type": "flat"});
    let image = |file: &str| json!({"type": "matte", "color": {"image": file}});
    // An image of the scene, and one that a frame alone names.
    let place = "o/frames/000001/picture.png";
    let (by_scene, by_frame) = (image(place), json!([{}, {}, {"materials.paint": image(place)}]));
    let mut all = String::new();
    for (paint, frames) in [(by_scene, json!([{}, {}])), (image("plain.png"), by_frame)] {
        let bench = Bench::new();
        bench.write("plain.png", include_bytes!("../../../etendue/tests/data/paint.png"));
        fs::create_dir_all(bench.path("o/frames/000001")).unwrap();
        fs::copy(bench.path("plain.png"), bench.path(place)).unwrap();
        (scene["materials"], scene["frames"]) = (json!({"paint": paint}), frames);
        bench.write("scene.json", scene.to_string().as_bytes());
        all += &refused(&bench, &["render", "scene.json", "-o", "o"]);
    }
    insta::assert_snapshot!(all);
    let bench = Bench::with_scene(&crate::frames::scene(&json!([{}, {}])));
    let name = "out/frames/000001/depth.npy";
    let report = ["render", "scene.json", "-o", "out", "--report", name];
    insta::assert_snapshot!(bench.refusal(&report), @"
    error: --report out/frames/000001/depth.npy: a result has this name
    hint: choose another one
    ");
    assert!(!bench.path("out").exists());
}

#[test]
fn a_report_does_not_take_the_place_of_a_result() {
    let bench = Bench::with_scene(BOX);
    let report = ["render", "scene.json", "-o", "out", "--report", "out/camera.json"];
    insta::assert_snapshot!(bench.refusal(&report), @"
    error: --report out/camera.json: a result has this name
    hint: choose another one
    ");
    bench.render(&["--report", "out/report.json"]);
    bench.render(&["--report", "out/report.json"]);
    assert!(bench.path("out/report.json").exists());
}

#[test]
fn a_second_render_leaves_nothing_of_the_first_and_all_of_others() {
    let bench = Bench::with_scene(BOX);
    bench.render(&[]);
    for (name, bytes) in [("notes.txt", "mine"), ("normal.npy", "mine, too")] {
        bench.write(&format!("out/{name}"), bytes.as_bytes());
    }
    assert!(bench.path("out/id_object.npy").exists());
    // A render that fails destroys nothing.
    let before = contents(&bench.path("out"));
    let failed = bench.run(&["render", "scene.json", "-o", "out", "--set", "objects[0].size=[0]"]);
    assert_eq!(failed.status.code(), Some(2));
    assert!(contents(&bench.path("out")) == before);
    // One that was changed is nobody's to remove.
    let mut changed = fs::read(bench.path("out/id_object.preview.png")).expect("a file");
    *changed.last_mut().expect("bytes") ^= 1;
    bench.write("out/id_object.preview.png", &changed);
    bench.render(&["--layers", "depth", "--outputs", "npy"]);
    let names: Vec<String> = contents(&bench.path("out")).into_keys().collect();
    assert_eq!(
        names,
        [
            "camera.json",
            "depth.npy",
            "etendue-manifest.json",
            "id_object.preview.png",
            "layers.json",
            "normal.npy",
            "notes.txt",
        ]
    );
}

#[test]
fn what_a_killed_run_left_is_removed() {
    let bench = Bench::with_scene(BOX);
    fs::create_dir(bench.path("out")).expect("a folder");
    bench.write("out/.depth.npy.a1B2c3.part", b"half");
    bench.write("out/.mine.part", b"mine");
    bench.render(&[]);
    assert!(!bench.path("out/.depth.npy.a1B2c3.part").exists());
    assert!(bench.path("out/.mine.part").exists());
}

/// Runs a script in namespaces of its own, where anybody may mount; `None` where that is not allowed.
fn in_namespace(bench: &Bench, script: &str) -> Option<std::process::Output> {
    let allowed = Command::new("unshare").args(["-rm", "true"]).output().ok()?;
    if !allowed.status.success() {
        return None;
    }
    let script = script.replace("etendue", env!("CARGO_BIN_EXE_etendue"));
    let mut command = Command::new("unshare");
    command.args(["-rm", "sh", "-c", &script]).current_dir(bench.path(""));
    Some(command.output().expect("unshare runs"))
}

/// Exit code 1: it is not the input that has to be mended.
#[test]
fn a_full_disk_is_no_fault_of_the_input() {
    let bench = Bench::with_scene(BOX);
    fs::create_dir(bench.path("out")).expect("a folder");
    let script = "mount -t tmpfs -o size=64k none out || exit 77
        etendue render scene.json -o out --quiet --set 'camera.sensor.resolution=[256,256]'";
    let Some(output) = in_namespace(&bench, script) else {
        return println!("skipped: no namespaces");
    };
    let err = text(&output.stderr);
    if output.status.code() == Some(77) {
        return println!("skipped: {err}");
    }
    assert_eq!(output.status.code(), Some(1), "{err}");
    assert!(err.contains("free some space"), "{err}");
}

/// A file system that takes no writes: refused before anything is rendered, and nothing is left.
#[test]
fn a_folder_that_cannot_be_written_to_is_named_at_once() {
    let bench = Bench::with_scene(BOX);
    fs::create_dir(bench.path("out")).expect("a folder");
    let script = "mount -t tmpfs -o ro none out || exit 77
        etendue render scene.json -o out/new --quiet --set render.samples=1048576";
    let Some(output) = in_namespace(&bench, script) else {
        return println!("skipped: no namespaces");
    };
    let err = text(&output.stderr);
    if output.status.code() == Some(77) {
        return println!("skipped: {err}");
    }
    assert_eq!(output.status.code(), Some(2), "{err}");
    assert!(err.contains("out/new") && err.contains("Read-only"), "{err}");
}

#[test]
fn strict_checks_decode_images() {
    let bench = Bench::new();
    bench.write("model.obj", MODEL);
    bench.write("m.mtl", b"newmtl m\nmap_Kd broken.png\n");
    bench.write("broken.png", b"\x89PNG\r\n\x1a\n and no more");
    assert!(bench.run(&["check", "model.obj"]).status.success());
    insta::assert_snapshot!(bench.refusal(&["check", "model.obj", "--strict"]), @"error: cannot decode broken.png: Format error decoding Png: ChunkType { type:  no , critical: false, private: true, reserved: true, safecopy: true } chunk appeared before IHDR chunk");
}

#[test]
fn frames_that_the_scene_has_no_more_go() {
    let orbit = |count: u32| scene(&json!({"type": "orbit", "count": count}));
    let by_layer = ["--pattern", "{layer}/{frame}"];
    for (pattern, gone) in [(&[][..], "frames/000003/depth.npy"), (&by_layer, "depth/000003.npy")] {
        let bench = Bench::with_scene(&orbit(5));
        bench.render(pattern);
        // Something else beside them, and a gap, as after a render of a part.
        fs::create_dir_all(bench.path("out/frames/000004")).unwrap();
        bench.write("out/frames/000004/mine.txt", b"mine");
        fs::remove_file(bench.path("out").join(gone)).unwrap();
        bench.write("scene.json", orbit(3).as_bytes());
        bench.render(pattern);
        let name = |number: u32| gone.replace("000003", &format!("{number:06}"));
        let is_there = |number| bench.path("out").join(name(number)).exists();
        assert_eq!([0, 1, 2, 3, 4].map(is_there), [true, true, true, false, false], "{gone}");
        assert!(!bench.path("out/frames/000003").exists());
        assert!(!bench.path("out/frames/000004.json").exists());
        assert!(bench.path("out/frames/000004/mine.txt").exists(), "what nobody rendered stays");
        assert_eq!(bench.json("out/index.json")["frames"].as_array().map(Vec::len), Some(3));
    }
}
