//! From a scene file to a scene: each model once, in parallel, then put together.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::SystemTime;

use etendue_camera::{Camera, CameraError, CameraSpec};
use etendue_geometry::{Bounds, Geometry};
use etendue_sensor::Sensor;
use etendue_spectrum::Bands;
use etendue_tracer::{LayerSpec, Light, Material, Texture};
use rayon::prelude::*;

use crate::bounds::Vertices;
use crate::cache::{KeptCamera, Manner};
use crate::cameras::{self, CameraOrigin, SceneCamera};
use crate::doctor::memory;
use crate::file::{
    AnimationSpec, FileKind, ObjectSpec, SceneFile, Source, Up, join, join_index, suggest,
};
use crate::identity::Ingredients;
use crate::import::{self, Import, ImportedPlacement, Note, NoteKind, Play, Strictness, Wanted};
use crate::instances::Instances;
use crate::memory::Budget;
use crate::parts::{Object, Parts};
use crate::paths::{Folder, Found};
use crate::scene::{LoadOptions, LoadProgress, Scene};
use crate::shape::{GoOn, ShapeError, ShapeSpec};
use crate::{Cache, SceneError, cache, facing, light_notes};

/// Where triangles come from, once for all objects that share them.
struct Origin {
    kind: OriginKind,
    /// The first object that uses it, for messages.
    user: usize,
}

#[derive(PartialEq)]
enum OriginKind {
    /// A moment of it, where it is animated.
    File(PathBuf, Option<Play>),
    Shape(ShapeSpec),
    /// In no file, by its name.
    Given(String),
}

impl OriginKind {
    /// As the cache knows it.
    fn kept(&self) -> Option<cache::Origin> {
        match self {
            Self::File(path, _) => Some(cache::Origin::File(path.clone())),
            // Shapes are made of numbers and words, which always serialise.
            Self::Shape(shape) => {
                Some(cache::Origin::Shape(serde_json::to_string(shape).unwrap_or_default()))
            }
            Self::Given(_) => None,
        }
    }

