//! A decision: what, how, why, what it saves, and by which key it is decided otherwise.

use std::borrow::Cow;
use std::fmt;

use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

use crate::{Cell, Size, Span, Table};

/// The subject of a decision.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DecisionKind {
    /// The number of rays.
    Rays,
    /// Samples a pixel.
    Samples,
    /// Passes over the film.
    Passes,
    /// Bands of wavelengths that light is rendered in.
    Wavelengths,
    /// Exposure by a sensor.
    Sensor,
    /// The shutter, and whether rays have times.
    Shutter,
    /// Denoising of the picture.
    Denoising,
    /// Tolerance of the picture's errors, and what is taken of it.
    Tolerance,
    /// Rays of each band's own.
    RaysOfBands,
    /// Paths through the scene that bands of a lens share.
    PathsOfBands,
    /// Rays spread over a pupil.
    Pupil,
    /// Light spread as waves are.
    Diffraction,
    /// The surfaces up to which light is followed.
    Bounces,
    /// Normals and places on triangles of hits.
    Surface,
    /// Shading normals of models.
    VertexNormals,
    /// The number of lights.
    Lights,
    /// Materials and their images.
    Textures,
    /// The filter of images.
    TextureFilter,
    /// Surfaces that are built.
    Geometry,
    /// Build time against traversal speed.
    BuildQuality,
    /// Hits solved again in f64.
    Refinement,
    /// Bits of data layers.
    DataLayers,
    /// Bits that paths of light are traced in.
    LightPaths,
    /// Bits that samples of colours are traced in.
    SampledHits,
    /// A number of the scene's that trades accuracy for speed.
    Accuracy,
    /// The forecast of memory.
    Memory,
    /// The forecast of time.
    Time,
    /// The number of pictures.
    Frames,
}

impl DecisionKind {
    /// Its name, and the path of the scene file or the option that decides it.
    fn row(self) -> (&'static str, Option<&'static str>) {
        match self {
            Self::Rays => ("rays", None),
            Self::Samples => ("samples", Some("render.samples")),
            Self::Passes => ("passes", None),
            Self::Wavelengths => ("wavelengths", None),
            Self::Sensor => ("sensor", None),
            Self::Shutter => ("shutter", Some("camera.shutter")),
            Self::Denoising => ("denoising", None),
            Self::Tolerance => ("tolerance", Some("tolerance")),
            Self::RaysOfBands => ("rays of a wavelength", Some("plan.dispersion")),
            Self::PathsOfBands => ("paths of a band", Some("plan.shared_paths")),
            Self::Pupil => ("pupil", None),
            Self::Diffraction => ("diffraction", Some("camera.diffraction")),
            Self::Bounces => ("shadows and bounces", None),
            Self::Surface => ("surface", None),
            Self::VertexNormals => ("vertex normals", None),
            Self::Lights => ("lights", None),
            Self::Textures => ("materials and textures", Some("plan.textures")),
            Self::TextureFilter => ("texture filter", Some("plan.texture_filter")),
            Self::Geometry => ("surfaces", Some("plan.unseen")),
            Self::BuildQuality => ("build quality", Some("plan.build_quality")),
            Self::Refinement => ("refinement", Some("plan.refine")),
            Self::DataLayers => ("data layers", Some("--outputs")),
            Self::LightPaths => ("light paths", Some("plan.light_precision")),
            Self::SampledHits => ("sampled hits", Some("plan.light_precision")),
            Self::Accuracy => ("accuracy", Some("accuracy")),
            Self::Memory => ("memory", None),
            Self::Time => ("time", None),
            Self::Frames => ("frames", None),
        }
    }

    /// Its name in lists.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.row().0
    }

    /// The path of the scene file, or the option, that decides it.
    #[must_use]
    pub fn key(self) -> Option<&'static str> {
        self.row().1
    }
}

