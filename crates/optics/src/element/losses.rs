//! Losses of light in glass: reflection at its surfaces, with and without a coating, and absorption
//! on the way.
//!
//! Fresnel's equations for unpolarised light (M. Born and E. Wolf, *Principles of Optics*, 7th ed.,
//! §1.5.2, eqs. 20-21) and the reflectance of a single homogeneous film (§1.6.4, eq. 57). What is
//! reflected is lost: ghosts are not traced. Absorption is exp(−α d) (Bouguer, Lambert).
//!
//! Filters: a transmission curve over a whole sheet, or a picture whose grey levels name curves.
//!
//! Like an aperture, a filter is a sheet without thickness that does not bend a ray; a filter of
//! glass is two flat surfaces around one.

use std::collections::BTreeMap;
use std::sync::Arc;

use rustfft::num_complex::Complex64;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Resolve;
use super::aperture::Picture;
use super::coating::{MirrorCoating, Stack, StackSpec};
use super::rays::{Block, LANES, Ray};
use super::surface::checked_semi_diameter;
use etendue_geometry::units::{Millimetres, Nanometres};
use etendue_spectrum::Curve;

/// Losses as a camera writes them. Nothing is lost unless it is asked for.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LossesSpec {
    /// Reflection of the surfaces between glass and air: `uncoated`, or a coating. Cemented surfaces
    /// are always uncoated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reflection: Option<Reflection>,
    /// True if glasses absorb, where the catalogue knows how much.
    #[serde(skip_serializing_if = "is_false")]
    pub absorption: bool,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes references")]
fn is_false(value: &bool) -> bool {
    !value
}

/// Reflection of surfaces between glass and air.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Reflection {
    /// By Fresnel's equations.
    Plain(Plain),
    /// Through one layer.
    Coated(Coating),
    /// Through several.
    Stack(StackSpec),
}

/// The word for surfaces without a coating.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Plain {
    /// No coating.
    Uncoated,
}

/// A single layer on each surface between glass and air.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Coating {
    /// Its index, from 1 on: 1.38 for magnesium fluoride.
    pub index: f64,
    /// Its thickness (nm): 100 is a quarter wave of 550 nm in magnesium fluoride.
    pub thickness: Nanometres,
}

impl LossesSpec {
    /// True if no losses are modelled.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Refuses coatings that are none.
    ///
    /// # Errors
    ///
    /// The key and a sentence.
    pub fn check(&self) -> Result<(), (&'static str, String)> {
        if let Some(Reflection::Stack(stack)) = &self.reflection {
            return stack.build().map(|_| ()).map_err(|why| ("reflection", why));
        }
        let Some(Reflection::Coated(Coating { index, thickness })) = self.reflection else {
            return Ok(());
        };
        if !(1.0..=10.0).contains(&index) {
            return Err(("reflection.index", format!("{index} is outside 1 to 10")));
        }
        if !(0.0..=1e5).contains(&thickness.0) {
            let why = format!("{} nm is outside 0 to 100000 nm", thickness.0);
            return Err(("reflection.thickness", why));
        }
        Ok(())
    }
}

/// Losses of light at one element, for light that arrives on one of its sides.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Loss {
    /// Indices before and behind the surface, as the light goes.
    indices: [f64; 2],
    reflects: bool,
    /// Index and phase thickness 2π n d/λ of the layer.
    layer: Option<[f64; 2]>,
    /// α of the medium that the light comes through (1/mm).
    absorption: f64,
    /// Several layers, as the light meets them, or what is a mirror; and the wavelength (nm).
    films: Option<(Films, f64)>,
}

/// Films that a ray meets.
#[derive(Debug, Clone, PartialEq)]
enum Films {
    /// On glass.
    Glass(Arc<Stack>),
    /// On a mirror.
    Mirror(Arc<MirrorCoating>),
}

