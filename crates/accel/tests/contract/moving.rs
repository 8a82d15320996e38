//! Bodies that move while the shutter is open: at each time as a still body that stands there.

use std::f64::consts::TAU;
use std::sync::Arc;

use etendue_accel::{Accel, AccelName, BuildOptions, Exact, build_moving};
use etendue_geometry::block::LANES;
use etendue_geometry::glam::{DMat3, DQuat, DVec3};
use etendue_geometry::{
    Geometry, HitBatch, Interpolation, MISS, Motion, Placement, RayBatch, RayBlock, RayBlocks,
    Steady, Transform,
};

use super::meshes::{Random, at, blob, mesh, placed, rays, scene, soup};
use super::{backends, closest};

const EXPOSURE: [f64; 2] = [-0.1, 0.9];

/// A body that moves.
fn moved(mesh: u32, motion: Motion) -> Placement {
    let motion = Some(Arc::new(motion));
    let still = placed(mesh, motion.as_ref().map_or(Transform::IDENTITY, |m| m.at(0.0)));
    Placement { motion, ..still }
}

fn each_moving(geometry: &Arc<Geometry>) -> Vec<(&'static str, Box<dyn Accel>)> {
    let options = BuildOptions { exposure: EXPOSURE, ..BuildOptions::default() };
    let build = |accel: AccelName| {
        let one = |geometry, options: &BuildOptions| accel.build(geometry, options);
        let built = build_moving(Arc::clone(geometry), &options, &one);
        (accel.name(), built.expect("the scene is sound"))
    };
    backends().map(build).collect()
}

/// The scene with all that moves where it is at `time`.
fn frozen(geometry: &Geometry, time: f64) -> Arc<Geometry> {
    let mut frozen = geometry.clone();
    for placement in &mut frozen.placements {
        placement.world_from_mesh = placement.world_from_mesh_at(time);
        placement.motion = None;
    }
    Arc::new(frozen)
}

fn spin(revolutions: f64, velocity: DVec3, about: DVec3) -> Steady {
    Steady { velocity, axis: DVec3::new(0.3, 1.0, -0.2), rate: TAU * revolutions, about }
}

/// Translated, turned and stretched; spinning by one, two and more revolutions; mirrored; both at once;
/// copies of a copy; among others that stand still.
fn bodies() -> Arc<Geometry> {
    let mut random = Random(5);
    let mut pose = |scale: [f64; 3]| {
        Transform::from_trs(random.cube() * 0.6, random.rotation(), DVec3::from(scale))
    };
    let poses = [pose([0.5; 3]), pose([0.4, 0.6, 0.5]), pose([0.3; 3])];
    let mirrored = pose([-0.4, 0.3, 0.5]);
    let copies = [pose([0.5; 3]), pose([0.7; 3])];
    let times = [-0.3, 0.2, 0.8];
    let through = |kind| Motion::through(&times, &poses, kind).expect("sound");
    let steady =
        |revolutions| Motion::steady(spin(revolutions, DVec3::X, DVec3::Y * 0.3)).expect("sound");
    let both = through(Interpolation::Cubic).with_steady(spin(2.0, DVec3::ZERO, DVec3::X));
    let mut placements = vec![
        placed(2, Transform::IDENTITY),
        moved(0, through(Interpolation::Linear)),
        moved(1, through(Interpolation::Cubic)),
        moved(0, steady(1.0).then_inner(&mirrored)),
        moved(1, steady(-2.0)),
        placed(1, Transform::from_trs(DVec3::Z * 0.5, DQuat::IDENTITY, DVec3::splat(0.5))),
        moved(0, both.expect("sound")),
    ];
    for copy in copies {
        let group = steady(0.4).then_inner(&copy);
        placements.extend(copies.map(|inner| moved(0, group.then_inner(&inner))));
    }
    at(vec![blob(12), soup(60, 0.4, 3), soup(40, 0.2, 9)], placements)
}

