//! From a scene file to a scene: each model once, in parallel, then put together.

mod camera;
mod deforming;
mod objects;
mod shutter;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::SystemTime;

use etendue_camera::Camera;
use etendue_files::{InputFolder, Opener};
use etendue_geometry::{Bounds, Geometry};
use etendue_optics::glass::AgfCatalogue;
use etendue_report::Refusal;
use etendue_tracer::{LayerSpec, Light, Material, Texture};
use rayon::prelude::*;

use crate::cache::{ImportManner, KeptCamera};
use crate::doctor::memory;
use crate::file::{FileKind, ObjectSpec, SceneFile, ScenePath};
use crate::identity::Ingredients;
use crate::import::{self, Import, ImportedPlacement, Note, NoteKind, Wanted};
use crate::memory::Budget;
use crate::parts::{Object, SceneParts};
use crate::scene::{LoadContext, LoadOptions, LoadProgress, Scene};
use crate::shape::{GoOn, ShapeError, ShapeSpec};
use crate::{Cache, SceneError};
use camera::CameraAhead;
pub(crate) use camera::CameraFiles;
use objects::{OriginKind, OwnParts, TriangleOrigin};

impl SceneFile {
    /// Opens all that the scene names and puts it together. Of the models only what is `wanted` is
    /// read.
    ///
    /// # Errors
    ///
    /// When a value makes no sense, a file is missing, leaves the scene's folder or cannot be
    /// imported; the message names the place.
    pub fn load(&self, wanted: Wanted, options: &LoadOptions<'_>) -> Result<Scene, SceneError> {
        let since = SystemTime::now();
        let fresh = Cache::default();
        let kept = options.cache.unwrap_or(&fresh);
        let folder = self.open_folder(&options.opener)?;
        let mut own = self.named_materials(&folder, options.glasses, wanted)?;
        let (textures, files) = (&mut own.textures, &mut own.files);
        let lights = self.named_lights(&folder, options.glasses, wanted, textures, files)?;
        // What can be checked without the models is; a bad camera need not wait for them.
        let ahead = self.camera_ahead(&folder, options, kept)?;
        let size = ahead.camera.resolution();
        let budget = Arc::new(Budget::new(options.memory_limit));
        if options.to_render {
            let film = memory::film(size, &self.spec.all_layers());
            let [width, height] = size;
            self.take(&budget, film, || format!("a picture of {width} x {height} pixels"))?;
        }
        let slots = self.slots(&options.opener)?;
        self.check_pixels(&slots, size)?;
        let mut named = OwnParts {
            materials: &own.materials,
            files: Vec::new(),
            kept,
            budget: options.to_render.then_some(&*budget),
        };
        let (origins, objects) = self.resolve_objects(&folder, &mut named)?;
        let instance_files = named.files;
        let context = LoadContext { folder: &folder, options, budget: &budget, kept };
        let imports = self.import_all(&origins, &objects, wanted, context)?;
        let mut parts =
            SceneParts::new(own.materials, own.textures, lights.clone().unwrap_or_default());
        let split_nodes = self.kind() == FileKind::Model;
        for (spec, object) in self.spec.objects.iter().zip(&objects) {
            let note = self.note_up(spec, &imports[object.origin]);
            parts.notes.extend(note.filter(|note| !parts.notes.contains(note)));
        }
        for import in imports {
            parts.add_import(import);
        }
        parts.settle_backs(self.spec.cull_backfaces);
        parts.files = instance_files;
        parts.files.extend(own.files);
        let slot_count = slots.len();
        parts.files.extend(slots.into_iter().flat_map(|slot| slot.files));
        for (index, object) in objects.iter().enumerate() {
            self.check_overrides(&parts, object, index)?;
            // The copies are spoken for, as far as each places one mesh.
            let known = match options.to_render {
                true => memory::copies(object.world_from_object.len() as u64),
                false => 0,
            };
            let bytes = parts.bytes_to_place(object, split_nodes).saturating_sub(known);
            self.take(&budget, bytes, || format!("placing \"{}\"", object.title))?;
            parts.place(object, split_nodes).map_err(|what| self.too_many(what))?;
        }
        if self.spec.picture() == Some(LayerSpec::Radiance) && lights.is_none() {
            parts.studio_if_dark = !parts.light_by_default();
        }
        let scene = self.finish(parts, ahead, context, since)?;
        kept.sweep();
        let mut scene = Scene { slots: slot_count, ..scene };
        self.check_contradictions(&scene)?;
        scene.notes.extend(self.idle_settings(&scene));
        Ok(scene)
    }

    /// The folder that the scene's paths start at.
    pub(crate) fn open_folder(&self, opener: &Opener) -> Result<InputFolder, SceneError> {
        let path = self.folder();
        opener.folder(path).map_err(|source| SceneError::unreadable(path, &source))
    }

    /// The camera as far as it is known without the models: one that frames the scene sees nothing
    /// yet.
    pub(crate) fn camera_alone(
        &self,
        folder: &InputFolder,
        glasses: &[AgfCatalogue],
    ) -> Result<Camera, SceneError> {
        let files = CameraFiles::new(folder, glasses);
        self.camera_spec().build(Bounds::default, &files).map_err(|error| self.camera_fault(&error))
    }

