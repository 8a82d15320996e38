//! Who is timed when, and medians.
//!
//! Contestants take turns: a round times each of them once, so that whatever else the machine does
//! meanwhile meets all of them alike. A ratio is the median of the ratios of the rounds.

use std::time::Instant;

use serde::Serialize;

/// Wall time of `work` (s), and what it made.
pub fn wall<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let start = Instant::now();
    let made = work();
    (start.elapsed().as_secs_f64(), made)
}

/// What one contestant took, round by round (s).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Series(pub Vec<f64>);

impl Series {
    /// The median (s); NaN without rounds.
    #[must_use]
    pub fn median(&self) -> f64 {
        median(self.0.clone())
    }

    /// The fastest round (s).
    #[must_use]
    pub fn fastest(&self) -> f64 {
        self.0.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The slowest round (s).
    #[must_use]
    pub fn slowest(&self) -> f64 {
        self.0.iter().copied().fold(0.0, f64::max)
    }

    /// How many times as fast as `other` this is: the median over the rounds.
    #[must_use]
    pub fn speed_against(&self, other: &Self) -> f64 {
        median(self.0.iter().zip(&other.0).map(|(own, other)| other / own).collect())
    }

    /// The three numbers that are told of it; `None` without rounds.
    #[must_use]
    pub fn spread(&self) -> Option<TimeSpread> {
        let spread = || TimeSpread {
            median: self.median(),
            fastest: self.fastest(),
            slowest: self.slowest(),
        };
        (!self.0.is_empty()).then(spread)
    }
}

/// Times of all rounds in three numbers (s).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TimeSpread {
    /// The median.
    pub median: f64,
    /// The fastest round.
    pub fastest: f64,
    /// The slowest round.
    pub slowest: f64,
}

/// The middle value, or the mean of the two in the middle; NaN of nothing.
#[must_use]
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let (below, above) = (values.len().wrapping_sub(1) / 2, values.len() / 2);
    match (values.get(below), values.get(above)) {
        (Some(a), Some(b)) => (a + b) / 2.0,
        _ => f64::NAN,
    }
}

/// Something that is timed once a round; it tells its own seconds.
pub type Turn<'a> = Box<dyn FnMut() -> f64 + 'a>;

/// Times each of `turns` once a round, after one round that is not counted. Each round begins with
/// another of them.
pub fn take_turns(rounds: usize, turns: &mut [Turn<'_>]) -> Vec<Series> {
    let mut series = vec![Series::default(); turns.len()];
    for turn in turns.iter_mut() {
        turn();
    }
    for round in 0..rounds {
        for who in order(round, turns.len()) {
            series[who].0.push(turns[who]());
        }
    }
    series
}

/// In which order `count` contestants take their turns in a round.
pub fn order(round: usize, count: usize) -> impl Iterator<Item = usize> {
    (0..count).map(move |k| (round + k) % count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_are_medians_of_rounds() {
        let (ours, limit) = (Series(vec![2.0, 4.0, 30.0]), Series(vec![1.0, 2.0, 3.0]));
        assert_eq!(ours.speed_against(&limit), 0.5, "a round of noise does not move it");
        assert_eq!(ours.median(), 4.0);
        assert_eq!(Series(vec![1.0, 3.0]).median(), 2.0);
        assert!(Series::default().median().is_nan());
        assert_eq!(Series::default().spread(), None);
    }

    #[test]
    fn every_turn_is_taken_once_a_round_after_a_warm_up() {
        let count = std::cell::Cell::new(0.0);
        let next = || {
            count.set(count.get() + 1.0);
            count.get()
        };
        let series = take_turns(2, &mut [Box::new(next), Box::new(next)]);
        assert_eq!(series[0].0, [3.0, 6.0]);
        assert_eq!(series[1].0, [4.0, 5.0]);
    }
}
