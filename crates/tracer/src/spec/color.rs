//! Colours and curves of surfaces and lights: their limits, and what they are to the eye.

use std::sync::Arc;

use etendue_image::linear_from_srgb;
use etendue_spectrum::colour::FINE_OBSERVER;
use etendue_spectrum::summary::LUMINOUS_EFFICACY;
use etendue_spectrum::{
    Bands, Curve, CurveError, CurveFault, CurveSpec, Illuminant, Outside, integral, rgb,
};

use super::supply::{ColorSpec, Fault, Supply};
use crate::tint::BRIGHTEST;
use crate::{Color, SceneCurve};

/// Bound of a colour.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Bound {
    /// A reflectance.
    One,
    /// A radiance.
    None,
}

/// A colour of a surface: its look, and its curve where it has one.
pub(super) struct Reflectance {
    pub(super) look: Color,
    pub(super) curve: Option<SceneCurve>,
}

/// A reflectance or transmittance.
pub(super) fn reflectance(
    key: &str,
    spec: &ColorSpec,
    supply: &mut dyn Supply,
) -> Result<Reflectance, Fault> {
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
pub(super) fn look(curve: &Curve) -> Color {
    let color = match Bands::Rgb.from_curve(curve, Outside::Held) {
        Ok(color) => std::array::from_fn(|k| color[k]),
        // Known in no visible light: what it is at its nearer end.
        Err(_) => [curve.held(555.0); 3],
    };
    color.map(|part: f64| part.clamp(0.0, 1.0))
}

/// Spectrum of a light: a colour and the curve that it multiplies, where it has one. The colour is then grey, by what
/// the curve is to the eye, and the curve that much less: lights are chosen by their colours.
pub(super) struct LightSpectrum {
    pub(super) color: Color,
    pub(super) curve: Option<Arc<Curve>>,
}

pub(super) fn emitted(
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
pub(super) fn brightest(key: &str, curve: &Curve) -> Result<f64, Fault> {
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
pub(super) fn curve(key: &str, spec: &CurveSpec, supply: &mut dyn Supply) -> Result<Curve, Fault> {
    spec.resolve(&mut |file| supply.text(file)).map_err(|CurveFault { key: below, why }| {
        let dot = if below.is_empty() { "" } else { "." };
        Fault::new(format!("{key}{dot}{below}"), why)
    })
}

/// Luminous quantity of a colour times a curve (lm for W/nm, and so on): 683.002 lm/W times ∫ S V dλ, of which V is
/// the CIE 1931 observer's ȳ (CIE 018:2019, equation 1).
pub(super) fn luminous(color: &Color, curve: Option<&Curve>) -> f64 {
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
pub(super) fn share_of(key: &str, wanted: f64, own: f64) -> Result<f64, Fault> {
    if !(wanted >= 0.0 && wanted.is_finite()) {
        return Err(Fault::new(key, format!("{wanted} is no amount of light")));
    }
    if own > 0.0 {
        return Ok(wanted / own);
    }
    let why = "is wanted of light that the eye does not see: give its spectrum visible light, or its power itself";
    Err(Fault::new(key, why))
}

pub(super) fn in_bounds(key: &str, color: &Color, bound: Bound) -> Result<(), Fault> {
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

pub(super) fn checked(illuminant: Option<Illuminant>) -> Result<Option<Arc<Curve>>, Fault> {
    let curve = illuminant.map(Illuminant::curve).transpose();
    let curve = curve.map_err(|error| Fault::new("illuminant", error.to_string()))?;
    Ok(curve.map(Arc::new))
}
