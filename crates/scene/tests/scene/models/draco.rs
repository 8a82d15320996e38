//! glTF whose primitives Draco compressed: by Google's own encoder (`data/draco/make.py`), as a sequence
//! (level 0) and by its edgebreaker with each of its ways to predict.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use etendue_geometry::glam::DVec3;
use etendue_scene::import::{Options, Wanted, import};

use super::{error, folder, load, write};

const SIDE: u32 = 20;
const LEVELS: [u32; 4] = [0, 4, 7, 10];

fn path(level: u32) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scene/data/draco");
    folder.join(format!("grid-level-{level}.glb"))
}

fn model(level: u32) -> Vec<u8> {
    std::fs::read(path(level)).unwrap()
}

/// The triangle's corners, the least first.
fn turned([a, b, c]: [u32; 3]) -> [u32; 3] {
    match a.min(b).min(c) {
        least if least == a => [a, b, c],
        least if least == b => [b, c, a],
        _ => [c, a, b],
    }
}

#[test]
fn decoded_meshes_are_those_that_were_compressed() {
    let squares = (0..(SIDE - 1) * (SIDE - 1)).map(|i| i % (SIDE - 1) + i / (SIDE - 1) * SIDE);
    let triangles =
        squares.flat_map(|a| [[a, a + 1, a + SIDE], [a + 1, a + SIDE + 1, a + SIDE]]).map(turned);
    let triangles: BTreeSet<[u32; 3]> = triangles.collect();
    for level in LEVELS {
        let import = load(&path(level));
        assert!(import.notes.is_empty(), "{:?}", import.notes);
        let mesh = &import.meshes[0];
        let count = mesh.positions.len();
        assert_eq!(count, (SIDE * SIDE) as usize);
        // Points come in another order; which one each is, its place tells.
        let mut points = Vec::new();
        for i in 0..count {
            let p = mesh.positions.get(i);
            let [x, y] = [p.x, p.y].map(|v| (v / 0.125).round());
            let z = (0.3 * x).sin() + (0.2 * y).cos();
            // Half a step of 14 bits of the widest side, at most 4 in z, and floats.
            let expected = DVec3::new(0.125 * x, 0.125 * y, z);
            assert!((p - expected).abs().max_element() < 0.5 * 4.0 / 16383.0 + 1e-6, "{p}");
            let normal = DVec3::from(mesh.normals.as_ref().unwrap().get(i).map(f64::from));
            let slope = DVec3::new(-2.4 * (0.3 * x).cos(), 1.6 * (0.2 * y).sin(), 1.0);
            // Half a step of 10 bits (511 a side of the octahedron) in two coordinates, both of which the third takes
            // up: √6 halves, which a sphere stretches by √3 at most.
            let off = normal.distance(slope.normalize());
            assert!(off < 18_f64.sqrt() * 0.5 / 511.0, "{normal}: {off}");
            let [u, v] = mesh.uvs[0].get(i).map(f64::from);
            // Half a step of 12 bits of 0.475.
            let off = (u - x / 40.0).abs().max((v - y / 40.0).abs());
            assert!(off < 0.5 * 0.475 / 4095.0 + 1e-6, "{u} {v}");
            let color = mesh.colors.as_ref().unwrap().get(i).map(|c| f64::from(c) * 255.0);
            // Whole numbers are kept.
            for (expected, found) in [x, y, x + y, 255.0 - x].into_iter().zip(color) {
                assert!((expected - found).abs() < 1e-3, "{color:?}");
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "0 to 399"
            )]
            points.push(x as u32 + y as u32 * SIDE);
        }
        assert_eq!(points.iter().collect::<BTreeSet<_>>().len(), count, "each is there once");
        let decoded = mesh.triangles.iter().map(|t| turned(t.map(|i| points[i as usize])));
        assert_eq!(decoded.collect::<BTreeSet<_>>(), triangles, "level {level}");
        assert_eq!(mesh.triangles.len(), triangles.len());
    }
}

#[test]
fn a_plain_copy_beside_the_stream_is_what_is_read() {
    let folder = folder();
    let text = r#"{"asset": {"version": "2.0"}, "extensionsUsed": ["KHR_draco_mesh_compression"],
        "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "extensions":
        {"KHR_draco_mesh_compression": {"bufferView": 1, "attributes": {"POSITION": 0}}}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]}"#;
    let import = load(&write(&folder, "plain.gltf", text));
    assert_eq!(import.meshes[0].positions.get(1), DVec3::X);
}

#[test]
fn damaged_streams_are_errors_or_meshes() {
    let folder = folder();
    let mut refused = 0;
    for level in LEVELS {
        let whole = model(level);
        let start = whole.windows(5).position(|bytes| bytes == b"DRACO").unwrap();
        // A bit of each place in turn, and zeros from there to the end.
        for at in (start..whole.len()).step_by(29) {
            let mut flipped = whole.clone();
            flipped[at] ^= 1 << (at % 8);
            let mut cut = whole.clone();
            cut[at..].fill(0);
            for bytes in [flipped, cut] {
                let path = write(&folder, "changed.glb", bytes);
                match import(&path, Wanted::EVERYTHING, &Options::default()) {
                    Ok(import) => {
                        let mesh = &import.meshes[0];
                        let count = mesh.positions.len();
                        let is_there = |&corner: &u32| (corner as usize) < count;
                        assert!(mesh.triangles.iter().flatten().all(is_there));
                    }
                    Err(error) => {
                        let message = error.to_string();
                        assert!(message.contains("changed.glb"), "{message}");
                        refused += 1;
                    }
                }
            }
        }
    }
    assert!(refused > 100, "{refused}");
}

#[test]
fn what_contradicts_itself_is_named() {
    let folder = folder();
    let refuse = |from: &str, to: &str, words: &[&str]| {
        // The JSON keeps its length.
        assert_eq!(from.len(), to.len());
        let mut model = model(4);
        let at = model.windows(from.len()).position(|bytes| bytes == from.as_bytes()).unwrap();
        model[at..at + to.len()].copy_from_slice(to.as_bytes());
        let message = error(&write(&folder, "odd.glb", model));
        for words in [&["odd.glb", "meshes[0].primitives[0], KHR_draco"], words].concat() {
            assert!(message.contains(words), "{message}");
        }
    };
    refuse("{\"bufferView\": 0", "{\"bufferView\": 7", &["no buffer view 7"]);
    refuse("\"bufferView\": 0, \"attrib", "\"bufferVieu\": 0, \"attrib", &["bufferView"]);
    refuse("DRACO", "DRACU", &["damaged"]);
    // Two thousand million triangles from two thousand bytes.
    let mut model = model(0);
    let start = model.windows(5).position(|bytes| bytes == b"DRACO").unwrap();
    model[start + 11..start + 16].copy_from_slice(&[0xff, 0xff, 0xff, 0xff, 0x07]);
    let message = error(&write(&folder, "large.glb", model));
    assert!(message.contains("large.glb"), "{message}");
}
