//! Textures and their images, as materials name them.

use etendue_tracer::texture::{Encoding, Filter, Wrap};
use etendue_tracer::{ImageSource, Texture, TextureUse};
use gltf::json;
use json::extensions::texture::TextureTransform;
use json::texture::{MagFilter, WrappingMode};
use json::validation::Checked;

use super::buffers::{Bytes, data_uri, percent_decoded};
use super::extensions;
use super::reader::GltfReader;
use crate::import::{Import, Refusal, Strictness, error};

/// Index that crate `gltf` puts for an image that a texture does not name.
const NO_IMAGE: usize = u32::MAX as usize;

/// The textures that materials name, each located once.
pub(super) struct GltfImages<'a> {
    pub(super) reader: &'a GltfReader<'a>,
    /// For each texture of the document: unseen, unusable, or its index in the import.
    of_texture: Vec<Option<Option<u32>>>,
}

impl<'a> GltfImages<'a> {
    /// Those of a document, none of them looked at yet.
    pub(super) fn new(reader: &'a GltfReader<'a>) -> Self {
        Self { reader, of_texture: vec![None; reader.document.root.textures.len()] }
    }

    pub(super) fn use_of(
        &mut self,
        from: &str,
        info: &json::texture::Info,
        encoding: Encoding,
        import: &mut Import,
    ) -> Result<Option<TextureUse>, Refusal> {
        let index = info.index.value();
        let known = self.of_texture.get(index).copied().flatten();
        let texture = match known {
            Some(texture) => texture,
            None => {
                let located = self.locate(index, from, import)?;
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

    /// Finds the image of texture `index`, which `from` names; `None`, with a note, when it cannot be used.
    fn locate(
        &self,
        index: usize,
        from: &str,
        import: &mut Import,
    ) -> Result<Option<u32>, Refusal> {
        let reader = self.reader;
        let root = &reader.document.root;
        let place = || format!("textures[{index}]");
        let Some(texture) = root.textures.get(index) else {
            return Err(reader.absent(from, "texture", index, root.textures.len()));
        };
        // Extensions put the image elsewhere and may leave the plain one out.
        let plain = Some(texture.source.value()).filter(|&source| source != NO_IMAGE);
        let Some(source) = plain.or_else(|| extensions::webp_image(texture)) else {
            if let Some(note) = extensions::encoded_texture(reader.file, texture, reader.wanted)? {
                error::push(&mut import.notes, note);
                return Ok(None);
            }
            return Err(reader.damaged(place(), "it has no image\nhint: export the file again"));
        };
        let Some(image) = root.images.get(source) else {
            return Err(reader.absent(place() + ".source", "image", source, root.images.len()));
        };
        let Some(source) = self.source(source, image, import)? else {
            return Ok(None);
        };
        let number = u32::try_from(import.textures.len())
            .map_err(|_| reader.damaged(place(), "there are more than 32 bits can count"))?;
        let sampler = match texture.sampler {
            Some(index) => Some(root.samplers.get(index.value()).ok_or_else(|| {
                let from = place() + ".sampler";
                reader.absent(from, "sampler", index.value(), root.samplers.len())
            })?),
            None => None,
        };
        import.textures.push(Texture {
            name: label(texture, image, index),
            source,
            wrap: sampler.map_or([Wrap::Repeat; 2], |s| [wrap(&s.wrap_s), wrap(&s.wrap_t)]),
            filter: match sampler.and_then(|s| s.mag_filter.as_ref()) {
                Some(Checked::Valid(MagFilter::Nearest)) => Filter::Nearest,
                _ => Filter::Bilinear,
            },
            named_by_scene: false,
        });
        Ok(Some(number))
    }

    fn source(
        &self,
        index: usize,
        image: &json::Image,
        import: &mut Import,
    ) -> Result<Option<ImageSource>, Refusal> {
        let reader = self.reader;
        let place = || format!("images[{index}]");
        if let Some(view) = image.buffer_view {
            let view = reader.view(view.value(), &(place() + ".bufferView"))?;
            let bytes = match view.bytes {
                Bytes::Mapped { .. } => view.bytes.view(view.start, view.len),
                Bytes::Memory(_) => None,
            };
            let copied =
                || view.bytes.as_slice()[view.start..view.start + view.len].to_vec().into();
            return Ok(Some(ImageSource::Bytes(bytes.unwrap_or_else(copied))));
        }
        let Some(uri) = &image.uri else {
            let reason = "it has neither a uri nor a bufferView; export the file again";
            return Err(reader.damaged(place(), reason));
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
                error::push(&mut import.notes, error::missing_image(written));
                Ok(Some(ImageSource::Missing))
            }
        }
    }
}

/// Name of a texture in messages.
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
