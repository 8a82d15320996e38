//! Consecutive bands of wavelengths: the spectral bands of a render, the channels of a sensor.

use std::fmt;

use serde::de::{self, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// An interval of wavelengths (nm).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Band {
    /// Its short end (nm).
    pub from: f64,
    /// Its long end (nm).
    pub to: f64,
}

impl Band {
    /// Its middle (nm).
    #[must_use]
    pub fn centre(self) -> f64 {
        0.5 * (self.from + self.to)
    }

    /// Its width (nm).
    #[must_use]
    pub fn width(self) -> f64 {
        self.to - self.from
    }
}

/// Bands that follow one another without a gap, given by their edges.
///
/// In JSON it is a list of edges, `[400, 500, 600, 700]` for three bands, or equal bands,
/// `{ "from": 400, "to": 700, "count": 3 }`:
///
/// ```
/// use etendue_spectrum::Grid;
///
/// let edges: Grid = serde_json::from_str("[400, 500, 600, 700]")?;
/// let equal: Grid = serde_json::from_str(r#"{ "from": 400, "to": 700, "count": 3 }"#)?;
/// assert_eq!(edges, equal);
/// assert_eq!(equal.centres().collect::<Vec<_>>(), [450.0, 550.0, 650.0]);
/// # Ok::<(), serde_json::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// At least two, positive, finite, strictly ascending.
    edges: Vec<f64>,
}

/// More bands than this are refused: a render would not fit into memory.
pub const MAX_BANDS: usize = 4096;

/// Error of numbers that make no grid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GridError {
    /// Fewer than two edges.
    #[error("bands need at least two edges (nm), {0} given")]
    TooFew(usize),
    /// More than [`MAX_BANDS`].
    #[error("{0} bands asked for: at most {MAX_BANDS} are possible")]
    TooMany(usize),
    /// A width that is not positive.
    #[error("bands of {0} nm asked for: the width must be positive")]
    Width(f64),
    /// An edge that is not a wavelength, or not after the one before it.
    #[error("edge {index} of the bands is {edge} nm: edges must be positive, finite and ascending")]
    Edge {
        /// Index of the edge, counted from 0.
        index: usize,
        /// Value that was given (nm).
        edge: f64,
    },
}

impl Grid {
    /// Bands between consecutive `edges` (nm).
    ///
    /// # Errors
    ///
    /// When there are fewer than two edges, more than [`MAX_BANDS`] bands, or the edges are not
    /// positive, finite and strictly ascending.
    pub fn from_edges(edges: Vec<f64>) -> Result<Self, GridError> {
        if edges.len() < 2 {
            return Err(GridError::TooFew(edges.len()));
        }
        if edges.len() - 1 > MAX_BANDS {
            return Err(GridError::TooMany(edges.len() - 1));
        }
        let mut previous = 0.0;
        for (index, &edge) in edges.iter().enumerate() {
            if !(edge > previous && edge.is_finite()) {
                return Err(GridError::Edge { index, edge });
            }
            previous = edge;
        }
        Ok(Self { edges })
    }

    /// `count` bands of equal width that fill `from..to` (nm).
    ///
    /// # Errors
    ///
    /// As [`Self::from_edges`].
    pub fn equal(from: f64, to: f64, count: usize) -> Result<Self, GridError> {
        if count > MAX_BANDS {
            return Err(GridError::TooMany(count));
        }
        if count == 0 {
            return Err(GridError::TooFew(1));
        }
        let edge = |i: usize| {
            let t = i as f64 / count as f64;
            from * (1.0 - t) + to * t
        };
        Self::from_edges((0..=count).map(edge).collect())
    }

    /// Equal bands of at most `width` (nm) that fill `from..to` (nm).
    ///
    /// # Errors
    ///
    /// As [`Self::from_edges`], or when the width is not positive.
    pub fn of_width(from: f64, to: f64, width: f64) -> Result<Self, GridError> {
        if width.is_nan() || width <= 0.0 {
            return Err(GridError::Width(width));
        }
        // A hair above a whole number of bands is that number, not one more.
        let bands = ((to - from) / width - 1e-9).ceil();
        #[expect(clippy::cast_possible_truncation, reason = "an `as` cast saturates")]
        Self::equal(from, to, bands.max(1.0) as usize)
    }

