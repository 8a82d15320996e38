//! Lengths, angles and times as files write them: a number in the documented unit, or a string with
//! its own (`"50 mm"`, `"1.2 m"`, `"0.1 deg"`, `"10 ms"`).
//!
//! A unit is a ratio of two whole numbers to the base unit, so that `"50 mm"` is 50 mm to the last
//! bit and `"1200 mm"` is the f64 nearest 1.2 m.

use std::borrow::Cow;
use std::fmt;

use etendue_report::Refusal;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Error as _, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Dimension of a quantity that a string with a unit gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dimension {
    /// From nanometres to kilometres, inches and feet.
    Length,
    /// Degrees, radians, arc minutes and seconds.
    Angle,
    /// From nanoseconds to minutes.
    Time,
}

/// A unit and its size in base units (m, degrees, s) as numerator and denominator.
type Unit = (&'static str, f64, f64);

const LENGTHS: &[Unit] = &[
    ("nm", 1.0, 1e9),
    ("um", 1.0, 1e6),
    ("\u{b5}m", 1.0, 1e6),
    ("\u{3bc}m", 1.0, 1e6),
    ("mm", 1.0, 1e3),
    ("cm", 1.0, 1e2),
    ("m", 1.0, 1.0),
    ("km", 1e3, 1.0),
    ("in", 254.0, 1e4),
    ("ft", 3048.0, 1e4),
];

const ANGLES: &[Unit] = &[
    ("deg", 1.0, 1.0),
    ("\u{b0}", 1.0, 1.0),
    ("rad", 180.0, std::f64::consts::PI),
    ("mrad", 0.18, std::f64::consts::PI),
    ("arcmin", 1.0, 60.0),
    ("arcsec", 1.0, 3600.0),
];

const TIMES: &[Unit] = &[
    ("ns", 1.0, 1e9),
    ("us", 1.0, 1e6),
    ("\u{b5}s", 1.0, 1e6),
    ("\u{3bc}s", 1.0, 1e6),
    ("ms", 1.0, 1e3),
    ("s", 1.0, 1.0),
    ("min", 60.0, 1.0),
];

impl Dimension {
    fn units(self) -> &'static [Unit] {
        match self {
            Self::Length => LENGTHS,
            Self::Angle => ANGLES,
            Self::Time => TIMES,
        }
    }

    /// The dimension by the word that JSON Schema carries under `x-quantity`.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        [Self::Length, Self::Angle, Self::Time].into_iter().find(|d| d.name() == name)
    }

    /// The word that JSON Schema carries under `x-quantity`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Length => "length",
            Self::Angle => "angle",
            Self::Time => "time",
        }
    }

    /// Reads `text`, a number and a unit, as a multiple of `target`, one of this dimension's units.
    ///
    /// # Errors
    ///
    /// When the number or the unit is missing, unknown or not finite.
    pub fn parse(self, text: &str, target: &str) -> Result<f64, Refusal> {
        let trimmed = text.trim();
        // A number, and a unit that this quantity has.
        let (number, unit) = split_number(trimmed);
        let Ok(value) = number.parse::<f64>() else {
            let why = format!("\"{text}\" does not start with a number");
            return Err(Refusal::new(why).hint(format!("write for example \"50 {target}\"")));
        };
        if unit.is_empty() {
            let remedy = format!("write \"{trimmed} {target}\", or the number without quotes");
            return Err(Refusal::new(format!("\"{trimmed}\" has no unit")).hint(remedy));
        }
        let of = |name: &str| self.units().iter().find(|(known, ..)| *known == name);
        let (Some(&(_, up, down)), Some(&(_, target_up, target_down))) = (of(unit), of(target))
        else {
            let mut known: Vec<&'static str> = self
                .units()
                .iter()
                .map(|(name, ..)| *name)
                .filter(|name| name.is_ascii())
                .collect();
            known.sort_unstable();
            let known = known.join(", ");
            return Err(format!("\"{text}\": unknown unit `{unit}`, known: {known}").into());
        };
        // From one unit to the other by whole numbers, which rounds once.
        let scaled = rescale(value, up * target_down, down * target_up);
        if scaled.is_finite() {
            Ok(scaled)
        } else {
            Err(format!("\"{text}\" is not a finite number").into())
        }
    }
}

/// `value · up / down` with one rounding where one of the two divides the other.
fn rescale(value: f64, up: f64, down: f64) -> f64 {
    if up % down == 0.0 {
        value * (up / down)
    } else if down % up == 0.0 {
        value / (down / up)
    } else {
        value * up / down
    }
}

/// Splits behind the longest prefix that f64 can read, so that `1e-3m` and `2 mm` both part well.
fn split_number(text: &str) -> (&str, &str) {
    let is_number = |c: char| c.is_ascii_digit() || matches!(c, '+' | '-' | '.' | 'e' | 'E');
    let mut end = text.find(|c| !is_number(c)).unwrap_or(text.len());
    while end > 0 && text[..end].parse::<f64>().is_err() {
        end -= 1;
    }
    (&text[..end], text[end..].trim_start())
}

