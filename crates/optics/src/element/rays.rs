//! Rays inside a lens: a structure of arrays in blocks of a few vector registers, and what became
//! of each ray.

use glam::{DMat3, DVec3};

use super::real::Real;

/// Rays of one block. A block is 2 kB and stays in the first-level cache from the first element to
/// the last.
pub const LANES: usize = 32;

/// Outcome of a ray. Elements count from 0 on the object side.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RayStatus {
    /// It left the train.
    Exited,
    /// It does not meet the element, or its image by a thin lens is not in front of it.
    Missed {
        /// Index of the element.
        element: usize,
    },
    /// It met the element's surface from the denser side at too small an angle.
    TotalInternalReflection {
        /// Index of the element.
        element: usize,
    },
    /// It met the element where it is opaque: outside its clear aperture.
    Vignetted {
        /// Index of the element.
        element: usize,
    },
}

const EXITED: u64 = 0;
const MISSED: u64 = 1 << 32;
const REFLECTED: u64 = 2 << 32;
const VIGNETTED: u64 = 3 << 32;
const IDLE: u64 = 4 << 32;
/// Left by a vector kernel for the scalar one to decide; never seen outside of a trace.
pub(crate) const PENDING: u64 = 5 << 32;

impl RayStatus {
    /// The element at which the ray ended; `None` when it left.
    #[must_use]
    pub fn element(self) -> Option<usize> {
        match self {
            Self::Exited => None,
            Self::Missed { element }
            | Self::TotalInternalReflection { element }
            | Self::Vignetted { element } => Some(element),
        }
    }

    pub(crate) fn code(self) -> u64 {
        match self {
            Self::Exited => EXITED,
            Self::Missed { element } => MISSED | element as u64,
            Self::TotalInternalReflection { element } => REFLECTED | element as u64,
            Self::Vignetted { element } => VIGNETTED | element as u64,
        }
    }

    fn from_code(code: u64) -> Self {
        let element = (code & 0xffff_ffff) as usize;
        match code & !0xffff_ffff {
            EXITED => Self::Exited,
            REFLECTED => Self::TotalInternalReflection { element },
            VIGNETTED => Self::Vignetted { element },
            _ => Self::Missed { element },
        }
    }
}

/// Counts of rays by their outcome.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct StatusCounts {
    /// Rays that left the train.
    pub exited: u64,
    /// Rays that missed element `i`.
    pub missed: Vec<u64>,
    /// Rays totally reflected at element `i`.
    pub reflected: Vec<u64>,
    /// Rays stopped by element `i`.
    pub vignetted: Vec<u64>,
    /// Rays that were not begun: no light reaches their place on the sensor.
    pub unlit: u64,
}

impl StatusCounts {
    /// Counts for a train of `elements` elements, all 0.
    #[must_use]
    pub fn new(elements: usize) -> Self {
        let zeros = || vec![0; elements];
        Self { missed: zeros(), reflected: zeros(), vignetted: zeros(), ..Self::default() }
    }

    /// Counts one ray.
    pub fn add(&mut self, status: RayStatus) {
        let (counts, element) = match status {
            RayStatus::Exited => {
                self.exited += 1;
                return;
            }
            RayStatus::Missed { element } => (&mut self.missed, element),
            RayStatus::TotalInternalReflection { element } => (&mut self.reflected, element),
            RayStatus::Vignetted { element } => (&mut self.vignetted, element),
        };
        if counts.len() <= element {
            counts.resize(element + 1, 0);
        }
        counts[element] += 1;
    }

    /// Counts every ray of a batch.
    pub fn add_all(&mut self, rays: &LensRays) {
        for (b, block) in rays.blocks.iter().enumerate() {
            let outcomes = &block.outcome[..LANES.min(rays.len() - b * LANES)];
            if outcomes.iter().all(|&code| code == EXITED) {
                self.exited += outcomes.len() as u64;
            } else {
                outcomes.iter().for_each(|&code| self.add(RayStatus::from_code(code)));
            }
        }
    }

    /// Adds what was counted elsewhere.
    pub fn merge(&mut self, other: &Self) {
        self.exited += other.exited;
        self.unlit += other.unlit;
        for (counts, others) in [
            (&mut self.missed, &other.missed),
            (&mut self.reflected, &other.reflected),
            (&mut self.vignetted, &other.vignetted),
        ] {
            if counts.len() < others.len() {
                counts.resize(others.len(), 0);
            }
            counts.iter_mut().zip(others).for_each(|(count, other)| *count += other);
        }
    }

