//! Pupils that are known in closed form: a round opening as the only rim, with nothing between it and
//! the sensor that bends rays. From each point of the sensor light comes from all over the disk and
//! from nowhere else, so no ray is lost at the rim.
//!
//! Samples of a batch are worked out side by side, in loops that vectorise. Even in area they would weigh cos⁴ θ,
//! which at the corner of a picture at f/2.8 differs by half of itself over the disk: noise. So they are moved
//! to be all but even in projected solid angle ([`even`]). On a disk as wide as it is far, as of a lens of f/0.5,
//! they are even in projected solid angle at each azimuth about the foot of the perpendicular from the sensor's
//! point, so that no weight exceeds π.

use std::f64::consts::PI;

use etendue_geometry::disk;
use glam::{DMat3, DVec2, DVec3};

use crate::element::{Block, Frame, LANES, Opening, RayStatus};
use crate::train::{OpticalTrain, Part};

/// From samples of the film to weighted rays.
#[derive(Debug, Clone, Copy)]
pub struct PupilSamples<'a> {
    /// Factor on all weights.
    pub scale: f64,
    /// Places on the sensor from its centre (mm), in the lens' axes, one array an axis.
    pub film: [&'a [f64]; 2],
    /// Places in the unit square.
    pub squares: &'a [[f64; 2]],
}

/// A round opening square to the axis (mm).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disk {
    centre: DVec3,
    radius: f64,
}

impl Disk {
    /// The disk of a lens that has such a pupil, as long as it stands before all of a sensor of half
    /// width and half height `half_size` (mm).
    pub fn of(train: &OpticalTrain, sensor: &Frame, half_size: DVec2) -> Option<Self> {
        let mut disk = None;
        for element in train.elements() {
            if element.frame.rotation != DMat3::IDENTITY {
                return None;
            }
            match &element.part {
                // What bends rays behind the opening would move its image.
                Part::ThinLens(lens) if lens.semi_diameter == f64::INFINITY && disk.is_none() => {}
                Part::Aperture(opening) => match **opening {
                    Opening::Circle { radius: f64::INFINITY } => {}
                    Opening::Circle { radius } if radius > 0.0 && disk.is_none() => {
                        disk = Some(Self { centre: element.frame.vertex, radius });
                    }
                    _ => return None,
                },
                _ => return None,
            }
        }
        let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]];
        let corners = corners.map(|c| sensor.point((DVec2::from(c) * half_size).extend(0.0)));
        disk.filter(|disk| corners.iter().all(|corner| corner.z > disk.centre.z))
    }

    /// The projected solid angle (sr) of the disk from a point of the axis, for what stands square to
    /// the axis: π sin²θ. `None` when the disk is not centred on the axis.
    pub fn solid_angle_from(&self, z: f64) -> Option<f64> {
        let distance = z - self.centre.z;
        let squared = self.radius * self.radius;
        let centred = self.centre.truncate() == DVec2::ZERO;
        centred.then(|| PI * squared / (squared + distance * distance))
    }

    /// True if the disk is as wide as it is far from a sensor, where samples that [`even`] moves
    /// still differ in weight.
    fn is_wide(&self, sensor: &Frame) -> bool {
        self.radius >= (sensor.vertex.z - self.centre.z).abs() * (1.0 - 1e-9)
    }

    /// From a point of the sensor (mm) to the point of the disk for a place in the unit square, and the
    /// projected solid angle that it stands for if the sensor is square to the axis: with the foot of the
    /// perpendicular as origin, even in azimuth and, along it, in cos² θ, as cos θ dΩ = −½ dφ d(cos² θ).
    fn aim_wide(&self, film: DVec3, [u, v]: [f64; 2]) -> (DVec3, f64) {
        let to_centre = (self.centre - film).truncate();
        let (offset, height) = (to_centre.length(), film.z - self.centre.z);
        let radius2 = self.radius * self.radius;
        // All around from inside, between the tangents from outside.
        let (azimuth, span) = if offset <= self.radius {
            (DVec2::from_angle(2.0 * PI * u), 2.0 * PI)
        } else {
            let half = (self.radius / offset).asin();
            let middle = to_centre / offset;
            (middle.rotate(DVec2::from_angle((2.0 * u - 1.0) * half)), 2.0 * half)
        };
        let (along, across) = (azimuth.dot(to_centre), azimuth.perp_dot(to_centre));
        let chord = (radius2 - across * across).max(0.0).sqrt();
        let (near, far) = ((along - chord).max(0.0), (along + chord).max(0.0));
        let cosine2 = |r: f64| height * height / (height * height + r * r);
        let (first, last) = (cosine2(near), cosine2(far));
        let there = first + v * (last - first);
        let r = (height * ((1.0 - there) / there).max(0.0).sqrt()).clamp(near, far);
        ((azimuth * r).extend(-height), 0.5 * span * (first - last))
    }

    /// Slopes for a place in the unit square from a point of a sensor (mm), and the area of slopes that they
    /// stand for.
    pub(super) fn draw(&self, sensor: &Frame, film: DVec3, u: [f64; 2]) -> (DVec2, f64) {
        if self.is_wide(sensor) {
            let (way, angle) = self.aim_wide(film, u);
            let slopes = way.truncate() / -way.z;
            // cos θ dΩ = cos⁴ θ dm.
            return (slopes, angle * (1.0 + slopes.length_squared()).powi(2));
        }
        let (centre, radius) = self.seen_from(film);
        let (point, stretch) = even(centre.to_array(), radius, disk::point(u));
        (centre + radius * DVec2::from(point), PI * radius * radius * stretch)
    }

    /// Centre and radius of the disk in slopes, from a point of the sensor (mm).
    pub(super) fn seen_from(&self, film: DVec3) -> (DVec2, f64) {
        let distance = film.z - self.centre.z;
        ((self.centre - film).truncate() / distance, self.radius / distance)
    }

    /// Fills blocks with one ray a sample from a sensor, behind a medium of an index squared.
    pub(super) fn fill(
        &self,
        sensor: &Frame,
        bundle: &PupilSamples<'_>,
        index2: f64,
        blocks: &mut [Block],
    ) {
        let bundle = PupilSamples { scale: bundle.scale * index2, ..*bundle };
        if self.is_wide(sensor) {
            fill_wide(self, sensor, &bundle, blocks);
        } else {
            fill_blocks(self, sensor, &bundle, blocks);
        }
    }
}

