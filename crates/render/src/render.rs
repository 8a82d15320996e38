//! From a loaded scene to a picture: build, decode, trace.

use std::sync::Arc;
use std::time::{Duration, Instant};

use etendue_accel::{Accel, BuildError, BuildOptions};
use etendue_camera::Camera;
use etendue_camera::element::FateCounts;
use etendue_scene::Scene;
use etendue_scene::file::AccelName;
use etendue_spectrum::Lanes;
use etendue_tracer::{Image, Surroundings, Texture, View};
use rayon::prelude::*;

use crate::film::FilmLayer;
use crate::output::{Layer, Picture, PictureError};
use crate::tiles::{Counts, Job, Sampling, Stopped};
use crate::{Plan, expose};

/// Told the share done (0..=1) now and then; answering `false` stops.
pub type Progress = Arc<dyn Fn(f64) -> bool + Send + Sync>;

/// Why a render came to nothing.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The acceleration structure could not be built.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The backend was left out when this program was built.
    #[error("this program was built without {0}; use `--accel bvh`, or build it with the feature")]
    Absent(&'static str),
    /// An instruction set was asked for that the backend cannot be told.
    #[error(
        "only Embree can be told an instruction set; leave `--isa` out, or use `--accel embree`"
    )]
    NotEmbree,
    /// The result is no picture; a fault of this program.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// The camera's pupil cannot be sampled: nothing gets through the lens at the wavelengths that
    /// are wanted.
    #[error("camera: {0}")]
    Camera(String),
    /// Rays were sent, and not one left the lens.
    #[error(
        "the picture would be black: no ray gets from the sensor past element {element} of the \
         camera's lens, counted from 0 on the object side ({})",
        losses.join(", ")
    )]
    Dark {
        /// The element nearest to the object at which rays ended.
        element: usize,
        /// Which share of the rays ended where.
        losses: Vec<String>,
    },
    /// The caller asked to stop.
    #[error("stopped")]
    Stopped,
}

impl From<Stopped> for RenderError {
    fn from(_: Stopped) -> Self {
        Self::Stopped
    }
}

/// A render's result.
#[derive(Debug)]
pub struct Rendered {
    /// The layers.
    pub picture: Picture,
    /// Rays traced by the camera.
    pub rays: u64,
    /// What became of the rays inside the camera's lens; all 0 without one.
    pub fates: FateCounts,
    /// Wall time of the tracing alone.
    pub trace_time: Duration,
}

/// The accelerators that this program was built with, the best first.
#[must_use]
pub fn accelerators() -> &'static [AccelName] {
    if cfg!(feature = "embree") {
        &[AccelName::Embree, AccelName::Bvh, AccelName::Exact]
    } else {
        &[AccelName::Bvh, AccelName::Exact]
    }
}

/// Builds `scene`'s acceleration structure with the backend that it names, or else the best.
///
/// # Errors
///
/// When the backend is not built in, cannot be told the options, or cannot build: memory, size, or a
/// stop.
pub fn build(
    scene: &Scene,
    plan: &Plan,
    options: &BuildOptions,
) -> Result<Box<dyn Accel>, RenderError> {
    let geometry = Arc::clone(&scene.geometry);
    let options = BuildOptions { quality: plan.quality, ..options.clone() };
    let name = scene.render.accel.unwrap_or(accelerators()[0]);
    if options.isa.is_some() && name != AccelName::Embree {
        return Err(RenderError::NotEmbree);
    }
    Ok(match name {
        #[cfg(feature = "embree")]
        AccelName::Embree => Box::new(etendue_accel::Embree::build(geometry, &options)?),
        #[cfg(not(feature = "embree"))]
        AccelName::Embree => return Err(RenderError::Absent("Embree")),
        AccelName::Bvh => Box::new(etendue_accel::Bvh::build(geometry, &options)?),
        AccelName::Exact => Box::new(etendue_accel::Exact::build(geometry, &options)?),
    })
}

/// Images of a scene's materials, decoded; what could not be is told.
#[derive(Debug, Default)]
pub struct Images {
    /// One a texture; `None` where no layer looks at it.
    pub decoded: Vec<Option<Image>>,
    /// What could not be decoded, in words.
    pub faults: Vec<String>,
}

impl Images {
    /// Decodes all `textures` side by side when the plan wants them. A broken one becomes a magenta
    /// checker and a fault.
    #[must_use]
    pub fn decode(textures: &[Texture], plan: &Plan) -> Self {
        if !plan.images {
            return Self { decoded: vec![None; textures.len()], faults: Vec::new() };
        }
        let results: Vec<_> = textures.par_iter().map(Texture::decode).collect();
        let mut images = Self::default();
        for result in results {
            images.decoded.push(Some(result.unwrap_or_else(|error| {
                images.faults.push(error.to_string());
                Image::missing()
            })));
        }
        images
    }

    /// Bytes of the decoded texels.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.decoded.iter().flatten().map(|image| image.bytes() as u64).sum()
    }
}

/// Renders `scene` as planned. Runs on the threads of the current rayon pool; the picture does not
/// depend on how many there are.
///
/// # Errors
///
/// When `progress` asks to stop, or no light gets through the camera's lens.
pub fn render(
    scene: &Scene,
    plan: &Plan,
    accel: &dyn Accel,
    images: &Images,
    header: Vec<(String, String)>,
    progress: &(dyn Fn(f64) -> bool + Sync),
) -> Result<Rendered, RenderError> {
    let [width, height] = scene.camera.resolution().map(|side| side as usize);
    let mut film: Vec<FilmLayer> = plan
        .layers
        .iter()
        .map(|&layer| FilmLayer::new(layer, width * height, plan.precision))
        .collect();
    let start = Instant::now();
    let camera = match plan.pupil {
        true => scene.camera.opened(&Lanes::Rgb).map_err(|e| RenderError::Camera(e.why))?,
        false => scene.camera.clone(),
    };
    let job = job(scene, plan, accel, images, &camera, progress);
    let Counts { rays, fates } = job.run(&mut film)?;
    let trace_time = start.elapsed();
    if let (true, 0, Some(element)) =
        (fates.total() > 0, fates.exited, fates.farthest_from_sensor())
    {
        return Err(RenderError::Dark { element, losses: fates.losses() });
    }
    let mut layers: Vec<Layer> = film
        .into_iter()
        .map(|layer| {
            let root = Some(layer.spec) == scene.picture;
            layer.into_layer(root)
        })
        .collect();
    layers.extend(expose::spectrum(scene, &layers));
    let picture = Picture::new(width, height, layers, header)?;
    Ok(Rendered { picture, rays, fates, trace_time })
}

fn job<'a>(
    scene: &'a Scene,
    plan: &Plan,
    accel: &'a dyn Accel,
    images: &'a Images,
    camera: &'a Camera,
    progress: &'a (dyn Fn(f64) -> bool + Sync),
) -> Job<'a> {
    let pose = scene.camera.pose();
    Job {
        accel,
        camera,
        groups: camera.lane_groups(&Lanes::Rgb),
        surroundings: Surroundings {
            geometry: &scene.geometry,
            materials: &scene.materials,
            images: &images.decoded,
            view: View { origin: pose.position, axes: pose.rotation },
        },
        detail: plan.detail,
        sampling: Sampling {
            samples: plan.samples,
            sampler: scene.render.sampler,
            seed: scene.render.seed,
        },
        progress,
    }
}
