//! Light-field cameras and arrays of cameras, as a user meets them.

use std::path::Path;
use std::process::Command;

use serde_json::{Value, json};

use crate::run::{Bench, text, under};

/// A camera of 20 mm f/4 with lenslets of 0.1 mm before a ball.
fn scene() -> Value {
    json!({
        "etendue": 1, "tracer": {"type": "facing"}, "render": {"samples": 4},
        "objects": [{"shape": "sphere", "radius": 0.03}],
        "camera": {
            "type": "light_field", "focal_length": 20, "f_number": 4, "focus_distance": 0.5,
            "microlenses": {"pitch": 0.1},
            "pose": {"from": [0, 0, 0.5], "look_at": [0, 0, 0]},
            "sensor": {"resolution": [120, 90], "pixel_pitch": 8}
        }
    })
}

/// Message of `etendue render` on the scene with a value of its own, which it refuses.
fn refused(path: &str, value: &str) -> String {
    let bench = Bench::with_scene(&scene().to_string());
    let setting = format!("{path}={value}");
    let message = bench.refusal(&["render", "scene.json", "-o", "out", "-q", "--set", &setting]);
    assert!(!bench.path("out/picture.png").exists(), "{setting}");
    message
}

#[test]
fn cameras_that_have_no_light_field_are_refused_with_a_way_out() {
    let lenslets = "camera.microlenses";
    let settings = [
        ("camera.microlenses.pitch", "0"),
        ("camera.microlenses.pitch", "3"),
        (lenslets, r#"{"pitch": 0.5, "size": [0.3, 0.3], "focal_length": 2}"#),
        (lenslets, r#"{"pitch": 0.1, "size": [0.12, 0.12], "offset": [0.05, 0.05]}"#),
        ("camera.views", "40"),
        ("camera.sensor.pixel_pitch", "80"),
        ("camera.sensor.resolution", "[8, 8]"),
    ];
    let messages =
        settings.map(|(path, value)| under(&format!("{path}={value}"), &refused(path, value)));
    insta::assert_snapshot!(messages.concat());
}

/// Files of each kind of camera, which is what Python and the window show: all have a raw picture, a white one and
/// centres; views, their reference, depth and disparity those that have views; `hci/` those of square pixels.
#[test]
fn each_kind_of_light_field_leaves_what_it_has() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let types = json!([{"focal_length": 0.425}, {"focal_length": 0.432}, {"focal_length": 0.418}]);
    let thick = json!({"pitch": 0.1, "radii": [0.215, null], "thickness": 0.1, "glass": "N-BK7"});
    let cases = [
        ("square", json!({"pitch": 0.1}), Ok(true)),
        ("hexagonal", json!({"pitch": 0.1, "grid": "hexagonal"}), Ok(false)),
        ("rotated", json!({"pitch": 0.1, "rotation": 30}), Ok(true)),
        ("multi-focus", json!({"pitch": 0.1, "grid": "hexagonal", "types": types}), Ok(false)),
        ("thick", thick, Ok(true)),
        ("real main lens", json!({"pitch": 0.1}), Ok(true)),
        ("focused", json!({"pitch": 0.1, "picture_distance": 0.3}), Err("a focused one")),
        ("focused, virtual", json!({"pitch": 0.1, "picture_distance": -0.9}), Err("a focused one")),
        ("narrow images", json!({"pitch": 0.1, "focal_length": 0.15}), Err("fewer than 5")),
    ];
    for (kind, microlenses, has) in cases {
        let mut scene = scene();
        scene["render"]["samples"] = json!(1);
        let camera = &mut scene["camera"];
        (camera["microlenses"], camera["views"]) = (microlenses, json!(3));
        if kind == "real main lens" {
            let lens = root.join("scenes/lenses/double-gauss.json");
            (camera["lens"], camera["focal_length"]) = (json!(lens.to_string_lossy()), Value::Null);
            camera.as_object_mut().unwrap().remove("focal_length");
        }
        let bench = Bench::with_scene(&scene.to_string());
        let output = bench.run(&["render", "scene.json", "-o", "out", "--allow-outside"]);
        let said = text(&output.stdout) + &text(&output.stderr);
        assert!(output.status.success(), "{kind}: {said}");
        let exists = |name: &str| bench.path("out").join(name).exists();
        let geometry = bench.json("out/geometry.json");
        let [n, rows, cols] = ["views", "rows", "cols"].map(|key| geometry[key].as_u64().unwrap());
        assert_eq!(bench.array("picture").len(), 120 * 90 * 3, "{kind}");
        assert_eq!(bench.array("white").len(), 120 * 90 * 3, "{kind}");
        assert_eq!(geometry["centres_px"].as_array().unwrap().len() as u64, rows, "{kind}");
        let pieces = [
            "views.npy",
            "views",
            "reference.npy",
            "reference",
            "central_depth.npy",
            "central_disparity.pfm",
        ];
        for name in pieces {
            assert_eq!(exists(name), has.is_ok(), "{kind}: {name}: {said}");
        }
        assert_eq!(exists("hci/parameters.cfg"), has == Ok(true), "{kind}: {said}");
        match has {
            Ok(_) => {
                assert_eq!(n, 3, "{kind}");
                for name in ["views", "reference"] {
                    assert_eq!(
                        bench.array(name).len() as u64,
                        n * n * rows * cols * 3,
                        "{kind} {name}"
                    );
                }
                assert_eq!(bench.array("central_disparity").len() as u64, rows * cols, "{kind}");
                if has == Ok(true) {
                    hci_by_its_own_definition(
                        &bench,
                        kind,
                        if kind == "rotated" { 30.0 } else { 0.0 },
                    );
                }
            }
            Err(why) => {
                let told = geometry["no_views"].as_str().unwrap();
                assert!(n == 0 && told.contains(why), "{kind}: {told}");
                assert!(said.contains("are not written") && said.contains(why), "{kind}: {said}");
                assert!(geometry["disparity"].is_null() && geometry["gains"].is_null(), "{kind}");
            }
        }
    }
}

/// The values of a PFM of one channel, the bottom row first.
fn pfm(bench: &Bench, name: &str) -> Vec<f64> {
    let bytes = std::fs::read(bench.path(name)).unwrap();
    let mut lines = bytes.splitn(4, |byte| *byte == b'\n');
    let head: [&[u8]; 3] = std::array::from_fn(|_| lines.next().unwrap());
    assert_eq!((head[0], head[2][0]), (&b"Pf"[..], b'-'), "{name}: grey, the low byte first");
    let values = lines.next().unwrap().as_chunks::<4>().0;
    values.iter().map(|value| f64::from(f32::from_le_bytes(*value))).collect()
}

/// The benchmark's ground truth by its own formula and parameters (Honauer et al. 2016): disparities are
/// b f (1/z − 1/z₀) max(width, height)/s, of lengths in mm, and the views are numbered by rows.
fn hci_by_its_own_definition(bench: &Bench, kind: &str, turned: f64) {
    let text = std::fs::read_to_string(bench.path("out/hci/parameters.cfg")).unwrap();
    let number = |key: &str| -> f64 {
        let lines = text.lines().filter_map(|line| line.split_once(" = "));
        lines.into_iter().find(|(name, _)| *name == key).unwrap().1.parse().unwrap()
    };
    let [width, height] = ["image_resolution_x_px", "image_resolution_y_px"].map(number);
    let [depth, disparity] = ["gt_depth_lowres", "gt_disp_lowres"]
        .map(|name| pfm(bench, &format!("out/hci/{name}.pfm")));
    assert_eq!(depth.len() as f64, width * height, "{kind}");
    let lengths = number("baseline_mm") * number("focal_length_mm") / number("sensor_size_mm");
    let focus = 1e3 * number("focus_distance_m");
    let mut hits = 0;
    for (z, found) in depth.iter().zip(&disparity).filter(|(z, _)| z.is_finite()) {
        let known = lengths * width.max(height) * (1.0 / (1e3 * z) - 1.0 / focus);
        // Both are f32, and near the focus a difference of nearly equal numbers.
        assert!((found - known).abs() < 1e-5, "{kind}: {found} at {z} m, not {known}");
        let [least, most] = [number("disp_min") - 1e-6, number("disp_max") + 1e-6];
        assert!((least..=most).contains(found), "{kind}: {found}");
        hits += 1;
    }
    assert!(hits > 0, "{kind}: the wall is seen");
    let rotation = number("center_cam_rz_rad").to_degrees().abs();
    assert!((rotation - turned).abs() < 1e-6, "{kind}: turned by {rotation} degrees");
    for view in 0..9 {
        let name = format!("out/hci/input_Cam{view:03}.png");
        assert!(bench.path(&name).exists(), "{kind}: {name}");
    }
}

/// An array that stands beside the light of the lens before it: an error that says so.
#[test]
fn an_array_beside_the_light_is_refused() {
    let mut scene = scene();
    scene["camera"] = json!({
        "type": "lens", "pose": {"from": [0, 0, 0.5], "look_at": [0, 0, 0]},
        "sensor": {"resolution": [60, 40], "pixel_pitch": 20},
        "lens": {"elements": [
            {"type": "aperture", "shape": "circular", "radius": 5, "stop": true},
            {"type": "thin_lens", "focal_length": 40, "thickness": 43.478},
            {"type": "microlens_array", "size": [1, 1], "pitch": 0.25, "focal_length": 1,
             "decentre": [30, 0], "thickness": 1}]}
    });
    let bench = Bench::with_scene(&scene.to_string());
    insta::assert_snapshot!(bench.refusal(&["render", "scene.json", "-o", "out", "-q"]), @"error: scene.json, line 1, column 2: camera: no light gets through the microlens array elements[2] to the sensor: it stands outside of the light of the lens before it, or its lenslets are closed");
}

/// Frames whose settings are whole cameras: one file, one run, and one structure for all of them.
#[test]
fn a_list_of_cameras_shares_one_structure() {
    let mut scene = scene();
    let pose = json!({"from": [0, 0, 0.5], "look_at": [0, 0, 0]});
    let right = json!({"from": [0.05, 0, 0.5], "look_at": [0, 0, 0]});
    let sensor = json!({"resolution": [24, 16]});
    scene["layers"] = json!(["depth"]);
    scene["frames"] = json!([
        {"camera": {"type": "pinhole", "fov": 20, "pose": pose, "sensor": sensor}},
        {"camera": {"type": "orthographic", "height": 0.1, "pose": right, "sensor": sensor}},
        {"camera": {"type": "thin_lens", "focal_length": 20, "f_number": 4, "focus_distance": 0.5,
                    "sensor_height": 4, "pose": right, "sensor": sensor}},
        {"camera.microlenses.rotation": 3}
    ]);
    let bench = Bench::with_scene(&scene.to_string());
    bench.render(&["--report", "report.json"]);
    let reports = bench.json("report.json");
    let reports = reports.as_array().unwrap();
    assert_eq!(reports.len(), 4);
    for (number, report) in reports.iter().enumerate() {
        let build = report["seconds"]["build"].as_f64().unwrap();
        assert_eq!(build == 0.0, number > 0, "frame {number} took {build} s to build");
        assert!(bench.path(&format!("out/frames/{number:06}/picture.npy")).exists());
    }
    assert!(bench.path("out/frames/000003/geometry.json").exists(), "a light field of its own");
    assert!(!bench.path("out/frames/000001/geometry.json").exists());
}

/// A grid of pinholes is the light field that a camera with as many views would have: the next camera sees
/// a point of a wall where baseline, focal length and depth say.
#[test]
fn a_grid_of_cameras_has_the_disparity_of_its_spacing() {
    let scene = json!({
        "etendue": 1, "layers": ["position"], "objects": [{"shape": "rectangle", "width": 9, "height": 9}],
        "camera": {"type": "pinhole", "fov": 40, "sensor": {"resolution": [32, 24]},
                   "pose": {"from": [0, 0, 2], "look_at": [0, 0, 0]}},
        "frames": {"type": "grid", "columns": 3, "rows": 2, "spacing": 0.1}
    });
    let bench = Bench::with_scene(&scene.to_string());
    bench.render(&["--report", "report.json"]);
    let reports = bench.json("report.json");
    let builds = reports.as_array().unwrap().iter().filter(|r| r["seconds"]["build"] != 0.0);
    assert_eq!(builds.count(), 1);
    let x = |frame: u32| bench.array(&format!("frames/{frame:06}/position"))[3 * (12 * 32 + 16)];
    let y =
        |frame: u32| bench.array(&format!("frames/{frame:06}/position"))[3 * (12 * 32 + 16) + 1];
    for (a, b, right, down) in [(0, 1, 0.1, 0.0), (1, 2, 0.1, 0.0), (0, 3, 0.0, 0.1)] {
        assert!((x(b) - x(a) - right).abs() < 1e-6, "{a} {b}: row by row from the top left");
        assert!((y(b) - y(a) + down).abs() < 1e-6, "{a} {b}");
    }
}

/// The Python of docs/how-to/light-fields.md on what a camera of these pages leaves: it checks itself. Takes the
/// interpreter that `ETENDUE_PYTHON` names, else `python3`, where it has numpy.
#[test]
fn the_page_of_light_fields_runs() {
    let python = std::env::var("ETENDUE_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let has_numpy = Command::new(&python).args(["-c", "import numpy"]).output();
    if !has_numpy.is_ok_and(|output| output.status.success()) {
        println!("passed over: {python} has no numpy");
        return;
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let bench = Bench::new();
    for (scene, folder) in [("light-field", "out"), ("light-field-focused", "focused")] {
        let scene = root.join(format!("scenes/{scene}.json"));
        let output = bench.run(&[
            "render",
            &scene.to_string_lossy(),
            "-o",
            folder,
            "-q",
            "--samples",
            "8",
            "--set",
            "camera.sensor.resolution=[360,270]",
        ]);
        assert!(output.status.success(), "{}", text(&output.stderr));
    }
    let page = std::fs::read_to_string(root.join("docs/how-to/light-fields.md")).unwrap();
    let blocks = page.split("```python\n").skip(1).filter_map(|rest| rest.split("```").next());
    let program: String = blocks.collect();
    assert!(program.contains("refocused"), "{program}");
    bench.write("page.py", program.as_bytes());
    let output = Command::new(&python).arg("page.py").current_dir(bench.path("")).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(bench.path("refocused.npy").exists() && bench.path("focused-far.npy").exists());
}
