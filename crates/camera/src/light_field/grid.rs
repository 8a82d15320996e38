//! The lenslets whose images lie whole on the sensor, as rows and columns of a picture, and the views
//! that are taken through them.

use glam::DVec2;

use crate::CameraError;
use crate::lens::{LensCamera, LensletChiefs};
use etendue_optics::element::Grid;

/// Pixels around the middle of a view's pixel that its sampling looks at.
const MARGIN: f64 = 2.0;

/// From the rim of a lenslet's image to the views that are taken unasked (pixels): cubic sampling looks
/// that far for all but a hundredth of its weight.
const RIM: f64 = 1.75;

/// The most views a side.
const MOST_VIEWS: u32 = 255;

/// Lenslets' images that are narrower than this (pixels) hold no views: cubic sampling looks at four pixels,
/// which would mix all of the opening.
const LEAST_IMAGE: f64 = 5.0;

/// Over how many pixels parallel light in front of a lenslet may be spread on the sensor: a view is taken
/// through one pixel's share of the opening, and twice that is told apart from it at 40 dB. Not a setting, nor is the
/// narrowest image: which views there are is decided while the camera is read, and which are good enough by
/// `view_psnr`.
const MOST_BLUR: f64 = 1.0;

/// Rows and columns of lenslets, as the picture has them: row 0 at the top, column 0 on the left.
#[derive(Debug, Clone, PartialEq)]
pub struct LensletGrid {
    /// Packing of the lenslets. In a hexagonal grid odd rows stand half a lenslet further right.
    pub grid: Grid,
    /// Rows.
    pub rows: u32,
    /// Columns.
    pub cols: u32,
    /// Row and column 0 in steps of the array: see [`LensletGrid::cell`].
    first: [f64; 2],
    /// −1 where the picture is upside down on the sensor, else 1.
    turn: f64,
}

/// A light-field camera's views.
#[derive(Debug, Clone, PartialEq)]
pub struct LightField {
    /// The lenslets of a view's pixels.
    pub grid: LensletGrid,
    /// Views along each side.
    pub views: u32,
    /// The fewest views a side that will do: as many as were asked for, else 1.
    pub least_views: u32,
    /// From one view to the next on the sensor (pixels).
    pub step: f64,
    /// Of the distance of viewpoints that the paraxial lens has, how much they are apart: 1 until rays
    /// through the whole opening are asked.
    pub pupil_share: f64,
    /// From the middle of a lenslet's image to the next one's (pixels).
    pub image_pitch: f64,
    /// The diameter of a lenslet's image of the main lens' opening (pixels), were it round.
    pub image_diameter: f64,
    /// Rotation of the rows of the picture (radians), from right towards down.
    pub rotation: f64,
    /// The distance that a refocused picture is asked for (m), from the entrance pupil.
    pub refocus: Option<f64>,
    /// Reason why pixels at one offset behind the lenslets are no views, where they are none.
    pub no_views: Option<String>,
}

impl LensletGrid {
    /// From a row to the next over the distance of lenslets in a row.
    #[must_use]
    pub fn row_height(&self) -> f64 {
        match self.grid {
            Grid::Square => 1.0,
            Grid::Hexagonal => 0.75_f64.sqrt(),
        }
    }

    /// The cell of the array of a row and column.
    #[must_use]
    pub fn cell(&self, row: u32, col: u32) -> [f64; 2] {
        self.cell_at(f64::from(row), f64::from(col))
    }

    fn cell_at(&self, row: f64, col: f64) -> [f64; 2] {
        let (row, col) = (row + self.first[0], col + self.first[1]);
        let j = -self.turn * row;
        match self.grid {
            Grid::Square => [self.turn * col, j],
            Grid::Hexagonal => {
                let shift = if row.rem_euclid(2.0) == 0.0 { 0.0 } else { 0.5 };
                [self.turn * (col + shift) - 0.5 * j, j]
            }
        }
    }

    /// The row and column, from the array's own lenslet (0, 0), of a cell.
    fn place([i, j]: [f64; 2], grid: Grid, turn: f64) -> [f64; 2] {
        let row = -turn * j;
        match grid {
            Grid::Square => [row, turn * i],
            Grid::Hexagonal => {
                let shift = if row.rem_euclid(2.0) == 0.0 { 0.0 } else { 0.5 };
                [row, turn * (i + 0.5 * j) - shift]
            }
        }
    }

