//! The bound around the passing directions from one point of the sensor, joined from those of the nodes
//! around it: samples of it, one by one and side by side.

use etendue_geometry::disk;
use glam::DVec2;

use super::coded::Anywhere;
use super::disk::PupilSamples;
use super::place::{NodePlace, TableAngle, angle_below, between, is_among};
use super::{ExitPupil, NodeLayout, PupilOutline};
use crate::element::{Block, Frame, LANES, LensRays, RayStatus};

/// The outline from one point of the sensor.
pub(super) struct PupilBound<'a> {
    pub(super) nodes: &'a [PupilOutline],
    /// Between which nodes; `None` for a disk.
    pub(super) place: Option<NodePlace>,
    /// Centre and half axes in slopes, as the nodes are turned.
    pub(super) frame: [DVec2; 2],
}

impl PupilBound<'_> {
    /// The radius in the frame at a share of a full turn.
    fn reach(&self, turn: f64) -> f64 {
        self.place.as_ref().map_or(1.0, |place| {
            let reach = |&(node, weight): &(usize, f64)| {
                between(&self.nodes[node].reach, angle_below(turn)) * weight
            };
            place.nodes.iter().map(reach).sum()
        })
    }

    /// The radius within which nothing passes.
    fn inner(&self, turn: f64) -> f64 {
        self.place.as_ref().map_or(0.0, |place| {
            let inner = |&(node, weight): &(usize, f64)| {
                between(&self.nodes[node].inner, angle_below(turn)) * weight
            };
            place.nodes.iter().map(inner).sum()
        })
    }

    fn turned(&self, slopes: DVec2) -> DVec2 {
        self.place.as_ref().map_or(slopes, |place| place.turned(slopes))
    }

    /// A rectangle around the bound.
    pub(super) fn rectangle(&self) -> Anywhere {
        let widest = self.place.as_ref().map_or(1.0, |place| {
            place.nodes.iter().map(|&(node, weight)| self.nodes[node].widest * weight).sum()
        });
        let axis = self.place.as_ref().map_or(DVec2::X, |place| place.axis);
        Anywhere { centre: self.frame[0], half: self.frame[1] * widest, axis }
    }

    /// Slopes for a place in the unit square, uniform in area at each angle, and the area of slopes that
    /// they stand for; `None` when the bound is empty there.
    pub(super) fn draw(&self, u: [f64; 2]) -> Option<(DVec2, f64)> {
        let (radius, turn) = concentric(u);
        let radii = [self.inner(turn), self.reach(turn)];
        let ([along, across], area) = spread(radii, disk::point(u), radius);
        let [centre, half] = self.frame;
        let slopes = centre + DVec2::new(along, across) * half;
        (area > 0.0).then(|| (self.turned(slopes), area * half.x * half.y))
    }
}

/// A point of the unit disk, which is so far from its middle, between two radii along the same angle, of which the
/// inner one counts if it is the lesser; and the area that it stands for. In the units of the radii.
#[inline(always)]
fn spread([inner, reach]: [f64; 2], [a, b]: [f64; 2], radius: f64) -> ([f64; 2], f64) {
    let from = if (inner > 0.0) & (inner < reach) { inner * inner } else { 0.0 };
    let rest = if reach > 0.0 { reach * reach - from } else { 0.0 };
    let (a, b, inverse) = if radius > 0.0 { (a, b, 1.0 / radius) } else { (1.0, 0.0, 1.0) };
    let scale = (from + rest * radius * radius).sqrt() * inverse;
    ([a * scale, b * scale], std::f64::consts::PI * rest)
}

type Row = [f64; LANES];

/// Values of the nodes about the places of a block.
struct NodeRows {
    /// The direction that is the nodes' +x.
    axis: [Row; 2],
    centre: [Row; 2],
    half: [Row; 2],
    /// The inner radius and the outer one, at the sample's angle.
    radii: [Row; 2],
}

impl NodeRows {
    const NOTHING: Self = Self {
        axis: [[1.0; LANES], [0.0; LANES]],
        centre: [[0.0; LANES]; 2],
        half: [[0.0; LANES]; 2],
        radii: [[0.0; LANES]; 2],
    };

    /// Sets a lane to what two nodes have with these weights, at an angle between two of their tables.
    #[inline(always)]
    fn set(
        &mut self,
        lane: usize,
        nodes: [&PupilOutline; 2],
        weights: [f64; 2],
        angle: TableAngle,
    ) {
        let [a, b] = nodes;
        let mix = |of_a: f64, of_b: f64| of_a * weights[0] + of_b * weights[1];
        self.centre[0][lane] = mix(a.centre.x, b.centre.x);
        self.centre[1][lane] = mix(a.centre.y, b.centre.y);
        self.half[0][lane] = mix(a.half.x, b.half.x);
        self.half[1][lane] = mix(a.half.y, b.half.y);
        self.radii[0][lane] = mix(between(&a.inner, angle), between(&b.inner, angle));
        self.radii[1][lane] = mix(between(&a.reach, angle), between(&b.reach, angle));
    }