    /// The number of bands.
    #[must_use]
    pub fn len(&self) -> usize {
        self.edges.len() - 1
    }

    /// Never: there is at least one band.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        false
    }

    /// The edges (nm): one more than there are bands.
    #[must_use]
    pub fn edges(&self) -> &[f64] {
        &self.edges
    }

    /// The bands, from the shortest wavelengths on.
    pub fn bands(&self) -> impl ExactSizeIterator<Item = Band> + '_ {
        (0..self.len()).map(|i| Band { from: self.edges[i], to: self.edges[i + 1] })
    }

    /// The middles of the bands (nm).
    pub fn centres(&self) -> impl ExactSizeIterator<Item = f64> + '_ {
        self.bands().map(Band::centre)
    }

    /// First and last edge (nm).
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        [self.edges[0], self.edges[self.edges.len() - 1]]
    }
}

/// The second form of a grid in JSON.
#[derive(Deserialize, schemars::JsonSchema)]
#[schemars(inline)]
#[serde(deny_unknown_fields)]
struct EqualBands {
    /// The short end of the first band (nm).
    from: f64,
    /// The long end of the last band (nm).
    to: f64,
    /// Number of bands.
    count: usize,
}

impl Serialize for Grid {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.edges.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Grid {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(GridVisitor)
    }
}

/// Reads either form, so that an error speaks of the grid and not of "no variant matched".
struct GridVisitor;

impl<'de> Visitor<'de> for GridVisitor {
    type Value = Grid;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of band edges (nm), or { \"from\": nm, \"to\": nm, \"count\": n }")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Grid, A::Error> {
        let mut edges = Vec::new();
        while let Some(edge) = list.next_element()? {
            edges.push(edge);
        }
        Grid::from_edges(edges).map_err(de::Error::custom)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Grid, A::Error> {
        let EqualBands { from, to, count } =
            EqualBands::deserialize(de::value::MapAccessDeserializer::new(map))?;
        Grid::equal(from, to, count).map_err(de::Error::custom)
    }
}

impl schemars::JsonSchema for Grid {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Grid".into()
    }

    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let edges = generator.subschema_for::<Vec<f64>>();
        let equal = generator.subschema_for::<EqualBands>();
        schemars::json_schema!({
            "description": "Consecutive bands of wavelengths: their edges (nm, ascending), or equal \
                bands.",
            "anyOf": [edges, equal],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_fill_the_range_without_gaps() {
        let grid = Grid::equal(380.0, 780.0, 40).unwrap();
        assert_eq!(grid.len(), 40);
        assert_eq!(grid.range(), [380.0, 780.0]);
        assert!(grid.bands().all(|b| (b.width() - 10.0).abs() < 1e-9));
        assert!(grid.edges().windows(2).all(|e| e[0] < e[1]));
        assert_eq!(Grid::of_width(380.0, 780.0, 10.0).unwrap(), grid);
        assert_eq!(Grid::of_width(400.0, 405.0, 10.0).unwrap().len(), 1);
        assert_eq!(Grid::of_width(400.0, 421.0, 10.0).unwrap().len(), 3);
    }

    #[test]
    fn bad_edges_are_refused() {
        assert_eq!(Grid::from_edges(vec![400.0]), Err(GridError::TooFew(1)));
        assert_eq!(Grid::equal(400.0, 700.0, 0), Err(GridError::TooFew(1)));
        assert_eq!(Grid::equal(400.0, 700.0, 5000), Err(GridError::TooMany(5000)));
        assert!(matches!(Grid::equal(700.0, 400.0, 3), Err(GridError::Edge { index: 1, .. })));
        for width in [0.0, -1.0, f64::NAN] {
            assert!(Grid::of_width(400.0, 700.0, width).is_err(), "{width}");
        }
        let with_nan = Grid::from_edges(vec![400.0, f64::NAN, 500.0]);
        assert!(matches!(with_nan, Err(GridError::Edge { index: 1, .. })));
        let unknown = r#"{ "from": 400, "to": 700, "count": 3, "step": 5 }"#;
        let error = serde_json::from_str::<Grid>(unknown).unwrap_err().to_string();
        assert!(error.contains("unknown field `step`"), "{error}");
    }
}
