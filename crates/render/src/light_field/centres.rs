//! Sampling places of views: the middles of the lenslets' images, and those of each band behind glass that disperses.

use etendue_camera::{CameraError, LensCamera, LightField};
use etendue_spectrum::Bands;
use rayon::prelude::*;

/// The middles of the images of a view's lenslets, row by row (pixels from the corner); `None` where no chief ray
/// gets to.
pub(super) type Places = Vec<Option<[f64; 2]>>;

/// The middles of images at the design wavelength, and in each band.
#[derive(Debug, Clone)]
pub(super) struct Centres {
    design: Places,
    /// Empty where glass does not tell wavelengths apart.
    by_band: Vec<Places>,
    /// Greatest distance of a band's centres from those of the design wavelength (pixels).
    apart: f64,
    /// From how far apart (pixels) on each band is sampled at its own. By itself 0.02: a disparity of 0.2 moves the
    /// waves of views by 0.004 columns over it, which is an error of 60 dB.
    most: f64,
}

impl Centres {
    /// The centres behind a lens for light in `bands`, which are sampled each at its own where they are more than
    /// `most` pixels apart.
    pub(super) fn new(
        lens: &LensCamera,
        light_field: &LightField,
        bands: &Bands,
        most: f64,
    ) -> Result<Self, CameraError> {
        let (rows, cols) = (light_field.grid.rows, light_field.grid.cols);
        let cells = || (0..rows * cols).into_par_iter().map(|k| (k / cols, k % cols));
        let design: Places = cells().map(|(row, col)| light_field.centre(lens, row, col)).collect();
        let lenslets = lens.lenslets_by_band(bands)?;
        let by_band: Vec<Places> = lenslets
            .iter()
            .map(|of| cells().map(|(row, col)| light_field.centre_by(lens, of, row, col)).collect())
            .collect();
        let pairs = by_band.iter().flat_map(|places| places.iter().zip(&design));
        let away = pairs.filter_map(|(own, design)| own.as_ref().zip(design.as_ref()));
        let apart = away.map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).fold(0.0, f64::max);
        Ok(Self { design, by_band, apart, most })
    }

    /// Those at which views of band `band` are sampled.
    pub(super) fn sampled(&self, band: usize) -> &Places {
        self.by_band.get(band).filter(|_| self.are_apart()).unwrap_or(&self.design)
    }

    /// Those of each band.
    pub(super) fn by_band(&self) -> &[Places] {
        &self.by_band
    }

    /// Greatest distance of a band's centres from those of the design wavelength (pixels).
    pub(super) fn apart(&self) -> f64 {
        self.apart
    }

    /// True if bands are sampled each at its own centres.
    pub(super) fn are_apart(&self) -> bool {
        self.apart > self.most
    }
}
