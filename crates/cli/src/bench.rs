//! `etendue bench`: speed against accuracy on the user's own scene and machine.

mod target;

use std::io::Write;
use std::path::PathBuf;

use etendue::{Options, Session, Setting, places};
use etendue_accel::{Accel, BuildOptions, Quality};
use etendue_bench::accelerators::{self, Method};
use etendue_bench::findings::Findings;
use etendue_bench::hits::Rays;
use etendue_bench::pictures::{Studio, is_sampled};
use etendue_bench::timing;
use etendue_bench::{BenchError, cameras, drawing, samplers};
use etendue_chart::Theme;
use etendue_files::{Ledger, MANIFEST, Opener, Transaction};
use etendue_render::Plan;
use etendue_render::output::{Outputs, sidecar};
use etendue_scene::Scene;
use etendue_scene::file::SceneFile;

use crate::arguments::{BenchArguments, PartArgument, SceneArguments};
use crate::fault::{Fault, print_text};
use crate::progress::{Phases, say};
use crate::{job, stop};

/// All of a run, and of a quick one.
const ROUNDS: [usize; 2] = [5, 3];
const RAYS: [usize; 2] = [1 << 19, 1 << 16];
const BATCHES: [&[usize]; 2] = [&[16, 64, 256, 1024], &[64, 256]];
const SAMPLES: [&[u32]; 2] = [&[1, 4, 16, 64, 256], &[1, 4, 16, 64]];
const SECONDS: [f64; 2] = [60.0, 10.0];

/// The converged picture has so many times as many samples as the best of the others.
const CONVERGED: u32 = 16;

pub(crate) fn run(arguments: &BenchArguments) -> Result<(), Fault> {
    stop::listen(say);
    let folder_is_new = !arguments.output.exists();
    let done = bench(arguments);
    if done.is_err() && folder_is_new {
        // Goes only when nothing was written into it.
        let _ = std::fs::remove_dir(&arguments.output);
    }
    done
}

fn bench(arguments: &BenchArguments) -> Result<(), Fault> {
    let phases = Phases::new(arguments.quiet);
    places::folder(&arguments.output)?;
    // The scene, with a picture where parts need one.
    let has = |part| wants(arguments, part);
    let has_pictures = has(PartArgument::Samplers) || has(PartArgument::Cameras);
    let mut notes = Vec::new();
    let scene_arguments = match has_pictures {
        true => with_picture(&arguments.scene, &mut notes)?,
        false => arguments.scene.clone(),
    };
    let options =
        Options { memory_limit: arguments.memory_limit, ..job::options(&scene_arguments) };
    let mut session = Session::open_with(&scene_arguments.scene, options)?;
    let progress = phases.progress(false);
    let scene = session.scene(&progress)?;
    // Results must not be written over inputs.
    let results = file_names().map(|name| arguments.output.join(name)).collect::<Vec<_>>();
    places::keep_apart(&scene.inputs, &results)?;
    let mut findings = Findings {
        machine: timing::describe(),
        scene: about(scene),
        rounds: arguments.rounds.unwrap_or(ROUNDS[usize::from(arguments.quick)]),
        accelerators: Vec::new(),
        samplers: None,
        cameras: None,
        target: None,
        notes,
    };
    // The parts that were asked for, and their files.
    if has(PartArgument::Accelerators) {
        accelerators(arguments, scene, phases, &mut findings)?;
    }
    if has_pictures {
        let (scene, accel) = session.scene_and_accel(&progress)?;
        pictures(arguments, scene, accel, phases, &mut findings)?;
    }
    if let Some(target) = arguments.target {
        let mut axes = target::axes(session.scene(&progress)?);
        axes.extend(target::sweeps(&arguments.sweep, session.file())?);
        let found = target::race(arguments, target, session.scene(&progress)?, phases, &axes)?;
        findings.notes.extend(found.notes.iter().cloned());
        findings.target = Some(found);
    }
    let ledger = Ledger::open(&arguments.output, "bench");
    let files = places::recorded(ledger, &session.inputs(), |to| write(to, arguments, &findings))?;
    print_text(&findings.text())?;
    if !arguments.quiet {
        let lines = findings.notes.iter().map(|note| format!("note: {note}"));
        let files = files.iter().map(|path| path.display().to_string());
        lines.chain(files).for_each(|line| say(&line));
    }
    Ok(())
}

/// True if a part is measured: those that are named, or all where no target is.
fn wants(arguments: &BenchArguments, part: PartArgument) -> bool {
    let all = arguments.only.is_empty() && arguments.target.is_none();
    all || arguments.only.contains(&part)
}

/// Description of what is traced.
fn about(scene: &Scene) -> Vec<String> {
    let geometry = &scene.geometry;
    let [width, height] = scene.camera.resolution();
    vec![format!(
        "Scene: {}, {} triangles ({} stored) in {} placements, {width} x {height} pixels",
        scene.path.display(),
        geometry.triangles(),
        geometry.triangles_unique(),
        geometry.placements.len()
    )]
}

