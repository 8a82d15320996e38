//! Pixels and dimensions that should know nothing of each other.

use anyhow::Result;
use rayon::prelude::*;

use crate::rendered::Pixels;

use super::{SAMPLERS, correlation, mean, smooth};
use crate::{Case, Outcome, Scale};

pub(super) const NEIGHBOURS: Case = Case {
    name: "neighbouring_pixels",
    regime: "the errors of neighbouring pixels, and of one pixel with neighbouring seeds, at 16 samples",
    must: "their correlation is within 4/√N of 0 along rows, columns, diagonals and seeds",
    limit: None,
    run: neighbours,
};

pub(super) const PAIRS: Case = Case {
    name: "pairs_of_dimensions",
    regime: "coordinates of different pairs of one pixel at 16 samples: place in the pixel, place in the \
        pupil, light, direction",
    must: "their correlation, averaged over N pixels, is within 4.5/√N of 0",
    limit: None,
    run: pairs,
};

pub(super) const FRAMES: Case = Case {
    name: "noise_of_frames",
    regime: "a wall under an even sky, by a path a pixel, in frames 0, 1, 2, 1000 and 2³¹ of a still camera, and the same \
        with `frozen_noise`",
    must: "the noise of any two frames correlates by less than 4/√N, and that of frozen ones is the same to the bit",
    limit: None,
    run: frames,
};

fn frames(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let side: u32 = scale.pick(100, 512);
    let shown = |frame: u32, is_frozen: bool| {
        let text = format!(
            r#"{{"etendue": 1, "tracer": {{"type": "direct"}},
            "camera": {{"type": "pinhole", "fov": 40, "pose": {{"from": [0, 0, 2], "look_at": [0, 0, 0]}},
                "sensor": {{"resolution": [{side}, {side}]}}}},
            "lights": [{{"type": "environment"}}],
            "objects": [{{"shape": "rectangle", "width": 40, "height": 40, "material": "wall"}},
                {{"shape": "sphere", "radius": 0.3, "transform": {{"translate": [0, 0, 4]}}}}],
            "materials": {{"wall": {{"type": "matte", "color": [0.3, 0.3, 0.3]}}}},
            "render": {{"samples": 1, "frame": {frame}, "frozen_noise": {is_frozen}}}}}"#
        );
        Pixels::read(&text).map(|pixels| pixels.values)
    };
    let numbers = [0, 1, 2, 1000, 1 << 31];
    let pictures = numbers.map(|frame| shown(frame, false));
    let pictures = pictures.into_iter().collect::<Result<Vec<_>>>()?;
    let (mut most, bound) = (0.0_f64, 4.0 / f64::from(side));
    for (i, one) in pictures.iter().enumerate() {
        for (k, other) in pictures[..i].iter().enumerate() {
            let pairs: Vec<[f64; 2]> = one.iter().zip(other).map(|(&a, &b)| [a, b]).collect();
            let found = correlation(&pairs).abs();
            outcome.must(found <= bound, || {
                format!("frames {} and {}: correlated by {found}", numbers[k], numbers[i])
            });
            most = most.max(found);
        }
    }
    let is_same = shown(7, true)? == shown(8, true)?;
    outcome.must(is_same, || "frozen frames differ".to_owned());
    outcome.measured(format!("at most {most:.4} of {bound:.4}; frozen frames are the same"));
    Ok(outcome)
}

fn neighbours(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let side: u32 = scale.pick(64, 512);
    for (name, sampler) in SAMPLERS {
        let picture = |seed: u64| -> Vec<f64> {
            let each = |i| mean(&sampler.pixel(seed, i % side, i / side, 16), 0, 16, smooth) - 1.0;
            (0..side * side).into_par_iter().map(each).collect()
        };
        let (one, other) = (picture(20), picture(21));
        let at = |x: u32, y: u32| one[((y % side) * side + x % side) as usize];
        let mut most = 0.0_f64;
        for (dx, dy) in [(1, 0), (0, 1), (1, 1), (2, 0), (0, 2), (16, 0), (0, 16)] {
            let beside = (0..side * side).map(|i| {
                let (x, y) = (i % side, i / side);
                [at(x, y), at(x + dx, y + dy)]
            });
            most = most.max(correlation(&beside.collect::<Vec<_>>()).abs());
        }
        let seeds: Vec<[f64; 2]> = one.iter().zip(&other).map(|(&a, &b)| [a, b]).collect();
        most = most.max(correlation(&seeds).abs());
        let bound = 4.0 / f64::from(side);
        outcome.must(most <= bound, || format!("{name}: correlated by {most}, at most {bound}"));
        outcome.measured(format!("{name}: at most {most:.4} of {bound:.4}"));
    }
    Ok(outcome)
}

fn pairs(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let (pixels, count): (u32, u32) = (scale.pick(4_096, 65_536), 16);
    for (name, sampler) in SAMPLERS {
        let mut most = 0.0_f64;
        for (first, second) in [(0, 1), (0, 2), (1, 2), (2, 3), (2, 6), (3, 7)] {
            for k in 0..4 {
                let one = |i: u32| {
                    let pixel = sampler.pixel(30, i % 512, i / 512, count);
                    let both = |s| [pixel.square(s, first)[k % 2], pixel.square(s, second)[k / 2]];
                    correlation(&(0..count).map(both).collect::<Vec<_>>())
                };
                let sum: f64 = (0..pixels).into_par_iter().map(one).sum();
                most = most.max((sum / f64::from(pixels)).abs());
            }
        }
        // The largest of 24; the correlation within one pixel is at most 1.
        let bound = 4.5 / f64::from(pixels).sqrt();
        outcome.must(most <= bound, || format!("{name}: correlated by {most}, at most {bound}"));
        outcome.measured(format!("{name}: at most {most:.4} of {bound:.4}"));
    }
    Ok(outcome)
}
