//! A second look at rays of which Embree's answer is suspicious: by rays beside them, and by the exact test.

use etendue_geometry::glam::DVec3;
use etendue_geometry::{HitBatch, MISS, RayBatch};

use crate::embree::{CommittedScene, FoundHits, NearestSearch};
use crate::nearest::{Nearest, Query};
use crate::recheck;
use crate::single::{F32Frame, Rays32};

/// Bundles around a ray before it is believed to miss.
const TURNS: u32 = 4;

/// The second look at rays of a scene.
#[derive(Clone, Copy)]
pub(super) struct SecondLook<'a> {
    pub(super) scene: &'a CommittedScene,
    pub(super) frame: &'a F32Frame,
}

impl SecondLook<'_> {
    /// A cheap second opinion, from one ray beside each suspect: drops those that it confirms.
    pub(super) fn ask_shifted(
        &self,
        rays: &RayBatch,
        hits: &HitBatch,
        rays32: &Rays32,
        again: &mut Rays32,
        found: &mut FoundHits,
        suspects: &mut Vec<u32>,
    ) {
        again.clear();
        for &i in suspects.iter() {
            let i = i as usize;
            let t = if hits.placement[i] == MISS {
                rays32.reach(i, self.frame)
            } else {
                hits.t[i] - rays32.advance[i]
            };
            let [shift, _] = recheck::nudges(rays.direction(i), rays32.blur(i, t));
            again.push_shifted(rays32, i, shift);
        }
        self.scene.closest(again, rays.coherent, found);
        let mut k = 0;
        suspects.retain(|&i| {
            // A nearer hit contradicts the first answer, or any hit a miss.
            let t = f64::from(found.t[k]) + again.advance[k];
            let contradicts = found.placement[k] != MISS
                && t < hits.t[i as usize] - again.slack(k, f64::from(found.t[k]));
            k += 1;
            contradicts
        });
    }

    /// As [`Self::ask_shifted`], for rays of which it was only asked whether they hit anything, and
    /// that did not: by two rays on different sides of each, because nothing else betrays a leak.
    pub(super) fn ask_shifted_for_any(
        &self,
        rays: &RayBatch,
        rays32: &Rays32,
        again: &mut Rays32,
        suspects: &mut Vec<u32>,
    ) {
        if suspects.is_empty() {
            return;
        }
        again.clear();
        for &i in suspects.iter() {
            let i = i as usize;
            let blur = rays32.blur(i, rays32.reach(i, self.frame));
            for shift in recheck::nudges(rays.direction(i), blur) {
                again.push_shifted(rays32, i, shift);
            }
        }
        let mut blocked = vec![false; again.len()];
        self.scene.occluded(again, rays.coherent, &mut blocked);
        let mut blocked = blocked.as_chunks::<2>().0.iter();
        suspects.retain(|_| blocked.next().is_some_and(|[one, other]| *one || *other));
    }

    /// Decides ray `i` by the exact test on all triangles that single precision meets along it, and
    /// along rays around it.
    pub(super) fn decide(
        &self,
        rays: &RayBatch,
        hits: &mut HitBatch,
        i: usize,
        rays32: &Rays32,
        again: &mut Rays32,
        found: &mut FoundHits,
    ) {
        let first = (hits.placement[i] != MISS).then_some(hits.t[i]);
        hits.clear_hit(i);
        let nearest = self.nearest(rays, i, rays32, again, found, first);
        nearest.write(self.scene.geometry(), hits, i);
    }

    /// As [`Self::decide`], for rays of which it was only asked whether they hit anything.
    pub(super) fn decide_occlusion(
        &self,
        rays: &RayBatch,
        rays32: &Rays32,
        again: &mut Rays32,
        found: &mut FoundHits,
        suspects: &[u32],
        blocked: &mut [bool],
    ) {
        for &i in suspects {
            let nearest = self.nearest(rays, i as usize, rays32, again, found, None);
            blocked[i as usize] = nearest.placement != MISS;
        }
    }

    /// The nearest exact hit of ray `i`, of which single precision says that it is at `first`.
    fn nearest(
        &self,
        rays: &RayBatch,
        i: usize,
        rays32: &Rays32,
        again: &mut Rays32,
        found: &mut FoundHits,
        first: Option<f64>,
    ) -> Nearest {
        let Some(query) = Query::of(rays, i) else { return Nearest::none(0.0) };
        let advance = rays32.advance[i];
        let t = first.map_or_else(|| rays32.reach(i, self.frame), |t| t - advance);
        let slack = rays32.slack(i, t);
        let mut search = NearestSearch::new(self.scene.geometry(), query, advance, slack);
        // Where it should be, as rounding has it: mostly the neighbour of what was found first.
        again.clear();
        again.push_unturned(rays, rays32, i);
        self.scene.search(again, &mut search, found);
        let is_neighbour = first.is_some_and(|t| (search.nearest.t - t).abs() <= slack);
        if is_neighbour {
            return search.nearest;
        }
        let mut missed = 0;
        for turn in 0..TURNS {
            let shifts = recheck::bundle(rays.direction(i), rays32.blur(i, t), turn);
            search.missed = 0;
            self.look_with(&shifts, rays32, i, again, &mut search, found);
            if search.nearest.placement != MISS {
                return search.nearest;
            }
            missed += search.missed.count_ones();
        }
        // Triangles on nearly all sides, and none is hit: no outline, but a corner where slivers meet.
        if missed >= recheck::MOSTLY_SURROUNDED * TURNS
            && let Some(corner) = search.nearest_corner()
        {
            let shifts = recheck::away_from(corner, rays.direction(i), rays32.blur(i, t));
            self.look_with(&shifts, rays32, i, again, &mut search, found);
        }
        search.nearest
    }

    /// Searches along ray `i`, moved sideways by each of `shifts` (m).
    fn look_with(
        &self,
        shifts: &[DVec3],
        rays32: &Rays32,
        i: usize,
        again: &mut Rays32,
        search: &mut NearestSearch<'_>,
        found: &mut FoundHits,
    ) {
        again.clear();
        for &shift in shifts {
            again.push_shifted(rays32, i, shift);
        }
        self.scene.search(again, search, found);
    }
}
