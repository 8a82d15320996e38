//! Choice of the views that a raw picture holds: as many about the middle one as are those of an ideal lens.

use etendue_camera::{Camera, CameraError, LensCamera, LightField, Projection, ViewGrid};
use etendue_scene::file::AccuracySpec;
use etendue_spectrum::Bands;
use std::sync::Arc;

use super::centres::Centres;
use super::response::{ViewRays, ViewResponse};

/// The views of a camera.
#[derive(Debug)]
pub(super) struct ChosenViews {
    pub(super) light_field: LightField,
    /// The ideal lens that they are held against.
    pub(super) reference: Camera,
    pub(super) grid: Arc<ViewGrid>,
    /// Response of the views; `None` where there is no raw picture, or no view.
    pub(super) response: Option<ViewResponse>,
    /// Reason why there are no views, where there are none.
    pub(super) no_views: Option<String>,
}

impl ChosenViews {
    /// The views of a light-field camera; `None` of other cameras.
    ///
    /// Views are to have 40 dB of an ideal lens' waves, a mean square of 1e-4. Half of it is left to the noise of
    /// the raw picture and to how well rays tell errors (2e-5), so by their rays they are held to 43 dB, where
    /// `accuracy` does not say otherwise.
    pub(super) fn of(
        camera: &Camera,
        accuracy: &AccuracySpec,
    ) -> Result<Option<Self>, CameraError> {
        let Some(light_field) = camera.light_field() else { return Ok(None) };
        let Some((reference, unit)) = reference_of(camera)? else { return Ok(None) };
        let mut chosen = Self {
            light_field: light_field.clone(),
            reference,
            grid: Arc::clone(&unit),
            response: None,
            no_views: camera.no_views().map(str::to_owned),
        };
        let Some(lens) = camera.lens().filter(|_| chosen.no_views.is_none()) else {
            return Ok(Some(chosen));
        };
        // Filters of some lenslets are what a mosaic is for: views keep them.
        let is_mosaic = lens.lenslets().is_some_and(|of| of.view().array.types.len() > 1);
        let opened = match is_mosaic {
            true => camera.opened_clear(&Bands::Rgb)?,
            false => camera.opened(&Bands::Rgb)?,
        };
        let centres = Centres::new(lens, light_field, &Bands::Rgb, accuracy.view_color_shift)?;
        let colors = if centres.by_band().is_empty() || !is_mosaic && is_coloured(lens) {
            vec![opened.band_groups(&Bands::Rgb).len() / 2]
        } else {
            vec![0, 1, 2]
        };
        let rays = ViewRays::of_raw(&opened, light_field, &unit, &centres, &colors, accuracy);
        let mut views = light_field.views;
        loop {
            let narrowed = light_field.narrowed(views, rays.pupil_share(views));
            let Some((reference, grid)) = reference_of(&camera.with_light_field(narrowed.clone()))?
            else {
                return Ok(None);
            };
            let ideal = ViewRays::of_reference(&reference, views, &unit, accuracy);
            let response = ViewResponse::new(&rays, &ideal);
            // The middle ones stay in their places when two rows and columns fewer are taken.
            let sides = (0..=views.saturating_sub(1) / 2).map(|less| views - 2 * less);
            let good = sides.clone().find(|&side| response.worst(side) >= accuracy.view_psnr);
            match good {
                Some(side) if side == views => {
                    (chosen.light_field, chosen.reference, chosen.grid) =
                        (narrowed, reference, grid);
                    chosen.response = Some(response);
                    break;
                }
                Some(side) if side >= light_field.least_views.max(3) => views = side,
                Some(_) | None => {
                    chosen.no_views = Some(too_far_off(response.worst(views), accuracy.view_psnr));
                    break;
                }
            }
        }
        Ok(Some(chosen))
    }
}

/// From which error of the paraxial baseline on a note tells of it.
const OFF: f64 = 0.005;

/// From how many columns of distortion on a note tells of it: with waves of 7 columns and an amplitude of
/// 0.4 that is 40 dB.
const BENT: f64 = 0.04;

impl ChosenViews {
    /// Notes for the user on the views of `camera`.
    pub(super) fn notes(&self, camera: &Camera) -> Vec<String> {
        let Some(response) = &self.response else { return Vec::new() };
        let mut notes = Vec::new();
        let share = self.light_field.pupil_share;
        if (share - 1.0).abs() > OFF {
            notes.push(format!(
                "viewpoints are {share:.4} times as far apart as by the paraxial lens, as the main lens or the                  lenslets image the opening with aberrations: the reference views and baseline_m follow"
            ));
        }
        if let Some(most) =
            camera.light_field().map(|of| of.views).filter(|n| *n > self.light_field.views)
        {
            notes.push(format!(
                "of {most} x {most} views the middle {n} x {n} are those of an ideal lens: further out the                  lenslets' images are cut, or blurred",
                n = self.light_field.views
            ));
        }
        if response.distortion > BENT {
            notes.push(format!(
                "the main lens distorts: all views stand up to {:.2} columns beside the reference views, which                  an ideal lens has",
                response.distortion
            ));
        }
        notes
    }
}

/// True if a filter, which is the same for all lenslets, makes the light of colours unlike.
fn is_coloured(lens: &LensCamera) -> bool {
    let elements = lens.focused().train().elements();
    elements.iter().flat_map(|of| of.part.curves()).any(|curve| curve.as_flat().is_none())
}

/// A light-field camera's ideal lens.
fn reference_of(camera: &Camera) -> Result<Option<(Camera, Arc<ViewGrid>)>, CameraError> {
    let reference = match camera.projection() {
        Projection::Views(_) => camera.clone(),
        _ => camera.reference_views()?,
    };
    Ok(match reference.projection() {
        Projection::Views(grid) => Some((reference.clone(), Arc::clone(grid))),
        _ => None,
    })
}

fn too_far_off(worst: f64, least: f64) -> String {
    format!(
        "by its rays the worst view would have {worst:.1} dB of an ideal lens', less than {least}, as \
         the main lens or the lenslets lose or bend part of the light: close the main lens, ask for fewer \
         views, or give lenslets that are thinner or of a longer focal length"
    )
}
