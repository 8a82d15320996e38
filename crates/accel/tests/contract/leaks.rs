//! Rays in blocks that are aimed at the edges and corners of closed bodies: none gets past what it is aimed at.
//!
//! Bodies of few triangles are traced by all of them, others by the accelerator itself, in its default mode.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use etendue_accel::BlockAccel;
use etendue_geometry::block::{LANES, vector};
use etendue_geometry::glam::{DMat3, DQuat, DVec3};
use etendue_geometry::{MISS, Mesh, RayBatch, RayBlocks, Transform};

use super::each;
use super::meshes::{Random, at, blob, mesh, placed};

/// Rays of one kind: one at each corner of each triangle of the largest body.
const RAYS: usize = 3 * 768;

/// The most triangles of scenes that are traced by all of them (`accel/src/few.rs`).
const FEW: u64 = 64;

/// A ray has got past what it is aimed at beyond so many times the way to it: single precision is off by some millionths
/// of the way, and the far side of each body is a fifth farther at least.
const PAST: f64 = 1.1;

/// The parts of a body that rays are aimed at.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Target {
    /// Places on edges, from a two-thousandth of their length to the middle.
    Edges,
    /// Places beside corners on all sides, by 5·10⁻⁵ to 10⁻³ of the body's size. Coordinates are up to thirty times as
    /// large, so that single precision moves a ray, and what it meets, by a tenth of that at most.
    BesideCorners,
    /// Corners.
    Corners,
}

/// Rays that are aimed at a body.
#[derive(Default)]
struct Aimed {
    /// Without an end.
    rays: RayBatch,
    /// The same that end behind what they are aimed at, before the far side.
    ended: RayBatch,
    /// The distance to what each is aimed at (m).
    distances: Vec<f64>,
}

impl Aimed {
    /// At a body where it stands, from about `ahead` times as far as each corner is from the middle.
    fn at(body: &Mesh, place: &Transform, target: Target, ahead: f64) -> Self {
        let mut random = Random(101);
        let size = place.linear.determinant().abs().cbrt();
        let mut aimed = Self::default();
        for k in 0..RAYS {
            let corners = body.corners(k / 3 % body.triangles.len());
            let [from, to] = [corners[k % 3], corners[(k + 1) % 3]];
            // Some meet a corner of a cube exactly.
            let offset = if k % 8 == 0 { DVec3::ZERO } else { random.cube() * 0.2 };
            let origin = place.point(from * ahead + offset);
            let along = match target {
                Target::Edges => 0.5 * 10_f64.powf(-3.0 * random.unit()),
                Target::BesideCorners | Target::Corners => 0.0,
            };
            let mut way = place.point_from(from + (to - from) * along, origin);
            if target == Target::BesideCorners {
                let (x, y) = way.normalize().any_orthonormal_pair();
                let (sin, cos) = (TAU * random.unit()).sin_cos();
                way += (x * cos + y * sin) * (size * 10_f64.powf(1.3 * random.unit() - 4.3));
            }
            let (distance, direction) = (way.length(), way.normalize());
            aimed.rays.push(origin, direction);
            aimed.ended.push_between(origin, direction, 0.0, PAST * distance);
            aimed.distances.push(distance);
        }
        aimed
    }

    /// Number of rays that get past what they are aimed at by their closest hits, and number of those for which nothing
    /// is found in the way.
    fn past(&self, blocks: &dyn BlockAccel, coherent: bool) -> [usize; 2] {
        let [mut rays, mut shadows] = [RayBlocks::default(), RayBlocks::default()];
        blocks.convert(&self.rays, &mut rays);
        blocks.convert(&self.ended, &mut shadows);
        blocks.closest_of_blocks(rays.blocks_mut(), &[], coherent);
        blocks.occluded_of_blocks(shadows.blocks_mut(), &[], coherent);
        let (mut past, mut free) = (0, 0);
        for (i, &distance) in self.distances.iter().enumerate() {
            let (block, lane) = (&rays.blocks()[i / LANES], i % LANES);
            // Rays from afar start nearer.
            let start = blocks.origin() + vector(&block.origin, lane);
            let t = start.distance(self.rays.origin(i)) + f64::from(block.t_max[lane]);
            past += usize::from(block.placement[lane] == MISS || t > PAST * distance);
            free += usize::from(!shadows.blocks()[i / LANES].is_blocked(lane));
        }
        [past, free]
    }
}

