//! Refocused pictures of focused cameras by patch rendering: the main lens' picture in a plane, put together from
//! what each lenslet sees of it.
//!
//! A lenslet with its middle at L images the point P of a plane at the distance a in front of it to the sensor's
//! point s = L + (L − P) m, where m = b/a for thin lenslets at the distance b from the sensor. Of a plane, a lenslet of
//! width d has a patch of m d to itself: A. Lumsdaine, T. Georgiev, "The focused plenoptic camera", 2009. What all
//! lenslets see of a point is averaged, which is the blending of T. Georgiev, A. Lumsdaine, "Focused plenoptic camera
//! and rendering", 2010: each point by all of the opening that the pixels used see, and not by the part that one lenslet
//! sees of it, which is another from point to point.

use etendue_camera::{LensCamera, LightField};
use etendue_geometry::glam::DVec2;
use etendue_optics::element::Grid;
use etendue_optics::train::{BehindLenslets, Focus};
use etendue_spectrum::Bands;
use rayon::prelude::*;
use serde::Serialize;

use super::views::{picture, planes, sampled};
use crate::output::{Picture, PictureError};

/// From the light of neighbours to what is sampled (pixels): cubic sampling looks that far for all but a
/// hundredth of its weight.
const RIM: f64 = 1.75;

/// Over how many pixels of the refocused picture a lenslet may spread a point of the plane to count as sharp, where
/// others are sharper: waves of 7 pixels lose 3.3 % of their amplitude by it.
const MOST_BLUR: f64 = 1.0;

/// Layout by which a picture is put together.
#[derive(Debug, Clone)]
pub(super) struct Patches {
    pub(super) facts: PatchFacts,
    lenslets: Vec<PatchLenslet>,
    /// Pixels of the raw picture.
    raw: DVec2,
}

/// A lenslet's middle and that of its image (raw pixels from the corner).
#[derive(Debug, Clone, Copy)]
struct PatchLenslet {
    middle: DVec2,
    image: DVec2,
    /// True if it sees the plane as sharp as any does.
    is_sharp: bool,
}

/// Facts that another renderer needs.
#[derive(Debug, Clone, Serialize)]
pub(super) struct PatchFacts {
    formula: &'static str,
    /// The plane that is sharp, from the entrance pupil (m); `null` for infinity.
    pub(super) distance_m: Option<f64>,
    /// From the main lens' picture of it to the lenslets, negative for one behind them.
    picture_distance_mm: f64,
    /// From the main lens' picture to the sensor: negative where the picture is behind the lenslets.
    magnification: f64,
    /// The same of red, green and blue light behind glass that disperses; `null` elsewhere.
    magnification_by_color: Option<[f64; 3]>,
    /// Width of the patch that a lenslet has to itself: its pitch times the magnification.
    patch_px: f64,
    /// Distance from the middle of its image within which a lenslet's pixels are used.
    reach_px: f64,
    /// Over how many pixels of the refocused picture the sharpest lenslets spread a point of the plane.
    blur_px: f64,
    /// The pixels of the refocused picture in the main lens' picture: raw ones over the magnification.
    pixel_pitch_um: f64,
    /// Columns and rows of the refocused picture, whose middle is on the axis.
    resolution: [u32; 2],
}

const FORMULA: &str = "pixel (X, Y) of the refocused picture is p = ((raw_size - 1)/2 + ((X, Y) - (resolution - 1)/2) \
                       / |magnification|) in raw pixels; a lenslet at lenslet_centres_px L has it at L + (L - p) \
                       magnification, which is used within reach_px of its centres_px; the picture is the sum of the raw \
                       values at these places over that of the white ones";

/// A plane that lenslets see without gaps.
#[derive(Debug, Clone)]
pub(super) struct PatchPlane {
    facts: PatchFacts,
    /// Over how many pixels of the refocused picture each type of lenslet spreads a point.
    blurs: Vec<f64>,
    /// z of the main lens' picture (mm).
    z: f64,
}

