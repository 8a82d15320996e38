//! Renders of a session: whole pictures, shares of them that are read from their files, and what is reported of them.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use etendue_accel::Accel;
use etendue_files::{SOFTWARE, Transaction};
use etendue_oidn::Denoiser;
use etendue_render::expose::SensorLight;
use etendue_render::output::{HeaderEntry, ImageHash, Layer};
use etendue_render::report::memory;
use etendue_render::{
    Checkpoint, Film, FilmFile, FollowedFrame, Identity, Plan, Prepared, RenderError, RenderState,
    Rendered, Report, Seconds, Shard, sample_set,
};
use etendue_scene::Scene;
use serde_json::Value;

use super::Session;
use super::loaded::LoadedScene;
use crate::rendering::TracedScene;
use crate::words::{NOT_FOLLOWED, changed, fingerprints, header, not_finite};
use crate::{Error, Progress, Rendering};

/// Shares of a render, as [`Session::render_shard`] wrote them, for [`Session::merge`].
#[derive(Debug)]
pub struct Shares {
    pub(crate) files: Vec<FilmFile>,
}

impl Shares {
    /// Reads them.
    ///
    /// # Errors
    ///
    /// When a file cannot be read, is no share, or is not whole.
    pub fn read<P: AsRef<Path>>(paths: impl IntoIterator<Item = P>) -> Result<Self, Error> {
        let read = |path: P| FilmFile::read(path.as_ref()).map_err(RenderError::from);
        Ok(Self { files: paths.into_iter().map(read).collect::<Result<_, _>>()? })
    }

    /// True if they are of the samples, and not of the rows.
    pub(crate) fn are_of_samples(&self) -> bool {
        self.files.iter().any(|file| file.header.shard.is_of_samples())
    }

    /// Origin that was given to the first share.
    #[must_use]
    pub fn origin(&self) -> Option<&Value> {
        self.files.first().map(|file| &file.header.origin)
    }
}

/// Start of a render, and the time of what was prepared before it (s): a part of its time, too.
struct Clock {
    start: Instant,
    before: f64,
}

impl Session {
    /// Renders the scene as it is now. When it is stopped while it renders and every pixel has samples, the
    /// picture of these is returned: see [`Rendering::partial`].
    ///
    /// # Errors
    ///
    /// As [`Self::prepare`], and when it is stopped before.
    pub fn render(&mut self, progress: &Progress) -> Result<Rendering, Error> {
        let clock = self.clock();
        self.open_denoiser(progress)?;
        let film = self.trace(None, &[], progress)?;
        self.conclude(film, clock, progress)
    }

    /// Renders a share of the picture's rows, or of its samples, and writes it to `path`, for [`merge`](Self::merge). `origin` goes
    /// with it, for whoever merges: [`Shares`] reads it.
    ///
    /// # Errors
    ///
    /// As [`Self::render`], and when it is stopped at all.
    pub fn render_shard(
        &mut self,
        shard: Shard,
        path: &Path,
        origin: &Value,
        progress: &Progress,
    ) -> Result<(), Error> {
        let film = self.trace(Some(shard), &[], progress)?;
        let LoadedScene { scene, plan, .. } = self.loaded()?;
        if !film.is_complete() {
            return Err(RenderError::Stopped.into());
        }
        film.notes().iter().for_each(|note| progress.note(note));
        let files = Transaction::at_once().keeping(&scene.inputs);
        Ok(film.write(&files, path, &self.identity(scene, plan)?, origin)?)
    }

    /// Puts the shares of a render together: the rendering that one machine would have made, to the bit when
    /// they are of its rows. Those of its samples are added as exactly as two f64 hold them.
    ///
    /// # Errors
    ///
    /// As [`Self::scene_and_accel`]; when a share is missing, given twice, or of another render.
    pub fn merge(&mut self, shares: &Shares, progress: &Progress) -> Result<Rendering, Error> {
        let clock = self.clock();
        self.open_denoiser(progress)?;
        self.build_for_picture(progress)?;
        self.decode_for_picture(progress)?;
        let film = if shares.are_of_samples() {
            self.trace(None, &shares.files, progress)?
        } else {
            let LoadedScene { scene, plan, .. } = self.loaded()?;
            Film::merged(scene, plan, &shares.files, &self.identity(scene, plan)?)?
        };
        self.conclude(film, clock, progress)
    }

    /// Keeps what there is of a render at `checkpoint` on the way, and goes on from there: after an
    /// interruption the same render takes up what was kept. The file stays until it is removed.
    pub fn keep_at(&mut self, checkpoint: Option<Checkpoint>) {
        self.checkpoint = checkpoint;
    }

