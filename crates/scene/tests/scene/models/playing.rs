//! Skins and morph targets while the shutter is open, with closed forms.

use std::f64::consts::FRAC_PI_2;

use etendue_geometry::Steps;
use etendue_geometry::glam::{DQuat, DVec3};
use etendue_scene::{LoadOptions, Scene, SceneError, SceneFile, Setting, Wanted};
use serde_json::{Value, json};

use super::build::{Builder, SQUARE};
use super::{folder, write};

/// A scene with the model, which goes on from 0.25 s for as long as it is exposed.
fn scene(
    model: &[u8],
    plays: bool,
    exposure: f64,
    limit: Option<u64>,
) -> Result<Scene, SceneError> {
    scene_with(model, plays, exposure, limit, &[])
}

/// The same with other settings.
fn scene_with(
    model: &[u8],
    plays: bool,
    exposure: f64,
    limit: Option<u64>,
    settings: &[Setting],
) -> Result<Scene, SceneError> {
    let folder = folder();
    write(&folder, "a.glb", model);
    let scene = json!({
        "etendue": 1,
        "camera": { "type": "pinhole", "fov": 60, "pose": { "from": [0, 2, 10], "look_at": [0, 2, 0] },
                    "sensor": { "resolution": [100, 100] }, "shutter": { "exposure": exposure } },
        "objects": [{ "file": "a.glb", "animation": { "time": 0.25, "plays": plays } }]
    });
    let path = write(&folder, "scene.json", scene.to_string());
    let options = LoadOptions { memory_limit: limit, ..LoadOptions::default() };
    SceneFile::read(&path, settings)?.load(Wanted::EVERYTHING, &options)
}

fn steps(scene: &Scene, mesh: usize) -> &Steps {
    scene.geometry.meshes[mesh].steps.as_deref().expect("it deforms")
}

fn corner(steps: &Steps, time: f64, i: usize) -> DVec3 {
    steps.corner(steps.moment(time), i)
}

/// Far from the plane of the square, and all normals from +Z towards +X.
const AWAY: [[f32; 3]; 4] = [[0.0, 0.0, 2.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.0], [-1.0, 0.0, 1.0]];

/// The square, whose one target gets a weight by `output` at the keys 0, 0.5 and 1 s.
fn morphed(kind: &str, output: &[f32], nodes: Value) -> Vec<u8> {
    let mut builder = Builder::default();
    let positions = builder.floats(&SQUARE);
    let normals = builder.floats(&[[0.0_f32, 0.0, 1.0]; 4]);
    let moves = builder.floats(&AWAY);
    let turns = builder.floats(&[[1.0_f32, 0.0, 0.0]; 4]);
    let indices = builder.u32s(&[0, 1, 2, 2, 1, 3]);
    let input = builder.floats(&[[0.0_f32], [0.5], [1.0]]);
    let output: Vec<[f32; 1]> = output.iter().map(|weight| [*weight]).collect();
    let output = builder.floats(&output);
    builder.glb(json!({
        "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": {"POSITION": positions, "NORMAL": normals}, "indices": indices,
                                    "targets": [{"POSITION": moves, "NORMAL": turns}]}]}],
        "animations": [{"samplers": [{"input": input, "output": output, "interpolation": kind}],
                        "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]}]
    }))
}

/// A weight that rises in straight lines: steps are its keys, and all corners and normals are exact.
#[test]
fn a_morph_by_straight_lines_is_exact() {
    let model = morphed("LINEAR", &[0.0, 1.0, 0.5], json!([{"mesh": 0}]));
    let scene = scene(&model, true, 0.5, None).unwrap();
    let steps = steps(&scene, 0);
    assert_eq!(steps.times(), [0.0, 0.25, 0.5]);
    for k in 0..=100 {
        let time = f64::from(k) / 200.0;
        let weight = if time < 0.25 { 0.5 + 2.0 * time } else { 1.25 - time };
        for (i, (at, away)) in SQUARE.iter().zip(&AWAY).enumerate() {
            let due: [f64; 3] =
                std::array::from_fn(|k| f64::from(at[k]) + weight * f64::from(away[k]));
            // Some roundings of numbers up to 2.
            assert!(corner(steps, time, i).distance(DVec3::from(due)) < 1e-15 * 4.0, "{time}: {i}");
            let normal = steps.normal(steps.moment(time), i).unwrap().normalize();
            // Of f32.
            assert!(
                normal.distance(DVec3::new(weight, 0.0, 1.0).normalize()) < 2e-7,
                "{time}: {i}"
            );
        }
    }
    // What is shown without `plays`, or in an instant, has no steps and is where it was.
    for (plays, exposure) in [(false, 0.5), (true, 0.0)] {
        let still = self::scene(&model, plays, exposure, None).unwrap();
        assert!(still.geometry.meshes[0].steps.is_none() && !still.geometry.moves());
        assert_eq!(still.geometry.meshes[0].positions.get(0), DVec3::new(0.0, 0.0, 1.0));
    }
}

