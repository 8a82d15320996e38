//! The sensor as a scene file writes it.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

use etendue_geometry::units::{Micrometres, Seconds};
use etendue_spectrum::colour::FINE_OBSERVER;
use etendue_spectrum::{Curve, Grid};
use schemars::JsonSchema;
use serde::de::{self, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use crate::effects::{AngularResponse, AutoExposure, DefectMap, Photodiodes, SecondReadout};
use crate::{CfaSpec, Model};

/// A scene file's `sensor`. What is absent comes from the `model`, or is ideal.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SensorSpec {
    /// Quantities that a pixel measures.
    #[serde(rename = "type")]
    pub kind: SensorKind,
    /// A sensor of the trade, whose published figures fill in for absent keys.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<Model>,
    /// Columns and rows (default: the model's, or 1024 × 1024).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub resolution: Option<[u32; 2]>,
    /// From one pixel's centre to the next (µm, > 0; default 5).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pixel_pitch: Option<Micrometres>,
    /// Electrons a photon frees, η (0..=1; default 1).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quantum_efficiency: Option<Curve>,
    /// System gain K (DN/e⁻, > 0). Without it there are no electrons to count: `noise` must be
    /// `none` and radiometry `digital`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub system_gain: Option<f64>,
    /// Factor of the amplifier between pixel and converter (> 0; default 1): it multiplies K.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub analog_gain: Option<f64>,
    /// Settings of the amplifier that were measured one by one, as ISO speeds or conversion gains.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iso_settings: Option<Vec<IsoSetting>>,
    /// The one of `iso_settings` that holds (default: the first).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iso: Option<f64>,
    /// Standard deviation of the read-out, `σ_read`, before the amplifier (e⁻, ≥ 0; default 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub read_noise: Option<f64>,
    /// Standard deviation of what the converter adds, behind the amplifier (DN, ≥ 0; default 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub converter_noise: Option<f64>,
    /// Dark current `μ_I` at `dark_current_temperature` (e⁻/s, ≥ 0; default 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dark_current: Option<f64>,
    /// Warming by this much doubles the dark current (K, > 0; absent: it stays as it is).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dark_current_doubling: Option<f64>,
    /// Temperature at which the dark current was measured (K; default 293.15).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dark_current_temperature: Option<f64>,
    /// Temperature of the sensor (K, ≥ 0; default `dark_current_temperature`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature: Option<f64>,
    /// Electrons a pixel holds (e⁻, > 0; absent: only the converter saturates).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub full_well: Option<f64>,
    /// Reading of no light (DN, 0 .. 2ᵇ − 1; default 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub black_level: Option<f64>,
    /// Bits of the converter (1..=16; default 16).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bit_depth: Option<u32>,
    /// Photo response non-uniformity: relative standard deviation of sensitivity (0..=1; default 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prnu: Option<f64>,
    /// Dark signal non-uniformity: standard deviation of the pixels' offsets (e⁻, ≥ 0; default 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dsnu: Option<f64>,
    /// Standard deviation of an offset that every row draws anew each frame (e⁻, ≥ 0; default 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub row_noise: Option<f64>,
    /// The same for columns (e⁻, ≥ 0; default 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub column_noise: Option<f64>,
    /// The same for rows, of an offset that is the same in every frame (e⁻, ≥ 0; default 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub row_pattern: Option<f64>,
    /// The same for columns (e⁻, ≥ 0; default 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub column_pattern: Option<f64>,
    /// Dark current non-uniformity: relative standard deviation of the pixels' dark currents
    /// (0..=1; default 0). The pattern grows with the time and the temperature.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dcnu: Option<f64>,
    /// Pixels with much more dark current than the others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hot_pixels: Option<HotPixels>,
    /// The share of pixels that collect no electrons (0..=1; default 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dead_pixels: Option<f64>,
    /// The share of pixels that are always saturated (0..=1; default 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stuck_pixels: Option<f64>,
    /// The share of a pixel's electrons that is collected by each of its four neighbours
    /// (0..=0.2; default 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub crosstalk: Option<f64>,
    /// Pixels with which something is wrong, one by one: a picture of them, or a list.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub defect_map: Option<DefectMap>,
    /// Share that is read of what a pixel collected, near saturation: points `[collected, read]` as shares of
    /// `full_well`, ascending from 0 to 1 collected, that straight lines join (absent: all of it).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nonlinearity: Option<Vec<[f64; 2]>>,
    /// The share of the charge above `full_well` that flows into the neighbours of its column (0..=1; default 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blooming: Option<f64>,
    /// The signal of smear, as a share of that of an area a tenth of the picture high (0..=1; default 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub smear: Option<f64>,
    /// Standard deviation of the way that carriers diffuse sideways, along columns as along rows (µm, ≥ 0; default 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub carrier_diffusion: Option<Micrometres>,
    /// The sensitivity against the angle of the chief ray (absent: the same at all angles).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub angular_response: Option<AngularResponse>,
    /// Parts of each pixel, that see parts of the pupil under one on-chip lens, each read for itself beside the whole.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub photodiodes: Option<Photodiodes>,
    /// A second number of each pixel: of another gain, or of a second photodiode.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_readout: Option<SecondReadout>,
    /// The exposure time is metered: instead of `exposure`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub auto_exposure: Option<AutoExposure>,
    /// Exposure time T (s, > 0; default 0.01).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exposure: Option<Seconds>,
    /// Several exposure times (s): the light is rendered once and exposed for each.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exposures: Option<Vec<Seconds>>,
    /// Frames of each exposure (≥ 1; default 1). They share the fixed pattern, not the noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frames: Option<u32>,
    /// Also merge all exposures and read-outs to one picture of electrons a second (default false).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hdr: Option<bool>,
    /// Law by which electrons are drawn (default: `poisson` with a model or a gain, else `none`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<NoiseModel>,
    /// Serial number: which copy of the sensor, hence which fixed pattern (default 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub serial: Option<u64>,
    /// Meaning of the light (default `digital`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radiometry: Option<Radiometry>,
    /// Colour filter array of a `raw` sensor: `rggb` or another two-by-two word read row by row, or
    /// a list of rows. Absent: monochrome.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cfa: Option<CfaSpec>,
    /// Transmissions of the filters by letter, or the name of a set. Letters without a curve are
    /// ideal: r, g and b each see one of the render's colours, w sees all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub filters: Option<Filters>,
    /// Bands of wavelengths (nm): the channels of a `multispectral` sensor, or how finely other
    /// sensors divide the light.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bands: Option<Grid>,
    /// Channels of a `multispectral` sensor by curves instead of bands, or the name of a set.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channels: Option<Channels>,
    /// Method by which the preview of a `raw` sensor finds missing colours (default `malvar`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub demosaic: Option<Method>,
    /// Also write the expected value and the variance of every pixel (default false).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub moments: Option<bool>,
}

