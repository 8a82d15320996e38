#![forbid(unsafe_code)]
#![doc = include_str!("../README.md")]
//!
//! Colours are linear light with the sRGB primaries (ITU-R BT.709), 1 being full scale; only files
//! and pictures to look at carry the sRGB transfer curve.

//!
//! # Map
//!
//! | module | idea |
//! |---|---|
//! | [`layer`] | the table of layers, and what fills each |
//! | [`reference`](mod@reference) | what a ray meets first, without light |
//! | [`view`], [`surface_point`] | the camera's frame and its cones; places on meshes |
//! | [`spec`] | materials and lights as scene files write them, and which surfaces they are |
//! | [`material`], [`texture`], [`cube`] | surfaces, ready to be looked up |
//! | [`footprint`] | how much of a surface a sample stands for |
//! | [`scattering`], [`bsdf`] | how surfaces scatter light: by which model, and its formulas |
//! | [`light`], [`group`], [`emitters`], [`environment`], [`clear_sky`] | where light comes from |
//! | [`placed`] | what there is to know of each placement before any ray meets it |
//! | [`spawn`] | where a ray that leaves a surface starts |
//! | [`transport`] | batches of paths, and the rules of each tracer of light |
//! | [`tint`] | the colour of a surface where it was met, and its curve |
//! | [`spectral`], [`sampling`] | colours to bands, numbers to directions |

mod angles;
mod area_light;
mod bodies;
pub mod bsdf;
pub mod clear_sky;
pub mod cube;
pub mod emitters;
pub mod environment;
pub mod footprint;
pub mod goniometric;
pub mod group;
pub mod layer;
pub mod light;
mod light_sampler;
mod light_tree;
pub mod lights;
pub mod material;
pub mod modulation;
pub mod placed;
pub mod projector;
mod pyramid;
pub mod reference;
pub mod sampling;
pub mod scattering;
mod shading;
mod sky;
pub mod spawn;
pub mod spec;
pub mod spectral;
mod spectral_sky;
mod surface;
pub mod surface_point;
mod target;
pub mod texture;
pub mod tint;
pub mod transport;
pub mod view;

pub use clear_sky::ClearSky;
pub use cube::{Cube, CubeKind, SceneCube};
pub use emitters::Emitters;
pub use environment::EnvironmentMap;
pub use footprint::{Cone, Footprint, Pixel};
pub use goniometric::Goniometric;
pub use group::LightGroup;
pub use layer::{Layer, LayerSpec};
pub use light::{EnvironmentImage, Light, LightKind};
pub use lights::Lights;
pub use material::{Emission, Material, Paint, TextureScope};
pub use modulation::{Clock, Modulation};
pub use placed::PlacedSurfaces;
pub use projector::Projector;
pub use reference::{Needs, NormalKind, SceneView, TracedBatch};
pub use scattering::{Absorption, Glass, Ior, Scattering};
pub use spec::{LightMotionSpec, LightSpec, MaterialSpec, ModulationSpec};
pub use spectral::Spectral;
pub use surface_point::SurfacePoint;
pub use texture::{Image, ImageSource, Texture, TextureUse};
pub use tint::{Color, Conductor, ConductorId, SceneCurve, Tint, TintSpectrum};
pub use transport::{LightingContext, RayStats, Rules, Samples, Scratch, Traits};
pub use view::{Space, View};
