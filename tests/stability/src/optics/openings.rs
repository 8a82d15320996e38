//! Openings of nothing, of one pixel, and wider than the lens is far.

use std::f64::consts::PI;
use std::path::Path;

use anyhow::Result;
use etendue_geometry::glam::{DVec2, DVec3};
use etendue_optics::element::{Clip, LensRays, RayStatus};
use etendue_optics::train::{ExitPupil, Focus, LensFile, OpticalTrain, PupilSample, Side};

use super::bench::{YELLOW, lens, parallel, status};
use crate::{Case, Outcome, Scale, rendered};

pub(super) const CLOSED: Case = Case {
    name: "closed_aperture",
    regime: "an aperture of radius 0",
    must: "no exit pupil: an error that names the element; the axis itself passes, 10⁻⁹ mm beside it is \
        vignetted; the f-number is absent",
    limit: None,
    run: closed,
};

pub(super) const F_0_5: Case = Case {
    name: "f_0_5",
    regime: "a thin lens at f/0.5, and a thick one whose rim bends light by more than it can",
    must: "the sampled pupil has the projected solid angle π/2 to 1 %; the thick lens loses its rim by \
        name",
    limit: None,
    run: f_0_5,
};

pub(super) const F_0_01: Case = Case {
    name: "f_0_01",
    regime: "thin lenses at f/2 to f/0.01, from the axis to three radii of the rim beside it",
    must: "no sample weighs more than π; their mean is the irradiance of a disc, π/2 (1 − (f² + r² − a²)/√((f² + r² + \
        a²)² − 4 r² a²)), to 10⁻³; on the axis all weigh the same",
    limit: None,
    run: f_0_01,
};

pub(super) const ONE_PIXEL: Case = Case {
    name: "mask_of_one_pixel",
    regime: "an aperture that is an image of one pixel: white, grey, black",
    must: "white is a square hole of the stated size, grey dims by its value, a scene with a black \
        one is refused with a sentence that names the element",
    limit: None,
    run: one_pixel,
};

fn closed(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let closed = lens(
        r#"{"type": "thin_lens", "focal_length": 50, "semi_diameter": 10, "thickness": 2},
           {"type": "aperture", "shape": "circular", "radius": 0}"#,
    )?;
    let paraxial = closed.paraxial(YELLOW)?;
    let none = (paraxial.f_number, paraxial.entrance_pupil.diameter) == (None, Some(0.0));
    outcome.must(none, || format!("{paraxial:?}"));
    let z = closed.sensor_z(Focus::Infinity)?;
    let pupil = ExitPupil::new(&closed, &[YELLOW], z, [5.0, 5.0]).map(drop);
    let message = pupil.err().map(|error| error.to_string()).unwrap_or_default();
    outcome.must(message.contains("past elements[1]"), || message.clone());
    outcome.measured(format!("“{message}”"));
    let axis = parallel(&closed, Clip::On, 0.0)?;
    outcome.must(axis == RayStatus::Exited, || format!("the axis: {axis:?}"));
    let beside = parallel(&closed, Clip::On, 1e-9)?;
    outcome
        .must(beside == RayStatus::Vignetted { element: 1 }, || format!("beside it: {beside:?}"));
    Ok(outcome)
}

fn f_0_5(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let wide = lens(
        r#"{"type": "thin_lens", "focal_length": 50},
           {"type": "aperture", "shape": "circular", "radius": 50}"#,
    )?;
    let f_number = wide.paraxial(YELLOW)?.f_number;
    outcome.must(f_number == Some(0.5), || format!("{f_number:?}"));
    let pupil = ExitPupil::new(&wide, &[YELLOW], 50.0, [5.0, 5.0])?;
    let side = scale.pick(200_u32, 2_000);
    let place = |i: u32| (f64::from(i) + 0.5) / f64::from(side);
    let samples = (0..side * side)
        .filter_map(|i| pupil.sample(DVec2::ZERO, [place(i % side), place(i / side)], YELLOW));
    // A cone of 45 degrees.
    let within = |s: &PupilSample| -s.direction.z >= 0.5_f64.sqrt();
    let sum: f64 = samples.filter(within).map(|s| s.weight).sum();
    // On the axis the projected solid angle is π sin² 45°; a grid of 200 × 200 gains or loses half a
    // ring of cells, 1/200 of the area.
    let off = sum / f64::from(side * side) / (0.5 * PI) - 1.0;
    outcome.measured(format!("the projected solid angle is {off:+.1e} off π/2"));
    outcome.must(off.abs() < 1e-2, || format!("{off} off"));
    let real = lens(
        r#"{"type": "surface", "radius": 12, "thickness": 14, "glass": {"n": 1.8},
            "semi_diameter": 11.9, "stop": true},
           {"type": "surface", "radius": -60, "semi_diameter": 11.9}"#,
    )?;
    let mut lost = 0;
    for i in 0..120 {
        let from = DVec3::new(0.0, 0.1 * f64::from(i), -9.0);
        let ends = status(&real, Clip::On, from, DVec3::Z)?;
        outcome.must(i > 0 || ends == RayStatus::Exited, || format!("the axis: {ends:?}"));
        lost += u32::from(ends != RayStatus::Exited);
    }
    outcome.measured(format!("{lost} of 120 rays across the thick lens end in it, by name"));
    outcome.must(lost > 0, || "no ray is lost".to_owned());
    Ok(outcome)
}

