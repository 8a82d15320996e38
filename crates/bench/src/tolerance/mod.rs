//! The cheapest camera within a tolerance: every model of the scene's own lens, compared with the full
//! train by what a pixel sees ([`etendue_render::tolerance`]), and timed.
//!
//! Models are compared at places all over the picture, and at each of them at the depths that the scene
//! itself has there.

mod seconds;
mod waves;
mod words;

use etendue_accel::Accel;
use etendue_camera::Camera;
use etendue_render::output::Outputs;
use etendue_render::{Plan, RenderError};
use etendue_scene::Scene;
use serde::Serialize;
use serde_json::Value;

use etendue_render::tolerance::lens_models::LensModelKind;
use etendue_render::tolerance::{Field, FullView};
pub use etendue_render::tolerance::{ModelError, Place, Tolerance, Worst};

pub use self::waves::WaveFinding;
use crate::pictures::Studio;
use crate::{BenchError, Progress};

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
            let times = seconds::seconds_a_sample(&mut studio, &models, progress)?;
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
