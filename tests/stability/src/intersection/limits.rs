//! The limits of single precision, and what the instruction sets make of it.

use std::sync::Arc;

use anyhow::Result;
use etendue_accel::{BuildOptions, Embree};
use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Geometry, Transform};
use fastrand::Rng;

use super::field::{
    Difference, Rays, backends, blob, bvh, closest, cube, embree, exact, grouped, in_cube, inwards,
    loose, placed, scene,
};
use crate::{Case, Outcome, Scale};

pub(super) const SMALL_IN_WIDE: Case = Case {
    name: "small_in_a_wide_scene",
    regime: "a blob of 10⁻², 10⁻⁴, 10⁻⁵, 10⁻⁶ and 10⁻⁷ m beside the far corner of a ground of 1 km",
    must: "`bvh` finds what `exact` finds, to the bit; Embree misses at most 1 in 10⁴ of what is \
        10⁻⁵ of the scene, if not always the same of its triangles",
    limit: Some(
        "Embree's coordinates are f32 and relative to the scene's middle: what is smaller than about \
         10⁻⁶ of the scene is lost to it. `--accel bvh` finds it.",
    ),
    run: small_in_wide,
};

pub(super) const SCATTERED: Case = Case {
    name: "scattered_scene",
    regime: "blobs of 1 m, 10⁷ m apart",
    must: "`bvh` finds what `exact` finds",
    limit: Some(
        "Over 10⁷ m f32 resolves one metre, so Embree sees little of things that are a metre large. \
         `--accel bvh` keeps a frame for each of them.",
    ),
    run: scattered,
};

pub(super) const BESIDE_A_WALL: Case = Case {
    name: "starting_beside_another_wall",
    regime: "rays that leave the floor of a cube of 2 m, 10⁻³ to 10⁻¹² m from a wall",
    must: "`bvh` and `exact` always meet the cube's other side; Embree does from 10⁻⁵ m on",
    limit: Some(
        "A ray that starts nearer than about 10⁻⁶ of the scene's size to another surface may start \
         behind it in single precision.",
    ),
    run: beside_a_wall,
};

pub(super) const INSTRUCTION_SETS: Case = Case {
    name: "instruction_sets",
    regime: "Embree forced to each instruction set that the processor has (`--isa`)",
    must: "the triangles of `exact`, distances to 10⁻¹² and normals to 10⁻⁶ degrees, hit by hit; past \
        silhouettes at most 1 ray in 10⁴ differs",
    limit: None,
    run: instruction_sets,
};

fn small_in_wide(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let ground = [[-500.0, 0.0, -500.0], [500.0, 0.0, -500.0], [-500.0, 0.0, 500.0]];
    for size in [1e-2, 1e-4, 1e-5, 1e-6, 1e-7] {
        let centre = DVec3::new(-499.0, 2.0, -499.0);
        let place = Transform::new(DMat3::IDENTITY * size, centre);
        let meshes = vec![loose("ground", &ground), blob(2_000)?];
        let placements = vec![placed(0, Transform::IDENTITY), placed(1, place)];
        let geometry = Arc::new(Geometry { meshes, placements });
        let rays = inwards(scale.pick(2_000, 100_000), 0.6, &place, 5);
        let truth = exact(geometry.clone())?;
        let found = Difference::between(&*truth, &*bvh(geometry.clone())?, &rays);
        outcome.must(found.is_none(), || format!("bvh at {size:e} m: {found:?}"));
        let found = Difference::between(&*truth, &*embree(geometry)?, &rays);
        // The scene measures 10³ m, so 10⁻² m is 10⁻⁵ of it.
        let few = found.missed * 10_000 <= found.rays;
        let holds = (size < 1e-2 || few) && found.invented == 0;
        outcome.must(holds, || format!("Embree at {size:e} m: {found:?}"));
        let share = |count: usize| 100.0 * count as f64 / found.rays as f64;
        let (missed, other) = (share(found.missed), share(found.other));
        outcome.measured(format!(
            "of {size:.0e} m Embree misses {missed:.1} % and takes another triangle in {other:.1} %"
        ));
    }
    Ok(outcome)
}

