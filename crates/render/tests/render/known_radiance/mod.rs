//! Scenes whose radiance is known, by every tracer of light, every accelerator and every precision of
//! hits that it has.
//!
//! The pixels of each picture see the same radiance, so their spread gives the standard error of
//! their mean: it has to be within four of the known value, or within `bias` where a scene is only
//! nearly the one that the formula speaks of.

mod bounds;
mod lights;
mod media;
mod one_plane;
mod surfaces;
mod thin;

use etendue_accel::AccelName;
use etendue_scene::Scene;
use etendue_scene::file::LightPrecision;

use crate::steps::{self, channels, load};

const TRACERS: [&str; 3] = ["direct", "whitted", "path"];

/// An accelerator and the precision in which light paths ask it.
type Way = (AccelName, LightPrecision);

/// All accelerators in f64, and Embree in f32, which the others do not have.
fn ways() -> Vec<Way> {
    let double = AccelName::built().map(|accel| (accel, LightPrecision::Double));
    let single = AccelName::built().filter(|accel| accel.has_single());
    double.chain(single.map(|accel| (accel, LightPrecision::Single))).collect()
}

/// All pixels' red.
fn picture(mut scene: Scene, (accel, precision): Way) -> Vec<f64> {
    scene.render.accel = Some(accel);
    scene.plan.light_precision = precision;
    channels(&steps::picture(&scene), "").swap_remove(0)
}

fn assert_shows(name: &str, pixels: &[f64], known: f64, bias: f64) {
    let n = pixels.len() as f64;
    let mean = steps::mean(pixels);
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
