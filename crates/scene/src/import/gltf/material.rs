//! Materials: glTF's metallic-roughness surfaces with their textures, and vertex colours.
//!
//! Factors are linear (glTF 2.0, section 3.9.2). Materials keep the document's numbers; what names
//! none gets one more at the end.

use etendue_tracer::material::{Alpha, GltfSurface, NormalMap, Occlusion};
use etendue_tracer::texture::{Encoding, Filter, Wrap};
use etendue_tracer::{Emission, ImageSource, Material, Paint, Scattering, Texture, TextureUse};
use gltf::json;
use json::extensions::texture::TextureTransform;
use json::material::AlphaMode;
use json::texture::{MagFilter, WrappingMode};
use json::validation::Checked;
use serde::Deserialize;
use serde_json::Value;

use super::buffers::{Bytes, data_uri, percent_decoded};
use super::{Reader, extensions};
use crate::import::note::{self, Note, NoteKind};
use crate::import::{Import, ImportError, Strictness};

/// The number of the material of `primitive`.
pub(super) fn number(
    reader: &Reader<'_>,
    primitive: &json::mesh::Primitive,
) -> Result<u32, ImportError> {
    let materials = reader.document.root.materials.len();
    let index = primitive.material.map_or(materials, |material| material.value());
    match u32::try_from(index) {
        Ok(number) if index < materials || primitive.material.is_none() => Ok(number),
        _ => Err(reader.damaged(
            format!("materials[{index}]"),
            format!("there is no such material; the file has {materials}"),
        )),
    }
}

/// Reads the document's materials into `import`, and the nameless one behind them.
pub(super) fn load(reader: &Reader<'_>, import: &mut Import) -> Result<(), ImportError> {
    let mut images = Images { reader, of_texture: vec![None; reader.document.root.textures.len()] };
    for material in &reader.document.root.materials {
        let material = read(&mut images, material, import)?;
        import.materials.push(material);
    }
    import.materials.push(Material::unnamed());
    Ok(())
}

