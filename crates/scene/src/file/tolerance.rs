//! The error that a picture may have for the sake of time, as the scene file writes it.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};

use super::PlanSpec;

/// Errors that a picture may have: what is cheapest within them is taken of the camera's lens, of the detail of meshes,
/// and of the surfaces that light is followed to. Without it nothing is approximated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ToleranceSpec {
    /// Greatest displacement of places, blur and colours of the picture (pixels).
    pub displacement: DisplacementSpec,
    /// By which share the light may differ: of lenses, of the light on the axis; of bounces, of the light of 99 % of
    /// all blocks of 8 × 8 pixels.
    pub light: ShareSpec,
}

/// A number of pixels above 0: a number, or `"0.5 px"`.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Serialize)]
pub struct DisplacementSpec(
    /// Pixels.
    pub f64,
);

/// A share above 0 and below 1: a number, or `"2 %"`.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Serialize)]
pub struct ShareSpec(
    /// Of 1.
    pub f64,
);

/// A number, or words.
#[derive(Deserialize)]
#[serde(untagged)]
enum NumberOrWords {
    Number(f64),
    Words(String),
}

impl DisplacementSpec {
    /// Pixels from words such as `0.5 px`.
    ///
    /// # Errors
    ///
    /// When they are none, in words.
    pub fn from_words(text: &str) -> Result<Self, String> {
        let number = text.trim().strip_suffix("px").unwrap_or(text).trim().parse();
        number.map_err(|_| wrong_pixels()).and_then(Self::new)
    }

    fn new(pixels: f64) -> Result<Self, String> {
        (pixels > 0.0 && pixels.is_finite()).then_some(Self(pixels)).ok_or_else(wrong_pixels)
    }
}

impl ShareSpec {
    /// A share from words such as `2 %`.
    ///
    /// # Errors
    ///
    /// When they are none, in words.
    pub fn from_words(text: &str) -> Result<Self, String> {
        let percent = text.trim().strip_suffix('%').ok_or_else(wrong_share)?;
        let percent: f64 = percent.trim().parse().map_err(|_| wrong_share())?;
        Self::new(percent / 100.0)
    }

    fn new(share: f64) -> Result<Self, String> {
        (share > 0.0 && share < 1.0).then_some(Self(share)).ok_or_else(wrong_share)
    }
}

fn wrong_pixels() -> String {
    "is no number of pixels above 0, such as \"0.5 px\"\nhint: leave `tolerance` out for a picture without \
     approximations"
        .to_owned()
}

fn wrong_share() -> String {
    "is no share of the light above 0 and below 1, such as \"2 %\" or 0.02\nhint: leave `tolerance` out for a picture \
     without approximations"
        .to_owned()
}

impl<'de> Deserialize<'de> for DisplacementSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let read = match NumberOrWords::deserialize(deserializer)? {
            NumberOrWords::Number(pixels) => Self::new(pixels),
            NumberOrWords::Words(text) => Self::from_words(&text),
        };
        read.map_err(D::Error::custom)
    }
}

impl<'de> Deserialize<'de> for ShareSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let read = match NumberOrWords::deserialize(deserializer)? {
            NumberOrWords::Number(share) => Self::new(share),
            NumberOrWords::Words(text) => Self::from_words(&text),
        };
        read.map_err(D::Error::custom)
    }
}

impl JsonSchema for DisplacementSpec {
    fn schema_name() -> Cow<'static, str> {
        "Displacement".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A number of pixels above 0, or such a number with its unit: \"0.5 px\".",
            "anyOf": [
                { "type": "number", "exclusiveMinimum": 0 },
                { "type": "string", "pattern": "^\\s*[0-9.eE+-]+\\s*(px)?\\s*$" },
            ],
        })
    }
}

impl JsonSchema for ShareSpec {
    fn schema_name() -> Cow<'static, str> {
        "Share".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A share above 0 and below 1, or as many hundredths: \"2 %\".",
            "anyOf": [
                { "type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1 },
                { "type": "string", "pattern": "^\\s*[0-9.eE+-]+\\s*%\\s*$" },
            ],
        })
    }
}

impl ToleranceSpec {
    /// Contradiction with the tolerance: the path, and why.
    pub(super) fn contradiction(
        plan: &PlanSpec,
        has_slots: bool,
    ) -> Option<(&'static str, String)> {
        if plan.dispersion == Some(true) {
            let why = "contradicts `tolerance`, which decides whether rays of all bands run together\nhint: leave one of \
                       them out";
            return Some(("plan.dispersion", why.to_owned()));
        }
        has_slots.then(|| {
            let why =
                "is of one camera, and the slots of `serial` have one each\nhint: leave one of them out";
            ("tolerance", why.to_owned())
        })
    }
}