fn accelerators(
    arguments: &BenchArguments,
    scene: &Scene,
    phases: Phases,
    findings: &mut Findings,
) -> Result<(), Fault> {
    let quick = usize::from(arguments.quick);
    let mut rays = Rays::primary(&scene.camera, arguments.rays.unwrap_or(RAYS[quick]));
    // Incoherent rays start where the camera's hit.
    if arguments.scattered {
        let options =
            BuildOptions { memory_limit: arguments.memory_limit, ..BuildOptions::default() };
        let accel = Method::BVH.build(&scene.geometry, &options).map_err(BenchError::from)?;
        rays = rays.scattered(&*accel);
        if rays.is_empty() {
            let why = "--scattered: the camera sees nothing that rays could scatter from";
            return Err(Fault::refused(why));
        }
        let many = format!("Rays: {} scattered from what the camera sees", rays.len());
        findings.scene.push(many);
    }
    // What is measured of each method.
    let effort = accelerators::Effort {
        methods: Method::all(),
        widths: sorted(arguments.batches.as_deref().unwrap_or(BATCHES[quick])),
        threads: match &arguments.threads {
            Some(threads) => sorted(threads),
            None => threads(arguments.quick),
        },
        rounds: findings.rounds,
        quality: quality(scene),
        memory_limit: arguments.memory_limit,
    };
    let progress = phases.begin("trace");
    findings.accelerators =
        accelerators::measure(&scene.geometry, &rays, &effort, &|share| progress(share))?;
    Ok(())
}

/// The scene with a picture: base colours when it names none.
fn with_picture(
    arguments: &SceneArguments,
    notes: &mut Vec<String>,
) -> Result<SceneArguments, Fault> {
    let mut arguments = arguments.clone();
    let file = SceneFile::read_with(
        &Opener::new(arguments.reach()),
        &arguments.scene,
        &arguments.overrides(),
    )?;
    if file.spec.tracer.is_none() {
        arguments.settings.push(Setting::new("tracer", r#"{"type": "facing"}"#));
        notes.push("the scene names no `tracer`; its pictures are of `facing`".to_owned());
    }
    Ok(arguments)
}

/// The samplers, and the models of the lens when there is one.
fn pictures(
    arguments: &BenchArguments,
    scene: &Scene,
    accel: &dyn Accel,
    phases: Phases,
    findings: &mut Findings,
) -> Result<(), Fault> {
    let quick = usize::from(arguments.quick);
    // How many samples, and the time that they may take.
    let counts = match &arguments.sample_counts {
        Some(counts) => sorted(counts),
        None => SAMPLES[quick].to_vec(),
    };
    let effort = samplers::Effort {
        converged: CONVERGED.saturating_mul(counts.last().copied().unwrap_or(1)),
        counts,
        rounds: findings.rounds,
        seconds: arguments.seconds.unwrap_or(SECONDS[quick]),
    };
    let has = |part| wants(arguments, part);
    if has(PartArgument::Samplers) && scene.picture.is_some_and(is_sampled) {
        let progress = phases.begin("sample");
        let mut studio = Studio::new(scene, accel)?;
        findings.samplers =
            Some(samplers::measure(&mut studio, &effort, &|share| progress(share))?);
    }
    if has(PartArgument::Cameras) {
        let progress = phases.begin("camera");
        let mut studio = Studio::new(scene, accel)?;
        match cameras::measure(&mut studio, &effort, &|share| progress(share)) {
            Ok(cameras) => {
                findings.notes.extend(cameras.notes.iter().cloned());
                findings.cameras = Some(cameras);
            }
            Err(error @ BenchError::NoLens(_)) => findings.notes.push(error.to_string()),
            Err(error) => return Err(error.into()),
        }
    }
    Ok(())
}

/// The quality that a render of the scene would build with.
fn quality(scene: &Scene) -> Quality {
    Plan::new(scene, Outputs::ALL).quality
}

/// One thread, twice as many and so on, and all; in a quick run the first and the last of these.
fn threads(quick: bool) -> Vec<usize> {
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    let mut threads: Vec<usize> =
        std::iter::successors(Some(1), |n| Some(2 * n)).take_while(|&n| n < all).collect();
    if quick {
        threads.truncate(1);
    }
    threads.push(all);
    threads
}

/// In order, each once.
fn sorted<T: Ord + Copy>(numbers: &[T]) -> Vec<T> {
    let mut numbers = numbers.to_vec();
    numbers.sort_unstable();
    numbers.dedup();
    numbers
}

/// The names of all files that a bench may write.
fn file_names() -> impl Iterator<Item = String> {
    let charts = [
        "accelerators-hits",
        "accelerators-depth",
        "accelerators-batch",
        "samplers-time",
        "samplers-samples",
        "cameras-time",
        "target-time",
    ];
    let charts =
        charts.into_iter().flat_map(|stem| ["svg", "png"].map(|end| format!("{stem}.{end}")));
    let tables = ["accelerators", "samplers", "cameras", "target", "target-equal-time"]
        .map(|stem| format!("{stem}.csv"));
    let others = ["target-equal-time.png", "bench.json", MANIFEST].map(str::to_owned);
    tables.into_iter().chain(charts).chain(others)
}

/// Writes all files; each appears when it is complete.
fn write(
    to: &Transaction,
    arguments: &BenchArguments,
    findings: &Findings,
) -> Result<Vec<PathBuf>, Fault> {
    let place = |name: &str| arguments.output.join(name);
    let mut files = vec![place("bench.json")];
    sidecar::write_json(to, &files[0], findings)?;
    let mut save = |name: String, bytes: &[u8]| {
        let path = place(&name);
        to.write(&path, |file| file.write_all(bytes))?;
        files.push(path);
        Ok::<(), Fault>(())
    };
    for (name, csv) in findings.csv() {
        save(name.to_owned(), csv.as_bytes())?;
    }
    if let Some(strip) = findings.target.as_ref().and_then(|target| target.strip.as_ref()) {
        save("target-equal-time.png".to_owned(), &drawing::strip(strip)?)?;
    }
    for (stem, chart) in findings.charts() {
        save(format!("{stem}.svg"), chart.svg(Theme::Reader).as_bytes())?;
        save(format!("{stem}.png"), &drawing::png(&chart)?)?;
    }
    Ok(files)
}
