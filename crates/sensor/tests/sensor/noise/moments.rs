//! Means and variances within four standard errors, and the images of them.

use etendue_sensor::{Exposure, Film, NoiseModel};
use serde_json::{Value, json};

use super::reference::exact_moments;
use super::{even_frame, moments, sensor};

#[test]
fn means_and_variances_are_those_of_theory() {
    // 2.4 DN of read noise hide the steps of the converter, which then add 1/12 DN².
    let (gain, sigma, black) = (0.6, 4.0, 100.0);
    let keys = json!({ "system_gain": gain, "read_noise": sigma, "black_level": black });
    for noise in [NoiseModel::Poisson, NoiseModel::Normal] {
        let sensor = sensor(1000, keys.clone()).with_noise(noise);
        for (seed, electrons) in
            [0.01, 0.1, 1.0, 9.5, 30.0, 100.0, 1e3, 1e4, 1e5].into_iter().enumerate()
        {
            let (image, electrons) = even_frame(&sensor, electrons, 0, seed as u64);
            let [mean, variance] = moments(image.values.iter().map(|&y| f64::from(y)));
            let count = image.values.len() as f64;
            let expected = gain * gain * (electrons + sigma * sigma) + 1.0 / 12.0;
            let error = (mean - (gain * electrons + black)) / (expected / count).sqrt();
            assert!(error.abs() < 4.0, "{noise:?} {electrons} e⁻: mean {error:.2} errors off");
            // The fourth moment of a Poisson variable is μ + 3μ², that of a normal one 3σ⁴.
            let excess = if noise == NoiseModel::Poisson { gain.powi(4) * electrons } else { 0.0 };
            let spread = ((excess + 2.0 * expected * expected) / count).sqrt();
            let error = (variance - expected) / spread;
            assert!(error.abs() < 4.0, "{noise:?} {electrons} e⁻: variance {error:.2} errors off");
        }
    }
}

#[test]
fn hundreds_of_thousands_of_electrons_do_not_trouble_it() {
    let keys = json!({ "system_gain": 1e-7, "read_noise": 0.0 });
    let sensor = sensor(1000, keys);
    // K·√μ = 0.08 DN: only the mean can be tested; half of the converter's range, 3·10¹¹ e⁻.
    let (image, electrons) = even_frame(&sensor, 3.276_75e11, 0, 1);
    let [mean, _] = moments(image.values.iter().map(|&y| f64::from(y)));
    assert!((mean - electrons * 1e-7).abs() < 0.5, "{mean}");
}

#[test]
fn moments_agree_with_many_frames() {
    let keys = json!({
        "system_gain": 0.5, "read_noise": 3.0, "black_level": 4, "bit_depth": 8, "full_well": 480.0,
        "prnu": 0.02, "dsnu": 2.0, "row_noise": 1.0, "column_noise": 1.5, "dark_current": 500.0,
        "serial": 9,
    });
    let sensor = sensor(32, keys);
    let responsivity = sensor.electrons_per_unit(0)[0];
    // From darkness, where black is clipped, to beyond the full well.
    let film: Vec<f32> =
        (0..32 * 32).map(|i| (550.0 * i as f64 / 1024.0 / responsivity) as f32).collect();
    let film = Film { values: &film };
    let shot = |frame| Exposure { exposure: 0.01, frame };
    let expected = sensor.moments(film, shot(0)).unwrap();
    let frames = 4000;
    let mut sums = vec![[0.0; 2]; 1024];
    for frame in 0..frames {
        let image = sensor.expose(film, shot(frame), 77).unwrap();
        for (sum, &y) in sums.iter_mut().zip(&image.values) {
            sum[0] += f64::from(y);
            sum[1] += f64::from(y) * f64::from(y);
        }
    }
    for (i, [sum, squares]) in sums.into_iter().enumerate() {
        let mean = sum / f64::from(frames);
        let variance = squares / f64::from(frames) - mean * mean;
        let (m, v) = (f64::from(expected.mean[i]), f64::from(expected.variance[i]));
        // Five standard errors for the worst of a thousand pixels; the fourth moment of a pixel that
        // only rarely leaves one number is at most the converter's range squared times its variance.
        let error = 5.0 * (v / f64::from(frames)).sqrt() + 1e-3;
        assert!((mean - m).abs() < error, "pixel {i}: mean {mean}, expected {m}");
        let error = 5.0 * ((3.0 * v * v + 20.0 * v) / f64::from(frames)).sqrt() + 1e-3;
        assert!((variance - v).abs() < error, "pixel {i}: variance {variance}, expected {v}");
    }
}

/// Mean and variance that a sensor of one pixel expects, and the electrons that it sees.
fn expected(keys: &Value, electrons: f64) -> ([f64; 2], f64) {
    let sensor = sensor(1, keys.clone());
    let responsivity = sensor.electrons_per_unit(0)[0];
    let light = (electrons / responsivity) as f32;
    let shot = Exposure { exposure: 0.01, frame: 0 };
    let moments = sensor.moments(Film { values: &[light] }, shot).unwrap();
    let [mean, variance] = [moments.mean[0], moments.variance[0]].map(f64::from);
    ([mean, variance], f64::from(light) * responsivity)
}

