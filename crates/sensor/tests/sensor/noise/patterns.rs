//! Fixed patterns, row and column noise, hot pixels.

use serde_json::json;

use super::{even_frame, moments, sensor};

/// The mean of frames, pixel by pixel.
fn mean_of_frames(sensor: &etendue_sensor::Sensor, electrons: f64, frames: u32) -> Vec<f64> {
    let mut sum = vec![0.0; (sensor.resolution()[0] * sensor.resolution()[1]) as usize];
    for frame in 0..frames {
        let (image, _) = even_frame(sensor, electrons, frame, 11);
        for (sum, &y) in sum.iter_mut().zip(&image.values) {
            *sum += f64::from(y) / f64::from(frames);
        }
    }
    sum
}

#[test]
fn prnu_and_dsnu_are_what_was_asked_for() {
    let (gain, dsnu, prnu) = (2.0, 6.0, 0.03);
    let keys = json!({
        "system_gain": gain, "read_noise": 2.0, "black_level": 200, "dsnu": dsnu, "prnu": prnu,
    });
    let sensor = sensor(300, keys);
    let frames = 32;
    let pixels = 300.0 * 300.0;
    let temporal = |electrons: f64| (gain * gain * (electrons + 4.0) + 1.0 / 12.0) / 32.0;
    let dark = mean_of_frames(&sensor, 0.0, frames);
    let [_, variance] = moments(dark.iter().copied());
    let measured = (variance - temporal(0.0)).sqrt() / gain;
    // Relative error of a standard deviation, 1/√(2N), times four; noise adds a tenth.
    let tolerance = 4.0 * 1.1 / (2.0f64 * pixels).sqrt();
    assert!((measured / dsnu - 1.0).abs() < tolerance, "DSNU {measured}");
    let bright = mean_of_frames(&sensor, 10_000.0, frames);
    let response: Vec<f64> = bright.iter().zip(&dark).map(|(b, d)| (b - d) / gain / 1e4).collect();
    let [mean, variance] = moments(response.iter().copied());
    let noise = (temporal(10_000.0) + temporal(0.0)) / (gain * 1e4).powi(2);
    let measured = (variance - noise).sqrt();
    assert!((measured / prnu - 1.0).abs() < tolerance * 1.1, "PRNU {measured}");
    assert!((mean - 1.0).abs() < 4.0 * prnu / pixels.sqrt(), "mean response {mean}");
}

#[test]
fn the_pattern_belongs_to_the_serial_number_and_the_noise_to_seed_and_frame() {
    let with_serial = |serial: u64| {
        let keys = json!({
            "system_gain": 1.0, "black_level": 1000, "dsnu": 50.0, "read_noise": 1.0, "serial": serial,
        });
        sensor(64, keys)
    };
    let [one, other] = [with_serial(1), with_serial(2)];
    let numbers = |sensor, frame, seed| -> Vec<f64> {
        even_frame(sensor, 0.0, frame, seed).0.values.iter().map(|&y| f64::from(y)).collect()
    };
    let correlation = |a: &[f64], b: &[f64]| {
        let ([ma, va], [mb, vb]) = (moments(a.iter().copied()), moments(b.iter().copied()));
        let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - ma) * (b - mb)).sum();
        sum / a.len() as f64 / (va * vb).sqrt()
    };
    let first = numbers(&one, 0, 5);
    assert!(correlation(&first, &numbers(&one, 1, 5)) > 0.99, "frames share the pattern");
    assert!(correlation(&first, &numbers(&one, 0, 6)) > 0.99, "seeds share the pattern");
    // 1/√4096 is one standard error of no correlation.
    assert!(correlation(&first, &numbers(&other, 0, 5)).abs() < 4.0 / 64.0);
    assert_ne!(first, numbers(&one, 1, 5), "frames have their own noise");
    assert_ne!(first, numbers(&one, 0, 6), "seeds have their own noise");
    assert_eq!(first, numbers(&one, 0, 5));
    let quiet = |serial: u64| {
        sensor(
            64,
            json!({ "system_gain": 1.0, "black_level": 9, "read_noise": 9.0, "serial": serial }),
        )
    };
    let residual = correlation(&numbers(&quiet(1), 0, 5), &numbers(&quiet(1), 1, 5));
    assert!(residual.abs() < 4.0 / 64.0, "noise of two frames correlates: {residual}");
}

#[test]
fn rows_and_columns_move_together() {
    let keys = json!({
        "system_gain": 1.0, "black_level": 500, "row_noise": 20.0, "column_noise": 10.0,
    });
    let side = 400;
    let sensor = sensor(side, keys);
    let (image, _) = even_frame(&sensor, 0.0, 0, 3);
    let side = side as usize;
    let line = |values: &mut dyn Iterator<Item = &u16>| {
        values.map(|&y| f64::from(y)).sum::<f64>() / side as f64
    };
    let rows: Vec<f64> = image.values.chunks(side).map(|row| line(&mut row.iter())).collect();
    let columns: Vec<f64> =
        (0..side).map(|x| line(&mut image.values.iter().skip(x).step_by(side))).collect();
    let deviation = |values: &[f64]| moments(values.iter().copied())[1].sqrt();
    let tolerance = 4.0 / (2.0f64 * side as f64).sqrt();
    assert!((deviation(&rows) / 20.0 - 1.0).abs() < tolerance, "{}", deviation(&rows));
    assert!((deviation(&columns) / 10.0 - 1.0).abs() < tolerance, "{}", deviation(&columns));
    let (next, _) = even_frame(&sensor, 0.0, 1, 3);
    assert_ne!(image.values, next.values, "every frame draws its own");
}

#[test]
fn hot_pixels_are_as_many_and_as_hot_as_asked_for() {
    let keys = json!({
        "system_gain": 1.0, "hot_pixels": { "share": 0.01, "dark_current": 1e5 },
    });
    let sensor = sensor(1000, keys);
    let (image, _) = even_frame(&sensor, 0.0, 0, 3);
    let hot: Vec<f64> = image.values.iter().map(|&y| f64::from(y)).filter(|&y| y > 0.0).collect();
    // 10 ms of 10⁵ e⁻/s, distributed exponentially: one in a thousand of them reads as 0.
    let [mean, variance] = moments(hot.iter().copied());
    let count = hot.len() as f64;
    assert!((count - 1e4).abs() < 4.0 * 1e2 + 10.0, "{count} hot pixels");
    assert!((mean - 1000.0).abs() < 4.0 * 1000.0 / count.sqrt() + 1.0, "mean {mean}");
    assert!(
        (variance.sqrt() - 1000.0).abs() < 4.0 * 1400.0 / count.sqrt(),
        "σ {}",
        variance.sqrt()
    );
    let (next, _) = even_frame(&sensor, 0.0, 1, 3);
    let same = image.values.iter().zip(&next.values).filter(|(a, b)| **a > 100 && **b > 50).count();
    let warm = image.values.iter().filter(|&&y| y > 100).count();
    assert_eq!(same, warm, "hot pixels stay where they are");
}