impl SensorSpec {
    /// True if the sensor asks for images of its own, that is for more than a grid of pixels.
    #[must_use]
    pub fn exposes(&self) -> bool {
        let grid =
            Self { resolution: self.resolution, pixel_pitch: self.pixel_pitch, ..Self::default() };
        *self != grid
    }

    /// The spec of a sensor that is the second reading alone.
    pub(crate) fn second(&self, second: SecondReadout) -> Self {
        let mut spec = Self {
            second_readout: None,
            hdr: None,
            iso_settings: None,
            iso: None,
            analog_gain: None,
            ..self.clone()
        };
        match second {
            SecondReadout::DualGain { system_gain, read_noise, full_well, black_level } => {
                spec.system_gain = Some(system_gain);
                spec.read_noise = read_noise.or(self.read_noise);
                spec.full_well = full_well.or(self.full_well);
                spec.black_level = black_level.or(self.black_level);
            }
            SecondReadout::SplitPixel { system_gain, read_noise, full_well, .. } => {
                spec.system_gain = system_gain.or(self.system_gain);
                spec.read_noise = read_noise.or(self.read_noise);
                spec.full_well = full_well.or(self.full_well);
            }
        }
        spec
    }
}

/// Quantities that a pixel measures.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SensorKind {
    /// One number, behind a colour filter or none: a real sensor.
    Raw,
    /// Red, green and blue at every pixel.
    #[default]
    Rgb,
    /// Any number of bands at every pixel.
    Multispectral,
}

/// Method by which missing colours are found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// From the same filter alone; any pattern.
    Bilinear,
    /// Guided by the pixel's own filter; Bayer patterns, bilinear for others.
    #[default]
    Malvar,
}

/// Law by which electrons are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NoiseModel {
    /// As nature does.
    Poisson,
    /// By a normal distribution of the same mean and variance, the paper's approximation (its Eqs. 5
    /// and 6; the variance K²·g that Eq. 5 prints holds for g in electrons, for g in DN it is K·g).
    /// The module `approximation` tells where it fails.
    Normal,
    /// Not at all: every pixel has its expected value, fixed patterns are left out.
    None,
}

/// Meaning of the light of a render to the sensor.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Radiometry {
    /// Intensities: 1 is full scale, and the grey value fixes the electrons. The exposure time moves
    /// the dark signal alone. Of the quantum efficiency only the shape matters.
    #[default]
    Digital,
    /// Spectral irradiance (W·m⁻²·nm⁻¹): exposure time, pixel area, photon energy and quantum
    /// efficiency make electrons.
    Physical,
}

/// Hot pixels, the same in every frame of a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HotPixels {
    /// The share of pixels that are hot (0..=1).
    pub share: f64,
    /// The mean of their extra dark current, which is distributed exponentially (e⁻/s, ≥ 0).
    pub dark_current: f64,
}

/// A setting of the amplifier, and what was measured at it. What is absent is as of the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct IsoSetting {
    /// Its ISO speed, or any number by which it is known (> 0).
    pub iso: f64,
    /// System gain K (DN/e⁻, > 0).
    pub system_gain: f64,
    /// Standard deviation of the read-out (e⁻, ≥ 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub read_noise: Option<f64>,
    /// Electrons a pixel holds (e⁻, > 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub full_well: Option<f64>,
    /// Reading of no light (DN).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub black_level: Option<f64>,
}

