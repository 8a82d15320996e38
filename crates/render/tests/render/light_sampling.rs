//! Choice of lights: what would sparkle by chance alone does not.

use std::f64::consts::PI;
use std::path::Path;

use crate::steps::{self, channels, load_in};

/// The red of all pixels of the scene `text` in `folder`.
fn picture(folder: &Path, text: &str) -> Vec<f64> {
    channels(&steps::picture(&load_in(folder, text)), "").swap_remove(0)
}

/// A sky of 64 × 32 pixels, black but for one: E = L Ω cos θ on a plane, of which 16 samples a pixel
/// give every pixel to a few tenths. Directions chosen alike from all sides would meet the pixel with
/// one sample in 1300.
#[test]
fn a_small_sun_in_an_image_lights_without_noise() {
    let folder = tempfile::tempdir().unwrap();
    let (columns, rows, sun) = (64_u32, 32_u32, [40_u32, 7_u32]);
    let radiance = |x: u32, y: u32| if [x, y] == sun { 1e4_f32 } else { 0.0 };
    let sky = image::Rgb32FImage::from_fn(columns, rows, |x, y| image::Rgb([radiance(x, y); 3]));
    image::DynamicImage::from(sky).save(folder.path().join("sky.hdr")).unwrap();
    exr::prelude::write_rgb_file(folder.path().join("sky.exr"), 64, 32, |x, y| {
        let value = radiance(u32::try_from(x).unwrap(), u32::try_from(y).unwrap());
        (value, value, value)
    })
    .unwrap();
    // Lookups between texels make a tent of the one, two texels wide: its integral over the sphere,
    // times the cosine to +Y. Along the row it is one texel wide in the mean; theta is from the top.
    let steps = 2000_u32;
    let row = |k: u32| f64::from(sun[1]) - 0.5 + 2.0 * (f64::from(k) + 0.5) / f64::from(steps);
    let across = |row: f64| {
        let theta = PI * row / f64::from(rows);
        (1.0 - (row - f64::from(sun[1]) - 0.5).abs()) * theta.sin() * theta.cos()
    };
    let over_rows = (0..steps).map(|k| across(row(k))).sum::<f64>() * 2.0 / f64::from(steps);
    let above = over_rows * (PI / f64::from(rows)) * (2.0 * PI / f64::from(columns));
    let known = 0.5 / PI * 1e4 * above;
    for (file, rotate) in [("sky.hdr", 0), ("sky.exr", 0), ("sky.exr", 77)] {
        let pixels = picture(
            folder.path(),
            &format!(
                r#"{{"etendue": 1, "tracer": {{"type": "path"}}, "render": {{"samples": 256}},
                "camera": {{"type": "orthographic", "height": 1, "sensor": {{"resolution": [8, 8]}},
                    "pose": {{"from": [0, 5, 0], "look_at": [0, 0, 0], "up": [0, 0, -1]}}}},
                "objects": [{{"shape": "rectangle", "width": 9, "height": 9, "material": "m",
                              "transform": {{"rotate": [1, 0, 0, -90]}}}}],
                "materials": {{"m": {{"type": "matte", "color": [0.5, 0.5, 0.5]}}}},
                "lights": [{{"type": "environment", "image": "{file}", "rotate": {rotate}}}]}}"#
            ),
        );
        let n = pixels.len() as f64;
        let mean = pixels.iter().sum::<f64>() / n;
        // 64 means of 256 samples leave 0.008 of chance, three times.
        assert!((mean / known - 1.0).abs() < 0.024, "{file}: {mean} is not {known}");
        // A lookup between texels is not the texel's own chance: samples differ by 1.04 of their mean
        // (the square of the interpolation over its mean in each cell, summed: 2.09), means of 256 by
        // 0.065, which 64 pixels show to a tenth.
        let square = pixels.iter().map(|p| (p / mean - 1.0).powi(2)).sum::<f64>() / n;
        assert!(square.sqrt() < 0.09, "{file}: pixels differ by {}", square.sqrt());
    }
}

/// Before a small lamp a glossy plane shows its highlight: light that is chosen by the lamp or by the
/// plane alone sparkles at one end of the roughnesses. By the power heuristic each of the two gives a
/// sample of no more than the lamp's radiance times the share that the plane returns.
#[test]
fn no_highlight_is_brighter_than_the_lamp_in_it() {
    let folder = tempfile::tempdir().unwrap();
    for roughness in [0.03, 0.1, 0.3, 0.7] {
        for size in [0.01, 0.3, 3.0] {
            let pixels = picture(
                folder.path(),
                &format!(
                    r#"{{"etendue": 1, "tracer": {{"type": "path"}}, "render": {{"samples": 1}},
                    "camera": {{"type": "pinhole", "fov": 40, "sensor": {{"resolution": [64, 64]}},
                        "pose": {{"from": [0, 2, 3], "look_at": [0, 0, 0]}}}},
                    "objects": [
                        {{"shape": "rectangle", "width": 9, "height": 9, "material": "m",
                          "transform": {{"rotate": [1, 0, 0, -90]}}}},
                        {{"shape": "rectangle", "width": {size}, "height": {size},
                          "material": "lamp", "transform": {{"translate": [0, 2, -3]}}}}],
                    "materials": {{"m": {{"type": "metal", "color": [1, 1, 1],
                                          "roughness": {roughness}}},
                        "lamp": {{"type": "emissive", "radiance": [100, 100, 100]}}}},
                    "lights": []}}"#
                ),
            );
            let most = pixels.iter().copied().fold(0.0, f64::max);
            // Twice: by the lamp and by the plane, in the same sample.
            assert!(most <= 200.0, "roughness {roughness}, lamp {size}: {most}");
            assert!(most > 0.0, "the lamp shines");
        }
    }
}