    /// Speaks for memory that `what` is about to take.
    fn take(
        &self,
        budget: &Budget,
        bytes: u64,
        what: impl FnOnce() -> String,
    ) -> Result<(), SceneError> {
        budget
            .take(bytes)
            .map_err(|source| SceneError::refused(self.path(), format!("{} {source}", what())))
    }

    fn too_many(&self, what: &'static str) -> SceneError {
        let why = format!("has more than {} {what}\nhint: split the scene", u32::MAX);
        SceneError::refused(self.path(), why)
    }

    fn import_all(
        &self,
        origins: &[TriangleOrigin],
        objects: &[Object],
        wanted: Wanted,
        LoadContext { folder, options, budget, kept }: LoadContext<'_>,
    ) -> Result<Vec<Import>, SceneError> {
        let done = AtomicUsize::new(0);
        let settings = import::Options {
            strictness: options.strictness,
            root: folder.limit().map(std::path::Path::to_owned),
            budget: Arc::clone(budget),
            copy: options.copy,
            animation: None,
        };
        let goes_on = |origin: &TriangleOrigin, done: usize| {
            let name = &objects[origin.user].title;
            let step = LoadProgress { name, done, total: origins.len() };
            options.progress.is_none_or(|progress| progress(step))
        };
        let structure = |triangles| match options.to_render {
            true => memory::structure(triangles),
            false => 0,
        };
        let manner = ImportManner {
            wanted,
            strictness: options.strictness,
            root: folder.limit().map(std::path::Path::to_owned),
            play: None,
        };
        // All are waited for, so that the first fault in the file's order is the one reported.
        let imports: Vec<Result<Import, SceneError>> = origins
            .par_iter()
            .map(|origin| {
                if !goes_on(origin, done.load(Ordering::Relaxed)) {
                    return Err(SceneError::Stopped);
                }
                let at = ScenePath::of("objects").index(origin.user);
                let known = origin.kind.kept();
                let manner = ImportManner { play: origin.kind.play(), ..manner.clone() };
                if let Some(import) = known.as_ref().and_then(|known| kept.model(known, &manner)) {
                    return self.again(&import, budget, &objects[origin.user].title, structure);
                }
                let mut import = match &origin.kind {
                    OriginKind::Given(name) => {
                        let import = kept.given(name).cloned().unwrap_or_default();
                        return self.again(&import, budget, name, structure);
                    }
                    OriginKind::File(path, play) => {
                        let settings =
                            import::Options { animation: play.clone(), ..settings.clone() };
                        let import = import::import(path, wanted, &settings)
                            .map_err(|source| self.import_fault(at, source))?;
                        let triangles: usize =
                            import.meshes.iter().map(|m| m.triangles.len()).sum();
                        self.take(budget, structure(triangles as u64), || {
                            format!(
                                "the structure over {triangles} triangles of {}",
                                path.display()
                            )
                        })?;
                        import
                    }
                    OriginKind::Shape(shape) => {
                        let (triangles, bytes) = shape.cost(wanted);
                        let bytes = bytes.saturating_add(structure(triangles));
                        self.take(budget, bytes, || {
                            format!("{at}: a {} of {triangles} triangles", shape.name())
                        })?;
                        of_shape(shape, wanted, &|| goes_on(origin, done.load(Ordering::Relaxed)))
                            .map_err(|fault| self.fault(at.join(fault.key), fault.reason))?
                            .ok_or(SceneError::Stopped)?
                    }
                };
                if let Some(known) = known {
                    kept.keep(known, manner, &mut import);
                }
                let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                if goes_on(origin, done) { Ok(import) } else { Err(SceneError::Stopped) }
            })
            .collect();
        imports.into_iter().collect()
    }

    /// A model that is in memory already. Only where the user set a limit is that counted: what the
    /// system has free is without it.
    fn again(
        &self,
        import: &Import,
        budget: &Budget,
        title: &str,
        structure: impl Fn(u64) -> u64,
    ) -> Result<Import, SceneError> {
        if budget.is_given() {
            let triangles: usize = import.meshes.iter().map(|m| m.triangles.len()).sum();
            let bytes = import.stats.bytes_copied.saturating_add(structure(triangles as u64));
            self.take(budget, bytes, || format!("\"{title}\" of {triangles} triangles"))?;
        }
        Ok(import.clone())
    }

    fn import_fault(&self, at: ScenePath, why: Refusal) -> SceneError {
        SceneError::Refused(match self.kind() {
            FileKind::Model => why,
            FileKind::Scene => why.and(&format!(" (from {}: {at})", self.path().display())),
        })
    }

