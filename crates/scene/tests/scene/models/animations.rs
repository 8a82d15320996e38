//! Moments of animations, with closed forms.

use etendue_geometry::glam::{DQuat, DVec3};
use etendue_geometry::{Bounds, Motion};
use etendue_scene::import::{Import, Options, Play, Wanted, import};
use serde_json::json;

use super::build::{Builder, SQUARE};
use super::{folder, load, write};

const KEYS: [f32; 3] = [1.0, 2.0, 4.0];

/// A square whose node, below another, is moved in one way by an animation of three keys.
fn animated(path: &str, kind: Option<&str>, output: impl FnOnce(&mut Builder) -> usize) -> Vec<u8> {
    let mut builder = Builder::default();
    let positions = builder.floats(&SQUARE);
    let input = builder.floats(&KEYS.map(|key| [key]));
    let output = output(&mut builder);
    let mut sampler = json!({"input": input, "output": output});
    if let Some(kind) = kind {
        sampler["interpolation"] = json!(kind);
    }
    builder.glb(json!({
        "nodes": [{"children": [1], "translation": [10, 0, 0]}, {"mesh": 0}],
        "scenes": [{"nodes": [0]}], "scene": 0,
        "meshes": [{"primitives": [{"attributes": {"POSITION": positions}}]}],
        "animations": [{"name": "other", "channels": [], "samplers": []},
                       {"name": "move", "samplers": [sampler],
                        "channels": [{"sampler": 0, "target": {"node": 1, "path": path}}]}]
    }))
}

fn at(bytes: &[u8], time: f64) -> Import {
    let folder = folder();
    let path = write(&folder, "a.glb", bytes);
    let animation = Some(Play { which: Some("move".to_owned()), time, plays: false });
    import(&path, Wanted::EVERYTHING, &Options { animation, ..Options::default() }).unwrap()
}

/// Position of the corner (1, 0, 0) of the square.
fn corner(bytes: &[u8], time: f64) -> DVec3 {
    at(bytes, time).placements[0].model_from_mesh.point(DVec3::X)
}

fn near(a: DVec3, b: DVec3) -> bool {
    // Roundings of f64; the keys are exact in f32.
    (a - b).length() < 1e-14
}

#[test]
fn translations_step_go_straight_and_follow_splines() {
    let values = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 8.0, 0.0]];
    let base = DVec3::new(11.0, 0.0, 0.0);
    let step = animated("translation", Some("STEP"), |b| b.floats(&values));
    let linear = animated("translation", None, |b| b.floats(&values));
    for (time, stepped, straight) in [
        (-3.0, [0.0; 3], [0.0; 3]),
        (1.0, [0.0; 3], [0.0; 3]),
        (1.25, [0.0; 3], [0.5, 0.0, 0.0]),
        (2.0, [2.0, 0.0, 0.0], [2.0, 0.0, 0.0]),
        (3.5, [2.0, 0.0, 0.0], [2.0, 6.0, 0.0]),
        (9.0, [2.0, 8.0, 0.0], [2.0, 8.0, 0.0]),
    ] {
        assert!(near(corner(&step, time), base + DVec3::from(stepped)), "{time}");
        assert!(near(corner(&linear, time), base + DVec3::from(straight)), "{time}");
    }
    // A cubic is its own spline: x = t³ − t, with its derivative 3t² − 1 as tangents.
    let cubic = |t: f32| {
        let tangent = [3.0 * t * t - 1.0, 0.0, 0.0];
        [tangent, [t * t * t - t, 0.0, 0.0], tangent]
    };
    let keys: Vec<[f32; 3]> = KEYS.into_iter().flat_map(cubic).collect();
    let spline = animated("translation", Some("CUBICSPLINE"), |b| b.floats(&keys));
    for t in [1.0, 1.3, 2.0, 2.75, 3.9, 4.0_f64] {
        let expected = base + DVec3::new(t.powi(3) - t, 0.0, 0.0);
        // Sums of terms up to 60.
        assert!((corner(&spline, t) - expected).length() < 1e-12, "{t}");
    }
}

#[test]
fn rotations_turn_evenly_the_shorter_way_and_scales_scale() {
    let turn = |degrees: f32| DQuat::from_rotation_z(f64::from(degrees).to_radians());
    #[expect(clippy::cast_possible_truncation, reason = "as files have them")]
    let floats = |q: DQuat| q.to_array().map(|x| x as f32);
    // The second key is the same turn with the other sign.
    let values = [floats(turn(0.0)), floats(-turn(90.0)), floats(turn(90.0))];
    let rotation = animated("rotation", Some("LINEAR"), |b| b.floats(&values));
    for (time, degrees) in [(1.0, 0.0), (1.5, 45.0), (1.75, 67.5), (3.0, 90.0)] {
        let expected = DVec3::X * 10.0 + turn(degrees) * DVec3::X;
        // The keys are rounded to f32.
        assert!((corner(&rotation, time) - expected).length() < 1e-7, "{time}");
    }
    let scales = [[1.0; 3], [3.0, 1.0, 1.0], [3.0, 1.0, 1.0]];
    let scale = animated("scale", None, |b| b.floats(&scales));
    assert!(near(corner(&scale, 1.5), DVec3::new(12.0, 0.0, 0.0)));
}

