//! `etendue render` of a scene with `frames`: a folder a frame, and what data sets want beside them.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::PathBuf;

use etendue::{Dataset, Frame, FramePattern, Progress, Session, places};
use etendue_files::{Ledger, MOST_OWN_BYTES, Transaction};
use etendue_render::output::{Outputs, sidecar};

use crate::arguments::RenderArguments;
use crate::fault::{Fault, print_text};
use crate::job::{check_report_path, keep, partial_note, refuse_result, remove};
use crate::progress::say;

pub(crate) fn render(
    arguments: &RenderArguments,
    session: &mut Session,
    frames: &[Frame],
    outputs: Outputs,
    progress: &Progress,
) -> Result<(), Fault> {
    if arguments.shard.is_some() {
        let why = "--shard divides one picture\nhint: divide a scene with `frames` by --frames, e.g. 0..100";
        return Err(Fault::refused(why));
    }
    let out = &arguments.output;
    let range = arguments.frames.clone().unwrap_or(0..frames.len());
    let wanted = chosen(frames, &range)?;
    session.check_outputs(frames)?;
    let pattern = arguments.pattern.clone().unwrap_or_default();
    // All names are known before the first frame is written.
    let is_no_result = |results: &[PathBuf]| refuse_result(arguments, results);
    session.check_frames(out, &pattern, wanted, progress, is_no_result)?;
    check_report_path(arguments, session, &[])?;
    let mut ledger = Ledger::open(out, "render");
    ledger.list_below(frames.iter().map(|frame| pattern.list_of(frame.number)));
    keep_exposure(arguments, session, frames, wanted, &pattern, progress)?;
    let mut dataset = Dataset::default();
    let mut files = Vec::new();
    let mut reports = Vec::new();
    let mut skipped = 0;
    for (done, frame) in (1..).zip(wanted) {
        session.show(frame)?;
        if arguments.resume && session.is_complete(out, &pattern, frame.number, progress)? {
            skipped += 1;
            if let Some(own) = pattern.own_folder(frame.number) {
                // A kill while its manifest was written anew leaves a part of that. What cannot be removed is
                // nobody's loss.
                let _ = places::folder(&out.join(own));
            }
            remove(out.join(checkpoint_of(frame)))?;
            dataset.add(frame, session.scene(progress)?, &pattern, outputs)?;
            continue;
        }
        let folder = EmptyFolder(out.join(pattern.folder(frame.number)));
        let results = session.check_place(&folder.0, &[], progress)?;
        let results = results.iter().filter_map(|path| path.strip_prefix(&folder.0).ok()?.to_str());
        let names: Vec<String> = results.map(str::to_owned).collect();
        pattern.keep_apart(out, frame.number, &session.inputs(), &names)?;
        let checkpoint = keep(arguments, session, out, &checkpoint_of(frame));
        let rendering = session.render(progress)?;
        if let Some(partial) = partial_note(&rendering, true)? {
            return Err(Fault::failed(partial));
        }
        if reports.is_empty() {
            ledger.save()?;
        }
        let written = pattern.write(&rendering, out, frame.number, outputs, progress)?;
        checkpoint.map_or(Ok(()), remove)?;
        dataset.add(frame, rendering.scene(), &pattern, outputs)?;
        files.extend(written.files.iter().cloned());
        let report = rendering.report_of(&written);
        if !arguments.quiet {
            let seconds = report.seconds.total;
            say(&format!("frame {} ({done} of {}): {seconds:.2} s", frame.number, wanted.len()));
        }
        reports.push(report);
    }
    // What other runs have of the scene is of the same data set.
    for frame in frames.iter().filter(|frame| !range.contains(&frame.number)) {
        if pattern.is_begun(out, frame.number) {
            session.show(frame)?;
            if session.is_complete(out, &pattern, frame.number, progress)? {
                dataset.add(frame, session.scene(progress)?, &pattern, outputs)?;
            }
        }
    }
    let gone = pattern.remove_from(out, frames.len());
    let inputs = session.inputs();
    let of_dataset = places::recorded(ledger, &inputs, |to| dataset.write(to, out))?;
    files.extend(of_dataset);
    if !arguments.quiet {
        dataset.notes().iter().for_each(|note| say(&format!("note: {note}")));
    }
    if let Some(path) = &arguments.report {
        sidecar::write_json(&Transaction::at_once().keeping(&inputs), path, &reports)?;
    }
    if !arguments.quiet {
        tell(wanted.len(), skipped, &gone);
    }
    let lines: Vec<String> = files.iter().map(|path| path.display().to_string()).collect();
    print_text(&lines.join("\n"))
}

/// Takes the exposure that was metered on the first frame from the files of that, where this run does not render it.
fn keep_exposure(
    arguments: &RenderArguments,
    session: &mut Session,
    frames: &[Frame],
    wanted: &[Frame],
    pattern: &FramePattern,
    progress: &Progress,
) -> Result<(), Fault> {
    let (Some(first), Some(start)) = (frames.first(), wanted.first()) else { return Ok(()) };
    session.show(first)?;
    let sensor = session.scene(progress)?.sensor.as_ref();
    let metering = sensor.and_then(|sensor| sensor.spec().auto_exposure);
    if metering.is_none_or(|metering| metering.each_frame) {
        return Ok(());
    }
    let out = &arguments.output;
    let is_there = session.is_complete(out, pattern, first.number, progress)?;
    if start.number == first.number && !(arguments.resume && is_there) {
        return Ok(());
    }
    let sidecar = out.join(pattern.place(first.number, "sensor.json"));
    let read = || -> Option<f64> {
        let text = etendue_files::read(&sidecar, MOST_OWN_BYTES).ok()?;
        let sidecar: serde_json::Value = serde_json::from_slice(&text).ok()?;
        sidecar["metered_exposure_s"].as_f64().filter(|time| *time > 0.0)
    };
    match is_there.then(read).flatten() {
        Some(time) => session.set_metered_exposure(time),
        None => {
            let why = format!(
                "camera.sensor.auto_exposure: all frames have the exposure that is metered on frame {}, which is \
                 neither rendered by this run nor in {}\nhint: render it first, give sensor.exposure, or set \
                 camera.sensor.auto_exposure.each_frame=true",
                first.number,
                out.display()
            );
            return Err(Fault::refused(why));
        }
    }
    Ok(())
}

/// Tells what of the folder's frames was left, and what has gone.
fn tell(wanted: usize, skipped: usize, gone: &BTreeSet<usize>) {
    if skipped > 0 {
        say(&format!("{skipped} of {wanted} frames were complete and are left as they are"));
    }
    if let (Some(first), Some(last)) = (gone.first(), gone.last()) {
        let count = gone.len();
        say(&format!("frames {first} to {last} ({count}) of an earlier scene were removed"));
    }
}

/// A folder that goes when this is dropped and nothing is in it.
struct EmptyFolder(PathBuf);

impl Drop for EmptyFolder {
    fn drop(&mut self) {
        // One that has something in it stays.
        let _ = std::fs::remove_dir(&self.0);
    }
}

fn chosen<'f>(frames: &'f [Frame], range: &Range<usize>) -> Result<&'f [Frame], Fault> {
    frames.get(range.clone()).filter(|chosen| !chosen.is_empty()).ok_or_else(|| {
        let last = frames.len();
        let Range { start, end } = range;
        Fault::refused(format!("--frames {start}..{end}: the scene has the frames 0..{last}"))
    })
}

/// File that keeps what there is of a frame, beside the folders of the frames.
fn checkpoint_of(frame: &Frame) -> String {
    format!("frame-{:06}.checkpoint.film", frame.number)
}
