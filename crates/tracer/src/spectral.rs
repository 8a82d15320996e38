//! From colours to the bands that a ray carries.

use std::sync::Arc;

use etendue_spectrum::{Bands, Curve, Metal, NoOverlap, Outside};

use crate::bsdf::metal;
use crate::{
    Absorption, Color, ConductorId, Cube, Material, SceneCube, SceneCurve, Tint, TintSpectrum,
};

/// Shares of a band's light between which a wavelength is interpolated. Not a setting: wavelengths are drawn, and over
/// a 32nd of a band's light glass bends them in proportion.
const SHARES: usize = 32;

/// The bands of a render, and the way from linear RGB to them.
#[derive(Debug, Clone)]
pub struct Spectral {
    bands: Bands,
    /// Values of red, green and blue in each band.
    from_rgb: [Vec<f64>; 3],
    is_rgb: bool,
    /// The [`Bands::wavelength`] of each band (nm): of weighted bands it is an integral, and paths ask for it at
    /// every surface.
    wavelengths: Vec<f64>,
    /// The [`Bands::quantiles`] of each band (nm).
    quantiles: Vec<Vec<f64>>,
    /// Of each metal by its number, and band: the reflectance face on, and the dip beside it.
    metals: Vec<[f64; 2]>,
    /// Of each curve of the scene by its number, and band: its mean.
    curves: Vec<f64>,
    /// Each cube of the scene by its number, and its texels in these bands.
    cubes: Vec<Option<(Arc<Cube>, Vec<f32>)>>,
}

impl Spectral {
    /// For these bands.
    #[must_use]
    pub fn new(bands: &Bands) -> Self {
        let from_rgb = bands.from_rgb();
        let count = from_rgb.len();
        let from_rgb = std::array::from_fn(|k| from_rgb.iter().map(|row| row[k]).collect());
        let quantiles = (0..count).map(|i| bands.quantiles(i, SHARES)).collect();
        let metals = Metal::ALL.iter().flat_map(|&metal| reflectances(metal, bands)).collect();
        let wavelengths = (0..count).map(|i| bands.wavelength(i)).collect();
        Self {
            is_rgb: *bands == Bands::Rgb,
            from_rgb,
            wavelengths,
            quantiles,
            metals,
            curves: Vec::new(),
            cubes: Vec::new(),
            bands: bands.clone(),
        }
    }

    /// For these bands, and the curves of these materials.
    #[must_use]
    pub fn of(bands: &Bands, materials: &[Material]) -> Self {
        let mut spectral = Self::new(bands);
        let count = spectral.count();
        for curve in materials.iter().flat_map(Material::curves) {
            let start = curve.number as usize * count;
            let means = held_in(bands, &curve.curve);
            if spectral.curves.len() < start + count {
                spectral.curves.resize(start + count, 1.0);
            }
            spectral.curves[start..start + count].copy_from_slice(&means);
        }
        // Red, green and blue are the cubes' looks.
        let cubes = materials.iter().filter(|_| !spectral.is_rgb);
        for SceneCube { number, cube } in cubes.flat_map(Material::cubes) {
            let number = *number as usize;
            if spectral.cubes.len() <= number {
                spectral.cubes.resize_with(number + 1, || None);
            }
            spectral.cubes[number] = Some((Arc::clone(cube), cube.in_bands(bands)));
        }
        spectral
    }

    /// Reflectance of a metal face on in band `i`, and the dip of its reflectance
    /// ([`crate::bsdf::Weights::dip`]).
    pub(crate) fn metal(&self, metal: ConductorId, i: usize) -> [f64; 2] {
        match metal {
            ConductorId::Named(metal) => self.metals[metal as usize * self.count() + i],
            ConductorId::Measured(numbers) => {
                let [face_on, second] = numbers.map(|number| self.curve(number, i));
                [face_on, metal::dip(face_on, second)]
            }
        }
    }

    /// The mean of a curve of the scene over band `i`.
    #[inline]
    fn curve(&self, number: u32, i: usize) -> f64 {
        self.curves.get(number as usize * self.count() + i).copied().unwrap_or(1.0)
    }

    /// A cube of the scene at (u, v) in band `i`.
    pub(crate) fn texel(&self, number: u32, at: [f64; 2], i: usize) -> f64 {
        let Some(Some((cube, texels))) = self.cubes.get(number as usize) else { return 1.0 };
        let value =
            |(texel, share): (usize, f64)| share * f64::from(texels[texel * self.count() + i]);
        cube.corners(at).into_iter().map(value).sum()
    }

