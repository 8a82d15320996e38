//! Embree's answers, measured in f64 and looked at again where they are suspicious.

use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use etendue_geometry::{Bounds, Geometry, HitBatch, MISS, RayBatch};

use crate::embree::{Found, Scene, version};
use crate::recheck::{self, BUNDLE, Candidate};
use crate::single::{self, Frame, Rays32};
use crate::solve::{self, Lanes, Solved};
use crate::{Accel, BuildError, BuildOptions, BuildReport, Counts};

/// Bundles around one place before a second look moves on behind it.
const TURNS: usize = 4;

/// Places along one ray that a second look tries.
const STEPS: usize = 64;

/// The Embree backend.
#[derive(Debug)]
pub struct Embree {
    scene: Scene,
    frame: Frame,
    robust: bool,
    refine: bool,
    report: BuildReport,
    rechecked: AtomicU64,
    corrected: AtomicU64,
}

/// What a thread needs while it works on a batch; kept between batches.
#[derive(Default)]
struct Scratch {
    rays: Rays32,
    again: Rays32,
    found: Found,
    solved: Solved,
    lanes: Box<Lanes>,
    suspects: Vec<u32>,
    candidates: Vec<Candidate>,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

impl Embree {
    /// Builds Embree's structure on `geometry`, whose buffers it shares where it can.
    ///
    /// # Errors
    ///
    /// When Embree cannot be opened, runs out of memory or of the limit, a mesh is over its 32-bit
    /// numbers, or the progress function stops it.
    pub fn build(geometry: Arc<Geometry>, options: &BuildOptions) -> Result<Self, BuildError> {
        let start = Instant::now();
        let bounds = geometry.loose_bounds();
        check_scale(bounds)?;
        let frame = Frame::of(bounds);
        let scene = Scene::build(geometry, frame.origin, options)?;
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
            robust: options.robust,
            refine: options.refine,
            report,
            rechecked: AtomicU64::new(0),
            corrected: AtomicU64::new(0),
        })
    }

    /// Rays per packet of coherent batches, as the processor has them (1 without packets).
    #[must_use]
    pub fn packet_width(&self) -> usize {
        self.scene.packet_width()
    }

    /// Looks again at what [`recheck`] suspects.
    fn look_again(&self, rays: &RayBatch, hits: &mut HitBatch, scratch: &mut Scratch) {
        let Scratch { rays: rays32, again, found, solved, lanes, suspects, candidates } = scratch;
        suspects.clear();
        if rays.len() > 1 {
            recheck::minority_sides(hits, &solved.front, suspects);
        }
        suspects.retain(|&i| solved.valid[i as usize]);
        recheck::lonely_misses(hits, |i| self.frame.may_meet(rays, i), suspects);
        // First a cheap second opinion, from one ray beside each.
        again.clear();
        for &i in suspects.iter() {
            let shift = recheck::nudge(rays.direction(i as usize), self.frame.blur());
            again.push_shifted(rays32, i as usize, shift);
        }
        let mut rechecked = again.len() as u64;
        rechecked += solved.valid.iter().filter(|valid| !**valid).count() as u64;
        self.scene.closest(again, rays.coherent, found);
        let mut kept = 0;
        for k in 0..suspects.len() {
            let i = suspects[k] as usize;
            // A nearer hit contradicts the first answer, or any hit a miss.
            let t = f64::from(found.t[k]) + again.advance[k];
            let slack = 1e-4 * self.frame.radius;
            if found.placement[k] != MISS && t < hits.t[i] - slack {
                suspects[kept] = suspects[k];
                kept += 1;
            }
        }
        suspects.truncate(kept);
        suspects.extend((0..).zip(&solved.valid).filter(|(_, valid)| !**valid).map(|(i, _)| i));
        let mut corrected = 0;
        for &i in suspects.iter() {
            let before = (hits.placement[i as usize], hits.triangle[i as usize]);
            self.ask_bundle(rays, hits, i as usize, rays32, again, found, candidates);
            let after = (hits.placement[i as usize], hits.triangle[i as usize]);
            if before != after {
                corrected += 1;
            }
            if after.0 != MISS {
                solve::solve_one(self.scene.geometry(), rays, hits, i as usize, lanes);
            } else {
                hits.clear_hit(i as usize);
            }
        }
        if rechecked > 0 {
            self.rechecked.fetch_add(rechecked, Ordering::Relaxed);
            self.corrected.fetch_add(corrected, Ordering::Relaxed);
        }
    }

    /// Decides ray `i` by the exact test on all triangles that a bundle of rays around it meets,
    /// first near the answer at hand, then behind it.
    #[expect(clippy::too_many_arguments, reason = "scratch memory, passed down once")]
    fn ask_bundle(
        &self,
        rays: &RayBatch,
        hits: &mut HitBatch,
        i: usize,
        rays32: &Rays32,
        again: &mut Rays32,
        found: &mut Found,
        candidates: &mut Vec<Candidate>,
    ) {
        candidates.clear();
        if hits.placement[i] != MISS {
            candidates.push((hits.placement[i], hits.triangle[i]));
        }
        let mut behind = rays32.t_near[i];
        // A ray along a surface grazes many triangles that it does not hit. Each step starts behind
        // the nearest of the last, so what lies along the ray bounds them.
        for _ in 0..STEPS {
            let mut nearest = f32::INFINITY;
            for turn in 0..TURNS {
                again.clear();
                for shift in recheck::bundle(rays.direction(i), self.frame.blur(), turn) {
                    again.push_shifted(rays32, i, shift);
                }
                again.t_near.fill(behind);
                self.scene.closest(again, true, found);
                for k in 0..BUNDLE {
                    if found.placement[k] != MISS {
                        let candidate = (found.placement[k], found.triangle[k]);
                        if !candidates.contains(&candidate) {
                            candidates.push(candidate);
                        }
                        nearest = nearest.min(found.t[k]);
                    }
                }
                if nearest == f32::INFINITY {
                    break;
                }
                let decided = recheck::decide(self.scene.geometry(), rays, i, candidates, hits);
                let t = hits.t[i] - rays32.advance[i];
                if decided && t <= f64::from(nearest) + self.slack(nearest) {
                    return;
                }
            }
            if nearest == f32::INFINITY {
                break;
            }
            let ahead = f64::from(nearest) + 4.0 * self.frame.blur();
            behind = nearest.next_up().max(single::round(ahead));
            if behind >= rays32.t_far[i] {
                break;
            }
        }
        recheck::decide(self.scene.geometry(), rays, i, candidates, hits);
    }

    fn slack(&self, t: f32) -> f64 {
        64.0 * (self.frame.blur() + f64::from(t) * f64::from(f32::EPSILON))
    }
}

