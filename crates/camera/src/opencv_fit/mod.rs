//! OpenCV's camera fitted to a lens: the pinhole with distortion whose pixels look where the lens' chief
//! rays go.
//!
//! K and the coefficients are those of which the chief rays of places all over the picture, at the distance
//! in focus, are seen nearest to these places: the least sum of squares of what OpenCV calls the
//! reprojection error (its `calibrateCamera`, after Z. Zhang, "A flexible new technique for camera
//! calibration", 2000), with rays of the lens in the place of pictures of a board.
//!
//! A pinhole has one centre, and the chief rays of a lens do not quite meet in one point: what is nearer or
//! farther than the distance of the fit is displaced by parallax, and the fit says from where to where that
//! stays within its tolerance.

mod models;
mod words;

use serde::Serialize;

use self::models::OpencvModel;
use crate::distortion::Distortion;
use crate::lens::focused::View;
use crate::{
    Camera, CameraError, CameraSpec, Intrinsics, IntrinsicsSpec, PinholeSpec, PixelOrigin,
    PoseSpec, SensorSpec,
};
use etendue_geometry::Bounds;
use etendue_geometry::units::Micrometres;
use models::{PixelSight, places_a_side, sights};

/// Rings of the picture for which the residuals are told.
const RINGS: u32 = 8;

/// The nearest distance that is looked at, as a share of the distance of the fit (or of 1 m).
const NEAREST: f64 = 1e-3;

/// OpenCV's camera, fitted to a lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OpencvFit {
    /// The camera as a scene has it.
    pub camera: CameraSpec,
    /// The matrix K by rows (pixels), its principal point counted from the centre of the top left pixel.
    #[serde(rename = "K")]
    pub k: [[f64; 3]; 3],
    /// `brown_conrady`, OpenCV's standard model, or `fisheye`.
    pub model: &'static str,
    /// `distCoeffs` in OpenCV's order: k1, k2, p1, p2, k3, or k1 to k4 of a fisheye.
    pub coefficients: Vec<f64>,
    /// The distance for which it was fitted (m), the one in focus; `null` for infinity.
    pub distance: Option<f64>,
    /// Distances of the lens' chief rays from where they belong.
    pub residuals: Residuals,
    /// Region in which it stays within the tolerance.
    pub holds: FitRegion,
    /// Notes for the user, in sentences.
    pub notes: Vec<String>,
}

/// Residuals of a fit (pixels).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Residuals {
    /// Places of the picture.
    pub places: usize,
    /// The root of their mean square.
    pub rms: f64,
    /// The largest.
    pub largest: f64,
    /// By distance from the principal point, from the inside outwards.
    pub rings: Vec<ResidualRing>,
}

/// The residuals of a ring of the picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ResidualRing {
    /// Its outer radius about the principal point (pixels).
    pub radius: f64,
    /// The widest angle from the axis in it (degrees).
    pub field: f64,
    /// The root of the mean square of its residuals (pixels).
    pub rms: f64,
    /// The largest of them (pixels).
    pub largest: f64,
}

/// Region in which a fit holds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FitRegion {
    /// The residual that is allowed (pixels).
    pub tolerance: f64,
    /// The share of the picture's places with less, at the distance of the fit (0..=1).
    pub share: f64,
    /// The radius about the principal point within which all have (pixels).
    pub radius: f64,
    /// The angle from the axis there (degrees).
    pub field: f64,
    /// Nearest distance at which they stay so (m); `null` when they are not so at the distance of the fit.
    pub nearest: Option<f64>,
    /// Farthest such distance (m); `null` for infinity, or as above.
    pub farthest: Option<f64>,
    /// Greatest distance of chief rays from the entrance pupil's middle (mm).
    pub pupil_wander: f64,
}

impl OpencvFit {
    /// The residual that is allowed when nothing is said of it (pixels).
    pub const TOLERANCE: f64 = 0.5;

