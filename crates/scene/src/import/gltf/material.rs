//! Materials: glTF's metallic-roughness surfaces with their textures, and vertex colours.
//!
//! Factors are linear (glTF 2.0, section 3.9.2). Materials keep the document's numbers; what names
//! none gets one more at the end.

use etendue_tracer::material::{Alpha, NormalMap, Occlusion};
use etendue_tracer::scattering::GltfSurface;
use etendue_tracer::spec::BRIGHTEST;
use etendue_tracer::texture::Encoding;
use etendue_tracer::{Emission, Material, Paint, Scattering};
use gltf::json;
use json::extensions::texture::TextureTransform;
use json::material::AlphaMode;
use json::validation::Checked;
use serde::Deserialize;
use serde_json::Value;

use super::images::GltfImages;
use super::judge::Judge;
use super::lobes;
use super::lobes::{Glossiness, MIRROR};
use super::reader::GltfReader;
use crate::import::{Import, Refusal};

/// The number of the material of `primitive`, which messages call `place`.
pub(super) fn number(
    reader: &GltfReader<'_>,
    primitive: &json::mesh::Primitive,
    place: impl Fn() -> String,
) -> Result<u32, Refusal> {
    let materials = reader.document.root.materials.len();
    let index = primitive.material.map_or(materials, |material| material.value());
    match u32::try_from(index) {
        Ok(number) if index < materials || primitive.material.is_none() => Ok(number),
        _ => Err(reader.absent(place() + ".material", "material", index, materials)),
    }
}

/// Reads the document's materials into `import`, and the nameless one behind them.
pub(super) fn load(reader: &GltfReader<'_>, import: &mut Import) -> Result<(), Refusal> {
    let mut images = GltfImages::new(reader);
    for (index, material) in reader.document.root.materials.iter().enumerate() {
        let named = material.name.clone().filter(|name| !name.is_empty());
        let subject = named.unwrap_or_else(|| format!("materials[{index}]"));
        let material = read(&mut images, &mut Judge { reader, subject }, material, import)?;
        import.materials.push(material);
    }
    import.materials.push(Material { one_sided: reader.wanted.light, ..Material::unnamed() });
    Ok(())
}

fn read(
    images: &mut GltfImages<'_>,
    judge: &mut Judge<'_>,
    material: &json::Material,
    import: &mut Import,
) -> Result<Material, Refusal> {
    let name = material.name.clone().unwrap_or_default();
    let surface = &material.pbr_metallic_roughness;
    let glossiness = Glossiness::of(judge, material, import)?;
    let (factor, key, texture) = match &glossiness {
        Some(own) => (own.diffuse_factor, "diffuseTexture", &own.diffuse_texture),
        None => {
            let factor = surface.base_color_factor.0.map(f64::from);
            (factor, "baseColorTexture", &surface.base_color_texture)
        }
    };
    let [red, green, blue, alpha] = factor;
    let factor = reflectance(judge, [red, green, blue], import)?;
    let image = match texture {
        Some(info) if images.reader.wanted.textures => {
            images.use_of(&judge.place(key), info, Encoding::Srgb, import)?
        }
        _ => None,
    };
    let base_color = match image {
        Some(image) => Paint::Image { factor, curve: None, image },
        None => Paint::Plain(factor),
    };
    let plain = Material::new(name, base_color, Scattering::Matte);
    let mut read = Material { vertex_colors: true, ..plain };
    if images.reader.wanted.light {
        read.alpha = match (&material.alpha_mode, material.alpha_cutoff) {
            (Checked::Valid(AlphaMode::Mask), cutoff) => {
                Alpha::Mask { factor: alpha, cutoff: cutoff.map_or(0.5, |c| f64::from(c.0)) }
            }
            (Checked::Valid(AlphaMode::Blend), _) => Alpha::Blend { factor: alpha },
            (Checked::Valid(AlphaMode::Opaque), _) => Alpha::Opaque,
            (Checked::Invalid, _) => {
                judge.say("alphaMode is none that glTF knows", "it is opaque", import)?;
                Alpha::Opaque
            }
        };
        read.scattering = match &glossiness {
            Some(_) if is_unlit(material) => Scattering::Unlit,
            Some(own) => Scattering::Gltf(Box::new(own.surface(images, judge, import)?)),
            None => scattering(images, judge, material, import)?,
        };
        read.emission = emission(images, judge, material, import)?;
        // Who looks out of a body of glass sees the backs of its surfaces.
        read.one_sided = !material.double_sided && !read.scattering.is_body();
        read.normal_map = match &material.normal_texture {
            Some(normal) => {
                let moved = normal.extensions.as_ref().and_then(|e| e.others.get(TRANSFORM));
                let info = info_of(normal.index, normal.tex_coord, moved);
                let from = judge.place("normalTexture");
                let image = images.use_of(&from, &info, Encoding::Linear, import)?;
                image.map(|image| NormalMap { image, scale: f64::from(normal.scale) })
            }
            None => None,
        };
    }
    if images.reader.wanted.occlusion
        && let Some(occlusion) = &material.occlusion_texture
    {
        let moved = occlusion.extensions.as_ref().and_then(|e| e.others.get(TRANSFORM));
        let info = info_of(occlusion.index, occlusion.tex_coord, moved);
        let from = judge.place("occlusionTexture");
        let image = images.use_of(&from, &info, Encoding::Linear, import)?;
        let strength = f64::from(occlusion.strength.0);
        read.occlusion = image.map(|image| Occlusion { image, strength });
    }
    Ok(read)
}

