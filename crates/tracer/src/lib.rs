#![forbid(unsafe_code)]
//! What becomes of a ray in the scene: materials and textures, and the reference tracers that write
//! ground truth (distance, normal, position, ids) beside the picture.
//!
//! Colours are linear light with the sRGB primaries (ITU-R BT.709), 1 being full scale; only files
//! and pictures to look at carry the sRGB transfer curve.

mod batches;
pub mod layer;
pub mod material;
pub mod reference;
pub mod texture;

pub use layer::{LayerSpec, NormalKind, Space};
pub use material::{Color, Material, MaterialSpec, Paint};
pub use reference::{Needs, Surroundings, Traced, View};
pub use texture::{Image, ImageSource, Texture, TextureUse};
