//! The cost of each model: the time of the scene's own picture through it on this machine.

use etendue_camera::{Camera, Sampler};
use etendue_scene::file::LightPrecision;

use crate::pictures::{PointSet, Studio};
use crate::timing::{Timings, order};
use crate::{BenchError, Progress};

/// Samples a pixel of the shorter and the longer picture: their difference has none of what is done once.
const SAMPLES: [u32; 2] = [2, 8];

/// Rounds in which every model takes its turn.
const ROUNDS: usize = 3;

/// Pixels that a model is timed on, at least.
const PIXELS: u64 = 20_000;

/// The time of one sample of one pixel through each of `models` (s): of tracing the scene's picture on all
/// threads, the median of the rounds.
pub(super) fn seconds_a_sample(
    studio: &mut Studio<'_>,
    models: &[Camera],
    progress: Progress<'_>,
) -> Result<Vec<f64>, BenchError> {
    let mut series = vec![Timings::default(); models.len()];
    let [few, many] = SAMPLES;
    for round in 0..ROUNDS {
        for who in order(round, models.len()) {
            if !progress((round * models.len() + who) as f64 / (ROUNDS * models.len()) as f64) {
                return Err(BenchError::Stopped);
            }
            let [width, height] = models[who].resolution().map(u64::from);
            #[expect(clippy::cast_possible_truncation, reason = "a share of a side")]
            let factor = (width * height / PIXELS).isqrt().max(1) as u32;
            let camera = models[who].coarser(factor);
            let [width, height] = camera.resolution().map(f64::from);
            let mut take = |samples| {
                let sampling = PointSet {
                    samples,
                    sampler: Sampler::Sobol,
                    seed: round as u64,
                    precision: LightPrecision::Auto,
                };
                studio.take(&camera, sampling).map(|taken| taken.seconds)
            };
            if round == 0 {
                // Caches and threads wake.
                take(few)?;
            }
            let (short, long) = (take(few)?, take(many)?);
            series[who].0.push((long - short).max(0.0) / (width * height * f64::from(many - few)));
        }
    }
    Ok(series.iter().map(Timings::median).collect())
}
