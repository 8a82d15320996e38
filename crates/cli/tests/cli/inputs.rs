//! Every key of the schema that names a file, and the files that those name in turn: none is read through a link
//! out of the scene's folder, none is written over, and each is in the scene's hash.

use std::collections::BTreeSet;
use std::fs;

use serde_json::{Value, json};

use crate::run::{Bench, text};

/// A file that a scene names, or one that such a file names.
struct Input {
    /// The definitions and keys of the schema that lead to it.
    keys: &'static [&'static str],
    /// The scene.
    scene: Value,
    /// All files with their contents.
    files: Vec<(&'static str, Vec<u8>)>,
    /// The file that is tried, and what it is changed to.
    tried: (&'static str, Vec<u8>),
}

const PAINT: &[u8] = include_bytes!("../../../etendue/tests/data/paint.png");

const OBJ: &[u8] =
    b"mtllib m.mtl\nv -1 -1 0\nv 1 -1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\n\
                     f 1/1 2/2 3/3\n";
const MTL: &[u8] = b"newmtl m\nmap_Kd paint.png\n";
const PLY: &[u8] = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                     element face 1\nproperty list uchar int vertex_indices\nend_header\n-1 -1 0\n1 -1 0\n0 1 0\n3 0 1 2\n";
const AGF: &[u8] = b"CC made up\nNM OWN-1 2 0 1.6 60 0 1\nCD 1.5 0.01 0 0 0 0\nLD 0.35 2.5\n";
const IES: &[u8] =
    b"IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 2 1 1 2 0 0 0\n1 1 40\n0 90\n0\n100 100\n";
const ZMX: &[u8] = b"MODE SEQ\nENPD 8\nFTYP 0 0 1 1\nYFLN 0\nWAVL 0.55\nSURF 0\n  TYPE STANDARD\n  DISZ INFINITY\n\
                     SURF 1\n  TYPE STANDARD\n  STOP\n  CURV 0.02\n  DISZ 4\n  GLAS ___BLANK 1 0 1.5 60\n  DIAM 4\n\
                     SURF 2\n  TYPE STANDARD\n  CURV -0.02\n  DISZ 48\n  DIAM 4\nSURF 3\n  TYPE STANDARD\n  DISZ 0\n";

/// A grey picture of 2 × 2 pixels of one level.
fn grey(level: u8) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 2, 2);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.write_header().unwrap().write_image_data(&[level; 4]).unwrap();
    bytes
}

/// An NPY file of 4 × 4 matrices that move along z.
fn npy(places: &[f64]) -> Vec<u8> {
    let shape = format!("({}, 4, 4)", places.len());
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}");
    header.push_str(&" ".repeat(117 - header.len()));
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(u16::try_from(header.len()).unwrap().to_le_bytes());
    bytes.extend(header.bytes());
    for z in places {
        let matrix = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., *z, 0., 0., 0., 1.];
        bytes.extend(matrix.iter().flat_map(|number| number.to_le_bytes()));
    }
    bytes
}

/// A glTF file of one triangle with its buffer beside it.
fn gltf() -> (Vec<u8>, Vec<u8>) {
    let corners: [f32; 9] = [-1., -1., 0., 1., -1., 0., 0., 1., 0.];
    let json = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "materials": [{"emissiveTexture": {"index": 0}, "emissiveFactor": [1, 1, 1]}],
        "textures": [{"source": 0}], "images": [{"uri": "paint.png"}],
        "buffers": [{"uri": "m.bin", "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                       "min": [-1, -1, 0], "max": [1, 1, 0]}]
    });
    (json.to_string().into_bytes(), corners.iter().flat_map(|x| x.to_le_bytes()).collect())
}

fn nerfstudio(z: f64) -> Vec<u8> {
    let pose = |z: f64| json!([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, z], [0, 0, 0, 1]]);
    json!({"fl_x": 4, "fl_y": 4, "cx": 2, "cy": 2, "w": 4, "h": 4,
           "frames": [{"file_path": "a", "transform_matrix": pose(z)}]})
    .to_string()
    .into_bytes()
}

/// A triangle before a camera, with `more` of the scene.
fn scene(more: &Value) -> Value {
    let mut scene = json!({
        "etendue": 1, "tracer": {"type": "direct"}, "render": {"samples": 1, "accel": "bvh"},
        "camera": {"type": "pinhole", "sensor": {"resolution": [4, 4]},
                   "pose": {"from": [0, 0, 3], "look_at": [0, 0, 0]}},
        "objects": [{"shape": "sphere"}],
        "lights": [{"type": "point", "at": [0, 0, 3], "intensity": [1, 1, 1]}]
    });
    for (key, value) in more.as_object().unwrap() {
        scene[key] = value.clone();
    }
    scene
}

