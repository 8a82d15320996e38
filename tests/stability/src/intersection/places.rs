//! Far away, very small, very large, mirrored, twice.

use anyhow::Result;
use etendue_geometry::Transform;
use etendue_geometry::glam::{DMat3, DQuat, DVec3};

use super::field::{
    Difference, Rays, at, backends, blob, closest, direction, exact, grouped, inwards, scene,
};
use crate::{Case, Outcome, Scale};

pub(super) const FAR: Case = Case {
    name: "far_from_the_origin",
    regime: "a mesh of 1 m at 10³, 10⁴, 10⁵, 10⁶ and 10⁷ m",
    must: "distances are those of the same mesh at the origin to 10⁻⁹ m, and the same triangles are \
        hit, with all accelerators",
    limit: None,
    run: far,
};

pub(super) const SIZES: Case = Case {
    name: "sizes",
    regime: "a mesh of 10⁻⁶, 10⁻³, 10³ and 10⁶ m, once and as an instance",
    must: "the hits are those of `exact`, distances to 10⁻¹² relatively",
    limit: None,
    run: sizes,
};

pub(super) const TWICE: Case = Case {
    name: "instances_in_one_place",
    regime: "a mesh placed three times in the very same place",
    must: "the last placement is named, with all accelerators",
    limit: None,
    run: twice,
};

pub(super) const MIRRORED: Case = Case {
    name: "mirrored_instance",
    regime: "placements with one, two and three mirrored axes, and with scales that differ",
    must: "the hits are those of `exact`; seen from outside every normal faces the viewer",
    limit: None,
    run: mirrored,
};

fn far(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let mesh = blob(20_000)?;
    let near = exact(scene(vec![mesh.clone()]))?;
    let count = scale.pick(5_000, 500_000);
    for distance in [1e3, 1e4, 1e5, 1e6, 1e7] {
        let place = DVec3::new(distance, -distance, distance + 3.0);
        let there = Transform::new(DMat3::IDENTITY, place);
        let away = inwards(count, 0.6, &there, 31);
        // The near rays start exactly where the far ones do: the difference of both is exact.
        let mut here = Rays::default();
        for rays in &away.batches {
            for i in 0..rays.len() {
                here.push(rays.origin(i) - place, rays.direction(i));
            }
        }
        let mut told = format!("{distance:.0e} m:");
        for (name, build) in backends() {
            let accel = build(at(mesh.clone(), &[there]))?;
            let (mut error, mut wrong) = (0.0_f64, 0);
            for (here, away) in here.batches.iter().zip(&away.batches) {
                let (truth, hits) = (closest(&*near, here), closest(&*accel, away));
                for i in 0..away.len() {
                    let off = (truth.t[i] - hits.t[i]).abs();
                    let same = truth.triangle[i] == hits.triangle[i] || off <= 1e-9;
                    wrong += usize::from(!same);
                    if same && truth.is_hit(i) {
                        error = error.max(off);
                    }
                }
            }
            outcome.must(wrong == 0, || format!("{name} at {distance:e} m: {wrong} hits differ"));
            outcome.must(error <= 1e-9, || format!("{name} at {distance:e} m: off by {error:e} m"));
            told += &format!(" {name} {error:.0e} m");
        }
        outcome.measured(told);
    }
    Ok(outcome)
}

fn sizes(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let mesh = blob(20_000)?;
    for size in [1e-6, 1e-3, 1e3, 1e6] {
        let place = Transform::from_trs(DVec3::ZERO, DQuat::IDENTITY, DVec3::splat(size));
        let rays = inwards(scale.pick(5_000, 500_000), 0.6, &place, 47);
        let mut told = format!("{size:.0e} m:");
        for (name, build) in backends() {
            let mut all = Difference::default();
            for copies in [1, 2] {
                let geometry = at(mesh.clone(), &vec![place; copies]);
                let truth = exact(geometry.clone())?;
                all = all + Difference::between(&*truth, &*build(geometry)?, &rays);
            }
            outcome.must(all.hits() == 0, || format!("{name} at {size:e} m: {all:?}"));
            outcome.must(all.distance <= 1e-12, || format!("{name} at {size:e} m: {all:?}"));
            told += &format!(" {name} {:.0e}", all.distance);
        }
        outcome.measured(told);
    }
    Ok(outcome)
}

fn twice(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let place = Transform::from_trs(DVec3::X, DQuat::from_rotation_y(0.3), DVec3::splat(0.7));
    let geometry = at(blob(2_000)?, &[place; 3]);
    let rays = inwards(scale.pick(10_000, 1_000_000), 0.5, &place, 61);
    for (name, build) in backends() {
        let accel = build(geometry.clone())?;
        let mut earlier = 0;
        for rays in &rays.batches {
            let hits = closest(&*accel, rays);
            earlier += (0..rays.len()).filter(|&i| hits.placement[i] != 2).count();
        }
        outcome.must(earlier == 0, || format!("{name}: {earlier} hits name another or miss"));
        outcome.measured(format!("{name}: {earlier} of {} rays name another", grouped(rays.len())));
    }
    Ok(outcome)
}

fn mirrored(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let mesh = blob(2_000)?;
    let scales = [[-1.0, 1.0, 1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, -1.0], [1.0, -2.0, 0.5]];
    let mut random = fastrand::Rng::with_seed(73);
    for (name, build) in backends() {
        let mut all = Difference::default();
        let mut backs = 0;
        for stretch in scales {
            for copies in [1, 2] {
                let turn = DQuat::from_axis_angle(direction(&mut random), 1.0);
                let place = Transform::from_trs(DVec3::ONE, turn, DVec3::from(stretch));
                let geometry = at(mesh.clone(), &vec![place; copies]);
                let rays = inwards(scale.pick(2_000, 100_000), 0.5, &place, 67);
                let (truth, accel) = (exact(geometry.clone())?, build(geometry)?);
                all = all + Difference::between(&*truth, &*accel, &rays);
                for rays in &rays.batches {
                    let hits = closest(&*accel, rays);
                    for i in 0..rays.len() {
                        let normal = hits.normal(i);
                        backs += usize::from(normal.dot(rays.direction(i)) >= 0.0);
                        let unit = (normal.length() - 1.0).abs() < 1e-14;
                        outcome.must(unit, || format!("{name}: a normal of {}", normal.length()));
                    }
                }
            }
        }
        outcome.must(all.hits() == 0 && backs == 0, || format!("{name}: {backs} backs, {all:?}"));
        let (hits, rays) = (all.hits(), grouped(all.rays));
        outcome.measured(format!("{name}: {hits} of {rays} hits differ, {backs} show the back"));
    }
    Ok(outcome)
}