impl Loss {
    /// `None` when nothing is lost. `absorption` is that of the medium on the side of arrival (1/mm).
    pub(crate) fn new(
        spec: &LossesSpec,
        indices: [f64; 2],
        absorption: Option<f64>,
        wavelength: f64,
    ) -> Option<Self> {
        let reflects = spec.reflection.is_some() && indices[0] != indices[1];
        let in_air = indices.contains(&1.0);
        let layer = match spec.reflection {
            Some(Reflection::Coated(Coating { index, thickness })) if in_air => {
                Some([index, std::f64::consts::TAU * index * thickness.0 / wavelength])
            }
            _ => None,
        };
        // Layers are told from the air on; a spec that is none has been refused.
        let films = match &spec.reflection {
            Some(Reflection::Stack(stack)) if in_air && reflects => {
                stack.build().ok().map(|stack| {
                    let stack = if indices[0] == 1.0 { stack } else { stack.reversed() };
                    (Films::Glass(stack.into()), wavelength)
                })
            }
            _ => None,
        };
        let absorption = absorption.filter(|_| spec.absorption).unwrap_or(0.0);
        (reflects || absorption > 0.0).then_some(Self {
            indices,
            reflects,
            layer,
            absorption,
            films,
        })
    }

    /// Of a mirror with films, in a medium of this index, and what else is lost on the way to it.
    pub(crate) fn of_mirror(
        loss: Option<Self>,
        coating: &Arc<MirrorCoating>,
        index: f64,
        wavelength: f64,
    ) -> Self {
        let absorption = loss.map_or(0.0, |loss| loss.absorption);
        let films = Some((Films::Mirror(Arc::clone(coating)), wavelength));
        Self { indices: [index; 2], reflects: true, layer: None, absorption, films }
    }

    /// The share of light that is left after a way of `length` (mm) through the medium before.
    pub(crate) fn absorbed(&self, length: f64) -> f64 {
        (-self.absorption * length).exp()
    }

    /// Returns the losses between other indices.
    pub(crate) fn between(&self, indices: [f64; 2]) -> Self {
        Self { indices, ..self.clone() }
    }

    /// The share of light that is left of a ray that came as `before` and goes on as `after`.
    pub(crate) fn share(&self, before: Ray, after: Ray) -> f64 {
        let mut share = 1.0;
        if self.absorption > 0.0 {
            let way = |axis: usize| after.position[axis] - before.position[axis];
            share = (-self.absorption * way(0).hypot(way(1)).hypot(way(2))).exp();
        }
        if self.reflects {
            share *= 1.0 - self.lost(before.direction, after.direction);
        }
        share
    }

    /// Share of light not let through, or by a mirror not reflected, computed from the directions
    /// alone: n' d' − n d is along the normal.
    fn lost(&self, before: [f64; 3], after: [f64; 3]) -> f64 {
        let [n, m] = self.indices;
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        if let Some((Films::Mirror(coating), wavelength)) = &self.films {
            // A mirror's kernel leaves minus the reflected direction, which is 2 cos i of the normal with the arriving one.
            let normal: [f64; 3] = std::array::from_fn(|k| before[k] + after[k]);
            let cosine = 0.5 * dot(normal, normal).sqrt();
            return 1.0 - coating.reflectance(n, cosine.min(1.0), *wavelength);
        }
        let normal: [f64; 3] = std::array::from_fn(|k| m * after[k] - n * before[k]);
        let length = dot(normal, normal).sqrt();
        if length == 0.0 {
            return 0.0;
        }
        let cosines = [before, after].map(|d| (dot(d, normal) / length).abs().min(1.0));
        if let Some((Films::Glass(stack), wavelength)) = &self.films {
            let indices = [n, m].map(|n| Complex64::new(n, 0.0));
            return 1.0 - stack.shares(indices, cosines[0], *wavelength)[1];
        }
        let Some([film, phase]) = self.layer else {
            let [s, p] = amplitudes([n, m], cosines);
            return 0.5 * (s * s + p * p);
        };
        let sine = n / film * (1.0 - cosines[0] * cosines[0]).max(0.0).sqrt();
        let cosine = (1.0 - sine * sine).max(0.0).sqrt();
        let twice = (2.0 * phase * cosine).cos();
        let first = amplitudes([n, film], [cosines[0], cosine]);
        let second = amplitudes([film, m], [cosine, cosines[1]]);
        let mut mean = 0.0;
        for (a, b) in first.into_iter().zip(second) {
            let cross = 2.0 * a * b * twice;
            let below = 1.0 + a * a * b * b + cross;
            // 0/0 is the limit of grazing light: all of it is reflected.
            let all = a * a + b * b + cross;
            mean += 0.5 * if below > 0.0 { (all / below).clamp(0.0, 1.0) } else { 1.0 };
        }
        mean
    }

