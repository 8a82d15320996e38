//! The spectral bands of a render: how many numbers a ray carries, and what each stands for.
//!
//! A band is a weight of a fixed spectrum, its [shape](Bands::shape): flat over visible light for
//! the single grey band, a primary of sRGB for each of three, a box for each band of wavelengths. The light of a
//! pixel is the sum of bands times shapes, so a sensor integrates it against its quantum efficiency
//! once and for all, and a flat sensor counts the same photons whatever the bands.

use std::sync::{Arc, LazyLock};

use crate::colour::{Matrix3, OBSERVER, inverse};
use crate::curve::{integral, known_everywhere, mean};
use crate::{Curve, Grid, Outside, WeightedBands, rgb};

/// Visible light (nm), where RGB assets are known.
pub const VISIBLE: [f64; 2] = [380.0, 780.0];

/// The bands of a render.
#[derive(Debug, Clone, PartialEq)]
pub enum Bands {
    /// One: the mean over [`VISIBLE`] by photons (weight λ), all that a sensor of flat quantum
    /// efficiency without colour filters can tell.
    Grey,
    /// Three: linear sRGB (see [`rgb`]).
    Rgb,
    /// The means over bands of wavelengths.
    Spectral(Grid),
    /// Such means, weighted for a sensor and a light.
    Weighted(Arc<WeightedBands>),
}

/// A curve says nothing about any band.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "the curve covers {}..={} nm, the spectral bands {}..={} nm: they do not overlap",
    curve[0], curve[1], bands[0], bands[1]
)]
pub struct NoOverlap {
    /// The curve's range (nm).
    pub curve: [f64; 2],
    /// The bands' range (nm).
    pub bands: [f64; 2],
}

impl Bands {
    /// The number of bands.
    #[must_use]
    pub fn count(&self) -> usize {
        match self {
            Self::Grey => 1,
            Self::Rgb => 3,
            Self::Spectral(grid) => grid.len(),
            Self::Weighted(bands) => bands.grid().len(),
        }
    }

