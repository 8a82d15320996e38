//! Split of a node: bins of centroids, and the cheapest border between them.
//!
//! Refs moved to the sides of a split.

use rayon::prelude::*;

use super::node::{CHUNK, Ref, RefBounds, half_area};
use etendue_geometry::glam::Vec4;

/// Grid of bins: their start and scale.
pub(super) struct BinGrid {
    start: Vec4,
    /// Bins per length; 0 along an axis without extent.
    scale: Vec4,
    last: usize,
}

#[derive(Clone, Copy)]
pub(super) struct Split {
    axis: usize,
    /// Bins below this one go left.
    bin: usize,
    pub(super) cost: f32,
}

impl BinGrid {
    pub(super) fn new(extent: &RefBounds, len: usize) -> Self {
        let bins = (4 + len / 20).min(BINS);
        let size = extent.centroid_hi - extent.centroid_lo;
        let scale = |size: f32| {
            let scale = (bins - 1) as f32 / size;
            if size > 0.0 && scale.is_finite() { scale } else { 0.0 }
        };
        let scale = Vec4::new(scale(size.x), scale(size.y), scale(size.z), 0.0);
        Self { start: extent.centroid_lo, scale, last: bins - 1 }
    }

    /// The bins along the three axes, 0 to `last`.
    #[inline(always)]
    fn bins(&self, [lo, hi]: [Vec4; 2]) -> [usize; 3] {
        // Added to 2²³, a number is rounded to a whole one, in the lowest bits.
        let place = (lo + hi - self.start) * self.scale + Vec4::splat(8_388_608.0);
        let [x, y, z, _] = place.to_array().map(|p| p.to_bits() as usize % BINS);
        [x, y, z]
    }

    #[inline(always)]
    pub(super) fn is_left(&self, corners: [Vec4; 2], split: Split) -> bool {
        self.bins(corners)[split.axis] < split.bin
    }
}

const BINS: usize = 32;

/// Boxes and counts of the bins along the three axes.
#[derive(Clone)]
pub(super) struct Bins {
    lo: [[Vec4; BINS]; 3],
    hi: [[Vec4; BINS]; 3],
    count: [[u32; BINS]; 3],
}

impl Bins {
    pub(super) const EMPTY: Self = Self {
        lo: [[Vec4::INFINITY; BINS]; 3],
        hi: [[Vec4::NEG_INFINITY; BINS]; 3],
        count: [[0; BINS]; 3],
    };

    pub(super) fn filled(mut self, grid: &BinGrid, refs: &[Ref]) -> Self {
        self.fill(grid, refs);
        self
    }

    /// Fills the bins of `grid` with `refs`; what was in them before is forgotten.
    pub(super) fn fill(&mut self, grid: &BinGrid, refs: &[Ref]) {
        for axis in 0..3 {
            self.lo[axis][..=grid.last].fill(Vec4::INFINITY);
            self.hi[axis][..=grid.last].fill(Vec4::NEG_INFINITY);
            self.count[axis][..=grid.last].fill(0);
        }
        for r in refs {
            let corners = r.corners();
            for (axis, bin) in grid.bins(corners).into_iter().enumerate() {
                self.lo[axis][bin] = self.lo[axis][bin].min(corners[0]);
                self.hi[axis][bin] = self.hi[axis][bin].max(corners[1]);
                self.count[axis][bin] += 1;
            }
        }
    }

    /// The boxes of what lies in bins below and from `split` on.
    pub(super) fn sides(&self, grid: &BinGrid, split: Split) -> [RefBounds; 2] {
        let union = |bins: std::ops::Range<usize>| {
            bins.fold(RefBounds::EMPTY, |all, bin| RefBounds {
                lo: all.lo.min(self.lo[split.axis][bin]),
                hi: all.hi.max(self.hi[split.axis][bin]),
                ..all
            })
        };
        [union(0..split.bin), union(split.bin..grid.last + 1)]
    }

    pub(super) fn merge(mut self, other: &Self, grid: &BinGrid) -> Self {
        for axis in 0..3 {
            for bin in 0..=grid.last {
                self.lo[axis][bin] = self.lo[axis][bin].min(other.lo[axis][bin]);
                self.hi[axis][bin] = self.hi[axis][bin].max(other.hi[axis][bin]);
                self.count[axis][bin] += other.count[axis][bin];
            }
        }
        self
    }

