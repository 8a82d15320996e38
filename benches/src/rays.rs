//! The rays that are traced, in batches of [`BATCH`] as a render has them.

use etendue_accel::Accel;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Detail, Geometry, HitBatch, RayBatch};

use crate::meshes::Random;

/// Rays in a batch: the pixels of a tile, 16 × 16.
pub const BATCH: usize = 256;

/// Columns and rows of the picture.
pub const SIDE: u32 = 1024;

/// Rays a pixel of [`View::samples`]: a packet's worth.
pub const SAMPLES: u32 = 16;

/// Of how many tiles [`View::samples`] takes one, so that it has as many rays as [`View::primary`].
const TILES_PER_SAMPLED: u32 = 16;

/// A pinhole camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Place where it stands (m).
    pub from: DVec3,
    /// Point that it looks at (m).
    pub look_at: DVec3,
    /// Full vertical field of view (degrees).
    pub fov: f64,
}

impl View {
    /// All of `bounds`, from two diagonals away, a little from the side and above.
    #[must_use]
    pub fn framing(bounds: Bounds) -> Self {
        let direction = DVec3::new(1.5, 1.15, 3.6).normalize();
        let from = bounds.centre() + direction * (2.0 * bounds.diagonal());
        // A blob fills three quarters of the picture so.
        Self { from, look_at: bounds.centre(), fov: 17.0 }
    }

    /// Over the tree tops to the horizon, which takes up the upper third.
    #[must_use]
    pub fn over_forest() -> Self {
        let from = DVec3::new(0.0, 12.0, 0.0);
        Self { from, look_at: from + DVec3::new(1.0, -0.2, 0.4), fov: 50.0 }
    }

    /// The unit direction through a place in the picture (pixels from its upper left corner).
    fn direction(&self, column: f64, row: f64) -> DVec3 {
        let back = (self.from - self.look_at).normalize();
        let right = DVec3::Y.cross(back).normalize();
        let up = back.cross(right);
        let half = f64::from(SIDE) / 2.0;
        let scale = (self.fov.to_radians() / 2.0).tan() / half;
        let (x, y) = ((column - half) * scale, (half - row) * scale);
        (right * x + up * y - back).normalize()
    }

    /// One ray a pixel: tiles of 16 × 16 pixels, each in 16 blocks of 4 × 4, so that 16 rays in a row
    /// are a block.
    #[must_use]
    pub fn primary(&self) -> Vec<RayBatch> {
        tiles()
            .map(|(left, top)| {
                let mut rays = coherent();
                for (x, y) in pixels(left, top) {
                    rays.push(self.from, self.direction(f64::from(x) + 0.5, f64::from(y) + 0.5));
                }
                rays
            })
            .collect()
    }

    /// [`SAMPLES`] jittered rays a pixel, those of one pixel side by side, for every sixteenth tile.
    #[must_use]
    pub fn samples(&self) -> Vec<RayBatch> {
        let mut random = Random::new(3);
        let mut batches = Vec::new();
        for (index, (left, top)) in (0u32..).zip(tiles()) {
            // A diagonal pattern, so that all parts of the picture have their share.
            let row = index / (SIDE / 16);
            if !(index + 5 * row).is_multiple_of(TILES_PER_SAMPLED) {
                continue;
            }
            let mut rays = coherent();
            for (x, y) in pixels(left, top) {
                for sample in 0..SAMPLES {
                    let [u, v] = [sample % 4, sample / 4].map(f64::from);
                    let column = f64::from(x) + (u + random.unit()) / 4.0;
                    let row = f64::from(y) + (v + random.unit()) / 4.0;
                    rays.push(self.from, self.direction(column, row));
                }
                if rays.len() == BATCH {
                    batches.push(std::mem::replace(&mut rays, coherent()));
                }
            }
        }
        batches
    }
}

fn coherent() -> RayBatch {
    RayBatch::with_capacity(BATCH).with_coherence(true)
}

/// The upper left corners of all tiles.
fn tiles() -> impl Iterator<Item = (u32, u32)> {
    (0..SIDE).step_by(16).flat_map(|top| (0..SIDE).step_by(16).map(move |left| (left, top)))
}

/// The pixels of a tile, block by block.
fn pixels(left: u32, top: u32) -> impl Iterator<Item = (u32, u32)> {
    (0..256).map(move |k| {
        let (block, pixel) = (k / 16, k % 16);
        (left + block % 4 * 4 + pixel % 4, top + block / 4 * 4 + pixel / 4)
    })
}

/// `count` rays from anywhere on the sphere around `bounds` to anywhere in it; neighbours in a batch
/// have nothing to do with each other.
#[must_use]
pub fn incoherent(bounds: Bounds, count: usize) -> Vec<RayBatch> {
    let (centre, radius) = (bounds.centre(), bounds.diagonal() / 2.0);
    let mut random = Random::new(1);
    let batch = |_| {
        let mut rays = RayBatch::with_capacity(BATCH);
        for _ in 0..BATCH {
            let from = random.direction() * radius;
            let to = random.in_ball() * radius;
            rays.push(centre + from, (to - from).normalize());
        }
        rays
    };
    (0..count / BATCH).map(batch).collect()
}

/// From each hit of `primary` towards a lamp: shadow rays, as coherent as what they start from.
#[must_use]
pub fn occlusion(accel: &dyn Accel, geometry: &Geometry, primary: &[RayBatch]) -> Vec<RayBatch> {
    let bounds = geometry.loose_bounds();
    let lamp = bounds.centre() + bounds.diagonal() * DVec3::new(-0.6, 1.0, 0.5);
    // Well clear of the surface, and not so far that it matters.
    let clear = 1e-4 * bounds.diagonal();
    let mut hits = HitBatch::new(Detail::Distance);
    let mut batches = vec![coherent()];
    for rays in primary {
        accel.closest(rays, &mut hits);
        for i in (0..rays.len()).filter(|&i| hits.is_hit(i)) {
            let from = rays.origin(i) + rays.direction(i) * hits.t[i];
            let way = lamp - from;
            let length = way.length();
            if batches.last().is_none_or(|batch| batch.len() == BATCH) {
                batches.push(coherent());
            }
            if let Some(batch) = batches.last_mut() {
                batch.push_between(from, way / length, clear, length);
            }
        }
    }
    batches.retain(|batch| batch.len() == BATCH);
    batches
}

/// The same rays, to be traced one by one.
#[must_use]
pub fn one_by_one(batches: &[RayBatch]) -> Vec<RayBatch> {
    batches.iter().map(|rays| rays.clone().with_coherence(false)).collect()
}
