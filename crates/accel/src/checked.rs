//! Embree's answers, measured in f64 and looked at again where they are suspicious.

mod second_look;

use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use etendue_geometry::block::{LANES, vector};
use etendue_geometry::{
    Coplanar, Detail, Geometry, HitBatch, HitPrecision, MISS, RayBatch, RayBlock,
};

use self::second_look::SecondLook;
use crate::embree::{CommittedScene, ExactFilter, FoundHits, version};
use crate::few::FewTriangles;
use crate::nearest::{find_lost_weights, find_lost_weights_of_blocks, settle, settle_blocks};
use crate::parts::check_scale;
use crate::recheck::EndTriangles;
use crate::single::{F32Frame, Rays32, round};
use crate::solve::{self, ChunkTriangles, HitSolutions};
use crate::{Accel, BlockAccel, BuildError, BuildOptions, BuildReport, Counts, recheck};

/// The Embree backend.
#[derive(Debug)]
pub struct Embree {
    scene: CommittedScene,
    frame: F32Frame,
    coplanar: Coplanar,
    few: Option<FewTriangles>,
    robust: bool,
    refine: bool,
    report: BuildReport,
    rechecked: AtomicU64,
    corrected: AtomicU64,
}

/// Scratch memory of a thread while it works on a batch; kept between batches.
#[derive(Default)]
struct BatchScratch {
    rays: Rays32,
    again: Rays32,
    found: FoundHits,
    solved: HitSolutions,
    lanes: Box<ChunkTriangles>,
    ends: EndTriangles,
    suspects: Vec<u32>,
    doubtful: Vec<u32>,
}

thread_local! {
    static SCRATCH: RefCell<BatchScratch> = RefCell::default();
}

impl Embree {
    /// Builds Embree's structure on `geometry`, whose buffers it shares where it can.
    ///
    /// # Errors
    ///
    /// When Embree cannot be opened, runs out of memory or of the limit, a mesh is over its 32-bit
    /// numbers, or the progress function stops it.
    pub fn build(geometry: Arc<Geometry>, options: &BuildOptions) -> Result<Self, BuildError> {
        Self::after(None, geometry, options)
    }

    fn after(
        before: Option<&Self>,
        geometry: Arc<Geometry>,
        options: &BuildOptions,
    ) -> Result<Self, BuildError> {
        // Around the frame in which f32 loses least.
        let start = Instant::now();
        let bounds = geometry.loose_bounds();
        check_scale(bounds)?;
        let frame = F32Frame::of(bounds);
        let scene = CommittedScene::build(
            geometry,
            frame.origin,
            options,
            before.map(|before| &before.scene),
        )?;
        let coplanar = Coplanar::of(scene.geometry());
        let few = FewTriangles::of(scene.geometry());
        // What was built, in words and numbers.
        let mode = match (options.robust, options.refine) {
            (true, true) => "robust + f64",
            (true, false) => "robust",
            (false, true) => "fast + f64",
            (false, false) => "fast",
        };
        let report = BuildReport {
            backend: format!("embree {} {mode}", version()?.version),
            quality: options.quality,
            time: start.elapsed(),
            bytes: scene.bytes().saturating_sub(scene.copied_bytes),
            copied_bytes: scene.copied_bytes,
        };
        Ok(Self {
            scene,
            frame,
            coplanar,
            few,
            robust: options.robust,
            refine: options.refine,
            report,
            rechecked: AtomicU64::new(0),
            corrected: AtomicU64::new(0),
        })
    }

    /// Turns normals of blocks' hits to where the placements are.
    fn turn_normals(&self, blocks: &mut [RayBlock]) {
        let Some(turns) = self.scene.turns() else { return };
        for block in blocks {
            for lane in (0..LANES).filter(|&lane| block.placement[lane] != MISS) {
                let own = vector(&block.normal, lane);
                let turned = turns[block.placement[lane] as usize] * own;
                for axis in 0..3 {
                    block.normal[axis][lane] = round(turned[axis]);
                }
            }
        }
    }

    /// Rays per packet of coherent batches, as the processor has them (1 without packets).
    #[must_use]
    pub fn packet_width(&self) -> usize {
        self.scene.packet_width()
    }

    /// True if answers are looked at a second time.
    fn checks(&self) -> bool {
        self.robust && self.refine
    }

    /// The closest hits as single precision has them.
    fn closest_as_found(&self, rays: &RayBatch, hits: &mut HitBatch, scratch: &mut BatchScratch) {
        let BatchScratch { rays: rays32, found, .. } = scratch;
        rays32.convert(rays, &self.frame);
        self.scene.closest_in_packets(rays32, rays.coherent, found);
        std::mem::swap(&mut hits.placement, &mut found.placement);
        std::mem::swap(&mut hits.triangle, &mut found.triangle);
        widen(found, &rays32.advance, hits);
        if let (Some(turns), Detail::Surface) = (self.scene.turns(), hits.detail) {
            for i in (0..rays.len()).filter(|&i| hits.placement[i] != MISS) {
                let turned = turns[hits.placement[i] as usize] * hits.normal(i);
                let unit = turned.normalize_or_zero();
                (hits.normal[0][i], hits.normal[1][i], hits.normal[2][i]) = unit.into();
            }
        }
    }

