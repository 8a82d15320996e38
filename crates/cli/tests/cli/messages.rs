//! Messages on what is wrong with a file, in words that who wrote it knows: no types of Rust, no
//! bytes of another format, who refers to what is not there, and what is allowed instead.

use std::fmt::Write;

use crate::run::{Bench, text};

/// Words that no message may have.
const PRIVATE: [&str; 16] = [
    "usize",
    "u32",
    "u64",
    "f32",
    "f64",
    "struct ",
    "a map",
    "a sequence",
    "invalid type",
    "invalid value",
    "invalid length",
    "0b0",
    "child of root",
    "\\u{0}",
    "\u{fffd}",
    "missing field",
];

/// `etendue check` refuses the file `name` with all of `words` in one short message.
fn refused(name: &str, bytes: &[u8], words: &[&str]) {
    let bench = Bench::new();
    bench.write(name, bytes);
    let output = bench.run(&["check", name]);
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{name}: {message}");
    assert!(message.contains(name), "{message}");
    for word in words {
        assert!(message.contains(word), "expected `{word}` in: {message}");
    }
    for word in PRIVATE {
        assert!(!message.contains(word), "`{word}` in: {message}");
    }
    assert!(message.len() < 800 && message.lines().count() <= 4, "{message}");
    assert!(!message.chars().any(|c| c.is_control() && c != '\n'), "{message:?}");
}

fn glb(total: u32, chunk: u32, kind: &[u8; 4], json: &str) -> Vec<u8> {
    [&b"glTF\x02\0\0\0"[..], &total.to_le_bytes(), &chunk.to_le_bytes(), kind, json.as_bytes()]
        .concat()
}

#[test]
fn files_of_other_kinds_are_named() {
    let png = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR";
    for name in ["a.glb", "a.gltf", "a.obj", "a.ply", "a.json"] {
        refused(name, png, &["it is a PNG image", "not"][usize::from(name == "a.json")..]);
        refused(name, b"PK\x03\x04rest", &["a ZIP archive"]);
        refused(name, &[0; 5000], &["nothing but zeros"]);
        refused(name, b"<!DOCTYPE html><p>404</p>", &["a web page"]);
    }
    refused(
        "c.stl",
        b"solid cube\nfacet normal 0 0 1\n",
        &["text that is no JSON", ".obj or .ply"],
    );
    refused("b.gltf", b"ply\nformat ascii 1.0\n", &["a PLY model, not glTF"]);
    refused("b.obj", b"glTF\x02\0\0\0", &["a binary glTF file (.glb), not an OBJ model"]);
    refused("b.json", b"glTF\x02\0\0\0", &["a binary glTF file (.glb), not JSON text"]);
    refused("c.gltf", b"hello", &["line 1, column 1", "a value should stand here", "hello"]);
}

#[test]
fn broken_containers_say_which_length_is_wrong() {
    refused("header.glb", &glb(12, 0, b"JSON", "{}"), &["ends before its first chunk"]);
    refused("kind.glb", &glb(22, 2, b"BIN\0", "{}"), &["first chunk is of kind \"BIN", "not JSON"]);
    refused("long.glb", &glb(22, 200, b"JSON", "{}"), &["byte 12", "200 bytes", "only 2 follow"]);
    let json = r#"{"asset": {"version": "2.0"}}   "#;
    let total = 20 + u32::try_from(json.len()).expect("a short text");
    refused("cut.glb", &glb(32, 12, b"JSON", &json[..12]), &["JSON chunk ends after 12 bytes"]);
    // What follows a chunk that is said to be too short is taken for the next one's length.
    refused(
        "short.glb",
        &glb(total, 12, b"JSON", json),
        &["byte 32", "or that of the chunk before"],
    );
    let two = [json, "\x08\0\0\0BIN\0"].concat();
    refused("more.glb", &glb(total + 8, 36, b"JSON", &two), &["JSON chunk of 36 bytes is damaged"]);
}

