//! Shutters: when each row of the sensor is open to light. Global and rolling shutters, codes within an exposure.
//!
//! Times are seconds in the frame's clock, whose 0 is the moment at which the shutter opens: that of the first row
//! that is read out, where rows open one after another.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::CameraError;
use etendue_geometry::units::Seconds;

/// The longest code (chips), and the most intervals of a list.
const MOST_INTERVALS: usize = 4096;

/// Share of an exposure by which a code may be longer, in rounding of its chips.
const ROUNDING: f64 = 1e-9;

/// A shutter as the scene file writes it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ShutterSpec {
    /// Times at which rows are open.
    #[serde(rename = "type")]
    pub kind: ShutterKind,
    /// Time for which a row is open (s). When absent, as long as the sensor exposes; without such a sensor no time at all,
    /// so that each row sees one instant.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exposure: Option<Seconds>,
    /// From one row to the next that is read out (s), of `rolling` and `global_reset`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line_time: Option<Seconds>,
    /// Direction in which the rows are read out.
    pub readout: Readout,
    /// The intervals `[from, to]` of the exposure in which light is let through (s from its start), in order; all of
    /// it when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub open: Option<Vec<[Seconds; 2]>>,
    /// Instead of `open`: a code of 1 (open) and 0 (closed), each for a chip's time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub code: Option<String>,
    /// Length of a chip of `code` (s); the exposure over the code's length when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chip: Option<Seconds>,
    /// Moment of its row's exposure at which data layers see a pixel.
    pub truth_at: TruthAt,
}

/// Times at which rows are open.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ShutterKind {
    /// All rows open and close together.
    #[default]
    Global,
    /// Rows open one after another, each for the same time.
    Rolling,
    /// All rows open together, and close one after another as they are read out.
    GlobalReset,
}

/// Direction in which rows are read out.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Readout {
    /// From the top row of the picture to the bottom one.
    #[default]
    Down,
    /// From the bottom row to the top one.
    Up,
}

/// A moment of a row's exposure.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TruthAt {
    /// When the row opens.
    Open,
    /// Halfway between its opening and its closing.
    #[default]
    Middle,
    /// When the row closes.
    Close,
}

/// Shutter: when each row is open.
#[derive(Debug, Clone, PartialEq)]
pub struct Shutter {
    kind: ShutterKind,
    exposure: f64,
    line_time: f64,
    readout: Readout,
    /// Open intervals from the row's opening (s), and the open time before each (s); empty when all is open.
    open: Vec<[f64; 2]>,
    before: Vec<f64>,
    truth_at: TruthAt,
    /// Rows of the sensor.
    rows: u32,
    /// Rows of the sensor in a row of the picture.
    coarse: f64,
}

impl ShutterSpec {
    /// The shutter of a sensor of so many rows.
    ///
    /// # Errors
    ///
    /// When times are negative or not finite, keys do not belong together, or there is no open moment; the error
    /// names the key.
    pub fn build(&self, rows: u32) -> Result<Shutter, CameraError> {
        let exposure = self.exposure.map_or(0.0, |time| time.0);
        if !(exposure >= 0.0 && exposure.is_finite()) {
            return fault("exposure", format!("{exposure} s is no duration\nhint: give 0 or more"));
        }
        let line_time = match (self.kind, self.line_time) {
            (ShutterKind::Global, None) => 0.0,
            (ShutterKind::Global, Some(_)) => {
                let why = "belongs to rows that are read one after another\nhint: set \"type\": \"rolling\", or \
                           leave it out";
                return fault("line_time", why.to_owned());
            }
            (_, None) => {
                let why = "is missing: rows that are read one after another want the time from one to the next, \
                           such as \"15 us\"";
                return fault("line_time", why.to_owned());
            }
            (_, Some(Seconds(time))) if time >= 0.0 && time.is_finite() => time,
            (_, Some(Seconds(time))) => {
                return fault(
                    "line_time",
                    format!("{time} s is no duration\nhint: give 0 or more"),
                );
            }
        };
        if !(line_time * f64::from(rows)).is_finite() {
            return fault(
                "line_time",
                format!("{line_time} s for each of {rows} rows is too long"),
            );
        }
        let open = self.intervals(exposure)?;
        let mut total = 0.0;
        let mut before = Vec::with_capacity(open.len());
        for [from, to] in &open {
            before.push(total);
            total += to - from;
        }
        if !open.is_empty() && self.kind == ShutterKind::GlobalReset && line_time > 0.0 {
            let key = if self.code.is_some() { "code" } else { "open" };
            let why = "rows of a global reset are open for different times, which no one code fits\nhint: set \
                       \"type\": \"global\" or \"rolling\"";
            return fault(key, why.to_owned());
        }
        Ok(Shutter {
            kind: self.kind,
            exposure,
            line_time,
            readout: self.readout,
            open,
            before,
            truth_at: self.truth_at,
            rows: rows.max(1),
            coarse: 1.0,
        })
    }