#[test]
fn at_rest_it_is_said_that_nothing_plays() {
    let folder = folder();
    let bytes = animated("translation", None, |b| b.floats(&[[1.0_f32; 3]; 3]));
    let rest = load(&write(&folder, "a.glb", &bytes));
    assert_eq!(rest.placements[0].model_from_mesh.point(DVec3::X), DVec3::new(11.0, 0.0, 0.0));
    assert!(rest.notes.iter().any(|note| note.subject == "animations"), "{:?}", rest.notes);
    assert!(at(&bytes, 1.0).notes.iter().all(|note| note.subject != "animations"));
}

#[test]
fn a_pointer_to_a_node_is_that_node() {
    let bytes = animated("pointer", None, |b| b.floats(&[[1.0_f32; 3]; 3]));
    assert!(at(&bytes, 1.0).notes[0].message.contains("pointer"), "nothing that is known");
    let text = String::from_utf8_lossy(&bytes).into_owned();
    assert!(text.contains("\"path\":\"pointer\""));
    let folder = folder();
    let mut builder = Builder::default();
    let positions = builder.floats(&SQUARE);
    let (input, output) = (builder.floats(&[[0.0_f32]]), builder.floats(&[[0.0_f32, 5.0, 0.0]]));
    let target = json!({"path": "pointer", "extensions":
        {"KHR_animation_pointer": {"pointer": "/nodes/0/translation"}}});
    let bytes = builder.glb(json!({
        "meshes": [{"primitives": [{"attributes": {"POSITION": positions}}]}],
        "extensionsUsed": ["KHR_animation_pointer"],
        "animations": [{"samplers": [{"input": input, "output": output}],
                        "channels": [{"sampler": 0, "target": target}]}]
    }));
    let path = write(&folder, "b.glb", bytes);
    let options = Options {
        animation: Some(Play { which: None, time: 3.0, plays: false }),
        ..Options::default()
    };
    let import = import(&path, Wanted::EVERYTHING, &options).unwrap();
    assert_eq!(import.placements[0].model_from_mesh.translation, DVec3::new(0.0, 5.0, 0.0));
}

#[test]
fn broken_animations_are_refused_when_they_are_played() {
    let refused = |bytes: &[u8], which: &str, words: &str| {
        let folder = folder();
        let path = write(&folder, "a.glb", bytes);
        let animation = Some(Play { which: Some(which.to_owned()), time: 0.0, plays: false });
        let options = Options { animation, ..Options::default() };
        let error = import(&path, Wanted::EVERYTHING, &options).unwrap_err().to_string();
        assert!(error.contains(words) && error.contains("a.glb"), "{error}");
        // At rest nobody looks.
        load(&path);
    };
    let good = animated("translation", None, |b| b.floats(&[[1.0_f32; 3]; 3]));
    refused(&good, "walk", "0 \"other\", 1 \"move\"");
    refused(&good, "7", "there is no animation \"7\"");
    let short = animated("translation", None, |b| b.floats(&[[1.0_f32; 3]; 2]));
    refused(&short, "move", "6 numbers for 3 keys");
    let nan = animated("translation", None, |b| b.floats(&[[1.0_f32; 3], [f32::NAN; 3], [0.0; 3]]));
    refused(&nan, "1", "not finite");
    let wide = animated("rotation", None, |b| b.floats(&[[1.0_f32; 3]; 3]));
    refused(&wide, "move", "3 components where 4");
    let other = animated("translation", Some("BEZIER"), |b| b.floats(&[[1.0_f32; 3]; 3]));
    refused(&other, "move", "BEZIER");
}

