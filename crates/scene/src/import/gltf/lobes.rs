//! Layers over a metallic-roughness surface, and shapes of its highlights: sheen and anisotropy.
//!
//! `KHR_materials_pbrSpecularGlossiness`: a diffuse colour beside a reflectance of any colour.
//!
//! It is carried over to `KHR_materials_specular` with `ior` 0, as that extension's text converts
//! it (Khronos, "Specular-glossiness materials"): a dielectric with the reflectance as its colour
//! face on, over the diffuse colour. Roughness is 1 − glossiness.
//!
//! Bodies of glass (`KHR_materials_volume`): closed surfaces that refract, and absorb on the way through.

use gltf::json;
use serde::Deserialize;
use serde_json::Value;

use super::images::GltfImages;
use super::judge::Judge;
use crate::import::{Import, Refusal};
use etendue_tracer::scattering::{Absorption, Glass, GltfSurface};
use etendue_tracer::texture::Encoding;
use etendue_tracer::{Ior, Scattering, TextureUse};

/// The refractive index of what reflects all that its colour lets it. An index of 0 stands for it in
/// `KHR_materials_ior`; glass of 10¹⁵ reflects as much.
pub(super) const MIRROR: f64 = 1e15;

const SHEEN: &str = "KHR_materials_sheen";
const ANISOTROPY: &str = "KHR_materials_anisotropy";

/// Adds to `read` what these extensions of `material` say.
pub(super) fn add(
    images: &mut GltfImages<'_>,
    judge: &Judge<'_>,
    material: &json::Material,
    read: &mut GltfSurface,
    import: &mut Import,
) -> Result<(), Refusal> {
    const SHARE: [f64; 2] = [0.0, 1.0];
    let written = |name: &str| material.extensions.as_ref().and_then(|all| all.others.get(name));
    let mut texture = |name: &str, key: &str, encoding, import: &mut Import| {
        let info = written(name).and_then(|extension| extension.get(key));
        let info = info.and_then(|info| json::texture::Info::deserialize(info).ok());
        info.map_or(Ok::<Option<TextureUse>, Refusal>(None), |info| {
            images.use_of(&judge.place(key), &info, encoding, import)
        })
    };
    if let Some(sheen) = written(SHEEN) {
        let color = sheen.get("sheenColorFactor").map(<[f64; 3]>::deserialize);
        if matches!(color, Some(Err(_))) {
            judge.say("sheenColorFactor is not three numbers", "it is left out", import)?;
        }
        for (own, value) in
            read.sheen_color.iter_mut().zip(color.and_then(Result::ok).unwrap_or_default())
        {
            *own = judge.factor("sheenColorFactor", value, SHARE, import)?;
        }
        let roughness = judge.number(material, SHEEN, "sheenRoughnessFactor", import)?;
        let roughness = roughness.unwrap_or(0.0);
        read.sheen_roughness = judge.factor("sheenRoughnessFactor", roughness, SHARE, import)?;
        read.sheen_color_texture = texture(SHEEN, "sheenColorTexture", Encoding::Srgb, import)?;
        read.sheen_roughness_texture =
            texture(SHEEN, "sheenRoughnessTexture", Encoding::Linear, import)?;
    }
    if written(ANISOTROPY).is_some() {
        let strength = judge.number(material, ANISOTROPY, "anisotropyStrength", import)?;
        let strength = strength.unwrap_or(0.0);
        read.anisotropy = judge.factor("anisotropyStrength", strength, SHARE, import)?;
        let rotation = judge.number(material, ANISOTROPY, "anisotropyRotation", import)?;
        read.anisotropy_rotation = rotation.unwrap_or(0.0);
        read.anisotropy_texture =
            texture(ANISOTROPY, "anisotropyTexture", Encoding::Linear, import)?;
    }
    Ok(())
}

const GLOSSINESS: &str = "KHR_materials_pbrSpecularGlossiness";

/// The extension's part of a material.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Glossiness {
    /// Linear, with alpha.
    pub diffuse_factor: [f64; 4],
    pub diffuse_texture: Option<json::texture::Info>,
    specular_factor: [f64; 3],
    glossiness_factor: f64,
    /// Reflectance by the sRGB curve, glossiness in alpha.
    specular_glossiness_texture: Option<json::texture::Info>,
}

