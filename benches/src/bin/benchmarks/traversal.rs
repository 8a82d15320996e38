//! Tracing: every contestant on every mesh, one thread.

use std::sync::Arc;

use etendue_bench::timing::{Turn, take_turns};
use etendue_benches::contest::{Query, time};
use etendue_benches::effort::{Effort, in_short};
use etendue_benches::field::{Field, Rays, Reference, contestants, names};
use etendue_benches::meshes;
use etendue_benches::rays::{View, incoherent, occlusion};
use etendue_geometry::Geometry;

use crate::findings::{Contest, Findings, Part, Record};
use crate::threads;

/// The questions, as the page shows them.
pub(crate) const PRIMARY: &str = "primary, 1 sample";
pub(crate) const SAMPLES: &str = "primary, 16 samples of a pixel";
pub(crate) const INCOHERENT: &str = "incoherent";
pub(crate) const OCCLUSION: &str = "occlusion";

const INCOHERENT_RAYS: usize = 1 << 18;

/// The reference is timed on one chunk in so many.
const EXACT_SHARE: usize = 16;

/// Rays cross many instances: one chunk in so many is enough.
const FOREST_SHARE: usize = 16;

pub(crate) fn measure(
    effort: Effort,
    [alone, side_by_side]: [bool; 2],
    findings: &mut Findings,
    write: &dyn Fn(&Findings) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let mut scenes: Vec<(String, Arc<Geometry>, Reference)> = Vec::new();
    for triangles in effort.blobs() {
        let reference =
            if triangles > 1_000_000 { Reference::LeftOut } else { Reference::Included };
        scenes.push((crate::blob_name(triangles), meshes::blob(triangles)?, reference));
    }
    if alone {
        let name = format!("soup {}", in_short(effort.soup().into()));
        scenes.push((name, meshes::soup(effort.soup()), Reference::Included));
        let side = crate::forest(effort);
        let instances = u64::from(side) * u64::from(side);
        let name = format!("forest {} x 10k", in_short(instances));
        scenes.push((name, meshes::forest(side)?, Reference::LeftOut));
    }
    for (mesh, geometry, reference) in scenes {
        eprintln!("tracing {mesh}");
        let field = Field::build(&geometry, reference)?;
        let is_forest = geometry.placements.len() > 1;
        let bounds = geometry.loose_bounds();
        let view = if is_forest { View::over_forest() } else { View::framing(bounds) };
        let primary = view.primary();
        if alone {
            let shadows = occlusion(&field.embree, &geometry, &primary);
            let sets = [
                (SAMPLES, Rays::new(view.samples(), Query::Closest)),
                (INCOHERENT, Rays::new(incoherent(bounds, INCOHERENT_RAYS), Query::Closest)),
                (OCCLUSION, Rays::new(shadows, Query::Occluded)),
            ];
            let first = (PRIMARY, Rays::new(primary.clone(), Query::Closest));
            for (question, rays) in [first].into_iter().chain(sets) {
                // Rays to a lamp cross most of the forest: they would take longer
                // than all other questions together.
                if is_forest && question == OCCLUSION {
                    continue;
                }
                findings.contests.push(contest(effort, &mesh, question, &field, &rays));
            }
        }
        if side_by_side && !is_forest && !mesh.starts_with("soup") {
            let rays = Rays::new(primary, Query::Closest);
            findings.contests.push(threads::contest(effort, &mesh, &field, &rays));
        }
        write(findings)?;
    }
    Ok(())
}

fn contest(effort: Effort, mesh: &str, question: &str, field: &Field, rays: &Rays) -> Contest {
    eprintln!("  {question}");
    let is_forest = field.geometry.placements.len() > 1;
    let share = if is_forest { FOREST_SHARE } else { 1 };
    let all = contestants(field, rays);
    let items = all.first().map_or(0, |(_, contestant)| contestant.rays()) as f64;
    let mut turns: Vec<Turn<'_>> = Vec::new();
    for (name, contestant) in &all {
        let every = if *name == names::EXACT { EXACT_SHARE } else { share };
        turns.push(Box::new(move || time(&**contestant, 1, every)));
    }
    let series = take_turns(effort.rounds(), &mut turns);
    let records = all.iter().zip(series).map(|((name, _), series)| Record {
        who: (*name).to_owned(),
        series,
        bytes: None,
    });
    Contest {
        part: Part::Traversal,
        mesh: mesh.to_owned(),
        question: question.to_owned(),
        items,
        records: records.collect(),
    }
}
