//! Every refusal: exit code 2, one message that names the file and the place, and no output.

use etendue_accel::AccelName;

use crate::run::{Bench, text};

/// Renders `scene.json` with `more` arguments, which must be refused in words that hold each of
/// `words`, with nothing left behind.
fn refused(bench: &Bench, more: &[&str], words: &[&str]) {
    let arguments = [&["render", "scene.json", "-o", "out"], more].concat();
    refused_command(bench, &arguments, words);
}

fn refused_command(bench: &Bench, arguments: &[&str], words: &[&str]) {
    let output = bench.run(arguments);
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    assert!(!message.contains("panicked"), "{message}");
    for word in words {
        assert!(message.contains(word), "expected \"{word}\" in: {message}");
    }
    let left = std::fs::read_dir(bench.path("out")).map_or(0, Iterator::count);
    assert_eq!(left, 0, "something was left behind: {message}");
}

fn refused_scene(scene: &str, words: &[&str]) {
    refused(&Bench::with_scene(scene), &[], words);
}

#[test]
fn broken_json_shows_line_column_and_the_line() {
    refused_scene(
        "{\n  \"etendue\": 1,\n  \"objects\": [ { \"shape\": \"box\" ]\n}\n",
        &["scene.json", "line 3", "\"objects\": [ { \"shape\": \"box\" ]"],
    );
    refused_scene("", &["scene.json", "line 1"]);
    refused_scene("[1, 2]", &["scene.json"]);
}