fn read(
    images: &mut Images<'_>,
    material: &json::Material,
    import: &mut Import,
) -> Result<Material, ImportError> {
    let name = material.name.clone().unwrap_or_default();
    let surface = &material.pbr_metallic_roughness;
    let [red, green, blue, alpha] = surface.base_color_factor.0.map(f64::from);
    let factor = reflectance(images.reader, [red, green, blue], &name, import)?;
    let image = match &surface.base_color_texture {
        Some(info) if images.reader.wanted.textures => {
            images.use_of(info.index.value(), info, Encoding::Srgb, import)?
        }
        _ => None,
    };
    let base_color = match image {
        Some(image) => Paint::Image { factor, image },
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
            _ => Alpha::Opaque,
        };
        read.scattering = scattering(images, material, import)?;
        read.emission = emission(images, material, import)?;
        read.normal_map = match &material.normal_texture {
            Some(normal) => {
                let moved = normal.extensions.as_ref().and_then(|e| e.others.get(TRANSFORM));
                let info = info_of(normal.index, normal.tex_coord, moved);
                let image = images.use_of(normal.index.value(), &info, Encoding::Linear, import)?;
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
        let image = images.use_of(occlusion.index.value(), &info, Encoding::Linear, import)?;
        let strength = f64::from(occlusion.strength.0);
        read.occlusion = image.map(|image| Occlusion { image, strength });
    }
    Ok(read)
}

/// A base colour brought to what a surface can reflect, with a note; refused when strict.
fn reflectance(
    reader: &Reader<'_>,
    factor: [f64; 3],
    name: &str,
    import: &mut Import,
) -> Result<[f64; 3], ImportError> {
    if factor.iter().all(|c| (0.0..=1.0).contains(c)) {
        return Ok(factor);
    }
    if reader.options.strictness == Strictness::Strict {
        let reason = format!("its base colour {factor:?} is outside 0 to 1");
        return Err(reader.damaged(format!("material \"{name}\""), reason));
    }
    let message = "its base colour is outside 0 to 1; it is brought there";
    note::push(&mut import.notes, Note::new(NoteKind::Irregular, name, message));
    Ok(factor.map(|c| if c.is_nan() { 0.0 } else { c.clamp(0.0, 1.0) }))
}

const TRANSFORM: &str = "KHR_texture_transform";

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

/// The metallic-roughness surface and the extensions that change it.
fn scattering(
    images: &mut Images<'_>,
    material: &json::Material,
    import: &mut Import,
) -> Result<Scattering, ImportError> {
    let extension = |name: &str| material.extensions.as_ref().and_then(|e| e.others.get(name));
    if extension("KHR_materials_unlit").is_some() {
        return Ok(Scattering::Unlit);
    }
    let surface = &material.pbr_metallic_roughness;
    let number = |name: &str, key: &str, default: f64| {
        let value = extension(name).and_then(|e| e.get(key)).and_then(Value::as_f64);
        value.filter(|v| v.is_finite() && *v >= 0.0).unwrap_or(default)
    };
    let texture = |name: &str, key: &str| {
        let value = extension(name)?.get(key)?;
        json::texture::Info::deserialize(value).ok()
    };
    let mut read = GltfSurface {
        metallic: f64::from(surface.metallic_factor.0),
        roughness: f64::from(surface.roughness_factor.0),
        ..GltfSurface::default()
    };
    let mut placed = |info: Option<&json::texture::Info>, encoding| match info {
        Some(info) => images.use_of(info.index.value(), info, encoding, import),
        None => Ok(None),
    };
    read.metallic_roughness =
        placed(surface.metallic_roughness_texture.as_ref(), Encoding::Linear)?;
    // An index of 0 stands for a reflectance of 1 in the extension; glass of 10¹⁵ reflects as much.
    read.ior = match number("KHR_materials_ior", "ior", 1.5) {
        0.0 => 1e15,
        ior => ior.max(1.0),
    };
    let specular = "KHR_materials_specular";
    read.specular = number(specular, "specularFactor", 1.0).min(1.0);
    let color = extension(specular).and_then(|e| e.get("specularColorFactor"));
    if let Some(color) = color.and_then(|c| <[f64; 3]>::deserialize(c).ok()) {
        read.specular_color = color.map(|c| if c.is_finite() { c.max(0.0) } else { 0.0 });
    }
    let info = texture(specular, "specularTexture");
    read.specular_texture = placed(info.as_ref(), Encoding::Linear)?;
    let info = texture(specular, "specularColorTexture");
    read.specular_color_texture = placed(info.as_ref(), Encoding::Srgb)?;
    let transmission = "KHR_materials_transmission";
    read.transmission = number(transmission, "transmissionFactor", 0.0).min(1.0);
    let info = texture(transmission, "transmissionTexture");
    read.transmission_texture = placed(info.as_ref(), Encoding::Linear)?;
    Ok(Scattering::Gltf(Box::new(read)))
}

fn emission(
    images: &mut Images<'_>,
    material: &json::Material,
    import: &mut Import,
) -> Result<Option<Emission>, ImportError> {
    let factor = material.emissive_factor.0.map(f64::from);
    if !factor.iter().all(|c| c.is_finite() && *c >= 0.0) {
        let subject = material.name.clone().unwrap_or_default();
        let message = "its emissive factor is below zero or not finite; it does not shine";
        note::push(&mut import.notes, Note::new(NoteKind::NotFinite, subject, message));
        return Ok(None);
    }
    if factor == [0.0; 3] {
        return Ok(None);
    }
    let image = match &material.emissive_texture {
        Some(info) => images.use_of(info.index.value(), info, Encoding::Srgb, import)?,
        None => None,
    };
    let radiance = match image {
        Some(image) => Paint::Image { factor, image },
        None => Paint::Plain(factor),
    };
    let name = "KHR_materials_emissive_strength";
    let strength = material.extensions.as_ref().and_then(|e| e.others.get(name));
    let strength = strength.and_then(|e| e.get("emissiveStrength")).and_then(Value::as_f64);
    let strength = strength.filter(|s| s.is_finite() && *s >= 0.0).unwrap_or(1.0);
    Ok(Some(Emission { radiance, strength, illuminant: None, two_sided: true }))
}

/// The textures that materials name, each located once.
struct Images<'a> {
    reader: &'a Reader<'a>,
    /// For each texture of the document: unseen, unusable, or its index in the import.
    of_texture: Vec<Option<Option<u32>>>,
}

