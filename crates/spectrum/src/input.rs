//! Curves as scene files write them: points, files, lamps by name, lines.
//!
//! A curve stands wherever a colour stands. Straight lines join its points; a lamp by name is 1 at 560 nm;
//! a line is a triangle whose greatest value is 1 and whose width is that at half of it. `scale` multiplies
//! each.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::table::{Column, CurveTable};
use crate::{Curve, Illuminant};

/// One curve, or several that are added.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum CurveSpec {
    /// One.
    One(CurveSource),
    /// The sum of several: the lines of a spectral lamp, lasers.
    Sum(Vec<CurveSource>),
}

/// Source of a curve.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum CurveSource {
    /// Points.
    Points(PointsSpec),
    /// A measured file.
    File(FileSpec),
    /// A lamp by name.
    Lamp(LampSpec),
    /// A spectral line.
    Line(LineSpec),
}

/// Points that straight lines join.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PointsSpec {
    /// Points `[nm, value]`, ascending.
    pub curve: Vec<[f64; 2]>,
    /// Multiplies the values.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub scale: f64,
}

/// A measured curve in a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FileSpec {
    /// A `.csv` or `.spd` file, relative to the scene file: a wavelength (nm) and values in each row.
    pub file: String,
    /// The column of the values by the header's word, or counted from 1 behind the wavelengths; the only one when
    /// absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub column: Option<Column>,
    /// Multiplies the values.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub scale: f64,
}

/// The spectrum of a lamp by name, 1 at 560 nm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LampSpec {
    /// The illuminant.
    pub illuminant: Illuminant,
    /// Multiplies the spectrum.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub scale: f64,
}

/// A spectral line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LineSpec {
    /// Wavelength of the line (nm).
    pub line: f64,
    /// Its width at half of its height (nm, > 0): the line is a triangle.
    #[serde(default = "one")]
    pub width: f64,
    /// Its height.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub scale: f64,
}

/// Fault of a curve, and its place below the curve's own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CurveFault {
    /// The key.
    pub key: String,
    /// The reason, with what would mend it.
    pub why: String,
}

impl CurveFault {
    fn new(key: &str, why: impl ToString) -> Self {
        Self { key: key.to_owned(), why: why.to_string() }
    }
}

impl CurveSpec {
    /// The curve; `read` gives the text of a file that it names.
    ///
    /// # Errors
    ///
    /// On the first point, file, lamp or line that makes no curve.
    pub fn resolve(
        &self,
        read: &mut dyn FnMut(&str) -> Result<String, String>,
    ) -> Result<Curve, CurveFault> {
        match self {
            Self::One(source) => source.resolve(read),
            Self::Sum(sources) if sources.is_empty() => Err(CurveFault::new(
                "",
                "is an empty list: give at least one curve, lamp or line, or the colour [0, 0, 0]",
            )),
            Self::Sum(sources) => {
                let each = sources.iter().enumerate().map(|(i, source)| {
                    source.resolve(read).map_err(|fault| {
                        let dot = if fault.key.is_empty() { "" } else { "." };
                        CurveFault { key: format!("{i}{dot}{}", fault.key), why: fault.why }
                    })
                });
                let curves = each.collect::<Result<Vec<Curve>, CurveFault>>()?;
                Ok(curves.into_iter().reduce(|a, b| a.plus(&b)).unwrap_or(Curve::ONE))
            }
        }
    }
}

impl CurveSource {
    fn resolve(
        &self,
        read: &mut dyn FnMut(&str) -> Result<String, String>,
    ) -> Result<Curve, CurveFault> {
        let (key, curve, scale) = match self {
            Self::Points(PointsSpec { curve, scale }) => {
                ("curve", Curve::sampled(curve.clone()).map_err(|e| e.to_string()), *scale)
            }
            Self::File(FileSpec { file, column, scale }) => {
                let curve = read(file).and_then(|text| {
                    let ending = Path::new(file).extension().and_then(|e| e.to_str());
                    let ending = ending.unwrap_or_default().to_ascii_lowercase();
                    if ending == "yml" || ending == "yaml" {
                        return Err("is a table of n and k, which a `metal` takes; a curve is \
                                    a .csv or .spd file"
                            .to_owned());
                    }
                    let table = CurveTable::read(&text)?;
                    table.column(column.as_ref())
                });
                ("file", curve.map_err(|why| format!("\"{file}\": {why}")), *scale)
            }
            Self::Lamp(LampSpec { illuminant, scale }) => {
                ("illuminant", illuminant.curve().map_err(|e| e.to_string()), *scale)
            }
            Self::Line(LineSpec { line, width, scale }) => {
                if width.is_nan() || *width <= 0.0 || *width >= *line {
                    let why = format!(
                        "{width} nm is no width: give one above zero and below the wavelength"
                    );
                    return Err(CurveFault::new("width", why));
                }
                let points = vec![[line - width, 0.0], [*line, 1.0], [line + width, 0.0]];
                ("line", Curve::sampled(points).map_err(|e| e.to_string()), *scale)
            }
        };
        let curve = curve.map_err(|why| CurveFault::new(key, why))?;
        if !(scale >= 0.0 && scale.is_finite()) {
            return Err(CurveFault::new("scale", format!("{scale} is not 0 or above")));
        }
        curve.scaled(scale).map_err(|e| CurveFault::new("scale", e))
    }
}

