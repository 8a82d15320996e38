//! The plan: the one place where it is decided what a scene needs, and why. What is off costs
//! nothing: it is not read, not traced, not written.

mod tolerance_words;
mod unseen;
mod words;

use std::ops::Range;

use etendue_accel::Quality;
use etendue_camera::{BandGroup, Camera};
use etendue_geometry::{Detail, HitPrecision};
use etendue_report::Decision;
use etendue_scene::file::BuildQuality;
use etendue_scene::import::Wanted;
use etendue_scene::{MemoryForecast, Scene};
use etendue_sensor::BandChoice;
use etendue_spectrum::Bands;
use etendue_tracer::{LayerSpec, Needs, TextureScope};

pub use self::unseen::Unseen;
use self::words::Grounds;
use crate::alike::are_alike;
use crate::band_paths::BandPaths;
use crate::denoise::DENOISED;
use crate::expose;
use crate::film::Precision;
use crate::forecast::forecast;
use crate::output::Outputs;
use crate::precision::light_precision;
use crate::samples::{self, BYTES_OF_SUM};
use crate::stopping::Stopping;
use crate::tolerance::Approximations;

/// Attributes of the models that have to be read for `layers`: decided before they are opened.
#[must_use]
pub fn wanted(layers: &[LayerSpec]) -> Wanted {
    let needs = needs(layers);
    Wanted {
        normals: needs.normals,
        uvs: needs.uvs,
        colors: needs.materials,
        textures: needs.materials,
        light: needs.light,
        occlusion: needs.ambient,
    }
}

fn needs(layers: &[LayerSpec]) -> Needs {
    layers.iter().fold(Needs::default(), |needs, layer| needs.union(layer.needs()))
}

/// Plan of a render: what is done for a scene, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The layers to fill, the picture first.
    pub layers: Vec<LayerSpec>,
    /// Detail to which each hit is worked out.
    pub detail: Detail,
    /// Images of materials that are decoded; none for `None`.
    pub images: Option<TextureScope>,
    /// True if images are averaged over the footprint of a sample.
    pub footprint: bool,
    /// Samples a pixel for coloured layers, at most.
    pub samples: u32,
    /// Stopping rule of the samples.
    pub stopping: Stopping,
    /// Reason why that is not what the scene asks for, where it is not.
    pub not_as_asked: Option<String>,
    /// Ranges of samples, each taken of every pixel before the next is taken of any. The picture does not depend on it.
    pub passes: Vec<Range<u32>>,
    /// True if rays are spread over a pupil.
    pub pupil: bool,
    /// Paths of the bands of light through the camera's lens.
    pub band_paths: BandPaths,
    /// True if the light of the scene is the same in all bands, of which one is traced for all.
    pub alike: bool,
    /// Rays in all.
    pub rays: u64,
    /// Build time against traversal speed.
    pub quality: Quality,
    /// Parts of the scene that no ray can meet, and that need not be built.
    pub unseen: Option<Unseen>,
    /// True if hits are solved again in f64.
    pub refine: bool,
    /// Precision of data layers.
    pub precision: Precision,
    /// Precision of the hits of light paths.
    pub light_precision: HitPrecision,
    /// Kinds of file that are written.
    pub outputs: Outputs,
    /// Bands of the picture's light: what its numbers are.
    pub bands: Bands,
    /// Forecast of the memory, by counts and headers alone: within 1.5 of the peak of the example scenes.
    pub memory: MemoryForecast,
    /// Part of the scene's tolerance that is taken.
    pub taken: Option<Approximations>,
    /// The decisions, with their reasons.
    pub decisions: Vec<Decision>,
}

/// Rays per triangle from which a better structure pays for its longer build: a rule of thumb, which
/// `make bench` measures both sides of (build time a triangle, traversal time a ray). Not a setting: it changes no
/// picture, and `plan.build_quality` decides.
const RAYS_PER_TRIANGLE: u64 = 50;

/// Rays that a sample of light is counted as when the build quality is chosen: the camera's, one to a
/// light, and one more bounce with its own.
const RAYS_A_SAMPLE_OF_LIGHT: u64 = 4;

/// The most memory that the sums of a film may take between passes. A larger film is gone over once. Not a setting: the
/// picture is the same.
const MOST_BYTES_OF_SUMS: u64 = 2 << 30;

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

impl Plan {
    /// Number of values of light that are kept of each sample: one where all bands are alike and land in one place.
    ///
    /// What is asked of the two halves of a pixel's samples is asked band by band.
    pub(crate) fn values_of_light(&self) -> usize {
        let is_one = self.alike && !self.band_paths.are_shared() && !self.stopping.is_adaptive();
        if is_one { 1 } else { self.bands.count() }
    }

    /// The bands of those numbers that `camera` sends separate ways.
    pub(crate) fn groups_of_light(&self, camera: &Camera) -> Vec<BandGroup> {
        match self.values_of_light() {
            1 => vec![BandGroup { bands: 0..1, wavelength: None }],
            _ => camera.band_groups(&self.bands),
        }
    }

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

    /// The camera that light is sampled by.
    #[must_use]
    pub fn light_camera<'a>(&'a self, scene: &'a Scene) -> &'a Camera {
        let taken = self.taken.as_ref().and_then(|taken| taken.camera.as_ref());
        taken.map_or(&scene.camera, |taken| &taken.camera)
    }

    /// The layers of the picture by the names that they will have in files; the picture's is empty.
    #[must_use]
    pub fn names(&self, scene: &Scene) -> Vec<String> {
        let names = |layer: &LayerSpec| match Some(*layer) == scene.picture {
            true => vec![String::new()],
            false => layer.row().names_in_files(),
        };
        let spectrum = expose::has_spectrum(scene).then(|| expose::SPECTRUM.to_owned());
        let denoised = self.outputs.denoised.then(|| DENOISED.to_owned());
        self.layers.iter().flat_map(names).chain(spectrum).chain(denoised).collect()
    }
}

/// The quality that pays for so many rays.
fn quality_for(rays: u64, triangles: u64) -> Quality {
    if rays / RAYS_PER_TRIANGLE < triangles { Quality::Low } else { Quality::Medium }
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

/// Rays that have to be traced.
#[derive(Debug, Clone, Copy)]
struct Passes {
    /// Chief rays.
    centre: bool,
    /// Samples of layers that are averaged.
    mean: bool,
    /// Samples of light.
    light: bool,
}

impl Passes {
    fn of(layers: &[LayerSpec], samples: u32, lens: bool) -> Self {
        let averaged = samples > 1 || lens;
        let light = layers.contains(&LayerSpec::Radiance);
        let is_traced = |layer: &LayerSpec| !layer.is_of_sampling();
        let seen = layers.iter().filter(|layer| !layer.is_light());
        let mut seen = seen.filter(|layer| is_traced(layer));
        let mean = averaged && seen.clone().any(|layer| layer.is_averaged());
        let centre = seen.any(|layer| !averaged || !layer.is_averaged());
        Self { centre, mean, light }
    }
}
