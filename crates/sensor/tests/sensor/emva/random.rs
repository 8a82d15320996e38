//! Sensors drawn at random: their series gives back what was drawn.

use etendue_sensor::emva::{Options, Series};
use serde_json::json;

use super::analysis::{Characterised, Measured};
use super::sensor;

/// Uniform numbers in 0..1 (Vigna's splitmix64).
fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 * 2f64.powi(-53)
}

#[test]
fn random_sensors_are_found_again() {
    let mut state = 1288;
    for (number, bits) in [8, 10, 12, 12, 14, 16].into_iter().enumerate() {
        // Between two values, each power of ten as likely as another.
        let mut draw = |low: f64, high: f64| low * (high / low).powf(uniform(&mut state));
        let full_well = draw(5e3, 1e5);
        let black_level = 0.02 * 2f64.powi(bits);
        let levels = 2f64.powi(bits) - 1.0 - black_level;
        // The well or the converter saturates first, by up to a tenth.
        let gain = levels / full_well * draw(0.9, 1.1);
        // With less noise before the converter than 0.8 DN its rounding is no noise of 1/12 DN².
        let read_noise = draw(1.0, 15.0).max(0.8 / gain);
        let (dark_current, efficiency) = (draw(0.1, 100.0), draw(0.2, 0.95));
        let (prnu, dsnu) = (draw(0.005, 0.03), draw(0.5, 2.0) * read_noise);
        let spec = json!({
            "type": "raw", "bit_depth": bits, "full_well": full_well, "system_gain": gain,
            "black_level": black_level.max(8.0 * gain * read_noise.hypot(dsnu)).round(),
            "read_noise": read_noise, "dark_current": dark_current, "prnu": prnu, "dsnu": dsnu,
            "quantum_efficiency": efficiency, "serial": number, "resolution": [128, 128],
        });
        let sensor = sensor(spec.clone());
        let options = Options { steps: 20, seed: number as u64, ..Options::default() };
        let series = Series::plan(&sensor, &options).unwrap();
        let folder = tempfile::tempdir().unwrap();
        series.write(&sensor, &options, folder.path(), |_| true).unwrap();
        let found = Characterised::read(folder.path(), gain * sensor.saturation());
        for (name, Measured { value, error }, expected) in [
            ("system gain", found.system_gain, gain),
            ("quantum efficiency", found.quantum_efficiency, efficiency),
            ("read noise", found.read_noise, read_noise),
            ("dark current by its mean", found.dark_current_by_mean, dark_current),
            ("dark current by its variance", found.dark_current_by_variance, dark_current),
            ("DSNU", found.dsnu, dsnu),
            ("PRNU", found.prnu, prnu),
        ] {
            let errors = (value - expected) / error;
            println!("{name}: {value:.5}, {expected:.5} drawn, {errors:.1} of {error:.2e}");
            // The errors themselves say something: none is wider than 5 %, but for a dark current
            // that is hardly seen in variances.
            let widest = if name.ends_with("variance") { 0.2 } else { 0.05 };
            assert!(error < widest * expected, "{name} is known to {error} only: {spec}");
            assert!(
                errors.abs() < 4.0,
                "{name}: {value}, {expected} drawn, {errors} errors: {spec}"
            );
        }
        println!("linearity: {:.1}, {:.2e}", found.worst_deviation, found.linearity_error);
        // Twenty signals of a normal distribution: beyond four errors once in a thousand sensors.
        assert!(found.worst_deviation < 4.0, "{spec}: {}", found.worst_deviation);
        // 0.02 %, which `Options` states for a single signal and the larger images that it chooses.
        assert!(found.linearity_error < 2e-4, "{spec}: {}", found.linearity_error);
    }
}
