//! `etendue render`: from a file to a folder of images.

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use etendue_accel::{Accel, BuildOptions};
use etendue_render::light_field::{self, Rendering};
use etendue_render::output::{
    ImageHash, Ledger, Look, MANIFEST, Outputs, Picture, SOFTWARE, Temporary, exr, npy, png,
    sidecar,
};
use etendue_render::report::{memory, seconds};
use etendue_render::{
    Images, Plan, Progress, Rendered, Report, Seconds, SoFar, Watch, expose, plan,
};
use etendue_scene::escape::one_line;
use etendue_scene::file::{FileKind, SceneFile};
use etendue_scene::import::Note;
use etendue_scene::memory::Budget;
use etendue_scene::{LoadOptions, Scene};

use crate::arguments::{AccelMode, RenderArguments, SceneArguments};
use crate::fault::{Fault, print_text};
use crate::progress::{Stages, say};
use crate::{places, stop};

pub(crate) fn run(arguments: &RenderArguments) -> Result<(), Fault> {
    stop::listen();
    let outputs = Outputs::from_list(&arguments.outputs)
        .map_err(|message| Fault::refused(format!("--outputs: {message}")))?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(arguments.threads)
        .build()
        .map_err(|error| Fault::refused(format!("--threads {}: {error}", arguments.threads)))?;
    let folder_is_new = !arguments.output.exists();
    if folder_is_new {
        stop::made(&arguments.output);
    }
    let done = pool.install(|| render(arguments, outputs));
    if done.is_err() && folder_is_new {
        // Goes only when nothing was written into it.
        let _ = std::fs::remove_dir(&arguments.output);
    }
    done
}

/// What memory a scene is loaded for.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Memory {
    /// To be looked at.
    Look,
    /// To be rendered.
    Render {
        /// The most bytes to take; what the system has free without it.
        limit: Option<u64>,
        /// Read models into memory instead of mapping them.
        copy: bool,
    },
}

/// Reads a scene and all that its layers want of the models.
pub(crate) fn load(
    arguments: &SceneArguments,
    memory: Memory,
    stages: Stages,
) -> Result<Scene, Fault> {
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
        memory_limit: match memory {
            Memory::Look => None,
            Memory::Render { limit, .. } => limit,
        },
        to_render: matches!(memory, Memory::Render { .. }),
        copy: matches!(memory, Memory::Render { copy: true, .. }),
        ..arguments.load_options()
    };
    Ok(file.load(plan::wanted(&file.spec.all_layers()), &options)?)
}

fn render(arguments: &RenderArguments, outputs: Outputs) -> Result<(), Fault> {
    let start = Instant::now();
    let mut time = Seconds::default();
    let mut lap = Lap(start);
    let stages = Stages::new(arguments.quiet);
    let mut notes = Notes { said: !arguments.quiet, all: Vec::new() };
    // Whether they can be written is better known now than after the render.
    places::folder(&arguments.output)?;
    if let Some(path) = &arguments.report {
        places::file(path)?;
    }
    let memory = Memory::Render { limit: arguments.memory_limit, copy: arguments.copy };
    let scene = load(&arguments.scene, memory, stages)?;
    notes.add(scene.notes.iter().map(in_words));
    let plan = Plan::new(&scene, outputs);
    keep_inputs(arguments, &scene, &plan, outputs)?;
    fits(&scene, &plan, arguments.memory_limit)?;
    time.load = lap.take();
    let accel = etendue_render::build(&scene, &plan, &build_options(arguments, stages))?;
    time.build = lap.take();
    let images = Images::decode(&scene, &plan, arguments.memory_limit)?;
    if arguments.scene.strict
        && let Some(fault) = images.faults.first()
    {
        return Err(Fault::refused(fault.clone()));
    }
    notes.add(images.faults.iter().cloned());
    time.decode = lap.take();
    let header = header(&scene)?;
    let watching = Watching::new(arguments, stages, outputs);
    let mut rendered = etendue_render::render(&scene, &plan, &*accel, &images, header, &watching)?;
    drop(watching);
    time.render = lap.take();
    let partial = heed_stop(&rendered, plan.samples, arguments)?;
    notes.add(partial.clone());
    notes.add(rendered.notes.iter().cloned());
    notes.add(not_finite(&rendered));
    notes.add(changed(&scene));
    let folder = &arguments.output;
    let (files, more) = places::recorded(Ledger::open(folder, "render"), || {
        let mut files = write(folder, &scene, &rendered.picture, outputs, stages)?;
        let progress = stages.begin("expose");
        let light = (&rendered.picture, rendered.band_film.take());
        let exposed = expose::write(&scene, light, folder, outputs, &*progress)?;
        files.extend(exposed.files);
        let rendering = Rendering { scene: &scene, accel: &*accel, images: &images };
        let progress = stages.begin("light field");
        let set = light_field::write(rendering, &rendered.picture, folder, outputs, &*progress)?;
        files.extend(set.files);
        Ok((files, [exposed.notes, set.notes].concat()))
    })?;
    notes.add(more);
    time.write = lap.take();
    time.total = seconds(start.elapsed());
    let mut report = report(&scene, &*accel, &images, &rendered, time, &files)?;
    (report.samples_wanted, report.notes) = (plan.samples, notes.all);
    if let Some(path) = &arguments.report {
        sidecar::write_json(path, &report)?;
    }
    if !arguments.quiet {
        summarise(&report);
    }
    let lines: Vec<String> = files.iter().map(|path| path.display().to_string()).collect();
    print_text(&lines.join("\n"))?;
    match partial {
        None => Ok(()),
        Some(partial) => Err(Fault::stopped(format!(
            "{partial}; the picture so far is in {}",
            arguments.output.display()
        ))),
    }
}

