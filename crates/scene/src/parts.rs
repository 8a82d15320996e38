//! A scene while it is put together: what the imports bring, and where the objects place it.
//!
//! Where the copies of an object stand: transforms of the scene file, or an NPY file of matrices.
//!
//! The file is what `numpy.save` writes of an array `[copy][row][column]`, so a million copies cost
//! 128 MB and no parsing.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;

use crate::cameras::SceneCamera;
use crate::error::not_found;
use crate::file::{InstancesSpec, ScenePath, TransformSpec};
use crate::identity::Register;
use crate::import::{self, Deformer, Import, ImportedPlacement, Note, NoteKind};
use crate::memory::has_room;
use crate::scene::LoadStats;
use etendue_files::{InputFolder, MappedFile};
use etendue_geometry::{Geometry, Motion, Placement, Transform};
use etendue_tracer::{Light, Material, Texture, TextureScope};

/// An object, checked; its triangles are still to come.
pub(crate) struct Object {
    pub(crate) title: String,
    pub(crate) origin: usize,
    /// Placement of each of its copies at the frame's time.
    pub(crate) world_from_object: Vec<Transform>,
    /// Motion of each of its copies; empty where it stands still.
    pub(crate) motions: Vec<Motion>,
    /// The scene's material that replaces the model's.
    pub(crate) material: Option<u32>,
    /// The scene's materials that replace those of the model, by their names there.
    pub(crate) overrides: BTreeMap<String, u32>,
}

/// Destination of the contents of one import.
struct Home {
    placements: Vec<ImportedPlacement>,
    cameras: Vec<import::ImportedCamera>,
    lights: Vec<import::ImportedLight>,
    meshes: usize,
    materials: usize,
}

/// A scene being put together.
#[derive(Default)]
pub(crate) struct SceneParts {
    pub(crate) geometry: Geometry,
    /// Deformations of meshes, by their indices.
    pub(crate) deformers: BTreeMap<u32, Arc<Deformer>>,
    pub(crate) register: Register,
    pub(crate) materials: Vec<Material>,
    pub(crate) textures: Vec<Texture>,
    pub(crate) lights: Vec<Light>,
    pub(crate) studio_if_dark: bool,
    pub(crate) cameras: Vec<SceneCamera>,
    pub(crate) notes: Vec<Note>,
    pub(crate) stats: LoadStats,
    /// Files that the scene names beside its models, textures and lights.
    pub(crate) files: Vec<PathBuf>,
    homes: Vec<Home>,
}

impl SceneParts {
    /// Makes those that the scene file itself declares, before any model is added.
    pub(crate) fn new(
        materials: Vec<Material>,
        textures: Vec<Texture>,
        lights: Vec<Light>,
    ) -> Self {
        Self { materials, textures, lights, ..Self::default() }
    }

    /// Leaves out the backs of surfaces that files give one side, or puts them back.
    pub(crate) fn settle_backs(&mut self, cull: bool) {
        for material in &mut self.materials {
            material.one_sided &= cull;
            if let Some(emission) = material.emission.as_mut().filter(|_| material.one_sided) {
                emission.two_sided = false;
            }
        }
    }

    pub(crate) fn add_import(&mut self, import: Import) {
        self.homes.push(Home {
            placements: import.placements,
            cameras: import.cameras,
            lights: import.lights,
            meshes: self.geometry.meshes.len(),
            materials: self.materials.len(),
        });
        let first_mesh = u32::try_from(self.geometry.meshes.len()).unwrap_or(u32::MAX);
        let deformers = import.deformers.into_iter();
        self.deformers.extend(deformers.map(|(mesh, it)| (first_mesh.saturating_add(mesh), it)));
        self.geometry.meshes.extend(import.meshes);
        let first_texture = u32::try_from(self.textures.len()).unwrap_or(u32::MAX);
        self.materials.extend(import.materials.into_iter().map(|mut material| {
            for used in material.textures_mut(TextureScope::ALL) {
                used.texture = used.texture.saturating_add(first_texture);
            }
            material
        }));
        self.textures.extend(import.textures);
        self.notes.extend(import.notes);
        let stats = import.stats;
        for (path, bytes) in stats.files {
            if !self.stats.files.iter().any(|(known, _)| *known == path) {
                self.stats.files.push((path, bytes));
            }
        }
        self.stats.bytes_mapped += stats.bytes_mapped;
        self.stats.bytes_copied += stats.bytes_copied;
        self.stats.dropped += stats.dropped;
    }

    /// Bytes that [`Self::place`] will take.
    pub(crate) fn bytes_to_place(&self, object: &Object, split_nodes: bool) -> u64 {
        let home = &self.homes[object.origin];
        let name = |p: &ImportedPlacement| if split_nodes { p.name.len() + 24 } else { 0 };
        let names: usize = home.placements.iter().map(name).sum();
        let lights = home.lights.len() * size_of::<Light>();
        let each = home.placements.len() * size_of::<Placement>() + lights;
        (each as u64).saturating_mul(object.world_from_object.len() as u64) + names as u64
    }

