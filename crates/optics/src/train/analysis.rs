//! Effects of a lens on the picture, measured with real rays.
//!
//! Chromatic shifts against the design wavelength.
//!
//! Distortion: how far the chief ray lands from where a lens of its focal length would put it.
//!
//! Relative illumination: how the irradiance of a uniform scene falls off over the sensor.
//!
//! E = ∫ cos θ dΩ over the directions from a point of the sensor in which a ray leaves the lens. In
//! slopes m = tan θ this is ∫ cos⁴θ dm, the fourth power of Eq. (1) of Nürnberg et al. (2019): cos³θ
//! from solid angle to slopes, and cos θ for the sensor's foreshortening.
//!
//! Spot diagrams: where a beam from infinity meets the sensor.

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::Serialize;

use crate::element::{Clip, LensRays, RayStatus};
use crate::glass::GlassError;
use crate::train::aim::towards_lens;
use crate::train::pupil::SlopeWindow;
use crate::train::{FieldSpec, MonochromaticTrain, OpticalTrain, Side};

/// Shift of the image of one wavelength from that of the design wavelength.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ColourShift {
    /// The wavelength (nm).
    pub wavelength: f64,
    /// Longitudinal: its back focal length less that of the design wavelength (mm); `null` for an
    /// afocal lens.
    pub longitudinal: Option<f64>,
    /// Lateral: its chief ray's height on the reference plane less that of the design wavelength
    /// (mm), one for each field angle; `null` where a chief ray does not arrive.
    pub lateral: Vec<Option<f64>>,
}

/// Shifts at `wavelengths` (nm) and `fields` (degrees) on the plane at `reference_z` (mm).
///
/// # Errors
///
/// When a glass has no index at one of the wavelengths.
pub fn colour_shifts(
    train: &OpticalTrain,
    wavelengths: &[f64],
    fields: &[f64],
    reference_z: f64,
) -> Result<Vec<ColourShift>, GlassError> {
    let heights = |wavelength: f64| -> Result<Vec<Option<f64>>, GlassError> {
        let at = train.at(wavelength)?;
        Ok(fields.iter().map(|&field| chief_height(train, &at, field, reference_z)).collect())
    };
    let design = train.wavelength();
    let (focus, reference) = (train.paraxial(design)?.bfl, heights(design)?);
    let mut shifts = Vec::with_capacity(wavelengths.len());
    for &wavelength in wavelengths {
        let own = train.paraxial(wavelength)?.bfl;
        let difference = |(own, reference): (Option<f64>, &Option<f64>)| Some(own? - (*reference)?);
        shifts.push(ColourShift {
            wavelength,
            longitudinal: difference((own, &focus)),
            lateral: heights(wavelength)?.into_iter().zip(&reference).map(difference).collect(),
        });
    }
    Ok(shifts)
}

/// Distortion at one field angle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct FieldDistortion {
    /// The angle off the axis (degrees).
    pub field: f64,
    /// Height at which the real chief ray meets the reference plane (mm).
    pub y_real: f64,
    /// efl · tan(field) (mm).
    pub y_paraxial: f64,
    /// (real − paraxial)/paraxial (percent), real counted from where the chief ray of field 0 lands,
    /// which tilts and decentrings move; 0 on the axis.
    pub percent: f64,
}

/// Distortion at `field` degrees on the plane at `reference_z` (mm). Vignetting is left out.
///
/// `None` when no chief ray arrives, the lens is afocal, or the field is 90° or more.
#[must_use]
pub fn distortion(
    train: &OpticalTrain,
    at: &MonochromaticTrain,
    field: f64,
    reference_z: f64,
) -> Option<FieldDistortion> {
    let y_real = chief_height(train, at, field, reference_z)?;
    let efl = train.paraxial(at.wavelength()).ok()?.efl?;
    if field.abs() >= 90.0 {
        return None;
    }
    let y_paraxial = efl * field.to_radians().tan();
    let centre = match train.is_rotationally_symmetric() {
        true => 0.0,
        false => chief_height(train, at, 0.0, reference_z)?,
    };
    let percent = match y_paraxial == 0.0 {
        true => 0.0,
        false => 100.0 * (y_real - centre - y_paraxial) / y_paraxial,
    };
    Some(FieldDistortion { field, y_real, y_paraxial, percent })
}

