//! A rolling shutter, a camera that moves and turns, objects that do, and a sensor: crossed with all that divides a
//! render, decides how it is traced, or exposes it.

use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::{Value, json};

use crate::deforming::write_morph;
use crate::run::{Bench, read_npy, text};

fn scene(samples: &Value) -> Bench {
    let spin = json!({ "type": "velocity", "angular_velocity": [0, 0, 14_400] });
    let key = |x: f64, turn: f64| json!({ "translate": [x, 0.35, 0], "rotate": [0, 1, 0, turn] });
    let bench = Bench::with_scene(
        &json!({
            "etendue": 1,
            "tracer": { "type": "direct" },
            "layers": ["depth", "ids", "time"],
            "camera": {
                "type": "pinhole", "fov": 40, "pose": { "from": [0, 0.6, 3], "look_at": [0, 0.3, 0] },
                "shutter": { "type": "rolling", "line_time": "60 us" },
                "motion": { "type": "velocity", "velocity": [0.5, 0, 0], "angular_velocity": [0, 20, 0] },
                "sensor": { "type": "raw", "cfa": "rggb", "resolution": [40, 70], "read_noise": 2, "system_gain": 0.5,
                    "exposure": "1 ms" }
            },
            "lights": [{ "type": "environment", "radiance": [0.5, 0.6, 0.7] }],
            "objects": [
                { "shape": "rectangle", "width": 8, "height": 8, "transform": { "rotate": [1, 0, 0, -90] } },
                { "shape": "box", "size": [0.12, 1.3, 0.05], "transform": { "translate": [-0.3, 0.75, 0] }, "motion": spin },
                { "shape": "box", "size": [0.5, 0.5, 0.5], "material": "lamp",
                  "motion": { "type": "transforms", "transforms": [key(0.1, 0.0), key(0.4, 40.0)], "times": [0, 0.005] } },
                { "file": "model.gltf", "animation": { "time": 0.001, "plays": true },
                  "transform": { "translate": [-0.6, 0.3, 0.3], "scale": 0.2 } }
            ],
            "materials": { "lamp": { "type": "emissive", "radiance": [0.4, 0.3, 0.2] } },
            "render": { "samples": samples, "seed": 5 }
        })
        .to_string(),
    );
    write_morph(&bench);
    bench
}

