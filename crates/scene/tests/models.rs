//! Small models made by hand: what the assets do not have, and what is broken.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Mesh, Positions, Transform};
use etendue_scene::import::{
    Import, ImportError, NoteKind, Options, Projection, Strictness, Wanted, import,
};
use etendue_tracer::texture::{Filter, Wrap};
use etendue_tracer::{ImageSource, Paint};
use serde_json::{Value, json};
use tempfile::TempDir;

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

fn write(folder: &TempDir, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

fn load(path: &Path) -> Import {
    import(path, Wanted::EVERYTHING, &Options::default()).unwrap()
}

fn error(path: &Path) -> String {
    import(path, Wanted::EVERYTHING, &Options::default()).unwrap_err().to_string()
}

fn strict() -> Options {
    Options { strictness: Strictness::Strict, ..Options::default() }
}

fn points(mesh: &Mesh) -> Vec<DVec3> {
    (0..mesh.positions.len()).map(|i| mesh.positions.get(i)).collect()
}

// --- glTF ---------------------------------------------------------------------------------------

/// Builds a glTF document and its bytes, accessor by accessor.
#[derive(Default)]
struct Builder {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Builder {
    fn view(&mut self, bytes: &[u8], stride: Option<usize>) -> usize {
        while !self.bytes.len().is_multiple_of(4) {
            self.bytes.push(0);
        }
        let mut view =
            json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()});
        if let Some(stride) = stride {
            view["byteStride"] = json!(stride);
        }
        self.bytes.extend(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    fn accessor(&mut self, kind: u32, shape: &str, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes, None);
        self.accessors.push(
            json!({"bufferView": view, "componentType": kind, "type": shape, "count": count}),
        );
        self.accessors.len() - 1
    }

    fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let shape = ["", "SCALAR", "VEC2", "VEC3", "VEC4"][N];
        self.accessor(5126, shape, values.len(), &bytes)
    }

    fn u32s(&mut self, values: &[u32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(5125, "SCALAR", values.len(), &bytes)
    }

    /// The document with `rest` and a node for mesh 0 unless it has its own.
    fn document(&self, rest: Value) -> Value {
        let mut document = json!({
            "asset": {"version": "2.0"},
            "nodes": [{"mesh": 0}],
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": self.bytes.len()}],
        });
        for (key, value) in rest.as_object().unwrap() {
            document[key] = value.clone();
        }
        document
    }

    fn glb(&self, rest: Value) -> Vec<u8> {
        glb(&self.document(rest), &self.bytes)
    }
}

fn glb(document: &Value, bytes: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut binary = bytes.to_vec();
    binary.resize(binary.len().next_multiple_of(4), 0);
    let total = 12 + 8 + json.len() + 8 + binary.len();
    let word = |n: usize| u32::try_from(n).unwrap().to_le_bytes();
    let mut file = Vec::new();
    file.extend(b"glTF");
    file.extend(word(2));
    file.extend(word(total));
    file.extend(word(json.len()));
    file.extend(b"JSON");
    file.extend(json);
    file.extend(word(binary.len()));
    file.extend(b"BIN\0");
    file.extend(binary);
    file
}

const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];

/// A GLB with one primitive over [`SQUARE`] with these attributes beside it.
fn square_glb(primitive: Value, rest: Value, build: impl FnOnce(&mut Builder)) -> Vec<u8> {
    let mut builder = Builder::default();
    let positions = builder.floats(&SQUARE);
    build(&mut builder);
    let mut primitive = primitive;
    if primitive["attributes"].is_null() {
        primitive["attributes"] = json!({});
    }
    primitive["attributes"]["POSITION"] = json!(positions);
    let mut rest = rest;
    rest["meshes"] = json!([{"primitives": [primitive]}]);
    builder.glb(rest)
}

#[test]
fn strips_fans_and_bare_corners_become_triangles() {
    let folder = folder();
    let triangles = |mode: u32| {
        let bytes = square_glb(json!({"mode": mode}), json!({}), |_| {});
        let import = load(&write(&folder, &format!("{mode}.glb"), bytes));
        import.meshes.first().map(|mesh| mesh.triangles.to_vec())
    };
    assert_eq!(triangles(5), Some(vec![[0, 1, 2], [1, 3, 2]]), "the second is turned round");
    assert_eq!(triangles(6), Some(vec![[1, 2, 0], [2, 3, 0]]));
    assert_eq!(triangles(4), Some(vec![[0, 1, 2]]), "one corner is left over");
    assert_eq!(triangles(0), None, "points have no surface");

    let bytes = square_glb(json!({"mode": 5, "indices": 1}), json!({}), |b| {
        b.accessor(5123, "SCALAR", 5, &[3, 0, 2, 0, 1, 0, 0, 0, 3, 0]);
    });
    let import = load(&write(&folder, "indexed.glb", bytes));
    assert_eq!(&import.meshes[0].triangles[..], [[3, 2, 1], [2, 0, 1], [1, 0, 3]]);
}

#[test]
fn indices_of_all_widths_are_read_and_u32_stays_where_it_is() {
    let folder = folder();
    for (kind, bytes) in [
        (5121, vec![2, 1, 0]),
        (5123, vec![2, 0, 1, 0, 0, 0]),
        (5125, vec![2, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0]),
    ] {
        let file = square_glb(json!({"indices": 1}), json!({}), |b| {
            b.accessor(kind, "SCALAR", 3, &bytes);
        });
        let import = load(&write(&folder, &format!("{kind}.glb"), file));
        assert_eq!(&import.meshes[0].triangles[..], [[2, 1, 0]]);
        assert_eq!(import.meshes[0].triangles.is_mapped(), kind == 5125);
        let Positions::F32(vertices) = &import.meshes[0].positions else { panic!("f32") };
        assert!(vertices.floats().is_mapped());
        assert!(vertices.is_padded(), "the file goes on behind the last vertex");
    }
}