/// A weight that leaps has its old value until then; one by a cubic is within a thousandth of a pixel of it.
#[test]
fn a_morph_leaps_and_goes_by_cubics() {
    let leaps = scene(&morphed("STEP", &[0.25, 1.0, 0.5], json!([{"mesh": 0}])), true, 0.5, None);
    let leaps = leaps.unwrap();
    for (time, weight) in [(0.0, 0.25), (0.2, 0.25), (0.249_999, 0.25), (0.25, 1.0), (0.4, 1.0)] {
        assert!((corner(steps(&leaps, 0), time, 0).z - 2.0 * weight).abs() < 1e-15, "{time}");
    }
    let (into, out) = ([0.0, 3.0, -1.0], [4.0, 3.0, 0.0]);
    let values = [0.1, 0.6, 0.9];
    let keys: Vec<f32> = (0..3).flat_map(|k| [into[k], values[k], out[k]]).collect();
    let cubic =
        scene(&morphed("CUBICSPLINE", &keys, json!([{"mesh": 0}])), true, 0.5, None).unwrap();
    let steps = steps(&cubic, 0);
    for k in 0..=1000 {
        let time = f64::from(k) / 2000.0;
        let i = usize::from(time >= 0.25);
        let s = (time + 0.25 - 0.5 * i as f64) / 0.5;
        let [from, to, out, into] = [values[i], values[i + 1], out[i], into[i + 1]].map(f64::from);
        let weight = (2.0 * s - 3.0) * s * s * (from - to)
            + from
            + 0.5 * s * ((s * s - 2.0 * s + 1.0) * out + (s * s - s) * into);
        let off = (corner(steps, time, 0).z - 2.0 * weight).abs();
        // A pixel is 2 tan 30° / 100 of the distance to a point, which is 7 m at least.
        assert!(off < 1e-3 * 0.01154 * 7.0, "{time}: {off}");
    }
    // h = √(8 · 1e-3 pixels / (1.73 · 2 m · 30 /s²)) is 0.003 s.
    let fine = steps.times().len();
    assert!((90..250).contains(&fine), "{fine} steps");
    // A tolerance a hundred times as large is met by about a tenth of the steps; parts of a way are divided evenly.
    let settings = [Setting::new("accuracy.deformation_error", "0.1")];
    let model = morphed("CUBICSPLINE", &keys, json!([{"mesh": 0}]));
    let coarse = scene_with(&model, true, 0.5, None, &settings).unwrap();
    assert!(
        coarse.notes.iter().all(|note| !note.subject.contains("accuracy")),
        "{:?}",
        coarse.notes
    );
    let coarse = self::steps(&coarse, 0).times().len();
    assert!((fine / 20..fine / 3).contains(&coarse), "{coarse} steps, {fine} before");
}

/// One mesh on two nodes, of which one plays, and below a node that turns: both are what they are.
#[test]
fn one_mesh_may_play_on_one_node_and_stand_on_another() {
    let nodes = json!([{"mesh": 0}, {"mesh": 0, "weights": [0.25]}]);
    let scene = scene(&morphed("LINEAR", &[0.0, 1.0, 1.0], nodes), true, 0.1, None).unwrap();
    let of = |placement: usize| scene.geometry.mesh_of(&scene.geometry.placements[placement]);
    assert!(of(0).steps.is_some() && of(1).steps.is_none());
    assert_eq!(of(1).positions.get(0), DVec3::Z * 0.5);
    assert!(scene.geometry.placements[0].motion.is_some());
    assert!(scene.geometry.placements[1].motion.is_none());
}

