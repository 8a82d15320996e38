//! The tree as it is traversed: eight boxes a node, tested side by side.
//!
//! A binary tree is folded into one of eight children by opening the child with the largest surface
//! first (I. Wald, C. Benthin, S. Boulos, "Getting rid of packets", 2008). A leaf is a run of numbers
//! in one long array: the corners of up to eight triangles, coordinate by coordinate so that they
//! load into lanes, and who they are.

use std::sync::atomic::{AtomicBool, Ordering};

use etendue_geometry::Geometry;
use etendue_geometry::glam::DVec3;
use rayon::prelude::*;

use crate::parts::{Frame, Part};
use crate::tree::{Node, Ref, Tree};

/// Eight children with their boxes. Unused ones have boxes that no ray meets.
#[derive(Debug, Clone)]
#[repr(C, align(32))]
pub(super) struct WideNode {
    /// `[axis][lower, upper][child]`
    pub(super) bounds: [[[f32; 8]; 2]; 3],
    pub(super) child: [Child; 8],
}

/// An inner node's index, or where a leaf's numbers begin and how many things it holds, in 32 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Child(pub(super) u32);

/// Leaves begin at multiples of this many numbers (32 bytes), so that 28 bits reach 8 GiB.
const LEAF_GRAIN: usize = 8;
const INDEX_BITS: u32 = 28;
/// What an index or a leaf's place can be at most.
pub(super) const MOST: usize = 1 << INDEX_BITS;

impl Child {
    const NONE: Self = Self(0);

    fn inner(node: usize) -> Self {
        Self(index(node))
    }

    fn leaf(place: usize, count: usize) -> Self {
        Self(index(place / LEAF_GRAIN) | index(count) << INDEX_BITS)
    }

    /// The number of things in a leaf; 0 for an inner node.
    #[inline(always)]
    pub(super) fn count(self) -> usize {
        (self.0 >> INDEX_BITS) as usize
    }

    /// The inner node's index.
    #[inline(always)]
    pub(super) fn node(self) -> usize {
        self.0 as usize
    }

    /// Where the leaf's numbers begin.
    #[inline(always)]
    pub(super) fn place(self) -> usize {
        (self.0 as usize & (MOST - 1)) * LEAF_GRAIN
    }

    /// The same child once its tree stands behind others.
    fn moved(self, nodes: usize, numbers: usize) -> Self {
        match self.count() {
            0 => Self::inner(self.node() + nodes),
            count => Self::leaf(self.place() + numbers, count),
        }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "checked against MOST before the build")]
fn index(i: usize) -> u32 {
    i as u32
}

/// A tree of wide nodes over triangles or over instances.
#[derive(Debug, Default, Clone)]
pub(super) struct WideTree {
    pub(super) nodes: Vec<WideNode>,
    /// What leaves hold, see [`Leaf`].
    pub(super) numbers: Vec<f32>,
    pub(super) lo: [f32; 3],
    pub(super) hi: [f32; 3],
}

/// How a leaf's coordinates relate to the mesh's: `p / scale + origin`, exactly.
#[derive(Debug, Clone, Copy)]
pub(super) struct Units {
    pub(super) frame: Frame,
    inverse_scale: f64,
}

impl Units {
    pub(super) fn of(frame: Frame) -> Self {
        Self { frame, inverse_scale: 1.0 / frame.scale }
    }

    #[inline(always)]
    fn coordinate(&self, number: f32, origin: f64) -> f64 {
        f64::from(number) * self.inverse_scale + origin
    }

    /// The corners, in the mesh's frame, of triangle `i` of the `n` in a leaf with these numbers.
    #[inline(always)]
    pub(super) fn corners(&self, numbers: &[f32], n: usize, i: usize) -> Option<[DVec3; 3]> {
        let numbers = numbers.get(..72)?;
        let origin = self.frame.origin;
        let corner = |k: usize| {
            let at = |axis: usize| numbers.get((3 * k + axis) * n + i).copied();
            let (x, y) = (self.coordinate(at(0)?, origin.x), self.coordinate(at(1)?, origin.y));
            Some(DVec3::new(x, y, self.coordinate(at(2)?, origin.z)))
        };
        Some([corner(0)?, corner(1)?, corner(2)?])
    }
}

