//! Rays in blocks: what they meet is what batches of single precision meet.

use std::sync::Arc;

#[cfg(feature = "embree")]
use etendue_accel::{Accel, Embree};
use etendue_accel::{BuildOptions, Exact};
use etendue_geometry::block::LANES;
use etendue_geometry::glam::{DMat3, DQuat, DVec3};
use etendue_geometry::{HitPrecision, MISS, Mesh, RayBatch, RayBlock, RayBlocks, Transform};

use super::meshes::{Random, at, mesh, placed, soup};
use super::{closest, each, is_at_edge};

/// A decal and a box on a floor, in both orders, with and without more triangles than are tested without a tree: what
/// lies in the floor's plane is told by the rule in blocks of rays, too.
#[test]
fn surfaces_in_one_plane_follow_the_rule_in_blocks() {
    let square = |size: f32, at: [f32; 2]| {
        let corner = |x: f32, z: f32| [at[0] + x * size, 0.0, at[1] + z * size];
        let corners = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
        mesh("square", &corners, vec![[0, 1, 2], [0, 2, 3]])
    };
    let floor = || square(2.0, [0.0, 0.0]);
    let others =
        || [square(0.4, [0.7, 0.6]), cube_on_floor([-0.8, -0.5]), cube_on_floor([0.3, -1.1])];
    let mut compared = 0;
    for (floor_first, crowded) in [(true, false), (false, false), (true, true), (false, true)] {
        let mut meshes: Vec<Mesh> = others().into();
        meshes.insert(if floor_first { 0 } else { meshes.len() }, floor());
        let mut placements: Vec<_> =
            (0..meshes.len() as u32).map(|mesh| placed(mesh, Transform::IDENTITY)).collect();
        if crowded {
            placements.push(placed(meshes.len() as u32, Transform::IDENTITY));
            meshes.push(soup(200, 0.05, 3));
        }
        if floor_first || !crowded {
            // A copy in the very same place, of which the last counts: of many triangles, an instance.
            placements.push(placements[0].clone());
        }
        let geometry = at(meshes, placements);
        let mut random = Random(19);
        let mut batch = RayBatch::default();
        for k in 0..4096 {
            let mut from = 1.8 * random.cube();
            // From above, from below, and from within the boxes.
            from.y = [2.0, -1.5, 0.3][k % 3];
            let down = DVec3::new(0.0, if k % 3 == 1 { 1.0 } else { -1.0 }, 0.0);
            batch.push(from, (down + 0.4 * random.cube()).normalize());
        }
        let truth = closest(
            &Exact::build(Arc::clone(&geometry), &BuildOptions::default()).unwrap(),
            &batch,
        );
        for (name, accel) in each(&geometry) {
            let Some(blocks) = accel.blocks() else { continue };
            compared += 1;
            let mut rays = RayBlocks::default();
            blocks.convert(&batch, &mut rays);
            blocks.closest_of_blocks(rays.blocks_mut(), &[], false);
            for i in 0..batch.len() {
                let (block, lane) = (&rays.blocks()[i / LANES], i % LANES);
                let own = [block.placement[lane], block.triangle[lane]];
                let due = [truth.placement[i], truth.triangle[i]];
                let at_edge =
                    own[0] != MISS && due[0] != MISS && is_at_edge(&geometry, &batch, &truth, i);
                let both = truth.is_hit(i) == (own[0] != MISS);
                assert!(
                    own == due || at_edge,
                    "{name} {floor_first} {crowded}: {own:?} {due:?}, {both}"
                );
                if own == due && truth.is_hit(i) {
                    let [t, u, v] = [block.t_max, block.u, block.v].map(|row| f64::from(row[lane]));
                    assert!((t - truth.t[i]).abs() < 1e-5, "{name}: {t} {}", truth.t[i]);
                    // Of edges of 0.05 m and more.
                    let off = (u - truth.u[i]).abs() + (v - truth.v[i]).abs();
                    assert!(off < 1e-3, "{name}: {off}");
                    let normal = DVec3::from(block.normal.map(|axis| f64::from(axis[lane])));
                    assert!(normal.normalize().distance(truth.normal(i)) < 1e-5, "{name}");
                }
            }
        }
    }
    assert!(compared >= if cfg!(feature = "embree") { 6 } else { 2 }, "{compared}");
}

