//! The passes over the film, until all samples are taken, an error is reached, or a time is over.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use crate::adaptive::{Adaptive, SampleCounts};
use crate::film::FilmLayer;
use crate::samples::Averaging;
use crate::tiles::{Job, RayCounts};
use crate::watch::{SoFar, Stopped, Watcher};

/// The share of what is left of a time that a pass may be reckoned to take.
const SHARE_OF_TIME: f64 = 0.95;

/// What the passes left.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Passed {
    /// Samples that every pixel has.
    pub(crate) samples: u32,
    /// Whether that is all that was wanted.
    pub(crate) is_complete: bool,
    /// How many samples the pixels have, where that differs.
    pub(crate) counts: Option<SampleCounts>,
}

/// The layers that are not averaged.
pub(crate) struct Beside<'a, 'f> {
    /// Along chief rays.
    pub(crate) centres: &'a [&'f mut FilmLayer],
    /// Those that tell of sampling.
    pub(crate) told: &'a mut [&'f mut FilmLayer],
}

impl Job<'_> {
    /// Takes the passes after the first `samples` samples. When it is stopped after one, the layers hold
    /// what there was then.
    pub(crate) fn passes(
        &self,
        mut samples: u32,
        parts: &mut [Averaging<'_>],
        mut beside: Beside<'_, '_>,
        watcher: &Watcher<'_>,
        traffic: &Mutex<RayCounts>,
    ) -> Result<Passed, Stopped> {
        let Range { start: first, end: all } = self.sampling.range();
        if parts.is_empty() {
            return Ok(Passed { samples: all, is_complete: true, counts: None });
        }
        if !self.shares.is_empty() || samples >= all {
            parts.iter_mut().for_each(|part| part.show(samples));
        }
        let mut adaptive = self.adaptive(parts);
        let mut passed = Passed { samples, is_complete: samples >= all, counts: None };
        let start = Instant::now();
        while let (false, Some(end)) = (passed.is_complete, self.end_of_pass(samples, start)) {
            let blocks = adaptive.as_ref().map(|adaptive| &adaptive.blocks);
            let pass = samples..end;
            let mut add = |part: &mut Averaging<'_>| part.add(&pass, blocks, watcher, traffic);
            if let Err(stopped) = parts.iter_mut().try_for_each(&mut add) {
                return if samples > first { Ok(passed) } else { Err(stopped) };
            }
            samples = end;
            passed = match &mut adaptive {
                Some(adaptive) => judged(adaptive, samples, parts, &mut beside, watcher),
                None => {
                    parts.iter_mut().for_each(|part| part.show(samples));
                    Passed { samples, is_complete: samples >= all, counts: None }
                }
            };
            self.expect(start, watcher);
            if !passed.is_complete {
                self.look(samples, parts, watcher);
                if let Some(keeper) = &self.keeper {
                    let centres: Vec<&FilmLayer> = beside.centres.iter().map(|l| &**l).collect();
                    let counts = traffic.lock().unwrap_or_else(PoisonError::into_inner).clone();
                    keeper.keep(samples, &centres, parts, &counts);
                }
            }
        }
        // What ends for want of time is all that was wanted.
        Ok(Passed { is_complete: true, ..passed })
    }

    /// Who judges the samples, where they are judged.
    fn adaptive(&self, parts: &[Averaging<'_>]) -> Option<Adaptive<'_>> {
        let rule = self.rule.as_ref()?;
        let place = |(k, part): (usize, &Averaging<'_>)| {
            let layer = part.layers().position(|layer| Some(layer.spec) == self.judged)?;
            Some((k, layer * part.what.shape()[1]))
        };
        let judged = parts.iter().enumerate().find_map(place).unwrap_or((0, 0));
        let sampling = &self.sampling;
        let limits = [rule.least, sampling.samples];
        Some(Adaptive::new(rule, limits, self.camera.resolution(), sampling.shard, judged))
    }

    /// The samples after the next pass; `None` when there is no time for one.
    fn end_of_pass(&self, samples: u32, start: Instant) -> Option<u32> {
        let end = self.passes.iter().map(|pass| pass.end).find(|end| *end > samples)?;
        let end = end.min(self.sampling.range().end);
        let Some(time) = self.time.filter(|_| samples > 0) else { return Some(end) };
        let a_sample = start.elapsed().as_secs_f64() / f64::from(samples);
        let left = SHARE_OF_TIME * time.saturating_sub(start.elapsed()).as_secs_f64();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturated")]
        let more = (left / a_sample) as u32;
        (more > 0).then(|| end.min(samples.saturating_add(more)))
    }

    /// Tells the watcher what is still to come where time says it.
    fn expect(&self, start: Instant, watcher: &Watcher<'_>) {
        let Some(time) = self.time else { return };
        let left = time.as_secs_f64() / start.elapsed().as_secs_f64() - 1.0;
        watcher.expect_more(left);
    }

    /// Shows the picture so far.
    fn look(&self, samples: u32, parts: &[Averaging<'_>], watcher: &Watcher<'_>) {
        let layers: Vec<&FilmLayer> = parts.iter().flat_map(Averaging::layers).collect();
        let picture = || (self.picture)(&layers, samples);
        watcher.watch().look(&SoFar {
            samples: [samples, self.sampling.samples],
            share: watcher.share(),
            picture: &picture,
        });
    }
}

/// Judges what there is after `samples` samples of each pixel that wanted them, where it is time, and shows it.
fn judged(
    adaptive: &mut Adaptive<'_>,
    samples: u32,
    parts: &mut [Averaging<'_>],
    beside: &mut Beside<'_, '_>,
    watcher: &Watcher<'_>,
) -> Passed {
    if adaptive.judges_at(samples) {
        adaptive.judge(samples, parts);
    }
    parts.iter_mut().for_each(|part| part.show_settled(&adaptive.blocks, samples));
    if !beside.told.is_empty() {
        adaptive.tell(samples, parts, beside.told);
    }
    watcher.expect(adaptive.to_come(samples) * parts.len() as u64);
    let counts = adaptive.counts(samples, parts);
    let least = counts.map_or(samples, |counts| counts.least);
    Passed { samples: least, is_complete: !adaptive.goes_on(samples), counts }
}