/// A channel of a multispectral sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ChannelSpec {
    /// Name in files.
    pub name: String,
    /// Its transmission (0..=1), which the quantum efficiency multiplies.
    pub curve: Curve,
}

/// Channels of a multispectral sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Channels {
    /// A set by name.
    Set(ChannelSet),
    /// A curve for each.
    Curves(Vec<ChannelSpec>),
}

/// Sets of channels that come with the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ChannelSet {
    /// X, Y and Z of the CIE 1931 observer: a colorimeter. The curves are x̄, ȳ and z̄ over the wavelength, for
    /// photons are counted, and alike in scale, so that light of equal energy has X = Y = Z.
    #[serde(rename = "cie_1931")]
    Cie1931,
}

impl Channels {
    /// The curve of each channel.
    #[must_use]
    pub fn curves(&self) -> Cow<'_, [ChannelSpec]> {
        let observer = match self {
            Self::Curves(channels) => return Cow::Borrowed(channels),
            Self::Set(ChannelSet::Cie1931) => &*FINE_OBSERVER,
        };
        let by_photon = |curve: &Curve| -> Vec<[f64; 2]> {
            curve.samples().iter().map(|&[nm, value]| [nm, value / nm]).collect()
        };
        let all = observer.each_ref().map(by_photon);
        let most = all.iter().flatten().map(|s| s[1]).fold(0.0, f64::max);
        let scaled = |samples: &Vec<[f64; 2]>| {
            Curve::sampled(samples.iter().map(|&[nm, value]| [nm, value / most]).collect())
        };
        let named = ["X", "Y", "Z"].into_iter().zip(&all);
        let channels = named.filter_map(|(name, samples)| {
            Some(ChannelSpec { name: name.to_owned(), curve: scaled(samples).ok()? })
        });
        Cow::Owned(channels.collect())
    }
}

/// Transmissions of colour filters.
#[derive(Debug, Clone, PartialEq)]
pub enum Filters {
    /// A set of curves by name.
    Set(FilterSet),
    /// A curve for each letter.
    Curves(BTreeMap<char, Curve>),
}

/// Sets of colour filters that come with the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FilterSet {
    /// r, g and b each see one of the render's colours.
    Ideal,
    /// r, g and b of the Nikon D5100 as measured by NPL, relative to their peaks. They include the
    /// silicon, so `quantum_efficiency` should be a number beside them.
    NikonD5100,
}

impl Serialize for Filters {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Set(set) => set.serialize(serializer),
            Self::Curves(curves) => curves.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Filters {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(FiltersVisitor)
    }
}

/// Reads either form, so that an error speaks of the filters and not of "no variant matched".
struct FiltersVisitor;

impl<'de> Visitor<'de> for FiltersVisitor {
    type Value = Filters;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the name of a filter set, or an object with a curve for each letter")
    }

    fn visit_str<E: de::Error>(self, name: &str) -> Result<Filters, E> {
        FilterSet::deserialize(de::value::StrDeserializer::new(name)).map(Filters::Set)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Filters, A::Error> {
        BTreeMap::deserialize(de::value::MapAccessDeserializer::new(map)).map(Filters::Curves)
    }
}

impl JsonSchema for Filters {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Filters".into()
    }

    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let set = generator.subschema_for::<FilterSet>();
        let curves = generator.subschema_for::<BTreeMap<String, Curve>>();
        schemars::json_schema!({ "anyOf": [set, curves] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_those_of_the_design_and_unknown_ones_are_refused() {
        let spec: SensorSpec = serde_json::from_str(
            r#"{ "type": "raw", "model": "imx183", "resolution": [640, 480], "exposure": 0.01,
                 "cfa": "rggb", "filters": { "r": [[580, 0], [600, 1], [700, 1]] },
                 "quantum_efficiency": [[400, 0.2], [700, 0.5]], "noise": "normal" }"#,
        )
        .unwrap();
        assert_eq!(spec.kind, SensorKind::Raw);
        assert_eq!(spec.noise, Some(NoiseModel::Normal));
        let back = serde_json::to_value(&spec).unwrap();
        assert_eq!(serde_json::from_value::<SensorSpec>(back).unwrap(), spec);
        for (text, word) in [
            (r#"{ "red_noise": 1 }"#, "unknown field `red_noise`"),
            (r#"{ "type": "bayer" }"#, "unknown variant `bayer`"),
            (r#"{ "model": "imx999" }"#, "unknown variant `imx999`"),
            (r#"{ "filters": "kodak" }"#, "unknown variant `kodak`"),
            (r#"{ "filters": 3 }"#, "the name of a filter set"),
            (r#"{ "filters": { "red": 1 } }"#, "a character"),
            (r#"{ "hot_pixels": { "share": 0.1 } }"#, "missing field `dark_current`"),
        ] {
            let error = serde_json::from_str::<SensorSpec>(text).unwrap_err().to_string();
            assert!(error.contains(word), "{text}: {error}");
        }
    }
}
