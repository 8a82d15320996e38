//! A forecast in words.

use std::fmt;

use etendue_render::Decision;

use super::TimeForecast;

impl fmt::Display for TimeForecast {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", ForecastTime(self.total), self.stages())
    }
}

impl TimeForecast {
    /// The stages in words.
    #[must_use]
    pub fn stages(&self) -> String {
        let Self { load, build, trace, sensor, views, output, .. } = *self;
        let stages = [
            ("load", load),
            ("build", build),
            ("trace", trace),
            ("sensor", sensor),
            ("views", views),
            ("output", output),
        ];
        let shown =
            stages.iter().filter(|(name, time)| *time > 0.0 || !["sensor", "views"].contains(name));
        let words: Vec<String> =
            shown.map(|(name, time)| format!("{name} {}", ForecastTime(*time))).collect();
        words.join(", ")
    }

    /// As an entry of the plan's list.
    #[must_use]
    pub fn decision(&self) -> Decision {
        let by = match self.is_piloted {
            true => "by this machine's rates and strips of the picture",
            false => "by this machine's rates and the plan's counts",
        };
        Decision {
            what: "time",
            choice: ForecastTime(self.total).to_string(),
            because: format!("{}; {by}", self.stages()),
            saves: None,
            key: None,
            forced: false,
        }
    }
}

/// A time with the digits that a forecast has.
struct ForecastTime(f64);

impl fmt::Display for ForecastTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            time if time >= 5400.0 => write!(f, "{:.1} h", time / 3600.0),
            time if time >= 90.0 => write!(f, "{:.0} min", time / 60.0),
            time if time >= 10.0 => write!(f, "{time:.0} s"),
            time if time >= 0.1 => write!(f, "{time:.1} s"),
            time => write!(f, "{:.0} ms", 1e3 * time),
        }
    }
}
