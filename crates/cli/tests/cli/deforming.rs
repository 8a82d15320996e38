//! Models that change their shapes while the shutter is open: morph targets and skins of glTF files, with closed forms.

use etendue_accel::AccelName;
use serde_json::{Value, json};

use crate::run::{Bench, read_npy, text};

/// Duration of the animations (s).
const LENGTH: f64 = 0.01;

/// A model put together: its numbers are in a file beside it.
#[derive(Default)]
pub(crate) struct Model {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Model {
    fn accessor(&mut self, kind: u32, shape: &str, count: usize, bytes: &[u8]) -> usize {
        self.views.push(
            json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() }),
        );
        self.bytes.extend(bytes);
        let view = self.views.len() - 1;
        self.accessors.push(
            json!({ "bufferView": view, "componentType": kind, "type": shape, "count": count }),
        );
        self.accessors.len() - 1
    }

    pub(crate) fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(5126, ["", "SCALAR", "VEC2", "VEC3", "VEC4"][N], values.len(), &bytes)
    }

    fn indices(&mut self, values: &[u32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(5125, "SCALAR", values.len(), &bytes)
    }

    pub(crate) fn write(self, bench: &Bench, mut document: Value) {
        document["asset"] = json!({ "version": "2.0" });
        document["accessors"] = json!(self.accessors);
        document["bufferViews"] = json!(self.views);
        document["buffers"] = json!([{ "byteLength": self.bytes.len(), "uri": "model.bin" }]);
        bench.write("model.bin", &self.bytes);
        bench.write("model.gltf", document.to_string().as_bytes());
    }
}

const SQUARE: [[f32; 3]; 4] = [[-1., -1., 0.], [1., -1., 0.], [-1., 1., 0.], [1., 1., 0.]];

/// A square of 2 m whose target, 1 m to the right, gets its whole weight in straight lines.
pub(crate) fn write_morph(bench: &Bench) {
    let mut model = Model::default();
    let positions = model.floats(&SQUARE);
    let moves = model.floats(&[[1.0_f32, 0.0, 0.0]; 4]);
    let indices = model.indices(&[0, 1, 2, 2, 1, 3]);
    #[expect(clippy::cast_possible_truncation, reason = "as files have it")]
    let input = model.floats(&[[0.0_f32], [LENGTH as f32]]);
    let output = model.floats(&[[0.0_f32], [1.0]]);
    model.write(
        bench,
        json!({
            "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": positions }, "indices": indices,
                                          "targets": [{ "POSITION": moves }] }] }],
            "animations": [{ "samplers": [{ "input": input, "output": output }],
                             "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }] }]
        }),
    );
}

