//! The views of a picture, to be looked at one by one and together.
//!
//! Together: R. Ng, M. Levoy, M. Brédif, G. Duval, M. Horowitz, P. Hanrahan, "Light field photography with a
//! hand-held plenoptic camera", 2005: all views, moved by their disparity, are averaged.

use std::sync::Arc;

use etendue_camera::ViewGrid;
use etendue_scene::Scene;

use super::LightFieldError;
use super::by_layer;
use super::choice::ChosenViews;
use super::views::Views;
use crate::RenderError;
use crate::output::{Development, Picture};

/// The views in a light-field camera's picture.
#[derive(Debug, Clone)]
pub struct LightFieldViews {
    views: Views,
    grid: Arc<ViewGrid>,
    development: Development,
}

impl LightFieldViews {
    /// The views in `picture` of `scene`; `None` of other cameras, of those that have
    /// [no views](etendue_camera::Camera::no_views), and without a picture.
    ///
    /// # Errors
    ///
    /// When the views have no places.
    pub fn of(scene: &Scene, picture: &Picture) -> Result<Option<Self>, LightFieldError> {
        let (Some(_), None) = (picture.layer(""), scene.camera.no_views()) else { return Ok(None) };
        let chosen = ChosenViews::of(&scene.camera, &scene.accuracy)
            .map_err(|error| RenderError::Camera(error.to_string()))?;
        let Some(ChosenViews { grid, response, no_views: None, light_field, .. }) = chosen else {
            return Ok(None);
        };
        let views = match scene.camera.lens().zip(response) {
            Some((lens, response)) => {
                let centres = by_layer(scene, lens, &light_field)
                    .map_err(|error| RenderError::Camera(error.to_string()))?;
                Views::decoded(picture, &centres, &light_field, (&grid, &response))?
            }
            None => Views::split(picture, &grid),
        };
        Ok(Some(Self { views, grid, development: *picture.development() }))
    }

    /// Views along each side.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.views.views
    }

    /// The distance at which disparities are 0 (m), along the axis from the entrance pupil.
    #[must_use]
    pub fn focus(&self) -> f64 {
        self.grid.focus()
    }

    /// The view from column `across` and row `down` of the pupil, both from 0 and less than
    /// [`count`](Self::count).
    ///
    /// # Errors
    ///
    /// None that a caller can cause.
    pub fn view(&self, [across, down]: [u32; 2]) -> Result<Picture, LightFieldError> {
        let last = self.views.views.saturating_sub(1);
        let view = self.views.single(across.min(last), down.min(last))?;
        Ok(view.developed(self.development))
    }

    /// The picture of a camera with the whole pupil that is focused at `depth` (m).
    ///
    /// # Errors
    ///
    /// None that a caller can cause.
    pub fn refocused(&self, depth: f64) -> Result<Picture, LightFieldError> {
        let picture = self.views.averaged(self.grid.disparity(depth), self.grid.row_height())?;
        Ok(picture.developed(self.development))
    }
}
