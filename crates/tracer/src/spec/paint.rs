//! Paints as files write them: colours, curves, images, cubes and squares of two colours.

use std::sync::Arc;

use etendue_spectrum::{Bands, Curve, CurveSpec, Illuminant, Outside, rgb};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::color::{
    Bound, LightSpectrum, Reflectance, brightest, checked, curve, emitted, in_bounds, reflectance,
};
use super::supply::{ColorSpec, CubeSpec, Fault, ImageSpec, Supply};
use crate::{Color, CubeKind, Paint, SceneCube, SceneCurve};

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

pub(super) fn paint(key: &str, spec: &PaintSpec, supply: &mut dyn Supply) -> Result<Paint, Fault> {
    match spec {
        PaintSpec::Color(color) => {
            in_bounds(key, color, Bound::One)?;
            Ok(Paint::Plain(*color))
        }
        PaintSpec::Curve(spec) => {
            let spec = ColorSpec::Curve(spec.clone());
            let Reflectance { look, curve } = reflectance(key, &spec, supply)?;
            Ok(match curve {
                Some(curve) => Paint::Curve { look, curve },
                None => Paint::Plain(look),
            })
        }
        PaintSpec::Cube(cube) => cube_paint(key, cube, CubeKind::Reflectance, supply),
        PaintSpec::Checker(CheckerSpec { checker, squares }) => {
            let below = |fault: Fault| Fault::new(format!("{key}.{}", fault.key), fault.why);
            self::checker("checker", checker, *squares, supply).map_err(below)
        }
        PaintSpec::Image(image) => {
            let Reflectance { look, curve } =
                reflectance(&format!("{key}.factor"), &image.factor, supply)?;
            image_paint(key, image, look, curve, supply)
        }
    }
}

/// A cube over a surface.
fn cube_paint(
    key: &str,
    spec: &CubeSpec,
    kind: CubeKind,
    supply: &mut dyn Supply,
) -> Result<Paint, Fault> {
    let below = |fault: Fault| Fault::new(format!("{key}.{}", fault.key), fault.why);
    let number = supply.curve_number();
    let cube = Arc::new(supply.cube(spec, kind).map_err(below)?);
    Ok(Paint::Cube { cube: SceneCube { number, cube }, repeat: spec.repeat })
}

/// An image times a factor, and times a curve of which that is the look.
fn image_paint(
    key: &str,
    image: &ImageSpec,
    own: Color,
    own_curve: Option<SceneCurve>,
    supply: &mut dyn Supply,
) -> Result<Paint, Fault> {
    let below = |fault: Fault| Fault::new(format!("{key}.{}", fault.key), fault.why);
    Ok(match (supply.image(image).map_err(below)?, own_curve) {
        (Paint::Image { image, .. }, curve) => Paint::Image { factor: own, curve, image },
        (_, Some(curve)) => Paint::Curve { look: own, curve },
        (_, None) => Paint::Plain(own),
    })
}

/// Squares of two colours.
pub(super) fn checker(
    key: &str,
    colors: &[ColorSpec; 2],
    squares: f64,
    supply: &mut dyn Supply,
) -> Result<Paint, Fault> {
    let [a, b] = [reflectance(key, &colors[0], supply)?, reflectance(key, &colors[1], supply)?];
    if squares.is_nan() || squares <= 0.0 {
        return Err(Fault::new("squares", format!("{squares} is not above zero")));
    }
    let looks = [a.look, b.look];
    let curves = match [a, b] {
        [Reflectance { curve: None, .. }, Reflectance { curve: None, .. }] => None,
        // A colour beside a curve is the curve that colours become.
        both => Some(Box::new(both.map(|one| match one.curve {
            Some(curve) => curve,
            None => SceneCurve {
                number: supply.curve_number(),
                curve: Arc::new(rgb::spectrum(one.look)),
            },
        }))),
    };
    Ok(Paint::Checker { colors: looks, curves, squares })
}

/// The light of a surface: a paint, and the curve that multiplies it.
pub(super) fn radiant_paint(
    key: &str,
    spec: &PaintSpec,
    illuminant: Option<Illuminant>,
    supply: &mut dyn Supply,
) -> Result<(Paint, Option<Arc<Curve>>), Fault> {
    Ok(match spec {
        PaintSpec::Color(color) => {
            let LightSpectrum { color, curve } =
                emitted(key, &ColorSpec::Rgb(*color), illuminant, supply)?;
            (Paint::Plain(color), curve)
        }
        PaintSpec::Curve(spec) => {
            let spec = ColorSpec::Curve(spec.clone());
            let LightSpectrum { color, curve } = emitted(key, &spec, illuminant, supply)?;
            (Paint::Plain(color), curve)
        }
        PaintSpec::Cube(cube) => {
            if illuminant.is_some() {
                let why =
                    format!("is given beside a cube of `{key}`, which has spectra of its own");
                return Err(Fault::new("illuminant", format!("{why}: leave one of them out")));
            }
            (cube_paint(key, cube, CubeKind::Light, supply)?, None)
        }
        PaintSpec::Checker(CheckerSpec { checker, squares }) => {
            if squares.is_nan() || *squares <= 0.0 {
                let why = format!("{squares} is not above zero");
                return Err(Fault::new(format!("{key}.squares"), why));
            }
            radiant_checker(key, checker, *squares, illuminant, supply)?
        }
        PaintSpec::Image(image) => {
            let factor = format!("{key}.factor");
            let LightSpectrum { color, curve } =
                emitted(&factor, &image.factor, illuminant, supply)?;
            (image_paint(key, image, color, None, supply)?, curve)
        }
    })
}

/// Squares of two lights, and the curve that multiplies both, where neither is one.
fn radiant_checker(
    key: &str,
    specs: &[ColorSpec; 2],
    squares: f64,
    illuminant: Option<Illuminant>,
    supply: &mut dyn Supply,
) -> Result<(Paint, Option<Arc<Curve>>), Fault> {
    let (mut colors, mut curves) = ([[0.0; 3]; 2], [None, None]);
    for (k, spec) in specs.iter().enumerate() {
        let key = format!("{key}.checker[{k}]");
        match spec {
            ColorSpec::Rgb(given) => {
                in_bounds(&key, given, Bound::None)?;
                colors[k] = *given;
            }
            ColorSpec::Curve(spec) => {
                let curve = curve(&key, spec, supply)?;
                brightest(&key, &curve)?;
                let color = Bands::Rgb.from_curve(&curve, Outside::Zero).unwrap_or_default();
                colors[k] = std::array::from_fn(|i| color.get(i).copied().unwrap_or(0.0));
                curves[k] = Some(curve);
            }
        }
    }
    if curves.iter().all(Option::is_none) {
        return Ok((Paint::Checker { colors, curves: None, squares }, checked(illuminant)?));
    }
    if illuminant.is_some() {
        let why = format!("is given beside a curve of `{key}`, which has its own spectrum");
        return Err(Fault::new("illuminant", format!("{why}: leave one of them out")));
    }
    let [first, second] = curves;
    // A colour beside a curve is the curve that colours become.
    let mut of = |given: Option<Curve>, color: Color| SceneCurve {
        number: supply.curve_number(),
        curve: Arc::new(given.unwrap_or_else(|| rgb::spectrum(color))),
    };
    let curves = Some(Box::new([of(first, colors[0]), of(second, colors[1])]));
    Ok((Paint::Checker { colors, curves, squares }, None))
}

pub(super) fn default_checker_squares() -> f64 {
    8.0
}
