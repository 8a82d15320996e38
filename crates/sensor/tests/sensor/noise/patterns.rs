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

/// Rows and columns of a fixed pattern are those of every frame, and of another serial number others.
#[test]
fn row_and_column_patterns_stay() {
    let keys = |serial: u32| {
        json!({
            "system_gain": 1.0, "black_level": 500, "row_pattern": 20.0, "column_pattern": 10.0, "serial": serial,
        })
    };
    let side = 300_u32;
    let [one, other] = [1, 2].map(|serial| sensor(side, keys(serial)));
    let (image, _) = even_frame(&one, 0.0, 0, 3);
    assert_eq!(image.values, even_frame(&one, 0.0, 1, 4).0.values);
    assert_ne!(image.values, even_frame(&other, 0.0, 0, 3).0.values);
    let side = side as usize;
    let rows: Vec<f64> = image
        .values
        .chunks(side)
        .map(|row| row.iter().map(|&y| f64::from(y)).sum::<f64>() / side as f64)
        .collect();
    let deviation = moments(rows.iter().copied())[1].sqrt();
    // Relative error of a standard deviation of 300 rows, times four.
    assert!((deviation / 20.0 - 1.0).abs() < 4.0 / (2.0 * side as f64).sqrt(), "{deviation}");
}

/// Dark currents of pixels are spread by DCNU: their pattern is proportional to the time and doubles with the
/// temperature, where that of DSNU stays.
#[test]
fn uneven_dark_currents_grow_with_time_and_temperature() {
    let dcnu = 0.2;
    let spread = |exposure: f64, temperature: f64| {
        let sensor = sensor(
            150,
            json!({
                "system_gain": 1.0, "black_level": 20, "dark_current": 500.0, "dcnu": dcnu, "noise": "poisson",
                "dark_current_doubling": 8.0, "temperature": temperature,
            }),
        );
        let film = vec![0.0; 150 * 150];
        let shot = etendue_sensor::Exposure { exposure, frame: 0 };
        let image = sensor.moments(etendue_sensor::Film { values: &film }, shot).unwrap();
        let [mean, variance] = moments(image.mean.iter().map(|&y| f64::from(y)));
        [mean - 20.0, variance.sqrt()]
    };
    for (exposure, temperature, warmer) in
        [(0.5, 293.15, 1.0), (2.0, 293.15, 1.0), (0.5, 301.15, 2.0)]
    {
        let dark = 500.0 * exposure * warmer;
        let [mean, deviation] = spread(exposure, temperature);
        // 22 500 pixels; a current below none, five deviations off, is none.
        assert!((mean / dark - 1.0).abs() < 4.0 * dcnu / 150.0, "{exposure} s: mean {mean}");
        let tolerance = 4.0 / (2.0 * 22_500.0_f64).sqrt();
        assert!((deviation / (dcnu * dark) - 1.0).abs() < tolerance, "{exposure} s: {deviation}");
    }
}

/// Dead pixels read as the black level, stuck ones as full scale, as many as asked for, in the places that the
/// sensor lists.
#[test]
fn defects_are_where_the_sensor_says() {
    use etendue_sensor::Defect;
    let keys = json!({
        "system_gain": 1.0, "black_level": 100, "bit_depth": 12, "dead_pixels": 0.004, "stuck_pixels": 0.002,
        "hot_pixels": { "share": 0.01, "dark_current": 1e5 }, "dark_current": 1e3,
    });
    let side = 500;
    let sensor = sensor(side, keys);
    let (image, _) = even_frame(&sensor, 1000.0, 0, 3);
    let mut wrong = vec![None; image.values.len()];
    for ([column, row], channel, defect) in sensor.defects() {
        assert_eq!(channel, 0);
        wrong[(row * side + column) as usize] = Some(defect);
    }
    for (&value, defect) in image.values.iter().zip(&wrong) {
        match defect {
            Some(Defect::Dead) => assert_eq!(value, 100),
            Some(Defect::Stuck) => assert_eq!(value, 4095),
            // 1000 electrons of light and 10 of heat: ten deviations of their noise below.
            Some(Defect::Hot) => assert!(value > 790, "{value}"),
            None => assert!((790..1430).contains(&value), "{value}"),
        }
    }
    let count = |wanted| wrong.iter().filter(|defect| **defect == Some(wanted)).count() as f64;
    let pixels = f64::from(side * side);
    for (defect, share) in [(Defect::Hot, 0.01), (Defect::Dead, 0.004), (Defect::Stuck, 0.002)] {
        let expected = share * pixels;
        assert!((count(defect) - expected).abs() < 4.0 * expected.sqrt(), "{defect:?}");
    }
    assert_eq!(super::sensor(side, json!({ "system_gain": 1.0 })).defects().count(), 0);
}

