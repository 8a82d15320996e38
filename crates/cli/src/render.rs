//! `etendue render`: from a file to a folder of images.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use etendue_accel::{Accel, BuildOptions};
use etendue_render::output::{
    ImageHash, Look, Outputs, PartFile, Picture, SOFTWARE, exr, npy, png, prepare_folder, sidecar,
};
use etendue_render::report::{memory, seconds};
use etendue_render::{Images, Plan, Rendered, Report, Seconds, expose, plan};
use etendue_scene::file::{FileKind, SceneFile};
use etendue_scene::import::Note;
use etendue_scene::{LoadOptions, Scene};

use crate::arguments::{AccelMode, RenderArguments, SceneArguments};
use crate::fault::{Fault, print_text};
use crate::progress::Stages;
use crate::stop;

pub(crate) fn run(arguments: &RenderArguments) -> Result<(), Fault> {
    stop::listen();
    let outputs = Outputs::from_list(&arguments.outputs)
        .map_err(|message| Fault::refused(format!("--outputs: {message}")))?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(arguments.threads)
        .build()
        .map_err(|error| Fault::refused(format!("--threads {}: {error}", arguments.threads)))?;
    let folder_is_new = !arguments.output.exists();
    let done = pool.install(|| render(arguments, outputs));
    if done.is_err() && folder_is_new {
        // Goes only when nothing was written into it.
        let _ = std::fs::remove_dir(&arguments.output);
    }
    done
}

