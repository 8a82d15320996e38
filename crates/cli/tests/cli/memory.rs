//! Scenes that would not fit into memory are refused in a sentence before work starts, and no small
//! file makes much appear.

use std::process::{Command, Output};

use serde_json::json;

use crate::run::{Bench, assets, text};

/// Runs the command with so many kilobytes of addresses: a memory taken in spite of the account is an
/// abort here, not a slow machine.
fn run(bench: &Bench, kilobytes: u32, arguments: &[&str]) -> Output {
    let script = format!("ulimit -v {kilobytes}; exec timeout -k 1 120 \"$0\" \"$@\"");
    Command::new("sh")
        .args(["-c", &script, env!("CARGO_BIN_EXE_etendue")])
        .args(arguments)
        .current_dir(bench.path(""))
        .output()
        .expect("the command runs")
}

fn refused(bench: &Bench, arguments: &[&str], words: &[&str]) {
    let output = run(bench, 1_500_000, arguments);
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    for word in words {
        assert!(message.contains(word), "expected \"{word}\" in: {message}");
    }
    assert!(!bench.path("o").exists(), "{arguments:?} left a folder");
}

const BOX: &str = r#"{"etendue": 1, "objects": [{"shape": "box"}], "tracer": {"type": "facing"},
    "layers": ["depth", "normal"]}"#;

#[test]
fn pictures_over_the_limit_are_refused_before_work_starts() {
    let bench = Bench::with_scene(BOX);
    let render = |size, more: &[&'static str]| {
        let words = ["render", "scene.json", "-o", "o", "--set", size];
        [words.as_slice(), more].concat()
    };
    let large = "camera.sensor.resolution=[8000,8000]";
    refused(&bench, &render(large, &[]), &["8000 x 8000", "ulimit -v", "needs", "GiB"]);
    let huge = "camera.sensor.resolution=[40000,40000]";
    refused(&bench, &render(huge, &[]), &["40000 x 40000", "GiB"]);
    let limited = render("camera.sensor.resolution=[2000,2000]", &["--memory-limit", "100M"]);
    refused(&bench, &limited, &["2000 x 2000", "--memory-limit allows 100.0 MiB"]);
}

#[test]
fn shapes_over_the_limit_are_refused_before_they_are_made() {
    let bench = Bench::new();
    let scene = json!({"etendue": 1, "objects": [{"shape": "blob", "triangles": 1_000_000_000}]});
    bench.write("scene.json", scene.to_string().as_bytes());
    let words = ["1000000000 triangles", "objects[0]", "needs"];
    refused(&bench, &["render", "scene.json", "-o", "o"], &words);
    let limited = ["render", "scene.json", "-o", "o", "--memory-limit", "200M"];
    refused(&bench, &limited, &["--memory-limit allows 200.0 MiB"]);
    refused(&bench, &["check", "scene.json"], &["1000000000 triangles"]);
}

/// Copies of copies: a thousand and a thousand lists of a few bytes are a million placements.
#[test]
fn copies_of_copies_are_counted_before_they_are_made() {
    let bench = Bench::new();
    let node = json!({"mesh": 0});
    let gltf = json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": (0..4000).collect::<Vec<u32>>()}],
        "nodes": vec![node; 4000],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"componentType": 5126, "count": 3, "type": "VEC3"}],
    });
    bench.write("many.gltf", gltf.to_string().as_bytes());
    let copies = vec![json!({}); 4000];
    let scene = json!({"etendue": 1, "objects": [{"file": "many.gltf", "instances": copies}]});
    bench.write("scene.json", scene.to_string().as_bytes());
    refused(&bench, &["render", "scene.json", "-o", "o"], &["placing", "needs", "ulimit -v"]);
}

