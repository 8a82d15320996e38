//! Preparation of a render: the scene, the frames that it is compared with, the structures over them, and images.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use etendue_accel::{Accel, BuildOptions};
use etendue_render::output::Outputs;
use etendue_render::tolerance::{self, Verified};
use etendue_render::{Plan, RenderedScene, denoise, plan};
use etendue_scene::escape::one_line;
use etendue_scene::file::SceneFile;
use etendue_scene::memory::Budget;
use etendue_scene::{LoadOptions, Scene, Strictness};

use super::loaded::{DecodedImages, LoadedScene};
use super::{PreparedScene, Session};
use crate::neighbours::{self, Neighbour};
use crate::progress::Phase;
use crate::words::in_words;
use crate::{Error, Progress};

impl Session {
    /// The scene, the structure over it and its images, once they are [prepared](Self::prepare).
    pub(crate) fn prepared(&self) -> Result<PreparedScene, Error> {
        let LoadedScene { scene, accel, .. } = self.loaded()?;
        let accel = accel.clone().ok_or_else(not_built)?;
        Ok(PreparedScene { scene: Arc::clone(scene), accel, images: Arc::clone(&self.images) })
    }

    /// Kinds of file to be written of the pictures.
    pub(crate) fn outputs(&self) -> Outputs {
        self.options.outputs
    }

    pub(super) fn loaded(&self) -> Result<&LoadedScene, Error> {
        self.loaded.as_ref().ok_or_else(|| Error::Refused("the scene is not loaded".to_owned()))
    }

    pub(super) fn built(&self) -> Result<&dyn Accel, Error> {
        self.loaded()?.accel.as_deref().ok_or_else(not_built)
    }

    /// Loads the scene, if it is not, and the frames that it is compared with. It has all its detail then.
    pub(super) fn load(&mut self, progress: &Progress) -> Result<(), Error> {
        self.load_as_rendered(progress)?;
        self.show_all();
        Ok(())
    }

    /// Loads the scene, but leaves a scene of which a coarser one is rendered as it is.
    pub(super) fn load_as_rendered(&mut self, progress: &Progress) -> Result<(), Error> {
        if self.loaded.is_some() {
            return Ok(());
        }
        let start = Instant::now();
        let mut neighbours = self.load_neighbours(progress)?;
        let mut scene = self.load_file(self.file(), progress)?;
        neighbours::refuse_views(&scene)?;
        neighbours.extend(neighbours::moments(&scene));
        if let Some(frames) = &self.frames {
            neighbours::refuse_far(&scene, frames)?;
        }
        let shown = self.shown.as_ref().map(|(number, _)| *number);
        let left = neighbours::leave_out(&mut scene, shown, &neighbours);
        if self.options.outputs.denoised {
            denoise::guide(&mut scene)?;
        }
        let of_frames = self.frame_notes.iter().filter(|_| shown.is_some()).cloned();
        let notes: Vec<String> =
            scene.notes.iter().map(in_words).chain(of_frames).chain(left).collect();
        notes.iter().for_each(|note| progress.note(note));
        let plan = Plan::new(&scene, self.options.outputs);
        let scene = Arc::new(scene);
        let (accel, coarse) = (None, None);
        let decoded = DecodedImages::Nothing;
        self.loaded = Some(LoadedScene { scene, plan, notes, accel, neighbours, decoded, coarse });
        self.seconds.load += start.elapsed().as_secs_f64();
        Ok(())
    }

