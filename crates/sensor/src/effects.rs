//! Parts of real chips and of their electronics, as a scene file writes them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{SensorError, SensorSpec};

/// The most pixels that a map of defects lists.
const MOST_DEFECTS: usize = 10_000_000;

/// The exposure time that brings a share of the pixels to a share of saturation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AutoExposure {
    /// The percentile of the pixels that is metered, each by its brightest channel (above 0, up to 100).
    pub percentile: f64,
    /// The share of saturation that it reaches, dark signal included (above 0, up to 1).
    pub target: f64,
    /// Meter every frame of a sequence by itself; else all have the exposure of the first.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub each_frame: bool,
}

impl AutoExposure {
    fn check(self) -> Result<(), SensorError> {
        let Self { percentile, target, .. } = self;
        let demand = "a percentile above 0, up to 100";
        let inside = percentile > 0.0 && percentile <= 100.0;
        SensorError::unless(inside, "auto_exposure.percentile", percentile, demand)?;
        let demand = "a share of saturation above 0, up to 1";
        let inside = target > 0.0 && target <= 1.0;
        SensorError::unless(inside, "auto_exposure.target", target, demand)
    }
}

/// Pixels with which something is wrong, one by one.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum DefectMap {
    /// A picture of the sensor's columns and rows, PNG (8 or 16 bits) or NPY (integers), relative to the file that names
    /// it: 0 is a good pixel, 1 a hot, 2 a dead and 3 a stuck one.
    File(String),
    /// The list of them, as `sensor.json` has it.
    List(Vec<ListedDefect>),
}

/// Fault of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Defect {
    /// It has much more dark current than others.
    Hot,
    /// It collects no electrons.
    Dead,
    /// It is always saturated.
    Stuck,
}

/// A pixel with which something is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ListedDefect {
    /// Its column, from 0.
    pub column: u32,
    /// Its row, from 0.
    pub row: u32,
    /// Its channel, of an image of several; all of them when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub channel: Option<u16>,
    /// Its fault.
    pub kind: Defect,
}

impl DefectMap {
    /// The list of a map that is a picture: its numbers by rows, of so many columns.
    ///
    /// # Errors
    ///
    /// When a number says of no defect; the message tells which and where.
    pub fn of_numbers(
        numbers: impl Iterator<Item = f64>,
        columns: usize,
    ) -> Result<Vec<ListedDefect>, String> {
        let mut list = Vec::new();
        for (place, number) in numbers.enumerate() {
            let [column, row] = [place % columns.max(1), place / columns.max(1)];
            let kind = match number {
                0.0 => continue,
                1.0 => Defect::Hot,
                2.0 => Defect::Dead,
                3.0 => Defect::Stuck,
                _ => {
                    return Err(format!(
                        "has the number {number} at column {column}, row {row}: 0 is a good pixel, 1 a hot, 2 a \
                         dead and 3 a stuck one"
                    ));
                }
            };
            #[expect(clippy::cast_possible_truncation, reason = "a side of an image")]
            let [column, row] = [column as u32, row as u32];
            list.push(ListedDefect { column, row, channel: None, kind });
        }
        Ok(list)
    }
}

/// Into what a pixel is divided under its on-chip lens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Photodiodes {
    /// A left and a right one.
    Dual,
    /// Two by two.
    Quad,
}

/// A second number of each pixel, beside the first and of the same exposure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum SecondReadout {
    /// The same electrons, read again at another gain (dual conversion gain).
    DualGain {
        /// K of the second reading (DN/e⁻, > 0).
        system_gain: f64,
        /// Its noise (e⁻, ≥ 0; default: the first's).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        read_noise: Option<f64>,
        /// Electrons that it can read (e⁻, > 0; default: the first's).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        full_well: Option<f64>,
        /// Reading of no light (DN; default: the first's).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        black_level: Option<f64>,
    },
    /// A photodiode of its own, smaller than the first.
    SplitPixel {
        /// Its sensitivity as a share of the first's (above 0, below 1).
        ratio: f64,
        /// K of it (DN/e⁻, > 0; default: the first's).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        system_gain: Option<f64>,
        /// Noise of its read-out (e⁻, ≥ 0; default: the first's).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        read_noise: Option<f64>,
        /// Electrons that it holds (e⁻, > 0; default: the first's).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        full_well: Option<f64>,
        /// Its dark current (e⁻/s, ≥ 0; default: `ratio` of the first's).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        dark_current: Option<f64>,
    },
}

