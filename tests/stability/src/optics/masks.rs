//! f-numbers that a lens does not have, and masks of which little is open.

use std::f64::consts::PI;

use anyhow::Result;
use etendue_geometry::glam::{DVec2, DVec3};
use etendue_optics::element::{Clip, LensRays};
use etendue_optics::train::analysis::projected_solid_angle;
use etendue_optics::train::{ExitPupil, Focus, LensFile, OpticalTrain, Side};

use super::bench::{YELLOW, lens};
use crate::{Case, Outcome, Scale};

pub(super) const WIDER_THAN_THE_LENS: Case = Case {
    name: "wider_than_the_lens",
    regime: "f-numbers from the widest of a lens to ten times wider",
    must: "the widest is accepted and has its light to 1 %; every wider one is refused and names it",
    limit: None,
    run: wider_than_the_lens,
};

pub(super) const LITTLE_OPEN: Case = Case {
    name: "mask_with_little_open",
    regime: "masks in a thin lens' stop: a coded one of 13 × 13, a ring, two holes, one hole of 8 × 8 \
        pixels of 400 × 400",
    must: "of the rays aimed at them 90 % get through from everywhere on the sensor, and they bring the \
        light of the closed form to 0.5 %",
    limit: None,
    run: little_open,
};

fn wider_than_the_lens(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    // f/2 by the rim of the lens, behind which an iris opens.
    let train = lens(
        r#"{"type": "thin_lens", "focal_length": 50, "semi_diameter": 12.5},
           {"type": "aperture", "shape": "circular", "radius": 3, "stop": true}"#,
    )?;
    let open = train.clone().with_f_number(2.0)?;
    let light = projected_solid_angle(&open, &open.at(YELLOW)?, DVec3::new(0.0, 0.0, 50.0));
    let exact = PI * 12.5_f64.powi(2) / (12.5_f64.powi(2) + 2500.0);
    outcome.measured(format!("f/2: {:+.1e} off its light", light / exact - 1.0));
    outcome.must((light / exact - 1.0).abs() < 0.01, || format!("{light} for {exact}"));
    let mut refused = 0;
    for wider in [1.95, 1.0, 0.2] {
        match train.clone().with_f_number(wider) {
            Err(error) if error.to_string().contains("f/2 at most") => refused += 1,
            other => outcome.must(false, || format!("f/{wider}: {other:?}")),
        }
    }
    outcome
        .measured(format!("{refused} of 3 wider ones are refused by \u{201c}f/2 at most\u{201d}"));
    Ok(outcome)
}

/// Masks by name: pixels a side, and what is open.
type Open = fn(u32, u32) -> bool;
const MASKS: [(&str, u32, Open); 4] = [
    ("coded", 13, |x, y| (x * x * 7 + y * 5 + x * y * 3) % 13 < 6),
    ("ring", 200, |x, y| (6400..9025).contains(&squared(x, y, 100))),
    ("two holes", 300, |x, y| squared(x, y, 60).min(squared(x, y, 240)) < 144),
    ("one hole", 400, |x, y| (226..234).contains(&x) && (226..234).contains(&y)),
];

fn squared(x: u32, y: u32, centre: u32) -> u32 {
    x.abs_diff(centre).pow(2) + y.abs_diff(centre).pow(2)
}

fn little_open(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let (width, distance) = (20.0, 50.0);
    for (name, pixels, open) in MASKS {
        let folder = tempfile::tempdir()?;
        let grey = |x, y| image::Luma([if open(x, y) { 255 } else { 0 }]);
        image::GrayImage::from_fn(pixels, pixels, grey).save(folder.path().join("mask.png"))?;
        let train = LensFile::from_json(
            r#"{"elements": [{"type": "thin_lens", "focal_length": 50}, {"type": "aperture",
                "shape": "image", "file": "mask.png", "width": 20, "stop": true}]}"#,
        )?
        .build(&|name: &str| Ok(folder.path().join(name)))?;
        let z = train.sensor_z(Focus::Infinity)?;
        let pupil = ExitPupil::new(&train, &[YELLOW], z, [18.0, 12.0])?;
        let (mut least, mut worst) = (1.0_f64, 0.0_f64);
        for film in [DVec2::ZERO, DVec2::new(17.9, -11.9), DVec2::new(-7.0, 5.0)] {
            let (left, light) = sampled(&train, &pupil, film, scale.pick(60_000, 4_000_000))?;
            let exact = closed_form(pixels, open, [width, distance], film);
            least = least.min(left);
            worst = worst.max((light / exact - 1.0).abs());
        }
        outcome.measured(format!("{name}: {:.1} % get through, {worst:.1e} off", 100.0 * least));
        outcome.must(least >= 0.9, || format!("{name}: {least} get through"));
        // Five in a hundred fail: 60 000 samples have a deviation of 1e-3 if random.
        outcome.must(worst < 5e-3, || format!("{name}: {worst} off"));
    }
    Ok(outcome)
}

/// The share of rays that get through and the light that they bring.
fn sampled(train: &OpticalTrain, pupil: &ExitPupil, film: DVec2, count: u32) -> Result<(f64, f64)> {
    let at = train.at(YELLOW)?;
    let (mut passed, mut light) = (0, 0.0);
    for start in (0..count).step_by(10_000) {
        // The R2 sequence (M. Roberts, 2018).
        let place = |i: u32| {
            [0.754_877_666_246_693, 0.569_840_290_998_053]
                .map(|a: f64| (0.5 + a * f64::from(i)).fract())
        };
        let squares: Vec<[f64; 2]> = (start..(start + 10_000).min(count)).map(place).collect();
        let mut rays = LensRays::default();
        pupil.push_rays(&vec![film; squares.len()], &squares, YELLOW, &mut rays);
        at.trace(Side::Sensor, Clip::On, &mut rays);
        passed += rays.exited();
        light += rays.passed_throughput();
    }
    #[expect(clippy::cast_precision_loss, reason = "a few million rays")]
    let passed = passed as f64;
    Ok((passed / f64::from(count), light / f64::from(count)))
}

/// The sum of cos⁴/d² over the open pixels of a mask, each of 8 × 8 points.
fn closed_form(pixels: u32, open: Open, [width, distance]: [f64; 2], film: DVec2) -> f64 {
    let side = width / f64::from(pixels);
    let mut sum = 0.0;
    for pixel in (0..pixels * pixels).filter(|i| open(i % pixels, i / pixels)) {
        for part in 0..64 {
            let at = |pixel: u32, part: u32| {
                (f64::from(pixel) + (f64::from(part) + 0.5) / 8.0) * side - 0.5 * width
            };
            let place = DVec2::new(at(pixel % pixels, part % 8), -at(pixel / pixels, part / 8));
            let squared = distance * distance + (place - film).length_squared();
            sum += distance * distance / (squared * squared) * side * side / 64.0;
        }
    }
    sum
}
