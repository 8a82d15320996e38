//! Copies of objects: where they stand, and what is no list of them.

use std::fs;

use etendue_geometry::glam::DVec3;
use etendue_scene::{LoadOptions, SceneFile, Wanted};

use super::load;

/// An NPY file (NEP 1, version 1.0) of little-endian numbers.
fn npy(kind: &str, order: &str, shape: &str, numbers: &[u8]) -> Vec<u8> {
    let mut header =
        format!("{{'descr': '{kind}', 'fortran_order': {order}, 'shape': {shape}, }}").into_bytes();
    header.resize((10 + header.len() + 1).next_multiple_of(64) - 11, b' ');
    header.push(b'\n');
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend(u16::try_from(header.len()).unwrap().to_le_bytes());
    file.extend(header);
    file.extend(numbers);
    file
}

/// `n` matrices of three rows that only move: copy i stands at (i, −i, 2 i).
fn moves(n: u32) -> Vec<f64> {
    (0..n)
        .flat_map(|i| {
            let i = f64::from(i);
            [1.0, 0.0, 0.0, i, 0.0, 1.0, 0.0, -i, 0.0, 0.0, 1.0, 2.0 * i]
        })
        .collect()
}

#[test]
fn copies_stand_where_the_list_or_the_file_says() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.json");
    let bytes64: Vec<u8> = moves(3).iter().flat_map(|x| x.to_le_bytes()).collect();
    #[expect(clippy::cast_possible_truncation, reason = "whole numbers")]
    let bytes32: Vec<u8> = moves(3).iter().flat_map(|&x| (x as f32).to_le_bytes()).collect();
    #[expect(clippy::cast_possible_truncation, reason = "whole numbers")]
    let swapped: Vec<u8> = moves(3).iter().flat_map(|&x| (x as f32).to_be_bytes()).collect();
    let mut square = Vec::new();
    for matrix in moves(3).chunks(12) {
        let rows = matrix.iter().chain(&[0.0, 0.0, 0.0, 1.0]);
        square.extend(rows.flat_map(|x| x.to_le_bytes()));
    }
    let place = |name: &str, bytes: Vec<u8>| fs::write(folder.path().join(name), bytes).unwrap();
    place("a.npy", npy("<f8", "False", "(3, 3, 4)", &bytes64));
    place("b.npy", npy("<f4", "False", "(3, 3, 4)", &bytes32));
    place("c.npy", npy(">f4", "False", "(3, 3, 4)", &swapped));
    place("d.npy", npy("<f8", "False", "(3, 4, 4)", &square));
    let list = r#"[{}, {"translate": [1, -1, 2]}, {"translate": [2, -2, 4]}]"#;
    for instances in [list, "\"a.npy\"", "\"b.npy\"", "\"c.npy\"", "\"d.npy\""] {
        let text = format!(
            r#"{{"etendue": 1, "objects": [{{"shape": "box"}}, {{"shape": "box",
                "transform": {{"translate": [0, 0, 5], "scale": 2}}, "instances": {instances}}}]}}"#
        );
        fs::write(&path, text).unwrap();
        let scene = load(&path, &[]);
        assert_eq!(scene.geometry.uses(), [4], "{instances}: one mesh, once and thrice");
        let at: Vec<DVec3> =
            scene.geometry.placements.iter().map(|p| p.world_from_mesh.translation).collect();
        let copy = |i: f64| DVec3::new(2.0 * i, -2.0 * i, 4.0 * i + 5.0);
        assert_eq!(at, [DVec3::ZERO, copy(0.0), copy(1.0), copy(2.0)], "{instances}");
        let objects: Vec<u32> = scene.geometry.placements.iter().map(|p| p.object).collect();
        assert_eq!(objects, [0, 1, 1, 1], "copies are one object");
    }
    let text = r#"{"etendue": 1, "objects": [{"shape": "box", "instances": "a.npy"}]}"#;
    fs::write(&path, text).unwrap();
    let first = load(&path, &[]).hash().unwrap();
    place("a.npy", npy("<f8", "False", "(2, 3, 4)", &bytes64[..192]));
    assert_ne!(load(&path, &[]).hash().unwrap(), first, "the file belongs to the scene's identity");
}

#[test]
fn a_million_copies_are_one_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("forest.json");
    let n = 1_000_000;
    let bytes: Vec<u8> = moves(n).iter().flat_map(|x| x.to_le_bytes()).collect();
    fs::write(folder.path().join("trees.npy"), npy("<f8", "False", "(1000000, 3, 4)", &bytes))
        .unwrap();
    let text = r#"{"etendue": 1, "objects":
        [{"shape": "blob", "triangles": 1000, "instances": "trees.npy"}]}"#;
    fs::write(&path, text).unwrap();
    let scene = load(&path, &[]);
    assert_eq!(scene.geometry.uses(), [n]);
    assert_eq!(scene.geometry.triangles(), 1_000_000_000);
    assert_eq!(scene.geometry.triangles_unique(), 1000);
    let last = &scene.geometry.placements[n as usize - 1].world_from_mesh;
    assert_eq!(last.translation, DVec3::new(999_999.0, -999_999.0, 1_999_998.0));
}

#[test]
fn files_of_copies_that_make_no_sense_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.json");
    let text = r#"{"etendue": 1, "objects": [{"shape": "box", "instances": "m.npy"}]}"#;
    fs::write(&path, text).unwrap();
    let error = || {
        let file = SceneFile::read(&path, &[]).unwrap();
        file.load(Wanted::EVERYTHING, &LoadOptions::default()).unwrap_err().to_string()
    };
    assert!(error().contains("objects[0].instances: no such file"), "{}", error());
    let bytes = |numbers: &[f64]| numbers.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>();
    let sound = bytes(&moves(2));
    let mut flat = moves(2);
    flat[22] = 0.0;
    let mut broken = moves(2);
    broken[15] = f64::NAN;
    let cases = [
        (b"no array".to_vec(), "no NPY file"),
        (Vec::new(), "NPY file"),
        (npy("<f8", "False", "(2, 3, 4)", &sound)[..300].to_vec(), "ends before its last number"),
        (npy("<f8", "False", "(2, 12)", &sound), "shape [2, 12] instead of n × 4 × 4"),
        (npy("<f8", "False", "(99999999999999999999, 3, 4)", &sound), "instances"),
        (npy("<f8", "False", "(9999999999999999, 3, 4)", &sound), "ends before"),
        (npy("<f8", "False", "(9999999999, 9999999999, 4)", &sound), "has the shape"),
        (npy("<f8", "True", "(2, 3, 4)", &sound), "Fortran order"),
        (npy("<i8", "False", "(2, 3, 4)", &sound), "'<i8' instead of float32 or float64"),
        (npy("|O", "False", "(2, 3, 4)", &sound), "instances"),
        (npy("<f8", "False", "(2, 3, 4)", &bytes(&flat)), "has a matrix 1 that is singular"),
        (npy("<f8", "False", "(2, 3, 4)", &bytes(&broken)), "has a matrix 1 that"),
    ];
    for (file, words) in cases {
        fs::write(folder.path().join("m.npy"), file).unwrap();
        let error = error();
        let place = error.contains("objects[0].instances");
        assert!(place && error.contains(words), "expected \"{words}\": {error}");
    }
    let listed = text.replace("\"m.npy\"", r#"[{}, {"scale": 0}]"#);
    fs::write(&path, listed).unwrap();
    assert!(error().contains("objects[0].instances[1].scale: is zero"), "{}", error());
}
