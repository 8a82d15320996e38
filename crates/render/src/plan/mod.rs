//! The plan: the one place where it is decided what a scene needs, and why. What is off costs
//! nothing: it is not read, not traced, not written.

mod make;
mod tolerance_words;
mod unseen;
mod words;

use std::ops::Range;

use etendue_accel::Quality;
use etendue_camera::{BandGroup, Camera};
use etendue_geometry::{Detail, HitPrecision};
use etendue_report::Decision;
use etendue_scene::import::Wanted;
use etendue_scene::{MemoryForecast, Scene};
use etendue_spectrum::Bands;
use etendue_tracer::{LayerSpec, Needs, TextureScope};

pub use self::unseen::Unseen;
use crate::band_paths::BandPaths;
use crate::denoise::DENOISED;
use crate::expose;
use crate::film::Precision;
use crate::output::Outputs;
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
