//! Contract of every backend, tested on each: the answers of `exact`, whatever the scene.

#![expect(clippy::cast_possible_truncation, reason = "meshes and batches here are small")]

#[path = "contract/accuracy.rs"]
mod accuracy;
#[path = "contract/blocks.rs"]
mod blocks;
#[path = "contract/deforming.rs"]
mod deforming;
#[path = "contract/degenerate.rs"]
mod degenerate;
#[path = "contract/leaks.rs"]
mod leaks;
#[path = "contract/meshes.rs"]
mod meshes;
#[path = "contract/moving.rs"]
mod moving;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

#[cfg(feature = "embree")]
use etendue_accel::Embree;
use etendue_accel::{Accel, AccelName, BuildError, BuildOptions, Bvh, Exact, watertight};
use etendue_geometry::glam::{DQuat, DVec3};
use etendue_geometry::{Detail, Geometry, HitBatch, MISS, RayBatch, Transform};
use meshes::{Random, at, blob, mesh, placed, rays, scene, soup};

/// All backends, the reference first.
fn backends() -> impl Iterator<Item = AccelName> {
    AccelName::built().rev()
}

/// Each backend over `geometry`.
fn each(geometry: &Arc<Geometry>) -> Vec<(&'static str, Box<dyn Accel>)> {
    let options = BuildOptions::default();
    let build = |name: AccelName| {
        (name.name(), name.build(Arc::clone(geometry), &options).expect("the scene is sound"))
    };
    backends().map(build).collect()
}

fn closest(accel: &dyn Accel, rays: &RayBatch) -> HitBatch {
    let mut hits = HitBatch::new(Detail::Surface);
    accel.closest(rays, &mut hits);
    hits
}

/// Hits by the exact test without any tree.
fn brute_force(geometry: &Geometry, rays: &RayBatch) -> Vec<(f64, u32, u32)> {
    let nearest = |i: usize| {
        let mut best = (f64::INFINITY, MISS, MISS);
        for (p, placement) in geometry.placements.iter().enumerate() {
            let mesh = geometry.mesh_of(placement);
            for triangle in 0..mesh.triangles.len() {
                let to = |corner| placement.world_from_mesh.point_from(corner, rays.origin(i));
                let [a, b, c] = mesh.corners(triangle).map(to);
                if let Some(hit) = watertight::intersect(a, b, c, rays.direction(i))
                    && hit.t >= rays.t_min()[i]
                    && hit.t <= rays.t_max()[i]
                {
                    let found = (hit.t, p as u32, triangle as u32);
                    best = if found < best { found } else { best };
                }
            }
        }
        best
    };
    (0..rays.len()).map(nearest).collect()
}

/// Exemptions of what is left out for single precision's sake.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Found {
    /// By everyone.
    ByAll,
    /// Not by Embree, for which the triangles are too thin or too far apart to be met: its rays and
    /// corners are f32.
    NotInF32,
}

/// Every backend, as scattered rays and as packets, gives `exact`'s hits.
fn assert_all_agree(geometry: &Arc<Geometry>, rays: &RayBatch, what: &str) {
    assert_agreement(geometry, rays, what, Found::ByAll);
}

fn assert_agreement(geometry: &Arc<Geometry>, rays: &RayBatch, what: &str, found: Found) {
    let options = BuildOptions::default();
    let exact = Exact::build(Arc::clone(geometry), &options).expect("the scene is sound");
    let truth = closest(&exact, rays);
    for (name, accel) in each(geometry) {
        if name == "embree" && found == Found::NotInF32 {
            continue;
        }
        for coherent in [false, true] {
            let rays = rays.clone().with_coherence(coherent);
            let hits = closest(&*accel, &rays);
            assert_eq!(hits.len(), rays.len());
            let mut at_edges = 0;
            for i in 0..rays.len() {
                let context = || {
                    let ray = (rays.origin(i), rays.direction(i), rays.t_min()[i], rays.t_max()[i]);
                    format!("{what}, {name}, coherent {coherent}: ray {i} {ray:?}")
                };
                let ours = (hits.t[i], hits.placement[i], hits.triangle[i]);
                let theirs = (truth.t[i], truth.placement[i], truth.triangle[i]);
                if truth.placement[i] == MISS {
                    assert_eq!(ours, theirs, "{}", context());
                    continue;
                }
                let same = (ours.1, ours.2) == (theirs.1, theirs.2);
                let allowed = tolerance(name, same, &rays, i, theirs.0);
                let error = (ours.0 - theirs.0).abs();
                let wrong = error > allowed;
                if wrong && name == "embree" && is_at_edge(geometry, &rays, &truth, i) {
                    at_edges += 1;
                    continue;
                }
                assert!(error <= allowed, "{}: {ours:?} is not {theirs:?}", context());
                // Where two triangles meet, either may come first by the last digit.
                if same {
                    let turned = hits.normal(i).distance(truth.normal(i));
                    assert!(turned < 1e-8, "{}: normal", context());
                    let moved = (hits.u[i] - truth.u[i]).abs() + (hits.v[i] - truth.v[i]).abs();
                    assert!(moved < 1e-6, "{}: weights", context());
                }
            }
            assert!(at_edges * 1000 <= rays.len(), "{what}: {at_edges} rays pass along edges");
            let mut blocked = Vec::new();
            accel.occluded(&rays, &mut blocked);
            assert_eq!(blocked.len(), rays.len());
            for (i, blocked) in blocked.into_iter().enumerate() {
                assert_eq!(blocked, truth.is_hit(i), "{what}, {name}: occlusion of ray {i}");
            }
        }
    }
}

