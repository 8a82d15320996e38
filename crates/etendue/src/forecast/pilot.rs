//! Parts of a picture, traced to tell what the whole will take.
//!
//! Some of the picture's own strips of rows, and not a smaller picture: a mesh of a million triangles is met by
//! rays as near each other as those of the render, which its caches make half as dear.

use std::time::Instant;

use etendue_accel::Accel;
use etendue_camera::Camera;
use etendue_render::light_field::white_rows;
use etendue_render::output::Outputs;
use etendue_render::{Images, Plan, Prepared, RenderError, RenderState, Shard, render, trace};
use etendue_scene::Scene;
use etendue_scene::file::SamplesSpec;
use etendue_spectrum::Bands;

use crate::Error;

/// Strips of rows that are traced at least, and for each thread: one that waits for the last is not the
/// render's.
const STRIPS: u32 = 6;
const STRIPS_OF_THREAD: u32 = 3;

/// The most samples of a pixel of theirs, and the time (s) that is given to one such trace.
const MOST_SAMPLES: u32 = 16;
const BUDGET: f64 = 0.25;

/// The most bytes of a film that is there as a whole for it; a larger picture is traced on larger pixels.
const MOST_FILM: f64 = 256e6;

/// Pixels of a small picture whose samples stop by themselves.
const ADAPTIVE: f64 = 3_000.0;

/// Pixels of a white image that are traced, about: in whole rows, as there are more samples at the rims of lenslets.
const WHITE_PIXELS: u32 = 18_000;

/// Number of times that each is traced: the fastest counts, which nothing else has disturbed.
const TIMES: usize = 3;

/// Tracing of parts of a picture, for the forecast.
pub(super) struct Pilot<'a> {
    pub(super) scene: &'a Scene,
    pub(super) accel: &'a dyn Accel,
    pub(super) images: &'a Images,
    /// Time after which they have taken too long: a forecast is worth no wait.
    pub(super) until: Instant,
}

impl Pilot<'_> {
    /// The time (s) of tracing the scene's picture through `camera`: what is done once, what each pixel
    /// takes, and each of its samples, by strips of it.
    pub(super) fn picture(&self, camera: &Camera) -> Result<f64, Error> {
        // Waves are spread over whole pictures alone: what rays take is nearly all of the time.
        let camera = &camera.without_diffraction();
        // A lens' pupil is measured once for a picture, and here once for all.
        let start = Instant::now();
        let plan = Plan::new(self.scene, Outputs::ALL);
        let whole = &camera.opened(&plan.bands).map_err(|e| RenderError::camera(e.why))?;
        let opening = start.elapsed().as_secs_f64();
        let film = plan.memory.film as f64 / pixels(&self.scene.camera) * pixels(whole);
        let camera = match film > MOST_FILM {
            true => &coarser(whole, pixels(whole) * MOST_FILM / film),
            false => whole,
        };
        let height = camera.resolution()[1];
        let share = Shard::sample(height, STRIPS.max(STRIPS_OF_THREAD * threads()));
        // The part of the whole picture's samples that is traced.
        let rows = plan.band_paths.share_of_samples(share, height);
        let traced = rows * pixels(camera) / pixels(whole);
        // What the first trace has beyond the others: tables are filled, threads and caches wake.
        let (waking, first) = self.traced(camera, share, 1)?;
        let (_, bare) = self.traced(camera, Shard::nothing(height), 1)?;
        let first = (first - bare).max(0.0) / traced;
        let once = opening + waking + bare;
        let samples = self.samples(whole)?;
        if samples <= 1.0 {
            return Ok(once + first);
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a small count"
        )]
        let several = (BUDGET / (first * traced)).min(samples) as u32;
        let several = several.clamp(2, MOST_SAMPLES);
        let more = (self.traced(camera, share, several)?.1 - bare).max(0.0) / traced;
        let sample = ((more - first) / f64::from(several - 1)).max(0.0);
        Ok(once + more + sample * (samples - f64::from(several)))
    }

    /// The time (s) of a light field's white image, by some of its rows.
    pub(super) fn white(&self) -> Result<f64, Error> {
        let start = Instant::now();
        let camera = &self.scene.camera;
        let camera = &camera.opened(&Bands::Rgb).map_err(|e| RenderError::camera(e.why))?;
        let opening = start.elapsed().as_secs_f64();
        let [width, height] = camera.resolution();
        let step = height.div_ceil((WHITE_PIXELS / width.max(1)).max(1));
        let rows: Vec<u32> = (step / 2..height).step_by(step.max(1) as usize).collect();
        let start = Instant::now();
        let samples = self.scene.accuracy.white_samples;
        std::hint::black_box(white_rows(camera, &self.scene.render, samples, &rows));
        let a_row = start.elapsed().as_secs_f64() / rows.len().max(1) as f64;
        Ok(opening + a_row * f64::from(height))
    }

    /// Of tracing a share of `camera`'s picture with `samples` a pixel in one pass: how much longer the first
    /// time took than the fastest one, and that (s).
    fn traced(&self, camera: &Camera, share: Shard, samples: u32) -> Result<(f64, f64), Error> {
        let mut scene = self.scene.clone();
        scene.camera = camera.clone();
        scene.render.samples = SamplesSpec::Count(samples);
        scene.layers.retain(|layer| !layer.is_of_sampling());
        let mut plan = Plan::new(&scene, Outputs::ALL);
        plan.passes = std::iter::once(0..samples).collect();
        let prepared = Prepared { accel: self.accel, images: self.images, others: &[] };
        let state = RenderState { shard: Some(share), ..RenderState::default() };
        let mut times = [0.0; TIMES];
        for time in &mut times {
            let film = trace(&scene, &plan, prepared, &[], &state, &|_: f64| self.goes_on())?;
            *time = film.trace_time().as_secs_f64();
            if !self.goes_on() {
                return Err(RenderError::Stopped.into());
            }
        }
        let fastest = times.into_iter().fold(f64::INFINITY, f64::min);
        Ok((times[0] - fastest, fastest))
    }

    /// The samples that pixels of `camera` will have in the mean.
    fn samples(&self, camera: &Camera) -> Result<f64, Error> {
        let spec = self.scene.render.samples;
        if !spec.is_adaptive() {
            return Ok(f64::from(spec.most()));
        }
        let mut scene = self.scene.clone();
        scene.camera = coarser(camera, ADAPTIVE);
        let plan = Plan::new(&scene, Outputs::ALL);
        let watch = |_: f64| self.goes_on();
        let done = render(&scene, &plan, self.accel, self.images, Vec::new(), &watch)?;
        if !self.goes_on() {
            return Err(RenderError::Stopped.into());
        }
        Ok(done.sample_counts.map_or(f64::from(spec.typical()), |counts| counts.mean()))
    }

    fn goes_on(&self) -> bool {
        Instant::now() < self.until
    }
}

fn pixels(camera: &Camera) -> f64 {
    camera.resolution().map(f64::from).iter().product()
}

fn threads() -> u32 {
    u32::try_from(rayon::current_num_threads()).unwrap_or(u32::MAX)
}

/// Returns the view on about so many pixels.
fn coarser(camera: &Camera, few: f64) -> Camera {
    let factor = (pixels(camera) / few).sqrt().round().max(1.0);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of a side"
    )]
    camera.coarser(factor as u32)
}
