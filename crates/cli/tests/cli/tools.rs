//! check, plan, schema, version.

use crate::run::{Bench, notes_in, text};

#[test]
fn version_names_the_program_and_what_traces() {
    let output = Bench::new().run(&["--version"]);
    let version = text(&output.stdout);
    assert!(version.starts_with(concat!("etendue ", env!("CARGO_PKG_VERSION"))), "{version}");
    assert!(version.contains("Embree"), "{version}");
}

#[test]
fn help_exists_for_every_command_and_shows_an_example() {
    let bench = Bench::new();
    for command in
        ["render", "check", "plan", "lens", "sensor", "bench", "schema", "completions", "man"]
    {
        let output = bench.run(&[command, "--help"]);
        assert!(output.status.success());
        assert!(text(&output.stdout).contains("Example"), "{command}");
    }
    assert_eq!(bench.run(&[]).status.code(), Some(2), "nothing asked for is no success");
}

#[test]
fn the_schema_is_json_and_knows_the_keys() {
    let output = Bench::new().run(&["schema"]);
    let schema: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    for key in ["etendue", "camera", "layers", "objects", "materials", "render"] {
        assert!(schema["properties"][key].is_object(), "{key}");
    }
}

#[test]
fn check_counts_and_measures() {
    let bench = Bench::with_scene(
        r#"{"etendue": 1, "objects": [
            {"shape": "box", "size": [2, 4, 6]},
            {"shape": "box", "size": [2, 4, 6], "transform": {"translate": [10, 0, 0]}}]}"#,
    );
    let output = bench.run(&["check", "scene.json", "--json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!((&found["triangles"], &found["triangles_unique"]), (&24.into(), &12.into()));
    let corner = |which: &str| -> Vec<f64> {
        found["bounds"][which].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
    };
    assert_eq!((corner("min"), corner("max")), (vec![-1.0, -2.0, -3.0], vec![11.0, 2.0, 3.0]));
}

#[test]
fn a_plan_says_what_is_off_and_why() {
    let bench =
        Bench::with_scene(r#"{"etendue": 1, "layers": ["depth"], "objects": [{"shape": "box"}]}"#);
    let plan = text(&bench.run(&["plan", "scene.json"]).stdout);
    assert!(plan.contains("vertex normals") && plan.contains("off"), "{plan}");
    let json = bench.run(&["plan", "scene.json", "--json"]);
    let decisions: Vec<serde_json::Value> = serde_json::from_slice(&json.stdout).expect("JSON");
    let surface = decisions.iter().find(|d| d["what"] == "surface").expect("a decision");
    assert_eq!(surface["choice"], "off", "depth needs no normals");
    assert_eq!(surface["value"], false);
    let memory = decisions.iter().find(|d| d["what"] == "memory").expect("a decision");
    assert!(memory["value"].as_u64().is_some_and(|bytes| bytes > 1 << 20), "{memory}");
    let table = text(&bench.run(&["plan", "scene.json", "--markdown"]).stdout);
    assert!(table.starts_with("| what | choice | because | saves | key |\n|---|"), "{table}");
    assert_eq!(table.lines().count(), 2 + decisions.len(), "{table}");
}

#[test]
fn a_plan_lists_the_accuracy_that_a_scene_sets() {
    let bench =
        Bench::with_scene(r#"{"etendue": 1, "layers": ["depth"], "objects": [{"shape": "box"}]}"#);
    let set = ["plan", "scene.json", "--json", "--set", "accuracy.view_psnr=40"];
    let decisions: Vec<serde_json::Value> =
        serde_json::from_slice(&bench.run(&set).stdout).expect("JSON");
    let rows: Vec<_> = decisions.iter().filter(|d| d["what"] == "accuracy").collect();
    assert_eq!(rows.len(), 1, "{decisions:?}");
    assert_eq!((&rows[0]["key"], &rows[0]["forced"]), (&"accuracy.view_psnr".into(), &true.into()));
    // What is out of range is refused by name.
    let beyond = ["plan", "scene.json", "--json", "--set", "accuracy.view_psnr=400"];
    insta::assert_snapshot!(bench.refusal(&beyond), @"
    error: --set accuracy.view_psnr=400: accuracy.view_psnr: 400 is above the most, 60
    hint: give a number from 0 to 60, or leave it out for 43
    ");
    let wrong = ["plan", "scene.json", "--json", "--set", "accuracy.roulette_after=1.5"];
    insta::assert_snapshot!(bench.refusal(&wrong), @"
    error: --set accuracy.roulette_after=1.5: accuracy.roulette_after: expected a whole number, found 1.5
    hint: give a whole number from 1 to 1024, or leave it out for 5
    ");
}

/// A number of what the scene has not is taken, and said to decide nothing: by each command as it says other notes.
#[test]
fn accuracy_that_decides_nothing_is_said() {
    let bench = Bench::with_scene(
        r#"{"etendue": 1, "layers": ["depth"], "objects": [{"shape": "box"}], "accuracy": {"view_psnr": 40}}"#,
    );
    let said = bench.run(&["plan", "scene.json"]);
    assert!(said.status.success(), "{}", text(&said.stderr));
    let row = "43 by itself; decides nothing here: the camera takes no light field [forced by accuracy.view_psnr]";
    assert!(text(&said.stdout).contains(row), "{}", text(&said.stdout));
    let checked = text(&bench.run(&["check", "scene.json"]).stdout);
    let finding = "`accuracy.view_psnr`: decides nothing here: the camera takes no light field";
    assert!(checked.contains(finding), "{checked}");
    let rendered = bench.run(&["render", "scene.json", "-o", "out"]);
    insta::assert_snapshot!(notes_in(&bench.said(&rendered)), @"note: `accuracy.view_psnr`: decides nothing here: the camera takes no light field; leave it out");
    // So is a setting by which bands share paths that run the same way.
    bench.write(
        "lit.json",
        br#"{"etendue": 1, "tracer": {"type": "direct"}, "objects": [{"shape": "box"}], "plan": {"shared_paths": true}}"#,
    );
    let checked = text(&bench.run(&["check", "lit.json"]).stdout);
    assert!(
        checked.contains("`plan.shared_paths`: decides nothing here: the camera has no lens"),
        "{checked}"
    );
}

#[test]
fn nothing_but_results_goes_to_standard_output() {
    let bench = Bench::with_scene(r#"{"etendue": 1, "objects": [{"shape": "box"}]}"#);
    let output = bench.run(&["render", "scene.json", "-o", "out", "--outputs", "exr"]);
    let out = text(&output.stdout);
    assert!(out.lines().all(|line| bench.path(line).is_file()), "{out}");
    let quiet = bench.run(&["render", "scene.json", "-o", "out", "--quiet"]);
    assert!(quiet.stderr.is_empty(), "{}", text(&quiet.stderr));
}

#[test]
fn man_pages_exist_for_the_program_and_every_command() {
    let bench = Bench::new();
    let output = bench.run(&["man", "man1"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    for name in ["etendue", "etendue-render", "etendue-lens", "etendue-man"] {
        let page = std::fs::read_to_string(bench.path("man1").join(format!("{name}.1")));
        let page = page.unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(page.contains(&format!(".TH {name} 1")), "{name}: {page}");
    }
    let page = std::fs::read_to_string(bench.path("man1/etendue-render.1")).unwrap();
    assert!(page.contains("checkpoint"), "{page}");
}

#[test]
fn completions_know_the_commands_and_their_options() {
    let bench = Bench::new();
    for shell in ["bash", "zsh", "fish"] {
        let output = bench.run(&["completions", shell]);
        assert!(output.status.success(), "{shell}: {}", text(&output.stderr));
        let script = text(&output.stdout);
        for word in ["render", "merge", "checkpoint", "opencv"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
    assert_eq!(bench.run(&["completions", "tcl"]).status.code(), Some(2));
}
