//! Rates at which errors fall, against integrands of known value.

use anyhow::Result;
use etendue_camera::Sampler;
use rayon::prelude::*;

use super::{Integrand, SAMPLERS, edge, mean, rms, slope, smooth};
use crate::{Case, Outcome, Scale};

pub(super) const SMOOTH: Case = Case {
    name: "convergence_smooth",
    regime: "∫∫ eˣ⁺ʸ over the square by every power of two of samples to 2²⁰",
    must: "the error falls at least as n^−1.3 with `sobol` to 2¹⁴ samples, n^−0.9 with `stratified` and \
        `hammersley`, n^−0.5 ± 0.05 with `independent`",
    limit: None,
    run: smooth_integrand,
};

pub(super) const EDGE: Case = Case {
    name: "convergence_edge",
    regime: "the area of a quarter disk, an edge across the square, by every power of two to 2²⁰",
    must: "the error falls at least as n^−0.65 with `sobol` to 2¹⁶ samples, `stratified` and \
        `hammersley`, n^−0.5 ± 0.05 with `independent`",
    limit: None,
    run: edge_integrand,
};

pub(super) const ODD_COUNTS: Case = Case {
    name: "counts_that_make_no_grid",
    regime: "1021 samples, a prime, against 1024",
    must: "`sobol` and `hammersley` keep to a tenth of the error of `independent`, and nobody has more",
    limit: Some(
        "A prime number of cells makes a grid of one row, so `stratified` is as noisy as random numbers \
         along the other axis. Powers of two, or any product of two near numbers, are good.",
    ),
    run: odd_counts,
};

/// Pixels that an error is the root mean square of: known to 1/√128 of itself.
const PIXELS: u32 = 64;

/// RMSE over pixels of `count` samples.
fn error(sampler: Sampler, count: u32, f: Integrand) -> f64 {
    // The largest sums need fewer pixels to be as dear.
    let pixels = if count > 1 << 14 { PIXELS / 4 } else { PIXELS };
    let errors: Vec<f64> = (0..pixels)
        .into_par_iter()
        .map(|i| mean(&sampler.pixel(1, i % 8, i / 8, count), 0, count, f) - 1.0)
        .collect();
    rms(errors)
}

/// log₂ of samples and error, at every power of two from 2⁴ to 2^`last`.
fn curve(sampler: Sampler, last: u32, f: Integrand) -> Vec<[f64; 2]> {
    (4..=last).map(|k| [f64::from(k), error(sampler, 1 << k, f).log2()]).collect()
}

/// Fits all samplers up to the power of two where each is asked for its rate, and tells their errors.
fn fitted(scale: Scale, f: Integrand, [sobol_last, sobol, grid]: [f64; 3]) -> Outcome {
    let mut outcome = Outcome::default();
    let last = scale.pick(12, 20);
    for (name, sampler) in SAMPLERS {
        let curve = curve(sampler, last, f);
        let to = if sampler == Sampler::Sobol { sobol_last } else { f64::from(last) };
        let asked: Vec<[f64; 2]> = curve.iter().copied().filter(|p| p[0] <= to).collect();
        let rate = slope(&asked);
        let holds = match sampler {
            Sampler::Sobol => rate <= sobol,
            Sampler::Independent => (rate + 0.5).abs() <= 0.05,
            Sampler::Stratified | Sampler::Hammersley | Sampler::BlueNoise => rate <= grid,
        };
        outcome.must(holds, || format!("{name}: the error falls as n^{rate:.2}"));
        let end = curve.last().map_or(f64::NAN, |p| p[1].exp2());
        outcome.measured(format!("{name}: n^{rate:.2}, {end:.1e} at 2^{last}"));
    }
    outcome
}

fn smooth_integrand(scale: Scale) -> Result<Outcome> {
    Ok(fitted(scale, smooth, [14.0, -1.3, -0.9]))
}

fn edge_integrand(scale: Scale) -> Result<Outcome> {
    Ok(fitted(scale, edge, [16.0, -0.65, -0.65]))
}

fn odd_counts(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let random = error(Sampler::Independent, 1021, smooth);
    for (name, sampler) in SAMPLERS {
        let (odd, even) = (error(sampler, 1021, smooth), error(sampler, 1024, smooth));
        outcome.measured(format!("{name}: {odd:.1e} with 1021, {even:.1e} with 1024"));
        let regular = matches!(sampler, Sampler::Sobol | Sampler::Hammersley);
        outcome.must(!regular || odd <= 0.1 * random, || format!("{name}: {odd:e}"));
        // Each error is known to 1/√128 of itself.
        outcome.must(odd <= 1.4 * random, || format!("{name}: {odd:e} against {random:e}"));
    }
    Ok(outcome)
}
