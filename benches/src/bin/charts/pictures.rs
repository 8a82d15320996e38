//! Samplers on a thin lens and on a real one, and models of the real one.

use std::path::Path;

use anyhow::Context;
use etendue_accel::{Accel, BuildOptions};
use etendue_bench::findings::Findings;
use etendue_bench::pictures::Studio;
use etendue_bench::{cameras, samplers};
use etendue_benches::effort::Effort;
use etendue_chart::Chart;
use etendue_render::output::Outputs;
use etendue_render::{Plan, plan};
use etendue_scene::{LoadOptions, Scene, SceneFile};

use crate::page::Page;

const THIN_LENS: &str = "scenes/paper/fig6a.json";
const REAL_LENS: &str = "scenes/double-gauss.json";

const THIN: &str = "\
    Pick `sobol`, the default, for pictures of any number of samples. `stratified` and `hammersley` have to be told the \
    number beforehand, and `independent` is there to be compared with.";
const REAL: &str = "\
    Pick `sobol` here as well: the rays' way through the glass changes what a sample costs, not which samples are good \
    ones. Take four times the samples when twice the accuracy is wanted of `independent`, and fewer of the others.";
const MODELS: &str = "\
    Pick the full train when its blur, distortion or falloff is what you are after: no number of samples makes up for \
    what a simpler model leaves out, which is where its line runs flat. Pick the pinhole for ground truth alone, and the \
    thin lens for a picture that only has to look out of focus.";

pub(crate) fn measure(effort: Effort, page: &mut Page) -> anyhow::Result<()> {
    page.heading("Samplers on a thin lens");
    let (scene, accel) = load(THIN_LENS)?;
    sampled(effort, page, &scene, &*accel, ("samplers-thin", THIN_LENS, THIN))?;
    page.heading("Samplers on a real lens");
    let (scene, accel) = load(REAL_LENS)?;
    sampled(effort, page, &scene, &*accel, ("samplers-real", REAL_LENS, REAL))?;
    page.heading("Models of a double Gauss");
    let mut studio = Studio::new(&scene, &*accel)?;
    let found = cameras::measure(&mut studio, &pictures(effort), &|_| true)?;
    page.paragraph(&format!(
        "`{REAL_LENS}`: the lens as a pinhole in its entrance pupil, as a thin lens, as a thick lens, and surface by \
         surface; all registered, so that the same pixel looks the same way near the axis."
    ));
    let findings = Findings { cameras: Some(found), ..nothing() };
    page.chart("cameras", &only(findings, "cameras-time")?, MODELS)
}

fn sampled(
    effort: Effort,
    page: &mut Page,
    scene: &Scene,
    accel: &dyn Accel,
    (stem, path, advice): (&str, &str, &str),
) -> anyhow::Result<()> {
    let mut studio = Studio::new(scene, accel)?;
    let found = samplers::measure(&mut studio, &pictures(effort), &|_| true)?;
    page.paragraph(&format!(
        "`{path}`, place in the pixel and place in the pupil: four dimensions."
    ));
    let findings = Findings { samplers: Some(found), ..nothing() };
    let mut chart = only(findings, "samplers-samples")?;
    chart.title = format!("{path}: error against samples");
    page.chart(stem, &chart, advice)
}

fn pictures(effort: Effort) -> samplers::Effort {
    samplers::Effort {
        counts: vec![1, 4, 16, 64, 256],
        converged: 4096,
        rounds: effort.rounds().min(3),
        seconds: effort.pick(25.0, 4.0),
    }
}

fn nothing() -> Findings {
    Findings {
        machine: Vec::new(),
        scene: Vec::new(),
        rounds: 0,
        accelerators: Vec::new(),
        samplers: None,
        cameras: None,
        target: None,
        notes: Vec::new(),
    }
}

fn only(findings: Findings, stem: &str) -> anyhow::Result<Chart> {
    let chart = findings.charts().into_iter().find(|(name, _)| *name == stem);
    chart.map(|(_, chart)| chart).with_context(|| format!("a chart {stem}"))
}

fn load(path: &str) -> anyhow::Result<(Scene, Box<dyn Accel>)> {
    let file = SceneFile::read(Path::new(path), &[])?;
    let scene = file.load(plan::wanted(&file.spec.all_layers()), &LoadOptions::default())?;
    let plan = Plan::new(&scene, Outputs { npy: true, ..Outputs::NONE });
    let accel = etendue_render::build(&scene, &plan, &BuildOptions::default())?;
    Ok((scene, accel))
}