#[test]
fn moving_bodies_are_still_ones_at_each_time() {
    let geometry = bodies();
    let accels = each_moving(&geometry);
    let mut random = Random(77);
    let (mut differ, mut count) = (0, 0);
    for number in 0..40 {
        // Within the exposure, at its ends, and before and after it.
        let share = random.cube().x;
        let time = match number % 8 {
            0 => EXPOSURE[0],
            1 => EXPOSURE[1],
            2 => 3.0 * share,
            _ => 0.4 + 0.5 * share,
        };
        let mut batch = rays(300, DVec3::ZERO, 1.0, 100 + number);
        let still = frozen(&geometry, time);
        let truth = closest(&Exact::build(still, &BuildOptions::default()).expect("sound"), &batch);
        batch.set_times(vec![time; batch.len()]);
        for (name, accel) in &accels {
            for coherent in [false, true] {
                let batch = batch.clone().with_coherence(coherent);
                let hits = closest(&**accel, &batch);
                let mut blocked = Vec::new();
                accel.occluded(&batch, &mut blocked);
                for (i, &is_blocked) in blocked.iter().enumerate() {
                    count += 1;
                    let (ours, theirs) = (
                        (hits.placement[i], hits.triangle[i]),
                        (truth.placement[i], truth.triangle[i]),
                    );
                    // Rays through edges may go to either side, by the last digit.
                    if ours != theirs {
                        differ += 1;
                        continue;
                    }
                    assert_eq!(is_blocked, truth.is_hit(i), "{name} at {time}: ray {i}");
                    if ours.0 == MISS {
                        continue;
                    }
                    // A few roundings, over the cosine of the least grazing ray.
                    assert!((hits.t[i] - truth.t[i]).abs() < 1e-9, "{name} at {time}: ray {i}");
                    assert!(hits.normal(i).distance(truth.normal(i)) < 1e-9);
                    let off = (hits.u[i] - truth.u[i]).abs() + (hits.v[i] - truth.v[i]).abs();
                    assert!(off < 1e-8, "{name} at {time}: weights of ray {i} off by {off}");
                    assert_eq!(hits.time(i), time);
                }
            }
        }
    }
    // Embree's f32 loses rays within 2·10⁻⁶ of outlines.
    assert!(differ * 2000 <= count, "{differ} of {count} rays differ");
}

#[test]
fn each_ray_of_a_batch_has_its_own_time() {
    let geometry = bodies();
    for (name, accel) in each_moving(&geometry) {
        let mut batch = rays(400, DVec3::ZERO, 1.0, 31);
        let time = |i: usize| EXPOSURE[0] + (i as f64 * 0.618_034).fract();
        batch.set_times((0..400).map(time));
        let mixed = closest(&*accel, &batch);
        for i in 0..400 {
            let mut alone = RayBatch::default();
            alone.gather(&batch, [i].into_iter());
            assert_eq!(alone.times(), [time(i)]);
            let hits = closest(&*accel, &alone);
            assert_eq!(hits.placement[0], mixed.placement[i], "{name}: ray {i}");
            assert!(hits.t[0] == mixed.t[i] || (hits.t[0] - mixed.t[i]).abs() < 1e-12);
        }
    }
}

#[test]
fn without_motion_in_the_exposure_the_backend_is_as_it_was() {
    let geometry = bodies();
    for accel in backends() {
        let (name, options) = (accel.name(), BuildOptions::default());
        let one = |geometry, options: &BuildOptions| accel.build(geometry, options);
        let plain = one(Arc::clone(&geometry), &options).expect("sound").report();
        let same = build_moving(Arc::clone(&geometry), &options, &one).expect("sound").report();
        assert_eq!((plain.backend, plain.bytes), (same.backend, same.bytes), "{name}");
    }
}

