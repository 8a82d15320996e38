//! Motion while a whole exposure is summed: codes that shut it out, whole turns, copies of copies, lamps.

use std::f64::consts::PI;

use anyhow::Result;
use etendue_accel::AccelName;
use etendue_geometry::glam::{DMat3, DVec3};
use serde_json::{Value, json};

use crate::rendered::Pixels;
use crate::{Case, Outcome, Scale};

pub(super) const SHUT_OUT: Case = Case {
    name: "motion_while_the_shutter_is_closed",
    regime: "a shining square that goes 2 m within 10⁻² to 10⁻⁹ of the exposure, in the middle of it, while the code of the shutter is \
        closed",
    must: "no light from the way, to the bit; half of its light at the start and half at the end, within 4 standard errors",
    limit: None,
    run: shut_out,
};

pub(super) const WHOLE_TURNS: Case = Case {
    name: "whole_turns_in_one_exposure",
    regime: "a bar that turns by 360°, 720° and 3600° about its middle in one exposure, blurred, with each accelerator",
    must: "each circle has the share of it that the bar covers, within 4 standard errors, which no number of whole turns changes",
    limit: None,
    run: whole_turns,
};

pub(super) const COPIES: Case = Case {
    name: "copies_of_copies_that_move",
    regime: "three copies of an object that spins and flies, copied by hand as well, in a scene of 1 m and of 1 km",
    must: "the depths of all copies are those of objects placed one by one, with all accelerators, to 10⁻⁶ (files have f32)",
    limit: None,
    run: copies,
};

pub(super) const LAMPS: Case = Case {
    name: "lamps_that_move",
    regime: "a shining square of 0.01 m to 1 m that flies 1 m over a floor and turns by up to ten times meanwhile, traced by paths with \
        each accelerator",
    must: "the floor has the mean over time of Lambert's formula for the square, within 4 standard errors and 10⁻⁴; it is asked for its \
        light: the standard error is at most the light over the root of the samples",
    limit: None,
    run: lamps,
};

/// A camera of parallel rays onto the plane z = 0, of so many metres.
fn camera(side: f64, resolution: [u32; 2], shutter: &Value) -> Value {
    json!({ "type": "orthographic", "height": side, "pose": { "from": [0, 0, 5], "look_at": [0, 0, 0] },
            "sensor": { "resolution": resolution }, "shutter": shutter })
}

fn shining(radiance: f64) -> Value {
    json!({ "lamp": { "type": "emissive", "radiance": [radiance, radiance, radiance] } })
}

fn shut_out(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let samples = scale.pick(64, 1024);
    let mut worst = 0.0_f64;
    for share in [1e-2, 1e-5, 1e-9] {
        let [from, to] = [0.5 - 0.5 * share, 0.5 + 0.5 * share];
        let place = |x: f64| json!({ "translate": [x, 0, 0] });
        // Of 1 s; the code is 1 before and after the way.
        let shutter = json!({ "exposure": 1, "open": [[0, from], [to, 1]] });
        let scene = json!({
            "etendue": 1, "tracer": { "type": "path" }, "lights": [], "camera": camera(1.0, [30, 10], &shutter),
            "materials": shining(1.0), "render": { "samples": samples },
            "objects": [{ "shape": "rectangle", "width": 0.5, "height": 4, "material": "lamp",
                          "motion": { "type": "transforms", "times": [from, to], "transforms": [place(-1.0), place(1.0)] } }]
        });
        let pixels = Pixels::read(&scene.to_string())?;
        for (i, &value) in pixels.values.iter().enumerate() {
            let x = (f64::from(u32::try_from(i % 30)?) + 0.5) / 10.0 - 1.5;
            let inside = [-1.0, 1.0].iter().any(|at| (x - at).abs() < 0.19);
            let beside = [-1.0, 1.0].iter().all(|at| (x - at).abs() > 0.31);
            if beside {
                outcome.must(value == 0.0, || format!("{share}: {value} at {x} m, on the way"));
            }
            if inside {
                // Both halves are open as long.
                let due = 0.5 * (1.0 - share);
                let off = (value - due).abs();
                worst = worst.max(off);
                let noise = 4.0 * 0.5 / f64::from(samples).sqrt();
                outcome.must(off <= noise, || format!("{share}: {value}, not {due}, at {x} m"));
            }
        }
    }
    outcome.measured(format!("nothing from the way; at most {worst:.1e} from the half"));
    Ok(outcome)
}