#[test]
fn models_that_make_much_of_nothing_are_refused() {
    let bench = Bench::new();
    let extension = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}});
    let model = |count: u64| {
        json!({
            "asset": {"version": "2.0"},
            "extensionsUsed": ["EXT_mesh_gpu_instancing"],
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0, "extensions": extension}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 1}}]}],
            "accessors": [
                {"componentType": 5126, "count": count, "type": "VEC3"},
                {"componentType": 5126, "count": 3, "type": "VEC3"},
            ],
        })
    };
    bench.write("few.gltf", model(3).to_string().as_bytes());
    let output = run(&bench, 1_500_000, &["check", "few.gltf"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    for count in [1 << 22, 1 << 26, u64::from(u32::MAX)] {
        bench.write("much.gltf", model(count).to_string().as_bytes());
        refused(&bench, &["check", "much.gltf"], &["much.gltf", "of memory", "of files"]);
    }
    if let Some(assets) = assets("models_that_make_much_of_nothing_are_refused") {
        for name in ["inst67M.gltf", "zeros20.gltf"] {
            let path = assets.join("reference/hostile").join(name);
            let output = run(&bench, 1_500_000, &["check", &path.to_string_lossy()]);
            let message = text(&output.stderr);
            assert_eq!(output.status.code(), Some(2), "{name}: {message}");
            assert!(message.contains("of memory"), "{message}");
        }
    }
}

/// A model that another program touches while it is rendered: here in the future, which is later than
/// any load.
#[test]
fn models_that_change_while_they_are_rendered_are_named() {
    let bench = Bench::with_scene(
        r#"{"etendue": 1, "objects": [{"file": "a.obj"}], "layers": ["depth"],
            "camera": {"type": "pinhole", "sensor": {"resolution": [8, 8]}}}"#,
    );
    bench.write("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    bench.render(&["--report", "report.json"]);
    assert_eq!(bench.json("report.json")["notes"].as_array().map(Vec::len), Some(0));
    let tomorrow = std::time::SystemTime::now() + std::time::Duration::from_secs(86_400);
    let file = std::fs::File::options().write(true).open(bench.path("a.obj")).unwrap();
    file.set_modified(tomorrow).unwrap();
    bench.render(&["--report", "report.json"]);
    insta::assert_snapshot!(bench.json("report.json")["notes"], @r#"["./a.obj changed while it was rendered: what is seen may be old or new; render again"]"#);
}

/// Models that were read before anything was traced may change: no note, and the same picture.
#[test]
fn copies_of_models_may_change_while_they_are_rendered() {
    let bench = Bench::with_scene(
        r#"{"etendue": 1, "objects": [{"file": "a.ply"}], "layers": ["depth"],
            "camera": {"type": "pinhole", "sensor": {"resolution": [8, 8]}}}"#,
    );
    let mut ply = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n\
        property float y\nproperty float z\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n"
        .to_vec();
    ply.extend(
        [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()),
    );
    ply.push(3);
    ply.extend([0_i32, 1, 2].iter().flat_map(|i| i.to_le_bytes()));
    bench.write("a.ply", &ply);
    let tomorrow = std::time::SystemTime::now() + std::time::Duration::from_secs(86_400);
    let file = std::fs::File::options().write(true).open(bench.path("a.ply")).unwrap();
    file.set_modified(tomorrow).unwrap();
    let seen = |arguments: &[&str]| {
        bench.render(&[&["--report", "report.json"], arguments].concat());
        let report = bench.json("report.json");
        (report["notes"].as_array().map(Vec::len), report["image_hash"].clone())
    };
    let (mapped, copied) = (seen(&[]), seen(&["--copy"]));
    assert_eq!((mapped.0, copied.0), (Some(1), Some(0)));
    assert_eq!(mapped.1, copied.1);
}

/// The peak that the system tells, against the forecast, for the example scenes: layers alone, a
/// million triangles, placements, passes over the picture, and what light fields leave.
#[test]
fn forecasts_are_within_half_as_much_again_of_the_peak() {
    let scenes = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let fewer = ["--set", "render.samples=8"];
    let waves = [
        "--set=camera.diffraction=true",
        "--set=camera.sensor.resolution=[80,64]",
        "--set=render.samples=9",
    ];
    let cases: [(&str, &[&str]); 11] = [
        ("cube.json", &[]),
        ("first-light.json", &[]),
        ("instances.json", &[]),
        ("orthographic.json", &[]),
        ("opencv.json", &[]),
        ("double-gauss.json", &fewer),
        ("light-field.json", &fewer),
        ("light-field-focused.json", &fewer),
        // Copies whose boxes meet.
        ("forest.json", &fewer),
        ("gallery/coded-aperture-stopped.json", &waves),
        // All at one depth.
        ("slanted-edge.json", &waves),
    ];
    let bench = Bench::new();
    for (name, more) in cases {
        let scene = scenes.join(name);
        let scene = scene.to_string_lossy();
        let check = bench.run(&[&["check", &scene, "--json"], more].concat());
        assert!(check.status.success(), "{name}: {}", text(&check.stderr));
        let check: serde_json::Value = serde_json::from_slice(&check.stdout).expect("JSON");
        let forecast = check["memory"]["total"].as_f64().expect("a number");
        let render = ["render", &scene, "-o", "out", "--quiet", "--report", "report.json"];
        let output = bench.run(&[&render, more].concat());
        assert!(output.status.success(), "{name}: {}", text(&output.stderr));
        let peak = bench.json("report.json")["peak_memory_bytes"].as_f64().expect("a number");
        let ratio = forecast / peak;
        println!("{name}: forecast {forecast:.0}, peak {peak:.0} bytes: {ratio:.2}");
        assert!((1.0 / 1.5..=1.5).contains(&ratio), "{name}: {forecast} for {peak}");
    }
}

/// `count` copies of a small sphere, whose places are an array in a file.
fn copies(count: u32) -> Bench {
    let bench = Bench::new();
    let shape = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({count}, 3, 4), }}");
    let mut array = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    array.extend(format!("{shape:<117}\n").bytes());
    for i in 0..count {
        let (x, y) = (f64::from(i % 300), f64::from(i / 300));
        let rows = [1.0, 0.0, 0.0, 3.0 * x, 0.0, 1.0, 0.0, 3.0 * y, 0.0, 0.0, 1.0, 0.0];
        array.extend(rows.map(f64::to_le_bytes).as_flattened());
    }
    bench.write("places.npy", &array);
    let scene = json!({"etendue": 1, "layers": ["depth"],
        "camera": {"type": "pinhole", "sensor": {"resolution": [64, 48]}},
        "objects": [{"shape": "sphere", "triangles": 80, "instances": "places.npy"}]});
    bench.write("scene.json", scene.to_string().as_bytes());
    bench
}