    /// Places an object. A model that stands for a scene has an object for each of its nodes.
    /// The error names what there is too much of.
    pub(crate) fn place(&mut self, object: &Object, split_nodes: bool) -> Result<(), &'static str> {
        let home = &self.homes[object.origin];
        let sum = |offset: usize, index: u32| u32::try_from(offset + index as usize).ok();
        let mut numbers =
            PlacementNumbers::new(object, &home.placements, split_nodes, &mut self.register)?;
        let first_object = numbers.first_object;
        for placement in &home.placements {
            let own = sum(home.materials, placement.material).ok_or("materials")?;
            let named = self.materials.get(own as usize).map(|material| &material.name);
            let replaced = named.and_then(|name| object.overrides.get(name).copied());
            let material = replaced.or(object.material).unwrap_or(own);
            let mesh = sum(home.meshes, placement.mesh).ok_or("meshes")?;
            let PlacedNode { object: number, node, first, each } = numbers.of(placement)?;
            let first = first + placement.instance.unwrap_or(0);
            let copies =
                (0..).zip(&object.world_from_object).map(|(k, copy): (u32, _)| Placement {
                    mesh,
                    object: number,
                    instance: first + k * each,
                    node,
                    material,
                    world_from_mesh: copy.then_inner(&placement.model_from_mesh),
                    motion: moved(object.motions.get(k as usize), copy, placement).map(Arc::new),
                });
            self.geometry.placements.extend(copies);
        }
        if u32::try_from(self.geometry.placements.len()).is_err() {
            return Err("placements");
        }
        // A million copies of a model have one place to look from: the first one's.
        if let Some(first) = object.world_from_object.first() {
            let cameras = home.cameras.iter();
            let placed = cameras.filter_map(|camera| SceneCamera::new(camera, first_object, first));
            self.cameras.extend(placed);
        }
        for (k, copy) in object.world_from_object.iter().enumerate() {
            let placed = home.lights.iter().filter_map(|it| it.placed(copy, object.motions.get(k)));
            self.lights.extend(placed);
        }
        Ok(())
    }

    /// The names of the materials that the object's model brings.
    pub(crate) fn names_of_materials(&self, object: &Object) -> impl Iterator<Item = &str> {
        let home = &self.homes[object.origin];
        let end = self.homes.get(object.origin + 1).map_or(self.materials.len(), |h| h.materials);
        self.materials[home.materials..end].iter().map(|material| material.name.as_str())
    }

    /// Lights the scene by the studio when nothing in it shines; otherwise `false`.
    pub(crate) fn light_by_default(&mut self) -> bool {
        let shines = |placement: &Placement| {
            let material = self.materials.get(placement.material as usize);
            material.is_some_and(|material| material.emission.is_some())
        };
        if !self.lights.is_empty() || self.geometry.placements.iter().any(shines) {
            return false;
        }
        self.lights.push(Light::STUDIO);
        self.notes.push(Note {
            kind: NoteKind::Assumed,
            subject: "lights".to_owned(),
            message: "nothing in the scene shines: it is lit by a grey studio; name `lights` in \
                      the scene for others, or `\"lights\": []` for none"
                .to_owned(),
            count: 1,
        });
        true
    }
}

/// Motion of a placement of a copy that stands at `copy`, where it or the copy does.
fn moved(own: Option<&Motion>, copy: &Transform, placement: &ImportedPlacement) -> Option<Motion> {
    let motion = match own {
        Some(motion) => motion.clone(),
        None if placement.links.is_empty() => return None,
        None => Motion::default().then_inner(copy),
    };
    Some(match placement.links.is_empty() {
        true => motion.then_inner(&placement.model_from_mesh),
        false => motion.then_links(&placement.links),
    })
}

/// The numbers that the placements of one object get.
struct PlacementNumbers<'a> {
    object: &'a Object,
    register: &'a mut Register,
    /// The object's index; of a model split into its nodes, that of the first.
    first_object: u32,
    split_nodes: bool,
    /// Number of instances that a node's own list makes of it.
    instances: HashMap<u32, u32>,
    nodes: HashMap<u32, PlacedNode>,
    /// Index of the first copy of the whole object.
    copies: Option<u32>,
}

/// A node that has its numbers.
#[derive(Debug, Clone, Copy)]
struct PlacedNode {
    object: u32,
    node: u32,
    /// Index of its first copy, and how many there are in one copy of the object.
    first: u32,
    each: u32,
}

