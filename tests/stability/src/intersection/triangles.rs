//! Triangles that are hardly any, too many of them, or several in one place.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::sync::Arc;

use anyhow::{Context, Result};
use etendue_accel::{Accel, BuildError, BuildOptions, Bvh, Embree, Exact};
use etendue_files::MappedFile;
use etendue_geometry::glam::{DQuat, DVec3};
use etendue_geometry::{Bounds, Buffer, Geometry, Mesh, Positions, Transform, Vertices};
use etendue_scene::import::{self, Wanted};
use fastrand::Rng;

use super::field::{
    Difference, Rays, at, backends, blob, bvh, closest, direction, embree, exact, grouped, in_cube,
    inwards, loose, mesh, placed, scene,
};
use crate::{Case, Outcome, Scale};

pub(super) const NEEDLES: Case = Case {
    name: "needles",
    regime: "triangles 10⁶ times as long as wide, aimed at along their length",
    must: "`bvh` finds what `exact` finds, to the bit",
    limit: None,
    run: needles,
};

pub(super) const NEEDLES_IN_EMBREE: Case = Case {
    name: "needles_in_embree",
    regime: "the same with Embree",
    must: "nothing is hit that is not there, and distances are within 10⁻⁸: a rounding over the sine of \
        the needle's largest angle",
    limit: Some(
        "A needle a metre long and 10⁻⁶ m wide, four metres away, is thinner than f32 resolves: \
         Embree does not see most of them. `--accel bvh` does.",
    ),
    run: needles_in_embree,
};

pub(super) const WITHOUT_AREA: Case = Case {
    name: "triangles_without_area",
    regime: "a mesh half of whose triangles are points, lines, or repeat another triangle",
    must: "triangles without area are never hit and trouble no other; all accelerators see the rest as \
        if they were not there",
    limit: None,
    run: without_area,
};

pub(super) const NOT_FINITE: Case = Case {
    name: "nan_and_infinite_corners",
    regime: "a model file with NaN and infinite corners among sound ones",
    must: "triangles with such a corner are dropped and counted, or the file is refused under \
        `--strict`; the rest is hit as ever",
    limit: None,
    run: not_finite,
};

pub(super) const COPLANAR: Case = Case {
    name: "coplanar_overlaps",
    regime: "each triangle of a mesh three times in the mesh",
    must: "`bvh` and `exact` name the last placement and its lowest triangle, to the bit",
    limit: None,
    run: coplanar,
};

pub(super) const COPIES_IN_EMBREE: Case = Case {
    name: "coplanar_overlaps_in_embree",
    regime: "the same with Embree",
    must: "the place and the distance are those of `exact`",
    limit: Some(
        "Of triangles of one mesh in the very same place, Embree names whichever it meets first.",
    ),
    run: copies_in_embree,
};

pub(super) const ONE: Case = Case {
    name: "one_triangle",
    regime: "meshes of one triangle, of one point, of none, one that is not placed, and batches of 0 to 300 rays",
    must: "all accelerators agree",
    limit: None,
    run: one,
};

pub(super) const TWO_TO_THE_31: Case = Case {
    name: "two_to_the_31_indices",
    regime: "a mesh of 2³¹ indices (715 827 882 triangles), and one of 2³² triangles",
    must: "refused by name with the remedy, before anything large is allocated: `bvh` and `exact` say \
        that the mesh is too large for them; Embree takes it when memory does, and says so of 2³² \
        triangles",
    limit: None,
    run: two_to_the_31,
};

/// Needles a million times as long as wide, and rays aimed at the middle of each.
fn field_of_needles(count: usize) -> (Mesh, Rays) {
    let mut random = Rng::with_seed(59);
    let mut corners = Vec::with_capacity(3 * count);
    for _ in 0..count {
        let (tip, along) = (in_cube(&mut random), direction(&mut random));
        let across = direction(&mut random).cross(along).normalize() * 1e-6;
        let needle = [tip, tip + along + across, tip + along - across];
        corners.extend(needle.map(|p| p.as_vec3().to_array()));
    }
    let needles = loose("needles", &corners);
    let mut rays = Rays::default();
    for triangle in 0..count {
        let [a, b, c] = needles.corners(triangle);
        let origin = direction(&mut random) * 4.0;
        rays.push(origin, ((a + b * 2.0 + c * 2.0) / 5.0 - origin).normalize());
    }
    (needles, rays)
}