    /// All rays.
    #[must_use]
    pub fn total(&self) -> u64 {
        let lost = self.missed.iter().chain(&self.reflected).chain(&self.vignetted);
        self.exited + self.unlit + lost.sum::<u64>()
    }

    /// The element nearest to the object at which rays ended: when rays come from the sensor and
    /// none leaves, the one that nothing gets past. `None` when no ray ended.
    #[must_use]
    pub fn farthest_from_sensor(&self) -> Option<usize> {
        let lost = |counts: &[u64]| counts.iter().position(|&count| count > 0);
        [&self.missed, &self.reflected, &self.vignetted].into_iter().filter_map(|c| lost(c)).min()
    }

    /// Losses by cause and element, as `vignetted at element 3: 12 %`, the greatest loss first.
    #[must_use]
    pub fn losses(&self) -> Vec<String> {
        let ways = [
            ("vignetted at", &self.vignetted),
            ("missed", &self.missed),
            ("totally reflected at", &self.reflected),
        ];
        #[expect(clippy::cast_precision_loss, reason = "a percentage to read")]
        let percent = |count: u64| 100.0 * count as f64 / self.total() as f64;
        let mut losses: Vec<(u64, String)> = Vec::new();
        for (way, counts) in ways {
            for (element, &count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
                losses.push((count, format!("{way} element {element}: {:.3} %", percent(count))));
            }
        }
        if self.unlit > 0 {
            let text = format!("outside of the image circle: {:.3} %", percent(self.unlit));
            losses.push((self.unlit, text));
        }
        losses.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
        losses.into_iter().map(|(_, text)| text).collect()
    }
}

/// Rays by axis; `[[f64; LANES]; 3]` is one array an axis. Lengths in mm.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub struct Block {
    /// Places (mm), one array an axis.
    pub position: [[f64; LANES]; 3],
    /// Unit directions, one array an axis.
    pub direction: [[f64; LANES]; 3],
    /// Share of the light that is left (0..=1).
    pub throughput: [f64; LANES],
    pub(crate) outcome: [u64; LANES],
}

impl Block {
    /// True if the ray in `lane` left the train with a throughput above 0.
    pub fn is_bright_at(&self, lane: usize) -> bool {
        self.outcome[lane] == EXITED && self.throughput[lane] > 0.0
    }

    /// True if each of the first `count` rays left the train with a throughput above 0.
    pub fn is_bright(&self, count: usize) -> bool {
        let lanes = self.outcome[..count].iter().zip(&self.throughput[..count]);
        lanes.fold(true, |all, (&code, &throughput)| all & (code == EXITED) & (throughput > 0.0))
    }

    /// True if every ray has ended.
    #[inline(always)]
    pub(crate) fn is_over(&self) -> bool {
        self.outcome.iter().fold(true, |all, &code| all & (code != EXITED))
    }

    const EMPTY: Self = Self {
        position: [[0.0; LANES]; 3],
        direction: [[0.0; LANES]; 3],
        throughput: [0.0; LANES],
        outcome: [IDLE; LANES],
    };

    #[inline(always)]
    pub(crate) fn ray(&self, lane: usize) -> Ray {
        Ray { position: at_lane(&self.position, lane), direction: at_lane(&self.direction, lane) }
    }

    #[inline(always)]
    pub(crate) fn set_ray(&mut self, lane: usize, ray: Ray) {
        for axis in 0..3 {
            self.position[axis][lane] = ray.position[axis];
            self.direction[axis][lane] = ray.direction[axis];
        }
    }
}

/// One lane of three arrays; `map` would copy the arrays and keep loops from being vectorised.
#[inline(always)]
pub(crate) fn at_lane<const N: usize>(axes: &[[f64; N]; 3], lane: usize) -> [f64; 3] {
    [axes[0][lane], axes[1][lane], axes[2][lane]]
}

/// A vector by a matrix.
#[inline(always)]
pub(super) fn turned<T: Real>(matrix: &DMat3, [x, y, z]: [T; 3]) -> [T; 3] {
    let columns = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
    std::array::from_fn(|i| {
        x.times(columns[0][i]) + y.times(columns[1][i]) + z.times(columns[2][i])
    })
}

/// A place moved by a vector.
#[inline(always)]
pub(super) fn moved<T: Real>([x, y, z]: [T; 3], by: DVec3) -> [T; 3] {
    [x.plus(by.x), y.plus(by.y), z.plus(by.z)]
}

/// Nothing is farther (mm): squares of more overflow, and sums of them are no numbers.
const FARTHEST: f64 = 1e150;

