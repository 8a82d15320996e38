//! Construction of a plan: all decisions, one after the other.

use std::ops::Range;

use etendue_accel::Quality;
use etendue_camera::Camera;
use etendue_geometry::Detail;
use etendue_scene::file::BuildQuality;
use etendue_scene::{MemoryForecast, Scene};
use etendue_sensor::BandChoice;
use etendue_spectrum::Bands;
use etendue_tracer::{LayerSpec, TextureScope};

use super::words::Grounds;
use super::{MOST_BYTES_OF_SUMS, Passes, Plan, RAYS_A_SAMPLE_OF_LIGHT, Unseen, needs, quality_for};
use crate::alike::are_alike;
use crate::band_paths::BandPaths;
use crate::expose;
use crate::film::Precision;
use crate::forecast::forecast;
use crate::output::Outputs;
use crate::precision::light_precision;
use crate::samples::{self, BYTES_OF_SUM};
use crate::stopping::Stopping;
use crate::tolerance::Approximations;

impl Plan {
    /// The plan for `scene`, written as `outputs`.
    #[must_use]
    pub fn new(scene: &Scene, outputs: Outputs) -> Self {
        Self::taking(scene, outputs, None)
    }

    /// Plans the scene with what is `taken` of the scene's tolerance ([`crate::tolerance::choose`]).
    #[must_use]
    pub fn taking(scene: &Scene, outputs: Outputs, taken: Option<Approximations>) -> Self {
        Self::of(scene, outputs, expose::bands(scene), taken)
    }

    /// The plan for `scene` as one part of a picture whose light is kept in these bands.
    #[must_use]
    pub fn in_bands(scene: &Scene, outputs: Outputs, bands: &Bands) -> Self {
        Self::of(scene, outputs, BandChoice::untried(bands.clone()), None)
    }

    fn of(
        scene: &Scene,
        outputs: Outputs,
        chosen: BandChoice,
        taken: Option<Approximations>,
    ) -> Self {
        // What the layers need of hits, and how many rays that takes.
        let layers = scene.layers.clone();
        let needs = needs(&layers);
        let lens = scene.camera.has_pupil();
        let spec = scene.render.samples;
        let (stopping, not_as_asked) = Stopping::of(scene);
        let passes = Passes::of(&layers, spec.most(), lens);
        let [width, height] = scene.camera.resolution();
        let pixels = u64::from(width) * u64::from(height);
        let samples = spec.most();
        let model = taken.as_ref().and_then(|taken| taken.camera.as_ref());
        let lit_by = model.map_or(&scene.camera, |model| &model.camera);
        let is_lit = lit_by.has_pupil() && passes.light;
        // Measuring how bands part behind a lens takes longer than many a simpler model of it.
        let is_open = scene.tolerance.is_some() && taken.is_none() && is_lit;
        let band_paths = match is_open {
            true => BandPaths::Apart("what is taken of the tolerance is not known yet".to_owned()),
            false => BandPaths::of(scene, lit_by, &chosen.bands, stopping, is_lit),
        };
        let apart = |camera: &Camera| camera.band_groups(&chosen.bands).len() as u64;
        let sampled = |yes, apart| if yes { u64::from(spec.typical()) * apart } else { 0 };
        let apart_in_light = match (band_paths.are_shared(), stopping.is_adaptive()) {
            (false, _) => apart(lit_by),
            (true, false) => 1,
            // Once to find out how many samples each pixel wants, and once to land.
            (true, true) => 2,
        };
        let lit = sampled(passes.light, apart_in_light);
        let rays = pixels
            * (u64::from(passes.centre)
                + sampled(passes.mean, apart(&scene.camera))
                + lit * RAYS_A_SAMPLE_OF_LIGHT * scene.slots.max(1) as u64);
        // How well to build for so many rays, and how exactly to trace.
        let triangles = scene.geometry.triangles_unique();
        let quality = forced_quality(scene).unwrap_or_else(|| quality_for(rays, triangles));
        let detail = if needs.surface { Detail::Surface } else { Detail::Distance };
        let precision = if outputs.npy { Precision::Double } else { Precision::Single };
        let (light_precision, why_precision) = light_precision(scene, samples);
        // Whether images are decoded at all.
        let wants_images = needs.materials && scene.plan.textures != Some(false);
        let images = (wants_images && !scene.textures.is_empty())
            .then_some(TextureScope { light: needs.light, ambient: needs.ambient });
        let mut plan = Self {
            layers,
            detail,
            images,
            footprint: images.is_some()
                && scene.camera.pixel_extent().is_some()
                && scene.plan.texture_filter != Some(false),
            samples,
            stopping,
            not_as_asked,
            passes: sample_passes(scene, passes, chosen.bands.count(), stopping),
            pupil: (lens && passes.mean) || is_lit,
            alike: chosen.bands.count() > 3
                && passes.light
                && (band_paths.are_shared() || apart(lit_by) == 1)
                && are_alike(scene),
            band_paths,
            rays,
            quality,
            // Mattes are of all samples of a pixel, and of what the lens gathers.
            unseen: unseen(scene, passes).filter(|_| !outputs.cryptomatte),
            refine: scene.plan.refine != Some(false),
            precision,
            light_precision,
            outputs,
            bands: chosen.bands.clone(),
            memory: MemoryForecast::default(),
            taken,
            decisions: Vec::new(),
        };
        // Memory and reasons follow from all other decisions.
        plan.memory = forecast(scene, &plan, outputs);
        let bands = &chosen;
        let grounds = Grounds { scene, bands, needs, passes, triangles, why_precision };
        plan.decisions = plan.explain(&grounds);
        plan
    }
}