/// A bar of corners up to y = 4 on both sides of y = 2, about which the second joint turns by 90° a second.
fn bar(second_skin: bool) -> Vec<u8> {
    let corners: [[f32; 3]; 6] =
        std::array::from_fn(|i| [if i % 2 == 0 { -1.0 } else { 1.0 }, [0.0, 2.0, 4.0][i / 2], 0.0]);
    let mut builder = Builder::default();
    let positions = builder.floats(&corners);
    let normals = builder.floats(&[[1.0_f32, 0.0, 0.0]; 6]);
    let indices = builder.u32s(&[0, 1, 2, 2, 1, 3, 2, 3, 4, 4, 3, 5]);
    let joints: Vec<u8> = (0..6).flat_map(|_| [0, 1, 0, 0]).collect();
    let joints = builder.accessor(5121, "VEC4", 6, &joints);
    let weights = corners.map(|[_, y, _]| [1.0 - y / 4.0, y / 4.0, 0.0, 0.0]);
    let weights = builder.floats(&weights);
    let bind = |y: f32| [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., y, 0., 1.];
    let bound: Vec<u8> =
        [bind(0.0), bind(-2.0)].concat().iter().flat_map(|v| v.to_le_bytes()).collect();
    let bound = builder.accessor(5126, "MAT4", 2, &bound);
    let input = builder.floats(&[[0.0_f32], [1.0]]);
    #[expect(clippy::cast_possible_truncation, reason = "as files have them")]
    let turned = DQuat::from_rotation_z(FRAC_PI_2).to_array().map(|x| x as f32);
    let output = builder.floats(&[[0.0, 0.0, 0.0, 1.0], turned]);
    let mut nodes = json!([
        {"mesh": 0, "skin": 0, "translation": [100, 0, 0]}, {"children": [2]}, {"translation": [0, 2, 0]},
    ]);
    let mut skins = json!([{"joints": [1, 2], "inverseBindMatrices": bound}]);
    if second_skin {
        // The same mesh, bound to joints that stand still.
        nodes.as_array_mut().unwrap().extend([
            json!({"mesh": 0, "skin": 1}),
            json!({"translation": [3, 0, 0]}),
            json!({"translation": [3, 2, 0]}),
        ]);
        skins.as_array_mut().unwrap().push(json!({"joints": [4, 5], "inverseBindMatrices": bound}));
    }
    builder.glb(json!({
        "nodes": nodes, "skins": skins,
        "meshes": [{"primitives": [{"indices": indices,
            "attributes": {"POSITION": positions, "NORMAL": normals, "JOINTS_0": joints, "WEIGHTS_0": weights}}]}],
        "animations": [{"samplers": [{"input": input, "output": output}],
                        "channels": [{"sampler": 0, "target": {"node": 2, "path": "rotation"}}]}]
    }))
}

#[test]
fn a_bone_that_turns_is_within_a_thousandth_of_a_pixel() {
    let scene = scene(&bar(false), true, 0.5, None).unwrap();
    let steps = steps(&scene, 0);
    let mut worst = 0.0_f64;
    for k in 0..=2000 {
        let time = f64::from(k) / 4000.0;
        let turn = DQuat::from_rotation_z(FRAC_PI_2 * (0.25 + time));
        for i in 0..6 {
            let p = DVec3::new(if i % 2 == 0 { -1.0 } else { 1.0 }, [0.0, 2.0, 4.0][i / 2], 0.0);
            // Linear blend skinning: the mean of where both joints have it.
            let pivot = DVec3::Y * 2.0;
            let due = p.lerp(pivot + turn * (p - pivot), p.y / 4.0);
            let off = corner(steps, time, i).distance(due);
            let pixel = 0.02 * 30f64.to_radians().tan() * due.distance(DVec3::new(0.0, 2.0, 10.0));
            worst = worst.max(off / pixel);
            let normal = steps.normal(steps.moment(time), i).unwrap().normalize();
            // That of the mean of the matrices, whose cofactors are in the plane those of a turn and a stretch.
            let mean = DVec3::X.lerp(turn * DVec3::X, p.y / 4.0).normalize();
            assert!(normal.distance(mean) < 1e-4, "{time}: normal {i} is {normal}, not {mean}");
        }
    }
    // Of a chord the sagitta, and f32's quaternions (6e-8 of 2 m).
    assert!(worst < 1e-3, "{worst} pixels");
    // r θ² / 8 n² with r = 2.24 m / 0.115 m pixels and θ = 45°: 39 steps, of Frobenius' norm 1.73 times as much squared.
    assert!((39..60).contains(&steps.times().len()), "{} steps", steps.times().len());
}

#[test]
fn skins_of_one_mesh_go_by_joints_of_their_own() {
    let scene = scene(&bar(true), true, 0.5, None).unwrap();
    let of = |placement: usize| scene.geometry.mesh_of(&scene.geometry.placements[placement]);
    assert!(of(0).steps.is_some() && of(1).steps.is_none());
    assert_eq!(of(1).positions.get(5), DVec3::new(4.0, 4.0, 0.0));
    // Where the node of a skinned mesh stands does not count.
    let placed = scene.geometry.placements[0].world_from_mesh_at(0.2).point(DVec3::X);
    assert_eq!(placed, DVec3::X);
}

#[test]
fn steps_over_the_limit_of_memory_are_refused_by_their_mesh() {
    let error = scene(&bar(false), true, 0.5, Some(4000)).unwrap_err().to_string();
    assert!(error.contains("shorter exposure") && error.contains("--memory-limit"), "{error}");
}