    fn finish(
        &self,
        parts: SceneParts,
        ahead: CameraAhead,
        context: LoadContext<'_>,
        since: SystemTime,
    ) -> Result<Scene, SceneError> {
        let LoadContext { folder, options, budget, kept } = context;
        let built = self.kept_camera(parts.geometry, &parts.cameras, context, ahead)?;
        let KeptCamera { geometry, camera, origin: camera_origin, files: camera_files, .. } = built;
        let geometry = self.deformed(geometry, &parts.deformers, &camera, budget)?;
        let span = camera.exposure_span();
        let things_move = geometry.moving_within(span).next().is_some()
            || parts.lights.iter().any(|light| light.moves_within(span));
        let camera = camera.among_moving_things(things_move);
        let mut emission = parts.materials.iter().filter_map(|material| material.emission.as_ref());
        let lights_change = parts.lights.iter().any(|light| light.modulation.is_some())
            || emission.any(|emission| emission.modulation.is_some());
        let camera = camera.under_changing_lights(lights_change);
        // Every file that the scene is made of.
        let opened = parts.stats.files.iter().map(|(path, _)| path.clone());
        let images = parts.textures.iter().filter_map(Texture::file);
        let skies = parts.lights.iter().filter_map(Light::file);
        let others = parts.files.iter();
        let mut files: Vec<(String, PathBuf)> = opened
            .chain(camera_files.into_iter().map(|file| file.path))
            .chain(images.chain(skies).chain(others).chain(options.also_read).cloned())
            .map(|path| (folder.relative(&path), path))
            .collect();
        files.sort();
        files.dedup();
        let own = (!self.is_in_memory()).then(|| self.path().to_owned());
        options.opener.record(own.into_iter().chain(files.iter().map(|(_, path)| path.clone())));
        let inputs = options.opener.found();
        // What a user should know of it.
        let mut notes = parts.notes;
        notes.extend(self.unused_materials());
        notes.extend(nothing_to_draw(&geometry));
        if self.spec.picture() == Some(LayerSpec::Radiance) {
            notes.extend(objects::of(&geometry, &parts.materials, &parts.lights));
        } else if camera.lens().is_some_and(|lens| lens.diffracts()) {
            notes.push(Note {
                kind: NoteKind::Unused,
                subject: "`camera.diffraction`".to_owned(),
                message: "spreads light alone, and nothing here traces any: set `tracer` to `path` or `direct`".to_owned(),
                count: 1,
            });
        }
        let sensor = self.sensor_behind(&camera)?;
        notes.extend(self.lens_notes(&camera, options.strictness)?);
        let is_whole = self.spec.serial.is_empty();
        notes.extend(shutter::notes(&camera).into_iter().filter(|_| is_whole));
        notes.extend(shutter::held(&camera, &geometry, &parts.deformers, &parts.lights));
        notes.extend(shutter::dark_lights(&camera, &parts.lights, &parts.materials));
        Ok(Scene {
            path: self.path().to_owned(),
            geometry,
            objects: parts.register.objects,
            nodes: parts.register.nodes,
            copies: parts.register.copies,
            materials: parts.materials,
            textures: parts.textures,
            lights: parts.lights,
            studio_if_dark: parts.studio_if_dark,
            tracer: self.spec.tracer,
            camera: camera.with_lens_accuracy(self.spec.accuracy.of_lens()),
            sensor,
            camera_origin,
            cameras: parts.cameras,
            picture: self.spec.picture(),
            slots: 0,
            layers: self.spec.all_layers(),
            render: self.spec.render.clone(),
            plan: self.spec.plan,
            accuracy: self.spec.accuracy,
            tolerance: self.spec.tolerance,
            notes,
            stats: parts.stats,
            inputs,
            is_copy: options.copy,
            since,
            ingredients: Ingredients::new(
                self.value(),
                files,
                kept.digests_of_given().collect(),
                kept.digests(),
            ),
        })
    }

    fn unused_materials(&self) -> impl Iterator<Item = Note> + '_ {
        let is_used = |name: &String| {
            let names = |o: &ObjectSpec| {
                o.material.as_ref() == Some(name) || o.materials.values().any(|m| m == name)
            };
            self.spec.objects.iter().any(names)
        };
        self.spec.materials.keys().filter(move |name| !is_used(name)).map(|name| Note {
            kind: NoteKind::Unused,
            subject: name.clone(),
            message: "no object uses this material".to_owned(),
            count: 1,
        })
    }
}

/// A shape as if it had been imported; `None` once `go_on` says no.
fn of_shape(
    shape: &ShapeSpec,
    wanted: Wanted,
    go_on: GoOn<'_>,
) -> Result<Option<Import>, ShapeError> {
    let Some(mesh) = shape.build_while(wanted, go_on)? else { return Ok(None) };
    let stats = import::Stats { bytes_copied: mesh.heap_bytes() as u64, ..Default::default() };
    Ok(Some(Import {
        placements: vec![ImportedPlacement::whole(0)],
        meshes: vec![mesh],
        materials: vec![Material::unnamed()],
        stats,
        ..Import::default()
    }))
}

/// The note on a scene without a triangle.
fn nothing_to_draw(geometry: &Geometry) -> Option<Note> {
    (geometry.triangles() == 0).then(|| Note {
        kind: NoteKind::Empty,
        subject: "scene".to_owned(),
        message: "nothing to draw: there is no triangle, and all rays miss; check the export, or \
                  give the scene objects"
            .to_owned(),
        count: 1,
    })
}
