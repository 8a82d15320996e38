//! `KHR_materials_pbrSpecularGlossiness`: a diffuse colour beside a reflectance of any colour.
//!
//! It is carried over to `KHR_materials_specular` with `ior` 0, as that extension's text converts
//! it (Khronos, "Specular-glossiness materials"): a dielectric with the reflectance as its colour
//! face on, over the diffuse colour. Roughness is 1 − glossiness.

use etendue_tracer::scattering::GltfSurface;
use etendue_tracer::texture::Encoding;
use gltf::json;
use serde::Deserialize;
use serde_json::Value;

use super::images::Images;
use super::material::{Judge, MIRROR};
use crate::import::{Import, ImportError};

const NAME: &str = "KHR_materials_pbrSpecularGlossiness";

/// What the extension says of a material.
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
    /// What `material` says; `None`, with a note where it is damaged, when nothing.
    pub(super) fn of(
        judge: &Judge<'_>,
        material: &json::Material,
        import: &mut Import,
    ) -> Result<Option<Self>, ImportError> {
        let written: Option<&Value> =
            material.extensions.as_ref().and_then(|extensions| extensions.others.get(NAME));
        let Some(written) = written else { return Ok(None) };
        let read = written.is_object().then(|| Self::deserialize(written).ok()).flatten();
        if read.is_none() {
            judge.say(&format!("{NAME} is damaged"), "it is left out", import)?;
        }
        Ok(read)
    }

    /// The surface that reflects as much.
    pub(super) fn surface(
        &self,
        images: &mut Images<'_>,
        judge: &Judge<'_>,
        import: &mut Import,
    ) -> Result<GltfSurface, ImportError> {
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