/// A scene that is measured without light, for which no pupil is looked for: behind what has no symmetry that takes many
/// seconds of a development build. The files of a lens are read all the same.
fn unlit(mut scene: Value) -> Value {
    let keys = scene.as_object_mut().unwrap();
    keys.remove("tracer");
    keys.remove("lights");
    keys.insert("layers".to_owned(), json!(["depth"]));
    scene
}

/// A camera whose lens has these elements before a lens, and more.
fn through(element: &Value, more: &Value) -> Value {
    let mut lens = json!({"elements": [
        element,
        {"type": "surface", "radius": 50, "thickness": 5, "glass": "N-BK7", "semi_diameter": 4},
        {"type": "surface", "radius": -50, "semi_diameter": 4}]});
    for (key, value) in more.as_object().unwrap() {
        lens[key] = value.clone();
    }
    lens
}

fn camera(lens: &Value) -> Value {
    json!({"camera": {"type": "lens", "lens": lens, "focus_distance": 3, "sensor_height": 4,
        "sensor": {"resolution": [4, 4]}, "pose": {"from": [0, 0, 3], "look_at": [0, 0, 0]}}})
}

fn along(file: &str) -> Value {
    scene(&json!({"frames": {"type": "trajectory", "file": file}}))
}

/// One byte more, which no reader of these formats minds.
fn longer(bytes: &[u8]) -> Vec<u8> {
    [bytes, b"\n"].concat()
}