#[test]
fn moments_are_those_of_the_law_from_a_hundredth_electron_to_a_hundred_thousand() {
    let electrons =
        [0.0, 0.01, 0.03, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 12.0, 40.0, 150.0, 1e3, 7e3, 3e4, 1e5];
    let mut turn = 0usize;
    for (number, electrons) in electrons.into_iter().enumerate() {
        for bits in 1..=16u32 {
            // The sum over many electrons is long: a quarter of the converters is enough there.
            if electrons > 100.0 && !(bits as usize + number).is_multiple_of(4) {
                continue;
            }
            let white = (1u32 << bits) - 1;
            // Gains at which that light is nowhere, in the midst, at the end and beyond; read noises
            // and black levels in turn, so that all meet.
            let middle = f64::from(white) / (electrons + 2.0);
            for gain in [0.002 * middle, 0.4 * middle, middle, 1.03 * middle, 20.0 * middle] {
                turn += 1;
                let read_noise = [0.0, 0.05, 0.3, 2.45, 11.0][turn % 5];
                let black = [0.0, 0.3, 0.2 * f64::from(white)][turn % 3];
                // The well is full at the mean, a little above it, or nowhere.
                let well = [1e9, electrons, 1.01 * electrons + 0.7, 1e9][turn % 4];
                if well * gain <= 0.5 {
                    continue;
                }
                let keys = json!({
                    "system_gain": gain, "read_noise": read_noise, "black_level": black,
                    "bit_depth": bits, "full_well": well,
                });
                let ([mean, variance], seen) = expected(&keys, electrons);
                let [m, v] = exact_moments(seen, [read_noise, gain, black], well, white);
                // What is promised, and the half step of the f32 that holds it.
                let allowed = 1e-3 * (m - black).abs() + 1e-6 + 6e-8 * m;
                assert!((mean - m).abs() <= allowed, "{seen} e⁻, {keys}: mean {mean}, is {m}");
                let allowed = 1e-3 * v + 1e-6;
                assert!((variance - v).abs() <= allowed, "{seen} e⁻, {keys}: {variance}, is {v}");
            }
        }
    }
    assert_eq!(turn, 5 * (11 * 16 + 5 * 4));
}

#[test]
fn few_electrons_have_the_moments_of_a_frame_of_them() {
    let cases = [
        (0.2, json!({ "system_gain": 10.0, "bit_depth": 12 })),
        (1.0, json!({ "system_gain": 0.347, "read_noise": 2.45, "bit_depth": 12 })),
        (0.0, json!({ "system_gain": 1.0, "read_noise": 0.3, "bit_depth": 1 })),
        (3.0, json!({ "system_gain": 0.25, "read_noise": 0.4, "bit_depth": 1 })),
        (
            30.0,
            json!({
                "system_gain": 1.5, "read_noise": 1.2, "bit_depth": 6, "noise": "normal", "full_well": 33.0,
            }),
        ),
        (30.0, json!({ "system_gain": 1.5, "bit_depth": 6, "noise": "normal", "full_well": 33.0 })),
        (4.0, json!({ "system_gain": 2.0, "read_noise": 1.0, "bit_depth": 8, "noise": "normal" })),
    ];
    for (seed, (electrons, keys)) in cases.into_iter().enumerate() {
        let (image, _) = even_frame(&sensor(1000, keys.clone()), electrons, 0, seed as u64);
        let values: Vec<f64> = image.values.iter().map(|&y| f64::from(y)).collect();
        let [m, v] = moments(values.iter().copied());
        let fourth = values.iter().map(|y| (y - m).powi(4)).sum::<f64>() / values.len() as f64;
        let ([mean, variance], _) = expected(&keys, electrons);
        // Four standard errors of a million pixels.
        let error = 4.0 * (v / values.len() as f64).sqrt();
        assert!((mean - m).abs() < error, "{keys}: mean {m}, expected {mean}");
        let error = 4.0 * ((fourth - v * v).max(0.0) / values.len() as f64).sqrt() + 1e-9;
        assert!((variance - v).abs() < error, "{keys}: variance {v}, expected {variance}");
    }
    // Without noise there is one number.
    let keys =
        json!({ "system_gain": 2.0, "bit_depth": 8, "noise": "none", "dark_current": 100.0 });
    assert_eq!(expected(&keys, 10.0).0, [22.0, 0.0]);
}

#[test]
fn without_noise_every_pixel_has_its_expected_value() {
    let keys = json!({
        "system_gain": 2.0, "read_noise": 5.0, "black_level": 10, "bit_depth": 10, "prnu": 0.1,
        "dsnu": 5.0, "dark_current": 300.0, "full_well": 400.0, "noise": "none",
    });
    let sensor = sensor(4, keys);
    for (electrons, expected) in [(0.0, 16), (100.0, 216), (500.0, 810)] {
        let (image, _) = even_frame(&sensor, electrons, 0, 0);
        // 10 + 2·(electrons + 3 of the dark), no more than the full well's 400.
        assert_eq!(image.values, [expected; 16]);
    }
}

#[test]
fn the_converter_rounds_and_clips_and_never_wraps() {
    let keys = json!({ "system_gain": 1.0, "bit_depth": 4, "noise": "none" });
    let sensor = sensor(4, keys);
    for (electrons, expected) in [(3.4, 3), (3.6, 4), (14.6, 15), (15.6, 15), (16.0, 15), (1e9, 15)]
    {
        let (image, _) = even_frame(&sensor, electrons, 0, 0);
        assert_eq!(image.values[0], expected, "{electrons}");
    }
}