/// The passes in which the film is filled.
fn sample_passes(
    scene: &Scene,
    passes: Passes,
    bands: usize,
    stopping: Stopping,
) -> Vec<Range<u32>> {
    let samples = scene.render.samples.most();
    if stopping.is_adaptive() {
        // How many rounds follow the first, and of how many samples, the picture says.
        return [0..scene.render.samples.least(), scene.render.samples.least()..samples]
            .into_iter()
            .filter(|pass| !pass.is_empty())
            .collect();
    }
    let [width, height] = scene.camera.resolution().map(u64::from);
    let colours = if passes.mean {
        let is_seen = |layer: &&LayerSpec| layer.is_averaged() && !layer.is_light();
        3 * scene.layers.iter().filter(is_seen).count()
    } else {
        0
    };
    let lit = scene.layers.iter().filter(|layer| layer.is_light()).count();
    let bands = if passes.light { lit * bands } else { 0 };
    let bytes = (width * height).saturating_mul(BYTES_OF_SUM * (colours + bands) as u64);
    match samples::passes(samples) {
        several if several.len() > 1 && bytes > MOST_BYTES_OF_SUMS => {
            std::iter::once(0..samples).collect()
        }
        passes => passes,
    }
}

/// The quality that the scene asks for.
fn forced_quality(scene: &Scene) -> Option<Quality> {
    scene.plan.build_quality.map(|quality| match quality {
        BuildQuality::Low => Quality::Low,
        BuildQuality::Medium => Quality::Medium,
        BuildQuality::High => Quality::High,
    })
}

/// Finds what no ray can meet, where all are chief rays whose hits do not depend on how the structure was built.
fn unseen(scene: &Scene, passes: Passes) -> Option<Unseen> {
    let is_alone = passes.centre && !passes.mean && !passes.light;
    // Layers that compare frames look from the other frame's camera, too.
    let compares = scene.layers.iter().any(|layer| layer.step().is_some());
    let is_allowed = scene.plan.unseen != Some(true) && scene.plan.refine != Some(false);
    let is_single = scene.slots == 0 && !compares;
    (is_alone && is_allowed && is_single)
        .then(|| Unseen::of(&scene.geometry, &scene.camera))
        .flatten()
}