    /// The open intervals of an exposure (s); none when all of it is open.
    fn intervals(&self, exposure: f64) -> Result<Vec<[f64; 2]>, CameraError> {
        match (&self.open, &self.code) {
            (_, None) if self.chip.is_some() => {
                fault("chip", "is the time of a `code`, and there is none".to_owned())
            }
            (None, None) => Ok(Vec::new()),
            (Some(_), Some(_)) => {
                let why =
                    "is given beside `open`, which already says when it is open\nhint: remove one";
                fault("code", why.to_owned())
            }
            (Some(list), None) => listed(list, exposure),
            (None, Some(code)) => coded(code, self.chip, exposure),
        }
    }
}

fn fault<T>(key: &str, why: String) -> Result<T, CameraError> {
    Err(CameraError::new(format!("shutter.{key}"), why))
}

/// The intervals of a list, held to be in order and within the exposure (s).
fn listed(list: &[[Seconds; 2]], exposure: f64) -> Result<Vec<[f64; 2]>, CameraError> {
    if list.is_empty() {
        return fault("open", "lists no interval: the shutter has no open moment".to_owned());
    }
    if list.len() > MOST_INTERVALS {
        return fault(
            "open",
            format!("lists {} intervals; {MOST_INTERVALS} are the most", list.len()),
        );
    }
    let mut end = 0.0;
    for (i, [Seconds(from), Seconds(to)]) in list.iter().enumerate() {
        let is_after = *from >= end && to > from && to.is_finite();
        if !is_after {
            let why = format!(
                "[{from}, {to}] s does not follow {end} s; intervals are in order, apart, and last longer than 0"
            );
            return fault(&format!("open[{i}]"), why);
        }
        end = *to;
    }
    if end > exposure * (1.0 + ROUNDING) {
        let why = format!("ends {end} s after the start of an exposure of {exposure} s");
        return fault(&format!("open[{}]", list.len() - 1), why);
    }
    Ok(list.iter().map(|interval| interval.map(|time| time.0)).collect())
}

/// The intervals of a code within an exposure (s).
fn coded(code: &str, chip: Option<Seconds>, exposure: f64) -> Result<Vec<[f64; 2]>, CameraError> {
    let is_open = |digit: char| match digit {
        '0' => Some(false),
        '1' => Some(true),
        _ => None,
    };
    let chips: Option<Vec<bool>> = code.chars().map(is_open).collect();
    let Some(chips) = chips.filter(|chips| chips.len() <= MOST_INTERVALS) else {
        let why = format!("is no text of at most {MOST_INTERVALS} digits 1 (open) and 0 (closed)");
        return fault("code", why);
    };
    if !chips.contains(&true) {
        return fault("code", format!("\"{code}\" has no 1: the shutter has no open moment"));
    }
    let count = chips.len() as f64;
    let length = chip.map_or(exposure / count, |time| time.0);
    if !(length > 0.0 && length.is_finite()) {
        let why = format!(
            "a chip lasts {length} s\nhint: give `chip` a time above 0, or the shutter an `exposure`"
        );
        return fault(if chip.is_some() { "chip" } else { "code" }, why);
    }
    if length * count > exposure * (1.0 + ROUNDING) {
        let why = format!(
            "{count} chips of {length} s are longer than the exposure of {exposure} s\nhint: shorten `chip`"
        );
        return fault("code", why);
    }
    let mut open: Vec<[f64; 2]> = Vec::new();
    for (i, _) in chips.iter().enumerate().filter(|(_, is_open)| **is_open) {
        let (from, to) = (i as f64 * length, (i as f64 + 1.0) * length);
        match open.last_mut() {
            Some(last) if i > 0 && chips[i - 1] => last[1] = to,
            _ => open.push([from, to]),
        }
    }
    Ok(open)
}

impl Shutter {
    /// Exposure time of the first row (s).
    #[must_use]
    pub fn exposure(&self) -> f64 {
        self.exposure
    }

    /// From one row to the next that is read out (s); 0 when all are read together.
    #[must_use]
    pub fn line_time(&self) -> f64 {
        self.line_time
    }

    /// Kind of the shutter: which rows are open when.
    #[must_use]
    pub fn kind(&self) -> ShutterKind {
        self.kind
    }

    /// Direction in which rows are read out.
    #[must_use]
    pub fn readout(&self) -> Readout {
        self.readout
    }

    /// Moment of its row's exposure at which data layers see a pixel.
    #[must_use]
    pub fn truth_at(&self) -> TruthAt {
        self.truth_at
    }

