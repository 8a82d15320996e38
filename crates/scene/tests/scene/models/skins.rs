//! Skins and morph targets in the pose that the file has at rest, with closed forms.

use etendue_geometry::glam::{DQuat, DVec3};
use etendue_geometry::{Mesh, Positions};
use etendue_scene::import::{Import, NoteKind};
use serde_json::{Value, json};

use super::build::{Builder, SQUARE};
use super::{error, folder, import_strict, load, points, write};

/// A bar of 3 × 2 corners up +Y from 0 to 4, bent to the left at its middle by a quarter turn: x is
/// −1 or 1, y 0, 2 or 4. Joint 0 stands at the origin and joint 1 at (0, 2, 0).
const BAR: [[f32; 3]; 6] = [
    [-1.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [-1.0, 2.0, 0.0],
    [1.0, 2.0, 0.0],
    [-1.0, 4.0, 0.0],
    [1.0, 4.0, 0.0],
];
const STRIP: [u32; 12] = [0, 1, 2, 2, 1, 3, 2, 3, 4, 4, 3, 5];

/// Corners of the bent bar: the lower half stays, the upper is turned about (0, 2), and the corners
/// between are the mean of both (linear blend skinning).
fn bent() -> [DVec3; 6] {
    BAR.map(|[x, y, _]| {
        let (x, y) = (f64::from(x), f64::from(y));
        let turned = DVec3::new(-(y - 2.0), 2.0 + x, 0.0);
        let still = DVec3::new(x, y, 0.0);
        let upper = y / 4.0;
        still.lerp(turned, upper)
    })
}

/// Encodings of the joints' weights in the bar's vertices.
#[derive(Clone, Copy, PartialEq)]
enum Weights {
    Floats,
    Bytes,
    Shorts,
    /// The second joint in a set of its own.
    TwoSets,
    /// Twice as heavy.
    Doubled,
}

/// A quarter turn about +Z.
fn quarter() -> [f64; 4] {
    DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2).to_array()
}

/// The bent bar, before `change` gets at its document.
fn bar(kind: Weights, change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let mut builder = Builder::default();
    let positions = builder.floats(&BAR);
    let normals = builder.floats(&[[1.0, 0.0, 0.0]; 6]);
    let indices = builder.u32s(&STRIP);
    let upper = BAR.map(|[_, y, _]| y / 4.0);
    let mut attributes = json!({"POSITION": positions, "NORMAL": normals});
    let joints = |builder: &mut Builder, both: [u8; 2]| {
        let bytes: Vec<u8> = (0..6).flat_map(|_| [both[0], both[1], 0, 0]).collect();
        builder.accessor(5121, "VEC4", 6, &bytes)
    };
    let integers = |builder: &mut Builder, kind: u32, most: u16| {
        let bytes: Vec<u8> = upper
            .iter()
            .flat_map(|u| {
                // 0, 2 or 4 quarters.
                let second = if *u == 0.5 { most / 2 } else { most * u16::from(*u == 1.0) };
                [most - second, second, 0, 0]
            })
            .flat_map(|w| w.to_le_bytes().into_iter().take(if kind == 5121 { 1 } else { 2 }))
            .collect();
        let accessor = builder.accessor(kind, "VEC4", 6, &bytes);
        builder.accessors[accessor]["normalized"] = json!(true);
        accessor
    };
    attributes["JOINTS_0"] = json!(joints(&mut builder, [0, 1]));
    match kind {
        Weights::Floats | Weights::Doubled => {
            let by = if kind == Weights::Doubled { 2.0 } else { 1.0 };
            let weights = upper.map(|u| [by * (1.0 - u), by * u, 0.0, 0.0]);
            attributes["WEIGHTS_0"] = json!(builder.floats(&weights));
        }
        Weights::Bytes => attributes["WEIGHTS_0"] = json!(integers(&mut builder, 5121, 255)),
        Weights::Shorts => attributes["WEIGHTS_0"] = json!(integers(&mut builder, 5123, 65535)),
        Weights::TwoSets => {
            // Joint 7 does not exist, and weighs nothing.
            attributes["JOINTS_0"] = json!(joints(&mut builder, [0, 7]));
            let first = upper.map(|u| [1.0 - u, 0.0, 0.0, 0.0]);
            attributes["WEIGHTS_0"] = json!(builder.floats(&first));
            attributes["JOINTS_1"] = json!(joints(&mut builder, [1, 0]));
            let second = upper.map(|u| [u, 0.0, 0.0, 0.0]);
            attributes["WEIGHTS_1"] = json!(builder.floats(&second));
        }
    }
    let bind = |y: f32| [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., y, 0., 1.];
    let bytes: Vec<u8> =
        [bind(0.0), bind(-2.0)].concat().iter().flat_map(|v| v.to_le_bytes()).collect();
    let bound = builder.accessor(5126, "MAT4", 2, &bytes);
    let mut document = builder.document(json!({
        "meshes": [{"primitives": [{"attributes": attributes, "indices": indices}]}],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": bound}],
        "nodes": [
            // The node of a skinned mesh moves nothing.
            {"mesh": 0, "skin": 0, "translation": [100, 0, 0]},
            {"children": [2]},
            {"translation": [0, 2, 0], "rotation": quarter()},
        ],
    }));
    change(&mut document);
    super::build::glb(&document, &builder.bytes)
}

