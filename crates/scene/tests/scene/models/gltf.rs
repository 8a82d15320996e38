//! glTF as its writers mean it.

use std::fmt::Write as _;

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Positions, Transform};
use etendue_scene::import::{CameraProjection, NoteKind, Wanted};
use etendue_tracer::texture::{Filter, Wrap};
use etendue_tracer::{Absorption, Glass, ImageSource, Ior, Paint, Scattering};
use serde_json::{Value, json};

use super::build::{Builder, SQUARE, square_glb};
use super::{folder, import_strict, import_with, load, points, super_import, write};

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
    assert_eq!(eye.projection, CameraProjection::Perspective { yfov: 0.7, aspect_ratio });
    assert_eq!((eye.name.as_str(), eye.model_from_camera.translation.z), ("eye", 3.0));
    assert_eq!(plan.projection, CameraProjection::Orthographic { xmag: 2.0, ymag: 1.0 });
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
    let Paint::Image { factor, image, .. } = &material.base_color else { panic!("{material:?}") };
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
    let missing = import.materials[1].base_color.image().expect("an image that stands in");
    let source = &import.textures[missing.texture as usize].source;
    assert!(matches!(source, ImageSource::Missing), "{source:?}");
    assert!(
        import.notes.iter().any(|n| n.kind == NoteKind::MissingFile && n.subject == "missing.png")
    );
    let plain = import_with(&folder, "material.glb", Wanted::NOTHING);
    assert_eq!(plain.materials[0].base_color, Paint::Plain([0.25, 0.5, 0.75]));
    assert!(plain.textures.is_empty());
}

/// A material that is clear all over and has a thickness is a body of glass; one that is partly clear is a thin wall.
#[test]
fn volumes_are_bodies_of_glass() {
    let folder = folder();
    let material = |transmission: f64, volume: Value| {
        json!({"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.25},
            "extensions": {"KHR_materials_transmission": {"transmissionFactor": transmission},
                "KHR_materials_ior": {"ior": 1.4}, "KHR_materials_volume": volume}})
    };
    let blue = json!({"thicknessFactor": 0.1, "attenuationDistance": 0.02,
        "attenuationColor": [0.1, 0.2, 0.9]});
    let rest = json!({
        "extensionsUsed": ["KHR_materials_transmission", "KHR_materials_ior", "KHR_materials_volume"],
        "materials": [material(1.0, blue.clone()), material(1.0, json!({"thicknessFactor": 1})),
            material(1.0, json!({"attenuationDistance": 1})), material(0.5, blue)]
    });
    let path = write(&folder, "volume.glb", square_glb(json!({"material": 0}), rest, |_| ()));
    let materials = load(&path).materials;
    let glass = |absorption| Glass { ior: Ior::Constant(1.4), roughness: 0.25, absorption };
    let absorption = Absorption { color: [0.1, 0.2, 0.9], curve: None, distance: 0.02 };
    assert_eq!(materials[0].scattering, Scattering::Dielectric(glass(Some(absorption))));
    assert_eq!(materials[1].scattering, Scattering::Dielectric(glass(None)));
    for thin in &materials[2..4] {
        assert!(matches!(thin.scattering, Scattering::Gltf(_)), "{thin:?}");
    }
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
    assert_eq!((import.stats.dropped, import.meshes[0].degenerate), (2, 1));
    assert_eq!(import.meshes[0].bounds.max, DVec3::new(1.0, 1.0, 0.0));
    let note = import.notes.iter().find(|note| note.kind == NoteKind::NotFinite).unwrap();
    assert_eq!(note.count, 2);
    let refused = import_strict(&path).unwrap_err().to_string();
    assert!(refused.contains("2 triangles with a corner that is not a finite number"), "{refused}");
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

#[test]
fn a_byte_order_mark_is_passed_over() {
    let folder = folder();
    let text = "\u{feff}{\"asset\": {\"version\": \"2.0\"}}";
    assert!(load(&write(&folder, "a.gltf", text)).meshes.is_empty());
}

#[test]
fn hidden_nodes_hide_all_below_them() {
    let folder = folder();
    let hidden = json!({"KHR_node_visibility": {"visible": false}});
    let nodes = json!([
        {"extensions": hidden, "children": [1]},
        {"mesh": 0, "camera": 0, "extensions": {"KHR_node_visibility": {"visible": true}}},
        {"mesh": 0, "name": "seen", "extensions": {"KHR_node_visibility": {}}},
    ]);
    let rest = json!({
        "nodes": nodes, "extensionsRequired": ["KHR_node_visibility"],
        "cameras": [{"perspective": {"yfov": 1}}]
    });
    let import = load(&write(&folder, "hidden.glb", square_glb(json!({}), rest, |_| {})));
    let names: Vec<&str> = import.placements.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["seen"]);
    assert_eq!(import.cameras.len(), 1, "cameras have nothing to show");
}