impl<'a> PlacementNumbers<'a> {
    fn new(
        object: &'a Object,
        placements: &[ImportedPlacement],
        split_nodes: bool,
        register: &'a mut Register,
    ) -> Result<Self, &'static str> {
        let first_object = match split_nodes {
            false => register.object(&object.title)?,
            true => u32::try_from(register.objects.len()).map_err(|_| "objects")?,
        };
        let mut instances = HashMap::new();
        for placement in placements {
            if let Some(instance) = placement.instance {
                let count = instances.entry(placement.node).or_insert(0);
                *count = (instance.saturating_add(1)).max(*count);
            }
        }
        let nodes = HashMap::new();
        Ok(Self { object, register, first_object, split_nodes, instances, nodes, copies: None })
    }

    fn of(&mut self, placement: &ImportedPlacement) -> Result<PlacedNode, &'static str> {
        if let Some(known) = self.nodes.get(&placement.node) {
            return Ok(*known);
        }
        let title = &self.object.title;
        let name = if placement.name.is_empty() { title } else { &placement.name };
        let object = match self.split_nodes {
            true => self.register.object(name)?,
            false => self.first_object,
        };
        let node = self.register.node(name, object)?;
        let own = self.instances.get(&placement.node).copied();
        let each = own.unwrap_or(1);
        let copies = self.object.world_from_object.len();
        let first = match (own, self.copies) {
            (None, Some(first)) if !self.split_nodes => first,
            (None, _) if !self.split_nodes => self.register.copies(title, object, copies)?,
            _ => {
                let count = copies.checked_mul(each as usize).ok_or("instances")?;
                self.register.copies(name, object, count)?
            }
        };
        if own.is_none() {
            self.copies = Some(first);
        }
        let placed = PlacedNode { object, node, first, each };
        self.nodes.insert(placement.node, placed);
        Ok(placed)
    }
}

/// The copies of an object.
#[derive(Debug)]
pub(crate) struct Instances {
    /// Placement of each, before the object's own transform.
    pub(crate) transforms: Vec<Transform>,
    /// The file that says so.
    pub(crate) file: Option<PathBuf>,
}

impl Instances {
    /// The copies that a scene file asks for. `at` is the place of
    /// the list; the error is the place of what is wrong, and the reason. So many copies as `fits` refuses are
    /// not made.
    pub(crate) fn resolve(
        spec: Option<&InstancesSpec>,
        at: &ScenePath,
        folder: &InputFolder,
        fits: &dyn Fn(u64) -> Result<(), String>,
    ) -> Result<Self, (ScenePath, String)> {
        match spec {
            None => Ok(Self { transforms: vec![Transform::IDENTITY], file: None }),
            Some(InstancesSpec::List(list)) => {
                fits(list.len() as u64).map_err(|why| (at.clone(), why))?;
                let built = list.iter().enumerate().map(|(index, spec)| {
                    spec.build().map_err(|(key, why)| (at.index(index).join(key), why))
                });
                Ok(Self { transforms: built.collect::<Result<_, _>>()?, file: None })
            }
            Some(InstancesSpec::File(written)) => {
                let fault = |why: String| (at.clone(), why);
                let path = folder.find(written).map_err(|error| fault(not_found(error)))?.path;
                let transforms =
                    read(&path, fits).map_err(|why| fault(format!("\"{written}\" {why}")))?;
                Ok(Self { transforms, file: Some(path) })
            }
        }
    }
}

/// The matrices of an NPY file; the error goes on after the file's name.
fn read(path: &Path, fits: &dyn Fn(u64) -> Result<(), String>) -> Result<Vec<Transform>, String> {
    let map = MappedFile::open(path).map_err(|error| format!("cannot be read: {error}"))?;
    let array = etendue_image::npy::read(map.bytes(), |shape| match shape {
        [_, 3 | 4, 4] => Ok(()),
        other => Err(format!("has the shape {other:?} instead of n × 4 × 4 or n × 3 × 4")),
    })?;
    let [count, rows] = [array.shape[0], array.shape[1]];
    fits(count as u64)?;
    // They are made side by side with what is wrong with them, and then kept alone.
    if !has_room(2 * count as u64 * size_of::<Transform>() as u64) {
        return Err(format!("holds {count} matrices, and the system has no memory for them"));
    }
    let transforms = array.numbers.par_chunks_exact(4 * rows).enumerate().map(|(index, matrix)| {
        of_rows(matrix).build().map_err(|(_, why)| format!("has a matrix {index} that {why}"))
    });
    // In order, so that the first fault of the file is the one that is told.
    transforms.collect::<Vec<_>>().into_iter().collect()
}

/// A matrix of three or four rows of four.
fn of_rows(numbers: &[f64]) -> TransformSpec {
    let mut matrix = [[0.0, 0.0, 0.0, 1.0]; 4];
    for (row, numbers) in matrix.iter_mut().zip(numbers.chunks_exact(4)) {
        row.copy_from_slice(numbers);
    }
    TransformSpec { matrix: Some(matrix), ..TransformSpec::default() }
}
