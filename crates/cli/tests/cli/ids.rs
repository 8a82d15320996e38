//! Numbers of objects, copies, nodes and materials, and what they are called.

use std::collections::BTreeSet;

use serde_json::{Value, json};

use crate::run::{Bench, text};

/// A box, three spheres of `instances`, and a model of three nodes of which two share a mesh.
fn scene() -> Bench {
    let move_by = |x: f64, y: f64| json!({"translate": [x, y, 0]});
    let scene = json!({
        "etendue": 1,
        "camera": {"type": "pinhole", "fov": 40, "pose": {"from": [0, 0, 16], "look_at": [0, 0, 0]},
                   "sensor": {"resolution": [96, 96]}},
        "layers": ["ids", "material_id", "coverage"],
        "objects": [
            {"shape": "box", "name": "crate", "transform": move_by(0.0, -3.0)},
            {"shape": "sphere", "radius": 0.8, "name": "ball", "material": "clay",
             "instances": [move_by(-3.0, 0.0), move_by(0.0, 0.0), move_by(3.0, 0.0)]},
            {"file": "m.gltf", "transform": move_by(0.0, 2.5)}],
        "materials": {"clay": {"type": "matte", "color": [0.8, 0.4, 0.3]}},
    });
    let bench = Bench::with_scene(&scene.to_string());
    bench.write("m.gltf", model().to_string().as_bytes());
    let corners: [[f32; 3]; 3] = [[-0.8, -0.8, 0.0], [0.8, -0.8, 0.0], [0.0, 0.8, 0.0]];
    let bytes: Vec<u8> = corners.as_flattened().iter().flat_map(|c| c.to_le_bytes()).collect();
    bench.write("m.bin", &bytes);
    bench
}