    /// The largest block of rows and columns, grown from the middle of the sensor, of which all `fit`.
    fn grown(
        middle: [f64; 2],
        grid: Grid,
        turn: f64,
        fit: impl Fn([f64; 2]) -> bool,
    ) -> Option<Self> {
        let at = |row: f64, col: f64| {
            Self { grid, rows: 1, cols: 1, first: [row, col], turn }.cell_at(0.0, 0.0)
        };
        let [row, col] = Self::place(middle, grid, turn).map(f64::round);
        if !fit(at(row, col)) {
            return None;
        }
        let (mut top, mut bottom, mut left, mut right) = (row, row, col, col);
        let across = |row: f64, left: f64, right: f64| {
            (0..=count(left, right)).all(|k| fit(at(row, left + f64::from(k))))
        };
        let down = |col: f64, top: f64, bottom: f64| {
            (0..=count(top, bottom)).all(|k| fit(at(top + f64::from(k), col)))
        };
        loop {
            let before = [top, bottom, left, right];
            if down(left - 1.0, top, bottom) {
                left -= 1.0;
            }
            if down(right + 1.0, top, bottom) {
                right += 1.0;
            }
            if across(top - 1.0, left, right) {
                top -= 1.0;
            }
            if across(bottom + 1.0, left, right) {
                bottom += 1.0;
            }
            if before == [top, bottom, left, right] {
                break;
            }
        }
        // Odd rows are those that are moved.
        if grid == Grid::Hexagonal && top.rem_euclid(2.0) != 0.0 && bottom > top {
            top += 1.0;
        }
        let (rows, cols) = (count(top, bottom) + 1, count(left, right) + 1);
        Some(Self { grid, rows, cols, first: [top, left], turn })
    }
}

/// The steps from one whole number to another.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "at most a million lenslets a side"
)]
fn count(from: f64, to: f64) -> u32 {
    (to - from).max(0.0) as u32
}

/// Refuses images of lenslets, of a diameter at distances (pixels), that pixels do not sample.
fn images_must_be_sampled([image_diameter, image_pitch]: [f64; 2]) -> Result<(), CameraError> {
    let fault = |key: &str, why: String| CameraError::new(key, why);
    if image_pitch < 2.0 {
        return Err(fault(
            "microlenses.pitch",
            format!(
                "the images of the lenslets are {image_pitch:.2} pixels apart: a light field needs 2 or \
                 more\nhint: give smaller pixels or a larger pitch"
            ),
        ));
    }
    if image_diameter < 1.0 {
        return Err(fault(
            "f_number",
            format!(
                "the images that lenslets make of the main lens' opening are {image_diameter:.2} pixels \
                 wide, smaller than a pixel: no pixel sees a part of the opening\nhint: open the lens, or give \
                 smaller pixels or lenslets of a longer focal length"
            ),
        ));
    }
    Ok(())
}

impl LightField {
    /// The views of a lens with lenslets: as many as asked for, or as the opening holds.
    pub(crate) fn new(
        lens: &LensCamera,
        resolution: [u32; 2],
        views: Option<u32>,
        step: Option<f64>,
    ) -> Result<Self, CameraError> {
        let fault = |key: &str, why: String| CameraError::new(key, why);
        let Some(lenslets) = lens.lenslets() else {
            return Err(fault("microlenses", "there are none behind a lens".to_owned()));
        };
        let pixel = lens.focused().pixel_pitch() * 1e-3;
        let [image_diameter, image_pitch] = lenslets.fit().map(|length| length / pixel);
        let step = step.unwrap_or(1.0);
        if !(step > 0.0 && step.is_finite()) {
            return Err(fault("view_step", format!("{step} is not above zero")));
        }
        images_must_be_sampled([image_diameter, image_pitch])?;
        // The middle of an image that no neighbour reaches into.
        let alone = image_diameter.min(2.0 * image_pitch - image_diameter);
        let least_views = views.unwrap_or(1);
        let views = match views {
            None => most_views(alone, step),
            Some(0) => return Err(fault("views", "is 0; it must be 1 or more".to_owned())),
            Some(views) => views,
        };
        if views > MOST_VIEWS || f64::from(views - 1) * step + 1.0 > image_pitch {
            return Err(fault(
                "views",
                format!(
                    "{views} views, {step} pixels apart, need more than the {image_pitch:.2} pixels from a \
                     lenslet's image to the next: there are no samples of the opening for more than \
                     {:.0}\nhint: ask for fewer, for a smaller view_step, or for smaller pixels",
                    ((image_pitch - 1.0) / step).floor() + 1.0
                ),
            ));
        }
        // A view's pixels, and the whole image.
        let [cosine, sine] = lenslets.view().array.lattice.turn;
        let corner = cosine.abs() + sine.abs();
        let reach = (0.5 * f64::from(views - 1) * step * corner + MARGIN)
            .max(0.5 * image_diameter.min(image_pitch) + 0.5);
        let size = DVec2::from(resolution.map(f64::from));
        let turn = lens.focused().turn();
        let view = lenslets.view();
        let [half_width, half_height] = view.array.half_size;
        let fit = |cell: [f64; 2]| {
            let centre = view.centre(cell) - view.decentre;
            let margin = view.array.reach;
            let whole =
                centre.x.abs() + margin <= half_width && centre.y.abs() + margin <= half_height;
            let at = lenslets
                .image_centre_nearly(cell)
                .map(|at| DVec2::from(lens.focused().pixel_of(at)));
            whole
                && at.is_some_and(|at| {
                    at.min_element() >= reach && (size - at).min_element() >= reach
                })
        };
        let middle = lens.focused().sensor_point();
        let grid = lenslets
            .own_cell(middle)
            .and_then(|cell| LensletGrid::grown(cell, view.array.lattice.grid, turn, fit))
            .ok_or_else(|| {
                let why = "not one lenslet has its image whole on the sensor\nhint: give more pixels, a smaller \
                           pitch, or fewer views";
                fault("microlenses", why.to_owned())
            })?;
        let rotation = (-sine).atan2(cosine);
        let no_views = lenslets.no_views(pixel, alone);
        Ok(Self {
            grid,
            views,
            least_views,
            step,
            pupil_share: 1.0,
            image_pitch,
            image_diameter,
            rotation,
            refocus: None,
            no_views,
        })
    }

