//! A binary tree of boxes over anything that has a box: the topology that both the pure-Rust
//! backends start from.
//!
//! Top-down splits by the binned surface-area heuristic (I. Wald, "On fast construction of
//! SAH-based bounding volume hierarchies", 2007): the centroids of a node's boxes fall into up to
//! 32 bins an axis, and the cheapest border between bins splits the node. Counts, minima and maxima
//! do not depend on the order they are taken in, and what is done in parallel depends on sizes
//! only, so the tree is the same for any number of threads.

use bytemuck::{Pod, Zeroable};
use etendue_geometry::glam::Vec4;
use rayon::prelude::*;

use crate::BuildError;
use crate::watch::Watch;

/// The box of one thing, with two numbers by which its owner knows it.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C, align(16))]
pub(crate) struct Ref {
    pub(crate) lo: [f32; 3],
    pub(crate) first: u32,
    pub(crate) hi: [f32; 3],
    pub(crate) second: u32,
}

impl Ref {
    /// The lower and upper corner; the fourth components are noise.
    #[inline]
    fn corners(&self) -> [Vec4; 2] {
        let [lo, hi]: [[f32; 4]; 2] = bytemuck::cast(*self);
        [Vec4::from_array(lo), Vec4::from_array(hi)]
    }
}

/// A node with its box. Nodes stand in depth-first order: an inner node's left child follows it,
/// its right child stands [`right`](Node::right) places after it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Node {
    pub(crate) lo: [f32; 3],
    pub(crate) hi: [f32; 3],
    /// A leaf's first ref; how far an inner node's right child is.
    link: u32,
    /// A leaf's number of refs; 0 for an inner node.
    count: u32,
}

impl Node {
    /// The range of refs of a leaf; `None` for an inner node.
    pub(crate) fn leaf(&self) -> Option<std::ops::Range<usize>> {
        (self.count > 0).then(|| self.link as usize..(self.link + self.count) as usize)
    }

    /// How many places after an inner node its right child stands.
    pub(crate) fn right(&self) -> usize {
        self.link as usize
    }

    /// Half the surface of the box.
    pub(crate) fn area(&self) -> f32 {
        half_area(Vec4::from((glam3(self.hi) - glam3(self.lo), 0.0)))
    }
}

fn glam3(v: [f32; 3]) -> etendue_geometry::glam::Vec3 {
    v.into()
}

/// How splitting ends.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LeafSize {
    /// The most refs of a leaf.
    pub(crate) most: usize,
    /// Refs that are tested side by side, at the cost of one.
    pub(crate) block: usize,
}

/// The tree and its refs in leaf order.
#[derive(Debug)]
pub(crate) struct Tree {
    /// In depth-first order; empty when there are no refs.
    pub(crate) nodes: Vec<Node>,
    pub(crate) refs: Vec<Ref>,
}

/// No path from the root is longer: past [`SAH_DEPTH`] levels nodes are halved by number.
pub(crate) const MAX_DEPTH: usize = SAH_DEPTH + 32;
const SAH_DEPTH: usize = 40;

const BINS: usize = 32;
/// From this many refs on, one node's refs are binned and moved in parallel.
const WIDE_NODE: usize = 1 << 17;
/// Refs that one thread bins or moves at a time.
const CHUNK: usize = 1 << 14;
/// Down to this many refs, the two sides of a split are built in parallel.
const PARALLEL_NODE: usize = 1 << 12;

impl Tree {
    /// Builds the tree over `refs`, at most 2³¹ of them, whose boxes are finite and not inverted.
    ///
    /// # Errors
    ///
    /// [`BuildError::Stopped`] when `watch` says so.
    pub(crate) fn build(
        mut refs: Vec<Ref>,
        leaf: LeafSize,
        watch: &Watch<'_>,
    ) -> Result<Self, BuildError> {
        if refs.is_empty() {
            return Ok(Self { nodes: Vec::new(), refs });
        }
        let mut spare = vec![Ref::zeroed(); if refs.len() >= WIDE_NODE { refs.len() } else { 0 }];
        let extent = Extent::of(&refs);
        let grown = Task { leaf, watch }.grow(&mut refs, &mut spare, 0, 0, extent)?;
        drop(spare);
        let mut nodes = Vec::with_capacity(grown.len());
        grown.flatten(&mut nodes);
        Ok(Self { nodes, refs })
    }
}

/// The boxes of a set of refs: around all of them, and around their centroids (times two).
#[derive(Debug, Clone, Copy)]
struct Extent {
    lo: Vec4,
    hi: Vec4,
    centroid_lo: Vec4,
    centroid_hi: Vec4,
}

impl Extent {
    const EMPTY: Self = Self {
        lo: Vec4::INFINITY,
        hi: Vec4::NEG_INFINITY,
        centroid_lo: Vec4::INFINITY,
        centroid_hi: Vec4::NEG_INFINITY,
    };

