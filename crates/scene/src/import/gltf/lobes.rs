//! What lies over a metallic-roughness surface or shapes its highlights: sheen and anisotropy.

use etendue_tracer::TextureUse;
use etendue_tracer::scattering::GltfSurface;
use etendue_tracer::texture::Encoding;
use gltf::json;
use serde::Deserialize;

use super::images::Images;
use super::material::Judge;
use crate::import::{Import, ImportError};

const SHEEN: &str = "KHR_materials_sheen";
const ANISOTROPY: &str = "KHR_materials_anisotropy";

/// Adds to `read` what these extensions of `material` say.
pub(super) fn add(
    images: &mut Images<'_>,
    judge: &Judge<'_>,
    material: &json::Material,
    read: &mut GltfSurface,
    import: &mut Import,
) -> Result<(), ImportError> {
    const SHARE: [f64; 2] = [0.0, 1.0];
    let written = |name: &str| material.extensions.as_ref().and_then(|all| all.others.get(name));
    let mut texture = |name: &str, key: &str, encoding, import: &mut Import| {
        let info = written(name).and_then(|extension| extension.get(key));
        let info = info.and_then(|info| json::texture::Info::deserialize(info).ok());
        info.map_or(Ok::<Option<TextureUse>, ImportError>(None), |info| {
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