#[test]
fn interleaved_vertices_stay_where_they_are() {
    let folder = folder();
    let mut builder = Builder::default();
    let bytes: Vec<u8> = SQUARE
        .iter()
        .flat_map(|[x, y, z]| [*x, *y, *z, 0.0, 0.0, 1.0, *x, *y])
        .flat_map(f32::to_le_bytes)
        .collect();
    let view = builder.view(&bytes, Some(32));
    for (offset, shape) in [(0, "VEC3"), (12, "VEC3"), (24, "VEC2")] {
        builder.accessors.push(json!({
            "bufferView": view, "byteOffset": offset, "componentType": 5126, "type": shape,
            "count": 4
        }));
    }
    let attributes = json!({"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2});
    let file = builder.glb(json!({"meshes": [{"primitives": [{"attributes": attributes}]}]}));
    let import = load(&write(&folder, "interleaved.glb", file));
    let mesh = &import.meshes[0];
    assert_eq!(points(mesh)[3], DVec3::new(1.0, 1.0, 0.0));
    assert_eq!(mesh.normals.as_ref().unwrap().get(3), [0.0, 0.0, 1.0]);
    assert_eq!(mesh.uvs[0].get(3), [1.0, 1.0]);
    assert_eq!(mesh.uvs[0].stride(), 8);
    assert!(mesh.uvs[0].floats().is_mapped());
    let bare = import_with(&folder, "interleaved.glb", Wanted::NOTHING);
    assert!(bare.meshes[0].normals.is_none() && bare.meshes[0].uvs.is_empty());
}

fn import_with(folder: &TempDir, name: &str, wanted: Wanted) -> Import {
    import(&folder.path().join(name), wanted, &Options::default()).unwrap()
}

#[test]
fn sparse_elements_replace_those_of_the_base_or_zeros() {
    let folder = folder();
    for with_base in [true, false] {
        let mut builder = Builder::default();
        builder.floats(&SQUARE);
        let indices = builder.view(&[1, 0, 3, 0], None);
        let values: Vec<u8> =
            [5.0_f32, 6.0, 7.0, 8.0, 9.0, 10.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        let values = builder.view(&values, None);
        let mut accessor = json!({
            "componentType": 5126, "type": "VEC3", "count": 4,
            "sparse": {
                "count": 2,
                "indices": {"bufferView": indices, "componentType": 5123},
                "values": {"bufferView": values}
            }
        });
        if with_base {
            accessor["bufferView"] = json!(0);
        }
        builder.accessors.push(accessor);
        let primitive = json!({"attributes": {"POSITION": 1}, "mode": 5});
        let file = builder.glb(json!({"meshes": [{"primitives": [primitive]}]}));
        let import = load(&write(&folder, "sparse.glb", file));
        let third = if with_base { [0.0, 1.0, 0.0] } else { [0.0; 3] };
        let expected = [[0.0; 3], [5.0, 6.0, 7.0], third, [8.0, 9.0, 10.0]];
        assert_eq!(points(&import.meshes[0]), expected.map(DVec3::from));
    }
}

#[test]
fn quantized_attributes_are_decoded() {
    let folder = folder();
    let mut builder = Builder::default();
    let shorts = |values: &[i16]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    // Positions as plain i16, padded to eight bytes a vertex; normals as normalized i8.
    let positions = builder.view(&shorts(&[-3, 0, 5, 0, 300, 0, 0, 0, 0, 7, 0, 0]), Some(8));
    let normals = builder.view(&[0, 0, 127, 0, 0x81, 0, 0, 0, 0x80, 0, 0, 0], Some(4));
    let uvs = builder.view(&[0, 0, 255, 0, 51, 102], Some(2));
    let more = [
        json!({"bufferView": positions, "componentType": 5122, "type": "VEC3", "count": 3}),
        json!({"bufferView": normals, "componentType": 5120, "type": "VEC3", "count": 3, "normalized": true}),
        json!({"bufferView": uvs, "componentType": 5121, "type": "VEC2", "count": 3, "normalized": true}),
    ];
    builder.accessors.extend(more);
    let attributes = json!({"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2});
    let file = builder.glb(json!({
        "meshes": [{"primitives": [{"attributes": attributes}]}],
        "extensionsUsed": ["KHR_mesh_quantization"],
        "extensionsRequired": ["KHR_mesh_quantization"]
    }));
    let import = load(&write(&folder, "quantized.glb", file));
    let mesh = &import.meshes[0];
    assert_eq!(points(mesh)[..2], [DVec3::new(-3.0, 0.0, 5.0), DVec3::new(300.0, 0.0, 0.0)]);
    let normals = mesh.normals.as_ref().unwrap();
    assert_eq!([normals.get(0), normals.get(1)], [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]);
    assert_eq!(normals.get(2), [-1.0, 0.0, 0.0], "−128 and −127 are both −1");
    assert_eq!(mesh.uvs[0].get(2), [0.2, 0.4]);
    assert!(import.notes.is_empty(), "{:?}", import.notes);
}

#[test]
fn instances_stand_below_their_node() {
    let folder = folder();
    let file = square_glb(
        json!({}),
        json!({"nodes": [{
            "mesh": 0, "translation": [10, 0, 0], "scale": [2, 2, 2],
            "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {
                "TRANSLATION": 1, "ROTATION": 2, "SCALE": 3
            }}}
        }]}),
        |b| {
            b.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]);
            // The second is turned a quarter about +Z, as normalized i16.
            let half = 23_170_i16.to_le_bytes();
            let rotations =
                [[0, 0, 0, 0, 0, 0, 0xff, 0x7f], [0, 0, 0, 0, half[0], half[1], half[0], half[1]]];
            b.accessor(5122, "VEC4", 2, rotations.as_flattened());
            b.accessors[2]["normalized"] = json!(true);
            b.floats(&[[1.0, 1.0, 1.0], [1.0, 3.0, 1.0]]);
        },
    );
    let import = load(&write(&folder, "instances.glb", file));
    assert_eq!((import.meshes.len(), import.placements.len()), (1, 2));
    let corner = |i: usize| import.placements[i].model_from_mesh.point(DVec3::new(1.0, 1.0, 0.0));
    assert_eq!(corner(0), DVec3::new(12.0, 2.0, 0.0));
    // (1, 1) is scaled to (1, 3), turned to (−3, 1), moved to (−2, 1), doubled and moved again.
    // The quarter turn is the same number twice, made unit length: exact to rounding.
    assert!((corner(1) - DVec3::new(6.0, 2.0, 0.0)).length() < 1e-14, "{}", corner(1));
}

