//! Parts of a scene that contradict each other, as far as it takes the loaded scene to tell.

use etendue_report::Refusal;
use etendue_tracer::LayerSpec;

use crate::file::{SamplesSpec, SceneFile};
use crate::idle::tells_bands_apart;
use crate::{Scene, SceneError};

impl Scene {
    /// Reason why the light of the scene's picture cannot be spread as waves, which `camera.diffraction` asks for; `None`
    /// where it can, or need not.
    #[must_use]
    pub fn diffraction_fault(&self) -> Option<Refusal> {
        let camera = &self.camera;
        if !camera.diffracts() || self.picture != Some(LayerSpec::Radiance) {
            return None;
        }
        let shutter = camera.shutter();
        let (why, remedy) = if camera.is_timed() || camera.light_of_rows_differs() || self.slots > 0
        {
            (
                "light is spread over the picture of one moment, and something moves, or rows or slots see different ones",
                "leave out `motion`, `shutter` and `serial`, or `diffraction`",
            )
        } else if camera.lights_change() || shutter.is_some_and(|shutter| !shutter.is_fully_open())
        {
            (
                "light is spread over the picture of one moment, and the shutter is closed for a part of the time, or \
                 lights change",
                "leave out `shutter`, or `diffraction`",
            )
        } else if self.render.samples.is_adaptive()
            || matches!(self.render.samples, SamplesSpec::Time(_))
        {
            (
                "light that is spread as waves lands beside the pixel that it starts from, so that no pixel can tell when \
                 its samples are enough",
                "give `render.samples` a number, or leave out `diffraction`",
            )
        } else {
            return None;
        };
        Some(Refusal::new(why).hint(remedy))
    }
}

impl SceneFile {
    /// Refuses parts of `scene`, which was made of the file, that contradict each other.
    pub(crate) fn check_contradictions(&self, scene: &Scene) -> Result<(), SceneError> {
        if let Some(why) = scene.diffraction_fault() {
            return Err(self.fault("camera.diffraction", why));
        }
        let is_together =
            scene.plan.dispersion == Some(false) && scene.plan.shared_paths == Some(true);
        if is_together && !scene.camera.lens().is_some_and(tells_bands_apart) {
            let why = "contradicts `dispersion` false, with which the rays of all bands are one, and there is nothing to \
                       share";
            let remedy = "leave one of them out";
            return Err(self.fault("plan.shared_paths", Refusal::new(why).hint(remedy)));
        }
        Ok(())
    }
}
