//! A data set of a real model by one command, read by the words of those who document its formats.

use std::collections::BTreeSet;

use serde_json::{Value, json};

use crate::run::{Bench, assets};

const SIZE: [usize; 2] = [240, 180];

/// An orbit of 36 frames around a model, through a camera with distortion.
fn orbit(name: &str) -> Option<Bench> {
    let model =
        std::fs::read(assets("orbit")?.join("data/gltf/Sundial/Sundial.glb")).expect("the model");
    let bench = Bench::new();
    bench.write("sundial.glb", &model);
    let scene = json!({
        "etendue": 1,
        "tracer": {"type": "flat"},
        "layers": ["depth", "position", "normal", "ids", "material_id"],
        "render": {"samples": 1},
        "camera": {
            "type": "pinhole",
            "intrinsics": {"fx": 300, "fy": 297, "cx": 121.5, "cy": 88.25, "pixel_origin": "center"},
            "distortion": {"type": "brown_conrady", "k1": -0.21, "k2": 0.06, "p1": 0.001, "p2": -0.002},
            "sensor": {"resolution": SIZE}
        },
        "objects": [{"file": "sundial.glb"}],
        "frames": {"type": "orbit", "count": 36}
    });
    bench.write(name, scene.to_string().as_bytes());
    bench.render(&[]);
    Some(bench)
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("a number, not {value}"))
}

fn matrix<const R: usize, const C: usize>(value: &Value) -> [[f64; C]; R] {
    assert_eq!(value.as_array().map(Vec::len), Some(R), "{value}");
    std::array::from_fn(|i| {
        assert_eq!(value[i].as_array().map(Vec::len), Some(C), "{value}");
        std::array::from_fn(|j| number(&value[i][j]))
    })
}

/// A point in a camera by its matrix.
fn moved(m: &[[f64; 4]; 4], p: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| m[i][0] * p[0] + m[i][1] * p[1] + m[i][2] * p[2] + m[i][3])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

/// The pixel of OpenCV's `projectPoints`, by its documentation.
fn project(frame: &Value, [x, y, z]: [f64; 3]) -> [f64; 2] {
    let k = matrix::<3, 3>(&frame["K"]);
    let d: Vec<f64> =
        frame["distortion"]["coefficients"].as_array().unwrap().iter().map(number).collect();
    assert_eq!(frame["distortion"]["model"], "brown_conrady");
    let (k1, k2, p1, p2) = (d[0], d[1], d[2], d[3]);
    let (x, y) = (x / z, y / z);
    let r2 = x * x + y * y;
    let radial = 1.0 + k1 * r2 + k2 * r2 * r2;
    let u = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
    let v = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
    [k[0][0] * u + k[0][2], k[1][1] * v + k[1][2]]
}

#[test]
fn thirty_six_frames_of_a_real_model_meet_each_other_and_are_what_nerfstudio_documents() {
    let Some(bench) = orbit("scene.json") else { return };
    let index = bench.json("out/index.json");
    let frames = index["frames"].as_array().unwrap();
    assert_eq!(frames.len(), 36);
    reprojects(&bench, frames);
    is_nerfstudios(&bench, frames);
}