/// A pixel of light is spread over its neighbours, behind filters of other colours, too; even light stays even to
/// the edge, and no electron is lost within.
#[test]
fn crosstalk_spreads_electrons() {
    let share = 0.05;
    let spec = json!({
        "type": "raw", "resolution": [5, 5], "system_gain": 1.0, "crosstalk": share, "noise": "none",
        "cfa": "rggb",
    });
    let spec: etendue_sensor::SensorSpec = serde_json::from_value(spec).unwrap();
    let sensor = etendue_sensor::Sensor::new(&spec).unwrap();
    let expose = |film: &[f32]| {
        let shot = etendue_sensor::Exposure { exposure: 0.01, frame: 0 };
        sensor.expose(etendue_sensor::Film { values: film }, shot, 0).unwrap().values
    };
    // Red light upon the red pixel in the middle.
    let mut film = vec![0.0; 5 * 5 * 3];
    film[12 * 3] = 0.5;
    let whole = 0.5 * 65_535.0;
    let image = expose(&film);
    for (k, &value) in image.iter().enumerate() {
        let expected = match k {
            12 => whole * (1.0 - 4.0 * share),
            7 | 11 | 13 | 17 => whole * share,
            _ => 0.0,
        };
        // Half a digital number of rounding, and the sum of products.
        assert!((f64::from(value) - expected).abs() <= 0.5 + 1e-9, "pixel {k}: {value}");
    }
    let even: Vec<u16> = expose(&[0.25; 5 * 5 * 3]);
    assert!(even.iter().all(|&value| value == even[0]), "{even:?}");
}

/// The expected value and the variance that are told hold for what is drawn, with every pattern at once.
#[test]
fn moments_hold_with_all_patterns_together() {
    let sensor = sensor(
        24,
        json!({
            "system_gain": 0.5, "black_level": 60, "bit_depth": 10, "read_noise": 3.0, "dsnu": 5.0, "prnu": 0.05,
            "dcnu": 0.3, "dark_current": 2e3, "row_pattern": 8.0, "column_pattern": 6.0, "row_noise": 2.0,
            "dead_pixels": 0.05, "stuck_pixels": 0.05, "crosstalk": 0.03, "converter_noise": 0.7, "serial": 5,
        }),
    );
    let frames = 400_u32;
    let mean = mean_of_frames(&sensor, 300.0, frames);
    let responsivity = sensor.electrons_per_unit(0)[0];
    let film = vec![(300.0 / responsivity) as f32; 24 * 24];
    let shot = etendue_sensor::Exposure { exposure: 0.01, frame: 0 };
    let told = sensor.moments(etendue_sensor::Film { values: &film }, shot).unwrap();
    let mut sum = 0.0;
    for ((mean, told), variance) in mean.iter().zip(&told.mean).zip(&told.variance) {
        let error = (f64::from(*variance) / f64::from(frames)).sqrt();
        let off = mean - f64::from(*told);
        // Of 576 pixels one in a thousand runs is off by five errors; f32 rounds what is told.
        assert!(off.abs() < 5.0 * error + 1e-3, "{mean} for {told}");
        sum += if error > 0.0 { (off / error).powi(2) } else { 0.0 };
    }
    // The same squares in the mean: 1 within four of its errors, √(2/n); offsets of rows are shared by 24 pixels.
    assert!((sum / 576.0 - 1.0).abs() < 0.45, "χ² {}", sum / 576.0);
}