impl Default for Glossiness {
    fn default() -> Self {
        Self {
            diffuse_factor: [1.0; 4],
            diffuse_texture: None,
            specular_factor: [1.0; 3],
            glossiness_factor: 1.0,
            specular_glossiness_texture: None,
        }
    }
}

impl Glossiness {
    /// Reads the extension of `material`; `None`, with a note where it is damaged, when there is none.
    pub(super) fn of(
        judge: &Judge<'_>,
        material: &json::Material,
        import: &mut Import,
    ) -> Result<Option<Self>, Refusal> {
        let written: Option<&Value> =
            material.extensions.as_ref().and_then(|extensions| extensions.others.get(GLOSSINESS));
        let Some(written) = written else { return Ok(None) };
        let read = written.is_object().then(|| Self::deserialize(written).ok()).flatten();
        if read.is_none() {
            judge.say(&format!("{GLOSSINESS} is damaged"), "it is left out", import)?;
        }
        Ok(read)
    }

    /// The surface that reflects as much.
    pub(super) fn surface(
        &self,
        images: &mut GltfImages<'_>,
        judge: &Judge<'_>,
        import: &mut Import,
    ) -> Result<GltfSurface, Refusal> {
        const SHARE: [f64; 2] = [0.0, 1.0];
        let glossiness = judge.factor("glossinessFactor", self.glossiness_factor, SHARE, import)?;
        let mut specular_color = self.specular_factor;
        for value in &mut specular_color {
            *value = judge.factor("specularFactor", *value, SHARE, import)?;
        }
        let image = match &self.specular_glossiness_texture {
            Some(info) => {
                let from = judge.place("specularGlossinessTexture");
                images.use_of(&from, info, Encoding::Srgb, import)?
            }
            None => None,
        };
        Ok(GltfSurface {
            metallic: 0.0,
            roughness: 1.0 - glossiness,
            glossiness_texture: image.clone(),
            ior: MIRROR,
            specular_color,
            specular_color_texture: image,
            ..GltfSurface::default()
        })
    }
}

const VOLUME: &str = "KHR_materials_volume";

/// Scattering of `read` when it has a thickness: glass where it is clear all over, else still a thin wall.
pub(super) fn body(
    judge: &Judge<'_>,
    material: &json::Material,
    read: GltfSurface,
    import: &mut Import,
) -> Result<Scattering, Refusal> {
    let extension = material.extensions.as_ref().and_then(|e| e.others.get(VOLUME));
    let thickness = judge.number(material, VOLUME, "thicknessFactor", import)?.unwrap_or(0.0);
    let thin = |read| Ok(Scattering::Gltf(Box::new(read)));
    let Some(extension) = extension.filter(|_| thickness > 0.0) else { return thin(read) };
    let textured = read.metallic_roughness.is_some() || read.transmission_texture.is_some();
    let varies = textured || extension.get("thicknessTexture").is_some();
    if read.transmission < 1.0 || read.metallic > 0.0 || varies {
        return thin(read);
    }
    let distance = judge.number(material, VOLUME, "attenuationDistance", import)?;
    let absorption = match distance.filter(|d| *d > 0.0 && d.is_finite()) {
        Some(distance) => {
            Some(Absorption { color: left(judge, extension, import)?, curve: None, distance })
        }
        None => None,
    };
    let ior = Ior::Constant(read.ior);
    Ok(Scattering::Dielectric(Glass { ior, roughness: read.roughness, absorption }))
}

/// The share of light that is left after the distance.
fn left(judge: &Judge<'_>, extension: &Value, import: &mut Import) -> Result<[f64; 3], Refusal> {
    let Some(written) = extension.get("attenuationColor") else { return Ok([1.0; 3]) };
    let color = <[f64; 3]>::deserialize(written).ok();
    let color = color.filter(|color| color.iter().all(|c| (0.0..=1.0).contains(c)));
    if color.is_none() {
        judge.say("attenuationColor is not three numbers in 0 to 1", "it is left out", import)?;
    }
    Ok(color.unwrap_or([1.0; 3]))
}
