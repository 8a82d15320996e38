//! The images of a scene's materials and its environment, decoded when a layer looks at them.

use std::sync::Arc;

use etendue_files::Stamp;
use etendue_image::{Coarseness, Limits};
use etendue_scene::Scene;
use etendue_spectrum::Bands;
use etendue_tracer::spec::BRIGHTEST;
use etendue_tracer::texture::{Encoding, Filter, ImageError, Wrap};
use etendue_tracer::{
    EnvironmentImage, EnvironmentMap, Image, ImageSource, LayerSpec, Light, LightKind, Texture,
};
use rayon::prelude::*;

use crate::Plan;
use crate::error::RenderError;
use crate::report::ImageSize;

/// Images of a scene's materials and its environment, decoded; what could not be is told.
#[derive(Debug, Default)]
pub struct Images {
    /// One a texture; `None` where no layer looks at it.
    pub decoded: Vec<Option<Arc<Image>>>,
    /// The image of the environment.
    pub environment: Option<Arc<EnvironmentMap>>,
    /// Origin of each texture, and its fault.
    origins: Vec<Option<ImageOrigin>>,
    /// Origin of the environment, its file as it was, whether it has spectra, and the rows of a clear sky's map.
    sky: Option<(EnvironmentImage, Option<Stamp>, bool, u32)>,
    /// Descriptions of the images that could not be decoded.
    pub faults: Vec<String>,
}

impl Images {
    /// Decodes side by side the textures that the plan's materials look at, and the environment, each
    /// within [`Limits::within`] of `memory` (bytes). A broken texture becomes a magenta checker and a
    /// fault.
    ///
    /// # Errors
    ///
    /// When the environment cannot be read or decoded, or an image that the scene itself names is too
    /// large.
    pub fn decode(scene: &Scene, plan: &Plan, memory: Option<u64>) -> Result<Self, RenderError> {
        Self::default().renewed(scene, plan, memory, &[])
    }

    /// As [`Self::decode`], with what these images have already. Those that may be `coarse`, of which there are none or
    /// one for each texture, are decoded in as few texels ([`crate::tolerance::coarse_images`]).
    ///
    /// # Errors
    ///
    /// As [`Self::decode`].
    pub fn renewed(
        &self,
        scene: &Scene,
        plan: &Plan,
        memory: Option<u64>,
        coarse: &[Option<Coarseness>],
    ) -> Result<Self, RenderError> {
        let limits = Limits::within(memory);
        let wanted = wanted_images(scene, plan);
        // What is known stays; all else is decoded, side by side.
        let results: Vec<_> = scene
            .textures
            .par_iter()
            .zip(&wanted)
            .enumerate()
            .map(|(i, (texture, encodings))| {
                let encodings = (*encodings)?;
                let coarse = coarse.get(i).copied().flatten();
                let lookups = scene.accuracy.texture_lookups;
                let origin = ImageOrigin { coarse, ..ImageOrigin::of(texture, encodings, lookups) };
                Some(match self.known(i, &origin) {
                    Some(known) => Ok(known),
                    None => decoded(texture, origin, limits),
                })
            })
            .collect();
        let mut images = Self::default();
        for result in results {
            let (image, origin) = result.transpose()?.unzip();
            images.faults.extend(origin.iter().filter_map(|origin| origin.fault.clone()));
            images.decoded.push(image);
            images.origins.push(origin);
        }
        if plan.layers.contains(&LayerSpec::Radiance) {
            images.read_environment(scene, limits, plan.bands != Bands::Rgb, self)?;
        }
        Ok(images)
    }

    /// The image of texture `i`, where it was decoded from the same.
    fn known(&self, i: usize, origin: &ImageOrigin) -> Option<(Arc<Image>, ImageOrigin)> {
        let known = self.origins.get(i)?.as_ref().filter(|known| known.is_same(origin))?;
        Some((Arc::clone(self.decoded.get(i)?.as_ref()?), known.clone()))
    }

