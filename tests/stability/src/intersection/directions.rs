//! Directions that make numbers vanish.

use std::f64::consts::TAU;

use anyhow::Result;
use etendue_geometry::Mesh;
use etendue_geometry::glam::DVec3;
use fastrand::Rng;

use super::field::{Difference, Rays, bvh, closest, cube, embree, exact, grouped, loose, scene};
use crate::{Case, Outcome, Scale};

pub(super) const IN_THE_PLANE: Case = Case {
    name: "rays_in_the_plane",
    regime: "rays exactly in the plane of a triangle, and along the faces and edges of a closed box",
    must: "a triangle seen exactly edge-on is never hit, a closed box always is; all accelerators agree, \
        `bvh` with `exact` to the bit",
    limit: None,
    run: in_the_plane,
};

pub(super) const GRAZING: Case = Case {
    name: "grazing_rays",
    regime: "rays that meet a lone triangle at 10⁻¹⁶ to 10⁻² of a radian",
    must: "`bvh` agrees with `exact` to the bit; Embree misses none at 10⁻⁵ or steeper, and invents none",
    limit: Some(
        "In f32 a triangle that is seen flatter than about 10⁻⁶ of a radian is seen edge-on. In a closed \
         mesh its neighbours are hit instead; a lone sheet is missed. `--accel bvh` hits it.",
    ),
    run: grazing,
};

pub(super) const ZEROS: Case = Case {
    name: "axis_parallel_directions",
    regime: "directions along the axes whose other components are 0, −0, 10⁻³⁰⁰ or denormal, towards \
        the inside, the edges and the corners of a box",
    must: "all rays hit, with all accelerators, where `exact` says",
    limit: None,
    run: zeros,
};

/// The answers of `bvh` to the bit, and of Embree in what is hit.
fn agree(outcome: &mut Outcome, what: &str, meshes: Vec<Mesh>, rays: &mut Rays) -> Result<()> {
    let geometry = scene(meshes);
    let truth = exact(geometry.clone())?;
    for (name, accel) in [("bvh", bvh(geometry.clone())?), ("embree", embree(geometry)?)] {
        let mut all = Difference::default();
        for coherent in [false, true] {
            rays.set_coherent(coherent);
            all = all + Difference::between(&*truth, &*accel, rays);
        }
        let (differ, count) = (all.hits(), grouped(all.rays));
        outcome.measured(format!("{what}, {name}: {differ} of {count} hits differ"));
        outcome.must(differ == 0, || format!("{name}: {all:?}"));
        outcome.must(name != "bvh" || all.is_none(), || format!("{name}: {all:?}"));
    }
    Ok(())
}

fn triangle() -> Mesh {
    loose("triangle", &[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.5, 0.0]])
}

/// Hits of `exact` alone.
fn hits(meshes: Vec<Mesh>, rays: &Rays) -> Result<usize> {
    let truth = exact(scene(meshes))?;
    let hits = rays.batches.iter().map(|rays| {
        let hits = closest(&*truth, rays);
        (0..rays.len()).filter(|&i| hits.is_hit(i)).count()
    });
    Ok(hits.sum())
}

fn in_the_plane(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let mut random = Rng::with_seed(11);
    let mut edge_on = Rays::default();
    for _ in 0..scale.pick(2_000, 200_000) {
        let (sin, cos) = (TAU * random.f64()).sin_cos();
        let away = DVec3::new(cos, sin, 0.0);
        edge_on.push(away * 3.0, -away);
    }
    let hit = hits(vec![triangle()], &edge_on)?;
    outcome.must(hit == 0, || format!("exact: {hit} rays hit a triangle seen edge-on"));
    agree(&mut outcome, "triangle", vec![triangle()], &mut edge_on)?;
    // Along faces and edges of a box: exactly in their planes.
    let mut along = Rays::default();
    for i in 0..scale.pick(600, 60_000) {
        let place = 2.0 * random.f64() - 1.0;
        let (edge, zero) = (if i % 2 == 0 { 1.0 } else { -1.0 }, [0.0, -0.0][i / 2 % 2]);
        along.push(DVec3::new(edge, place, 3.0), DVec3::new(zero, zero, -1.0));
        along.push(DVec3::new(3.0, edge, edge), DVec3::new(-1.0, zero, -zero));
        along.push(DVec3::new(place, -3.0, edge), DVec3::new(zero, 1.0, zero));
    }
    agree(&mut outcome, "box", vec![cube()?], &mut along)?;
    let missed = along.len() - hits(vec![cube()?], &along)?;
    outcome.must(missed == 0, || format!("exact: {missed} rays along a box's faces miss it"));
    Ok(outcome)
}

fn grazing(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let mut random = Rng::with_seed(12);
    let geometry = scene(vec![triangle()]);
    let truth = exact(geometry.clone())?;
    let (ours, theirs) = (bvh(geometry.clone())?, embree(geometry)?);
    for decade in (2..=16).rev() {
        let slope = 10_f64.powi(-decade);
        let mut rays = Rays::default();
        for _ in 0..scale.pick(500, 50_000) {
            let (sin, cos) = (TAU * random.f64()).sin_cos();
            // Aimed well inside.
            let aim = DVec3::new(random.f64() - 0.5, random.f64() - 0.5, 0.0) * 0.2;
            let origin = aim + DVec3::new(cos, sin, slope) * 3.0;
            rays.push(origin, (aim - origin).normalize());
        }
        let found = Difference::between(&*truth, &*ours, &rays);
        outcome.must(found.is_none(), || format!("bvh at 1e-{decade}: {found:?}"));
        let found = Difference::between(&*truth, &*theirs, &rays);
        let holds = found.invented == 0 && (decade > 5 || found.missed == 0);
        outcome.must(holds, || format!("Embree at 1e-{decade}: {found:?}"));
        let share = 100.0 * found.missed as f64 / found.rays as f64;
        if share > 0.0 && decade < 10 {
            outcome.measured(format!("Embree misses {share:.0} % at 1e-{decade} rad"));
        }
    }
    outcome.measured("`bvh` misses none");
    Ok(outcome)
}

fn zeros(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let mut random = Rng::with_seed(13);
    let mut rays = Rays::default();
    for _ in 0..scale.pick(100, 20_000) {
        for zero in [0.0, -0.0, 1e-300, -1e-42, 5e-324] {
            // On corners and edges where the ray does not turn away from them, and within.
            let mut place = || match random.usize(0..3) {
                0 if zero == 0.0 => 1.0,
                1 if zero == 0.0 => -1.0,
                _ => 1.99 * random.f64() - 0.995,
            };
            let (s, t) = (place(), place());
            rays.push(DVec3::new(s, t, 3.0), DVec3::new(zero, zero, -1.0));
            rays.push(DVec3::new(s, t, -3.0), DVec3::new(zero, -zero, 1.0));
            rays.push(DVec3::new(-3.0, s, t), DVec3::new(1.0, zero, zero));
            rays.push(DVec3::new(s, 3.0, t), DVec3::new(-zero, -1.0, zero));
            rays.push(DVec3::new(s * 0.9, t * 0.9, 0.0), DVec3::new(zero, zero, 1.0));
        }
    }
    agree(&mut outcome, "box", vec![cube()?], &mut rays)?;
    let missed = rays.len() - hits(vec![cube()?], &rays)?;
    outcome.must(missed == 0, || format!("exact: {missed} rays miss"));
    Ok(outcome)
}
