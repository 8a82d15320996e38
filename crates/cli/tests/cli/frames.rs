//! Many pictures of one scene.

mod refusals;

use serde_json::{Value, json};

use crate::run::{Bench, text, under};

/// A ball on a floor and the frames of it.
pub(crate) fn scene(frames: &Value) -> String {
    json!({
        "etendue": 1,
        "tracer": {"type": "facing"},
        "layers": ["depth", "position"],
        "render": {"samples": 1},
        "camera": {"type": "pinhole", "fov": 50,
                   "pose": {"from": [0.3, 1.5, 4], "look_at": [0, 0, 0]},
                   "sensor": {"resolution": [32, 24]}},
        "objects": [{"shape": "sphere"},
                    {"shape": "rectangle", "width": 40, "height": 40,
                     "transform": {"translate": [0, -1, 0], "rotate": [1, 0, 0, -90]}}],
        "frames": frames
    })
    .to_string()
}

#[test]
fn each_frame_is_the_picture_of_its_settings() {
    let frames = json!([{"camera.fov": 30}, {"camera.pose.from": [1, 2, 3], "render.samples": 2},
                        {"objects[0].transform.translate": [0.5, 0, 0]}]);
    let bench = Bench::with_scene(&scene(&frames));
    bench.render(&["--report", "report.json"]);
    let reports = bench.json("report.json");
    assert_eq!(reports.as_array().map(Vec::len), Some(3));
    let mut alone: Value = serde_json::from_str(&scene(&frames)).unwrap();
    alone.as_object_mut().unwrap().remove("frames");
    let alone = Bench::with_scene(&alone.to_string());
    let all = frames.as_array().unwrap();
    for (number, (frame, report)) in all.iter().zip(reports.as_array().unwrap()).enumerate() {
        let mut more = vec!["--report".to_owned(), "report.json".to_owned()];
        // The first has the number of a scene without frames.
        if number > 0 {
            more.extend(["--set".to_owned(), format!("render.frame={number}")]);
        }
        for (path, value) in frame.as_object().unwrap() {
            more.extend(["--set".to_owned(), format!("{path}={value}")]);
        }
        alone.render(&more.iter().map(String::as_str).collect::<Vec<_>>());
        let one = alone.json("report.json");
        for key in ["image_hash", "scene_hash", "resolution"] {
            assert_eq!(report[key], one[key], "frame {number}: {key}");
        }
    }
    let index = bench.json("out/index.json");
    assert_eq!(index["frames"][2]["folder"], "frames/000002");
}

