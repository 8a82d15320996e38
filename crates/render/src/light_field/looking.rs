//! The views of a picture, to be looked at one by one and together.
//!
//! Together: R. Ng, M. Levoy, M. Brédif, G. Duval, M. Horowitz, P. Hanrahan, "Light field photography with a
//! hand-held plenoptic camera", 2005: all views, moved by their disparity, are averaged.

use std::sync::Arc;

use etendue_camera::{Camera, CameraError, ViewGrid};
use etendue_scene::Scene;
use etendue_spectrum::Bands;

use super::choice::ChosenViews;
use super::patches::{PatchPlane, Patches};
use super::views::{Views, picture, planes};
use super::{LightFieldError, by_layer, white};
use crate::RenderError;
use crate::output::{Development, Picture};

/// Views of a light-field camera's picture, or, of a focused camera, what its lenslets see of a plane.
#[derive(Debug, Clone)]
pub struct LightFieldViews {
    source: LightFieldSource,
    development: Development,
}

#[derive(Debug, Clone)]
enum LightFieldSource {
    Views { views: Views, grid: Arc<ViewGrid> },
    Patches { camera: Box<Camera>, raw: Arc<Picture>, white: Arc<Picture> },
}

/// The nearest and the farthest plane that is offered, as a share of the distance in focus, and the steps in which
/// those are looked for that patches fill.
const FARTHEST: f64 = 5.0;
const STEP: f64 = 1.02;

impl LightFieldViews {
    /// Decodes what `picture` of `scene` holds; `None` of other cameras, of those that have neither
    /// [views](etendue_camera::Camera::no_views) nor patches without gaps, and without a picture.
    ///
    /// # Errors
    ///
    /// When the views have no places, or the white picture cannot be made.
    pub fn of(scene: &Scene, picture: &Picture) -> Result<Option<Self>, LightFieldError> {
        if picture.layer("").is_none() {
            return Ok(None);
        }
        let fault = |error: CameraError| RenderError::camera(error.to_string());
        let chosen = ChosenViews::of(&scene.camera, &scene.accuracy).map_err(fault)?;
        let Some(ChosenViews { grid, response, no_views, light_field, .. }) = chosen else {
            return Ok(None);
        };
        let source = match (scene.camera.lens(), response, no_views) {
            (Some(lens), Some(response), None) => {
                let centres = by_layer(scene, lens, &light_field).map_err(fault)?;
                let views = Views::decoded(picture, &centres, &light_field, &grid, &response)?;
                Some(LightFieldSource::Views { views, grid })
            }
            (Some(lens), _, Some(_)) => {
                let is_seen = PatchPlane::new(lens, &light_field, None).is_ok();
                is_seen.then(|| LightFieldSource::patches(scene, picture)).transpose()?.flatten()
            }
            (_, _, None) => {
                Some(LightFieldSource::Views { views: Views::split(picture, &grid), grid })
            }
            (None, _, Some(_)) => None,
        };
        let development = *picture.development();
        Ok(source.map(|source| Self { source, development }))
    }

    /// Views along each side; 0 where there is only what lenslets see of planes.
    #[must_use]
    pub fn count(&self) -> u32 {
        match &self.source {
            LightFieldSource::Views { views, .. } => views.views,
            LightFieldSource::Patches { .. } => 0,
        }
    }

    /// The distance that is in focus (m), along the axis from the entrance pupil: there disparities are 0.
    #[must_use]
    pub fn focus(&self) -> f64 {
        match &self.source {
            LightFieldSource::Views { grid, .. } => grid.focus(),
            LightFieldSource::Patches { camera, .. } => {
                camera.lens().map_or(f64::INFINITY, |lens| lens.focused().object_distance())
            }
        }
    }

    /// The nearest and the farthest distance (m) to [refocus](Self::refocused) at: a fifth of that in focus and five
    /// times that, and no plane of which patches leave gaps.
    #[must_use]
    pub fn distances(&self) -> [f64; 2] {
        let focus = self.focus();
        let focus = if focus.is_finite() && focus > 0.0 { focus } else { 1.0 };
        let LightFieldSource::Patches { camera, .. } = &self.source else {
            return [focus / FARTHEST, focus * FARTHEST];
        };
        let Some((lens, light_field)) = camera.lens().zip(camera.light_field()) else {
            return [focus; 2];
        };
        [1.0 / STEP, STEP].map(|step| {
            let is_offered = |at: &f64| {
                (focus / FARTHEST..=focus * FARTHEST).contains(at)
                    && PatchPlane::new(lens, light_field, Some(*at)).is_ok()
            };
            let planes = std::iter::successors(Some(focus), |at| Some(at * step));
            planes.take_while(is_offered).last().unwrap_or(focus)
        })
    }

    /// The view from column `across` and row `down` of the pupil, both from 0 and less than
    /// [`count`](Self::count).
    ///
    /// # Errors
    ///
    /// When there are none.
    pub fn view(&self, [across, down]: [u32; 2]) -> Result<Picture, LightFieldError> {
        let LightFieldSource::Views { views, .. } = &self.source else {
            return Err(RenderError::camera("the camera has no views").into());
        };
        let last = views.views.saturating_sub(1);
        let view = views.single(across.min(last), down.min(last))?;
        Ok(view.developed(self.development))
    }

    /// The picture of a camera with the whole pupil that is focused at `depth` (m).
    ///
    /// # Errors
    ///
    /// When the patches of the lenslets leave gaps there, see [`distances`](Self::distances).
    pub fn refocused(&self, depth: f64) -> Result<Picture, LightFieldError> {
        let picture = match &self.source {
            LightFieldSource::Views { views, grid } => {
                views.averaged(grid.disparity(depth), grid.row_height())?
            }
            LightFieldSource::Patches { camera, raw, white } => {
                let lenslets = camera.lens().zip(camera.light_field());
                let (lens, light_field) =
                    lenslets.ok_or_else(|| RenderError::camera("there are no lenslets"))?;
                let patches = Patches::new(lens, light_field, Some(depth));
                patches.map_err(RenderError::camera)?.rendered(raw, white)?
            }
        };
        Ok(picture.developed(self.development))
    }
}

impl LightFieldSource {
    /// A raw picture of lenslets, and the white one that goes with it.
    fn patches(scene: &Scene, raw: &Picture) -> Result<Option<Self>, LightFieldError> {
        let Some(planes) = planes(raw, "").filter(|planes| planes.len() == 3) else {
            return Ok(None);
        };
        let opened = scene.camera.opened(&Bands::Rgb);
        let opened = opened.map_err(|error| RenderError::camera(error.to_string()))?;
        let samples = scene.accuracy.white_samples;
        let white = Arc::new(white::picture(&opened, &scene.render, samples)?);
        let size = [raw.width(), raw.height()];
        let raw = picture(size, "the raw picture", |pixel, color| planes[color][pixel])?;
        Ok(Some(Self::Patches { camera: Box::new(scene.camera.clone()), raw: raw.into(), white }))
    }
}
