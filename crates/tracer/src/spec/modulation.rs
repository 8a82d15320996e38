//! Change of the strength of a light with time, as the scene file writes it.

use etendue_geometry::units::Seconds;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::supply::{Fault, one};
use crate::modulation::{Clock, Modulation, Waveform};

/// The most points of a curve.
const MOST_POINTS: usize = 1 << 16;

/// The highest frequency (Hz): a period of it is told apart from the next in f64 after a day.
const HIGHEST: f64 = 1e9;

/// Change of the strength of a light with time, as the scene file writes it: a factor, not below zero.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum ModulationSpec {
    /// Through points, in straight lines; before the first and after the last the factor is theirs.
    Curve {
        /// Times (s), none before the one in front of it, and factors. Two points at one time are a step.
        points: Vec<(Seconds, f64)>,
        /// The curve from 0 to here repeats (s).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        period: Option<Seconds>,
        /// The event that its times count from.
        #[serde(default = "of_frame")]
        clock: Clock,
    },
    /// On once, as an electronic flash, and dark else.
    Pulse {
        /// When it starts (s).
        #[serde(default)]
        start: Seconds,
        /// Time for which it is on (s).
        duration: Seconds,
        /// The factor while it is on.
        #[serde(default = "one")]
        #[schemars(range(min = 0.0))]
        factor: f64,
        /// The event that its times count from.
        #[serde(default = "of_frame")]
        clock: Clock,
    },
    /// On and off by turns, as a lamp that is dimmed by the width of its pulses.
    Square {
        /// Periods a second (Hz).
        frequency: f64,
        /// The share of a period for which it is on, from its start.
        #[serde(default = "half")]
        #[schemars(range(min = 0.0, max = 1.0))]
        duty: f64,
        /// The factor while it is on.
        #[serde(default = "one")]
        #[schemars(range(min = 0.0))]
        high: f64,
        /// The factor while it is off.
        #[serde(default)]
        #[schemars(range(min = 0.0))]
        low: f64,
        /// Phase of its period at time 0 (turns).
        #[serde(default)]
        phase: f64,
        /// The event that its times count from.
        #[serde(default)]
        clock: Clock,
    },
    /// 1 + `depth` · sin 2π(`frequency` · t + `phase`): its mean is 1.
    Sine {
        /// Periods a second (Hz): of a lamp on the mains, twice that of the mains.
        frequency: f64,
        /// Depth of its swing, 0 to 1.
        #[serde(default = "one")]
        #[schemars(range(min = 0.0, max = 1.0))]
        depth: f64,
        /// Phase of its period at time 0 (turns).
        #[serde(default)]
        phase: f64,
        /// The event that its times count from.
        #[serde(default)]
        clock: Clock,
    },
}

fn of_frame() -> Clock {
    Clock::Frame
}

fn half() -> f64 {
    0.5
}

impl ModulationSpec {
    /// Clock that its times count from.
    #[must_use]
    pub fn clock(&self) -> Clock {
        match self {
            Self::Curve { clock, .. }
            | Self::Pulse { clock, .. }
            | Self::Square { clock, .. }
            | Self::Sine { clock, .. } => *clock,
        }
    }