    /// The wavelengths that the bands cover (nm).
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        match self {
            Self::Grey | Self::Rgb => VISIBLE,
            Self::Spectral(grid) => grid.range(),
            Self::Weighted(bands) => bands.grid().range(),
        }
    }

    /// The edges of the bands, if they are bands of wavelengths.
    #[must_use]
    pub fn grid(&self) -> Option<&Grid> {
        match self {
            Self::Spectral(grid) => Some(grid),
            Self::Weighted(bands) => Some(bands.grid()),
            Self::Grey | Self::Rgb => None,
        }
    }

    /// Names for the channels of an image, one a band: `Y`; `R`, `G`, `B`; or the bands' middles as
    /// `450nm`, `452.5nm`.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        let of_grid =
            |grid: &Grid| grid.centres().map(|nm| format!("{}nm", thousandth(nm))).collect();
        match self {
            Self::Grey => vec!["Y".into()],
            Self::Rgb => ["R", "G", "B"].map(String::from).into(),
            Self::Spectral(grid) => of_grid(grid),
            Self::Weighted(bands) => of_grid(bands.grid()),
        }
    }

    /// The wavelength that stands for band `i` where only one can be traced (nm): a band's middle,
    /// a weighted band's or a primary's centroid, 555 nm for grey.
    #[must_use]
    pub fn wavelength(&self, i: usize) -> f64 {
        match self {
            Self::Grey => 555.0,
            Self::Rgb => rgb::PRIMARY_WAVELENGTHS[i],
            Self::Spectral(grid) => 0.5 * (grid.edges()[i] + grid.edges()[i + 1]),
            Self::Weighted(bands) => bands.centroid(i),
        }
    }

    /// The spectrum that a value of 1 in band `i` stands for.
    #[must_use]
    pub fn shape(&self, i: usize) -> Curve {
        let one_over = |from, to| Curve::trusted(vec![[from, 1.0], [to, 1.0]]);
        match self {
            Self::Grey => one_over(VISIBLE[0], VISIBLE[1]),
            Self::Rgb => rgb::PRIMARIES[i].clone(),
            Self::Spectral(grid) => one_over(grid.edges()[i], grid.edges()[i + 1]),
            Self::Weighted(bands) => bands.shape(i),
        }
    }

    /// Parts of the bands' light, `(band, weight)`, whose sum is the plain mean over each band of
    /// `grid`. Bands that are not bands have none.
    #[must_use]
    pub fn means_over(&self, grid: &Grid) -> Vec<Vec<(usize, f64)>> {
        let own = self.grid();
        let bands = 0..own.map_or(0, Grid::len);
        let shapes: Vec<Curve> = bands.clone().map(|i| self.shape(i)).collect();
        let part = |i: usize, from: f64, to: f64| (i, shapes[i].integral(from, to) / (to - from));
        grid.bands()
            .map(|b| {
                let parts = bands.clone().map(|i| part(i, b.from, b.to));
                parts.filter(|(_, weight)| *weight > 0.0).collect()
            })
            .collect()
    }

    /// Weights of linear sRGB in each band: band `i` of a colour is the dot product with row `i`.
    /// The weights of a row are ≥ 0 and sum to 1, so white is 1 in every band.
    #[must_use]
    pub fn from_rgb(&self) -> Vec<[f64; 3]> {
        match self {
            Self::Grey => vec![*GREY_FROM_RGB],
            Self::Rgb => vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            Self::Spectral(grid) => {
                let primary =
                    |k: usize, from, to| mean(&rgb::PRIMARIES[k], from, to, Outside::Held);
                let row = |e: &[f64]| std::array::from_fn(|k| primary(k, e[0], e[1]));
                grid.edges().windows(2).map(row).map(normalised).collect()
            }
            Self::Weighted(bands) => {
                let primary = |i, k: usize| bands.mean(i, &rgb::PRIMARIES[k], Outside::Held);
                let row = |i| std::array::from_fn(|k| primary(i, k));
                (0..bands.grid().len()).map(row).map(normalised).collect()
            }
        }
    }

    /// Weights of each band in linear sRGB, for looking: the colour of a pixel is the sum of bands
    /// times rows. 1 in every band is white. Colours outside of sRGB have negative parts. Bands
    /// that see too little of red, green or blue to tell colours apart come out grey; colours that
    /// [`Self::from_rgb`] took into weighted bands come back exactly.
    #[must_use]
    pub fn to_rgb(&self) -> Vec<[f64; 3]> {
        match self {
            Self::Grey => vec![[1.0; 3]],
            Self::Rgb => self.from_rgb(),
            Self::Spectral(grid) => colours_of(grid),
            Self::Weighted(bands) => {
                let rows = colours_of(bands.grid());
                exact_for_primaries(&self.from_rgb(), &rows).unwrap_or(rows)
            }
        }
    }

    /// A spectrum in bands: means over bands, or its colour with negative parts set to 0.
    ///
    /// # Errors
    ///
    /// When the spectrum is known at no wavelength of any band.
    pub fn from_curve(&self, curve: &Curve, outside: Outside) -> Result<Vec<f64>, NoOverlap> {
        let [low, high] = curve.range();
        let [from, to] = self.range();
        if high <= from || low >= to {
            return Err(NoOverlap { curve: [low, high], bands: [from, to] });
        }
        if let Some(value) = curve.as_flat() {
            return Ok(vec![value; self.count()]);
        }
        Ok(match self {
            Self::Grey => {
                let known = known_everywhere(curve, from, to, outside);
                vec![integral(&[&known, &RAMP], from, to) / RAMP.integral(from, to)]
            }
            Self::Rgb => {
                let [from, to] = OBSERVER[0].range();
                let known = known_everywhere(curve, from, to, outside);
                rgb::colour(&known).map(|part| part.max(0.0)).into()
            }
            Self::Spectral(grid) => {
                grid.bands().map(|band| mean(curve, band.from, band.to, outside)).collect()
            }
            Self::Weighted(bands) => {
                (0..bands.grid().len()).map(|i| bands.mean(i, curve, outside)).collect()
            }
        })
    }
}