fn f_0_01(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let side = scale.pick(141_u32, 1_000);
    let place = |i: u32| (f64::from(i) + 0.5) / f64::from(side);
    let f = 50.0;
    let (mut most, mut worst, mut uneven) = (0.0_f64, 0.0_f64, 0.0_f64);
    for f_number in [2.0, 1.0, 0.5, 0.2, 0.05, 0.01] {
        let a = 0.5 * f / f_number;
        let thin = lens(&format!(
            r#"{{"type": "thin_lens", "focal_length": {f}}},
               {{"type": "aperture", "shape": "circular", "radius": {a}}}"#
        ))?;
        let pupil = ExitPupil::new(&thin, &[YELLOW], f, [2.5 * a, 2.0 * a])?;
        for r in [0.0, 0.3 * a, 0.99 * a, 1.01 * a, 3.0 * a] {
            let film = DVec2::new(0.6 * r, -0.8 * r);
            let root = ((f * f + r * r + a * a).powi(2) - 4.0 * r * r * a * a).sqrt();
            let exact = 0.5 * PI * (1.0 - (f * f + r * r - a * a) / root);
            let squares = (0..side * side).map(|i| [place(i % side), place(i / side)]);
            let weights: Vec<f64> = squares
                .filter_map(|square| pupil.sample(film, square, YELLOW))
                .map(|sample| sample.weight)
                .collect();
            let greatest = weights.iter().copied().fold(0.0, f64::max);
            let off = weights.iter().sum::<f64>() / f64::from(side * side) / exact - 1.0;
            let lens = format!("f/{f_number}, {r} mm beside the axis");
            outcome.must(greatest <= PI * (1.0 + 1e-12), || format!("{lens}: a weight {greatest}"));
            outcome.must(off.abs() <= 1e-3, || format!("{lens}: {off} off"));
            (most, worst) = (most.max(greatest), worst.max(off.abs()));
            if r == 0.0 {
                let apart = weights.iter().map(|weight| (weight / exact - 1.0).abs());
                uneven = uneven.max(apart.fold(0.0, f64::max));
            }
        }
    }
    outcome.must(uneven <= 1e-12, || format!("on the axis weights differ by {uneven}"));
    outcome.measured(format!(
        "weights up to {most:.4}, means at most {worst:.1e} off; on the axis weights differ by {uneven:.1e}"
    ));
    Ok(outcome)
}

/// A thin lens before a mask of one pixel, 4 mm wide, of the grey value `grey` of 255.
const MASKED: &str = r#"{"elements": [
    {"type": "thin_lens", "focal_length": 50, "semi_diameter": 10, "thickness": 2},
    {"type": "aperture", "shape": "image", "file": "mask.png", "width": 4}]}"#;

fn write_mask(folder: &Path, grey: u8) -> Result<()> {
    let mask = image::GrayImage::from_pixel(1, 1, image::Luma([grey]));
    Ok(mask.save(folder.join("mask.png"))?)
}

fn one_pixel(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let folder = tempfile::tempdir()?;
    let masked = |grey| -> Result<OpticalTrain> {
        write_mask(folder.path(), grey)?;
        let file = LensFile::from_json(MASKED)?;
        Ok(file.build(&|name: &str| Ok(folder.path().join(name)))?)
    };
    let train = masked(255)?;
    let z = train.sensor_z(Focus::Infinity)?;
    let pupil = ExitPupil::new(&train, &[YELLOW], z, [1.0, 1.0])?;
    let side = scale.pick(100_u32, 1_000);
    let place = |i: u32| (f64::from(i) + 0.5) / f64::from(side);
    let squares: Vec<[f64; 2]> =
        (0..side * side).map(|i| [place(i % side), place(i / side)]).collect();
    let mut rays = LensRays::default();
    pupil.push_rays(&vec![DVec2::ZERO; squares.len()], &squares, YELLOW, &mut rays);
    train.at(YELLOW)?.trace(Side::Sensor, Clip::On, &mut rays);
    let white = rays.passed_throughput() / f64::from(side * side);
    // A square of 4 mm at 48 mm, on the axis: ∫ cos θ dΩ over a rectangle (Howell, B-3, four corners).
    let x = 2.0 / 48.0_f64;
    let root = (1.0 + x * x).sqrt();
    let off = white / (4.0 * (x / root) * (x / root).atan()) - 1.0;
    outcome.measured(format!("white: {off:+.1e} off a square hole"));
    outcome.must(off.abs() < 1e-2, || format!("white: {off} off"));
    let mut ray = LensRays::default();
    ray.push(DVec3::new(0.0, 1.0, -5.0), DVec3::Z);
    masked(51)?.at(YELLOW)?.trace(Side::Object, Clip::On, &mut ray);
    let grey = ray.throughput(0);
    outcome.measured(format!("51 of 255: {grey} passes"));
    outcome.must((grey - 0.2).abs() < 1e-12, || format!("grey: {grey}"));
    let message = dark_scene(folder.path())?;
    outcome.must(message.contains("past elements[1]"), || format!("black: \"{message}\""));
    // Behind the file and the line.
    let sentence = message.rsplit("camera: ").next().unwrap_or_default();
    outcome.measured(format!("black: “{sentence}”"));
    Ok(outcome)
}

/// Message of a scene whose camera has a black mask.
fn dark_scene(folder: &Path) -> Result<String> {
    write_mask(folder, 0)?;
    std::fs::write(folder.join("lens.json"), MASKED)?;
    let scene = rendered::load(
        folder,
        r#"{"etendue": 1, "tracer": {"type": "flat"},
        "camera": {"type": "lens", "lens": "lens.json", "focus_distance": 2,
            "pose": {"from": [0, 0, 2], "look_at": [0, 0, 0]},
            "sensor": {"resolution": [4, 4], "pixel_pitch": 100}},
        "objects": [{"shape": "rectangle"}], "render": {"samples": 4}}"#,
    );
    Ok(scene.err().map(|error| error.to_string()).unwrap_or_default())
}
