//! glTF whose buffers meshoptimizer compressed: by its own encoder.

use std::f32::consts::FRAC_1_SQRT_2;

use etendue_geometry::glam::DVec3;
use etendue_geometry::{Mesh, Vertices};
use serde_json::{Value, json};

use super::build::glb;
use super::{error, folder, load, points, write};

/// Puts compressed views behind each other; the buffer that they stand for is a placeholder.
struct Packer {
    name: &'static str,
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Packer {
    fn new(name: &'static str) -> Self {
        Self { name, bytes: Vec::new(), views: Vec::new(), accessors: Vec::new() }
    }

    /// Adds a view of `count` elements of `stride` bytes, and an accessor to it.
    fn add(&mut self, packed: &[u8], stride: usize, count: usize, how: [&str; 2], accessor: Value) {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let [mode, filter] = how;
        let mut view = json!({
            "buffer": 1, "byteLength": count * stride,
            "extensions": {self.name: {
                "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": packed.len(),
                "byteStride": stride, "count": count, "mode": mode, "filter": filter
            }}
        });
        if mode == "ATTRIBUTES" {
            view["byteStride"] = json!(stride);
        }
        let mut accessor = accessor;
        accessor["bufferView"] = json!(self.views.len());
        accessor["count"] = json!(count);
        self.bytes.extend(packed);
        self.views.push(view);
        self.accessors.push(accessor);
    }

    fn glb(&self, primitive: Value, change: impl FnOnce(&mut Value)) -> Vec<u8> {
        let mut document = json!({
            "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [primitive]}],
            "accessors": self.accessors, "bufferViews": self.views,
            "buffers": [
                {"byteLength": self.bytes.len()},
                {"byteLength": 1_000_000, "extensions": {self.name: {"fallback": true}}}
            ],
            "extensionsUsed": [self.name], "extensionsRequired": [self.name]
        });
        change(&mut document);
        glb(&document, &self.bytes)
    }
}

/// A wavy grid of `side` × `side` corners, enough for several blocks of the codec.
fn grid(side: u32) -> (Vec<[f32; 3]>, Vec<u32>) {
    let corner = |i: u32| {
        let (x, y) = ((i % side) as f32, (i / side) as f32);
        [x * 0.125, y * 0.125, (x * 0.3).sin() + (y * 0.2).cos()]
    };
    let squares = (0..(side - 1) * (side - 1)).map(|i| i % (side - 1) + i / (side - 1) * side);
    let triangles = squares.flat_map(|a| [a, a + 1, a + side, a + 1, a + side + 1, a + side]);
    ((0..side * side).map(corner).collect(), triangles.collect())
}

const POSITION: [&str; 2] = ["ATTRIBUTES", "NONE"];

fn floats(shape: &str) -> Value {
    json!({"componentType": 5126, "type": shape})
}

/// The grid with every codec and filter that meshes use.
fn packed(name: &'static str, change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let version = if name.starts_with("KHR") { Some(1) } else { Some(0) };
    let (positions, triangles) = grid(40);
    let count = positions.len();
    let mut packer = Packer::new(name);
    let bytes = meshopt::encode_vertex_buffer_level(&positions, 2, version).unwrap();
    packer.add(&bytes, 12, count, POSITION, floats("VEC3"));
    let normals = vec![[FRAC_1_SQRT_2, 0.0, -FRAC_1_SQRT_2, 0.0]; count];
    let normals = meshopt::encode_filter_oct::<i8>(&normals, 8);
    let bytes = meshopt::encode_vertex_buffer_level(&normals, 2, version).unwrap();
    let accessor = json!({"componentType": 5120, "type": "VEC3", "normalized": true});
    packer.add(&bytes, 4, count, ["ATTRIBUTES", "OCTAHEDRAL"], accessor);
    let uvs: Vec<[f32; 2]> = positions.iter().map(|[x, y, _]| [*x, *y]).collect();
    let uvs = meshopt::encode_filter_exp(&uvs, 15, meshopt::EncodeExpMode::Separate);
    let bytes = meshopt::encode_vertex_buffer_level(&uvs, 2, version).unwrap();
    packer.add(&bytes, 8, count, ["ATTRIBUTES", "EXPONENTIAL"], floats("VEC2"));
    let bytes = meshopt::encode_index_buffer(&triangles, count).unwrap();
    let accessor = json!({"componentType": 5123, "type": "SCALAR"});
    packer.add(&bytes, 2, triangles.len(), ["TRIANGLES", "NONE"], accessor);
    let attributes = json!({"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2});
    packer.glb(json!({"attributes": attributes, "indices": 3}), change)
}

fn doubles<const N: usize>(values: &Vertices<N>, i: usize) -> [f64; N] {
    values.get(i).map(f64::from)
}

fn assert_is_the_grid(mesh: &Mesh) {
    let (positions, triangles) = grid(40);
    let expected: Vec<DVec3> = positions.iter().map(|p| DVec3::from(p.map(f64::from))).collect();
    assert_eq!(points(mesh), expected, "floats without a filter are kept to the bit");
    // The codec keeps the order of triangles and may turn their corners round.
    let turned = |[a, b, c]: [u32; 3]| match a.min(b).min(c) {
        least if least == a => [a, b, c],
        least if least == b => [b, c, a],
        _ => [c, a, b],
    };
    let triangles = triangles.as_chunks::<3>().0.iter().map(|&t| turned(t));
    assert!(mesh.triangles.iter().map(|&t| turned(t)).eq(triangles));
    let (normals, uvs) = (mesh.normals.as_ref().unwrap(), &mesh.uvs[0]);
    let slope = f64::from(FRAC_1_SQRT_2);
    for i in [0, 777, 1599] {
        let normal = DVec3::from(doubles(normals, i));
        // One step of 8 bits.
        assert!(normal.distance(DVec3::new(slope, 0.0, -slope)) < 1.5 / 127.0, "{normal}");
        let [u, v] = doubles(uvs, i);
        // 15 bits of a mantissa, of numbers up to 5.
        let expected = expected[i];
        assert!((u - expected.x).abs() + (v - expected.y).abs() < 10.0 / 16384.0, "{u} {v}");
    }
}

#[test]
fn compressed_meshes_are_those_that_were_compressed() {
    let folder = folder();
    for name in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
        let import = load(&write(&folder, "grid.glb", packed(name, |_| {})));
        assert!(import.notes.is_empty(), "{:?}", import.notes);
        assert_is_the_grid(&import.meshes[0]);
    }
}

#[test]
fn compressed_sequences_and_quaternions_are_decoded() {
    let folder = folder();
    let mut packer = Packer::new("EXT_meshopt_compression");
    let (positions, _) = grid(3);
    let bytes = meshopt::encode_vertex_buffer_level(&positions, 2, Some(0)).unwrap();
    packer.add(&bytes, 12, 9, POSITION, floats("VEC3"));
    let strip = [0_u32, 1, 3, 4, 6, 7];
    let bytes = meshopt::encode_index_sequence(&strip, 9).unwrap();
    let accessor = json!({"componentType": 5125, "type": "SCALAR"});
    packer.add(&bytes, 4, 6, ["INDICES", "NONE"], accessor);
    let turns = [[0.0, 0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2]; 2];
    let turns = meshopt::encode_filter_quat(&turns, 16);
    let bytes = meshopt::encode_vertex_buffer_level(&turns, 2, Some(0)).unwrap();
    let accessor = json!({"componentType": 5122, "type": "VEC4", "normalized": true});
    packer.add(&bytes, 8, 2, ["ATTRIBUTES", "QUATERNION"], accessor);
    let primitive = json!({"attributes": {"POSITION": 0}, "indices": 1, "mode": 5});
    let file = packer.glb(primitive, |document| {
        document["nodes"][0]["extensions"] =
            json!({"EXT_mesh_gpu_instancing": {"attributes": {"ROTATION": 2}}});
    });
    let import = load(&write(&folder, "strip.glb", file));
    assert_eq!(&import.meshes[0].triangles[..], [[0, 1, 3], [1, 4, 3], [3, 4, 6], [4, 7, 6]]);
    assert_eq!(import.placements.len(), 2);
    let turned = import.placements[1].model_from_mesh.point(DVec3::X);
    // Quaternions of 16 bits.
    assert!(turned.distance(DVec3::Y) < 1e-4, "{turned}");
}

#[test]
fn damaged_streams_are_refused_with_their_place() {
    type Change = fn(&mut Value);
    let cases: [(&str, Change, &str); 8] = [
        ("short", |e| e["byteLength"] = json!(40), "damaged"),
        ("outside", |e| e["byteOffset"] = json!(1_000_000), "lie outside its buffer"),
        ("buffer", |e| e["buffer"] = json!(9), "no buffer 9; the file has 2"),
        ("count", |e| e["count"] = json!(u32::MAX), "cannot come from"),
        ("stride", |e| e["byteStride"] = json!(10), "1600 elements of 10 bytes"),
        (
            "mode",
            |e| e["mode"] = json!("TRIANGLE"),
            "\"TRIANGLE\" is not known here\nhint: did you mean",
        ),
        ("filter", |e| e["filter"] = json!("QUATERNION"), "filter Quaternion"),
        ("missing", |e| *e = json!({"buffer": 0}), "the key `byteLength` is missing"),
    ];
    for (name, change, words) in cases {
        let folder = folder();
        let file = packed("EXT_meshopt_compression", |document| {
            change(&mut document["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]);
        });
        let message = error(&write(&folder, &format!("{name}.glb"), file));
        let place = "bufferViews[0].extensions.EXT_meshopt_compression";
        for words in [place, words] {
            assert!(message.contains(words), "{name}: {message}");
        }
    }
}