    /// Dims all rays of a block that came as `before` and are still on their way.
    pub(crate) fn dim(&self, block: &mut Block, before: &Block) {
        for lane in 0..LANES {
            if block.outcome[lane] == 0 {
                block.throughput[lane] *= self.share(before.ray(lane), block.ray(lane));
            }
        }
    }
}

/// Fresnel's amplitudes for light polarised across and in the plane of incidence.
fn amplitudes([n, m]: [f64; 2], [arriving, leaving]: [f64; 2]) -> [f64; 2] {
    let ratio = |a: f64, b: f64| if a + b > 0.0 { (a - b) / (a + b) } else { 1.0 };
    [ratio(n * arriving, m * leaving), ratio(m * arriving, n * leaving)]
}

/// A filter as a lens file writes it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FilterSpec {
    /// The share of light that passes (0..=1) by wavelength: a number, or a list of [nm, share].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transmission: Option<Curve>,
    /// Instead: a grey picture whose levels are the keys of `curves`; row 0 is at the top and
    /// column 0 on the left as seen from the sensor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub image: Option<String>,
    /// The picture's width (mm).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub width: Option<Millimetres>,
    /// The picture's height (mm); by square pixels when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub height: Option<Millimetres>,
    /// The curve of each grey level of the picture: "0" to "255", or to "65535" for 16 bits.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub curves: BTreeMap<String, Curve>,
    /// Half the clear diameter (mm). Unlimited when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub semi_diameter: Option<Millimetres>,
}

/// A filter in its own plane.
#[derive(Debug, Clone, PartialEq)]
pub struct Filter {
    /// Half the clear diameter (mm); infinite when unlimited.
    pub semi_diameter: f64,
    /// The curves of the filter.
    pub curves: Vec<Curve>,
    /// Map of the curves by place; the first curve everywhere when there is none.
    map: Option<CurveMap>,
}

#[derive(Debug, Clone, PartialEq)]
struct CurveMap {
    picture: Picture,
    curve_of_pixel: Vec<u32>,
}

impl FilterSpec {
    /// The filter.
    ///
    /// # Errors
    ///
    /// A sentence on what is missing, or on the curve or file that makes no filter.
    pub fn build(&self, resolve: Resolve<'_>) -> Result<Filter, String> {
        let semi_diameter = checked_semi_diameter(self.semi_diameter)?;
        let sound = |curve: &Curve| curve.clone().within(0.0, 1.0).map_err(|e| e.to_string());
        match (&self.transmission, &self.image, self.width) {
            (Some(curve), None, None) if self.curves.is_empty() && self.height.is_none() => {
                Ok(Filter { semi_diameter, curves: vec![sound(curve)?], map: None })
            }
            (None, Some(file), Some(width)) => {
                let height = self.height.map(|h| h.0);
                let picture = Picture::read(file, width.0, height, resolve)?;
                let curves = self.curves.values().map(sound).collect::<Result<Vec<_>, _>>()?;
                let curve_of_pixel = self.curves_of(&picture, file)?;
                let map = Some(CurveMap { picture, curve_of_pixel });
                Ok(Filter { semi_diameter, curves, map })
            }
            _ => Err("give either transmission, or image with width and curves".to_owned()),
        }
    }