impl SecondReadout {
    /// The ratio of a split pixel; 1 of one photodiode.
    #[must_use]
    pub fn ratio(&self) -> f64 {
        match self {
            Self::DualGain { .. } => 1.0,
            Self::SplitPixel { ratio, .. } => *ratio,
        }
    }

    fn check(self) -> Result<(), SensorError> {
        if let Self::SplitPixel { ratio, .. } = self {
            let demand = "a share above 0 and below 1: two photodiodes of one sensitivity see no more than one";
            let inside = ratio > 0.0 && ratio < 1.0;
            SensorError::unless(inside, "second_readout.ratio", ratio, demand)?;
        }
        Ok(())
    }

    /// The spec of a sensor that is this reading alone.
    pub(crate) fn spec_of(self, first: &SensorSpec) -> SensorSpec {
        let mut spec = SensorSpec {
            second_readout: None,
            hdr: None,
            iso_settings: None,
            iso: None,
            analog_gain: None,
            ..first.clone()
        };
        match self {
            Self::DualGain { system_gain, read_noise, full_well, black_level } => {
                spec.system_gain = Some(system_gain);
                spec.read_noise = read_noise.or(first.read_noise);
                spec.full_well = full_well.or(first.full_well);
                spec.black_level = black_level.or(first.black_level);
            }
            Self::SplitPixel { system_gain, read_noise, full_well, .. } => {
                spec.system_gain = system_gain.or(first.system_gain);
                spec.read_noise = read_noise.or(first.read_noise);
                spec.full_well = full_well.or(first.full_well);
            }
        }
        spec
    }
}

/// The sensitivity of pixels against the angle of their light.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AngularResponse {
    /// Points `[degrees, share]`, ascending from 0 degrees: the quantum efficiency at that angle of the chief ray, as a
    /// share (0..=1) of what `quantum_efficiency` says. Beyond the last point the curve stays as it ends.
    pub curve: Vec<[f64; 2]>,
    /// On-chip lenses are shifted for a chief ray of this angle at the corner of the sensor (degrees, ≥ 0), and in
    /// proportion elsewhere; centred (0) when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lens_shift: Option<f64>,
}

impl AngularResponse {
    /// The share that pixels see whose chief ray has this angle (degrees), at this share of the way from the centre of
    /// the sensor to its corner.
    #[must_use]
    pub fn at(&self, angle: f64, height: f64) -> f64 {
        let turned = angle - self.lens_shift.unwrap_or(0.0) * height;
        joined(&self.curve, turned.abs())
    }

    fn check(&self) -> Result<(), SensorError> {
        let key = "angular_response.curve";
        if self.curve.is_empty() {
            return Err(SensorError::missing(key, "give points [degrees, share]"));
        }
        let first = self.curve[0][0];
        SensorError::unless(first == 0.0, key, first, "points that begin at 0 degrees")?;
        ascending(&self.curve, 90.0).map_err(|[x, _]| SensorError::Value {
            key,
            value: x,
            demand: "angles that ascend, up to 90 degrees",
        })?;
        if let Some([_, share]) = self.curve.iter().find(|[_, y]| !(0.0..=1.0).contains(y)) {
            let demand = "shares in 0..=1: no light is seen twice";
            return Err(SensorError::Value { key, value: *share, demand });
        }
        let shift = self.lens_shift.unwrap_or(0.0);
        let demand = "degrees, 0 or more, below 90";
        SensorError::unless(
            (0.0..90.0).contains(&shift),
            "angular_response.lens_shift",
            shift,
            demand,
        )
    }
}

/// A curve of straight lines through points, held beyond both ends.
pub(crate) fn joined(points: &[[f64; 2]], x: f64) -> f64 {
    let after = points.partition_point(|point| point[0] <= x);
    match (points.get(after.wrapping_sub(1)), points.get(after)) {
        (Some([a, from]), Some([b, to])) => from + (to - from) * (x - a) / (b - a),
        (Some([_, end]), None) | (None, Some([_, end])) => *end,
        (None, None) => 1.0,
    }
}