/// How a thing's numbers are laid out in a leaf of `n`: nine runs of `n` coordinates, corner by
/// corner and axis by axis, then the `n` triangles, and then, where a part has several placements,
/// the `n` placements. Leaves of instances have only their numbers.
pub(super) trait Leaf: Sync {
    /// Appends the numbers of a leaf.
    fn write(&self, refs: &[Ref], numbers: &mut Vec<f32>);
}

/// Numbers that may be read past a leaf's own: eight lanes from the last place of any.
const OVERRUN: usize = 96;

/// Subtrees of about this many nodes are folded side by side.
const PARALLEL_NODES: usize = 1 << 14;

impl WideTree {
    pub(super) fn fold(tree: &Tree, leaf: &impl Leaf) -> Self {
        let Some(root) = tree.nodes.first() else { return Self::default() };
        let mut top = Fold { tree, leaf, wide: Self::default(), later: Some(Vec::new()) };
        top.node(0, tree.nodes.len());
        let later = top.later.take().unwrap_or_default();
        let parts: Vec<Self> = later
            .par_iter()
            .map(|subtree| {
                let mut fold = Fold { tree, leaf, wide: Self::default(), later: None };
                fold.node(subtree.root, subtree.size);
                fold.wide
            })
            .collect();
        let mut wide = top.wide;
        wide.nodes.reserve_exact(parts.iter().map(|part| part.nodes.len()).sum());
        let numbers: usize = parts.iter().map(|part| part.numbers.len()).sum();
        wide.numbers.reserve_exact(numbers + OVERRUN);
        for (subtree, part) in later.iter().zip(parts) {
            let (nodes, numbers) = (wide.nodes.len(), wide.numbers.len());
            wide.nodes[subtree.parent].child[subtree.slot] = Child::inner(nodes);
            wide.numbers.extend_from_slice(&part.numbers);
            wide.nodes.extend(part.nodes.into_iter().map(|mut node| {
                node.child = node.child.map(|child| child.moved(nodes, numbers));
                node
            }));
        }
        wide.numbers.extend([0.0; OVERRUN]);
        Self { lo: root.lo, hi: root.hi, ..wide }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Mixes everything that the tree consists of into `sum` (Fowler, Noll, Vo).
    pub(super) fn fingerprint(&self, sum: u64) -> u64 {
        let boxes = self.nodes.iter().flat_map(|node| node.bounds.as_flattened().as_flattened());
        let children = self.nodes.iter().flat_map(|node| node.child.map(|child| child.0));
        let numbers = boxes.chain(&self.numbers).map(|number| number.to_bits());
        numbers
            .chain(children)
            .fold(sum, |sum, bits| (sum ^ u64::from(bits)).wrapping_mul(0x0100_0000_01b3))
    }

    pub(super) fn bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<WideNode>() + self.numbers.capacity() * size_of::<f32>()
    }
}

struct Fold<'a, L> {
    tree: &'a Tree,
    leaf: &'a L,
    wide: WideTree,
    /// Subtrees that are left for other threads; `None` where all is folded at once.
    later: Option<Vec<Subtree>>,
}

struct Subtree {
    /// The wide node and the slot in it that it hangs from.
    parent: usize,
    slot: usize,
    /// Its binary root and number of binary nodes.
    root: usize,
    size: usize,
}