impl PatchPlane {
    /// The plane at `distance` (m) from the entrance pupil, or else that which lenslets see sharp.
    ///
    /// # Errors
    ///
    /// Why patches do not make its picture.
    pub(super) fn new(
        lens: &LensCamera,
        light_field: &LightField,
        distance: Option<f64>,
    ) -> Result<Self, String> {
        let lenslets = lens.lenslets().ok_or("there are no lenslets")?;
        let (view, focused) = (lenslets.view(), lens.focused());
        let (pixel, sensor_z) = (1e-3 * focused.pixel_pitch(), focused.sensor_z());
        let (distance, z) = match distance {
            Some(distance) => {
                let z = view.main.sensor_z(Focus::Distance(distance));
                (distance, z.map_err(|fault| fault.to_string())?)
            }
            None => (focused.object_distance(), view.picture_z(sensor_z)),
        };
        let magnification = magnification(view, sensor_z, z);
        // What a lenslet has of the plane, and what of its image is free of the neighbours' light.
        let lenslet = view.array.lattice.pitch / pixel;
        let patch = magnification.abs() * lenslet;
        let kinds = 0..view.array.types.len();
        let spread = kinds.clone().map(|kind| spread(view, kind, sensor_z) / pixel);
        let image = light_field.image_diameter + spread.fold(0.0, f64::max);
        let reach = 0.5 * image.min(2.0 * light_field.image_pitch - image) - RIM;
        let corner = match light_field.grid.grid {
            Grid::Square => 0.5_f64.sqrt(),
            Grid::Hexagonal => 1.0 / 3.0_f64.sqrt(),
        };
        if !(reach >= patch * corner && patch > 0.0) {
            return Err(format!(
                "each lenslet has a patch of {patch:.1} pixels of the plane at {distance:.4} m, and {:.1} pixels \
                 about the middle of its image that are free of its neighbours' light: patches leave gaps; give \
                 lenslets that are farther from the main lens' picture (`picture_distance`), or smaller pixels",
                (2.0 * reach).max(0.0)
            ));
        }
        let pitch = pixel / magnification.abs();
        let blur = |kind| {
            let sight = view.sight(kind, sensor_z);
            let away = sight.height[0] + sight.slope[0] * (view.front_z - z);
            2.0 * view.array.reach * away.abs() / pitch
        };
        let blurs: Vec<f64> = kinds.map(blur).collect();
        let facts = PatchFacts {
            formula: FORMULA,
            distance_m: distance.is_finite().then_some(distance),
            picture_distance_mm: view.front_z - view.principal_distance(0) - z,
            magnification,
            magnification_by_color: None,
            patch_px: patch,
            reach_px: reach,
            blur_px: blurs.iter().copied().fold(f64::INFINITY, f64::min),
            pixel_pitch_um: 1e3 * pitch,
            resolution: [0; 2],
        };
        Ok(Self { facts, blurs, z })
    }
}

impl Patches {
    /// Of the plane at `distance` (m) from the entrance pupil, or else of that which lenslets see sharp.
    ///
    /// # Errors
    ///
    /// Why there is no such picture.
    pub(super) fn new(
        lens: &LensCamera,
        light_field: &LightField,
        distance: Option<f64>,
    ) -> Result<Self, String> {
        let PatchPlane { mut facts, blurs, z } = PatchPlane::new(lens, light_field, distance)?;
        let lenslets = lens.lenslets().ok_or("there are no lenslets")?;
        let (view, focused) = (lenslets.view(), lens.focused());
        let by_color = lens.lenslets_by_band(&Bands::Rgb).map_err(|fault| fault.to_string())?;
        let by_color: Vec<f64> =
            by_color.iter().map(|of| magnification(of.view(), focused.sensor_z(), z)).collect();
        facts.magnification_by_color = by_color.try_into().ok();
        let grid = &light_field.grid;
        let cells = (0..grid.rows * grid.cols).map(|k| (k / grid.cols, k % grid.cols));
        let lenslet = |(row, col)| {
            let cell = grid.cell(row, col);
            Some(PatchLenslet {
                middle: focused.pixel_of(view.centre(cell)).into(),
                image: light_field.centre(lens, row, col)?.into(),
                is_sharp: blurs[view.array.type_at(cell)] <= facts.blur_px.max(MOST_BLUR),
            })
        };
        let mut patches = Self {
            lenslets: cells.filter_map(lenslet).collect(),
            raw: 2.0 * DVec2::from(focused.pixel_of(DVec2::ZERO)),
            facts,
        };
        patches.crop();
        let narrowest = f64::from(patches.facts.resolution[0].min(patches.facts.resolution[1]));
        if narrowest < 2.0 * patches.facts.patch_px.max(1.0) {
            return Err(
                "the lenslets whose images are whole see too little of the plane: give more pixels"
                    .into(),
            );
        }
        Ok(patches)
    }