    /// Returns the shutter with data layers that see another moment.
    pub(crate) fn with_truth_at(&self, truth_at: TruthAt) -> Self {
        Self { truth_at, ..self.clone() }
    }

    /// Returns the shutter for rows of the picture `factor` times as high.
    pub(crate) fn coarser(&self, factor: f64) -> Self {
        Self { coarse: self.coarse * factor, ..self.clone() }
    }

    /// Number of rows read out before a row of the picture, whose number may be a place between
    /// rows: 0.5 is the middle of the first.
    fn rows_before(&self, place: f64) -> f64 {
        let last = f64::from(self.rows) - 1.0;
        let row = place * self.coarse - 0.5;
        match self.readout {
            Readout::Down => row,
            Readout::Up => last - row,
        }
    }

    /// Times at which the row at a place (rows from the top edge) opens and closes (s).
    #[must_use]
    pub fn span(&self, place: f64) -> [f64; 2] {
        let lag = self.rows_before(place) * self.line_time;
        match self.kind {
            ShutterKind::Global => [0.0, self.exposure],
            ShutterKind::Rolling => [lag, lag + self.exposure],
            ShutterKind::GlobalReset => [0.0, lag + self.exposure],
        }
    }

    /// Times at which the first row opens and the last one closes (s).
    #[must_use]
    pub fn whole_span(&self) -> [f64; 2] {
        let edge = 0.5 / self.coarse;
        let rows = f64::from(self.rows) / self.coarse;
        let [first, last] = [self.span(edge), self.span(rows - edge)];
        [first[0].min(last[0]), first[1].max(last[1])]
    }

    /// The moment at which data layers see what is at a place (rows from the top edge) (s).
    #[must_use]
    pub fn truth(&self, place: f64) -> f64 {
        let [open, close] = self.span(place);
        match self.truth_at {
            TruthAt::Open => open,
            TruthAt::Middle => 0.5 * (open + close),
            TruthAt::Close => close,
        }
    }

    /// The moment (s) of the open time of the row at a place (rows from the top edge) by a number in 0..1 that is
    /// even in it.
    #[must_use]
    pub fn moment(&self, place: f64, share: f64) -> f64 {
        let [open, close] = self.span(place);
        let Some(last) = self.open.last() else { return open + share * (close - open) };
        let total = self.before[self.before.len() - 1] + (last[1] - last[0]);
        let elapsed = share * total;
        let k = self.before.partition_point(|&before| before <= elapsed).max(1) - 1;
        open + (self.open[k][0] + (elapsed - self.before[k])).min(self.open[k][1])
    }

    /// The intervals (s) in which the row at a place (rows from the top edge) is open: one without length of a shutter
    /// that sees an instant.
    #[must_use]
    pub fn open_intervals(&self, place: f64) -> Vec<[f64; 2]> {
        let [open, close] = self.span(place);
        match self.open.is_empty() {
            true => vec![[open, close]],
            false => self.open.iter().map(|part| part.map(|time| open + time)).collect(),
        }
    }

    /// The share of the exposure of the first row for which the row at a place (rows from the top edge) is open: what
    /// its light is multiplied by, so that a sensor that exposes for that time collects what comes through. 1 for an
    /// instant.
    #[must_use]
    pub fn open_share(&self, place: f64) -> f64 {
        if self.exposure <= 0.0 {
            return 1.0;
        }
        match self.open.last() {
            Some(last) => {
                (self.before[self.before.len() - 1] + (last[1] - last[0])) / self.exposure
            }
            None => {
                let [open, close] = self.span(place);
                match self.kind {
                    ShutterKind::Global | ShutterKind::Rolling => 1.0,
                    ShutterKind::GlobalReset => (close - open) / self.exposure,
                }
            }
        }
    }

    /// True if all rows get all of the light of the exposure.
    #[must_use]
    pub fn is_fully_open(&self) -> bool {
        let has_longer = self.kind == ShutterKind::GlobalReset && self.line_time > 0.0;
        self.exposure <= 0.0 || self.open.is_empty() && !has_longer
    }

    /// True if rows are seen at different moments.
    #[must_use]
    pub fn rows_differ(&self) -> bool {
        self.kind != ShutterKind::Global && self.line_time > 0.0
    }

    /// In words, for lists of decisions.
    #[must_use]
    pub fn words(&self) -> String {
        let what = match self.kind {
            ShutterKind::Global => "global".to_owned(),
            ShutterKind::Rolling => format!("rolling, {} us a row", 1e6 * self.line_time),
            ShutterKind::GlobalReset => format!("global reset, {} us a row", 1e6 * self.line_time),
        };
        let open = match self.open.len() {
            0 => String::new(),
            count => format!(", open in {count} intervals"),
        };
        format!("{what}, {} ms{open}", 1e3 * self.exposure)
    }
}