/// Rays of one point start as those of a batch do, near the scene and as far as single precision takes them: they run along
/// the same lines, and meet the same. From farther on there are none.
#[test]
fn rays_of_one_point_are_those_of_a_batch() {
    // Away from the world's origin, so that blocks have an origin of their own.
    let middle = DVec3::new(30.0, -20.0, 10.0);
    let geometry =
        at(vec![soup(2000, 0.3, 3)], vec![placed(0, Transform::new(DMat3::IDENTITY, middle))]);
    let radius = 0.5 * geometry.loose_bounds().diagonal();
    let mut random = Random(23);
    let mut compared = 0;
    for (name, accel) in each(&geometry) {
        let Some(blocks) = accel.blocks() else { continue };
        compared += 1;
        let towards = random.cube().normalize();
        assert!(blocks.frame().block_origin(middle + 17.0 * radius * towards).is_none(), "{name}");
        for far in [0.0, 0.9, 1.6, 5.0, 15.0] {
            let position = middle + far * radius * towards;
            let from = blocks.frame().block_origin(position).expect("it is near");
            let (mut batch, mut rays) = (RayBatch::default(), RayBlocks::default());
            for _ in 0..1000 {
                // Some miss the sphere around the scene.
                let goal = middle + 2.0 * radius * random.cube();
                let direction = (goal - position).normalize().as_vec3();
                batch.push(position, direction.as_dvec3().normalize());
                rays.push([0.0; 3], direction.to_array(), 0.0);
            }
            let mut due = RayBlocks::default();
            blocks.convert(&batch, &mut due);
            from.start(&mut rays);
            for i in 0..batch.len() {
                let [own, other] = [&rays, &due].map(|rays| &rays.blocks()[i / LANES]);
                let lane = i % LANES;
                let is_traced = [own, other].map(|block| block.t_max[lane] > 0.0);
                assert!(!is_traced[1] || is_traced[0], "{name}, {far}: {is_traced:?}");
                if is_traced == [true; 2] {
                    let start = |block: &RayBlock| {
                        DVec3::from(block.origin.map(|axis| f64::from(axis[lane])))
                    };
                    // Roundings of 16 radii, and of a sum of three products.
                    let error = start(own).distance(start(other)) / radius;
                    assert!(error < 64.0 * f64::from(f32::EPSILON), "{name}, {far}: {error}");
                    assert_eq!(own.t_min[lane], 0.0);
                }
            }
            blocks.closest_of_blocks(rays.blocks_mut(), &[], true);
            blocks.closest_of_blocks(due.blocks_mut(), &[], true);
            let hits = |rays: &RayBlocks, i: usize| {
                let (block, lane) = (&rays.blocks()[i / LANES], i % LANES);
                [block.placement[lane], block.triangle[lane]]
            };
            let differ = (0..batch.len()).filter(|&i| hits(&rays, i) != hits(&due, i)).count();
            let hit = (0..batch.len()).filter(|&i| hits(&rays, i)[0] != MISS).count();
            // Hits within a millionth of the scene of an edge.
            assert!(differ <= 2 && hit > 100, "{name}, {far}: {differ} of {hit}");
        }
    }
    assert!(compared >= usize::from(cfg!(feature = "embree")), "{compared}");
}