#[test]
fn nodes_are_read_in_double_precision() {
    let folder = folder();
    let far = 12_345_678.901_234_567_f64;
    let nodes = json!([
        {"translation": [far, 0, 0], "scale": [-1, 1, 1], "children": [1]},
        {"matrix": [0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 2, 0, 0.1, 0.2, 0.3, 1], "mesh": 0, "name": "leaf"}
    ]);
    let file = square_glb(json!({}), json!({"nodes": nodes}), |_| {});
    let import = load(&write(&folder, "far.glb", file));
    let placement = &import.placements[0];
    assert_eq!(placement.name, "leaf");
    let linear = DMat3::from_cols_array(&[0.0, 2.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 2.0]);
    assert_eq!(placement.model_from_mesh.linear, linear);
    assert_eq!(placement.model_from_mesh.handedness(), -1.0);
    let origin = DVec3::new(far, 0.0, 0.0);
    let seen = placement.model_from_mesh.point_from(DVec3::ZERO, origin);
    assert_eq!(seen, DVec3::new(-0.1, 0.2, 0.3), "nothing is lost 10⁷ m from the origin");
}

#[test]
fn the_default_scene_is_the_named_the_first_or_all_roots() {
    let folder = folder();
    let nodes = json!([
        {"mesh": 0, "translation": [0, 0, 0]}, {"mesh": 0, "translation": [1, 0, 0]},
        {"children": [1]}
    ]);
    let places = |scenes: Value| {
        let mut rest = json!({"nodes": nodes});
        for (key, value) in scenes.as_object().unwrap() {
            rest[key] = value.clone();
        }
        let path = write(&folder, "scenes.glb", square_glb(json!({}), rest, |_| {}));
        let placements = load(&path).placements;
        placements.iter().map(|p| p.model_from_mesh.translation.x).collect::<Vec<_>>()
    };
    assert_eq!(places(json!({})), [0.0, 1.0]);
    assert_eq!(places(json!({"scenes": [{"nodes": [2]}, {"nodes": [0]}]})), [1.0]);
    assert_eq!(places(json!({"scene": 1, "scenes": [{"nodes": [2]}, {"nodes": [0]}]})), [0.0]);
    assert!(places(json!({"scenes": [{}]})).is_empty(), "a scene may be empty");
}

#[test]
fn cameras_keep_their_view_and_place() {
    let folder = folder();
    let rest = json!({
        "cameras": [
            {"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1, "aspectRatio": 1.5}},
            {"type": "orthographic", "name": "plan",
             "orthographic": {"xmag": 2, "ymag": 1, "znear": 0, "zfar": 9}}
        ],
        "nodes": [{"camera": 0, "name": "eye", "translation": [1, 2, 3]}, {"camera": 1}]
    });
    let import =
        load(&write(&folder, "cameras.gltf", Builder::default().document(rest).to_string()));
    let [eye, plan] = &import.cameras[..] else { panic!("{:?}", import.cameras) };
    let aspect_ratio = Some(1.5);
    assert_eq!(eye.projection, Projection::Perspective { yfov: 0.7, aspect_ratio });
    assert_eq!((eye.name.as_str(), eye.model_from_camera.translation.z), ("eye", 3.0));
    assert_eq!(plan.projection, Projection::Orthographic { xmag: 2.0, ymag: 1.0 });
    assert_eq!((plan.name.as_str(), plan.model_from_camera), ("plan", Transform::IDENTITY));
}

#[test]
fn buffers_come_from_files_with_escaped_names_and_from_data() {
    let folder = folder();
    let mut builder = Builder::default();
    builder.floats(&SQUARE);
    write(&folder, "my mesh#1.bin", &builder.bytes);
    let mut rest =
        json!({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 5}]}]});
    rest["buffers"] = json!([{"uri": "my%20mesh%231.bin", "byteLength": 48}]);
    let outside = load(&write(&folder, "a.gltf", builder.document(rest.clone()).to_string()));
    assert_eq!(outside.meshes[0].triangles.len(), 2);
    let Positions::F32(vertices) = &outside.meshes[0].positions else { panic!("f32") };
    assert!(vertices.floats().is_mapped());
    assert!(!vertices.is_padded(), "the file ends with the last vertex");

    let mut data = String::from("data:application/octet-stream,");
    builder.bytes.iter().for_each(|byte| write!(data, "%{byte:02x}").unwrap());
    rest["buffers"] = json!([{"uri": data, "byteLength": 48}]);
    let inside = load(&write(&folder, "b.gltf", builder.document(rest).to_string()));
    assert_eq!(points(&inside.meshes[0]), points(&outside.meshes[0]));
}

