//! The cheapest camera within a tolerance: every model of the scene's own lens, compared with the full
//! train by what a pixel sees. The models are those of [`crate::cameras`], and after `pinhole` one more:
//! `opencv` also keeps the lens' distortion, as OpenCV's model fits it.
//!
//! Models are compared at places all over the picture, and at each of them at the depths that the scene
//! itself has there.

mod pixel_views;
mod words;

use etendue_accel::Accel;
use etendue_camera::{Camera, OpencvFit};
use etendue_geometry::Bounds;
use etendue_render::Plan;
use etendue_render::output::Outputs;
use etendue_scene::Scene;
use etendue_spectrum::Bands;
use serde::Serialize;

use self::pixel_views::{PlaceView, seen};
use crate::cameras::{self, LensModel};
use crate::pictures::Studio;
use crate::{BenchError, Progress};

/// Columns and rows of places that are compared, the picture's corners among them.
const FIELD: [u32; 2] = [9, 7];

/// Rays of a place and a group of bands, where there are few groups and where there are many.
const RAYS: [u32; 2] = [1024, 256];

/// What a model may be off by.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Tolerance {
    /// Of places, blur and shifts of colour (pixels).
    pub pixels: f64,
    /// Of light, as a share of that on the axis; not judged when absent.
    pub light: Option<f64>,
}

/// A place of the picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Place {
    /// Its column (pixels from the outer corner of the top left pixel).
    pub column: f64,
    /// Its row.
    pub row: f64,
    /// Depths (m) that are seen around it, the nearest first.
    #[serde(serialize_with = "finite_or_null")]
    pub depths: Vec<f64>,
}

/// All models of a lens against the full train.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// What they may be off by.
    pub tolerance: Tolerance,
    /// The nearest and the farthest depth (m) that the camera sees; `null` for infinity.
    #[serde(serialize_with = "finite_or_null")]
    pub depths: Vec<f64>,
    /// Places that were compared.
    pub places: Vec<Place>,
    /// The models, the simplest first.
    pub models: Vec<Finding>,
    /// The simplest that stays within the tolerance.
    pub cheapest: &'static str,
    /// How many times as fast as the full train that is, measured; `null` without a picture to time.
    pub saving: Option<f64>,
    /// What a user should know, in sentences.
    pub notes: Vec<String>,
}

/// What a model misses, and what it costs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// `pinhole`, `opencv`, `thin`, `thick`, `undispersed` or `full`.
    pub model: &'static str,
    /// How far chief rays are from the train's (pixels).
    pub chief_ray: Worst,
    /// How far the middle of a pixel's light is (pixels).
    pub centroid: Worst,
    /// The difference of the blur, the root mean square radius of a pixel's light in a band (pixels).
    pub blur: Worst,
    /// The difference of where a band lies among all bands (pixels).
    pub colour: Worst,
    /// The difference of a pixel's light in a band, as a share of that on the axis.
    pub light: Worst,
    /// Whether it stays within the tolerance.
    pub is_within: bool,
    /// The time of a sample of a pixel (s); `null` without a picture to time.
    pub seconds_a_sample: Option<f64>,
    /// How many times as fast as the full train that is.
    pub speed: Option<f64>,
}

/// The greatest difference, and where it is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Worst {
    /// As the quantity says.
    pub value: f64,
    /// The column and row of its place (pixels from the corner).
    pub at: [f64; 2],
    /// Its depth (m); `null` for infinity, or where the depth plays no part.
    pub depth: Option<f64>,
}