/// The law of [`forecasts_are_within_half_as_much_again_of_the_peak`] for copies, and of the limit: what may
/// pass it is refused, and what is not refused does not.
#[test]
fn copies_are_in_the_forecast_and_no_render_passes_its_limit() {
    let bench = copies(40_000);
    let check = bench.run(&["check", "scene.json", "--json"]);
    let check: serde_json::Value = serde_json::from_slice(&check.stdout).expect("JSON");
    let total = check["memory"]["total"].as_f64().expect("a number");
    // The least that is let through: the forecast and the quarter that it may be too low.
    let least = (1.25 * total / 1_048_576.0).ceil();
    for (megabytes, fits) in [(20.0, false), (least - 2.0, false), (least, true)] {
        let limit = format!("{megabytes}M");
        let _ = std::fs::remove_file(bench.path("report.json"));
        let output = bench.run(&[
            "render",
            "scene.json",
            "-o",
            "out",
            "--report",
            "report.json",
            "--memory-limit",
            &limit,
        ]);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(if fits { 0 } else { 2 }), "{limit}: {said}");
        if !fits {
            assert!(said.contains("40000 copies") && said.contains("--memory-limit"), "{said}");
            assert!(!bench.path("out").exists(), "{limit} left a folder");
            continue;
        }
        let peak = bench.json("report.json")["peak_memory_bytes"].as_f64().expect("a number");
        assert!(peak <= megabytes * 1_048_576.0, "{limit}: {peak}");
        assert!((1.0 / 1.5..=1.5).contains(&(total / peak)), "{total} for {peak}");
    }
}

/// The law of [`forecasts_are_within_half_as_much_again_of_the_peak`] for a surface and for an environment by wavelength,
/// which are held as they are and once more in the sensor's bands.
#[test]
fn cubes_are_in_the_forecast() {
    let bench = Bench::new();
    let values = vec![0.25; 512 * 512 * 24];
    bench.write("cube.npy", &crate::expose::npy(&[512, 512, 24], &values));
    let cube = json!({"cube": "cube.npy", "bands": {"from": 400, "to": 700, "count": 24}});
    let sensors = [
        json!({"resolution": [64, 64]}),
        json!({"type": "multispectral", "resolution": [64, 64], "bands": {"from": 400, "to": 700, "count": 24}}),
    ];
    for (sensor, around) in sensors.iter().flat_map(|sensor| [(sensor, false), (sensor, true)]) {
        let color = if around { json!([0.5, 0.5, 0.5]) } else { cube.clone() };
        let mut scene = json!({"etendue": 1, "tracer": {"type": "direct"},
            "camera": {"type": "pinhole", "sensor": sensor}, "objects": [{"shape": "rectangle", "material": "a"}],
            "materials": {"a": {"type": "matte", "color": color}}});
        if around {
            scene["lights"] = json!([{"type": "environment", "image": cube}]);
        }
        bench.write("scene.json", scene.to_string().as_bytes());
        let check = bench.run(&["check", "scene.json", "--json"]);
        let check: serde_json::Value = serde_json::from_slice(&check.stdout).expect("JSON");
        let total = check["memory"]["total"].as_f64().expect("a number");
        bench.render(&["--report", "report.json"]);
        let peak = bench.json("report.json")["peak_memory_bytes"].as_f64().expect("a number");
        println!("forecast {total}, peak {peak}: {:.2}", total / peak);
        assert!((1.0 / 1.5..=1.5).contains(&(total / peak)), "{total} for {peak}");
        assert!(total > 4.0 * 512.0 * 512.0 * 24.0, "the cube is in it: {total}");
    }
}

