//! Scenes that no sound program writes and that files hold all the same: points, lines, needles, and
//! much in one place. Nothing here may end the process, and what has an area is found by its number.

use etendue_accel::Quality;
use etendue_geometry::glam::DMat3;
use etendue_geometry::{Mesh, Positions};

use super::*;

const QUALITIES: [Quality; 3] = [Quality::Low, Quality::Medium, Quality::High];

/// Every backend and quality over `geometry` finds, or refuses in words, what `exact` does; rays are
/// aimed at the middles of triangles.
fn assert_survives(geometry: &Arc<Geometry>, rays: &RayBatch, what: &str) {
    for own in backends() {
        let name = own.name();
        for quality in QUALITIES {
            for (compact, robust) in [(false, true), (true, true), (false, false)] {
                let options =
                    BuildOptions { quality, compact, robust, threads: 2, ..Default::default() };
                match own.build(Arc::clone(geometry), &options) {
                    Ok(accel) => assert_only_areas_are_hit(geometry, &*accel, rays, what),
                    Err(BuildError::Scale { .. }) => {}
                    Err(error) => panic!("{what}, {name}, {quality:?}: {error}"),
                }
            }
        }
    }
}

fn assert_only_areas_are_hit(geometry: &Geometry, accel: &dyn Accel, rays: &RayBatch, what: &str) {
    for coherent in [false, true] {
        let rays = rays.clone().with_coherence(coherent);
        let hits = closest(accel, &rays);
        let mut blocked = Vec::new();
        accel.occluded(&rays, &mut blocked);
        for i in (0..rays.len()).filter(|&i| hits.is_hit(i)) {
            let placement = &geometry.placements[hits.placement[i] as usize];
            let mesh = geometry.mesh_of(placement);
            let corners = mesh.corners(hits.triangle[i] as usize);
            let corners = corners.map(|corner| placement.world_from_mesh.linear * corner);
            assert!(!etendue_geometry::is_degenerate(corners), "{what}: {corners:?} was hit");
        }
    }
}

/// A mesh of a few triangles of one unsound kind.
fn odd_mesh(random: &mut Random, kind: u32) -> Mesh {
    let count = [1, 2, 3, 9, 40, 700][(random.unit() * 6.0) as usize];
    let scale = [1.0, 1e-3, 1e-9, 1e-30, 1e6][(random.unit() * 5.0) as usize];
    let centre = if random.unit() < 0.5 { DVec3::splat(2.0) } else { random.cube() * 4.0 };
    let (a, b) = (random.direction(), random.direction());
    let mut points = Vec::new();
    for _ in 0..count {
        let corner = |random: &mut Random| match kind % 8 {
            // Points: all in one place, or each in its own.
            0 => DVec3::ZERO,
            1 => centre,
            // Lines.
            2 => a * (random.unit() * scale),
            // Needles.
            3 => a * random.unit() + b * (random.unit() * 1e-7 * scale),
            // In one plane, whatever the scale.
            4 => (random.cube() * scale).with_z(0.0),
            5 => random.cube() * scale,
            // On a grid of few places, so that much repeats.
            6 => (random.cube() * 1.5).round(),
            _ => (random.cube() * 1.5).round() * scale,
        };
        let first = corner(random);
        let same = matches!(kind % 8, 0 | 1) || random.unit() < 0.2;
        let mut triangle = [first; 3];
        if !same {
            triangle[1] = corner(random);
            triangle[2] = if random.unit() < 0.2 { first } else { corner(random) };
        }
        points.extend(triangle.map(|p| if kind % 8 > 1 { p + centre } else { p }.to_array()));
    }
    let triangles: Vec<[u32; 3]> = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    if random.unit() < 0.5 {
        return Mesh::new("odd", Positions::F64(points.into()), triangles.into());
    }
    let points: Vec<[f32; 3]> = points.iter().map(|p| p.map(|x| x as f32)).collect();
    mesh("odd", &points, triangles)
}

/// A place that files have: none, far, tiny, flat, a line, a point, mirrored, or as the one before.
fn odd_place(random: &mut Random) -> Transform {
    let turn = random.rotation();
    let at = if random.unit() < 0.5 { DVec3::splat(1.0) } else { random.cube() * 3.0 };
    let scale = match (random.unit() * 9.0) as u32 {
        0 => DVec3::ZERO,
        1 => DVec3::new(0.0, 0.0, 1.0),
        2 => DVec3::new(1.0, 0.0, 1.0),
        3 => DVec3::splat(1e-8),
        4 => DVec3::splat(1e-30),
        5 => DVec3::new(1.0, 1e-12, 1.0),
        6 => DVec3::splat(-1.0),
        _ => DVec3::ONE,
    };
    match (random.unit() * 4.0) as u32 {
        0 => Transform::IDENTITY,
        1 => Transform::new(DMat3::ZERO, at),
        _ => Transform::from_trs(at, turn, scale),
    }
}