/// A box of 0.6 m that stands on y = 0.
fn cube_on_floor([x, z]: [f32; 2]) -> Mesh {
    let corners: Vec<[f32; 3]> = (0..8)
        .map(|k| {
            let side = |bit: u32| if k >> bit & 1 == 1 { 0.3 } else { -0.3 };
            [x + side(0), side(1) + 0.3, z + side(2)]
        })
        .collect();
    let quads =
        [[0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    mesh("box", &corners, triangles)
}

/// Many placements of few meshes, which Embree has as instances, are met in blocks as in batches: ray by ray and in
/// packets that keep together, in the compact mode, too. Some are mirror images, and one of those is used once.
#[cfg(feature = "embree")]
#[test]
fn instances_are_met_in_blocks_as_in_batches() {
    let mut random = Random(29);
    let mut geometry = (*super::instances(&mut random, 40)).clone();
    let mirrored = DVec3::new(0.3, -0.4, 0.3);
    let mirror = Transform::from_trs(DVec3::splat(0.6), random.rotation(), mirrored);
    geometry.placements.push(placed(geometry.meshes.len() as u32, mirror));
    geometry.meshes.push(super::blob(6));
    let geometry = Arc::new(geometry);
    for (compact, coherent) in [(false, false), (false, true), (true, false), (true, true)] {
        let options = BuildOptions { compact, ..BuildOptions::default() };
        let accel = Embree::build(Arc::clone(&geometry), &options).unwrap();
        let mut batch = super::rays(6000, DVec3::ZERO, 1.0, 37).with_coherence(coherent);
        batch.precision = HitPrecision::Single;
        let due = closest(&accel, &batch);
        let mut due_blocked = Vec::new();
        accel.occluded(&batch, &mut due_blocked);
        let blocks = accel.blocks().expect("Embree takes blocks of every scene");
        let mut rays = RayBlocks::default();
        blocks.convert(&batch, &mut rays);
        let start = |block: &RayBlock, lane: usize| {
            blocks.origin() + DVec3::from(block.origin.map(|axis| f64::from(axis[lane])))
        };
        let mut shadows = rays.clone();
        blocks.closest_of_blocks(rays.blocks_mut(), &[], coherent);
        blocks.occluded_of_blocks(shadows.blocks_mut(), &[], coherent);
        let (mut is_hit, mut differ) = (vec![false; geometry.placements.len()], 0);
        for (i, &due_blocked) in due_blocked.iter().enumerate() {
            let context = format!("compact {compact}, coherent {coherent}: ray {i}");
            let (block, lane) = (&rays.blocks()[i / LANES], i % LANES);
            let is_blocked = shadows.blocks()[i / LANES].is_blocked(lane);
            let own = [block.placement[lane], block.triangle[lane]];
            if own != [due.placement[i], due.triangle[i]] || is_blocked != due_blocked {
                differ += 1;
                continue;
            }
            if !due.is_hit(i) {
                continue;
            }
            is_hit[own[0] as usize] = true;
            let t = (start(block, lane) - batch.origin(i)).length() + f64::from(block.t_max[lane]);
            assert!((t - due.t[i]).abs() < 1e-5, "{context}: {t}, not {}", due.t[i]);
            let weights = [block.u, block.v].map(|row| f64::from(row[lane]));
            let off = (weights[0] - due.u[i]).abs() + (weights[1] - due.v[i]).abs();
            assert!(off < 1e-3, "{context}: {off}");
            let normal = DVec3::from(block.normal.map(|axis| f64::from(axis[lane])));
            assert!(normal.normalize().distance(due.normal(i)) < 1e-5, "{context}: {normal}");
        }
        // Packets round in another order than rays one by one.
        assert!(differ <= 6, "compact {compact}, coherent {coherent}: {differ} differ");
        let count = is_hit.iter().filter(|&&is_hit| is_hit).count();
        assert!(count >= 38, "{count} of {} placements are hit", is_hit.len());
        assert!(is_hit.last() == Some(&true), "the mirror image that is used once is hit");
    }
}

/// With each instruction set that the processor has blocks meet what batches meet, and whatever the lanes hold that have no
/// ray, they meet nothing. Embree has no packets of sixteen where registers are narrower.
#[cfg(feature = "embree")]
#[test]
fn every_instruction_set_meets_the_same_in_blocks() {
    let geometry = at(vec![soup(3000, 0.2, 5)], vec![placed(0, Transform::IDENTITY)]);
    let mut tried = 0;
    for isa in ["sse2", "sse4.2", "avx", "avx2", "avx512"] {
        let options = BuildOptions { isa: Some(isa.to_owned()), ..BuildOptions::default() };
        let Ok(accel) = Embree::build(Arc::clone(&geometry), &options) else { continue };
        tried += 1;
        let blocks = accel.blocks().expect("Embree takes blocks of every scene");
        for coherent in [false, true] {
            let mut batch = super::rays(4000, DVec3::ZERO, 1.0, 41).with_coherence(coherent);
            batch.precision = HitPrecision::Single;
            let due = closest(&accel, &batch);
            let mut due_blocked = Vec::new();
            accel.occluded(&batch, &mut due_blocked);
            let mut rays = RayBlocks::default();
            blocks.convert(&batch, &mut rays);
            // Some blocks have a few rays, some half of them, and some none.
            let has_ray = |i: usize| match i / LANES % 4 {
                0 => true,
                1 => i.is_multiple_of(5),
                2 => i % LANES < 8,
                _ => false,
            };
            for i in (0..batch.len()).filter(|&i| !has_ray(i)) {
                let (block, lane) = (&mut rays.blocks_mut()[i / LANES], i % LANES);
                let rows = block.origin.iter_mut().chain(&mut block.direction);
                rows.for_each(|row| row[lane] = f32::NAN);
                block.t_max[lane] = 0.0;
            }
            let mut shadows = rays.clone();
            blocks.closest_of_blocks(rays.blocks_mut(), &[], coherent);
            blocks.occluded_of_blocks(shadows.blocks_mut(), &[], coherent);
            let mut differ = 0;
            for (i, &due_blocked) in due_blocked.iter().enumerate() {
                let (block, lane) = (&rays.blocks()[i / LANES], i % LANES);
                let own = [block.placement[lane], block.triangle[lane]];
                let is_blocked = shadows.blocks()[i / LANES].is_blocked(lane);
                if !has_ray(i) {
                    assert_eq!((own, is_blocked), ([MISS; 2], false), "{isa}: lane {i}");
                } else if own != [due.placement[i], due.triangle[i]] || is_blocked != due_blocked {
                    differ += 1;
                }
            }
            // Packets round in another order than rays one by one.
            assert!(differ <= 4, "{isa}, coherent {coherent}: {differ} differ");
        }
    }
    assert!(tried >= 1, "no instruction set of Embree's is this processor's");
}

/// A mesh `size` times as large, whose triangles share no corners.
fn scaled(body: &Mesh, size: f64) -> Mesh {
    let corners = (0..body.triangles.len()).flat_map(|triangle| body.corners(triangle));
    let positions: Vec<[f32; 3]> =
        corners.map(|corner| (corner * size).to_array().map(|axis| axis as f32)).collect();
    let triangles = (0..positions.len() as u32 / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]);
    mesh("scaled", &positions, triangles.collect())
}

/// The weights of hits of single precision do not depend on the unit of length, in scenes of 10⁻¹⁰ m and of meshes that
/// placements enlarge as much: Embree itself has none of triangles below 10⁻¹⁸ m².
#[test]
fn triangles_of_every_size_have_their_weights() {
    let mut compared = 0;
    for size in [1.0, 1e-3, 1e-6, 1e-8, 1e-10] {
        let enlarge = |x: f64| {
            let at = DVec3::new(x, 0.0, 0.0);
            placed(0, Transform::from_trs(DVec3::splat(1.0 / size), DQuat::IDENTITY, at))
        };
        let small = || vec![scaled(&super::blob(16), size)];
        let as_it_is = at(small(), vec![placed(0, Transform::IDENTITY)]);
        // A mesh of many triangles that is placed more than once has instances.
        let enlarged = at(small(), vec![enlarge(0.0), enlarge(5.0)]);
        for (geometry, world) in [(as_it_is, size), (enlarged, 1.0)] {
            let mut random = Random(53);
            let mut batch = RayBatch::default();
            for _ in 0..1500 {
                let (from, to) = (2.0 * random.direction(), 0.6 * random.cube());
                batch.push(world * from, (to - from).normalize());
            }
            let options = BuildOptions::default();
            let truth = closest(&Exact::build(Arc::clone(&geometry), &options).unwrap(), &batch);
            batch.precision = HitPrecision::Single;
            for (name, accel) in each(&geometry) {
                let mut found = vec![closest(&*accel, &batch)];
                if let Some(blocks) = accel.blocks() {
                    let mut rays = RayBlocks::default();
                    blocks.convert(&batch, &mut rays);
                    blocks.closest_of_blocks(rays.blocks_mut(), &[], false);
                    let mut hits = truth.clone();
                    for i in 0..batch.len() {
                        let (block, lane) = (&rays.blocks()[i / LANES], i % LANES);
                        (hits.placement[i], hits.triangle[i]) =
                            (block.placement[lane], block.triangle[lane]);
                        (hits.u[i], hits.v[i]) =
                            (f64::from(block.u[lane]), f64::from(block.v[lane]));
                    }
                    found.push(hits);
                }
                for hits in found {
                    for i in (0..batch.len()).filter(|&i| truth.is_hit(i)) {
                        let same = [hits.placement[i], hits.triangle[i]]
                            == [truth.placement[i], truth.triangle[i]];
                        let cosine = truth.normal(i).dot(batch.direction(i)).abs();
                        if same && cosine > 0.1 {
                            compared += 1;
                            // A place is off by some millionths of the size, an edge is a tenth of it long.
                            let off =
                                (hits.u[i] - truth.u[i]).abs() + (hits.v[i] - truth.v[i]).abs();
                            assert!(off < 1e-3, "{name}, {size} m, {world} m: {off}");
                        }
                    }
                }
            }
        }
    }
    assert!(compared > 10_000, "{compared}");
}