    /// The offset of a view from the middle of a lenslet's image (pixels right, pixels down): views step
    /// along the rows of lenslets and across them, from the left and from the top.
    #[must_use]
    pub fn offset(&self, across: u32, down: u32) -> [f64; 2] {
        let middle = 0.5 * f64::from(self.views - 1);
        let [along, beyond] = [across, down].map(|k| (f64::from(k) - middle) * self.step);
        let (sine, cosine) = self.rotation.sin_cos();
        [cosine * along - sine * beyond, sine * along + cosine * beyond]
    }

    /// The middle ones of its views, `views` a side, with viewpoints `pupil_share` times as far apart as
    /// those of the paraxial lens.
    #[must_use]
    pub fn narrowed(&self, views: u32, pupil_share: f64) -> Self {
        Self { views, pupil_share, ..self.clone() }
    }

    /// Centre of a lenslet's image on the sensor (pixels from the corner).
    #[must_use]
    pub fn centre(&self, lens: &LensCamera, row: u32, col: u32) -> Option<[f64; 2]> {
        self.centre_by(lens, lens.lenslets()?, row, col)
    }

    /// Centre of the image as by [`Self::centre`], with lenslets of their own, as light of another wavelength has them.
    #[must_use]
    pub fn centre_by(
        &self,
        lens: &LensCamera,
        lenslets: &LensletChiefs,
        row: u32,
        col: u32,
    ) -> Option<[f64; 2]> {
        lenslets.image_centre(self.grid.cell(row, col)).map(|at| lens.focused().pixel_of(at))
    }
}

/// The odd number of views a side whose corners are inside a round image.
fn most_views(diameter: f64, step: f64) -> u32 {
    let half = ((0.5 * diameter - RIM) * std::f64::consts::FRAC_1_SQRT_2 / step).floor();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and half the most views"
    )]
    let half = half.clamp(0.0, f64::from(MOST_VIEWS / 2)) as u32;
    2 * half + 1
}

impl LensletChiefs {
    /// Reason why pixels `pixel` (mm) wide at one offset behind the lenslets do not see the same part of the opening
    /// through all of each lenslet, in images of which `alone` pixels are free of their neighbours.
    fn no_views(&self, pixel: f64, alone: f64) -> Option<String> {
        if alone < LEAST_IMAGE {
            return Some(format!(
                "only {:.2} pixels of a lenslet's image of the main lens' opening are free of its \
                 neighbours' light, fewer than {LEAST_IMAGE}: give smaller pixels, or set the f-number of \
                 the main lens to the lenslets'",
                alone.max(0.0)
            ));
        }
        // Slopes in front of a lenslet change by Sₐ over its opening, and by Sₚ over the sensor.
        let view = self.view();
        let blur = |kind| {
            let sight = view.sight(kind, self.sensor_z());
            2.0 * view.array.reach * (sight.slope[0] / sight.slope[1]).abs() / pixel
        };
        let blurs = (0..view.array.types.len()).map(blur);
        let widest = blurs.fold(0.0, f64::max);
        (widest > MOST_BLUR).then(|| {
            format!(
                "the camera is a focused one: its lenslets see a picture of the main lens sharp and not its \
                 opening, of which every pixel sees {widest:.1} pixels' worth. A pixel of each lenslet makes no \
                 view of it; for views, leave out `picture_distance`, and stand the sensor in the focus of \
                 all lenslets"
            )
        })
    }

    /// The diameter of the image that a lenslet makes of the main lens' opening, and the distance from one
    /// to the next, on the sensor (mm).
    #[must_use]
    pub fn fit(&self) -> [f64; 2] {
        let view = self.view();
        let [slope, _] = self.central();
        let pupil = view.main.paraxial(view.main.wavelength()).ok().map(|p| p.exit_pupil);
        let pitch = view.array.lattice.pitch;
        match pupil.and_then(|pupil| Some((view.front_z - pupil.z?, pupil.diameter?))) {
            Some((distance, diameter)) => {
                [(diameter / distance / slope).abs(), pitch * (1.0 + 1.0 / (distance * slope))]
            }
            None => [f64::INFINITY, pitch],
        }
    }
}
