//! Curves as files write them.

use std::fmt;

use serde::de::{self, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{Curve, CurveShape};
use crate::CurveSpec;
use crate::input::CurveSource;

impl Serialize for Curve {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.shape {
            CurveShape::Flat(value) => serializer.serialize_f64(*value),
            CurveShape::Sampled(samples) => samples.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Curve {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(CurveVisitor)
    }
}

/// Reads either form, so that an error speaks of the curve and not of "no variant matched".
struct CurveVisitor;

impl<'de> Visitor<'de> for CurveVisitor {
    type Value = Curve;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(
            "a number, a list of [nanometres, value] in ascending order, or a curve such as \
             {\"illuminant\": \"d65\"} or {\"line\": 532}",
        )
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Curve, E> {
        Curve::flat(value).map_err(E::custom)
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Curve, E> {
        self.visit_f64(value as f64)
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Curve, E> {
        self.visit_f64(value as f64)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Curve, A::Error> {
        let (mut samples, mut sum) = (Vec::new(), None::<Curve>);
        while let Some(element) = list.next_element::<CurveItem>()? {
            match element {
                CurveItem::Sample(sample) => samples.push(sample),
                CurveItem::Curve(source) => {
                    let curve = of_source(CurveSpec::One(source))?;
                    sum = Some(sum.map_or_else(|| curve.clone(), |sum| sum.plus(&curve)));
                }
            }
        }
        match sum {
            Some(sum) if samples.is_empty() => Ok(sum),
            Some(_) => {
                Err(de::Error::custom("samples and curves in one list: give one or the other"))
            }
            None => Curve::sampled(samples).map_err(de::Error::custom),
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Curve, A::Error> {
        let source = CurveSource::deserialize(de::value::MapAccessDeserializer::new(map))?;
        of_source(CurveSpec::One(source))
    }
}

/// An element of a curve's list.
enum CurveItem {
    Sample([f64; 2]),
    Curve(CurveSource),
}

impl<'de> Deserialize<'de> for CurveItem {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ElementVisitor)
    }
}

/// Reads either form, so that an error speaks of the sample.
struct ElementVisitor;

impl<'de> Visitor<'de> for ElementVisitor {
    type Value = CurveItem;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an array of length 2")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<CurveItem, A::Error> {
        <[f64; 2]>::deserialize(de::value::SeqAccessDeserializer::new(list)).map(CurveItem::Sample)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<CurveItem, A::Error> {
        CurveSource::deserialize(de::value::MapAccessDeserializer::new(map)).map(CurveItem::Curve)
    }
}

/// A curve that names no file: those are read where it is known in which folder.
fn of_source<E: de::Error>(spec: CurveSpec) -> Result<Curve, E> {
    let mut none = |file: &str| {
        Err(format!(
            "\"{file}\" is not read here: give the curve in the scene's own camera, or as a list of \
             [nm, value]"
        ))
    };
    spec.resolve(&mut none).map_err(|fault| E::custom(fault.why))
}

impl schemars::JsonSchema for Curve {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Curve".into()
    }

    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let samples = generator.subschema_for::<Vec<[f64; 2]>>();
        let spec = generator.subschema_for::<CurveSpec>();
        schemars::json_schema!({
            "description": "A function of wavelength: a number, or a list of [nm, value] in \
                ascending order, joined by straight lines, or a curve as colours may be.",
            "anyOf": [{ "type": "number" }, samples, spec],
        })
    }
}
