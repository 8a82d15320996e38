//! Bodies that move, for rays in blocks: what stands still is asked as ever, and of the rest only rays that meet the
//! boxes that bodies sweep are carried, in f64.

use etendue_geometry::block::LANES;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Detail, HitBatch, RayBatch, RayBlock, RayBlocks};

use super::{Moving, OnePlace, meets};
use crate::single::{F32Frame, Rays32};
use crate::{Accel, BlockAccel};

/// Distances that differ by no more than this share, where one of them is of single precision, are one.
const ONE_PLACE: f64 = 8.0 * f32::EPSILON as f64;

impl Moving {
    /// The frame of blocks around all that stands and all that moves, whose coordinates are those of what stands; `None`
    /// where that is not asked in blocks, or too far away for single precision.
    pub(super) fn frame_of_blocks(
        still: &dyn Accel,
        standing: Bounds,
        swept: Bounds,
    ) -> Option<F32Frame> {
        let origin = still.blocks()?.origin();
        F32Frame::around(standing.union(swept), origin)
    }

    /// Asks `ask` of the rays that count hits and may meet a body, with the block and the lane of each.
    fn of_blocks(
        &self,
        blocks: &mut [RayBlock],
        times: &[f64],
        ask: impl FnOnce(&RayBatch, &[(usize, usize)], &mut [RayBlock]),
    ) {
        let origin = self.frame.map_or(DVec3::ZERO, |frame| frame.origin);
        let (mut rays, mut lanes, mut at) = (RayBatch::default(), Vec::new(), Vec::new());
        for (number, block) in blocks.iter().enumerate() {
            for lane in 0..LANES {
                let limits = [block.t_min[lane], block.t_max[lane]].map(f64::from);
                if limits[1] <= 0.0 {
                    continue;
                }
                let [start, along] = [&block.origin, &block.direction]
                    .map(|axes| DVec3::from(axes.map(|axis| f64::from(axis[lane]))));
                let reach = limits[1] + ONE_PLACE * limits[1].abs().max(start.abs().max_element());
                if meets(self.swept, origin + start, along, [limits[0], reach]) {
                    rays.push_between(origin + start, along, limits[0], reach);
                    at.push(times.get(number * LANES + lane).copied().unwrap_or(0.0));
                    lanes.push((number, lane));
                }
            }
        }
        if !lanes.is_empty() {
            rays.from_surface = true;
            rays.set_times(at);
            ask(&rays, &lanes, blocks);
        }
    }
}

impl BlockAccel for Moving {
    fn origin(&self) -> DVec3 {
        self.frame.map_or(DVec3::ZERO, |frame| frame.origin)
    }

    fn has_times(&self) -> bool {
        true
    }

    fn convert(&self, rays: &RayBatch, blocks: &mut RayBlocks) {
        if let Some(frame) = &self.frame {
            Rays32::default().convert_to_blocks(rays, frame, blocks);
        }
    }

    fn closest_of_blocks(&self, blocks: &mut [RayBlock], times: &[f64], coherent: bool) {
        if let Some(still) = self.still.blocks() {
            still.closest_of_blocks(blocks, &[], coherent);
        }
        self.of_blocks(blocks, times, |rays, lanes, blocks| {
            let mut hits = HitBatch::new(Detail::Surface);
            hits.reset(rays.len());
            for (k, &(number, lane)) in lanes.iter().enumerate() {
                let block = &blocks[number];
                hits.placement[k] = block.placement[lane];
                if hits.is_hit(k) {
                    hits.t[k] = f64::from(block.t_max[lane]);
                }
            }
            self.closest_of_bodies(rays, &mut hits, OnePlace(ONE_PLACE));
            for (k, &(number, lane)) in lanes.iter().enumerate() {
                if self.moves.get(hits.placement[k] as usize) == Some(&true) {
                    write(&mut blocks[number], lane, &hits, k);
                }
            }
        });
    }

    fn occluded_of_blocks(&self, blocks: &mut [RayBlock], times: &[f64], coherent: bool) {
        if let Some(still) = self.still.blocks() {
            still.occluded_of_blocks(blocks, &[], coherent);
        }
        self.of_blocks(blocks, times, |rays, lanes, blocks| {
            let mut blocked = vec![false; rays.len()];
            self.occluded_by_bodies(rays, &mut blocked);
            for (&(number, lane), _) in lanes.iter().zip(&blocked).filter(|(_, blocked)| **blocked)
            {
                blocks[number].t_max[lane] = f32::NEG_INFINITY;
            }
        });
    }
}

/// Sets what the ray of a lane hit.
#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is the purpose")]
fn write(block: &mut RayBlock, lane: usize, hits: &HitBatch, k: usize) {
    block.t_max[lane] = hits.t[k] as f32;
    (block.placement[lane], block.triangle[lane]) = (hits.placement[k], hits.triangle[k]);
    (block.u[lane], block.v[lane]) = (hits.u[k] as f32, hits.v[k] as f32);
    for (axis, normal) in block.normal.iter_mut().zip(&hits.normal) {
        axis[lane] = normal[k] as f32;
    }
}
