//! Materials and lights as scene files write them, the limits of their values, and which surfaces and lights
//! they are: one file for each, and here what both have.

mod light;
mod material;

use std::path::PathBuf;

use etendue_image::linear_from_srgb;
use etendue_spectrum::Illuminant;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::light::{LightSpec, SunSpec};
pub use self::material::{AbbeSpec, AbsorptionSpec, IorSpec, MaterialSpec};
use crate::texture::{Filter, Wrap};
use crate::{Color, Ior, Paint};

/// The brightest that a light or a surface may be, in whichever unit: pictures hold no number above
/// 3·10³⁸, and the powers of all lights are added up.
pub const BRIGHTEST: f64 = 1e30;

/// A colour, or an image of colours.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum PaintSpec {
    /// Linear RGB.
    Color(Color),
    /// An image over the surface's texture coordinates.
    Image(ImageSpec),
}

impl Default for PaintSpec {
    fn default() -> Self {
        Self::Color([1.0; 3])
    }
}

/// An image file over the surface's texture coordinates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageSpec {
    /// A PNG, JPEG, Radiance or EXR file, relative to the scene file.
    pub image: String,
    /// Multiplies the image: linear RGB.
    #[serde(default = "white")]
    pub factor: Color,
    /// What the file's numbers are: colours by the sRGB curve, or plain.
    #[serde(default)]
    pub encoding: crate::texture::Encoding,
    /// What happens outside of 0..=1, along both axes.
    #[serde(default)]
    pub wrap: Wrap,
    /// How texels are read.
    #[serde(default)]
    pub filter: Filter,
    /// Copies of the image along one unit of the texture coordinates, along u and v.
    #[serde(default = "unit_scale")]
    pub repeat: [f64; 2],
}

/// What is wrong with a value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// The key below the material or light.
    pub key: String,
    /// Why.
    pub why: String,
}

impl Fault {
    /// The key that is wrong, and the reason.
    pub fn new(key: impl Into<String>, why: impl Into<String>) -> Self {
        Self { key: key.into(), why: why.into() }
    }
}

/// What specifications name that stands elsewhere: files, and glasses of a catalogue.
pub trait Supply {
    /// An image as a paint.
    ///
    /// # Errors
    ///
    /// When there is no such file; keys are those of the image.
    fn image(&mut self, spec: &ImageSpec) -> Result<Paint, Fault>;

    /// A file by the name that the scene gives it.
    ///
    /// # Errors
    ///
    /// A sentence on why there is none.
    fn file(&mut self, written: &str) -> Result<PathBuf, String>;

    /// A refractive index.
    ///
    /// # Errors
    ///
    /// A sentence on the glass that is not known, or the number that is no index.
    fn index(&mut self, spec: &IorSpec) -> Result<Ior, String>;
}

/// What a colour may be.
#[derive(Clone, Copy, PartialEq)]
enum Bound {
    /// A reflectance.
    One,
    /// A radiance.
    None,
}

fn paint(
    key: &str,
    spec: &PaintSpec,
    bound: Bound,
    supply: &mut dyn Supply,
) -> Result<Paint, Fault> {
    match spec {
        PaintSpec::Color(color) => {
            in_bounds(key, color, bound)?;
            Ok(Paint::Plain(*color))
        }
        PaintSpec::Image(image) => {
            in_bounds(&format!("{key}.factor"), &image.factor, bound)?;
            let below = |fault: Fault| Fault::new(format!("{key}.{}", fault.key), fault.why);
            supply.image(image).map_err(below)
        }
    }
}

fn in_bounds(key: &str, color: &Color, bound: Bound) -> Result<(), Fault> {
    let fault = |why: String| Err(Fault::new(key, why));
    if !color.iter().all(|c| *c >= 0.0 && c.is_finite()) {
        return fault(format!("{color:?} has a part below zero"));
    }
    if !color.iter().all(|c| *c <= BRIGHTEST) {
        return fault(format!("{color:?} is above {BRIGHTEST:e}; pictures hold no more"));
    }
    if bound == Bound::One && !color.iter().all(|c| *c <= 1.0) {
        // Three bytes of an image, probably.
        let is_bytes = color.iter().all(|c| *c <= 255.0 && c.fract() == 0.0);
        let decoded = color.map(|c| (linear_from_srgb(c / 255.0) * 1e3).round() / 1e3);
        let hint = match is_bytes && color.iter().any(|c| *c > 2.0) {
            true => format!(
                "; numbers run from 0 to 1 in linear light, where sRGB's {color:?} of 255 are {decoded:?}"
            ),
            false => String::new(),
        };
        return fault(format!("{color:?} is outside 0 to 1; a surface reflects no more{hint}"));
    }
    Ok(())
}

fn checked(illuminant: Option<Illuminant>) -> Result<Option<Illuminant>, Fault> {
    let checked = illuminant.map(Illuminant::checked).transpose();
    checked.map_err(|error| Fault::new("illuminant", error.to_string()))
}

fn unit_scale() -> [f64; 2] {
    [1.0; 2]
}

fn white() -> Color {
    [1.0; 3]
}

fn one() -> f64 {
    1.0
}
