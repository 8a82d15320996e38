//! Models with skins: where the pose that the file has at rest puts them.

use serde_json::json;

use crate::run::{Bench, text};

/// The corners of a figure 0.6 m wide, 0.3 m deep and 1.8 m tall, as programs with Z up write it.
fn corners() -> Vec<[f32; 3]> {
    let mut corners = Vec::new();
    for z in [0.0, 1.8] {
        for (x, y) in [(-0.3, -0.15), (0.3, -0.15), (0.3, 0.15), (-0.3, 0.15)] {
            corners.push([x, y, z]);
        }
    }
    corners
}

/// A rig as `CesiumMan`'s: vertices with Z up, joints below a node that turns Z up to Y up, and inverse
/// bind matrices that undo the joints as bound but not that node.
fn rig(bench: &Bench) {
    let corners = corners();
    let mut bytes: Vec<u8> = corners.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    for _ in &corners {
        bytes.extend([0, 1, 0, 0]);
    }
    // The feet hang on the hips, the rest on the head.
    for [_, _, z] in &corners {
        bytes.extend(if *z == 0.0 { [255, 0, 0, 0] } else { [0, 255, 0, 0] });
    }
    for height in [-0.9_f32, -1.6] {
        let matrix = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., height, 1.];
        bytes.extend(matrix.iter().flat_map(|x: &f32| x.to_le_bytes()));
    }
    let sides =
        [[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7], [4, 5, 6, 7], [3, 2, 1, 0]];
    for [a, b, c, d] in sides {
        bytes.extend::<[u8; 6]>([a, b, c, a, c, d]);
    }
    let document = json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {"name": "Z_UP", "children": [1, 3],
             "matrix": [1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1]},
            {"name": "hips", "translation": [0, 0, 0.9], "children": [2]},
            {"name": "head", "translation": [0, 0, 0.7]},
            {"name": "man", "mesh": 0, "skin": 0},
        ],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": 3, "skeleton": 1}],
        "meshes": [{"primitives": [{
            "attributes": {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}, "indices": 4}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 8,
             "min": [-0.3, -0.15, 0], "max": [0.3, 0.15, 1.8]},
            {"bufferView": 1, "componentType": 5121, "type": "VEC4", "count": 8},
            {"bufferView": 2, "componentType": 5121, "type": "VEC4", "count": 8,
             "normalized": true},
            {"bufferView": 3, "componentType": 5126, "type": "MAT4", "count": 2},
            {"bufferView": 4, "componentType": 5121, "type": "SCALAR", "count": 36}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 96},
            {"buffer": 0, "byteOffset": 96, "byteLength": 32},
            {"buffer": 0, "byteOffset": 128, "byteLength": 32},
            {"buffer": 0, "byteOffset": 160, "byteLength": 128},
            {"buffer": 0, "byteOffset": 288, "byteLength": 36}],
        "buffers": [{"uri": "man.bin", "byteLength": bytes.len()}],
    });
    bench.write("man.gltf", document.to_string().as_bytes());
    bench.write("man.bin", &bytes);
}

#[test]
fn a_figure_whose_joints_turn_it_upright_stands() {
    let bench = Bench::new();
    rig(&bench);
    let output = bench.run(&["check", "man.gltf", "--json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    println!("{report}");
    // Z of the file is Y of the world; corners of f32 are told apart to 1e-7 m.
    for (end, expected) in [("min", [-0.3, 0.0, -0.15]), ("max", [0.3, 1.8, 0.15])] {
        for (k, expected) in expected.into_iter().enumerate() {
            let found = report["bounds"][end][k].as_f64().expect("a number");
            assert!((found - expected).abs() < 2e-7, "{end}: {}", report["bounds"]);
        }
    }
    let notes = report["notes"].to_string();
    assert!(!notes.contains("skin"), "{notes}");
}
