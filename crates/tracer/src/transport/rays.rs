//! Rays under way with what they hit, as accelerators take them: in [blocks](Blocks) of single precision where there
//! are such, in [batches](Batch) of either precision else. The tracer is one for both.

use std::fmt::Debug;
use std::ops::Range;

use etendue_geometry::block::{LANES as BLOCK, vector};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{
    Detail, HitBatch, HitPrecision, PlacedTriangle, RayBatch, RayBlock, RayBlocks,
};

use super::patch::{BESIDE, Patch, put};
use super::{LightingContext, kernels};
use crate::LANES;

/// Hit of a ray.
#[derive(Debug, Clone, Copy)]
pub(super) struct RayHit {
    /// Placement and triangle.
    pub(super) id: PlacedTriangle,
    /// Of the second and the third corner.
    pub(super) weights: [f64; 2],
    /// From where the ray starts (m).
    pub(super) t: f64,
    /// Of the triangle (unit), on its front.
    pub(super) normal: DVec3,
    /// Time (s from the frame's time).
    pub(super) time: f64,
}

/// Rays with what they hit. Memory is kept.
pub(super) trait Rays: Debug + Default {
    /// Removes all rays, and makes ready for those that leave surfaces of a scene.
    fn restart(&mut self, ctx: &LightingContext<'_>);

    /// Takes the camera's rays.
    fn take(&mut self, ctx: &LightingContext<'_>, rays: &RayBatch);

    /// Appends a ray that counts hits as far as `reach` (m), which leaves the first of `ends` and ends on the second,
    /// if that counts.
    fn push(&mut self, ray: [DVec3; 2], reach: f64, ends: impl FnOnce() -> [PlacedTriangle; 2]);

    /// Says when each ray is (s from the frame's time).
    fn set_times(&mut self, times: impl Iterator<Item = f64>);

    /// Finds the closest hit of each.
    fn closest(&mut self, ctx: &LightingContext<'_>, coherent: bool);

    /// Finds whether anything is between the ends of each.
    fn occlude(&mut self, ctx: &LightingContext<'_>, coherent: bool);

    /// Returns true if there is anything between the ends of a ray, of which that was asked.
    fn is_blocked(&self, i: usize) -> bool;

    /// Number of rays.
    fn len(&self) -> usize;

    /// Start of a ray (m), which may be nearer to the scene than its camera.
    fn origin(&self, i: usize) -> DVec3;

    /// Its unit direction.
    fn direction(&self, i: usize) -> DVec3;

    /// Length of a ray that hit nothing (m).
    fn reach(&self, i: usize) -> f64;

    /// Distance from its start at which a ray hit (m).
    fn t(&self, i: usize) -> f64;

    /// The placement that it hit, or [`MISS`](etendue_geometry::MISS).
    fn placement(&self, i: usize) -> u32;

    /// Refills `placements` with the same of all rays.
    fn placements(&self, placements: &mut Vec<u32>);

    /// The placement's triangle that it hit.
    fn triangle(&self, i: usize) -> PlacedTriangle;

    /// Hit of ray `i`.
    fn hit(&self, i: usize) -> RayHit;

    /// Sets a patch to the hits of a run of rays.
    fn unpack_run(&self, patch: &mut Patch, run: Range<usize>);

    /// Sets a patch to the hits of the `picked` rays, side by side.
    fn unpack_picked(
        &self,
        patch: &mut Patch,
        side_by_side: &mut Vec<RayBlock>,
        picked: impl Iterator<Item = usize>,
    );
}

/// Rays in blocks of sixteen, in single precision.
#[derive(Debug, Default)]
pub(super) struct Blocks {
    rays: RayBlocks,
    /// Origin that coordinates are relative to (m).
    origin: DVec3,
    /// Time of each ray (s from the frame's time), where that counts.
    times: Vec<f64>,
    has_times: bool,
}

impl Blocks {
    #[inline(always)]
    fn at(&self, i: usize) -> (&RayBlock, usize) {
        (&self.rays.blocks()[i / BLOCK], i % BLOCK)
    }
}

impl Rays for Blocks {
    fn restart(&mut self, ctx: &LightingContext<'_>) {
        self.rays.clear();
        self.times.clear();
        let blocks = ctx.accel.blocks();
        self.origin = blocks.map_or(DVec3::ZERO, |blocks| blocks.origin());
        self.has_times = blocks.is_some_and(|blocks| blocks.has_times());
    }

    fn take(&mut self, ctx: &LightingContext<'_>, rays: &RayBatch) {
        self.restart(ctx);
        if let Some(blocks) = ctx.accel.blocks() {
            blocks.convert(rays, &mut self.rays);
        }
    }

    #[inline(always)]
    fn push(
        &mut self,
        [start, along]: [DVec3; 2],
        reach: f64,
        _ends: impl FnOnce() -> [PlacedTriangle; 2],
    ) {
        let round = |v: DVec3| [v.x, v.y, v.z].map(single);
        self.rays.push(round(start - self.origin), round(along), single(reach));
    }

    fn set_times(&mut self, times: impl Iterator<Item = f64>) {
        self.times.clear();
        self.times.extend(times.filter(|_| self.has_times));
    }

    fn closest(&mut self, ctx: &LightingContext<'_>, coherent: bool) {
        if let Some(blocks) = ctx.accel.blocks() {
            blocks.closest_of_blocks(self.rays.blocks_mut(), &self.times, coherent);
        }
    }

    fn occlude(&mut self, ctx: &LightingContext<'_>, coherent: bool) {
        if let Some(blocks) = ctx.accel.blocks() {
            blocks.occluded_of_blocks(self.rays.blocks_mut(), &self.times, coherent);
        }
    }

    #[inline(always)]
    fn is_blocked(&self, i: usize) -> bool {
        let (block, lane) = self.at(i);
        block.is_blocked(lane)
    }

    #[inline(always)]
    fn len(&self) -> usize {
        self.rays.len()
    }

    #[inline(always)]
    fn origin(&self, i: usize) -> DVec3 {
        let (block, lane) = self.at(i);
        self.origin + vector(&block.origin, lane)
    }

    #[inline(always)]
    fn direction(&self, i: usize) -> DVec3 {
        let (block, lane) = self.at(i);
        vector(&block.direction, lane)
    }

    #[inline(always)]
    fn reach(&self, i: usize) -> f64 {
        self.t(i)
    }

    #[inline(always)]
    fn t(&self, i: usize) -> f64 {
        let (block, lane) = self.at(i);
        f64::from(block.t_max[lane])
    }

    #[inline(always)]
    fn placement(&self, i: usize) -> u32 {
        let (block, lane) = self.at(i);
        block.placement[lane]
    }

    fn placements(&self, placements: &mut Vec<u32>) {
        placements.clear();
        self.rays.blocks().iter().for_each(|block| placements.extend_from_slice(&block.placement));
        placements.truncate(self.rays.len());
    }

    #[inline(always)]
    fn triangle(&self, i: usize) -> PlacedTriangle {
        let (block, lane) = self.at(i);
        [block.placement[lane], block.triangle[lane]]
    }

    #[inline(always)]
    fn hit(&self, i: usize) -> RayHit {
        let (block, lane) = self.at(i);
        let normal = vector(&block.normal, lane);
        RayHit {
            id: [block.placement[lane], block.triangle[lane]],
            weights: [block.u[lane], block.v[lane]].map(f64::from),
            t: f64::from(block.t_max[lane]),
            normal: normal / normal.length(),
            time: self.times.get(i).copied().unwrap_or(0.0),
        }
    }

    fn unpack_run(&self, patch: &mut Patch, run: Range<usize>) {
        patch.clear();
        patch.count = run.len();
        let blocks = run.start / BLOCK..run.end.div_ceil(BLOCK);
        kernels::unpack(patch, &self.rays.blocks()[blocks], self.origin.to_array());
    }

    fn unpack_picked(
        &self,
        patch: &mut Patch,
        side_by_side: &mut Vec<RayBlock>,
        picked: impl Iterator<Item = usize>,
    ) {
        side_by_side.resize(LANES / BLOCK, RayBlock::EMPTY);
        patch.clear();
        for i in picked {
            let (from, lane) = self.at(i);
            side_by_side[patch.count / BLOCK].copy_hit(patch.count % BLOCK, from, lane);
            patch.count += 1;
        }
        let blocks = &side_by_side[..patch.count.div_ceil(BLOCK)];
        kernels::unpack(patch, blocks, self.origin.to_array());
    }
}

/// Rays in double precision, which may be hit in either, at any times.
#[derive(Debug, Default)]
pub(super) struct Batch {
    rays: RayBatch,
    hits: HitBatch,
    blocked: Vec<bool>,
}

impl Batch {
    /// Adds the hit of a ray to a patch.
    fn unpack(&self, patch: &mut Patch, i: usize) {
        let lane = patch.count;
        let seen = &mut patch.seen;
        put(&mut seen.origin, lane, self.rays.origin(i));
        put(&mut seen.direction, lane, self.rays.direction(i));
        put(&mut seen.normal, lane, self.hits.normal(i));
        put(&mut seen.shading, lane, self.hits.normal(i));
        seen.t[lane] = self.hits.t[i];
        let [u, v] = [self.hits.u[i], self.hits.v[i]];
        let is_single = self.rays.precision == HitPrecision::Single;
        let least = u.min(v).min(1.0 - u - v);
        seen.is_beside[lane] = f64::from(u8::from(is_single && least < BESIDE));
        patch.count += 1;
    }
}

impl Rays for Batch {
    fn restart(&mut self, ctx: &LightingContext<'_>) {
        self.rays.clear();
        self.rays.from_surface = true;
        self.rays.precision = ctx.precision;
        self.hits.detail = Detail::Surface;
    }

    fn take(&mut self, ctx: &LightingContext<'_>, rays: &RayBatch) {
        self.restart(ctx);
        self.rays.copy_from(rays);
        self.rays.from_surface = false;
        self.rays.precision = ctx.precision;
    }

    fn push(
        &mut self,
        [start, along]: [DVec3; 2],
        reach: f64,
        ends: impl FnOnce() -> [PlacedTriangle; 2],
    ) {
        match self.rays.precision {
            HitPrecision::Single => self.rays.push_between(start, along, 0.0, reach),
            HitPrecision::Double => {
                self.rays.push_between_triangles(start, along, [0.0, reach], ends());
            }
        }
    }

    fn set_times(&mut self, times: impl Iterator<Item = f64>) {
        self.rays.set_times(times);
    }

    fn closest(&mut self, ctx: &LightingContext<'_>, coherent: bool) {
        self.rays.coherent = coherent;
        ctx.accel.closest(&self.rays, &mut self.hits);
    }

    fn occlude(&mut self, ctx: &LightingContext<'_>, coherent: bool) {
        self.rays.coherent = coherent;
        ctx.accel.occluded(&self.rays, &mut self.blocked);
    }

    fn is_blocked(&self, i: usize) -> bool {
        self.blocked[i]
    }

    fn len(&self) -> usize {
        self.rays.len()
    }

    fn origin(&self, i: usize) -> DVec3 {
        self.rays.origin(i)
    }

    fn direction(&self, i: usize) -> DVec3 {
        self.rays.direction(i)
    }

    fn reach(&self, i: usize) -> f64 {
        self.rays.t_max()[i]
    }

    fn t(&self, i: usize) -> f64 {
        self.hits.t[i]
    }

    fn placement(&self, i: usize) -> u32 {
        self.hits.placement[i]
    }

    fn placements(&self, placements: &mut Vec<u32>) {
        placements.clear();
        placements.extend_from_slice(&self.hits.placement[..self.rays.len()]);
    }

    fn triangle(&self, i: usize) -> PlacedTriangle {
        [self.hits.placement[i], self.hits.triangle[i]]
    }

    fn hit(&self, i: usize) -> RayHit {
        let hits = &self.hits;
        RayHit {
            id: [hits.placement[i], hits.triangle[i]],
            weights: [hits.u[i], hits.v[i]],
            t: hits.t[i],
            normal: hits.normal(i),
            time: hits.time(i),
        }
    }

    fn unpack_run(&self, patch: &mut Patch, run: Range<usize>) {
        patch.clear();
        run.for_each(|i| self.unpack(patch, i));
    }

    fn unpack_picked(
        &self,
        patch: &mut Patch,
        _side_by_side: &mut Vec<RayBlock>,
        picked: impl Iterator<Item = usize>,
    ) {
        patch.clear();
        picked.for_each(|i| self.unpack(patch, i));
    }
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is the purpose")]
#[inline(always)]
fn single(x: f64) -> f32 {
    x as f32
}