fn loaded(name: &str, bytes: Vec<u8>) -> Import {
    let folder = folder();
    load(&write(&folder, name, bytes))
}

fn assert_near(mesh: &Mesh, expected: &[DVec3], most: f64) {
    let found = points(mesh);
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert!(found.distance(*expected) <= most, "{found} is not {expected}");
    }
}

#[test]
fn a_bar_of_two_joints_bends_as_linear_blending_says() {
    use Weights::{Bytes, Doubled, Floats, Shorts, TwoSets};
    for kind in [Floats, Bytes, Shorts, TwoSets, Doubled] {
        let import = loaded("bar.glb", bar(kind, |_| {}));
        let placement = &import.placements[0];
        assert!(placement.model_from_mesh.is_identity(), "the node of a skinned mesh is ignored");
        // Half of 255 is no whole number: the mean is off by half a step over the 2.8 m between its
        // two places. Otherwise f32 rounds numbers up to 3.
        let most = match kind {
            Bytes => 2.9 * 0.5 / 255.0,
            Shorts => 2.9 * 0.5 / 65535.0,
            Floats | TwoSets | Doubled => 4e-7,
        };
        assert_near(&import.meshes[0], &bent(), most);
        let normals = import.meshes[0].normals.as_ref().unwrap();
        let half = std::f64::consts::FRAC_1_SQRT_2;
        for (i, expected) in [(0, DVec3::X), (3, DVec3::new(half, half, 0.0)), (5, DVec3::Y)] {
            let normal = DVec3::from(normals.get(i).map(f64::from));
            assert!(normal.distance(expected) <= most.max(1e-6), "{normal} is not {expected}");
        }
        let notes: Vec<_> = import.notes.iter().map(|n| (n.kind, n.count)).collect();
        let expected = if kind == Doubled { vec![(NoteKind::Irregular, 6)] } else { Vec::new() };
        assert_eq!(notes, expected, "{:?}", import.notes);
    }
}

#[test]
fn without_inverse_bind_matrices_vertices_are_in_the_joints_frames() {
    let bytes = bar(Weights::Floats, |document| {
        document["skins"][0].as_object_mut().unwrap().remove("inverseBindMatrices");
        document["nodes"][2]["translation"] = json!([0, 10, 0]);
        document["nodes"][2]["rotation"] = json!([0, 0, 0, 1]);
    });
    let expected = BAR.map(|[x, y, _]| {
        let (x, y) = (f64::from(x), f64::from(y));
        DVec3::new(x, y + 10.0 * y / 4.0, 0.0)
    });
    assert_near(&loaded("bar.glb", bytes).meshes[0], &expected, 1e-6);
}

#[test]
fn joints_far_away_lose_no_digits() {
    let bytes = bar(Weights::Floats, |document| {
        document["nodes"][1]["translation"] = json!([1e7, 0, 0]);
    });
    let import = loaded("bar.glb", bytes);
    assert!(matches!(import.meshes[0].positions, Positions::F64(_)), "f32 knows 10⁷ to 1 m");
    // f64 knows 10⁷ m to 2 nm.
    assert_near(&import.meshes[0], &bent().map(|p| p + DVec3::new(1e7, 0.0, 0.0)), 4e-9);
}

#[test]
fn joints_that_mirror_turn_triangles_over() {
    let bytes = bar(Weights::Floats, |document| {
        document["nodes"][1]["scale"] = json!([-1, 1, 1]);
    });
    let import = loaded("bar.glb", bytes);
    let mesh = &import.meshes[0];
    assert_eq!(mesh.triangles[0], [0, 2, 1]);
    let [a, b, c] = mesh.triangles[0].map(|corner| mesh.positions.get(corner as usize));
    assert!((b - a).cross(c - a).z > 0.0, "the front still looks along +z");
    assert_eq!(mesh.normals.as_ref().unwrap().get(0), [-1.0, 0.0, 0.0]);
}

