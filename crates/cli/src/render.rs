//! `etendue render`: from a file to a folder of images.

use std::path::PathBuf;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use etendue::{Calibration, Session, SoFar, TimeForecast, places};
use etendue_files::{Temporary, Transaction};
use etendue_render::output::{Outputs, png};

use crate::arguments::RenderArguments;
use crate::fault::Fault;
use crate::job::{carry_out, check_report_path, keep, open, remove, verified, write};
use crate::progress::{Phases, expect, say};
use crate::{merge, sequence, stop};

pub(crate) fn run(arguments: &RenderArguments) -> Result<(), Fault> {
    carry_out(arguments, |outputs| render(arguments, outputs))
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
    let watching = PictureSoFar::new(arguments, outputs, &session);
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

/// The picture so far, beside the results.
struct PictureSoFar {
    keeps: bool,
    to: Transaction,
    /// File in which the picture so far is shown; nowhere when no PNG is wanted. It goes when this
    /// does, and so does that of a run that was killed.
    place: Option<(PathBuf, Temporary)>,
    start: Instant,
    /// The last time that it was written.
    shown: Mutex<Option<LastLook>>,
}

/// Time that it took to write the picture so far, and when that was done.
#[derive(Clone, Copy)]
struct LastLook {
    took: Duration,
    when: Instant,
}

/// File of what there is of a render, to go on from.
const CHECKPOINT: &str = "checkpoint.film";

/// The picture so far.
const SO_FAR: &str = "picture.so-far.png";

/// The picture so far is not written more often than takes this share of the time.
const SHARE_OF_LOOKS: f64 = 0.01;

impl PictureSoFar {
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
    fn is_due(&self, last: Option<LastLook>, share: f64) -> bool {
        let left = self.start.elapsed().as_secs_f64() * (1.0 / share.max(1e-9) - 1.0);
        match last {
            // Not for renders that are done before anybody has opened it.
            None => left > 2.0,
            Some(LastLook { took, when }) => {
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
        *shown = Some(LastLook { took: start.elapsed(), when: Instant::now() });
    }
}