    fn of(refs: &[Ref]) -> Self {
        if refs.len() >= WIDE_NODE {
            refs.par_chunks(CHUNK).map(Self::of_chunk).reduce(|| Self::EMPTY, Self::union)
        } else {
            Self::of_chunk(refs)
        }
    }

    fn of_chunk(refs: &[Ref]) -> Self {
        let mut extent = Self::EMPTY;
        for r in refs {
            extent.include(r.corners());
        }
        extent
    }

    #[inline]
    fn include(&mut self, [lo, hi]: [Vec4; 2]) {
        let centroid = lo + hi;
        self.lo = self.lo.min(lo);
        self.hi = self.hi.max(hi);
        self.centroid_lo = self.centroid_lo.min(centroid);
        self.centroid_hi = self.centroid_hi.max(centroid);
    }

    fn include_centroids(&mut self, refs: &[Ref]) {
        for r in refs {
            let [lo, hi] = r.corners();
            self.centroid_lo = self.centroid_lo.min(lo + hi);
            self.centroid_hi = self.centroid_hi.max(lo + hi);
        }
    }

    fn union(self, other: Self) -> Self {
        Self {
            lo: self.lo.min(other.lo),
            hi: self.hi.max(other.hi),
            centroid_lo: self.centroid_lo.min(other.centroid_lo),
            centroid_hi: self.centroid_hi.max(other.centroid_hi),
        }
    }

    fn node(&self, link: u32, count: u32) -> Node {
        let three = |v: Vec4| v.truncate().to_array();
        Node { lo: three(self.lo), hi: three(self.hi), link, count }
    }
}

/// Half the surface of a box with edges `e`; the fourth component is passed over.
#[inline]
fn half_area(e: Vec4) -> f32 {
    e.x * e.y + e.y * e.z + e.z * e.x
}

/// A finished part of the tree. Parts built in parallel are joined once, at the end.
enum Grown {
    Nodes(Vec<Node>),
    Split(Node, Box<(Self, Self)>),
}

impl Grown {
    fn len(&self) -> usize {
        match self {
            Self::Nodes(nodes) => nodes.len(),
            Self::Split(_, sides) => 1 + sides.0.len() + sides.1.len(),
        }
    }

    fn flatten(self, nodes: &mut Vec<Node>) {
        match self {
            Self::Nodes(part) => nodes.extend(part),
            Self::Split(node, sides) => {
                let (left, right) = *sides;
                nodes.push(Node { link: index(1 + left.len()), ..node });
                left.flatten(nodes);
                right.flatten(nodes);
            }
        }
    }
}

/// Trees have fewer than 2³² nodes because there are at most 2³¹ refs.
#[expect(clippy::cast_possible_truncation, reason = "bounded by the number of refs")]
fn index(i: usize) -> u32 {
    i as u32
}

#[derive(Clone, Copy)]
struct Task<'a> {
    leaf: LeafSize,
    watch: &'a Watch<'a>,
}

impl Task<'_> {
    /// The subtree over `refs`, which begin at `first` in the whole.
    fn grow(
        self,
        refs: &mut [Ref],
        spare: &mut [Ref],
        first: usize,
        depth: usize,
        extent: Extent,
    ) -> Result<Grown, BuildError> {
        if refs.len() < PARALLEL_NODE {
            let mut nodes = Vec::with_capacity(refs.len());
            let mut bins = Bins::EMPTY;
            self.grow_alone(refs, first, depth, extent, &mut (&mut nodes, &mut bins));
            self.watch.advance(refs.len() as u64)?;
            return Ok(Grown::Nodes(nodes));
        }
        let mut bins = Bins::EMPTY;
        let sides = self.divide(refs, spare, depth, &extent, &mut bins);
        let [left, right] = sides.unwrap_or_else(|| halve(refs));
        let spare_middle = if spare.is_empty() { 0 } else { left.len };
        let (a, b) = refs.split_at_mut(left.len);
        let (spare_a, spare_b) = spare.split_at_mut(spare_middle);
        let (a, b) = rayon::join(
            || self.grow(a, spare_a, first, depth + 1, left.extent),
            || self.grow(b, spare_b, first + left.len, depth + 1, right.extent),
        );
        Ok(Grown::Split(extent.node(0, 0), Box::new((a?, b?))))
    }

    /// As [`Self::grow`], on one thread.
    fn grow_alone(
        self,
        refs: &mut [Ref],
        first: usize,
        depth: usize,
        extent: Extent,
        work: &mut (&mut Vec<Node>, &mut Bins),
    ) {
        let (nodes, bins) = work;
        let sides = match self.divide(refs, &mut [], depth, &extent, bins) {
            None if refs.len() <= self.leaf.most => {
                nodes.push(extent.node(index(first), index(refs.len())));
                return;
            }
            None => halve(refs),
            Some(sides) => sides,
        };
        let at = nodes.len();
        nodes.push(extent.node(0, 0));
        let [left, right] = sides;
        let (a, b) = refs.split_at_mut(left.len);
        self.grow_alone(a, first, depth + 1, left.extent, work);
        work.0[at].link = index(work.0.len() - at);
        self.grow_alone(b, first + left.len, depth + 1, right.extent, work);
    }

    /// Splits by the surface-area heuristic and moves `refs` accordingly. `None` when a leaf is
    /// cheaper, or when there is nothing to tell the refs apart by.
    fn divide(
        self,
        refs: &mut [Ref],
        spare: &mut [Ref],
        depth: usize,
        extent: &Extent,
        bins: &mut Bins,
    ) -> Option<[Side; 2]> {
        let smallest = self.leaf.block.min(self.leaf.most);
        if refs.len() <= smallest || depth >= SAH_DEPTH {
            return None;
        }
        let grid = Grid::new(extent, refs.len());
        let wide = refs.len() >= WIDE_NODE;
        if wide {
            let bin = |chunk: &[Ref]| Bins::EMPTY.filled(&grid, chunk);
            *bins = refs.par_chunks(CHUNK).map(bin).reduce_with(|a, b| a.merge(&b, &grid))?;
        } else {
            bins.fill(&grid, refs);
        }
        let split = bins.cheapest(&grid, self.leaf.block)?;
        let blocks = refs.len().div_ceil(self.leaf.block) as f32;
        if refs.len() <= self.leaf.most {
            // One box test for the node against what testing its triangles less often saves.
            let area = half_area(extent.hi - extent.lo);
            if blocks * area <= area + split.cost {
                return None;
            }
        }
        Some(if wide {
            partition_wide(refs, spare, &grid, split)
        } else {
            partition(refs, &grid, split, bins)
        })
    }
}