/// A closed cube of half-edge 1, each face of `n` by `n` squares of two triangles; single precision holds the corners
/// where `n` is a power of two.
fn cube(n: u32) -> Mesh {
    let (mut corners, mut triangles) = (Vec::new(), Vec::new());
    for (axis, side) in [0, 1, 2].into_iter().flat_map(|axis| [(axis, -1.0), (axis, 1.0)]) {
        let first = corners.len() as u32;
        for (i, j) in (0..=n).flat_map(|i| (0..=n).map(move |j| (i, j))) {
            let mut corner = [side; 3];
            corner[(axis + 1) % 3] = 2.0 * i as f32 / n as f32 - 1.0;
            corner[(axis + 2) % 3] = 2.0 * j as f32 / n as f32 - 1.0;
            corners.push(corner);
        }
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let corner = |i: u32, j: u32| first + i * (n + 1) + j;
            let (a, c) = (corner(i, j), corner(i + 1, j + 1));
            let (b, d) = (corner(i + 1, j), corner(i, j + 1));
            // Both fronts are outside.
            let (b, d) = if side > 0.0 { (b, d) } else { (d, b) };
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh("cube", &corners, triangles)
}

/// Placements of bodies: at the origin, near it and far from it; small and large; turned, stretched and mirrored.
fn places() -> [Transform; 5] {
    let turned = DQuat::from_rotation_y(0.7);
    [
        Transform::IDENTITY,
        Transform::from_trs(DVec3::new(3.0, -2.0, 1.0), DQuat::IDENTITY, DVec3::ONE),
        Transform::from_trs(DVec3::new(1e5, 3.0, -7e6), turned, DVec3::new(1.0, -1.5, 0.8)),
        Transform::from_trs(DVec3::new(0.2, 0.1, 0.0), turned, DVec3::splat(-0.01)),
        Transform::from_trs(DVec3::new(1e6, 0.0, 2e6), turned, DVec3::splat(1e6)),
    ]
}

/// Aims rays at a body where it stands. Adds to `at_corners` how many of those at corners get past, and how many there are.
fn aim(
    blocks: &dyn BlockAccel,
    (body, place): (&Mesh, &Transform),
    what: &str,
    at_corners: &mut [usize; 2],
) {
    for target in [Target::Edges, Target::BesideCorners, Target::Corners] {
        // From inside and from outside.
        for ahead in [0.0, 4.0] {
            let aimed = Aimed::at(body, place, target, ahead);
            for coherent in [false, true] {
                let past = aimed.past(blocks, coherent);
                if target == Target::Corners {
                    at_corners[0] += past[0] + past[1];
                    at_corners[1] += 2 * RAYS;
                } else {
                    let context = format!("{what}: {target:?} from {ahead}, coherent {coherent}");
                    assert_eq!(past, [0, 0], "{context}: closest hits and occlusion");
                }
            }
        }
    }
}

/// Triangles that share an edge agree on the side on which a ray passes it, so that none slips through; nor beside
/// corners, a few roundings of single precision from them. At corners themselves, where several edges meet, signs may
/// contradict each other: those of single precision do so for some one ray in a hundred, those of double precision, by
/// which scenes of few triangles decide, for hardly any ray as single precision has it.
#[test]
fn no_ray_in_blocks_gets_past_edges_and_corners() {
    let bodies = [
        ("cube", cube(1)),
        ("few bumps", blob(2)),
        ("divided cube", cube(8)),
        ("many bumps", blob(8)),
    ];
    let mut asked = 0;
    for (name, body) in &bodies {
        // Of a body that is placed twice Embree has instances, which is another way through it.
        for copies in [1, 2] {
            let mut at_corners: BTreeMap<(&str, bool), [usize; 2]> = BTreeMap::new();
            for (number, place) in places().into_iter().enumerate() {
                let aside = Transform::new(DMat3::IDENTITY, DVec3::X * 10.0);
                let all = [place, place.then_inner(&aside)];
                let placements = all[..copies].iter().map(|&place| placed(0, place)).collect();
                let geometry = at(vec![body.clone()], placements);
                let is_few = geometry.triangles() <= FEW;
                for (accel, structure) in each(&geometry) {
                    let Some(blocks) = structure.blocks() else { continue };
                    asked += 1;
                    let what = format!("{accel}, {copies} of {name} at place {number}");
                    let at_corners = at_corners.entry((accel, is_few)).or_default();
                    aim(blocks, (body, &place), &what, at_corners);
                }
            }
            for ((accel, is_few), [past, rays]) in at_corners {
                // Twice what is known of single precision (`NUDGE` in `accel/src/single.rs`); and next to none.
                let one_in = if is_few { 10_000 } else { 50 };
                let what = format!("{accel}, {copies} of {name}");
                assert!(past * one_in <= rays, "{what}: {past} of {rays} at corners get past");
            }
        }
    }
    // Of two bodies of few triangles and of two of many, once and twice at five places.
    assert_eq!(asked, if cfg!(feature = "embree") { 60 } else { 20 });
}