/// Commands that examine a scene examine its frames: they count them, and refuse what a render would.
#[test]
fn check_and_plan_know_of_frames() {
    let bench = Bench::with_scene(&scene(&json!([{"camera.fov": 30}, {"camera.fov": 40}])));
    for (command, counted) in [("check", "frames        2;"), ("plan", "frames")] {
        let output = bench.run(&[command, "scene.json"]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        let told = text(&output.stdout);
        assert!(told.lines().any(|line| line.starts_with(counted)), "{told}");
    }
    for (key, value) in [("fob", 40), ("fov", 300)] {
        let wrong = json!({ format!("camera.{key}"): value });
        let bench = Bench::with_scene(&scene(&json!([{}, wrong])));
        for command in ["check", "plan", "render"] {
            let more: &[&str] = if command == "render" { &["-o", "out"] } else { &[] };
            let output = bench.run(&[&[command, "scene.json"], more].concat());
            assert_eq!(output.status.code(), Some(2), "{command}");
            let why = text(&output.stderr);
            assert_eq!(why.matches("frames[1]").count(), 1, "{command}: {why}");
            assert!(why.contains(key), "{command}: {why}");
        }
        assert!(!bench.path("out/frames/000000").exists(), "nothing is rendered first");
    }
}

/// 300 copies, whose numbers a mask of 8 bits cannot have.
#[test]
fn the_index_lists_no_file_that_was_not_written() {
    let place =
        |k: i32| json!({"translate": [f64::from(k % 20) - 9.5, f64::from(k / 20) - 7.0, -15]});
    let places: Vec<Value> = (0..300).map(place).collect();
    let mut scene: Value = serde_json::from_str(&scene(&json!([{}]))).unwrap();
    scene["layers"] = json!(["ids"]);
    scene["camera"]["pose"] = json!({"from": [0, 0, 0], "look_at": [0, 0, -1]});
    scene["camera"]["sensor"]["resolution"] = json!([160, 120]);
    scene["objects"] = json!([{"shape": "rectangle", "instances": places}]);
    let bench = Bench::with_scene(&scene.to_string());
    bench.render(&["--outputs", "png,npy,indexed"]);
    let index = bench.json("out/index.json");
    let layers = index["frames"][0]["files"].as_object().unwrap();
    let files = layers.values().flat_map(|files| files.as_object().unwrap());
    for (ending, file) in files {
        assert!(bench.path("out").join(file.as_str().unwrap()).exists(), "{ending}: {file}");
    }
    assert!(layers["Id.object"].get("indexed.png").is_some(), "{layers:?}");
    assert!(layers["Id.instance"].get("indexed.png").is_none(), "{layers:?}");
    assert!(layers["Id.instance"].get("png").is_some(), "{layers:?}");
}

#[test]
fn a_limit_of_memory_holds_for_every_frame() {
    let large = json!([{}, {"camera.sensor.resolution": [4000, 4000]}]);
    let bench = Bench::with_scene(&scene(&large));
    let output = bench.run(&["render", "scene.json", "-o", "out", "-q", "--memory-limit", "64M"]);
    let err = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{err}");
    assert!(err.contains("4000 x 4000") && err.contains("--memory-limit allows 64"), "{err}");
    assert!(bench.path("out/frames/000000/depth.npy").exists());
}

#[test]
fn resumed_frames_have_what_is_asked_for_and_parts_of_a_set_are_one() {
    let bench = Bench::with_scene(&scene(&json!({"type": "orbit", "count": 4})));
    bench.render(&["--outputs", "npy", "--frames", "2..4"]);
    bench.render(&["--outputs", "npy", "--frames", "0..2"]);
    let count = |bench: &Bench| bench.json("out/index.json")["frames"].as_array().map(Vec::len);
    assert_eq!(count(&bench), Some(4), "those of the other run, too");
    assert_eq!(bench.json("out/index.json")["frames"][3]["frame"], 3);
    assert!(!bench.path("out/frames/000001/layers.exr").exists());
    bench.render(&["--outputs", "npy,exr", "--resume"]);
    assert!(bench.path("out/frames/000001/layers.exr").exists());
    // As large as it was, and not what it was.
    let damaged = bench.path("out/frames/000002/depth.npy");
    let whole = std::fs::read(&damaged).unwrap();
    std::fs::write(&damaged, vec![0; whole.len()]).unwrap();
    bench.render(&["--outputs", "npy,exr", "--resume"]);
    assert_eq!(std::fs::read(&damaged).unwrap(), whole);
}

#[test]
fn points_of_one_frame_are_where_the_next_one_sees_them() {
    let orbit = json!({"type": "orbit", "count": 12, "center": [0, 0, 0]});
    let bench = Bench::with_scene(&scene(&orbit));
    bench.render(&[]);
    let index = bench.json("out/index.json");
    let frames = index["frames"].as_array().unwrap();
    assert_eq!(frames.len(), 12);
    let positions = bench.array("frames/000000/position");
    let depth = bench.array("frames/000001/depth");
    let m = |i: usize, k: usize| frames[1]["camera_from_world"][i][k].as_f64().unwrap();
    let k = |i: usize, j: usize| frames[1]["K"][i][j].as_f64().unwrap();
    let (mut seen, mut worst) = (0, 0.0_f64);
    for point in positions.chunks(3).filter(|point| point[0].is_finite()) {
        let at = |i: usize| (0..3).map(|j| m(i, j) * point[j]).sum::<f64>() + m(i, 3);
        let (x, y, z) = (at(0), at(1), at(2));
        let (u, v) = (k(0, 0) * x / z + k(0, 2), k(1, 1) * y / z + k(1, 2));
        // Near a pixel's centre the floor's depth there, carried over by its slope, is the point's.
        if !(0.0..31.0).contains(&u) || !(0.0..23.0).contains(&v) || point[1] > -0.999 {
            continue;
        }
        let (column, row) = (u.floor(), v.floor());
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "in the picture"
        )]
        let here = |c: f64, r: f64| 1.0 / depth[(r * 32.0 + c) as usize];
        // The inverse of depth is linear over a plane's picture.
        let (p, q) = (u - column, v - row);
        let corners = [here(column, row), here(column + 1.0, row), here(column, row + 1.0)];
        let fourth = here(column + 1.0, row + 1.0);
        let plane = corners[1] + corners[2] - corners[0];
        // All four on the floor, and none past its edge.
        if fourth == 0.0 || corners.contains(&0.0) || (plane / fourth - 1.0).abs() > 1e-9 {
            continue;
        }
        let inverse = corners[0] + p * (corners[1] - corners[0]) + q * (corners[2] - corners[0]);
        worst = worst.max((inverse * z - 1.0).abs());
        seen += 1;
    }
    assert!(seen > 50, "{seen}");
    // Roundings of f64 over a dozen steps.
    assert!(worst < 1e-12, "{worst}");
}

