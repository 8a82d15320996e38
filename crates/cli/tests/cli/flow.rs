//! Layers that compare two frames: flow, disparity, occlusion.

use serde_json::{Value, json};

use crate::run::{Bench, text};

/// 40 × 30 pixels, focal length 50 pixels, looking along −z.
const FOCAL: f64 = 50.0;

fn scene(objects: &Value, frames: &Value, layers: &Value) -> Value {
    json!({
        "etendue": 1,
        "layers": layers,
        "camera": {"type": "pinhole",
                   "intrinsics": {"fx": 50, "fy": 50, "cx": 20, "cy": 15, "pixel_origin": "corner"},
                   "pose": {"from": [0, 0, 0], "look_at": [0, 0, -1]},
                   "sensor": {"resolution": [40, 30]}},
        "objects": objects,
        "frames": frames
    })
}

/// A wall at 4 m and a square of 1 m before it, at 2 m.
fn wall_and_square() -> Value {
    json!([{"shape": "rectangle", "width": 1, "height": 1, "transform": {"translate": [0, 0, -2]}},
           {"shape": "rectangle", "width": 40, "height": 40, "transform": {"translate": [0, 0, -4]}}])
}

fn rendered(objects: &Value, frames: &Value, layers: &Value) -> Bench {
    let bench = Bench::with_scene(&scene(objects, frames, layers).to_string());
    bench.render(&[]);
    bench
}

#[test]
fn disparity_is_focal_length_times_baseline_over_depth() {
    let grid = json!({"type": "grid", "columns": 2, "spacing": "0.2 m"});
    let layers = json!(["depth", "disparity", "flow", {"type": "disparity", "to": -1}]);
    let bench = rendered(&wall_and_square(), &grid, &layers);
    let (depth, disparity) =
        (bench.array("frames/000000/depth"), bench.array("frames/000000/disparity"));
    let flow = bench.array("frames/000000/flow");
    for (i, (z, d)) in depth.iter().zip(&disparity).enumerate() {
        // A dozen roundings of pixel coordinates up to 40.
        assert!((d - FOCAL * 0.2 / z).abs() < 1e-12, "{d} at {z} m");
        assert_eq!(flow[2 * i], -d);
        assert!(flow[2 * i + 1].abs() < 1e-12, "{}", flow[2 * i + 1]);
    }
    // The other way it is the other sign, and at the ends there is no such frame.
    let back = bench.array("frames/000001/disparity_back");
    let depth = bench.array("frames/000001/depth");
    assert!(back.iter().zip(&depth).all(|(d, z)| (d + FOCAL * 0.2 / z).abs() < 1e-12));
    assert!(!bench.path("out/frames/000001/disparity.npy").exists());
    assert!(!bench.path("out/frames/000000/disparity_back.npy").exists());
}

