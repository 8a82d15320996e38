//! Colours, and that of a surface where it was met: linear RGB, times a curve where it has one.

use std::sync::Arc;

use etendue_spectrum::{Curve, Metal};

/// Linear RGB with the sRGB primaries, 0..=1 for reflectances.
pub type Color = [f64; 3];

/// The brightest that a light or a surface may be, in whichever unit: pictures hold no number above
/// 3·10³⁸, and the powers of all lights are added up.
pub const BRIGHTEST: f64 = 1e30;

/// A curve of a scene, and its number in the table of [`Spectral`](crate::Spectral).
#[derive(Debug, Clone, PartialEq)]
pub struct SceneCurve {
    /// The number, from 0.
    pub number: u32,
    /// The curve.
    pub curve: Arc<Curve>,
}

/// A metal by what it reflects.
#[derive(Debug, Clone, PartialEq)]
pub enum Conductor {
    /// One of the tables.
    Named(Metal),
    /// By curves of n and k: what it reflects face on and at the cosine of
    /// [`SECOND_COSINE`](crate::bsdf::SECOND_COSINE).
    Measured([SceneCurve; 2]),
}

/// A [`Conductor`] by its numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ConductorId {
    /// One of the tables.
    Named(Metal),
    /// By the numbers of its curves.
    Measured([u32; 2]),
}

impl Conductor {
    /// Its numbers.
    #[must_use]
    pub fn id(&self) -> ConductorId {
        match self {
            Self::Named(metal) => ConductorId::Named(*metal),
            Self::Measured(curves) => ConductorId::Measured(curves.each_ref().map(|c| c.number)),
        }
    }

    /// Reflectance face on, by wavelength (nm).
    #[must_use]
    pub fn face_on(&self) -> Curve {
        match self {
            Self::Named(metal) => metal.reflectance(1.0),
            Self::Measured([face_on, _]) => Curve::clone(&face_on.curve),
        }
    }

    /// The curves of the scene that it has.
    pub(crate) fn curves(&self) -> &[SceneCurve] {
        match self {
            Self::Named(_) => &[],
            Self::Measured(curves) => curves,
        }
    }
}

/// A colour times a curve.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Tint {
    /// Linear RGB.
    pub color: Color,
    /// Curve that multiplies it in bands of wavelengths.
    pub spectrum: TintSpectrum,
}

/// The curve of a [`Tint`], by its number.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum TintSpectrum {
    /// None: 1 everywhere.
    #[default]
    White,
    /// One.
    Curve {
        /// Its number.
        number: u32,
        /// Its greatest value.
        peak: f64,
    },
    /// A texel of a cube.
    Texel {
        /// The number of the cube.
        number: u32,
        /// Place on it: u and v.
        at: [f64; 2],
    },
    /// Two mixed, as squares of a checker within one sample are.
    Mixed {
        /// Their numbers.
        numbers: [u32; 2],
        /// The share of the first.
        share: f64,
        /// The greatest value of both.
        peak: f64,
    },
}

impl Tint {
    /// Nothing.
    pub const BLACK: Self = Self { color: [0.0; 3], spectrum: TintSpectrum::White };

    /// White.
    pub const WHITE: Self = Self { color: [1.0; 3], spectrum: TintSpectrum::White };

    /// The greatest that it is in any band, or more.
    #[must_use]
    pub fn peak(&self) -> f64 {
        let [r, g, b] = self.color;
        let color = r.max(g).max(b);
        match self.spectrum {
            TintSpectrum::White | TintSpectrum::Texel { .. } => color,
            TintSpectrum::Curve { peak, .. } | TintSpectrum::Mixed { peak, .. } => color * peak,
        }
    }

    /// The same with a colour in 0..=1.
    #[must_use]
    pub fn clamped(self) -> Self {
        Self { color: self.color.map(|c| c.clamp(0.0, 1.0)), ..self }
    }
}

impl From<Color> for Tint {
    fn from(color: Color) -> Self {
        Self { color, spectrum: TintSpectrum::White }
    }
}

impl SceneCurve {
    /// Its use as the spectrum of a tint.
    #[must_use]
    pub fn spectrum(&self) -> TintSpectrum {
        TintSpectrum::Curve { number: self.number, peak: self.curve.extent()[1] }
    }
}
