//! Whole distributions by χ². A bound of 4 standard deviations is passed by chance once in 30 000;
//! the seeds are fixed, so each test either holds for ever or never.

use serde_json::json;

use super::reference::{chi_square, histogram, poisson_gauss};
use super::{even_frame, sensor};

#[test]
fn electrons_are_poisson_distributed_at_any_mean() {
    // One DN an electron and no other noise: the numbers are the electrons.
    let keys = json!({ "system_gain": 1.0, "bit_depth": 13, "full_well": 8000.0 });
    let sensor = sensor(1000, keys);
    for (seed, mean) in [
        0.01, 0.1, 1.0, 3.0, 7.0, 9.99, 10.01, 12.0, 16.0, 25.0, 40.0, 100.0, 300.0, 1000.0, 5000.0,
    ]
    .into_iter()
    .enumerate()
    {
        let (image, mean) = even_frame(&sensor, mean, 0, seed as u64);
        let probabilities = poisson_gauss(mean, 0.0, 1.0, 0.0, 8191);
        let chi = chi_square(&histogram(&image.values, 8191), &probabilities);
        assert!(chi.abs() < 4.0, "{mean} e⁻: χ² is {chi:.2} standard deviations off");
    }
}

#[test]
fn digital_numbers_follow_the_poisson_gauss_mixture() {
    for (read_noise, gain) in [(0.3, 4.0), (0.3, 1.0), (2.0, 0.7), (2.0, 2.5)] {
        let keys = json!({
            "system_gain": gain, "read_noise": read_noise, "bit_depth": 10, "black_level": 20,
        });
        let sensor = sensor(1000, keys);
        for (seed, mean) in [0.1, 1.0, 10.0, 100.0].into_iter().enumerate() {
            let (image, mean) = even_frame(&sensor, mean, 3, seed as u64);
            let probabilities = poisson_gauss(mean, read_noise, gain, 20.0, 1023);
            let chi = chi_square(&histogram(&image.values, 1023), &probabilities);
            assert!(chi.abs() < 4.0, "{mean} e⁻, σ {read_noise}, K {gain}: χ² {chi:.2}");
        }
    }
}

#[test]
fn dark_electrons_are_poisson_distributed_too() {
    // 3000 e⁻/s for 10 ms without light.
    let keys = json!({ "system_gain": 1.0, "bit_depth": 10, "dark_current": 3000.0 });
    let (image, _) = even_frame(&sensor(1000, keys), 0.0, 0, 5);
    let probabilities = poisson_gauss(30.0, 0.0, 1.0, 0.0, 1023);
    let chi = chi_square(&histogram(&image.values, 1023), &probabilities);
    assert!(chi.abs() < 4.0, "χ² {chi:.2}");
}

#[test]
fn the_test_tells_the_normal_approximation_apart() {
    let keys = json!({
        "system_gain": 4.0, "read_noise": 1.0, "bit_depth": 10, "black_level": 40, "noise": "normal",
    });
    let sensor = sensor(1000, keys);
    for (seed, mean) in [10.0, 100.0].into_iter().enumerate() {
        let (image, mean) = even_frame(&sensor, mean, 0, seed as u64);
        let probabilities = poisson_gauss(mean, 1.0, 4.0, 40.0, 1023);
        let chi = chi_square(&histogram(&image.values, 1023), &probabilities);
        assert!(chi > 20.0, "{mean} e⁻: χ² is only {chi:.2} standard deviations off");
    }
}
