//! Progress bars on a terminal, and nothing in a pipe.

use std::collections::HashSet;
use std::io::{IsTerminal, Write};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use etendue::Phase;
use etendue_render::Progress;
use etendue_scene::escape::printable;
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::stop;

/// Steps of a bar: finer than any terminal is wide.
const STEPS: u64 = 1000;

/// The bar that is shown now.
static SHOWN: Mutex<Option<ProgressBar>> = Mutex::new(None);

fn shown() -> Option<ProgressBar> {
    SHOWN.lock().unwrap_or_else(PoisonError::into_inner).clone()
}

/// Expected time of the tracing (s), as far as somebody has said.
static EXPECTED: Mutex<Option<f64>> = Mutex::new(None);

/// The share that is done from which on the work itself tells how long it takes.
const TELLING: f64 = 0.03;

/// Says how long the tracing that comes will take (s).
pub(crate) fn expect(seconds: f64) {
    *EXPECTED.lock().unwrap_or_else(PoisonError::into_inner) = Some(seconds);
}

/// Remaining time (s) of work that is done to a `share`, for which `elapsed` (s) were taken and
/// `expected` foreseen; `None` while nothing is known.
fn remaining(share: f64, elapsed: f64, expected: Option<f64>) -> Option<f64> {
    match expected {
        Some(expected) if share < TELLING => Some((expected - elapsed).max(0.0)),
        _ if share > 0.0 => Some(elapsed * (1.0 / share - 1.0)),
        _ => None,
    }
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
    /// `said`: each once, however many frames there are of which it is true.
    pub(crate) fn progress(self, says_notes: bool) -> etendue::Progress {
        let shown: Mutex<Option<(Phase, Progress)>> = Mutex::default();
        let on_phase = move |phase: Phase, share: f64| {
            let mut shown = shown.lock().unwrap_or_else(PoisonError::into_inner);
            if shown.as_ref().is_none_or(|(of, _)| *of != phase) {
                // The old bar goes before the new one comes.
                *shown = None;
                *shown = Some((phase, self.begin(phase.name())));
            }
            shown.as_ref().is_none_or(|(_, bar)| bar(share))
        };
        let said = Mutex::new(HashSet::new());
        let note = move |note: &str| {
            let is_new =
                || said.lock().unwrap_or_else(PoisonError::into_inner).insert(note.to_owned());
            if says_notes && is_new() {
                say(&format!("note: {note}"));
            }
        };
        etendue::Progress::new(on_phase).with_notes(note)
    }

    /// Begins a phase. The function is told the share done and answers whether to go on; the bar
    /// goes away with the last of its owners.
    pub(crate) fn begin(self, name: &'static str) -> Progress {
        // The bar, and what the forecast expects of the render.
        let bar = Bar(if self.shown {
            let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::stderr());
            let style =
                ProgressStyle::with_template("{prefix:>7} {wide_bar} {percent:>3} %  {msg}");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar.set_prefix(name);
            *SHOWN.lock().unwrap_or_else(PoisonError::into_inner) = Some(bar.clone());
            bar
        } else {
            ProgressBar::hidden()
        });
        let expected = match name == Phase::Render.name() {
            true => EXPECTED.lock().unwrap_or_else(PoisonError::into_inner).take(),
            false => None,
        };
        let start = Instant::now();
        // Moved by each share; false ends the work.
        Arc::new(move |share| {
            let left = remaining(share, start.elapsed().as_secs_f64(), expected);
            if let Some(left) = left.and_then(|left| Duration::try_from_secs_f64(left).ok()) {
                bar.0.set_message(format!("{:#}", HumanDuration(left)));
            }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_forecast_holds_until_the_work_tells_for_itself() {
        assert_eq!(remaining(0.0, 0.0, None), None);
        assert_eq!(remaining(0.0, 1.0, Some(40.0)), Some(39.0));
        assert_eq!(remaining(0.01, 60.0, Some(40.0)), Some(0.0));
        assert_eq!(remaining(0.25, 10.0, Some(400.0)), Some(30.0));
        assert_eq!(remaining(0.5, 10.0, None), Some(10.0));
    }
}