/// An arm of 2 m along +X from its bone, which turns by 90°, as a strip of 0.2 m.
fn write_arm(bench: &Bench) {
    let mut model = Model::default();
    let positions =
        model.floats(&[[0.0_f32, -0.1, 0.0], [2.0, -0.1, 0.0], [0.0, 0.1, 0.0], [2.0, 0.1, 0.0]]);
    let indices = model.indices(&[0, 1, 2, 2, 1, 3]);
    let joints = model.accessor(5121, "VEC4", 4, &[0_u8; 16]);
    let weights = model.floats(&[[1.0_f32, 0.0, 0.0, 0.0]; 4]);
    #[expect(clippy::cast_possible_truncation, reason = "as files have it")]
    let input = model.floats(&[[0.0_f32], [LENGTH as f32]]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let output = model.floats(&[[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, half, half]]);
    model.write(
        bench,
        json!({
            "nodes": [{ "mesh": 0, "skin": 0 }, {}],
            "scenes": [{ "nodes": [0, 1] }], "scene": 0,
            "skins": [{ "joints": [1] }],
            "meshes": [{ "primitives": [{ "indices": indices,
                "attributes": { "POSITION": positions, "JOINTS_0": joints, "WEIGHTS_0": weights } }] }],
            "animations": [{ "samplers": [{ "input": input, "output": output }],
                             "channels": [{ "sampler": 0, "target": { "node": 1, "path": "rotation" } }] }]
        }),
    );
}

/// The model before parallel rays of 40 pixels a metre.
fn scene(shutter: &Value, more: &Value) -> Value {
    let mut scene = json!({
        "etendue": 1, "tracer": { "type": "path" }, "lights": [],
        "camera": { "type": "orthographic", "height": 3.0, "pose": { "from": [0, 0, 5], "look_at": [0, 0, 0] },
                    "sensor": { "resolution": [200, 120] }, "shutter": shutter },
        "objects": [{ "file": "model.gltf", "material": "lamp", "animation": { "time": 0, "plays": true } }],
        "materials": { "lamp": { "type": "emissive", "radiance": [1, 1, 1] } },
        "render": { "samples": 256 }
    });
    for (key, value) in more.as_object().expect("an object") {
        scene[key] = value.clone();
    }
    scene
}

fn bench(scene: &Value, write: impl Fn(&Bench)) -> Bench {
    let bench = Bench::with_scene(&scene.to_string());
    write(&bench);
    bench
}

/// Both upright edges of the square go 1 m to the right, so that each is a ramp of 40 pixels.
#[test]
fn a_morph_blurs_by_the_ramp_of_its_speed_with_each_accelerator_of_f64() {
    let scene = scene(&json!({ "exposure": LENGTH }), &json!({}));
    let bench = bench(&scene, write_morph);
    let mut pictures = Vec::new();
    for accel in AccelName::built().filter(|accel| !accel.has_single()).map(AccelName::name) {
        bench.render(&["--accel", accel]);
        let picture = bench.array("picture");
        let (mut sum, mut due_sum) = (0.0, 0.0);
        for column in 0..200_u32 {
            // The share of time for which a place is between the edges, at −1 + s and 1 + s for s in 0..1.
            let share = |x: f64| (x + 1.0).clamp(0.0, 1.0) - (x - 1.0).clamp(0.0, 1.0);
            let x = (f64::from(column) + 0.5) / 40.0 - 2.5;
            // Ramps are straight over a pixel, and their ends are at edges of pixels.
            let due = share(x);
            let rows: Vec<f64> =
                (30..90).map(|row| picture[(row * 200 + column as usize) * 3]).collect();
            let mean = rows.iter().sum::<f64>() / 60.0;
            // 60 pixels of 256 samples, evenly spread in time: better than binomial, four times.
            let noise = 4.0 * (due * (1.0 - due) / (60.0 * 256.0)).sqrt() + 1e-6;
            assert!((mean - due).abs() <= noise, "{accel}, column {column}: {mean}, not {due}");
            (sum, due_sum) = (sum + mean, due_sum + due);
        }
        assert!((sum / due_sum - 1.0).abs() < 1e-3, "{accel}: {sum}, not {due_sum}");
        pictures.push(picture);
    }
    assert!(pictures[0] == pictures[1], "both find the same hits");
}

/// Rows of a rolling shutter see the arm where its bone has it then.
#[test]
fn rows_of_a_rolling_shutter_see_a_skin_at_their_times() {
    let line_time = LENGTH / 120.0;
    let shutter = json!({ "type": "rolling", "line_time": line_time, "exposure": 0 });
    let more = json!({ "layers": ["depth", "ids"] });
    let mut scene = scene(&shutter, &more);
    scene.as_object_mut().expect("an object").remove("tracer");
    let bench = bench(&scene, write_arm);
    bench.render(&["--accel", "bvh"]);
    let depth = bench.array("depth");
    let (mut seen, mut near) = (0, 0);
    for row in 0..120_u32 {
        let angle = std::f64::consts::FRAC_PI_2 * f64::from(row) / 120.0;
        let y = 1.5 - (f64::from(row) + 0.5) / 40.0;
        for column in 0..200_u32 {
            let x = (f64::from(column) + 0.5) / 40.0 - 2.5;
            let (along, across) =
                (x * angle.cos() + y * angle.sin(), y * angle.cos() - x * angle.sin());
            // How far inside of the strip a pixel's middle is (m).
            let inside = along.min(2.0 - along).min(0.1 - across.abs());
            let is_hit = depth[(row * 200 + column) as usize].is_finite();
            seen += u32::from(is_hit);
            // A thousandth of a pixel of steps, and f32's quaternions.
            match inside.abs() < 2e-3 / 40.0 {
                true => near += 1,
                false => assert_eq!(is_hit, inside > 0.0, "row {row}, column {column}: {inside} m"),
            }
        }
    }
    assert!(seen > 400 && near < 20, "{seen} pixels see the arm, {near} are at its edge");
}

/// Without `plays` it stands in its moment; with it, all threads and both precisions see the same.
#[test]
fn what_deforms_is_the_same_for_threads_shares_and_precisions() {
    let floor = json!([
        { "file": "model.gltf", "material": "lamp", "animation": { "time": 0, "plays": true }, "transform": { "translate": [0, 0, 0.5] } },
        { "file": "model.gltf", "animation": { "time": 0.002, "plays": true }, "motion": { "type": "velocity",
          "angular_velocity": [0, 0, 2000] }, "transform": { "translate": [0, -0.5, 0.2], "scale": 0.4 } },
        { "shape": "rectangle", "width": 6, "height": 6, "transform": { "translate": [0, 0, -1] } }
    ]);
    let shutter = json!({ "type": "rolling", "line_time": "20 us", "exposure": LENGTH / 2.0, "code": "1101" });
    let more = json!({ "objects": floor, "layers": ["depth", "normal", "time"], "render": { "samples": 8 },
                       "lights": [{ "type": "environment", "radiance": [0.5, 0.6, 0.7] }] });
    let mut scene = scene(&shutter, &more);
    scene["camera"]["sensor"]["resolution"] = json!([50, 30]);
    let bench = bench(&scene, write_morph);
    let run = |arguments: &[&str]| {
        let output = bench.run(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
    };
    let bytes =
        |folder: &str, file: &str| std::fs::read(bench.path(folder).join(file)).expect("a file");
    run(&["render", "scene.json", "-o", "whole", "--threads", "1"]);
    run(&["render", "scene.json", "-o", "threads", "--threads", "3"]);
    for share in ["1/2", "2/2"] {
        run(&["render", "scene.json", "-o", "samples", "--shard", share, "--shard-by", "samples"]);
    }
    run(&["merge", "merged", "samples/samples-1-of-2.film", "samples/samples-2-of-2.film"]);
    for file in ["picture.npy", "depth.npy", "normal.npy", "time.npy"] {
        for folder in ["threads", "merged"] {
            assert!(bytes(folder, file) == bytes("whole", file), "{folder}/{file}");
        }
    }
    let mean = |folder: &str| {
        let pixels = read_npy(&bench.path(folder).join("picture.npy"));
        pixels.iter().sum::<f64>() / pixels.len() as f64
    };
    for (folder, more) in [
        ("bvh", ["--accel", "bvh"]),
        ("exact", ["--accel", "exact"]),
        ("double", ["--set", "plan.light_precision=\"double\""]),
        ("stopped", ["--set", "render.samples={\"relative_error\":0.02,\"min\":8,\"max\":256}"]),
    ] {
        run(&[&["render", "scene.json", "-o", folder][..], &more].concat());
        let [found, due] = [folder, "whole"].map(|of| read_npy(&bench.path(of).join("depth.npy")));
        let same = |(a, b): (&f64, &f64)| a == b || (a - b).abs() <= 1e-12 * b.abs();
        assert!(found.iter().zip(&due).all(same), "{folder}");
        // Roundings of where rays leave surfaces; what stops has the noise of 1500 pixels of 2 %.
        let most = if folder == "stopped" { 0.01 } else { 1e-4 };
        assert!((mean(folder) / mean("whole") - 1.0).abs() < most, "{folder}: {}", mean(folder));
    }
}

/// Shapes of the frame's own moment without `plays`, the whole sweep in slots, and flow from frame to frame.
#[test]
fn slots_and_flow_follow_shapes() {
    let slots = json!([{ "duration": LENGTH / 2.0 }, { "duration": LENGTH / 2.0 }]);
    let whole = scene(&json!({ "exposure": LENGTH }), &json!({}));
    let mut slotted = whole.clone();
    slotted["serial"] = slots;
    let [whole, slotted] = [whole, slotted].map(|scene| {
        let bench = bench(&scene, write_morph);
        bench.render(&[]);
        bench.array("picture")
    });
    let sums = [&whole, &slotted].map(|picture| picture.iter().sum::<f64>());
    assert!((sums[0] / sums[1] - 1.0).abs() < 1e-3, "{sums:?}");

    // From the exposure of one frame to that of the next: the square's pixels go by the speed of 100 m/s.
    let step = 0.002;
    let more = json!({ "layers": ["flow", "depth"] });
    let mut moving = scene(&json!({ "exposure": "1 ms" }), &more);
    moving.as_object_mut().expect("an object").remove("tracer");
    moving["camera"]["sensor"]["resolution"] = json!([100, 60]);
    moving["frames"] = json!([
        { "render.time": 0.001, "objects[0].animation.time": 0.001 },
        { "render.time": 0.001 + step, "objects[0].animation.time": 0.001 + step }
    ]);
    let bench = bench(&moving, write_morph);
    bench.render(&[]);
    let flow = bench.array("frames/000000/flow");
    let depth = bench.array("frames/000000/depth");
    let mut counted = 0;
    for (i, flow) in flow.chunks(2).enumerate() {
        if !depth[i].is_finite() {
            continue;
        }
        counted += 1;
        // 20 pixels a metre; keys of 0.01 s are f32.
        assert!((flow[0] - 20.0 * step * 100.0).abs() < 1e-6, "{flow:?}");
        assert!(flow[1].abs() < 1e-9, "{flow:?}");
    }
    assert!(counted > 1000, "{counted} pixels");
}

/// Too many steps are refused by their mesh, with what to do.
#[test]
fn too_many_steps_are_refused_by_their_mesh() {
    let scene = scene(&json!({ "exposure": LENGTH }), &json!({}));
    let bench = bench(&scene, write_arm);
    let output = bench.run(&["render", "scene.json", "-o", "out", "--memory-limit", "300 kB"]);
    assert_eq!(output.status.code(), Some(2));
    let words = text(&output.stderr);
    assert!(words.contains("memory"), "{words}");
    assert!(!bench.path("out").exists());
}

/// The plan says how many steps there are and why, and the forecast has their memory and that of motion.
#[test]
fn the_plan_tells_of_steps_and_of_their_memory() {
    let bench = bench(&scene(&json!({ "exposure": LENGTH }), &json!({})), write_arm);
    let output = bench.run(&["plan", "scene.json"]);
    let words = text(&output.stdout);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(words.contains("1 meshes change their shapes, in up to"), "{words}");
    assert!(words.contains("thousandth of a pixel") && words.contains(" motion"), "{words}");
    // Parallel rays of 40 pixels a metre; a stretch of √3 counts at most: r θ² / 8 n² of 10⁻³ pixels.
    let steps: f64 = words
        .split("in up to ")
        .nth(1)
        .and_then(|rest| rest.split(' ').next())
        .and_then(|count| count.parse().ok())
        .expect("a number of steps");
    let least = std::f64::consts::FRAC_PI_2 * (2.0 * 40.0 / 8e-3_f64).sqrt();
    assert!((least..2.0 * least).contains(&steps), "{steps} steps, {least} at least");
}