    /// Description of the error of the first image of `scene` that cannot be decoded, whether a
    /// layer looks at it or not.
    #[must_use]
    pub fn first_fault(scene: &Scene) -> Option<String> {
        let limits = Limits::default();
        let faults: Vec<Option<String>> = scene
            .textures
            .par_iter()
            .map(|texture| texture.decode(limits).err().map(|error| error.to_string()))
            .collect();
        let environment = || match environment(scene)? {
            EnvironmentImage::File(path) => {
                EnvironmentMap::read(path, limits).err().map(|e| e.to_string())
            }
            EnvironmentImage::Studio
            | EnvironmentImage::ClearSky(_)
            | EnvironmentImage::Cube(_)
            | EnvironmentImage::Constant => None,
        };
        faults.into_iter().flatten().next().or_else(environment)
    }

    fn read_environment(
        &mut self,
        scene: &Scene,
        limits: Limits,
        spectral: bool,
        before: &Self,
    ) -> Result<(), ImageError> {
        let Some(image) = environment(scene) else { return Ok(()) };
        // A file is read again when it has changed.
        let stamp = match image {
            EnvironmentImage::File(path) => Stamp::of(path),
            EnvironmentImage::Studio
            | EnvironmentImage::ClearSky(_)
            | EnvironmentImage::Cube(_)
            | EnvironmentImage::Constant => None,
        };
        let rows = scene.accuracy.sky_rows;
        self.sky = Some((image.clone(), stamp, spectral, rows));
        // The map as it was, or made anew.
        let known = before.environment.as_ref().filter(|_| before.sky == self.sky);
        let map = match (known, image) {
            (Some(known), _) => Arc::clone(known),
            (None, EnvironmentImage::Studio) => Arc::new(EnvironmentMap::studio()),
            (None, EnvironmentImage::ClearSky(sky)) => Arc::new(sky.map(spectral, rows)),
            (None, EnvironmentImage::Cube(cube)) => Arc::new(EnvironmentMap::of_cube(cube)),
            (None, EnvironmentImage::File(path)) => Arc::new(EnvironmentMap::read(path, limits)?),
            (None, EnvironmentImage::Constant) => return Ok(()),
        };
        if map.dropped > 0 {
            self.faults.push(format!(
                "the environment has {} pixels that are not finite, below zero or above {BRIGHTEST:e}; \
                 they are black",
                map.dropped
            ));
        }
        self.environment = Some(map);
        Ok(())
    }

    /// Number of images decoded in fewer texels than their files have.
    #[must_use]
    pub fn coarser(&self, scene: &Scene) -> usize {
        let all = scene.textures.iter().zip(&self.decoded).zip(&self.origins);
        let is_coarser = |((texture, image), origin): &((&Texture, &Option<Arc<Image>>), _)| {
            let origin: &&Option<ImageOrigin> = origin;
            let may_be = origin.as_ref().is_some_and(|origin| origin.coarse.is_some());
            let fewer = |image: &Arc<Image>| (image.bytes() as u64) < texture.decoded_bytes();
            may_be && image.as_ref().is_some_and(fewer)
        };
        all.filter(is_coarser).count()
    }

    /// Each decoded image: what it is called, columns, rows and bytes.
    #[must_use]
    pub fn sizes(&self, scene: &Scene) -> Vec<ImageSize> {
        let textures = scene.textures.iter().zip(&self.decoded);
        let textures = textures.filter_map(|(texture, image)| {
            let image = image.as_ref()?;
            let (name, resolution) = (texture.name.clone(), image.size());
            Some(ImageSize { name, resolution, bytes: image.bytes() as u64 })
        });
        let environment = self.environment.iter().map(|map| ImageSize {
            name: "environment".to_owned(),
            resolution: map.size(),
            bytes: map.bytes() as u64,
        });
        textures.chain(environment).collect()
    }
}

/// The encodings in which an image is averaged over footprints.
type Encodings = [Option<Encoding>; 2];