    fn clock(&self) -> Clock {
        let before = self.seconds.load + self.seconds.build + self.seconds.decode;
        Clock { start: Instant::now(), before }
    }

    /// Traces the scene, or a share of it, or puts shares of its samples together.
    fn trace(
        &mut self,
        shard: Option<Shard>,
        shares: &[FilmFile],
        progress: &Progress,
    ) -> Result<Film, Error> {
        self.build_for_picture(progress)?;
        self.decode_for_picture(progress)?;
        self.take(progress)?;
        let LoadedScene { scene, plan, .. } = self.loaded()?;
        let identity = match (&shard, &self.checkpoint) {
            (None, None) if shares.is_empty() => Identity::new(),
            (None, Some(_)) if shares.is_empty() => self.kept_identity(scene, plan)?,
            _ => self.identity(scene, plan)?,
        };
        let state = RenderState { shard, shares, checkpoint: self.checkpoint.clone(), identity };
        if let Some(film) = self.trace_slots(&state, progress)? {
            return Ok(film);
        }
        let LoadedScene { scene, plan, neighbours, .. } = self.loaded()?;
        let (accel, start) = (self.built()?, Instant::now());
        let header = header(scene, &fingerprints(scene, neighbours)?);
        let others: Vec<FollowedFrame<'_>> =
            neighbours.iter().filter_map(|other| other.followed(scene)).collect();
        let prepared = Prepared { accel, images: &self.images, others: &others };
        let film = etendue_render::trace(scene, plan, prepared, &header, &state, progress)
            .map_err(|error| self.placed(error))?;
        self.seconds.render = start.elapsed().as_secs_f64();
        Ok(film)
    }

    /// The error of a render with its place in the scene's file, where it is about something there.
    pub(crate) fn placed(&self, error: RenderError) -> Error {
        match error {
            RenderError::Refused(why) => self.file().placed(why).into(),
            error => error.into(),
        }
    }

    /// Identity that films must agree in to be of one picture.
    fn identity(&self, scene: &Scene, plan: &Plan) -> Result<Identity, Error> {
        let prints = fingerprints(scene, &self.loaded()?.neighbours)?;
        self.identity_by(scene, plan, plan.samples.to_string(), prints)
    }

    /// Identity that a film must agree in for a render to go on from it: where more samples follow
    /// the same ones, any number of them.
    fn kept_identity(&self, scene: &Scene, plan: &Plan) -> Result<Identity, Error> {
        let neighbours = &self.loaded()?.neighbours;
        if !neighbours.is_empty() {
            return self.identity(scene, plan);
        }
        let samples = match sample_set(scene, plan) {
            None => "any".to_owned(),
            Some(size) if size == plan.samples => return self.identity(scene, plan),
            Some(size) => format!("any of a set of {size}"),
        };
        let print = HeaderEntry::new("scene_hash", scene.hash_of_any_samples()?.to_string());
        self.identity_by(scene, plan, samples, vec![print])
    }

    fn identity_by(
        &self,
        scene: &Scene,
        plan: &Plan,
        samples: String,
        prints: Vec<HeaderEntry>,
    ) -> Result<Identity, Error> {
        let [width, height] = scene.camera.resolution();
        let layers: Vec<_> = plan.layers.iter().map(|layer| layer.row().name).collect();
        let own = [
            ("version", SOFTWARE.to_owned()),
            ("accelerator", self.built()?.report().backend),
            ("resolution", format!("{width} x {height}")),
            ("number of samples", samples),
            ("seed", scene.render.seed.to_string()),
            ("list of layers", layers.join(", ")),
            ("precision", format!("{:?}", plan.precision).to_lowercase()),
            ("precision of light", format!("{:?}", plan.light_precision).to_lowercase()),
        ];
        let own = own.map(|(key, value)| (key.to_owned(), value));
        let prints = prints.into_iter().map(|print| (print.key.replace('_', " "), print.text));
        Ok(own.into_iter().chain(prints).collect())
    }

