//! Illumination of the picture: how much of the light arrives where.

use etendue_camera::Camera;
use etendue_scene::file::AccuracySpec;
use etendue_spectrum::Bands;

/// Illumination: the light that arrives, on a grid over the picture that is interpolated in.
#[derive(Debug, Clone)]
pub(crate) struct IlluminationGrid {
    values: Vec<f64>,
    /// Places a side.
    across: u32,
    /// Columns and rows of the picture.
    size: [f64; 2],
}

impl IlluminationGrid {
    /// Returns the light that arrives at a place of the picture (pixels from the corner).
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the grid")]
    pub(crate) fn at(&self, [column, row]: [f64; 2]) -> f64 {
        let last = f64::from(self.across - 1);
        let part = |at: f64, size: f64| {
            let at = (at / size * last).clamp(0.0, last);
            let low = at.floor().min(last - 1.0);
            (low as usize, at - low)
        };
        let (x, right) = part(column, self.size[0]);
        let (y, down) = part(row, self.size[1]);
        let value = |x: usize, y: usize| self.values[y * self.across as usize + x];
        let line = |y: usize| value(x, y) * (1.0 - right) + value(x + 1, y) * right;
        line(y) * (1.0 - down) + line(y + 1) * down
    }
}

/// Computes the illumination of each band; where halves of the picture are alike, of one quarter.
pub(super) fn illumination(
    opened: &Camera,
    bands: &Bands,
    resolution: [u32; 2],
    is_mirrored: bool,
    accuracy: &AccuracySpec,
) -> Vec<IlluminationGrid> {
    let AccuracySpec { illumination_places: across, illumination_rays: rays, .. } = *accuracy;
    let size = resolution.map(f64::from);
    let share = |k: u32| f64::from(k) / f64::from(across - 1);
    let traced = if is_mirrored { across.div_ceil(2) } else { across };
    let places: Vec<[f64; 2]> = (0..traced * traced)
        .map(|k| [share(k % traced) * size[0], share(k / traced) * size[1]])
        .collect();
    let own = |k: u32| if k < traced { k } else { across - 1 - k };
    let mut by_band = Vec::new();
    for (number, group) in opened.band_groups(bands).into_iter().enumerate() {
        let quarter = opened.illumination(&places, number, rays);
        let value = |k: u32| quarter[(own(k / across) * traced + own(k % across)) as usize];
        let values: Vec<f64> = (0..across * across).map(value).collect();
        let grid = IlluminationGrid { values, across, size };
        by_band.extend(group.bands.map(|_| grid.clone()));
    }
    by_band
}