fn needles(scale: Scale) -> Result<Outcome> {
    let (needles, mut rays) = field_of_needles(scale.pick(2_000, 10_000));
    let geometry = scene(vec![needles]);
    let (truth, ours) = (exact(geometry.clone())?, bvh(geometry)?);
    let mut outcome = Outcome::default();
    for coherent in [false, true] {
        rays.set_coherent(coherent);
        let difference = Difference::between(&*truth, &*ours, &rays);
        outcome.must(difference.is_none(), || format!("bvh: {difference:?}"));
    }
    outcome.measured(format!("bvh: 0 of {} rays differ", grouped(rays.len())));
    Ok(outcome)
}

fn needles_in_embree(scale: Scale) -> Result<Outcome> {
    let (needles, rays) = field_of_needles(scale.pick(2_000, 10_000));
    let geometry = scene(vec![needles]);
    let (truth, ours) = (exact(geometry.clone())?, embree(geometry)?);
    let hits = rays.batches.iter().map(|rays| {
        let hits = closest(&*truth, rays);
        (0..rays.len()).filter(|&i| hits.is_hit(i)).count()
    });
    let hits: usize = hits.sum();
    let difference = Difference::between(&*truth, &*ours, &rays);
    let mut outcome = Outcome::default();
    outcome.must(difference.invented == 0, || format!("{difference:?}"));
    outcome.must(difference.distance < 1e-8, || format!("{difference:?}"));
    let share = 100.0 * difference.missed as f64 / hits as f64;
    let (missed, hits) = (grouped(difference.missed), grouped(hits));
    outcome.measured(format!(
        "Embree misses {missed} of {hits} needles that `exact` hits, {share:.0} %"
    ));
    Ok(outcome)
}

fn without_area(scale: Scale) -> Result<Outcome> {
    let sound = blob(scale.pick(2_000, 200_000))?;
    let corner_count = sound.positions.len();
    let mut corners: Vec<[f32; 3]> =
        (0..corner_count).map(|i| sound.positions.get(i).as_vec3().to_array()).collect();
    // A corner amid every edge of the first triangle, to lay lines along.
    let [a, b, _] = sound.corners(0);
    corners.push(((a + b) / 2.0).as_vec3().to_array());
    let middle = u32::try_from(corner_count)?;
    let mut triangles: Vec<[u32; 3]> = sound.triangles.to_vec();
    let [first, second, _] = sound.triangles[0];
    for (i, &[a, b, c]) in sound.triangles.iter().enumerate() {
        triangles.push(match i % 4 {
            0 => [a, a, a],
            1 => [a, b, b],
            2 => [first, middle, second],
            _ => [a, b, c],
        });
    }
    let littered = scene(vec![mesh("littered", &corners, triangles)]);
    let truth = exact(scene(vec![sound]))?;
    let mut rays = inwards(scale.pick(10_000, 1_000_000), 0.8, &Transform::IDENTITY, 61);
    let mut outcome = Outcome::default();
    for (name, build) in backends() {
        let accel = build(littered.clone())?;
        let mut all = Difference::default();
        for coherent in [false, true] {
            rays.set_coherent(coherent);
            all = all + Difference::between(&*truth, &*accel, &rays);
        }
        outcome.must(all.hits() == 0, || format!("{name}: {all:?}"));
        outcome.measured(format!("{name}: {} of {} rays differ", all.hits(), grouped(all.rays)));
    }
    Ok(outcome)
}

