//! Pupils that are known in closed form: a round opening as the only rim, with nothing between it and
//! the sensor that bends rays. From each point of the sensor light comes from all over the disc and
//! from nowhere else, so no ray is lost at the rim.
//!
//! Samples of a batch are worked out side by side, in loops that vectorise.

use std::f64::consts::{FRAC_PI_4, PI};

use glam::{DMat3, DVec2, DVec3};

use crate::element::{Block, Fate, Frame, LANES, LensRays, Opening};
use crate::train::{OpticalTrain, Part};

/// A round opening square to the axis (mm).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Disc {
    centre: DVec3,
    radius: f64,
}

/// From samples of the film to weighted rays.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bundle<'a> {
    /// The sensor's place.
    pub(crate) sensor: &'a Frame,
    /// Weight of a sample per its projected solid angle (1/sr).
    pub(crate) scale: f64,
    /// Places on the sensor (mm), one array an axis.
    pub(crate) film: [&'a [f64]; 2],
    /// Places in the unit square.
    pub(crate) squares: &'a [[f64; 2]],
}

impl Disc {
    /// The disc of a lens that has such a pupil, as long as the sensor's `corners` are behind it.
    pub(super) fn of(train: &OpticalTrain, corners: &[DVec3]) -> Option<Self> {
        let mut disc = None;
        for element in train.elements() {
            if element.frame.rotation != DMat3::IDENTITY {
                return None;
            }
            match &element.part {
                // What bends rays behind the opening would move its image.
                Part::ThinLens(lens) if lens.semi_diameter == f64::INFINITY && disc.is_none() => {}
                Part::Aperture(opening) => match **opening {
                    Opening::Circle { radius: f64::INFINITY } => {}
                    Opening::Circle { radius } if radius > 0.0 && disc.is_none() => {
                        disc = Some(Self { centre: element.frame.vertex, radius });
                    }
                    _ => return None,
                },
                _ => return None,
            }
        }
        disc.filter(|disc| corners.iter().all(|corner| corner.z > disc.centre.z))
    }

    /// Centre and radius of the disc in slopes, from a point of the sensor (mm).
    pub(super) fn seen_from(&self, film: DVec3) -> (DVec2, f64) {
        let distance = film.z - self.centre.z;
        ((self.centre - film).truncate() / distance, self.radius / distance)
    }

    /// Refills `rays` with one ray a sample, as [`super::ExitPupil::sample`] gives them one by one.
    pub(crate) fn fill(&self, bundle: &Bundle<'_>, rays: &mut LensRays) {
        rays.resize(bundle.squares.len());
        fill_blocks(self, bundle, &mut rays.blocks);
    }
}

#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512dq+avx512vl",
    "x86_64+avx2",
    "aarch64+neon"
))]
fn fill_blocks(disc: &Disc, bundle: &Bundle<'_>, blocks: &mut [Block]) {
    let Bundle { sensor, scale, film, squares } = *bundle;
    let Frame { vertex, rotation } = *sensor;
    let (right, up, normal) = (rotation.x_axis, rotation.y_axis, rotation.z_axis);
    let factor = scale * PI * disc.radius * disc.radius;
    for (b, block) in blocks.iter_mut().enumerate() {
        let range = b * LANES..squares.len().min((b + 1) * LANES);
        let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
        let mut square = [[0.0; 2]; LANES];
        x[..range.len()].copy_from_slice(&film[0][range.clone()]);
        y[..range.len()].copy_from_slice(&film[1][range.clone()]);
        square[..range.len()].copy_from_slice(&squares[range.clone()]);
        for i in 0..LANES {
            let px = vertex.x + (right.x * x[i] + up.x * y[i]);
            let py = vertex.y + (right.y * x[i] + up.y * y[i]);
            let pz = vertex.z + (right.z * x[i] + up.z * y[i]);
            let [a, b] = disc_point(square[i]);
            let (u, v) =
                (disc.centre.x + a * disc.radius - px, disc.centre.y + b * disc.radius - py);
            let w = disc.centre.z - pz;
            let length2 = u * u + v * v + w * w;
            let inverse = 1.0 / length2.sqrt();
            let (dx, dy, dz) = (u * inverse, v * inverse, w * inverse);
            // dΩ = dA cos θ / r², as the disc is square to the axis, under the sensor's own cosine.
            let on_sensor = (dx * normal.x + dy * normal.y + dz * normal.z).abs();
            block.position[0][i] = px;
            block.position[1][i] = py;
            block.position[2][i] = pz;
            block.direction[0][i] = dx;
            block.direction[1][i] = dy;
            block.direction[2][i] = dz;
            block.throughput[i] = factor * -dz / length2 * on_sensor;
        }
        block.outcome[..range.len()].fill(Fate::Exited.code());
    }
}

/// A point of the unit square on the unit disc, equal areas staying equal (P. Shirley and K. Chiu, "A
/// low distortion map between disk and square", 1997).
#[inline(always)]
fn disc_point([u, v]: [f64; 2]) -> [f64; 2] {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    let flat = a.abs() > b.abs();
    let (radius, other) = if flat { (a, b) } else { (b, a) };
    let ratio = if radius == 0.0 { 0.0 } else { other / radius };
    let (sine, cosine) = small_sine_cosine(FRAC_PI_4 * ratio);
    if flat { [radius * cosine, radius * sine] } else { [radius * sine, radius * cosine] }
}

/// Sine and cosine of an angle of at most π/4 by their series: what is left out is below 10⁻¹⁶.
#[inline(always)]
fn small_sine_cosine(angle: f64) -> (f64, f64) {
    let x = angle * angle;
    let series = |terms: [f64; 8]| {
        let mut sum = terms[7];
        for k in (0..7).rev() {
            sum = sum * x + terms[k];
        }
        sum
    };
    let sine = series([
        1.0,
        -1.0 / 6.0,
        1.0 / 120.0,
        -1.0 / 5_040.0,
        1.0 / 362_880.0,
        -1.0 / 39_916_800.0,
        1.0 / 6_227_020_800.0,
        -1.0 / 1_307_674_368_000.0,
    ]);
    let cosine = series([
        -1.0 / 2.0,
        1.0 / 24.0,
        -1.0 / 720.0,
        1.0 / 40_320.0,
        -1.0 / 3_628_800.0,
        1.0 / 479_001_600.0,
        -1.0 / 87_178_291_200.0,
        1.0 / 20_922_789_888_000.0,
    ]);
    (angle * sine, 1.0 + x * cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sines_and_cosines_are_those_of_the_library() {
        for i in -100..=100 {
            let angle = FRAC_PI_4 * f64::from(i) / 100.0;
            let (sine, cosine) = small_sine_cosine(angle);
            // A rounding of each of two operations near 1.
            assert!((sine - angle.sin()).abs() < 3e-16, "{angle}: {sine}");
            assert!((cosine - angle.cos()).abs() < 3e-16, "{angle}: {cosine}");
        }
    }
}
