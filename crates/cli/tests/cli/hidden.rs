//! Models of which there is nothing to see: meshes collapsed to a point, and nodes scaled to 0.

use etendue_accel::AccelName;
use serde_json::json;

use crate::run::{Bench, text};

/// Renders `file` with default settings and every accelerator; none ends the process.
fn renders(bench: &Bench, file: &str) {
    for accel in AccelName::built().map(AccelName::name) {
        let size = "camera.sensor.resolution=[8,4]";
        let output = bench.run(&["render", file, "-o", accel, "--accel", accel, "--set", size]);
        let code = output.status.code();
        assert!(output.status.success(), "{file}, {accel}: {code:?}: {}", text(&output.stderr));
    }
}

fn defects(bench: &Bench, file: &str) -> serde_json::Value {
    let output = bench.run(&["check", file, "--json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    serde_json::from_slice::<serde_json::Value>(&output.stdout).expect("JSON")["defects"].clone()
}

#[test]
fn meshes_of_one_point_end_no_process() {
    let bench = Bench::new();
    bench.write("mini.obj", b"v 2 2 2\nv 2 2 2\nv 2 2 2\no b\nf 1 2 3\no c\nf 1 2 3\n");
    renders(&bench, "mini.obj");
    assert_eq!(defects(&bench, "mini.obj")["degenerate"], 2);
}

#[test]
fn nodes_scaled_to_0_end_no_process() {
    let bench = Bench::new();
    let node =
        |scale: f64| json!({"mesh": 0, "scale": [scale, scale, scale], "translation": [2, 2, 2]});
    let gltf = json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0, 1, 2]}],
        "nodes": [node(0.0), node(0.0), node(1.0)],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
            "min": [0, 0, 0], "max": [1, 1, 0]}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": "corners.bin"}],
    });
    let corners: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    bench.write("corners.bin", &corners.map(f32::to_le_bytes).concat());
    bench.write("hidden.gltf", gltf.to_string().as_bytes());
    renders(&bench, "hidden.gltf");
    assert_eq!(defects(&bench, "hidden.gltf")["collapsed"], 2);
}

/// A triangle in the plane z = 0.
const CORNERS: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// A model of [`CORNERS`] a kilometre away.
fn flat_node(scale: [f64; 3]) -> serde_json::Value {
    json!({
        "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "scale": scale, "translation": [1000, 0, 0]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
            "min": [0, 0, 0], "max": [1, 1, 0]}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": "corners.bin"}],
    })
}

#[test]
fn what_has_no_size_sets_no_frame() {
    let bench = Bench::new();
    bench.write("corners.bin", &CORNERS.map(f32::to_le_bytes).concat());
    // A cube, alone and with something far away that nothing is drawn of.
    let cube = json!({"shape": "box"});
    let scaled = |name: &str, scale: [f64; 3]| {
        bench.write(name, flat_node(scale).to_string().as_bytes());
        json!({"file": name})
    };
    let scenes = [
        vec![cube.clone()],
        vec![cube.clone(), scaled("point.gltf", [0.0, 0.0, 0.0])],
        vec![cube.clone(), scaled("line.gltf", [0.0, 9.0, 0.0])],
        // A triangle across z that is seen on edge.
        vec![cube.clone(), scaled("edge.gltf", [9.0, 0.0, 9.0])],
        vec![json!({"file": "hairs.obj"}), cube],
    ];
    // Points and lines beside a triangle at the origin.
    let hairs = "v 1000 0 0\nv 0 1000 0\nv 0 2000 0\nv 0 0 0\nv 0.1 0 0\nv 0 0.1 0\n\
                 f 1 1 1\nf 4 2 3\nf 4 5 6\n";
    bench.write("hairs.obj", hairs.as_bytes());
    let mut all = Vec::new();
    for (number, objects) in scenes.into_iter().enumerate() {
        let name = format!("{number}.json");
        let scene = json!({"etendue": 1, "layers": ["coverage"], "objects": objects,
                           "render": {"accel": "bvh"},
                           "camera": {"type": "pinhole", "sensor": {"resolution": [32, 32]}}});
        bench.write(&name, scene.to_string().as_bytes());
        let output = bench.run(&["render", &name, "-o", "out"]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        let check = bench.run(&["check", &name, "--json"]);
        let check: serde_json::Value = serde_json::from_slice(&check.stdout).expect("JSON");
        let told = [&check["bounds"], &check["precision"]["f32_step_in_world"]].map(Clone::clone);
        all.push((bench.json("out/camera.json"), bench.array("coverage"), told));
    }
    // Half of a picture at the least is the cube that it frames.
    let covered = all[0].1.iter().sum::<f64>() / all[0].1.len() as f64;
    assert!(covered > 0.5, "{covered}");
    for (number, other) in all.iter().enumerate() {
        assert_eq!(*other, all[0], "scene {number}");
    }
}
