//! Point sets.

mod convergence;
mod correlation;
mod running_out;
mod stopping;

use etendue_camera::{PixelSamples, Sampler};

use crate::Method;

/// Samplers.
pub const METHOD: Method = Method {
    name: "Sampling",
    cases: &[
        convergence::SMOOTH,
        convergence::EDGE,
        convergence::ODD_COUNTS,
        running_out::BEYOND_THE_SEQUENCE,
        running_out::LARGE_TABLES,
        running_out::MORE_THAN_ASKED_FOR,
        running_out::ONE,
        running_out::DIMENSIONS,
        correlation::NEIGHBOURS,
        correlation::PAIRS,
        correlation::FRAMES,
        stopping::BEHIND_GLASS,
        stopping::SPARKLES,
    ],
};

/// The samplers by name.
pub(crate) const SAMPLERS: [(&str, Sampler); 4] = [
    ("sobol", Sampler::Sobol),
    ("stratified", Sampler::Stratified),
    ("hammersley", Sampler::Hammersley),
    ("independent", Sampler::Independent),
];

/// ∫∫ over the unit square is 1, with a slope everywhere and no symmetry that points could share.
fn smooth([x, y]: [f64; 2]) -> f64 {
    let norm = std::f64::consts::E - 1.0;
    (x + y).exp() / (norm * norm)
}

/// 1 within a quarter of the unit disk, over its area.
fn edge([x, y]: [f64; 2]) -> f64 {
    if x * x + y * y < 1.0 { 4.0 / std::f64::consts::PI } else { 0.0 }
}

type Integrand = fn([f64; 2]) -> f64;

/// The mean of `f` over the first `count` points of `pixel` in one pair of dimensions.
fn mean(pixel: &PixelSamples, pair: u32, count: u32, f: Integrand) -> f64 {
    let sum: f64 = (0..count).map(|i| f(pixel.square(i, pair))).sum();
    sum / f64::from(count)
}

/// The root of the mean square of errors.
fn rms(errors: impl IntoIterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for error in errors {
        sum += error * error;
        count += 1.0;
    }
    (sum / count).sqrt()
}

/// The slope of a straight line through points, by least squares.
fn slope(points: &[[f64; 2]]) -> f64 {
    let count = points.len() as f64;
    let mean = |k: usize| points.iter().map(|p| p[k]).sum::<f64>() / count;
    let [x, y] = [mean(0), mean(1)];
    let covariance: f64 = points.iter().map(|p| (p[0] - x) * (p[1] - y)).sum();
    covariance / points.iter().map(|p| (p[0] - x) * (p[0] - x)).sum::<f64>()
}

/// Pearson's correlation of pairs.
fn correlation(pairs: &[[f64; 2]]) -> f64 {
    let count = pairs.len() as f64;
    let mean = |k: usize| pairs.iter().map(|p| p[k]).sum::<f64>() / count;
    let [x, y] = [mean(0), mean(1)];
    let product = |a: usize, b: usize| -> f64 {
        let m = [x, y];
        pairs.iter().map(|p| (p[a] - m[a]) * (p[b] - m[b])).sum()
    };
    product(0, 1) / (product(0, 0) * product(1, 1)).sqrt()
}