struct QuantityVisitor(Dimension, &'static str);

impl Visitor<'_> for QuantityVisitor {
    type Value = f64;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a number of {} or a string with a unit", self.1)
    }

    fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<f64, E> {
        Ok(value)
    }

    #[expect(clippy::cast_precision_loss, reason = "JSON does not tell 2 from 2.0")]
    fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<f64, E> {
        Ok(value as f64)
    }

    #[expect(clippy::cast_precision_loss, reason = "JSON does not tell 2 from 2.0")]
    fn visit_u64<E: serde::de::Error>(self, value: u64) -> Result<f64, E> {
        Ok(value as f64)
    }

    fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<f64, E> {
        self.0.parse(text, self.1).map_err(E::custom)
    }
}

macro_rules! quantity {
    ($(#[$doc:meta])* $name:ident, $dimension:expr, $unit:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default)]
        pub struct $name(pub f64);

        impl $name {
            /// The unit of the number inside, as strings write it.
            pub const UNIT: &'static str = $unit;
        }

        impl Serialize for $name {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_f64(self.0)
            }
        }

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let value = deserializer.deserialize_any(QuantityVisitor($dimension, $unit))?;
                if value.is_finite() {
                    Ok(Self(value))
                } else {
                    Err(D::Error::custom("the number is not finite"))
                }
            }
        }

        impl JsonSchema for $name {
            fn schema_name() -> Cow<'static, str> {
                stringify!($name).into()
            }

            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!({
                    "description": concat!("A number in ", $unit, ", or a string with a unit."),
                    "x-quantity": $dimension.name(),
                    "x-unit": $unit,
                    "anyOf": [{ "type": "number" }, { "type": "string" }]
                })
            }
        }
    };
}

quantity! {
    /// A length in the world (m).
    Metres, Dimension::Length, "m"
}
quantity! {
    /// A length inside a lens (mm).
    Millimetres, Dimension::Length, "mm"
}
quantity! {
    /// A pixel's size (µm).
    Micrometres, Dimension::Length, "um"
}
quantity! {
    /// A wavelength (nm).
    Nanometres, Dimension::Length, "nm"
}
quantity! {
    /// An angle (degrees).
    Degrees, Dimension::Angle, "deg"
}
quantity! {
    /// A time (s).
    Seconds, Dimension::Time, "s"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_convert_to_the_nearest_f64() {
        let metres = |text| Dimension::Length.parse(text, "m");
        assert_eq!(metres("1200 mm"), Ok(1.2));
        assert_eq!(metres("50mm"), Ok(0.05));
        assert_eq!(metres("1e-3m"), Ok(0.001));
        assert_eq!(metres(" 2 in "), Ok(0.0508));
        assert_eq!(metres("-3.5 km"), Ok(-3500.0));
        assert_eq!(Dimension::Length.parse("50 mm", "mm"), Ok(50.0));
        assert_eq!(Dimension::Length.parse("0.1 mm", "um"), Ok(100.0));
        assert_eq!(Dimension::Length.parse("3.45 \u{b5}m", "um"), Ok(3.45));
        assert_eq!(Dimension::Angle.parse("90 arcmin", "deg"), Ok(1.5));
        assert_eq!(Dimension::Time.parse("10 ms", "s"), Ok(0.01));
        let half_turn = Dimension::Angle.parse(&format!("{} rad", std::f64::consts::PI), "deg");
        assert!((half_turn.unwrap() - 180.0).abs() < 1e-13, "one rounding of π and one of 180/π");
    }

    #[test]
    fn what_is_wrong_is_said() {
        let error = |text| Dimension::Length.parse(text, "mm").unwrap_err().to_string();
        assert_eq!(
            error("50 mn"),
            "\"50 mn\": unknown unit `mn`, known: cm, ft, in, km, m, mm, nm, um"
        );
        assert!(error("50").contains("has no unit\nhint: write \"50 mm\""), "{}", error("50"));
        assert!(error("mm").contains("does not start with a number"), "{}", error("mm"));
        assert!(error("nan mm").contains("does not start with a number"), "{}", error("nan mm"));
        assert!(error("1e308 km").contains("finite"), "{}", error("1e308 km"));
        assert!(error("").contains("does not start with a number"), "{}", error(""));
    }

    #[test]
    fn files_give_numbers_or_strings() {
        let read = |json| serde_json::from_str::<Millimetres>(json).map(|l| l.0);
        assert_eq!(read("50").unwrap(), 50.0);
        assert_eq!(read("2.5").unwrap(), 2.5);
        assert_eq!(read("\"5 cm\"").unwrap(), 50.0);
        assert!(read("true").unwrap_err().to_string().contains("a number of mm"));
    }
}
