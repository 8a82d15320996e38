//! Each sampler × number of samples: how far the picture is from the converged one, and the time. Of light,
//! Sobol's points are taken with hits in both precisions.

use etendue_camera::{Camera, Sampler};
use etendue_geometry::HitPrecision;
use etendue_scene::file::LightPrecision;
use serde::Serialize;

use crate::pictures::{PointSet, Studio, mean, mean_square};
use crate::timing::{TimeSpread, Timings, order};
use crate::{BenchError, Progress};

/// Extent of the measurement.
#[derive(Debug, Clone)]
pub struct Effort {
    /// Samples a pixel.
    pub counts: Vec<u32>,
    /// Samples a pixel of the converged picture (at least 2).
    pub converged: u32,
    /// Times that everything is rendered, each with other samples (at least 1).
    pub rounds: usize,
    /// Time that all of it may take (s): pixels are made larger until it does.
    pub seconds: f64,
}

/// Measurements of all samplers on one scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Samplers {
    /// Columns and rows of the pictures.
    pub resolution: [u32; 2],
    /// The picture that others are compared with.
    pub converged: ConvergedPicture,
    /// Each sampler × number of samples.
    pub findings: Vec<SamplerMeasurement>,
}

/// The picture that others are compared with: the mean of two of half the samples.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConvergedPicture {
    /// Samples a pixel.
    pub samples: u32,
    /// The mean of its values.
    pub mean: f64,
    /// Its own error: half the root of the mean square of the difference of the two halves.
    pub rmse: f64,
    #[serde(skip)]
    pub(crate) values: Vec<f64>,
}

/// Measurement of one sampler at one number of samples.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SamplerMeasurement {
    /// The point set, as a scene file writes it, and the precision of hits where it is not the plan's.
    pub sampler: &'static str,
    /// Samples a pixel.
    pub samples: u32,
    /// Wall time of tracing the picture on all threads (s).
    pub seconds: TimeSpread,
    /// The root of the mean squared difference to the converged picture.
    pub rmse: f64,
    /// The same over the mean of the converged picture.
    pub relative_rmse: f64,
}

/// A point set, and the precision of hits.
#[derive(Debug, Clone, Copy)]
struct Contestant {
    name: &'static str,
    sampler: Sampler,
    precision: LightPrecision,
}

/// The samplers, the plainest first, and then the precision that the plan does not choose.
fn contestants(studio: &Studio<'_>) -> Vec<Contestant> {
    let of = |name, sampler| Contestant { name, sampler, precision: LightPrecision::Auto };
    let mut all = vec![
        of("independent", Sampler::Independent),
        of("stratified", Sampler::Stratified),
        of("hammersley", Sampler::Hammersley),
        of("sobol", Sampler::Sobol),
        of("blue_noise", Sampler::BlueNoise),
    ];
    let other = studio.precision().map(|precision| match precision {
        HitPrecision::Single => ("sobol, hits in f64", LightPrecision::Double),
        HitPrecision::Double => ("sobol, hits in f32", LightPrecision::Single),
    });
    all.extend(other.map(|(name, precision)| Contestant {
        name,
        sampler: Sampler::Sobol,
        precision,
    }));
    all
}

/// Renders with every sampler in turn.
///
/// # Errors
///
/// When the scene cannot be rendered, or `progress` asks to stop.
pub fn measure(
    studio: &mut Studio<'_>,
    effort: &Effort,
    progress: Progress<'_>,
) -> Result<Samplers, BenchError> {
    let rounds = effort.rounds.max(1);
    let own: f64 = effort.counts.iter().map(|&n| f64::from(n)).sum();
    let contestants = contestants(studio);
    let all = f64::from(effort.converged) + own * (rounds * contestants.len()) as f64;
    studio.fit(all, effort.seconds)?;
    let camera = studio.camera().clone();
    let converged = ConvergedPicture::render(studio, &camera, effort.converged)?;
    let mut entries: Vec<SamplerTrial<Contestant>> =
        contestants.iter().flat_map(|&who| SamplerTrial::each(who, &effort.counts)).collect();
    let settings = |of: &Contestant| PictureSettings {
        camera: &camera,
        sampler: of.sampler,
        precision: of.precision,
    };
    take_pictures(studio, &mut entries, effort, &converged, all, &settings, progress)?;
    let finding = |entry: &SamplerTrial<Contestant>| {
        let rmse = entry.rmse();
        Some(SamplerMeasurement {
            sampler: entry.of.name,
            samples: entry.samples,
            seconds: entry.seconds.spread()?,
            rmse,
            relative_rmse: rmse / converged.mean,
        })
    };
    let findings = entries.iter().filter_map(finding).collect();
    Ok(Samplers { resolution: camera.resolution(), converged, findings })
}