#[test]
fn unknown_keys_name_the_nearest_known_one() {
    refused_scene(r#"{"etendue": 1, "camra": {}}"#, &["camra", "`camera`"]);
    refused_scene(
        r#"{"etendue": 1, "camera": {"type": "pinhole", "fof": 30}}"#,
        &["camera", "fof", "`fov`"],
    );
    refused_scene(
        r#"{"etendue": 1, "objects": [{"shape": "box", "materiel": "x"}]}"#,
        &["objects[0]", "materiel", "`material`"],
    );
}

#[test]
fn wrong_types_and_versions_say_what_was_expected() {
    refused_scene(r#"{"etendue": 2}"#, &["etendue", "2"]);
    refused_scene(r#"{"etendue": 1, "objects": 3}"#, &["objects"]);
    refused_scene(r#"{"etendue": 1, "layers": ["dept"]}"#, &["layers[0]", "depth"]);
    refused_scene(
        r#"{"etendue": 1, "objects": [{"shape": "sphere", "radius": "1 parsec"}]}"#,
        &["objects[0]", "radius", "parsec"],
    );
    refused_scene(r#"{"etendue": 1, "objects": [{"shape": "pyramid"}]}"#, &["pyramid"]);
}

#[test]
fn impossible_cameras_are_named() {
    let camera = |keys: &str| {
        format!(r#"{{"etendue": 1, "camera": {{"type": "pinhole", {keys}}}, "objects": []}}"#)
    };
    refused_scene(&camera(r#""sensor": {"resolution": [0, 100]}"#), &["resolution"]);
    refused_scene(&camera(r#""sensor": {"resolution": [100000, 100000]}"#), &["resolution"]);
    refused_scene(&camera(r#""fov": 180"#), &["fov"]);
    refused_scene(&camera(r#""fov": -3"#), &["fov"]);
    refused_scene(&camera(r#""pose": {"from": [0, 0, 1], "look_at": [0, 0, 1]}"#), &["pose"]);
    refused_scene(
        &camera(r#""pose": {"from": [0, 5, 0], "look_at": [0, 0, 0], "up": [0, 1, 0]}"#),
        &["pose"],
    );
}

#[test]
fn missing_files_and_materials_name_what_there_is() {
    let bench = Bench::with_scene(r#"{"etendue": 1, "objects": [{"file": "bunny.obj"}]}"#);
    bench.write("bunnny.obj", b"");
    refused(&bench, &[], &["bunny.obj", "bunnny.obj"]);
    refused_command(&bench, &["render", "nothing.json", "-o", "out"], &["nothing.json"]);
    refused_scene(
        r#"{"etendue": 1, "objects": [{"shape": "box", "material": "cly"}],
            "materials": {"clay": {"type": "matte", "color": [0.5, 0.5, 0.5]}}}"#,
        &["cly", "clay"],
    );
}

#[test]
fn paths_stay_in_the_scenes_folder_unless_allowed() {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("inner")).unwrap();
    bench.write("mesh.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    bench.write("inner/scene.json", br#"{"etendue": 1, "objects": [{"file": "../mesh.obj"}]}"#);
    let scene = ["render", "inner/scene.json", "-o", "out"];
    refused_command(&bench, &scene, &["../mesh.obj", "--allow-outside"]);
    std::os::unix::fs::symlink(bench.path("mesh.obj"), bench.path("inner/link.obj")).unwrap();
    bench.write("inner/scene.json", br#"{"etendue": 1, "objects": [{"file": "link.obj"}]}"#);
    refused_command(&bench, &scene, &["link.obj", "--allow-outside"]);
    let allowed = bench.run(&[&scene[..], &["--allow-outside"]].concat());
    assert!(allowed.status.success(), "{}", text(&allowed.stderr));
}

/// One range and one message for all accelerators: what one refuses, no other works on without end.
#[test]
fn scenes_beyond_what_accelerators_tell_apart_are_refused_by_all() {
    let scaled = |scale: &str| {
        let scene = format!(
            r#"{{"etendue": 1, "objects": [{{"shape": "box", "transform": {{"scale": {scale}}}}}]}}"#
        );
        Bench::with_scene(&scene)
    };
    // Beside a box of a metre, one far away.
    let apart = format!(
        r#"{{"etendue": 1, "objects": [{{"shape": "box"}},
            {{"shape": "box", "transform": {{"translate": [{}, 0, 0]}}}}]}}"#,
        "5e29"
    );
    for accel in AccelName::built().map(AccelName::name) {
        let says = ["and accelerators hold 1e-12 to 1e12 m", "scale its objects"];
        for scale in ["1e38", "1e25", "1.1e12", "0.9e-12", "1e-30"] {
            refused(&scaled(scale), &["--accel", accel], &says);
        }
        refused(&Bench::with_scene(&apart), &["--accel", accel], &says);
        for scale in ["0.9e12", "1.1e-12"] {
            let size = "camera.sensor.resolution=[4,4]";
            let bench = scaled(scale);
            let output =
                bench.run(&["render", "scene.json", "-o", "out", "--accel", accel, "--set", size]);
            assert!(output.status.success(), "{accel}, {scale}: {}", text(&output.stderr));
        }
    }
    // Looking at a scene says what rendering it would.
    for command in ["check", "plan"] {
        let output = scaled("1e25").run(&[command, "scene.json"]);
        assert_eq!(output.status.code(), Some(2), "{command}");
        let said = text(&output.stderr);
        assert!(said.contains("scene.json") && said.contains("accelerators hold"), "{said}");
    }
    // A point far away is nothing to tell apart.
    let bench = Bench::new();
    bench.write("far.obj", b"v 0 1e38 0\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 1 1\nf 2 3 4\n");
    let output = bench.run(&["render", "far.obj", "-o", "out", "--accel", "bvh"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
}

#[test]
fn settings_and_folders_that_cannot_be_say_why() {
    let bench = Bench::with_scene(r#"{"etendue": 1, "objects": []}"#);
    refused(&bench, &["--set", "camera.fov=1e400"], &["1e400", "1.8e308"]);
    refused(&bench, &["--set", "camera.fov=1e-320"], &["fov"]);
    refused(&bench, &["--samples", "99999999999"], &["1048576"]);
    bench.write("taken", b"");
    let into_a_file = ["render", "scene.json", "-o", "taken"];
    refused_command(&bench, &into_a_file, &["taken", "it is a file; choose another folder"]);
}

#[test]
fn bytes_of_other_files_are_no_models_and_never_reach_the_terminal() {
    let bench = Bench::new();
    bench.write("noise.obj", b"\x7fELF\0\0\0\n\0\xff\n");
    let words = ["noise.obj", "it is a program, not an OBJ model"];
    refused_command(&bench, &["render", "noise.obj", "-o", "out"], &words);
    bench.write("colour.obj", b"v 1 2 \x1b[31mred\n");
    let output = bench.run(&["render", "colour.obj", "-o", "out"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(!output.stderr.contains(&0x1b), "{}", text(&output.stderr));
    bench.write("empty.glb", b"");
    refused_command(&bench, &["render", "empty.glb", "-o", "out"], &["empty.glb", "it is empty"]);
}

/// A GLB of one triangle with the given positions and indices.
fn glb(positions: &[[f32; 3]], indices: &[u32], extension: &str) -> Vec<u8> {
    let mut binary: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
    let offset = binary.len();
    binary.extend(positions.iter().flatten().flat_map(|x| x.to_le_bytes()));
    let finite = |f: fn(f32, f32) -> f32, start: f32| {
        [0, 1, 2].map(|k| positions.iter().map(|p| p[k]).fold(start, f))
    };
    let required = match extension {
        "" => String::new(),
        name => format!(r#""extensionsUsed": ["{name}"], "extensionsRequired": ["{name}"],"#),
    };
    let json = format!(
        r#"{{"asset": {{"version": "2.0"}}, {required}
        "scenes": [{{"nodes": [0]}}], "scene": 0, "nodes": [{{"mesh": 0}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 1}}, "indices": 0}}]}}],
        "buffers": [{{"byteLength": {length}}}],
        "bufferViews": [{{"buffer": 0, "byteOffset": 0, "byteLength": {offset}}},
            {{"buffer": 0, "byteOffset": {offset}, "byteLength": {rest}}}],
        "accessors": [{{"bufferView": 0, "componentType": 5125, "count": {ni}, "type": "SCALAR"}},
            {{"bufferView": 1, "componentType": 5126, "count": {np}, "type": "VEC3",
              "min": {min:?}, "max": {max:?}}}]}}"#,
        length = binary.len(),
        rest = binary.len() - offset,
        ni = indices.len(),
        np = positions.len(),
        min = finite(f32::min, 1e30),
        max = finite(f32::max, -1e30),
    );
    let mut json = json.into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut file = b"glTF\x02\0\0\0".to_vec();
    let total = 12 + 8 + json.len() + 8 + binary.len();
    let size = |n: usize| u32::try_from(n).unwrap().to_le_bytes();
    file.extend(size(total));
    file.extend(size(json.len()));
    file.extend(b"JSON");
    file.extend(&json);
    file.extend(size(binary.len()));
    file.extend(b"BIN\0");
    file.extend(&binary);
    file
}

const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

fn refused_model(bytes: &[u8], more: &[&str], words: &[&str]) {
    let bench = Bench::new();
    bench.write("model.glb", bytes);
    let arguments = [&["render", "model.glb", "-o", "out"], more].concat();
    refused_command(&bench, &arguments, words);
}

#[test]
fn a_sound_glb_is_taken() {
    // So that the refusals below are for the reason they name.
    let bench = Bench::new();
    bench.write("model.glb", &glb(&CORNERS, &[0, 1, 2], ""));
    let output = bench.run(&["render", "model.glb", "-o", "out"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
}

#[test]
fn truncated_models_are_refused_at_any_length() {
    let whole = glb(&CORNERS, &[0, 1, 2], "");
    for length in [0, 3, 12, 19, 20, whole.len() / 2, whole.len() - 1] {
        refused_model(&whole[..length], &[], &["model.glb"]);
    }
}

#[test]
fn indices_out_of_range_are_refused() {
    refused_model(&glb(&CORNERS, &[0, 1, 3], ""), &[], &["model.glb", "3"]);
}

#[test]
fn unfinite_positions_are_dropped_and_counted_or_refused() {
    let corners = [[f32::NAN, 0.0, 0.0], CORNERS[1], CORNERS[2], [1.0, 1.0, 0.0]];
    let model = glb(&corners, &[0, 1, 2, 1, 3, 2], "");
    let bench = Bench::new();
    bench.write("model.glb", &model);
    let output = bench.run(&["render", "model.glb", "-o", "out", "--report", "report.json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let report = bench.json("report.json");
    assert_eq!(report["triangles"], 1);
    assert!(report["notes"].to_string().contains("not a finite number"), "{report}");
    refused_model(&model, &["--strict"], &["model.glb"]);
}

#[test]
fn compressed_models_are_named_with_the_command_that_converts_them() {
    refused_model(
        &glb(&CORNERS, &[0, 1, 2], "EXT_texture_avif"),
        &[],
        &["EXT_texture_avif", "npx @gltf-transform/cli png"],
    );
    refused_model(&glb(&CORNERS, &[0, 1, 2], "ACME_unheard_of"), &[], &["ACME_unheard_of"]);
    let both = "ACME_unheard_of\", \"KHR_texture_basisu";
    let words = ["ACME_unheard_of", "KHR_texture_basisu", "ktxdecompress"];
    refused_model(&glb(&CORNERS, &[0, 1, 2], both), &[], &words);
}

#[test]
fn an_empty_scene_is_a_picture_without_hits() {
    for scene in [
        r#"{"etendue": 1, "layers": ["depth", "ids", "normal"]}"#,
        r#"{"etendue": 1, "objects": [{"file": "empty.obj"}], "layers": ["depth", "ids", "normal"]}"#,
    ] {
        let bench = Bench::with_scene(scene);
        bench.write("empty.obj", b"# nothing\n");
        bench.render(&["--set", "camera.type=pinhole", "--set", "camera.sensor.resolution=[9,5]"]);
        assert!(bench.array("depth").iter().all(|z| *z == f64::INFINITY));
        assert!(bench.array("id_object").iter().all(|id| *id == 0.0));
        assert!(bench.array("normal").iter().all(|n| *n == 0.0));
    }
}

#[test]
fn folders_that_cannot_be_written_to_are_refused_before_rendering() {
    let bench = Bench::with_scene(r#"{"etendue": 1}"#);
    bench.write("file", b"");
    refused_command(&bench, &["render", "scene.json", "-o", "file/out"], &["file/out"]);
    refused_command(&bench, &["render", "scene.json", "-o", "file"], &["file"]);
}

#[cfg(feature = "embree")]
#[test]
fn instruction_sets_that_there_are_not_are_refused_by_name() {
    let bench = Bench::with_scene(r#"{"etendue": 1, "objects": [{"shape": "box"}]}"#);
    refused(&bench, &["--isa", "mmx"], &["isa", "mmx"]);
    refused(&bench, &["--isa", "avx2", "--accel", "bvh"], &["--isa", "--accel embree"]);
    refused(&bench, &["--accel-mode", "sloppy"], &["--accel-mode", "robust", "fast"]);
}

#[test]
fn a_memory_limit_that_the_build_would_pass_stops_it() {
    let bench =
        Bench::with_scene(r#"{"etendue": 1, "objects": [{"shape": "blob", "triangles": 200000}]}"#);
    for accel in AccelName::built().map(AccelName::name) {
        refused(&bench, &["--memory-limit", "1M", "--accel", accel], &["--memory-limit"]);
    }
}

#[test]
fn options_that_mean_nothing_are_refused() {
    let bench = Bench::with_scene(r#"{"etendue": 1}"#);
    refused(&bench, &["--outputs", "gif"], &["gif", "exr"]);
    refused(&bench, &["--layers", "dept"], &["dept", "depth"]);
    refused(&bench, &["--set", "camera"], &["PATH=VALUE"]);
    refused(&bench, &["--set", "render.samples=0"], &["samples"]);
    refused(&bench, &["--memory-limit", "4 elephants"], &["memory-limit"]);
    refused(&bench, &["--camera", "front"], &["front"]);
    for option in ["--samples", "--seed", "--threads", "--memory-limit", "--checkpoint"] {
        refused(&bench, &[option, "-1"], &["invalid value '-1'", option]);
    }
    let twice = "camera={\"type\": \"pinhole\", \"fov\": 3, \"fov\": 40}";
    refused(&bench, &["--set", twice], &["fov stands here a second time"]);
    refused_command(
        &bench,
        &["plan", "scene.json", "--tolerance", "1 px"],
        &["tolerance", "light"],
    );
}

#[test]
fn lenses_that_leave_no_opening_are_refused() {
    let camera = |number: &str| {
        format!(
            r#"{{"etendue": 1, "camera": {{"type": "thin_lens", "focal_length": 50, "f_number": {number},
            "focus_distance": 3, "sensor_height": 24}}}}"#
        )
    };
    refused_scene(&camera("1e300"), &["camera.f_number", "an opening of 2.5e-299 mm"]);
}

#[test]
fn a_folder_where_a_file_is_to_be_is_refused_before_rendering() {
    let bench = Bench::with_scene(r#"{"etendue": 1}"#);
    std::fs::create_dir_all(bench.path("out/picture.png")).unwrap();
    let output = bench.run(&["render", "scene.json", "-o", "out"]);
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("picture.png: is a folder, where a file is to be"), "{message}");
    assert!(!bench.path("out/etendue-manifest.json").exists());
}