/// Weights of bands in linear sRGB, for looking.
fn colours_of(grid: &Grid) -> Vec<[f64; 3]> {
    let rows: Vec<[f64; 3]> = grid.bands().map(|b| rgb::colour_of_band(b.from, b.to)).collect();
    let white: [f64; 3] = std::array::from_fn(|k| rows.iter().map(|row| row[k]).sum());
    if grid.len() < 3 || white.iter().any(|&part| part < 0.05) {
        return vec![[1.0 / grid.len() as f64; 3]; grid.len()];
    }
    let balanced = |row: [f64; 3]| std::array::from_fn(|k| row[k] / white[k]);
    rows.into_iter().map(balanced).collect()
}

/// `rows` such that red, green and blue come back as they were; `None` when bands blur them too much
/// for that.
fn exact_for_primaries(from_rgb: &[[f64; 3]], rows: &[[f64; 3]]) -> Option<Vec<[f64; 3]>> {
    // What each primary comes back as.
    let back: Matrix3 = std::array::from_fn(|k| {
        std::array::from_fn(|c| from_rgb.iter().zip(rows).map(|(from, to)| from[k] * to[c]).sum())
    });
    let mended = inverse(&back)?;
    // A factor of a few sharpens the blur of wide bands, more would only sharpen noise.
    let tame = mended.iter().flatten().all(|value| value.abs() < 4.0);
    let row = |row: &[f64; 3]| std::array::from_fn(|c| (0..3).map(|k| row[k] * mended[k][c]).sum());
    tame.then(|| rows.iter().map(row).collect())
}

/// λ itself over visible light: photons in a watt are proportional to it.
static RAMP: LazyLock<Curve> =
    LazyLock::new(|| Curve::trusted(vec![[VISIBLE[0], VISIBLE[0]], [VISIBLE[1], VISIBLE[1]]]));

static GREY_FROM_RGB: LazyLock<[f64; 3]> = LazyLock::new(|| {
    normalised(std::array::from_fn(|k| {
        integral(&[&rgb::PRIMARIES[k], &RAMP], VISIBLE[0], VISIBLE[1])
    }))
});

fn normalised(weights: [f64; 3]) -> [f64; 3] {
    let sum: f64 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}