#[test]
fn materials_have_colour_texture_and_transform() {
    let folder = folder();
    let rest = json!({
        "materials": [{"name": "tiles", "pbrMetallicRoughness": {
            "baseColorFactor": [0.25, 0.5, 0.75, 1],
            "baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform":
                {"offset": [0, 1], "rotation": std::f64::consts::FRAC_PI_2, "scale": [0.5, 0.5],
                 "texCoord": 1}}}
        }}, {"pbrMetallicRoughness": {"baseColorTexture": {"index": 1}}}],
        "textures": [{"source": 0, "sampler": 0}, {"source": 1}],
        "samplers": [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}],
        "images": [{"bufferView": 1, "mimeType": "image/png"}, {"uri": "missing.png"}]
    });
    let file = square_glb(json!({"material": 0}), rest, |b| {
        b.view(b"pixels", None);
    });
    let path = write(&folder, "material.glb", file);
    let import = load(&path);
    let material = &import.materials[import.placements[0].material as usize];
    let Paint::Image { factor, image } = &material.base_color else { panic!("{material:?}") };
    assert_eq!((material.name.as_str(), factor), ("tiles", &[0.25, 0.5, 0.75]));
    assert_eq!(image.uv_set, 1);
    // The registry's example: the lower left quarter of the image, turned.
    let at = |u: f64, v: f64| image.transform.map(|[a, b, c]| a * u + b * v + c);
    for (uv, expected) in
        [((0.0, 0.0), [0.0, 1.0]), ((1.0, 0.0), [0.0, 0.5]), ((0.0, 1.0), [0.5, 1.0])]
    {
        let [u, v] = at(uv.0, uv.1);
        // The angle is f32 in the crate that reads it.
        assert!((u - expected[0]).abs() + (v - expected[1]).abs() < 1e-7, "{uv:?}: {u} {v}");
    }
    let texture = &import.textures[image.texture as usize];
    assert_eq!(
        (texture.wrap, texture.filter),
        ([Wrap::ClampToEdge, Wrap::MirroredRepeat], Filter::Nearest)
    );
    let ImageSource::Bytes(bytes) = &texture.source else { panic!("{texture:?}") };
    assert_eq!(&bytes[..], b"pixels");
    assert_eq!(import.materials[1].base_color, Paint::Plain([1.0; 3]));
    assert!(
        import.notes.iter().any(|n| n.kind == NoteKind::MissingFile && n.subject == "missing.png")
    );
    let plain = import_with(&folder, "material.glb", Wanted::NOTHING);
    assert_eq!(plain.materials[0].base_color, Paint::Plain([0.25, 0.5, 0.75]));
    assert!(plain.textures.is_empty());
}

#[test]
fn triangles_that_are_not_finite_are_dropped_or_refused() {
    let folder = folder();
    let mut builder = Builder::default();
    builder.floats(&[
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [f32::NAN, 0.0, 0.0],
        [0.0, f32::INFINITY, 0.0],
        [f32::NAN; 3],
    ]);
    builder.u32s(&[0, 1, 2, 0, 1, 3, 4, 1, 2, 2, 1, 0, 0, 0, 1]);
    let primitive = json!({"attributes": {"POSITION": 0}, "indices": 1});
    let path =
        write(&folder, "nan.glb", builder.glb(json!({"meshes": [{"primitives": [primitive]}]})));
    let import = super_import(&path);
    assert_eq!(&import.meshes[0].triangles[..], [[0, 1, 2], [2, 1, 0], [0, 0, 1]]);
    assert_eq!((import.stats.dropped, import.stats.degenerate), (2, Some(1)));
    assert_eq!(import.meshes[0].bounds.max, DVec3::new(1.0, 1.0, 0.0));
    let note = import.notes.iter().find(|note| note.kind == NoteKind::NotFinite).unwrap();
    assert_eq!(note.count, 2);
    let refused = import_strict(&path).unwrap_err().to_string();
    assert!(refused.contains("2 triangles with a corner that is not a finite number"), "{refused}");
}

fn super_import(path: &Path) -> Import {
    let options = Options { count_degenerate: true, ..Options::default() };
    import(path, Wanted::EVERYTHING, &options).unwrap()
}

fn import_strict(path: &Path) -> Result<Import, ImportError> {
    import(path, Wanted::EVERYTHING, &strict())
}

#[test]
fn an_unused_nan_harms_nobody() {
    let folder = folder();
    let mut builder = Builder::default();
    builder.floats(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [f32::NAN; 3]]);
    builder.u32s(&[0, 1, 2]);
    let primitive = json!({"attributes": {"POSITION": 0}, "indices": 1});
    let path =
        write(&folder, "nan.glb", builder.glb(json!({"meshes": [{"primitives": [primitive]}]})));
    assert_eq!(import_strict(&path).unwrap().meshes[0].triangles.len(), 1);
}

/// The file is refused with a message that has its name and all `words`.
fn refused(name: &str, bytes: Vec<u8>, words: &[&str]) {
    let folder = folder();
    let message = error(&write(&folder, name, bytes));
    assert!(message.contains(name), "{message}");
    for word in words {
        assert!(message.contains(word), "{name}: {message}");
    }
}

