//! `serial`: the slots of one exposure, as the file writes them.

use std::collections::BTreeMap;

use etendue_geometry::units::Seconds;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// A part of the exposure, with what is set for it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SlotSpec {
    /// When it starts (s from its row's opening); when the slot before it ends, if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<Seconds>,
    /// How long it lasts (s); when absent, an equal share of what slots with durations leave of the exposure.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub duration: Option<Seconds>,
    /// What each pixel takes of the slot's light, 0 to 1; all of it when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pixels: Option<PixelsSpec>,
    /// What is set for it: paths of `camera`, `lights`, `objects` or `materials` and their values, as
    /// `{"camera.pose": …}`. The sensor and the shutter are those of the exposure.
    pub set: BTreeMap<String, Value>,
}

/// What each pixel takes of a slot's light.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum PixelsSpec {
    /// A grey picture (PNG or EXR) of the sensor's columns and rows, relative to the scene file.
    File(String),
    /// Rows of a tile that is repeated over the sensor from its top left pixel on.
    Tile(Vec<Vec<f64>>),
}
