//! Pupils that are known in closed form: a round opening as the only rim, with nothing between it and
//! the sensor that bends rays. From each point of the sensor light comes from all over the disc and
//! from nowhere else, so no ray is lost at the rim.
//!
//! Samples of a batch are worked out side by side, in loops that vectorise.

use std::f64::consts::PI;

use etendue_geometry::disk;
use glam::{DMat3, DVec2, DVec3};

use crate::element::{Block, Fate, Frame, LANES, LensRays, Opening};
use crate::train::{OpticalTrain, Part};

/// A round opening square to the axis (mm).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disc {
    centre: DVec3,
    radius: f64,
}

/// From samples of the film to weighted rays.
#[derive(Debug, Clone, Copy)]
pub struct Bundle<'a> {
    /// The sensor's place.
    pub sensor: &'a Frame,
    /// Weight of a sample per its projected solid angle (1/sr).
    pub scale: f64,
    /// Places on the sensor (mm), one array an axis.
    pub film: [&'a [f64]; 2],
    /// Places in the unit square.
    pub squares: &'a [[f64; 2]],
}

impl Disc {
    /// The disc of a lens that has such a pupil, as long as it stands before all of a sensor of half
    /// width and half height `half_size` (mm).
    pub fn of(train: &OpticalTrain, sensor: &Frame, half_size: DVec2) -> Option<Self> {
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
        let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]];
        let corners = corners.map(|c| sensor.point((DVec2::from(c) * half_size).extend(0.0)));
        disc.filter(|disc| corners.iter().all(|corner| corner.z > disc.centre.z))
    }

    /// The projected solid angle (sr) of the disc from a point of the axis, for what stands square to
    /// the axis: π sin²θ. `None` when the disc is not centred on the axis.
    pub fn solid_angle_from(&self, z: f64) -> Option<f64> {
        let distance = z - self.centre.z;
        let squared = self.radius * self.radius;
        let centred = self.centre.truncate() == DVec2::ZERO;
        centred.then(|| PI * squared / (squared + distance * distance))
    }

    /// Centre and radius of the disc in slopes, from a point of the sensor (mm).
    pub(super) fn seen_from(&self, film: DVec3) -> (DVec2, f64) {
        let distance = film.z - self.centre.z;
        ((self.centre - film).truncate() / distance, self.radius / distance)
    }

    /// Refills `rays` with one ray a sample, as [`super::ExitPupil::sample`] gives them one by one.
    pub fn fill(&self, bundle: &Bundle<'_>, rays: &mut LensRays) {
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
            let [a, b] = disk::point(square[i]);
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
