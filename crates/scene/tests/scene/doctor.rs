//! The scene doctor on scenes whose ailments are known.

use std::f64::consts::SQRT_2;
use std::fs;
use std::path::Path;

use etendue_scene::{Diagnosis, LoadOptions, doctor};

use crate::test_data;

fn check(path: &Path) -> Diagnosis {
    doctor::check(path, &[], &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn counts_are_of_what_is_placed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.json");
    let text = r#"{"etendue": 1, "camera": {"type": "pinhole", "sensor": {"resolution": [64, 48]}},
        "layers": ["depth", "normal"],
        "objects": [{"shape": "box", "name": "a", "size": [2, 2, 2]},
        {"shape": "box", "size": [2, 2, 2], "transform": {"translate": [10, 0, 0],
        "rotate": [0, 1, 0, 45]}}], "materials": {"m": {"type": "matte", "color": [1, 1, 1]}}}"#;
    fs::write(&path, text).unwrap();
    let found = check(&path);
    assert_eq!((found.triangles, found.triangles_unique), (24, 12));
    let bounds = found.bounds.unwrap();
    assert_eq!(bounds.min[0], -1.0);
    // Turned by 45°, the box reaches √2 to the side: its corners, not those of a box around it.
    assert!((bounds.max[0] - (10.0 + 2_f64.sqrt())).abs() < 1e-14, "{:?}", bounds.max);
    assert!(found.units.plausible);
    assert_eq!(found.objects[0].name, "a");
    assert_eq!(found.objects[1].triangles, 12);
    assert_eq!(found.memory.film, 4 * 64 * 48 * 4, "z and three of the normal");
    assert_eq!(found.memory.structure, 92 * 12, "one mesh");
    assert_eq!(found.memory.copies, 1000 * 2, "placed twice");
    assert_eq!(found.findings.len(), 1, "the material that nothing uses: {:?}", found.findings);
    let json = serde_json::to_value(&found).unwrap();
    assert_eq!(json["triangles"], 24);
    assert_eq!(json["bounds"]["min"][0], -1.0);
    assert_eq!(json["camera"]["resolution"], serde_json::json!([64, 48]));
    let table = found.table().text();
    for part in
        ["24 in 2 placements; 12 unique", "[-1, -1, -1.41421] to [11.4142, 1, 1.41421]", "64 × 48"]
    {
        assert!(table.contains(part), "{part} in:\n{table}");
    }
}

#[test]
fn an_empty_scene_is_well() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.json");
    fs::write(&path, r#"{"etendue": 1}"#).unwrap();
    let found = check(&path);
    assert_eq!((found.triangles, found.bounds, found.precision), (0, None, None));
    assert!(found.table().text().contains("nothing to draw"));
}

#[test]
fn bad_triangles_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.obj");
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nv 2 0 0\n\
        f 1 2 3\nf 3 1 2\nf 1 2 4\nf 1 2 5\nf 1 1 2\n";
    fs::write(&path, text).unwrap();
    let defects = check(&path).defects;
    assert_eq!(defects.not_finite, 1, "{defects:?}");
    assert_eq!(defects.degenerate, 2, "{defects:?}");
    assert_eq!(defects.duplicate, 1, "{defects:?}");
}

/// Surfaces that lie in one plane and face one side are named, the earlier first; a box that stands
/// on the floor is not.
#[test]
fn what_lies_in_one_plane_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.json");
    let text = r#"{"etendue": 1, "objects": [
        {"shape": "rectangle", "name": "floor", "width": 4, "height": 4, "transform": {"rotate": [1, 0, 0, -90]}},
        {"shape": "rectangle", "name": "lamp", "width": 1, "height": 1, "transform": {"rotate": [1, 0, 0, -90]}},
        {"shape": "box", "name": "crate", "size": [0.5, 0.5, 0.5], "transform": {"translate": [1.5, 0.25, 0]}},
        {"shape": "sphere", "name": "twin", "radius": 0.1, "triangles": 80, "transform": {"translate": [0, 1, 0]}},
        {"shape": "sphere", "name": "twin 2", "radius": 0.1, "triangles": 80, "transform": {"translate": [0, 1, 0]}}]}"#;
    fs::write(&path, text).unwrap();
    let found = check(&path);
    assert_eq!(found.defects.coplanar, 2, "{found:?}");
    let table = found.table().text();
    for part in [
        "2 pairs of things in one plane",
        "object 1 \"floor\" and object 2 \"lamp\": lie over one another in one plane; the later one is seen",
        "object 4 \"twin\" and object 5 \"twin 2\"",
    ] {
        assert!(table.contains(part), "{part} in:\n{table}");
    }
}