/// A bar that turns by 150° while the shutter is open, seen along its axis: the share of time for which
/// it covers a point is that of the closed form.
#[test]
fn a_turning_bar_covers_each_point_for_its_share_of_the_time() {
    let (half_width, half_length) = (0.1, 1.0);
    let corner = |x: f64, y: f64| [(x * half_length) as f32, (y * half_width) as f32, 0.0];
    let corners = [corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)];
    let half_width = f64::from(corners[2][1]);
    let bar = mesh("bar", &corners, vec![[0, 1, 2], [0, 2, 3]]);
    let turned = 150f64.to_radians();
    let spin = Steady { axis: DVec3::Z, rate: turned, ..Steady::default() };
    let geometry = at(vec![bar], vec![moved(0, Motion::steady(spin).expect("sound"))]);
    const COUNT: u32 = 20_000;
    for (name, accel) in each_moving(&geometry) {
        for (radius, angle) in [(0.3, 0.5), (0.5, 1.0), (0.8, 2.0), (0.95, -1.2), (0.05, 2.9)] {
            let mut batch = RayBatch::default();
            let origin = DVec3::new(radius * f64::cos(angle), radius * f64::sin(angle), 2.0);
            let time = |k: u32| EXPOSURE[0] + (f64::from(k) + 0.5) / f64::from(COUNT);
            (0..COUNT).for_each(|_| batch.push(origin, DVec3::NEG_Z));
            batch.set_times((0..COUNT).map(time));
            let mut hits = HitBatch::default();
            accel.closest(&batch, &mut hits);
            let share = hits.placement.iter().filter(|p| **p != MISS).count() as f64;
            let share = share / f64::from(COUNT);
            // The bar covers the point while its angle is within asin(w/r) of the point's, modulo a half turn.
            let reach = (half_width / radius).min(1.0).asin();
            let [from, to] = EXPOSURE.map(|time| turned * time);
            let due: f64 = (-3..=3)
                .map(|k| {
                    let middle = angle + std::f64::consts::PI * f64::from(k);
                    ((middle + reach).min(to) - (middle - reach).max(from)).max(0.0)
                })
                .sum::<f64>()
                .min(to - from)
                / (to - from);
            // Each end of an interval falls between two times.
            let allowed = 4.0 / f64::from(COUNT);
            assert!(
                (share - due).abs() <= allowed,
                "{name} at {radius}, {angle}: {share}, not {due}"
            );
        }
    }
}

/// A whole turn, and two, end where they began, and are elsewhere in between.
#[test]
fn whole_revolutions_come_back() {
    for revolutions in [1.0, 2.0] {
        let motion = Motion::steady(spin(revolutions, DVec3::ZERO, DVec3::X)).expect("sound");
        let away = |time: f64| motion.at(time).point(DVec3::Y * 2.0).distance(DVec3::Y * 2.0);
        assert!(away(1.0) < 1e-14, "{}", away(1.0));
        assert!(away(0.25 / revolutions) > 1.0);
    }
}

/// One body overtakes another: the nearer one is met, first one and then the other.
#[test]
fn a_body_that_overtakes_another_is_met_from_then_on() {
    let square =
        || mesh("square", &[[-1., -1., 0.], [3., -1., 0.], [-1., 3., 0.]], vec![[0, 1, 2]]);
    let fall = |from: f64, speed: f64| {
        let velocity = DVec3::Z * speed;
        let motion = Motion::steady(Steady { velocity, ..Steady::default() }).expect("sound");
        motion.then_inner(&Transform::new(DMat3::IDENTITY, DVec3::Z * from))
    };
    let geometry =
        at(vec![square(), square()], vec![moved(0, fall(1.0, 1.0)), moved(1, fall(0.6, 2.0))]);
    for (name, accel) in each_moving(&geometry) {
        let mut batch = RayBatch::default();
        let times = [-0.1, 0.0, 0.2, 0.3, 0.39, 0.41, 0.5, 0.7, 0.9];
        times.iter().for_each(|_| batch.push(DVec3::Z * 10.0, DVec3::NEG_Z));
        batch.set_times(times);
        let hits = closest(&*accel, &batch);
        for (i, time) in times.into_iter().enumerate() {
            let [first, second] = [1.0 + time, 0.6 + 2.0 * time];
            assert_eq!(hits.placement[i], u32::from(second > first), "{name} at {time}");
            assert!((hits.t[i] - (10.0 - first.max(second))).abs() < 1e-12, "{name} at {time}");
        }
    }
}