fn model() -> Value {
    let primitive = json!({"attributes": {"POSITION": 0}});
    json!({
        "asset": {"version": "2.0"},
        "buffers": [{"uri": "m.bin", "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                       "min": [-0.8, -0.8, 0], "max": [0.8, 0.8, 0]}],
        "meshes": [{"primitives": [primitive]}, {"primitives": [primitive]}],
        "nodes": [{"name": "left", "mesh": 0, "translation": [-3, 0, 0]},
                  {"name": "middle", "mesh": 0}, {"name": "right", "mesh": 1,
                  "translation": [3, 0, 0]}],
        "scenes": [{"nodes": [0, 1, 2]}],
    })
}

#[expect(clippy::cast_possible_truncation, reason = "ids are whole numbers below 2³²")]
fn distinct(values: &[f64]) -> Vec<u32> {
    let set: BTreeSet<u32> = values.iter().map(|v| *v as u32).collect();
    set.into_iter().collect()
}

/// The table of names of a layer in `layers.json`, as `id name` and the object where it has one.
fn table(bench: &Bench, layer: &str) -> Vec<String> {
    let json = bench.json("out/layers.json");
    let layers = json["layers"].as_array().expect("layers");
    let found = layers.iter().find(|l| l["name"] == layer).expect("the layer");
    let entry = |e: &Value| {
        let object = e.get("object").map(|o| format!(" of {o}")).unwrap_or_default();
        format!("{} {}{object}", e["id"], e["name"].as_str().expect("a name"))
    };
    found["names"].as_array().expect("a table").iter().map(entry).collect()
}

#[test]
fn objects_copies_and_nodes_have_numbers_of_their_own() {
    let bench = scene();
    bench.render(&[]);
    assert_eq!(distinct(&bench.array("id_object")), [0, 1, 2, 3]);
    assert_eq!(distinct(&bench.array("id_instance")), [0, 1, 2, 3, 4, 5], "three balls apart");
    assert_eq!(distinct(&bench.array("id_node")), [0, 1, 2, 3, 4, 5], "three nodes apart");
    assert_eq!(table(&bench, "Id.object"), ["1 crate", "2 ball", "3 m.gltf"]);
    assert_eq!(
        table(&bench, "Id.instance"),
        ["1 crate of 1", "2 ball[0] of 2", "3 ball[1] of 2", "4 ball[2] of 2", "5 m.gltf of 3"]
    );
    assert_eq!(
        table(&bench, "Id.node"),
        ["1 crate of 1", "2 ball of 2", "3 left of 3", "4 middle of 3", "5 right of 3"]
    );
    // Left of the picture's middle row is the first ball: object 2, copy 2.
    let at = |layer: &str, x: usize, y: usize| bench.array(layer)[y * 96 + x];
    assert_eq!((at("id_object", 23, 48), at("id_instance", 23, 48)), (2.0, 2.0));
    assert_eq!((at("id_object", 72, 48), at("id_instance", 72, 48)), (2.0, 4.0));
    // Each number stands for nothing exactly where nothing is hit.
    for layer in ["id_object", "id_instance", "id_node", "id_primitive", "material_id"] {
        let ids = bench.array(layer);
        let hit = bench.array("coverage");
        assert!(ids.iter().zip(&hit).all(|(id, hit)| (*id > 0.0) == (*hit > 0.0)), "{layer}");
    }
}

#[test]
fn check_and_layers_agree_on_numbers_and_names() {
    let bench = scene();
    bench.render(&[]);
    let output = bench.run(&["check", "scene.json", "--json"]);
    let found: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let layers = bench.json("out/layers.json");
    let names = |layer: &str| {
        let all = layers["layers"].as_array().expect("layers");
        all.iter().find(|l| l["name"] == layer).expect("the layer")["names"].clone()
    };
    assert_eq!(found["instances"], names("Id.instance"));
    assert_eq!(found["nodes"], names("Id.node"));
    let objects: Vec<Value> = found["objects"].as_array().expect("objects").clone();
    let objects: Vec<Value> =
        objects.iter().map(|o| json!({"id": o["id"], "name": o["name"]})).collect();
    assert_eq!(Value::from(objects), names("Id.object"));
    let table = text(&bench.run(&["check", "scene.json"]).stdout);
    assert!(table.contains("objects       1 \"crate\""), "{table}");
}

#[test]
fn masks_are_the_numbers_in_sixteen_bits() {
    let bench = scene();
    bench.render(&[]);
    for layer in ["id_object", "id_instance", "id_node", "material_id"] {
        let file = std::fs::File::open(bench.path(&format!("out/{layer}.png"))).expect("a mask");
        let decoder = png::Decoder::new(std::io::BufReader::new(file));
        let mut reader = decoder.read_info().expect("a PNG");
        let info = reader.info();
        assert_eq!(
            (info.bit_depth, info.color_type),
            (png::BitDepth::Sixteen, png::ColorType::Grayscale)
        );
        let mut bytes = vec![0; 96 * 96 * 2];
        reader.next_frame(&mut bytes).expect("an image");
        let mask: Vec<f64> =
            bytes.as_chunks().0.iter().map(|&b| f64::from(u16::from_be_bytes(b))).collect();
        assert_eq!(mask, bench.array(layer), "{layer}");
    }
    assert!(!bench.path("out/id_primitive.png").exists(), "triangles are no masks");
}

/// A palette has 256 colours: a file that cannot be is told, and no other that was not asked for.
#[test]
fn numbers_that_no_file_holds_are_told_for_the_files_that_are_wanted() {
    let copies: Vec<Value> =
        (0..300).map(|i| json!({"translate": [0.01 * f64::from(i), 0, 0]})).collect();
    let scene = json!({ "etendue": 1, "layers": ["ids"], "camera": {"type": "pinhole", "sensor": {"resolution": [64, 8]}},
        "objects": [{"shape": "box", "size": [0.01, 1, 0.01], "instances": copies}] });
    let bench = Bench::with_scene(&scene.to_string());
    for (outputs, is_told) in [("indexed", true), ("png", false), ("npy", false)] {
        let output = bench.run(&["render", "scene.json", "-o", outputs, "--outputs", outputs]);
        let said = text(&output.stderr);
        assert!(output.status.success(), "{said}");
        assert_eq!(said.contains("more than a palette has colours"), is_told, "{outputs}: {said}");
        assert!(!said.contains("16-bit PNG"), "{outputs}: {said}");
    }
}

/// Blender groups the channels of a file by all but the last part of their names, which it takes for
/// one letter: `Id.object` and `Id.node` would be one pass of two channels X, which it drops.
#[test]
fn every_kind_of_id_is_a_pass_of_its_own_in_an_exr() {
    let bench = scene();
    bench.render(&["--outputs", "exr"]);
    let head = std::fs::read(bench.path("out/layers.exr")).expect("an EXR");
    let head = text(&head[..head.len().min(1 << 14)]);
    for name in ["Id.object.X", "Id.instance.X", "Id.node.X", "Id.primitive.X", "MaterialId.X"] {
        assert!(head.contains(&format!("{name}\0")), "{name} is a channel");
    }
    assert!(head.contains("etendue:names:Id.instance"), "names stand in the header too");
}

#[test]
fn a_model_alone_has_an_object_for_each_node() {
    let bench = scene();
    let output = bench.run(&["render", "m.gltf", "-o", "out", "--layers", "ids", "--quiet"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_eq!(table(&bench, "Id.object"), ["1 left", "2 middle", "3 right"]);
    assert_eq!(table(&bench, "Id.node"), ["1 left of 1", "2 middle of 2", "3 right of 3"]);
    assert_eq!(table(&bench, "Id.instance"), ["1 left of 1", "2 middle of 2", "3 right of 3"]);
}

#[test]
fn instances_of_a_gltf_file_are_copies_of_their_node() {
    let bench = scene();
    let mut model = model();
    model["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
    model["buffers"][0]["byteLength"] = json!(60);
    model["bufferViews"] = json!([{"buffer": 0, "byteLength": 36},
        {"buffer": 0, "byteOffset": 36, "byteLength": 24}]);
    let accessors = model["accessors"].as_array_mut().expect("accessors");
    accessors.push(json!({"bufferView": 1, "componentType": 5126, "count": 2, "type": "VEC3"}));
    model["nodes"][1]["extensions"] =
        json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 1}}});
    let mut bytes = std::fs::read(bench.path("m.bin")).expect("the buffer");
    for number in [0.0_f32, 0.0, 0.0, 0.0, 1.7, 0.0] {
        bytes.extend(number.to_le_bytes());
    }
    bench.write("m.bin", &bytes);
    bench.write("m.gltf", model.to_string().as_bytes());
    bench.render(&[]);
    assert_eq!(
        table(&bench, "Id.instance")[4..],
        ["5 m.gltf of 3", "6 middle[0] of 3", "7 middle[1] of 3"]
    );
    assert_eq!(distinct(&bench.array("id_instance")), [0, 1, 2, 3, 4, 5, 6, 7]);
    assert_eq!(distinct(&bench.array("id_node")), [0, 1, 2, 3, 4, 5]);
}
