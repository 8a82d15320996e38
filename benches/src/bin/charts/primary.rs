//! Primary visibility: every accelerator on scenes of four kinds, and rays aimed where meshes leak.

use std::sync::Arc;

use anyhow::{Context, anyhow};
use etendue_accel::Quality;
use etendue_bench::accelerators::{self, AcceleratorMeasurement, Method, RENDER_WIDTH};
use etendue_bench::findings::Findings;
use etendue_bench::hits::Rays;
use etendue_benches::effort::Effort;
use etendue_benches::meshes;
use etendue_benches::rays::View;
use etendue_camera::{Camera, CameraSpec, Pose};
use etendue_chart::Chart;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Geometry, RayBatch};

use crate::page::Page;

/// Builds of more triangles take so long that fewer rounds have to do.
const HEAVY: u64 = 5_000_000;

pub(crate) fn measure(effort: Effort, page: &mut Page) -> anyhow::Result<()> {
    let [small, large] = effort.blobs();
    let smooth = |triangles: u64| -> anyhow::Result<_> {
        let geometry = meshes::blob(triangles)?;
        let view = View::framing(geometry.bounds());
        Ok((geometry, view))
    };
    let (geometry, view) = smooth(small)?;
    let title = format!("A smooth mesh of {}", in_words(small));
    primary(effort, page, "smooth", &title, (&geometry, view), SMOOTH)?;
    let (geometry, view) = smooth(large)?;
    let title = format!("A smooth mesh of {}", in_words(large));
    primary(effort, page, "smooth-heavy", &title, (&geometry, view), HEAVY_ADVICE)?;
    let geometry = meshes::soup(effort.soup());
    let view = View::framing(geometry.bounds());
    let title = format!("A soup of {}", in_words(effort.soup().into()));
    primary(effort, page, "soup", &title, (&geometry, view), SOUP)?;
    // Instances along a side.
    let side = effort.pick(100, 30);
    let geometry = meshes::forest(side)?;
    let instances = u64::from(side).pow(2);
    let title = format!("A forest of {instances} instances of 10 000 triangles");
    primary(effort, page, "forest", &title, (&geometry, View::over_forest()), FOREST)?;
    aimed(effort, page)
}

const SMOOTH: &str = "\
    Pick `embree robust + f64`, which renders use anyway: its distances are of double precision, every ray finds its \
    triangle, and modes that do less buy little. Pick `bvh` where Embree is not to be had; it is as accurate.";
const HEAVY_ADVICE: &str = "\
    Pick the same: at this size memory takes most of the time, and the modes of Embree differ by no more than their \
    rounds do. Pick `bvh` where not one ray may take the neighbour of its triangle, and `exact` only to check others.";
const SOUP: &str = "\
    Pick `bvh` where every hit counts: triangles that are no surface have open edges, and of the rays along these \
    Embree misses some, which no neighbour makes suspicious. Pick `embree robust + f64` for pictures of such scenes, \
    where one ray in some hundreds at an edge does not show.";
const FOREST: &str = "\
    Pick `embree robust + f64` for scenes of instances; one copy of the mesh is all that is held. Distances in f32 are \
    coarse here, as the scene is wide and what is seen is far from its middle.";
const AIMED: &str = "\
    Pick a robust mode whenever a ray that slips through matters: coverage, light leaks, watertight depth. Fast modes are \
    for previews, and solving their hits in f64 mends distances and no leak.";

fn primary(
    effort: Effort,
    page: &mut Page,
    stem: &str,
    title: &str,
    (geometry, view): (&Arc<Geometry>, View),
    advice: &str,
) -> anyhow::Result<()> {
    page.heading(title);
    let rays = Rays::primary(&camera(view)?, crate::rays(effort));
    let (findings, rounds) = accelerators(effort, geometry, &rays)?;
    if rounds != effort.rounds() {
        page.paragraph(&format!("Medians of {rounds} rounds."));
    }
    let mut chart = chart(&findings, "accelerators-depth")?;
    chart.title = format!("{title}: error of the distance");
    page.chart(stem, &chart, advice)?;
    page.table(&TITLES, &rows(&findings));
    Ok(())
}