    /// The fit to the lens of `camera`: of the standard model where that stays within `tolerance` (pixels)
    /// all over the picture, and else of the better of the standard and the fisheye model.
    ///
    /// # Errors
    ///
    /// When the camera has no lens, its rays are parallel, lenslets cut its picture up, or no model fits:
    /// the error says which.
    pub fn new(camera: &Camera, tolerance: f64) -> Result<Self, CameraError> {
        let start = start(camera)?;
        let distance = distance_in_focus(camera);
        let sights = sights(camera);
        // The first model within the tolerance, or the better one.
        let candidates = [models::standard, models::fisheye];
        let mut best: Option<(f64, OpencvModel, Distortion)> = None;
        let mut why = None;
        for fit in candidates {
            let Some(model) = fit(&sights, distance, &start) else { continue };
            let built = match build(camera, &model) {
                Ok(distortion) => distortion,
                Err(error) => {
                    why.get_or_insert(error);
                    continue;
                }
            };
            let largest = worst(&sights, distance, &model.intrinsics, &built);
            if best.as_ref().is_none_or(|(least, ..)| largest < *least) {
                best = Some((largest, model, built));
            }
            if best.as_ref().is_some_and(|(least, ..)| *least <= tolerance) {
                break;
            }
        }
        let none = || CameraError::new("lens", "neither of OpenCV's models fits its chief rays");
        let (_, model, distortion) = best.ok_or_else(|| why.unwrap_or_else(none))?;
        // What it misses, and how far it holds.
        let mut notes = Vec::new();
        let places = places_a_side(camera).pow(2) as usize;
        let dark = places - sights.len();
        if dark > 0 {
            notes.push(format!(
                "{dark} of {places} places of the picture see nothing through the lens; the fit goes on \
                 there as its polynomial does"
            ));
        }
        let residuals = residuals(&sights, distance, &model.intrinsics, &distortion);
        let holds = holds(&sights, distance, &model.intrinsics, &distortion, tolerance);
        Ok(Self {
            camera: as_spec(camera, &model),
            k: model.intrinsics.matrix(PixelOrigin::Center),
            model: model.distortion.name(),
            coefficients: model.distortion.coefficients(),
            distance: distance.is_finite().then_some(distance),
            residuals,
            holds,
            notes,
        })
    }
}

/// The paraxial camera of the lens, from which a fit begins.
fn start(camera: &Camera) -> Result<Intrinsics, CameraError> {
    let none = |why: &str| Err(CameraError::new("type", why));
    match camera.lens() {
        None => none("has no lens to fit a model to"),
        Some(lens) if lens.lenslets().is_some() => none(
            "is a light field, whose pixels look through lenslets: no single pinhole stands for them",
        ),
        Some(lens) => match lens.focused().view() {
            View::Perspective(intrinsics) => Ok(intrinsics),
            View::Parallel { .. } => none(
                "has a lens that is telecentric towards the object: its rays pass through no point",
            ),
        },
    }
}

/// The distance in focus (m), infinite where the lens is focused on nothing in front of it.
fn distance_in_focus(camera: &Camera) -> f64 {
    let distance = camera.lens().map_or(f64::INFINITY, |lens| lens.focused().object_distance());
    if distance > 0.0 { distance } else { f64::INFINITY }
}

/// The camera of a model, standing where `camera` does.
fn as_spec(camera: &Camera, model: &OpencvModel) -> CameraSpec {
    let OpencvModel { intrinsics, distortion } = model;
    let [fx, fy] = intrinsics.focal;
    let origin = PixelOrigin::Center;
    let [cx, cy] = intrinsics.centre.map(|c| c - origin.to_corner());
    CameraSpec::Pinhole(PinholeSpec {
        fov: None,
        intrinsics: Some(IntrinsicsSpec { fx, fy, cx, cy, skew: 0.0, pixel_origin: origin }),
        falloff: None,
        distortion: Some(distortion.clone()),
        pose: Some(PoseSpec::from(*camera.pose())),
        shutter: None,
        motion: None,
        sensor: SensorSpec {
            resolution: camera.resolution(),
            pixel_pitch: camera.pixel_pitch().map(Micrometres),
        },
    })
}

/// The distortion of a model, as the scene's camera has it.
fn build(camera: &Camera, model: &OpencvModel) -> Result<Distortion, CameraError> {
    let built =
        as_spec(camera, model).build(|| Bounds::EMPTY, &|name: &str| Err(name.to_owned()))?;
    match built.projection() {
        crate::Projection::Pinhole(pinhole) => pinhole.distortion().cloned(),
        _ => None,
    }
    .ok_or_else(|| CameraError::new("lens", "the fit has no distortion"))
}

/// Residual (pixels) of a chief ray, at a distance (m): how far it is seen from its own place.
fn residual(
    sight: &PixelSight,
    distance: f64,
    intrinsics: &Intrinsics,
    distortion: &Distortion,
) -> f64 {
    let seen = intrinsics.project(distortion.distort(sight.at(distance).to_array()));
    (seen[0] - sight.pixel[0]).hypot(seen[1] - sight.pixel[1])
}