/// True if ray `i` hits its triangle so close to an open edge, or to one behind which the mesh
/// turns away, that single precision may see what is behind: within 2·10⁻⁶ of the scene's and the
/// ray's size, which is what rays are nudged by and what f32 may be off by.
fn is_at_edge(geometry: &Geometry, rays: &RayBatch, truth: &HitBatch, i: usize) -> bool {
    let placement = &geometry.placements[truth.placement[i] as usize];
    let mesh = geometry.mesh_of(placement);
    let to = |corner| placement.world_from_mesh.point_from(corner, rays.origin(i));
    let corners = mesh.corners(truth.triangle[i] as usize).map(to);
    let at = rays.direction(i) * truth.t[i];
    let size = truth.t[i].max(corners[0].length()) + geometry.loose_bounds().diagonal();
    (0..3).any(|k| {
        let (p, edge) = (corners[k], corners[(k + 1) % 3] - corners[k]);
        let along = ((at - p).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
        let way = at - (p + edge * along);
        // Sideways, as the ray sees it.
        way.cross(rays.direction(i)).length() <= 2e-6 * size
    })
}

/// Greatest difference (m) of a distance from `t`.
fn tolerance(name: &str, same_triangle: bool, rays: &RayBatch, i: usize, t: f64) -> f64 {
    // A backend may sum in another order: 1e-12 is what the contract promises.
    let digits = 1e-12 * t.abs();
    if name != "embree" {
        return digits.max(f64::MIN_POSITIVE);
    }
    // A distance far smaller than the coordinates is a difference of numbers that are rounded to
    // them, over the cosine of incidence (here at least one in 64).
    let rounding = 64.0 * f64::EPSILON * (rays.origin(i).abs().max_element() + t.abs());
    // Of two surfaces that are closer to each other than single precision resolves, a few 2⁻²⁴ of
    // the coordinates over the cosine, Embree may see the farther one.
    let size = rays.origin(i).abs().max_element() + t.abs();
    let coincident = if same_triangle { 0.0 } else { 1e-6 * size };
    digits.max(rounding).max(coincident)
}

/// `bvh` measures with the same arithmetic as `exact`, so its answers are the same bits.
fn assert_bvh_equals_exact(geometry: &Arc<Geometry>, rays: &RayBatch, what: &str) {
    let options = BuildOptions::default();
    let exact = Exact::build(Arc::clone(geometry), &options).expect("sound");
    let bvh = Bvh::build(Arc::clone(geometry), &options).expect("sound");
    let truth = closest(&exact, rays);
    for coherent in [false, true] {
        let hits = closest(&bvh, &rays.clone().with_coherence(coherent));
        for i in 0..rays.len() {
            let all = |h: &HitBatch| {
                (h.t[i], h.placement[i], h.triangle[i], h.u[i], h.v[i], h.normal(i).to_array())
            };
            assert_eq!(all(&hits), all(&truth), "{what}, coherent {coherent}: ray {i}");
        }
    }
}

#[test]
fn exact_is_what_testing_every_triangle_gives() {
    let mut random = Random(5);
    let scenes = [
        ("blob", scene(vec![blob(6)])),
        ("soup", scene(vec![soup(300, 0.4, 1)])),
        ("instances", instances(&mut random, 6)),
    ];
    for (name, geometry) in scenes {
        let rays = rays(2000, DVec3::ZERO, 1.0, 9);
        let exact = Exact::build(Arc::clone(&geometry), &BuildOptions::default()).expect("sound");
        let hits = closest(&exact, &rays);
        for (i, truth) in brute_force(&geometry, &rays).into_iter().enumerate() {
            let ours = (hits.t[i], hits.placement[i], hits.triangle[i]);
            assert_eq!(ours, truth, "{name}: ray {i}");
        }
        assert!((0..rays.len()).filter(|&i| hits.is_hit(i)).count() > 500, "{name} is hit at all");
    }
}

/// A blob and a soup, placed several times each: turned, stretched, mirrored; and a blob once.
fn instances(random: &mut Random, count: usize) -> Arc<Geometry> {
    let mut placements = vec![placed(2, Transform::IDENTITY)];
    for i in 0..count {
        let stretch = DVec3::new(1.0, if i % 2 == 0 { -0.5 } else { 0.7 }, 1.3) * 0.5;
        let transform = Transform::from_trs(random.cube(), random.rotation(), stretch);
        placements.push(placed(i as u32 % 2, transform));
    }
    at(vec![blob(5), soup(100, 0.3, 2), blob(4)], placements)
}

#[test]
fn backends_agree_on_blobs_soups_and_instances() {
    let mut random = Random(17);
    let cases = [
        ("blob", scene(vec![blob(40)])),
        ("soup", scene(vec![soup(5000, 0.1, 3)])),
        ("dense soup", scene(vec![soup(300, 0.9, 4)])),
        ("two meshes", scene(vec![blob(10), soup(200, 0.2, 6)])),
        ("instances", instances(&mut random, 40)),
    ];
    for (name, geometry) in cases {
        let rays = rays(6000, DVec3::ZERO, 1.0, 23);
        assert_all_agree(&geometry, &rays, name);
        assert_bvh_equals_exact(&geometry, &rays, name);
    }
}

#[test]
fn far_instances_and_scattered_scenes_agree() {
    let mut random = Random(41);
    let place = |p: DVec3, random: &mut Random| {
        Transform::from_trs(p, random.rotation(), DVec3::new(1.0, 1.0, -1.0))
    };
    let centre = DVec3::new(1e7, 2e6, -3e6);
    let geometry = at(
        vec![blob(20), soup(100, 0.2, 8)],
        vec![
            placed(0, place(centre, &mut random)),
            placed(0, place(DVec3::ZERO, &mut random)),
            placed(1, place(centre + 0.5, &mut random)),
            placed(0, place(centre + 1.5, &mut random)),
        ],
    );
    for seen in [centre, DVec3::ZERO] {
        let rays = rays(3000, seen, 1.0, 43);
        // Against 10⁷ m, f32 resolves 1 m.
        assert_agreement(&geometry, &rays, "scattered", Found::NotInF32);
        assert_bvh_equals_exact(&geometry, &rays, "scattered");
    }
}

/// From a hit onwards: without a limit the same place again, at a distance of a rounding or none;
/// behind a small limit the next surface.
#[test]
fn rays_that_start_on_a_surface_agree() {
    let geometry = scene(vec![blob(15)]);
    let first = rays(2000, DVec3::ZERO, 1.0, 53);
    let exact = Exact::build(Arc::clone(&geometry), &BuildOptions::default()).expect("sound");
    let hits = closest(&exact, &first);
    let mut second = RayBatch::default();
    for i in (0..first.len()).filter(|&i| hits.is_hit(i)) {
        let at = first.origin(i) + first.direction(i) * hits.t[i];
        second.push_between(at, first.direction(i), 1e-9, f64::INFINITY);
        second.push_between(at, hits.normal(i), 1e-9, 10.0);
    }
    assert_all_agree(&geometry, &second, "from the surface");
}

#[test]
fn limits_are_inclusive() {
    let square = mesh("square", &[[-1., -1., 2.], [3., -1., 2.], [-1., 3., 2.]], vec![[0, 1, 2]]);
    for (name, accel) in each(&scene(vec![square])) {
        let mut batch = RayBatch::default();
        let above = 2f64.next_up();
        for (t_min, t_max) in [(2.0, 2.0), (0.0, 2.0), (2.0, 9.0), (above, 9.0), (0.0, 1.0)] {
            batch.push_between(DVec3::ZERO, DVec3::Z, t_min, t_max);
        }
        let hits = closest(&*accel, &batch);
        let hit: Vec<bool> = (0..batch.len()).map(|i| hits.is_hit(i)).collect();
        assert_eq!(hit, [true, true, true, false, false], "{name}");
    }
}

#[test]
fn mirrored_and_flattened_placements_agree() {
    let mut random = Random(67);
    let placements = [
        DVec3::new(-1.0, 1.0, 1.0),
        DVec3::new(-1.0, -1.0, -1.0),
        DVec3::new(1.0, 1.0, 0.0),
        DVec3::new(0.0, 1.0, 0.0),
        DVec3::new(1e-7, 1.0, 1.0),
        DVec3::ZERO,
    ]
    .map(|scale| placed(0, Transform::from_trs(random.cube(), random.rotation(), scale)));
    for placements in [placements.to_vec(), placements[..1].to_vec(), placements[2..3].to_vec()] {
        let geometry = at(vec![blob(12)], placements);
        let rays = rays(3000, DVec3::ZERO, 1.5, 71);
        assert_all_agree(&geometry, &rays, "mirrored and flattened");
        assert_bvh_equals_exact(&geometry, &rays, "mirrored and flattened");
    }
}

/// Rays that make no sense miss; they do not disturb their neighbours.
#[test]
fn senseless_rays_miss() {
    let geometry = scene(vec![blob(8)]);
    let mut batch = RayBatch::default();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        batch.push(DVec3::ZERO, DVec3::X);
        batch.push(DVec3::new(bad, 0.0, 0.0), DVec3::X);
        batch.push(DVec3::ZERO, DVec3::new(0.0, bad, 0.0));
    }
    batch.push(DVec3::ZERO, DVec3::ZERO);
    batch.push_between(DVec3::ZERO, DVec3::X, 5.0, 1.0);
    batch.push_between(DVec3::ZERO, DVec3::X, f64::NAN, f64::NAN);
    batch.push(DVec3::splat(1e30), DVec3::X);
    batch.push(DVec3::splat(1e300), DVec3::NEG_Y);
    batch.push(DVec3::ZERO, DVec3::X);
    assert_all_agree(&geometry, &batch, "senseless");
    for (name, accel) in each(&geometry) {
        let hits = closest(&*accel, &batch);
        let hit: Vec<usize> = (0..batch.len()).filter(|&i| hits.is_hit(i)).collect();
        assert_eq!(hit, [0, 3, 6, batch.len() - 1], "{name}");
    }
}