#[test]
fn broken_containers_and_indices_are_refused_with_their_place() {
    let primitive = |indices: &[u32]| {
        square_glb(json!({"indices": 1}), json!({}), |b| {
            b.u32s(indices);
        })
    };
    refused(
        "index.glb",
        primitive(&[0, 1, 2, 1, 2, 4]),
        &["meshes[0].primitives[0]", "triangle 1", "vertex 4", "4 vertices"],
    );
    let whole = primitive(&[0, 1, 2]);
    refused("short.glb", whole[..whole.len() - 8].to_vec(), &["cut off"]);
    refused("header.glb", whole[..9].to_vec(), &["header"]);
    let mut old = whole.clone();
    old[4] = 1;
    refused("old.glb", old, &["version 1"]);
}

#[test]
fn broken_hierarchies_are_refused_with_their_place() {
    let nodes = |nodes: Value| {
        square_glb(json!({}), json!({"nodes": nodes, "scenes": [{"nodes": [0]}]}), |_| {})
    };
    refused(
        "cycle.glb",
        nodes(json!([{"children": [1]}, {"children": [0]}])),
        &["nodes[0]", "ancestor"],
    );
    refused("self.glb", nodes(json!([{"children": [0]}])), &["nodes[0]"]);
    refused(
        "parents.glb",
        nodes(json!([{"children": [1, 2]}, {"children": [3]}, {"children": [3]}, {}])),
        &["nodes[3]", "two parents"],
    );
    refused("missing.glb", nodes(json!([{"children": [7]}])), &["nodes[7]"]);
    refused("mesh.glb", nodes(json!([{"mesh": 5}])), &["nodes[0].mesh", "no mesh 5"]);
    refused("rotation.glb", nodes(json!([{"rotation": [0, 0, 0, 0]}])), &["nodes[0]", "rotation"]);
    refused(
        "projection.glb",
        nodes(json!([{"matrix": [1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}])),
        &["nodes[0]", "last row"],
    );
}

#[test]
fn broken_documents_are_refused_with_their_place() {
    refused(
        "json.gltf",
        b"{\n  \"asset\": {,\n}".to_vec(),
        &["line 2, column 13", "\"asset\": {,"],
    );
    refused(
        "type.gltf",
        br#"{"asset": {"version": "2.0"}, "nodes": [{}, {"mesh": "x"}]}"#.to_vec(),
        &["nodes[1].mesh"],
    );
    refused("one.gltf", br#"{"asset": {"version": "1.0"}}"#.to_vec(), &["glTF 1.0"]);
    refused("else.gltf", b"[1, 2]".to_vec(), &["line 1"]);
}

#[test]
fn broken_accessors_are_refused_with_their_place() {
    let mut builder = Builder::default();
    builder.floats(&SQUARE);
    let mesh = json!([{"primitives": [{"attributes": {"POSITION": 0}}]}]);
    let broken = |change: &dyn Fn(&mut Value)| {
        let mut document = builder.document(json!({"meshes": mesh}));
        change(&mut document);
        glb(&document, &builder.bytes)
    };
    refused(
        "count.glb",
        broken(&|d| d["accessors"][0]["count"] = json!(5)),
        &["POSITION (accessor 0)", "do not fit"],
    );
    refused("huge.glb", broken(&|d| d["accessors"][0]["count"] = json!(u64::MAX)), &["accessor 0"]);
    refused(
        "offset.glb",
        broken(&|d| d["bufferViews"][0]["byteOffset"] = json!(u64::MAX)),
        &["bufferViews[0]"],
    );
    refused(
        "view.glb",
        broken(&|d| d["accessors"][0]["bufferView"] = json!(9)),
        &["bufferViews[9]"],
    );
    refused(
        "zeros.glb",
        broken(&|d| {
            d["accessors"][0] =
                json!({"componentType": 5126, "type": "VEC3", "count": 4_000_000_000_u32});
        }),
        &["without any data"],
    );
    refused(
        "length.glb",
        broken(&|d| d["buffers"][0]["byteLength"] = json!(64)),
        &["buffers[0]", "64 bytes", "cut off after 48"],
    );
    refused("stride.glb", broken(&|d| d["bufferViews"][0]["byteStride"] = json!(4)), &["overlap"]);
}

#[test]
fn extensions_are_named_with_what_to_do() {
    let folder = folder();
    let with = |rest: Value, primitive: Value| square_glb(primitive, rest, |_| {});
    let path = write(
        &folder,
        "un known.glb",
        with(json!({"extensionsRequired": ["ACME_teapot"]}), json!({})),
    );
    assert!(error(&path).contains("ACME_teapot"));
    let draco = json!({"extensionsRequired": ["KHR_draco_mesh_compression"], "extensionsUsed": ["KHR_draco_mesh_compression"]});
    let message = error(&write(&folder, "dra co.glb", with(draco, json!({}))));
    assert!(message.contains("KHR_draco_mesh_compression"), "{message}");
    assert!(message.contains("npx @gltf-transform/cli copy '"), "{message}");
    let basis = json!({
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"extensions": {"KHR_texture_basisu": {"source": 0}}}],
        "images": [{"uri": "a.ktx2"}], "extensionsUsed": ["KHR_texture_basisu"]
    });
    let path = write(&folder, "ktx.glb", with(basis, json!({"material": 0})));
    assert!(error(&path).contains("KHR_texture_basisu"));
    let bare = import_with(&folder, "ktx.glb", Wanted::NOTHING);
    assert!(bare.notes.iter().any(|note| note.subject == "KHR_texture_basisu"), "{:?}", bare.notes);
    let used = json!({"extensionsUsed": ["KHR_materials_sheen", "ACME_teapot"]});
    let notes = load(&write(&folder, "used.glb", with(used, json!({})))).notes;
    let subjects: Vec<&str> = notes.iter().map(|note| note.subject.as_str()).collect();
    assert_eq!(subjects[..2], ["KHR_materials_sheen", "ACME_teapot"]);

    let compressed = json!({"EXT_meshopt_compression": {"buffer": 0}});
    let mut builder = Builder::default();
    builder.floats(&SQUARE);
    let mut document =
        builder.document(json!({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]}));
    document["buffers"] = json!([{"byteLength": 48}, {"byteLength": 48}]);
    document["bufferViews"][0]["buffer"] = json!(1);
    document["bufferViews"][0]["extensions"] = compressed;
    let message = error(&write(&folder, "meshopt.glb", glb(&document, &builder.bytes)));
    assert!(message.contains("EXT_meshopt_compression"), "{message}");
}

