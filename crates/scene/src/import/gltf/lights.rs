//! Lights (`KHR_lights_punctual`).
//!
//! The extension gives candela and lux. A picture's full scale is radiance 1, so one candela is taken
//! for intensity 1 and one lux for irradiance 1: parallel light of π lx makes a white wall 1.

use std::f64::consts::FRAC_PI_4;
use std::path::Path;

use etendue_geometry::glam::DVec3;
use etendue_tracer::spec::BRIGHTEST;
use etendue_tracer::{Light, LightKind};
use serde::Deserialize;
use serde_json::Value;

use super::document::{GltfDocument, GltfNode};
use crate::file::{ScenePath, read_value};
use crate::import::Refusal;
use crate::import::error::{self, Note, NoteKind, damaged};
use crate::words::kind_of;

const NAME: &str = "KHR_lights_punctual";

#[derive(Debug, Deserialize)]
struct WrittenLight {
    #[serde(rename = "type")]
    kind: String,
    #[serde(default = "white")]
    color: [f64; 3],
    #[serde(default = "one")]
    intensity: f64,
    #[serde(default)]
    name: Option<String>,
    #[serde(default)]
    spot: Option<LightCone>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct LightCone {
    #[serde(default)]
    inner_cone_angle: f64,
    #[serde(default = "eighth_turn")]
    outer_cone_angle: f64,
}

fn white() -> [f64; 3] {
    [1.0; 3]
}

fn one() -> f64 {
    1.0
}

fn eighth_turn() -> f64 {
    FRAC_PI_4
}

/// Light `number` of the document.
fn read(path: &Path, number: &Value, value: &Value) -> Result<WrittenLight, Refusal> {
    let place = format!("extensions.{NAME}.lights[{number}]");
    if !value.is_object() {
        let reason =
            format!("expected an object, found {}\nhint: export the file again", kind_of(value));
        return Err(damaged(path, place, reason));
    }
    read_value(value)
        .map_err(|(inside, why)| damaged(path, ScenePath::of(&place).join(inside), why))
}

/// The light of a node, at the origin of its frame; `None` when it has none, or a dark one.
pub(super) fn placed(
    path: &Path,
    document: &GltfDocument,
    node: &GltfNode,
    index: usize,
    notes: &mut Vec<Note>,
) -> Result<Option<Light>, Refusal> {
    let Some(number) = node.extensions.get(NAME).and_then(|e| e.get("light")) else {
        return Ok(None);
    };
    let place = || format!("nodes[{index}].extensions.{NAME}");
    let all = document.root.extensions.as_ref().and_then(|e| e.others.get(NAME));
    let all = all.and_then(|e| e.get("lights")).and_then(Value::as_array);
    let found = number.as_u64().and_then(|n| usize::try_from(n).ok());
    let Some(value) = found.and_then(|n| all?.get(n)) else {
        let reason = format!(
            "there is no light {number}; the file has {}\nhint: export it again",
            all.map_or(0, Vec::len)
        );
        return Err(damaged(path, place() + ".light", reason));
    };
    let written = read(path, number, value)?;
    let color = written.color.map(|c| c * written.intensity);
    let named = written.name.clone().unwrap_or_else(place);
    if !color.iter().all(|c| (0.0..=BRIGHTEST).contains(c)) {
        let message =
            "its colour or intensity is below zero, not finite or above 1e30; it is left out";
        error::push(notes, Note::new(NoteKind::NotFinite, named, message));
        return Ok(None);
    }
    if color == [0.0; 3] {
        let message = "the light has no power; it is left out";
        error::push(notes, Note::new(NoteKind::Unused, named, message));
        return Ok(None);
    }
    let kind = match (written.kind.as_str(), written.spot) {
        ("point", _) => LightKind::Point(DVec3::ZERO),
        ("directional", _) => {
            LightKind::Directional { along: DVec3::NEG_Z, cos_radius: 1.0, visible: false }
        }
        ("spot", Some(cone)) => LightKind::Spot {
            at: DVec3::ZERO,
            axis: DVec3::NEG_Z,
            cos_outer: cone.outer_cone_angle.cos(),
            cos_inner: cone.inner_cone_angle.min(cone.outer_cone_angle).cos(),
        },
        ("spot", None) => {
            let reason = "a spot light without `spot`, its cones; export the file again";
            return Err(damaged(path, place(), reason));
        }
        (other, _) => {
            let reason =
                format!("a light of type \"{other}\" is none of `point`, `spot` and `directional`");
            return Err(damaged(path, place(), reason));
        }
    };
    Ok(Some(Light::steady(kind, color)))
}
