//! Broken glTF is refused with its place.

use etendue_scene::import::{Options, Wanted, import};
use serde_json::{Value, json};

use super::build::{Builder, SQUARE, glb, square_glb};
use super::{error, folder, import_with, load, refused, write};

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
    old[4] = 3;
    refused("new.glb", old.clone(), &["version 3 instead of 2"]);
    old[4] = 1;
    refused("old.glb", old, &["glTF 1.0"]);
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
    refused(
        "missing.glb",
        nodes(json!([{"children": [7]}])),
        &["nodes[0].children[0]", "no node 7", "has 1"],
    );
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
        &["POSITION (accessor 0)", "no buffer view 9"],
    );
    refused(
        "zeros.glb",
        broken(&|d| {
            d["accessors"][0] =
                json!({"componentType": 5126, "type": "VEC3", "count": 4_000_000_000_u32});
        }),
        &["of memory and has"],
    );
    refused(
        "length.glb",
        broken(&|d| d["buffers"][0]["byteLength"] = json!(64)),
        &["buffers[0]", "64 bytes", "cut off after 48"],
    );
    refused("stride.glb", broken(&|d| d["bufferViews"][0]["byteStride"] = json!(4)), &["overlap"]);
}

#[test]
fn the_first_version_of_gltf_is_named() {
    let first = ["asset.version", "glTF 1.0", "npx gltf-pipeline"];
    for text in [
        r#"{"asset": {"version": 1}}"#,
        r#"{"asset": {"version": 1.0}}"#,
        r#"{"asset": {"version": "1.0"}}"#,
        r#"{"asset": {"version": "1.1"}}"#,
        r#"{"nodes": {"node_1": {"meshes": ["m"]}}, "meshes": {"m": {}}}"#,
    ] {
        refused("old.gltf", text.into(), &first);
    }
    refused("two.gltf", r#"{"asset": {"version": 2}}"#.into(), &["asset.version", "\"2.0\""]);
    refused("none.gltf", "{}".into(), &["asset.version", "missing"]);
    refused("old.glb", b"glTF\x01\0\0\0\x20\0\0\0".into(), &["GLB header", "glTF 1.0"]);
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
    let basis = json!({
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"extensions": {"KHR_texture_basisu": {"source": 0}}}],
        "images": [{"uri": "a.ktx2"}], "extensionsUsed": ["KHR_texture_basisu"]
    });
    let path = write(&folder, "ktx.glb", with(basis, json!({"material": 0})));
    assert!(error(&path).contains("KHR_texture_basisu"));
    let bare = import_with(&folder, "ktx.glb", Wanted::NOTHING);
    assert!(bare.notes.iter().any(|note| note.subject == "KHR_texture_basisu"), "{:?}", bare.notes);
    let film = json!({"extensionsRequired": ["KHR_materials_iridescence"]});
    let path = write(&folder, "film.glb", with(film, json!({})));
    assert!(error(&path).contains("needs KHR_materials_iridescence"), "{}", error(&path));
    let bare = import_with(&folder, "film.glb", Wanted::NOTHING);
    assert_eq!(bare.notes[0].subject, "KHR_materials_iridescence", "depth needs no film");
    let used = json!({"extensionsUsed": ["KHR_materials_iridescence", "ACME_teapot"]});
    let notes = load(&write(&folder, "used.glb", with(used, json!({})))).notes;
    let subjects: Vec<&str> = notes.iter().map(|note| note.subject.as_str()).collect();
    assert_eq!(subjects[..2], ["KHR_materials_iridescence", "ACME_teapot"]);
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
        assert!(error.why().contains("leads out of the folder"), "{uri}: {error}");
        assert!(error.remedy().unwrap().contains("--allow-outside"), "{uri}: {error}");
    }
    std::fs::write(&path, document("../secret.bin")).unwrap();
    let wider = Options { root: Some(folder.path().to_owned()), ..Options::default() };
    assert!(import(&path, Wanted::NOTHING, &wider).is_ok());
    assert!(import(&path, Wanted::NOTHING, &Options::default()).is_ok());
    std::fs::write(&path, document("none.bin")).unwrap();
    let missing = import(&path, Wanted::NOTHING, &options).unwrap_err().to_string();
    assert!(missing.contains("\"none.bin\" does not exist"), "{missing}");
}