/// The value of a decision.
#[derive(Debug, Clone, PartialEq)]
pub enum DecisionValue {
    /// On or off.
    Switch(bool),
    /// A number of things.
    Count(u64),
    /// Numbers of so many bits.
    Bits(u32),
    /// A forecast of memory (bytes).
    Bytes(u64),
    /// A forecast of time (s).
    Seconds(f64),
    /// A number that has a name.
    Number {
        /// The name.
        name: &'static str,
        /// The number.
        value: f64,
    },
    /// One of a few words, or several.
    Words(Cow<'static, str>),
}

impl From<&'static str> for DecisionValue {
    fn from(words: &'static str) -> Self {
        Self::Words(words.into())
    }
}

impl From<String> for DecisionValue {
    fn from(words: String) -> Self {
        Self::Words(words.into())
    }
}

impl fmt::Display for DecisionValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Switch(true) => f.write_str("on"),
            Self::Switch(false) => f.write_str("off"),
            Self::Count(count) => write!(f, "{count}"),
            Self::Bits(bits) => write!(f, "{bits} bits"),
            Self::Bytes(bytes) => write!(f, "about {}", Size(*bytes)),
            Self::Seconds(seconds) => write!(f, "{}", Span(*seconds)),
            Self::Number { name, value } => write!(f, "{name} {value}"),
            Self::Words(words) => f.write_str(words),
        }
    }
}

/// The value for programs: true or false, a count, bits, bytes, seconds, a number, or the words.
impl Serialize for DecisionValue {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Switch(on) => serializer.serialize_bool(*on),
            Self::Count(count) | Self::Bytes(count) => serializer.serialize_u64(*count),
            Self::Bits(bits) => serializer.serialize_u32(*bits),
            Self::Seconds(value) | Self::Number { value, .. } => serializer.serialize_f64(*value),
            Self::Words(words) => serializer.serialize_str(words),
        }
    }
}

/// The saving of a decision beside the fullest choice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Saving {
    /// Bytes of memory.
    pub bytes: u64,
    /// Of so many images, where it is images that are left out.
    pub images: Option<usize>,
}

impl fmt::Display for Saving {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.images {
            Some(images) => write!(f, "{} of {images} images", Size(self.bytes)),
            None => write!(f, "{}", Size(self.bytes)),
        }
    }
}

/// A decision.
#[derive(Debug, Clone, PartialEq)]
pub struct Decision {
    /// The subject.
    pub kind: DecisionKind,
    /// The choice.
    pub value: DecisionValue,
    /// The reason.
    pub reason: String,
    /// The saving, counted; `None` where that has no number before the render.
    pub saving: Option<Saving>,
    /// The path of the scene file, or the option, that decides it otherwise.
    pub key: Option<&'static str>,
    /// A decision of the scene's, not the program's.
    pub is_forced: bool,
}

impl Decision {
    /// A decision that the program makes by itself.
    pub fn new(
        kind: DecisionKind,
        value: impl Into<DecisionValue>,
        reason: impl Into<String>,
    ) -> Self {
        let key = kind.key();
        let (value, reason) = (value.into(), reason.into());
        Self { kind, value, reason, saving: None, key, is_forced: false }
    }

    /// Marks the decision as made by the scene's key where `is_forced`.
    #[must_use]
    pub fn forced(self, is_forced: bool) -> Self {
        Self { is_forced, ..self }
    }

    /// Returns the decision with another key.
    #[must_use]
    pub fn by_key(self, key: &'static str) -> Self {
        Self { key: Some(key), ..self }
    }

    /// Returns the decision with what it saves.
    #[must_use]
    pub fn saving(self, saving: Option<Saving>) -> Self {
        Self { saving, ..self }
    }
}