/// A closed mesh seen from inside, by rays at its corners and edges.
fn aimed(effort: Effort, page: &mut Page) -> anyhow::Result<()> {
    let triangles = effort.blobs()[0] / 10;
    page.heading("Rays aimed at corners and edges");
    page.paragraph(&format!(
        "From inside a closed mesh of {}: every ray aims at a corner, or at the middle of an edge. None may get out.",
        in_words(triangles)
    ));
    let geometry = meshes::blob(triangles)?;
    let eye = DVec3::new(0.02, -0.03, 0.01);
    let mesh = geometry.meshes.first().context("a mesh")?;
    let mut rays = RayBatch::default().with_coherence(true);
    for triangle in mesh.triangles.iter() {
        let [a, b, _] = triangle.map(|corner| mesh.positions.get(corner as usize));
        for target in [a, 0.5 * (a + b)] {
            rays.push(eye, (target - eye).normalize());
        }
    }
    let (findings, _) = accelerators(effort, &geometry, &Rays::new(rays))?;
    let mut chart = chart(&findings, "accelerators-hits")?;
    chart.title = "Aimed at corners and edges: rays with a wrong answer".to_owned();
    page.chart("aimed", &chart, AIMED)?;
    page.table(&TITLES, &rows(&findings));
    Ok(())
}

/// Measured with all methods at the width of a render's batches, and the rounds it took.
fn accelerators(
    effort: Effort,
    geometry: &Arc<Geometry>,
    rays: &Rays,
) -> anyhow::Result<(Vec<AcceleratorMeasurement>, usize)> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let mut threads = vec![1, cores];
    threads.dedup();
    let is_heavy = geometry.triangles_unique() > HEAVY;
    let rounds = if is_heavy { effort.rounds().min(3) } else { effort.rounds() };
    let effort = accelerators::Effort {
        methods: Method::all(),
        widths: vec![RENDER_WIDTH],
        threads,
        rounds,
        quality: Quality::Medium,
        memory_limit: None,
    };
    Ok((accelerators::measure(geometry, rays, &effort, &|_| true)?, rounds))
}

/// One of the charts that `etendue bench` draws.
fn chart(findings: &[AcceleratorMeasurement], stem: &str) -> anyhow::Result<Chart> {
    let findings = Findings {
        machine: Vec::new(),
        scene: Vec::new(),
        rounds: 0,
        accelerators: findings.to_vec(),
        samplers: None,
        cameras: None,
        target: None,
        notes: Vec::new(),
    };
    let chart = findings.charts().into_iter().find(|(name, _)| *name == stem);
    chart.map(|(_, chart)| chart).ok_or_else(|| anyhow!("no chart {stem}"))
}

const TITLES: [&str; 7] =
    ["", "build (s)", "MB", "Mrays/s, all threads", "missed", "false", "wrong triangle"];

fn rows(findings: &[AcceleratorMeasurement]) -> Vec<Vec<String>> {
    let most = findings.iter().map(|finding| finding.threads).max().unwrap_or(1);
    let row = |finding: &AcceleratorMeasurement| {
        let errors = &finding.errors;
        let rate = |seconds: f64| errors.rays as f64 / seconds / 1e6;
        vec![
            format!("`{}`", finding.method),
            format!("{:.2}", finding.build_seconds.median),
            format!("{:.0}", finding.bytes as f64 / 1e6),
            format!(
                "{:.2} ({:.2} to {:.2})",
                rate(finding.seconds.median),
                rate(finding.seconds.slowest),
                rate(finding.seconds.fastest)
            ),
            format!("{} of {}", errors.missed, errors.hits),
            errors.false_hits.to_string(),
            errors.wrong_triangle.to_string(),
        ]
    };
    findings.iter().filter(|finding| finding.threads == most).map(row).collect()
}

/// A square picture of `view`.
fn camera(view: View) -> anyhow::Result<Camera> {
    let pose = Pose::look_at(view.from, view.look_at, DVec3::Y).context("a view upright")?;
    let spec = CameraSpec::perspective(pose, view.fov.to_radians(), 1.0);
    Ok(spec.build(|| Bounds::EMPTY, &|name: &str| Err(name.to_owned()))?)
}

/// 1000000 is "1 million triangles".
fn in_words(count: u64) -> String {
    match count {
        1_000_000.. => format!("{} million triangles", count / 1_000_000),
        _ => format!("{} thousand triangles", count / 1000),
    }
}
