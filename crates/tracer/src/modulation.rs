//! Change of the strength of a light with time: flashes, lamps on mains, pulses of a driver, measured waveforms.
//!
//! A factor multiplies all that the light gives off. Its mean over an interval is exact: a sine's by the sum formula,
//! `1 + d sinc(f T) sin 2π(f t_m + φ)` about the middle `t_m` of an interval of length T, that of a curve by trapezoids.

use std::f64::consts::{PI, TAU};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The event that times count from.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Clock {
    /// Scene time: it goes on from frame to frame.
    #[default]
    Scene,
    /// The frame's: each frame has it anew, from the moment at which its shutter opens.
    Frame,
}

/// A factor as a function of time.
#[derive(Debug, Clone, PartialEq)]
pub struct Modulation {
    pub(crate) clock: Clock,
    /// The time in its own clock at time 0 of the frame's (s).
    pub(crate) offset: f64,
    pub(crate) form: Waveform,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Waveform {
    Curve {
        /// (s, factor), in order.
        points: Vec<[f64; 2]>,
        /// The integral up to each point from the first (s).
        sums: Vec<f64>,
        /// s.
        period: Option<f64>,
    },
    Sine {
        /// Hz.
        frequency: f64,
        depth: f64,
        /// Turns.
        phase: f64,
    },
}

impl Waveform {
    /// Through points in order, of which there is one at least.
    pub(crate) fn curve(points: Vec<[f64; 2]>, period: Option<f64>) -> Self {
        let mut sums = Vec::with_capacity(points.len());
        let mut sum = 0.0;
        for (i, point) in points.iter().enumerate() {
            if let Some(before) = i.checked_sub(1).map(|i| points[i]) {
                sum += 0.5 * (before[1] + point[1]) * (point[0] - before[0]);
            }
            sums.push(sum);
        }
        Self::Curve { points, sums, period }
    }
}

/// The factor and the integral from the first point (s) at a time of a curve that does not repeat.
fn along(points: &[[f64; 2]], sums: &[f64], time: f64) -> [f64; 2] {
    let next = points.partition_point(|point| point[0] <= time);
    let Some(i) = next.checked_sub(1) else {
        let [first, factor] = points[0];
        return [factor, (time - first) * factor];
    };
    let [from, start] = points[i];
    let elapsed = time - from;
    let factor = match points.get(next) {
        Some([to, end]) => start + (end - start) * (elapsed / (to - from)),
        None => start,
    };
    [factor, sums[i] + 0.5 * (start + factor) * elapsed]
}

impl Modulation {
    /// The same in the clock of a frame whose time is `time` (s).
    #[must_use]
    pub fn from_time(&self, time: f64) -> Self {
        let shift = if self.clock == Clock::Scene { time } else { 0.0 };
        Self { offset: self.offset + shift, ..self.clone() }
    }

    /// The factor at a time of the frame's clock (s); at a step, that behind it.
    #[must_use]
    pub fn at(&self, time: f64) -> f64 {
        let time = time + self.offset;
        match &self.form {
            Waveform::Sine { frequency, depth, phase } => {
                1.0 + depth * (TAU * ((frequency * time).fract() + phase)).sin()
            }
            Waveform::Curve { points, sums, period } => {
                let time = period.map_or(time, |period| time.rem_euclid(period));
                along(points, sums, time)[0]
            }
        }
    }

    /// The mean over an interval of the frame's clock (s), exactly; of a moment the factor then.
    #[must_use]
    pub fn mean(&self, [from, to]: [f64; 2]) -> f64 {
        let length = to - from;
        if length <= 0.0 {
            return self.at(from);
        }
        match &self.form {
            Waveform::Sine { frequency, depth, phase } => {
                let middle = (frequency * (0.5 * (from + to) + self.offset)).fract();
                let half_turn = PI * frequency * length;
                let share = half_turn.sin() / half_turn;
                1.0 + depth * share * (TAU * (middle + phase)).sin()
            }
            Waveform::Curve { points, sums, period } => {
                let [_, whole] = along(points, sums, period.unwrap_or(0.0));
                let [_, before] = along(points, sums, 0.0);
                let integral = |time: f64| match period {
                    None => along(points, sums, time)[1],
                    Some(period) => {
                        let turns = (time / period).floor();
                        turns * (whole - before) + along(points, sums, time - turns * period)[1]
                    }
                };
                // From the period in which it starts on: the integrals are then as small as the interval.
                let start = from + self.offset;
                let start = period.map_or(start, |period| start.rem_euclid(period));
                (integral(start + length) - integral(start)) / length
            }
        }
    }

    /// By what its light is chosen among others where it is seen over an interval of the frame's clock (s): the mean, but
    /// at least a twentieth of light that is seen at all, or the rows that see it would be noise.
    pub(crate) fn weight(&self, interval: [f64; 2]) -> f64 {
        const LEAST: f64 = 0.05;
        match self.mean(interval) {
            mean if mean > 0.0 => mean.max(LEAST),
            _ => 0.0,
        }
    }

    /// The mean over several intervals of the frame's clock (s), each by its length; of moments alone, that over them.
    #[must_use]
    pub fn mean_over(&self, intervals: &[[f64; 2]]) -> f64 {
        let total: f64 = intervals.iter().map(|[from, to]| to - from).sum();
        if total <= 0.0 {
            let sum: f64 = intervals.iter().map(|[from, _]| self.at(*from)).sum();
            return sum / intervals.len().max(1) as f64;
        }
        let parts = intervals.iter().map(|&[from, to]| (to - from) * self.mean([from, to]));
        parts.sum::<f64>() / total
    }
}
