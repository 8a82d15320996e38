//! Bodies that move while the rows of a rolling shutter are read.

use anyhow::Result;
use etendue_accel::AccelName;
use serde_json::{Value, json};

use crate::rendered::Pixels;
use crate::{Case, Outcome, Scale};

pub(super) const MOTION: Case = Case {
    name: "bodies_that_move",
    regime: "a bar that turns by 0 to 3600 degrees about a point beside it and flies by up to 1 km/s while the rows of a \
        rolling shutter are read, its line time from 1 ns to 1 s",
    must: "each row has the depths of the same bar standing where it is at the row's time, with all accelerators: the same \
        pixels hit, distances to 10⁻⁶ (files have f32)",
    limit: None,
    run: motion,
};

const COLUMNS: usize = 24;

/// A bar before a camera of parallel rays.
fn scene(accel: &str, rows: usize, shutter: &Value, transform: &Value, motion: &Value) -> Value {
    let mut bar = json!({ "shape": "box", "size": [2.1, 1.3, 0.5], "transform": transform });
    let mut camera = json!({
        "type": "orthographic", "height": 3,
        "pose": { "from": [0.01, 0.02, 5], "look_at": [0.01, 0.02, 0] },
        "sensor": { "resolution": [COLUMNS, rows] },
    });
    if motion.is_object() {
        bar["motion"] = motion.clone();
        camera["shutter"] = shutter.clone();
    }
    json!({ "etendue": 1, "layers": ["depth"], "render": { "accel": accel }, "camera": camera, "objects": [bar] })
}

fn motion(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let rows = scale.pick(16, 32);
    let all: [(f64, f64); 5] =
        [(0.0, 30.0), (150.0, 0.0), (360.0, 1000.0), (720.0, -3.0), (3600.0, 1.0)];
    let motions = scale.pick(&all[1..4], &all);
    let line_times: &[f64] = scale.pick(&[1e-3], &[1e-9, 1e-3, 1.0]);
    let (mut worst, mut compared, mut hit) = (0.0_f64, 0, 0);
    for &line_time in line_times {
        for &(degrees, pace) in motions {
            // By the readout of all rows: so many degrees, and so much of a kilometre a second as fits the picture.
            let readout = line_time * rows as f64;
            let speed = pace.clamp(-1.0 / readout, 1.0 / readout);
            let rate = degrees / readout;
            let shutter = json!({ "type": "rolling", "line_time": line_time, "exposure": 0 });
            let moving = json!({ "type": "velocity", "velocity": [speed, 0, 0],
                                 "angular_velocity": [0, 0, rate], "about": [0, 0, 0] });
            for accel in AccelName::built().map(AccelName::name) {
                let start = json!({ "translate": [0.4, 0, 0] });
                let text = scene(accel, rows, &shutter, &start, &moving);
                let seen = Pixels::read(&text.to_string())?;
                for row in 0..rows {
                    let time = line_time * row as f64;
                    let (sin, cos) = (rate * time).to_radians().sin_cos();
                    let there = json!({ "translate": [0.4 * cos + speed * time, 0.4 * sin, 0],
                                        "rotate": [0, 0, 1, rate * time] });
                    let still = scene(accel, rows, &shutter, &there, &Value::Null);
                    let due = Pixels::read(&still.to_string())?;
                    let of_row = row * COLUMNS..(row + 1) * COLUMNS;
                    for (seen, due) in seen.values[of_row.clone()].iter().zip(&due.values[of_row]) {
                        let off = if seen == due { 0.0 } else { (seen / due - 1.0).abs() };
                        outcome.must(off <= 1e-6, || {
                            format!(
                                "{accel}, {degrees}°, {speed} m/s, row {row}: {seen}, not {due}"
                            )
                        });
                        worst = worst.max(off);
                        compared += 1;
                        hit += u32::from(due.is_finite());
                    }
                }
            }
        }
    }
    outcome.must(hit * 20 > compared, || format!("{hit} of {compared} pixels see the bar"));
    outcome
        .measured(format!("{compared} pixels, {hit} of them on the bar, at most {worst:.1e} off"));
    Ok(outcome)
}
