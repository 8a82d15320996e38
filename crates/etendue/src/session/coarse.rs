//! Coarser scene that is rendered in the place of one with a tolerance: the same with coarser meshes, where these are
//! within it. All else that a session is asked of its scene is answered by the scene's own meshes.

use std::sync::Arc;

use etendue_accel::Accel;
use etendue_render::Plan;
use etendue_render::tolerance::{coarser, with_meshes};
use etendue_scene::Scene;

use super::Session;
use super::loaded::CoarseScene;
use crate::Error;

/// A scene with all its detail, and the structure over it once that is built.
pub(super) type FullScene = (Arc<Scene>, Option<Arc<dyn Accel>>);

impl Session {
    /// Puts the coarser scene in the place of the loaded one, where there is one.
    pub(super) fn show_coarse(&mut self) {
        let outputs = self.options.outputs;
        let Some(loaded) = &mut self.loaded else { return };
        if loaded.coarse.is_none() && loaded.scene.tolerance.is_some() {
            let found = coarser(&loaded.scene);
            let (scene, detail) = match found {
                Some((geometry, detail)) => {
                    (Arc::new(with_meshes(&loaded.scene, geometry)), Some(detail))
                }
                None => (Arc::clone(&loaded.scene), None),
            };
            let plan = match detail {
                Some(_) => Plan::new(&scene, outputs),
                None => loaded.plan.clone(),
            };
            loaded.coarse =
                Some(CoarseScene { scene, plan, accel: None, detail, is_in_place: false });
        }
        loaded.exchange(true);
    }

    /// Puts the scene with its own meshes back. What was taken of its tolerance stays known.
    pub(super) fn show_all(&mut self) {
        let outputs = self.options.outputs;
        let Some(loaded) = &mut self.loaded else { return };
        if !loaded.exchange(false) {
            return;
        }
        let taken = loaded.coarse.as_ref().and_then(|coarse| coarse.plan.taken.clone());
        if loaded.plan.taken.is_none() && taken.is_some() {
            loaded.plan = Plan::taking(&loaded.scene, outputs, taken);
        }
    }

    /// The scene with all its detail, and the structure over it, for what is rendered to be compared with.
    pub(super) fn in_full(&self) -> Result<FullScene, Error> {
        let loaded = self.loaded()?;
        Ok(match loaded.coarse.as_ref().filter(|coarse| coarse.is_in_place) {
            Some(coarse) => (Arc::clone(&coarse.scene), coarse.accel.clone()),
            None => (Arc::clone(&loaded.scene), loaded.accel.clone()),
        })
    }
}
