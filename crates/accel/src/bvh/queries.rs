//! Closest hits and occlusion of batches and of blocks, by the instruction set that the machine has.

use std::marker::PhantomData;

use etendue_geometry::{HitBatch, RayBatch, RayBlock};

use super::lanes::{Lanes, Portable};
use super::packet::BatchTraversal;
use super::single::{AnyHit, Sink};
use super::wide::WideTree;
use super::{Bvh, Isa};
use crate::few::FewTriangles;
use crate::nearest::{Nearest, settle, settle_blocks};
use crate::parts::PartInstance;
use crate::{Accel, BlockAccel, BuildReport, F32Frame, Quality};

impl Bvh {
    fn run<L: Lanes, S: Sink>(&self, lanes: L, rays: &RayBatch, sink: impl FnMut(usize, S)) {
        lanes.run(BatchTraversal { lanes, bvh: self, rays, sink, seen: PhantomData });
    }

    fn dispatch<S: Sink>(&self, rays: &RayBatch, sink: impl FnMut(usize, S)) {
        match self.isa {
            Isa::Portable => self.run(Portable, rays, sink),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2(token) => self.run(token, rays, sink),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx512(token) => self.run(token, rays, sink),
        }
    }
}

impl BlockAccel for Bvh {
    fn frame(&self) -> &F32Frame {
        self.few.as_ref().map_or(F32Frame::EMPTY, FewTriangles::frame)
    }

    fn closest_of_blocks(&self, blocks: &mut [RayBlock], _times: &[f64], _coherent: bool) {
        let Some(few) = &self.few else { return };
        few.closest_of_blocks(blocks);
        settle_blocks(&self.coplanar, &self.geometry, few.frame().origin(), blocks);
    }

    fn occluded_of_blocks(&self, blocks: &mut [RayBlock], _times: &[f64], _coherent: bool) {
        if let Some(few) = &self.few {
            few.occluded_of_blocks(blocks);
        }
    }
}

impl Accel for Bvh {
    fn closest(&self, rays: &RayBatch, hits: &mut HitBatch) {
        hits.reset(rays.len());
        self.dispatch(rays, |i, nearest: Nearest| nearest.write(&self.geometry, hits, i));
        settle(&self.coplanar, &self.geometry, rays, hits);
    }

    fn blocks(&self) -> Option<&dyn BlockAccel> {
        self.few.is_some().then_some(self)
    }

    fn occluded(&self, rays: &RayBatch, blocked: &mut Vec<bool>) {
        blocked.clear();
        blocked.resize(rays.len(), false);
        self.dispatch(rays, |i, found: AnyHit| blocked[i] = found.found);
    }

    fn report(&self) -> BuildReport {
        let trees = self.parts.iter().map(|part| &part.tree).chain([&self.top]);
        let instances = self.layout.instances.capacity() * size_of::<PartInstance>();
        BuildReport {
            backend: format!("bvh {}", self.isa.name()),
            quality: Quality::Medium,
            time: self.time,
            bytes: (trees.map(WideTree::bytes).sum::<usize>() + instances) as u64,
            copied_bytes: 0,
        }
    }
}
