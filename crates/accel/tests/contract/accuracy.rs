//! Counted against `exact`: leaks of rays aimed exactly at corners and edges, and errors of distances
//! and normals, of every backend in its default mode.
//!
//! Ten million rays of the first, in a few minutes:
//!
//! ```text
//! cargo test --release -p etendue-accel --test contract -- --ignored ten_million
//! ```

use super::*;

/// Rays aimed exactly at the corners and at the middles of the edges of a placed blob, from inside and
/// from outside, and how far (m) it is to what they aim at.
struct Aimed {
    rays: RayBatch,
    distance: Vec<f64>,
}

impl Aimed {
    fn at(mesh: &etendue_geometry::Mesh, transform: &Transform, random: &mut Random) -> Self {
        let mut aimed = Self { rays: RayBatch::default(), distance: Vec::new() };
        for triangle in 0..mesh.triangles.len() {
            let local = mesh.corners(triangle);
            let away = random.direction() * 0.3;
            for k in 0..3 {
                let middle = (local[k] + local[(k + 1) % 3]) / 2.0;
                for target in [local[k], middle] {
                    // Blobs can be seen whole from around their centre. From ahead, so that the
                    // target is no silhouette.
                    for origin in [away, local[k] * 4.0 + away] {
                        let way = transform.point_from(target, transform.point(origin));
                        aimed.rays.push(transform.point(origin), way.normalize());
                        aimed.distance.push(way.length());
                    }
                }
            }
        }
        aimed
    }

    /// How many of the rays got past what they aim at.
    fn leaks(&self, accel: &dyn Accel) -> usize {
        let mut leaks = 0;
        let mut hits = HitBatch::new(Detail::Distance);
        let mut blocked = Vec::new();
        for start in (0..self.rays.len()).step_by(256) {
            let range = start..self.rays.len().min(start + 256);
            let batch = slice(&self.rays, range.clone());
            accel.closest(&batch, &mut hits);
            accel.occluded(&batch, &mut blocked);
            for (k, i) in range.enumerate() {
                // The corner is where f64 puts it, to within roundings of the coordinates.
                let past = hits.t[k] > self.distance[i] * (1.0 + 1e-9);
                leaks += usize::from(past || !blocked[k]);
            }
        }
        leaks
    }
}

fn slice(rays: &RayBatch, range: std::ops::Range<usize>) -> RayBatch {
    let mut batch = RayBatch { coherent: rays.coherent, ..RayBatch::with_capacity(range.len()) };
    for i in range {
        batch.push_between(rays.origin(i), rays.direction(i), rays.t_min[i], rays.t_max[i]);
    }
    batch
}

fn places() -> [Transform; 3] {
    let turned = DQuat::from_rotation_y(0.7);
    [
        Transform::IDENTITY,
        Transform::from_trs(DVec3::new(1e5, 3.0, -7e6), turned, DVec3::new(1.0, -1.5, 0.8)),
        Transform::from_trs(DVec3::new(0.2, 0.1, 0.0), turned, DVec3::splat(-0.01)),
    ]
}

fn assert_no_leaks(detail: u32, backends: &[(&str, Build)], copies: usize, seed: u64) -> usize {
    let mesh = blob(detail);
    let mut random = Random(seed);
    let mut count = 0;
    for transform in places() {
        let mut aimed = Aimed::at(&mesh, &transform, &mut random);
        let geometry = at(vec![mesh.clone()], vec![placed(0, transform); copies]);
        for (name, build) in backends {
            let accel = build(Arc::clone(&geometry), &BuildOptions::default()).expect("sound");
            for coherent in [false, true] {
                aimed.rays.coherent = coherent;
                let leaks = aimed.leaks(&*accel);
                assert_eq!(leaks, 0, "{name}, coherent {coherent}, of {} rays", aimed.rays.len());
                count += aimed.rays.len();
            }
        }
    }
    count
}

#[test]
fn rays_aimed_at_corners_and_edges_do_not_leak() {
    assert!(assert_no_leaks(30, BACKENDS, 1, 101) > 1_000_000);
    assert_no_leaks(10, BACKENDS, 2, 102);
}

fn assert_ten_million(backend: &str) {
    let backends: Vec<_> = BACKENDS.iter().copied().filter(|(name, _)| *name == backend).collect();
    let mut count = 0;
    for seed in 0.. {
        count += assert_no_leaks(150, &backends, 1, 1000 + seed);
        if count >= 10_000_000 {
            break;
        }
    }
    println!("{backend}: 0 leaks of {count} rays");
}

#[cfg(feature = "embree")]
#[test]
#[ignore = "ten million rays; see the head of this file"]
fn ten_million_aimed_rays_do_not_leak_through_embree() {
    assert_ten_million("embree");
}

#[test]
#[ignore = "ten million rays; see the head of this file"]
fn ten_million_aimed_rays_do_not_leak_through_bvh() {
    assert_ten_million("bvh");
}

/// Without this the test above could not tell a mode that leaks from one that does not.
#[cfg(feature = "embree")]
#[test]
fn embrees_fast_mode_leaks() {
    let mesh = blob(30);
    let aimed = Aimed::at(&mesh, &Transform::IDENTITY, &mut Random(103));
    let options = BuildOptions { robust: false, ..BuildOptions::default() };
    let fast = Embree::build(scene(vec![mesh]), &options).expect("sound");
    let leaks = aimed.leaks(&fast);
    println!("fast mode: {leaks} of {} rays", aimed.rays.len());
    assert!(leaks > 0, "none of {} rays", aimed.rays.len());
}