/// Settings of a contestant's picture: its camera, its point set, and the precision of hits.
pub(crate) struct PictureSettings<'a> {
    pub(crate) camera: &'a Camera,
    pub(crate) sampler: Sampler,
    pub(crate) precision: LightPrecision,
}

/// Renders all entries in turn, round after round, to `all` samples a pixel with those of the converged
/// picture.
pub(crate) fn take_pictures<'a, T: Clone>(
    studio: &mut Studio<'_>,
    entries: &mut [SamplerTrial<T>],
    effort: &Effort,
    converged: &ConvergedPicture,
    all: f64,
    settings: &dyn Fn(&T) -> PictureSettings<'a>,
    progress: Progress<'_>,
) -> Result<(), BenchError> {
    let mut done = f64::from(effort.converged);
    for round in 0..effort.rounds.max(1) {
        for who in order(round, entries.len()) {
            if !progress(done / all) {
                return Err(BenchError::Stopped);
            }
            let entry = &mut entries[who];
            let own = settings(&entry.of);
            entry.take(studio, &own, round, converged)?;
            done += f64::from(entry.samples);
        }
    }
    Ok(())
}

impl ConvergedPicture {
    pub(crate) fn render(
        studio: &mut Studio<'_>,
        camera: &Camera,
        samples: u32,
    ) -> Result<Self, BenchError> {
        let half = (samples / 2).max(1);
        let mut take = |seed| {
            let precision = LightPrecision::Auto;
            studio
                .take(camera, PointSet { samples: half, sampler: Sampler::Sobol, seed, precision })
        };
        // Far from the seeds of the rounds.
        let [a, b] = [take(u64::MAX)?.values, take(u64::MAX - 1)?.values];
        let rmse = 0.5 * mean_square(&a, &b).sqrt();
        let values: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 0.5 * (a + b)).collect();
        Ok(Self { samples: 2 * half, mean: mean(&values), rmse, values })
    }
}

/// One contestant at one number of samples while it is measured.
pub(crate) struct SamplerTrial<T> {
    pub(crate) of: T,
    pub(crate) samples: u32,
    pub(crate) seconds: Timings,
    squares: Vec<f64>,
}

impl<T: Clone> SamplerTrial<T> {
    /// One for each of `counts`.
    pub(crate) fn each(of: T, counts: &[u32]) -> impl Iterator<Item = Self> {
        counts.iter().map(move |&samples| Self {
            of: of.clone(),
            samples,
            seconds: Timings::default(),
            squares: Vec::new(),
        })
    }

    pub(crate) fn take(
        &mut self,
        studio: &mut Studio<'_>,
        settings: &PictureSettings<'_>,
        round: usize,
        converged: &ConvergedPicture,
    ) -> Result<(), BenchError> {
        let &PictureSettings { camera, sampler, precision } = settings;
        let sampling = PointSet { samples: self.samples, sampler, seed: round as u64, precision };
        let taken = studio.take(camera, sampling)?;
        self.seconds.0.push(taken.seconds);
        self.squares.push(mean_square(&taken.values, &converged.values));
        Ok(())
    }

    /// Over all rounds.
    pub(crate) fn rmse(&self) -> f64 {
        mean(&self.squares).sqrt()
    }
}