#[test]
fn written_data_sets_are_trajectories_again() {
    let orbit = json!({"type": "orbit", "count": 4, "center": [0, 0, 0]});
    let first = Bench::with_scene(&scene(&orbit));
    first.render(&[]);
    let read = |name: &str| std::fs::read(first.path("out").join(name)).unwrap();
    let mut tum = "# timestamp tx ty tz qx qy qz qw\n".to_owned();
    let images = text(&read("colmap/images.txt"));
    for (i, line) in images.lines().filter(|l| l.contains("picture.png")).enumerate() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [w, x, y, z, a, b, c] = [1, 2, 3, 4, 5, 6, 7].map(|k| words[k]);
        tum.push_str(&format!("{i}.5 {a} {b} {c} {x} {y} {z} {w}\n"));
    }
    let files: [(&str, Vec<u8>, Value); 3] = [
        ("transforms.json", read("transforms.json"), json!({})),
        ("images.txt", read("colmap/images.txt"), json!({})),
        ("poses.txt", tum.into_bytes(), json!({"maps": "camera_from_world"})),
    ];
    for (name, bytes, more) in files {
        let mut frames = json!({"type": "trajectory", "file": name});
        more.as_object().unwrap().iter().for_each(|(k, v)| frames[k] = v.clone());
        let mut again: Value = serde_json::from_str(&scene(&frames)).unwrap();
        if name != "poses.txt" {
            // These bring a K.
            again["camera"].as_object_mut().unwrap().remove("fov");
        }
        let bench = Bench::with_scene(&again.to_string());
        bench.write(name, &bytes);
        if name == "images.txt" {
            bench.write("cameras.txt", &read("colmap/cameras.txt"));
        }
        bench.render(&[]);
        for frame in 0..4 {
            let layer = format!("frames/00000{frame}/depth");
            let (old, new) = (first.array(&layer), bench.array(&layer));
            for (old, new) in old.iter().zip(&new) {
                // A turn there and back through a quaternion; silhouettes may move by a pixel.
                let is_near = (new / old - 1.0).abs() < 1e-9 || old == new;
                assert!(is_near, "{name} {frame}: {old} {new}");
            }
        }
    }
    let index =
        Bench::with_scene(&scene(&json!({"type": "poses", "times": [0.25, "50 ms"], "poses": [
        {"from": [0, 0, 4], "look_at": [0, 0, 0]}, {"from": [0, 1, 4], "look_at": [0, 0, 0]}]})));
    index.render(&[]);
    assert_eq!(index.json("out/index.json")["frames"][1]["time_s"], 0.05);
}

#[test]
fn complete_frames_are_left_and_the_rest_is_rendered() {
    let grid = json!({"type": "grid", "columns": 2, "rows": 2, "spacing": "65 mm"});
    let bench = Bench::with_scene(&scene(&grid));
    bench.render(&["--frames", "0..3"]);
    assert!(!bench.path("out/frames/000003").exists());
    let time = |n: u32| {
        bench
            .path(&format!("out/frames/00000{n}/layers.exr"))
            .metadata()
            .unwrap()
            .modified()
            .unwrap()
    };
    let before = [time(0), time(1), time(2)];
    // What a kill leaves of a manifest that was written anew.
    let part = bench.path("out/frames/000002/.etendue-manifest.json.abc123.part");
    std::fs::write(&part, b"").unwrap();
    // A frame that lost a file, and one that was stopped.
    std::fs::remove_file(bench.path("out/frames/000001/depth.npy")).unwrap();
    bench.render(&["--resume"]);
    assert_eq!([time(0), time(2)], [before[0], before[2]]);
    assert!(!part.exists(), "frames that are left as they are, too, are tidied");
    assert_ne!(time(1), before[1]);
    assert!(bench.path("out/frames/000003/layers.exr").exists());
    assert_eq!(bench.json("out/index.json")["frames"].as_array().map(Vec::len), Some(4));
    // Another scene is not what is there.
    bench.render(&["--resume", "--set", "camera.fov=51"]);
    assert_ne!(time(0), before[0]);
    // The baseline, to the right and down, with the scene's own pose in the middle.
    let at = |frame: usize| {
        let matrix = &bench.json("out/transforms.json")["frames"][frame]["transform_matrix"];
        [0, 1, 2].map(|row| matrix[row][3].as_f64().unwrap())
    };
    let (a, b) = (at(0), at(1));
    let distance: f64 = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
    assert!((distance - 0.065).abs() < 1e-15, "{distance}");
}