    pub(super) fn load_file(&self, file: &SceneFile, progress: &Progress) -> Result<Scene, Error> {
        let wanted = plan::wanted(&file.spec.all_layers());
        let share = |done: usize, total: usize| done as f64 / total.max(1) as f64;
        let goes_on = |step: etendue_scene::LoadProgress<'_>| {
            progress.goes_on(Phase::Load, share(step.done, step.total))
        };
        let options = LoadOptions {
            strictness: self.options.strictness,
            opener: self.opener.clone(),
            also_read: &self.options.inputs,
            glasses: &self.glasses,
            camera: self.options.camera.as_deref(),
            memory_limit: self.options.memory_limit,
            to_render: self.options.to_render,
            copy: self.options.copy,
            cache: Some(&self.cache),
            progress: Some(&goes_on),
        };
        Ok(file.load(wanted, &options)?)
    }

    pub(super) fn load_neighbours(&self, progress: &Progress) -> Result<Vec<Neighbour>, Error> {
        let mut steps = neighbours::steps(&self.file().spec.all_layers());
        steps.retain(|step| step.moment().is_none());
        if steps.is_empty() {
            return Ok(Vec::new());
        }
        if self.file.spec.frames.is_none() {
            let path = self.file.path().display();
            return Err(Error::Refused(format!(
                "{path}: layers: flow, disparity and occlusion compare frames, and the scene has no `frames`\nhint: give \
                 it some, or leave these layers out"
            )));
        }
        // The scene by itself, when no frame is shown, has no neighbours.
        let (Some((number, _)), Some(frames)) = (&self.shown, &self.frames) else {
            return Ok(Vec::new());
        };
        // Two steps may lead to one frame.
        let mut loaded: BTreeMap<usize, Arc<Scene>> = BTreeMap::new();
        let mut neighbours = Vec::new();
        for (step, frame) in neighbours::in_steps(frames, *number, &steps) {
            let scene = match loaded.get(&frame.number) {
                Some(scene) => Arc::clone(scene),
                None => Arc::new(self.load_file(&self.file.at(frame)?, progress)?),
            };
            loaded.insert(frame.number, Arc::clone(&scene));
            neighbours.push(Neighbour { step, scene, accel: None });
        }
        Ok(neighbours)
    }

    /// Builds the structures, unless there are such over the same surfaces.
    pub(super) fn build(&mut self, progress: &Progress) -> Result<(), Error> {
        self.build_for(false, progress)
    }

    /// Builds the structure for the rays of the picture alone: what they cannot meet may be left out, and what is finer
    /// than the scene's tolerance. Of several frames each sees something else, and all have one structure.
    pub(super) fn build_for_picture(&mut self, progress: &Progress) -> Result<(), Error> {
        let is_single = self.file.spec.frames.is_none();
        self.build_for(is_single, progress)
    }

    fn build_for(&mut self, picture: bool, progress: &Progress) -> Result<(), Error> {
        self.load(progress)?;
        let start = Instant::now();
        if picture {
            self.show_coarse();
        }
        let options = BuildOptions {
            threads: rayon::current_num_threads(),
            memory_limit: self.options.memory_limit,
            robust: self.options.robust,
            isa: self.options.isa.clone(),
            progress: Some(progress.of(Phase::Build)),
            ..BuildOptions::default()
        };
        let Some(loaded) = &mut self.loaded else { return Ok(()) };
        let LoadedScene { scene, plan, accel, neighbours, .. } = loaded;
        let structures = &mut self.structures;
        let mut is_new = false;
        let unseen = plan.unseen.as_ref().filter(|_| picture);
        if accel.as_ref().is_some_and(|accel| unseen.is_none() && !structures.is_whole(accel)) {
            *accel = None;
        }
        // What is free now was judged when the structure was built; a limit holds for every picture.
        if self.options.memory_limit.is_some() {
            fits(scene, plan, self.options.memory_limit)?;
        }
        let others = neighbours.iter_mut().map(|other| (&other.scene, &mut other.accel));
        for (scene, accel) in std::iter::once((&*scene, accel)).chain(others) {
            if accel.is_none() {
                *accel = structures.over(scene, plan, unseen);
            }
            if accel.is_none() {
                fits(scene, plan, self.options.memory_limit)?;
                *accel = Some(structures.build(scene, plan, unseen, &options)?);
                is_new = true;
            }
        }
        let others = neighbours.iter().map(|other| &*other.scene);
        structures.keep(std::iter::once(&**scene).chain(others));
        if is_new {
            self.seconds.build += start.elapsed().as_secs_f64();
        }
        Ok(())
    }

    /// Decodes the images that the plan wants, unless they are.
    pub(super) fn decode(&mut self, progress: &Progress) -> Result<(), Error> {
        self.decode_as(DecodedImages::Whole, progress)
    }

    /// Decodes the images for the rays of the picture alone: in fewer texels where the scene's tolerance allows. Of
    /// several frames each would tell others apart, and all have the whole images.
    pub(super) fn decode_for_picture(&mut self, progress: &Progress) -> Result<(), Error> {
        let is_single = self.file.spec.frames.is_none();
        let has_tolerance = self.loaded()?.scene.tolerance.is_some();
        let may_be_coarse = is_single && has_tolerance;
        self.decode_as(
            if may_be_coarse { DecodedImages::ForPicture } else { DecodedImages::Whole },
            progress,
        )
    }

    fn decode_as(&mut self, wanted: DecodedImages, progress: &Progress) -> Result<(), Error> {
        let LoadedScene { scene, plan, decoded, .. } = self.loaded()?;
        if *decoded == wanted {
            return Ok(());
        }
        let start = Instant::now();
        let coarse = match wanted {
            DecodedImages::ForPicture => tolerance::coarse_images(scene, plan),
            DecodedImages::Nothing | DecodedImages::Whole => Vec::new(),
        };
        let images = self.images.renewed(scene, plan, self.options.memory_limit, &coarse)?;
        if let (Strictness::Strict, Some(fault)) = (self.options.strictness, images.faults.first())
        {
            return Err(Error::Refused(fault.clone()));
        }
        images.faults.iter().for_each(|fault| progress.note(fault));
        self.images = Arc::new(images);
        if let Some(loaded) = &mut self.loaded {
            loaded.decoded = wanted;
        }
        self.seconds.decode += start.elapsed().as_secs_f64();
        Ok(())
    }
}