fn whole_turns(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let samples = scale.pick(64, 1024);
    let (half_length, half_width) = (1.0, 0.2_f64);
    let mut worst = 0.0_f64;
    for accel in AccelName::built().map(AccelName::name) {
        for degrees in [360.0, 720.0, 3600.0] {
            let scene = json!({
                "etendue": 1, "tracer": { "type": "path" }, "lights": [],
                "camera": camera(2.4, [48, 48], &json!({ "exposure": 1 })), "materials": shining(1.0),
                "render": { "samples": samples, "accel": accel },
                "objects": [{ "shape": "rectangle", "width": 2.0 * half_length, "height": 2.0 * half_width, "material": "lamp",
                              "motion": { "type": "velocity", "angular_velocity": [0, 0, degrees] } }]
            });
            let pixels = Pixels::read(&scene.to_string())?;
            for ring in 1..18_u32 {
                let radius = 0.05 * f64::from(ring);
                // Of pixels whose middle is about on the circle, the mean and what the closed form says of each.
                let (mut sum, mut due, mut count) = (0.0, 0.0, 0_u32);
                for (i, &value) in pixels.values.iter().enumerate() {
                    let place = |k: usize| -> Result<f64> {
                        Ok((f64::from(u32::try_from(k)?) + 0.5) * 0.05 - 1.2)
                    };
                    let (x, y) = (place(i % 48)?, place(i / 48)?);
                    if (x.hypot(y) - radius).abs() > 0.025 {
                        continue;
                    }
                    // Over the pixel, by 8 × 8 places.
                    let covered = |k: u32| {
                        let [a, b] = [k % 8, k / 8].map(|k| (f64::from(k) + 0.5) / 8.0 - 0.5);
                        let radius = (x + 0.05 * a).hypot(y + 0.05 * b);
                        4.0 * (half_width / radius).min(1.0).asin() / (2.0 * PI)
                    };
                    due += (0..64).map(covered).sum::<f64>() / 64.0;
                    (sum, count) = (sum + value, count + 1);
                }
                let [found, due] = [sum, due].map(|sum| sum / f64::from(count));
                let noise = 4.0 * (0.25 / f64::from(count * samples)).sqrt();
                // Of the 64 places, a few 10⁻⁴ where the bar's edge bends.
                let most = noise + 5e-4;
                outcome.must((found - due).abs() <= most, || {
                    format!("{accel}, {degrees}°, {radius} m: {found}, not {due}")
                });
                worst = worst.max((found - due).abs());
            }
        }
    }
    outcome.measured(format!("at most {worst:.1e} from the share"));
    Ok(outcome)
}

fn copies(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let sizes: &[f64] = scale.pick(&[1.0], &[1.0, 1000.0]);
    let (mut worst, mut compared) = (0.0_f64, 0);
    for &size in sizes {
        let places =
            [[-1.0, 0.3, 0.0], [0.2, -0.8, 0.5], [1.1, 0.9, -1.0]].map(|p| p.map(|x| x * size));
        let motion = json!({ "type": "velocity", "velocity": [30.0 * size, 0, 0], "angular_velocity": [0, 0, 3000],
                             "about": [0, 0, 0] });
        let object = json!({ "shape": "box", "size": [0.8 * size, 0.5 * size, 0.3 * size], "motion": motion });
        let with = |key: &str, value: Value| {
            let mut object = object.clone();
            object[key] = value;
            object
        };
        let list: Vec<Value> = places.iter().map(|place| json!({ "translate": place })).collect();
        let whole = json!([with("instances", json!(list))]);
        let each: Vec<Value> = list.iter().map(|place| with("transform", place.clone())).collect();
        for accel in AccelName::built().map(AccelName::name) {
            let depth = |objects: &Value| {
                let scene = json!({
                    "etendue": 1, "layers": ["depth"], "render": { "accel": accel }, "objects": objects,
                    "camera": { "type": "pinhole", "fov": 60, "pose": { "from": [0, 0, 5.0 * size], "look_at": [0, 0, 0] },
                                "sensor": { "resolution": [48, 36] },
                                "shutter": { "type": "rolling", "line_time": "1 ms", "exposure": "1 ms" } }
                });
                Pixels::read(&scene.to_string())
            };
            let [whole, each] = [depth(&whole)?, depth(&json!(each))?];
            outcome.must(whole.values.iter().any(|depth| depth.is_finite()), || {
                "nothing is seen".to_owned()
            });
            for (a, b) in whole.values.iter().zip(&each.values) {
                let off = if a == b { 0.0 } else { (a / b - 1.0).abs() };
                outcome.must(off <= 1e-6, || format!("{accel}, {size} m: {a}, not {b}"));
                (worst, compared) = (worst.max(off), compared + 1);
            }
        }
    }
    outcome.measured(format!("{compared} pixels, at most {worst:.1e} off"));
    Ok(outcome)
}

