//! Acceleration structures of a session, kept while they are of use.

use std::sync::Arc;

use etendue_accel::{Accel, BuildOptions};
use etendue_geometry::Geometry;
use etendue_render::{Plan, RenderError};
use etendue_scene::Scene;
use etendue_scene::file::AccelName;

/// The structures that were built last.
#[derive(Debug, Default)]
pub(crate) struct Structures {
    /// The latest first.
    built: Vec<Built>,
}

/// A structure, and what it was built over.
#[derive(Debug, Clone)]
struct Built {
    accel: Arc<dyn Accel>,
    geometry: Arc<Geometry>,
    name: Option<AccelName>,
}

impl Structures {
    /// The structure over the surfaces of `scene`, if there is one.
    pub(crate) fn over(&self, scene: &Scene) -> Option<Arc<dyn Accel>> {
        self.built.iter().find(|built| built.is_over(scene)).map(|built| Arc::clone(&built.accel))
    }

    /// Builds the structure over `scene`, with what the last one has of it.
    pub(crate) fn build(
        &mut self,
        scene: &Scene,
        plan: &Plan,
        options: &BuildOptions,
    ) -> Result<Arc<dyn Accel>, RenderError> {
        let name = scene.render.accel;
        let before = self.built.iter().find(|built| built.name == name);
        let accel = etendue_render::rebuild(scene, plan, options, before.map(|b| &*b.accel))?;
        let accel: Arc<dyn Accel> = Arc::from(accel);
        let geometry = Arc::clone(&scene.geometry);
        self.built.insert(0, Built { accel: Arc::clone(&accel), geometry, name });
        Ok(accel)
    }

    /// Drops all structures but those over `scenes`.
    pub(crate) fn keep<'s>(&mut self, scenes: impl Iterator<Item = &'s Scene> + Clone) {
        self.built.retain(|built| scenes.clone().any(|scene| built.is_over(scene)));
    }
}

impl Built {
    fn is_over(&self, scene: &Scene) -> bool {
        self.name == scene.render.accel
            && (Arc::ptr_eq(&self.geometry, &scene.geometry)
                || self.geometry.has_surfaces_of(&scene.geometry))
    }
}