/// A pair that moves: the disparity is within the pair at every moment, and flow that of one camera.
#[test]
fn disparity_of_a_rig_is_within_the_rig_and_flow_along_time() {
    const BASELINE: f64 = 0.2;
    const STEP: [f64; 3] = [0.15, -0.05, -0.5];
    let rig = json!({
        "type": "rig",
        "cameras": [{"name": "left", "at": [-0.5 * BASELINE, 0, 0]},
                    {"name": "right", "at": [0.5 * BASELINE, 0, 0]}],
        "path": {"type": "dolly", "count": 3, "to": STEP.map(|x| 2.0 * x)}
    });
    let layers = json!(["depth", "position", "disparity", {"type": "disparity", "to": -1}, "flow",
                        "occlusion", {"type": "occlusion", "to": {"cameras": 1}},
                        {"type": "flow", "to": {"cameras": 1}}]);
    let bench = rendered(&wall_and_square(), &rig, &layers);
    let index = bench.json("out/index.json");
    assert_eq!(index["frames"].as_array().map(Vec::len), Some(6));
    assert_eq!(index["frames"][3]["rig_camera"], json!({"number": 1, "name": "right"}));
    assert_eq!(index["frames"][3]["moment"], 1);
    let has = |frame: usize, layer: &str| {
        bench.path(&format!("out/frames/{frame:06}/{layer}.npy")).exists()
    };
    for frame in 0..6_usize {
        let at = |name: &str| bench.array(&format!("frames/{frame:06}/{name}"));
        let (moment, camera) = (frame / 2, frame % 2);
        let z = at("depth");
        let (own, sign) = if camera == 0 { ("disparity", 1.0) } else { ("disparity_back", -1.0) };
        for (d, z) in at(own).iter().zip(&z) {
            // A dozen roundings of pixel coordinates up to 40.
            assert!((d - sign * FOCAL * BASELINE / z).abs() < 1e-12, "frame {frame}: {d} at {z} m");
        }
        assert!(!has(frame, if camera == 0 { "disparity_back" } else { "disparity" }), "{frame}");
        for layer in ["flow_camera", "occlusion_camera_hidden"] {
            assert_eq!(has(frame, layer), camera == 0, "{frame} {layer}");
        }
        if camera == 0 {
            let pairs = at("flow_camera");
            for (flow, d) in pairs.chunks(2).zip(at(own)) {
                assert!((flow[0] + d).abs() < 1e-12 && flow[1].abs() < 1e-12, "{flow:?} {d}");
            }
        }
        assert_eq!(has(frame, "flow"), moment < 2, "{frame}");
        if moment == 2 {
            continue;
        }
        // The same camera one step on, whose axes are the world's.
        let here = |k: usize| {
            let side = if camera == 0 { -0.5 } else { 0.5 };
            STEP[k] * f64::from(u8::try_from(moment).unwrap())
                + if k == 0 { side * BASELINE } else { 0.0 }
        };
        let seen = |p: &[f64], from: [f64; 3]| {
            let depth = from[2] - p[2];
            [FOCAL * (p[0] - from[0]) / depth, -FOCAL * (p[1] - from[1]) / depth]
        };
        let now = [here(0), here(1), here(2)];
        let next = [0, 1, 2].map(|k| now[k] + STEP[k]);
        for (flow, p) in at("flow").chunks(2).zip(at("position").chunks(3)) {
            let (a, b) = (seen(p, now), seen(p, next));
            for k in 0..2 {
                assert!(
                    (flow[k] - (b[k] - a[k])).abs() < 1e-12,
                    "frame {frame}: {flow:?} {a:?} {b:?}"
                );
            }
        }
    }
    // None of the cameras has one that is two further on, at any moment.
    let far = scene(&wall_and_square(), &rig, &json!(["depth", {"type": "disparity", "to": 2}]));
    let bench = Bench::with_scene(&far.to_string());
    insta::assert_snapshot!(bench.refusal(&["render", "scene.json", "-o", "out"]), @"
    error: scene.json: layers: `to`: 2 leads out of the rig's cameras, which are 0..2, from each of them
    hint: name a nearer one, or leave the layer out
    ");
}

/// Numbers of copies run through all objects: what stands still is followed whatever became of others.
#[test]
fn a_copy_that_goes_takes_nothing_else_along() {
    let copies = |xs: &[f64]| -> Vec<Value> {
        xs.iter().map(|x| json!({"translate": [x, 0, -2]})).collect()
    };
    let mut objects = wall_and_square();
    objects[0] = json!({"shape": "rectangle", "width": 0.2, "height": 0.2,
                        "instances": copies(&[-0.5, 0.5])});
    let frames = json!([{}, {"objects[0].instances": copies(&[-0.5])}]);
    let bench = rendered(&objects, &frames, &json!(["ids", "flow"]));
    let object = bench.array("frames/000000/id_object");
    let instance = bench.array("frames/000000/id_instance");
    let flow = bench.array("frames/000000/flow");
    let first =
        instance.iter().copied().filter(|number| *number > 0.0).fold(f64::INFINITY, f64::min);
    for (i, flow) in flow.chunks(2).enumerate() {
        let is_gone = object[i] == 1.0 && instance[i] != first;
        let expected = if is_gone { f64::INFINITY } else { 0.0 };
        // The roundings of pixel coordinates up to 40.
        assert!(
            flow.iter().all(|v| *v == expected || (v - expected).abs() < 1e-12),
            "{i}: {flow:?}"
        );
    }
    assert!((0..object.len()).any(|i| object[i] == 1.0 && instance[i] != first), "one copy goes");
}

#[test]
fn flow_follows_an_object_that_moves_and_says_what_it_hides() {
    let frames = json!([{}, {"objects[0].transform.translate": [0.1, -0.05, -1.9]}]);
    let bench =
        rendered(&wall_and_square(), &frames, &json!(["depth", "position", "flow", "occlusion"]));
    let at = |name: &str| bench.array(&format!("frames/000000/{name}"));
    let (depth, position, flow) = (at("depth"), at("position"), at("flow"));
    let (hidden, outside) = (at("occlusion_hidden"), at("occlusion_outside"));
    let mut behind = 0;
    for (i, z) in depth.iter().enumerate() {
        let [x, y] = [position[3 * i], position[3 * i + 1]];
        let place = |x: f64, y: f64, z: f64| [FOCAL * x / z, -FOCAL * y / z];
        let here = place(x, y, *z);
        let there = if *z < 3.0 { place(x + 0.1, y - 0.05, 1.9) } else { here };
        for k in 0..2 {
            let expected = there[k] - here[k];
            assert!(
                (flow[2 * i + k] - expected).abs() < 1e-12,
                "{i}: {} {expected}",
                flow[2 * i + k]
            );
        }
        // The square's new edges at 1.9 m hide of the wall at 4 m what is twice as far from the axis.
        let (left, right) = (-0.4 / 1.9 * 4.0, 0.6 / 1.9 * 4.0);
        let (low, high) = (-0.55 / 1.9 * 4.0, 0.45 / 1.9 * 4.0);
        let is_behind = *z > 3.0 && (left..right).contains(&x) && (low..high).contains(&y);
        assert_eq!(hidden[i], f64::from(u8::from(is_behind)), "{x} {y} {z}");
        assert_eq!(outside[i], 0.0);
        behind += usize::from(is_behind);
    }
    assert!(behind > 30, "{behind}");
}

#[test]
fn what_leaves_the_picture_is_outside_and_what_is_behind_has_no_flow() {
    let frames =
        json!([{}, {"camera.pose.look_at": [-1, 0, -1]}, {"camera.pose.look_at": [0, 0, 1]}]);
    let layers =
        json!(["flow", {"type": "flow", "to": 2}, "occlusion", {"type": "occlusion", "to": 2}]);
    let bench = rendered(&wall_and_square(), &frames, &layers);
    let at = |name: &str| bench.array(&format!("frames/000000/{name}"));
    let (flow, outside) = (at("flow"), at("occlusion_outside"));
    for i in 0..40 * 30 {
        let column = f64::from(u32::try_from(i % 40).unwrap()) + 0.5;
        // A turn by 45°: a direction of tangent t is seen at tan(45° + atan t).
        let tangent = ((column - 20.0) / FOCAL).atan() + std::f64::consts::FRAC_PI_4;
        let there = 20.0 + FOCAL * tangent.tan();
        assert!((flow[2 * i] - (there - column)).abs() < 1e-10, "{} {there}", flow[2 * i]);
        assert_eq!(outside[i], f64::from(u8::from(!(0.0..=40.0).contains(&there))), "{there}");
    }
    assert!(at("flow2").iter().all(|flow| *flow == f64::INFINITY));
    assert!(at("occlusion2_outside").iter().all(|outside| *outside == 1.0));
    assert!(at("occlusion2_hidden").iter().all(|hidden| *hidden == 0.0));
}

#[test]
fn flow_lands_on_the_same_point_of_a_curved_surface_and_through_a_lens() {
    // Forth and back again is where one was, wherever nothing is hidden: seen here by positions.
    let objects = json!([{"shape": "sphere", "transform": {"translate": [0, 0, -4]}}]);
    let frames = json!([{}, {"camera.pose.from": [0.2, 0.1, 0]}]);
    let mut scene = scene(&objects, &frames, &json!(["position", "flow"]));
    scene["camera"] = json!({"type": "lens", "lens": {"elements": [
            {"type": "surface", "radius": 60, "thickness": 6, "glass": {"n": 1.6}, "semi_diameter": 12},
            {"type": "surface", "radius": -60, "thickness": 4, "semi_diameter": 12},
            {"type": "aperture", "shape": "circular", "radius": 4, "thickness": 30, "stop": true}]},
        "focus_distance": 4, "pose": {"from": [0, 0, 0], "look_at": [0, 0, -1]},
        "sensor": {"resolution": [40, 30], "pixel_pitch": "0.4 mm"}});
    let bench = Bench::with_scene(&scene.to_string());
    bench.render(&[]);
    let (first, second) =
        (bench.array("frames/000000/position"), bench.array("frames/000001/position"));
    let flow = bench.array("frames/000000/flow");
    let mut seen = 0;
    for i in (0..40 * 30).filter(|i| flow[2 * i].is_finite()) {
        let [column, row] = [i % 40, i / 40].map(|k| f64::from(u32::try_from(k).unwrap()));
        let (u, v) = (column + flow[2 * i], row + flow[2 * i + 1]);
        if !(0.0..38.0).contains(&u) || !(0.0..28.0).contains(&v) {
            continue;
        }
        // The point itself, between the four that the second frame sees around its place.
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "in the picture"
        )]
        let around = |right: usize, down: usize, k: usize| {
            second[3 * ((v as usize + down) * 40 + u as usize + right) + k]
        };
        let (p, q) = (u.fract(), v.fract());
        let between = |k: usize| {
            (1.0 - q) * ((1.0 - p) * around(0, 0, k) + p * around(1, 0, k))
                + q * ((1.0 - p) * around(0, 1, k) + p * around(1, 1, k))
        };
        let off = (0..2).map(|k| (between(k) - first[3 * i + k]).powi(2)).sum::<f64>().sqrt();
        if !off.is_finite() || (0..2).any(|k| (around(1, 1, k) - around(0, 0, k)).abs() > 0.1) {
            continue;
        }
        // Between four points of a sphere of 1 m that lie some 50 mm apart a straight line is wrong by
        // (50 mm)² / 8 m at most, twice, and more where it falls away; a pixel is 50 mm.
        assert!(off < 2e-3, "{off} m at {column} {row}");
        seen += 1;
    }
    assert!(seen > 100, "{seen}");
}