/// Lambert's irradiance at the origin, along +Y, of a polygon of radiance 1 that is above the plane y = 0.
fn lambert(corners: [DVec3; 4]) -> f64 {
    let side = |k: usize| {
        let [a, b] = [corners[k], corners[(k + 1) % 4]];
        a.angle_between(b) * a.cross(b).normalize().y
    };
    0.5 * (0..4).map(side).sum::<f64>().abs()
}

fn lamps(scale: Scale) -> Result<Outcome> {
    /// Of the closed form: where the lamp is seen edge-on the light has a kink in time, and the mean over these is off by
    /// some 10⁻⁵ of it.
    const MOMENTS: u32 = 2000;
    const ALBEDO: f64 = 0.8;
    let mut outcome = Outcome::default();
    let samples = scale.pick(64, 4096);
    let cases: &[(f64, f64)] = scale.pick(
        &[(1.0, 90.0)],
        &[(1.0, 0.0), (1.0, 180.0), (1.0, 3600.0), (0.2, 90.0), (0.01, 90.0)],
    );
    for &(side, degrees) in cases {
        let from = DVec3::new(0.6, 0.6, -0.5);
        let due = |k: u32| {
            let time = (f64::from(k) + 0.5) / f64::from(MOMENTS);
            let turn = DMat3::from_rotation_y((degrees * time).to_radians());
            let place = from + DVec3::Z * time;
            let corner = |[x, y]: [f64; 2]| place + turn * (DVec3::new(x, y, 0.0) * (0.5 * side));
            lambert([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(corner))
        };
        let due = ALBEDO / PI * (0..MOMENTS).map(due).sum::<f64>() / f64::from(MOMENTS);
        for accel in AccelName::built().map(AccelName::name) {
            let lamp = json!({ "shape": "rectangle", "width": side, "height": side, "material": "lamp",
                "transform": { "translate": from.to_array() },
                "motion": { "type": "velocity", "velocity": [0, 0, 1], "angular_velocity": [0, degrees, 0] } });
            let scene = json!({
                "etendue": 1, "tracer": { "type": "path" }, "lights": [],
                "camera": { "type": "orthographic", "height": 1e-4, "pose": { "from": [-3, 2, 0], "look_at": [0, 0, 0] },
                            "sensor": { "resolution": [16, 16] }, "shutter": { "exposure": 1 } },
                "materials": { "lamp": { "type": "emissive", "radiance": [1, 1, 1], "two_sided": true },
                               "floor": { "type": "matte", "color": [ALBEDO, ALBEDO, ALBEDO] } },
                "render": { "samples": samples, "accel": accel },
                "objects": [{ "shape": "rectangle", "width": 4, "height": 4, "material": "floor",
                              "transform": { "rotate": [1, 0, 0, -90] } }, lamp]
            });
            let found = Pixels::read(&scene.to_string())?;
            let (mean, error) = (found.mean(), found.standard_error());
            outcome.must((mean - due).abs() <= 4.0 * error + 1e-4 * due, || {
                format!("{accel}, {side} m, {degrees}°: {mean}, not {due}, ± {error}")
            });
            // Paths that come upon it by chance have two times as much at 1 m, and fifty times at 0.01 m.
            outcome.must(error <= due / f64::from(samples * 256).sqrt(), || {
                format!("{accel}, {side} m, {degrees}°: ± {error} of {due}")
            });
            if accel == "embree" {
                outcome.measured(format!(
                    "{side} m, {degrees}°: {:+.1e} off, ± {:.0e}",
                    mean / due - 1.0,
                    error / due
                ));
            }
        }
    }
    Ok(outcome)
}