/// A base colour brought to what a surface can reflect, with a note; refused when strict.
fn reflectance(
    judge: &Judge<'_>,
    factor: [f64; 3],
    import: &mut Import,
) -> Result<[f64; 3], Refusal> {
    if !factor.iter().all(|c| (0.0..=1.0).contains(c)) {
        let what = format!("base colour {factor:?} is outside 0 to 1");
        judge.say(&what, "it is brought there", import)?;
    }
    Ok(factor.map(|c| if c.is_nan() { 0.0 } else { c.clamp(0.0, 1.0) }))
}

const TRANSFORM: &str = "KHR_texture_transform";
const SPECULAR: &str = "KHR_materials_specular";
const CLEARCOAT: &str = "KHR_materials_clearcoat";
const TRANSMISSION: &str = "KHR_materials_transmission";

/// A texture's use in the words of the base colour's, whose type the document has no second time.
fn info_of(
    index: json::Index<json::Texture>,
    tex_coord: u32,
    moved: Option<&Value>,
) -> json::texture::Info {
    let moved = moved.and_then(|value| TextureTransform::deserialize(value).ok());
    let extensions = moved.map(|transform| json::extensions::texture::Info {
        texture_transform: Some(transform),
        ..Default::default()
    });
    json::texture::Info { index, tex_coord, extensions, extras: json::Extras::default() }
}

fn is_unlit(material: &json::Material) -> bool {
    let extensions = material.extensions.as_ref();
    extensions.is_some_and(|extensions| extensions.others.contains_key("KHR_materials_unlit"))
}

