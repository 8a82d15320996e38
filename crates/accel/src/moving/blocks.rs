//! Bodies that move, for rays in blocks: what stands still is asked as ever, and of the rest only rays that meet the
//! boxes that bodies sweep are carried, in f64, and asked in blocks of the body's frame again.

use etendue_geometry::block::{LANES, vector};
use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Bounds, Detail, HitBatch, MISS, RayBatch, RayBlock, RayBlocks};

use super::{BodyHit, BodyRays, MovingScene, RaysInFrame, meets, reach, span, turned_normal};
use crate::single::{F32Frame, round};
use crate::{Accel, BlockAccel};

/// Distances that differ by no more than this share, where one of them is of single precision, are one.
const ONE_PLACE: f64 = 8.0 * f32::EPSILON as f64;

/// A lane of a block, by the block's number.
#[derive(Clone, Copy)]
struct BlockLane {
    block: usize,
    lane: usize,
}

impl MovingScene {
    /// The frame of blocks around all that stands and all that moves, whose coordinates are those of what stands; `None`
    /// where that is not asked in blocks, or too far away for single precision.
    pub(super) fn frame_of_blocks(
        still: &dyn Accel,
        standing: Bounds,
        swept: Bounds,
    ) -> Option<F32Frame> {
        let origin = still.blocks()?.origin();
        F32Frame::near(standing.union(swept), origin)
    }