#[test]
fn paths_may_not_leave_the_root() {
    let folder = folder();
    let inner = folder.path().join("inner");
    std::fs::create_dir(&inner).unwrap();
    let mut builder = Builder::default();
    builder.floats(&SQUARE);
    write(&folder, "secret.bin", &builder.bytes);
    let document = |uri: &str| {
        let mesh = json!([{"primitives": [{"attributes": {"POSITION": 0}}]}]);
        builder
            .document(json!({"meshes": mesh, "buffers": [{"uri": uri, "byteLength": 48}]}))
            .to_string()
    };
    let path = inner.join("a.gltf");
    let options = Options { root: Some(inner.clone()), ..Options::default() };
    let absolute = folder.path().join("secret.bin");
    for uri in ["../secret.bin", "%2e%2e/secret.bin", "../none.bin", absolute.to_str().unwrap()] {
        std::fs::write(&path, document(uri)).unwrap();
        let error = import(&path, Wanted::NOTHING, &options).unwrap_err();
        assert!(matches!(error, ImportError::Outside { .. }), "{uri}: {error}");
    }
    std::fs::write(&path, document("../secret.bin")).unwrap();
    let wider = Options { root: Some(folder.path().to_owned()), ..Options::default() };
    assert!(import(&path, Wanted::NOTHING, &wider).is_ok());
    assert!(import(&path, Wanted::NOTHING, &Options::default()).is_ok());
    std::fs::write(&path, document("none.bin")).unwrap();
    let missing = import(&path, Wanted::NOTHING, &options).unwrap_err().to_string();
    assert!(missing.contains("\"none.bin\" does not exist"), "{missing}");
}

// --- OBJ ----------------------------------------------------------------------------------------

#[test]
fn obj_groups_materials_and_attributes() {
    let folder = folder();
    write(
        &folder,
        "paint.mtl",
        "newmtl red\nKd 1 0 0\nKd_odd\n\nnewmtl photo\nKd 0.5\nmap_Kd -s 2 1 pic ture.png\n",
    );
    write(&folder, "pic ture.png", "pixels");
    let text = "\
        mtllib paint.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0.25\nvt 1 0.25\nvn 0 0 1\n\
        usemtl red\nf 1 2 3 # a comment\ng side\nusemtl photo\nf 1/1/1 2/2/1 \\\n 3/1/1\n\
        usemtl nobody\nf -4 -3 -2\nusemtl photo\nf 4/1/1 3/2/1 1/1/1\nl 1 2\nf 1 2\n";
    let import = load(&write(&folder, "a.obj", text));
    let summary: Vec<_> = import
        .placements
        .iter()
        .map(|p| {
            let mesh = &import.meshes[p.mesh as usize];
            let material = &import.materials[p.material as usize];
            (p.name.as_str(), material.name.as_str(), mesh.triangles.len(), mesh.uvs.len())
        })
        .collect();
    assert_eq!(summary, [("", "red", 1, 0), ("side", "photo", 2, 1), ("side", "nobody", 1, 0)]);
    assert_eq!(import.materials[0].base_color, Paint::Plain([1.0, 0.0, 0.0]));
    let Paint::Image { factor, image } = &import.materials[1].base_color else { panic!("image") };
    assert_eq!((*factor, image.transform), ([0.5; 3], [[2.0, 0.0, 0.0], [0.0, 1.0, 0.0]]));
    let side = &import.meshes[1];
    assert_eq!(side.uvs[0].get(1), [1.0, 0.75], "v runs down");
    assert_eq!(side.normals.as_ref().unwrap().get(0), [0.0, 0.0, 1.0]);
    assert_eq!(
        points(&import.meshes[2]),
        [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]].map(DVec3::from)
    );
    let noted = |kind: NoteKind| import.notes.iter().filter(|note| note.kind == kind).count();
    assert_eq!(
        (noted(NoteKind::Irregular), noted(NoteKind::Unsupported)),
        (2, 1),
        "{:?}",
        import.notes
    );
}

#[test]
fn obj_far_from_the_origin_keeps_its_digits() {
    let folder = folder();
    let text = "v 1000000.1 0 0\nv 1000001.1 0 0\nv 1000000.1 1.3 0\nf 1 2 3\n";
    let import = load(&write(&folder, "far.obj", text));
    assert_eq!(points(&import.meshes[0])[1].x, 1_000_001.1);
}

