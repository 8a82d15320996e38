//! `render.imu`: the inertial unit on the camera, as the file writes it.

use etendue_camera::Convention;
use etendue_geometry::units::Seconds;
use etendue_sensor::InertialNoiseSpec;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The highest rate (Hz).
const FASTEST: f64 = 1e6;

/// The most readings of a picture, and the highest number of one.
const MOST: f64 = 1e8;

/// Readings of an inertial unit on the camera while it moves: `imu.csv` beside the picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImuSpec {
    /// Readings a second (Hz). They are taken at whole numbers over the rate, in the scene's clock.
    pub rate: f64,
    /// From when on there are readings (s, in the scene's clock); the frame's time when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<Seconds>,
    /// Until when, itself excluded; when absent the next frame's time by `render.rate`, or else the moment at which the
    /// last row closes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<Seconds>,
    /// Its axes: those of the camera in this convention.
    #[serde(default = "opencv")]
    pub convention: Convention,
    /// Its place (m, from the camera's origin along its axes).
    #[serde(default)]
    pub at: [f64; 3],
    /// The acceleration of what falls (m/s², in the world).
    #[serde(default = "standard_gravity")]
    pub gravity: [f64; 3],
    /// Its errors; none when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<InertialNoiseSpec>,
}

fn opencv() -> Convention {
    Convention::Opencv
}

/// Standard gravity (3rd CGPM, 1901), where +Y is up.
fn standard_gravity() -> [f64; 3] {
    [0.0, -9.806_65, 0.0]
}

impl ImuSpec {
    /// The first key whose value makes no sense, below `render.imu`, and why.
    pub(crate) fn fault(&self) -> Option<(String, String)> {
        let fault = |key: &str, why: String| Some((key.to_owned(), why));
        if !(self.rate > 0.0 && self.rate <= FASTEST) {
            let why = format!(
                "{} readings a second\nhint: give a number above 0, and at most {FASTEST}",
                self.rate
            );
            return fault("rate", why);
        }
        for (key, time) in [("from", self.from), ("to", self.to)] {
            if let Some(Seconds(time)) = time
                && !(time.is_finite() && (time * self.rate).abs() <= MOST)
            {
                let why = format!(
                    "{time} s is reading {} of a clock that has {MOST} at most",
                    time * self.rate
                );
                return fault(key, why);
            }
        }
        if let (Some(Seconds(from)), Some(Seconds(to))) = (self.from, self.to)
            && to <= from
        {
            return fault("to", format!("{to} s is not after `from`, {from} s"));
        }
        for (key, vector) in [("at", self.at), ("gravity", self.gravity)] {
            if vector.iter().any(|number| !number.is_finite()) {
                return fault(key, "is not finite".to_owned());
            }
        }
        let key = self.noise.as_ref()?.fault()?;
        fault(
            &format!("noise.{key}"),
            "is not finite, or below zero where it may not be".to_owned(),
        )
    }

    /// The numbers of its readings from `from` (s) until before `to` (s): reading k is at k over the rate.
    #[must_use]
    pub fn numbers(&self, [from, to]: [f64; 2]) -> std::ops::Range<i64> {
        #[expect(clippy::cast_possible_truncation, reason = "at most 1e8, held above")]
        let number = |time: f64| {
            let place = (time * self.rate).clamp(-MOST, MOST);
            // A time that is a whole number but for rounding is that reading's.
            let whole = place.round();
            (if (place - whole).abs() < 1e-9 * whole.abs().max(1.0) { whole } else { place.ceil() })
                as i64
        };
        number(from)..number(to)
    }
}
