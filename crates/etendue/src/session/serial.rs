//! Serial exposures: the slots of one exposure rendered one after the other, and their light added up.

use std::sync::Arc;
use std::time::Instant;

use etendue_render::output::HeaderEntry;
use etendue_render::serial::SerialFilm;
use etendue_render::{
    Film, FollowedFrame, Identity, Plan, Prepared, RenderError, RenderState, Shard,
};
use etendue_scene::Scene;
use etendue_spectrum::Bands;
use etendue_tracer::LayerSpec;

use super::Session;
use super::loaded::{DecodedImages, LoadedScene};
use crate::words::{fingerprints, header};
use crate::{Error, Progress};

/// A scene with some of its layers.
fn with_layers(scene: &Scene, wanted: impl Fn(&LayerSpec) -> bool) -> Scene {
    let mut scene = scene.clone();
    scene.layers.retain(wanted);
    scene.picture = scene.picture.filter(|picture| scene.layers.contains(picture));
    scene
}

impl Session {
    /// Refuses what is not divided into slots.
    fn allows_slots(&self, scene: &Scene, state: &RenderState<'_>) -> Result<(), Error> {
        let why = if scene.picture != Some(LayerSpec::Radiance) {
            "adds up light, and the picture shows none\nhint: give the scene a `tracer` of light, such as \
             {\"type\": \"path\"}"
        } else if scene.camera.light_field().is_some() {
            "does not go with a light-field camera, whose views are rendered from one camera\nhint: leave one of them out"
        } else if scene.layers.iter().any(|layer| layer.is_of_sampling()) {
            "has samples of its own in each slot, of which `sample_count` and `variance` do not tell\nhint: leave them out"
        } else if state.checkpoint.is_some() {
            "is not kept on the way\nhint: leave `--checkpoint` out, or render rows with `--shard`"
        } else if state.shard.is_some_and(Shard::is_of_samples) || !state.shares.is_empty() {
            "is not divided by samples\nhint: use `--shard-by rows`"
        } else {
            return Ok(());
        };
        Err(Error::Refused(format!("{}: serial: the exposure {why}", scene.path.display())))
    }

    /// Traces the slots of the scene, which is prepared, and adds up their light: `None` where it has none. Layers
    /// without light are those of the scene by itself.
    pub(super) fn trace_slots(
        &mut self,
        state: &RenderState<'_>,
        progress: &Progress,
    ) -> Result<Option<Film>, Error> {
        if self.file().spec.serial.is_empty() {
            return Ok(None);
        }
        let start = Instant::now();
        let LoadedScene { scene, plan, neighbours, .. } = self.loaded()?;
        let (scene, outputs) = (Arc::clone(scene), self.options.outputs);
        self.allows_slots(&scene, state)?;
        let (bands, shard) = (plan.bands.clone(), state.shard);
        let plan = plan.clone();
        // What is no light, of the scene itself.
        let head = header(&scene, &fingerprints(&scene, neighbours)?);
        let of_part = RenderState { shard, identity: Identity::new(), ..RenderState::default() };
        let seen = with_layers(&scene, |layer| !layer.is_light());
        let data = match seen.layers.is_empty() {
            true => None,
            false => {
                let others: Vec<FollowedFrame<'_>> =
                    neighbours.iter().filter_map(|other| other.followed(&seen)).collect();
                let plan = Plan::in_bands(&seen, outputs, &bands);
                let prepared =
                    Prepared { accel: self.built()?, images: &self.images, others: &others };
                let traced =
                    etendue_render::trace(&seen, &plan, prepared, &head, &of_part, progress);
                Some(traced.map_err(|error| self.placed(error))?)
            }
        };
        let mut film = SerialFilm::new(&scene, &plan, shard, data)?;
        // Slot by slot, each as a scene by itself.
        let (whole, images) = (self.loaded.take(), Arc::clone(&self.images));
        let added = self.add_slots(&mut film, &bands, &head, &of_part, progress);
        (self.loaded, self.images) = (whole, images);
        added?;
        self.seconds.render = start.elapsed().as_secs_f64();
        Ok(Some(film.finish()))
    }

    fn add_slots(
        &mut self,
        film: &mut SerialFilm,
        bands: &Bands,
        head: &[HeaderEntry],
        state: &RenderState<'_>,
        progress: &Progress,
    ) -> Result<(), Error> {
        for slot in self.file().slots(&self.opener)? {
            let scene = self.load_file(&slot.file, progress)?;
            let scene = with_layers(&scene, |layer| layer.is_light());
            let plan = Plan::in_bands(&scene, self.options.outputs, bands);
            self.loaded = Some(LoadedScene {
                scene: Arc::new(scene),
                plan,
                notes: Vec::new(),
                accel: None,
                neighbours: Vec::new(),
                decoded: DecodedImages::Nothing,
                coarse: None,
            });
            self.build(progress)?;
            self.decode(progress)?;
            let LoadedScene { scene, plan, .. } = self.loaded()?;
            let prepared = Prepared { accel: self.built()?, images: &self.images, others: &[] };
            let traced = etendue_render::trace(scene, plan, prepared, head, state, progress)
                .map_err(|error| self.placed(error))?;
            if !traced.is_complete() {
                return Err(RenderError::Stopped.into());
            }
            film.add(traced, slot.pixels.as_ref());
        }
        Ok(())
    }
}