    /// The border with the least sum of areas, each times the blocks of refs on its side.
    pub(super) fn cheapest(&self, grid: &BinGrid, block: usize) -> Option<Split> {
        let mut best: Option<Split> = None;
        let last = grid.last;
        for axis in (0..3).filter(|&axis| grid.scale[axis] > 0.0) {
            let mut right_cost = [0.0_f32; BINS];
            let (mut lo, mut hi, mut count) = (Vec4::INFINITY, Vec4::NEG_INFINITY, 0);
            for bin in (1..=last).rev() {
                lo = lo.min(self.lo[axis][bin]);
                hi = hi.max(self.hi[axis][bin]);
                count += self.count[axis][bin];
                right_cost[bin] = cost(hi - lo, count, block);
            }
            (lo, hi) = (Vec4::INFINITY, Vec4::NEG_INFINITY);
            let total = count + self.count[axis][0];
            count = 0;
            for (bin, right_cost) in right_cost.into_iter().enumerate().take(last + 1).skip(1) {
                lo = lo.min(self.lo[axis][bin - 1]);
                hi = hi.max(self.hi[axis][bin - 1]);
                count += self.count[axis][bin - 1];
                let cost = cost(hi - lo, count, block) + right_cost;
                let divides = count > 0 && count < total;
                if divides && best.is_none_or(|best| cost < best.cost) {
                    best = Some(Split { axis, bin, cost });
                }
            }
        }
        best
    }
}

#[inline]
fn cost(edges: Vec4, count: u32, block: usize) -> f32 {
    if count == 0 { 0.0 } else { half_area(edges) * (count as usize).div_ceil(block) as f32 }
}

/// One side of a split.
pub(super) struct SplitSide {
    pub(super) len: usize,
    pub(super) extent: RefBounds,
}

/// The first and the second half of `refs`, as they stand.
pub(super) fn halve(refs: &[Ref]) -> [SplitSide; 2] {
    let (a, b) = refs.split_at(refs.len() / 2);
    [a, b].map(|half| SplitSide { len: half.len(), extent: RefBounds::of(half) })
}

/// Brings the left refs to the front, in place.
pub(super) fn partition(
    refs: &mut [Ref],
    grid: &BinGrid,
    split: Split,
    bins: &Bins,
) -> [SplitSide; 2] {
    let mut len = 0;
    // Swaps whether it must or not: which side a ref goes to cannot be predicted.
    for i in 0..refs.len() {
        let is_left = grid.is_left(refs[i].corners(), split);
        refs.swap(len, i);
        len += usize::from(is_left);
    }
    let [mut left, mut right] = bins.sides(grid, split);
    let (left_refs, right_refs) = refs.split_at(len);
    left.include_centroids(left_refs);
    right.include_centroids(right_refs);
    [SplitSide { len, extent: left }, SplitSide { len: right_refs.len(), extent: right }]
}

/// As [`partition`], in parallel: every chunk is told where its left and right refs go.
pub(super) fn partition_wide(
    refs: &mut [Ref],
    spare: &mut [Ref],
    grid: &BinGrid,
    split: Split,
) -> [SplitSide; 2] {
    // How much of each chunk goes to which side.
    let chunks: Vec<[SplitSide; 2]> = refs
        .par_chunks(CHUNK)
        .map(|chunk| {
            let mut sides =
                [RefBounds::EMPTY, RefBounds::EMPTY].map(|extent| SplitSide { len: 0, extent });
            for r in chunk {
                let corners = r.corners();
                let side = &mut sides[usize::from(!grid.is_left(corners, split))];
                side.len += 1;
                side.extent.include(corners);
            }
            sides
        })
        .collect();
    let mut sides = [RefBounds::EMPTY, RefBounds::EMPTY].map(|extent| SplitSide { len: 0, extent });
    for chunk in &chunks {
        for (side, part) in sides.iter_mut().zip(chunk) {
            side.len += part.len;
            side.extent = side.extent.union(part.extent);
        }
    }
    // Each chunk has a part of both sides to itself.
    let (mut lefts, mut rights) = spare[..refs.len()].split_at_mut(sides[0].len);
    let mut targets = Vec::with_capacity(chunks.len());
    for [left, right] in &chunks {
        let (mine, rest) = lefts.split_at_mut(left.len);
        lefts = rest;
        let (mine_right, rest) = rights.split_at_mut(right.len);
        rights = rest;
        targets.push((mine, mine_right));
    }
    refs.par_chunks(CHUNK).zip(targets).for_each(|(chunk, (left, right))| {
        let (mut left, mut right) = (left.iter_mut(), right.iter_mut());
        for r in chunk {
            let side = if grid.is_left(r.corners(), split) { &mut left } else { &mut right };
            if let Some(place) = side.next() {
                *place = *r;
            }
        }
    });
    refs.par_chunks_mut(CHUNK).zip(spare.par_chunks(CHUNK)).for_each(|(to, from)| {
        to.copy_from_slice(&from[..to.len()]);
    });
    sides
}
