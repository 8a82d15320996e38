//! What would not fit into memory is refused in a sentence before work starts, and no small file makes
//! much appear.

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
    let notes = bench.json("report.json")["notes"].to_string();
    assert!(notes.contains("a.obj changed while it was rendered"), "{notes}");
}
