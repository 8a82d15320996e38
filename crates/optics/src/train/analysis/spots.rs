//! Spot diagrams: where a beam from infinity meets the sensor.

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::Serialize;

use crate::element::{Clip, LensRays, RayStatus};
use crate::train::{MonochromaticTrain, OpticalTrain, Side};

/// Cells across the square around the entrance pupil.
const GRID: u32 = 32;

/// Where the rays of one field point meet the reference plane.
///
/// Rays start on a grid of 32 × 32 cell centres in the square around the paraxial entrance pupil,
/// of which those inside the circle count, all in the direction (0, sin field, cos field). Radii are
/// from the centroid.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Spot {
    /// The angle off the axis (degrees).
    pub field: f64,
    /// Rays sent.
    pub rays_launched: usize,
    /// Rays that left the lens towards the sensor.
    pub rays_passed: usize,
    /// The centroid's height on the reference plane (mm).
    pub centroid_y: f64,
    /// Root mean square radius on the reference plane (mm).
    pub rms: f64,
    /// The greatest radius on the reference plane (mm).
    pub geometric: f64,
    /// From the reference plane to the plane of least rms for this field (mm).
    pub best_focus: f64,
    /// Root mean square radius there (mm).
    pub best_rms: f64,
    /// The greatest radius there (mm).
    pub best_geometric: f64,
    /// The points on the reference plane from the centroid (mm), for drawing.
    #[serde(skip)]
    pub points: Vec<DVec2>,
}

/// The spot of the field angle `field` (degrees) on the plane at `reference_z` (mm).
///
/// `None` when the lens has no finite entrance pupil or no ray passes.
#[must_use]
pub fn spot(
    train: &OpticalTrain,
    at: &MonochromaticTrain,
    field: f64,
    reference_z: f64,
) -> Option<Spot> {
    let rays = beam(train, at, field)?;
    let mut hits = Vec::with_capacity(rays.len());
    for i in (0..rays.len()).filter(|&i| rays.status(i) == RayStatus::Exited) {
        let (position, direction) = (rays.position(i), rays.direction(i));
        let slopes = direction.truncate() / direction.z;
        let place = position.truncate() + slopes * (reference_z - position.z);
        if place.is_finite() && slopes.is_finite() {
            hits.push((place, slopes));
        }
    }
    if hits.is_empty() {
        return None;
    }
    #[expect(clippy::cast_precision_loss, reason = "at most 1024 rays")]
    let count = hits.len() as f64;
    let centroid = hits.iter().map(|h| h.0).sum::<DVec2>() / count;
    let drift = hits.iter().map(|h| h.1).sum::<DVec2>() / count;
    // Σ |p + s t|² over the rays is least at t = −Σ p·s / Σ s², p and s from their means.
    let cross: f64 = hits.iter().map(|h| (h.0 - centroid).dot(h.1 - drift)).sum();
    let square: f64 = hits.iter().map(|h| (h.1 - drift).length_squared()).sum();
    let best_focus = if square > 0.0 { -cross / square } else { 0.0 };
    let radii = |shift: f64| {
        let radius = |h: &(DVec2, DVec2)| (h.0 - centroid + (h.1 - drift) * shift).length();
        let rms = (hits.iter().map(|h| radius(h).powi(2)).sum::<f64>() / count).sqrt();
        (rms, hits.iter().map(radius).fold(0.0, f64::max))
    };
    let ((rms, geometric), (best_rms, best_geometric)) = (radii(0.0), radii(best_focus));
    Some(Spot {
        field,
        rays_launched: rays.len(),
        rays_passed: hits.len(),
        centroid_y: centroid.y,
        rms,
        geometric,
        best_focus,
        best_rms,
        best_geometric,
        points: hits.iter().map(|h| h.0 - centroid).collect(),
    })
}

/// The beam of a field angle, traced.
fn beam(train: &OpticalTrain, at: &MonochromaticTrain, field: f64) -> Option<LensRays> {
    let pupil = train.paraxial(at.wavelength()).ok()?.entrance_pupil;
    let (z, radius) = (pupil.z?, 0.5 * pupil.diameter?);
    let (sine, cosine) = field.to_radians().sin_cos();
    let direction = DVec3::new(0.0, sine, cosine);
    let back = train.far_in_front(z) + radius;
    let coordinate = |i: u32| (2.0 * (f64::from(i) + 0.5) / f64::from(GRID) - 1.0) * radius;
    let mut rays = LensRays::with_capacity((GRID * GRID) as usize);
    for row in 0..GRID {
        for column in 0..GRID {
            let (x, y) = (coordinate(column), coordinate(row));
            if x * x + y * y <= radius * radius {
                rays.push(DVec3::new(x, y, z) - direction * back, direction);
            }
        }
    }
    at.trace(Side::Object, Clip::On, &mut rays);
    Some(rays)
}