impl Worst {
    fn raise(&mut self, value: f64, place: &Place, nearness: Option<f64>) {
        if value > self.value {
            let depth = nearness.map(|nearness| 1.0 / nearness).filter(|depth| depth.is_finite());
            *self = Self { value, at: [place.column, place.row], depth };
        }
    }
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
    // The models, and the places and depths at which they are compared.
    let bands = Plan::new(scene, Outputs::ALL).bands;
    let (models, mut notes) = models(scene, &bands, tolerance)?;
    let mut places = pixel_views::places(scene, accel);
    let in_focus = scene.camera.lens().map_or(f64::INFINITY, |l| l.focused().object_distance());
    if places.iter().all(|place| place.depths.is_empty()) {
        notes.push("the camera sees no surface: compared at the distance in focus".to_owned());
        places.iter_mut().for_each(|place| place.depths.push(in_focus.abs()));
    }
    // What a pixel sees through each, against the full train.
    let groups = scene.camera.band_groups(&bands).len();
    let rays = RAYS[usize::from(groups > 3)];
    let all: Vec<Vec<PlaceView>> =
        models.iter().map(|(_, camera)| seen(camera, &bands, &places, rays)).collect();
    let full = all.last().map_or(&[][..], |seen| seen);
    let scale = cameras::scale(&scene.camera).unwrap_or(f64::NAN);
    let mut findings: Vec<Finding> = models
        .iter()
        .zip(&all)
        .map(|((name, _), own)| finding(name, (own, full), &places, (scale, tolerance)))
        .collect();
    // What each costs, where there is a picture to time.
    match Studio::with_sensor(scene, accel) {
        Ok(mut studio) => {
            let times = pixel_views::seconds_a_sample(&mut studio, &models, progress)?;
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
    let (cheapest, saving) = cheapest.map_or(("full", None), |f| (f.model, f.speed));
    Ok(Comparison {
        tolerance,
        depths: ends(&places),
        places,
        models: findings,
        cheapest,
        saving,
        notes,
    })
}

/// The models, opened for the bands of the picture, the full train last; and what is missing for which
/// reason.
fn models(
    scene: &Scene,
    bands: &Bands,
    tolerance: Tolerance,
) -> Result<(Vec<LensModel>, Vec<String>), BenchError> {
    let (mut models, mut notes) = cameras::models(&scene.camera)?;
    match OpencvFit::new(&scene.camera, tolerance.pixels)
        .and_then(|fit| fit.camera.build(|| Bounds::EMPTY, &|name: &str| Err(name.to_owned())))
    {
        Ok(camera) => {
            let after = models.iter().take_while(|(name, _)| *name == "pinhole").count();
            models.insert(after, ("opencv", camera));
        }
        Err(error) => notes.push(format!("no `opencv` model of this lens: {error}")),
    }
    // All of the lens, as at its design wavelength.
    let undispersed = scene.camera.without_dispersion();
    let rays = |camera: &Camera| camera.band_groups(bands).len();
    if rays(&undispersed) < rays(&scene.camera) {
        models.insert(models.len() - 1, ("undispersed", undispersed));
    }
    for (_, camera) in &mut models {
        let opened = camera.opened(bands);
        *camera = opened
            .map_err(|error| BenchError::Render(etendue_render::RenderError::Camera(error.why)))?;
    }
    Ok((models, notes))
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

/// What a model misses of the full train.
fn finding(
    model: &'static str,
    (own, full): (&[PlaceView], &[PlaceView]),
    places: &[Place],
    (scale, tolerance): (f64, Tolerance),
) -> Finding {
    let [mut chief_ray, mut centroid, mut blur, mut colour, mut light] = [Worst::default(); 5];
    for ((own, full), place) in own.iter().zip(full).zip(places) {
        // Light depends on the place alone.
        for (a, b) in own.bands.iter().zip(&full.bands) {
            light.raise((a.light - b.light).abs(), place, None);
        }
        // Chief rays, blur and colour also on the depth.
        for &depth in &place.depths {
            let nearness = 1.0 / depth;
            let at = Some(nearness);
            if let (Some(a), Some(b)) = (own.chief, full.chief) {
                chief_ray.raise(scale * (a.at(nearness) - b.at(nearness)).length(), place, at);
            }
            let (Some(a), Some(b)) = (own.centroid(nearness), full.centroid(nearness)) else {
                continue;
            };
            centroid.raise(scale * (a - b).length(), place, at);
            for (c, d) in own.bands.iter().zip(&full.bands) {
                if let (Some(p), Some(q)) = (c.centroid(nearness), d.centroid(nearness)) {
                    blur.raise(scale * (c.blur(nearness) - d.blur(nearness)).abs(), place, at);
                    colour.raise(scale * ((p - a) - (q - b)).length(), place, at);
                }
            }
        }
    }
    let in_pixels = [chief_ray, centroid, blur, colour];
    let is_within = in_pixels.iter().all(|worst| worst.value <= tolerance.pixels)
        && tolerance.light.is_none_or(|most| light.value <= most);
    Finding {
        model,
        chief_ray,
        centroid,
        blur,
        colour,
        light,
        is_within,
        seconds_a_sample: None,
        speed: None,
    }
}

fn finite_or_null<S: serde::Serializer>(values: &[f64], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(values.iter().map(|x| x.is_finite().then_some(*x)))
}
