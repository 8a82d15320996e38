//! Gains: settings of the amplifier, and what the converter adds behind it.

use serde_json::json;

use super::{even_frame, moments, sensor};

/// K (DN/e⁻) and the noise of the read-out (e⁻) by the photon transfer of two even frames.
fn transfer(sensor: &etendue_sensor::Sensor, electrons: f64) -> [f64; 2] {
    let statistics = |electrons: f64| {
        let (image, _) = even_frame(sensor, electrons, 0, 7);
        moments(image.values.iter().map(|&y| f64::from(y)))
    };
    let ([dark, of_dark], [bright, of_bright]) = (statistics(0.0), statistics(electrons));
    let gain = (of_bright - of_dark) / (bright - dark);
    // The converter's rounding adds a twelfth.
    [gain, (of_dark - 1.0 / 12.0).sqrt() / gain]
}

/// Each setting has its own gain, noise and well, found again from its pictures; the first holds by default.
#[test]
fn each_iso_setting_is_found_again() {
    let settings = json!([
        { "iso": 100, "system_gain": 0.25, "read_noise": 8.0, "full_well": 15_000.0 },
        { "iso": 800, "system_gain": 2.0, "read_noise": 1.6, "full_well": 1_900.0, "black_level": 64 },
        { "iso": 1600, "system_gain": 4.0 },
    ]);
    let at = |iso: Option<u32>| {
        let mut keys = json!({
            "iso_settings": settings, "bit_depth": 12, "read_noise": 1.5, "black_level": 40, "full_well": 950.0,
        });
        if let Some(iso) = iso {
            keys["iso"] = iso.into();
        }
        sensor(400, keys)
    };
    for (iso, gain, noise, well, black) in [
        (None, 0.25, 8.0, 15_000.0, 40.0),
        (Some(800), 2.0, 1.6, 1_900.0, 64.0),
        (Some(1600), 4.0, 1.5, 950.0, 40.0),
    ] {
        let sensor = at(iso);
        assert_eq!(sensor.system_gain(), gain);
        assert_eq!((sensor.full_well(), sensor.black_level()), (well, black));
        let [measured, read_noise] = transfer(&sensor, 0.5 * well);
        // A variance of 160 000 pixels is known to √(2/n), times five; the dark one counts little.
        let tolerance = 5.0 * (2.0_f64 / 160_000.0).sqrt();
        assert!((measured / gain - 1.0).abs() < tolerance, "{iso:?}: K {measured}");
        assert!((read_noise / noise - 1.0).abs() < 2.0 * tolerance, "{iso:?}: σ {read_noise}");
        // Light beyond the well reads as the well, at each setting its own.
        let (full, _) = even_frame(&sensor, 3.0 * well, 0, 1);
        let level = (gain * well + black).round_ties_even().min(4095.0);
        let middle = full.values.iter().map(|&y| f64::from(y)).sum::<f64>() / 160_000.0;
        // What the read-out adds to a full well, over the pixels, times five.
        assert!((middle - level).abs() < 5.0 * gain * noise / 400.0 + 0.5, "{iso:?}: {middle}");
    }
}

/// Analog gain multiplies K, and what the converter adds is divided by it, where variances add up.
#[test]
fn analog_gain_hides_the_noise_of_the_converter() {
    for factor in [0.5, 1.0, 4.0, 16.0] {
        let sensor = sensor(
            400,
            json!({
                "system_gain": 0.2, "analog_gain": factor, "read_noise": 2.0, "converter_noise": 1.5,
                "black_level": 100, "bit_depth": 14,
            }),
        );
        let gain = 0.2 * factor;
        let noise = 2.0_f64.hypot(1.5 / gain);
        assert!((sensor.read_noise() / noise - 1.0).abs() < 1e-15);
        let [measured, read_noise] = transfer(&sensor, 4_000.0);
        let tolerance = 5.0 * (2.0_f64 / 160_000.0).sqrt();
        assert!((measured / gain - 1.0).abs() < tolerance, "{factor}: K {measured}");
        assert!((read_noise / noise - 1.0).abs() < 2.0 * tolerance, "{factor}: σ {read_noise}");
    }
}