#[test]
fn a_mesh_of_two_skins_is_two_meshes_and_others_stay_in_the_file() {
    let bytes = bar(Weights::Floats, |document| {
        document["nodes"] = json!([
            {"mesh": 0, "skin": 0}, {"children": [2]},
            {"translation": [0, 2, 0], "rotation": quarter()},
            {"mesh": 0, "skin": 1}, {"translation": [0, 0, 5]}, {"mesh": 0}, {"mesh": 0},
        ]);
        let bound = document["skins"][0]["inverseBindMatrices"].clone();
        let skins = document["skins"].as_array_mut().unwrap();
        skins.push(json!({"joints": [4, 4], "inverseBindMatrices": bound}));
    });
    let import = loaded("bar.glb", bytes);
    assert_eq!((import.meshes.len(), import.placements.len()), (3, 4));
    let mesh = |placement: usize| &import.meshes[import.placements[placement].mesh as usize];
    assert_near(mesh(0), &bent(), 4e-7);
    // Both joints at (0, 0, 5), the second bound 2 m higher.
    let second = BAR.map(|[x, y, _]| DVec3::new(x.into(), f64::from(y) * 0.5, 5.0));
    assert_near(mesh(1), &second, 4e-7);
    let Positions::F32(still) = &mesh(2).positions else { panic!("f32") };
    assert!(still.floats().is_mapped(), "a mesh without a skin is not copied");
    assert_eq!(import.placements[2].mesh, import.placements[3].mesh);
}

