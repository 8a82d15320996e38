//! Glass that parts wavelengths: where each of them goes, and how noisy that is.

use std::path::Path;

use etendue_render::Plan;
use etendue_render::output::Outputs;
use etendue_scene::file::LightPrecision;
use etendue_spectrum::{Bands, Grid};

use crate::steps::{channels, load_in, rendered};

/// The bands of all pixels of the light of the scene `text`.
fn light(folder: &Path, text: &str, precision: LightPrecision, bands: Bands) -> Vec<Vec<f64>> {
    let mut scene = load_in(folder, text);
    scene.plan.light_precision = precision;
    let mut plan = Plan::new(&scene, Outputs::from_list("exr").unwrap());
    plan.bands = bands;
    let done = rendered(&scene, &plan);
    if let Some(film) = &done.band_film {
        let count = film.bands.count();
        let band = |k| film.values.iter().skip(k).step_by(count).map(|&v| f64::from(v)).collect();
        return (0..count).map(band).collect();
    }
    channels(&done.picture, "")
}

/// N-BK7's index at a wavelength (nm): Schott's data sheet of 2014.
fn bk7(nm: f64) -> f64 {
    let squared = (nm / 1000.0).powi(2);
    let term = |b: f64, c: f64| b * squared / (squared - c);
    let sum = term(1.039_612_12, 0.006_000_698_67)
        + term(0.231_792_344, 0.020_017_914_4)
        + term(1.010_469_45, 103.560_653);
    (1.0 + sum).sqrt()
}

/// A wedge of N-BK7 seen face on: the ray leaves its back at θ with sin θ = n sin A, turned by
/// θ − A, and meets a thin lamp at a place that its wavelength decides. Each colour's light has the
/// centroid that its wavelengths have, and between the colours there is no gap.
#[test]
fn a_prism_shows_a_spectrum() {
    const COLUMNS: usize = 192;
    let folder = tempfile::tempdir().unwrap();
    let apex: f64 = 15.0_f64.to_radians();
    let (far, thin) = (20.0, 0.05);
    // Corners (x, y, z): the front at z = 0, and the tilted back.
    let back = |x: f64| -thin - (x + 1.0) * apex.tan();
    let mut model = String::new();
    for y in [-1.0, 1.0] {
        for (x, z) in [(-1.0, 0.0), (1.0, 0.0), (1.0, back(1.0)), (-1.0, back(-1.0))] {
            model += &format!("v {x} {y} {z}\n");
        }
    }
    // Front, back, right, left, bottom and top, counter-clockwise from outside.
    for face in ["1 2 6 5", "3 4 8 7", "2 3 7 6", "4 1 5 8", "4 3 2 1", "5 6 7 8"] {
        model += &format!("f {face}\n");
    }
    std::fs::write(folder.path().join("wedge.obj"), model).unwrap();
    let tangent = |nm: f64| ((bk7(nm) * apex.sin()).asin() - apex).tan();
    let lamp = (far - thin - apex.tan()) * tangent(550.0);
    let seen_at = |nm: f64| {
        let t = tangent(nm);
        (lamp - (far - thin - apex.tan()) * t) / (1.0 - apex.tan() * t)
    };
    let height = 0.005;
    let width = height * COLUMNS as f64 / 4.0;
    let text = |tracer: &str| {
        format!(
            r#"{{"etendue": 1, "tracer": {{"type": "{tracer}", "max_bounces": 6}}, "lights": [],
            "camera": {{"type": "orthographic", "height": {height},
                "pose": {{"from": [0, 0, 3], "look_at": [0, 0, 0]}},
                "sensor": {{"resolution": [{COLUMNS}, 4]}}}},
            "objects": [{{"file": "wedge.obj", "material": "glass"}},
                {{"shape": "rectangle", "width": 0.01, "height": 3, "material": "lamp",
                  "transform": {{"translate": [{lamp}, 0, -{far}]}}}}],
            "materials": {{"glass": {{"type": "dielectric", "ior": "N-BK7"}},
                "lamp": {{"type": "emissive", "radiance": [1, 1, 1]}}}},
            "render": {{"samples": 256}}}}"#
        )
    };
    let middle = |column: usize| width * ((column as f64 + 0.5) / COLUMNS as f64 - 0.5);
    for tracer in ["whitted", "path"] {
        let bands = light(folder.path(), &text(tracer), LightPrecision::Auto, Bands::Rgb);
        let column = |band: &[f64], x: usize| (0..4).map(|y| band[y * COLUMNS + x]).sum::<f64>();
        let mut all = vec![0.0; COLUMNS];
        for (i, band) in bands.iter().enumerate() {
            let (mut sum, mut moment) = (0.0, 0.0);
            for (x, all) in all.iter_mut().enumerate() {
                let light = column(band, x);
                *all += light;
                sum += light;
                moment += light * middle(x);
            }
            let wavelengths = Bands::Rgb.spread(i, &[]).wavelengths;
            let count = wavelengths.len() as f64;
            let known = wavelengths.into_iter().map(seen_at).sum::<f64>() / count;
            let found = moment / sum;
            // Light reflected within the wedge goes elsewhere; noise is a tenth of a column.
            assert!(
                (found - known).abs() < 0.5 * width / COLUMNS as f64,
                "{tracer} band {i}: {found} is not {known}"
            );
        }
        let peak = all.iter().copied().fold(0.0, f64::max);
        let between = |x: &usize| (seen_at(450.0)..seen_at(630.0)).contains(&middle(*x));
        let inside: Vec<usize> = (0..COLUMNS).filter(between).collect();
        assert!(inside.len() > 40, "{inside:?}");
        let gaps = inside.iter().filter(|&&x| all[x] < 0.1 * peak).count();
        assert_eq!(gaps, 0, "{tracer}: {all:?}");
    }
}

