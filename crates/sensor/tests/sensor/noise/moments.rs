//! Means and variances within four standard errors, and the images of them.

use etendue_sensor::{Exposure, Film, NoiseModel};
use serde_json::json;

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
        // Five standard errors for the worst of a thousand pixels. Where something is clipped, the
        // normal distribution that stands for a skewed one is off by a few hundredths of a DN and
        // by 2 % of the variance that there would be without clipping.
        let error = 5.0 * (v / f64::from(frames)).sqrt() + 0.06;
        assert!((mean - m).abs() < error, "pixel {i}: mean {mean}, expected {m}");
        let whole = 0.25 * (550.0 * i as f64 / 1024.0 + 17.0);
        let error = 5.0 * v * (2.0 / f64::from(frames)).sqrt() + 0.02 * whole;
        assert!((variance - v).abs() < error, "pixel {i}: variance {variance}, expected {v}");
    }
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
