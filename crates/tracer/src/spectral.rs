//! From colours to the bands that a ray carries.

use etendue_spectrum::{Bands, Curve, Illuminant, NoOverlap, Outside};

use crate::Color;

/// The bands of a render, and the way from linear RGB to them.
#[derive(Debug, Clone)]
pub struct Spectral {
    bands: Bands,
    from_rgb: Vec<[f64; 3]>,
    is_rgb: bool,
}

impl Spectral {
    /// For these bands.
    #[must_use]
    pub fn new(bands: &Bands) -> Self {
        let from_rgb = bands.from_rgb();
        Self { is_rgb: *bands == Bands::Rgb, from_rgb, bands: bands.clone() }
    }

    /// The bands.
    #[must_use]
    pub fn bands(&self) -> &Bands {
        &self.bands
    }

    /// How many bands a ray has.
    #[must_use]
    pub fn count(&self) -> usize {
        self.from_rgb.len()
    }

    /// The wavelength that stands for band `i` (nm).
    #[must_use]
    pub fn wavelength(&self, i: usize) -> f64 {
        self.bands.wavelength(i)
    }

    /// Row `i` of a linear sRGB colour.
    #[must_use]
    #[inline]
    pub fn band(&self, color: &Color, i: usize) -> f64 {
        if self.is_rgb {
            return color[i];
        }
        let row = &self.from_rgb[i];
        row[0] * color[0] + row[1] * color[1] + row[2] * color[2]
    }

    /// A colour in all bands.
    #[inline]
    pub fn spread(&self, color: &Color, out: &mut [f64]) {
        for (i, out) in out.iter_mut().enumerate() {
            *out = self.band(color, i);
        }
    }

    /// An illuminant, 1 at 560 nm, in all bands.
    ///
    /// # Errors
    ///
    /// When it is known at no wavelength of any band.
    pub fn illuminant(&self, illuminant: Illuminant) -> Result<Vec<f64>, NoOverlap> {
        // Checked when the scene was read; a flat spectrum stands in for what cannot be.
        let curve = illuminant.curve().unwrap_or(Curve::ONE);
        self.bands.from_curve(&curve, Outside::Zero)
    }
}