/// Encodings of the scene's images that the plan's materials look at.
pub(crate) fn wanted_images(scene: &Scene, plan: &Plan) -> Vec<Option<Encodings>> {
    let mut wanted = vec![None; scene.textures.len()];
    let Some(scope) = plan.images else { return wanted };
    let mut seen = vec![false; scene.materials.len()];
    for placement in &scene.geometry.placements {
        if let Some(seen) = seen.get_mut(placement.material as usize) {
            *seen = true;
        }
    }
    for (material, _) in scene.materials.iter().zip(&seen).filter(|(_, seen)| **seen) {
        for (texture, encoding) in material.textures(scope) {
            if let Some(wanted) = wanted.get_mut(texture as usize) {
                let encodings = wanted.get_or_insert([None; 2]);
                encodings[encoding as usize] = plan.footprint.then_some(encoding);
            }
        }
    }
    // What lights throw is looked up at points.
    for thrown in scene.lights.iter().filter(|_| scope.light).filter_map(Light::texture) {
        if let Some(wanted) = wanted.get_mut(thrown.texture as usize) {
            wanted.get_or_insert([None; 2]);
        }
    }
    wanted
}

/// Origin of an image, and its fault.
#[derive(Debug, Clone)]
struct ImageOrigin {
    source: ImageSource,
    /// The file as it was.
    stamp: Option<Stamp>,
    wrap: [Wrap; 2],
    filter: Filter,
    /// Encodings in which it is filtered by footprint.
    encodings: Encodings,
    /// Lookups along a footprint, at most.
    lookups: u32,
    /// Coarseness that it may have.
    coarse: Option<Coarseness>,
    fault: Option<String>,
}

impl ImageOrigin {
    fn of(texture: &Texture, encodings: Encodings, lookups: u32) -> Self {
        Self {
            source: texture.source.clone(),
            stamp: texture.file().and_then(|path| Stamp::of(path)),
            wrap: texture.wrap,
            filter: texture.filter,
            encodings,
            lookups,
            coarse: None,
            fault: None,
        }
    }

    fn is_same(&self, other: &Self) -> bool {
        let source = match (&self.source, &other.source) {
            (ImageSource::File(own), ImageSource::File(other)) => own == other,
            (ImageSource::Bytes(own), ImageSource::Bytes(other)) => own.is_same(other),
            (ImageSource::Missing, ImageSource::Missing) => true,
            (ImageSource::File(_) | ImageSource::Bytes(_) | ImageSource::Missing, _) => false,
        };
        source
            && self.stamp == other.stamp
            && (self.wrap, self.filter) == (other.wrap, other.filter)
            && (self.encodings, self.lookups) == (other.encodings, other.lookups)
            && self.coarse == other.coarse
    }
}

/// Decodes a texture; a broken one becomes a magenta checker and a fault.
///
/// # Errors
///
/// When it is too large and the scene itself names it: who writes a scene can choose a smaller image, who
/// renders a model often cannot.
fn decoded(
    texture: &Texture,
    mut origin: ImageOrigin,
    limits: Limits,
) -> Result<(Arc<Image>, ImageOrigin), ImageError> {
    let decode = || -> Result<Image, ImageError> {
        let image = texture.decode(limits.coarse(origin.coarse))?;
        let mut image = image.with_lookups(origin.lookups);
        for encoding in origin.encodings.into_iter().flatten() {
            image.filter_by_footprint(encoding, &texture.name)?;
        }
        Ok(image)
    };
    let image = match decode() {
        Err(error) if texture.named_by_scene && error.is_too_large() => return Err(error),
        Err(error) => {
            let shown = "where it is a colour, magenta squares show it; data are left out";
            origin.fault = Some(format!("{error}; {shown}"));
            Image::missing()
        }
        Ok(image) => image,
    };
    if image.dropped > 0 {
        origin.fault = Some(format!(
            "{} has {} texels that are not finite or below zero; they are black",
            texture.name, image.dropped
        ));
    }
    Ok((Arc::new(image), origin))
}

/// The image of the environment of `scene`, when it has one.
pub(crate) fn environment(scene: &Scene) -> Option<&EnvironmentImage> {
    scene.lights.iter().find_map(|light| match &light.kind {
        LightKind::Environment { image, .. } => Some(image),
        _ => None,
    })
}
