//! From a binary tree to one of eight children a node, by opening the child with the largest
//! surface first (I. Wald, C. Benthin, S. Boulos, "Getting rid of packets", 2008).

use std::sync::atomic::{AtomicBool, Ordering};

use etendue_geometry::Geometry;
use rayon::prelude::*;

use super::wide::{
    Arena, Child, INSTANCE_NUMBERS, LEAF_CELLS, LeafNumbers, LeafUnits, MOST_CELLS, MOST_IN_LEAF,
    NO_CHILDREN, NodeChunk, WideTree,
};
use crate::parts::{Blas, MeshTriangles};
use crate::tree::{Ref, Tree};

/// Writes the numbers of a leaf.
pub(super) trait WriteLeaf: Sync {
    /// Into `numbers`, which are zeros; answers how many are used.
    fn write(&self, refs: &[Ref], numbers: &mut LeafNumbers) -> usize;
}

/// Subtrees of about this many binary nodes are folded side by side.
const PARALLEL_NODES: usize = 1 << 13;

/// The tree of eight children a node; `None` when it has too many cells to number.
pub(super) fn fold(tree: &Tree, leaf: &impl WriteLeaf) -> Option<WideTree> {
    let Some(root) = tree.nodes.first() else { return Some(WideTree::default()) };
    // The top of the tree, and its subtrees side by side.
    let mut top = TreeCollapse::new(tree, leaf);
    top.later = Some(Vec::new());
    top.node(0, tree.nodes.len());
    let later = top.later.take().unwrap_or_default();
    let mut pieces: Vec<Piece> = later
        .par_iter()
        .map(|subtree| {
            let mut fold = TreeCollapse::new(tree, leaf);
            fold.node(subtree.root, subtree.size);
            fold.piece
        })
        .collect();
    // Where each piece will stand, and who refers to it.
    let mut place = top.piece.cells.len();
    for (subtree, piece) in later.iter().zip(&mut pieces) {
        piece.place = place;
        place += piece.cells.len();
        top.piece.set_child(subtree.parent, subtree.slot, piece.place, 0);
    }
    let len = place + LEAF_CELLS;
    if len > MOST_CELLS {
        return None;
    }
    // All pieces into one piece of memory.
    let cells = Arena::new(len, |cells| {
        let mut targets = Vec::with_capacity(pieces.len() + 1);
        let mut rest = cells;
        for mut piece in std::iter::once(top.piece).chain(pieces) {
            let (mine, others) = rest.split_at_mut(piece.cells.len());
            rest = others;
            piece.settle();
            targets.push((mine, piece));
        }
        targets.into_par_iter().for_each(|(mine, piece)| mine.copy_from_slice(&piece.cells));
    });
    Some(WideTree { cells, lo: root.lo, hi: root.hi })
}

/// A part of the tree whose place in the whole is not known yet.
#[derive(Default)]
struct Piece {
    cells: Vec<NodeChunk>,
    /// First cells of its nodes.
    nodes: Vec<usize>,
    place: usize,
}

impl Piece {
    fn set_child(&mut self, node: usize, slot: usize, place: usize, count: usize) {
        // A place that is too large is found out before anyone reads it.
        let child = Child::new(place % MOST_CELLS, count);
        self.cells[node + 6].0[slot] = f32::from_bits(child.0);
    }

    /// Makes the places of children those in the whole. The first piece knows them already.
    fn settle(&mut self) {
        if self.place == 0 {
            return;
        }
        for &node in &self.nodes {
            let children = &mut self.cells[node + 6].0;
            *children = children.map(|bits| {
                let child = Child(bits.to_bits());
                f32::from_bits(Child::new(child.place() + self.place, child.count()).0)
            });
        }
    }
}

struct TreeCollapse<'a, L> {
    tree: &'a Tree,
    leaf: &'a L,
    piece: Piece,
    /// Subtrees that are left for other threads; `None` where all is folded at once.
    later: Option<Vec<Subtree>>,
}

struct Subtree {
    /// The node and the slot in it that it hangs from.
    parent: usize,
    slot: usize,
    /// Its binary root and number of binary nodes.
    root: usize,
    size: usize,
}

/// Up to eight binary nodes, each with the number of nodes in its subtree.
struct Children {
    list: [(usize, usize); 8],
    len: usize,
}

impl<'a, L: WriteLeaf> TreeCollapse<'a, L> {
    fn new(tree: &'a Tree, leaf: &'a L) -> Self {
        Self { tree, leaf, piece: Piece::default(), later: None }
    }