impl Images<'_> {
    fn use_of(
        &mut self,
        index: usize,
        info: &json::texture::Info,
        encoding: Encoding,
        import: &mut Import,
    ) -> Result<Option<TextureUse>, ImportError> {
        let known = self.of_texture.get(index).copied().flatten();
        let texture = match known {
            Some(texture) => texture,
            None => {
                let located = self.locate(index, import)?;
                if let Some(known) = self.of_texture.get_mut(index) {
                    *known = Some(located);
                }
                located
            }
        };
        let Some(texture) = texture else { return Ok(None) };
        let moved = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
        Ok(Some(TextureUse {
            texture,
            uv_set: moved.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord),
            transform: moved.map_or(TextureUse::UNCHANGED, matrix),
            encoding,
        }))
    }

    /// Finds the image of texture `index`; `None`, with a note, when it cannot be used.
    fn locate(&self, index: usize, import: &mut Import) -> Result<Option<u32>, ImportError> {
        let reader = self.reader;
        let root = &reader.document.root;
        let place = || format!("textures[{index}]");
        let Some(texture) = root.textures.get(index) else {
            return Err(reader.damaged(place(), "there is no such texture; export the file again"));
        };
        let Some(image) = root.images.get(texture.source.value()) else {
            // Extensions put the image elsewhere and leave the plain one out.
            if let Some(note) = extensions::encoded_texture(reader.file, texture, reader.wanted)? {
                note::push(&mut import.notes, note);
                return Ok(None);
            }
            return Err(reader.damaged(place(), "it has no image; export the file again"));
        };
        let Some(source) = self.source(texture.source.value(), image, import)? else {
            return Ok(None);
        };
        let number = u32::try_from(import.textures.len())
            .map_err(|_| reader.damaged(place(), "there are more than 32 bits can count"))?;
        let sampler = texture.sampler.and_then(|sampler| root.samplers.get(sampler.value()));
        import.textures.push(Texture {
            name: label(texture, image, index),
            source,
            wrap: sampler.map_or([Wrap::Repeat; 2], |s| [wrap(&s.wrap_s), wrap(&s.wrap_t)]),
            filter: match sampler.and_then(|s| s.mag_filter.as_ref()) {
                Some(Checked::Valid(MagFilter::Nearest)) => Filter::Nearest,
                _ => Filter::Bilinear,
            },
        });
        Ok(Some(number))
    }

    fn source(
        &self,
        index: usize,
        image: &json::Image,
        import: &mut Import,
    ) -> Result<Option<ImageSource>, ImportError> {
        let reader = self.reader;
        let place = || format!("images[{index}]");
        if let Some(view) = image.buffer_view {
            let view = reader.view(view.value())?;
            let bytes = match view.bytes {
                Bytes::Mapped { .. } => view.bytes.view(view.start, view.len),
                Bytes::Memory(_) => None,
            };
            let copied =
                || view.bytes.as_slice()[view.start..view.start + view.len].to_vec().into();
            return Ok(Some(ImageSource::Bytes(bytes.unwrap_or_else(copied))));
        }
        let Some(uri) = &image.uri else {
            return Err(reader.damaged(place(), "it has neither a uri nor a bufferView"));
        };
        if let Some(data) = data_uri(uri) {
            let bytes = data.map_err(|reason| reader.damaged(place(), reason))?;
            return Ok(Some(ImageSource::Bytes(bytes.into())));
        }
        let written = percent_decoded(uri);
        match reader.files.locate(&written)? {
            Some(file) => Ok(Some(ImageSource::File(file))),
            None if reader.options.strictness == Strictness::Strict => {
                Err(reader.damaged(place(), format!("\"{written}\" does not exist")))
            }
            None => {
                note::push(&mut import.notes, note::missing_image(written));
                Ok(Some(ImageSource::Missing))
            }
        }
    }
}

/// What to call a texture in messages.
fn label(texture: &json::Texture, image: &json::Image, index: usize) -> String {
    let named = texture.name.as_ref().or(image.name.as_ref());
    let file = || image.uri.as_ref().filter(|uri| !uri.starts_with("data:"));
    named.or_else(file).cloned().unwrap_or_else(|| format!("textures[{index}]"))
}

fn wrap(mode: &Checked<WrappingMode>) -> Wrap {
    match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::ClampToEdge,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::MirroredRepeat,
        Checked::Valid(WrappingMode::Repeat) | Checked::Invalid => Wrap::Repeat,
    }
}

/// `KHR_texture_transform`: translation · rotation · scale, with v downwards, so that a positive
/// rotation turns the coordinates clockwise as numbers go.
fn matrix(transform: &TextureTransform) -> [[f64; 3]; 2] {
    let [x, y] = transform.offset.0.map(f64::from);
    let [scale_u, scale_v] = transform.scale.0.map(f64::from);
    let (sin, cos) = f64::from(transform.rotation.0).sin_cos();
    [[cos * scale_u, sin * scale_v, x], [-sin * scale_u, cos * scale_v, y]]
}