#[test]
fn comparisons_without_another_frame_are_refused() {
    let mut alone = scene(&wall_and_square(), &json!([{}]), &json!(["flow"]));
    let refused = |scene: &Value| {
        let bench = Bench::with_scene(&scene.to_string());
        bench.refusal(&["render", "scene.json", "-o", "out", "-q"])
    };
    alone["layers"] = json!([{"type": "flow", "to": 0}]);
    insta::assert_snapshot!(refused(&alone), @"error: scene.json, line 1, column 212: layers[0]: `to` is 0: a frame does not move against itself; 1 is the next frame");
    alone["layers"] = json!(["flow"]);
    alone.as_object_mut().unwrap().remove("frames");
    insta::assert_snapshot!(refused(&alone), @"
    error: scene.json: layers: flow, disparity and occlusion compare frames, and the scene has no `frames`
    hint: give it some, or leave these layers out
    ");
}

#[test]
fn a_changed_neighbour_is_no_complete_frame() {
    let frames = json!([{}, {"camera.pose.from": [0.2, 0, 0]}]);
    let bench = rendered(&wall_and_square(), &frames, &json!(["flow"]));
    let time =
        || bench.path("out/frames/000000/layers.exr").metadata().unwrap().modified().unwrap();
    let (before, flow) = (time(), bench.array("frames/000000/flow"));
    bench.render(&["--resume"]);
    assert_eq!(time(), before);
    bench.render(&["--resume", "--set", "frames[1]={\"camera.pose.from\": [0.3, 0, 0]}"]);
    assert_ne!(time(), before);
    assert!(bench.array("frames/000000/flow") != flow);
}

#[test]
fn a_frame_to_compare_with_that_is_not_there_is_told() {
    let grid = json!({"type": "grid", "columns": 2, "spacing": "0.2 m"});
    let bench = Bench::with_scene(&scene(&wall_and_square(), &grid, &json!(["flow"])).to_string());
    let output = bench.run(&["render", "scene.json", "-o", "out"]);
    assert!(output.status.success());
    let said = text(&output.stderr);
    assert!(said.contains("note: frame 1: ") && !said.contains("note: frame 0: "), "{said}");
    assert!(bench.array("frames/000001/flow").iter().all(|flow| *flow == f64::INFINITY));
    // None of the two frames has one that is two further.
    let far = json!(["depth", {"type": "flow", "to": 2}]);
    let bench = Bench::with_scene(&scene(&wall_and_square(), &grid, &far).to_string());
    insta::assert_snapshot!(bench.refusal(&["render", "scene.json", "-o", "out"]), @"
    error: scene.json: layers: `to`: 2 leads out of the scene's frames, which are 0..2, from each of them
    hint: name a nearer one, or leave the layer out
    ");
}
