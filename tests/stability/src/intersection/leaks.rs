//! Rays aimed exactly at the corners and at the middles of the edges of a closed mesh.

use anyhow::Result;
use etendue_accel::{Accel, BuildOptions, Embree};
use etendue_geometry::glam::{DQuat, DVec3};
use etendue_geometry::{Detail, HitBatch, Mesh, RayBatch, Transform};
use fastrand::Rng;
use rayon::prelude::*;

use super::field::{BATCH, at, backends, blob, direction, grouped};
use crate::{Case, Outcome, Scale};

pub(super) const DEFAULT: Case = Case {
    name: "corners_and_edges",
    regime: "rays aimed exactly at every corner and at the middle of every edge of a closed mesh, from \
        inside and outside, in packets and one by one, at the origin, at 7·10⁶ m and 1 cm in size",
    must: "no ray gets past what it aims at, with any accelerator in its default mode",
    limit: None,
    run: closest_hits,
};

pub(super) const OCCLUSION: Case = Case {
    name: "corners_and_edges_occlusion",
    regime: "the same rays, asked whether anything is in the way",
    must: "something always is, with any accelerator in its default mode",
    limit: None,
    run: occlusion,
};

pub(super) const WITHOUT_F64: Case = Case {
    name: "corners_and_edges_without_f64",
    regime: "the same with Embree's robust mode alone: no f64, no second look",
    must: "at most 1 in 1000 leaks: single precision turns the rays aside by a rounding",
    limit: Some(
        "Robust edge tests make neighbours agree on one ray, but a ray rounded to f32 can still pass \
         beside a corner. The second look in f64 is what closes it, and is on by default.",
    ),
    run: robust_alone,
};

pub(super) const FAST: Case = Case {
    name: "corners_and_edges_fast",
    regime: "the same with `--accel-mode fast`",
    must: "it leaks, and this measurement tells the modes apart: more than 1 in 1000",
    limit: Some(
        "Embree's fast mode tests the edges of neighbours with different roundings. That is what it is \
         faster by; it is never the default.",
    ),
    run: fast,
};

/// A corner is where f64 puts it, to within roundings of the coordinates.
const OF_F64: f64 = 1e-9;

/// And where f32 does.
const OF_F32: f64 = 1e-5;

/// Rays in batches, and how far (m) each has to what it aims at.
struct Aimed(Vec<(RayBatch, Vec<f64>)>);

impl Aimed {
    /// First all rays from inside, then all from outside, so that packets run side by side.
    fn at(mesh: &Mesh, place: &Transform, coherent: bool, seed: u64) -> Self {
        let mut random = Rng::with_seed(seed);
        let mut aimed = Self(Vec::new());
        for ahead in [0.0, 4.0] {
            for triangle in 0..mesh.triangles.len() {
                let local = mesh.corners(triangle);
                let away = direction(&mut random) * 0.3;
                for k in 0..3 {
                    // From ahead, so that the target is no silhouette.
                    let origin = place.point(local[k] * ahead + away);
                    let middle = (local[k] + local[(k + 1) % 3]) / 2.0;
                    for target in [local[k], middle] {
                        aimed.push(origin, place.point_from(target, origin), coherent);
                    }
                }
            }
        }
        aimed
    }

    fn push(&mut self, origin: DVec3, way: DVec3, coherent: bool) {
        if self.0.last().is_none_or(|(rays, _)| rays.len() == BATCH) {
            let rays = RayBatch::with_capacity(BATCH).with_coherence(coherent);
            self.0.push((rays, Vec::with_capacity(BATCH)));
        }
        if let Some((rays, distances)) = self.0.last_mut() {
            rays.push(origin, way.normalize());
            distances.push(way.length());
        }
    }

    fn len(&self) -> usize {
        self.0.iter().map(|(rays, _)| rays.len()).sum()
    }

    /// Number of the rays that have their closest hit behind what they aim at, by more than `slack` of its
    /// distance.
    fn past(&self, accel: &dyn Accel, slack: f64) -> usize {
        let batch = |(rays, distances): &(RayBatch, Vec<f64>)| {
            let mut hits = HitBatch::new(Detail::Distance);
            accel.closest(rays, &mut hits);
            let past = |i: &usize| hits.t[*i] > distances[*i] * (1.0 + slack);
            (0..rays.len()).filter(past).count()
        };
        self.0.par_iter().map(batch).sum()
    }