fn worst(sights: &[PixelSight], distance: f64, intrinsics: &Intrinsics, built: &Distortion) -> f64 {
    let off = sights.iter().map(|sight| residual(sight, distance, intrinsics, built));
    // A residual that is no number is none that holds.
    off.map(|off| if off.is_nan() { f64::INFINITY } else { off }).fold(0.0, f64::max)
}

/// Field of a sight: the distance of its place from the principal point (pixels), and the angle of
/// its ray to the axis (degrees).
fn field(sight: &PixelSight, distance: f64, centre: [f64; 2]) -> [f64; 2] {
    let direction = sight.at(distance);
    let radius = (sight.pixel[0] - centre[0]).hypot(sight.pixel[1] - centre[1]);
    [radius, direction.x.hypot(direction.y).atan2(direction.z).to_degrees()]
}

fn residuals(
    sights: &[PixelSight],
    distance: f64,
    intrinsics: &Intrinsics,
    distortion: &Distortion,
) -> Residuals {
    // How far off each place is, and its radius and field.
    let places: Vec<([f64; 2], f64)> = sights
        .iter()
        .map(|sight| {
            let off = residual(sight, distance, intrinsics, distortion);
            (field(sight, distance, intrinsics.centre), off)
        })
        .collect();
    let rms = |offs: &[f64]| {
        (offs.iter().map(|off| off * off).sum::<f64>() / offs.len().max(1) as f64).sqrt()
    };
    let largest = |offs: &[f64]| offs.iter().copied().fold(0.0, f64::max);
    let reach = places.iter().map(|([radius, _], _)| *radius).fold(0.0, f64::max);
    // Rings of even width about the middle of the picture.
    let ring = |i: u32| {
        let edge = |i: u32| reach * f64::from(i) / f64::from(RINGS);
        let inside = |radius: f64| radius <= edge(i + 1) && (i == 0 || radius > edge(i));
        let of_ring: Vec<_> = places.iter().filter(|([radius, _], _)| inside(*radius)).collect();
        let offs: Vec<f64> = of_ring.iter().map(|(_, off)| *off).collect();
        let field = of_ring.iter().map(|([_, field], _)| *field).fold(0.0, f64::max);
        (!offs.is_empty()).then(|| ResidualRing {
            radius: edge(i + 1),
            field,
            rms: rms(&offs),
            largest: largest(&offs),
        })
    };
    let offs: Vec<f64> = places.iter().map(|(_, off)| *off).collect();
    Residuals {
        places: offs.len(),
        rms: rms(&offs),
        largest: largest(&offs),
        rings: (0..RINGS).filter_map(ring).collect(),
    }
}

/// Region in which the fit stays within a tolerance (pixels).
fn holds(
    sights: &[PixelSight],
    distance: f64,
    intrinsics: &Intrinsics,
    distortion: &Distortion,
    tolerance: f64,
) -> FitRegion {
    let mut places: Vec<([f64; 2], bool)> = sights
        .iter()
        .map(|sight| {
            let within = residual(sight, distance, intrinsics, distortion) <= tolerance;
            (field(sight, distance, intrinsics.centre), within)
        })
        .collect();
    places.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]));
    let inner = places.iter().take_while(|(_, within)| *within).last();
    let [radius, field] = inner.map_or([0.0; 2], |(at, _)| *at);
    let within = places.iter().filter(|(_, within)| *within).count();
    let at = |distance: f64| worst(sights, distance, intrinsics, distortion) <= tolerance;
    let (nearest, farthest) = if at(distance) { range(distance, &at) } else { (None, None) };
    FitRegion {
        tolerance,
        share: within as f64 / places.len().max(1) as f64,
        radius,
        field,
        nearest,
        farthest,
        pupil_wander: 1e3 * sights.iter().map(PixelSight::wander).fold(0.0, f64::max),
    }
}

/// Nearest and farthest distance (m) on both sides of `distance` between which something holds; `None` for infinity.
fn range(distance: f64, holds: &dyn Fn(f64) -> bool) -> (Option<f64>, Option<f64>) {
    // Displacements go with one over the distance.
    let own = 1.0 / distance;
    let limit = |mut good: f64, mut bad: f64| {
        if holds(1.0 / bad) {
            return bad;
        }
        for _ in 0..50 {
            let middle = 0.5 * (good + bad);
            if holds(1.0 / middle) { good = middle } else { bad = middle }
        }
        good
    };
    let nearest = 1.0 / limit(own, own.max(1.0) / NEAREST);
    let farthest = if holds(f64::INFINITY) { None } else { Some(1.0 / limit(own, 0.0)) };
    (Some(nearest), farthest)
}
