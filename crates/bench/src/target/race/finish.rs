//! The end of a race: the later ones are left out until it is decided, the soonest is rendered with what it needs, and
//! what was found is put together.

use super::forecast::{Forecast, MOST_SAMPLES, seconds_of};
use super::{ContenderRecord, MOST_TRIES, NEAR_ENOUGH, Race};
use crate::BenchError;
use crate::target::{ContenderForecast, Target, Verification};

impl<E: From<BenchError>> Race<'_, E> {
    /// Leaves out the later half, but not the scene as it is; whether more than it and another are left.
    pub(super) fn halve(&mut self) -> bool {
        let mut left: Vec<usize> =
            (0..self.entries.len()).filter(|&i| !self.entries[i].is_out).collect();
        left.sort_by(|&a, &b| {
            self.time_of(&self.entries[a]).total_cmp(&self.time_of(&self.entries[b]))
        });
        for &who in left.iter().skip(left.len().div_ceil(2).max(2)).filter(|&&who| who > 0) {
            self.entries[who].is_out = true;
        }
        self.entries.iter().filter(|entry| !entry.is_out).count() > 2
    }

    /// True if anybody left needs more than so many samples.
    pub(super) fn is_undecided(&self, samples: u32) -> bool {
        let entries = self.entries.iter().filter(|entry| !entry.is_out);
        let mut forecasts = entries.filter_map(|entry| self.forecast_of(entry));
        forecasts.any(|forecast| forecast.samples > samples)
    }

    /// Renders the soonest with what it needs, and again while that is not near the target. Of those within it, the
    /// soonest; or else the one that comes nearest.
    pub(super) fn verify(&mut self) -> Result<Option<Verification>, E> {
        let mut best: Option<Verification> = None;
        // More than any that was not enough.
        let mut too_few: Vec<(usize, u32)> = Vec::new();
        let most = NEAR_ENOUGH[1] * self.effort.target;
        for tries in 0.. {
            if tries >= MOST_TRIES && best.as_ref().is_some_and(|known| known.error <= most) {
                break;
            }
            // Another may be sooner by what was learnt meanwhile.
            let all = (0..self.entries.len()).filter(|&i| !self.entries[i].is_out);
            let all = all.filter_map(|i| {
                let forecast = self.forecast_of(&self.entries[i])?;
                let short = too_few.iter().filter(|(who, _)| *who == i).map(|(_, n)| *n).max();
                let samples = forecast.samples.max(short.map_or(1, |n| n + n.div_ceil(8)));
                Some((
                    i,
                    Forecast { samples, seconds: seconds_of(&self.entries[i].points, samples) },
                ))
            });
            let all = all.filter(|(_, forecast)| f64::from(forecast.samples) <= MOST_SAMPLES);
            let Some((who, forecast)) = all.min_by(|a, b| a.1.seconds.total_cmp(&b.1.seconds))
            else {
                self.notes
                    .push("nothing reaches the target, with any number of samples".to_owned());
                break;
            };
            if forecast.seconds > self.left(1.0) {
                self.notes.push(format!(
                    "the soonest would take {:.0} s, for which no time was left; more --seconds have it",
                    forecast.seconds
                ));
                break;
            }
            let name = self.entries[who].contender.name.clone();
            let is_known =
                |known: &&Verification| known.name == name && known.samples == forecast.samples;
            // The same again would tell nothing.
            if best.as_ref().filter(is_known).is_some() {
                break;
            }
            let Some(point) = self.render(who, forecast.samples)? else { continue };
            let error = point.square.sqrt();
            let (samples, seconds, foretold) = (point.samples, point.seconds, forecast.seconds);
            let found = Verification { name, samples, foretold, seconds, error };
            let share = error / self.effort.target;
            if share > NEAR_ENOUGH[1] {
                too_few.push((who, samples));
            }
            let is_better = best.as_ref().is_none_or(|known| {
                match [known.error, error].map(|error| error <= most) {
                    [true, true] => seconds < known.seconds,
                    [false, false] => error < known.error,
                    [_, is_within] => is_within,
                }
            });
            best = if is_better { Some(found) } else { best };
            if (NEAR_ENOUGH[0]..=NEAR_ENOUGH[1]).contains(&share)
                || (samples == 1 && share <= NEAR_ENOUGH[1])
            {
                break;
            }
        }
        if let Some(found) = best.as_ref().filter(|found| found.error > most) {
            self.notes.push(format!(
                "the last render of the soonest has an error of {:.2} %, more than the target",
                100.0 * found.error
            ));
        }
        Ok(best)
    }

    pub(super) fn conclude(self, verified: Option<Verification>) -> Target {
        let foretold = |entry: &ContenderRecord| {
            let forecast = self.forecast_of(entry);
            ContenderForecast {
                name: entry.contender.name.clone(),
                samples: forecast.map(|forecast| forecast.samples),
                seconds: forecast.map(|forecast| forecast.seconds),
                renders: entry.renders,
                settings: entry.contender.settings.clone(),
            }
        };
        let mut contenders: Vec<ContenderForecast> = self.entries.iter().map(foretold).collect();
        let time = |foretold: &ContenderForecast| foretold.seconds.unwrap_or(f64::INFINITY);
        contenders.sort_by(|a, b| time(a).total_cmp(&time(b)));
        let mut notes = self.notes;
        notes.dedup();
        Target {
            target: self.effort.target,
            converged: self.samples,
            own_error: self.own_square.sqrt(),
            renders: self.renders,
            contenders,
            verified,
            equal_time: Vec::new(),
            strip: None,
            notes,
        }
    }
}