impl<L: Leaf> Fold<'_, L> {
    /// Appends the wide node for the `size` binary nodes from `root` on, and what is below it.
    fn node(&mut self, root: usize, size: usize) {
        let at = self.wide.nodes.len();
        let children = self.open(root, size);
        let mut node = WideNode {
            bounds: [[[f32::INFINITY; 8], [f32::NEG_INFINITY; 8]]; 3],
            child: [Child::NONE; 8],
        };
        for (slot, &(child, _)) in children.iter().enumerate() {
            let Node { lo, hi, .. } = self.tree.nodes[child];
            for axis in 0..3 {
                node.bounds[axis][0][slot] = lo[axis];
                node.bounds[axis][1][slot] = hi[axis];
            }
        }
        self.wide.nodes.push(node);
        for (slot, (child, size)) in children.into_iter().enumerate() {
            if let Some(range) = self.tree.nodes[child].leaf() {
                self.wide.nodes[at].child[slot] = self.write_leaf(range);
            } else if let Some(later) = &mut self.later
                && size <= PARALLEL_NODES
            {
                later.push(Subtree { parent: at, slot, root: child, size });
            } else {
                self.wide.nodes[at].child[slot] = Child::inner(self.wide.nodes.len());
                self.node(child, size);
            }
        }
    }

    /// Up to eight descendants of `root` that cover it, each with its number of binary nodes.
    fn open(&self, root: usize, size: usize) -> Vec<(usize, usize)> {
        let mut children = vec![(root, size)];
        while children.len() < 8 {
            let area = |&(child, _): &(usize, usize)| {
                let node = &self.tree.nodes[child];
                if node.leaf().is_some() { -1.0 } else { node.area() }
            };
            let areas = children.iter().map(area).enumerate();
            let largest = areas.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|&(_, area)| area >= 0.0);
            let Some((slot, _)) = largest else { break };
            let (child, size) = children[slot];
            let right = self.tree.nodes[child].right();
            children[slot] = (child + 1, right - 1);
            children.insert(slot + 1, (child + right, size - right));
        }
        children
    }

    fn write_leaf(&mut self, range: std::ops::Range<usize>) -> Child {
        let numbers = &mut self.wide.numbers;
        let leaf = Child::leaf(numbers.len(), range.len());
        self.leaf.write(&self.tree.refs[range], numbers);
        numbers.resize(numbers.len().next_multiple_of(LEAF_GRAIN), 0.0);
        leaf
    }
}

/// Leaves of triangles.
pub(super) struct Triangles<'a> {
    pub(super) part: &'a Part,
    pub(super) geometry: &'a Geometry,
    /// Whether placements have to be told apart.
    pub(super) placements: bool,
    /// How the mesh's coordinates would follow from the leaves', and whether they all do.
    pub(super) units: Units,
    pub(super) is_exact: AtomicBool,
}

impl Leaf for Triangles<'_> {
    #[expect(clippy::cast_possible_truncation, reason = "single precision finds")]
    fn write(&self, refs: &[Ref], numbers: &mut Vec<f32>) {
        let (n, start) = (refs.len(), numbers.len());
        numbers.resize(start + 72, 0.0);
        let mut is_exact = self.is_exact.load(Ordering::Relaxed);
        for (i, r) in refs.iter().enumerate() {
            let corners = self.part.corners(self.geometry, r.first, r.second);
            for (k, coordinate) in corners.iter().flat_map(|c| c.to_array()).enumerate() {
                numbers[start + k * n + i] = coordinate as f32;
            }
            if is_exact {
                let original = self.part.local_corners(self.geometry, r.first, r.second);
                is_exact = self.units.corners(&numbers[start..], n, i) == Some(original);
            }
        }
        if !is_exact {
            self.is_exact.store(false, Ordering::Relaxed);
        }
        numbers.truncate(start + 9 * n);
        numbers.extend(refs.iter().map(|r| f32::from_bits(r.second)));
        if self.placements {
            numbers.extend(refs.iter().map(|r| f32::from_bits(r.first)));
        }
    }
}

/// Leaves of instances.
pub(super) struct Instances;

impl Leaf for Instances {
    fn write(&self, refs: &[Ref], numbers: &mut Vec<f32>) {
        numbers.extend(refs.iter().map(|r| f32::from_bits(r.first)));
    }
}
