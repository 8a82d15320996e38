//! The objects of a scene, their names resolved: where their triangles come from, once for all that share
//! them, and what each makes of them.
//!
//! Light that a scene asks for and no picture will show.

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::doctor::memory;
use crate::error::not_found;
use crate::file::{AnimationSpec, FileKind, ObjectSpec, SceneFile, ScenePath, Source, Up};
use crate::import::{Import, Note, NoteKind, Play};
use crate::memory::Budget;
use crate::parts::{Instances, Object, SceneParts};
use crate::shape::ShapeSpec;
use crate::words::suggest;
use crate::{Cache, SceneError, cache};
use etendue_files::{FoundFile, InputFolder};
use etendue_geometry::{Bounds, Geometry, Mesh, Placement};
use etendue_tracer::{Light, LightKind, Material};

/// Origin of triangles, once for all objects that share them.
pub(super) struct TriangleOrigin {
    pub(super) kind: OriginKind,
    /// The first object that uses it, for messages.
    pub(super) user: usize,
}

#[derive(PartialEq)]
pub(super) enum OriginKind {
    /// A moment of it, where it is animated.
    File(PathBuf, Option<Play>),
    Shape(ShapeSpec),
    /// In no file, by its name.
    Given(String),
}

impl OriginKind {
    /// As the cache knows it.
    pub(super) fn kept(&self) -> Option<cache::ModelOrigin> {
        match self {
            Self::File(path, _) => Some(cache::ModelOrigin::File(path.clone())),
            // Shapes are made of numbers and words, which always serialise.
            Self::Shape(shape) => {
                Some(cache::ModelOrigin::Shape(serde_json::to_string(shape).unwrap_or_default()))
            }
            Self::Given(_) => None,
        }
    }

    /// The moment of an animation that is shown.
    pub(super) fn play(&self) -> Option<Play> {
        match self {
            Self::File(_, play) => play.clone(),
            Self::Shape(_) | Self::Given(_) => None,
        }
    }
}

impl SceneFile {
    pub(super) fn resolve_objects(
        &self,
        folder: &InputFolder,
        own: &mut OwnParts<'_>,
    ) -> Result<(Vec<TriangleOrigin>, Vec<Object>), SceneError> {
        let mut origins: Vec<TriangleOrigin> = Vec::new();
        // Links to one file are one file.
        let mut files: BTreeMap<PathBuf, PathBuf> = BTreeMap::new();
        let mut objects = Vec::new();
        for (index, spec) in self.spec.objects.iter().enumerate() {
            let at = ScenePath::of("objects").index(index);
            let origin = match &spec.source {
                Source::File(written) if own.kept.given(written).is_some() => {
                    let kind = OriginKind::Given(written.clone());
                    origins.iter().position(|known| known.kind == kind).unwrap_or_else(|| {
                        origins.push(TriangleOrigin { kind, user: index });
                        origins.len() - 1
                    })
                }
                Source::File(written) => {
                    let FoundFile { path, real } = self.find(folder, index, written)?;
                    let path = files.entry(real).or_insert(path).clone();
                    let kind = OriginKind::File(path, self.play(spec, &at)?);
                    origins.iter().position(|known| known.kind == kind).unwrap_or_else(|| {
                        origins.push(TriangleOrigin { kind, user: index });
                        origins.len() - 1
                    })
                }
                Source::Shape(_) if spec.animation.is_some() => {
                    let why =
                        "a shape has no animation; models of glTF files have\nhint: leave this out";
                    return Err(self.fault(at.key("animation"), why));
                }
                Source::Shape(shape) => {
                    let kind = OriginKind::Shape(shape.clone());
                    origins.iter().position(|known| known.kind == kind).unwrap_or_else(|| {
                        origins.push(TriangleOrigin { kind, user: index });
                        origins.len() - 1
                    })
                }
            };
            objects.push(self.object(spec, &at, origin, folder, own)?);
        }
        Ok((origins, objects))
    }

    /// The moment of a model's animation that is shown.
    pub(super) fn play(
        &self,
        spec: &ObjectSpec,
        at: &ScenePath,
    ) -> Result<Option<Play>, SceneError> {
        let Some(AnimationSpec { time, name, plays }) = &spec.animation else { return Ok(None) };
        if !time.0.is_finite() {
            return Err(self.fault(at.join("animation.time"), "is not finite"));
        }
        match &spec.source {
            Source::File(path) if !names_no_up(path) => {
                Ok(Some(Play { which: name.clone(), time: time.0, plays: *plays }))
            }
            Source::File(_) | Source::Shape(_) => Err(self.fault(
                at.key("animation"),
                "only glTF files have animations\nhint: leave this out",
            )),
        }
    }

