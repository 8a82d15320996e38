//! Relative illumination: how the irradiance of a uniform scene falls off over the sensor.
//!
//! E = ∫ cos θ dΩ over the directions from a point of the sensor in which a ray leaves the lens. In
//! slopes m = tan θ this is ∫ cos⁴θ dm, the fourth power of Eq. (1) of Nürnberg et al. (2019): cos³θ
//! from solid angle to slopes, and cos θ for the sensor's foreshortening.

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::Serialize;

use super::distortion::chief_height;
use crate::element::{Clip, LensRays};
use crate::train::aim::towards_lens;
use crate::train::pupil::Window;
use crate::train::{MonochromaticTrain, OpticalTrain, Side};

/// Cells a side over the rectangle of passing directions.
const GRID: u32 = 500;

/// The same in the least, for the longest trains.
const LEAST_GRID: u32 = 100;

/// Rays times elements that one point is worth: a train of more than 64 elements gets a coarser grid.
const WORK: u32 = 64 * GRID * GRID;

/// Cells a side for a train of so many elements.
fn grid(elements: usize) -> u32 {
    let rays = WORK / u32::try_from(elements.max(1)).unwrap_or(u32::MAX);
    rays.isqrt().clamp(LEAST_GRID, GRID)
}

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
        let projected_solid_angle = projected_solid_angle(train, at, film);
        let relative = if on_axis > 0.0 { projected_solid_angle / on_axis } else { 0.0 };
        points.push(FieldIllumination { field, image_y, projected_solid_angle, relative });
    }
    points
}

/// ∫ cos θ dΩ over the directions in which rays from `film` (mm) leave the lens, weighted with what
/// apertures and filters pass, for a sensor square to the axis.
#[must_use]
pub fn projected_solid_angle(train: &OpticalTrain, at: &MonochromaticTrain, film: DVec3) -> f64 {
    let Some(window) = Window::find(train, at, film) else { return 0.0 };
    let grid = grid(train.elements().len());
    let size = (window.max - window.min) / f64::from(grid);
    let mut rays = LensRays::with_capacity(grid as usize);
    let mut sum = 0.0;
    for row in 0..grid {
        rays.clear();
        for column in 0..grid {
            // Rows and columns are shifted against each other: on a straight grid the edge of a square
            // stop would lie in or out of a whole line of cells at once.
            let shift = |i: usize, line: u32| (SHIFTS[i] * (f64::from(line) + 0.5)).fract();
            let cell =
                DVec2::new(f64::from(column) + shift(0, row), f64::from(row) + shift(1, column));
            let slopes = window.min + cell * size;
            let cos2 = 1.0 / (1.0 + slopes.length_squared());
            rays.push_weighted(film, towards_lens(slopes), cos2 * cos2);
        }
        at.trace(Side::Sensor, Clip::On, &mut rays);
        sum += rays.passed_throughput();
    }
    sum * size.x * size.y
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
    let lit = |r: f64| Window::find(train, at, DVec3::new(0.0, r, sensor_z)).is_some();
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
    let window = Window::find(train, at, film)?;
    let outside = |slopes: DVec2| {
        let path = at.path(Side::Sensor, Clip::Off, film, towards_lens(slopes));
        path.direction.map(|d| d.truncate().length().atan2(-d.z).to_degrees())
    };
    // The middle of a crescent may run past the lens altogether.
    let corners = [window.min, window.max].map(|corner| 0.5 * (corner + window.centre()));
    [window.centre(), corners[0], corners[1]].into_iter().find_map(outside)
}