    /// Note for the user.
    pub(super) fn note(&self) -> Option<String> {
        let blur = self.facts.blur_px;
        (blur > MOST_BLUR).then(|| {
            format!(
                "refocused: the lenslets are out of focus at its distance, and spread a point over {blur:.1} of its \
                 pixels"
            )
        })
    }

    /// Leaves of the pixels that the sensor's middle has those about the axis of which all are seen.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "no more than the pixels of the sensor times a patch's share of an image"
    )]
    fn crop(&mut self) {
        let scale = self.facts.magnification.abs();
        let [width, height] = (self.raw * scale).floor().to_array().map(|side| side as u32);
        self.facts.resolution = [width, height];
        let mut is_seen = vec![false; width as usize * height as usize];
        for lenslet in &self.lenslets {
            self.seen_by(lenslet, self.facts.magnification, |at, _| is_seen[at] = true);
        }
        let [mut left, mut top] = [0, 0];
        let unseen = |columns: std::ops::Range<u32>, rows: std::ops::Range<u32>| {
            let dark = rows.flat_map(|row| columns.clone().map(move |column| (row, column)));
            dark.filter(|&(row, column)| !is_seen[(row * width + column) as usize]).count()
        };
        // The side that lacks the greater share goes first.
        while 2 * left < width && 2 * top < height {
            let (columns, rows) = (left..width - left, top..height - top);
            let first = unseen(left..left + 1, rows.clone());
            let sides = first + unseen(columns.end - 1..columns.end, rows.clone());
            let above = unseen(columns.clone(), top..top + 1);
            let above = above + unseen(columns.clone(), rows.end - 1..rows.end);
            if sides + above == 0 {
                break;
            }
            match sides * columns.len() >= above * rows.len() {
                true => left += 1,
                false => top += 1,
            }
        }
        self.facts.resolution = [width.saturating_sub(2 * left), height.saturating_sub(2 * top)];
    }

    /// The pixels of the refocused picture that a lenslet sees, and where on the sensor (raw pixels from the
    /// corner).
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the picture"
    )]
    fn seen_by(&self, lenslet: &PatchLenslet, m: f64, mut each: impl FnMut(usize, DVec2)) {
        let facts = &self.facts;
        let (scale, reach) = (facts.magnification.abs(), facts.reach_px);
        let size = DVec2::from(facts.resolution.map(f64::from));
        let PatchLenslet { middle, image, .. } = *lenslet;
        // What of the picture stands in the middle of the image.
        let point = middle - (image - middle) / facts.magnification;
        let at = 0.5 * size + (point - 0.5 * self.raw) * scale;
        let first = (at - reach - 0.5).ceil().clamp(DVec2::ZERO, size);
        let end = (at + reach + 0.5).floor().clamp(DVec2::ZERO, size);
        for row in first.y as usize..end.y as usize {
            for column in first.x as usize..end.x as usize {
                let pixel = DVec2::new(column as f64, row as f64) + 0.5;
                if (pixel - at).length_squared() <= reach * reach {
                    let point = 0.5 * self.raw + (pixel - 0.5 * size) / scale;
                    let on_sensor = middle + (middle - point) * m;
                    each(row * facts.resolution[0] as usize + column, on_sensor);
                }
            }
        }
    }

    /// The picture of a raw picture and a white one.
    pub(super) fn rendered(&self, raw: &Picture, white: &Picture) -> Result<Picture, PictureError> {
        let empty = || PictureError::empty("the raw picture");
        let size = [raw.width(), raw.height()];
        let planes = [raw, white].map(|picture| planes(picture, ""));
        let [Some(raw), Some(white)] = planes else { return Err(empty()) };
        let [width, height] = self.facts.resolution.map(|side| side as usize);
        let plane = |(color, (raw, white)): (usize, (&&[f32], &&[f32]))| {
            let by_color = self.facts.magnification_by_color;
            let m = by_color.map_or(self.facts.magnification, |of| of[color.min(2)]);
            let mut values = vec![0.0; width * height];
            let mut is_done = vec![false; width * height];
            // What no sharp lenslet sees is left to the others.
            for is_sharp in [true, false] {
                let mut sums = vec![[0.0_f64; 2]; width * height];
                for lenslet in self.lenslets.iter().filter(|of| of.is_sharp == is_sharp) {
                    self.seen_by(lenslet, m, |pixel, at| {
                        let light = [raw, white].map(|of| sampled(of, size, at.into()));
                        sums[pixel] = [0, 1].map(|k| sums[pixel][k] + f64::from(light[k]));
                    });
                }
                for ((value, is_done), [light, white]) in
                    values.iter_mut().zip(&mut is_done).zip(sums)
                {
                    if !*is_done && white > 0.0 {
                        (*value, *is_done) = (light / white, true);
                    }
                }
            }
            values
        };
        let colors: Vec<_> = raw.iter().zip(&white).enumerate().collect();
        let colors: Vec<Vec<f64>> = colors.into_par_iter().map(plane).collect();
        #[expect(clippy::cast_possible_truncation, reason = "films hold f32")]
        let value = |pixel: usize, color: usize| colors[color][pixel] as f32;
        picture(
            [width, height],
            "the plane in focus, put together from the lenslets' patches",
            value,
        )
    }
}

