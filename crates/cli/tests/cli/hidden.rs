//! Models of which there is nothing to see: meshes collapsed to a point, and nodes scaled to 0.

use serde_json::json;

use crate::run::{Bench, text};

/// Renders `file` with default settings and every accelerator; none ends the process.
fn renders(bench: &Bench, file: &str) {
    for accel in ["embree", "bvh", "exact"] {
        if accel == "embree" && !cfg!(feature = "embree") {
            continue;
        }
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