/// A glTF document that `rest` goes on.
fn gltf(rest: &str) -> Vec<u8> {
    format!(r#"{{"asset": {{"version": "2.0"}}, {rest}}}"#).into_bytes()
}

#[test]
fn values_of_the_wrong_kind_are_told_in_words_of_json() {
    let cases: [(&str, &[&str]); 13] = [
        (
            r#""nodes": [{"rotation": {}}]"#,
            &["nodes[0].rotation: expected an array of 4 values, found an object"],
        ),
        (
            r#""nodes": [{"mesh": -1}]"#,
            &["nodes[0].mesh: expected a whole number from 0, found -1"],
        ),
        (r#""nodes": [{"mesh": 1.5}]"#, &["found 1.5"]),
        (r#""nodes": {}"#, &["nodes: expected an array, found an object"]),
        (r#""nodes": [[1]]"#, &["nodes[0]: expected an object, found an array"]),
        (r#""nodes": [{"rotation": [1, 2]}]"#, &["expected an array of 4 values, found 2 values"]),
        (r#""accessors": [{}]"#, &["accessors[0]: the key `count` is missing"]),
        (
            r#""accessors": [{"count": 1, "type": "VEC3", "componentType": "f"}]"#,
            &["accessors[0].componentType: expected one of 5120, 5121", "found \"f\""],
        ),
        (
            r#""materials": [{"pbrMetallicRoughness": [{}]}]"#,
            &["materials[0].pbrMetallicRoughness: expected an object, found an array"],
        ),
        (
            r#""meshes": [{"primitives": [{"attributes": {"POSITION": "x"}}]}]"#,
            &["meshes[0].primitives[0].attributes.POSITION: expected a whole number from 0"],
        ),
        (
            r#""extensions": {"KHR_lights_punctual": {"lights": [{"type": 1}]}},
               "nodes": [{"extensions": {"KHR_lights_punctual": {"light": 0}}}]"#,
            &["extensions.KHR_lights_punctual.lights[0].type: expected a string, found 1"],
        ),
        (
            r#""extensions": {"KHR_lights_punctual": {"lights": [{"type": "spot", "spot": []}]}},
               "nodes": [{"extensions": {"KHR_lights_punctual": {"light": 2}}}]"#,
            &["nodes[0].extensions.KHR_lights_punctual.light: there is no light 2", "has 1"],
        ),
        (r#""cameras": [{"perspective": {}}]"#, &["cameras[0].perspective: the key `yfov`"]),
    ];
    for (rest, words) in cases {
        refused("m.gltf", &gltf(rest), words);
    }
}

#[test]
fn references_to_nothing_say_who_refers() {
    let mesh = r#""meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 3}]}]"#;
    let accessor = |view: u32| {
        format!(
            r#""accessors": [{{"bufferView": {view}, "componentType": 5126, "type": "VEC3",
               "count": 3}}], "bufferViews": [{{"buffer": 0, "byteLength": 36}},
               {{"buffer": 7, "byteLength": 36}}], "buffers": [{{"byteLength": 36,
               "uri": "data:,%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00%00"}}]"#
        )
    };
    let nodes = r#""nodes": [{"mesh": 0}]"#;
    let shown = |rest: &str| gltf(&format!("{nodes}, {rest}"));
    let cases: [(Vec<u8>, &[&str]); 8] = [
        (shown(r#""meshes": []"#), &["nodes[0].mesh: there is no mesh 0; the file has 0"]),
        (shown(mesh), &["POSITION (accessor 0): there is no accessor 0"]),
        (
            shown(&format!("{mesh}, {}", accessor(5))),
            &["primitives[0], POSITION (accessor 0)", "no buffer view 5; the file has 2"],
        ),
        (
            shown(&format!("{mesh}, {}", accessor(1))),
            &["bufferViews[1].buffer: there is no buffer 7; the file has 1"],
        ),
        (
            shown(&format!("{mesh}, {}", accessor(0))),
            &["meshes[0].primitives[0].material: there is no material 3; the file has 0"],
        ),
        (gltf(r#""scene": 4, "scenes": [{}]"#), &["scene: there is no scene 4; the file has 1"]),
        (
            gltf(r#""scenes": [{"nodes": [0, 2]}], "nodes": [{}]"#),
            &["scenes[0].nodes[1]: there is no node 2; the file has 1"],
        ),
        (gltf(r#""nodes": [{"camera": 1}]"#), &["nodes[0].camera: there is no camera 1"]),
    ];
    for (bytes, words) in cases {
        refused("m.gltf", &bytes, words);
    }
    let textured = gltf(r#""materials": [{"name": "skin", "normalTexture": {"index": 2}}]"#);
    let bench = Bench::new();
    bench.write("m.gltf", &textured);
    let output = bench.run(&["check", "m.gltf"]);
    let message = text(&output.stderr);
    assert!(
        message.contains("material \"skin\".normalTexture: there is no texture 2"),
        "{message}"
    );
}

#[test]
fn data_uris_that_are_cut_off_say_so() {
    for (data, words) in [
        ("AAAAA==", "character 6 is '='"),
        ("AAAAA", "no whole number of bytes"),
        ("AAB=", "character 3, the last, cannot end it"),
        ("AA*A", "character 3 is '*'"),
    ] {
        let rest = format!(
            r#""buffers": [{{"uri": "data:application/octet-stream;base64,{data}",
               "byteLength": 2}}], "bufferViews": [{{"buffer": 0, "byteLength": 2}}]"#
        );
        refused("m.gltf", &gltf(&rest), &["buffers[0].uri", "not sound base64", words]);
    }
}

#[test]
fn scenes_say_what_is_allowed() {
    let cases: [(&str, &[&str]); 16] = [
        (r#"{"etendue": 1.0}"#, &["etendue: 1.0 is not 1\nhint: write it without a point"]),
        (r#"{"etendue": "1"}"#, &["etendue: \"1\" is not 1\nhint: write it without quotes"]),
        (r#"{"etendue": 2}"#, &["etendue: 2 is not 1\nhint: 1 is all that this version reads"]),
        (r#"{}"#, &["the key `etendue` is missing", "give it 1"]),
        (
            r#"{"etendue": 1, "objects": [{"sahpe": "box"}]}"#,
            &[
                "column 29",
                "objects[0].sahpe: unknown key\nhint: did you mean `shape`?",
                "`sphere`",
            ],
        ),
        (
            r#"{"etendue": 1, "lights": [{"tpye": "point"}]}"#,
            &["lights[0].tpye: unknown key\nhint: did you mean `type`?", "`environment`"],
        ),
        (
            r#"{"etendue": 1, "materials": {"a": {"colour": [1, 1, 1]}}}"#,
            &[
                "materials.a.colour: unknown key\nhint: did you mean `color`?",
                "give the object `type`",
            ],
        ),
        (
            r#"{"etendue": 1, "camera": {"fov": 60}}"#,
            &["camera: says not what it is\nhint: give it `type` (one of `pinhole`"],
        ),
        (
            r#"{"etendue": 1, "objects": [{"file": "a.glb", "shape": "box"}]}"#,
            &["objects[0].file: `file` does not go with `box`", "known: ", "`size`"],
        ),
        (
            r#"{"etendue": 1, "lights": [{"type": "point"}]}"#,
            &["lights[0]: the key `at` is missing", "give it an array of 3 "],
        ),
        (
            r#"{"etendue": 1, "camera": {"type": "pinhole", "pose": {"from": [0, 0, 1]}}}"#,
            &["camera.pose: the key `look_at` is missing", "give it an array of 3 "],
        ),
        (
            r#"{"etendue": 1, "camera": {"type": "pinhole", "intrinsics": {"fx": 1, "fy": 1,
                "cx": 0, "cy": 0}}}"#,
            &["the key `pixel_origin` is missing", "one of `"],
        ),
        (
            r#"{"etendue": 1, "render": {"seed": 7.0}}"#,
            &["render.seed: expected a whole number, found 7.0\nhint: write it without a point"],
        ),
        (r#"{"etendue": 1"#, &["the text ends inside an object (EOF)"]),
        (r#"{"etendue": 1, "camera": }"#, &["a value should stand here"]),
        (r#"{"etendue": 1, camera: {}}"#, &["a key in double quotes should stand here"]),
    ];
    for (scene, words) in cases {
        refused("s.json", scene.as_bytes(), words);
    }
}

#[test]
fn names_of_files_send_nothing_to_the_terminal() {
    let escape = "a\\u001b[31mb\\u0007\\u009b2J";
    let rest = format!(
        r#""nodes": [{{"mesh": 0}}], "meshes": [{{"name": "{escape}", "primitives":
           [{{"attributes": {{"POSITION": 4}}}}]}}]"#
    );
    refused("m.gltf", &gltf(&rest), &["a\\u{1b}[31mb", "no accessor 4"]);
    refused("m.obj", b"v 0 0 \x1b[31mx\nf 1 1 1\n", &["line 1"]);
    refused("s.json", b"{\"etendue\": 1, \"\\u001b[2J\": 1}", &["unknown key"]);
    refused("s.json", b"{\"etendue\": 1, \"camera\": \"\x1b[2J\"}", &["line 1"]);
}

/// A refusal, whole: the place from the outside in, why, and the remedy on a line of its own.
#[test]
fn refusals_are_whole() {
    let bench = Bench::with_scene(
        r#"{"etendue": 1, "camera": {"type": "pinhole"}, "objects": [{"shape": "box"}]}"#,
    );
    let scenes = [
        ("comma.json", r#"{"etendue": 1 "camera": {"type": "pinhole"}}"#),
        ("key.json", r#"{"etendue": 1, "camera": {"type": "pinhole", "fvo": 30}}"#),
        ("kind.json", r#"{"etendue": 1, "camera": {"fov": 30}}"#),
        ("word.json", r#"{"etendue": 1, "camera": {"type": "pinhol"}}"#),
        (
            "material.json",
            r#"{"etendue": 1, "objects": [{"shape": "box", "material": "cley"}], "materials": {"clay": {"type": "matte", "color": [1, 1, 1]}}, "camera": {"type": "pinhole"}}"#,
        ),
        (
            "file.json",
            r#"{"etendue": 1, "camera": {"type": "pinhole"}, "objects": [{"file": "nodel.obj"}]}"#,
        ),
        (
            "outside.json",
            r#"{"etendue": 1, "camera": {"type": "pinhole"}, "objects": [{"file": "../model.obj"}]}"#,
        ),
        (
            "text.json",
            r#"{"etendue": 1, "camera": {"type": "pinhole"}, "objects": [{"file": "text.obj"}]}"#,
        ),
        (
            "unit.json",
            r#"{"etendue": 1, "camera": {"type": "thin_lens", "focal_length": "50", "f_number": 2, "fov": 30}}"#,
        ),
        (
            "opening.json",
            r#"{"etendue": 1, "camera": {"type": "thin_lens", "focal_length": "50 mm", "fov": 30}}"#,
        ),
        ("twice.json", r#"{"etendue": 1, "etendue": 1}"#),
        (
            "frames.json",
            r#"{"etendue": 1, "camera": {"type": "pinhole"}, "frames": [{"camera.fvo": 3}]}"#,
        ),
    ];
    for (name, scene) in scenes {
        bench.write(name, scene.as_bytes());
    }
    bench.write("solid.stl", b"solid cube");
    bench.write("model.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    bench.write("text.obj", b"v 0 0 0\nf 1 2 3\n");
    let extensions = r#""extensionsRequired": ["EXT_none", "KHR_texture_basisu"]"#;
    bench.write("extensions.gltf", &gltf(extensions));
    let mut commands: Vec<Vec<&str>> =
        scenes.iter().map(|(name, _)| vec!["check", *name]).collect();
    commands.extend([
        vec!["check", "scnee.json"],
        vec!["check", "solid.stl"],
        vec!["check", "extensions.gltf"],
        vec!["check", "scene.json", "--set", "objects[9].shape=box"],
        vec!["check", "scene.json", "--set", "camera..fov=3"],
        vec!["check", "scene.json", "--set", "camera.fov=300"],
        vec!["check", "model.obj", "--camera", "nobody"],
        vec!["lens", "scene.json"],
        vec!["lens", "solid.stl"],
        vec!["merge", "out", "model.obj"],
        vec!["render", "scene.json", "--shard", "9/8"],
        vec!["render", "scene.json", "-o", "out", "--report", "scene.json"],
    ]);
    let folder = bench.path("").canonicalize().expect("the folder").display().to_string();
    let mut all = String::new();
    for arguments in &commands {
        let output = bench.run(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", text(&output.stderr));
        let said = text(&output.stderr).replace(&folder, "FOLDER");
        writeln!(all, "$ etendue {}\n{said}", arguments.join(" ")).expect("a string");
    }
    insta::assert_snapshot!(all);
}
