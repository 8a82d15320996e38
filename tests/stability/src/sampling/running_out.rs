//! More samples and more dimensions than a sequence has.

use std::collections::HashSet;

use anyhow::Result;
use etendue_camera::Sampler;
use etendue_tracer::sampling::DiscreteDistribution;
use rayon::prelude::*;

use super::{SAMPLERS, mean, rms, smooth};
use crate::{Case, Outcome, Scale};

pub(super) const BEYOND_THE_SEQUENCE: Case = Case {
    name: "samples_beyond_the_sequence",
    regime: "2²⁰ samples of `sobol`, whose table has 2¹⁶ points",
    must: "no pair of points repeats, and the error goes on falling",
    limit: Some(
        "From 2¹⁶ samples on, the set starts over with another scrambling, so the error falls as 1/√n \
         from there.",
    ),
    run: beyond_the_sequence,
};

pub(super) const LARGE_TABLES: Case = Case {
    name: "choices_of_large_tables",
    regime: "one number of each sampler chooses among 2⁸ to 2²⁴ entries, of which every second weighs \
        10⁻³, and what is left of it is the place in the entry",
    must: "light entries are chosen by their weight, and the places are uniform, within 4.5 standard \
        errors of the mean of pixels",
    limit: None,
    run: large_tables,
};

pub(super) const MORE_THAN_ASKED_FOR: Case = Case {
    name: "more_samples_than_asked_for",
    regime: "64 times as many samples as the pixel was opened for",
    must: "all lie in the square, and the mean stays right to four standard errors of the first set",
    limit: Some(
        "`hammersley` has no more points than were asked for and repeats them; `stratified` starts its \
         grid over. A render opens each pixel for all the samples that it takes.",
    ),
    run: more_than_asked_for,
};

pub(super) const ONE: Case = Case {
    name: "one_sample",
    regime: "one sample a pixel, or none, over 65 536 pixels",
    must: "uniform over the square: the mean over pixels is within 4 standard errors of 1",
    limit: None,
    run: one,
};

pub(super) const DIMENSIONS: Case = Case {
    name: "dimensions_running_out",
    regime: "pairs of dimensions up to number 16 387, the last of a path of 4096 steps, of a table of 128 \
        pairs; and integrands of two pairs at once, one of them 128 further on, by 256 samples",
    must: "points stay in the square; an integrand of two pairs is no noisier than with random numbers, by \
        more than chance",
    limit: None,
    run: dimensions,
};

fn beyond_the_sequence(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let count: u32 = scale.pick(1 << 18, 1 << 20);
    let pixels: u32 = scale.pick(8, 64);
    let error = |count: u32| {
        let each = |i| mean(&Sampler::Sobol.pixel(3, i, 0, count), 0, count, smooth) - 1.0;
        rms((0..pixels).into_par_iter().map(each).collect::<Vec<_>>())
    };
    let (table, beyond) = (error(1 << 16), error(count));
    outcome.measured(format!("{table:.1e} with 2^16, {beyond:.1e} with 2^{}", count.ilog2()));
    outcome.must(beyond <= 1.2 * table, || format!("{beyond:e} after {table:e}"));
    let pixel = Sampler::Sobol.pixel(3, 0, 0, count);
    let mut seen = HashSet::with_capacity(count as usize);
    let repeated =
        (0..count).filter(|&i| !seen.insert(pixel.square(i, 0).map(f64::to_bits))).count();
    outcome.measured(format!("{repeated} points repeat"));
    outcome.must(repeated == 0, || format!("{repeated} points repeat"));
    Ok(outcome)
}

fn large_tables(scale: Scale) -> Result<Outcome> {
    const LIGHT: f64 = 1e-3;
    let mut outcome = Outcome::default();
    let (pixels, count): (u32, u32) = (scale.pick(4_096, 65_536), 64);
    for bits in [8, 19, 24] {
        let weights: Vec<f64> =
            (0..1 << bits).map(|k| if k % 2 == 0 { 1.0 } else { LIGHT }).collect();
        let table = DiscreteDistribution::new(&weights);
        let chance = LIGHT / (1.0 + LIGHT);
        for (name, sampler) in SAMPLERS {
            let pixel = |i| {
                let pixel = sampler.pixel(11, i, 5, count);
                let picks = (0..count).map(|s| table.pick(pixel.square(s, 4)[0]));
                picks.fold((0.0, 0.0), |(light, places), (index, place)| {
                    (light + f64::from(u8::from(index % 2 == 1)), places + place)
                })
            };
            let sums: Vec<(f64, f64)> = (0..pixels).into_par_iter().map(pixel).collect();
            let errors = [
                off(sums.iter().map(|(light, _)| light / f64::from(count)), chance),
                off(sums.iter().map(|(_, place)| place / f64::from(count)), 0.5),
            ];
            let holds = errors.iter().all(|error| error.abs() <= 4.5);
            outcome.must(holds, || format!("{name}, 2^{bits}: {errors:?} standard errors off"));
            outcome.measured(format!("{name}, 2^{bits}: {:+.1}, {:+.1}", errors[0], errors[1]));
        }
    }
    Ok(outcome)
}

