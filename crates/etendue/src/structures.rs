//! Acceleration structures of a session, kept while they are of use.
//!
//! In f64 every structure over the same surfaces gives the same hits. Those of f32 depend in their last
//! bits on how it was built, so a picture whose light hits in f32 wants one that was built for it alone:
//! it is then the picture of a new session.

use std::sync::Arc;

use etendue_accel::AccelName;
use etendue_accel::{Accel, BuildOptions};
use etendue_geometry::{Geometry, HitPrecision};
use etendue_render::{Plan, RenderError, Unseen};
use etendue_scene::Scene;

/// The structures that were built last.
#[derive(Debug, Default)]
pub(crate) struct Structures {
    /// The latest first.
    built: Vec<BuiltStructure>,
}

/// A structure, and what it was built over.
#[derive(Debug, Clone)]
struct BuiltStructure {
    accel: Arc<dyn Accel>,
    geometry: Arc<Geometry>,
    name: Option<AccelName>,
    /// True if its hits are solved again in f64.
    refine: bool,
    /// Between which times (s) what moves is in it.
    exposure: [f64; 2],
    /// Nothing of it is of one before.
    is_new: bool,
    /// Parts that were left out of it.
    unseen: Option<Unseen>,
}

/// True if a picture depends on how the structure was built.
fn wants_new(plan: &Plan) -> bool {
    plan.light_precision == HitPrecision::Single && plan.layers.iter().any(|l| l.is_averaged())
}

/// True if a structure without `lacks` answers rays that cannot meet what is `unseen`.
fn serves(lacks: Option<&Unseen>, unseen: Option<&Unseen>) -> bool {
    match (lacks, unseen) {
        (None, _) => true,
        (Some(_), None) => false,
        (Some(lacks), Some(unseen)) => unseen.is_served_without(lacks),
    }
}

impl Structures {
    /// True if `accel` has all of the surfaces of its scene.
    pub(crate) fn is_whole(&self, accel: &Arc<dyn Accel>) -> bool {
        let is_own = |built: &&BuiltStructure| Arc::ptr_eq(&built.accel, accel);
        self.built.iter().find(is_own).is_none_or(|built| built.unseen.is_none())
    }

    /// The structure over the surfaces of `scene`, if there is one that will do where these are `unseen`.
    pub(crate) fn over(
        &self,
        scene: &Scene,
        plan: &Plan,
        unseen: Option<&Unseen>,
    ) -> Option<Arc<dyn Accel>> {
        let is_own =
            |built: &BuiltStructure| built.is_new && built.accel.report().quality == plan.quality;
        let will_do = |built: &&BuiltStructure| {
            built.is_over(scene)
                && serves(built.unseen.as_ref(), unseen)
                && built.refine == plan.refine
                && (!wants_new(plan) || is_own(built))
        };
        self.built.iter().find(will_do).map(|built| Arc::clone(&built.accel))
    }

    /// Builds the structure over `scene`, with what the last one has of it where that will do. What is `unseen` is
    /// left out, unless something else of the same surfaces was before: who looks elsewhere once will do so again.
    pub(crate) fn build(
        &mut self,
        scene: &Scene,
        plan: &Plan,
        unseen: Option<&Unseen>,
        options: &BuildOptions,
    ) -> Result<Arc<dyn Accel>, RenderError> {
        let name = scene.render.accel;
        let unseen = unseen.filter(|_| !self.built.iter().any(|built| built.is_over(scene)));
        let is_alike = |built: &&BuiltStructure| built.name == name && built.refine == plan.refine;
        let is_whole = |built: &&BuiltStructure| built.unseen.is_none() && unseen.is_none();
        let fits = |built: &&BuiltStructure| is_alike(built) && is_whole(built) && !wants_new(plan);
        let before = self.built.iter().find(fits);
        let is_new = before.is_none();
        let accel = match unseen {
            Some(unseen) => etendue_render::build_without(unseen, scene, plan, options)?,
            None => etendue_render::rebuild(scene, plan, options, before.map(|b| &*b.accel))?,
        };
        let accel: Arc<dyn Accel> = Arc::from(accel);
        let geometry = Arc::clone(&scene.geometry);
        let (refine, exposure) = (plan.refine, scene.camera.exposure_span());
        let unseen = unseen.cloned();
        let accel_too = Arc::clone(&accel);
        let built =
            BuiltStructure { accel: accel_too, geometry, name, refine, exposure, is_new, unseen };
        self.built.insert(0, built);
        Ok(accel)
    }

    /// Drops all structures but those over `scenes`.
    pub(crate) fn keep<'s>(&mut self, scenes: impl Iterator<Item = &'s Scene> + Clone) {
        self.built.retain(|built| scenes.clone().any(|scene| built.is_over(scene)));
    }
}

impl BuiltStructure {
    fn is_over(&self, scene: &Scene) -> bool {
        self.name == scene.render.accel
            && (self.exposure == scene.camera.exposure_span() || !scene.geometry.moves())
            && (Arc::ptr_eq(&self.geometry, &scene.geometry)
                || self.geometry.has_surfaces_of(&scene.geometry))
    }
}
