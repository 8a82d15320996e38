//! Places of the picture that are compared.

use serde::Serialize;

/// A place of the picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Place {
    /// Its column (pixels from the outer corner of the top left pixel).
    pub column: f64,
    /// Its row.
    pub row: f64,
    /// Depths (m) that are seen around it, the nearest first.
    #[serde(serialize_with = "finite_or_null")]
    pub depths: Vec<f64>,
}

fn finite_or_null<S: serde::Serializer>(values: &[f64], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(values.iter().map(|x| x.is_finite().then_some(*x)))
}
