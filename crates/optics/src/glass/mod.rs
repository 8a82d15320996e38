//! Glasses: what a lens file calls them, and their refractive index at a wavelength.
//!
//! Indices are relative to air, as makers measure them, so air is exactly 1.

mod agf;
mod catalogue;
mod dispersion;
mod medium;

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{self, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

pub use agf::AgfCatalogue;
pub use catalogue::{Entry, Makers, catalogue};
pub use dispersion::{Dispersion, FRAUNHOFER_C, FRAUNHOFER_D, FRAUNHOFER_F};
pub use medium::{Glass, GlassError};

/// A glass as a lens file writes it.
#[derive(Debug, Clone, PartialEq)]
pub enum GlassSpec {
    /// `"N-BK7"`: exactly the catalogue's name, or `"CDGM:F2"` with the maker's in front.
    Named(String),
    /// `{"n": 1.67}`: the same index at every wavelength.
    Constant(f64),
    /// `{"nd": 1.5168, "vd": 64.17}`: n = A + B/λ² through the index at 587.56 nm and the
    /// difference (nd − 1)/vd between 486.13 nm and 656.27 nm.
    Abbe {
        /// The index at 587.56 nm.
        nd: f64,
        /// Abbe's number.
        vd: f64,
    },
    /// `{"sellmeier": {"b": [...], "c": [...]}}`: n² = 1 + Σ b λ²/(λ² − c), λ in µm.
    Sellmeier {
        /// Strengths.
        b: Vec<f64>,
        /// Squared resonance wavelengths (µm²).
        c: Vec<f64>,
    },
    /// `{"power": [[a, p], ...]}`: n² = Σ a λᵖ, λ in µm (Schott's old formula; Ohara, Hoya, CDGM).
    Power(Vec<[f64; 2]>),
    /// `{"cauchy": [A, B, C, ...]}`: n = A + B/λ² + C/λ⁴ + …, λ in µm.
    Cauchy(Vec<f64>),
}

impl GlassSpec {
    /// Looks the glass up.
    ///
    /// # Errors
    ///
    /// When the name is unknown or the numbers describe no glass.
    pub fn resolve(&self) -> Result<Glass, GlassError> {
        self.resolve_among(&[], Makers::default())
    }

    /// Looks the glass up in `own` catalogues first, the last one before the others.
    ///
    /// # Errors
    ///
    /// As [`Self::resolve`].
    pub fn resolve_in(&self, own: &[AgfCatalogue]) -> Result<Glass, GlassError> {
        self.resolve_among(own, Makers::default())
    }

    /// As [`Self::resolve_in`], with the order in which makers are asked for a plain name of the built-in
    /// catalogue.
    ///
    /// # Errors
    ///
    /// As [`Self::resolve`].
    pub fn resolve_among(
        &self,
        own: &[AgfCatalogue],
        makers: Makers<'_>,
    ) -> Result<Glass, GlassError> {
        let inline = |law, why| Err(GlassError::Inline { law, why });
        let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
        let dispersion = match self {
            Self::Named(name) => {
                return match catalogue::find_in(own, name) {
                    Some(glass) => Ok(glass.clone()),
                    None => catalogue().find(name, makers).map_err(|error| match error {
                        GlassError::Unknown { name, .. } => catalogue().unknown(&name, own),
                        error => error,
                    }),
                };
            }
            Self::Constant(n) if *n >= 1.0 && n.is_finite() => Dispersion::Constant(*n),
            Self::Constant(_) => return inline("constant", "n must be a number from 1 on"),
            Self::Abbe { nd, vd } if *nd > 1.0 && *vd > 0.0 && finite(&[*nd, *vd]) => {
                Dispersion::from_abbe(*nd, *vd)
            }
            Self::Abbe { .. } => return inline("nd and vd", "nd must exceed 1 and vd exceed 0"),
            Self::Sellmeier { b, c } if b.len() != c.len() => {
                return inline("sellmeier", "b and c must have the same length");
            }
            Self::Sellmeier { b, c } if !finite(b) || !finite(c) => {
                return inline("sellmeier", "b and c must be finite");
            }
            Self::Sellmeier { b, c } => {
                Dispersion::Sellmeier(b.iter().zip(c).map(|(&b, &c)| [b, c]).collect())
            }
            Self::Power(terms) if terms.is_empty() || !finite(terms.as_flattened()) => {
                return inline("power", "needs one or more [a, p], all finite");
            }
            Self::Power(terms) => Dispersion::Power(terms.clone()),
            Self::Cauchy(terms) if terms.is_empty() || !finite(terms) => {
                return inline("cauchy", "needs one or more finite coefficients");
            }
            Self::Cauchy(terms) => Dispersion::cauchy(terms),
        };
        Ok(Glass::inline(self.to_string(), dispersion))
    }
}

impl fmt::Display for GlassSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Named(name) => f.write_str(name),
            Self::Constant(n) => write!(f, "n = {n}"),
            Self::Abbe { nd, vd } => write!(f, "nd = {nd}, vd = {vd}"),
            Self::Sellmeier { .. } => f.write_str("(inline Sellmeier formula)"),
            Self::Power(_) => f.write_str("(inline power series)"),
            Self::Cauchy(_) => f.write_str("(inline Cauchy formula)"),
        }
    }
}

