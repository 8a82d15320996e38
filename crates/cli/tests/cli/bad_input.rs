//! Every refusal: exit code 2, one message that names the file and the place, and no output.

use etendue_accel::AccelName;

use crate::run::{Bench, text, under};

/// Renders `scene.json` with `more` arguments, which must be refused with nothing left behind; the message.
fn refused(bench: &Bench, more: &[&str]) -> String {
    let arguments = [&["render", "scene.json", "-o", "out"], more].concat();
    refused_command(bench, &arguments)
}

fn refused_command(bench: &Bench, arguments: &[&str]) -> String {
    let message = bench.refusal(arguments);
    let left = std::fs::read_dir(bench.path("out")).map_or(0, Iterator::count);
    assert_eq!(left, 0, "something was left behind: {message}");
    message
}

/// The messages that refuse each of `scenes`.
fn refused_scenes(scenes: &[&str]) -> String {
    let messages =
        scenes.iter().map(|scene| under(scene, &refused(&Bench::with_scene(scene), &[])));
    messages.collect()
}

#[test]
fn broken_json_shows_line_column_and_the_line() {
    insta::assert_snapshot!(refused_scenes(&[
        "{\n  \"etendue\": 1,\n  \"objects\": [ { \"shape\": \"box\" ]\n}\n",
        "",
        "[1, 2]",
    ]));
}

#[test]
fn unknown_keys_name_the_nearest_known_one() {
    insta::assert_snapshot!(refused_scenes(&[
        r#"{"etendue": 1, "camra": {}}"#,
        r#"{"etendue": 1, "camera": {"type": "pinhole", "fof": 30}}"#,
        r#"{"etendue": 1, "objects": [{"shape": "box", "materiel": "x"}]}"#,
    ]));
}

#[test]
fn wrong_types_and_versions_say_what_was_expected() {
    insta::assert_snapshot!(refused_scenes(&[
        r#"{"etendue": 2}"#,
        r#"{"etendue": 1, "objects": 3}"#,
        r#"{"etendue": 1, "layers": ["dept"]}"#,
        r#"{"etendue": 1, "objects": [{"shape": "sphere", "radius": "1 parsec"}]}"#,
        r#"{"etendue": 1, "objects": [{"shape": "pyramid"}]}"#,
    ]));
}