    /// The factor as a function of time, of a frame whose time is 0.
    ///
    /// # Errors
    ///
    /// On the first value that makes no sense; the fault names its key below `modulation`.
    pub fn build(&self) -> Result<Modulation, Fault> {
        let of = |form| Ok(Modulation { clock: self.clock(), offset: 0.0, form });
        match self {
            Self::Curve { points, period, .. } => {
                let points: Vec<[f64; 2]> = points.iter().map(|(time, f)| [time.0, *f]).collect();
                check_points(&points)?;
                let period = period.map(|period| period.0);
                if let Some(period) = period {
                    let [first, last] = [points[0][0], points[points.len() - 1][0]];
                    if !(period > 0.0 && period.is_finite() && first >= 0.0 && last <= period) {
                        let why = format!(
                            "{period} s does not hold points from {first} s to {last} s: the part from 0 to it repeats"
                        );
                        return Err(Fault::new("modulation.period", why));
                    }
                }
                of(Waveform::curve(points, period))
            }
            Self::Pulse { start: Seconds(start), duration: Seconds(duration), factor, .. } => {
                if !start.is_finite() {
                    return Err(Fault::new("modulation.start", format!("{start} s is not finite")));
                }
                if !(*duration > 0.0 && (start + duration).is_finite()) {
                    let why = format!("{duration} s is no duration of a pulse; give more than 0");
                    return Err(Fault::new("modulation.duration", why));
                }
                check_factor("factor", *factor)?;
                let end = start + duration;
                let points = [[*start, 0.0], [*start, *factor], [end, *factor], [end, 0.0]];
                of(Waveform::curve(points.to_vec(), None))
            }
            Self::Square { frequency, duty, high, low, phase, .. } => {
                check_frequency(*frequency, *phase)?;
                if !(0.0..=1.0).contains(duty) {
                    let why = format!("{duty} is no share of a period, 0 to 1");
                    return Err(Fault::new("modulation.duty", why));
                }
                check_factor("high", *high)?;
                check_factor("low", *low)?;
                let period = 1.0 / frequency;
                let step = duty * period;
                let points = [[0.0, *high], [step, *high], [step, *low], [period, *low]];
                let form = Waveform::curve(points.to_vec(), Some(period));
                let offset = phase.rem_euclid(1.0) * period;
                Ok(Modulation { clock: self.clock(), offset, form })
            }
            Self::Sine { frequency, depth, phase, .. } => {
                check_frequency(*frequency, *phase)?;
                if !(0.0..=1.0).contains(depth) {
                    let why = format!(
                        "{depth} is not between 0 and 1: light would fall below zero, or swing by nothing"
                    );
                    return Err(Fault::new("modulation.depth", why));
                }
                of(Waveform::Sine {
                    frequency: *frequency,
                    depth: *depth,
                    phase: phase.rem_euclid(1.0),
                })
            }
        }
    }
}

fn check_points(points: &[[f64; 2]]) -> Result<(), Fault> {
    if points.is_empty() || points.len() > MOST_POINTS {
        let why = format!("{} points; give 1 to {MOST_POINTS}", points.len());
        return Err(Fault::new("modulation.points", why));
    }
    let mut last = f64::NEG_INFINITY;
    for (i, [time, factor]) in points.iter().enumerate() {
        let at = format!("modulation.points[{i}]");
        if !(time.is_finite() && *time >= last) {
            return Err(Fault::new(
                at.as_str(),
                format!("{time} s does not follow {last} s; times are in order"),
            ));
        }
        if !(*factor >= 0.0 && factor.is_finite()) {
            return Err(Fault::new(
                at.as_str(),
                format!("{factor} is no factor of light; give 0 or more"),
            ));
        }
        last = *time;
    }
    Ok(())
}

fn check_factor(key: &str, factor: f64) -> Result<(), Fault> {
    match factor >= 0.0 && factor.is_finite() {
        true => Ok(()),
        false => {
            let why = format!("{factor} is no factor of light; give 0 or more");
            Err(Fault::new(format!("modulation.{key}"), why))
        }
    }
}