#[test]
fn plans_and_checks_tell_what_memory_a_render_takes() {
    let bench = Bench::with_scene(BOX);
    let output = bench.run(&["plan", "scene.json"]);
    let plan = text(&output.stdout);
    let line = plan.lines().find(|line| line.trim_start().starts_with("memory"));
    let line = line.unwrap_or_else(|| panic!("{plan}"));
    assert!(line.contains("MiB") && plan.contains("structure"), "{plan}");
    let of = |more: &[&str], key: &str| {
        let output = bench.run(&[&["check", "scene.json", "--json"], more].concat());
        let check: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        check["memory"][key].as_u64().expect("a number")
    };
    let size = ["--set", "camera.sensor.resolution=[100,100]"];
    // Three f32 of the picture, and f64: one of depth, three of the normal.
    assert_eq!(of(&size, "film"), 10_000 * (12 + 32));
    assert_eq!(of(&size, "sums"), 0);
    let samples = [size.as_slice(), &["--set", "render.samples=16"]].concat();
    assert_eq!(of(&samples, "sums"), 10_000 * 3 * 16, "a sum and its remainder for each colour");
}

/// From where the program hardly starts to more than any of these takes.
#[test]
fn no_command_aborts_where_addresses_are_few() {
    let bench = Bench::with_scene(BOX);
    bench.write(
        "lens.json",
        br#"{"elements": [{"type": "surface", "radius": 50, "thickness": 4, "glass": "N-BK7",
            "semi_diameter": 9}, {"type": "surface", "radius": -50}]}"#,
    );
    // As large as makes Embree build with all threads.
    let blob = json!({"etendue": 1, "objects": [{"shape": "blob", "triangles": 100_000}]});
    bench.write("blob.json", blob.to_string().as_bytes());
    let small = ["--set", "camera.sensor.resolution=[32,24]"];
    let render = |scene| [&["render", scene, "-o", "o", "--quiet"], &small[..]].concat();
    let commands: [&[&str]; 5] = [
        &["check", "scene.json"],
        &["plan", "scene.json"],
        &["lens", "lens.json"],
        &render("scene.json"),
        &render("blob.json"),
    ];
    // The least limit with which a command line is read: 4 MiB are left to the program then.
    let is_read = |&kilobytes: &u32| run(&bench, kilobytes, &["--help"]).status.code() == Some(0);
    let roughly = (40_000..600_000).step_by(2_000).find(is_read).expect("600 MB are enough");
    let least = (roughly - 2_000..=roughly).step_by(100).find(is_read).expect("found above");
    // In small steps there, where the many lists of a few bytes are made. Of less than 300 KiB
    // the system's loader, the C++ library and Rust's runtime dispose, before `main` does.
    for kilobytes in (least - 3_700..least + 6_000).step_by(100) {
        for arguments in [&["--help"][..], commands[2]] {
            ends_well(&bench, kilobytes, arguments);
        }
    }
    let mut done = 0;
    for kilobytes in
        (least..600_000).step_by(30_000).chain([700_000, 850_000, 1_000_000, 1_400_000, 2_000_000])
    {
        done +=
            commands.iter().filter(|command| ends_well(&bench, kilobytes, command) == 0).count();
    }
    assert!(done >= commands.len(), "where there is enough, all of them work");
}

/// Runs the command and gives its exit code, which is of one that worked (0) or refused (2).
#[track_caller]
fn ends_well(bench: &Bench, kilobytes: u32, arguments: &[&str]) -> i32 {
    let output = run(bench, kilobytes, arguments);
    let said = text(&output.stderr);
    let at = format!("{kilobytes} kB, {arguments:?}: {:?}: {said}", output.status);
    let code = output.status.code().unwrap_or_else(|| panic!("{at}"));
    assert!([0, 2].contains(&code), "{at}");
    if code == 2 {
        // One sentence, and below it what would do.
        let is_sentence = said.starts_with("error: ")
            && said.lines().skip(1).all(|line| line.starts_with("hint: "));
        assert!(is_sentence, "{at}");
    }
    code
}

/// A skinned mesh of few bytes a vertex and a mesh whose long name each of its primitives has.
#[test]
fn names_of_meshes_are_spoken_for() {
    let bench = Bench::new();
    let primitives = vec![json!({"attributes": {"POSITION": 0}}); 20_000];
    let model = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "accessors": [{"componentType": 5126, "count": 3, "type": "VEC3"}],
        "meshes": [{"name": "n".repeat(1 << 16), "primitives": primitives}],
    });
    bench.write("names.gltf", model.to_string().as_bytes());
    let arguments = ["check", "names.gltf"];
    refused(&bench, &arguments, &["names.gltf", "of memory"]);
}