fn not_finite(_: Scale) -> Result<Outcome> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("broken.obj");
    let mut file = File::create(&path)?;
    writeln!(file, "v -1 -1 0\nv 1 -1 0\nv 0 1 0\nv nan 0 0\nv 0 inf 0\nv 0 0 -inf")?;
    writeln!(file, "f 1 2 3\nf 1 2 4\nf 3 5 1\nf 6 2 3\nf 4 5 6")?;
    let tolerant = import::import(&path, Wanted::NOTHING, &import::Options::default())?;
    let mut outcome = Outcome::default();
    let dropped = tolerant.stats.dropped;
    outcome.measured(format!("{dropped} of 5 triangles dropped and counted, 1 kept"));
    outcome.must(dropped == 4, || format!("{dropped} triangles dropped, not 4"));
    let told = tolerant.notes.iter().any(|note| note.kind == import::NoteKind::NotFinite);
    outcome.must(told, || format!("not told: {:?}", tolerant.notes));
    let strict =
        import::Options { strictness: import::Strictness::Strict, ..import::Options::default() };
    let refused = import::import(&path, Wanted::NOTHING, &strict).is_err();
    outcome.must(refused, || "--strict takes the file".to_owned());
    let geometry = scene(tolerant.meshes);
    let mut rays = Rays::default();
    rays.push(DVec3::new(0.0, 0.0, 3.0), DVec3::NEG_Z);
    rays.push(DVec3::new(5.0, 0.0, 3.0), DVec3::NEG_Z);
    for (name, build) in backends() {
        let hits = closest(&*build(geometry.clone())?, &rays.batches[0]);
        outcome.must(hits.t[0] == 3.0 && !hits.is_hit(1), || format!("{name}: {:?}", hits.t));
    }
    Ok(outcome)
}

/// Each triangle three times.
fn thrice(triangles: u64) -> Result<(Mesh, usize)> {
    let once = blob(triangles)?;
    let corners: Vec<[f32; 3]> =
        (0..once.positions.len()).map(|i| once.positions.get(i).as_vec3().to_array()).collect();
    let count = once.triangles.len();
    let thrice = (0..3).flat_map(|_| once.triangles.iter().copied()).collect();
    Ok((mesh("thrice", &corners, thrice), count))
}

fn turned() -> Transform {
    Transform::from_trs(DVec3::X, DQuat::from_rotation_y(0.3), DVec3::splat(0.7))
}

fn coplanar(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let (thrice, count) = thrice(1_000)?;
    for place in [Transform::IDENTITY, turned()] {
        let geometry = at(thrice.clone(), &[place; 3]);
        let rays = inwards(scale.pick(10_000, 1_000_000), 0.8, &place, 61);
        let truth = exact(geometry.clone())?;
        let difference = Difference::between(&*truth, &*bvh(geometry)?, &rays);
        outcome.must(difference.is_none(), || format!("bvh: {difference:?}"));
        let mut wrong = 0;
        for rays in &rays.batches {
            let hits = closest(&*truth, rays);
            let due = |i: usize| hits.placement[i] == 2 && (hits.triangle[i] as usize) < count;
            wrong += (0..rays.len()).filter(|&i| hits.is_hit(i) && !due(i)).count();
        }
        outcome.must(wrong == 0, || format!("exact names another {wrong} times"));
        outcome.measured(format!("{wrong} of {} rays name another", grouped(rays.len())));
    }
    Ok(outcome)
}

fn copies_in_embree(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let (thrice, count) = thrice(1_000)?;
    let geometry = at(thrice, &[turned(); 3]);
    let rays = inwards(scale.pick(10_000, 1_000_000), 0.8, &turned(), 61);
    let (truth, ours) = (exact(geometry.clone())?, embree(geometry)?);
    let difference = Difference::between(&*truth, &*ours, &rays);
    outcome.must(difference.hits() == 0, || format!("{difference:?}"));
    let (mut placements, mut triangles) = (0, 0);
    for rays in &rays.batches {
        let hits = closest(&*ours, rays);
        for i in (0..rays.len()).filter(|&i| hits.is_hit(i)) {
            placements += usize::from(hits.placement[i] != 2);
            triangles += usize::from(hits.triangle[i] as usize >= count);
        }
    }
    outcome.must(placements == 0, || format!("{placements} hits name an earlier placement"));
    let (triangles, rays) = (grouped(triangles), grouped(rays.len()));
    outcome.measured(format!("{triangles} of {rays} hits name a later copy of the triangle"));
    Ok(outcome)
}

