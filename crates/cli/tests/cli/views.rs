//! Default pose of a camera that has none, and which way is up.

use serde_json::Value;

use crate::run::{Bench, assets, text};

/// Free rows above and below, and columns left and right, of what `out/coverage.npy` shows.
fn margins(bench: &Bench, side: usize) -> [usize; 4] {
    let hit = bench.array("coverage");
    let row = |y: usize| (0..side).any(|x| hit[y * side + x] > 0.0);
    let column = |x: usize| (0..side).any(|y| hit[y * side + x] > 0.0);
    [
        (0..side).position(row).expect("something is hit"),
        (0..side).rev().position(row).expect("something is hit"),
        (0..side).position(column).expect("something is hit"),
        (0..side).rev().position(column).expect("something is hit"),
    ]
}

fn rendered(bench: &Bench, model: &str, more: &[&str]) {
    let fixed = [
        "render",
        model,
        "-o",
        "out",
        "--quiet",
        "--layers",
        "coverage",
        "--set",
        "camera.sensor.resolution=[256,256]",
    ];
    let output = bench.run(&[&fixed[..], more].concat());
    assert!(output.status.success(), "{model}: {}", text(&output.stderr));
}

/// A pyramid: four corners below, and one at `apex`.
fn pyramid([x, y, z]: [f64; 3]) -> String {
    format!(
        "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv {x} {y} {z}\n\
         f 1 2 3 4\nf 2 1 5\nf 3 2 5\nf 4 3 5\nf 1 4 5\n"
    )
}

#[test]
fn margins_are_even_around_the_vertices() {
    for apex in [[0.0, 1.0, 0.0], [0.0, 5.0, 0.0], [0.9, 2.0, -0.9], [3.0, 0.3, 0.0]] {
        for camera in ["camera.type=pinhole", "camera.type=orthographic"] {
            let bench = Bench::new();
            bench.write("m.obj", pyramid(apex).as_bytes());
            rendered(&bench, "m.obj", &["--set", camera]);
            let [above, below, left, right] = margins(&bench, 256);
            // A vertex lies between two pixels' centres, and a tip may pass between two rays.
            assert!(above.abs_diff(below) <= 2, "{apex:?} {camera}: {above} and {below} rows");
            assert!(left.abs_diff(right) <= 2, "{apex:?} {camera}: {left} and {right} columns");
            // 4 % of 256 are 10.24.
            let least = above.min(left);
            assert!((9..=12).contains(&least), "{apex:?} {camera}: {least} rows are free");
        }
    }
}

#[test]
fn real_models_stand_in_the_middle() {
    let Some(folder) = assets("the framing of real models") else { return };
    for name in
        ["gltf/Sundial/Sundial.glb", "gltf/Avocado/Avocado.gltf", "obj/spot.obj", "obj/koala.obj"]
    {
        let bench = Bench::new();
        rendered(&bench, &folder.join("data").join(name).to_string_lossy(), &[]);
        let [above, below, left, right] = margins(&bench, 256);
        assert!(above.abs_diff(below) <= 3, "{name}: {above} and {below} rows");
        assert!(left.abs_diff(right) <= 3, "{name}: {left} and {right} columns");
    }
}

