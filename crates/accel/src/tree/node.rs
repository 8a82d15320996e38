//! Parts of which trees are built: boxes of things, boxes that hold many of them, and nodes.

use bytemuck::{Pod, Zeroable};
use etendue_geometry::glam::{Vec3, Vec4};
use rayon::prelude::*;

/// From this many refs on, one node's refs are binned and moved in parallel.
pub(super) const WIDE_NODE: usize = 1 << 17;

/// Refs that one thread bins or moves at a time.
pub(super) const CHUNK: usize = 1 << 14;

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
    pub(super) fn corners(&self) -> [Vec4; 2] {
        let [lo, hi]: [[f32; 4]; 2] = bytemuck::cast(*self);
        [Vec4::from_array(lo), Vec4::from_array(hi)]
    }
}

/// A node with its box. Nodes stand in depth-first order: an inner node's left child follows it,
/// its right child stands [`right`](Node::right) places after it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BinaryNode {
    pub(crate) lo: [f32; 3],
    pub(crate) hi: [f32; 3],
    /// A leaf's first ref; how far an inner node's right child is.
    pub(super) link: u32,
    /// A leaf's number of refs; 0 for an inner node.
    pub(super) count: u32,
}

impl BinaryNode {
    /// The range of refs of a leaf; `None` for an inner node.
    pub(crate) fn leaf(&self) -> Option<std::ops::Range<usize>> {
        (self.count > 0).then(|| self.link as usize..(self.link + self.count) as usize)
    }

    /// Number of places from an inner node to its right child.
    pub(crate) fn right(&self) -> usize {
        self.link as usize
    }

    /// Half the surface of the box.
    pub(crate) fn area(&self) -> f32 {
        half_area(Vec4::from((glam3(self.hi) - glam3(self.lo), 0.0)))
    }
}

fn glam3(v: [f32; 3]) -> Vec3 {
    v.into()
}

/// The boxes of a set of refs: around all of them, and around their centroids (times two).
#[derive(Debug, Clone, Copy)]
pub(super) struct RefBounds {
    pub(super) lo: Vec4,
    pub(super) hi: Vec4,
    pub(super) centroid_lo: Vec4,
    pub(super) centroid_hi: Vec4,
}

impl RefBounds {
    pub(super) const EMPTY: Self = Self {
        lo: Vec4::INFINITY,
        hi: Vec4::NEG_INFINITY,
        centroid_lo: Vec4::INFINITY,
        centroid_hi: Vec4::NEG_INFINITY,
    };

    pub(super) fn of(refs: &[Ref]) -> Self {
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
    pub(super) fn include(&mut self, [lo, hi]: [Vec4; 2]) {
        let centroid = lo + hi;
        self.lo = self.lo.min(lo);
        self.hi = self.hi.max(hi);
        self.centroid_lo = self.centroid_lo.min(centroid);
        self.centroid_hi = self.centroid_hi.max(centroid);
    }

    pub(super) fn include_centroids(&mut self, refs: &[Ref]) {
        for r in refs {
            let [lo, hi] = r.corners();
            self.centroid_lo = self.centroid_lo.min(lo + hi);
            self.centroid_hi = self.centroid_hi.max(lo + hi);
        }
    }

    pub(super) fn union(self, other: Self) -> Self {
        Self {
            lo: self.lo.min(other.lo),
            hi: self.hi.max(other.hi),
            centroid_lo: self.centroid_lo.min(other.centroid_lo),
            centroid_hi: self.centroid_hi.max(other.centroid_hi),
        }
    }

    pub(super) fn node(&self, link: u32, count: u32) -> BinaryNode {
        let three = |v: Vec4| v.truncate().to_array();
        BinaryNode { lo: three(self.lo), hi: three(self.hi), link, count }
    }
}

/// Half the surface of a box with edges `e`; the fourth component is passed over.
#[inline]
pub(super) fn half_area(e: Vec4) -> f32 {
    e.x * e.y + e.y * e.z + e.z * e.x
}