#[test]
fn files_lie_where_a_pattern_says_and_a_kill_leaves_nothing_half() {
    let grid = json!({"type": "grid", "columns": 3, "spacing": "65 mm"});
    let bench = Bench::with_scene(&scene(&grid));
    let by_layer = ["--pattern", "{layer}/{frame}", "--outputs", "png,npy,tum"];
    bench.render(&[&by_layer[..], &["--frames", "0..2"]].concat());
    let index = bench.json("out/index.json");
    let files = &index["frames"][1]["files"];
    assert_eq!(files["Depth"]["npy"], "depth/000001.npy");
    assert_eq!(files["Depth"]["tum.png"], "depth/000001.tum.png");
    assert_eq!(files["picture"]["png"], "picture/000001.png");
    for (_, layer) in files.as_object().unwrap() {
        for (_, path) in layer.as_object().unwrap() {
            assert!(bench.path("out").join(path.as_str().unwrap()).is_file(), "{path}");
        }
    }
    let left: Vec<_> = std::fs::read_dir(bench.path("out/frames")).unwrap().collect();
    assert_eq!(left.len(), 2, "a record a frame, and no folder of files under way: {left:?}");
    // What a kill leaves: a frame under way, and one whose record is not there yet.
    std::fs::create_dir(bench.path("out/frames/000002.unfinished")).unwrap();
    bench.write("out/frames/000002.unfinished/depth.npy", b"half");
    std::fs::remove_file(bench.path("out/frames/000001.json")).unwrap();
    let time = |n: u32| {
        let path = bench.path(&format!("out/depth/00000{n}.npy"));
        path.metadata().unwrap().modified().unwrap()
    };
    let before = [time(0), time(1)];
    bench.render(&[&by_layer[..], &["--resume"]].concat());
    assert_eq!(time(0), before[0]);
    assert_ne!(time(1), before[1]);
    assert_eq!(bench.array("depth/000002").len(), 32 * 24);
    assert!(!bench.path("out/frames/000002.unfinished").exists());
    // The same files as in folders of their own.
    let folders = Bench::with_scene(&scene(&grid));
    folders.render(&[]);
    assert_eq!(folders.array("frames/000002/position"), bench.array("position/000002"));
    let pattern = ["render", "scene.json", "-o", "out", "--pattern", "{frame}"];
    insta::assert_snapshot!(bench.refusal(&pattern), @"
    error: invalid value '{frame}' for '--pattern <NAMES>': wants {frame} and {layer} in it, as {layer}/{frame}

    For more information, try '--help'.
    ");
}

#[test]
fn a_killed_sequence_goes_on_where_it_was() {
    let orbit = json!({"type": "orbit", "count": 400, "center": [0, 0, 0]});
    let bench = Bench::with_scene(&scene(&orbit));
    let arguments =
        ["render", "scene.json", "-o", "out", "-q", "--set", "camera.sensor.resolution=[200,150]"];
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_etendue"))
        .args(arguments)
        .current_dir(bench.path(""))
        .stdout(std::process::Stdio::null())
        .spawn()
        .unwrap();
    while !bench.path("out/frames/000003/etendue-manifest.json").exists() {
        assert!(child.try_wait().unwrap().is_none(), "400 frames were done in a moment");
        std::thread::yield_now();
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let time = |n: u32| {
        let path = bench.path(&format!("out/frames/00000{n}/layers.exr"));
        path.metadata().unwrap().modified().unwrap()
    };
    let before = [time(0), time(1), time(2)];
    let resumed = [&arguments[..], &["--resume", "--frames", "0..12"]].concat();
    assert!(bench.run(&resumed).status.success());
    assert_eq!([time(0), time(1), time(2)], before);
    // As if nobody had killed it.
    let whole = Bench::with_scene(&scene(&orbit));
    let all = [&arguments[..], &["--frames", "0..12"]].concat();
    assert!(whole.run(&all).status.success());
    for frame in 0..12 {
        let layer = format!("frames/{frame:06}/position");
        assert!(whole.array(&layer) == bench.array(&layer), "{frame}");
        let files = |bench: &Bench| {
            let folder = bench.path(&format!("out/frames/{frame:06}"));
            let mut names: Vec<_> =
                std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name()).collect();
            names.sort();
            names
        };
        assert_eq!(files(&whole), files(&bench));
    }
}

#[test]
fn models_bring_their_animations_and_cameras() {
    let Some(assets) = crate::run::assets("models_bring_their_animations_and_cameras") else {
        return;
    };
    let moles = std::fs::read(assets.join("data/gltf/WhackAMole/WhackAMole.glb")).unwrap();
    let bench = Bench::new();
    bench.write("moles.glb", &moles);
    let scene = |frames: &Value| {
        json!({"etendue": 1, "layers": ["depth", "flow", "ids"], "render": {"samples": 1},
               "camera": {"type": "pinhole", "sensor": {"resolution": [320, 240]}},
               "objects": [{"file": "moles.glb"}], "frames": frames})
    };
    // The first mole comes up within 0.83 s; at first it is all in its hill.
    let times = json!({"type": "animation", "name": "MoleAppear", "times": [0.0, "400 ms", 0.8]});
    bench.write("scene.json", scene(&times).to_string().as_bytes());
    bench.render(&["--camera", "Main Camera"]);
    let index = bench.json("out/index.json");
    assert_eq!(index["frames"][1]["time_s"], 0.4);
    let flow = bench.array("frames/000001/flow");
    let moves = |f: &&[f64]| f[0].is_finite() && f[0].hypot(f[1]) > 1e-9;
    let moving = flow.chunks(2).filter(moves).count();
    let still = flow.chunks(2).filter(|f| f[0] == 0.0 && f[1] == 0.0).count();
    assert!(moving > 10 && still > 5000, "{moving} move, {still} do not");
    assert!(bench.array("frames/000001/depth") != bench.array("frames/000002/depth"));
    // A frame for each camera.
    bench.write("scene.json", scene(&json!({"type": "cameras"})).to_string().as_bytes());
    bench.render(&["--layers", "depth"]);
    let cameras = bench.json("out/index.json");
    assert_eq!(cameras["frames"].as_array().map(Vec::len), Some(1));
    assert_eq!(cameras["frames"][0]["resolution"], json!([320, 240]));
    let wrong = [
        json!({"type": "animation", "times": [0], "name": "walk"}),
        json!({"type": "animation"}),
        json!({"type": "animation", "end": 1, "rate": 0}),
        json!({"type": "animation", "end": 1, "objects": [1]}),
    ];
    let messages = wrong.map(|frames| {
        bench.write("scene.json", scene(&frames).to_string().as_bytes());
        under(&frames.to_string(), &bench.refusal(&["render", "scene.json", "-o", "out", "-q"]))
    });
    insta::assert_snapshot!(messages.concat());
}

#[test]
fn a_note_on_every_frame_is_said_once() {
    // Tracing light finds none in any of them.
    let mut dark: Value =
        serde_json::from_str(&scene(&json!({"type": "orbit", "count": 3}))).unwrap();
    dark["tracer"] = json!({"type": "direct"});
    let bench = Bench::with_scene(&dark.to_string());
    let output = bench.run(&["render", "scene.json", "-o", "out", "--report", "report.json"]);
    assert!(output.status.success());
    let said = text(&output.stderr);
    let mut notes: Vec<&str> = said.lines().filter(|line| line.starts_with("note: ")).collect();
    let count = notes.len();
    assert!(count > 0, "{said}");
    notes.sort_unstable();
    notes.dedup();
    assert_eq!(notes.len(), count, "{said}");
    let reports = bench.json("report.json");
    assert!(reports.as_array().unwrap().iter().all(|report| report["notes"] != json!([])));
}