    /// The rendering of a film, with its report.
    fn conclude(
        &mut self,
        film: Film,
        clock: Clock,
        progress: &Progress,
    ) -> Result<Rendering, Error> {
        let loaded = self.loaded()?;
        let (scene, plan, accel) = (Arc::clone(&loaded.scene), &loaded.plan, self.built()?);
        let structure = loaded.accel.clone();
        let fingerprints = fingerprints(&scene, &loaded.neighbours)?;
        let header = header(&scene, &fingerprints);
        let rendered = etendue_render::finish(&scene, plan, film, header, Some(accel))?;
        let mut seconds = self.seconds;
        seconds.total = clock.start.elapsed().as_secs_f64() + clock.before;
        let mut more = rendered.notes.clone();
        more.extend(not_finite(&rendered));
        more.extend(changed(&scene));
        let mut others = loaded.neighbours.iter().filter_map(|other| other.followed(&scene));
        if others.any(|other| other.loses_some()) {
            more.push(NOT_FOLLOWED.to_owned());
        }
        more.iter().for_each(|note| progress.note(note));
        let mut notes = loaded.notes.clone();
        notes.extend(self.images.faults.iter().cloned());
        notes.extend(more);
        let mut report = self.report(&scene, accel, &rendered, seconds)?;
        report.notes = notes;
        self.seconds = Seconds::default();
        let Rendered { picture, band_film, .. } = rendered;
        // The views of a light field are rendered when they are written, and annotations are traced.
        let outputs = self.options.outputs;
        let asks = outputs.annotates() || outputs.cryptomatte;
        let traced = structure
            .filter(|_| asks || scene.camera.light_field().is_some())
            .map(|accel| TracedScene { accel, images: Arc::clone(&self.images) });
        let mut rendering =
            Rendering::new(scene, picture, band_film, traced, report, fingerprints)?;
        rendering.light = rendering.light.map(|light| self.at_common_exposure(light));
        match &self.denoiser {
            Some(denoiser) => {
                let rendering = rendering.denoised(denoiser)?;
                rendering.notes().last().into_iter().for_each(|note| progress.note(note));
                Ok(rendering)
            }
            None => Ok(rendering),
        }
    }

    /// Sets the exposure that `auto_exposure` metered on the first frame of a sequence (s), for a
    /// session that does not render that frame.
    pub fn set_metered_exposure(&mut self, exposure: f64) {
        self.metered = Some(exposure);
    }

    /// Of a sequence all frames have the exposure that was metered on the first, unless each has its own.
    fn at_common_exposure(&mut self, light: SensorLight) -> SensorLight {
        let metering = light.sensor().spec().auto_exposure;
        if self.shown.is_none() || metering.is_none_or(|metering| metering.each_frame) {
            return light;
        }
        match self.metered {
            Some(time) => light.at_exposure(time),
            None => {
                self.metered = light.metered();
                light
            }
        }
    }

    /// Finds what takes the noise out of the picture, where that is wanted: before hours are spent on it.
    fn open_denoiser(&mut self, progress: &Progress) -> Result<(), Error> {
        self.load(progress)?;
        if self.options.outputs.denoised && self.denoiser.is_none() {
            let denoiser = Denoiser::open(rayon::current_num_threads());
            self.denoiser = Some(denoiser.map_err(RenderError::from)?);
        }
        Ok(())
    }

    fn report(
        &self,
        scene: &Scene,
        accel: &dyn Accel,
        rendered: &Rendered,
        seconds: Seconds,
    ) -> Result<Report, Error> {
        // What the structure, the process and the images say of themselves.
        let (built, counts) = (accel.report(), accel.counts());
        let (peak, private) = memory();
        let sizes = self.images.sizes(scene);
        Ok(Report {
            software: SOFTWARE,
            scene: scene.path.clone(),
            scene_hash: scene.hash()?.to_string(),
            image_hash: ImageHash::of(&rendered.picture).to_string(),
            resolution: scene.camera.resolution(),
            layers: rendered.picture.layers().iter().map(Layer::title).collect(),
            accel: built.backend,
            build_quality: format!("{:?}", built.quality).to_lowercase(),
            threads: rayon::current_num_threads(),
            seed: scene.render.seed,
            samples: rendered.samples,
            samples_wanted: rendered.samples_wanted,
            sample_counts: rendered.sample_counts,
            seconds,
            rays: rendered.rays,
            lens_rays: rendered.statuses.total(),
            lens_losses: rendered.statuses.losses(),
            mrays_per_second: rendered.rays as f64 / rendered.trace_time.as_secs_f64() / 1e6,
            rechecked: counts.rechecked,
            corrected: counts.corrected,
            triangles: scene.geometry.triangles(),
            triangles_unique: scene.geometry.triangles_unique(),
            placements: scene.geometry.placements.len() as u64,
            bvh_bytes: built.bytes,
            geometry_bytes_mapped: scene.stats.bytes_mapped,
            geometry_bytes_copied: scene.stats.bytes_copied + built.copied_bytes,
            image_bytes: sizes.iter().map(|size| size.bytes).sum(),
            images: sizes,
            not_finite: rendered.light.not_finite,
            peak_memory_bytes: peak,
            peak_private_bytes: private,
            notes: Vec::new(),
            files: Vec::new(),
        })
    }
}