    fn curves_of(&self, picture: &Picture, file: &str) -> Result<Vec<u32>, String> {
        let mut index_of_level = BTreeMap::new();
        for (index, key) in (0..).zip(self.curves.keys()) {
            let level = key.parse::<u32>().map_err(|_| {
                format!("curves has the key \"{key}\"; keys are grey levels of the image")
            })?;
            index_of_level.insert(level, index);
        }
        let mut indices = Vec::with_capacity(picture.values.len());
        for (i, &value) in picture.values.iter().enumerate() {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a value in 0..=1 times at most 65535"
            )]
            let level = (value * picture.levels).round() as u32;
            let Some(&index) = index_of_level.get(&level) else {
                let [column, row] = [i % picture.pixels[0], i / picture.pixels[0]];
                return Err(format!(
                    "{file}: the pixel in column {column}, row {row} has the grey level {level}, \
                     which curves does not name"
                ));
            };
            indices.push(index);
        }
        Ok(indices)
    }
}

impl Filter {
    /// True if the whole filter has one curve.
    #[must_use]
    pub fn is_uniform(&self) -> bool {
        self.map.is_none()
    }

    /// Index of the transmission curve at `x`, `y` (mm); `None` beside the picture, where it is
    /// opaque.
    #[must_use]
    pub fn curve_at(&self, x: f64, y: f64) -> Option<usize> {
        match &self.map {
            None => Some(0),
            Some(map) => map.picture.pixel(x, y).map(|i| map.curve_of_pixel[i] as usize),
        }
    }

