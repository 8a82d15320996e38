//! Meshes that change their shape while the shutter is open: at each time as a still mesh of that shape.

use std::f64::consts::TAU;
use std::sync::Arc;

use etendue_accel::{Accel, AccelName, BuildError, BuildOptions, Exact, build_moving};
use etendue_geometry::glam::{DQuat, DVec3};
use etendue_geometry::{
    Geometry, MISS, Mesh, Motion, Placement, Positions, RayBatch, Steady, Steps, Transform,
};

use super::meshes::{Random, at, blob, placed, rays, soup};
use super::{backends, closest};

const EXPOSURE: [f64; 2] = [-0.1, 0.9];
const TIMES: [f64; 4] = [-0.1, 0.2, 0.21, 0.9];

/// The mesh with a shape of its own at each of the times: twisted, bent, stretched, and pulled far away.
fn deforming(mesh: Mesh) -> Mesh {
    let shape = |k: usize| {
        let k = k as f64;
        let moved = |i: usize| {
            let p = mesh.positions.get(i);
            let turn = DQuat::from_axis_angle(DVec3::new(0.2, 1.0, 0.1).normalize(), 0.7 * k * p.y);
            let p = turn * p * (1.0 + 0.15 * k * p.x) + DVec3::Z * (0.1 * k * k * p.x * p.x);
            (p + DVec3::X * (0.2 * k)).to_array()
        };
        (0..mesh.positions.len()).map(moved).collect::<Vec<_>>()
    };
    let shapes = (0..TIMES.len()).map(shape).collect();
    let steps = Steps::new(TIMES.to_vec(), shapes, Vec::new(), &mesh.triangles).expect("sound");
    Mesh { steps: Some(Arc::new(steps)), ..mesh }
}

fn carried(mesh: u32, motion: Motion) -> Placement {
    let place = motion.at(0.0);
    Placement { motion: Some(Arc::new(motion)), ..placed(mesh, place) }
}

/// Scene of a deforming mesh as it stands, turned and mirrored; one that spins while it deforms;
/// among others that stand still or move.
fn scene() -> Arc<Geometry> {
    let mut random = Random(15);
    let mut pose = |scale: [f64; 3]| {
        Transform::from_trs(random.cube() * 0.5, random.rotation(), DVec3::from(scale))
    };
    let spin = Steady {
        velocity: DVec3::X * 0.4,
        axis: DVec3::new(0.3, 1.0, -0.2),
        rate: TAU,
        about: DVec3::Y * 0.3,
    };
    let spin = Motion::steady(spin).expect("sound");
    let placements = vec![
        placed(2, Transform::IDENTITY),
        carried(0, Motion::default().then_inner(&pose([0.5; 3]))),
        carried(1, Motion::default().then_inner(&pose([-0.4, 0.6, 0.5]))),
        carried(0, spin.then_inner(&pose([0.3, 0.4, 0.3]))),
        carried(3, spin.then_inner(&pose([0.3; 3]))),
    ];
    let meshes = vec![deforming(blob(10)), deforming(soup(50, 0.4, 3)), soup(40, 0.2, 9), blob(6)];
    at(meshes, placements)
}

/// All shapes and places as they are at a time.
fn frozen(geometry: &Geometry, time: f64) -> Arc<Geometry> {
    let mut frozen = geometry.clone();
    for mesh in &mut frozen.meshes {
        let Some(steps) = &mesh.steps else { continue };
        let moment = steps.moment(time);
        let corners: Vec<[f64; 3]> =
            (0..mesh.positions.len()).map(|i| steps.corner(moment, i).to_array()).collect();
        *mesh = Mesh::new("frozen", Positions::F64(corners.into()), mesh.triangles.clone());
    }
    for placement in &mut frozen.placements {
        placement.world_from_mesh = placement.world_from_mesh_at(time);
        placement.motion = None;
    }
    Arc::new(frozen)
}

fn each(geometry: &Arc<Geometry>) -> Vec<(&'static str, Box<dyn Accel>)> {
    let options = BuildOptions { exposure: EXPOSURE, ..BuildOptions::default() };
    let build = |accel: AccelName| {
        let one = |geometry, options: &BuildOptions| accel.build(geometry, options);
        let built = build_moving(Arc::clone(geometry), &options, &one);
        (accel.name(), built.expect("the scene is sound"))
    };
    backends().map(build).collect()
}

