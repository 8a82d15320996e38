//! `etendue render`: from a file to a folder of images.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use etendue::{
    Calibration, Checkpoint, Error, Options, Progress, Rendering, Session, SoFar, TimeForecast,
    places,
};
use etendue_files::{Temporary, Transaction, real_place};
use etendue_render::output::{Outputs, png, sidecar};
use etendue_render::{RenderError, Report, Seconds};

use crate::arguments::{AccelMode, RenderArguments, SceneArguments};
use crate::fault::{Fault, print_text};
use crate::progress::{Phases, expect, say};
use crate::{merge, sequence, stop};

pub(crate) fn run(arguments: &RenderArguments) -> Result<(), Fault> {
    carry_out(arguments, |outputs| render(arguments, outputs))
}

/// Runs `render`, which writes into the output folder, on as many threads as are asked for.
pub(crate) fn carry_out(
    arguments: &RenderArguments,
    render: impl FnOnce(Outputs) -> Result<(), Fault> + Send,
) -> Result<(), Fault> {
    stop::listen(say);
    let outputs = Outputs::from_list(&arguments.outputs)
        .map_err(|message| Fault::refused(format!("--outputs: {message}")))?;
    let outputs = Outputs { denoised: arguments.denoise, ..outputs };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(arguments.threads)
        .build()
        .map_err(|error| Fault::refused(format!("--threads {}: {error}", arguments.threads)))?;
    let folder_is_new = !arguments.output.exists();
    if folder_is_new {
        stop::made(&arguments.output);
    }
    let done = pool.install(|| render(outputs));
    if done.is_err() && folder_is_new {
        // Goes only when nothing was written into it.
        let _ = std::fs::remove_dir(&arguments.output);
    }
    done
}

/// The options of a session, as far as a scene's arguments tell.
pub(crate) fn options(arguments: &SceneArguments) -> Options {
    let options = arguments.load_options();
    Options {
        settings: arguments.overrides(),
        strictness: options.strictness,
        reach: arguments.reach(),
        glass_catalogs: arguments.glass_catalogs.clone(),
        camera: arguments.camera.clone(),
        ..Options::default()
    }
}

/// Verifies what was taken of the scene's tolerance by a small part with everything.
pub(crate) fn verified(session: &mut Session, progress: &Progress) -> Result<String, Fault> {
    match session.verify(progress)? {
        Some(verified) => Ok(format!("note: {verified}")),
        None => Err(Fault::refused(
            "--verify compares what is taken of a `tolerance` with everything, and the scene has none\nhint: give it one, \
             such as --tolerance \"0.5 px, 2 %\"",
        )),
    }
}

fn render(arguments: &RenderArguments, outputs: Outputs) -> Result<(), Fault> {
    let folder = &arguments.output;
    // Whether it can be written is better known now than after the render.
    places::folder(folder)?;
    let mut session = open(arguments, outputs)?;
    let progress = Phases::new(arguments.quiet).progress(!arguments.quiet);
    if arguments.verify && session.scene(&progress)?.tolerance.is_none() {
        // Before hours are spent on it.
        verified(&mut session, &progress)?;
    }
    if let Some(frames) = session.frames(&progress)? {
        if arguments.verify {
            return Err(Fault::refused("--verify is of one picture, and the scene has `frames`"));
        }
        return sequence::render(arguments, &mut session, &frames, outputs, &progress);
    }
    if arguments.resume || arguments.frames.is_some() || arguments.pattern.is_some() {
        let why = "--frames, --pattern and --resume are for scenes with `frames`, and this is one picture";
        return Err(Fault::refused(why));
    }
    if let Some(shard) = arguments.shard.map(|shard| shard.by(arguments.shard_by.into())) {
        return merge::render_shard(arguments, &mut session, shard, &progress);
    }
    let checkpoint = keep(arguments, &mut session, folder, CHECKPOINT);
    let results = session.check_place(folder, &[SO_FAR, CHECKPOINT], &progress)?;
    check_report_path(arguments, &session, &results)?;
    let watching = Watching::new(arguments, outputs, &session);
    let progress = progress.with_looks(move |so_far| watching.look(so_far));
    // By what is kept of this machine; a render does not begin with measuring it.
    if let Some(machine) = Calibration::kept() {
        expect(TimeForecast::counted(&session.prospect(&progress)?, &machine).trace);
    }
    let rendering = session.render(&progress)?;
    write(arguments, &rendering, outputs, progress.clone())?;
    if arguments.verify {
        say(&verified(&mut session, &progress)?);
    }
    checkpoint.map_or(Ok(()), remove)
}

/// Has the session keep what there is of the render in a file of `folder`, if that is asked for.
pub(crate) fn keep(
    arguments: &RenderArguments,
    session: &mut Session,
    folder: &Path,
    name: &str,
) -> Option<PathBuf> {
    let every = Duration::try_from_secs_f64(arguments.checkpoint?).ok()?;
    let path = folder.join(name);
    session.keep_at(Some(Checkpoint { path: path.clone(), every }));
    Some(path)
}

