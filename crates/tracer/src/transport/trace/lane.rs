//! The two precisions in which light is traced: their random numbers, and their rays as accelerators take them.

use etendue_accel::Accel;
use etendue_geometry::block::LANES;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{
    Detail, Float, HitBatch, HitPrecision, MISS, PlacedTriangle, RayBatch, RayBlocks,
};

use super::compaction::Word;
use crate::transport::{LightingContext, RaySamples};

/// The triangles that a ray leaves and ends on; [`MISS`] where there is none.
pub(in crate::transport) type RayEnds = [PlacedTriangle; 2];

/// Rays of double precision, as accelerators take them, and what they hit; memory is kept.
#[derive(Debug, Default)]
pub(in crate::transport) struct Batch {
    rays: RayBatch,
    hits: HitBatch,
    blocked: Vec<bool>,
}

/// Properties of rays that are traced together.
#[derive(Debug, Clone, Copy)]
pub(in crate::transport) struct Query<'a> {
    /// Times (s from the frame's time); all at 0 where there are none.
    pub(super) times: &'a [f64],
    /// Unused in single precision, and of the camera's rays, which have none.
    pub(super) ends: &'a [RayEnds],
    /// They run close together.
    pub(super) coherent: bool,
}

/// A number of the precision in which a scene is traced.
pub(in crate::transport) trait Lane: Float + Word {
    /// Rays say which triangles they leave and end on.
    const HAS_ENDS: bool;

    /// Point that coordinates are relative to (m).
    fn origin(accel: &dyn Accel) -> DVec3;

    /// Times of rays count.
    fn has_times(accel: &dyn Accel) -> bool;

    /// The camera's rays in blocks, which are refilled.
    fn convert(accel: &dyn Accel, rays: &RayBatch, blocks: &mut RayBlocks<Self>);

    /// Finds the closest hit of each.
    fn closest(
        ctx: &LightingContext<'_>,
        blocks: &mut RayBlocks<Self>,
        query: Query<'_>,
        batch: &mut Batch,
    );

    /// Finds whether anything is between the ends of each.
    fn occlude(
        ctx: &LightingContext<'_>,
        blocks: &mut RayBlocks<Self>,
        query: Query<'_>,
        batch: &mut Batch,
    );

    /// Numbers of one pair of dimensions for each of `rays`, in two columns.
    fn draw(camera: &RaySamples<'_>, rays: &[u32], pair: u32, out: &mut [Vec<Self>; 2]);
}

impl Lane for f32 {
    const HAS_ENDS: bool = false;

    fn origin(accel: &dyn Accel) -> DVec3 {
        accel.blocks().map_or(DVec3::ZERO, |blocks| blocks.origin())
    }

    fn has_times(accel: &dyn Accel) -> bool {
        accel.blocks().is_some_and(|blocks| blocks.has_times())
    }

    fn convert(accel: &dyn Accel, rays: &RayBatch, blocks: &mut RayBlocks) {
        if let Some(accel) = accel.blocks() {
            accel.convert(rays, blocks);
        }
    }

    fn closest(
        ctx: &LightingContext<'_>,
        blocks: &mut RayBlocks,
        Query { times, coherent, .. }: Query<'_>,
        _batch: &mut Batch,
    ) {
        if let Some(accel) = ctx.accel.blocks() {
            accel.closest_of_blocks(blocks.blocks_mut(), times, coherent);
        }
    }

    fn occlude(
        ctx: &LightingContext<'_>,
        blocks: &mut RayBlocks,
        Query { times, coherent, .. }: Query<'_>,
        _batch: &mut Batch,
    ) {
        if let Some(accel) = ctx.accel.blocks() {
            accel.occluded_of_blocks(blocks.blocks_mut(), times, coherent);
        }
    }

    fn draw(camera: &RaySamples<'_>, rays: &[u32], pair: u32, out: &mut [Vec<Self>; 2]) {
        camera.samples.floats_of_pair(rays, pair, out);
    }
}

impl Lane for f64 {
    const HAS_ENDS: bool = true;

    fn origin(_accel: &dyn Accel) -> DVec3 {
        DVec3::ZERO
    }

    fn has_times(_accel: &dyn Accel) -> bool {
        true
    }

