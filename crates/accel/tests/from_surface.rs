//! Rays that leave surfaces: f64 decides at their ends, whatever the backend.

use std::sync::Arc;

use etendue_accel::{Accel, AccelName, BuildOptions};
use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{
    Detail, Geometry, HitBatch, MISS, Mesh, Positions, RayBatch, Transform, Vertices,
};

/// A cube of half-edge 1, seen from within and without.
fn cube() -> Mesh {
    let corner = |k: u32| [k & 1, k >> 1 & 1, k >> 2].map(|bit| 2.0 * bit as f32 - 1.0);
    let corners: Vec<[f32; 3]> = (0..8).map(corner).collect();
    let faces =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<[u32; 3]> =
        faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Mesh::new("cube", Positions::F32(Vertices::from_arrays(&corners)), triangles.into())
}

fn backends(geometry: &Arc<Geometry>) -> Vec<Box<dyn Accel>> {
    let options = BuildOptions::default();
    AccelName::built().map(|name| name.build(Arc::clone(geometry), &options).unwrap()).collect()
}

/// From points a few roundings inside of a cube's faces, edges and corners in all directions: rays
/// into the cube meet its other side, rays out of it meet nothing, and no ray stays at its start.
#[test]
fn rays_neither_stick_nor_leak() {
    for (scale, far) in [(1.0, 0.0), (1e-3, 0.0), (1e3, 0.0), (1.0, 1e6)] {
        let place = Transform::new(DMat3::IDENTITY * scale, DVec3::splat(far));
        let geometry = Arc::new(Geometry::alone(cube(), place));
        // What a spawned ray is off by: 32 roundings of the numbers involved.
        let off = 32.0 * f64::EPSILON * 3.0 * (scale + far);
        let mut rays = RayBatch::default().from_surfaces();
        let mut ending_rays = rays.clone();
        let mut inward = Vec::new();
        let golden = 2.399_963_229_728_653;
        for k in 0..4000_u32 {
            let share = (f64::from(k) + 0.5) / 4000.0;
            // Places on the floor y = −1, near its edges as often as not. Nearer than 10⁻⁶ to another
            // wall, single precision may start behind it and never find it: docs/measurements/accuracy.md tells.
            let near = 10.0_f64.powf(-1.0 - 5.0 * (share * 7.3).fract());
            let x = if k % 3 == 0 { 1.0 - near } else { 1.9 * (share * 31.7).fract() - 0.95 };
            let z = if k % 3 == 1 { near - 1.0 } else { 1.9 * (share * 57.1).fract() - 0.95 };
            let side = if k % 2 == 0 { 1.0 } else { -1.0 };
            let up = 1.0 - (share * 91.3).fract();
            let azimuth = f64::from(k) * golden;
            let r = (1.0 - up * up).sqrt();
            let direction = DVec3::new(r * azimuth.cos(), side * up, r * azimuth.sin()).normalize();
            let origin =
                DVec3::splat(far) + DVec3::new(x, -1.0, z) * scale + DVec3::Y * (side * off);
            rays.push(origin, direction);
            let limits = [0.0, f64::INFINITY];
            // The floor is triangles 4 and 5, on both sides of its diagonal.
            let leaves = [[0, if x > z { 4 } else { 5 }], [MISS; 2]];
            ending_rays.push_between_triangles(origin, direction, limits, leaves);
            inward.push(side > 0.0);
        }
        for accel in backends(&geometry) {
            let name = accel.report().backend;
            // In packets or not, told which triangle each ray leaves or not.
            for (coherent, ending) in [(false, false), (true, false), (false, true), (true, true)] {
                let rays = if ending { &ending_rays } else { &rays };
                let rays = rays.clone().with_coherence(coherent);
                let mut hits = HitBatch::new(Detail::Surface);
                accel.closest(&rays, &mut hits);
                let mut blocked = Vec::new();
                accel.occluded(&rays, &mut blocked);
                for (i, &inward) in inward.iter().enumerate() {
                    let (o, d) = (rays.origin(i), rays.direction(i));
                    let place = format!("{name} scale {scale} far {far}: {o} along {d}");
                    assert_eq!(hits.is_hit(i), inward, "closest, {place}");
                    assert_eq!(blocked[i], inward, "occluded, {place}");
                    if inward {
                        // On the other side of the cube: not on the floor that it left.
                        let end = (o - DVec3::splat(far)) / scale + d * (hits.t[i] / scale);
                        assert!(end.y > -1.0 + 0.5 * d.y * hits.t[i] / scale, "{place}: {end}");
                        let most = end.abs().max_element();
                        assert!((most - 1.0).abs() < 1e-6 + 1e-9 * far, "{place}: {end}");
                    }
                }
                // A ray that ends a little before the wall it would meet is free.
                let mut short = rays.clone();
                for i in 0..short.len() {
                    let near = hits.t[i].min(1e30) * (1.0 - 1e-9) - off * 8.0;
                    short.arrays_mut().t_max[i] = near.max(0.0);
                }
                accel.occluded(&short, &mut blocked);
                let stuck = blocked.iter().filter(|&&b| b).count();
                assert_eq!(stuck, 0, "{name} scale {scale} far {far}");
            }
        }
    }
}