#[test]
fn broken_obj_is_refused_with_its_line() {
    let folder = folder();
    for (text, words) in [
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n\nf 1 2 4\n", ["line 5, column 7", "\"4\"", "3 vertices"]),
        ("v 0 0 0\nf 1 -2 1\nv 0 1 0\n", ["line 2, column 5", "\"-2\"", "1 vertices"]),
        ("v 0 0 0\nv 1 0\n", ["line 2", "3 numbers", "v 1 0"]),
        ("v 0 x 0\n", ["line 1, column 5", "\"x\"", "not a number"]),
        ("v 0 0 0\nf 1 1 0\n", ["line 2", "\"0\"", "count from 1"]),
        ("f 99999999999 1 1\n", ["line 1", "99999999999", "vert"]),
    ] {
        let message = error(&write(&folder, "bad.obj", text));
        for word in words {
            assert!(message.contains(word), "{text:?}: {message}");
        }
    }
    let path = write(&folder, "uv.obj", "v 0 0 0\nf 1/1 1/1 1/1\n");
    let import = load(&path);
    assert!(import.meshes[0].uvs.is_empty());
    assert_eq!(import.notes[0].count, 3, "{:?}", import.notes);
    let message = import_strict(&path).unwrap_err().to_string();
    assert!(message.contains("line 2, column 3") && message.contains("0 texture"), "{message}");
    assert!(load(&write(&folder, "empty.obj", "")).meshes[0].triangles.is_empty());
}

// --- PLY ----------------------------------------------------------------------------------------

const PLY_HEADER: &str = "ply\nformat FORMAT 1.0\ncomment by hand\nelement vertex 5\n\
    property float x\nproperty float y\nproperty float z\nproperty uchar red\n\
    property uchar green\nproperty uchar blue\nelement face 2\n\
    property list uchar int vertex_indices\nend_header\n";

/// A triangle and a concave quadrilateral.
const PLY_POINTS: [[f32; 3]; 5] =
    [[0.0, 0.0, 0.0], [2.0, -1.0, 0.0], [0.5, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 9.0]];
const PLY_FACES: [&[i32]; 2] = [&[0, 1, 4], &[0, 1, 2, 3]];

fn ply_text() -> Vec<u8> {
    let mut text = PLY_HEADER.replace("FORMAT", "ascii");
    for [x, y, z] in PLY_POINTS {
        writeln!(text, "{x} {y} {z} 255 0 128").unwrap();
    }
    for face in PLY_FACES {
        let corners: Vec<String> = face.iter().map(i32::to_string).collect();
        writeln!(text, "{} {}", face.len(), corners.join(" ")).unwrap();
    }
    text.into_bytes()
}

fn ply_binary(big: bool) -> Vec<u8> {
    let format = if big { "binary_big_endian" } else { "binary_little_endian" };
    let mut file = PLY_HEADER.replace("FORMAT", format).into_bytes();
    let word = |bytes: [u8; 4]| {
        if big { bytes.map(|b| b).into_iter().rev().collect() } else { bytes.to_vec() }
    };
    for point in PLY_POINTS {
        point.iter().for_each(|x| file.extend(word(x.to_le_bytes())));
        file.extend([255, 0, 128]);
    }
    for face in PLY_FACES {
        file.push(u8::try_from(face.len()).unwrap());
        face.iter().for_each(|i| file.extend(word(i.to_le_bytes())));
    }
    file
}

#[test]
fn ply_is_the_same_in_all_formats() {
    let folder = folder();
    for (name, bytes) in
        [("t.ply", ply_text()), ("l.ply", ply_binary(false)), ("b.ply", ply_binary(true))]
    {
        let import = load(&write(&folder, name, &bytes));
        let mesh = &import.meshes[0];
        assert_eq!(points(mesh), PLY_POINTS.map(|p| DVec3::from(p.map(f64::from))), "{name}");
        assert_eq!(mesh.triangles.len(), 3, "{name}");
        let area: f64 = (1..3)
            .map(|i| mesh.corners(i))
            .map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0)
            .sum();
        assert_eq!(area, 0.5, "{name}: the arrow head is not filled up");
        let [red, green, blue, _] = mesh.colors.as_ref().unwrap().get(4);
        // 128 of 255 in sRGB is 0.2158605 of full scale.
        assert_eq!((red, green), (1.0, 0.0));
        assert!((blue - 0.215_860_5).abs() < 1e-7, "{blue}");
        for (cut, word) in [(10, "format"), (100, "cut.ply"), (bytes.len() - 4, "")] {
            let message = error(&write(&folder, "cut.ply", &bytes[..cut]));
            assert!(message.contains(word), "{cut}: {message}");
        }
    }
}

#[test]
fn ply_of_triangles_is_read_in_parallel_and_in_place() {
    let folder = folder();
    let mut header = String::from(
        "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\n\
         property float y\nproperty float z\nelement face 2\nproperty uchar flags\n\
         property list uchar uint vertex_index\nproperty float quality\nend_header\n",
    );
    while !header.len().is_multiple_of(4) {
        header = header.replace("end_header", "comment\nend_header").replacen(
            "comment\n",
            "comment \n",
            1,
        );
        if header.len() > 600 {
            break;
        }
    }
    let mut file = header.into_bytes();
    SQUARE.as_flattened().iter().for_each(|x| file.extend(x.to_le_bytes()));
    for triangle in [[0_u32, 1, 2], [1, 3, 2]] {
        file.extend([7, 3]);
        triangle.iter().for_each(|i| file.extend(i.to_le_bytes()));
        file.extend(0.5_f32.to_le_bytes());
    }
    let import = load(&write(&folder, "t.ply", file));
    assert_eq!(&import.meshes[0].triangles[..], [[0, 1, 2], [1, 3, 2]]);
    assert_eq!(points(&import.meshes[0])[3], DVec3::new(1.0, 1.0, 0.0));
}

