//! Filters: a transmission curve over a whole sheet, or a picture whose grey levels name curves.
//!
//! Like an aperture, a filter is a sheet without thickness that does not bend a ray; a filter of
//! glass is two flat surfaces around one.

use std::collections::BTreeMap;

use etendue_spectrum::Curve;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::picture::Picture;
use super::resources::Resolve;
use super::surface::checked_semi_diameter;
use etendue_geometry::units::Millimetres;

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
    /// Which curve is where; the first one everywhere when there is none.
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
    /// Whether every place has the same curve.
    #[must_use]
    pub fn is_uniform(&self) -> bool {
        self.map.is_none()
    }

    /// Which of the curves is at `x`, `y` (mm); `None` beside the picture, where it is opaque.
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
