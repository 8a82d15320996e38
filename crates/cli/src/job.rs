//! A job that renders: its threads, options and session before, its checkpoint, files, report and summary.

use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use etendue::{Checkpoint, Error, Options, Progress, Rendering, Session, places};
use etendue_files::{Transaction, real_place};
use etendue_render::output::{Outputs, sidecar};
use etendue_render::{RenderError, Report, Seconds};

use crate::arguments::{AccelMode, RenderArguments, SceneArguments};
use crate::fault::{Fault, print_text};
use crate::progress::say;
use crate::stop;

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

/// The session of a render's scene.
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

/// Words for what a stop left of the picture; `None` when it is complete.
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