    /// True if the rays are to be decided in f64 where they start: those of surfaces.
    fn start_on_surfaces(rays: &RayBatch) -> bool {
        let set_off = || !rays.coherent && rays.t_min().iter().any(|&t_min| t_min > 0.0);
        rays.from_surface || set_off()
    }

    /// Looks again at what is wrong, and at what [`recheck`] suspects.
    fn look_again(&self, rays: &RayBatch, hits: &mut HitBatch, scratch: &mut BatchScratch) {
        let BatchScratch { rays: rays32, again, found, solved, suspects, doubtful, .. } = scratch;
        // Hits of the other side than most, and misses among hits: rays beside them are traced.
        suspects.clear();
        if solved.both_sides {
            recheck::minority_sides(hits, &solved.front, suspects);
        }
        suspects.retain(|&i| solved.valid[i as usize]);
        let could_hit = |i| rays32.can_hit(i) && self.frame.may_meet(rays, i);
        let missed = |i: usize| hits.placement[i] == MISS;
        recheck::lonely_misses(missed, hits.len(), could_hit, suspects);
        let mut rechecked = suspects.len() as u64;
        if !suspects.is_empty() {
            self.second_look().ask_shifted(rays, hits, rays32, again, found, suspects);
        }
        // What is in doubt after that is decided exactly.
        suspects.append(doubtful);
        if !solved.all_valid {
            let invalid = (0..).zip(&solved.valid).filter(|(_, valid)| !**valid);
            suspects.extend(invalid.map(|(i, _)| i));
        }
        suspects.sort_unstable();
        suspects.dedup();
        if suspects.is_empty() {
            self.count(rechecked, 0);
            return;
        }
        rechecked += suspects.len() as u64;
        let mut corrected = 0;
        for &i in suspects.iter() {
            let i = i as usize;
            let before = (hits.placement[i], hits.triangle[i]);
            self.second_look().decide(rays, hits, i, rays32, again, found);
            corrected += u64::from(before != (hits.placement[i], hits.triangle[i]));
        }
        self.count(rechecked, corrected);
    }

    /// The second look at single rays.
    fn second_look(&self) -> SecondLook<'_> {
        SecondLook { scene: &self.scene, frame: &self.frame }
    }

    fn count(&self, rechecked: u64, corrected: u64) {
        if rechecked > 0 {
            self.rechecked.fetch_add(rechecked, Ordering::Relaxed);
            self.corrected.fetch_add(corrected, Ordering::Relaxed);
        }
    }
}

/// Writes what single precision found as hits: all but their placements and triangles.
#[multiversion::multiversion(targets = "simd")]
fn widen(found: &FoundHits, advance: &[f64], hits: &mut HitBatch) {
    let n = hits.t.len();
    let HitBatch { detail, t, placement, u, v, normal, .. } = hits;
    let placement = &placement[..n];
    for (((t, &near), &ahead), &placement) in t.iter_mut().zip(&found.t).zip(advance).zip(placement)
    {
        *t = if placement == MISS { f64::INFINITY } else { f64::from(near) + ahead };
    }
    if *detail == Detail::Distance {
        return;
    }
    for (out, weights) in [u, v].into_iter().zip(&found.weights) {
        for ((out, &weight), &placement) in out.iter_mut().zip(weights).zip(placement) {
            *out = if placement == MISS { 0.0 } else { f64::from(weight.clamp(0.0, 1.0)) };
        }
    }
    let [x, y, z] = normal.each_mut().map(|axis| &mut axis[..n]);
    let [from_x, from_y, from_z] = found.normal.each_ref().map(|axis| &axis[..n]);
    for i in 0..n {
        let own = [f64::from(from_x[i]), f64::from(from_y[i]), f64::from(from_z[i])];
        let length = (own[0] * own[0] + own[1] * own[1] + own[2] * own[2]).sqrt();
        let scale = if placement[i] == MISS { 0.0 } else { 1.0 / length };
        let keep = |axis: f64| if placement[i] == MISS { 0.0 } else { axis * scale };
        x[i] = keep(own[0]);
        y[i] = keep(own[1]);
        z[i] = keep(own[2]);
    }
}

