//! Images over surfaces.

use std::path::PathBuf;

use etendue_geometry::Buffer;

/// Where an image's bytes are, still encoded (PNG or JPEG).
#[derive(Debug, Clone)]
pub enum ImageSource {
    /// A file.
    File(PathBuf),
    /// Bytes inside another file (a GLB's buffer view, a data URI).
    Bytes(Buffer<u8>),
}

/// What happens to texture coordinates outside 0..=1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wrap {
    /// The image repeats.
    #[default]
    Repeat,
    /// Every other copy is mirrored.
    MirroredRepeat,
    /// The border goes on.
    ClampToEdge,
}

/// How a lookup reads texels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Filter {
    /// Weighted by distance to the four nearest.
    #[default]
    Bilinear,
    /// The nearest only.
    Nearest,
}

/// An image with its sampler. Decoded only when the plan needs it, and once.
#[derive(Debug, Clone)]
pub struct Texture {
    /// What the file calls it, for messages.
    pub name: String,
    /// The encoded image.
    pub source: ImageSource,
    /// Wrap modes along u and v.
    pub wrap: [Wrap; 2],
    /// How texels are read.
    pub filter: Filter,
}

/// One use of a texture by a material.
#[derive(Debug, Clone, PartialEq)]
pub struct TextureUse {
    /// Index into the scene's textures.
    pub texture: u32,
    /// Which of the mesh's texture coordinate sets.
    pub uv_set: u32,
    /// `KHR_texture_transform`: rows of the 2×3 matrix that carries (u, v, 1).
    pub transform: [[f64; 3]; 2],
}

impl TextureUse {
    /// The transform that changes nothing.
    pub const UNCHANGED: [[f64; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
}
