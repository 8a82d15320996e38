//! The rounds in which contenders are rendered, and what is foretold of them.

mod equal_time;
mod finish;
mod forecast;

use std::time::Instant;

use etendue_scene::Setting;

use super::{Change, Contender, Effort, Outcome, Render, Run, Target, WholeRun};
use crate::pictures::{mean, mean_square};
use crate::{BenchError, Progress};
use forecast::{Forecast, TrialRender, forecast};

/// Samples of the first two renders of everybody.
const FIRST: [u32; 2] = [4, 16];

/// By how much a round has more samples than the one before.
const STEP: u32 = 4;

/// The converged picture's own error is to be at most this share of the target.
const OWN_SHARE: f64 = 0.25;

/// The shares of the time that the converged picture, and that with the rounds, may take.
const SHARES: [f64; 2] = [0.3, 0.8];

/// The soonest is rendered again while its error is outside of these shares of the target: as long as there is time
/// while none is within it, then no more than so often in all.
const NEAR_ENOUGH: [f64; 2] = [0.85, 1.0 + ROUNDING];
const MOST_TRIES: usize = 6;

/// By how much rounding may take an error over the target.
const ROUNDING: f64 = 1e-9;

/// Renders of a contender, and what follows of them.
struct ContenderRecord {
    contender: Contender,
    points: Vec<TrialRender>,
    renders: usize,
    is_out: bool,
}

/// Renders the scene and its changes until it is known which reach the target soonest. `axes` are lists of changes of
/// which each excludes the others; `in_full` is set for the converged picture, beside what the scene says itself;
/// `program` renders.
///
/// # Errors
///
/// Those of `program`; [`BenchError::Stopped`] when `progress` asks for it; [`BenchError::Refused`] when the scene
/// itself is.
pub fn measure<E: From<BenchError>>(
    axes: &[Vec<Change>],
    in_full: &[Setting],
    effort: Effort,
    program: &mut dyn FnMut(Run<'_>) -> Result<Outcome, E>,
    progress: Progress<'_>,
) -> Result<Target, E> {
    let plain = Contender::of(axes, &[]);
    let converged = Contender { settings: in_full.to_vec(), ..plain.clone() };
    let mut race = Race::begin([plain, converged], effort, program, progress)?;
    let singles = axes.iter().enumerate();
    let singles = singles.flat_map(|(axis, changes)| (0..changes.len()).map(move |k| (axis, k)));
    let singles: Vec<Contender> = singles.map(|change| Contender::of(axes, &[change])).collect();
    race.add(singles);
    race.render_first()?;
    // Changes that are sooner each for itself, together: the best of each axis, and each two of the best.
    let better = race.better();
    let mut joint: Vec<Vec<(usize, usize)>> = vec![better.clone()];
    for (i, &one) in better.iter().enumerate() {
        joint.extend(better[i + 1..].iter().map(|&other| vec![one, other]));
    }
    joint.retain(|changes| changes.len() > 1);
    // Of two changes all together are one of the pairs.
    joint.dedup();
    race.add(joint.iter().map(|changes| Contender::of(axes, changes)).collect());
    race.render_first()?;
    let mut samples = FIRST[1];
    while race.halve() && race.is_undecided(samples) {
        samples = samples.saturating_mul(STEP);
        if !race.render_all(samples)? {
            break;
        }
    }
    let verified = race.verify()?;
    let (rows, strip) = match &verified {
        Some(found) => race.equal_time(found)?,
        None => (Vec::new(), None),
    };
    Ok(Target { equal_time: rows, strip, ..race.conclude(verified) })
}

struct Race<'a, E> {
    effort: Effort,
    program: &'a mut dyn FnMut(Run<'_>) -> Result<Outcome, E>,
    progress: Progress<'a>,
    start: Instant,
    converged: Vec<f64>,
    /// Its samples, its mean, and its squared error over that.
    samples: u32,
    mean: f64,
    own_square: f64,
    entries: Vec<ContenderRecord>,
    renders: Vec<Render>,
    notes: Vec<String>,
    seed: u64,
}