/// The point that does not lie behind the one before it, or beyond `last`.
fn ascending(points: &[[f64; 2]], last: f64) -> Result<(), [f64; 2]> {
    let mut before = f64::NEG_INFINITY;
    for point in points {
        if !(point[0] > before && point[0] <= last) {
            return Err(*point);
        }
        before = point[0];
    }
    Ok(())
}

/// Non-linearity near saturation: the charge that is read of what was collected, in shares of the full well.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Nonlinearity {
    /// `[collected, read]`, from `[0, 0]` to 1 collected.
    points: Vec<[f64; 2]>,
}

impl Nonlinearity {
    fn new(points: &[[f64; 2]]) -> Result<Self, SensorError> {
        let key = "nonlinearity";
        let value = |value, demand| SensorError::Value { key, value, demand };
        let last = points.last().map_or(0.0, |point| point[0]);
        if last != 1.0 {
            return Err(value(
                last,
                "points [collected, read] as shares of the full well, up to 1 collected",
            ));
        }
        let mut all = vec![[0.0; 2]];
        for &[collected, read] in points.iter().filter(|point| **point != [0.0; 2]) {
            let [before, below] = all[all.len() - 1];
            if !(collected > before && collected <= 1.0) {
                return Err(value(collected, "shares collected that ascend from 0 to 1"));
            }
            if !(read > below && read <= 2.0) {
                return Err(value(
                    read,
                    "shares read that ascend: two signals of one number cannot be told apart",
                ));
            }
            all.push([collected, read]);
        }
        Ok(Self { points: all })
    }

    /// The share read of a share collected.
    pub(crate) fn read(&self, collected: f64) -> f64 {
        // Below 0 as the first line goes on.
        match collected < 0.0 {
            true => collected * self.slope(0.0),
            false => joined(&self.points, collected),
        }
    }

    /// The share collected of which a share was read.
    pub(crate) fn collected(&self, read: f64) -> f64 {
        let turned: Vec<[f64; 2]> = self.points.iter().map(|[x, y]| [*y, *x]).collect();
        match read < 0.0 {
            true => read / self.slope(0.0),
            false => joined(&turned, read),
        }
    }

    /// The slope of the line on which a share collected lies.
    pub(crate) fn slope(&self, collected: f64) -> f64 {
        let after = self.points.partition_point(|point| point[0] <= collected);
        let after = after.clamp(1, self.points.len() - 1);
        let [[a, from], [b, to]] = [self.points[after - 1], self.points[after]];
        (to - from) / (b - a)
    }
}

/// Effects that a sensor has of those in this module, checked.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Effects {
    pub(crate) nonlinearity: Option<Nonlinearity>,
    /// Share of the charge above the full well that flows into neighbours of the column.
    pub(crate) blooming: f64,
    /// Signal of smear, as a share of that of an area a tenth of the picture high.
    pub(crate) smear: f64,
    /// By rows, columns and channels.
    pub(crate) listed: Vec<ListedDefect>,
    /// Standard deviation of the way that carriers diffuse (µm).
    pub(crate) diffusion: f64,
}

