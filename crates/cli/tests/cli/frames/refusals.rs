//! Frames that cannot be: refused at once, by their number and place.

use serde_json::{Value, json};

use super::scene;
use crate::run::{Bench, under};

fn refused(frames: &Value, files: &[(&str, &[u8])], more: &[&str]) -> String {
    let bench = Bench::with_scene(&scene(frames));
    files.iter().for_each(|(name, bytes)| bench.write(name, bytes));
    let message = bench.refusal(&[&["render", "scene.json", "-o", "out", "-q"], more].concat());
    assert!(!bench.path("out/frames/000000/layers.exr").exists());
    message
}

/// Frames are told to be too many before any is made.
#[test]
fn too_many_frames_are_refused_at_once() {
    let grid = json!({"type": "grid", "columns": 100_000, "rows": 100_000, "spacing": 0.1});
    insta::assert_snapshot!(refused(&grid, &[], &[]), @"error: scene.json, line 1, column 139: frames.columns: 10000000000 frames; 100000 are the most");
    let orbit = json!({"type": "orbit", "count": 4_000_000_000_u32});
    insta::assert_snapshot!(refused(&orbit, &[], &[]), @"error: scene.json, line 1, column 139: frames.count: 4000000000 frames; 100000 are the most");
}

#[test]
fn a_value_that_is_wrong_in_one_frame_is_told_with_its_place() {
    let bench = Bench::with_scene(&scene(&json!([{}, {"camera.fov": 300}])));
    insta::assert_snapshot!(bench.refusal(&["render", "scene.json", "-o", "out", "-q"]), @"error: frames[1]: camera.fov=300: camera.fov: 300 is outside 0 to 180 degrees (both excluded)");
    assert!(!bench.path("out/frames/000001").exists(), "no empty folder is left");
}

#[test]
fn bad_frames_are_refused_by_number() {
    let poses = |name: &str| json!({"type": "trajectory", "file": name});
    // Poses that are no rotation: which, and by how much.
    let bent = json!([[1, 0, 0, 0], [0, 1.01, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]);
    let good = json!({"from": [0, 0, 4], "look_at": [0, 0, 0]});
    let bent = json!({"matrix": bent, "maps": "world_from_camera", "convention": "opengl"});
    let cases = [
        json!([{"camera.fov": 30}, {"camera.fow": 30}]),
        json!([]),
        poses("no.npy"),
        json!({"type": "orbit", "count": 0}),
        json!({"type": "orbit", "count": 3, "axis": [0, 0, 0]}),
        json!({"type": "poses", "poses": [good, bent]}),
        json!({"type": "poses", "poses": [], "times": [1]}),
    ];
    let mut all =
        cases.map(|frames| under(&frames.to_string(), &refused(&frames, &[], &[]))).concat();
    all += &under("--frames 1..2", &refused(&json!([{}]), &[], &["--frames", "1..2"]));
    let files: [(&str, &[u8]); 4] = [
        ("a quaternion of no length", b"0 0 0 4 0 0 0 1\n1 0 0 4 0 0 0 0\n"),
        ("no number", b"0 0 nan 4 0 0 0 1\n"),
        ("three words", b"0 0 0\n"),
        ("times that fall", b"0.1 0 0 4 0 0 0 1\n0.2 0 0 4 0 0 0 1\n0.15 0 0 4 0 0 0 1\n"),
    ];
    for (what, bytes) in files {
        all += &under(what, &refused(&poses("a.txt"), &[("a.txt", bytes)], &[]));
    }
    let npy = |shape: &str, values: &[u8]| {
        let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}");
        [&b"\x93NUMPY\x01\x00\x76\x00"[..], format!("{header:<117}\n").as_bytes(), values].concat()
    };
    for (shape, values) in
        [("(1, 4, 5)", vec![0; 160]), ("(1, 3, 4)", f64::NAN.to_le_bytes().repeat(12))]
    {
        let bytes = npy(shape, &values);
        all += &under(shape, &refused(&poses("a.npy"), &[("a.npy", &bytes)], &[]));
    }
    insta::assert_snapshot!(all);
}

/// Intrinsics of no lens, before anything is rendered: 16 × 12 pixels of them took 6 s.
#[test]
fn intrinsics_of_no_lens_are_refused_at_once() {
    let pose = |z: f64| json!([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, z], [0, 0, 0, 1]]);
    let odd = json!({"fl_x": 2e-5, "fl_y": 20, "k1": 0.01, "frames": [
        {"file_path": "a", "transform_matrix": pose(4.0)}, {"file_path": "b", "transform_matrix": pose(5.0)}]});
    let trajectory = json!({"type": "trajectory", "file": "odd.json"});
    let mut free: Value = serde_json::from_str(&scene(&trajectory)).unwrap();
    free["camera"].as_object_mut().unwrap().remove("fov");
    let bench = Bench::with_scene(&free.to_string());
    bench.write("odd.json", odd.to_string().as_bytes());
    let started = std::time::Instant::now();
    let message = bench.refusal(&["render", "scene.json", "-o", "out", "-q"]);
    assert!(started.elapsed().as_secs_f64() < 5.0, "{:?}", started.elapsed());
    insta::assert_snapshot!(message, @r#"
    error: frames[0]: camera.distortion={"k1":0.01,"k2":0.0,"k3":0.0,"p1":0.0,"p2":0.0,"type":"brown_conrady"}: camera.distortion: the picture reaches 89.9999° from the axis, where no lens of this model sees
    hint: check the focal lengths (fx, fy) and the resolution, which are in pixels, or leave out the distortion
    "#);
}
