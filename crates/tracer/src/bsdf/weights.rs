//! Factors by which surfaces change light, as multiples of a few colours.

/// A value as multiples of white, the surface's colour and others that follow from it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Weights {
    /// Of white.
    pub white: f64,
    /// Of the surface's colour.
    pub base: f64,
    /// Of the highlights' colour.
    pub highlight: f64,
    /// Of what a measured metal's reflectance lacks of Schlick's.
    pub dip: f64,
    /// Of the colour of light that met several facets.
    pub deep: f64,
    /// Of the sheen's colour.
    pub sheen: f64,
}

impl Weights {
    /// That many times white.
    #[must_use]
    pub fn white(white: f64) -> Self {
        Self { white, ..Self::default() }
    }

    /// That many times the surface's colour.
    #[must_use]
    pub fn base(base: f64) -> Self {
        Self { base, ..Self::default() }
    }

    /// Tests whether nothing is left.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        *self == Self::default()
    }

    pub(super) fn plus(self, other: Self) -> Self {
        Self {
            white: self.white + other.white,
            base: self.base + other.base,
            highlight: self.highlight + other.highlight,
            dip: self.dip + other.dip,
            deep: self.deep + other.deep,
            sheen: self.sheen + other.sheen,
        }
    }

    pub(super) fn times(self, factor: f64) -> Self {
        Self {
            white: self.white * factor,
            base: self.base * factor,
            highlight: self.highlight * factor,
            dip: self.dip * factor,
            deep: self.deep * factor,
            sheen: self.sheen * factor,
        }
    }
}
