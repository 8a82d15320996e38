//! Materials: what colour a surface has. (Light comes with the spectral tracers.)

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::TextureUse;

/// Linear RGB with the sRGB primaries, 0..=1 for reflectances.
pub type Color = [f64; 3];

/// A material as the scene file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum MaterialSpec {
    /// A Lambert reflector.
    Matte {
        /// Reflectance, linear RGB, each 0..=1.
        color: Color,
    },
    /// Squares of two colours over the surface's texture coordinates.
    Checker {
        /// The two reflectances, linear RGB.
        #[serde(default = "default_checker_colors")]
        colors: [Color; 2],
        /// Squares along one unit of the texture coordinates (> 0).
        #[serde(default = "default_checker_squares")]
        squares: f64,
    },
}

fn default_checker_colors() -> [Color; 2] {
    [[0.8; 3], [0.2; 3]]
}

fn default_checker_squares() -> f64 {
    8.0
}

/// A material ready to be looked up at a hit.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// What the file calls it, for messages and overrides.
    pub name: String,
    /// Base colour.
    pub base_color: Paint,
    /// The mesh's vertex colours multiply the base colour (glTF's `COLOR_0`).
    pub vertex_colors: bool,
}

impl Material {
    /// The material of whatever names none: glTF's default white is too bright to show shape, so
    /// this is a light grey only where the file has no material at all.
    #[must_use]
    pub fn unnamed() -> Self {
        Self { name: String::new(), base_color: Paint::Plain([0.8; 3]), vertex_colors: true }
    }
}

/// A colour over a surface.
#[derive(Debug, Clone, PartialEq)]
pub enum Paint {
    /// One colour everywhere.
    Plain(Color),
    /// Squares of two colours over texture coordinate set 0.
    Checker {
        /// The two colours.
        colors: [Color; 2],
        /// Squares along one unit of the texture coordinates.
        squares: f64,
    },
    /// An image times a factor.
    Image {
        /// Multiplies the image.
        factor: Color,
        /// Which image, over which coordinates.
        image: TextureUse,
    },
}

impl Paint {
    /// Whether a lookup needs texture coordinates.
    #[must_use]
    pub fn needs_uv(&self) -> bool {
        !matches!(self, Self::Plain(_))
    }
}

impl MaterialSpec {
    /// The material as it is looked up at a hit.
    #[must_use]
    pub fn resolve(&self, name: &str) -> Material {
        let base_color = match *self {
            Self::Matte { color } => Paint::Plain(color),
            Self::Checker { colors, squares } => Paint::Checker { colors, squares },
        };
        Material { name: name.to_owned(), base_color, vertex_colors: false }
    }
}