impl<'a, E: From<BenchError>> Race<'a, E> {
    /// With the converged picture of the scene as it is.
    fn begin(
        [plain, in_full]: [Contender; 2],
        effort: Effort,
        program: &'a mut dyn FnMut(Run<'_>) -> Result<Outcome, E>,
        progress: Progress<'a>,
    ) -> Result<Self, E> {
        let start = Instant::now();
        let mut samples = FIRST[1];
        let (values, square) = loop {
            let before = start.elapsed().as_secs_f64();
            let mut take = |seed| match program(Run { contender: &in_full, samples, seed })? {
                Outcome::Done(run) => Ok(run.values),
                Outcome::Refused(why) => Err(E::from(BenchError::Refused(why))),
            };
            // Far from the seeds of the rounds.
            let [a, b] = [take(u64::MAX)?, take(u64::MAX - 1)?];
            if !progress((start.elapsed().as_secs_f64() / effort.seconds).min(1.0)) {
                return Err(BenchError::Stopped.into());
            }
            let values: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 0.5 * (a + b)).collect();
            let mean = mean(&values);
            let square = 0.25 * mean_square(&a, &b) / (mean * mean);
            let now = start.elapsed().as_secs_f64();
            let next = now + f64::from(STEP) * (now - before);
            let is_enough = square.sqrt() <= OWN_SHARE * effort.target;
            if is_enough || next > SHARES[0] * effort.seconds || !square.is_finite() {
                break (values, square);
            }
            samples = samples.saturating_mul(STEP);
        };
        let mean = mean(&values);
        let mut notes = Vec::new();
        let own = square.sqrt();
        if !own.is_finite() {
            notes.push("the sensor records nothing: there is no error of it".to_owned());
        } else if own > OWN_SHARE * effort.target {
            notes.push(format!(
                "the converged picture has an error of {:.2} % itself, which is taken off; more --seconds make it less",
                100.0 * own
            ));
        }
        let entries = vec![ContenderRecord {
            contender: plain,
            points: Vec::new(),
            renders: 0,
            is_out: false,
        }];
        Ok(Self {
            effort,
            program,
            progress,
            start,
            converged: values,
            samples: 2 * samples,
            mean,
            own_square: square,
            entries,
            renders: Vec::new(),
            notes,
            seed: 0,
        })
    }

    fn add(&mut self, contenders: Vec<Contender>) {
        let entry = |contender| ContenderRecord {
            contender,
            points: Vec::new(),
            renders: 0,
            is_out: false,
        };
        self.entries.extend(contenders.into_iter().map(entry));
    }

    /// The time that is left (s) of a share of all.
    fn left(&self, share: f64) -> f64 {
        share * self.effort.seconds - self.start.elapsed().as_secs_f64()
    }

    /// Renders all that are not out, and not yet, with so many samples; whether there was time for all.
    fn render_all(&mut self, samples: u32) -> Result<bool, E> {
        for who in 0..self.entries.len() {
            if !self.render_in_time(who, samples)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The first two renders of everybody, one after another: what there was time for can be told of.
    fn render_first(&mut self) -> Result<(), E> {
        for who in 0..self.entries.len() {
            for samples in FIRST {
                if !self.render_in_time(who, samples)? {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// Renders one that is not out, and not yet, with so many samples, unless there is no time for it.
    fn render_in_time(&mut self, who: usize, samples: u32) -> Result<bool, E> {
        let entry = &self.entries[who];
        if entry.is_out || entry.points.iter().any(|point| point.samples >= samples) {
            return Ok(true);
        }
        // As many samples more take as much time more, at most; the first of all tell of the others.
        let known = entry.points.last().or_else(|| self.entries[0].points.first());
        let expected = known.map_or(0.0, |known| {
            known.seconds * (f64::from(samples) / f64::from(known.samples)).max(1.0)
        });
        if expected > self.left(SHARES[1]) {
            self.notes.push(format!(
                "no time was left for renders with {samples} samples; more --seconds have it"
            ));
            return Ok(false);
        }
        self.render(who, samples)?;
        Ok(true)
    }

    fn render(&mut self, who: usize, samples: u32) -> Result<Option<TrialRender>, E> {
        let done = (self.start.elapsed().as_secs_f64() / self.effort.seconds).min(1.0);
        if !(self.progress)(done) {
            return Err(BenchError::Stopped.into());
        }
        self.seed += 1;
        let contender = &self.entries[who].contender;
        let run = match (self.program)(Run { contender, samples, seed: self.seed })? {
            Outcome::Done(run) => run,
            Outcome::Refused(why) => {
                self.notes.push(format!("{} is not to be had: {why}", contender.name));
                self.entries[who].is_out = true;
                return Ok(None);
            }
        };
        let (point, render) = self.judged(contender.name.clone(), samples, &run);
        self.renders.push(render);
        let entry = &mut self.entries[who];
        // Two of one number would tell no slope.
        entry.points.retain(|known| known.samples != samples);
        entry.points.push(point);
        entry.points.sort_by_key(|point| point.samples);
        entry.renders += 1;
        Ok(Some(point))
    }

    fn judged(&self, name: String, samples: u32, run: &WholeRun) -> (TrialRender, Render) {
        let square = mean_square(&run.values, &self.converged) / (self.mean * self.mean);
        let square = (square - self.own_square).max(0.0);
        let floor = 0.01 * self.mean * self.mean;
        let share = |(own, all): (&f64, &f64)| (own - all) * (own - all) / (all * all + floor);
        let shares: Vec<f64> = run.values.iter().zip(&self.converged).map(share).collect();
        let seconds = run.seconds();
        let (stages, error) = (run.stages, square.sqrt());
        let render = Render { name, samples, stages, seconds, error, relative_mse: mean(&shares) };
        (TrialRender { samples, seconds, square }, render)
    }

    fn forecast_of(&self, entry: &ContenderRecord) -> Option<Forecast> {
        forecast(&entry.points, self.effort.target)
    }

    /// The time (s) at which an entry reaches the target.
    fn time_of(&self, entry: &ContenderRecord) -> f64 {
        self.forecast_of(entry).map_or(f64::INFINITY, |forecast| forecast.seconds)
    }

    /// Of each axis the change that is soonest, where it is sooner than the scene as it is.
    fn better(&self) -> Vec<(usize, usize)> {
        let plain = self.time_of(&self.entries[0]);
        let mut better: Vec<((usize, usize), f64)> = Vec::new();
        for entry in self.entries.iter().filter(|entry| !entry.is_out) {
            let (&[change], time) = (&*entry.contender.changes, self.time_of(entry)) else {
                continue;
            };
            match better.iter_mut().find(|((axis, _), _)| *axis == change.0) {
                _ if time >= plain => {}
                Some(known) if known.1 <= time => {}
                Some(known) => *known = (change, time),
                None => better.push((change, time)),
            }
        }
        better.into_iter().map(|(change, _)| change).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::target::AS_IT_IS;

    /// Time that a contender takes at first, and that a sample takes (s), and the squared error of one sample and of all.
    type Law = [f64; 4];

    /// A picture of mean 1 with just this squared error.
    fn picture(square: f64) -> Vec<f64> {
        (0..64)
            .map(|i| if i % 2 == 0 { 1.0 + square.sqrt() } else { 1.0 - square.sqrt() })
            .collect()
    }

    fn raced(axes: &[Vec<(&str, Law)>], plain: Law, target: f64) -> Target {
        let of =
            |(name, _): &(&str, Law)| Change { name: (*name).to_owned(), settings: Vec::new() };
        let changes: Vec<Vec<Change>> =
            axes.iter().map(|axis| axis.iter().map(of).collect()).collect();
        let mut program = |run: Run<'_>| {
            if run.seed >= u64::MAX - 1 {
                return Ok(Outcome::Done(WholeRun {
                    stages: [0.0; 4],
                    values: picture(0.0),
                    shape: [8, 8, 1],
                }));
            }
            // Of joint changes the savings multiply, and what is missed adds up.
            let laws = run.contender.changes.iter().map(|&(axis, number)| axes[axis][number].1);
            let [start, sample, variance, rest] = laws.fold(plain, |a, b| {
                [
                    a[0] * b[0] / plain[0],
                    a[1] * b[1] / plain[1],
                    a[2] * b[2] / plain[2],
                    a[3] + b[3],
                ]
            });
            if sample < 0.0 {
                return Ok(Outcome::Refused("not with this".to_owned()));
            }
            let n = f64::from(run.samples);
            let stages = [start, 0.0, sample * n, 0.0];
            let values = picture(variance / n + rest);
            Ok::<_, BenchError>(Outcome::Done(WholeRun { stages, values, shape: [8, 8, 1] }))
        };
        measure(&changes, &[], Effort { target, seconds: 1e9 }, &mut program, &|_| true).unwrap()
    }

    #[test]
    fn the_soonest_is_that_of_the_laws() {
        // An error of 1 % wants 10⁴ · 0.04 = 400 samples: 0.5 + 4 s.
        let plain = [0.5, 0.01, 0.04, 0.0];
        let axes = vec![
            vec![
                ("half the variance", [0.5, 0.01, 0.02, 0.0]),
                ("twice the time", [0.5, 0.02, 0.04, 0.0]),
            ],
            vec![
                // Quick, and never good enough: its rest is 2 %.
                ("biased", [0.5, 0.001, 0.04, 4e-4]),
                ("quick", [0.5, 0.005, 0.04, 0.0]),
            ],
            vec![("refused", [0.5, -1.0, 0.04, 0.0])],
        ];
        let found = raced(&axes, plain, 0.01);
        let best = &found.contenders[0];
        assert_eq!(best.name, "half the variance + quick", "{:?}", found.contenders);
        // 200 samples of 5 ms and half a second.
        assert_eq!(best.samples, Some(200));
        let verified = found.verified.unwrap();
        assert_eq!(verified.samples, 200);
        assert!((verified.seconds - 1.5).abs() < 1e-9 && verified.factor() < 1.0 + 1e-9);
        assert!((verified.error - 0.01).abs() < 1e-9, "{verified:?}");
        // In its 1.5 s the scene as it is has 100 samples, and twice the error.
        let [own, soonest, ..] = &found.equal_time[..] else { panic!("{:?}", found.equal_time) };
        assert_eq!((&*own.name, own.samples / 2), (AS_IT_IS, 50));
        assert!((own.error - 0.02).abs() < 1e-4, "{own:?}");
        assert_eq!(soonest.name, best.name);
        assert!((soonest.error - 0.01).abs() < 1e-4 && soonest.relative_mse < own.relative_mse);
        assert_eq!(found.strip.unwrap().pictures.len(), 1 + found.equal_time.len());
        let time = |name: &str| {
            let own = found.contenders.iter().find(|own| own.name == name).unwrap();
            own.seconds
        };
        assert!(time("biased").is_none());
        assert!((time(AS_IT_IS).unwrap() - 4.5).abs() < 1e-9);
        assert!(found.notes.iter().any(|note| note.contains("refused is not to be had")));
    }

    #[test]
    fn two_renders_tell_when_a_third_reaches_the_target() {
        let law = |n: u32| TrialRender {
            samples: n,
            seconds: 2.0 + 0.1 * f64::from(n),
            square: 1e-4 + 0.01 / f64::from(n),
        };
        // b² = 1e-4 and v = 0.01: a squared error of 2e-4 at 100 samples, after 12 s.
        let found = forecast(&[law(4), law(16)], 2e-4_f64.sqrt()).unwrap();
        assert!((99..=101).contains(&found.samples), "{found:?}");
        // A sample more, by rounding up.
        assert!((found.seconds - 12.0).abs() < 0.11, "{found:?}");
        assert_eq!(forecast(&[law(4), law(16)], 0.01), None, "below what no sample mends");
        assert_eq!(forecast(&[law(4)], 0.1), None);
    }
}
