//! What is made of a scene: the picture, and how it is rendered.

use etendue_camera::sampler::Sampler;
use etendue_tracer::LayerSpec;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the picture shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum TracerSpec {
    /// Base colour under a headlight, to look at.
    Facing {},
    /// Base colour without light.
    Flat {},
    /// Light that one surface sends to the camera, with shadows.
    Direct {},
    /// The same, seen through mirrors and clear glass.
    Whitted {
        /// The most surfaces on a path.
        #[serde(default = "default_whitted_bounces")]
        #[schemars(range(min = 1, max = 1024))]
        max_bounces: u32,
    },
    /// Global illumination.
    Path {
        /// The most surfaces on a path.
        #[serde(default = "default_path_bounces")]
        #[schemars(range(min = 1, max = 1024))]
        max_bounces: u32,
    },
}

fn default_whitted_bounces() -> u32 {
    16
}

fn default_path_bounces() -> u32 {
    32
}

impl TracerSpec {
    /// The layer that holds the picture.
    #[must_use]
    pub fn layer(self) -> LayerSpec {
        match self {
            Self::Facing {} => LayerSpec::Facing,
            Self::Flat {} => LayerSpec::Flat,
            Self::Direct {} | Self::Whitted { .. } | Self::Path { .. } => LayerSpec::Radiance,
        }
    }

    /// The word behind `type` in the file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Facing {} => "facing",
            Self::Flat {} => "flat",
            Self::Direct {} => "direct",
            Self::Whitted { .. } => "whitted",
            Self::Path { .. } => "path",
        }
    }
}

/// How the scene is rendered. The command line's options of the same names go before these.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RenderSpec {
    /// Rays a pixel of the picture (at least 1). Layers take the pixel's chief ray alone.
    #[serde(default = "one")]
    #[schemars(range(min = 1, max = 1_048_576))]
    pub samples: u32,
    /// Where in its pixel a sample lies.
    #[serde(default)]
    pub sampler: Sampler,
    /// Another seed gives other samples.
    #[serde(default)]
    pub seed: u64,
    /// What finds the hits; the best that was built in when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accel: Option<AccelName>,
}

fn one() -> u32 {
    1
}

impl Default for RenderSpec {
    fn default() -> Self {
        Self { samples: 1, sampler: Sampler::default(), seed: 0, accel: None }
    }
}

/// The accelerators by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AccelName {
    /// Intel's Embree.
    Embree,
    /// Pure Rust.
    Bvh,
    /// The f64 reference.
    Exact,
}