/// Relative to the coordinates that a distance is a difference of; `exact` itself is within 16
/// roundings over the cosine of incidence, which is at least one in 64 for nearly all rays here.
const DEPTH_ERROR: f64 = 1e-12;
/// One in 10⁶ degrees.
const NORMAL_ERROR: f64 = 1e-6 * std::f64::consts::PI / 180.0;

fn assert_accurate(truth: &HitBatch, hits: &HitBatch, rays: &RayBatch, what: &str) {
    let mut same = 0;
    for i in (0..rays.len()).filter(|&i| hits.triangle[i] == truth.triangle[i]) {
        assert_eq!(hits.placement[i], truth.placement[i], "{what}: ray {i}");
        if !truth.is_hit(i) {
            continue;
        }
        same += 1;
        let steep = truth.normal(i).dot(rays.direction(i)).abs() > 1.0 / 64.0;
        let error = (hits.t[i] / truth.t[i] - 1.0).abs();
        assert!(
            !steep || error <= DEPTH_ERROR,
            "{what}: ray {i} is off by {error:e} of its length"
        );
        let turned = hits.normal(i).distance(truth.normal(i));
        assert!(turned <= NORMAL_ERROR, "{what}: ray {i}: normal off by {turned:e}");
    }
    assert!(same * 100 > rays.len() * 70, "{what}: {same} of {} rays hit the same", rays.len());
}

/// Rays from outside: a distance that is far smaller than the coordinates has fewer digits.
fn from_outside(count: usize, transform: &Transform, seed: u64) -> RayBatch {
    let mut random = Random(seed);
    let mut rays = RayBatch::with_capacity(count);
    for _ in 0..count {
        let origin = transform.point(random.direction() * 4.0);
        let way = transform.point_from(random.cube() * 0.4, origin);
        rays.push(origin, way.normalize());
    }
    rays
}

#[test]
fn distances_and_normals_are_those_of_exact() {
    for (k, transform) in places().into_iter().enumerate() {
        for copies in [1, 2] {
            let geometry = at(vec![blob(40)], vec![placed(0, transform); copies]);
            let mut rays = from_outside(20_000, &transform, 107);
            let options = BuildOptions::default();
            let exact = Exact::build(Arc::clone(&geometry), &options).expect("sound");
            let truth = closest(&exact, &rays);
            for (name, accel) in each(&geometry) {
                for coherent in [false, true] {
                    rays.coherent = coherent;
                    let what = format!("{name}, place {k}, {copies} copies, coherent {coherent}");
                    assert_accurate(&truth, &closest(&*accel, &rays), &rays, &what);
                }
            }
        }
    }
}

/// The instruction sets differ in their roundings (fused or not) and widths, and so in what single
/// precision finds; what is measured in the end does not.
#[cfg(feature = "embree")]
#[test]
fn all_instruction_sets_of_embree_agree() {
    let geometry = scene(vec![blob(40)]);
    let mut rays = from_outside(20_000, &Transform::IDENTITY, 109);
    let exact = Exact::build(Arc::clone(&geometry), &BuildOptions::default()).expect("sound");
    let truth = closest(&exact, &rays);
    let mut tried = 0;
    for isa in ["sse2", "sse4.2", "avx", "avx2", "avx512"] {
        let options = BuildOptions { isa: Some(isa.to_owned()), ..BuildOptions::default() };
        let embree = match Embree::build(Arc::clone(&geometry), &options) {
            Ok(embree) => embree,
            Err(error) => {
                // What the processor lacks is refused by name.
                assert!(error.to_string().contains(isa), "{error}");
                continue;
            }
        };
        tried += 1;
        for coherent in [false, true] {
            rays.coherent = coherent;
            let hits = closest(&embree, &rays);
            assert_accurate(&truth, &hits, &rays, isa);
            for i in 0..rays.len() {
                assert_eq!(hits.triangle[i], truth.triangle[i], "{isa}: ray {i}");
            }
        }
    }
    assert!(tried > 0, "no instruction set works here");
}

#[cfg(feature = "embree")]
#[test]
fn an_unknown_instruction_set_is_refused_by_name() {
    let options = BuildOptions { isa: Some("mmx".to_owned()), ..BuildOptions::default() };
    let refused =
        Embree::build(scene(vec![blob(2)]), &options).expect_err("there is no such thing");
    let message = refused.to_string();
    assert!(message.contains("\"mmx\"") && message.contains("avx2"), "{message}");
}

/// Single precision's error, and with it how many rays are looked at twice, follows from how far away
/// things are, not from how wide the scene is.
#[cfg(feature = "embree")]
#[test]
fn small_things_in_a_wide_scene_are_found_at_once() {
    let ground = [[-1e3, -2.0, -1e3], [1e3, -2.0, -1e3], [-1e3, -2.0, 1e3]];
    let geometry = scene(vec![blob(100), mesh("ground", &ground, vec![[0, 1, 2]])]);
    let rays = from_outside(20_000, &Transform::IDENTITY, 113);
    let embree = Embree::build(Arc::clone(&geometry), &BuildOptions::default()).expect("sound");
    let exact = Exact::build(geometry, &BuildOptions::default()).expect("sound");
    let (truth, hits) = (closest(&exact, &rays), closest(&embree, &rays));
    assert_accurate(&truth, &hits, &rays, "statue");
    let wrong = (0..rays.len()).filter(|&i| hits.triangle[i] != truth.triangle[i]).count();
    assert_eq!(wrong, 0);
    let again = embree.counts().rechecked;
    println!("{again} of {} rays looked at again", rays.len());
    assert!(again * 50 < rays.len() as u64, "{again} of {} rays", rays.len());
}