    /// Adds a node's share to a lane, at an angle between two of its table.
    #[inline(always)]
    fn add(&mut self, lane: usize, node: &PupilOutline, weight: f64, angle: TableAngle) {
        let (centre, half) = (node.centre.to_array(), node.half.to_array());
        for axis in 0..2 {
            self.centre[axis][lane] += centre[axis] * weight;
            self.half[axis][lane] += half[axis] * weight;
        }
        for (row, table) in self.radii.iter_mut().zip([&node.inner, &node.reach]) {
            row[lane] += between(table, angle) * weight;
        }
    }
}

impl ExitPupil {
    /// Refills `rays` with one ray a sample, ready to be traced from [`Side::Sensor`](crate::train::Side::Sensor), as [`Self::sample`] gives them
    /// one by one. False where it has to be asked one by one: at a mask, behind lenslets, and where no light arrives at
    /// the place of some sample.
    pub fn fill(&self, bundle: &PupilSamples<'_>, rays: &mut LensRays) -> bool {
        if self.lenslets.is_some() || self.coded.is_some() {
            return false;
        }
        rays.resize(bundle.squares.len());
        match &self.disk {
            Some(disk) => disk.fill(&self.sensor, bundle, self.index2, &mut rays.blocks),
            None => return self.fill_bounds(bundle, &mut rays.blocks),
        }
        true
    }

    /// Fills the first `count` lanes with what the nodes have that lie about places on the film; false where one lies beyond
    /// all of them.
    fn fill_nodes(
        &self,
        film: &[Row; 2],
        angles: &[TableAngle; LANES],
        count: usize,
        rows: &mut NodeRows,
    ) -> bool {
        if self.layout == NodeLayout::Radial && !self.nodes.is_empty() {
            let intervals = self.nodes.len() - 1;
            let mut places = RadialPlaces { low: [0; LANES], share: [0.0; LANES] };
            if !radial_places(film, self.radius, intervals, &mut rows.axis, &mut places) {
                return false;
            }
            for (lane, &angle) in angles[..count].iter().enumerate() {
                let (low, share) = (places.low[lane] as usize, places.share[lane]);
                let nodes = [&self.nodes[low], &self.nodes[(low + 1).min(intervals)]];
                rows.set(lane, nodes, [1.0 - share, share], angle);
            }
            return true;
        }
        for (lane, &angle) in angles[..count].iter().enumerate() {
            let place = self.place(DVec2::new(film[0][lane], film[1][lane]));
            let Some(NodePlace { axis, nodes }) = place else { return false };
            (rows.axis[0][lane], rows.axis[1][lane]) = axis.into();
            for (node, weight) in nodes.into_iter().filter(|(_, weight)| *weight != 0.0) {
                rows.add(lane, &self.nodes[node], weight, angle);
            }
        }
        true
    }

    /// Fills blocks with rays towards the bounds that were measured, a sample a ray; false where no light arrives at
    /// the place of some sample, which stays as it was.
    fn fill_bounds(&self, bundle: &PupilSamples<'_>, blocks: &mut [Block]) -> bool {
        let mut are_lit = true;
        for (number, block) in blocks.iter_mut().enumerate() {
            let first = number * LANES;
            let count = LANES.min(bundle.squares.len() - first);
            let (mut square, mut film) = ([[0.5; 2]; LANES], [[0.0; LANES]; 2]);
            square[..count].copy_from_slice(&bundle.squares[first..first + count]);
            for (row, from) in film.iter_mut().zip(bundle.film) {
                row[..count].copy_from_slice(&from[first..first + count]);
            }
            let mut rows = NodeRows::NOTHING;
            let angles = angles(&square);
            if !self.fill_nodes(&film, &angles, count, &mut rows) {
                return false;
            }
            let scale = bundle.scale * self.index2;
            aim(&rows, &self.sensor, scale, &film, &square, block);
            are_lit &= block.throughput[..count].iter().all(|weight| *weight > 0.0);
            block.outcome[..count].fill(RayStatus::Exited.code());
        }
        are_lit
    }
}

/// Places among nodes on a radius: the interval, and the share of it that is passed.
struct RadialPlaces {
    low: [u32; LANES],
    share: Row,
}

/// Places of a block among nodes at the ends of so many intervals of a radius, and their directions from the middle, as
/// [`ExitPupil::place`] finds them one by one; false where one lies beyond the last.
#[multiversion::multiversion(targets = "simd")]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "between 0 and a few dozen"
)]
fn radial_places(
    film: &[Row; 2],
    radius: f64,
    intervals: usize,
    axis: &mut [Row; 2],
    places: &mut RadialPlaces,
) -> bool {
    let (last, highest) = (intervals as f64, intervals.saturating_sub(1) as u32);
    let mut are_inside = true;
    for i in 0..LANES {
        let (x, y) = (film[0][i], film[1][i]);
        let r = (x * x + y * y).sqrt();
        let at = if radius > 0.0 { r / radius * last } else { 0.0 };
        are_inside &= is_among(at, last);
        let low = (at as u32).min(highest);
        let share = at - f64::from(low);
        let share = if share < 1.0 { share } else { 1.0 };
        (places.low[i], places.share[i]) = (low, if share > 0.0 { share } else { 0.0 });
        (axis[0][i], axis[1][i]) = if r > 0.0 { (x / r, y / r) } else { (1.0, 0.0) };
    }
    are_inside
}

