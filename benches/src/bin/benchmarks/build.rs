//! Building: wall time on all cores, and the memory of what is built.

use std::cell::Cell;
use std::sync::Arc;

use etendue_accel::limit::{BareScene, Mode};
use etendue_accel::{Accel, BuildOptions, Bvh, Embree, Exact, Quality};
use etendue_bench::timing::{Turn, take_turns, wall};
use etendue_benches::effort::{Effort, in_short};
use etendue_benches::meshes;
use etendue_geometry::Geometry;

use crate::findings::{Contest, Findings, Part, Record};

/// The contestants, as the page shows them.
pub(crate) const LIMIT: &str = "limit";
pub(crate) const LIMIT_LOW: &str = "limit, low quality";
pub(crate) const LIMIT_COMPACT: &str = "limit, compact";
pub(crate) const EMBREE: &str = "embree";
pub(crate) const EMBREE_LOW: &str = "embree, low quality";
pub(crate) const BVH: &str = "bvh";
pub(crate) const EXACT: &str = "exact";

pub(crate) const QUESTION: &str = "build";

pub(crate) fn measure(effort: Effort, findings: &mut Findings) -> anyhow::Result<()> {
    let mut scenes: Vec<(String, Arc<Geometry>)> = Vec::new();
    for triangles in effort.blobs() {
        scenes.push((crate::blob_name(triangles), meshes::blob(triangles)?));
    }
    let soup = meshes::soup(effort.soup());
    scenes.push((format!("soup {}", in_short(effort.soup().into())), soup));
    let side = crate::forest(effort);
    let instances = u64::from(side) * u64::from(side);
    let forest = meshes::forest(side)?;
    scenes.push((format!("forest {} x 10k", in_short(instances)), forest));
    for (mesh, geometry) in scenes {
        eprintln!("building {mesh}");
        findings.contests.push(contest(effort, mesh, &geometry));
    }
    Ok(())
}

/// Builds something and tells the bytes that it holds; nothing where it failed.
type Builder<'a> = Box<dyn Fn() -> Option<u64> + 'a>;

fn builders(geometry: &Arc<Geometry>) -> Vec<(&'static str, Builder<'_>)> {
    let limit = |quality, compact| -> Builder<'_> {
        Box::new(move || {
            let mode = Mode { quality, compact };
            BareScene::build(Arc::clone(geometry), mode, 0).ok().map(|scene| scene.bytes())
        })
    };
    let embree = |quality| -> Builder<'_> {
        Box::new(move || {
            let options = BuildOptions { quality, ..BuildOptions::default() };
            Embree::build(Arc::clone(geometry), &options).ok().map(|built| built.report().bytes)
        })
    };
    let mut all: Vec<(&'static str, Builder<'_>)> = vec![
        (LIMIT, limit(Quality::Medium, false)),
        (EMBREE, embree(Quality::Medium)),
        (LIMIT_LOW, limit(Quality::Low, false)),
        (EMBREE_LOW, embree(Quality::Low)),
        (LIMIT_COMPACT, limit(Quality::Medium, true)),
    ];
    all.push((BVH, {
        let options = BuildOptions::default();
        Box::new(move || {
            Bvh::build(Arc::clone(geometry), &options).ok().map(|built| built.report().bytes)
        })
    }));
    if geometry.triangles() <= 1_000_000 {
        let options = BuildOptions::default();
        all.push((
            EXACT,
            Box::new(move || {
                Exact::build(Arc::clone(geometry), &options).ok().map(|built| built.report().bytes)
            }),
        ));
    }
    all
}

fn contest(effort: Effort, mesh: String, geometry: &Arc<Geometry>) -> Contest {
    let all = builders(geometry);
    let bytes: Vec<Cell<Option<u64>>> = all.iter().map(|_| Cell::new(None)).collect();
    let mut turns: Vec<Turn<'_>> = Vec::new();
    for ((_, build), bytes) in all.iter().zip(&bytes) {
        turns.push(Box::new(move || {
            let (seconds, built) = wall(build);
            bytes.set(built);
            seconds
        }));
    }
    let series = take_turns(effort.rounds(), &mut turns);
    drop(turns);
    let names = all.iter().map(|(name, _)| (*name).to_owned());
    let records = names.zip(series).zip(&bytes).map(|((who, series), bytes)| Record {
        who,
        series,
        bytes: bytes.get(),
    });
    Contest {
        part: Part::Build,
        mesh,
        question: QUESTION.to_owned(),
        items: geometry.triangles_unique() as f64,
        records: records.collect(),
    }
}
