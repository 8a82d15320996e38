//! Exposures in slots: the light of each slot added up before the sensor sees it, so that noise is drawn once.

use etendue_scene::Scene;
use etendue_scene::serial::PixelShares;
use etendue_tracer::LayerSpec;

use crate::error::RenderError;
use crate::film::FilmLayer;
use crate::memory::filled;
use crate::output::Values;
use crate::render::empty_film;
use crate::state::Film;
use crate::{Plan, Shard};

/// A film onto which the light of slots is added.
#[derive(Debug)]
pub struct SerialFilm {
    film: Film,
    /// Of each layer of light, the sum of each plane.
    sums: Vec<(LayerSpec, Vec<Vec<f64>>)>,
    width: usize,
}

impl SerialFilm {
    /// A film of `scene` without light, whose other layers are those of `data`.
    ///
    /// # Errors
    ///
    /// When there is no memory for it.
    pub fn new(
        scene: &Scene,
        plan: &Plan,
        shard: Option<Shard>,
        data: Option<Film>,
    ) -> Result<Self, RenderError> {
        let mut layers = empty_film(scene, plan)?;
        let resolution = scene.camera.resolution();
        let mut film = match data {
            Some(data) => data,
            None => Film::without_layers(resolution, shard.unwrap_or(Shard::ALL), plan.samples),
        };
        let mut sums = Vec::new();
        for layer in &mut layers {
            if layer.spec.is_light() {
                let planes = layer.named_planes().map(|(_, plane)| filled(0.0, plane.len()));
                sums.push((layer.spec, planes.collect::<Result<_, _>>()?));
            } else if let Some(k) = film.layers.iter().position(|other| other.spec == layer.spec) {
                *layer = film.layers.swap_remove(k);
            }
        }
        film.layers = layers;
        Ok(Self { film, sums, width: resolution[0] as usize })
    }

    /// Adds the light of a slot, of which each pixel takes its share.
    pub fn add(&mut self, slot: Film, pixels: Option<&PixelShares>) {
        let share =
            |i: usize| pixels.map_or(1.0, |pixels| pixels.at([i % self.width, i / self.width]));
        for (spec, sums) in &mut self.sums {
            let of_layer = |layer: &&FilmLayer| layer.spec == *spec;
            let Some(layer) = slot.layers.iter().find(of_layer) else { continue };
            for (sums, (_, plane)) in sums.iter_mut().zip(layer.named_planes()) {
                sums.iter_mut().enumerate().for_each(|(i, sum)| *sum += share(i) * plane.at(i));
            }
        }
        let Film { counts, passed, trace_time, notes, camera, .. } = slot;
        self.film.counts.merge(&counts);
        self.film.passed.samples = self.film.passed.samples.min(passed.samples);
        self.film.passed.is_complete &= passed.is_complete;
        self.film.trace_time += trace_time;
        for note in notes {
            if !self.film.notes.contains(&note) {
                self.film.notes.push(note);
            }
        }
        if self.film.camera.is_none() {
            self.film.camera = camera;
        }
    }

    /// The film of the whole exposure.
    #[must_use]
    pub fn finish(mut self) -> Film {
        for (spec, sums) in self.sums {
            let layers = self.film.layers.iter_mut().find(|layer| layer.spec == spec);
            let planes = layers.into_iter().flat_map(FilmLayer::named_planes_mut);
            for ((_, plane), sums) in planes.zip(sums) {
                match plane {
                    Values::F32(values) => {
                        #[expect(clippy::cast_possible_truncation, reason = "as light is kept")]
                        values.iter_mut().zip(&sums).for_each(|(value, sum)| *value = *sum as f32);
                    }
                    Values::F64(values) => values.copy_from_slice(&sums),
                    Values::U16(_) | Values::U32(_) => {}
                }
            }
        }
        self.film
    }
}