/// The object form, one field a way of writing.
#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct Inline {
    /// The same index at every wavelength.
    #[serde(skip_serializing_if = "Option::is_none")]
    n: Option<f64>,
    /// The index at 587.56 nm, together with `vd`.
    #[serde(skip_serializing_if = "Option::is_none")]
    nd: Option<f64>,
    /// Abbe's number, together with `nd`.
    #[serde(skip_serializing_if = "Option::is_none")]
    vd: Option<f64>,
    /// n² = 1 + Σ b λ²/(λ² − c), λ in µm.
    #[serde(skip_serializing_if = "Option::is_none")]
    sellmeier: Option<SellmeierTerms>,
    /// [a, p]: n² = Σ a λᵖ, λ in µm.
    #[serde(skip_serializing_if = "Option::is_none")]
    power: Option<Vec<[f64; 2]>>,
    /// A, B, C: n = A + B/λ² + C/λ⁴, λ in µm.
    #[serde(skip_serializing_if = "Option::is_none")]
    cauchy: Option<Vec<f64>>,
}

#[derive(Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct SellmeierTerms {
    /// Strengths.
    b: Vec<f64>,
    /// Squared resonance wavelengths (µm²).
    c: Vec<f64>,
}

const INLINE_FORMS: &str = "give a glass as a name, as {\"n\"}, as {\"nd\", \"vd\"}, or as one of \
                            {\"sellmeier\"}, {\"power\"}, {\"cauchy\"}";

impl TryFrom<Inline> for GlassSpec {
    type Error = &'static str;

    fn try_from(inline: Inline) -> Result<Self, &'static str> {
        match inline {
            Inline {
                n: Some(n),
                nd: None,
                vd: None,
                sellmeier: None,
                power: None,
                cauchy: None,
            } => Ok(Self::Constant(n)),
            Inline {
                nd: Some(nd),
                vd: Some(vd),
                n: None,
                sellmeier: None,
                power: None,
                cauchy: None,
            } => Ok(Self::Abbe { nd, vd }),
            Inline {
                sellmeier: Some(SellmeierTerms { b, c }),
                n: None,
                nd: None,
                vd: None,
                power: None,
                cauchy: None,
            } => Ok(Self::Sellmeier { b, c }),
            Inline {
                power: Some(terms),
                n: None,
                nd: None,
                vd: None,
                sellmeier: None,
                cauchy: None,
            } => Ok(Self::Power(terms)),
            Inline {
                cauchy: Some(terms),
                n: None,
                nd: None,
                vd: None,
                sellmeier: None,
                power: None,
            } => Ok(Self::Cauchy(terms)),
            _ => Err(INLINE_FORMS),
        }
    }
}

struct GlassVisitor;

impl<'de> Visitor<'de> for GlassVisitor {
    type Value = GlassSpec;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(INLINE_FORMS)
    }

    fn visit_str<E: de::Error>(self, name: &str) -> Result<GlassSpec, E> {
        Ok(GlassSpec::Named(name.to_owned()))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<GlassSpec, A::Error> {
        let inline = Inline::deserialize(MapAccessDeserializer::new(map))?;
        inline.try_into().map_err(de::Error::custom)
    }
}

impl<'de> Deserialize<'de> for GlassSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(GlassVisitor)
    }
}

impl Serialize for GlassSpec {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut inline = Inline::default();
        match self.clone() {
            Self::Named(name) => return serializer.serialize_str(&name),
            Self::Constant(n) => inline.n = Some(n),
            Self::Abbe { nd, vd } => (inline.nd, inline.vd) = (Some(nd), Some(vd)),
            Self::Sellmeier { b, c } => inline.sellmeier = Some(SellmeierTerms { b, c }),
            Self::Power(terms) => inline.power = Some(terms),
            Self::Cauchy(terms) => inline.cauchy = Some(terms),
        }
        inline.serialize(serializer)
    }
}

