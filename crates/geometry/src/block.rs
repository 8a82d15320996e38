//! Rays in blocks of sixteen: in single precision as Embree's packets have them, or in double precision. Light is traced
//! in these.

use glam::DVec3;

use crate::batch::MISS;
use crate::float::Float;

/// Rays of a block.
pub const LANES: usize = 16;

/// One number of each ray of a block.
pub type Floats<F = f32> = [F; LANES];

/// One index of each ray of a block.
pub type Indices = [u32; LANES];

/// Sixteen rays and what they hit, in single precision in the order of Embree's `RTCRayHit16`, so that they can be handed
/// over as they are. Origins are relative to what the accelerator says (m), directions are unit vectors.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub struct RayBlock<F = f32> {
    /// Origins (m), one array an axis.
    pub origin: [Floats<F>; 3],
    /// Nearest distances that count (m).
    pub t_min: Floats<F>,
    /// Unit directions, one array an axis.
    pub direction: [Floats<F>; 3],
    /// Embree's time of each ray: 0, for its structures stand still.
    pub time: Floats,
    /// Farthest distances that count (m): nothing is traced where this is not above 0. A closest hit puts its
    /// distance here, occlusion puts −∞.
    pub t_max: Floats<F>,
    /// Embree's mask of each ray: all bits.
    pub mask: Indices,
    /// Embree's number of each ray, which nothing reads.
    pub id: Indices,
    /// Embree's flags of each ray: 0.
    pub flags: Indices,
    /// Normals of the triangles that were hit, of any length, on their front; one array an axis.
    pub normal: [Floats<F>; 3],
    /// Barycentric weights of their second corners.
    pub u: Floats<F>,
    /// Barycentric weights of their third corners.
    pub v: Floats<F>,
    /// Triangles in their meshes, or [`MISS`].
    pub triangle: Indices,
    /// Placements, or [`MISS`].
    pub placement: Indices,
    /// Embree's instances.
    pub instance: Indices,
    /// Embree's numbers of primitives of instances, which not every version has.
    pub instance_primitive: Indices,
}

/// The vector of a lane of three arrays, one an axis.
#[must_use]
#[inline(always)]
pub fn vector<F: Float>(axes: &[Floats<F>; 3], lane: usize) -> DVec3 {
    let [x, y, z] = axes;
    DVec3::new(x[lane].into(), y[lane].into(), z[lane].into())
}

/// As many numbers of a column as a block has lanes, from `start` on; those behind its end are the type's default. (A copy
/// between slices is a call where the function has more instructions than the standard library.)
#[must_use]
#[inline(always)]
#[expect(
    clippy::manual_memcpy,
    reason = "a copy between slices is a call, where instructions differ"
)]
pub fn lanes<T: Copy + Default>(column: &[T], start: usize) -> [T; LANES] {
    let mut row = [T::default(); LANES];
    if let Some(own) = column.get(start..start + LANES) {
        for i in 0..LANES {
            row[i] = own[i];
        }
    } else if let Some(rest) = column.get(start..) {
        for (to, from) in row.iter_mut().zip(rest) {
            *to = *from;
        }
    }
    row
}

impl<F: Float> RayBlock<F> {
    /// A block of which no ray is traced.
    pub const EMPTY: Self = Self {
        origin: [[F::ZERO; LANES]; 3],
        t_min: [F::ZERO; LANES],
        direction: [[F::ZERO; LANES]; 3],
        time: [0.0; LANES],
        t_max: [F::ZERO; LANES],
        mask: [u32::MAX; LANES],
        id: [0; LANES],
        flags: [0; LANES],
        normal: [[F::ZERO; LANES]; 3],
        u: [F::ZERO; LANES],
        v: [F::ZERO; LANES],
        triangle: [MISS; LANES],
        placement: [MISS; LANES],
        instance: [MISS; LANES],
        instance_primitive: [MISS; LANES],
    };

    /// Forgets what was hit.
    #[inline]
    pub fn clear_hits(&mut self) {
        self.triangle = [MISS; LANES];
        self.placement = [MISS; LANES];
        self.instance = [MISS; LANES];
    }