#[test]
fn ply_strips_are_cut_at_minus_one() {
    let folder = folder();
    let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\n\
        property double z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n\
        0 0 0\n1 0 0\n0 1 0\n1 1 0\n8 0 1 2 3 -1 2 1 0\n";
    let import = load(&write(&folder, "s.ply", text));
    assert_eq!(&import.meshes[0].triangles[..], [[0, 1, 2], [2, 1, 3], [2, 1, 0]]);
}

// --- all ----------------------------------------------------------------------------------------

#[test]
fn what_cannot_be_opened_is_named() {
    let folder = folder();
    let missing = error(&folder.path().join("none.glb"));
    assert!(missing.contains("none.glb") && missing.contains("cannot read"), "{missing}");
    assert!(error(&write(&folder, "a.fbx", "x")).contains("use .gltf, .glb, .obj or .ply"));
    std::fs::create_dir(folder.path().join("dir.obj")).unwrap();
    assert!(error(&folder.path().join("dir.obj")).contains("not a regular file"));
    assert!(error(&write(&folder, "empty.glb", "")).contains("empty.glb"));
}

/// A generator of which every platform gives the same numbers (Marsaglia, *Xorshift RNGs*, 2003).
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        usize::try_from(self.0 % n as u64).unwrap()
    }
}

/// Files with bytes changed, cut, doubled and swapped are read or refused; nothing panics.
/// `ETENDUE_MUTATIONS` asks for more of each than 600.
#[test]
fn damaged_files_never_panic() {
    let folder = folder();
    let quads = square_glb(
        json!({"indices": 1, "material": 0}),
        json!({
            "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
            "textures": [{"source": 0}], "images": [{"bufferView": 0}],
            "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}],
            "nodes": [{"children": [1, 2], "matrix": [1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]},
                      {"mesh": 0, "scale": [1, 2, 3], "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}}},
                      {"camera": 0}]
        }),
        |b| {
            b.u32s(&[0, 1, 2, 1, 3, 2]);
        },
    );
    let obj =
        b"mtllib m.mtl\no a b\nv 0 0 0 1 0 1\nv 1 0 0\nv 1 1.5e1 0\nv 0 1 0\nvt 0 1\nvn 0 0 1\n\
        usemtl x\nf 1/1/1 2/1/1 3/1/1 4/1/1\nf -1//1 -2//1 -3//1\ng c\nusemtl y\nf 1 2 3\nl 1 2\n"
            .to_vec();
    let mtl = b"newmtl x\nKd 0.5 1 2\nmap_Kd -s 1 2 3 a.png\nKs 1\nNs 3\nd 1\nillum 2\nnewmtl y\nKd 1 1 1\n".to_vec();
    let originals = [
        ("a.glb", quads),
        ("a.obj", obj.clone()),
        ("m.mtl", mtl.clone()),
        ("t.ply", ply_text()),
        ("l.ply", ply_binary(false)),
        ("b.ply", ply_binary(true)),
    ];
    write(&folder, "m.mtl", &mtl);
    write(&folder, "base.obj", &obj);
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let rounds = std::env::var("ETENDUE_MUTATIONS").map_or(600, |n| n.parse().unwrap());
    let mut outcomes = [0, 0];
    for (name, original) in &originals {
        for _ in 0..rounds {
            let mut bytes = original.clone();
            for _ in 0..=random.below(4) {
                mutate(&mut bytes, &mut random);
            }
            let path = write(&folder, name, &bytes);
            let model = if name.ends_with("mtl") { folder.path().join("base.obj") } else { path };
            for options in [Options::default(), strict()] {
                let outcome = import(&model, Wanted::EVERYTHING, &options);
                outcomes[usize::from(outcome.is_err())] += 1;
                if let Ok(import) = outcome {
                    check_promises(&import);
                }
            }
        }
        write(&folder, "m.mtl", &mtl);
    }
    println!("read {}, refused {}", outcomes[0], outcomes[1]);
    assert!(outcomes.iter().all(|&count| count > 500), "{outcomes:?}");
}

fn mutate(bytes: &mut Vec<u8>, random: &mut Random) {
    if bytes.is_empty() {
        return;
    }
    let at = random.below(bytes.len());
    match random.below(6) {
        0 => bytes.truncate(at),
        1 => bytes[at] ^= 1 << random.below(8),
        2 => bytes[at] = u8::try_from(random.below(256)).unwrap(),
        3 => bytes[at] = b"0123456789-+.eE/\\ \n\"[]{},:#"[random.below(27)],
        4 => {
            let end = (at + 1 + random.below(20)).min(bytes.len());
            let part = bytes[at..end].to_vec();
            bytes.splice(at..at, part);
        }
        _ => {
            let other = random.below(bytes.len());
            bytes.swap(at, other);
        }
    }
}

/// What other crates rely on without looking again.
fn check_promises(import: &Import) {
    for mesh in &import.meshes {
        for &corner in mesh.triangles.iter().flatten() {
            assert!((corner as usize) < mesh.positions.len());
            assert!(mesh.positions.get(corner as usize).is_finite());
        }
        let count = mesh.positions.len();
        assert!(mesh.normals.as_ref().is_none_or(|v| v.len() == count));
        assert!(mesh.colors.as_ref().is_none_or(|v| v.len() == count));
        assert!(mesh.uvs.iter().all(|v| v.len() == count));
    }
    for placement in &import.placements {
        assert!((placement.mesh as usize) < import.meshes.len());
        assert!((placement.material as usize) < import.materials.len());
        assert!(placement.model_from_mesh.is_finite());
    }
    for material in &import.materials {
        if let Paint::Image { image, .. } = &material.base_color {
            assert!((image.texture as usize) < import.textures.len());
        }
    }
}