impl JsonSchema for GlassSpec {
    fn schema_name() -> Cow<'static, str> {
        "Glass".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let inline = generator.subschema_for::<Inline>();
        json_schema!({
            "description": "A glass: a catalogue's name (\"N-BK7\", \"CDGM:F2\") or its numbers.",
            "anyOf": [{ "type": "string" }, inline],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(json: &str) -> Result<Glass, String> {
        let spec: GlassSpec = serde_json::from_str(json).map_err(|e| e.to_string())?;
        let again: GlassSpec =
            serde_json::from_str(&serde_json::to_string(&spec).unwrap()).unwrap();
        assert_eq!(spec, again, "a glass survives JSON");
        spec.resolve().map_err(|e| e.to_string())
    }

    #[test]
    fn every_way_of_writing_gives_its_formula() {
        assert_eq!(read(r#"{"n": 1.67}"#).unwrap().index(500.0), Ok(1.67));
        let bk7 = read(r#""N-BK7""#).unwrap();
        let inline = read(
            r#"{"sellmeier": {"b": [1.03961212, 0.231792344, 1.01046945],
                              "c": [0.00600069867, 0.0200179144, 103.560653]}}"#,
        );
        assert_eq!(bk7.index(587.56), inline.unwrap().index(587.56));
        let abbe = read(r#"{"nd": 1.5168, "vd": 64.17}"#).unwrap();
        // nd and vd are met exactly but for a rounding or two.
        assert!((abbe.index(FRAUNHOFER_D).unwrap() - 1.5168).abs() < 1e-15);
        assert!((abbe.abbe_number().unwrap() - 64.17).abs() < 1e-10);
        let power = read(r#"{"power": [[2.25, 0], [0.01, -2]]}"#).unwrap();
        assert_eq!(power.index(1000.0), Ok(2.26_f64.sqrt()));
        let cauchy = read(r#"{"cauchy": [1.5, 0.004]}"#).unwrap();
        assert_eq!(cauchy.index(500.0), Ok(1.5 + 0.004 / 0.25));
    }

    #[test]
    fn what_is_no_glass_is_refused_in_words() {
        let error = |json| read(json).unwrap_err();
        assert!(error(r#""N-BK8""#).contains("unknown glass \"N-BK8\""), "{}", error(r#""N-BK8""#));
        assert!(error(r#""N-BK8""#).contains("N-BK7"));
        assert!(error(r#""n-bk7""#).contains("unknown glass"), "names match exactly");
        assert!(error(r#"{"n": 0.5}"#).contains("from 1 on"));
        assert!(error(r#"{"nd": 1.5}"#).contains("give a glass as"));
        assert!(error(r#"{"n": 1.5, "nd": 1.5, "vd": 60}"#).contains("give a glass as"));
        assert!(error(r#"{"N": 1.5}"#).contains("unknown field `N`"));
        assert!(error("1.5").contains("give a glass as"));
        assert!(error(r#"{"sellmeier": {"b": [1], "c": []}}"#).contains("same length"));
        assert!(error(r#"{"power": []}"#).contains("one or more"));
    }

    #[test]
    fn a_formula_beyond_its_resonance_gives_an_error_and_no_nan() {
        let bk7 = read(r#""N-BK7""#).unwrap();
        assert!(bk7.covers(550.0) && !bk7.covers(200.0));
        // λ² = c at the first resonance, and n² is negative just below the third.
        assert!(matches!(bk7.index(10_170.0), Err(GlassError::NoIndex { .. })));
        assert!(bk7.index(f64::NAN).is_err());
        assert!(bk7.index(0.0).is_err());
    }

    #[test]
    fn absorption_follows_the_extinction_coefficient() {
        let bk7 = read(r#""N-BK7""#).unwrap();
        // Schott's data sheet: 10 mm of N-BK7 pass 0.998 at 500 nm; three digits are given.
        let alpha = bk7.absorption(500.0).unwrap();
        assert!(((-alpha * 10.0).exp() - 0.998).abs() < 6e-4, "{alpha}");
        assert_eq!(bk7.absorption(200.0), None);
        assert_eq!(Glass::air().absorption(500.0), None);
    }
}