/// One side of a split.
struct Side {
    len: usize,
    extent: Extent,
}

/// The first and the second half of `refs`, as they stand.
fn halve(refs: &[Ref]) -> [Side; 2] {
    let (a, b) = refs.split_at(refs.len() / 2);
    [a, b].map(|half| Side { len: half.len(), extent: Extent::of(half) })
}

/// Where bins begin.
struct Grid {
    start: Vec4,
    /// Bins per length; 0 along an axis without extent.
    scale: Vec4,
    last: usize,
}

#[derive(Clone, Copy)]
struct Split {
    axis: usize,
    /// Bins below this one go left.
    bin: usize,
    cost: f32,
}

impl Grid {
    fn new(extent: &Extent, len: usize) -> Self {
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
    fn is_left(&self, corners: [Vec4; 2], split: Split) -> bool {
        self.bins(corners)[split.axis] < split.bin
    }
}

/// Boxes and counts of the bins along the three axes.
#[derive(Clone)]
struct Bins {
    lo: [[Vec4; BINS]; 3],
    hi: [[Vec4; BINS]; 3],
    count: [[u32; BINS]; 3],
}

impl Bins {
    const EMPTY: Self = Self {
        lo: [[Vec4::INFINITY; BINS]; 3],
        hi: [[Vec4::NEG_INFINITY; BINS]; 3],
        count: [[0; BINS]; 3],
    };

    fn filled(mut self, grid: &Grid, refs: &[Ref]) -> Self {
        self.fill(grid, refs);
        self
    }

    /// Fills the bins of `grid` with `refs`; what was in them before is forgotten.
    fn fill(&mut self, grid: &Grid, refs: &[Ref]) {
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
    fn sides(&self, grid: &Grid, split: Split) -> [Extent; 2] {
        let union = |bins: std::ops::Range<usize>| {
            bins.fold(Extent::EMPTY, |all, bin| Extent {
                lo: all.lo.min(self.lo[split.axis][bin]),
                hi: all.hi.max(self.hi[split.axis][bin]),
                ..all
            })
        };
        [union(0..split.bin), union(split.bin..grid.last + 1)]
    }

    fn merge(mut self, other: &Self, grid: &Grid) -> Self {
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
    fn cheapest(&self, grid: &Grid, block: usize) -> Option<Split> {
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

/// Brings the left refs to the front, in place.
fn partition(refs: &mut [Ref], grid: &Grid, split: Split, bins: &Bins) -> [Side; 2] {
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
    [Side { len, extent: left }, Side { len: right_refs.len(), extent: right }]
}

/// As [`partition`], in parallel: every chunk is told where its left and right refs go.
fn partition_wide(refs: &mut [Ref], spare: &mut [Ref], grid: &Grid, split: Split) -> [Side; 2] {
    let chunks: Vec<[Side; 2]> = refs
        .par_chunks(CHUNK)
        .map(|chunk| {
            let mut sides = [Extent::EMPTY, Extent::EMPTY].map(|extent| Side { len: 0, extent });
            for r in chunk {
                let corners = r.corners();
                let side = &mut sides[usize::from(!grid.is_left(corners, split))];
                side.len += 1;
                side.extent.include(corners);
            }
            sides
        })
        .collect();
    let mut sides = [Extent::EMPTY, Extent::EMPTY].map(|extent| Side { len: 0, extent });
    for chunk in &chunks {
        for (side, part) in sides.iter_mut().zip(chunk) {
            side.len += part.len;
            side.extent = side.extent.union(part.extent);
        }
    }
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