    /// The object at path `at`, its names resolved.
    pub(super) fn object(
        &self,
        spec: &ObjectSpec,
        at: &ScenePath,
        origin: usize,
        folder: &InputFolder,
        own: &mut OwnParts<'_>,
    ) -> Result<Object, SceneError> {
        let world_from_object = spec
            .transform
            .build()
            .map_err(|(key, why)| self.fault(at.key("transform").join(key), why))?;
        let motion = spec.motion.as_ref().map(|motion| {
            let built = motion.build(&spec.transform, self.spec.render.time());
            built.map_err(|(key, why)| self.fault(at.key("motion").join(key), why))
        });
        let motion = motion.transpose()?;
        // Where it stands at the frame's time.
        let world_from_object = motion.as_ref().map_or(world_from_object, |motion| motion.at(0.0));
        // The scene's own materials, for all of the object or by the model's names.
        let named = |name: &str, at: ScenePath| {
            let position = own.materials.iter().position(|material| material.name == name);
            let position = position.and_then(|position| u32::try_from(position).ok());
            position.ok_or_else(|| self.fault(at, unknown_material(name, own.materials)))
        };
        let material = match &spec.material {
            Some(name) => Some(named(name, at.key("material"))?),
            None => None,
        };
        let mut overrides = BTreeMap::new();
        for (theirs, ours) in &spec.materials {
            let place = at.key("materials").key(theirs);
            overrides.insert(theirs.clone(), named(ours, place)?);
        }
        // Each copy is turned upright, placed among the copies, and then in the world.
        let budget = own.budget;
        let fits = |count: u64| {
            let taken = budget.map_or(Ok(()), |budget| budget.take(memory::copies(count)));
            taken.map_err(|error| format!("{count} copies: {error}"))
        };
        let at = at.key("instances");
        let instances = Instances::resolve(spec.instances.as_ref(), &at, folder, &fits)
            .map_err(|(at, why)| self.fault(at, why))?;
        own.files.extend(instances.file);
        let turn = self.up_of(spec).turn();
        let copies = instances.transforms.iter();
        let copies = copies.map(|copy| copy.then_inner(&turn));
        let (mut stand, mut motions) = (Vec::new(), Vec::new());
        for copy in copies {
            stand.push(world_from_object.then_inner(&copy));
            motions.extend(motion.as_ref().map(|motion| motion.then_inner(&copy)));
        }
        Ok(Object {
            title: spec.title(),
            origin,
            world_from_object: stand,
            motions,
            material,
            overrides,
        })
    }

    /// Axis of an object's file that points up.
    pub(super) fn up_of(&self, spec: &ObjectSpec) -> Up {
        let silent = matches!(&spec.source, Source::File(path) if names_no_up(path));
        spec.up.unwrap_or(if silent { self.spec.up } else { Up::Y })
    }

    /// That a model seems to lie on its back or its side: a file that does not say which way is up, and whose
    /// box stands on z = 0, or a little above it, with as much on one side of y = 0 as on the other.
    pub(super) fn note_up(&self, spec: &ObjectSpec, import: &Import) -> Option<Note> {
        let Source::File(path) = &spec.source else { return None };
        let said = spec.up.is_some() || self.value().get("up").is_some();
        if said || !names_no_up(path) {
            return None;
        }
        let how = where_z_is_up(import)?;
        let message = format!(
            "{how}: if it lies on its back or its side, +Z is up in this file; give `--up z`, or its object \
             `\"up\": \"z\"` (`\"y\"` for silence)"
        );
        Some(Note { kind: NoteKind::Assumed, subject: path.clone(), message, count: 1 })
    }

    /// Materials that an object replaces and its model does not have are refused.
    pub(super) fn check_overrides(
        &self,
        parts: &SceneParts,
        object: &Object,
        index: usize,
    ) -> Result<(), SceneError> {
        let known: Vec<&str> = parts.names_of_materials(object).collect();
        match object.overrides.keys().find(|name| !known.contains(&name.as_str())) {
            None => Ok(()),
            Some(name) => {
                let at = ScenePath::of("objects").index(index).key("materials").key(name);
                let known = known.into_iter().filter(|name| !name.is_empty());
                let why = format!("the model has no material \"{name}\"{}", suggest(name, known));
                Err(self.fault(&at, why))
            }
        }
    }

    /// The file of an object. A model that stands for the scene is where the user said it is.
    pub(super) fn find(
        &self,
        folder: &InputFolder,
        index: usize,
        written: &str,
    ) -> Result<FoundFile, SceneError> {
        let own_name = self.path().file_name().unwrap_or_default().to_string_lossy();
        if self.kind() == FileKind::Model && written == own_name {
            let path = self.path().to_owned();
            let real =
                path.canonicalize().map_err(|source| SceneError::unreadable(&path, &source))?;
            return Ok(FoundFile { path, real });
        }
        let at = ScenePath::of("objects").index(index).key("file");
        folder.find(written).map_err(|error| self.fault(&at, not_found(error)))
    }
}

