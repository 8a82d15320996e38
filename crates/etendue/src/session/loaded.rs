//! A scene as it is loaded, and the coarser one that is rendered in its place where it has a tolerance.

use std::sync::Arc;

use etendue_accel::Accel;
use etendue_render::Plan;
use etendue_render::tolerance::TakenDetail;
use etendue_scene::Scene;

use crate::neighbours::Neighbour;

/// The scene as it is now: while its picture is rendered, the one in its place.
pub(super) struct LoadedScene {
    pub(super) scene: Arc<Scene>,
    pub(super) plan: Plan,
    pub(super) notes: Vec<String>,
    /// The structure over it, once it is built.
    pub(super) accel: Option<Arc<dyn Accel>>,
    /// Other frames that it is compared with.
    pub(super) neighbours: Vec<Neighbour>,
    /// State of the images of this scene: whether they are decoded, and how much of them.
    pub(super) decoded: DecodedImages,
    /// Coarser scene that is rendered in its place, once that was looked for.
    pub(super) coarse: Option<CoarseScene>,
}

/// State of a scene's images.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum DecodedImages {
    /// Nothing yet.
    Nothing,
    /// All of those that are looked at.
    Whole,
    /// As much as the rays of the picture can tell apart, where the scene has a tolerance.
    ForPicture,
}

/// A scene with coarser meshes; while it is rendered, the scene with its own.
pub(super) struct CoarseScene {
    /// The other one of the two, its plan and the structure over it.
    pub(super) scene: Arc<Scene>,
    pub(super) plan: Plan,
    pub(super) accel: Option<Arc<dyn Accel>>,
    /// Detail that was left out; nothing where the scene has to be rendered as it is.
    pub(super) detail: Option<TakenDetail>,
    /// True if the coarser one is the session's now.
    pub(super) is_in_place: bool,
}

impl LoadedScene {
    /// Detail that is left out of its meshes.
    pub(super) fn detail(&self) -> Option<TakenDetail> {
        self.coarse.as_ref().filter(|coarse| coarse.is_in_place)?.detail
    }

    /// Exchanges the two scenes where the other one is wanted; whether it did.
    pub(super) fn exchange(&mut self, coarse_wanted: bool) -> bool {
        let Some(coarse) = &mut self.coarse else { return false };
        if coarse.detail.is_none() || coarse.is_in_place == coarse_wanted {
            return false;
        }
        std::mem::swap(&mut self.scene, &mut coarse.scene);
        std::mem::swap(&mut self.plan, &mut coarse.plan);
        std::mem::swap(&mut self.accel, &mut coarse.accel);
        coarse.is_in_place = coarse_wanted;
        true
    }
}
