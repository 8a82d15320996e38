//! Parts of real chips and of their electronics, as a scene file writes them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::SensorError;

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
    pub(crate) fn check(self) -> Result<(), SensorError> {
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

    pub(crate) fn check(self) -> Result<(), SensorError> {
        if let Self::SplitPixel { ratio, .. } = self {
            let demand = "a share above 0 and below 1: two photodiodes of one sensitivity see no more than one";
            let inside = ratio > 0.0 && ratio < 1.0;
            SensorError::unless(inside, "second_readout.ratio", ratio, demand)?;
        }
        Ok(())
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

    pub(crate) fn check(&self) -> Result<(), SensorError> {
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

#[cfg(test)]
mod tests {
    use super::*;

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