/// Points of one frame lie on the planes of the triangles that the next one sees there.
fn reprojects(bench: &Bench, frames: &[Value]) {
    let at = |frame: usize, layer: &str| bench.array(&format!("frames/{frame:06}/{layer}"));
    let (first, second) = (at(1, "position"), at(2, "position"));
    let (normal, depth) = (at(2, "normal"), at(2, "depth"));
    // A node may have several meshes, each of a material.
    let ids = |frame| ["id_node", "id_primitive", "material_id"].map(|layer| at(frame, layer));
    let (ids_here, ids_there) = (ids(1), ids(2));
    let pose = matrix::<4, 4>(&frames[2]["camera_from_world"]);
    let corner = if frames[2]["pixel_origin"] == "corner" { 0.0 } else { 0.5 };
    let (mut seen, mut worst) = (0, 0.0_f64);
    for i in (0..first.len() / 3).filter(|i| first[3 * i].is_finite()) {
        let point = [0, 1, 2].map(|k| first[3 * i + k]);
        let in_camera = moved(&pose, point);
        let [u, v] = project(&frames[2], in_camera).map(|x| x + corner);
        let [width, height] = SIZE;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "in the picture"
        )]
        let (column, row) = (u.max(0.0) as usize, v.max(0.0) as usize);
        if u < 0.0 || v < 0.0 || column >= width || row >= height {
            continue;
        }
        let there = row * width + column;
        // Another triangle is before it, or beside it.
        if (0..3).any(|k| ids_here[k][i] != ids_there[k][there]) {
            continue;
        }
        // The pixel's depth, carried from its centre to the point along the triangle's plane.
        let turn = |v: [f64; 3]| [0, 1, 2].map(|r| dot([pose[r][0], pose[r][1], pose[r][2]], v));
        let n = turn([0, 1, 2].map(|k| normal[3 * there + k]));
        let q = moved(&pose, [0, 1, 2].map(|k| second[3 * there + k]));
        assert!((q[2] / depth[there] - 1.0).abs() < 1e-12);
        let along = dot(n, q) / dot(n, in_camera);
        // Planes seen nearly edge-on stretch roundings.
        if dot(n, in_camera).abs() < 0.02 * dot(in_camera, in_camera).sqrt() {
            continue;
        }
        worst = worst.max((along - 1.0).abs());
        seen += 1;
    }
    assert!(seen > 500, "{seen}");
    assert!(worst < 1e-9, "{worst}");
}

/// <https://docs.nerf.studio/quickstart/data_conventions.html>: every key is one that it documents, and says
/// what it documents.
fn is_nerfstudios(bench: &Bench, frames: &[Value]) {
    let file = bench.json("out/transforms.json");
    let known: BTreeSet<&str> = [
        "file_path",
        "transform_matrix",
        "depth_file_path",
        "mask_path",
        "camera_model",
        "fl_x",
        "fl_y",
        "cx",
        "cy",
        "w",
        "h",
        "k1",
        "k2",
        "k3",
        "k4",
        "p1",
        "p2",
    ]
    .into();
    assert_eq!(file.as_object().unwrap().keys().collect::<Vec<_>>(), ["camera_model", "frames"]);
    let listed = file["frames"].as_array().unwrap();
    assert_eq!(listed.len(), frames.len());
    for (frame, ours) in listed.iter().zip(frames) {
        let keys = frame.as_object().unwrap().keys();
        let unknown: Vec<_> = keys.filter(|key| !known.contains(key.as_str())).collect();
        assert!(unknown.is_empty(), "{unknown:?}");
        assert_eq!(frame["camera_model"], "OPENCV");
        for key in ["file_path", "depth_file_path"] {
            let path = bench.path("out").join(frame[key].as_str().unwrap());
            assert!(path.is_file(), "{}", path.display());
        }
        assert_eq!([&frame["w"], &frame["h"]], SIZE.map(|side| json!(side)).each_ref());
        assert_eq!([number(&frame["fl_x"]), number(&frame["fl_y"])], [300.0, 297.0]);
        assert_eq!([number(&frame["k1"]), number(&frame["p2"])], [-0.21, -0.002]);
        // Principal points count from the corner, as in COLMAP.
        assert_eq!([number(&frame["cx"]), number(&frame["cy"])], [122.0, 88.75]);
        // Camera to world, x right, y up and z back: OpenCV's with two axes turned.
        let m = matrix::<4, 4>(&frame["transform_matrix"]);
        assert_eq!(m[3], [0.0, 0.0, 0.0, 1.0]);
        let from_world = matrix::<4, 4>(&ours["camera_from_world"]);
        for i in 0..3 {
            for j in 0..3 {
                let column = |k: usize| [m[0][k], m[1][k], m[2][k]];
                let unit = f64::from(u8::from(i == j));
                assert!((dot(column(i), column(j)) - unit).abs() < 1e-14);
            }
            let ahead = [m[0][3] - m[0][2], m[1][3] - m[1][2], m[2][3] - m[2][2]];
            let seen = moved(&from_world, ahead);
            assert!((seen[i] - [0.0, 0.0, 1.0][i]).abs() < 1e-13, "{seen:?}");
        }
    }
}
