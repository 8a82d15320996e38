//! Where a node is split: bins of centroids, and the cheapest border between them.

use etendue_geometry::glam::Vec4;

use super::Ref;
use super::extent::{RefBounds, half_area};

/// Where bins begin.
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