/// Rays from within a closed body that moves do not leave it, and those that leave its surface do not stick.
#[test]
fn a_closed_body_that_moves_does_not_leak() {
    let motion = Motion::steady(spin(3.0, DVec3::new(4.0, -1.0, 2.0), DVec3::X)).expect("sound");
    let geometry = at(vec![blob(12)], vec![moved(0, motion.clone())]);
    for (name, accel) in each_moving(&geometry) {
        let mut random = Random(8);
        let (mut inner, mut times) = (RayBatch::default(), Vec::new());
        for k in 0..4000 {
            let time = EXPOSURE[0] + f64::from(k) / 4000.0;
            let from = motion.at(time).point(random.cube() * 0.2);
            // At corners and along edges of the mesh as often as not.
            let mesh = &geometry.meshes[0];
            let [a, b, _] = mesh.corners(k as usize % mesh.triangles.len());
            let to = motion.at(time).point(if k % 3 == 0 { a } else { (a + b) * 0.5 });
            let to = if k % 3 == 2 { from + random.direction() } else { to };
            inner.push(from, (to - from).normalize());
            times.push(time);
        }
        inner.set_times(times);
        let hits = closest(&*accel, &inner);
        assert!((0..inner.len()).all(|i| hits.is_hit(i)), "{name} leaks");
        // Outwards along the normal of a body that is convex enough there: nothing in the way.
        let mut outer = RayBatch::default().from_surfaces();
        for i in 0..inner.len() {
            let normal = hits.normal(i);
            let at = inner.origin(i) + inner.direction(i) * hits.t[i];
            let own = [hits.placement[i], hits.triangle[i]];
            outer.push_between_triangles(at, normal, [0.0, 1e-3], [own, [MISS; 2]]);
        }
        outer.set_times(inner.times().iter().copied());
        let mut blocked = Vec::new();
        accel.occluded(&outer, &mut blocked);
        let stuck = blocked.iter().filter(|blocked| **blocked).count();
        // At the corners of dents a neighbour is in the way.
        assert!(stuck * 2 < blocked.len(), "{name}: {stuck} stick");
    }
}

/// The shadow of a body that crosses a ray is there while it crosses.
#[test]
fn shadows_are_there_while_a_body_passes() {
    let fall = Steady { velocity: DVec3::X * 10.0, ..Steady::default() };
    let motion = Motion::steady(fall).expect("sound");
    let square = mesh(
        "square",
        &[[-1., -1., 0.], [0., -1., 0.], [0., 1., 0.], [-1., 1., 0.]],
        vec![[0, 1, 2], [0, 2, 3]],
    );
    let floor = mesh("floor", &[[-9., -9., -1.], [9., -9., -1.], [0., 9., -1.]], vec![[0, 1, 2]]);
    let mut geometry = (*scene(vec![square, floor])).clone();
    geometry.placements[0] = moved(0, motion);
    for (name, accel) in each_moving(&Arc::new(geometry)) {
        let mut batch = RayBatch::default().from_surfaces();
        let times: Vec<f64> = (0..1000).map(|k| -0.1 + f64::from(k) / 1000.0).collect();
        times
            .iter()
            .for_each(|_| batch.push_between(DVec3::new(3.0, 0.2, -0.999), DVec3::Z, 0.0, 5.0));
        batch.set_times(times.iter().copied());
        let mut blocked = Vec::new();
        accel.occluded(&batch, &mut blocked);
        for (time, blocked) in times.into_iter().zip(blocked) {
            let x = 3.0 - 10.0 * time;
            if x.abs() > 1e-9 && (x + 1.0).abs() > 1e-9 {
                assert_eq!(blocked, (-1.0..0.0).contains(&x), "{name} at {time}");
            }
        }
    }
}

/// Hundreds of bodies that move among each other are still ones at each time.
#[test]
fn many_bodies_that_move_are_each_where_they_are() {
    let mut random = Random(21);
    let mut body = |_: u32| {
        let place = Transform::from_trs(random.cube(), random.rotation(), DVec3::splat(0.08));
        let steady = spin(random.unit(), random.cube() * 0.3, random.cube());
        moved(0, Motion::steady(steady).expect("sound").then_inner(&place))
    };
    let geometry = at(vec![blob(3)], (0..300).map(&mut body).collect());
    for (name, accel) in each_moving(&geometry) {
        let (mut differ, mut hit) = (0, 0);
        for number in 0..10_u32 {
            let time = EXPOSURE[0] + f64::from(number) / 9.0;
            let mut batch = rays(300, DVec3::ZERO, 1.0, 300 + u64::from(number));
            let still = frozen(&geometry, time);
            let truth =
                closest(&Exact::build(still, &BuildOptions::default()).expect("sound"), &batch);
            batch.set_times(vec![time; batch.len()]);
            let hits = closest(&*accel, &batch);
            let mut blocked = Vec::new();
            accel.occluded(&batch, &mut blocked);
            for (i, &is_blocked) in blocked.iter().enumerate() {
                let [ours, theirs] = [&hits, &truth].map(|it| (it.placement[i], it.triangle[i]));
                hit += usize::from(truth.is_hit(i));
                differ += usize::from(ours != theirs || is_blocked != truth.is_hit(i));
            }
        }
        // Rays through edges go to either side by the last digit, and Embree's f32 loses some at outlines.
        assert!(differ <= 6 && hit > 600, "{name}: {differ} differ, {hit} hit");
    }
}

