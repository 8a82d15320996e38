//! Messages on what is wrong with a file, in words that who wrote it knows: no types of Rust, no
//! bytes of another format, who refers to what is not there, and what is allowed instead.

use std::fmt::Write;

use crate::run::{Bench, under};

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

/// `etendue check` refuses the file `name` in one short message, which stands below `heading` for a snapshot.
fn refused(heading: &str, name: &str, bytes: &[u8]) -> String {
    let bench = Bench::new();
    bench.write(name, bytes);
    let message = bench.refusal(&["check", name]);
    assert!(message.contains(name), "{message}");
    for word in PRIVATE {
        assert!(!message.contains(word), "`{word}` in: {message}");
    }
    assert!(message.len() < 800 && message.lines().count() <= 4, "{message}");
    assert!(!message.chars().any(|c| c.is_control() && c != '\n'), "{message:?}");
    under(heading, &message)
}

fn glb(total: u32, chunk: u32, kind: &[u8; 4], json: &str) -> Vec<u8> {
    [&b"glTF\x02\0\0\0"[..], &total.to_le_bytes(), &chunk.to_le_bytes(), kind, json.as_bytes()]
        .concat()
}

#[test]
fn files_of_other_kinds_are_named() {
    let kinds: [(&str, &[u8]); 4] = [
        ("a PNG image", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"),
        ("a ZIP archive", b"PK\x03\x04rest"),
        ("zeros", &[0; 5000]),
        ("a web page", b"<!DOCTYPE html><p>404</p>"),
    ];
    let mut all = String::new();
    for name in ["a.glb", "a.gltf", "a.obj", "a.ply", "a.json"] {
        for (kind, bytes) in kinds {
            all += &refused(&format!("{kind} as {name}"), name, bytes);
        }
    }
    let others: [(&str, &str, &[u8]); 5] = [
        ("STL", "c.stl", b"solid cube\nfacet normal 0 0 1\n"),
        ("PLY", "b.gltf", b"ply\nformat ascii 1.0\n"),
        ("GLB", "b.obj", b"glTF\x02\0\0\0"),
        ("GLB", "b.json", b"glTF\x02\0\0\0"),
        ("a word", "c.gltf", b"hello"),
    ];
    for (kind, name, bytes) in others {
        all += &refused(&format!("{kind} as {name}"), name, bytes);
    }
    insta::assert_snapshot!(all);
}

#[test]
fn broken_containers_say_which_length_is_wrong() {
    let json = r#"{"asset": {"version": "2.0"}}   "#;
    let total = 20 + u32::try_from(json.len()).expect("a short text");
    let two = [json, "\x08\0\0\0BIN\0"].concat();
    let cases = [
        ("header.glb", glb(12, 0, b"JSON", "{}")),
        ("kind.glb", glb(22, 2, b"BIN\0", "{}")),
        ("long.glb", glb(22, 200, b"JSON", "{}")),
        ("cut.glb", glb(32, 12, b"JSON", &json[..12])),
        // What follows a chunk that is said to be too short is taken for the next one's length.
        ("short.glb", glb(total, 12, b"JSON", json)),
        ("more.glb", glb(total + 8, 36, b"JSON", &two)),
    ];
    insta::assert_snapshot!(cases.map(|(name, bytes)| refused(name, name, &bytes)).concat());
}

/// A lens file that a scene names is refused as one that `etendue lens` reads is: with its place, in words of JSON.
#[test]
fn a_lens_file_that_a_scene_names_says_where_it_is_wrong() {
    let surface = |keys: &str| {
        format!(
            "{{\n  \"elements\": [\n    {{\"type\": \"surface\", {keys}}},\n    {{\"type\": \"surface\"}}\n  ]\n}}"
        )
    };
    let scene = r#"{"etendue": 1, "camera": {"type": "lens", "lens": "l.json", "focus_distance": 2},
                    "objects": []}"#;
    let cases = [
        surface(r#""radios": 50"#),
        surface(r#""radius": "flat""#),
        surface(r#""radius": 50, "thickness": -1"#),
        surface(r#""glass": "N-BK77""#),
        surface(r#""radius": 50"#).replace('}', ""),
        surface(r#""filter": {"file": "none.csv"}"#),
        r#"{"elements": 3}"#.to_owned(),
        r#"{"surface_group": }"#.to_owned(),
    ];
    let messages = cases.map(|lens| {
        let bench = Bench::new();
        bench.write("l.json", lens.as_bytes());
        bench.write("s.json", scene.as_bytes());
        let message = bench.refusal(&["check", "s.json"]);
        for word in PRIVATE {
            assert!(!message.contains(word), "`{word}` in: {message}");
        }
        under(&lens, &message)
    });
    insta::assert_snapshot!(messages.concat());
}

/// A glTF document that `rest` goes on.
fn gltf(rest: &str) -> Vec<u8> {
    format!(r#"{{"asset": {{"version": "2.0"}}, {rest}}}"#).into_bytes()
}

#[test]
fn values_of_the_wrong_kind_are_told_in_words_of_json() {
    let cases = [
        r#""nodes": [{"rotation": {}}]"#,
        r#""nodes": [{"mesh": -1}]"#,
        r#""nodes": [{"mesh": 1.5}]"#,
        r#""nodes": {}"#,
        r#""nodes": [[1]]"#,
        r#""nodes": [{"rotation": [1, 2]}]"#,
        r#""accessors": [{}]"#,
        r#""accessors": [{"count": 1, "type": "VEC3", "componentType": "f"}]"#,
        r#""materials": [{"pbrMetallicRoughness": [{}]}]"#,
        r#""meshes": [{"primitives": [{"attributes": {"POSITION": "x"}}]}]"#,
        r#""extensions": {"KHR_lights_punctual": {"lights": [{"type": 1}]}},
           "nodes": [{"extensions": {"KHR_lights_punctual": {"light": 0}}}]"#,
        r#""extensions": {"KHR_lights_punctual": {"lights": [{"type": "spot", "spot": []}]}},
           "nodes": [{"extensions": {"KHR_lights_punctual": {"light": 2}}}]"#,
        r#""cameras": [{"perspective": {}}]"#,
    ];
    insta::assert_snapshot!(cases.map(|rest| refused(rest, "m.gltf", &gltf(rest))).concat());
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
    let shown = |rest: &str| format!("{nodes}, {rest}");
    let cases = [
        shown(r#""meshes": []"#),
        shown(mesh),
        shown(&format!("{mesh}, {}", accessor(5))),
        shown(&format!("{mesh}, {}", accessor(1))),
        shown(&format!("{mesh}, {}", accessor(0))),
        r#""scene": 4, "scenes": [{}]"#.to_owned(),
        r#""scenes": [{"nodes": [0, 2]}], "nodes": [{}]"#.to_owned(),
        r#""nodes": [{"camera": 1}]"#.to_owned(),
        r#""materials": [{"name": "skin", "normalTexture": {"index": 2}}]"#.to_owned(),
    ];
    insta::assert_snapshot!(cases.map(|rest| refused(&rest, "m.gltf", &gltf(&rest))).concat());
}

#[test]
fn data_uris_that_are_cut_off_say_so() {
    let cases = ["AAAAA==", "AAAAA", "AAB=", "AA*A"].map(|data| {
        let rest = format!(
            r#""buffers": [{{"uri": "data:application/octet-stream;base64,{data}",
               "byteLength": 2}}], "bufferViews": [{{"buffer": 0, "byteLength": 2}}]"#
        );
        refused(data, "m.gltf", &gltf(&rest))
    });
    insta::assert_snapshot!(cases.concat());
}

#[test]
fn scenes_say_what_is_allowed() {
    let cases = [
        r#"{"etendue": 1.0}"#,
        r#"{"etendue": "1"}"#,
        r#"{"etendue": 2}"#,
        r#"{}"#,
        r#"{"etendue": 1, "objects": [{"sahpe": "box"}]}"#,
        r#"{"etendue": 1, "lights": [{"tpye": "point"}]}"#,
        r#"{"etendue": 1, "materials": {"a": {"colour": [1, 1, 1]}}}"#,
        r#"{"etendue": 1, "camera": {"fov": 60}}"#,
        r#"{"etendue": 1, "objects": [{"file": "a.glb", "shape": "box"}]}"#,
        r#"{"etendue": 1, "lights": [{"type": "point"}]}"#,
        r#"{"etendue": 1, "camera": {"type": "pinhole", "pose": {"from": [0, 0, 1]}}}"#,
        r#"{"etendue": 1, "camera": {"type": "pinhole", "intrinsics": {"fx": 1, "fy": 1,
            "cx": 0, "cy": 0}}}"#,
        r#"{"etendue": 1, "render": {"seed": 7.0}}"#,
        r#"{"etendue": 1"#,
        r#"{"etendue": 1, "camera": }"#,
        r#"{"etendue": 1, camera: {}}"#,
    ];
    insta::assert_snapshot!(cases.map(|scene| refused(scene, "s.json", scene.as_bytes())).concat());
}

#[test]
fn names_of_files_send_nothing_to_the_terminal() {
    let escape = "a\\u001b[31mb\\u0007\\u009b2J";
    let rest = format!(
        r#""nodes": [{{"mesh": 0}}], "meshes": [{{"name": "{escape}", "primitives":
           [{{"attributes": {{"POSITION": 4}}}}]}}]"#
    );
    let cases = [
        refused("in a mesh's name", "m.gltf", &gltf(&rest)),
        refused("in a line of OBJ", "m.obj", b"v 0 0 \x1b[31mx\nf 1 1 1\n"),
        refused("in a key", "s.json", b"{\"etendue\": 1, \"\\u001b[2J\": 1}"),
        refused("in a value", "s.json", b"{\"etendue\": 1, \"camera\": \"\x1b[2J\"}"),
    ];
    insta::assert_snapshot!(cases.concat());
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
    let mut all = String::new();
    for arguments in &commands {
        let said = bench.refusal(arguments);
        writeln!(all, "$ etendue {}\n{said}", arguments.join(" ")).expect("a string");
    }
    insta::assert_snapshot!(all);
}