    /// The radius of the circle around what is not opaque (mm).
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.map.as_ref().map_or(f64::INFINITY, |m| m.picture.radius()).min(self.semi_diameter)
    }

    /// The wavelengths (nm) for which all curves are known.
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        self.curves.iter().map(Curve::range).fold([0.0, f64::INFINITY], |[low, high], range| {
            [low.max(range[0]), high.min(range[1])]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(json: &str) -> LossesSpec {
        serde_json::from_str(json).unwrap()
    }

    /// The share of light at `angle` (radians) from `n` into `m`.
    fn share(spec: &LossesSpec, [n, m]: [f64; 2], angle: f64) -> f64 {
        let sine = n * angle.sin() / m;
        let before = Ray { position: [0.0; 3], direction: [angle.sin(), 0.0, angle.cos()] };
        let after = Ray { position: [0.0; 3], direction: [sine, 0.0, (1.0 - sine * sine).sqrt()] };
        Loss::new(spec, [n, m], None, 550.0).map_or(1.0, |loss| loss.share(before, after))
    }

    #[test]
    fn uncoated_glass_reflects_as_fresnel_says() {
        let bare = spec(r#"{"reflection": "uncoated"}"#);
        let head_on = ((1.5 - 1.0) / (1.5 + 1.0_f64)).powi(2);
        assert!((share(&bare, [1.0, 1.5], 0.0) - (1.0 - head_on)).abs() < 1e-15);
        // At Brewster's angle only light across the plane is reflected: half of
        // ((n² − 1)/(n² + 1))².
        let brewster = 1.5_f64.atan();
        let across = 0.5 * (1.25 / 3.25_f64).powi(2);
        assert!((share(&bare, [1.0, 1.5], brewster) - (1.0 - across)).abs() < 1e-14);
        // Both ways alike (Stokes), and nothing at equal indices.
        let inside = (brewster.sin() / 1.5).asin();
        let back = share(&bare, [1.5, 1.0], inside);
        assert!((back - (1.0 - across)).abs() < 1e-14);
        assert_eq!(share(&bare, [1.5, 1.5], 0.3), 1.0);
        assert!(share(&bare, [1.0, 1.5], 1.57).is_finite());
    }

    #[test]
    fn a_quarter_wave_is_the_textbook_coating_and_no_layer_is_bare_glass() {
        let quarter = 550.0 / (4.0 * 1.38);
        let coated =
            spec(&format!(r#"{{"reflection": {{"index": 1.38, "thickness": {quarter}}}}}"#));
        // ((n₀ n₂ − n₁²)/(n₀ n₂ + n₁²))², here 1.26 %.
        let least = ((1.52 - 1.38 * 1.38) / (1.52 + 1.38 * 1.38_f64)).powi(2);
        assert!((share(&coated, [1.0, 1.52], 0.0) - (1.0 - least)).abs() < 1e-14);
        assert!((share(&coated, [1.52, 1.0], 0.0) - (1.0 - least)).abs() < 1e-14);
        let thin = spec(r#"{"reflection": {"index": 1.38, "thickness": 0}}"#);
        let bare = spec(r#"{"reflection": "uncoated"}"#);
        for angle in [0.0, 0.4, 1.2, 1.5] {
            let error = share(&thin, [1.0, 1.52], angle) - share(&bare, [1.0, 1.52], angle);
            assert!(error.abs() < 1e-14, "{angle}: {error}");
        }
        // Cement is not coated.
        assert_eq!(share(&coated, [1.5, 1.7], 0.2), share(&bare, [1.5, 1.7], 0.2));
    }

    #[test]
    fn absorption_is_by_the_way_and_what_is_no_coating_is_refused() {
        let absorbing = spec(r#"{"absorption": true}"#);
        let loss = Loss::new(&absorbing, [1.5, 1.0], Some(0.1), 550.0).unwrap();
        let before = Ray { position: [0.0, 0.0, 0.0], direction: [0.0, 0.6, 0.8] };
        let after = Ray { position: [0.0, 3.0, 4.0], direction: [0.0, 0.9, 0.4] };
        assert!((loss.share(before, after) - (-0.5_f64).exp()).abs() < 1e-15);
        assert_eq!(Loss::new(&LossesSpec::default(), [1.5, 1.0], Some(0.1), 550.0), None);
        assert_eq!(Loss::new(&absorbing, [1.5, 1.0], None, 550.0), None);
        let bad = spec(r#"{"reflection": {"index": 0.5, "thickness": 100}}"#);
        assert_eq!(bad.check().unwrap_err().0, "reflection.index");
    }

    fn build(json: &str, resolve: Resolve<'_>) -> Result<Filter, String> {
        serde_json::from_str::<FilterSpec>(json).map_err(|e| e.to_string())?.build(resolve)
    }

    #[test]
    fn a_picture_maps_places_to_curves() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cfa.png");
        image::GrayImage::from_raw(2, 1, vec![0, 7]).unwrap().save(&path).unwrap();
        let resolve = |_: &str| Ok(path.clone());
        let json = r#"{"image": "cfa.png", "width": 4,
                   "curves": {"0": 0.5, "7": [[400, 0], [700, 1]]}}"#;
        let filter = build(json, &resolve).unwrap();
        let at = |x| filter.curve_at(x, 0.0).map(|i| filter.curves[i].held(550.0));
        assert_eq!((at(-1.0), at(1.0), at(3.0)), (Some(0.5), Some(0.5), None));
        assert_eq!(filter.curves[filter.curve_at(1.0, 0.0).unwrap()].held(700.0), 1.0);
        assert_eq!(filter.range(), [400.0, 700.0]);
        let error = build(&json.replace("\"7\"", "\"8\""), &resolve).unwrap_err();
        assert!(error.contains("column 1, row 0 has the grey level 7"), "{error}");
    }

    #[test]
    fn what_is_no_filter_is_refused_in_words() {
        let error =
            |json| build(json, &|name: &str| Err(format!("{name} is not here"))).unwrap_err();
        assert!(error("{}").contains("give either transmission"));
        assert!(error(r#"{"transmission": 1.5}"#).contains("0..=1"), "{}", error("{}"));
        assert!(error(r#"{"image": "a.png", "width": 1}"#).contains("a.png is not here"));
        assert!(error(r#"{"transmission": 1, "width": 3}"#).contains("give either"));
    }
}