/// Rays in blocks, of which each has a time of its own, meet what batches meet: among bodies and things that stand, from
/// near and from far away, also where what stands is a small part of the whole.
#[test]
fn rays_in_blocks_meet_bodies_at_their_times() {
    let mut few = (*bodies()).clone();
    few.placements.retain(|placement| placement.motion.is_some());
    few.placements.push(Placement::of(
        2,
        Transform::from_trs(DVec3::new(0.2, 0.1, 0.0), DQuat::IDENTITY, DVec3::splat(0.05)),
    ));
    let (mut compared, mut differ, mut count) = (0, 0, 0);
    for (geometry, away) in [(bodies(), 1.0), (bodies(), 60.0), (Arc::new(few), 20.0)] {
        for (name, accel) in each_moving(&geometry) {
            let Some(blocks) = accel.blocks() else { continue };
            assert!(blocks.has_times());
            compared += 1;
            let mut random = Random(31);
            let mut batch = RayBatch::default();
            for _ in 0..2000 {
                let [from, to] = [random.cube(), random.cube()];
                let from = from.normalize() * (1.5 * away);
                batch.push(from, (0.8 * to - from).normalize());
            }
            let times: Vec<f64> = (0..batch.len()).map(|_| 0.4 + 0.5 * random.cube().x).collect();
            batch.set_times(times.iter().copied());
            let due = closest(&*accel, &batch);
            let mut rays = RayBlocks::default();
            blocks.convert(&batch, &mut rays);
            let start = |block: &RayBlock, lane: usize| {
                blocks.origin() + DVec3::from(block.origin.map(|axis| f64::from(axis[lane])))
            };
            let mut shadows = rays.clone();
            blocks.closest_of_blocks(rays.blocks_mut(), &times, false);
            blocks.occluded_of_blocks(shadows.blocks_mut(), &times, false);
            for i in 0..batch.len() {
                let (block, lane) = (&rays.blocks()[i / LANES], i % LANES);
                let own = [block.placement[lane], block.triangle[lane]];
                count += 1;
                if own != [due.placement[i], due.triangle[i]] {
                    differ += 1;
                    continue;
                }
                let is_blocked = shadows.blocks()[i / LANES].is_blocked(lane);
                assert_eq!(is_blocked, due.is_hit(i), "{name} {away}: ray {i}");
                if !due.is_hit(i) {
                    continue;
                }
                // f32 at some metres from the scene, where blocks start, over the cosine of the most grazing ray.
                let t =
                    (start(block, lane) - batch.origin(i)).length() + f64::from(block.t_max[lane]);
                assert!((t - due.t[i]).abs() < 5e-4, "{name} {away}: {t}, not {}", due.t[i]);
                let normal = DVec3::from(block.normal.map(|axis| f64::from(axis[lane])));
                assert!(normal.normalize().distance(due.normal(i)) < 1e-5, "{name} {away}: {i}");
            }
        }
    }
    // Of scenes of few triangles, and by Embree.
    let least = if cfg!(feature = "embree") { 3 } else { 1 };
    assert!(compared >= least, "{compared}");
    // Where two meet, and at outlines, single precision may take the other.
    assert!(differ * 200 <= count, "{differ} of {count} rays differ");
}

/// One more copy that moves takes some hundred bytes, of the structure and of the scene, whatever its mesh has.
#[test]
fn a_copy_that_moves_takes_some_hundred_bytes() {
    let copies = |count: u32| {
        let place =
            |k: u32| Transform::from_trs(DVec3::X * f64::from(k), DQuat::IDENTITY, DVec3::ONE);
        let steady = Motion::steady(spin(1.0, DVec3::Y, DVec3::ZERO)).expect("sound");
        let copies = (0..count).map(|k| moved(0, steady.then_inner(&place(k))));
        at(vec![blob(40)], copies.collect())
    };
    let [few, many] = [100, 300].map(copies);
    for ((name, few), (_, many)) in each_moving(&few).iter().zip(&each_moving(&many)) {
        let each = (many.report().bytes - few.report().bytes) / 200;
        let whole = each as usize + size_of::<Motion>() + size_of::<Placement>();
        assert!(whole < 900, "{name}: {each} of the structure, {whole} in all");
    }
}
