//! A binary tree of boxes over anything that has a box: the topology that both the pure-Rust
//! backends start from.
//!
//! Top-down splits by the binned surface-area heuristic (I. Wald, "On fast construction of
//! SAH-based bounding volume hierarchies", 2007): the centroids of a node's boxes fall into up to
//! 32 bins an axis, and the cheapest border between bins splits the node. Counts, minima and maxima
//! do not depend on the order they are taken in, and what is done in parallel depends on sizes
//! only, so the tree is the same for any number of threads.

mod bins;
mod node;

use bytemuck::Zeroable;
use rayon::prelude::*;

use self::bins::{BinGrid, Bins, SplitSide, halve, partition, partition_wide};
use self::node::{CHUNK, RefBounds, WIDE_NODE, half_area};
use crate::{BuildError, BuildWatch};

pub(crate) use self::node::{BinaryNode, Ref};

/// Limits at which splitting ends.
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
    pub(crate) nodes: Vec<BinaryNode>,
    pub(crate) refs: Vec<Ref>,
}

/// No path from the root is longer: past [`SAH_DEPTH`] levels nodes are halved by number.
pub(crate) const MAX_DEPTH: usize = SAH_DEPTH + 32;
const SAH_DEPTH: usize = 40;

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
        watch: &BuildWatch<'_>,
    ) -> Result<Self, BuildError> {
        if refs.is_empty() {
            return Ok(Self { nodes: Vec::new(), refs });
        }
        let mut spare = vec![Ref::zeroed(); if refs.len() >= WIDE_NODE { refs.len() } else { 0 }];
        let extent = RefBounds::of(&refs);
        let grown = BuildTask { leaf, watch }.grow(&mut refs, &mut spare, 0, 0, extent)?;
        drop(spare);
        let mut nodes = Vec::with_capacity(grown.len());
        grown.flatten(&mut nodes);
        Ok(Self { nodes, refs })
    }
}

/// A finished part of the tree. Parts built in parallel are joined once, at the end.
enum BuiltSubtree {
    Nodes(Vec<BinaryNode>),
    Split(BinaryNode, Box<(Self, Self)>),
}

impl BuiltSubtree {
    fn len(&self) -> usize {
        match self {
            Self::Nodes(nodes) => nodes.len(),
            Self::Split(_, sides) => 1 + sides.0.len() + sides.1.len(),
        }
    }

    fn flatten(self, nodes: &mut Vec<BinaryNode>) {
        match self {
            Self::Nodes(part) => nodes.extend(part),
            Self::Split(node, sides) => {
                let (left, right) = *sides;
                nodes.push(BinaryNode { link: index(1 + left.len()), ..node });
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
struct BuildTask<'a> {
    leaf: LeafSize,
    watch: &'a BuildWatch<'a>,
}

/// The nodes that a thread grows, and its bins.
struct GrownNodes {
    nodes: Vec<BinaryNode>,
    bins: Bins,
}

impl BuildTask<'_> {
    /// The subtree over `refs`, which begin at `first` in the whole.
    fn grow(
        self,
        refs: &mut [Ref],
        spare: &mut [Ref],
        first: usize,
        depth: usize,
        extent: RefBounds,
    ) -> Result<BuiltSubtree, BuildError> {
        if refs.len() < PARALLEL_NODE {
            let nodes = Vec::with_capacity(refs.len());
            let mut grown = GrownNodes { nodes, bins: Bins::EMPTY };
            self.grow_alone(refs, first, depth, extent, &mut grown);
            self.watch.advance(refs.len() as u64)?;
            return Ok(BuiltSubtree::Nodes(grown.nodes));
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
        Ok(BuiltSubtree::Split(extent.node(0, 0), Box::new((a?, b?))))
    }

    /// As [`Self::grow`], on one thread.
    fn grow_alone(
        self,
        refs: &mut [Ref],
        first: usize,
        depth: usize,
        extent: RefBounds,
        grown: &mut GrownNodes,
    ) {
        let GrownNodes { nodes, bins } = grown;
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
        self.grow_alone(a, first, depth + 1, left.extent, grown);
        grown.nodes[at].link = index(grown.nodes.len() - at);
        self.grow_alone(b, first + left.len, depth + 1, right.extent, grown);
    }

    /// Splits by the surface-area heuristic and moves `refs` accordingly. `None` when a leaf is
    /// cheaper, or when there is nothing to tell the refs apart by.
    fn divide(
        self,
        refs: &mut [Ref],
        spare: &mut [Ref],
        depth: usize,
        extent: &RefBounds,
        bins: &mut Bins,
    ) -> Option<[SplitSide; 2]> {
        let smallest = self.leaf.block.min(self.leaf.most);
        if refs.len() <= smallest || depth >= SAH_DEPTH {
            return None;
        }
        let grid = BinGrid::new(extent, refs.len());
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
        let sides = if wide {
            partition_wide(refs, spare, &grid, split)
        } else {
            partition(refs, &grid, split, bins)
        };
        // Where numbers overflow, bins may tell nothing apart; a side without refs would be no node.
        sides.iter().all(|side| side.len > 0).then_some(sides)
    }
}