/// Removes a checkpoint that has served.
pub(crate) fn remove(checkpoint: PathBuf) -> Result<(), Fault> {
    match std::fs::remove_file(&checkpoint) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(Fault::failed(format!("cannot remove {}: {error}", checkpoint.display())))
        }
        _ => Ok(()),
    }
}

/// Writes a rendering, its report and a summary; an error when it was stopped.
pub(crate) fn write(
    arguments: &RenderArguments,
    rendering: &Rendering,
    outputs: Outputs,
    progress: Progress,
) -> Result<(), Fault> {
    let partial = partial_note(rendering, arguments.discard_partial)?;
    if let Some(partial) = &partial
        && !arguments.quiet
    {
        say(&format!("note: {partial}"));
    }
    // Files, in a folder of their own when the picture is partial.
    let folder = &rendering.place_in(&arguments.output);
    if let (Some(partial), Some(samples)) = (&partial, rendering.more_samples_in(folder)) {
        let folder = folder.display();
        let stays = format!("{partial}; the picture of {samples} samples in {folder} stays");
        return Err(Fault::failed(stays));
    }
    if *folder != arguments.output {
        places::folder(folder)?;
    }
    let written = rendering.write_with(folder, outputs, &progress)?;
    drop(progress);
    // The report, on disk and in words.
    let mut report = rendering.report_of(&written);
    report.notes.extend(partial.clone());
    if let Some(path) = &arguments.report {
        let to = Transaction::at_once().keeping(&rendering.scene().inputs);
        sidecar::write_json(&to, path, &report)?;
    }
    if !arguments.quiet {
        summarise(&report);
    }
    let lines: Vec<String> = written.files.iter().map(|path| path.display().to_string()).collect();
    print_text(&lines.join("\n"))?;
    match partial {
        None => Ok(()),
        Some(partial) => {
            Err(Fault::failed(format!("{partial}; the picture so far is in {}", folder.display())))
        }
    }
}

pub(crate) fn open(arguments: &RenderArguments, outputs: Outputs) -> Result<Session, Error> {
    let options = Options {
        memory_limit: arguments.memory_limit,
        copy: arguments.copy,
        outputs,
        robust: arguments.accel_mode == AccelMode::Robust,
        isa: arguments.isa.clone(),
        ..options(&arguments.scene)
    };
    Session::open_with(&arguments.scene.scene, options)
}

/// Refuses to write the report over a result, over what the scene is made of, or where nothing can be written.
pub(crate) fn check_report_path(
    arguments: &RenderArguments,
    session: &Session,
    results: &[PathBuf],
) -> Result<(), Fault> {
    refuse_result(arguments, results)?;
    let report = arguments.report.as_slice();
    places::keep_apart(&session.inputs(), report)?;
    Ok(report.iter().try_for_each(|path| places::file(path))?)
}

/// Refuses a report that is one of `results`.
pub(crate) fn refuse_result(arguments: &RenderArguments, results: &[PathBuf]) -> Result<(), Fault> {
    let Some(report) = &arguments.report else { return Ok(()) };
    let place = real_place(report);
    let is_it =
        |path: &&PathBuf| path.file_name() == report.file_name() && real_place(path) == place;
    match results.iter().find(is_it) {
        None => Ok(()),
        Some(_) => Err(Fault::refused(format!(
            "--report {}: a result has this name\nhint: choose another one",
            report.display()
        ))),
    }
}

/// What a stop left of the picture, in words; `None` when it is complete.
pub(crate) fn partial_note(rendering: &Rendering, discards: bool) -> Result<Option<String>, Fault> {
    stop::saves(false);
    let Some(partial) = rendering.partial() else { return Ok(None) };
    if discards {
        return Err(RenderError::Stopped.into());
    }
    // From here on only a second signal stops.
    stop::heed();
    Ok(Some(partial))
}

/// The picture so far, beside the results.
struct Watching {
    keeps: bool,
    to: Transaction,
    /// File in which the picture so far is shown; nowhere when no PNG is wanted. It goes when this
    /// does, and so does that of a run that was killed.
    place: Option<(PathBuf, Temporary)>,
    start: Instant,
    /// Time that it took to write it last, and when that was done.
    shown: Mutex<Option<(Duration, Instant)>>,
}

/// File of what there is of a render, to go on from.
const CHECKPOINT: &str = "checkpoint.film";

/// The picture so far.
const SO_FAR: &str = "picture.so-far.png";

/// The picture so far is not written more often than takes this share of the time.
const SHARE_OF_LOOKS: f64 = 0.01;

impl Watching {
    fn new(arguments: &RenderArguments, outputs: Outputs, session: &Session) -> Self {
        Self {
            keeps: !arguments.discard_partial,
            to: Transaction::at_once().keeping(&session.inputs()),
            place: outputs.png.then(|| {
                let place = arguments.output.join(SO_FAR);
                let temporary = Temporary::new(&place);
                (place, temporary)
            }),
            start: Instant::now(),
            shown: Mutex::default(),
        }
    }

    /// True if a picture of so many pixels is worth its writing now.
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
            let _ = png::write(&self.to, place, &picture, "", png::Bits::Eight);
        }
        *shown = Some((start.elapsed(), Instant::now()));
    }
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