    /// Asks `ask` of the rays that count hits and may meet a body, with the block and the lane of each; those of `ends`
    /// look as far as what is in the place of their end.
    fn of_blocks(
        &self,
        blocks: &mut [RayBlock],
        times: &[f64],
        ends: impl Fn(&RayBlock, usize) -> bool,
        ask: impl FnOnce(&RayBatch, &[BlockLane], &mut [RayBlock]),
    ) {
        let origin = self.frame().origin();
        let (mut rays, mut lanes, mut at) = (RayBatch::default(), Vec::new(), Vec::new());
        for (number, block) in blocks.iter().enumerate() {
            for lane in 0..LANES {
                let limits = [block.t_min[lane], block.t_max[lane]].map(f64::from);
                if limits[1] <= 0.0 {
                    continue;
                }
                let [start, along] =
                    [&block.origin, &block.direction].map(|axes| vector(axes, lane));
                let size = limits[1].abs().max((origin + start).abs().max_element());
                let slack = if ends(block, lane) { ONE_PLACE * size } else { 0.0 };
                let reach = limits[1] + slack;
                if meets(self.swept, origin + start, along, [limits[0], reach]) {
                    rays.push_between(origin + start, along, limits[0], reach);
                    at.push(times.get(number * LANES + lane).copied().unwrap_or(0.0));
                    lanes.push(BlockLane { block: number, lane });
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

impl BlockAccel for MovingScene {
    fn frame(&self) -> &F32Frame {
        self.frame.as_ref().unwrap_or(F32Frame::EMPTY)
    }

    fn has_times(&self) -> bool {
        true
    }

    fn closest_of_blocks(&self, blocks: &mut [RayBlock], times: &[f64], coherent: bool) {
        if let Some(still) = self.still.blocks() {
            still.closest_of_blocks(blocks, &[], coherent);
        }
        let is_hit = |block: &RayBlock, lane: usize| block.placement[lane] != MISS;
        self.of_blocks(blocks, times, is_hit, |rays, lanes, blocks| {
            let mut hits = HitBatch::new(Detail::Surface);
            hits.reset(rays.len());
            for (k, &BlockLane { block: number, lane }) in lanes.iter().enumerate() {
                let block = &blocks[number];
                hits.placement[k] = block.placement[lane];
                if hits.is_hit(k) {
                    hits.t[k] = f64::from(block.t_max[lane]);
                }
            }
            let (mut packed, mut carried) = (BlocksInFrame::default(), RaysInFrame::default());
            carried.hits.detail = Detail::Surface;
            let near = self.near(rays, |i| Some(reach(rays, &hits, i, ONE_PLACE)));
            for own in self.by_body(&near) {
                let body = own.body;
                let Some(shape) = self.shapes[body.shape].blocks() else {
                    self.closest_of_body(&own, rays, &mut hits, ONE_PLACE, &mut carried);
                    continue;
                };
                let far = |i: usize| Some(reach(rays, &hits, i, ONE_PLACE));
                packed.fill(&own, rays, shape.origin(), far);
                shape.closest_of_blocks(packed.rays.blocks_mut(), &[], coherent);
                for (k, &(i, stretch, ahead, linear)) in packed.from.iter().enumerate() {
                    let (block, lane) = (&packed.rays.blocks()[k / LANES], k % LANES);
                    if block.placement[lane] == MISS {
                        continue;
                    }
                    let t = (ahead + f64::from(block.t_max[lane])) / stretch;
                    if !body.is_nearest(rays, &hits, i, t, ONE_PLACE) {
                        continue;
                    }
                    let normal = vector(&block.normal, lane);
                    let hit = BodyHit {
                        t,
                        triangle: block.triangle[lane],
                        weights: [block.u[lane], block.v[lane]].map(f64::from),
                        normal: turned_normal(linear, normal),
                    };
                    hit.put(&mut hits, i, body.placement);
                }
            }
            for (k, &BlockLane { block: number, lane }) in lanes.iter().enumerate() {
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
        self.of_blocks(
            blocks,
            times,
            |_, _| false,
            |rays, lanes, blocks| {
                let mut blocked = vec![false; rays.len()];
                let (mut packed, mut carried) = (BlocksInFrame::default(), RaysInFrame::default());
                let near = self.near(rays, |i| Some(rays.t_max()[i]));
                for own in self.by_body(&near) {
                    let Some(shape) = self.shapes[own.body.shape].blocks() else {
                        self.occluded_by_body(&own, rays, &mut blocked, &mut carried);
                        continue;
                    };
                    let far = |i: usize| (!blocked[i]).then(|| rays.t_max()[i]);
                    packed.fill(&own, rays, shape.origin(), far);
                    shape.occluded_of_blocks(packed.rays.blocks_mut(), &[], coherent);
                    for (k, &(i, ..)) in packed.from.iter().enumerate() {
                        blocked[i] |= packed.rays.blocks()[k / LANES].is_blocked(k % LANES);
                    }
                }
                for (&BlockLane { block: number, lane }, _) in
                    lanes.iter().zip(&blocked).filter(|(_, blocked)| **blocked)
                {
                    blocks[number].t_max[lane] = f32::NEG_INFINITY;
                }
            },
        );
    }
}

/// Rays of a body in blocks, in its frame.
#[derive(Default)]
struct BlocksInFrame {
    rays: RayBlocks,
    /// Of each, which of the batch it is, how long its unit is in the body's frame, how far it starts ahead there (m), and
    /// what turns and stretches the frame.
    from: Vec<(usize, f64, f64, DMat3)>,
}

impl BlocksInFrame {
    /// Carries those of a body's rays into its frame that meet its box, by coordinates relative to `origin` (m):
    /// in f64, and then rounded where they enter the box, so that f32 has the body's own lengths alone.
    fn fill(
        &mut self,
        own: &BodyRays<'_>,
        rays: &RayBatch,
        origin: DVec3,
        t_max: impl Fn(usize) -> Option<f64>,
    ) {
        self.rays.clear();
        self.from.clear();
        let body = own.body;
        for i in own.numbers() {
            let Some(t_max) = t_max(i) else { continue };
            let place = body.motion.at(rays.time(i));
            let inverse = place.linear.inverse();
            let turned = inverse * rays.direction(i);
            let stretch = turned.length();
            if !(stretch > 0.0 && stretch.is_finite()) {
                continue;
            }
            let (start, along) = (inverse * -place.offset_from(rays.origin(i)), turned / stretch);
            let limits = [rays.t_min()[i], t_max].map(|t| t * stretch);
            let Some([enters, _]) = span(body.local, start, along, limits) else { continue };
            // Of a ray that starts in the box, or before it by no more than the box is wide, where it starts.
            let room = (body.local.max - body.local.min).length();
            let ahead = if enters > room { enters - 0.5 * room } else { limits[0] };
            let from = start + along * ahead - origin;
            self.rays.push(single(from), single(along), round(limits[1] - ahead));
            self.from.push((i, stretch, ahead, place.linear));
        }
    }
}

fn single(v: DVec3) -> [f32; 3] {
    v.to_array().map(round)
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
