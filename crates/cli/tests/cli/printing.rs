//! Names in files do nothing to the terminal.

use crate::run::{Bench, text};

/// Escape sequences, a bell, C1 controls and letters that run backwards.
const NAME: &str = "a\u{1b}]0;pwned\u{7}\u{1b}[31m\u{9b}2J\u{202e}RED\u{2066}";

fn is_command(c: char) -> bool {
    (c.is_control() && c != '\n' && c != '\t')
        || ['\u{202e}', '\u{2066}', '\u{200f}', '\u{2028}'].contains(&c)
}

fn bench() -> Bench {
    let bench = Bench::new();
    let obj =
        format!("mtllib {NAME}.mtl\no {NAME}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl {NAME}\nf 1 2 3\n");
    bench.write("model.obj", obj.as_bytes());
    let title = serde_json::json!(format!("{NAME}\nerror: forged"));
    bench.write(
        "scene.json",
        format!(
            r#"{{"etendue": 1, "layers": ["depth", "ids"],
            "camera": {{"type": "pinhole", "sensor": {{"resolution": [8, 8]}}}},
            "materials": {{{title}: {{"type": "matte", "color": [1, 1, 1]}}}},
            "objects": [{{"file": "model.obj", "name": {title}}}]}}"#
        )
        .as_bytes(),
    );
    let lens = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/lenses/achromat.json");
    let lens = std::fs::read(lens).expect("a lens");
    let mut lens: serde_json::Value = serde_json::from_slice(&lens).expect("JSON");
    lens["name"] = title;
    bench.write("lens.json", lens.to_string().as_bytes());
    bench
}

#[test]
fn names_in_files_never_command_a_terminal() {
    let bench = bench();
    for arguments in [
        &["render", "model.obj", "-o", "out"][..],
        &["render", "scene.json", "-o", "out", "--report", "report.json"],
        &["check", "model.obj"],
        &["check", "model.obj", "--json"],
        &["check", "scene.json"],
        &["check", "scene.json", "--json"],
        &["plan", "scene.json"],
        &["plan", "scene.json", "--json"],
        &["lens", "lens.json"],
        &["lens", "lens.json", "--json"],
    ] {
        let output = bench.run(arguments);
        let (out, err) = (text(&output.stdout), text(&output.stderr));
        assert!(output.status.success(), "{arguments:?}: {err}");
        assert!(
            !out.contains(is_command) && !err.contains(is_command),
            "{arguments:?}: {out}{err}"
        );
        let forged = |text: &str| text.lines().any(|line| line.starts_with("error: forged"));
        assert!(!forged(&out) && !forged(&err), "{arguments:?}: {out}{err}");
    }
    for file in ["report.json", "out/layers.json"] {
        let json = std::fs::read_to_string(bench.path(file)).expect("JSON");
        assert!(!json.contains(is_command), "{file}");
    }
    // Spelled out, it is still the name.
    let output = bench.run(&["check", "model.obj", "--json"]);
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert!(found.to_string().contains("\u{202e}RED"), "{found}");
}

#[test]
fn notes_come_before_the_render_that_they_are_about() {
    let bench = Bench::new();
    bench.write("model.obj", b"mtllib absent.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let err = text(&bench.run(&["render", "model.obj", "-o", "out"]).stderr);
    assert!(err.starts_with("note: ") && err.contains("absent.mtl"), "{err}");
    // It is known, and said, though the render then comes to nothing.
    let refused = ["render", "model.obj", "-o", "out", "--isa", "sse2", "--accel", "bvh"];
    let err = text(&bench.run(&refused).stderr);
    assert!(err.starts_with("note: ") && err.contains("error: "), "{err}");
}

/// Text that is longer than what a pipe holds (64 KiB), for a reader that is slow, and for one that has
/// had enough.
#[test]
fn a_slow_reader_gets_all_and_one_that_leaves_is_no_fault() {
    let bench = Bench::new();
    let program = env!("CARGO_BIN_EXE_etendue");
    let run = |script: &str| {
        let mut command = std::process::Command::new("sh");
        command.args(["-c", script, program]).current_dir(bench.path(""));
        command.output().expect("a shell")
    };
    let all = bench.run(&["schema"]).stdout;
    assert!(all.len() > 1 << 16, "{} bytes", all.len());
    let slow = run("\"$0\" schema 2>err | { sleep 0.5; cat; }");
    assert_eq!((slow.status.code(), slow.stdout), (Some(0), all));
    let left = run("{ \"$0\" schema; echo $? >code; } 2>err | head -c 1");
    assert_eq!(left.stdout, b"{");
    let read = |name: &str| std::fs::read_to_string(bench.path(name)).expect("a file");
    assert_eq!((read("code").as_str(), read("err").as_str()), ("0\n", ""));
}