impl Session {
    /// Takes what is cheapest within the scene's tolerance, unless it was.
    pub(super) fn take(&mut self, progress: &Progress) -> Result<(), Error> {
        let loaded = self.loaded()?;
        let LoadedScene { scene, plan, .. } = loaded;
        if scene.tolerance.is_none() || plan.taken.is_some() {
            return Ok(());
        }
        let start = Instant::now();
        let watch = |share: f64| progress.goes_on(Phase::Build, share);
        let rendered = RenderedScene { scene, accel: self.built()?, images: &self.images };
        let taken = tolerance::choose(rendered, plan, loaded.detail(), &watch)?;
        let plan = Plan::taking(scene, self.options.outputs, taken);
        if self.options.memory_limit.is_some() {
            fits(scene, &plan, self.options.memory_limit)?;
        }
        if let Some(loaded) = &mut self.loaded {
            loaded.plan = plan;
        }
        self.seconds.build += start.elapsed().as_secs_f64();
        Ok(())
    }

    /// Renders a small part of the scene with everything, and compares it with what is taken of its tolerance;
    /// `None` of a scene without one.
    ///
    /// # Errors
    ///
    /// As [`Self::prepare`].
    pub fn verify(&mut self, progress: &Progress) -> Result<Option<Verified>, Error> {
        self.build_for_picture(progress)?;
        self.decode_for_picture(progress)?;
        self.take(progress)?;
        // Where meshes are coarser, the scene with its own is built, too.
        let (full, accel) = self.in_full()?;
        let accel = match accel {
            Some(accel) => accel,
            None => {
                self.build(progress)?;
                let (_, accel) = self.in_full()?;
                self.build_for_picture(progress)?;
                accel.ok_or_else(not_built)?
            }
        };
        let LoadedScene { scene, plan, .. } = self.loaded()?;
        let Some(taken) = &plan.taken else { return Ok(None) };
        let watch = |share: f64| progress.goes_on(Phase::Render, share);
        let rendered = RenderedScene { scene, accel: self.built()?, images: &self.images };
        let whole = self.images.renewed(&full, plan, self.options.memory_limit, &[])?;
        let whole = RenderedScene { scene: &full, accel: &*accel, images: &whole };
        let found = tolerance::verify(whole, rendered, taken, &watch)?;
        Ok(Some(found))
    }
}

fn not_built() -> Error {
    Error::Refused("the structure is not built".to_owned())
}

/// Small lists, and buffers of files that are written (bytes).
const BESIDE: u64 = 16 << 20;

/// The part of a forecast by which it may be too low (`benches/forecasts.py memory`).
const SLACK: u64 = 4;

/// The stack of a thread of Embree's, and its small lists (bytes).
const THREAD: u64 = 6 << 20;

/// Refuses what will not fit into the memory that is allowed, or else free.
fn fits(scene: &Scene, plan: &Plan, limit: Option<u64>) -> Result<(), Error> {
    let memory = &plan.memory;
    let bytes = match limit {
        // The user's is one of all that the process holds, what it has mapped included, and is not passed
        // where a forecast is a little low.
        Some(_) => memory.total.saturating_add(memory.total / SLACK).saturating_add(memory.mapped),
        // What was loaded is no longer free.
        None => memory.to_come(),
    };
    // Asked of the system, too, with what is beside what is counted.
    let threads = rayon::current_num_threads() as u64;
    let with_threads = bytes.saturating_add(BESIDE + THREAD.saturating_mul(threads));
    let taken = Budget::new(limit).take(bytes);
    let Err(error) = taken.and_then(|()| Budget::default().take(with_threads)) else {
        return Ok(());
    };
    let [width, height] = scene.camera.resolution();
    let images = scene.textures.iter().map(|texture| (texture.decoded_bytes(), &texture.name));
    let largest = match images.max() {
        Some((bytes, name)) if 2 * bytes > memory.total => {
            format!(" (most of it for the image {})", one_line(name))
        }
        _ if 2 * memory.copies > memory.total => {
            format!(" (most of it for {} copies)", scene.placed_copies())
        }
        _ => String::new(),
    };
    let path = scene.path.display();
    Err(Error::Refused(format!("{path}: a picture of {width} x {height} pixels{largest} {error}")))
}