/// The height (mm) at which the chief ray of a field angle (degrees) meets the plane at
/// `reference_z`, through the lens without clipping.
pub fn chief_height(
    train: &OpticalTrain,
    at: &MonochromaticTrain,
    field: f64,
    reference_z: f64,
) -> Option<f64> {
    let chief = train.chief_ray(at, field)?;
    let path = at.path(Side::Object, Clip::Off, chief.position, chief.direction);
    let (last, direction) = (*path.points.last()?, path.direction?);
    let height = last.y + direction.y / direction.z * (reference_z - last.z);
    height.is_finite().then_some(height)
}

/// Cells a side over the rectangle of passing directions. Not a setting of a scene: a camera's solid angle is measured
/// while its description is read, before anything of the scene is known, and to 10⁻⁴.
const PUPIL_GRID: f64 = 500.0;

/// Least number of cells a side, for the longest trains.
const LEAST_GRID: f64 = 100.0;

/// Rays times elements that the illumination at one place is worth: a train of more than 64 elements gets a coarser
/// grid.
const WORK: f64 = 64.0 * PUPIL_GRID * PUPIL_GRID;

/// Rays that a table of many places is worth, which share them.
const MOST_RAYS: f64 = 40.0 * PUPIL_GRID * PUPIL_GRID;

/// Cells a side for one of so many places.
#[expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts of rays and places"
)]
fn grid(at: &MonochromaticTrain, places: usize) -> u32 {
    let rays = (WORK / at.cost_of_a_ray()).min(MOST_RAYS / places as f64);
    rays.sqrt().clamp(LEAST_GRID, PUPIL_GRID) as u32
}

/// Rings around the axis of a round lens. Not a setting, as [`PUPIL_GRID`].
const RINGS: u32 = 1024;

/// Steps in which the edge between two of them is sought.
const EDGE_BISECTIONS: u32 = 40;

/// Fractions of the golden ratio and of the root of 2, whose multiples are even over 0 to 1, and those
/// of their sum and difference, too, so that diagonals fare as well.
const SHIFTS: [f64; 2] = [0.618_033_988_749_895, 0.414_213_562_373_095];

/// Illumination at one field angle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct FieldIllumination {
    /// The angle off the axis (degrees).
    pub field: f64,
    /// Height of its chief ray on the sensor (mm).
    pub image_y: f64,
    /// The projected solid angle of the exit pupil from there (sr), that is the irradiance for a
    /// radiance of 1.
    pub projected_solid_angle: f64,
    /// The same over that on the axis.
    pub relative: f64,
}

/// Illumination at `fields` (degrees) on a sensor square to the axis at `sensor_z` (mm). A field
/// whose chief ray does not arrive is left out.
#[must_use]
pub fn illumination(
    train: &OpticalTrain,
    at: &MonochromaticTrain,
    fields: &[f64],
    sensor_z: f64,
) -> Vec<FieldIllumination> {
    let on_axis = projected_solid_angle(train, at, DVec3::new(0.0, 0.0, sensor_z));
    let mut points = Vec::with_capacity(fields.len());
    for &field in fields {
        let Some(image_y) = chief_height(train, at, field, sensor_z) else { continue };
        let film = DVec3::new(0.0, image_y, sensor_z);
        let projected_solid_angle = solid_angle(train, at, film, fields.len());
        let relative = if on_axis > 0.0 { projected_solid_angle / on_axis } else { 0.0 };
        points.push(FieldIllumination { field, image_y, projected_solid_angle, relative });
    }
    points
}