fn one(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let triangle = || loose("one", &[[-1.0, -1.0, 1.0], [1.0, -1.0, 1.0], [0.0, 1.0, 1.0]]);
    let point = mesh("point", &[[1.0, 1.0, 1.0]], vec![[0, 0, 0]]);
    let none = || mesh("none", &[], vec![]);
    let cases = [
        scene(vec![triangle()]),
        scene(vec![point]),
        scene(vec![none()]),
        scene(vec![none(), triangle()]),
        Arc::new(Geometry { meshes: vec![triangle()], placements: Vec::new() }),
        Arc::new(Geometry::default()),
    ];
    let mut asked = 0;
    for geometry in cases {
        let truth = exact(geometry.clone())?;
        for (name, build) in backends() {
            let accel = build(geometry.clone())?;
            for count in [0, 1, 7, 16, 17, 300] {
                let rays = inwards(count, 1.0, &Transform::IDENTITY, 79);
                let difference = Difference::between(&*truth, &*accel, &rays);
                outcome.must(difference.hits() == 0, || format!("{name}: {difference:?}"));
                asked += count;
            }
        }
    }
    outcome.measured(format!("0 of {} rays differ", grouped(asked)));
    Ok(outcome)
}

/// A mesh of so many triangles, all alike, whose indices are a hole in a file: no memory, no disk.
fn in_a_hole(folder: &std::path::Path, triangles: u64) -> Result<Arc<Geometry>> {
    let path = folder.join(format!("{triangles}.bin"));
    File::create(&path)?.set_len(12 * triangles)?;
    let file = Arc::new(MappedFile::open(&path)?);
    let triangles = Buffer::from_file(&file, 0, usize::try_from(triangles)?);
    let mesh = Mesh {
        name: "colossus".to_owned(),
        positions: Positions::F32(Vertices::from_arrays(&[[-1.0; 3], [1.0; 3], [1.0, -1.0, 0.0]])),
        triangles: triangles.context("the file is long enough")?,
        normals: None,
        uvs: Vec::new(),
        colors: None,
        tangents: None,
        bounds: Bounds { min: DVec3::NEG_ONE, max: DVec3::ONE },
        degenerate: 0,
        steps: None,
    };
    let placements = vec![placed(0, Transform::IDENTITY)];
    Ok(Arc::new(Geometry { meshes: vec![mesh], placements }))
}

fn two_to_the_31(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let folder = tempfile::tempdir()?;
    let options = BuildOptions::default();
    let many = in_a_hole(folder.path(), (1 << 31) / 3)?;
    let most = in_a_hole(folder.path(), 1 << 32)?;
    let mut refused = BTreeMap::new();
    let fault = |built: Result<(), BuildError>| built.err().map(|e| e.to_string());
    refused.insert("bvh", fault(Bvh::build(many.clone(), &options).map(drop)));
    refused.insert("exact", fault(Exact::build(many.clone(), &options).map(drop)));
    refused.insert("Embree, 2³² triangles", fault(Embree::build(most, &options).map(drop)));
    for (name, message) in refused {
        let message = message.unwrap_or_default();
        let clear = message.contains("\"colossus\"") && message.contains("split the mesh");
        outcome.must(clear, || format!("{name}: \"{message}\""));
        outcome.measured(format!("{name}: “{message}”"));
    }
    // Embree can count them, so the memory limit is what stands in the way here.
    let limited = BuildOptions { memory_limit: Some(1 << 30), ..options };
    let built = Embree::build(many, &limited).map(|accel| accel.report());
    let over = matches!(built, Err(BuildError::MemoryLimit { .. }));
    outcome.must(over, || format!("Embree within 1 GiB: {built:?}"));
    outcome.measured("Embree, 2³¹ indices within 1 GiB: refused by the memory limit");
    Ok(outcome)
}