/// One ray (mm), by components so that vector kernels see plain numbers.
#[derive(Debug, Clone, Copy)]
pub struct Ray<T = f64> {
    /// Place (mm).
    pub position: [T; 3],
    /// Unit direction.
    pub direction: [T; 3],
}

impl Ray {
    /// With a direction of any length but 0; `None` unless all numbers are finite and the ray starts
    /// within `1e150`.
    pub fn new(position: DVec3, direction: DVec3) -> Option<Self> {
        if !position.is_finite() || position.abs().max_element() > FARTHEST {
            return None;
        }
        // Within a rounding or two of 1 there is nothing to scale.
        if (direction.length_squared() - 1.0).abs() < 1e-15 {
            return Some(Self { position: position.into(), direction: direction.into() });
        }
        // Squares overflow or lose digits long before the direction does.
        let ordinary = (1e-100..1e100).contains(&direction.length_squared());
        let scale = if ordinary { 1.0 } else { direction.abs().max_element() };
        let unit = (direction / scale).try_normalize()?;
        let ray = Self { position: position.to_array(), direction: unit.to_array() };
        unit.is_finite().then_some(ray)
    }
}

impl<T: Real> Ray<T> {
    /// The ray without derivatives.
    pub(crate) fn value(self) -> Ray {
        let values = |axes: [T; 3]| axes.map(T::value);
        Ray { position: values(self.position), direction: values(self.direction) }
    }

    /// The ray `distance` further on.
    #[inline(always)]
    pub(crate) fn advanced(self, distance: T) -> Self {
        let Self { position: [x, y, z], direction: [u, v, w] } = self;
        Self { position: [x + distance * u, y + distance * v, z + distance * w], ..self }
    }

    /// The ray with its direction, which is nearly a unit vector, brought nearer by a step of Newton's
    /// for 1/√; to the last bit as it is where only roundings set them apart.
    #[inline(always)]
    pub(crate) fn unit(self) -> Self {
        const ROUNDINGS: f64 = 1e-14;
        let [u, v, w] = self.direction;
        let one = T::constant(1.0);
        let off = u * u + v * v + w * w - one;
        let is_off = off.value().abs() > ROUNDINGS;
        let scale = if is_off { one - off.times(0.5) } else { one };
        Self { direction: [u * scale, v * scale, w * scale], ..self }
    }
}

/// A batch of rays in lens coordinates: millimetres, z = 0 at the first element's vertex, +z from
/// the object to the sensor.
#[derive(Debug, Clone, Default)]
pub struct LensRays {
    pub(crate) blocks: Vec<Block>,
    len: usize,
}

impl LensRays {
    /// An empty batch with room for `capacity` rays.
    #[must_use]
    pub fn with_capacity(capacity: usize) -> Self {
        Self { blocks: Vec::with_capacity(capacity.div_ceil(LANES)), len: 0 }
    }

    /// The number of rays.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// True if there are no rays.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Removes all rays and keeps the memory.
    pub fn clear(&mut self) {
        self.blocks.clear();
        self.len = 0;
    }