    fn convert(_accel: &dyn Accel, rays: &RayBatch, blocks: &mut RayBlocks<Self>) {
        let [origins, directions] = [rays.origins(), rays.directions()];
        blocks.refill(rays.len(), |block, start, count| {
            let run = start..start + count;
            for axis in 0..3 {
                block.origin[axis][..count].copy_from_slice(&origins[axis][run.clone()]);
                block.direction[axis][..count].copy_from_slice(&directions[axis][run.clone()]);
            }
            block.t_min[..count].copy_from_slice(&rays.t_min()[run.clone()]);
            block.t_max[..count].copy_from_slice(&rays.t_max()[run]);
        });
    }

    fn closest(
        ctx: &LightingContext<'_>,
        blocks: &mut RayBlocks<Self>,
        query: Query<'_>,
        batch: &mut Batch,
    ) {
        batch.take(ctx.precision, blocks, query);
        batch.hits.detail = Detail::Surface;
        ctx.accel.closest(&batch.rays, &mut batch.hits);
        let (hits, len) = (&batch.hits, blocks.len());
        for (number, block) in blocks.blocks_mut().iter_mut().enumerate() {
            let run = number * LANES..len.min((number + 1) * LANES);
            let count = run.len();
            block.placement[..count].copy_from_slice(&hits.placement[run.clone()]);
            block.triangle[..count].copy_from_slice(&hits.triangle[run.clone()]);
            block.u[..count].copy_from_slice(&hits.u[run.clone()]);
            block.v[..count].copy_from_slice(&hits.v[run.clone()]);
            for (axis, normals) in block.normal.iter_mut().zip(&hits.normal) {
                axis[..count].copy_from_slice(&normals[run.clone()]);
            }
            for (t_max, (&t, &placement)) in
                block.t_max.iter_mut().zip(hits.t[run.clone()].iter().zip(&hits.placement[run]))
            {
                *t_max = if placement == MISS { *t_max } else { t };
            }
        }
    }

    fn occlude(
        ctx: &LightingContext<'_>,
        blocks: &mut RayBlocks<Self>,
        query: Query<'_>,
        batch: &mut Batch,
    ) {
        batch.take(ctx.precision, blocks, query);
        ctx.accel.occluded(&batch.rays, &mut batch.blocked);
        for i in (0..blocks.len()).filter(|&i| batch.blocked[i]) {
            blocks.blocks_mut()[i / LANES].t_max[i % LANES] = -Self::INFINITY;
        }
    }

    fn draw(camera: &RaySamples<'_>, rays: &[u32], pair: u32, out: &mut [Vec<Self>; 2]) {
        let mut squares = Vec::new();
        camera.samples.squares_of_pair(rays, pair, &mut squares);
        for (k, column) in out.iter_mut().enumerate() {
            column.clear();
            column.extend(squares.iter().map(|square| square[k]));
        }
    }
}

impl Batch {
    /// Takes rays of blocks to be hit in some precision.
    fn take(
        &mut self,
        precision: HitPrecision,
        blocks: &RayBlocks<f64>,
        Query { times, ends, coherent }: Query<'_>,
    ) {
        let rays = &mut self.rays;
        rays.reset(blocks.len());
        rays.from_surface = !ends.is_empty();
        rays.precision = precision;
        rays.coherent = coherent;
        let own = rays.arrays_mut();
        for (number, block) in blocks.blocks().iter().enumerate() {
            let run = number * LANES..blocks.len().min((number + 1) * LANES);
            let count = run.len();
            for axis in 0..3 {
                own.origins[axis][run.clone()].copy_from_slice(&block.origin[axis][..count]);
                own.directions[axis][run.clone()].copy_from_slice(&block.direction[axis][..count]);
            }
            own.t_min[run.clone()].copy_from_slice(&block.t_min[..count]);
            own.t_max[run].copy_from_slice(&block.t_max[..count]);
        }
        if precision == HitPrecision::Double && !ends.is_empty() {
            rays.end_on_triangles(ends.iter().copied());
        }
        rays.set_times(times.iter().copied());
    }
}

/// A number of either precision in double precision.
#[inline(always)]
pub(super) fn wide<F: Float>(x: F) -> f64 {
    x.into()
}

/// Three of them. (What maps arrays is a function without the instructions of those that call it.)
#[inline(always)]
pub(super) fn widen<F: Float>([x, y, z]: [F; 3]) -> [f64; 3] {
    [x.into(), y.into(), z.into()]
}

/// A vector, rounded to the precision of lanes.
#[inline(always)]
pub(super) fn single<F: Lane>(v: DVec3) -> [F; 3] {
    [F::of(v.x), F::of(v.y), F::of(v.z)]
}

/// A number, rounded likewise.
#[inline(always)]
pub(super) fn round<F: Lane>(x: f64) -> F {
    F::of(x)
}