/// ∫ cos θ dΩ over the directions in which rays from `film` (mm) leave the lens, weighted with what
/// apertures and filters pass, for a sensor square to the axis.
#[must_use]
pub fn projected_solid_angle(train: &OpticalTrain, at: &MonochromaticTrain, film: DVec3) -> f64 {
    solid_angle(train, at, film, 1)
}

/// Projected solid angle, for one of `places`, which share the rays that a table is worth.
fn solid_angle(train: &OpticalTrain, at: &MonochromaticTrain, film: DVec3, places: usize) -> f64 {
    let Some(window) = SlopeWindow::find(train, at, film) else { return 0.0 };
    if film.truncate() == DVec2::ZERO && train.is_rotationally_symmetric() {
        let corner = window.min.abs().max(window.max.abs());
        return solid_angle_of_rings(at, film, corner.max_element());
    }
    let grid = grid(at, places);
    // Left and right of a place on the y axis a round lens passes the same.
    let is_mirrored = film.x == 0.0 && train.is_rotationally_symmetric();
    let (columns, times) = if is_mirrored { (grid.div_ceil(2), 2.0) } else { (grid, 1.0) };
    let (mut from, mut to) = (window.min, window.max);
    if is_mirrored {
        (from.x, to.x) = (0.0, to.x.max(-from.x));
    }
    let size = (to - from) / DVec2::new(f64::from(columns), f64::from(grid));
    let mut rays = LensRays::with_capacity(columns as usize);
    let mut sum = 0.0;
    for row in 0..grid {
        rays.clear();
        for column in 0..columns {
            // Rows and columns are shifted against each other: on a straight grid the edge of a square
            // stop would lie in or out of a whole line of cells at once.
            let shift = |i: usize, line: u32| (SHIFTS[i] * (f64::from(line) + 0.5)).fract();
            let cell =
                DVec2::new(f64::from(column) + shift(0, row), f64::from(row) + shift(1, column));
            let slopes = from + cell * size;
            let cos2 = 1.0 / (1.0 + slopes.length_squared());
            rays.push_weighted(film, towards_lens(slopes), cos2 * cos2);
        }
        at.trace(Side::Sensor, Clip::On, &mut rays);
        sum += rays.passed_throughput();
    }
    times * sum * size.x * size.y
}

/// Projected solid angle from a place on the axis of a round lens, for slopes up to `steepest`: of rings, each with
/// what a ray in its middle passes, whose borders are where rays begin or cease to pass.
fn solid_angle_of_rings(at: &MonochromaticTrain, film: DVec3, steepest: f64) -> f64 {
    let traced = |slopes: &[f64]| {
        let mut rays = LensRays::with_capacity(slopes.len());
        slopes.iter().for_each(|&slope| rays.push(film, towards_lens(DVec2::new(slope, 0.0))));
        at.trace(Side::Sensor, Clip::On, &mut rays);
        let passed = |i| (rays.status(i) == RayStatus::Exited).then(|| rays.throughput(i));
        (0..slopes.len()).map(passed).collect::<Vec<Option<f64>>>()
    };
    let width = steepest / f64::from(RINGS);
    let middles: Vec<f64> = (0..RINGS).map(|k| (f64::from(k) + 0.5) * width).collect();
    let passed = traced(&middles);
    // ∫ cos θ dΩ within a slope is π sin² θ.
    let within = |slope: f64| std::f64::consts::PI * slope * slope / (1.0 + slope * slope);
    let mut inner = 0.0;
    let mut sum = 0.0;
    for (k, own) in passed.iter().enumerate() {
        let next = passed.get(k + 1).unwrap_or(own);
        let mut outer = (k + 1) as f64 * width;
        if own.is_some() != next.is_some() {
            let mut between = [middles[k], middles[k + 1]];
            for _ in 0..EDGE_BISECTIONS {
                outer = 0.5 * (between[0] + between[1]);
                let is_alike = traced(&[outer])[0].is_some() == own.is_some();
                between[usize::from(!is_alike)] = outer;
            }
        }
        sum += own.unwrap_or(0.0) * (within(outer) - within(inner));
        inner = outer;
    }
    sum
}