    /// Sets the ray of a lane, and what it hit, to those of lane `of` of another block.
    #[inline]
    pub fn copy_hit(&mut self, lane: usize, other: &Self, of: usize) {
        for axis in 0..3 {
            self.origin[axis][lane] = other.origin[axis][of];
            self.direction[axis][lane] = other.direction[axis][of];
            self.normal[axis][lane] = other.normal[axis][of];
        }
        self.t_max[lane] = other.t_max[of];
        (self.u[lane], self.v[lane]) = (other.u[of], other.v[of]);
        (self.triangle[lane], self.placement[lane]) = (other.triangle[of], other.placement[of]);
    }

    /// True if anything is between the ends of a ray, once occlusion was asked for.
    #[must_use]
    #[inline]
    pub fn is_blocked(&self, lane: usize) -> bool {
        self.t_max[lane] == -F::INFINITY
    }
}

/// Rays side by side in blocks, without gaps. Memory is kept.
#[derive(Debug, Clone, Default)]
pub struct RayBlocks<F = f32> {
    blocks: Vec<RayBlock<F>>,
    len: usize,
}

impl<F: Float> RayBlocks<F> {
    /// Removes all rays.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// Number of rays.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// True if there are no rays.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The blocks that have rays.
    #[must_use]
    pub fn blocks(&self) -> &[RayBlock<F>] {
        &self.blocks[..self.len.div_ceil(LANES)]
    }

    /// The blocks that have rays, to be traced.
    pub fn blocks_mut(&mut self) -> &mut [RayBlock<F>] {
        &mut self.blocks[..self.len.div_ceil(LANES)]
    }

    /// Makes them `len` rays, which `fill` sets: a block at a time, with the number of its first ray and how many
    /// there are. Other lanes are not traced.
    pub fn refill(&mut self, len: usize, mut fill: impl FnMut(&mut RayBlock<F>, usize, usize)) {
        self.reset(len);
        for (block, start) in self.blocks_mut().iter_mut().zip((0..).step_by(LANES)) {
            fill(block, start, LANES.min(len - start));
        }
    }

    /// Makes them `len` rays, which are to be set: until then none is traced.
    pub fn reset(&mut self, len: usize) {
        let count = len.div_ceil(LANES);
        if self.blocks.len() < count {
            self.blocks.resize(count, RayBlock::EMPTY);
        }
        self.len = len;
        for block in self.blocks_mut() {
            block.t_min = [F::ZERO; LANES];
            block.t_max = [F::ZERO; LANES];
        }
    }

    /// Appends a ray from `origin` (m) along the unit `direction` that counts hits from 0 to `t_max` (m).
    #[inline(always)]
    pub fn push(&mut self, origin: [F; 3], direction: [F; 3], t_max: F) {
        let (number, lane) = (self.len / LANES, self.len % LANES);
        if lane == 0 {
            if number == self.blocks.len() {
                self.blocks.push(RayBlock::EMPTY);
            }
            let block = &mut self.blocks[number];
            block.t_min = [F::ZERO; LANES];
            block.t_max = [F::ZERO; LANES];
        }
        let block = &mut self.blocks[number];
        for axis in 0..3 {
            block.origin[axis][lane] = origin[axis];
            block.direction[axis][lane] = direction[axis];
        }
        block.t_max[lane] = t_max;
        self.len += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_that_no_ray_has_are_not_traced() {
        let mut rays = RayBlocks::default();
        for _ in 0..2 {
            rays.clear();
            for k in 0..LANES + 3 {
                rays.push([0.5; 3], [0.0, 0.0, 1.0], 1.0 + k as f32);
            }
            let mut refilled = rays.clone();
            refilled.refill(LANES + 3, |block, start, count| {
                for lane in 0..count {
                    block.t_max[lane] = 1.0 + (start + lane) as f32;
                }
            });
            for rays in [&rays, &refilled] {
                let [whole, rest] = rays.blocks() else { panic!("two blocks") };
                assert!(whole.t_max.iter().all(|&t_max| t_max > 0.0));
                assert_eq!(rest.t_max.iter().filter(|&&t_max| t_max > 0.0).count(), 3);
                assert_eq!((rest.t_min[2], rest.t_max[2]), (0.0, 19.0));
                assert_eq!(rays.len(), 19);
            }
        }
        assert!(!rays.is_empty() && !rays.blocks()[0].is_blocked(0));
    }
}