/// Embree multiplies three lengths of a triangle, which have to stay in single precision.
fn check_scale(bounds: Bounds) -> Result<(), BuildError> {
    const LEAST: f64 = 1e-12;
    const MOST: f64 = 1e12;
    let extent = if bounds.is_empty() { 0.0 } else { (bounds.max - bounds.min).max_element() };
    if extent == 0.0 || (LEAST..=MOST).contains(&extent) {
        return Ok(());
    }
    Err(BuildError::Scale { backend: "Embree", extent, least: LEAST, most: MOST })
}

impl Accel for Embree {
    fn closest(&self, rays: &RayBatch, hits: &mut HitBatch) {
        hits.reset(rays.len());
        SCRATCH.with_borrow_mut(|scratch| {
            scratch.rays.convert(rays, &self.frame);
            self.scene.closest(&scratch.rays, rays.coherent, &mut scratch.found);
            hits.placement.copy_from_slice(&scratch.found.placement);
            hits.triangle.copy_from_slice(&scratch.found.triangle);
            solve::solve(
                self.scene.geometry(),
                rays,
                hits,
                &mut scratch.lanes,
                &mut scratch.solved,
            );
            if !self.refine {
                for i in 0..rays.len() {
                    if hits.placement[i] != MISS {
                        hits.t[i] = f64::from(scratch.found.t[i]) + scratch.rays.advance[i];
                    }
                }
            } else if self.robust {
                self.look_again(rays, hits, scratch);
            }
        });
    }

    fn occluded(&self, rays: &RayBatch, blocked: &mut Vec<bool>) {
        blocked.clear();
        blocked.resize(rays.len(), false);
        SCRATCH.with_borrow_mut(|scratch| {
            scratch.rays.convert(rays, &self.frame);
            self.scene.occluded(&scratch.rays, rays.coherent, blocked);
        });
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
