//! The passes over the film, until all samples are taken, an error is reached, or a time is over.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use crate::adaptive::{Adaptive, JudgedValue, Rule};
use crate::error::RenderError;
use crate::film::FilmLayer;
use crate::memory::NoMemory;
use crate::samples::Averaging;
use crate::tile::RayCounts;
use crate::tiles::{Job, OtherLayers, SamplesTaken};
use crate::watch::{SoFar, Watcher};

/// The share of what is left of a time that a pass may be reckoned to take.
const SHARE_OF_TIME: f64 = 0.95;

impl Job<'_> {
    /// Takes the passes after the first `samples` samples. When it is stopped after one, the layers hold
    /// what there was then.
    pub(crate) fn passes(
        &self,
        mut samples: u32,
        parts: &mut [Averaging<'_>],
        others: OtherLayers<'_, '_>,
        watcher: &Watcher<'_>,
        traffic: &Mutex<RayCounts>,
    ) -> Result<SamplesTaken, RenderError> {
        let Range { start: first, end: all } = self.sampling.range();
        if parts.is_empty() {
            return Ok(SamplesTaken { samples: all, is_complete: true, counts: None });
        }
        if !self.shares.is_empty() || samples >= all {
            parts.iter_mut().for_each(|part| part.show(samples));
        }
        if let Some(rule) = &self.rule
            && self.shares.is_empty()
        {
            let adaptive = self.adaptive(rule, parts)?;
            return self.rounds(adaptive, parts, others, watcher, traffic);
        }
        let mut passed = SamplesTaken { samples, is_complete: samples >= all, counts: None };
        let start = Instant::now();
        while let (false, Some(end)) = (passed.is_complete, self.end_of_pass(samples, start)) {
            let pass = samples..end;
            let mut add = |part: &mut Averaging<'_>| part.add(&pass, watcher, traffic);
            if let Err(stopped) = parts.iter_mut().try_for_each(&mut add) {
                return if samples > first { Ok(passed) } else { Err(stopped.into()) };
            }
            samples = end;
            parts.iter_mut().for_each(|part| part.show(samples));
            passed = SamplesTaken { samples, is_complete: samples >= all, counts: None };
            self.expect(start, watcher);
            if !passed.is_complete {
                self.look(samples, parts, watcher);
                if let Some(keeper) = &self.keeper {
                    let centres: Vec<&FilmLayer> = others.centres.iter().map(|l| &**l).collect();
                    let counts = traffic.lock().unwrap_or_else(PoisonError::into_inner).clone();
                    keeper.keep(samples, &centres, parts, &counts);
                }
            }
        }
        // What ends for want of time is all that was wanted.
        Ok(SamplesTaken { is_complete: true, ..passed })
    }

    /// Takes the samples that are wanted, round by round, until no pixel wants more.
    fn rounds(
        &self,
        mut adaptive: Adaptive<'_>,
        parts: &mut [Averaging<'_>],
        others: OtherLayers<'_, '_>,
        watcher: &Watcher<'_>,
        traffic: &Mutex<RayCounts>,
    ) -> Result<SamplesTaken, RenderError> {
        let mut passed: Option<SamplesTaken> = None;
        let lands = parts.iter().any(|part| part.what.shared_rows().is_some());
        while adaptive.goes_on() {
            let wanted = |pixel| adaptive.wanted(pixel);
            let mut add = |part: &mut Averaging<'_>| part.add_wanted(&wanted, watcher, traffic);
            if let Err(stopped) = parts.iter_mut().try_for_each(&mut add) {
                return passed.ok_or(stopped.into());
            }
            adaptive.judge(parts);
            adaptive.show(parts, others.of_sampling);
            let to_land = if lands { adaptive.taken() + adaptive.to_come() } else { 0 };
            watcher.expect(adaptive.to_come() * parts.len() as u64 + to_land);
            let counts = adaptive.counts();
            let least = counts.map_or(self.sampling.samples, |counts| counts.least);
            if adaptive.goes_on() {
                self.look(least, parts, watcher);
            }
            // Light that has not landed is no picture.
            passed = (!lands || !adaptive.goes_on()).then_some(SamplesTaken {
                samples: least,
                is_complete: !adaptive.goes_on(),
                counts,
            });
        }
        if let (true, Some(passed)) = (lands, &mut passed) {
            parts.iter_mut().try_for_each(|part| part.land(adaptive.have(), watcher, traffic))?;
            adaptive.judge_landed(parts);
            adaptive.show(parts, others.of_sampling);
            passed.counts = adaptive.counts();
        }
        // A share without rows wants nothing.
        let all = SamplesTaken { samples: self.sampling.samples, is_complete: true, counts: None };
        Ok(passed.unwrap_or(all))
    }

    /// Judge of the samples by a rule.
    fn adaptive<'a>(
        &self,
        rule: &'a Rule,
        parts: &[Averaging<'_>],
    ) -> Result<Adaptive<'a>, NoMemory> {
        let place = |(k, part): (usize, &Averaging<'_>)| {
            let layer = part.layers().position(|layer| Some(layer.spec) == self.judged)?;
            Some(JudgedValue { part: k, first: layer * part.what.shape()[1] })
        };
        let judged = parts.iter().enumerate().find_map(place).unwrap_or_default();
        let (strips, hits) = (self.sampled_strips(), self.chief_hits()?);
        Adaptive::new(rule, self.sampling.samples, self.camera.resolution(), strips, judged, &hits)
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