fn one() -> f64 {
    1.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
fn is_one(value: &f64) -> bool {
    *value == 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolved(text: &str) -> Result<Curve, CurveFault> {
        let spec: CurveSpec = serde_json::from_str(text).unwrap();
        spec.resolve(&mut |file| match file {
            "patch.csv" => Ok("wavelength,red,blue\n400,0.1,0.9\n700,0.8,0.2\n".to_owned()),
            "one.spd" => Ok("# a lamp\n400 1\n500 3\n".to_owned()),
            _ => Err("is not there".to_owned()),
        })
    }

    #[test]
    fn every_form_makes_its_curve() {
        assert_eq!(
            resolved(r#"{"curve": [[400, 0.2], [600, 0.6]]}"#).unwrap().at(500.0),
            Some(0.4)
        );
        let blue = resolved(r#"{"file": "patch.csv", "column": "blue"}"#).unwrap();
        let second = resolved(r#"{"file": "patch.csv", "column": 2}"#).unwrap();
        assert_eq!((blue.at(400.0), blue), (Some(0.9), second));
        assert_eq!(resolved(r#"{"file": "one.spd", "scale": 2}"#).unwrap().at(450.0), Some(4.0));
        let lamp = resolved(r#"{"illuminant": "fl11", "scale": 3}"#).unwrap();
        assert!((lamp.at(560.0).unwrap() - 3.0).abs() < 1e-12);
        let line = resolved(r#"{"line": 532, "width": 2, "scale": 5}"#).unwrap();
        // The area of a triangle: its height times its width at half of that.
        assert!((line.integral(500.0, 600.0) - 10.0).abs() < 1e-12);
        let sodium = resolved(
            r#"[{"line": 589.0, "width": 0.1, "scale": 2}, {"line": 589.6, "width": 0.1}]"#,
        );
        let sodium = sodium.unwrap();
        assert!((sodium.integral(580.0, 600.0) - 0.3).abs() < 1e-12);
        assert_eq!([589.0, 589.3, 589.6].map(|nm| sodium.at(nm).unwrap()), [2.0, 0.0, 1.0]);
    }

    #[test]
    fn what_makes_no_curve_is_refused_by_name() {
        for (text, key, word) in [
            (r#"{"curve": [[500, 1], [400, 0]]}"#, "curve", "sort"),
            (r#"{"curve": [[500, 1], [500, 0]]}"#, "curve", "once"),
            (r#"{"curve": [[-400, 1], [500, 0]]}"#, "curve", "positive"),
            (r#"{"curve": [[0.4, 1], [0.7, 0]]}"#, "curve", "did you mean nm"),
            (r#"{"file": "none.csv"}"#, "file", "not there"),
            (r#"{"file": "patch.csv"}"#, "file", "`column`"),
            (r#"{"file": "patch.csv", "column": "green"}"#, "file", "red"),
            (r#"{"line": 532, "width": 0}"#, "width", "above zero"),
            (r#"{"line": 0.532, "width": 0.001}"#, "line", "did you mean nm"),
            (r#"{"illuminant": {"daylight": 2000}}"#, "illuminant", "4000"),
            (r#"[{"line": 532}, {"line": 600, "scale": -1}]"#, "1.scale", "0 or above"),
            ("[]", "", "empty list"),
        ] {
            let fault = resolved(text).unwrap_err();
            assert!(fault.key == key && fault.why.contains(word), "{text}: {fault:?}");
        }
    }
}
