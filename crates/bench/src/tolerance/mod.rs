//! The cheapest camera within a tolerance: every model of the scene's own lens, compared with the full
//! train by what a pixel sees ([`etendue_render::tolerance`]), and timed.
//!
//! Models are compared at places all over the picture, and at each of them at the depths that the scene
//! itself has there.

mod waves;
mod words;

use etendue_accel::Accel;
use etendue_camera::{Camera, Sampler};
use etendue_render::output::Outputs;
use etendue_render::{Plan, RenderError};
use etendue_scene::Scene;
use etendue_scene::file::LightPrecision;
use serde::Serialize;
use serde_json::Value;

use etendue_render::tolerance::lens_models::LensModelKind;
use etendue_render::tolerance::{Field, FullView};
pub use etendue_render::tolerance::{ModelError, Place, Tolerance, Worst};

pub use self::waves::WaveFinding;
use crate::pictures::{PointSet, Studio};
use crate::timing::{Timings, order};
use crate::{BenchError, Progress};

/// Samples a pixel of the shorter and the longer picture: their difference has none of what is done once.
const SAMPLES: [u32; 2] = [2, 8];

/// Rounds in which every model takes its turn.
const ROUNDS: usize = 3;

/// Pixels that a model is timed on, at least.
const PIXELS: u64 = 20_000;

/// All models of a lens against the full train.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Errors that they may have.
    pub tolerance: Tolerance,
    /// The nearest and the farthest depth (m) that the camera sees; `null` for infinity.
    #[serde(serialize_with = "finite_or_null")]
    pub depths: Vec<f64>,
    /// Places that were compared.
    pub places: Vec<Place>,
    /// The models, the simplest first.
    pub models: Vec<ModelError>,
    /// The keys of a scene that take each of these, in their order; `null` for the full train.
    pub scenes: Vec<Value>,
    /// The simplest that stays within the tolerance.
    pub cheapest: LensModelKind,
    /// Number of times that it is as fast as the full train, measured; `null` without a picture to time.
    pub saving: Option<f64>,
    /// The full train by rays, and by waves as `camera.diffraction` has them.
    pub waves: Vec<WaveFinding>,
    /// Notes for the user, in sentences.
    pub notes: Vec<String>,
}

/// Compares the models of the lens of `scene`'s camera by what pixels see of the scene behind `accel`, and
/// times the scene's picture through each.
///
/// # Errors
///
/// [`BenchError::NoLens`] when the camera has no lens, or one that no pinhole stands for; when no light gets
/// through it, the scene cannot be rendered, or `progress` asks to stop.
pub fn compare(
    scene: &Scene,
    accel: &dyn Accel,
    tolerance: Tolerance,
    progress: Progress<'_>,
) -> Result<Comparison, BenchError> {
    if scene.camera.lens().is_some_and(|lens| lens.lenslets().is_some()) {
        return Err(BenchError::NoLens("lenslets cut its picture up, which no simpler lens does"));
    }
    // What a pixel sees through each model, against the full train.
    let plan = Plan::new(scene, Outputs::ALL);
    if scene.camera.lens().is_none() {
        return Err(BenchError::NoLens("the camera has none"));
    }
    let view = FullView::new(scene, accel, &plan.bands, Field::FINE)?;
    let found = view.models(tolerance)?;
    let mut notes = view.notes.clone();
    notes.extend(found.notes);
    let (mut findings, mut models, mut scenes) = (Vec::new(), Vec::new(), Vec::new());
    for model in found.models {
        let mut finding = view.finding(model.kind, &model.camera, tolerance)?;
        if model.lacks_mask {
            finding.is_within = false;
            notes.push(format!(
                "`{}` has not the lens' mask, which is kept where it is alone, in the stop and upright: its blur is \
                 another",
                model.kind
            ));
        }
        findings.push(finding);
        models.push(opened(&plan, &model.camera)?);
        scenes.push(model.scene);
    }
    findings.push(view.itself(tolerance));
    models.push(opened(&plan, &scene.camera)?);
    scenes.push(Value::Null);
    let (waves, missing) = waves::findings(&scene.camera, &plan.bands, &view.places);
    notes.extend(missing);
    // What each costs, where there is a picture to time.
    match Studio::with_sensor(scene, accel) {
        Ok(mut studio) => {
            let times = seconds_a_sample(&mut studio, &models, progress)?;
            let full = times.last().copied().unwrap_or(f64::NAN);
            for (finding, time) in findings.iter_mut().zip(times) {
                finding.seconds_a_sample = Some(time);
                finding.speed = (time > 0.0).then(|| full / time);
            }
        }
        Err(BenchError::NoPicture) => {
            notes.push("the scene names no `tracer`: there is no picture to time".to_owned());
        }
        Err(error) => return Err(error),
    }
    let cheapest = findings.iter().find(|finding| finding.is_within);
    let (cheapest, saving) = cheapest.map_or((LensModelKind::Full, None), |f| (f.model, f.speed));
    Ok(Comparison {
        tolerance,
        depths: ends(&view.places),
        places: view.places,
        models: findings,
        scenes,
        cheapest,
        saving,
        waves,
        notes,
    })
}

/// The time of one sample of one pixel through each of `models` (s): of tracing the scene's picture on all
/// threads, the median of the rounds.
fn seconds_a_sample(
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

/// The camera of a model, opened for the bands of the picture.
fn opened(plan: &Plan, camera: &Camera) -> Result<Camera, BenchError> {
    let opened = camera.opened(&plan.bands);
    opened.map_err(|error| BenchError::Render(RenderError::camera(error.why)))
}

/// The nearest and the farthest depth of all.
fn ends(places: &[Place]) -> Vec<f64> {
    let mut depths: Vec<f64> = places.iter().flat_map(|place| place.depths.clone()).collect();
    depths.sort_by(f64::total_cmp);
    match depths[..] {
        [first, .., last] => vec![first, last],
        _ => depths,
    }
}

fn finite_or_null<S: serde::Serializer>(values: &[f64], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(values.iter().map(|x| x.is_finite().then_some(*x)))
}