/// A point of the unit disk, of points even in area, moved so that they are all but even in projected solid angle on a
/// disk of slopes about `centre`, and how much of its area stands for it there.
///
/// Seen from the axis, where the solid angle within r is π ρ²r² / (1 + ρ²r²) in slopes of the disk's radius ρ, they are
/// even. Aside of it the disk is mapped onto itself by the projective map that leaves its rim, (x + b, y √(1 − b²)) /
/// (1 + b x), whose density goes by (1 − b x)⁻³ and with which b takes away what cos⁴ θ has in the first order
/// of x and of ρ; the 3.5 in it halves what is left of the third. The rest is of the second order in x: 0.4 % at f/2.8
/// and 20°.
#[inline(always)]
fn even(centre: [f64; 2], radius: f64, [x, y]: [f64; 2]) -> ([f64; 2], f64) {
    let square = centre[0] * centre[0] + centre[1] * centre[1];
    let length = square.sqrt();
    let axis = if length > 0.0 { [centre[0] / length, centre[1] / length] } else { [1.0, 0.0] };
    let (along, across) = (x * axis[0] + y * axis[1], y * axis[0] - x * axis[1]);
    let bow = radius * radius / (1.0 + square);
    let shrink = 1.0 / (1.0 + bow - bow * (along * along + across * across));
    let root = shrink.sqrt();
    let shift = -4.0 * length * radius / (3.0 * (1.0 + square) + 3.5 * radius * radius);
    let rest = 1.0 - shift * shift;
    let narrow = rest.sqrt();
    let over = 1.0 / (1.0 + shift * along * root);
    let (p, q) = ((along * root + shift) * over, across * root * narrow * over);
    let stretch = (1.0 + bow) * shrink * shrink * rest * narrow * over * over * over;
    ([p * axis[0] - q * axis[1], q * axis[0] + p * axis[1]], stretch)
}

fn fill_wide(disk: &Disk, sensor: &Frame, bundle: &PupilSamples<'_>, blocks: &mut [Block]) {
    let PupilSamples { scale, film, squares } = *bundle;
    for (i, &square) in squares.iter().enumerate() {
        let (block, lane) = (&mut blocks[i / LANES], i % LANES);
        let at = sensor.point(DVec3::new(film[0][i], film[1][i], 0.0));
        let (way, angle) = disk.aim_wide(at, square);
        let direction = way.normalize();
        // The sensor's own cosine, where it is tilted.
        let tilt = direction.dot(sensor.rotation.z_axis).abs() / -direction.z;
        for axis in 0..3 {
            block.position[axis][lane] = at[axis];
            block.direction[axis][lane] = direction[axis];
        }
        block.throughput[lane] = scale * angle * tilt;
        block.outcome[lane] = RayStatus::Exited.code();
    }
}

#[multiversion::multiversion(targets = "simd")]
fn fill_blocks(disk: &Disk, sensor: &Frame, bundle: &PupilSamples<'_>, blocks: &mut [Block]) {
    let PupilSamples { scale, film, squares } = *bundle;
    let Frame { vertex, rotation } = *sensor;
    let (right, up, normal) = (rotation.x_axis, rotation.y_axis, rotation.z_axis);
    let factor = scale * PI * disk.radius * disk.radius;
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
            let w = disk.centre.z - pz;
            let slope = -1.0 / w;
            let centre = [(disk.centre.x - px) * slope, (disk.centre.y - py) * slope];
            let ([a, b], stretch) = even(centre, disk.radius * slope, disk::point(square[i]));
            let (u, v) =
                (disk.centre.x + a * disk.radius - px, disk.centre.y + b * disk.radius - py);
            let length2 = u * u + v * v + w * w;
            let inverse = 1.0 / length2.sqrt();
            let (dx, dy, dz) = (u * inverse, v * inverse, w * inverse);
            // dΩ = dA cos θ / r², as the disk is square to the axis, under the sensor's own cosine.
            let on_sensor = (dx * normal.x + dy * normal.y + dz * normal.z).abs();
            block.position[0][i] = px;
            block.position[1][i] = py;
            block.position[2][i] = pz;
            block.direction[0][i] = dx;
            block.direction[1][i] = dy;
            block.direction[2][i] = dz;
            block.throughput[i] = factor * stretch * -dz / length2 * on_sensor;
        }
        block.outcome[..range.len()].fill(RayStatus::Exited.code());
    }
}
