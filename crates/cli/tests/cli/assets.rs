//! Real models, where they are.

use crate::run::{Bench, assets, text};

/// Triangles and boxes as an independent reader measured them (the folder's README).
#[expect(clippy::approx_constant, reason = "a box, as its reader printed it")]
const MODELS: [(&str, u64, [f64; 6]); 13] = [
    ("gltf/Avocado/Avocado.gltf", 682, [-0.02128, -0.00005, -0.01381, 0.02128, 0.06285, 0.01381]),
    (
        "gltf/NormalTangentTest/NormalTangentTest.glb",
        7774,
        [-1.11, -1.2, -0.01, 1.11, 0.95, 0.0805],
    ),
    ("gltf/SimpleMeshes/SimpleMeshes.gltf", 2, [0.0, 0.0, 0.0, 2.0, 1.0, 0.0]),
    ("gltf/Cameras/Cameras.gltf", 2, [0.0, 0.0, -0.70759, 1.0, 0.70662, 0.0]),
    ("gltf/SphereLights/sphere_lights.gltf", 224, [-1.0, -1.0, -1.0, 1.0, 1.0, 1.0]),
    ("gltf/Mirror/one_face_123_mirror.gltf", 1, [-3.0, -0.10998, 0.0, -1.0, -0.01, 0.0]),
    // Without the nodes that it hides, 6192 triangles of its 15546.
    ("gltf/Sundial/Sundial.glb", 9354, [-0.52666, 0.0, -0.57288, 0.52666, 0.45618, 0.42135]),
    ("gltf/WhackAMole/WhackAMole.glb", 85698, [-0.5, 0.0, -0.5, 0.5, 0.05966, 0.5]),
    (
        "gltf/VertexCount32/01_vertex_count_32bit.gltf",
        130_380,
        [-1.0, -1.0, -2.62654, 1.0, 1.0, 2.8],
    ),
    ("gltf/NodeHierarchy/02_node_hierarchy.gltf", 60, [-1.0, -1.0, -1.0, 5.0, 5.0, 1.0]),
    ("gltf/SharedMesh/02_shared_mesh.gltf", 24, [-1.0, -1.41421, -1.41421, 5.0, 1.41421, 1.41421]),
    ("gltf/koala.glb", 99994, [-1.89076, -1.43612, -4.22494, 1.89066, 3.93034, 5.04552]),
    ("obj/koala.obj", 99994, [-1.89076, -1.43612, -4.22494, 1.89066, 3.93034, 5.04552]),
];

#[test]
fn every_model_has_the_triangles_and_the_box_of_an_independent_reader() {
    let Some(folder) = assets("the check of real models") else { return };
    let bench = Bench::new();
    for (name, triangles, bounds) in MODELS {
        let path = folder.join("data").join(name);
        let output = bench.run(&["check", &path.to_string_lossy(), "--json"]);
        assert!(output.status.success(), "{name}: {}", text(&output.stderr));
        let found: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        assert_eq!(found["triangles"], triangles, "{name}");
        for k in 0..6 {
            let side = &found["bounds"][if k < 3 { "min" } else { "max" }][k % 3];
            let side = side.as_f64().unwrap_or_else(|| panic!("{name}: {found}"));
            // The README prints five decimals.
            assert!((side - bounds[k]).abs() < 1.1e-5, "{name}: {side} for {}", bounds[k]);
        }
    }
}

/// All models of the folder.
fn models(folder: &std::path::Path) -> Vec<std::path::PathBuf> {
    let mut models: Vec<_> = ["gltf", "obj"]
        .iter()
        .flat_map(|kind| walk(&folder.join("data").join(kind)))
        .filter(|path| {
            let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
            matches!(ending, "gltf" | "glb" | "obj")
        })
        .collect();
    models.sort();
    assert!(models.len() > 20, "{models:?}");
    models
}

#[test]
fn every_model_renders_to_a_picture_with_something_in_it() {
    let Some(folder) = assets("the rendering of real models") else { return };
    for model in models(&folder) {
        let bench = Bench::new();
        let model = model.to_string_lossy();
        let output = bench.run(&["render", &model, "-o", "out", "--layers", "coverage"]);
        assert!(output.status.success(), "{model}: {}", text(&output.stderr));
        let covered = bench.array("coverage").iter().filter(|a| **a == 1.0).count();
        assert!(covered > 1000, "{model}: {covered} pixels hit");
    }
}

/// By global illumination, from the view that is chosen for them: neither black nor burnt out.
#[test]
fn every_model_is_lit_where_it_is_looked_at() {
    let Some(folder) = assets("the lighting of real models") else { return };
    // Nothing but black by their own files: `Kd 0 0 0`.
    let black = ["leading-decimal-dot-issue-201.obj"];
    for model in models(&folder) {
        let bench = Bench::new();
        let name = model.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let path = model.to_string_lossy();
        let settings = ["tracer.type=path", "camera.sensor.resolution=[48,48]", "render.samples=4"];
        let mut words = vec!["render", &path, "-o", "out", "--layers", "coverage"];
        words.extend(settings.iter().flat_map(|setting| ["--set", setting]));
        let output = bench.run(&words);
        assert!(output.status.success(), "{path}: {}", text(&output.stderr));
        let hit = bench.array("coverage");
        let picture = bench.array("picture");
        let pixels = picture.chunks(3).zip(&hit).filter(|(_, hit)| **hit == 1.0);
        let (mut sum, mut count) = (0.0, 0.0);
        for (rgb, _) in pixels {
            sum += rgb.iter().sum::<f64>() / 3.0;
            count += 1.0;
        }
        let mean = sum / count;
        let least = if black.contains(&name) { 0.0 } else { 0.003 };
        assert!((least..1.2).contains(&mean), "{path}: {mean}");
    }
}

fn walk(folder: &std::path::Path) -> Vec<std::path::PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let entries = entries.flatten().map(|entry| entry.path());
    entries.flat_map(|path| if path.is_dir() { walk(&path) } else { vec![path] }).collect()
}
