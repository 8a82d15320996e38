//! Bodies of glass (`KHR_materials_volume`): closed surfaces that refract, and absorb on the way through.

use etendue_tracer::scattering::{Absorption, Glass, GltfSurface};
use etendue_tracer::{Ior, Scattering};
use gltf::json;
use serde::Deserialize;
use serde_json::Value;

use super::material::Judge;
use crate::import::{Import, ImportError};

const NAME: &str = "KHR_materials_volume";

/// What `read` is when it has a thickness: glass where it is clear all over, else still a thin wall.
pub(super) fn body(
    judge: &Judge<'_>,
    material: &json::Material,
    read: GltfSurface,
    import: &mut Import,
) -> Result<Scattering, ImportError> {
    let extension = material.extensions.as_ref().and_then(|e| e.others.get(NAME));
    let thickness = judge.number(material, NAME, "thicknessFactor", import)?.unwrap_or(0.0);
    let thin = |read| Ok(Scattering::Gltf(Box::new(read)));
    let Some(extension) = extension.filter(|_| thickness > 0.0) else { return thin(read) };
    let textured = read.metallic_roughness.is_some() || read.transmission_texture.is_some();
    let varies = textured || extension.get("thicknessTexture").is_some();
    if read.transmission < 1.0 || read.metallic > 0.0 || varies {
        return thin(read);
    }
    let distance = judge.number(material, NAME, "attenuationDistance", import)?;
    let absorption = match distance.filter(|d| *d > 0.0 && d.is_finite()) {
        Some(distance) => Some(Absorption { color: left(judge, extension, import)?, distance }),
        None => None,
    };
    let ior = Ior::Constant(read.ior);
    Ok(Scattering::Dielectric(Glass { ior, roughness: read.roughness, absorption }))
}

/// The share of light that is left after the distance.
fn left(
    judge: &Judge<'_>,
    extension: &Value,
    import: &mut Import,
) -> Result<[f64; 3], ImportError> {
    let Some(written) = extension.get("attenuationColor") else { return Ok([1.0; 3]) };
    let color = <[f64; 3]>::deserialize(written).ok();
    let color = color.filter(|color| color.iter().all(|c| (0.0..=1.0).contains(c)));
    if color.is_none() {
        judge.say("attenuationColor is not three numbers in 0 to 1", "it is left out", import)?;
    }
    Ok(color.unwrap_or([1.0; 3]))
}