#[test]
fn odd_sizes_are_questioned() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("big.obj");
    fs::write(&path, "v 0 0 0\nv 4000 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let units = check(&path).units;
    assert!(!units.plausible && units.remark.contains("\"scale\": 0.001"), "{}", units.remark);
    assert!(units.remark.contains("names no unit"), "{}", units.remark);
}

#[test]
fn cameras_and_lights_of_models_are_told() {
    let Some(data) = test_data() else { return };
    let found = check(&data.join("gltf/Cameras/Cameras.gltf"));
    let kinds: Vec<&str> = found.cameras.iter().map(|camera| camera.kind).collect();
    assert_eq!(kinds, ["pinhole", "orthographic"]);
    let lit = check(&data.join("gltf/SphereLights/sphere_lights.gltf"));
    assert_eq!(lit.lights, 4);
}

#[test]
fn a_models_camera_keeps_its_field_of_view() {
    let Some(data) = test_data() else { return };
    let path = data.join("gltf/Cameras/Cameras.gltf");
    let with = |camera| {
        let options = LoadOptions { camera: Some(camera), ..LoadOptions::default() };
        doctor::check(&path, &[], &options).unwrap().camera
    };
    let perspective = with("0");
    assert_eq!(perspective.resolution, [1024, 1024], "aspect ratio 1");
    // The file has yfov 0.7; glTF's numbers may pass through f32.
    let fov = 2.0 * (512.0 / perspective.k.unwrap()[1][1]).atan();
    assert!((fov - 0.7).abs() < 1e-7, "{fov}");
    assert_eq!(perspective.world_from_camera.map(|row| row[3]), [0.5, 0.5, 3.0, 1.0]);
    let orthographic = with("1").orthographic.unwrap();
    assert!((orthographic.metres_per_pixel * 1024.0 - 2.0).abs() < 1e-6, "ymag 1 is half of 2 m");
    let options = LoadOptions { camera: Some("7"), ..LoadOptions::default() };
    let error = doctor::check(&path, &[], &options).unwrap_err().to_string();
    assert!(error.contains("no such camera; there are 0 \"\", 1 \"\""), "{error}");
}

#[test]
fn boxes_and_counts_agree_with_an_independent_reader() {
    let Some(data) = test_data() else { return };
    // From the table that comes with the files; five digits after the point.
    let table = [
        (
            "gltf/Avocado/Avocado.gltf",
            682,
            [-0.02128, -0.00005, -0.01381],
            [0.02128, 0.06285, 0.01381],
        ),
        ("gltf/SimpleMeshes/SimpleMeshes.gltf", 2, [0.0, 0.0, 0.0], [2.0, 1.0, 0.0]),
        ("gltf/Cameras/Cameras.gltf", 2, [0.0, 0.0, -0.70759], [1.0, 0.70662, 0.0]),
        ("gltf/Mirror/one_face_123_mirror.gltf", 1, [-3.0, -0.10998, 0.0], [-1.0, -0.01, 0.0]),
        (
            "gltf/SharedMesh/02_shared_mesh.gltf",
            24,
            [-1.0, -SQRT_2, -SQRT_2],
            [5.0, SQRT_2, SQRT_2],
        ),
        // Without the nodes that it hides.
        ("gltf/Sundial/Sundial.glb", 9_354, [-0.52666, 0.0, -0.57288], [0.52666, 0.45618, 0.42135]),
        ("obj/spot.obj", 23_062, [-0.46343, -0.73023, -0.69957], [0.46419, 1.01738, 1.0776]),
    ];
    for (name, triangles, min, max) in table {
        let found = check(&data.join(name));
        assert_eq!(found.triangles, triangles, "{name}");
        let bounds = found.bounds.unwrap();
        for axis in 0..3 {
            assert!((bounds.min[axis] - min[axis]).abs() < 1e-5, "{name}: {:?}", bounds.min);
            assert!((bounds.max[axis] - max[axis]).abs() < 1e-5, "{name}: {:?}", bounds.max);
        }
    }
}