/// Bytes that the refocused picture takes while it is put together; 0 where patches leave gaps.
pub(crate) fn refocused_bytes(lens: &LensCamera, light_field: &LightField) -> u64 {
    /// Of a pixel in each colour: its value and whether it is done, and the sums of light.
    const EACH: u64 = 3 * (size_of::<f64>() + 1 + size_of::<[f64; 2]>()) as u64;
    let Ok(plane) = PatchPlane::new(lens, light_field, light_field.refocus) else { return 0 };
    let raw = 2.0 * DVec2::from(lens.focused().pixel_of(DVec2::ZERO));
    let [columns, rows] = (raw * plane.facts.magnification.abs()).to_array();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a forecast, of no more than the pixels of the sensor"
    )]
    let pixels = (columns * rows) as u64;
    EACH.saturating_mul(pixels)
}

/// Magnification from a plane to the sensor, both at z (mm), with the image the other way round.
fn magnification(view: &BehindLenslets, sensor_z: f64, plane: f64) -> f64 {
    let principal = view.principal_distance(0);
    let [slope, _] = view.sight(0, sensor_z).central(principal);
    1.0 / (slope * (view.front_z - principal - plane))
}

/// Spread of a point of the rim of the exit pupil on the sensor at z (mm), by a type of lenslet (mm).
fn spread(view: &BehindLenslets, kind: usize, sensor_z: f64) -> f64 {
    let sight = view.sight(kind, sensor_z);
    let [over_array, over_sensor] = match view.exit_pupil_z() {
        Some(z) => [0, 1].map(|k| sight.height[k] + sight.slope[k] * (view.front_z - z)),
        None => sight.slope,
    };
    2.0 * view.array.reach * (over_array / over_sensor).abs()
}
