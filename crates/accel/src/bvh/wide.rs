//! The tree as it is traversed: eight boxes a node, tested side by side, and leaves of up to eight
//! triangles.
//!
//! All of it stands in one array of [`NodeChunk`]s, a node before its leaves and those before its inner
//! children, so that what is visited together lies together.
//!
//! Memory for a tree: on huge pages where there are any, because rays jump about in it and would
//! miss the processor's page tables more often than its caches.

use std::ops::Deref;

use bytemuck::{Pod, Zeroable};
use memmap2::MmapMut;

use crate::parts::PartFrame;
use etendue_geometry::glam::DVec3;

/// Eight numbers: the grain in which a tree is stored.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C, align(32))]
pub(super) struct NodeChunk(pub(super) [f32; 8]);

/// A node: the lower and upper bounds of its eight children along x, y and z, a cell each, and the
/// bits of their [`Child`]. Unused children have boxes that no ray meets.
pub(super) type WideNode = [NodeChunk; 7];

pub(super) const NO_CHILDREN: WideNode = {
    // Far outside of any frame, and finite, so that a product with 0 is 0.
    let (lower, upper) = (NodeChunk([1e30; 8]), NodeChunk([-1e30; 8]));
    [lower, upper, lower, upper, lower, upper, NodeChunk([0.0; 8])]
};

/// Position of a node or a leaf, and the number of things in a leaf: 32 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Child(pub(super) u32);

const PLACE_BITS: u32 = 28;
/// Cells that can be told apart: 8 GiB.
pub(super) const MOST_CELLS: usize = 1 << PLACE_BITS;
/// Things that a leaf can hold.
pub(super) const MOST_IN_LEAF: usize = 8;

impl Child {
    /// The root of every tree, unless it is empty.
    pub(super) const ROOT: Self = Self(0);

    /// An inner node (`count` 0) or a leaf that begins at cell `place`, less than [`MOST_CELLS`].
    #[expect(clippy::cast_possible_truncation, reason = "checked when trees are joined")]
    pub(super) fn new(place: usize, count: usize) -> Self {
        Self(place as u32 | (count as u32) << PLACE_BITS)
    }

    /// The number of things in a leaf; 0 for an inner node.
    #[inline(always)]
    pub(super) fn count(self) -> usize {
        (self.0 >> PLACE_BITS) as usize
    }

    /// The first cell.
    #[inline(always)]
    pub(super) fn place(self) -> usize {
        self.0 as usize & (MOST_CELLS - 1)
    }
}

/// A tree over triangles or over instances.
///
/// A leaf of `n` triangles has nine runs of `n` coordinates, corner by corner and axis by axis, then
/// the `n` triangles, and then, where a part has several placements, the `n` placements. A leaf of
/// instances has [`INSTANCE_NUMBERS`] for each: its number, and the lower and upper bounds of its box.
#[derive(Debug, Default)]
pub(super) struct WideTree {
    pub(super) cells: Arena,
    pub(super) lo: [f32; 3],
    pub(super) hi: [f32; 3],
}

/// Number of values that a leaf holds of an instance.
pub(super) const INSTANCE_NUMBERS: usize = 7;

/// Cells that may be read from the first of any leaf: more than eight lanes from the last run of
/// eight, and a power of two, so that a remainder is all it takes to stay within.
pub(super) const LEAF_CELLS: usize = 16;

/// The numbers of a leaf, and others behind.
pub(super) type LeafNumbers = [f32; 8 * LEAF_CELLS];

#[inline(always)]
pub(super) fn leaf_numbers(cells: &[NodeChunk], leaf: Child) -> Option<&LeafNumbers> {
    let cells = cells.get(leaf.place()..leaf.place() + LEAF_CELLS)?;
    bytemuck::cast_slice(cells).first_chunk()
}

