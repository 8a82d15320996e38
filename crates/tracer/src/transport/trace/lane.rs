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

/// What is known of rays that are traced together.
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
        let from = batch.take(ctx.precision, blocks, query);
        batch.hits.detail = Detail::Surface;
        ctx.accel.closest(&batch.rays, &mut batch.hits);
        let hits = &batch.hits;
        for (k, i) in from.enumerate() {
            let (block, lane) = (&mut blocks.blocks_mut()[i / LANES], i % LANES);
            (block.placement[lane], block.triangle[lane]) = (hits.placement[k], hits.triangle[k]);
            if hits.placement[k] == MISS {
                continue;
            }
            (block.t_max[lane], block.u[lane], block.v[lane]) = (hits.t[k], hits.u[k], hits.v[k]);
            for (axis, normal) in block.normal.iter_mut().zip(hits.normal(k).to_array()) {
                axis[lane] = normal;
            }
        }
    }

    fn occlude(
        ctx: &LightingContext<'_>,
        blocks: &mut RayBlocks<Self>,
        query: Query<'_>,
        batch: &mut Batch,
    ) {
        let from = batch.take(ctx.precision, blocks, query);
        ctx.accel.occluded(&batch.rays, &mut batch.blocked);
        for i in from.filter(|&i| batch.blocked[i]) {
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
    /// Takes rays of blocks to be hit in some precision; the numbers of all.
    fn take(
        &mut self,
        precision: HitPrecision,
        blocks: &RayBlocks<f64>,
        Query { times, ends, coherent }: Query<'_>,
    ) -> std::ops::Range<usize> {
        let rays = &mut self.rays;
        rays.clear();
        rays.from_surface = !ends.is_empty();
        rays.precision = precision;
        rays.coherent = coherent;
        for i in 0..blocks.len() {
            let (block, lane) = (&blocks.blocks()[i / LANES], i % LANES);
            let at =
                |axes: &[[f64; LANES]; 3]| DVec3::new(axes[0][lane], axes[1][lane], axes[2][lane]);
            let (origin, direction) = (at(&block.origin), at(&block.direction));
            let limits = [block.t_min[lane], block.t_max[lane]];
            match (precision, ends.get(i)) {
                (HitPrecision::Double, Some(own)) => {
                    rays.push_between_triangles(origin, direction, limits, *own);
                }
                _ => rays.push_between(origin, direction, limits[0], limits[1]),
            }
        }
        rays.set_times(times.iter().copied());
        0..blocks.len()
    }
}

/// A number of either precision in double precision.
#[inline(always)]
pub(super) fn wide<F: Float>(x: F) -> f64 {
    x.into()
}
