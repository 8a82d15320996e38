//! Files that are no files, files that would cost without end, and files that real programs write.

use std::path::Path;
use std::process::{Command, Output};

use crate::run::{Bench, text, under};

/// Runs the command, which is killed when it hangs and gets no more than 3 GB of addresses.
fn run(bench: &Bench, arguments: &[&str]) -> Output {
    let script = "ulimit -v 3000000; exec timeout -k 1 120 \"$0\" \"$@\"";
    let output = Command::new("sh")
        .args(["-c", script, env!("CARGO_BIN_EXE_etendue")])
        .args(arguments)
        .current_dir(bench.path(""))
        .output()
        .expect("the command runs");
    assert_ne!(output.status.code(), Some(124), "{arguments:?} hangs");
    output
}

/// Runs the command, which must refuse its input; the message.
fn refused(bench: &Bench, arguments: &[&str]) -> String {
    let output = run(bench, arguments);
    let message = bench.said(&output);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    message
}

/// Output of `check --json`.
fn checked(bench: &Bench, file: &str) -> serde_json::Value {
    let output = run(bench, &["check", file, "--json"]);
    assert!(output.status.success(), "{file}: {}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

fn pipe(bench: &Bench, name: &str) {
    assert!(Command::new("mkfifo").arg(bench.path(name)).status().unwrap().success());
}

#[test]
fn headers_of_npy_files_are_read_strictly() {
    let scene = r#"{"etendue": 1, "objects": [{"shape": "box", "instances": "m.npy"}]}"#;
    let bench = Bench::with_scene(scene);
    let mut braces = b"\x93NUMPY\x01\x00\x0e\x00".to_vec();
    braces.extend([b'{'; 14]);
    bench.write("m.npy", &braces);
    insta::assert_snapshot!(refused(&bench, &["check", "scene.json"]), @r#"
    error: scene.json, line 1, column 45: objects[0].instances: "m.npy" has a broken header: expected a string, found "{{{{{{{{{{{{{"
    hint: write it with numpy.save
    "#);
    let mut long = b"\x93NUMPY\x02\x00\xff\xff\xff\x7f".to_vec();
    long.extend(b"{'descr': '<f8', 'fortran_order': False, 'shape': (1, 4, 4), }");
    bench.write("m.npy", &long);
    insta::assert_snapshot!(refused(&bench, &["check", "scene.json"]), @r#"
    error: scene.json, line 1, column 45: objects[0].instances: "m.npy" has a header of 2147483647 bytes, where an array of numbers needs a hundred
    hint: write it with numpy.save
    "#);
}

#[test]
fn faces_of_many_corners_keep_them() {
    let bench = Bench::new();
    let corners = 19_501;
    let mut face = String::from("v .5 -.5 .5\nv -.5 -.5 .5\nv -.5 -.5 1e-160\nv -.5 .5 -.5\nf");
    for corner in 0..corners {
        face += &format!(" {}", corner % 4 + 1);
    }
    bench.write("again.obj", face.as_bytes());
    assert_eq!(checked(&bench, "again.obj")["triangles"], corners - 2);
    // A comb of 5000 teeth, whose triangles must cover its area once.
    let mut comb = String::from("v 0 0 0\nv 5000 0 0\nv 5000 1 0\n");
    for tooth in (0..5000).rev() {
        comb +=
            &format!("v {tooth}.75 1 0\nv {tooth}.75 9 0\nv {tooth}.25 9 0\nv {tooth}.25 1 0\n");
    }
    comb += "v 0 1 0\nf";
    for corner in 1..=20_004 {
        comb += &format!(" {corner}");
    }
    bench.write("comb.obj", comb.as_bytes());
    let found = checked(&bench, "comb.obj");
    assert_eq!((&found["triangles"], &found["defects"]["duplicate"]), (&20_002.into(), &0.into()));
}

#[test]
fn pipes_are_refused_wherever_a_file_is_named() {
    let bench = Bench::new();
    for name in
        ["p.json", "p.obj", "p.glb", "p.ply", "p.zmx", "p.npy", "p.png", "p.exr", "p.mtl", "p.bin"]
    {
        pipe(&bench, name);
    }
    let mut all = String::new();
    let mut refuse = |what: &str, arguments: &[&str]| {
        all += &under(
            &format!("{what}: etendue {}", arguments.join(" ")),
            &refused(&bench, arguments),
        );
    };
    for file in ["p.json", "p.obj", "p.glb", "p.ply"] {
        refuse("file", &["check", file]);
        refuse("file", &["render", file, "-o", "out"]);
    }
    refuse("file", &["lens", "p.zmx"]);
    refuse("file", &["lens", "p.json"]);
    refuse("file", &["sensor", "p.json"]);
    bench.write("lens.json", br#"{"elements": [{"type": "thin_lens", "focal_length": 50}]}"#);
    refuse("rays", &["lens", "lens.json", "--rays", "p.json"]);
    let scene = |keys: &str| {
        bench.write("scene.json", format!("{{\"etendue\": 1, {keys}}}").as_bytes());
    };
    scene(r#""objects": [{"shape": "box", "instances": "p.npy"}]"#);
    refuse("instances", &["check", "scene.json"]);
    for camera in [
        r#"{"type": "lens", "lens": "p.zmx"}"#,
        r#"{"type": "lens", "lens": "p.json"}"#,
        r#"{"type": "thin_lens", "focal_length": 50, "sensor_height": 24,
            "aperture": {"shape": "image", "file": "p.png", "width": 10}}"#,
        r#"{"type": "thin_lens", "focal_length": 50, "sensor_height": 24,
            "aperture": {"shape": "image", "file": "p.exr", "width": 10}}"#,
    ] {
        scene(&format!(r#""camera": {camera}, "objects": [{{"shape": "box"}}]"#));
        refuse(camera, &["check", "scene.json"]);
    }
    let small = r#""camera": {"type": "pinhole", "sensor": {"resolution": [8, 8]}}"#;
    scene(&format!(
        r#"{small}, "tracer": {{"type": "flat"}}, "objects": [{{"shape": "box", "material": "m"}}],
        "materials": {{"m": {{"type": "matte", "color": {{"image": "p.png"}}}}}}"#
    ));
    refuse("texture", &["render", "scene.json", "-o", "out", "--strict"]);
    scene(&format!(
        r#"{small}, "tracer": {{"type": "path"}}, "objects": [{{"shape": "box"}}],
        "lights": [{{"type": "environment", "image": "p.exr"}}]"#
    ));
    refuse("environment", &["render", "scene.json", "-o", "out", "--strict"]);
    // Models that name pipes: as good as files that are not there.
    bench.write("m.obj", b"mtllib p.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    assert_eq!(checked(&bench, "m.obj")["triangles"], 1);
    bench.write(
        "m.gltf",
        br#"{"asset": {"version": "2.0"}, "buffers": [{"byteLength": 4, "uri": "p.bin"}],
            "bufferViews": [{"buffer": 0, "byteLength": 4}]}"#,
    );
    refuse("buffer", &["check", "m.gltf"]);
    insta::assert_snapshot!(all);
}

#[test]
fn only_regular_files_are_replaced_by_outputs() {
    use std::os::unix::fs::FileTypeExt;
    let bench = Bench::with_scene(
        r#"{"etendue": 1, "camera": {"type": "pinhole", "sensor": {"resolution": [4, 3]}}}"#,
    );
    pipe(&bench, "pipe");
    let render = ["render", "scene.json", "-o", "out", "--quiet", "--report"];
    let reader = std::thread::spawn({
        let path = bench.path("pipe");
        move || std::fs::read(path).unwrap()
    });
    let output = run(&bench, &[&render[..], &["pipe"]].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let report: serde_json::Value = serde_json::from_slice(&reader.join().unwrap()).unwrap();
    assert_eq!(report["resolution"], serde_json::json!([4, 3]));
    assert!(std::fs::metadata(bench.path("pipe")).unwrap().file_type().is_fifo());

    // As much as can be tried: a test must not put the machine's devices at stake. A link stands
    // for the device, and would be replaced by a file.
    std::os::unix::fs::symlink("/dev/null", bench.path("null")).unwrap();
    let output = run(&bench, &[&render[..], &["null"]].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(std::fs::symlink_metadata(bench.path("null")).unwrap().is_symlink());

    // Standard output, as a pipe and as a file: first the report, then the names of the files.
    let all = [&render[..], &["/dev/stdout"]].concat();
    let told = text(&run(&bench, &all).stdout);
    assert!(told.starts_with('{') && told.trim_end().ends_with("layers.json"), "{told}");
    let status = Command::new(env!("CARGO_BIN_EXE_etendue"))
        .args(&all)
        .current_dir(bench.path(""))
        .stdout(std::fs::File::create(bench.path("told")).unwrap())
        .status();
    assert!(status.unwrap().success());
    let told = std::fs::read_to_string(bench.path("told")).unwrap();
    assert!(told.starts_with('{') && told.trim_end().ends_with("layers.json"), "{told}");
    assert!(Path::new("/dev/stdout").symlink_metadata().unwrap().is_symlink());

    bench.write("lens.json", br#"{"elements": [{"type": "thin_lens", "focal_length": 50}]}"#);
    let told = text(&run(&bench, &["lens", "lens.json", "--save", "/dev/stdout"]).stdout);
    assert!(told.starts_with('{') && told.contains("thin_lens"), "{told}");
}

#[test]
fn no_path_tells_which_files_exist_elsewhere() {
    let bench = Bench::new();
    std::fs::create_dir_all(bench.path("in/sub")).unwrap();
    std::fs::create_dir(bench.path("elsewhere")).unwrap();
    std::os::unix::fs::symlink(bench.path("elsewhere"), bench.path("in/link")).unwrap();
    bench.write("there.mtl", b"");
    bench.write("elsewhere/there.mtl", b"");
    let answer = |name: &str| {
        let model = format!("mtllib {name}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
        bench.write("in/m.obj", model.as_bytes());
        bench.write("in/s.json", br#"{"etendue": 1, "objects": [{"file": "m.obj"}]}"#);
        let output = run(&bench, &["check", "in/s.json"]);
        (output.status.code(), text(&output.stderr).replace(name, "NAME"))
    };
    for (there, missing) in [
        ("..\\there.mtl", "..\\hidden.mtl"),
        ("sub\\..\\..\\there.mtl", "sub\\..\\..\\hidden.mtl"),
        ("../there.mtl", "../hidden.mtl"),
        ("link/there.mtl", "link/hidden.mtl"),
        ("link\\there.mtl", "link\\hidden.mtl"),
    ] {
        let told = answer(there);
        assert_eq!(told.0, Some(2), "{there}: {}", told.1);
        assert_eq!(told, answer(missing), "{there}");
    }
    // Nor does a scene tell what a folder behind a link holds.
    bench.write("in/s.json", br#"{"etendue": 1, "objects": [{"file": "link/thre.obj"}]}"#);
    bench.write("elsewhere/three.obj", b"");
    let output = run(&bench, &["check", "in/s.json"]);
    assert!(!text(&output.stderr).contains("three"), "{}", text(&output.stderr));
    // Backslashes inside still lead to files.
    bench.write("in/sub/a.mtl", b"newmtl m\nKd 1 0 0\n");
    assert_eq!(answer("sub\\a.mtl").0, Some(0));
}

#[test]
fn many_of_anything_take_no_time_of_their_own() {
    let bench = Bench::new();
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let libraries: String = (0..100_000).map(|i| format!("mtllib a{i}\n")).collect();
    bench.write("libraries.obj", format!("{libraries}{triangle}f 1 2 3\n").as_bytes());
    let found = checked(&bench, "libraries.obj");
    assert!(found["findings"].as_array().unwrap().len() < 300);
    assert!(found["findings"].to_string().contains("only the first 1000 material files"));
    // Faces of too few corners among faces that count backwards.
    let short: String = (0..65_000).map(|_| "f -1 -2 -3\nf -1\n").collect();
    bench.write("short.obj", format!("{triangle}{short}").as_bytes());
    assert_eq!(checked(&bench, "short.obj")["triangles"], 65_000);
    // One position with ever another texture coordinate.
    let coordinates: String = (0..50_000).map(|i| format!("vt {i}\n")).collect();
    let faces: String = (1..50_000).map(|i| format!("f 1/{i} 1/{} 1/1\n", i + 1)).collect();
    bench.write("crowd.obj", format!("v 0 0 0\n{coordinates}{faces}").as_bytes());
    assert_eq!(checked(&bench, "crowd.obj")["defects"]["degenerate"], 49_999);
    // A chain of nodes.
    let nodes: Vec<String> =
        (1..60_000).map(|i| format!("{{\"children\": [{i}]}}")).chain(["{}".to_owned()]).collect();
    let gltf = format!(
        "{{\"asset\": {{\"version\": \"2.0\"}}, \"scenes\": [{{\"nodes\": [0]}}], \"nodes\": [{}]}}",
        nodes.join(",")
    );
    bench.write("chain.gltf", gltf.as_bytes());
    assert_eq!(checked(&bench, "chain.gltf")["triangles"], 0);
}

#[test]
fn fields_of_a_zemax_file_are_limited() {
    let bench = Bench::new();
    let fields: Vec<String> = (0..3000).map(|i| (f64::from(i) * 0.01).to_string()).collect();
    let surface = |n: u32, lines: &str| format!("SURF {n}\n  TYPE STANDARD\n{lines}");
    let text_of = |kind: u32| {
        format!(
            "MODE SEQ\nENPD 10\nFTYP {kind} 0 3000 1\nYFLN {}\nWAVL 0.55\n{}{}{}{}",
            fields.join(" "),
            surface(0, "  DISZ INFINITY\n"),
            surface(1, "  STOP\n  CURV 0.02\n  DISZ 4\n  GLAS ___BLANK 1 0 1.5 60\n  DIAM 8\n"),
            surface(2, "  CURV -0.02\n  DISZ 48\n  DIAM 8\n"),
            surface(3, "  DISZ 0\n")
        )
    };
    for kind in [0, 3] {
        bench.write("many.zmx", text_of(kind).as_bytes());
        let output = run(&bench, &["lens", "many.zmx", "--json"]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        assert!(report["fields"].as_array().unwrap().len() <= 100);
        assert!(report["notes"].to_string().contains("of 3000 fields the first 100"), "{report}");
    }
}

#[test]
fn depth_is_limited_everywhere() {
    let bench = Bench::with_scene(r#"{"etendue": 1}"#);
    let path = "a.".repeat(60_000) + "b=1";
    // Messages of what the command line says have all of it.
    let message = refused(&bench, &["check", "scene.json", "--set", &path]);
    assert!(message.contains("60001 steps"), "{message}");
    let deep = format!("camera={}", "[".repeat(60_000));
    let message = refused(&bench, &["check", "scene.json", "--set", &deep]);
    assert!(message.contains("camera"), "{message}");
    let mut all = String::new();
    let mut refuse = |arguments: &[&str]| {
        all += &under(&arguments.join(" "), &refused(&bench, arguments));
    };
    let nested = "[".repeat(100_000);
    for (name, before) in [
        ("deep.json", "{\"etendue\": 1, \"objects\": "),
        ("deep.gltf", "{\"asset\": {\"version\": \"2.0\"}, \"nodes\": "),
    ] {
        bench.write(name, format!("{before}{nested}").as_bytes());
        refuse(&["check", name]);
    }
    refuse(&["lens", "deep.json"]);
    refuse(&["sensor", "deep.json"]);
    // A long key, which the places of all below it would repeat.
    let numbers = vec!["1"; 200_000].join(",");
    let long = format!("{{\"etendue\": 1, \"{}\": [{numbers}]}}", "k".repeat(400_000));
    bench.write("long.json", long.as_bytes());
    refuse(&["check", "long.json"]);
    insta::assert_snapshot!(all);
}

#[test]
fn nothing_to_draw_is_said_once_everywhere() {
    let bench = Bench::with_scene(r#"{"etendue": 1}"#);
    bench.write("points.obj", b"v 0 0 0\nv 1 0 0\np 1 2\n");
    let told = "nothing to draw";
    for file in ["scene.json", "points.obj"] {
        let found = checked(&bench, file);
        let findings = found["findings"].as_array().unwrap();
        let empty: Vec<_> = findings.iter().filter(|f| f["kind"] == "empty").collect();
        assert_eq!(empty.len(), 1, "{found}");
        assert!(empty[0]["message"].as_str().unwrap().contains(told));
        assert_eq!(text(&run(&bench, &["check", file]).stdout).matches(told).count(), 1);
        let small = ["--set", "camera.sensor.resolution=[8, 8]"];
        let output = run(&bench, &[&["render", file, "-o", "out"], &small[..]].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        assert_eq!(text(&output.stderr).matches(told).count(), 1, "{}", text(&output.stderr));
    }
    let messages = ["empty.obj", "empty.ply", "empty.gltf", "empty.glb"].map(|name| {
        bench.write(name, b"");
        under(name, &refused(&bench, &["render", name, "-o", "out"]))
    });
    insta::assert_snapshot!(messages.concat());
}