    /// Makes the rays those of another batch, and keeps the memory.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.blocks.clone_from(&other.blocks);
        self.len = other.len;
    }

    /// Makes room for `len` rays, all of them to be set.
    pub(crate) fn resize(&mut self, len: usize) {
        // Lanes of the last block that are no rays are idle.
        self.blocks.truncate(len / LANES);
        self.blocks.resize(len.div_ceil(LANES), Block::EMPTY);
        self.len = len;
    }

    /// Appends a ray of throughput 1. A direction of another length is scaled to 1; a ray that has
    /// no direction or no finite place counts as having missed element 0.
    pub fn push(&mut self, position: DVec3, direction: DVec3) {
        self.push_weighted(position, direction, 1.0);
    }

    /// Appends a ray of the given throughput, as [`Self::push`] does.
    pub fn push_weighted(&mut self, position: DVec3, direction: DVec3, throughput: f64) {
        let ray = Ray::new(position, direction);
        self.push_ray(ray, throughput);
    }

    pub(crate) fn push_ray(&mut self, ray: Option<Ray>, throughput: f64) {
        let lane = self.len % LANES;
        if lane == 0 {
            self.blocks.push(Block::EMPTY);
        }
        let last = self.blocks.len() - 1;
        let block = &mut self.blocks[last];
        match ray {
            Some(ray) => {
                block.set_ray(lane, ray);
                block.outcome[lane] = EXITED;
            }
            None => block.outcome[lane] = RayStatus::Missed { element: 0 }.code(),
        }
        block.throughput[lane] = throughput;
        self.len += 1;
    }

    /// The block that begins with ray `start`, and how many of its lanes are rays.
    pub fn block_at(&self, start: usize) -> (&Block, usize) {
        (&self.blocks[start / LANES], LANES.min(self.len - start))
    }

    /// Position of ray `i` (mm), at the last refracting element that it reached.
    #[must_use]
    pub fn position(&self, i: usize) -> DVec3 {
        at_lane(&self.blocks[i / LANES].position, i % LANES).into()
    }

    /// Direction of ray `i`, a unit vector.
    #[must_use]
    pub fn direction(&self, i: usize) -> DVec3 {
        at_lane(&self.blocks[i / LANES].direction, i % LANES).into()
    }

    /// Share of its radiance that ray `i` keeps, times the weight that it was given.
    #[must_use]
    pub fn throughput(&self, i: usize) -> f64 {
        self.blocks[i / LANES].throughput[i % LANES]
    }

    /// Outcome of ray `i`; [`RayStatus::Exited`] as long as nothing ended it.
    #[must_use]
    pub fn status(&self, i: usize) -> RayStatus {
        RayStatus::from_code(self.blocks[i / LANES].outcome[i % LANES])
    }

    /// Ends ray `i` in the given way; [`RayStatus::Exited`] revives it.
    pub fn set_status(&mut self, i: usize, status: RayStatus) {
        self.blocks[i / LANES].outcome[i % LANES] = status.code();
    }

    /// The sum of the throughputs of the rays that left.
    #[must_use]
    pub fn passed_throughput(&self) -> f64 {
        let lanes = self.blocks.iter().flat_map(|b| b.outcome.iter().zip(&b.throughput));
        lanes.filter(|(code, _)| **code == EXITED).map(|(_, throughput)| throughput).sum::<f64>()
            + 0.0
    }

    /// Number of rays that left the train.
    #[must_use]
    pub fn exited(&self) -> usize {
        self.blocks.iter().flat_map(|b| b.outcome).filter(|&code| code == EXITED).count()
    }
}

/// Clipping of rays by clear apertures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Clip {
    /// Semi-diameters, apertures and opaque parts of filters end a ray.
    #[default]
    On,
    /// Only missed surfaces and total reflection end a ray.
    Off,
}

/// Outcome of a single ray at an element.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Traversal {
    pub(crate) status: RayStatus,
    /// The ray as it goes on; as it came unless [`RayStatus::Exited`].
    pub(crate) ray: Ray,
    /// Point where the ray met the element, in lens coordinates; `None` when it missed.
    pub(crate) point: Option<[f64; 3]>,
    /// The share of light that goes on.
    pub(crate) transmission: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_come_back_as_they_went_in_across_blocks() {
        let mut rays = LensRays::with_capacity(3);
        for i in 0..LANES + 3 {
            rays.push(DVec3::new(i as f64, 1.0, 2.0), DVec3::new(0.0, 0.0, 1.0 + i as f64));
        }
        assert_eq!((rays.len(), rays.exited()), (LANES + 3, LANES + 3));
        assert_eq!(rays.position(LANES + 1), DVec3::new(33.0, 1.0, 2.0));
        assert_eq!(rays.direction(7), DVec3::Z);
        rays.set_status(33, RayStatus::Vignetted { element: 4 });
        rays.set_status(34, RayStatus::TotalInternalReflection { element: 70_000 });
        assert_eq!(rays.status(33), RayStatus::Vignetted { element: 4 });
        assert_eq!(rays.status(34), RayStatus::TotalInternalReflection { element: 70_000 });
        let mut counts = StatusCounts::new(5);
        counts.add_all(&rays);
        assert_eq!((counts.exited, counts.total()), (33, 35));
        assert_eq!(counts.losses()[0], "vignetted at element 4: 2.857 %");
    }

    #[test]
    fn what_is_no_ray_is_dead_and_holds_no_nan() {
        let mut rays = LensRays::default();
        rays.push(DVec3::NAN, DVec3::Z);
        rays.push(DVec3::ZERO, DVec3::ZERO);
        rays.push(DVec3::ZERO, DVec3::new(0.0, f64::INFINITY, 1.0));
        for i in 0..3 {
            assert_eq!(rays.status(i), RayStatus::Missed { element: 0 });
            assert!(rays.position(i).is_finite() && rays.direction(i).is_finite());
        }
        rays.push(DVec3::ZERO, DVec3::new(0.0, 3e-300, 4e-300));
        assert!((rays.direction(3) - DVec3::new(0.0, 0.6, 0.8)).length() < 1e-15);
    }
}