/// The box that `check` finds, as least and greatest y and z.
fn heights(bench: &Bench, arguments: &[&str]) -> [f64; 4] {
    let output = bench.run(&[&["check"], arguments, &["--json"]].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let found: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let side = |which: &str, axis: usize| found["bounds"][which][axis].as_f64().expect("a number");
    [side("min", 1), side("max", 1), side("min", 2), side("max", 2)]
}

/// A box of 2 × 1 × 3 m that stands on the plane z = 0.
const STANDING: &str = "v -1 -0.5 0\nv 1 -0.5 0\nv 1 0.5 0\nv -1 0.5 0\nv -1 -0.5 3\nv 1 -0.5 3\n\
    v 1 0.5 3\nv -1 0.5 3\nf 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

#[test]
fn models_with_z_up_are_noticed_and_turned() {
    let bench = Bench::new();
    bench.write("m.obj", STANDING.as_bytes());
    let lying = text(&bench.run(&["check", "m.obj"]).stdout);
    assert!(lying.contains("m.obj: ") && lying.contains("`--up z`"), "{lying}");
    for axis in ["y", "z"] {
        let said = text(&bench.run(&["check", "m.obj", "--up", axis]).stdout);
        assert!(!said.contains("--up z"), "{axis}: {said}");
    }
    assert_eq!(heights(&bench, &["m.obj"]), [-0.5, 0.5, 0.0, 3.0]);
    assert_eq!(heights(&bench, &["m.obj", "--up", "z"]), [0.0, 3.0, -0.5, 0.5]);
    // One that stands on y = 0 has no need of it.
    bench
        .write("upright.obj", STANDING.replace(" -0.5 ", " 0 ").replace(" 0.5 ", " 1 ").as_bytes());
    let upright = text(&bench.run(&["check", "upright.obj"]).stdout);
    assert!(!upright.contains("--up z"), "{upright}");
    // A car's body: built about y = 0, a little above z = 0. With y up it is not, nor one that hangs far away.
    let body = STANDING.replace(" 0\n", " 0.25\n");
    bench.write("body.obj", body.as_bytes());
    let said = text(&bench.run(&["check", "body.obj"]).stdout);
    assert!(said.contains("half below y = 0") && said.contains("`--up z`"), "{said}");
    let far = STANDING.replace(" 0\n", " 5\n").replace(" 3\n", " 7\n");
    let upright = body.replace(" -0.5 ", " 0.2 ").replace(" 0.5 ", " 1 ");
    for other in [far, upright] {
        bench.write("other.obj", other.as_bytes());
        let said = text(&bench.run(&["check", "other.obj"]).stdout);
        assert!(!said.contains("--up z"), "{said}");
    }
    // The objects of a scene: by the scene's word, unless they have their own; before `transform`.
    let scene = r#"{"etendue": 1, "up": "z", "objects": [
        {"file": "m.obj", "transform": {"scale": 2}}, {"shape": "box", "size": [1, 1, 9]}]}"#;
    bench.write("scene.json", scene.as_bytes());
    assert_eq!(heights(&bench, &["scene.json"]), [-0.5, 6.0, -4.5, 4.5]);
    bench.write("scene.json", scene.replace("\"m.obj\"", "\"m.obj\", \"up\": \"y\"").as_bytes());
    assert_eq!(heights(&bench, &["scene.json"]), [-1.0, 1.0, -4.5, 6.0]);
}

#[test]
fn camera_space_comes_in_both_conventions() {
    let bench = Bench::with_scene(
        r#"{"etendue": 1,
        "camera": {"type": "pinhole", "pose": {"from": [2, 1, 3], "look_at": [0, 0, 0]},
                   "sensor": {"resolution": [24, 24]}},
        "layers": ["position", "normal", {"type": "position", "space": "opencv"},
                   {"type": "normal", "space": "opencv"}, {"type": "normal", "space": "camera"},
                   {"type": "normal", "kind": "shading", "space": "opencv"}, "depth"],
        "objects": [{"shape": "sphere"}]}"#,
    );
    bench.render(&[]);
    let camera = bench.json("out/camera.json");
    let matrix: Vec<f64> = camera["camera_from_world"]
        .as_array()
        .expect("rows")
        .iter()
        .flat_map(|row| {
            row.as_array().expect("a row").iter().map(|x| x.as_f64().expect("a number"))
        })
        .collect();
    let turned = |v: &[f64], w: f64| -> [f64; 3] {
        std::array::from_fn(|k| {
            let row = &matrix[4 * k..4 * k + 4];
            row[0] * v[0] + row[1] * v[1] + row[2] * v[2] + row[3] * w
        })
    };
    let (position, normal) = (bench.array("position"), bench.array("normal"));
    let seen = [("position_opencv", &position, 1.0), ("normal_opencv", &normal, 0.0)];
    for (name, world, w) in seen {
        for (world, found) in world.chunks(3).zip(bench.array(name).chunks(3)) {
            if world[0].is_finite() {
                let known = turned(world, w);
                // A few f64 roundings of numbers near 4.
                let near = known.iter().zip(found).all(|(a, b)| (a - b).abs() < 1e-13);
                assert!(near, "{name}: {found:?} for {known:?}");
            }
        }
    }
    for (gl, cv) in
        bench.array("normal_camera").chunks(3).zip(bench.array("normal_opencv").chunks(3))
    {
        assert_eq!([gl[0], -gl[1], -gl[2]], cv[..]);
    }
    for (z, at) in bench.array("depth").iter().zip(bench.array("position_opencv").chunks(3)) {
        assert!(z.is_infinite() || (z - at[2]).abs() < 1e-13, "depth is OpenCV's z");
    }
    let layers = bench.json("out/layers.json");
    let frame = |name: &str| {
        let all = layers["layers"].as_array().expect("layers");
        let layer = all.iter().find(|l| l["name"] == name).expect("the layer");
        layer["meaning"]["frame"].as_str().expect("a frame").to_owned()
    };
    assert!(frame("NormalOpencv").contains("OpenCV's convention, as in camera.json"));
    assert!(frame("NormalCamera").contains("OpenGL's convention"), "{}", frame("NormalCamera"));
}
