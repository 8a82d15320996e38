//! Small pictures of a scene, and what they tell of its picture.

use std::time::Instant;

use etendue_accel::Accel;
use etendue_camera::Camera;
use etendue_render::light_field::white_rows;
use etendue_render::output::Outputs;
use etendue_render::{Images, Plan, RenderError, render};
use etendue_scene::Scene;
use etendue_scene::file::SamplesSpec;
use etendue_spectrum::Bands;

use crate::Error;

/// Pixels of the larger and the smaller of the small pictures, about.
const PIXELS: [f64; 2] = [12_000.0, 3_000.0];

/// Samples a pixel of the larger one.
const SAMPLES: [u32; 2] = [1, 4];

/// Pixels of a small picture whose samples stop by themselves.
const ADAPTIVE: f64 = 3_000.0;

/// Pixels of a white image that are traced, about: in whole rows, as there are more samples at the rims of lenslets.
const WHITE_PIXELS: u32 = 18_000;

/// How often each is traced: the fastest counts, which nothing else has disturbed.
const TIMES: usize = 2;

/// What small pictures of a scene are traced by.
pub(super) struct Pilot<'a> {
    pub(super) scene: &'a Scene,
    pub(super) accel: &'a dyn Accel,
    pub(super) images: &'a Images,
    /// When they have taken too long: a forecast is worth no wait.
    pub(super) until: Instant,
}

impl Pilot<'_> {
    /// The time (s) of tracing the scene's picture through `camera`: what is done once, what each pixel
    /// takes, and each of its samples, by three small pictures.
    pub(super) fn picture(&self, camera: &Camera) -> Result<f64, Error> {
        // A lens' pupil is measured once for a picture, and here once for all.
        let start = Instant::now();
        let bands = Plan::new(self.scene, Outputs::ALL).bands;
        let camera = &camera.opened(&bands).map_err(|e| RenderError::Camera(e.why))?;
        let opening = start.elapsed().as_secs_f64();
        let [large, small] = PIXELS.map(|pixels| coarser(camera, pixels));
        let [one, several] = SAMPLES;
        // Threads and caches wake.
        self.seconds(&small, SamplesSpec::Count(one))?;
        let first = self.fastest(&large, one)?;
        let more = self.fastest(&large, several)?;
        let few = self.fastest(&small, one)?;
        let [all, large, small] = [camera, &large, &small].map(pixels);
        let sample = ((more - first) / (f64::from(several - one) * large)).max(0.0);
        let each = match large > 1.2 * small {
            true => ((first - few) / (large - small)).max(0.0),
            false => first / large,
        };
        let once = (first - each * large).max(0.0);
        let pixel = (each - sample * f64::from(one)).max(0.0);
        Ok(opening + once + all * (pixel + sample * self.samples(camera)?))
    }

    /// The time (s) of a light field's white image, by some of its rows.
    pub(super) fn white(&self) -> Result<f64, Error> {
        let start = Instant::now();
        let camera = &self.scene.camera;
        let camera = &camera.opened(&Bands::Rgb).map_err(|e| RenderError::Camera(e.why))?;
        let opening = start.elapsed().as_secs_f64();
        let [width, height] = camera.resolution();
        let step = height.div_ceil((WHITE_PIXELS / width.max(1)).max(1));
        let rows: Vec<u32> = (step / 2..height).step_by(step.max(1) as usize).collect();
        let start = Instant::now();
        std::hint::black_box(white_rows(camera, &self.scene.render, &rows));
        let a_row = start.elapsed().as_secs_f64() / rows.len().max(1) as f64;
        Ok(opening + a_row * f64::from(height))
    }

    /// The samples that pixels of `camera` will have in the mean.
    fn samples(&self, camera: &Camera) -> Result<f64, Error> {
        let spec = self.scene.render.samples;
        if !spec.is_adaptive() {
            return Ok(f64::from(spec.most()));
        }
        let (_, counted) = self.seconds(&coarser(camera, ADAPTIVE), spec)?;
        Ok(counted.unwrap_or(f64::from(spec.typical())))
    }

    fn fastest(&self, camera: &Camera, samples: u32) -> Result<f64, Error> {
        let mut fastest = f64::INFINITY;
        for _ in 0..TIMES {
            fastest = fastest.min(self.seconds(camera, SamplesSpec::Count(samples))?.0);
        }
        Ok(fastest)
    }

    /// The time (s) of a picture, and the samples that its pixels have where these stop by themselves.
    fn seconds(&self, camera: &Camera, samples: SamplesSpec) -> Result<(f64, Option<f64>), Error> {
        let mut scene = self.scene.clone();
        scene.camera = camera.clone();
        scene.render.samples = samples;
        if !samples.is_adaptive() {
            scene.layers.retain(|layer| !layer.is_of_sampling());
        }
        let plan = Plan::new(&scene, Outputs::ALL);
        let start = Instant::now();
        let goes_on = |_: f64| Instant::now() < self.until;
        let done = render(&scene, &plan, self.accel, self.images, Vec::new(), &goes_on)?;
        if !goes_on(1.0) {
            return Err(RenderError::Stopped.into());
        }
        let time = done.trace_time.min(start.elapsed()).as_secs_f64();
        Ok((time, done.sample_counts.map(|counts| counts.mean())))
    }
}

fn pixels(camera: &Camera) -> f64 {
    camera.resolution().map(f64::from).iter().product()
}

/// The same view on about so many pixels.
fn coarser(camera: &Camera, few: f64) -> Camera {
    let factor = (pixels(camera) / few).sqrt().round().max(1.0);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of a side"
    )]
    camera.coarser(factor as u32)
}