/// The instances of a leaf: the number, the lower and the upper bounds of each.
#[inline(always)]
pub(super) fn instances_of(
    cells: &[NodeChunk],
    leaf: Child,
) -> Option<impl Iterator<Item = (usize, [f32; 3], [f32; 3])>> {
    let (instances, _) = leaf_numbers(cells, leaf)?.as_chunks::<INSTANCE_NUMBERS>();
    let instances = instances.get(..leaf.count())?.iter();
    Some(instances.map(|&[number, x0, y0, z0, x1, y1, z1]| {
        (number.to_bits() as usize, [x0, y0, z0], [x1, y1, z1])
    }))
}

impl WideTree {
    /// Mixes everything that the tree consists of into `sum` (Fowler, Noll, Vo).
    pub(super) fn fingerprint(&self, sum: u64) -> u64 {
        let numbers = self.cells.iter().flat_map(|cell| cell.0);
        numbers.fold(sum, |sum, number| {
            (sum ^ u64::from(number.to_bits())).wrapping_mul(0x0100_0000_01b3)
        })
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val::<[NodeChunk]>(&self.cells)
    }
}

/// Units of a leaf's coordinates against the mesh's: `p / scale + origin`, exactly.
#[derive(Debug, Clone, Copy)]
pub(super) struct LeafUnits {
    origin: DVec3,
    inverse_scale: f64,
}

impl LeafUnits {
    pub(super) fn of(frame: PartFrame) -> Self {
        Self { origin: frame.origin, inverse_scale: 1.0 / frame.scale }
    }

    /// The corners, in the mesh's frame, of triangle `i` of the `n` in a leaf.
    #[inline(always)]
    pub(super) fn corners(&self, numbers: &LeafNumbers, n: usize, i: usize) -> [DVec3; 3] {
        [
            self.corner(numbers, n, i),
            self.corner(numbers, n, 3 * n + i),
            self.corner(numbers, n, 6 * n + i),
        ]
    }

    #[inline(always)]
    fn corner(&self, numbers: &LeafNumbers, n: usize, first: usize) -> DVec3 {
        let at = |i: usize| f64::from(numbers[i % numbers.len()]);
        DVec3::new(at(first), at(first + n), at(first + 2 * n)) * self.inverse_scale + self.origin
    }
}

/// Cells that do not move any more.
#[derive(Debug, Default)]
pub(super) enum Arena {
    #[default]
    Empty,
    /// Mapped memory, which begins on a page.
    Mapped(MmapMut),
    /// Memory of the heap, where mapping failed.
    Heap(Vec<NodeChunk>),
}

impl Arena {
    /// `len` cells of zeros, which `fill` sets.
    pub(super) fn new(len: usize, fill: impl FnOnce(&mut [NodeChunk])) -> Self {
        if len == 0 {
            return Self::Empty;
        }
        match MmapMut::map_anon(len * size_of::<NodeChunk>()) {
            Ok(mut map) => {
                // Only a wish: without huge pages the same memory works.
                #[cfg(target_os = "linux")]
                let _ = map.advise(memmap2::Advice::HugePage);
                fill(bytemuck::cast_slice_mut(&mut map));
                Self::Mapped(map)
            }
            Err(_) => {
                let mut cells = vec![NodeChunk([0.0; 8]); len];
                fill(&mut cells);
                Self::Heap(cells)
            }
        }
    }
}

impl Deref for Arena {
    type Target = [NodeChunk];

    #[inline]
    fn deref(&self) -> &[NodeChunk] {
        match self {
            Self::Empty => &[],
            Self::Mapped(map) => bytemuck::cast_slice(map),
            Self::Heap(cells) => cells,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_begins_as_zeros_and_keeps_what_is_written() {
        let arena = Arena::new(1000, |cells| {
            assert!(cells.iter().all(|cell| cell.0 == [0.0; 8]));
            cells[999].0[7] = 1.0;
        });
        assert_eq!((arena.len(), arena[999].0[7]), (1000, 1.0));
        assert!(Arena::new(0, |_| ()).is_empty());
    }
}