impl Accel for Embree {
    fn closest(&self, rays: &RayBatch, hits: &mut HitBatch) {
        hits.resize(rays.len());
        SCRATCH.with_borrow_mut(|scratch| {
            if rays.precision == HitPrecision::Single {
                self.closest_as_found(rays, hits, scratch);
                if hits.detail == Detail::Surface {
                    find_lost_weights(self.scene.geometry(), rays, hits);
                }
                return settle(&self.coplanar, self.scene.geometry(), rays, hits);
            }
            let geometry = self.scene.geometry();
            scratch.doubtful.clear();
            scratch.rays.convert(rays, &self.frame);
            // Embree finds; rays that start on surfaces have their hits judged on the way.
            if self.checks() && Self::start_on_surfaces(rays) {
                scratch.ends.spare(geometry, rays, &mut scratch.rays, &mut scratch.lanes);
                let mut judged =
                    ExactFilter::new(geometry, rays, &scratch.rays, &mut scratch.doubtful);
                self.scene.closest_from_surfaces(&scratch.rays, &mut judged, &mut scratch.found);
            } else {
                if !self.checks() && Self::start_on_surfaces(rays) {
                    scratch.rays.keep_clear(rays);
                }
                self.scene.closest(&scratch.rays, rays.coherent, &mut scratch.found);
            }
            // f64 measures.
            std::mem::swap(&mut hits.placement, &mut scratch.found.placement);
            std::mem::swap(&mut hits.triangle, &mut scratch.found.triangle);
            // f64 measures, and what is in doubt is looked at again.
            solve::solve(geometry, rays, hits, &mut scratch.lanes, &mut scratch.solved);
            if self.checks() {
                self.look_again(rays, hits, scratch);
            } else if !self.refine {
                for i in (0..rays.len()).filter(|&i| hits.placement[i] != MISS) {
                    hits.t[i] = f64::from(scratch.found.t[i]) + scratch.rays.advance[i];
                }
            }
            settle(&self.coplanar, geometry, rays, hits);
        });
    }

    fn occluded(&self, rays: &RayBatch, blocked: &mut Vec<bool>) {
        blocked.clear();
        blocked.resize(rays.len(), false);
        SCRATCH.with_borrow_mut(|scratch| {
            let BatchScratch {
                rays: rays32, again, found, suspects, doubtful, ends, lanes, ..
            } = scratch;
            rays32.convert(rays, &self.frame);
            if rays.precision == HitPrecision::Single {
                self.scene.occluded_in_packets(rays32, rays.coherent, blocked);
                return;
            }
            if !self.checks() {
                if Self::start_on_surfaces(rays) {
                    rays32.keep_clear(rays);
                }
                self.scene.occluded(rays32, rays.coherent, blocked);
                return;
            }
            doubtful.clear();
            let geometry = self.scene.geometry();
            ends.spare(geometry, rays, rays32, lanes);
            let mut judged = ExactFilter::new(geometry, rays, rays32, doubtful);
            self.scene.occluded_exactly(rays32, rays.coherent, &mut judged, blocked);
            doubtful.retain(|&i| !blocked[i as usize]);
            doubtful.sort_unstable();
            doubtful.dedup();
            self.second_look().decide_occlusion(rays, rays32, again, found, doubtful, blocked);
            // Only now, as those that were decided tell which misses are lonely.
            let could_hit = |i| rays32.can_hit(i) && self.frame.may_meet(rays, i);
            suspects.clear();
            recheck::lonely_misses(|i| !blocked[i], blocked.len(), could_hit, suspects);
            suspects.retain(|i| doubtful.binary_search(i).is_err());
            self.second_look().ask_shifted_for_any(rays, rays32, again, suspects);
            self.second_look().decide_occlusion(rays, rays32, again, found, suspects, blocked);
            doubtful.append(suspects);
            let corrected = doubtful.iter().filter(|&&i| blocked[i as usize]).count() as u64;
            self.count(doubtful.len() as u64, corrected);
        });
    }

    fn blocks(&self) -> Option<&dyn BlockAccel> {
        (self.few.is_some() || CommittedScene::takes_blocks()).then_some(self)
    }

    fn rebuilt(
        &self,
        geometry: Arc<Geometry>,
        options: &BuildOptions,
    ) -> Option<Result<Box<dyn Accel>, BuildError>> {
        let rebuilt = Self::after(Some(self), geometry, options);
        Some(rebuilt.map(|embree| Box::new(embree) as Box<dyn Accel>))
    }

    fn report(&self) -> BuildReport {
        self.report.clone()
    }

    fn counts(&self) -> Counts {
        Counts {
            rechecked: self.rechecked.load(Ordering::Relaxed),
            corrected: self.corrected.load(Ordering::Relaxed),
        }
    }
}

impl BlockAccel for Embree {
    fn frame(&self) -> &F32Frame {
        &self.frame
    }

    fn closest_of_blocks(&self, blocks: &mut [RayBlock], _times: &[f64], coherent: bool) {
        match &self.few {
            Some(few) => few.closest_of_blocks(blocks),
            None => {
                self.scene.closest_of_blocks(blocks, coherent);
                self.turn_normals(blocks);
                find_lost_weights_of_blocks(self.scene.geometry(), self.frame.origin, blocks);
            }
        }
        settle_blocks(&self.coplanar, self.scene.geometry(), self.frame.origin, blocks);
    }

    fn occluded_of_blocks(&self, blocks: &mut [RayBlock], _times: &[f64], coherent: bool) {
        match &self.few {
            Some(few) => few.occluded_of_blocks(blocks),
            None => self.scene.occluded_of_blocks(blocks, coherent),
        }
    }
}