/// True if a model's format leaves open which way is up.
fn names_no_up(path: &str) -> bool {
    let ending = path.rsplit_once('.').map_or("", |(_, ending)| ending);
    ["obj", "ply"].iter().any(|known| ending.eq_ignore_ascii_case(known))
}

/// Description of how the box of a model stands when +Z seems to be up in it; `None` when nothing tells.
fn where_z_is_up(import: &Import) -> Option<&'static str> {
    /// Shares of the box's own sides.
    const ON_THE_GROUND: f64 = 0.01;
    const OFF_CENTRE: f64 = 0.2;
    const MIRRORED: f64 = 0.02;
    let boxes = import.meshes.iter().map(|mesh| mesh.bounds);
    let bounds = boxes.fold(Bounds::EMPTY, Bounds::union);
    let (size, centre) = (bounds.max - bounds.min, bounds.centre());
    // A sheet says nothing.
    if bounds.is_empty() || size.min_element() <= 0.05 * size.max_element() {
        return None;
    }
    if bounds.min.z.abs() <= ON_THE_GROUND * size.z && centre.y.abs() <= OFF_CENTRE * size.y {
        return Some("its box stands on z = 0");
    }
    // What is built about the plane y = 0, as a car's body is, and is a little way above z = 0; if y were up,
    // half of it would be in the ground.
    let is_above = bounds.min.z > 0.0 && bounds.min.z < size.z;
    let is_mirrored = centre.y.abs() <= MIRRORED * size.y && centre.x.abs() <= OFF_CENTRE * size.x;
    (is_above && is_mirrored).then_some("its box is half below y = 0 and all above z = 0")
}

/// Parts that the scene file itself brings, while its objects are resolved.
pub(super) struct OwnParts<'a> {
    pub(super) materials: &'a [Material],
    /// Files that objects name beside their models.
    pub(super) files: Vec<PathBuf>,
    pub(super) kept: &'a Cache,
    /// Budget that copies are spoken for in, where the scene is to be rendered.
    pub(super) budget: Option<&'a Budget>,
}

/// That the scene has no material of this name, and which it has.
fn unknown_material(name: &str, materials: &[Material]) -> String {
    let known = materials.iter().map(|material| material.name.as_str());
    match materials {
        [] => format!("unknown material \"{name}\"; the scene has no `materials`"),
        _ => format!("unknown material \"{name}\"{}", suggest(name, known)),
    }
}

/// Notes on lights and surfaces that shine but find no way into a picture, in words.
pub(crate) fn of(geometry: &Geometry, materials: &[Material], lights: &[Light]) -> Vec<Note> {
    let mut placed: BTreeMap<u32, f64> = BTreeMap::new();
    let mut bends: Vec<&str> = Vec::new();
    // Some area of every material that shines, and the glasses.
    for placement in &geometry.placements {
        let Some(material) = materials.get(placement.material as usize) else { continue };
        if material.emission.is_some() {
            let area = placed.entry(placement.material).or_default();
            if *area == 0.0 {
                *area = some_area(geometry.mesh_of(placement), placement);
            }
        }
        if material.scattering.is_body() && !bends.contains(&material.name.as_str()) {
            bends.push(&material.name);
        }
    }
    // Materials that shine and have none.
    let mut notes: Vec<Note> = placed
        .into_iter()
        .filter(|(_, area)| *area == 0.0)
        .map(|(number, _)| {
            let message = "shines, and no triangle that it is on has an area: it lights nothing";
            note(format!("material \"{}\"", materials[number as usize].name), message)
        })
        .collect();
    // Lights that no path can find behind glass.
    let is_point = |light: &&Light| !matches!(light.kind, LightKind::Environment { .. });
    let points = lights.iter().filter(is_point).count() as u64;
    if points > 0 && !bends.is_empty() {
        let message = format!(
            "the light of suns, spots, points and projectors does not find its way through surfaces that bend it \
             ({}): what it shines on through them, or from within, is black; give the light a size \
             (`emissive`, `environment`) and take the tracer `path`",
            bends.join(", ")
        );
        notes.push(Note { count: points, ..note("lights".to_owned(), &message) });
    }
    notes
}

fn note(subject: String, message: &str) -> Note {
    Note { kind: NoteKind::Unsupported, subject, message: message.to_owned(), count: 1 }
}

/// The area (m²) of the first triangle of a placement that has one; 0 when none has.
fn some_area(mesh: &Mesh, placement: &Placement) -> f64 {
    let turn = &placement.world_from_mesh.linear;
    let area = |triangle: usize| {
        let [a, b, c] = mesh.corners(triangle);
        0.5 * (*turn * (b - a)).cross(*turn * (c - a)).length()
    };
    (0..mesh.triangles.len()).map(area).find(|area| *area > 0.0).unwrap_or(0.0)
}