/// Refuses what will not fit into the memory that is allowed, or else free.
fn fits(scene: &Scene, plan: &Plan, limit: Option<u64>) -> Result<(), Fault> {
    let memory = &plan.memory;
    let bytes = match limit {
        Some(_) => memory.total - memory.program,
        // What was loaded is no longer free.
        None => memory.to_come(),
    };
    let Err(error) = Budget::new(limit).take(bytes) else { return Ok(()) };
    let [width, height] = scene.camera.resolution();
    let images = scene.textures.iter().map(|texture| (texture.decoded_bytes(), &texture.name));
    let largest = match images.max() {
        Some((bytes, name)) if 2 * bytes > memory.total => {
            format!(" (most of it for the image {})", one_line(name))
        }
        _ => String::new(),
    };
    let path = scene.path.display();
    Err(Fault::refused(format!("{path}: a picture of {width} x {height} pixels{largest} {error}")))
}

/// Refuses to write over what the scene is made of, and the report over a result.
fn keep_inputs(
    arguments: &RenderArguments,
    scene: &Scene,
    plan: &Plan,
    outputs: Outputs,
) -> Result<(), Fault> {
    let names = ["layers.exr", "camera.json", "layers.json", MANIFEST, SO_FAR].map(str::to_owned);
    let mut results: Vec<PathBuf> = names
        .into_iter()
        .chain(plan.names(scene).iter().flat_map(|layer| layer_files(layer, outputs)))
        .chain(expose::file_names(scene))
        .chain(light_field::file_names(scene))
        .map(|name| arguments.output.join(name))
        .collect();
    let results_folder = arguments.output.canonicalize().ok();
    if let Some(report) = &arguments.report {
        let folder = report.parent().map(|folder| match folder.as_os_str().is_empty() {
            true => Path::new("."),
            false => folder,
        });
        let is_inside = folder.and_then(|folder| folder.canonicalize().ok()) == results_folder;
        if is_inside && results.iter().any(|path| path.file_name() == report.file_name()) {
            return Err(Fault::refused(format!(
                "--report {}: a result has this name; choose another one",
                report.display()
            )));
        }
        results.push(report.clone());
    }
    places::keep_apart(&scene.inputs, &results)
}

/// What a user should know, said as soon as it is known.
struct Notes {
    said: bool,
    all: Vec<String>,
}

impl Notes {
    fn add(&mut self, notes: impl IntoIterator<Item = String>) {
        for note in notes {
            if self.said {
                say(&format!("note: {note}"));
            }
            self.all.push(note);
        }
    }
}

/// What a stop left of the picture, in words; `None` when it is complete.
fn heed_stop(
    rendered: &Rendered,
    wanted: u32,
    arguments: &RenderArguments,
) -> Result<Option<String>, Fault> {
    stop::saves(false);
    if rendered.samples == wanted {
        return Ok(None);
    }
    if arguments.discard_partial {
        return Err(etendue_render::RenderError::Stopped.into());
    }
    // From here on only a second signal stops.
    stop::heed();
    Ok(Some(format!("stopped after {} of {wanted} samples a pixel", rendered.samples)))
}

/// The bar of a render, and the picture so far beside its results.
struct Watching {
    progress: Progress,
    keeps: bool,
    /// Where the picture so far is shown; nowhere when no PNG is wanted. It goes when this does, and
    /// so does that of a run that was killed.
    place: Option<(PathBuf, Temporary)>,
    start: Instant,
    /// How long it took to write it last, and when that was done.
    shown: Mutex<Option<(Duration, Instant)>>,
}