impl Effects {
    /// Of a sensor of these columns and rows, with this full well (e⁻, +inf for none).
    pub(crate) fn new(
        spec: &SensorSpec,
        [columns, rows]: [u32; 2],
        full_well: f64,
    ) -> Result<Self, SensorError> {
        let share = |key, value: Option<f64>| {
            let value = value.unwrap_or(0.0);
            let inside = (0.0..=1.0).contains(&value);
            SensorError::unless(inside, key, value, "a fraction in 0..=1").map(|()| value)
        };
        let of_a_well =
            spec.nonlinearity.is_some() || spec.blooming.is_some_and(|share| share > 0.0);
        if of_a_well && full_well.is_infinite() {
            let why = "nonlinearity and blooming count from the electrons that a pixel holds";
            return Err(SensorError::missing("full_well", why));
        }
        let nonlinearity = spec.nonlinearity.as_deref().map(Nonlinearity::new).transpose()?;
        let diffusion = spec.carrier_diffusion.map_or(0.0, |length| length.0);
        let demand = "micrometres, 0 or more, up to 1000";
        SensorError::unless(
            (0.0..=1000.0).contains(&diffusion),
            "carrier_diffusion",
            diffusion,
            demand,
        )?;
        if let Some(metering) = spec.auto_exposure {
            metering.check()?;
        }
        if let Some(second) = spec.second_readout {
            second.check()?;
        }
        if let Some(response) = &spec.angular_response {
            response.check()?;
        }
        let mut listed = match &spec.defect_map {
            None => Vec::new(),
            Some(DefectMap::List(list)) => list.clone(),
            Some(DefectMap::File(_)) => {
                let why = "files are read where the scene is\nhint: give the list of pixels";
                return Err(SensorError::misplaced("defect_map", why));
            }
        };
        let count = listed.len();
        let demand = "ten million pixels at most";
        SensorError::unless(count <= MOST_DEFECTS, "defect_map", count as f64, demand)?;
        for at in &listed {
            let demand = "columns of the sensor";
            SensorError::unless(at.column < columns, "defect_map", f64::from(at.column), demand)?;
            SensorError::unless(
                at.row < rows,
                "defect_map",
                f64::from(at.row),
                "rows of the sensor",
            )?;
            if at.kind == Defect::Hot && spec.hot_pixels.is_none() {
                let why = "the map has hot pixels, and nobody says how hot they are: give { \"share\": 0, \
                           \"dark_current\": 50 } (e⁻/s)";
                return Err(SensorError::missing("hot_pixels", why));
            }
        }
        let place = |at: &ListedDefect| (at.row, at.column, at.channel);
        listed.sort_by_key(place);
        if let Some(twice) = listed.windows(2).find(|pair| place(&pair[0]) == place(&pair[1])) {
            let column = f64::from(twice[0].column);
            SensorError::unless(false, "defect_map", column, "the column of each pixel once")?;
        }
        Ok(Self {
            nonlinearity,
            blooming: share("blooming", spec.blooming)?,
            smear: share("smear", spec.smear)?,
            listed,
            diffusion,
        })
    }

    /// The listed defects of a row's pixels from one column to before another, in a channel.
    pub(crate) fn listed_in(
        &self,
        row: u32,
        columns: std::ops::Range<u32>,
        channel: u16,
    ) -> impl Iterator<Item = &ListedDefect> {
        let before = |at: &ListedDefect| (at.row, at.column) < (row, columns.start);
        let from = self.listed.partition_point(before);
        let end = columns.end;
        self.listed[from..]
            .iter()
            .take_while(move |at| at.row == row && at.column < end)
            .filter(move |at| at.channel.is_none_or(|own| own == channel))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_of_saturation_is_its_own_inverse() {
        let curve = Nonlinearity::new(&[[0.8, 0.8], [0.9, 0.88], [1.0, 0.93]]).unwrap();
        for k in -2..=20 {
            let share = f64::from(k) / 20.0;
            // Three roundings.
            assert!((curve.collected(curve.read(share)) - share).abs() < 1e-14, "{share}");
        }
        assert_eq!((curve.read(0.5), curve.read(1.5)), (0.5, 0.93));
        assert!((curve.slope(0.85) - 0.8).abs() < 1e-12 && (curve.slope(1.0) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn shifted_lenses_move_the_curve() {
        let response = AngularResponse {
            curve: vec![[0.0, 1.0], [10.0, 0.9], [30.0, 0.5]],
            lens_shift: Some(20.0),
        };
        assert_eq!(response.at(0.0, 0.0), 1.0);
        assert_eq!(response.at(20.0, 1.0), 1.0);
        // Ten degrees from the design, on either side.
        assert!((response.at(10.0, 1.0) - 0.9).abs() < 1e-15);
        assert!((response.at(20.0, 0.5) - 0.9).abs() < 1e-15);
        assert_eq!(AngularResponse { lens_shift: None, ..response }.at(50.0, 1.0), 0.5);
    }
}