/// By how many standard errors the mean of pixels is off `known`; those of one pixel are not
/// independent.
fn off(pixels: impl ExactSizeIterator<Item = f64> + Clone, known: f64) -> f64 {
    let count = pixels.len() as f64;
    let mean = pixels.clone().sum::<f64>() / count;
    let variance = pixels.map(|p| (p - mean) * (p - mean)).sum::<f64>() / (count - 1.0);
    (mean - known) / (variance / count).sqrt()
}

fn more_than_asked_for(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    for (name, sampler) in SAMPLERS {
        let (asked, taken, pixels) = (64, 64 * 64, 128);
        let mut inside = true;
        let mut error = |count: u32| {
            rms((0..pixels).map(|i| {
                let pixel = sampler.pixel(9, i, 4, asked);
                let square = |k| pixel.square(k, 0);
                inside &= (0..count).all(|k| square(k).iter().all(|x| (0.0..1.0).contains(x)));
                mean(&pixel, 0, count, smooth) - 1.0
            }))
        };
        let (first, all) = (error(asked), error(taken));
        outcome.must(inside, || format!("{name}: a point outside of the square"));
        outcome.must(all <= 1.5 * first, || format!("{name}: {all:e} after {first:e}"));
        outcome.measured(format!("{name}: {first:.1e} with 64, {all:.1e} with 4096"));
    }
    Ok(outcome)
}

fn one(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let side = 256_u32;
    for (name, sampler) in SAMPLERS {
        for count in [0, 1] {
            let each = |i: u32| smooth(sampler.pixel(5, i % side, i / side, count).square(0, 0));
            let values: Vec<f64> = (0..side * side).map(each).collect();
            let n = f64::from(side * side);
            let mean = values.iter().sum::<f64>() / n;
            let spread = rms(values.iter().map(|v| v - mean));
            let errors = (mean - 1.0) / (spread / n.sqrt());
            outcome.must(errors.abs() <= 4.0, || format!("{name}, {count}: {errors} errors off"));
            if count == 1 {
                outcome.measured(format!("{name}: {errors:+.1} standard errors off"));
            }
        }
    }
    Ok(outcome)
}

/// The last pair of a path of 4096 steps of four pairs, behind the four of the camera.
const LAST_PAIR: u32 = 4 + 4 * 4096 - 1;

fn dimensions(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let (count, pixels): (u32, u32) = (256, scale.pick(256, 4_096));
    let pairs = [0, 1, 2, 3, 100, 127, 1_000, LAST_PAIR - 128];
    // The error of the mean of f(p) f(q) over pixels, for the pairs p and q and each of the above.
    let error = |sampler: Sampler, pair: u32, further: u32| {
        let each = |i: u32| {
            let pixel = sampler.pixel(11, i % 64, i / 64, count);
            let both = |k| smooth(pixel.square(k, pair)) * smooth(pixel.square(k, pair + further));
            (0..count).map(both).sum::<f64>() / f64::from(count) - 1.0
        };
        rms((0..pixels).into_par_iter().map(each).collect::<Vec<_>>())
    };
    // An error of as many pixels is known to 1/√(2 n) of itself; five of them for the worst of 64.
    let chance = 1.0 + 5.0 / (2.0 * f64::from(pixels)).sqrt();
    let random = error(Sampler::Independent, 0, 1);
    for (name, sampler) in SAMPLERS {
        let pixel = sampler.pixel(11, 2, 3, count);
        for pair in pairs.into_iter().chain([LAST_PAIR]) {
            let square = |i| pixel.square(i, pair);
            let inside = (0..count).all(|i| square(i).iter().all(|x| (0.0..1.0).contains(x)));
            outcome.must(inside, || format!("{name}, pair {pair}: a point outside"));
        }
        let mut worst = (0.0, 0, 0);
        for pair in pairs {
            for further in [1, 128] {
                let found = error(sampler, pair, further) / random;
                if found > worst.0 {
                    worst = (found, pair, pair + further);
                }
            }
        }
        let (most, first, second) = worst;
        let told =
            format!("{name}: {most:.2} of the noise of random numbers (pairs {first}, {second})");
        outcome.must(most <= chance, || told.clone());
        outcome.measured(told);
    }
    Ok(outcome)
}
