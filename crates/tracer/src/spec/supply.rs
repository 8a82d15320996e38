//! Files and glasses that specifications name and that stand elsewhere, their source, and faults of values.

use std::path::PathBuf;

use etendue_spectrum::{CurveSpec, Grid};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::texture::{Filter, Wrap};
use crate::{Color, Cube, CubeKind, Ior, Paint};

/// A colour, or a curve over wavelengths.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum ColorSpec {
    /// Linear RGB.
    Rgb(Color),
    /// A curve.
    Curve(CurveSpec),
}

impl ColorSpec {
    /// White.
    pub const WHITE: Self = Self::Rgb([1.0; 3]);
}

/// A file of reflectances, or of a lamp's light, by wavelength over the surface's texture coordinates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CubeSpec {
    /// A file of reflectances of 0 to 1, or of light, relative to the scene file: NPY, `[row][column][band]`; ENVI, by its
    /// header or its numbers; or EXR with channels `T.550,0nm`, of light `S0.550,0nm` (Fichet et al. 2021).
    pub cube: String,
    /// The wavelengths of the bands (nm) of an NPY file; the others say their own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bands: Option<Grid>,
    /// Treatment of coordinates outside of 0..=1, along both axes.
    #[serde(default)]
    pub wrap: Wrap,
    /// Filter by which texels are read.
    #[serde(default)]
    pub filter: Filter,
    /// Copies of the cube along one unit of the texture coordinates, along u and v.
    #[serde(default = "unit_scale")]
    pub repeat: [f64; 2],
}

/// An image file over the surface's texture coordinates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageSpec {
    /// A PNG, JPEG, Radiance or EXR file, relative to the scene file.
    pub image: String,
    /// Multiplies the image: linear RGB, or a curve.
    #[serde(default = "white")]
    pub factor: ColorSpec,
    /// Encoding of the file's numbers: colours by the sRGB curve, or plain.
    #[serde(default)]
    pub encoding: crate::texture::Encoding,
    /// Treatment of coordinates outside of 0..=1, along both axes.
    #[serde(default)]
    pub wrap: Wrap,
    /// Filter by which texels are read.
    #[serde(default)]
    pub filter: Filter,
    /// Copies of the image along one unit of the texture coordinates, along u and v.
    #[serde(default = "unit_scale")]
    pub repeat: [f64; 2],
}

/// Fault of a value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// The key below the material or light.
    pub key: String,
    /// The reason.
    pub why: String,
}

impl Fault {
    /// The key that is wrong, and the reason.
    pub fn new(key: impl Into<String>, why: impl Into<String>) -> Self {
        Self { key: key.into(), why: why.into() }
    }
}

/// Source of what specifications name and stands elsewhere: files, and glasses of a catalogue.
pub trait Supply {
    /// An image as a paint, white times what it is multiplied by.
    ///
    /// # Errors
    ///
    /// When there is no such file; keys are those of the image.
    fn image(&mut self, spec: &ImageSpec) -> Result<Paint, Fault>;

    /// The text of a file by the name that the scene gives it.
    ///
    /// # Errors
    ///
    /// A sentence on why there is none.
    fn text(&mut self, written: &str) -> Result<String, String>;

    /// A cube of this kind.
    ///
    /// # Errors
    ///
    /// When there is no such file, or it holds no such cube; keys are those of the cube.
    fn cube(&mut self, spec: &CubeSpec, kind: CubeKind) -> Result<Cube, Fault>;

    /// The next number for a curve of the scene.
    fn curve_number(&mut self) -> u32;

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

pub(super) fn unit_scale() -> [f64; 2] {
    [1.0; 2]
}

pub(super) fn white() -> ColorSpec {
    ColorSpec::WHITE
}

pub(super) fn one() -> f64 {
    1.0
}

/// A refractive index as the scene file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum IorSpec {
    /// The same for all wavelengths, at least 1.
    Constant(f64),
    /// A glass of the catalogue.
    Glass(String),
    /// By the index and Abbe number of the helium d line.
    Abbe(AbbeSpec),
}

impl Default for IorSpec {
    fn default() -> Self {
        Self::Constant(1.5)
    }
}

/// Index and dispersion of a glass.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AbbeSpec {
    /// Index at 587.56 nm, at least 1.
    pub nd: f64,
    /// Abbe number (> 0).
    pub vd: f64,
}