/// Neighbouring rays of a small picture, as packets get them, against the same one by one.
#[test]
fn packets_agree_with_single_rays() {
    let mut random = Random(89);
    for (what, geometry) in [
        ("blob", scene(vec![blob(60)])),
        ("soup", scene(vec![soup(3000, 0.1, 10)])),
        ("instances", instances(&mut random, 20)),
    ] {
        for (eye, width) in [(DVec3::new(0.0, 0.0, 4.0), 0.8), (DVec3::splat(0.02), 3.0)] {
            let mut batch = RayBatch::default().with_coherence(true);
            for block in 0..64 {
                for pixel in 0..64 {
                    let x = f64::from(block % 8 * 8 + pixel % 8) / 32.0 - 1.0;
                    let y = f64::from(block / 8 * 8 + pixel / 8) / 32.0 - 1.0;
                    batch.push(eye, DVec3::new(x * width, y * width, -2.0).normalize());
                }
            }
            assert_all_agree(&geometry, &batch, what);
            assert_bvh_equals_exact(&geometry, &batch, what);
        }
    }
}

#[test]
fn builds_do_not_depend_on_threads() {
    let geometry = scene(vec![soup(200_000, 0.01, 11)]);
    let batch = rays(3000, DVec3::ZERO, 1.0, 97);
    let build = |threads| {
        let options = BuildOptions { threads, ..BuildOptions::default() };
        Bvh::build(Arc::clone(&geometry), &options).expect("sound")
    };
    let (one, four) = (build(1), build(4));
    assert_eq!(one.fingerprint(), four.fingerprint());
    assert_bvh_equals_exact(&geometry, &batch, "200 000 triangles");
}

