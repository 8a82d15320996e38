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

use std::sync::Arc;

use etendue_accel::AccelName;
use etendue_geometry::Mesh;
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

/// Divides each triangle of a scene into `n`² alike. Neighbours still share corners to the bit where `n` is a power of
/// two and the corners are those of boxes of such sides: single precision holds all of them.
fn divide(scene: &mut Scene, n: u32) {
    for mesh in &mut Arc::make_mut(&mut scene.geometry).meshes {
        let (mut corners, mut triangles) = (Vec::new(), Vec::new());
        for whole in 0..mesh.triangles.len() {
            let [a, b, c] = mesh.corners(whole);
            let mut corner = |i: u32, j: u32| {
                let [along, across] = [i, j].map(|k| f64::from(k) / f64::from(n));
                corners.push((a + (b - a) * along + (c - a) * across).to_array());
                u32::try_from(corners.len() - 1).unwrap()
            };
            for (i, j) in (0..n).flat_map(|i| (0..n - i).map(move |j| (i, j))) {
                triangles.push([corner(i, j), corner(i + 1, j), corner(i, j + 1)]);
                if i + j + 1 < n {
                    triangles.push([corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)]);
                }
            }
        }
        *mesh = Mesh::from_arrays(mesh.name.clone(), &corners, &triangles).unwrap();
    }
}
