//! Charge near and above saturation, and defects that are listed.

use etendue_sensor::{Defect, Exposure, Film, Sensor};
use serde_json::json;

use super::{even_frame, moments, sensor};

const SHOT: Exposure = Exposure { exposure: 0.01, frame: 0 };

/// Readings follow the curve from black to beyond the well, and their mean and variance are those that `moments` says.
#[test]
fn what_is_read_follows_the_curve() {
    let (well, gain) = (10_000.0, 0.3);
    let keys = |noise: &str| {
        json!({
            "system_gain": gain, "full_well": well, "black_level": 50, "bit_depth": 12, "read_noise": 3.0,
            "nonlinearity": [[0.7, 0.7], [0.9, 0.86], [1.0, 0.9]], "noise": noise,
        })
    };
    let silent = sensor(4, keys("none"));
    let curve = |share: f64| match share {
        s if s < 0.7 => s,
        s if s < 0.9 => 0.7 + (s - 0.7) * 0.8,
        s => 0.86 + (s.min(1.0) - 0.9) * 0.4,
    };
    for k in 0..=26 {
        let (image, electrons) = even_frame(&silent, well * f64::from(k) / 20.0, 0, 0);
        let level = gain * well * curve(electrons / well) + 50.0;
        assert!(
            (f64::from(image.values[0]) - level).abs() <= 0.5,
            "{k}: {} {level}",
            image.values[0]
        );
    }
    assert_eq!(silent.saturation_level(), (gain * 0.9 * well + 50.0).round());
    assert!((silent.saturation() - well).abs() < 1e-9);
    for noise in ["poisson", "normal"] {
        let (noisy, one) = (sensor(256, keys(noise)), sensor(1, keys(noise)));
        for share in [0.3, 0.695, 0.8, 0.9, 0.98, 1.1] {
            let (image, _) = even_frame(&noisy, share * well, 0, 3);
            let [mean, variance] = moments(image.values.iter().map(|&y| f64::from(y)));
            let light = (share * well / noisy.electrons_per_unit(0)[0]) as f32;
            let moments = one.moments(Film { values: &[light] }, SHOT).unwrap();
            let [m, v] = [moments.mean[0], moments.variance[0]].map(f64::from);
            // 65 536 pixels: five errors of a mean, and of a variance.
            assert!(
                (mean - m).abs() < 5.0 * v.sqrt() / 256.0 + 1e-3,
                "{noise} {share}: {mean} {m}"
            );
            assert!(
                (variance / v - 1.0).abs() < 5.0 * (2.0_f64 / 65_536.0).sqrt(),
                "{noise} {share}: {variance} {v}"
            );
        }
    }
}

fn level(sensor: &Sensor, film: &[f32], column: usize, row: usize) -> u16 {
    let image = sensor.expose(Film { values: film }, SHOT, 0).unwrap();
    image.values[row * image.width + column]
}

/// Charge above the well flows along the column, and light of a column smears over it; each in its colour channel's
/// pixel of a mosaic too, for charge knows no filters.
#[test]
fn charge_flows_and_light_smears() {
    let keys = |blooming: f64, smear: f64| {
        json!({
            "system_gain": 1.0, "full_well": 1000.0, "bit_depth": 16, "noise": "none",
            "blooming": blooming, "smear": smear,
        })
    };
    let bright = |sensor: &Sensor, electrons: f64| {
        let mut film = vec![0.0; 64 * 64];
        film[32 * 64 + 20] = (electrons / sensor.electrons_per_unit(0)[0]) as f32;
        film
    };
    for share in [0.25, 0.5, 1.0] {
        let sensor = sensor(64, keys(share, 0.0));
        let film = bright(&sensor, 9_000.0);
        let image = sensor.expose(Film { values: &film }, SHOT, 0).unwrap();
        let column: f64 = image.values.iter().skip(20).step_by(64).map(|&y| f64::from(y)).sum();
        let all: f64 = image.values.iter().map(|&y| f64::from(y)).sum();
        // A rounding of the film's f32, and of each pixel that is filled in part.
        assert!((column - (1000.0 + share * 8000.0)).abs() < 2.0, "{share}: {column}");
        assert_eq!(column, all);
    }
    let sensor = sensor(64, keys(0.0, 1e-3));
    let film = bright(&sensor, 50_000.0);
    // 10·1e-3/64 of the column's light; the pixel itself is full.
    assert_eq!(level(&sensor, &film, 20, 3), (50_000.0 * 1e-2 / 64.0_f64).round() as u16);
    assert_eq!(level(&sensor, &film, 21, 3), 0);
}

/// Each listed pixel has its defect, at an offset of blocks too, and no other pixel changes by a bit.
#[test]
fn listed_defects_are_those_of_the_list() {
    let (gain, black) = (1.0, 100.0);
    let keys = |map: serde_json::Value| {
        json!({
            "system_gain": gain, "black_level": black, "bit_depth": 12, "read_noise": 1.0,
            "hot_pixels": { "share": 0.0, "dark_current": 1e5 }, "defect_map": map,
        })
    };
    let list = json!([
        { "column": 199, "row": 0, "kind": "dead" }, { "column": 3, "row": 7, "kind": "stuck" },
        { "column": 130, "row": 7, "kind": "hot" }, { "column": 0, "row": 199, "kind": "stuck" },
    ]);
    let [good, bad] = [json!([]), list].map(|map| sensor(200, keys(map)));
    let [(good, _), (image, _)] = [&good, &bad].map(|sensor| even_frame(sensor, 500.0, 0, 3));
    let places = [(199, 0), (3, 7), (130, 7), (0, 199)].map(|(x, y)| y * 200 + x);
    for (at, (a, b)) in good.values.iter().zip(&image.values).enumerate() {
        assert_eq!(a != b, places.contains(&at), "{at}");
    }
    let values = places.map(|at| image.values[at]);
    assert!(values[0] < 110, "dead: {}", values[0]);
    assert_eq!([values[1], values[3]], [4095; 2]);
    assert!(values[2] > good.values[places[2]], "hot: {}", values[2]);
    let listed: Vec<_> = bad.defects().collect();
    assert_eq!(
        listed,
        [
            ([199, 0], 0, Defect::Dead),
            ([3, 7], 0, Defect::Stuck),
            ([130, 7], 0, Defect::Hot),
            ([0, 199], 0, Defect::Stuck),
        ]
    );
}
