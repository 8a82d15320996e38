//! Blocks of pixels, samples of a camera's film, and the rays that they become.

use etendue_geometry::RayBatch;

use etendue_optics::element::{LensRays, StatusCounts};

/// A rectangle of pixels. Rays of a block run row by row from its top left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixelBlock {
    /// The leftmost column.
    pub x: u32,
    /// The topmost row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl PixelBlock {
    /// The number of pixels.
    #[must_use]
    pub fn len(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// True if there is no pixel.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.width == 0 || self.height == 0
    }

    /// The columns and rows of the pixels, in the order of their rays.
    pub fn pixels(&self) -> impl Iterator<Item = (u32, u32)> + use<> {
        let Self { x, y, width, height } = *self;
        (y..y + height).flat_map(move |row| (x..x + width).map(move |column| (column, row)))
    }
}

/// Places of a batch of samples: on the film, in the pupil, and among wavelengths. The arrays have
/// one entry a sample.
#[derive(Debug, Clone, Default)]
pub struct FilmSamples {
    /// Columns (pixels) from the outer corner of the top left pixel, whose centre is (0.5, 0.5).
    pub columns: Vec<f64>,
    /// Rows (pixels) from the same corner.
    pub rows: Vec<f64>,
    /// Places in the unit square that the camera maps to its pupil; cameras without one do not look.
    pub pupil: Vec<[f64; 2]>,
    /// Places in 0..1 of the light that the rays stand for, from its shortest wavelength to its
    /// longest; cameras whose lenses do not disperse do not look.
    pub spectrum: Vec<f64>,
    /// Places in 0..1 by which the wavelength is chosen at which a ray that all bands share is traced into
    /// the scene; rays of single bands do not look.
    pub leading: Vec<f64>,
    /// Times of the frame's clock (s); empty as long as nothing moves.
    pub times: Vec<f64>,
    /// Weight of each sample by the time for which its row is open; empty when all rows are open all the time.
    pub open_shares: Vec<f64>,
    /// Index of the rays' group among the camera's [`band_groups`](crate::Camera::band_groups) for the
    /// bands that the camera was opened for.
    pub group: usize,
}

/// The rays of a batch of samples that leave the camera. Samples whose rays are blocked on the way
/// have none: they count as zero.
#[derive(Debug, Clone, Default)]
pub struct CameraRays {
    /// The rays.
    pub rays: RayBatch,
    /// Weight of the radiance of each ray in the mean over its pixel's samples: relative to a pixel
    /// that sees through an unvignetted pupil on the axis.
    pub weight: Vec<f64>,
    /// The sample of each ray.
    pub sample: Vec<u32>,
    /// Counts of rays by their outcome inside the lens, over all batches since it was last emptied.
    pub statuses: StatusCounts,
    /// The rays while they are in the lens.
    pub(crate) in_lens: LensRays,
    /// Places of the samples on the sensor (mm), one array an axis, and in the unit square.
    pub(crate) places: [Vec<f64>; 2],
    pub(crate) squares: Vec<[f64; 2]>,
    /// The samples by the wavelength that they are traced at.
    pub(crate) order: Vec<(usize, u32)>,
}

impl FilmSamples {
    /// The number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.columns.len()
    }

    /// True if there are no samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty()
    }

    /// Removes all samples and keeps the memory.
    pub fn clear(&mut self) {
        self.columns.clear();
        self.rows.clear();
        self.pupil.clear();
        self.spectrum.clear();
        self.leading.clear();
        self.times.clear();
        self.open_shares.clear();
    }

    /// Appends a sample of single bands: column and row, place in the pupil, place in the spectrum.
    pub fn push(&mut self, [column, row]: [f64; 2], pupil: [f64; 2], spectrum: f64) {
        self.columns.push(column);
        self.rows.push(row);
        self.pupil.push(pupil);
        self.spectrum.push(spectrum);
        self.leading.push(0.5);
    }
}

impl CameraRays {
    /// Removes all rays and keeps the memory and the counts.
    pub(crate) fn clear(&mut self) {
        self.rays.clear();
        self.weight.clear();
        self.sample.clear();
    }

    /// Leaves out rays that were ended before they began: they see nothing.
    pub(crate) fn drop_unseen(&mut self) {
        let sees: Vec<bool> = self.rays.t_max().iter().map(|&t_max| t_max >= 0.0).collect();
        if sees.iter().all(|&sees| sees) {
            return;
        }
        self.rays.retain(|i| sees[i]);
        let mut i = 0;
        self.sample.retain(|_| {
            i += 1;
            sees[i - 1]
        });
    }
}