/// A square below two nodes that move: the outer turns and is stretched, the inner goes by a spline and steps.
fn nested() -> Vec<u8> {
    let mut builder = Builder::default();
    let positions = builder.floats(&SQUARE);
    let input = builder.floats(&KEYS.map(|key| [key]));
    let late = builder.floats(&[[1.5_f32], [3.0]]);
    #[expect(clippy::cast_possible_truncation, reason = "as files have them")]
    let turn = |axis: DVec3, angle: f64| {
        DQuat::from_axis_angle(axis.normalize(), angle).to_array().map(|x| x as f32)
    };
    let turns = builder.floats(&[
        turn(DVec3::Z, 0.1),
        turn(DVec3::new(1.0, 2.0, 0.5), 2.9),
        turn(DVec3::new(-1.0, 0.5, 0.5), -1.4),
    ]);
    let scales = builder.floats(&[[1.0_f32, 2.0, 1.0], [3.0, 1.0, 0.5]]);
    let ways: Vec<[f32; 3]> = (0..9_u8).map(|k| [f32::from(k), 1.0, -0.5 * f32::from(k)]).collect();
    let ways = builder.floats(&ways);
    let spins: Vec<[f32; 4]> = [
        [[0.1, 0.2, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0], [0.3, 0.0, 0.1, 0.0]],
        [[0.1, 0.1, 0.0, 0.0], [0.6, 0.0, 0.0, 0.8], [0.0, 0.1, 0.1, 0.0]],
        [[0.0, 0.1, 0.0, 0.1], [0.0, 0.6, 0.0, 0.8], [0.0, 0.0, 0.0, 0.0]],
    ]
    .concat();
    let spins = builder.floats(&spins);
    let steps = builder.floats(&[[1.0_f32; 3], [2.0; 3]]);
    let sampler = |input: usize, output: usize, kind: &str| json!({ "input": input, "output": output, "interpolation": kind });
    let target = |k: usize, node: usize, path: &str| json!({ "sampler": k, "target": { "node": node, "path": path } });
    builder.glb(json!({
        "nodes": [{"children": [1], "translation": [10, 0, 0]},
                  {"children": [2], "rotation": [0, 0.6, 0, 0.8]}, {"mesh": 0}],
        "scenes": [{"nodes": [0]}], "scene": 0,
        "meshes": [{"primitives": [{"attributes": {"POSITION": positions}}]}],
        "animations": [{"name": "move",
            "samplers": [sampler(input, turns, "LINEAR"), sampler(late, scales, "LINEAR"),
                sampler(input, ways, "CUBICSPLINE"), sampler(input, spins, "CUBICSPLINE"), sampler(late, steps, "STEP")],
            "channels": [target(0, 0, "rotation"), target(1, 0, "scale"), target(2, 2, "translation"),
                target(3, 2, "rotation"), target(4, 2, "scale")]}]
    }))
}

fn playing(bytes: &[u8], time: f64) -> Import {
    let folder = folder();
    let path = write(&folder, "a.glb", bytes);
    let animation = Some(Play { which: Some("move".to_owned()), time, plays: true });
    import(&path, Wanted::EVERYTHING, &Options { animation, ..Options::default() }).unwrap()
}

/// Frames that move in each other are, at each time, where the moments of the animation have them; and the box that the
/// square sweeps has all of it.
#[test]
fn what_plays_goes_through_the_moments_of_its_animation() {
    let bytes = nested();
    let shown = 1.2;
    let motion = Motion::default().then_links(&playing(&bytes, shown).placements[0].links);
    assert!(at(&bytes, shown).placements[0].links.is_empty(), "nothing plays unless asked");
    let [first, last] = motion.played_span().unwrap();
    assert!((first - (1.0 - shown)).abs() < 1e-15 && (last - (4.0 - shown)).abs() < 1e-15);
    let local = Bounds { min: DVec3::ZERO, max: DVec3::new(1.0, 1.0, 0.0) };
    let exposure = [-0.7, 3.3];
    let swept = motion.swept(local, exposure);
    for step in 0..=400 {
        let time = exposure[0] + 4.0 * f64::from(step) / 400.0;
        let [played, due] =
            [motion.at(time), at(&bytes, shown + time).placements[0].model_from_mesh];
        for corner in [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0)] {
            let off = (played.point(corner) - due.point(corner)).length();
            // Roundings of f64 of numbers up to some tens; a step falls on either side of its time.
            assert!(off < 1e-12 || (time + shown - 3.0).abs() < 1e-12, "{time}: {off}");
            let point = played.point(corner);
            assert!(point.cmpge(swept.min).all() && point.cmple(swept.max).all(), "{time} {point}");
        }
    }
    // Before the first key and after the last it stands still.
    assert!(motion.moves_within([0.0, 0.1]) && !motion.moves_within([3.0, 5.0]));
}

#[test]
fn what_cannot_play_is_refused_by_its_node() {
    let bad = animated("scale", None, |b| b.floats(&[[1.0; 3], [-1.0, 1.0, 1.0], [1.0; 3]]));
    let folder = folder();
    let refused = |bytes: &[u8]| {
        let path = write(&folder, "bad.glb", bytes);
        let animation = Some(Play { which: Some("move".to_owned()), time: 1.0, plays: true });
        import(&path, Wanted::EVERYTHING, &Options { animation, ..Options::default() })
            .unwrap_err()
            .to_string()
    };
    let error = refused(&bad);
    assert!(error.contains("nodes[1]") && error.contains("scale passes through 0"), "{error}");
}
