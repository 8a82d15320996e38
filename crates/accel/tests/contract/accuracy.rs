//! Errors of distances and normals, counted against `exact`, of every backend in its default mode. (Leaks,
//! instruction sets, and the regimes where single precision fails: the stability suite.)

use std::f64::consts::TAU;

use super::*;

fn places() -> [Transform; 3] {
    let turned = DQuat::from_rotation_y(0.7);
    [
        Transform::IDENTITY,
        Transform::from_trs(DVec3::new(1e5, 3.0, -7e6), turned, DVec3::new(1.0, -1.5, 0.8)),
        Transform::from_trs(DVec3::new(0.2, 0.1, 0.0), turned, DVec3::splat(-0.01)),
    ]
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

/// A pole where more slivers meet than a few rays around one can try.
#[test]
fn a_ray_at_the_tip_of_a_cone_of_slivers_hits_one_of_them() {
    const SLIVERS: u32 = 800;
    let rim = |i: u32| {
        let (sine, cosine) = (TAU * f64::from(i) / f64::from(SLIVERS)).sin_cos();
        [cosine as f32, sine as f32, -1.0]
    };
    let corners: Vec<[f32; 3]> =
        std::iter::once([0.1, 0.2, 0.3]).chain((0..SLIVERS).map(rim)).collect();
    let triangles = (0..SLIVERS).map(|i| [0, 1 + i, 1 + (i + 1) % SLIVERS]).collect();
    let geometry = scene(vec![mesh("cone", &corners, triangles)]);
    let tip = DVec3::from(corners[0].map(f64::from));
    let mut random = Random(79);
    let mut rays = RayBatch::default();
    for _ in 0..500 {
        let origin = DVec3::new(0.1, 0.2, -2.0) + random.cube() * 0.3;
        rays.push(origin, (tip - origin).normalize());
    }
    for (name, accel) in each(&geometry) {
        for coherent in [false, true] {
            let rays = rays.clone().with_coherence(coherent);
            let mut blocked = Vec::new();
            accel.occluded(&rays, &mut blocked);
            let free = blocked.iter().filter(|&&blocked| !blocked).count();
            assert_eq!(free, 0, "{name}, coherent {coherent}: rays that get past the tip");
            let hits = closest(&*accel, &rays);
            let missing = (0..rays.len()).filter(|&i| !hits.is_hit(i)).count();
            assert_eq!(missing, 0, "{name}, coherent {coherent}: rays that miss the tip");
        }
    }
}