    /// A tint in band `i`.
    #[must_use]
    #[inline]
    pub fn tint(&self, tint: &Tint, i: usize) -> f64 {
        let color = self.band(&tint.color, i);
        match tint.spectrum {
            TintSpectrum::White => color,
            TintSpectrum::Curve { number, .. } => color * self.curve(number, i),
            TintSpectrum::Texel { number, at } => color * self.texel(number, at, i),
            TintSpectrum::Mixed { numbers: [a, b], share, .. } => {
                color * (share * self.curve(a, i) + (1.0 - share) * self.curve(b, i))
            }
        }
    }

    /// The bands.
    #[must_use]
    pub fn bands(&self) -> &Bands {
        &self.bands
    }

    /// Number of bands of a ray.
    #[must_use]
    pub fn count(&self) -> usize {
        self.wavelengths.len()
    }

    /// Tests whether the bands are linear red, green and blue.
    #[must_use]
    pub fn is_rgb(&self) -> bool {
        self.is_rgb
    }

    /// The wavelength that stands for band `i` (nm).
    #[must_use]
    pub fn wavelength(&self, i: usize) -> f64 {
        self.wavelengths[i]
    }

    /// The wavelength (nm) of band `i` below which lies the share `u` (0..1) of its light.
    #[must_use]
    pub fn wavelength_at(&self, i: usize, u: f64) -> f64 {
        let scaled = u.clamp(0.0, 1.0) * SHARES as f64;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in range")]
        let k = (scaled as usize).min(SHARES - 1);
        let [from, to] = [self.quantiles[i][k], self.quantiles[i][k + 1]];
        from + (to - from) * (scaled - k as f64)
    }

    /// Row `i` of a linear sRGB colour.
    #[must_use]
    #[inline]
    pub fn band(&self, color: &Color, i: usize) -> f64 {
        if self.is_rgb {
            return color[i];
        }
        let [red, green, blue] = &self.from_rgb;
        red[i] * color[0] + green[i] * color[1] + blue[i] * color[2]
    }

    /// A colour in all bands.
    #[inline]
    pub fn spread(&self, color: &Color, out: &mut [f64]) {
        for (i, out) in out.iter_mut().enumerate() {
            *out = self.band(color, i);
        }
    }

    /// A tint in all bands.
    pub fn spread_tint(&self, tint: &Tint, out: &mut [f64]) {
        for (i, out) in out.iter_mut().enumerate() {
            *out = self.tint(tint, i);
        }
    }

    /// Emission of a light in all bands, nothing outside of the curve's range.
    ///
    /// # Errors
    ///
    /// When it is known at no wavelength of any band.
    pub fn emission(&self, curve: &Curve) -> Result<Vec<f64>, NoOverlap> {
        self.bands.from_curve(curve, Outside::Zero)
    }
}

impl Absorption {
    /// Share of light that is left after the distance.
    pub(crate) fn tint(&self, spectral: &Spectral) -> Tint {
        let (color, spectrum) = part(spectral, self.color, self.curve.as_ref());
        Tint { color, spectrum }
    }
}

/// The factor of a part's image, and its spectrum: the look alone where light is traced as red, green and blue.
pub(crate) fn part(
    spectral: &Spectral,
    look: Color,
    curve: Option<&SceneCurve>,
) -> (Color, TintSpectrum) {
    match curve.filter(|_| !spectral.is_rgb()) {
        Some(curve) => ([1.0; 3], curve.spectrum()),
        None => (look, TintSpectrum::White),
    }
}

/// The means of a curve over bands, which goes on beyond its ends as it is there.
fn held_in(bands: &Bands, curve: &Curve) -> Vec<f64> {
    bands
        .from_curve(curve, Outside::Held)
        .unwrap_or_else(|_| (0..bands.count()).map(|i| curve.held(bands.wavelength(i))).collect())
}

/// Reflectance of a metal face on in each band, and the dip of its reflectance.
fn reflectances(named: Metal, bands: &Bands) -> Vec<[f64; 2]> {
    let at = |cosine| held_in(bands, &named.reflectance(cosine));
    let (face_on, second) = (at(1.0), at(metal::SECOND_COSINE));
    face_on.iter().zip(&second).map(|(&f, &s)| [f, metal::dip(f, s)]).collect()
}