#[test]
fn shapes_are_those_of_still_meshes_at_each_time() {
    let geometry = scene();
    let accels = each(&geometry);
    let mut random = Random(78);
    let (mut differ, mut count, mut reached) = (0, 0, 0);
    for number in 0..40 {
        let share = random.unit();
        let time = match number % 8 {
            0 => EXPOSURE[0],
            1 => EXPOSURE[1],
            2 => TIMES[1] + share * (TIMES[2] - TIMES[1]),
            3 => TIMES[1],
            // Before and after the exposure shapes are those at its ends.
            4 => 3.0 * share - 1.0,
            _ => EXPOSURE[0] + share,
        };
        let mut batch = rays(300, DVec3::ZERO, 1.0, 200 + number);
        let still = frozen(&geometry, time);
        let truth = closest(&Exact::build(still, &BuildOptions::default()).expect("sound"), &batch);
        batch.set_times(vec![time; batch.len()]);
        for (name, accel) in &accels {
            let hits = closest(&**accel, &batch);
            let mut blocked = Vec::new();
            accel.occluded(&batch, &mut blocked);
            for (i, &is_blocked) in blocked.iter().enumerate() {
                count += 1;
                let [ours, theirs] = [&hits, &truth].map(|it| (it.placement[i], it.triangle[i]));
                if ours != theirs {
                    differ += 1;
                    continue;
                }
                assert_eq!(is_blocked, truth.is_hit(i), "{name} at {time}: ray {i}");
                if ours.0 == MISS {
                    continue;
                }
                reached += usize::from([1, 2, 3].contains(&ours.0));
                // A few roundings, over the cosine of the least grazing ray.
                assert!((hits.t[i] - truth.t[i]).abs() < 1e-9, "{name} at {time}: ray {i}");
                assert!(hits.normal(i).distance(truth.normal(i)) < 1e-9, "{name} at {time}: {i}");
                let off = (hits.u[i] - truth.u[i]).abs() + (hits.v[i] - truth.v[i]).abs();
                assert!(off < 1e-8, "{name} at {time}: weights of ray {i} off by {off}");
            }
        }
    }
    // Rays through edges go to either side by the last digit, and Embree's f32 loses some at outlines.
    assert!(differ * 2000 <= count, "{differ} of {count} rays differ");
    assert!(reached * 4 > count, "{reached} of {count} rays meet what deforms");
}

#[test]
fn a_closed_mesh_that_deforms_does_not_leak() {
    let mesh = deforming(blob(10));
    let steps = mesh.steps.clone().expect("it has some");
    let geometry = at(vec![mesh], vec![carried(0, Motion::default())]);
    for (name, accel) in each(&geometry) {
        let mut random = Random(4);
        let (mut batch, mut times) = (RayBatch::default(), Vec::new());
        for k in 0..4000_usize {
            let time = EXPOSURE[0] + k as f64 / 4000.0;
            let mesh = &geometry.meshes[0];
            let [a, b, _] = mesh.corners_at(k % mesh.triangles.len(), time);
            let moment = steps.moment(time);
            let centre = (0..mesh.positions.len()).map(|i| steps.corner(moment, i)).sum::<DVec3>()
                / mesh.positions.len() as f64;
            let from = centre + random.cube() * 0.02;
            // Through corners and edges, which are those of several triangles.
            let to = if k % 2 == 0 { a } else { a.lerp(b, random.unit()) };
            batch.push(from, (to - from).normalize());
            times.push(time);
        }
        batch.set_times(times);
        let hits = closest(&*accel, &batch);
        let leaks = (0..batch.len()).filter(|&i| !hits.is_hit(i)).count();
        assert_eq!(leaks, 0, "{name}");
    }
}

/// A triangle whose corners go apart and rise: hits by the closed form of its plane.
#[test]
fn a_rising_triangle_is_met_at_its_height() {
    let corners = [[-1.0, -1.0, 0.0], [3.0, -1.0, 0.0], [-1.0, 3.0, 0.0_f32]];
    let at_time = |time: f64| {
        let grow = 1.0 + time;
        corners.map(|[x, y, _]| [f64::from(x) * grow, f64::from(y) * grow, 2.0 * time]).to_vec()
    };
    let mesh = super::meshes::mesh("triangle", &corners, vec![[0, 1, 2]]);
    let times = EXPOSURE.to_vec();
    let shapes = times.iter().map(|&time| at_time(time)).collect();
    let steps = Steps::new(times, shapes, Vec::new(), &mesh.triangles).expect("sound");
    let mesh = Mesh { steps: Some(Arc::new(steps)), ..mesh };
    let geometry = at(vec![mesh], vec![carried(0, Motion::default())]);
    for (name, accel) in each(&geometry) {
        let mut batch = RayBatch::default();
        let time = |i: usize| EXPOSURE[0] + i as f64 / 100.0;
        (0..100).for_each(|_| batch.push(DVec3::new(0.2, -1.05, 10.0), DVec3::NEG_Z));
        batch.set_times((0..100).map(time));
        let hits = closest(&*accel, &batch);
        for i in 0..100 {
            let time = time(i);
            // The lower edge passes y = −1.05 at 0.05 s.
            assert_eq!(hits.is_hit(i), time >= 0.05 - 1e-12, "{name} at {time}");
            if hits.is_hit(i) {
                assert!((hits.t[i] - (10.0 - 2.0 * time)).abs() < 1e-14 * 10.0, "{name} at {time}");
                let height = (-1.05 / (1.0 + time) + 1.0) / 4.0;
                assert!((hits.v[i] - height).abs() < 1e-14, "{name} at {time}");
            }
        }
    }
}

#[test]
fn boxes_over_the_limit_of_memory_are_refused() {
    let geometry = at(vec![deforming(blob(10))], vec![carried(0, Motion::default())]);
    let options =
        BuildOptions { exposure: EXPOSURE, memory_limit: Some(20_000), ..BuildOptions::default() };
    for accel in backends() {
        let name = accel.name();
        let one = |geometry, options: &BuildOptions| accel.build(geometry, options);
        let refused = build_moving(Arc::clone(&geometry), &options, &one);
        let refused = refused.map(|accel| accel.report().bytes);
        assert!(matches!(refused, Err(BuildError::MemoryLimit { .. })), "{name}: {refused:?}");
    }
}