/// To a thousandth, for names.
fn thousandth(nm: f64) -> f64 {
    (nm * 1e3).round() / 1e3
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Illuminant;

    fn all() -> Vec<Bands> {
        let bands = |from, to, n| Bands::Spectral(Grid::equal(from, to, n).unwrap());
        vec![
            Bands::Grey,
            Bands::Rgb,
            bands(380.0, 780.0, 40),
            bands(400.0, 700.0, 31),
            bands(350.0, 1100.0, 75),
            bands(400.0, 700.0, 3),
            bands(800.0, 900.0, 10),
            bands(525.0, 526.0, 1),
        ]
    }

    #[test]
    fn white_is_one_in_every_band_and_white_again() {
        for bands in all() {
            let weights = bands.from_rgb();
            assert_eq!(weights.len(), bands.count());
            assert_eq!(bands.names().len(), bands.count());
            for row in &weights {
                assert!(row.iter().all(|&w| w >= 0.0));
                assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            }
            let back: [f64; 3] =
                std::array::from_fn(|k| bands.to_rgb().iter().map(|row| row[k]).sum());
            assert!(back.iter().all(|part| (part - 1.0).abs() < 1e-12), "{bands:?} {back:?}");
            let flat = bands.from_curve(&Curve::flat(0.3).unwrap(), Outside::Zero).unwrap();
            assert!(flat.iter().all(|value| (value - 0.3).abs() < 1e-12));
        }
    }

    #[test]
    fn colours_survive_fine_bands() {
        // Ten nanometres, the usual step of hyperspectral cameras, blur saturated primaries.
        for (width, tolerance) in [(5.0, 6e-3), (10.0, 2e-2)] {
            let bands = Bands::Spectral(Grid::of_width(380.0, 780.0, width).unwrap());
            for colour in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.2, 0.5, 0.8]] {
                let mut back = [0.0; 3];
                for (weights, row) in bands.from_rgb().iter().zip(bands.to_rgb()) {
                    let band: f64 = (0..3).map(|k| weights[k] * colour[k]).sum();
                    back = std::array::from_fn(|k| back[k] + band * row[k]);
                }
                let worst = (0..3).map(|k| (back[k] - colour[k]).abs()).fold(0.0, f64::max);
                assert!(worst < tolerance, "{width} nm: {colour:?} came back as {back:?}");
            }
        }
    }

    #[test]
    fn a_flat_sensor_counts_the_same_photons_in_any_bands() {
        let photons = |bands: &Bands, values: &[f64]| -> f64 {
            let of_band =
                |i: usize| values[i] * integral(&[&bands.shape(i), &RAMP], VISIBLE[0], VISIBLE[1]);
            (0..bands.count()).map(of_band).sum()
        };
        let colour = [0.9, 0.2, 0.4];
        let of_colour = |bands: &Bands| -> f64 {
            let dot = |row: &[f64; 3]| (0..3).map(|k| row[k] * colour[k]).sum();
            let values: Vec<f64> = bands.from_rgb().iter().map(dot).collect();
            photons(bands, &values)
        };
        let grey = of_colour(&Bands::Grey);
        assert!((of_colour(&Bands::Rgb) / grey - 1.0).abs() < 1e-6);
        let bands = Bands::Spectral(Grid::of_width(380.0, 780.0, 10.0).unwrap());
        // A band's mean is taken by watts, the grey band's by photons: 10 nm differ by 1e-4.
        assert!((of_colour(&bands) / grey - 1.0).abs() < 2e-4);
    }

    #[test]
    fn spectra_become_bands() {
        let lamp = Illuminant::A.curve().unwrap();
        let rgb = Bands::Rgb.from_curve(&lamp, Outside::Zero).unwrap();
        assert!(rgb[0] > rgb[1] && rgb[1] > rgb[2], "tungsten is orange: {rgb:?}");
        let step = Curve::sampled(vec![[500.0, 0.25], [600.0, 0.75]]).unwrap();
        let bands = Bands::Spectral(Grid::equal(400.0, 700.0, 3).unwrap());
        let held = bands.from_curve(&step, Outside::Held).unwrap();
        let zero = bands.from_curve(&step, Outside::Zero).unwrap();
        for (value, expected) in held.iter().chain(&zero).zip([0.25, 0.5, 0.75, 0.0, 0.5, 0.0]) {
            assert!((value - expected).abs() < 1e-14, "{held:?} {zero:?}");
        }
        let primary = Bands::Rgb.from_curve(&rgb::PRIMARIES[1], Outside::Held).unwrap();
        assert!((primary[1] - 1.0).abs() < 1e-9 && primary[0].abs() + primary[2].abs() < 1e-9);
        let infrared = Curve::sampled(vec![[900.0, 1.0], [950.0, 1.0]]).unwrap();
        for bands in [Bands::Grey, Bands::Rgb, bands] {
            let error = bands.from_curve(&infrared, Outside::Held).unwrap_err();
            assert!(error.to_string().contains("900..=950 nm"), "{error}");
        }
    }

    #[test]
    fn channels_are_named_by_their_wavelength() {
        let bands = Bands::Spectral(Grid::from_edges(vec![400.0, 405.0, 500.0]).unwrap());
        assert_eq!(bands.names(), ["402.5nm", "452.5nm"]);
        assert_eq!(bands.wavelength(1), 452.5);
    }
}