#[test]
fn broken_skins_are_refused_with_their_place() {
    type Change = fn(&mut Value);
    let cases: [(&str, Change, &[&str]); 9] = [
        ("skin", |d| d["nodes"][0]["skin"] = json!(3), &["nodes[0].skin", "no skin 3", "has 1"]),
        (
            "joint",
            |d| d["skins"][0]["joints"] = json!([1, 9]),
            &["skins[0].joints[1]", "no node 9", "has 3"],
        ),
        ("none", |d| d["skins"][0]["joints"] = json!([]), &["skins[0].joints", "none"]),
        (
            "few",
            |d| d["skins"][0]["joints"] = json!([1]),
            &["meshes[0].primitives[0]", "vertex 2 names joint 1", "has 1"],
        ),
        (
            "matrices",
            |d| d["skins"][0]["joints"] = json!([1, 2, 2]),
            &["skins[0].inverseBindMatrices", "2 elements of 16 numbers for 3 joints"],
        ),
        (
            "vectors",
            |d| d["skins"][0]["inverseBindMatrices"] = json!(0),
            &["skins[0].inverseBindMatrices", "6 elements of 3 numbers", "4 × 4"],
        ),
        (
            "cycle",
            |d| {
                d["scenes"] = json!([{"nodes": [0]}]);
                d["nodes"][2]["children"] = json!([1]);
            },
            &["skins[0].joints[0]", "node 1 stands nowhere", "ancestor"],
        ),
        (
            "weights",
            |d| d["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(0),
            &["WEIGHTS_0"],
        ),
        (
            "many",
            |d| d["skins"][0]["joints"] = json!(vec![1; 70_000]),
            &["skins[0].joints", "70000 are more", "65536", "split the skin"],
        ),
    ];
    for (name, change, words) in cases {
        let folder = folder();
        let file = format!("{name}.glb");
        let path = write(&folder, &file, bar(Weights::Floats, change));
        if name == "weights" {
            // Positions have three components, so the fourth is 0: sums far from 1 are noted.
            assert!(!load(&path).notes.is_empty());
            continue;
        }
        let message = error(&path);
        for word in [&[file.as_str()], words].concat() {
            assert!(message.contains(word), "{name}: {message}");
        }
    }
}

#[test]
fn matrices_and_weights_that_make_no_sense_are_refused_or_told() {
    let with = |name: &str, old: &[u8], new: &[u8]| {
        let mut bytes = bar(Weights::Floats, |_| {});
        let at = bytes.windows(old.len()).rposition(|window| window == old).unwrap();
        bytes[at..at + old.len()].copy_from_slice(new);
        let folder = folder();
        let path = write(&folder, name, bytes);
        (error_or_load(&path), import_strict(&path).err().map(|e| e.to_string()))
    };
    let nan = f32::NAN.to_le_bytes();
    let (message, _) = with("nan.glb", &(-2.0_f32).to_le_bytes(), &nan);
    let message = message.unwrap_err();
    assert!(message.contains("skins[0].inverseBindMatrices, matrix 1"), "{message}");
    assert!(message.contains("finite"), "{message}");

    // The last two corners hang on joint 1 alone.
    let upper = [0.0_f32, 1.0, 0.0, 0.0];
    let both = |last: [f32; 4]| -> Vec<u8> {
        [upper, last].concat().iter().flat_map(|w| w.to_le_bytes()).collect()
    };
    let (import, strict) = with("zero.glb", &both(upper), &both([0.0; 4]));
    let import = import.unwrap();
    assert_eq!(import.notes.len(), 1, "{:?}", import.notes);
    assert!(import.notes[0].message.contains("without any weight"), "{:?}", import.notes);
    assert!(strict.unwrap().contains("1 vertices without any weight"));

    let (import, strict) = with("nan weight.glb", &both(upper), &both([f32::NAN, 1.0, 0.0, 0.0]));
    assert_eq!(import.unwrap().stats.dropped, 1, "one triangle has the last corner");
    assert!(strict.unwrap().contains("finite"));

    let folder = folder();
    let zeros = bar(Weights::Floats, |document| {
        let weights = &document["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"];
        let weights = usize::try_from(weights.as_u64().unwrap()).unwrap();
        document["accessors"][weights].as_object_mut().unwrap().remove("bufferView");
    });
    let message = error(&write(&folder, "zeros.glb", zeros));
    assert!(message.contains("all weights of its joints are 0"), "{message}");
}

fn error_or_load(path: &std::path::Path) -> Result<Import, String> {
    use etendue_scene::import::{Options, Wanted, import};
    import(path, Wanted::EVERYTHING, &Options::default()).map_err(|error| error.to_string())
}

/// A square with two morph targets: one lifts it by 1 along z and turns its normals to +X, one moves
/// its last corner alone.
fn morphing(mesh: Value, nodes: Value) -> Vec<u8> {
    let mut builder = Builder::default();
    let positions = builder.floats(&SQUARE);
    let normals = builder.floats(&[[0.0, 0.0, 1.0]; 4]);
    let lift = builder.floats(&[[0.0, 0.0, 1.0]; 4]);
    let turn = builder.floats(&[[1.0, 0.0, -1.0]; 4]);
    let indices = builder.view(&[3, 0], None);
    let value: Vec<u8> = [0.5_f32, 0.5, 0.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    let values = builder.view(&value, None);
    builder.accessors.push(json!({
        "componentType": 5126, "type": "VEC3", "count": 4,
        "sparse": {"count": 1, "indices": {"bufferView": indices, "componentType": 5123},
                   "values": {"bufferView": values}}
    }));
    let mut mesh = mesh;
    mesh["primitives"] = json!([{
        "attributes": {"POSITION": positions, "NORMAL": normals}, "mode": 5,
        "targets": [{"POSITION": lift, "NORMAL": turn}, {"POSITION": 4}],
    }]);
    builder.glb(json!({"meshes": [mesh], "nodes": nodes}))
}

#[test]
fn morph_targets_move_by_the_weights_of_the_node_or_the_mesh() {
    let nodes =
        json!([{"mesh": 0}, {"mesh": 0, "weights": [1, 0]}, {"mesh": 0, "weights": [0, 0]}]);
    let import = loaded("morph.glb", morphing(json!({"weights": [0.25, 2]}), nodes));
    assert!(import.notes.is_empty(), "{:?}", import.notes);
    let mesh = |placement: usize| &import.meshes[import.placements[placement].mesh as usize];
    let square = SQUARE.map(|p| DVec3::from(p.map(f64::from)));
    let mut moved = square.map(|p| p + 0.25 * DVec3::Z);
    moved[3] += DVec3::new(1.0, 1.0, 0.0);
    assert_eq!(points(mesh(0)), moved);
    assert_eq!(points(mesh(1)), square.map(|p| p + DVec3::Z));
    assert_eq!(mesh(1).normals.as_ref().unwrap().get(0), [1.0, 0.0, 0.0]);
    assert_eq!(points(mesh(2)), square);
    let Positions::F32(still) = &mesh(2).positions else { panic!("f32") };
    assert!(still.floats().is_mapped(), "weights of 0 copy nothing");
}

#[test]
fn weights_and_targets_that_do_not_match_are_told() {
    let folder = folder();
    let nodes = json!([{"mesh": 0, "weights": [0, 1, 1]}]);
    let path = write(&folder, "weights.glb", morphing(json!({}), nodes));
    let import = load(&path);
    assert_eq!(points(&import.meshes[0])[3], DVec3::new(1.5, 1.5, 0.0));
    assert!(
        import.notes[0].message.contains("3 weights for 2 morph targets"),
        "{:?}",
        import.notes
    );
    assert!(import_strict(&path).unwrap_err().to_string().contains("3 weights"));
}
