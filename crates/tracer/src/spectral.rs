//! From colours to the lanes that a ray carries.

use etendue_spectrum::{Curve, Illuminant, Lanes, NoOverlap, Outside};

use crate::Color;

/// The lanes of a render, and the way from linear RGB to them.
#[derive(Debug, Clone)]
pub struct Spectral {
    lanes: Lanes,
    from_rgb: Vec<[f64; 3]>,
    is_rgb: bool,
}

impl Spectral {
    /// For these lanes.
    #[must_use]
    pub fn new(lanes: &Lanes) -> Self {
        let from_rgb = lanes.from_rgb();
        Self { is_rgb: *lanes == Lanes::Rgb, from_rgb, lanes: lanes.clone() }
    }

    /// The lanes.
    #[must_use]
    pub fn lanes(&self) -> &Lanes {
        &self.lanes
    }

    /// How many lanes a ray has.
    #[must_use]
    pub fn count(&self) -> usize {
        self.from_rgb.len()
    }

    /// The wavelength that stands for lane `i` (nm).
    #[must_use]
    pub fn wavelength(&self, i: usize) -> f64 {
        self.lanes.wavelength(i)
    }

    /// Lane `i` of a linear sRGB colour.
    #[must_use]
    #[inline]
    pub fn lane(&self, color: &Color, i: usize) -> f64 {
        if self.is_rgb {
            return color[i];
        }
        let row = &self.from_rgb[i];
        row[0] * color[0] + row[1] * color[1] + row[2] * color[2]
    }

    /// A colour in all lanes.
    #[inline]
    pub fn spread(&self, color: &Color, out: &mut [f64]) {
        for (i, out) in out.iter_mut().enumerate() {
            *out = self.lane(color, i);
        }
    }

    /// An illuminant, 1 at 560 nm, in all lanes.
    ///
    /// # Errors
    ///
    /// When it is known at no wavelength of any lane.
    pub fn illuminant(&self, illuminant: Illuminant) -> Result<Vec<f64>, NoOverlap> {
        // Checked when the scene was read; a flat spectrum stands in for what cannot be.
        let curve = illuminant.curve().unwrap_or(Curve::ONE);
        self.lanes.from_curve(&curve, Outside::Zero)
    }
}