#[test]
fn impossible_cameras_are_named() {
    let cameras = [
        r#""sensor": {"resolution": [0, 100]}"#,
        r#""sensor": {"resolution": [100000, 100000]}"#,
        r#""fov": 180"#,
        r#""fov": -3"#,
        r#""pose": {"from": [0, 0, 1], "look_at": [0, 0, 1]}"#,
        r#""pose": {"from": [0, 5, 0], "look_at": [0, 0, 0], "up": [0, 1, 0]}"#,
    ];
    let scenes = cameras.map(|keys| {
        format!(r#"{{"etendue": 1, "camera": {{"type": "pinhole", {keys}}}, "objects": []}}"#)
    });
    insta::assert_snapshot!(refused_scenes(&scenes.each_ref().map(String::as_str)));
}

#[test]
fn missing_files_and_materials_name_what_there_is() {
    let bench = Bench::with_scene(r#"{"etendue": 1, "objects": [{"file": "bunny.obj"}]}"#);
    bench.write("bunnny.obj", b"");
    insta::assert_snapshot!(refused(&bench, &[]), @r#"
    error: scene.json, line 1, column 29: objects[0].file: no such file: "bunny.obj"
    hint: did you mean "bunnny.obj"?
    "#);
    insta::assert_snapshot!(refused_command(&bench, &["render", "nothing.json", "-o", "out"]), @"error: nothing.json: no such file");
    let scene = r#"{"etendue": 1, "objects": [{"shape": "box", "material": "cly"}],
        "materials": {"clay": {"type": "matte", "color": [0.5, 0.5, 0.5]}}}"#;
    insta::assert_snapshot!(refused(&Bench::with_scene(scene), &[]), @r#"
    error: scene.json, line 1, column 45: objects[0].material: unknown material "cly"
    hint: did you mean `clay`? known: `clay`
    "#);
}

#[test]
fn paths_stay_in_the_scenes_folder_unless_allowed() {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("inner")).unwrap();
    bench.write("mesh.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    bench.write("inner/scene.json", br#"{"etendue": 1, "objects": [{"file": "../mesh.obj"}]}"#);
    let scene = ["render", "inner/scene.json", "-o", "out"];
    insta::assert_snapshot!(refused_command(&bench, &scene), @r#"
    error: inner/scene.json, line 1, column 29: objects[0].file: "../mesh.obj" leaves the scene's folder FOLDER/inner
    hint: move the file there, or pass --allow-outside
    "#);
    std::os::unix::fs::symlink(bench.path("mesh.obj"), bench.path("inner/link.obj")).unwrap();
    bench.write("inner/scene.json", br#"{"etendue": 1, "objects": [{"file": "link.obj"}]}"#);
    insta::assert_snapshot!(refused_command(&bench, &scene), @r#"
    error: inner/scene.json, line 1, column 29: objects[0].file: "link.obj" leads through a link out of the scene's folder FOLDER/inner
    hint: move the file there, or pass --allow-outside
    "#);
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
    let mut said = Vec::new();
    for accel in AccelName::built().map(AccelName::name) {
        let beyond = ["1e38", "1e25", "1.1e12", "0.9e-12", "1e-30"];
        let mut all = beyond
            .map(|scale| under(scale, &refused(&scaled(scale), &["--accel", accel])))
            .concat();
        all += &under("apart", &refused(&Bench::with_scene(&apart), &["--accel", accel]));
        said.push(all);
        for scale in ["0.9e12", "1.1e-12"] {
            let size = "camera.sensor.resolution=[4,4]";
            let bench = scaled(scale);
            let output =
                bench.run(&["render", "scene.json", "-o", "out", "--accel", accel, "--set", size]);
            assert!(output.status.success(), "{accel}, {scale}: {}", text(&output.stderr));
        }
    }
    said.dedup();
    assert_eq!(said.len(), 1, "{said:?}");
    insta::assert_snapshot!(said[0]);
    // Looking at a scene says what rendering it would.
    let [checked, planned] =
        ["check", "plan"].map(|command| scaled("1e25").refusal(&[command, "scene.json"]));
    assert_eq!(checked, planned);
    insta::assert_snapshot!(checked, @"
    error: scene.json: the scene measures 1.0e25 m, and accelerators hold 1e-12 to 1e12 m
    hint: scale its objects, or leave out what stands far from the others
    ");
    // A point far away is nothing to tell apart.
    let bench = Bench::new();
    bench.write("far.obj", b"v 0 1e38 0\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 1 1\nf 2 3 4\n");
    let output = bench.run(&["render", "far.obj", "-o", "out", "--accel", "bvh"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
}

#[test]
fn settings_and_folders_that_cannot_be_say_why() {
    let bench = Bench::with_scene(r#"{"etendue": 1, "objects": []}"#);
    insta::assert_snapshot!(refused(&bench, &["--set", "camera.fov=1e400"]), @"error: --set camera.fov=1e400: a number out of range: the largest is about 1.8e308");
    insta::assert_snapshot!(refused(&bench, &["--set", "camera.fov=1e-320"]), @"error: --set camera.fov=1e-320: camera.fov: 0.00000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000001 is under 0.0000002 degrees; no ray bends so little");
    insta::assert_snapshot!(refused(&bench, &["--samples", "99999999999"]), @"
    error: invalid value '99999999999' for '--samples <N>': 99999999999 is not in 1..=1048576

    For more information, try '--help'.
    ");
    bench.write("taken", b"");
    let into_a_file = ["render", "scene.json", "-o", "taken"];
    insta::assert_snapshot!(refused_command(&bench, &into_a_file), @"
    error: cannot write taken: File exists (os error 17)
    hint: it is a file; choose another folder
    ");
}

#[test]
fn bytes_of_other_files_are_no_models_and_never_reach_the_terminal() {
    let bench = Bench::new();
    bench.write("noise.obj", b"\x7fELF\0\0\0\n\0\xff\n");
    insta::assert_snapshot!(refused_command(&bench, &["render", "noise.obj", "-o", "out"]), @"
    error: noise.obj: the file: it is a program, not an OBJ model
    hint: name the model itself
    ");
    bench.write("colour.obj", b"v 1 2 \x1b[31mred\n");
    let output = bench.run(&["render", "colour.obj", "-o", "out"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(!output.stderr.contains(&0x1b), "{}", text(&output.stderr));
    bench.write("empty.glb", b"");
    insta::assert_snapshot!(refused_command(&bench, &["render", "empty.glb", "-o", "out"]), @"
    error: empty.glb: the file: it is empty
    hint: copy or export it again
    ");
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

fn refused_model(bytes: &[u8], more: &[&str]) -> String {
    let bench = Bench::new();
    bench.write("model.glb", bytes);
    let arguments = [&["render", "model.glb", "-o", "out"], more].concat();
    refused_command(&bench, &arguments)
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
    let lengths = [0, 3, 12, 19, 20, whole.len() / 2, whole.len() - 1];
    let messages = lengths
        .map(|length| under(&format!("{length} bytes"), &refused_model(&whole[..length], &[])));
    insta::assert_snapshot!(messages.concat());
}

#[test]
fn indices_out_of_range_are_refused() {
    insta::assert_snapshot!(refused_model(&glb(&CORNERS, &[0, 1, 3], ""), &[]), @"
    error: model.glb: meshes[0].primitives[0]: triangle 0 names vertex 3, but there are only 3 vertices
    hint: export the file again
    ");
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
    insta::assert_snapshot!(format!("{:#}", report["notes"]), @r#"
    [
      "meshes[0].primitives[0]: triangles with a corner that is not a finite number are dropped"
    ]
    "#);
    insta::assert_snapshot!(refused_model(&model, &["--strict"]), @"error: model.glb: meshes[0].primitives[0]: 1 triangle with a corner that is not a finite number; without --strict they are dropped");
}

#[test]
fn compressed_models_are_named_with_the_command_that_converts_them() {
    let both = "ACME_unheard_of\", \"KHR_texture_basisu";
    let extensions = ["EXT_texture_avif", "ACME_unheard_of", both];
    let messages = extensions.map(|extension| {
        under(extension, &refused_model(&glb(&CORNERS, &[0, 1, 2], extension), &[]))
    });
    insta::assert_snapshot!(messages.concat());
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
    let within = ["render", "scene.json", "-o", "file/out"];
    insta::assert_snapshot!(refused_command(&bench, &within), @"
    error: cannot write file/out: Not a directory (os error 20)
    hint: a part of the path is a file; choose another folder
    ");
    insta::assert_snapshot!(refused_command(&bench, &["render", "scene.json", "-o", "file"]), @"
    error: cannot write file: File exists (os error 17)
    hint: it is a file; choose another folder
    ");
}

#[cfg(feature = "embree")]
#[test]
fn instruction_sets_that_there_are_not_are_refused_by_name() {
    let bench = Bench::with_scene(r#"{"etendue": 1, "objects": [{"shape": "box"}]}"#);
    // Which there are is the processor's.
    let message = refused(&bench, &["--isa", "mmx"]);
    assert!(message.contains("isa: unknown instruction set \"mmx\""), "{message}");
    insta::assert_snapshot!(refused(&bench, &["--isa", "avx2", "--accel", "bvh"]), @"
    error: only Embree can be told an instruction set
    hint: leave `--isa` out, or use `--accel embree`
    ");
    insta::assert_snapshot!(refused(&bench, &["--accel-mode", "sloppy"]), @"
    error: invalid value 'sloppy' for '--accel-mode <ACCEL_MODE>'
      [possible values: robust, fast]

    For more information, try '--help'.
    ");
}

#[test]
fn a_memory_limit_that_the_build_would_pass_stops_it() {
    let bench =
        Bench::with_scene(r#"{"etendue": 1, "objects": [{"shape": "blob", "triangles": 200000}]}"#);
    for accel in AccelName::built().map(AccelName::name) {
        // How much it takes is the accelerator's own.
        let message = refused(&bench, &["--memory-limit", "1M", "--accel", accel]);
        assert!(message.contains("--memory-limit"), "{message}");
    }
}

#[test]
fn options_that_mean_nothing_are_refused() {
    let bench = Bench::with_scene(r#"{"etendue": 1}"#);
    let cases = [
        ["--outputs", "gif"],
        ["--layers", "dept"],
        ["--set", "camera"],
        ["--set", "render.samples=0"],
        ["--memory-limit", "4 elephants"],
        ["--camera", "front"],
        ["--samples", "-1"],
        ["--seed", "-1"],
        ["--threads", "-1"],
        ["--memory-limit", "-1"],
        ["--checkpoint", "-1"],
        ["--set", "camera={\"type\": \"pinhole\", \"fov\": 3, \"fov\": 40}"],
    ];
    let mut all = cases.map(|more| under(&more.join(" "), &refused(&bench, &more))).concat();
    let plan = ["plan", "scene.json", "--tolerance", "1 px"];
    all += &under(&plan.join(" "), &refused_command(&bench, &plan));
    insta::assert_snapshot!(all);
}

#[test]
fn lenses_that_leave_no_opening_are_refused() {
    let camera = |number: &str| {
        format!(
            r#"{{"etendue": 1, "camera": {{"type": "thin_lens", "focal_length": 50, "f_number": {number},
            "focus_distance": 3, "sensor_height": 24}}}}"#
        )
    };
    insta::assert_snapshot!(refused(&Bench::with_scene(&camera("1e300")), &[]), @"error: scene.json, line 1, column 68: camera.f_number: 1000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000 cannot be set: f/1000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000 would leave an opening of 2.5e-299 mm");
}

#[test]
fn a_folder_where_a_file_is_to_be_is_refused_before_rendering() {
    let bench = Bench::with_scene(r#"{"etendue": 1}"#);
    std::fs::create_dir_all(bench.path("out/picture.png")).unwrap();
    insta::assert_snapshot!(bench.refusal(&["render", "scene.json", "-o", "out"]), @"
    note: scene: nothing to draw: there is no triangle, and all rays miss; check the export, or give the scene objects
    error: out/picture.png: is a folder, where a file is to be written
    hint: remove or rename it
    ");
    assert!(!bench.path("out/etendue-manifest.json").exists());
}