fn check_frequency(frequency: f64, phase: f64) -> Result<(), Fault> {
    if !(frequency > 0.0 && frequency <= HIGHEST) {
        let why = format!("{frequency} Hz is not above 0 and at most {HIGHEST}");
        return Err(Fault::new("modulation.frequency", why));
    }
    match phase.is_finite() {
        true => Ok(()),
        false => Err(Fault::new("modulation.phase", format!("{phase} turns are not finite"))),
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    fn built(spec: serde_json::Value) -> Modulation {
        serde_json::from_value::<ModulationSpec>(spec).unwrap().build().unwrap()
    }

    /// Means against sums of the factor at many moments, and factors against their formulas.
    #[test]
    fn means_are_the_integrals_of_the_factors() {
        use serde_json::json;
        let all = [
            json!({ "type": "sine", "frequency": 100, "depth": 0.7, "phase": 0.3 }),
            json!({ "type": "square", "frequency": 120, "duty": 0.3, "high": 2, "low": 0.1, "phase": -0.4 }),
            json!({ "type": "pulse", "start": "3 ms", "duration": "1 ms", "factor": 5 }),
            json!({ "type": "curve", "points": [[0.001, 0], [0.002, 1], [0.002, 3], [0.005, 0.5]] }),
            json!({ "type": "curve", "points": [[0.001, 0], [0.002, 1], [0.004, 0.5]], "period": "6 ms" }),
        ];
        for spec in all {
            let modulation = built(spec.clone()).from_time(12.345);
            for [from, to] in [[0.0, 0.01], [-0.02, 0.003], [0.0025, 0.0031], [0.5, 0.77]] {
                let n = 200_000;
                let step = (to - from) / f64::from(n);
                let sum: f64 =
                    (0..n).map(|i| modulation.at(from + (f64::from(i) + 0.5) * step)).sum();
                let [found, due] = [modulation.mean([from, to]), sum / f64::from(n)];
                // The midpoint rule misses steps by a step of its own times their height, 77 of them at most.
                assert!(
                    (found - due).abs() < 80.0 * 5.0 / f64::from(n),
                    "{spec} {from}: {found} {due}"
                );
            }
        }
        let sine = built(json!({ "type": "sine", "frequency": 100, "depth": 0.5 }));
        assert!(
            (sine.at(0.0025) - 1.5).abs() < 1e-12 && (sine.mean([0.0, 0.01]) - 1.0).abs() < 1e-15
        );
        // (1/T)∫ sin over the half period is 2/π.
        assert!((sine.mean([0.0, 0.005]) - (1.0 + 1.0 / PI)).abs() < 1e-12);
    }

    /// A flash is the frame's, and a lamp goes on from frame to frame.
    #[test]
    fn clocks_differ() {
        use serde_json::json;
        let flash = built(json!({ "type": "pulse", "start": 0.002, "duration": 0.001 }));
        let means = [flash.from_time(0.0), flash.from_time(7.0)].map(|it| it.mean([0.0, 0.01]));
        assert!(means.iter().all(|mean| (mean - 0.1).abs() < 1e-15), "{means:?}");
        let lamp = built(json!({ "type": "square", "frequency": 1 })).from_time(0.75);
        assert_eq!([lamp.at(0.0), lamp.at(0.3)], [0.0, 1.0]);
    }

    #[test]
    fn what_makes_no_sense_is_refused_by_its_key() {
        use serde_json::json;
        for (spec, key) in [
            (json!({ "type": "curve", "points": [] }), "modulation.points"),
            (json!({ "type": "curve", "points": [[0, 1], [-1, 1]] }), "modulation.points[1]"),
            (json!({ "type": "curve", "points": [[0, -1]] }), "modulation.points[0]"),
            (
                json!({ "type": "curve", "points": [[0, 1], [3, 1]], "period": 2 }),
                "modulation.period",
            ),
            (json!({ "type": "pulse", "duration": 0 }), "modulation.duration"),
            (json!({ "type": "square", "frequency": 0 }), "modulation.frequency"),
            (json!({ "type": "square", "frequency": 1, "duty": 2 }), "modulation.duty"),
            (json!({ "type": "sine", "frequency": 1, "depth": 1.5 }), "modulation.depth"),
        ] {
            let fault =
                serde_json::from_value::<ModulationSpec>(spec).unwrap().build().unwrap_err();
            assert_eq!(fault.key, key, "{}", fault.why);
        }
    }
}