#[expect(clippy::too_many_lines, reason = "one list of all keys that name files")]
fn inputs() -> Vec<Input> {
    let mut inputs = Vec::new();
    let mut add = |keys, scene: Value, files: &[(&'static str, &[u8])], changed: Vec<Vec<u8>>| {
        for ((name, _), changed) in files.iter().zip(changed) {
            let files = files.iter().map(|(name, bytes)| (*name, bytes.to_vec())).collect();
            inputs.push(Input { keys, scene: scene.clone(), files, tried: (name, changed) });
        }
    };
    // Models with what they name.
    let model = |file: &str| scene(&json!({"objects": [{"file": file}]}));
    let model_keys: &[&str] = &["Object.file"];
    let obj: [(&str, &[u8]); 3] = [("m.obj", OBJ), ("m.mtl", MTL), ("paint.png", PAINT)];
    add(model_keys, model("m.obj"), &obj, obj.map(|(_, bytes)| longer(bytes)).into());
    add(model_keys, model("m.ply"), &[("m.ply", PLY)], vec![longer(PLY)]);
    let (json, bin) = gltf();
    let gltf: [(&str, &[u8]); 3] = [("m.gltf", &json), ("m.bin", &bin), ("paint.png", PAINT)];
    let changed = gltf.map(|(_, bytes)| longer(bytes));
    add(model_keys, model("m.gltf"), &gltf, changed.into());
    let copies = json!({"objects": [{"shape": "sphere", "instances": "copies.npy"}]});
    let (one, other) = (npy(&[0.0]), npy(&[-0.5]));
    add(&["InstancesSpec"], scene(&copies), &[("copies.npy", &one)], vec![other]);
    // Light and its surfaces.
    let painted = json!({"objects": [{"shape": "sphere", "material": "paint"}],
        "materials": {"paint": {"type": "matte", "color": {"image": "paint.png"}}}});
    let paint: [(&str, &[u8]); 1] = [("paint.png", PAINT)];
    add(&["ImageSpec.image"], scene(&painted), &paint, vec![longer(PAINT)]);
    let sky = json!({"lights": [{"type": "environment", "image": "paint.png"}]});
    add(&["SkyImageSpec"], scene(&sky), &paint, vec![longer(PAINT)]);
    let lamp = json!({"lights": [{"type": "goniometric", "at": [0, 2, 0], "file": "lamp.ies"}]});
    add(&["LightSpec.file"], scene(&lamp), &[("lamp.ies", IES)], vec![longer(IES)]);
    // Curves of surfaces, metals, lights and sensors, and cubes of them.
    let ball = |paint: Value| json!({"objects": [{"shape": "sphere", "material": "paint"}], "materials": {"paint": paint}});
    let matte = |color: Value| ball(json!({"type": "matte", "color": color}));
    let curve_keys: &[&str] = &["FileSpec.file"];
    let curve: [(&str, &[u8]); 1] = [("c.csv", b"400,0.5\n700,0.6\n")];
    let other = || vec![b"400,0.5\n700,0.7\n".to_vec()];
    let named = || json!({"file": "c.csv"});
    add(curve_keys, scene(&matte(named())), &curve, other());
    let lamp = json!({"lights": [{"type": "point", "at": [0, 0, 3], "intensity": named()}]});
    add(curve_keys, scene(&lamp), &curve, other());
    let seen = json!({"camera": {"type": "pinhole", "pose": {"from": [0, 0, 3], "look_at": [0, 0, 0]},
        "sensor": {"type": "raw", "resolution": [4, 4], "quantum_efficiency": named()}}});
    add(curve_keys, scene(&seen), &curve, other());
    let metal = ball(json!({"type": "metal", "metal": {"file": "m.yml"}}));
    let yml = |n: f64| format!("- type: tabulated nk\n  data: |\n    0.4 {n} 2\n    0.7 {n} 3\n");
    let (one, two) = (yml(1.0).into_bytes(), yml(2.0).into_bytes());
    add(&["MetalFileSpec.file"], scene(&metal), &[("m.yml", &one)], vec![two]);
    let cube = |value: f64| {
        let mut bytes = npy(&[value]);
        // One texel row of four columns and four bands, all of one value.
        let start = bytes.len() - 128;
        bytes[start..].copy_from_slice(&value.to_le_bytes().repeat(16));
        bytes
    };
    let (one, two) = (cube(0.5), cube(0.25));
    let bands = json!({"cube": "c.npy", "bands": [400, 500, 600, 700, 800]});
    add(&["CubeSpec.cube"], scene(&matte(bands)), &[("c.npy", &one)], vec![two]);
    let sky = json!({"lights": [{"type": "environment", "image":
        {"cube": "c.npy", "bands": [400, 500, 600, 700, 800]}}]});
    add(&["SkyCubeSpec.cube"], scene(&sky), &[("c.npy", &cube(0.5))], vec![cube(0.25)]);
    let header: &[u8] = b"ENVI\nsamples = 1\nlines = 1\nbands = 2\ndata type = 1\ninterleave = bsq\nheader offset = 0\n\
        reflectance scale factor = 255\nwavelength units = nm\nwavelength = {450, 550}\n";
    let texel: &[u8] = &[50, 90];
    let pair = [("c.img", texel), ("c.hdr", header)];
    for name in ["c.img", "c.hdr"] {
        let scene = scene(&matte(json!({"cube": name})));
        add(&["CubeSpec.cube"], scene, &pair, vec![vec![50, 91], longer(header)]);
    }
    // Lenses with what they name.
    let plain = through(
        &json!({"type": "aperture", "shape": "circular", "radius": 2, "thickness": 1, "stop": true}),
        &json!({}),
    );
    let lens_keys: &[&str] = &["LensSource"];
    let written = plain.to_string().into_bytes();
    let in_file = scene(&camera(&json!("lens.json")));
    add(lens_keys, in_file, &[("lens.json", &written)], vec![longer(&written)]);
    let in_zemax = scene(&camera(&json!("lens.zmx")));
    add(lens_keys, in_zemax, &[("lens.zmx", ZMX)], vec![longer(ZMX)]);
    let grey = grey(255);
    let mask: [(&str, &[u8]); 1] = [("mask.png", &grey)];
    let masked = through(
        &json!({"type": "aperture", "shape": "image", "file": "mask.png", "width": 4, "thickness": 1,
                "stop": true}),
        &json!({}),
    );
    let coated =
        through(&json!({"type": "filter", "transmission": named(), "thickness": 1}), &json!({}));
    let written = coated.to_string().into_bytes();
    let files = [curve[0], ("lens.json", &written)];
    add(curve_keys, scene(&camera(&json!("lens.json"))), &files, other());
    let mask_keys: &[&str] = &["ApertureSpec.file", "ElementSpec.file", "PlacedSpec.file"];
    add(mask_keys, unlit(scene(&camera(&masked))), &mask, vec![longer(&grey)]);
    let filtered = through(
        &json!({"type": "filter", "image": "mask.png", "width": 20, "curves": {"255": 0.5}, "thickness": 1}),
        &json!({}),
    );
    let filter_keys: &[&str] = &["ElementSpec.image", "PlacedSpec.image"];
    add(filter_keys, unlit(scene(&camera(&filtered))), &mask, vec![longer(&grey)]);
    let spread =
        json!({"type": "height_map", "file": "mask.png", "width": 20, "height": 20, "depth": 0.01});
    let mapped = json!({"type": "freeform", "semi_diameter": 4, "thickness": 1, "sag": [spread]});
    let mapped = unlit(scene(&camera(&through(&mapped, &json!({})))));
    add(&["SagSpec.file"], mapped, &mask, vec![longer(&grey)]);
    let pattern =
        json!({"type": "image", "file": "mask.png", "width": 20, "height": 20, "depth": 0.1});
    let phased = json!({"type": "freeform", "semi_diameter": 4, "thickness": 1,
        "phase": {"pattern": pattern, "order": 1}});
    let phased = unlit(scene(&camera(&through(&phased, &json!({})))));
    add(&["PatternSpec.file"], phased, &mask, vec![longer(&grey)]);
    let own = through(
        &json!({"type": "surface", "radius": 90, "thickness": 2, "glass": "OWN-1", "semi_diameter": 4}),
        &json!({"glass_catalogs": ["own.agf"]}),
    );
    add(&["LensFile.glass_catalogs"], scene(&camera(&own)), &[("own.agf", AGF)], vec![longer(AGF)]);
    // Defects of a sensor.
    let dead = self::grey(2);
    let chip = json!({"camera": {"type": "pinhole", "pose": {"from": [0, 0, 3], "look_at": [0, 0, 0]},
        "sensor": {"type": "raw", "resolution": [2, 2], "defect_map": "defects.png"}}});
    add(&["DefectMap"], scene(&chip), &[("defects.png", &dead)], vec![self::grey(3)]);
    // Pixels of a slot.
    let slots = json!({"serial": [{"pixels": "pixels.png"}, {}], "camera": {"type": "pinhole",
        "pose": {"from": [0, 0, 3], "look_at": [0, 0, 0]}, "sensor": {"resolution": [2, 2]},
        "shutter": {"exposure": 0.01}}});
    add(&["PixelsSpec"], scene(&slots), &[("pixels.png", &grey)], vec![longer(&grey)]);
    // The camera itself.
    let pinhole = |fov: u32| {
        json!({"type": "pinhole", "fov": fov, "sensor": {"resolution": [4, 4]},
               "pose": {"from": [0, 0, 3], "look_at": [0, 0, 0]}})
        .to_string()
        .into_bytes()
    };
    let (narrow, wide) = (pinhole(30), pinhole(60));
    let in_file = scene(&json!({"camera": "camera.json"}));
    add(&["CameraSource"], in_file, &[("camera.json", &narrow)], vec![wide]);
    // Poses.
    let path_keys: &[&str] = &["CameraPath.file"];
    let (near, far) = (nerfstudio(3.0), nerfstudio(4.0));
    add(path_keys, along("transforms.json"), &[("transforms.json", &near)], vec![far]);
    let (near, far) = (npy(&[-3.0]), npy(&[-4.0]));
    add(path_keys, along("p.npy"), &[("p.npy", &near)], vec![far]);
    let tum: [(&str, &[u8]); 1] = [("p.txt", b"0 0 0 -3 0 0 0 1\n")];
    add(path_keys, along("p.txt"), &tum, vec![b"0 0 0 -4 0 0 0 1\n".to_vec()]);
    let colmap: [(&str, &[u8]); 2] =
        [("images.txt", b"1 1 0 0 0 0 0 3 1 a\n\n"), ("cameras.txt", b"1 PINHOLE 4 4 4 4 2 2\n")];
    let changed = [&b"1 1 0 0 0 0 0 4 1 a\n\n"[..], b"1 PINHOLE 4 4 5 5 2 2\n"];
    add(path_keys, along("images.txt"), &colmap, changed.map(<[u8]>::to_vec).into());
    inputs
}

/// Keys of the schema whose value is the name of a file, by the definition that they are in.
fn keys_of_schema() -> BTreeSet<String> {
    let bench = Bench::new();
    let output = bench.run(&["schema"]);
    let schema: Value = serde_json::from_slice(&output.stdout).unwrap();
    let mut keys = BTreeSet::new();
    for (name, definition) in schema["$defs"].as_object().unwrap() {
        walk(name, definition, &mut keys);
    }
    walk("Scene", &schema, &mut keys);
    keys
}

/// Words by which the schema says that a text is the name of a file.
const WORDS: [&str; 5] = [
    "relative to the scene file",
    "from the scene's folder",
    "lens file's folder",
    "PNG",
    "grey picture",
];

fn walk(place: &str, node: &Value, keys: &mut BTreeSet<String>) {
    let is_text =
        |node: &Value| node["type"] == "string" || node["type"] == json!(["string", "null"]);
    let told = |node: &Value| {
        let about = node["description"].as_str().unwrap_or_default().replace('\n', " ");
        WORDS.iter().any(|word| about.contains(word))
    };
    let choices = ["anyOf", "oneOf", "allOf"].into_iter().filter_map(|of| node[of].as_array());
    for choice in choices.flatten() {
        if is_text(choice) && (told(choice) || told(node)) {
            keys.insert(place.to_owned());
        }
        walk(place, choice, keys);
    }
    for (key, value) in node["properties"].as_object().into_iter().flatten() {
        let is_list_of_text = value["type"] == "array" && is_text(&value["items"]);
        if (is_text(value) || is_list_of_text) && told(value) {
            keys.insert(format!("{place}.{key}"));
        }
    }
}

/// The scene's hash, of every frame.
fn hashes(bench: &Bench, more: &[&str]) -> Vec<String> {
    let render = ["render", "scene.json", "-o", "out", "-q", "--report", "report.json"];
    let output = bench.run(&[&render, more].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let report = bench.json("report.json");
    let frames = report.as_array().cloned().unwrap_or_else(|| vec![report.clone()]);
    frames.iter().map(|frame| frame["scene_hash"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn every_key_of_the_schema_that_names_a_file_is_tried_here() {
    let tried: BTreeSet<String> =
        inputs().iter().flat_map(|input| input.keys).map(|key| (*key).to_owned()).collect();
    assert_eq!(keys_of_schema(), tried);
}

#[test]
#[cfg(unix)]
fn every_file_of_a_scene_is_guarded_and_kept_and_in_its_hash() {
    for Input { scene, files, tried: (name, changed), .. } in inputs() {
        let bench = Bench::with_scene(&scene.to_string());
        for (name, bytes) in &files {
            bench.write(name, bytes);
        }
        let original = fs::read(bench.path(name)).unwrap();
        // It is not written over.
        let report = ["render", "scene.json", "-o", "refused", "-q", "--report", name];
        let output = bench.run(&report);
        let err = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{name}: {err}");
        assert!(err.contains("is read by this command"), "{name}: {err}");
        assert_eq!(fs::read(bench.path(name)).unwrap(), original, "{name}");
        assert!(!bench.path("refused").exists(), "{name}");
        // It is in the hash.
        let before = hashes(&bench, &[]);
        bench.write(name, &changed);
        let after = hashes(&bench, &[]);
        assert_eq!(before.len(), after.len(), "{name}");
        assert!(before.iter().zip(&after).all(|(before, after)| before != after), "{name}");
        // It is not read through a link out of the folder, unless that is allowed.
        let away = tempfile::tempdir().unwrap();
        fs::write(away.path().join(name), &original).unwrap();
        fs::remove_file(bench.path(name)).unwrap();
        std::os::unix::fs::symlink(away.path().join(name), bench.path(name)).unwrap();
        let output = bench.run(&["render", "scene.json", "-o", "refused", "-q"]);
        let err = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{name}: {err}");
        assert!(err.contains("--allow-outside") && err.contains(name), "{name}: {err}");
        hashes(&bench, &["--allow-outside"]);
        // Nor written over behind the link.
        let target = away.path().join(name).display().to_string();
        let report =
            ["render", "scene.json", "-o", "refused", "-q", "--allow-outside", "--report", &target];
        let output = bench.run(&report);
        assert_eq!(output.status.code(), Some(2), "{name}: {}", text(&output.stderr));
        assert_eq!(fs::read(&target).unwrap(), original, "{name}");
    }
}

#[test]
fn a_catalogue_of_the_command_line_is_kept_and_in_the_hash() {
    let lens = through(
        &json!({"type": "surface", "radius": 90, "thickness": 2, "glass": "OWN-1", "semi_diameter": 4}),
        &json!({}),
    );
    let bench = Bench::with_scene(&scene(&camera(&lens)).to_string());
    bench.write("own.agf", AGF);
    let own = ["--glass-catalog", "own.agf"];
    let render = ["render", "scene.json", "-o", "out", "-q", "--report", "own.agf"];
    insta::assert_snapshot!(bench.refusal(&[&render[..], &own].concat()), @"
    error: own.agf would be written over, and is read by this command; nothing was written
    hint: choose another folder or name
    ");
    let before = hashes(&bench, &own);
    bench.write("own.agf", &longer(AGF));
    assert_ne!(before, hashes(&bench, &own));
}