/// The greatest distance from the axis on a sensor at `sensor_z` (mm) from which light can leave
/// the lens; `None` when none can from the axis, or the distance has no end below `limit` (mm).
#[must_use]
pub fn image_circle(
    train: &OpticalTrain,
    at: &MonochromaticTrain,
    sensor_z: f64,
    limit: f64,
) -> Option<f64> {
    let lit = |r: f64| SlopeWindow::find(train, at, DVec3::new(0.0, r, sensor_z)).is_some();
    if !lit(0.0) || lit(limit) {
        return None;
    }
    let (mut low, mut high) = (0.0, limit);
    while high - low > 1e-3 * high {
        let middle = 0.5 * (low + high);
        if lit(middle) { low = middle } else { high = middle }
    }
    Some(low)
}

/// The angle from the axis (degrees) of the light that reaches a point of the sensor `radius` (mm)
/// from its centre: half the field of view when that is the image circle's edge. It is that of the
/// ray in the middle of the beam; `None` when there is no light.
#[must_use]
pub fn half_field(
    train: &OpticalTrain,
    at: &MonochromaticTrain,
    sensor_z: f64,
    radius: f64,
) -> Option<f64> {
    let film = DVec3::new(0.0, radius, sensor_z);
    let window = SlopeWindow::find(train, at, film)?;
    let outside = |slopes: DVec2| {
        let path = at.path(Side::Sensor, Clip::Off, film, towards_lens(slopes));
        path.direction.map(|d| d.truncate().length().atan2(-d.z).to_degrees())
    };
    // The middle of a crescent may run past the lens altogether.
    let corners = [window.min, window.max].map(|corner| 0.5 * (corner + window.centre()));
    [window.centre(), corners[0], corners[1]].into_iter().find_map(outside)
}

/// Cells across the square around the entrance pupil. Not a setting of a scene: no picture is made of spots.
const SPOT_GRID: u32 = 32;

/// Intersections of the rays of one field point with the reference plane.
///
/// Rays start on a grid of 32 × 32 cell centres in the square around the paraxial entrance pupil,
/// of which those inside the circle count, all in the direction (0, sin field, cos field). Vignetting factors move
/// them to what is left of the pupil. Radii are from the centroid.
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

impl Spot {
    /// The share of its rays that passed.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "counts of some hundred rays")]
    pub fn passed(&self) -> f64 {
        self.rays_passed as f64 / self.rays_launched.max(1) as f64
    }
}

/// The spot of a field on the plane at `reference_z` (mm).
///
/// `None` when the lens has no finite entrance pupil or no ray passes.
#[must_use]
pub fn spot(
    train: &OpticalTrain,
    at: &MonochromaticTrain,
    field: &FieldSpec,
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
        field: field.angle.0,
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

/// The beam of a field, traced.
fn beam(train: &OpticalTrain, at: &MonochromaticTrain, field: &FieldSpec) -> Option<LensRays> {
    let pupil = train.paraxial(at.wavelength()).ok()?.entrance_pupil;
    let (z, radius) = (pupil.z?, 0.5 * pupil.diameter?);
    let (sine, cosine) = field.angle.0.to_radians().sin_cos();
    let direction = DVec3::new(0.0, sine, cosine);
    let back = train.far_in_front(z) + radius;
    let coordinate = |i: u32| 2.0 * (f64::from(i) + 0.5) / f64::from(SPOT_GRID) - 1.0;
    let mut rays = LensRays::with_capacity((SPOT_GRID * SPOT_GRID) as usize);
    for row in 0..SPOT_GRID {
        for column in 0..SPOT_GRID {
            let place = DVec2::new(coordinate(column), coordinate(row));
            if place.length_squared() <= 1.0 {
                let place = field.vignetting.place(place) * radius;
                rays.push(place.extend(z) - direction * back, direction);
            }
        }
    }
    at.trace(Side::Object, Clip::On, &mut rays);
    Some(rays)
}
