//! A scene's picture at any number of samples, and how far it is from another.

use etendue_accel::{Accel, AccelName};
use etendue_camera::{Camera, Sampler};
use etendue_geometry::HitPrecision;
use etendue_render::output::{Outputs, Picture};
use etendue_render::{Images, Plan, RenderError};
use etendue_scene::Scene;
use etendue_scene::file::{LightPrecision, SamplesSpec};
use etendue_spectrum::Bands;
use etendue_tracer::LayerSpec;

use crate::BenchError;

/// The fewest pixels along a side.
const LEAST_SIDE: u32 = 16;

/// A scene whose picture is rendered again and again, before any sensor: as red, green and blue, or in a
/// sensor's bands.
#[derive(Debug)]
pub struct Studio<'a> {
    scene: Scene,
    camera: Camera,
    accel: &'a dyn Accel,
    images: Images,
}

/// Sampling of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PointSet {
    /// Rays a pixel.
    pub samples: u32,
    /// The point set.
    pub sampler: Sampler,
    /// Other seeds give other samples.
    pub seed: u64,
    /// The precision of the hits that light is worked out from.
    pub precision: LightPrecision,
}

/// A picture's values, one after the other, and the time it took.
#[derive(Debug, Clone, PartialEq)]
pub struct TimedPicture {
    /// Red, green and blue planes.
    pub values: Vec<f64>,
    /// Wall time of the tracing (s).
    pub seconds: f64,
}

impl<'a> Studio<'a> {
    /// For `scene`'s picture, found by `accel`.
    ///
    /// # Errors
    ///
    /// [`BenchError::NoPicture`] when the scene has layers alone.
    pub fn new(scene: &Scene, accel: &'a dyn Accel) -> Result<Self, BenchError> {
        let mut scene = scene.clone();
        scene.sensor = None;
        Self::with_sensor(&scene, accel)
    }

    /// As [`Self::new`], in the bands that the scene's sensor asks for.
    ///
    /// # Errors
    ///
    /// As [`Self::new`].
    pub fn with_sensor(scene: &Scene, accel: &'a dyn Accel) -> Result<Self, BenchError> {
        let picture = scene.picture.ok_or(BenchError::NoPicture)?;
        let mut scene = scene.clone();
        scene.layers = vec![picture];
        let images = Images::decode(&scene, &Plan::new(&scene, OUTPUTS), None)?;
        let camera = opened(&scene.camera)?;
        Ok(Self { scene, camera, accel, images })
    }

    /// The scene's camera, with pixels as large as [`Self::fit`] made them.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The precision of the hits that light is worked out from where nothing else is asked for; `None` where
    /// the picture is not of light, or the accelerator has one precision alone.
    #[must_use]
    pub fn precision(&self) -> Option<HitPrecision> {
        let plan = Plan::new(&self.scene, OUTPUTS);
        let accel = self.scene.render.accel.unwrap_or_else(AccelName::best);
        let has_both = accel.has_single() && plan.layers.contains(&LayerSpec::Radiance);
        has_both.then_some(plan.light_precision)
    }

    /// Makes the camera's pixels as large as it takes for `per_pixel` samples of each to be done in
    /// `seconds`, by what a few samples take.
    ///
    /// # Errors
    ///
    /// As [`Self::take`].
    pub fn fit(&mut self, per_pixel: f64, seconds: f64) -> Result<(), BenchError> {
        let [width, height] = self.camera().resolution();
        let limit = (width.min(height) / LEAST_SIDE).max(1);
        let pilot = self.camera().coarser((width.max(height) / 64).clamp(1, limit));
        let sampling = PointSet {
            samples: 4,
            sampler: Sampler::default(),
            seed: 0,
            precision: LightPrecision::Auto,
        };
        // The first wakes threads and caches.
        self.take(&pilot, sampling)?;
        let taken = self.take(&pilot, sampling)?;
        let samples = 4.0 * taken.values.len() as f64 / 3.0;
        let pixels = seconds / (per_pixel * taken.seconds / samples);
        let all = f64::from(width) * f64::from(height);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of a side, saturated"
        )]
        let factor = (all / pixels).sqrt().ceil() as u32;
        self.camera = self.camera.coarser(factor.clamp(1, limit));
        Ok(())
    }

    /// The picture through `camera`, which has been [`opened`].
    ///
    /// # Errors
    ///
    /// When it cannot be rendered, such as when no light gets through the lens.
    pub fn take(
        &mut self,
        camera: &Camera,
        sampling: PointSet,
    ) -> Result<TimedPicture, BenchError> {
        let render = &mut self.scene.render;
        (render.samples, render.sampler, render.seed) =
            (SamplesSpec::Count(sampling.samples), sampling.sampler, sampling.seed);
        self.scene.plan.light_precision = sampling.precision;
        self.scene.camera = camera.clone();
        let plan = Plan::new(&self.scene, OUTPUTS);
        let rendered = etendue_render::render(
            &self.scene,
            &plan,
            self.accel,
            &self.images,
            Vec::new(),
            &|_: f64| true,
        )?;
        let seconds = rendered.trace_time.as_secs_f64();
        Ok(TimedPicture { values: values(&rendered.picture), seconds })
    }
}

/// A camera whose lens' pupil is measured once and not again for every picture.
///
/// # Errors
///
/// When no light gets through the lens.
pub fn opened(camera: &Camera) -> Result<Camera, BenchError> {
    let opened = camera.opened(&Bands::Rgb);
    opened.map_err(|error| BenchError::Render(RenderError::camera(error.why)))
}

/// In double precision.
const OUTPUTS: Outputs = Outputs { npy: true, ..Outputs::NONE };

fn values(picture: &Picture) -> Vec<f64> {
    let layers = picture.layers().iter().filter(|layer| layer.name.is_empty());
    let channels = layers.flat_map(|layer| &layer.channels);
    channels.flat_map(|channel| (0..channel.values.len()).map(|i| channel.values.at(i))).collect()
}

/// True if the picture of a scene is the mean of samples.
#[must_use]
pub fn is_sampled(layer: LayerSpec) -> bool {
    layer == LayerSpec::Radiance || layer.is_averaged()
}

/// The mean of squared differences.
#[must_use]
pub fn mean_square(a: &[f64], b: &[f64]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    sum / a.len().min(b.len()).max(1) as f64
}

/// The mean of all values.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}