/// Reads a scene and all that its layers want of the models.
pub(crate) fn load(arguments: &SceneArguments, stages: Stages) -> Result<Scene, Fault> {
    let mut overrides = arguments.overrides();
    let mut file = SceneFile::read(&arguments.scene, &overrides)?;
    if file.kind() == FileKind::Model && file.spec.layers.is_empty() && file.spec.tracer.is_none() {
        // A bare model gets a picture and the two layers that most people come for.
        overrides.push(("tracer".to_owned(), r#"{"type": "facing"}"#.to_owned()));
        overrides.push(("layers".to_owned(), r#"["depth", "normal"]"#.to_owned()));
        file = SceneFile::read(&arguments.scene, &overrides)?;
    }
    let progress = stages.begin("load");
    let options = LoadOptions {
        progress: Some(&|step| progress(step.done as f64 / step.total.max(1) as f64)),
        ..arguments.load_options()
    };
    Ok(file.load(plan::wanted(&file.spec.all_layers()), &options)?)
}

fn render(arguments: &RenderArguments, outputs: Outputs) -> Result<(), Fault> {
    let start = Instant::now();
    let mut time = Seconds::default();
    let mut lap = Lap(start);
    let stages = Stages::new(arguments.quiet);
    prepare_folder(&arguments.output)?;
    if let Some(path) = &arguments.report {
        // Whether it can be written is better known now than after the render.
        drop(PartFile::create(path)?);
    }
    let scene = load(&arguments.scene, stages)?;
    let plan = Plan::new(&scene, outputs);
    time.load = lap.take();
    let accel = etendue_render::build(&scene, &plan, &build_options(arguments, stages))?;
    time.build = lap.take();
    let images = Images::decode(&scene, &plan);
    if arguments.scene.strict
        && let Some(fault) = images.faults.first()
    {
        return Err(Fault::refused(fault.clone()));
    }
    time.decode = lap.take();
    let header = header(&scene)?;
    let progress = stages.begin("render");
    let mut rendered = etendue_render::render(&scene, &plan, &*accel, &images, header, &*progress)?;
    drop(progress);
    time.render = lap.take();
    let mut files = write(&arguments.output, &scene, &rendered.picture, outputs, stages)?;
    let progress = stages.begin("expose");
    let folder = &arguments.output;
    let light = (&rendered.picture, rendered.lane_film.take());
    let exposed = expose::write(&scene, light, folder, outputs, &*progress)?;
    drop(progress);
    files.extend(exposed.files);
    time.write = lap.take();
    time.total = seconds(start.elapsed());
    let mut report = report(&scene, &*accel, &images, &rendered, time, &files)?;
    report.notes.extend(exposed.notes);
    if let Some(path) = &arguments.report {
        sidecar::write_json(path, &report)?;
    }
    if !arguments.quiet {
        say(&report);
    }
    let lines: Vec<String> = files.iter().map(|path| path.display().to_string()).collect();
    print_text(&lines.join("\n"))
}

fn build_options(arguments: &RenderArguments, stages: Stages) -> BuildOptions {
    BuildOptions {
        threads: rayon::current_num_threads(),
        memory_limit: arguments.memory_limit,
        robust: arguments.accel_mode == AccelMode::Robust,
        isa: arguments.isa.clone(),
        progress: Some(stages.begin("build")),
        ..BuildOptions::default()
    }
}

/// Time since it was last asked.
struct Lap(Instant);

impl Lap {
    fn take(&mut self) -> f64 {
        let lap = seconds(self.0.elapsed());
        self.0 = Instant::now();
        lap
    }
}

/// What stands in the header of every file.
fn header(scene: &Scene) -> Result<Vec<(String, String)>, Fault> {
    let header: Vec<(String, String)> = [
        ("scene_hash", scene.hash()?.to_string()),
        ("seed", scene.render.seed.to_string()),
        ("samples", scene.render.samples.to_string()),
        ("pixel_origin", "pixel centres lie at half-integers from the picture's corner".to_owned()),
        ("camera", serde_json::to_string(&scene.camera.opencv()).unwrap_or_default()),
    ]
    .map(|(key, value)| (key.to_owned(), value))
    .into();
    Ok(header)
}

/// Writes everything; each file appears when it is complete.
fn write(
    folder: &Path,
    scene: &Scene,
    picture: &Picture,
    outputs: Outputs,
    stages: Stages,
) -> Result<Vec<PathBuf>, Fault> {
    let progress = stages.begin("write");
    let mut files = Vec::new();
    let mut place = |name: String| {
        let path = folder.join(name);
        files.push(path.clone());
        path
    };
    if outputs.exr {
        let options =
            exr::Options { progress: Some(&|share| progress(share * 0.5)), ..Default::default() };
        exr::write(&place("layers.exr".to_owned()), picture, &options)?;
    }
    let total = picture.layers().len() as f64;
    for (done, layer) in picture.layers().iter().enumerate() {
        if !progress(0.5 + 0.5 * done as f64 / total) {
            return Err(etendue_render::RenderError::Stopped.into());
        }
        let stem = stem(&layer.name);
        if outputs.png {
            let name = match layer.name.as_str() {
                "" => format!("{stem}.png"),
                _ => format!("{stem}.preview.png"),
            };
            let bits = match layer.look {
                Look::Distance => png::Bits::Sixteen,
                _ => png::Bits::Eight,
            };
            png::write(&place(name), picture, &layer.name, bits)?;
            let mask = folder.join(format!("{stem}.png"));
            if png::has_mask(layer) && png::write_mask(&mask, picture, &layer.name)? {
                place(format!("{stem}.png"));
            }
        }
        if outputs.npy {
            npy::write(&place(format!("{stem}.npy")), picture, &layer.name)?;
        }
    }
    sidecar::write_json(&place("camera.json".to_owned()), &scene.camera.opencv())?;
    sidecar::write(&place("layers.json".to_owned()), picture)?;
    Ok(files)
}

/// A layer's file name: `NormalCamera` is `normal_camera`, `Id.object` `id_object`, the picture
/// `picture`.
fn stem(layer: &str) -> String {
    if layer.is_empty() {
        return "picture".to_owned();
    }
    let mut stem = String::new();
    for c in layer.replace('.', "_").chars() {
        if c.is_ascii_uppercase() && !stem.is_empty() {
            stem.push('_');
        }
        stem.push(c.to_ascii_lowercase());
    }
    stem
}

fn report(
    scene: &Scene,
    accel: &dyn Accel,
    images: &Images,
    rendered: &Rendered,
    seconds: Seconds,
    files: &[PathBuf],
) -> Result<Report, Fault> {
    let built = accel.report();
    let counts = accel.counts();
    let (peak, private) = memory();
    let mut notes: Vec<String> = scene.notes.iter().map(in_words).collect();
    notes.extend(images.faults.iter().cloned());
    notes.extend(rendered.notes.iter().cloned());
    if rendered.light.not_finite > 0 {
        let count = rendered.light.not_finite;
        notes.push(format!("{count} contributions of light were not finite and are left out"));
    }
    let sizes = images.sizes(scene);
    Ok(Report {
        software: SOFTWARE,
        scene: scene.path.clone(),
        scene_hash: scene.hash()?.to_string(),
        image_hash: ImageHash::of(&rendered.picture).to_string(),
        resolution: scene.camera.resolution(),
        layers: rendered
            .picture
            .layers()
            .iter()
            .map(etendue_render::output::Layer::title)
            .collect(),
        accel: built.backend,
        build_quality: format!("{:?}", built.quality).to_lowercase(),
        threads: rayon::current_num_threads(),
        seed: scene.render.seed,
        seconds,
        rays: rendered.rays,
        lens_rays: rendered.fates.total(),
        lens_losses: rendered.fates.losses(),
        mrays_per_second: rendered.rays as f64 / rendered.trace_time.as_secs_f64() / 1e6,
        rechecked: counts.rechecked,
        corrected: counts.corrected,
        triangles: scene.geometry.triangles(),
        triangles_unique: scene.geometry.triangles_unique(),
        placements: scene.geometry.placements.len() as u64,
        bvh_bytes: built.bytes,
        geometry_bytes_mapped: scene.stats.bytes_mapped,
        geometry_bytes_copied: scene.stats.bytes_copied + built.copied_bytes,
        image_bytes: sizes.iter().map(|size| size.bytes).sum(),
        images: sizes,
        not_finite: rendered.light.not_finite,
        peak_memory_bytes: peak,
        peak_private_bytes: private,
        notes,
        files: files.to_vec(),
    })
}

/// A note as one line.
fn in_words(note: &Note) -> String {
    match note.count {
        0 | 1 => format!("{}: {}", note.subject, note.message),
        count => format!("{} (x{count}): {}", note.subject, note.message),
    }
}

/// A few lines for a person, on standard error. When nobody reads it, nobody is told.
fn say(report: &Report) {
    let mut lines: Vec<String> = report.notes.iter().map(|note| format!("note: {note}")).collect();
    let Seconds { load, build, decode, render, write, total } = report.seconds;
    lines.push(format!(
        "{} triangles ({} stored), {} rays at {:.1} Mrays/s through {}",
        report.triangles,
        report.triangles_unique,
        report.rays,
        report.mrays_per_second,
        report.accel
    ));
    if report.lens_rays > 0 {
        let lost = match report.lens_losses.as_slice() {
            [] => "none lost".to_owned(),
            losses => losses.join(", "),
        };
        lines.push(format!("{} rays into the lens: {lost}", report.lens_rays));
    }
    lines.push(format!(
        "load {load:.2} s, build {build:.2} s, decode {decode:.2} s, render {render:.2} s, write \
         {write:.2} s; {total:.2} s in all, {} MiB at most",
        report.peak_memory_bytes >> 20
    ));
    let _ = writeln!(std::io::stderr(), "{}", lines.join("\n"));
}
