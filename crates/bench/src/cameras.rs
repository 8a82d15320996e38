//! Each model of the same lens, from a pinhole to the full train: how far its picture is from the
//! full train's, and the time.
//!
//! | model | what it keeps of the lens |
//! |---|---|
//! | `pinhole` | where its entrance pupil is, and the scale of the picture |
//! | `thin` | also focal length, f-number and the plane in focus: blur |
//! | `thick` | also how far its pupils are from its principal planes: falloff |
//! | `full` | everything: aberrations, distortion, vignetting, cos⁴ |
//!
//! All of them are registered: the same pixel looks along the same paraxial chief ray. `thin` and
//! `thick` are the approximations of C. Kolb, D. Mitchell and P. Hanrahan, "A realistic camera model
//! for computer graphics", 1995.

use etendue_camera::{Camera, Sampler};
use etendue_render::tolerance::lens_models;
use etendue_scene::file::LightPrecision;
use serde::Serialize;

use crate::pictures::{Studio, opened};
use crate::samplers::{ConvergedPicture, Effort, PictureSettings, SamplerTrial, take_pictures};
use crate::timing::TimeSpread;
use crate::{BenchError, Progress};

/// Measurements of the models of one scene's lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cameras {
    /// Columns and rows of the pictures.
    pub resolution: [u32; 2],
    /// The picture through the full train that others are compared with.
    pub converged: ConvergedPicture,
    /// Each model × number of samples.
    pub findings: Vec<ModelMeasurement>,
    /// Models that there are not of this lens, and why.
    pub notes: Vec<String>,
}

/// Measurement of one model at one number of samples.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModelMeasurement {
    /// `pinhole`, `thin`, `thick` or `full`.
    pub model: &'static str,
    /// Samples a pixel.
    pub samples: u32,
    /// Wall time of tracing the picture on all threads (s).
    pub seconds: TimeSpread,
    /// The root of the mean squared difference to the full train's converged picture.
    pub rmse: f64,
    /// The same over the mean of that picture.
    pub relative_rmse: f64,
}

/// Renders through every model of the scene's lens in turn.
///
/// # Errors
///
/// [`BenchError::NoLens`] when the camera has none; when the scene cannot be rendered, or `progress`
/// asks to stop.
pub fn measure(
    studio: &mut Studio<'_>,
    effort: &Effort,
    progress: Progress<'_>,
) -> Result<Cameras, BenchError> {
    let rounds = effort.rounds.max(1);
    let own: f64 = effort.counts.iter().map(|&n| f64::from(n)).sum();
    let all = f64::from(effort.converged) + own * (rounds * 4) as f64;
    studio.fit(all, effort.seconds)?;
    let full = studio.camera().clone();
    let (models, notes) = models(&full)?;
    let converged = ConvergedPicture::render(studio, &full, effort.converged)?;
    let mut entries: Vec<SamplerTrial<usize>> =
        (0..models.len()).flat_map(|model| SamplerTrial::each(model, &effort.counts)).collect();
    let settings = |of: &usize| PictureSettings {
        camera: &models[*of].1,
        sampler: Sampler::Sobol,
        precision: LightPrecision::Auto,
    };
    take_pictures(studio, &mut entries, effort, &converged, all, &settings, progress)?;
    let finding = |entry: &SamplerTrial<usize>| {
        let rmse = entry.rmse();
        Some(ModelMeasurement {
            model: models[entry.of].0,
            samples: entry.samples,
            seconds: entry.seconds.spread()?,
            rmse,
            relative_rmse: rmse / converged.mean,
        })
    };
    let findings = entries.iter().filter_map(finding).collect();
    Ok(Cameras { resolution: full.resolution(), converged, findings, notes })
}

/// A model of a lens: what it is called, and its camera.
pub type LensModel = (&'static str, Camera);

/// All models of a camera's lens that keep no more than what is known near its axis, the simplest first and the
/// lens itself last, and what is missing for which reason.
///
/// # Errors
///
/// [`BenchError::NoLens`] when the camera has none, or one without a finite entrance pupil or focal
/// length.
pub fn models(full: &Camera) -> Result<(Vec<LensModel>, Vec<String>), BenchError> {
    let found = lens_models::near_axis(full)?;
    let mut notes = found.notes;
    let mut models = Vec::new();
    for model in found.models {
        match opened(&model.camera) {
            Ok(camera) => models.push((model.kind.name(), camera)),
            Err(why) => notes.push(format!("no `{}` model of this lens: {why}", model.kind)),
        }
    }
    models.push(("full", full.clone()));
    Ok((models, notes))
}
