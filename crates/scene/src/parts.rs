//! A scene while it is put together: what the imports bring, and where the objects place it.

use std::collections::BTreeMap;
use std::path::PathBuf;

use etendue_geometry::{Geometry, Placement, Transform};
use etendue_tracer::{EnvironmentImage, Light, LightKind, Material, Texture, TextureScope};

use crate::cameras::SceneCamera;
use crate::import::{self, Import, ImportedPlacement, Note, NoteKind};
use crate::scene::LoadStats;

/// An object, checked; its triangles are still to come.
pub(crate) struct Object {
    pub(crate) title: String,
    pub(crate) origin: usize,
    /// Where each of its copies stands.
    pub(crate) world_from_object: Vec<Transform>,
    /// The scene's material that replaces the model's.
    pub(crate) material: Option<u32>,
    /// The scene's materials that replace those of the model, by their names there.
    pub(crate) overrides: BTreeMap<String, u32>,
}

/// Where the contents of one import went.
struct Home {
    placements: Vec<ImportedPlacement>,
    cameras: Vec<import::ImportedCamera>,
    lights: Vec<import::ImportedLight>,
    meshes: usize,
    materials: usize,
}

/// A scene being put together.
#[derive(Default)]
pub(crate) struct Parts {
    pub(crate) geometry: Geometry,
    pub(crate) objects: Vec<String>,
    pub(crate) materials: Vec<Material>,
    pub(crate) textures: Vec<Texture>,
    pub(crate) lights: Vec<Light>,
    pub(crate) cameras: Vec<SceneCamera>,
    pub(crate) notes: Vec<Note>,
    pub(crate) stats: LoadStats,
    /// Files that the scene names beside its models, textures and lights.
    pub(crate) files: Vec<PathBuf>,
    homes: Vec<Home>,
}

impl Parts {
    /// What the scene file itself declares, before any model is added.
    pub(crate) fn new(
        materials: Vec<Material>,
        textures: Vec<Texture>,
        lights: Vec<Light>,
    ) -> Self {
        Self { materials, textures, lights, ..Self::default() }
    }

    pub(crate) fn add_import(&mut self, import: Import) {
        self.homes.push(Home {
            placements: import.placements,
            cameras: import.cameras,
            lights: import.lights,
            meshes: self.geometry.meshes.len(),
            materials: self.materials.len(),
        });
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
        if let Some(degenerate) = stats.degenerate {
            self.stats.degenerate = Some(self.stats.degenerate.unwrap_or(0) + degenerate);
        }
    }

    /// Places an object. A model that stands for a scene has an object for each of its nodes.
    /// The error names what there is too much of.
    pub(crate) fn place(
        &mut self,
        object: &Object,
        split_nodes: bool,
        index: usize,
    ) -> Result<(), &'static str> {
        let home = &self.homes[object.origin];
        let sum = |offset: usize, index: u32| u32::try_from(offset + index as usize).ok();
        if !split_nodes {
            self.objects.push(object.title.clone());
        }
        let mut last: Option<&ImportedPlacement> = None;
        for placement in &home.placements {
            let starts_node = last.is_none_or(|last| !is_same_node(last, placement));
            if split_nodes && starts_node {
                let named = !placement.name.is_empty();
                let name = if named { &placement.name } else { &object.title };
                self.objects.push(name.clone());
            }
            last = Some(placement);
            let number = if split_nodes { self.objects.len() - 1 } else { index };
            let own = sum(home.materials, placement.material).ok_or("materials")?;
            let named = self.materials.get(own as usize).map(|material| &material.name);
            let replaced = named.and_then(|name| object.overrides.get(name).copied());
            let material = replaced.or(object.material).unwrap_or(own);
            let mesh = sum(home.meshes, placement.mesh).ok_or("meshes")?;
            let number = u32::try_from(number).map_err(|_| "objects")?;
            let copies = object.world_from_object.iter().map(|copy| Placement {
                mesh,
                object: number,
                material,
                world_from_mesh: copy.then_inner(&placement.model_from_mesh),
            });
            self.geometry.placements.extend(copies);
        }
        if u32::try_from(self.geometry.placements.len()).is_err() {
            return Err("placements");
        }
        let number = u32::try_from(index).map_err(|_| "objects")?;
        // A million copies of a model have one place to look from: the first one's.
        if let Some(first) = object.world_from_object.first() {
            let cameras = home.cameras.iter();
            let placed = cameras.filter_map(|camera| SceneCamera::new(camera, number, first));
            self.cameras.extend(placed);
        }
        for copy in &object.world_from_object {
            self.lights.extend(home.lights.iter().filter_map(|light| light.placed(copy)));
        }
        Ok(())
    }

    /// The names of the materials that the object's model brings.
    pub(crate) fn names_of_materials(&self, object: &Object) -> impl Iterator<Item = &str> {
        let home = &self.homes[object.origin];
        let end = self.homes.get(object.origin + 1).map_or(self.materials.len(), |h| h.materials);
        self.materials[home.materials..end].iter().map(|material| material.name.as_str())
    }

    /// Lights the scene by the studio when nothing in it shines.
    pub(crate) fn light_by_default(&mut self) {
        let shines = |placement: &Placement| {
            let material = self.materials.get(placement.material as usize);
            material.is_some_and(|material| material.emission.is_some())
        };
        if !self.lights.is_empty() || self.geometry.placements.iter().any(shines) {
            return;
        }
        self.lights.push(Light {
            kind: LightKind::Environment { image: EnvironmentImage::Studio, rotation: 0.0 },
            color: [1.0; 3],
            illuminant: None,
        });
        self.notes.push(Note {
            kind: NoteKind::Assumed,
            subject: "lights".to_owned(),
            message: "nothing in the scene shines: it is lit by a grey studio; name `lights` in \
                      the scene for others, or `\"lights\": []` for none"
                .to_owned(),
            count: 1,
        });
    }
}

/// Whether two placements in a row are primitives of one node's mesh.
fn is_same_node(a: &ImportedPlacement, b: &ImportedPlacement) -> bool {
    a.name == b.name && a.mesh != b.mesh && a.model_from_mesh == b.model_from_mesh
}