/// A ball of N-BK7 and one of its index at the d line, in 31 bands: the same picture but for the
/// colours at its rim, and noise that is nearly the same.
#[test]
fn bands_that_part_make_no_noise() {
    let folder = tempfile::tempdir().unwrap();
    let text = |ior: &str, seed: u32| {
        format!(
            r#"{{"etendue": 1, "tracer": {{"type": "path", "max_bounces": 12}},
            "camera": {{"type": "pinhole", "fov": 30,
                "pose": {{"from": [0, 1, 5], "look_at": [0, 0.6, 0]}},
                "sensor": {{"resolution": [24, 24]}}}},
            "lights": [{{"type": "environment", "radiance": [0.4, 0.5, 0.7]}}],
            "objects": [{{"shape": "sphere", "radius": 0.6, "triangles": 5000, "material": "glass",
                    "transform": {{"translate": [0, 0.6, 0]}}}},
                {{"shape": "rectangle", "width": 8, "height": 8, "material": "floor",
                  "transform": {{"rotate": [1, 0, 0, -90]}}}}],
            "materials": {{"glass": {{"type": "dielectric", "ior": {ior}}},
                "floor": {{"type": "checker"}}}},
            "render": {{"samples": 64, "seed": {seed}}}}}"#
        )
    };
    for precision in [LightPrecision::Double, LightPrecision::Single] {
        let noise_and_mean = |ior: &str| {
            let bands = Bands::Spectral(Grid::equal(400.0, 710.0, 31).unwrap());
            let [a, b] =
                [1, 2].map(|seed| light(folder.path(), &text(ior, seed), precision, bands.clone()));
            assert_eq!(a.len(), 31);
            let (mut squares, mut sum, mut count) = (0.0, 0.0, 0.0);
            for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
                squares += (a - b).powi(2) / 2.0;
                sum += a + b;
                count += 1.0;
            }
            ((squares / count).sqrt(), sum / (2.0 * count))
        };
        let (own, mean) = noise_and_mean("1.5168");
        let (parted, parted_mean) = noise_and_mean(r#""N-BK7""#);
        // One band of 31 kept at random is noisier by an order of magnitude.
        assert!(parted < 1.25 * own, "{precision:?}: {parted}, {own} with a constant index");
        let error = 6.0 * own.hypot(parted) / 24.0;
        assert!((mean - parted_mean).abs() < error, "{mean} {parted_mean}");
    }
}