/// The keys of `etendue plan --json`.
impl Serialize for Decision {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut row = serializer.serialize_struct("Decision", 8)?;
        row.serialize_field("what", self.kind.name())?;
        row.serialize_field("choice", &self.value.to_string())?;
        row.serialize_field("value", &self.value)?;
        row.serialize_field("because", &self.reason)?;
        row.serialize_field("saves", &self.saving.map(|saving| saving.to_string()))?;
        row.serialize_field("saved_bytes", &self.saving.map(|saving| saving.bytes))?;
        row.serialize_field("key", &self.key)?;
        row.serialize_field("forced", &self.is_forced)?;
        row.end()
    }
}

/// Decisions as tables.
#[derive(Debug, Clone, Copy)]
pub struct Tabled<'a>(
    /// The decisions, in their order.
    pub &'a [Decision],
);

impl Tabled<'_> {
    /// A line each, for a terminal.
    #[must_use]
    pub fn text(&self) -> String {
        let mut table = Table::default();
        for Decision { kind, value, reason, saving, key, is_forced } in self.0 {
            let saves = saving.map_or_else(String::new, |saving| format!("; saves {saving}"));
            let by = match key {
                Some(key) if *is_forced => format!(" [forced by {key}]"),
                Some(key) => format!(" [{key}]"),
                None => String::new(),
            };
            let words = [kind.name().to_owned(), value.to_string(), format!("{reason}{saves}{by}")];
            table.push(words.map(Cell::word));
        }
        table.text()
    }

    /// A table of GitHub's Markdown.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut table = Table::new(&["what", "choice", "because", "saves", "key"]);
        for decision in self.0 {
            let key = decision.key.map_or_else(String::new, |key| format!("`{key}`"));
            let saves = decision.saving.map_or_else(String::new, |saving| saving.to_string());
            let value = decision.value.to_string();
            let words =
                [decision.kind.name().to_owned(), value, decision.reason.clone(), saves, key];
            table.push(words.map(Cell::word));
        }
        table.markdown()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decisions() -> [Decision; 4] {
        let left_out = Saving { bytes: 3 << 20, images: Some(2) };
        [
            Decision::new(DecisionKind::Textures, DecisionValue::Switch(false), "no layer")
                .saving(Some(left_out)),
            Decision::new(DecisionKind::BuildQuality, "high", "the scene says so").forced(true),
            Decision::new(DecisionKind::Memory, DecisionValue::Bytes(1 << 20), "all"),
            Decision::new(
                DecisionKind::Accuracy,
                DecisionValue::Number { name: "noise", value: 0.1 },
                "set",
            ),
        ]
    }

    #[test]
    fn all_forms_are_of_the_same_rows() {
        let decisions = decisions();
        assert_eq!(
            Tabled(&decisions).text(),
            "materials and textures  off            no layer; saves 3.0 MiB of 2 images [plan.textures]\n\
             build quality           high           the scene says so [forced by plan.build_quality]\n\
             memory                  about 1.0 MiB  all\n\
             accuracy                noise 0.1      set [accuracy]\n"
        );
        assert_eq!(
            Tabled(&decisions[1..3]).markdown(),
            "| what | choice | because | saves | key |\n|---|---|---|---|---|\n\
             | build quality | high | the scene says so |  | `plan.build_quality` |\n\
             | memory | about 1.0 MiB | all |  |  |\n"
        );
    }

    #[test]
    fn programs_get_words_and_numbers() {
        let found = serde_json::to_value(decisions()).unwrap();
        let textures = serde_json::json!({
            "what": "materials and textures", "choice": "off", "value": false, "because": "no layer",
            "saves": "3.0 MiB of 2 images", "saved_bytes": 3 << 20, "key": "plan.textures", "forced": false,
        });
        assert_eq!(found[0], textures);
        assert_eq!(
            (&found[2]["choice"], &found[2]["value"]),
            (&"about 1.0 MiB".into(), &(1 << 20).into())
        );
        assert!(found[2]["key"].is_null() && found[1]["forced"] == true);
        let number = serde_json::json!(["noise 0.1", 0.1]);
        assert_eq!((&found[3]["choice"], &found[3]["value"]), (&number[0], &number[1]));
    }
}