#[test]
fn memory_limits_and_progress_are_heeded() {
    let geometry = scene(vec![soup(20_000, 0.1, 12)]);
    for accel in backends() {
        let name = accel.name();
        let tight = BuildOptions { memory_limit: Some(10_000), ..BuildOptions::default() };
        let refused = accel.build(Arc::clone(&geometry), &tight);
        assert!(matches!(refused, Err(BuildError::MemoryLimit { .. })), "{name}");
        let roomy = BuildOptions { memory_limit: Some(1 << 30), ..BuildOptions::default() };
        assert!(accel.build(Arc::clone(&geometry), &roomy).is_ok(), "{name}");

        let stop = BuildOptions { progress: Some(Arc::new(|_| false)), ..BuildOptions::default() };
        let stopped = accel.build(Arc::clone(&geometry), &stop);
        assert!(matches!(stopped, Err(BuildError::Stopped)), "{name}");

        let calls = Arc::new(AtomicUsize::new(0));
        let count = Arc::clone(&calls);
        let watched = BuildOptions {
            progress: Some(Arc::new(move |share| {
                assert!((0.0..=1.0).contains(&share), "{share}");
                count.fetch_add(1, Ordering::Relaxed);
                true
            })),
            ..BuildOptions::default()
        };
        let built = accel.build(Arc::clone(&geometry), &watched).expect("nothing stops it");
        assert!(calls.load(Ordering::Relaxed) > 0, "{name}");
        assert!(built.report().bytes > 0, "{name}");
    }
}