/// The metallic-roughness surface and the extensions that change it.
fn scattering(
    images: &mut GltfImages<'_>,
    judge: &Judge<'_>,
    material: &json::Material,
    import: &mut Import,
) -> Result<Scattering, Refusal> {
    let extension = |name: &str| material.extensions.as_ref().and_then(|e| e.others.get(name));
    if is_unlit(material) {
        return Ok(Scattering::Unlit);
    }
    let surface = &material.pbr_metallic_roughness;
    let texture = |name: &str, key: &str| {
        let value = extension(name)?.get(key)?;
        json::texture::Info::deserialize(value).ok()
    };
    const SHARE: [f64; 2] = [0.0, 1.0];
    let metallic = f64::from(surface.metallic_factor.0);
    let roughness = f64::from(surface.roughness_factor.0);
    let ior = judge.number(material, "KHR_materials_ior", "ior", import)?.unwrap_or(1.5);
    let strength = judge.number(material, SPECULAR, "specularFactor", import)?.unwrap_or(1.0);
    let passes = judge.number(material, TRANSMISSION, "transmissionFactor", import)?.unwrap_or(0.0);
    let coat = judge.number(material, CLEARCOAT, "clearcoatFactor", import)?.unwrap_or(0.0);
    let of_coat = judge.number(material, CLEARCOAT, "clearcoatRoughnessFactor", import)?;
    let mut read = GltfSurface {
        clearcoat: judge.factor("clearcoatFactor", coat, SHARE, import)?,
        clearcoat_roughness: judge.factor(
            "clearcoatRoughnessFactor",
            of_coat.unwrap_or(0.0),
            SHARE,
            import,
        )?,
        metallic: judge.factor("metallicFactor", metallic, SHARE, import)?,
        roughness: judge.factor("roughnessFactor", roughness, SHARE, import)?,
        ior: match ior {
            0.0 => MIRROR,
            ior => judge.factor("ior", ior, [1.0, f64::INFINITY], import)?.min(MIRROR),
        },
        specular: judge.factor("specularFactor", strength, SHARE, import)?,
        transmission: judge.factor("transmissionFactor", passes, SHARE, import)?,
        ..GltfSurface::default()
    };
    if let Some(color) = extension(SPECULAR).and_then(|e| e.get("specularColorFactor")) {
        read.specular_color = specular_color(judge, color, import)?;
    }
    let mut placed = |key: &str, info: Option<&json::texture::Info>, encoding| match info {
        Some(info) => images.use_of(&judge.place(key), info, encoding, import),
        None => Ok(None),
    };
    read.metallic_roughness = placed(
        "metallicRoughnessTexture",
        surface.metallic_roughness_texture.as_ref(),
        Encoding::Linear,
    )?;
    let info = texture(SPECULAR, "specularTexture");
    read.specular_texture = placed("specularTexture", info.as_ref(), Encoding::Linear)?;
    let info = texture(SPECULAR, "specularColorTexture");
    read.specular_color_texture = placed("specularColorTexture", info.as_ref(), Encoding::Srgb)?;
    let info = texture(TRANSMISSION, "transmissionTexture");
    read.transmission_texture = placed("transmissionTexture", info.as_ref(), Encoding::Linear)?;
    for (key, use_of) in [
        ("clearcoatTexture", &mut read.clearcoat_texture),
        ("clearcoatRoughnessTexture", &mut read.clearcoat_roughness_texture),
    ] {
        *use_of = placed(key, texture(CLEARCOAT, key).as_ref(), Encoding::Linear)?;
    }
    lobes::add(images, judge, material, &mut read, import)?;
    lobes::body(judge, material, read, import)
}

/// The tint of the reflection face on: anything from 0.
fn specular_color(
    judge: &Judge<'_>,
    written: &Value,
    import: &mut Import,
) -> Result<[f64; 3], Refusal> {
    let color = <[f64; 3]>::deserialize(written).ok();
    let color = color.filter(|color| color.iter().all(|c| c.is_finite() && *c >= 0.0));
    if color.is_none() {
        judge.say("specularColorFactor is not three numbers from 0", "it is left out", import)?;
    }
    Ok(color.unwrap_or([1.0; 3]))
}

fn emission(
    images: &mut GltfImages<'_>,
    judge: &Judge<'_>,
    material: &json::Material,
    import: &mut Import,
) -> Result<Option<Emission>, Refusal> {
    let factor = material.emissive_factor.0.map(f64::from);
    if factor == [0.0; 3] {
        return Ok(None);
    }
    let name = "KHR_materials_emissive_strength";
    let strength = judge.number(material, name, "emissiveStrength", import)?.unwrap_or(1.0);
    if !factor.iter().all(|c| *c >= 0.0 && (0.0..=BRIGHTEST).contains(&(c * strength))) {
        let what = format!("emission is below zero, not finite or above {BRIGHTEST:e}");
        judge.say(&what, "it does not shine", import)?;
        return Ok(None);
    }
    let image = match &material.emissive_texture {
        Some(info) => {
            images.use_of(&judge.place("emissiveTexture"), info, Encoding::Srgb, import)?
        }
        None => None,
    };
    let radiance = match image {
        Some(image) => Paint::Image { factor, curve: None, image },
        None => Paint::Plain(factor),
    };
    Ok(Some(Emission {
        radiance,
        strength,
        illuminant: None,
        two_sided: true,
        group: None,
        modulation: None,
    }))
}