fn scattered(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let centres = [DVec3::ZERO, DVec3::new(1e7, 2e6, -3e6)];
    let places = centres.map(|centre| Transform::new(DMat3::IDENTITY, centre));
    let placements = places.iter().map(|&place| placed(0, place)).collect();
    let geometry = Arc::new(Geometry { meshes: vec![blob(2_000)?], placements });
    let truth = exact(geometry.clone())?;
    let (ours, theirs) = (bvh(geometry.clone())?, embree(geometry)?);
    for (what, place) in ["the near one", "the far one"].into_iter().zip(places) {
        let rays = inwards(scale.pick(2_000, 100_000), 0.6, &place, 43);
        let found = Difference::between(&*truth, &*ours, &rays);
        outcome.must(found.is_none(), || format!("bvh, {what}: {found:?}"));
        let found = Difference::between(&*truth, &*theirs, &rays);
        let share = 100.0 * (found.missed + found.other) as f64 / found.rays as f64;
        outcome.measured(format!("Embree misses {share:.1} % of {what}"));
    }
    Ok(outcome)
}

fn beside_a_wall(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let geometry = scene(vec![cube()?]);
    let mut random = Rng::with_seed(23);
    let decades = [3, 5, 6, 7, 9, 12];
    let mut told = vec![String::new(); backends().count()];
    for decade in decades {
        let near = 10_f64.powi(-decade);
        let mut rays = Rays::default();
        for _ in 0..scale.pick(2_000, 100_000) {
            // Off the floor by what a spawned ray is off by: 32 roundings of the numbers involved.
            let up = 96.0 * f64::EPSILON;
            let z = 1.8 * random.f64() - 0.9;
            let way = in_cube(&mut random).normalize_or(DVec3::Y);
            rays.push(DVec3::new(1.0 - near, up - 1.0, z), DVec3::new(way.x, way.y.abs(), way.z));
        }
        rays.set_from_surface();
        for ((name, build), told) in backends().zip(&mut told) {
            let accel = build(geometry.clone())?;
            let mut lost = 0;
            for rays in &rays.batches {
                let hits = closest(&*accel, rays);
                lost += (0..rays.len()).filter(|&i| !hits.is_hit(i)).count();
            }
            let holds = lost == 0 || (name == "embree" && decade > 5);
            outcome.must(holds, || format!("{name} at 1e-{decade} m: {lost} rays get out"));
            let share = 100.0 * lost as f64 / rays.len() as f64;
            *told += &format!(" {share:.2} % at 1e-{decade} m,");
        }
    }
    for ((name, _), told) in backends().zip(told) {
        outcome.measured(format!("{name} loses{}", told.trim_end_matches(',')));
    }
    Ok(outcome)
}

fn instruction_sets(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let geometry = scene(vec![blob(20_000)?]);
    let truth = exact(geometry.clone())?;
    let count = scale.pick(10_000, 1_000_000);
    let mut inside = inwards(count, 0.4, &Transform::IDENTITY, 109);
    let mut anywhere = inwards(count, 1.2, &Transform::IDENTITY, 110);
    let mut tried = 0;
    for isa in ["sse2", "sse4.2", "avx", "avx2", "avx512"] {
        let options = BuildOptions { isa: Some(isa.to_owned()), ..BuildOptions::default() };
        let accel = match Embree::build(geometry.clone(), &options) {
            Ok(accel) => accel,
            Err(error) => {
                let named = error.to_string().contains(isa);
                outcome.must(named, || format!("what the processor lacks is not named: {error}"));
                outcome.measured(format!("{isa}: not on this processor"));
                continue;
            }
        };
        tried += 1;
        let (mut all, mut past) = (Difference::default(), Difference::default());
        for coherent in [false, true] {
            inside.set_coherent(coherent);
            anywhere.set_coherent(coherent);
            all = all + Difference::between(&*truth, &accel, &inside);
            past = past + Difference::between(&*truth, &accel, &anywhere);
        }
        outcome.must(all.hits() == 0 && all.distance <= 1e-12, || format!("{isa}: {all:?}"));
        outcome.must(all.normal.to_degrees() <= 1e-6, || format!("{isa}: {all:?}"));
        outcome.must(past.hits() * 10_000 <= past.rays, || format!("{isa}: {past:?}"));
        outcome.measured(format!(
            "{isa}: {} of {} hits differ, {} of {} past silhouettes",
            all.hits(),
            grouped(all.rays),
            past.hits(),
            grouped(past.rays)
        ));
    }
    outcome.must(tried > 0, || "no instruction set works here".to_owned());
    Ok(outcome)
}