fn run(bench: &Bench, arguments: &[&str]) {
    let output = bench.run(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
}

fn bytes(bench: &Bench, folder: &str, file: &str) -> Vec<u8> {
    std::fs::read(bench.path(folder).join(file)).unwrap_or_else(|e| panic!("{folder}/{file}: {e}"))
}

#[test]
fn what_moves_is_the_same_for_all_threads_shares_and_exposures() {
    let bench = scene(&json!(16));
    run(&bench, &["render", "scene.json", "-o", "whole", "--threads", "1"]);
    run(&bench, &["render", "scene.json", "-o", "threads", "--threads", "3"]);
    for (folder, by) in [("rows", "rows"), ("samples", "samples")] {
        for share in ["1/2", "2/2"] {
            run(
                &bench,
                &["render", "scene.json", "-o", folder, "--shard", share, "--shard-by", by],
            );
        }
        let film = |k: u32| {
            let name = if by == "rows" { "shard" } else { "samples" };
            format!("{folder}/{name}-{k}-of-2.film")
        };
        run(&bench, &["merge", &format!("{folder}-merged"), &film(1), &film(2)]);
    }
    for file in ["picture.npy", "raw.npy", "depth.npy", "time.npy", "camera.json"] {
        let whole = bytes(&bench, "whole", file);
        for folder in ["threads", "rows-merged", "samples-merged"] {
            assert!(bytes(&bench, folder, file) == whole, "{folder}/{file}");
        }
    }
    run(&bench, &["expose", "whole/layers.exr", "--sensor", "scene.json", "-o", "exposed"]);
    assert!(bytes(&bench, "exposed", "raw.npy") == bytes(&bench, "whole", "raw.npy"));
}

/// Data to 10⁻¹², light to the rounding of f32 where rays leave surfaces.
#[test]
fn what_moves_is_the_same_for_all_accelerators_and_precisions() {
    let bench = scene(&json!(16));
    run(&bench, &["render", "scene.json", "-o", "whole"]);
    let mean = |folder: &str| {
        let pixels = read_npy(&bench.path(folder).join("picture.npy"));
        pixels.iter().sum::<f64>() / pixels.len() as f64
    };
    let whole = mean("whole");
    for (folder, arguments) in [
        ("bvh", ["--accel", "bvh"]),
        ("exact", ["--accel", "exact"]),
        ("double", ["--set", "plan.light_precision=\"double\""]),
    ] {
        run(&bench, &[&["render", "scene.json", "-o", folder][..], &arguments].concat());
        for file in ["depth.npy", "time.npy"] {
            let [found, due] = [folder, "whole"].map(|of| read_npy(&bench.path(of).join(file)));
            // The last bits of what is solved in the frame of a body.
            let same = |(a, b): (&f64, &f64)| a == b || (a - b).abs() <= 1e-12 * b.abs();
            assert!(found.iter().zip(&due).all(same), "{folder}/{file}");
        }
        let found = mean(folder);
        assert!((found / whole - 1.0).abs() < 1e-4, "{folder}: {found}, not {whole}");
    }
}

/// Samples that stop see the same light.
#[test]
fn samples_that_stop_see_what_moves() {
    let mean = |samples: Value| {
        let bench = scene(&samples);
        run(&bench, &["render", "scene.json", "-o", "out"]);
        let pixels = bench.array("picture");
        pixels.iter().sum::<f64>() / pixels.len() as f64
    };
    let [even, stopped] =
        [json!(64), json!({ "relative_error": 0.05, "min": 8, "max": 512 })].map(mean);
    // 2800 pixels of an error of a twentieth at most: 0.1 % of the mean, and four times that.
    assert!((stopped / even - 1.0).abs() < 4e-3, "{stopped}, not {even}");
}

/// A moving scene that is kept on the way goes on after a kill.
#[test]
fn what_moves_goes_on_after_kills() {
    let bench = scene(&json!(600));
    let arguments = [
        "render",
        "scene.json",
        "-o",
        "out",
        "-q",
        "--threads",
        "1",
        "--checkpoint",
        "0.001",
        "--set",
        "lights[0].modulation={\"type\":\"sine\",\"frequency\":300}",
    ];
    let file = bench.path("out/checkpoint.film");
    let kept = || file.metadata().and_then(|data| data.modified()).ok();
    let mut kills = 0;
    for _ in 0..4 {
        let before = kept();
        let mut command = Command::new(env!("CARGO_BIN_EXE_etendue"));
        let command = command.args(arguments).current_dir(bench.path(""));
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("runs");
        while kept() == before && child.try_wait().expect("a child").is_none() {
            std::thread::sleep(Duration::from_millis(1));
        }
        child.kill().expect("a child");
        kills += u32::from(!child.wait().expect("a child").success());
    }
    assert!(kills >= 2, "{kills} of 4 were killed");
    run(&bench, &arguments);
    let whole: Vec<&str> =
        arguments.iter().map(|word| if *word == "out" { "whole" } else { word }).collect();
    run(&bench, &[&whole[..7], &whole[9..]].concat());
    for name in ["picture.npy", "raw.npy", "depth.npy"] {
        assert!(bytes(&bench, "out", name) == bytes(&bench, "whole", name), "{name}");
    }
}

/// No place is chosen on a lamp that moves, and weights against that are 1: a lamp that hardly moves lights as one that
/// stands still, on which places are.
#[test]
fn lamps_that_move_light_as_those_that_stand_still() {
    let mean = |motion: Value| {
        let mut scene = json!({
            "etendue": 1, "tracer": { "type": "path" }, "lights": [],
            "camera": { "type": "pinhole", "fov": 50, "pose": { "from": [0, 1, 4], "look_at": [0, 0.5, 0] },
                        "sensor": { "resolution": [24, 24] }, "shutter": { "exposure": "10 ms" } },
            "objects": [
                { "shape": "rectangle", "width": 8, "height": 8, "transform": { "rotate": [1, 0, 0, -90] } },
                { "shape": "sphere", "radius": 0.4, "transform": { "translate": [0.6, 0.4, 0] } },
                { "shape": "box", "size": [1.5, 0.4, 1.5], "material": "lamp", "transform": { "translate": [0, 2, 0] } }
            ],
            "materials": { "lamp": { "type": "emissive", "radiance": [3, 3, 3] } },
            "render": { "samples": 512 }
        });
        if !motion.is_null() {
            scene["objects"][2]["motion"] = motion;
        }
        let bench = Bench::with_scene(&scene.to_string());
        run(&bench, &["render", "scene.json", "-o", "out"]);
        let pixels = bench.array("picture");
        pixels.iter().sum::<f64>() / pixels.len() as f64
    };
    let [moving, still] =
        [json!({ "type": "velocity", "velocity": [1e-6, 0, 0] }), Value::Null].map(mean);
    // 576 pixels of 512 samples, of which one in five comes upon the lamp: 1 / √(0.2 · 295 000), and four times that.
    assert!((moving / still - 1.0).abs() < 4.0 * 0.0042, "{moving}, not {still}");
}

/// Copies of an object that moves are objects that do.
#[test]
fn copies_move_along() {
    let depth = |objects: Value| {
        let scene = json!({
            "etendue": 1, "layers": ["depth"],
            "camera": { "type": "pinhole", "fov": 60, "pose": { "from": [0, 0, 5], "look_at": [0, 0, 0] },
                        "sensor": { "resolution": [48, 36] },
                        "shutter": { "type": "rolling", "line_time": "1 ms", "exposure": "1 ms" } },
            "objects": objects
        });
        let bench = Bench::with_scene(&scene.to_string());
        run(&bench, &["render", "scene.json", "-o", "out"]);
        bench.array("depth")
    };
    let motion = json!({ "type": "velocity", "velocity": [30, 0, 0], "angular_velocity": [0, 0, 3000], "about": [0, 0, 0] });
    let places = [[-1.0, 0.3, 0.0], [0.2, -0.8, 0.5], [1.1, 0.9, -1.0]];
    let list = places.map(|place| json!({ "translate": place }));
    let whole = depth(
        json!([{ "shape": "box", "size": [0.8, 0.5, 0.3], "instances": list, "motion": motion }]),
    );
    let each = places.map(|place| {
        json!({ "shape": "box", "size": [0.8, 0.5, 0.3], "transform": { "translate": place }, "motion": motion })
    });
    let each = depth(json!(each));
    assert!(whole.iter().any(|depth| depth.is_finite() && *depth > 0.0));
    for (i, (found, due)) in whole.iter().zip(&each).enumerate() {
        // Last bits of where the frame of the copy is.
        assert!(found == due || (found - due).abs() < 1e-12, "{i}: {found} {due}");
    }
}

/// Flow is from where a point is when it is seen here to where it is when it is seen there: with a rolling shutter a body that
/// rises meets the rows that are read later.
#[test]
fn flow_goes_from_exposure_to_exposure() {
    const FOCAL: f64 = 60.0;
    let step = 0.02;
    for (line_time, truth_at) in [(0.0, "middle"), (1e-4, "middle"), (1e-4, "close")] {
        let kind = if line_time > 0.0 { "rolling" } else { "global" };
        let mut shutter = json!({ "type": kind, "exposure": "4 ms", "truth_at": truth_at });
        if line_time > 0.0 {
            shutter["line_time"] = json!(line_time);
        }
        let place = |x: f64, y: f64| json!({ "translate": [x, y, 0] });
        let scene = json!({
            "etendue": 1, "layers": ["flow", "occlusion", "depth"],
            "camera": { "type": "pinhole", "fov": 2.0 * (30.0 / FOCAL).atan().to_degrees(),
                        "pose": { "from": [0, 0, 4], "look_at": [0, 0, 0] },
                        "sensor": { "resolution": [60, 60] }, "shutter": shutter },
            "objects": [{ "shape": "rectangle", "width": 1.5, "height": 1.5,
                          "motion": { "type": "transforms", "times": [0, 1], "transforms": [place(0.0, 0.0), place(3.0, 8.0)] } }],
            "frames": [{ "render.time": 0.01 }, { "render.time": 0.01 + step }]
        });
        let bench = Bench::with_scene(&scene.to_string());
        run(&bench, &["render", "scene.json", "-o", "out", "--accel", "bvh"]);
        let flow = bench.array("frames/000000/flow");
        let depth = bench.array("frames/000000/depth");
        let hidden = bench.array("frames/000000/occlusion_hidden");
        // Pixels a second; rows grow downwards, so that the rows are met earlier there.
        let [across, up] = [3.0, 8.0].map(|speed| FOCAL * speed / 4.0);
        let rows = -up * step / (1.0 + up * line_time);
        let columns = across * (step + rows * line_time);
        let mut counted = 0;
        for (i, flow) in flow.chunks(2).enumerate().filter(|(i, _)| depth[*i].is_finite()) {
            counted += 1;
            // Steps of the search end below 10⁻¹² s, at 120 pixels a second.
            assert!(
                (flow[0] - columns).abs() < 1e-8,
                "{kind}, {truth_at}: {flow:?}, not {columns}"
            );
            assert!((flow[1] - rows).abs() < 1e-8, "{kind}, {truth_at}: {flow:?}, not {rows}");
            assert_eq!(hidden[i], 0.0, "nothing is before it");
        }
        assert!(counted > 400, "{counted} pixels");
    }
}

/// Lenslets and real lenses see what moves: the picture of an exposure is the mean of those of its moments.
#[test]
fn lenslets_and_lenses_see_what_moves() {
    let lenslets = json!({
        "type": "light_field", "focal_length": 20, "f_number": 4, "focus_distance": 0.5, "microlenses": { "pitch": 0.1 },
        "pose": { "from": [0, 0, 0.5], "look_at": [0, 0, 0] }, "sensor": { "resolution": [60, 40], "pixel_pitch": 16 }
    });
    let lens = json!({
        "type": "thin_lens", "focal_length": "20 mm", "f_number": 2, "focus_distance": "0.5 m", "fov": 15,
        "pose": { "from": [0, 0, 0.5], "look_at": [0, 0, 0] }, "sensor": { "resolution": [60, 40] }
    });
    for (kind, camera) in [("lenslets", lenslets), ("lens", lens)] {
        let picture = |samples: u32, lamp: Value, exposure: f64| {
            let mut camera = camera.clone();
            camera["shutter"] = json!({ "exposure": exposure });
            let mut object = lamp;
            object["shape"] = json!("rectangle");
            (object["width"], object["height"]) = (json!(0.03), json!(0.03));
            object["material"] = json!("lamp");
            let scene = json!({
                "etendue": 1, "tracer": { "type": "path" }, "lights": [], "camera": camera, "objects": [object],
                "materials": { "lamp": { "type": "emissive", "radiance": [1, 1, 1] } }, "render": { "samples": samples }
            });
            let bench = Bench::with_scene(&scene.to_string());
            run(&bench, &["render", "scene.json", "-o", "out", "-q", "--accel", "bvh"]);
            bench.array("picture")
        };
        let motion =
            json!({ "type": "velocity", "velocity": [4, 0, 0], "angular_velocity": [0, 0, 9000] });
        let moving = picture(
            256,
            json!({ "motion": motion, "transform": { "translate": [-0.02, 0, 0] } }),
            0.01,
        );
        let mut mean = vec![0.0; moving.len()];
        for k in 0..16 {
            let time = 0.01 * (f64::from(k) + 0.5) / 16.0;
            let place = json!({ "translate": [-0.02 + 4.0 * time, 0, 0], "rotate": [0, 0, 1, 9000.0 * time] });
            let still = picture(16, json!({ "transform": place }), 0.0);
            mean.iter_mut().zip(&still).for_each(|(mean, still)| *mean += still / 16.0);
        }
        let total = |pixels: &[f64]| pixels.iter().sum::<f64>();
        let (found, due) = (total(&moving), total(&mean));
        // 2400 pixels, of which a third see it, of 256 samples: some 10⁻³ of both; 16 moments of an edge that goes on.
        assert!((found / due - 1.0).abs() < 5e-3, "{kind}: {found}, not {due}");
        // It is where it was: pixels differ by their noise of one sixteenth at most, and by the steps of 16 moments.
        let off = moving.iter().zip(&mean).map(|(a, b)| (a - b).abs()).sum::<f64>() / due;
        assert!(off < 0.1, "{kind}: {off}");
    }
}

/// Motion vectors within one exposure: from where a point is seen to where it is when its row's shutter opens and
/// closes, of an object and of a camera that moves, in closed form; without frames, and the same for any threads.
#[test]
fn points_are_followed_to_the_ends_of_their_exposure() {
    let (exposure, line) = (0.01, 50e-6);
    let layers = json!(["depth", { "type": "flow", "to": "open" }, { "type": "flow", "to": "close" },
        { "type": "occlusion", "to": "close" }]);
    let scene = |wall: [f64; 3], camera: [f64; 3]| {
        Bench::with_scene(
            &json!({
                "etendue": 1, "layers": layers,
                "camera": {
                    "type": "orthographic", "height": 1, "pose": { "from": [0, 0, 2], "look_at": [0, 0, 0] },
                    "shutter": { "type": "rolling", "line_time": line },
                    "motion": { "type": "velocity", "velocity": camera },
                    "sensor": { "resolution": [20, 20], "exposure": exposure }
                },
                "objects": [
                    { "shape": "rectangle", "width": 9, "height": 9, "motion": { "type": "velocity", "velocity": wall } }
                ]
            })
            .to_string(),
        )
    };
    // Pixels a second to the right and down, of a wall, of a camera that goes the other way, and of both.
    let (across, down) = (30.0 * 20.0, 20.0 * 20.0);
    for (wall, camera) in [
        ([30.0, -20.0, 0.0], [0.0; 3]),
        ([0.0; 3], [-30.0, 20.0, 0.0]),
        ([10.0, -20.0, 0.0], [-20.0, 0.0, 0.0]),
    ] {
        let bench = scene(wall, camera);
        bench.render(&[]);
        for (name, half) in [("flow_open", -0.5 * exposure), ("flow_close", 0.5 * exposure)] {
            // The row of arrival opens and closes later by as many lines as it lies lower.
            let rows = down * half / (1.0 - down * line);
            let columns = across * (half + rows * line);
            for flow in bench.array(name).chunks(2) {
                let off = (flow[0] - columns).abs().max((flow[1] - rows).abs());
                assert!(
                    off < 1e-9,
                    "{name} of {wall:?} {camera:?}: {flow:?}, not {columns} {rows}"
                );
            }
        }
        let header = text(
            &bench.run(&["render", "scene.json", "-o", "one", "--threads", "1", "--quiet"]).stderr,
        );
        assert_eq!(
            bytes(&bench, "one", "flow_close.npy"),
            bytes(&bench, "out", "flow_close.npy"),
            "{header}"
        );
        // What leaves the picture meanwhile is outside at its edge.
        assert!(bench.array("occlusion_close_outside").contains(&1.0));
        assert!(!bench.array("occlusion_close_hidden").contains(&1.0));
    }
    // Nothing moves: nor do points, but for the rounding of their places.
    let bench = scene([0.0; 3], [0.0; 3]);
    bench.render(&[]);
    assert!(bench.array("flow_close").iter().all(|flow| flow.abs() < 1e-12));
    // Slots have exposures of their own.
    let mut written: Value =
        serde_json::from_slice(&std::fs::read(bench.path("scene.json")).unwrap()).unwrap();
    written["serial"] = json!([{}, {}]);
    written["tracer"] = json!({ "type": "direct" });
    std::fs::write(bench.path("scene.json"), written.to_string()).unwrap();
    insta::assert_snapshot!(bench.refusal(&["render", "scene.json", "-o", "slots"]), @r#"
    error: scene.json: layers: `to`: "open" and "close" are moments of one camera's exposure
    hint: leave them out, or `serial`
    "#);
}
