//! Materials and lights as scene files write them, the limits of their values, and which surfaces and lights
//! they are: one file for each, and here what both have.

mod light;
mod light_motion;
mod material;
mod paint;

use std::path::PathBuf;
use std::sync::Arc;

use etendue_image::linear_from_srgb;
use etendue_spectrum::colour::FINE_OBSERVER;
use etendue_spectrum::summary::LUMINOUS_EFFICACY;
use etendue_spectrum::{
    Bands, Curve, CurveError, CurveFault, CurveSpec, Grid, Illuminant, Outside, integral, rgb,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::light::{LightSpec, SkyCubeSpec, SkyImageSpec, SunSpec};
pub use self::light_motion::LightMotionSpec;
pub use self::material::{AbbeSpec, AbsorptionSpec, IorSpec, MaterialSpec};
use self::paint::{checker, paint, radiant_paint};
use crate::texture::{Filter, Wrap};
use crate::{Color, Cube, CubeKind, Ior, Paint, SceneCurve};

/// The brightest that a light or a surface may be, in whichever unit: pictures hold no number above
/// 3·10³⁸, and the powers of all lights are added up.
pub const BRIGHTEST: f64 = 1e30;

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

/// A colour, a curve over wavelengths, an image or squares of two colours.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum PaintSpec {
    /// Linear RGB.
    Color(Color),
    /// An image over the surface's texture coordinates.
    Image(ImageSpec),
    /// A reflectance, or of a lamp its light, by wavelength over the surface's texture coordinates.
    Cube(CubeSpec),
    /// Squares over the surface's texture coordinates.
    Checker(CheckerSpec),
    /// A curve.
    Curve(CurveSpec),
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

/// Squares of two colours over the surface's texture coordinates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CheckerSpec {
    /// The two colours.
    pub checker: [ColorSpec; 2],
    /// Squares along one unit of the texture coordinates (> 0).
    #[serde(default = "default_checker_squares")]
    pub squares: f64,
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
    /// Why.
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

/// Bound of a colour.
#[derive(Clone, Copy, PartialEq)]
enum Bound {
    /// A reflectance.
    One,
    /// A radiance.
    None,
}

/// A colour of a surface: its look, and its curve where it has one.
struct Reflectance {
    look: Color,
    curve: Option<SceneCurve>,
}

/// A reflectance or transmittance.
fn reflectance(key: &str, spec: &ColorSpec, supply: &mut dyn Supply) -> Result<Reflectance, Fault> {
    match spec {
        ColorSpec::Rgb(color) => {
            in_bounds(key, color, Bound::One)?;
            Ok(Reflectance { look: *color, curve: None })
        }
        ColorSpec::Curve(spec) => {
            let curve = curve(key, spec, supply)?;
            let curve = share(curve).map_err(|why| Fault::new(key, why))?;
            let look = look(&curve);
            let curve = SceneCurve { number: supply.curve_number(), curve: Arc::new(curve) };
            Ok(Reflectance { look, curve: Some(curve) })
        }
    }
}

/// Share of light that a surface reflects or lets pass: 0 to 1.
fn share(curve: Curve) -> Result<Curve, String> {
    curve.within(0.0, 1.0).map_err(|error| match error {
        CurveError::OutOfBounds { wavelength: Some(nm), value, .. } if value > 1.0 => format!(
            "is {value} at {nm} nm, more light than falls in: a reflectance is 0 to 1 (percent are \
             scaled by `\"scale\": 0.01`), and fluorescence, which gives back other wavelengths than \
             it takes, is not modelled"
        ),
        CurveError::OutOfBounds { wavelength: Some(nm), value, .. } => format!(
            "is {value} at {nm} nm, below zero: a surface reflects and a body lets pass 0 to 1; clip \
             what the noise of the measurement leaves there"
        ),
        other => other.to_string(),
    })
}

/// Look of a reflectance: linear RGB in 0..=1, of its colour under daylight.
fn look(curve: &Curve) -> Color {
    let color = match Bands::Rgb.from_curve(curve, Outside::Held) {
        Ok(color) => std::array::from_fn(|k| color[k]),
        // Known in no visible light: what it is at its nearer end.
        Err(_) => [curve.held(555.0); 3],
    };
    color.map(|part: f64| part.clamp(0.0, 1.0))
}

/// Spectrum of a light: a colour and the curve that it multiplies, where it has one. The colour is then grey, by what
/// the curve is to the eye, and the curve that much less: lights are chosen by their colours.
struct LightSpectrum {
    color: Color,
    curve: Option<Arc<Curve>>,
}

fn emitted(
    key: &str,
    spec: &ColorSpec,
    illuminant: Option<Illuminant>,
    supply: &mut dyn Supply,
) -> Result<LightSpectrum, Fault> {
    match spec {
        ColorSpec::Rgb(color) => {
            in_bounds(key, color, Bound::None)?;
            Ok(LightSpectrum { color: *color, curve: checked(illuminant)? })
        }
        ColorSpec::Curve(spec) => {
            if illuminant.is_some() {
                let why = format!("is given beside a curve of `{key}`, which has its own spectrum");
                return Err(Fault::new("illuminant", format!("{why}: leave one of them out")));
            }
            emission(key, &curve(key, spec, supply)?)
        }
    }
}

/// A curve of a light.
fn emission(key: &str, curve: &Curve) -> Result<LightSpectrum, Fault> {
    let high = brightest(key, curve)?;
    let color = Bands::Rgb.from_curve(curve, Outside::Zero).unwrap_or_default();
    let seen = color.iter().sum::<f64>() / 3.0;
    let grey = if seen > 0.0 { seen } else { high };
    if grey <= 0.0 {
        return Ok(LightSpectrum { color: [0.0; 3], curve: None });
    }
    let unit = curve.scaled(1.0 / grey).map_err(|e| Fault::new(key, e.to_string()))?;
    Ok(LightSpectrum { color: [grey; 3], curve: Some(Arc::new(unit)) })
}

/// The greatest value of a curve of a light.
fn brightest(key: &str, curve: &Curve) -> Result<f64, Fault> {
    let [low, high] = curve.extent();
    if low < 0.0 {
        return Err(Fault::new(
            key,
            format!("is {low} at its least; a light sends no less than 0"),
        ));
    }
    if high > BRIGHTEST {
        return Err(Fault::new(key, format!("is above {BRIGHTEST:e}; pictures hold no more")));
    }
    Ok(high)
}

/// A curve as the scene gives it.
fn curve(key: &str, spec: &CurveSpec, supply: &mut dyn Supply) -> Result<Curve, Fault> {
    spec.resolve(&mut |file| supply.text(file)).map_err(|CurveFault { key: below, why }| {
        let dot = if below.is_empty() { "" } else { "." };
        Fault::new(format!("{key}{dot}{below}"), why)
    })
}

/// Luminous quantity of a colour times a curve (lm for W/nm, and so on): 683.002 lm/W times ∫ S V dλ, of which V is
/// the CIE 1931 observer's ȳ (CIE 018:2019, equation 1).
fn luminous(color: &Color, curve: Option<&Curve>) -> f64 {
    let own = rgb::spectrum(*color);
    let seen = &FINE_OBSERVER[1];
    let [from, to] = seen.range();
    LUMINOUS_EFFICACY
        * match curve {
            None => integral(&[&own, seen], from, to),
            Some(curve) => {
                let [low, high] = curve.range();
                let flat = curve.as_flat().is_some();
                let (from, to) = if flat { (from, to) } else { (from.max(low), to.min(high)) };
                if from < to { integral(&[&own, curve, seen], from, to) } else { 0.0 }
            }
        }
}

/// Factor that a light with so much of a photometric quantity is multiplied by to have as much as is `wanted`.
fn share_of(key: &str, wanted: f64, own: f64) -> Result<f64, Fault> {
    if !(wanted >= 0.0 && wanted.is_finite()) {
        return Err(Fault::new(key, format!("{wanted} is no amount of light")));
    }
    if own > 0.0 {
        return Ok(wanted / own);
    }
    let why = "is wanted of light that the eye does not see: give its spectrum visible light, or its power itself";
    Err(Fault::new(key, why))
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

fn checked(illuminant: Option<Illuminant>) -> Result<Option<Arc<Curve>>, Fault> {
    let curve = illuminant.map(Illuminant::curve).transpose();
    let curve = curve.map_err(|error| Fault::new("illuminant", error.to_string()))?;
    Ok(curve.map(Arc::new))
}

fn unit_scale() -> [f64; 2] {
    [1.0; 2]
}

fn white() -> ColorSpec {
    ColorSpec::WHITE
}

fn default_checker_squares() -> f64 {
    8.0
}

fn one() -> f64 {
    1.0
}
