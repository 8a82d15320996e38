//! Scenes whose radiance is known, by every tracer of light, every accelerator and every precision of
//! hits that it has.
//!
//! The pixels of each picture see the same radiance, so their spread gives the standard error of
//! their mean: it has to be within four of the known value, or within `bias` where a scene is only
//! nearly the one that the formula speaks of.

mod bounds;
mod lights;
mod surfaces;

use std::path::Path;

use etendue_accel::BuildOptions;
use etendue_render::output::{Outputs, Values};
use etendue_render::{Images, Plan, accelerators, build, plan, render};
use etendue_scene::file::{AccelName, LightPrecision, SceneFile};
use etendue_scene::{LoadOptions, Scene};

const TRACERS: [&str; 3] = ["direct", "whitted", "path"];

/// An accelerator and the precision in which light paths ask it.
type Way = (AccelName, LightPrecision);

/// All accelerators in f64, and Embree in f32, which the others do not have.
fn ways() -> Vec<Way> {
    let double = accelerators().iter().map(|&accel| (accel, LightPrecision::Double));
    let single = accelerators().iter().filter(|&&accel| accel == AccelName::Embree);
    double.chain(single.map(|&accel| (accel, LightPrecision::Single))).collect()
}

fn load(text: &str) -> Scene {
    load_in(tempfile::tempdir().unwrap().path(), text)
}

fn load_in(folder: &Path, text: &str) -> Scene {
    let path = folder.join("scene.json");
    std::fs::write(&path, text).unwrap();
    let file = SceneFile::read(&path, &[]).unwrap();
    file.load(plan::wanted(&file.spec.all_layers()), &LoadOptions::default()).unwrap()
}

/// All pixels' red.
fn picture(mut scene: Scene, (accel, precision): Way) -> Vec<f64> {
    scene.render.accel = Some(accel);
    scene.plan.light_precision = precision;
    let outputs = Outputs::from_list("exr").unwrap();
    let plan = Plan::new(&scene, outputs);
    let accel = build(&scene, &plan, &BuildOptions::default()).unwrap();
    let images = Images::decode(&scene, &plan, None).unwrap();
    let done = render(&scene, &plan, &*accel, &images, Vec::new(), &|_: f64| true).unwrap();
    assert_eq!(done.light.not_finite, 0);
    match &done.picture.layers()[0].channels[0].values {
        Values::F32(values) => values.iter().map(|&v| f64::from(v)).collect(),
        other => panic!("a picture is f32: {other:?}"),
    }
}

fn assert_shows(name: &str, pixels: &[f64], known: f64, bias: f64) {
    let n = pixels.len() as f64;
    let mean = pixels.iter().sum::<f64>() / n;
    let variance = pixels.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / (n - 1.0);
    // Pictures are f32: half a unit in the last place is the least error.
    let bound = 4.0 * (variance / n).sqrt() + bias + 1e-7 * known;
    assert!((mean - known).abs() <= bound, "{name}: {mean} is not {known} within {bound}");
}

/// A picture of `8 × 8` pixels of a tiny patch around `at`, from `from`.
fn patch(tracer: &str, samples: u32, from: [f64; 3], at: [f64; 3], rest: &str) -> String {
    format!(
        r#"{{"etendue": 1, "tracer": {{"type": "{tracer}"}},
        "camera": {{"type": "orthographic", "height": 1e-3,
            "pose": {{"from": {from:?}, "look_at": {at:?}, "up": [0.1, 0.2, 0.9]}},
            "sensor": {{"resolution": [8, 8]}}}},
        "render": {{"samples": {samples}}}, {rest}}}"#
    )
}

/// Runs `text` by every tracer and accelerator against the value that each tracer should find.
fn check(
    name: &str,
    samples: u32,
    [from, at]: [[f64; 3]; 2],
    rest: &str,
    change: impl Fn(&mut Scene),
    bias: f64,
    known: impl Fn(&str) -> f64,
) {
    for tracer in TRACERS {
        for way in ways() {
            let mut scene = load(&patch(tracer, samples, from, at, rest));
            change(&mut scene);
            let pixels = picture(scene, way);
            assert_shows(&format!("{name}, {tracer}, {way:?}"), &pixels, known(tracer), bias);
        }
    }
}