    /// The moment of an animation that is shown.
    fn play(&self) -> Option<Play> {
        match self {
            Self::File(_, play) => play.clone(),
            Self::Shape(_) | Self::Given(_) => None,
        }
    }
}

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
        let folder = Folder::open(self.folder(), options.reach)?;
        let own = self.named_materials(&folder, wanted)?;
        let lights = self.named_lights(&folder)?;
        // What can be checked without the models is; a bad camera need not wait for them.
        let size = self.resolution(&folder, options, kept)?;
        let budget = Arc::new(Budget::new(options.memory_limit));
        if options.to_render {
            let film = memory::film(size, &self.spec.all_layers());
            let [width, height] = size;
            self.take(&budget, film, || format!("a picture of {width} x {height} pixels"))?;
        }
        let mut named = OwnParts { materials: &own.materials, files: Vec::new(), kept };
        let (origins, objects) = self.resolve_objects(&folder, &mut named)?;
        let instance_files = named.files;
        let imports =
            self.import_all(&origins, &objects, &folder, wanted, options, (&budget, kept))?;
        let mut parts = Parts::new(own.materials, own.textures, lights.clone().unwrap_or_default());
        let split_nodes = self.kind() == FileKind::Model;
        for (spec, object) in self.spec.objects.iter().zip(&objects) {
            let note = self.note_up(spec, &imports[object.origin]);
            parts.notes.extend(note.filter(|note| !parts.notes.contains(note)));
        }
        for import in imports {
            parts.add_import(import);
        }
        parts.files = instance_files;
        for (index, object) in objects.iter().enumerate() {
            self.check_overrides(&parts, object, index)?;
            let bytes = parts.bytes_to_place(object, split_nodes);
            self.take(&budget, bytes, || format!("placing \"{}\"", object.title))?;
            parts.place(object, split_nodes).map_err(|what| self.too_many(what))?;
        }
        if self.spec.picture() == Some(LayerSpec::Radiance) && lights.is_none() {
            parts.studio_if_dark = !parts.light_by_default();
        }
        let scene = self.finish(parts, &folder, options, kept, since)?;
        kept.sweep();
        Ok(scene)
    }

    /// The camera as far as it is known without the models: one that frames the scene sees nothing
    /// yet.
    pub(crate) fn camera_alone(&self, folder: &Folder) -> Result<Camera, SceneError> {
        let files = CameraFiles::new(folder);
        self.camera_spec()
            .build(Bounds::default, &|name| files.find(name))
            .map_err(|error| self.camera_fault(&error))
    }

    /// Speaks for memory that `what` is about to take.
    fn take(
        &self,
        budget: &Budget,
        bytes: u64,
        what: impl FnOnce() -> String,
    ) -> Result<(), SceneError> {
        budget.take(bytes).map_err(|source| SceneError::Memory {
            file: self.path().to_owned(),
            what: what(),
            source,
        })
    }

    fn too_many(&self, what: &'static str) -> SceneError {
        SceneError::TooMany { file: self.path().to_owned(), what, limit: u32::MAX.into() }
    }

    fn camera_spec(&self) -> CameraSpec {
        self.spec.camera.clone().unwrap_or_default()
    }

    fn camera_fault(&self, error: &CameraError) -> SceneError {
        let dot = if error.at.is_empty() { "" } else { "." };
        self.fault(&format!("camera{dot}{}", error.at), error.why.as_str())
    }

    fn resolve_objects(
        &self,
        folder: &Folder,
        own: &mut OwnParts<'_>,
    ) -> Result<(Vec<Origin>, Vec<Object>), SceneError> {
        let mut origins: Vec<Origin> = Vec::new();
        // Links to one file are one file.
        let mut files: BTreeMap<PathBuf, PathBuf> = BTreeMap::new();
        let mut objects = Vec::new();
        for (index, spec) in self.spec.objects.iter().enumerate() {
            let at = join_index("objects", index);
            let origin = match &spec.source {
                Source::File(written) if own.kept.given(written).is_some() => {
                    let kind = OriginKind::Given(written.clone());
                    origins.iter().position(|known| known.kind == kind).unwrap_or_else(|| {
                        origins.push(Origin { kind, user: index });
                        origins.len() - 1
                    })
                }
                Source::File(written) => {
                    let Found { path, real } = self.find(folder, index, written)?;
                    let path = files.entry(real).or_insert(path).clone();
                    let kind = OriginKind::File(path, self.play(spec, &at)?);
                    origins.iter().position(|known| known.kind == kind).unwrap_or_else(|| {
                        origins.push(Origin { kind, user: index });
                        origins.len() - 1
                    })
                }
                Source::Shape(_) if spec.animation.is_some() => {
                    let why = "a shape has no animation; models of glTF files have";
                    return Err(self.fault(&join(&at, "animation"), why));
                }
                Source::Shape(shape) => {
                    let kind = OriginKind::Shape(shape.clone());
                    origins.iter().position(|known| known.kind == kind).unwrap_or_else(|| {
                        origins.push(Origin { kind, user: index });
                        origins.len() - 1
                    })
                }
            };
            objects.push(self.object(spec, &at, origin, folder, own)?);
        }
        Ok((origins, objects))
    }

    /// The moment of a model's animation that is shown.
    fn play(&self, spec: &ObjectSpec, at: &str) -> Result<Option<Play>, SceneError> {
        let Some(AnimationSpec { time, name }) = &spec.animation else { return Ok(None) };
        if !time.0.is_finite() {
            return Err(self.fault(&join(at, "animation.time"), "is not finite"));
        }
        match &spec.source {
            Source::File(path) if !names_no_up(path) => {
                Ok(Some(Play { which: name.clone(), time: time.0 }))
            }
            _ => Err(self.fault(&join(at, "animation"), "only glTF files have animations")),
        }
    }

    /// The object at path `at`, its names resolved.
    fn object(
        &self,
        spec: &ObjectSpec,
        at: &str,
        origin: usize,
        folder: &Folder,
        own: &mut OwnParts<'_>,
    ) -> Result<Object, SceneError> {
        let world_from_object = spec.transform.build().map_err(|(key, why)| {
            let at = join(at, "transform");
            self.fault(&if key.is_empty() { at } else { join(&at, key) }, why)
        })?;
        let named = |name: &str, at: &str| {
            let position = own.materials.iter().position(|material| material.name == name);
            let position = position.and_then(|position| u32::try_from(position).ok());
            position.ok_or_else(|| self.fault(at, unknown_material(name, own.materials)))
        };
        let material = match &spec.material {
            Some(name) => Some(named(name, &join(at, "material"))?),
            None => None,
        };
        let mut overrides = BTreeMap::new();
        for (theirs, ours) in &spec.materials {
            let at = join(&join(at, "materials"), theirs);
            overrides.insert(theirs.clone(), named(ours, &at)?);
        }
        let instances = Instances::resolve(spec.instances.as_ref(), &join(at, "instances"), folder)
            .map_err(|(at, why)| self.fault(&at, why))?;
        own.files.extend(instances.file);
        let turn = self.up_of(spec).turn();
        let copies = instances.transforms.iter();
        let copies = copies.map(|copy| world_from_object.then_inner(&copy.then_inner(&turn)));
        Ok(Object {
            title: spec.title(),
            origin,
            world_from_object: copies.collect(),
            material,
            overrides,
        })
    }

    /// Which axis of an object's file points up.
    fn up_of(&self, spec: &ObjectSpec) -> Up {
        let silent = matches!(&spec.source, Source::File(path) if names_no_up(path));
        spec.up.unwrap_or(if silent { self.spec.up } else { Up::Y })
    }

    /// That a model seems to lie on its back: a file that does not say which way is up, and whose box
    /// stands on z = 0 with as much on one side of y = 0 as on the other.
    fn note_up(&self, spec: &ObjectSpec, import: &Import) -> Option<Note> {
        let Source::File(path) = &spec.source else { return None };
        let said = spec.up.is_some() || self.value().get("up").is_some();
        if said || !names_no_up(path) || !stands_on_z(import) {
            return None;
        }
        let message = "its box stands on z = 0: if it lies on its back, +Z is up in this file; give \
                       `--up z`, or its object `\"up\": \"z\"` (`\"y\"` for silence)";
        Some(Note {
            kind: NoteKind::Assumed,
            subject: path.clone(),
            message: message.to_owned(),
            count: 1,
        })
    }

    /// Materials that an object replaces and its model does not have are refused.
    fn check_overrides(
        &self,
        parts: &Parts,
        object: &Object,
        index: usize,
    ) -> Result<(), SceneError> {
        let known: Vec<&str> = parts.names_of_materials(object).collect();
        match object.overrides.keys().find(|name| !known.contains(&name.as_str())) {
            None => Ok(()),
            Some(name) => {
                let at = join(&join(&join_index("objects", index), "materials"), name);
                let known = known.into_iter().filter(|name| !name.is_empty());
                let why = format!("the model has no material \"{name}\"{}", suggest(name, known));
                Err(self.fault(&at, why))
            }
        }
    }

    /// The file of an object. A model that stands for the scene is where the user said it is.
    fn find(&self, folder: &Folder, index: usize, written: &str) -> Result<Found, SceneError> {
        let own_name = self.path().file_name().unwrap_or_default().to_string_lossy();
        if self.kind() == FileKind::Model && written == own_name {
            let path = self.path().to_owned();
            let real =
                path.canonicalize().map_err(|source| SceneError::unreadable(&path, source))?;
            return Ok(Found { path, real });
        }
        let at = join(&join_index("objects", index), "file");
        folder.find(written).map_err(|why| self.fault(&at, why))
    }

    fn import_all(
        &self,
        origins: &[Origin],
        objects: &[Object],
        folder: &Folder,
        wanted: Wanted,
        options: &LoadOptions<'_>,
        (budget, kept): (&Arc<Budget>, &Cache),
    ) -> Result<Vec<Import>, SceneError> {
        let done = AtomicUsize::new(0);
        let settings = import::Options {
            strictness: options.strictness,
            root: folder.limit().map(std::path::Path::to_owned),
            budget: Arc::clone(budget),
            copy: options.copy,
            animation: None,
        };
        let goes_on = |origin: &Origin, done: usize| {
            let name = &objects[origin.user].title;
            let step = LoadProgress { name, done, total: origins.len() };
            options.progress.is_none_or(|progress| progress(step))
        };
        let structure = |triangles| match options.to_render {
            true => memory::structure(triangles),
            false => 0,
        };
        let manner = Manner {
            wanted,
            strictness: options.strictness,
            root: folder.limit().map(std::path::Path::to_owned),
            play: None,
        };
        // All are waited for, so that the first fault in the file's order is the one reported.
        let imports: Vec<Result<Import, SceneError>> = origins
            .par_iter()
            .map(|origin| {
                let at = join_index("objects", origin.user);
                let known = origin.kind.kept();
                let manner = Manner { play: origin.kind.play(), ..manner.clone() };
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
                            .map_err(|fault| self.fault(&join(&at, fault.key), fault.reason))?
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

    fn import_fault(&self, at: String, source: import::ImportError) -> SceneError {
        let path = match self.kind() {
            FileKind::Model => String::new(),
            FileKind::Scene => at,
        };
        SceneError::Import { file: self.path().to_owned(), path, source: Box::new(source) }
    }

    fn finish(
        &self,
        parts: Parts,
        folder: &Folder,
        options: &LoadOptions<'_>,
        kept: &Cache,
        since: SystemTime,
    ) -> Result<Scene, SceneError> {
        let built = self.kept_camera(parts.geometry, &parts.cameras, (folder, options), kept)?;
        let KeptCamera { geometry, camera, origin: camera_origin, files: camera_files, .. } = built;
        let opened = parts.stats.files.iter().map(|(path, _)| path.clone());
        let images = parts.textures.iter().filter_map(Texture::file);
        let skies = parts.lights.iter().filter_map(Light::file);
        let others = parts.files.iter();
        let mut inputs = folder.found();
        if !self.is_in_memory() {
            inputs.push(self.path().to_owned());
        }
        let mut files: Vec<(String, PathBuf)> = opened
            .chain(camera_files.into_iter().map(|(path, _)| path))
            .chain(images.chain(skies).chain(others).cloned())
            .map(|path| (folder.relative(&path), path))
            .collect();
        files.sort();
        files.dedup();
        inputs.extend(files.iter().map(|(_, path)| path.clone()));
        inputs.sort();
        inputs.dedup();
        let mut notes = parts.notes;
        notes.extend(self.unused_materials());
        notes.extend(nothing_to_draw(&geometry));
        if self.spec.picture() == Some(LayerSpec::Radiance) {
            notes.extend(light_notes::of(&geometry, &parts.materials, &parts.lights));
        }
        let sensor = self.sensor_behind(&camera)?;
        notes.extend(self.lens_notes(&camera, options.strictness)?);
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
            camera,
            sensor,
            camera_origin,
            cameras: parts.cameras,
            picture: self.spec.picture(),
            layers: self.spec.all_layers(),
            render: self.spec.render.clone(),
            plan: self.spec.plan,
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

    /// The picture's columns and rows, known without the models.
    fn resolution(
        &self,
        folder: &Folder,
        options: &LoadOptions<'_>,
        kept: &Cache,
    ) -> Result<[u32; 2], SceneError> {
        match kept.camera(&self.camera_words(options)) {
            Some(known) => Ok(known.camera.resolution()),
            None => Ok(self.camera_alone(folder)?.resolution()),
        }
    }

    /// All that makes the camera but the geometry.
    fn camera_words(&self, options: &LoadOptions<'_>) -> String {
        format!("{:?} {}", options.camera, self.value().get("camera").unwrap_or_default())
    }

    /// The camera over `geometry`; the one before when nothing has changed that it depends on.
    fn kept_camera(
        &self,
        geometry: Geometry,
        cameras: &[SceneCamera],
        (folder, options): (&Folder, &LoadOptions<'_>),
        kept: &Cache,
    ) -> Result<KeptCamera, SceneError> {
        let words = self.camera_words(options);
        let known = kept.camera(&words);
        let geometry = match &known {
            Some(known) if known.geometry.is_same(&geometry) => Arc::clone(&known.geometry),
            _ => Arc::new(geometry),
        };
        if let Some(known) = known
            && (Arc::ptr_eq(&known.geometry, &geometry) && options.camera.is_none()
                || known.origin == CameraOrigin::Scene)
        {
            let same = KeptCamera { geometry, ..known };
            kept.keep_camera(same.clone());
            return Ok(same);
        }
        let files = CameraFiles::new(folder);
        let (camera, origin) = self.camera(&geometry, cameras, &files, options)?;
        let files = cache::stamps(&files.found.into_inner());
        let built = KeptCamera { words, geometry, camera, origin, files };
        kept.keep_camera(built.clone());
        Ok(built)
    }

    fn camera(
        &self,
        geometry: &Geometry,
        cameras: &[SceneCamera],
        files: &CameraFiles<'_>,
        options: &LoadOptions<'_>,
    ) -> Result<(Camera, CameraOrigin), SceneError> {
        let own = self.camera_spec();
        let (spec, origin) = match options.camera {
            Some(wanted) => {
                let (index, camera) = cameras::pick(cameras, wanted).map_err(|reason| {
                    SceneError::NoSuchCamera { wanted: wanted.to_owned(), reason }
                })?;
                let mut spec = camera.spec.clone();
                let given = |key| self.value().pointer("/camera/sensor")?.get(key);
                if given("resolution").or_else(|| given("model")).is_some() {
                    *spec.sensor_mut() = own.sensor().clone();
                }
                let name = match &camera.name {
                    name if name.is_empty() => index.to_string(),
                    name => name.clone(),
                };
                (spec, CameraOrigin::Model(name))
            }
            None if own.has_pose() => (own, CameraOrigin::Scene),
            None => (own, CameraOrigin::Framed),
        };
        let vertices = Vertices(geometry);
        let camera = spec
            .build(|| facing::subject(&vertices), &|name| files.find(name))
            .map_err(|error| self.camera_fault(&error))?;
        Ok((camera, origin))
    }

    /// What is odd about the camera's lens. Glasses and filters that are not known at a wavelength
    /// that is traced are an error when strict.
    fn lens_notes(&self, camera: &Camera, strictness: Strictness) -> Result<Vec<Note>, SceneError> {
        let Some(lens) = camera.lens() else { return Ok(Vec::new()) };
        let guesses = lens.out_of_range(&Bands::Rgb);
        if let (Strictness::Strict, Some(guess)) = (strictness, guesses.first()) {
            return Err(self.fault("camera", guess.as_str()));
        }
        let train = lens.focused().train();
        let subject = if train.name().is_empty() { "the camera's lens" } else { train.name() };
        let note = |message: &String| Note {
            kind: NoteKind::Irregular,
            subject: subject.to_owned(),
            message: message.clone(),
            count: 1,
        };
        let implausible = lens.implausible();
        Ok(train.notes().iter().chain(&implausible).chain(&guesses).map(note).collect())
    }

    /// The sensor with the pixels that the camera gives it.
    fn sensor_behind(&self, camera: &Camera) -> Result<Option<Sensor>, SceneError> {
        let Some(sensor) = &self.sensor else { return Ok(None) };
        let sized = match camera.pixel_pitch() {
            Some(pitch) if pitch != sensor.pixel_pitch() => sensor.with_pixel_pitch(pitch),
            _ => Ok(sensor.clone()),
        };
        let sized = sized.map_err(|error| self.fault("camera.sensor", error.why()))?;
        Ok(Some(sized.with_resolution(camera.resolution())))
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

/// Whether a model's format leaves open which way is up.
fn names_no_up(path: &str) -> bool {
    let ending = path.rsplit_once('.').map_or("", |(_, ending)| ending);
    ["obj", "ply"].iter().any(|known| ending.eq_ignore_ascii_case(known))
}

/// Whether the box of a model stands on the plane z = 0, and not on y = 0.
fn stands_on_z(import: &Import) -> bool {
    /// Shares of the box's own sides.
    const ON_THE_GROUND: f64 = 0.01;
    const OFF_CENTRE: f64 = 0.2;
    let boxes = import.meshes.iter().map(|mesh| mesh.bounds);
    let bounds = boxes.fold(Bounds::EMPTY, Bounds::union);
    if bounds.is_empty() {
        return false;
    }
    let size = bounds.max - bounds.min;
    // A sheet says nothing.
    size.min_element() > 0.05 * size.max_element()
        && bounds.min.z.abs() <= ON_THE_GROUND * size.z
        && bounds.centre().y.abs() <= OFF_CENTRE * size.y
}

/// What the scene file itself brings, while its objects are resolved.
struct OwnParts<'a> {
    materials: &'a [Material],
    /// Files that objects name beside their models.
    files: Vec<PathBuf>,
    kept: &'a Cache,
}

/// That the scene has no material of this name, and which it has.
fn unknown_material(name: &str, materials: &[Material]) -> String {
    let known = materials.iter().map(|material| material.name.as_str());
    match materials {
        [] => format!("unknown material \"{name}\"; the scene has no `materials`"),
        _ => format!("unknown material \"{name}\"{}", suggest(name, known)),
    }
}

/// The files that a camera names: lenses and masks.
struct CameraFiles<'a> {
    folder: &'a Folder,
    /// Those that were asked for and are there.
    found: RefCell<Vec<PathBuf>>,
}

impl<'a> CameraFiles<'a> {
    fn new(folder: &'a Folder) -> Self {
        Self { folder, found: RefCell::default() }
    }

    fn find(&self, written: &str) -> Result<PathBuf, String> {
        let path = self.folder.find(written)?.path;
        let mut found = self.found.borrow_mut();
        if !found.contains(&path) {
            found.push(path.clone());
        }
        Ok(path)
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