    /// Number of the rays that are found to have nothing in their way.
    fn free(&self, accel: &dyn Accel) -> usize {
        let batch = |(rays, _): &(RayBatch, Vec<f64>)| {
            let mut blocked = Vec::new();
            accel.occluded(rays, &mut blocked);
            blocked.into_iter().filter(|blocked| !blocked).count()
        };
        self.0.par_iter().map(batch).sum()
    }
}

const PLACES: [&str; 3] = ["at the origin", "at 7·10⁶ m", "1 cm in size"];

fn places() -> [Transform; 3] {
    let turned = DQuat::from_rotation_y(0.7);
    [
        Transform::IDENTITY,
        Transform::from_trs(DVec3::new(1e5, 3.0, -7e6), turned, DVec3::new(1.0, -1.5, 0.8)),
        Transform::from_trs(DVec3::new(0.2, 0.1, 0.0), turned, DVec3::splat(-0.01)),
    ]
}

/// Asks every backend for the leaks of all rays that are aimed at a mesh of so many triangles.
fn default_modes(
    triangles: u64,
    as_packets: &[bool],
    leaks_of: fn(&Aimed, &dyn Accel) -> usize,
) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    // Twelve rays a triangle, three places, packets and single rays. A mesh placed twice is an
    // instance, which is another way through Embree.
    let (once, instance) = (blob(triangles)?, blob(1_000)?);
    for (name, build) in backends() {
        let (mut leaks, mut rays) = (0, 0);
        for (seed, place) in (101..).zip(places()) {
            for (mesh, copies) in [(&once, 1), (&instance, 2)] {
                let accel = build(at(mesh.clone(), &vec![place; copies]))?;
                for &coherent in as_packets {
                    let aimed = Aimed::at(mesh, &place, coherent, seed);
                    leaks += leaks_of(&aimed, &*accel);
                    rays += aimed.len();
                }
            }
        }
        outcome.measured(format!("{name}: {leaks} of {} rays leak", grouped(rays)));
        outcome.must(leaks == 0, || format!("{name}: {leaks} of {rays} rays leak"));
    }
    Ok(outcome)
}

fn closest_hits(scale: Scale) -> Result<Outcome> {
    let triangles = scale.pick(2_000, 140_000);
    default_modes(triangles, &[false, true], |aimed, accel| aimed.past(accel, OF_F64))
}

fn occlusion(scale: Scale) -> Result<Outcome> {
    default_modes(scale.pick(2_000, 140_000), &[false, true], Aimed::free)
}

/// The share of rays that leak with `options`, told place by place.
fn share(scale: Scale, options: &BuildOptions, outcome: &mut Outcome) -> Result<f64> {
    let mesh = blob(scale.pick(3_000, 140_000))?;
    let slack = if options.refine { OF_F64 } else { OF_F32 };
    let (mut leaks, mut rays) = (0, 0);
    for (what, place) in PLACES.into_iter().zip(places()) {
        let accel = Embree::build(at(mesh.clone(), &[place]), options)?;
        let (mut here, mut asked) = (0, 0);
        for coherent in [false, true] {
            let aimed = Aimed::at(&mesh, &place, coherent, 103);
            here += aimed.past(&accel, slack);
            asked += aimed.len();
        }
        let share = 100.0 * here as f64 / asked as f64;
        let (told_here, told_asked) = (grouped(here), grouped(asked));
        outcome.measured(format!("{what} {told_here} of {told_asked} rays leak, {share:.3} %"));
        leaks += here;
        rays += asked;
    }
    Ok(leaks as f64 / rays as f64)
}

fn robust_alone(scale: Scale) -> Result<Outcome> {
    let options = BuildOptions { refine: false, ..BuildOptions::default() };
    let mut outcome = Outcome::default();
    let share = share(scale, &options, &mut outcome)?;
    outcome.must(share <= 1e-3, || format!("{share} of the rays leak"));
    Ok(outcome)
}

fn fast(scale: Scale) -> Result<Outcome> {
    let options = BuildOptions { robust: false, ..BuildOptions::default() };
    let mut outcome = Outcome::default();
    let share = share(scale, &options, &mut outcome)?;
    outcome.must(share >= 1e-3, || format!("the measurement sees no leaks: {share}"));
    Ok(outcome)
}