fn rays_at(random: &mut Random, geometry: &Geometry) -> RayBatch {
    let mut rays = RayBatch::with_capacity(60);
    for placement in geometry.placements.iter().cycle().take(60) {
        let mesh = geometry.mesh_of(placement);
        let i = (random.unit() * mesh.triangles.len() as f64) as usize;
        let [a, b, c] = mesh.corners(i);
        let target = placement.world_from_mesh.point((a + b + c) / 3.0);
        let origin = target + random.direction() * 5.0;
        rays.push(origin, (target - origin).normalize());
    }
    rays
}

#[test]
fn degenerate_scenes_end_no_process() {
    let seed = std::env::var("ETENDUE_SEED").ok().and_then(|seed| seed.parse().ok());
    let mut random = Random(seed.unwrap_or(2029));
    for round in 0..60 {
        let meshes: Vec<_> = (0..2 + round % 5)
            .map(|_| {
                let kind = (random.unit() * 8.0) as u32;
                odd_mesh(&mut random, kind)
            })
            .collect();
        let mut placements = Vec::new();
        for mesh in 0..meshes.len() as u32 {
            let copies = if random.unit() < 0.5 { 1 } else { 1 + (random.unit() * 12.0) as u32 };
            let mut place = odd_place(&mut random);
            for _ in 0..copies {
                placements.push(placed(mesh, place));
                if random.unit() < 0.7 {
                    place = odd_place(&mut random);
                }
            }
        }
        let geometry = at(meshes, placements);
        let rays = rays_at(&mut random, &geometry);
        assert_survives(&geometry, &rays, &format!("round {round}"));
    }
}

/// Two meshes, each collapsed to one point: what Debian 12's Embree ended the process for.
#[test]
fn meshes_collapsed_to_a_point_are_left_out() {
    let point = |name| mesh(name, &[[2.0; 3]; 3], vec![[0, 1, 2]]);
    let geometry = scene(vec![point("b"), point("c")]);
    let rays = rays_at(&mut Random(1), &geometry);
    assert_survives(&geometry, &rays, "two points");
    // A node that hides its mesh by a scale of 0, and one whose mesh single precision makes a point.
    for scale in [0.0, 1e-30] {
        let hidden = Transform::from_trs(DVec3::splat(2.0), DQuat::IDENTITY, DVec3::splat(scale));
        let placements = vec![placed(0, hidden), placed(1, hidden), placed(2, Transform::IDENTITY)];
        let geometry = at(vec![blob(4), blob(4), blob(4)], placements);
        let rays = rays_at(&mut Random(2), &geometry);
        assert_survives(&geometry, &rays, "hidden");
    }
}

/// Lengths whose squares no number holds.
#[test]
fn scenes_that_no_number_holds_are_refused_by_every_backend() {
    for scale in [1e154, 1e300, 1e-150, 1e-300] {
        let place = Transform::from_trs(DVec3::ZERO, DQuat::IDENTITY, DVec3::splat(scale));
        let geometry = at(vec![blob(4)], vec![placed(0, place)]);
        for accel in backends() {
            let name = accel.name();
            let built = accel.build(Arc::clone(&geometry), &BuildOptions::default());
            assert!(matches!(built, Err(BuildError::Scale { .. })), "{name}, {scale:e}");
        }
    }
}

/// Triangles without area are left out, and those behind them keep their numbers.
#[test]
fn numbers_stay_those_of_the_file() {
    let corners = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.25, 0.0, 0.0],
        [5.0, 0.0, 0.0],
        [6.0, 0.0, 0.0],
        [5.0, 1.0, 0.0],
    ];
    let triangles = vec![[0, 0, 1], [0, 1, 3], [0, 1, 2], [4, 4, 4], [4, 5, 6]];
    let turned = Transform::from_trs(DVec3::X, DQuat::from_rotation_z(0.3), DVec3::ONE);
    for placements in [
        vec![placed(0, Transform::IDENTITY)],
        vec![placed(0, turned)],
        vec![placed(0, Transform::IDENTITY), placed(0, turned)],
    ] {
        let geometry = at(vec![mesh("odd", &corners, triangles.clone())], placements);
        for (number, placement) in geometry.placements.iter().enumerate() {
            let mut rays = RayBatch::default();
            for (x, y) in [(0.2, 0.2), (5.2, 0.2)] {
                let target = placement.world_from_mesh.point(DVec3::new(x, y, 0.0));
                rays.push(target + DVec3::Z, DVec3::NEG_Z);
            }
            for (name, accel) in each(&geometry) {
                let hits = closest(&*accel, &rays);
                assert_eq!(hits.triangle, [2, 4], "{name}, placement {number}");
                assert_eq!(hits.placement, [number as u32; 2], "{name}");
            }
        }
    }
}