/// The picture so far.
const SO_FAR: &str = "picture.so-far.png";

/// The picture so far is not written more often than takes this share of the time.
const SHARE_OF_LOOKS: f64 = 0.01;

impl Watching {
    fn new(arguments: &RenderArguments, stages: Stages, outputs: Outputs) -> Self {
        Self {
            progress: stages.begin("render"),
            keeps: !arguments.discard_partial,
            place: outputs.png.then(|| {
                let place = arguments.output.join(SO_FAR);
                (place.clone(), Temporary::new(place))
            }),
            start: Instant::now(),
            shown: Mutex::default(),
        }
    }

    /// Whether a picture of so many pixels is worth its writing now.
    fn is_due(&self, last: Option<(Duration, Instant)>, share: f64) -> bool {
        let left = self.start.elapsed().as_secs_f64() * (1.0 / share.max(1e-9) - 1.0);
        match last {
            // Not for renders that are done before anybody has opened it.
            None => left > 2.0,
            Some((took, when)) => {
                left > 2.0 && took.as_secs_f64() < SHARE_OF_LOOKS * when.elapsed().as_secs_f64()
            }
        }
    }
}

impl Watch for Watching {
    fn goes_on(&self, share: f64) -> bool {
        (self.progress)(share)
    }

    fn look(&self, so_far: &SoFar<'_>) {
        stop::saves(self.keeps);
        let Some((place, _)) = &self.place else { return };
        let Ok(mut shown) = self.shown.lock() else { return };
        if !self.is_due(*shown, so_far.share) {
            return;
        }
        let start = Instant::now();
        // A look is a favour: the render goes on without it, and the results will say what is wrong
        // with the folder.
        if let Ok(picture) = so_far.picture() {
            let _ = png::write(place, &picture, "", png::Bits::Eight);
        }
        *shown = Some((start.elapsed(), Instant::now()));
    }
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
        let [image, array] = image_and_array(&layer.name);
        if outputs.png {
            let bits = match layer.look {
                Look::Distance => png::Bits::Sixteen,
                _ => png::Bits::Eight,
            };
            png::write(&place(image), picture, &layer.name, bits)?;
            let mask = format!("{}.png", stem(&layer.name));
            if png::has_mask(layer) && png::write_mask(&folder.join(&mask), picture, &layer.name)? {
                place(mask);
            }
        }
        if outputs.npy {
            npy::write(&place(array), picture, &layer.name)?;
        }
    }
    sidecar::write_json(&place("camera.json".to_owned()), &scene.camera.opencv())?;
    sidecar::write(&place("layers.json".to_owned()), picture)?;
    Ok(files)
}

/// The files of a layer: to look at, and for numpy.
fn image_and_array(layer: &str) -> [String; 2] {
    let stem = stem(layer);
    let image = match layer {
        "" => format!("{stem}.png"),
        _ => format!("{stem}.preview.png"),
    };
    [image, format!("{stem}.npy")]
}

/// Those of them that are wanted.
fn layer_files(layer: &str, outputs: Outputs) -> Vec<String> {
    let [image, array] = image_and_array(layer);
    let has_mask = layer.starts_with("Id.") || layer == "MaterialId";
    let mask = format!("{}.png", stem(layer));
    let files = [(outputs.png, image), (outputs.npy, array), (outputs.png && has_mask, mask)];
    files.into_iter().filter_map(|(wanted, name)| wanted.then_some(name)).collect()
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
        samples: rendered.samples,
        samples_wanted: rendered.samples,
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
        notes: Vec::new(),
        files: files.to_vec(),
    })
}

/// A note as one line.
fn in_words(note: &Note) -> String {
    let Note { subject, message, .. } = note;
    one_line(&match note.count {
        0 | 1 => format!("{subject}: {message}"),
        count => format!("{subject} (x{count}): {message}"),
    })
    .into_owned()
}

/// Models that another program wrote to meanwhile.
fn changed(scene: &Scene) -> impl Iterator<Item = String> {
    scene.changed_files().into_iter().map(|path| {
        let path = path.display();
        format!(
            "{path} changed while it was rendered: what is seen may be old or new; render again"
        )
    })
}

/// That some light was left out, if it was.
fn not_finite(rendered: &Rendered) -> Option<String> {
    let count = rendered.light.not_finite;
    (count > 0).then(|| format!("{count} contributions of light were not finite and are left out"))
}

/// A few lines for a person, on standard error.
fn summarise(report: &Report) {
    let mut lines = Vec::new();
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
    say(&lines.join("\n"));
}