    /// Appends the node for the `size` binary nodes from `root` on, and what is below it.
    fn node(&mut self, root: usize, size: usize) {
        let at = self.piece.cells.len();
        let children = self.open(root, size);
        // The boxes of its children.
        let mut node = NO_CHILDREN;
        for (slot, &(child, _)) in children.list[..children.len].iter().enumerate() {
            let child = &self.tree.nodes[child];
            for axis in 0..3 {
                node[2 * axis].0[slot] = child.lo[axis];
                node[2 * axis + 1].0[slot] = child.hi[axis];
            }
        }
        // Leaves follow their node; subtrees follow these, or are left for later when they are
        // large.
        self.piece.cells.extend(node);
        self.piece.nodes.push(at);
        for (slot, &(child, _)) in children.list[..children.len].iter().enumerate() {
            if let Some(range) = self.tree.nodes[child].leaf() {
                self.write_leaf(at, slot, range);
            }
        }
        for (slot, &(child, size)) in children.list[..children.len].iter().enumerate() {
            if self.tree.nodes[child].leaf().is_some() {
                continue;
            }
            if let Some(later) = &mut self.later
                && size <= PARALLEL_NODES
            {
                later.push(Subtree { parent: at, slot, root: child, size });
            } else {
                self.piece.set_child(at, slot, self.piece.cells.len(), 0);
                self.node(child, size);
            }
        }
    }

    /// The descendants of `root` that become children of one node.
    fn open(&self, root: usize, size: usize) -> Children {
        let area = |child: usize| {
            let node = &self.tree.nodes[child];
            if node.leaf().is_some() { -1.0 } else { node.area() }
        };
        let mut children = Children { list: [(root, size); 8], len: 1 };
        let mut areas = [area(root); 8];
        while children.len < 8 {
            let mut slot = 0;
            for other in 1..children.len {
                if areas[other] > areas[slot] {
                    slot = other;
                }
            }
            if areas[slot] < 0.0 {
                break;
            }
            let (child, size) = children.list[slot];
            let right = self.tree.nodes[child].right();
            children.list[slot] = (child + 1, right - 1);
            children.list[children.len] = (child + right, size - right);
            areas[slot] = area(child + 1);
            areas[children.len] = area(child + right);
            children.len += 1;
        }
        children
    }

    fn write_leaf(&mut self, node: usize, slot: usize, range: std::ops::Range<usize>) {
        let mut cells = [NodeChunk([0.0; 8]); LEAF_CELLS];
        let numbers: &mut [LeafNumbers; 1] = bytemuck::cast_mut(&mut cells);
        let refs = &self.tree.refs[range];
        let used = self.leaf.write(refs, &mut numbers[0]);
        let place = self.piece.cells.len();
        self.piece.cells.extend(&cells[..used.div_ceil(8)]);
        self.piece.set_child(node, slot, place, refs.len());
    }
}

/// Leaves of triangles.
pub(super) struct Triangles<'a> {
    pub(super) part: &'a Blas,
    pub(super) geometry: &'a Geometry,
    /// Source of all triangles; `None` where placements have to be told apart.
    pub(super) only: Option<MeshTriangles<'a>>,
    /// Map from the leaves' coordinates to the mesh's, and whether it holds for all.
    pub(super) units: LeafUnits,
    pub(super) is_exact: AtomicBool,
}

impl WriteLeaf for Triangles<'_> {
    #[expect(clippy::cast_possible_truncation, reason = "single precision finds")]
    fn write(&self, refs: &[Ref], numbers: &mut LeafNumbers) -> usize {
        let n = refs.len().min(MOST_IN_LEAF);
        let was_exact = self.is_exact.load(Ordering::Relaxed);
        let mut is_exact = was_exact;
        for (i, r) in refs.iter().take(n).enumerate() {
            let source = match &self.only {
                Some(source) => *source,
                None => self.part.source(self.geometry, r.first),
            };
            for (k, corner) in source.corners(r.second).into_iter().enumerate() {
                for (axis, coordinate) in corner.to_array().into_iter().enumerate() {
                    numbers[(3 * k + axis) * n + i] = coordinate as f32;
                }
            }
            numbers[9 * n + i] = f32::from_bits(r.second);
            if self.only.is_none() {
                numbers[10 * n + i] = f32::from_bits(r.first);
            }
            is_exact &= self.units.corners(numbers, n, i) == source.local_corners(r.second);
        }
        if was_exact && !is_exact {
            self.is_exact.store(false, Ordering::Relaxed);
        }
        if self.only.is_some() { 10 * n } else { 11 * n }
    }
}

/// Leaves of instances.
pub(super) struct InstanceLeafWriter;

impl WriteLeaf for InstanceLeafWriter {
    fn write(&self, refs: &[Ref], numbers: &mut LeafNumbers) -> usize {
        let (leaves, _) = numbers.as_chunks_mut::<INSTANCE_NUMBERS>();
        for (leaf, r) in leaves.iter_mut().zip(refs) {
            let ([x0, y0, z0], [x1, y1, z1]) = (r.lo, r.hi);
            *leaf = [f32::from_bits(r.first), x0, y0, z0, x1, y1, z1];
        }
        refs.len() * INSTANCE_NUMBERS
    }
}
