//! Boxes around many things and around their centroids.

use etendue_geometry::glam::Vec4;
use rayon::prelude::*;

use super::{CHUNK, Node, Ref, WIDE_NODE};

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

    pub(super) fn node(&self, link: u32, count: u32) -> Node {
        let three = |v: Vec4| v.truncate().to_array();
        Node { lo: three(self.lo), hi: three(self.hi), link, count }
    }
}

/// Half the surface of a box with edges `e`; the fourth component is passed over.
#[inline]
pub(super) fn half_area(e: Vec4) -> f32 {
    e.x * e.y + e.y * e.z + e.z * e.x
}
