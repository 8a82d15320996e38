//! Progress bars on a terminal, and nothing in a pipe.

use std::io::{IsTerminal, Write};
use std::sync::{Arc, Mutex, PoisonError};

use etendue::Phase;
use etendue_render::Progress;
use etendue_scene::escape::printable;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::stop;

/// Steps of a bar: finer than any terminal is wide.
const STEPS: u64 = 1000;

/// The bar that is shown now.
static SHOWN: Mutex<Option<ProgressBar>> = Mutex::new(None);

fn shown() -> Option<ProgressBar> {
    SHOWN.lock().unwrap_or_else(PoisonError::into_inner).clone()
}

/// Writes a line to standard error, above the bar when there is one. When nobody reads it, nobody is
/// told.
pub(crate) fn say(line: &str) {
    let write = || {
        let _ = writeln!(std::io::stderr(), "{}", printable(line));
    };
    match shown() {
        Some(bar) => bar.suspend(write),
        None => write(),
    }
}

/// Shows how far each phase is, one bar a phase.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Phases {
    shown: bool,
}

impl Phases {
    pub(crate) fn new(quiet: bool) -> Self {
        Self { shown: !quiet && std::io::stderr().is_terminal() }
    }

    /// The bars of all phases of a render, one after the other, and notes above them where they are
    /// `said`.
    pub(crate) fn progress(self, says_notes: bool) -> etendue::Progress {
        let shown: Mutex<Option<(Phase, Progress)>> = Mutex::default();
        let told = move |phase: Phase, share: f64| {
            let mut shown = shown.lock().unwrap_or_else(PoisonError::into_inner);
            if shown.as_ref().is_none_or(|(of, _)| *of != phase) {
                // The old bar goes before the new one comes.
                *shown = None;
                *shown = Some((phase, self.begin(phase.name())));
            }
            shown.as_ref().is_none_or(|(_, bar)| bar(share))
        };
        let note = move |note: &str| {
            if says_notes {
                say(&format!("note: {note}"));
            }
        };
        etendue::Progress::new(told).with_notes(note)
    }

    /// Begins a phase. The function is told the share done and answers whether to go on; the bar
    /// goes away with the last of its owners.
    pub(crate) fn begin(self, name: &'static str) -> Progress {
        let bar = Bar(if self.shown {
            let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::stderr());
            let style =
                ProgressStyle::with_template("{prefix:>7} {wide_bar} {percent:>3} %  {eta}");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar.set_prefix(name);
            *SHOWN.lock().unwrap_or_else(PoisonError::into_inner) = Some(bar.clone());
            bar
        } else {
            ProgressBar::hidden()
        });
        Arc::new(move |share| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "clamped to 0..=STEPS"
            )]
            bar.0.set_position((share.clamp(0.0, 1.0) * STEPS as f64) as u64);
            !stop::asked()
        })
    }
}

struct Bar(ProgressBar);

impl Drop for Bar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
        if !self.0.is_hidden() {
            SHOWN.lock().unwrap_or_else(PoisonError::into_inner).take();
        }
    }
}