/// Places in the tables of angles of the directions of a block's samples.
#[multiversion::multiversion(targets = "simd")]
fn angles(squares: &[[f64; 2]; LANES]) -> [TableAngle; LANES] {
    let mut turns = [0.0; LANES];
    for i in 0..LANES {
        (_, turns[i]) = concentric(squares[i]);
    }
    let mut angles = [TableAngle::FIRST; LANES];
    for i in 0..LANES {
        angles[i] = angle_below(turns[i]);
    }
    angles
}

/// Rays of a block towards places in their bounds, each with its weight; 0 where its bound is empty.
#[multiversion::multiversion(targets = "simd")]
fn aim(
    rows: &NodeRows,
    sensor: &Frame,
    scale: f64,
    film: &[Row; 2],
    squares: &[[f64; 2]; LANES],
    block: &mut Block,
) {
    let Frame { vertex, rotation } = *sensor;
    let (right, up, normal) = (rotation.x_axis, rotation.y_axis, rotation.z_axis);
    for i in 0..LANES {
        let [u, v] = squares[i];
        let sides = [(2.0 * u - 1.0).abs(), (2.0 * v - 1.0).abs()];
        let radius = if sides[0] > sides[1] { sides[0] } else { sides[1] };
        let point = disk::point([u, v]);
        let ([a, b], area) = spread([rows.radii[0][i], rows.radii[1][i]], point, radius);
        let (along, across) =
            (rows.centre[0][i] + a * rows.half[0][i], rows.centre[1][i] + b * rows.half[1][i]);
        let (x, y) = (rows.axis[0][i], rows.axis[1][i]);
        let slopes = [x * along - y * across, y * along + x * across];
        let inverse = 1.0 / (slopes[0] * slopes[0] + slopes[1] * slopes[1] + 1.0).sqrt();
        let (dx, dy, dz) = (slopes[0] * inverse, slopes[1] * inverse, -inverse);
        let on_sensor = (dx * normal.x + dy * normal.y + dz * normal.z).abs();
        let (half, cubed) = (rows.half[0][i] * rows.half[1][i], inverse * inverse * inverse);
        let is_open = (rows.half[0][i] > 0.0) & (rows.half[1][i] > 0.0);
        block.throughput[i] = if is_open { scale * area * half * cubed * on_sensor } else { 0.0 };
        block.direction[0][i] = dx;
        block.direction[1][i] = dy;
        block.direction[2][i] = dz;
        let (x, y) = (film[0][i], film[1][i]);
        block.position[0][i] = vertex.x + (right.x * x + up.x * y);
        block.position[1][i] = vertex.y + (right.y * x + up.y * y);
        block.position[2][i] = vertex.z + (right.z * x + up.z * y);
    }
}

/// From the unit square to the disk: radius and share of a full turn, with equal areas staying
/// equal (P. Shirley and K. Chiu, "A low distortion map between disk and square", 1997).
fn concentric(u: [f64; 2]) -> (f64, f64) {
    let [a, b] = u.map(|x| 2.0 * x - 1.0);
    if a == 0.0 && b == 0.0 {
        return (0.0, 0.0);
    }
    let (radius, eighths) = if a.abs() > b.abs() { (a, b / a) } else { (b, 2.0 - a / b) };
    let turn = eighths / 8.0 + if radius < 0.0 { 0.5 } else { 0.0 };
    (radius.abs(), if turn < 0.0 { turn + 1.0 } else { turn })
}

#[cfg(test)]
mod tests {
    use super::concentric;

    #[test]
    fn the_map_from_the_square_keeps_areas_and_neighbours() {
        let mut inside = 0;
        for i in 0..10_000 {
            let u = [f64::from(i % 100) / 100.0 + 0.005, f64::from(i / 100) / 100.0 + 0.005];
            let (radius, turn) = concentric(u);
            assert!((0.0..=1.0).contains(&radius) && (0.0..1.0).contains(&turn));
            inside += u32::from(radius <= 0.5);
        }
        assert_eq!(inside, 2500, "a quarter of the disk's area is a quarter of the square's");
        assert_eq!(concentric([0.5, 0.5]), (0.0, 0.0));
        assert_eq!(concentric([1.0, 0.5]), (1.0, 0.0));
        assert_eq!(concentric([0.5, 1.0]), (1.0, 0.25));
        assert_eq!(concentric([0.0, 0.5]), (1.0, 0.5));
    }
}
