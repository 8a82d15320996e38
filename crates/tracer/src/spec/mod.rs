//! Materials and lights as scene files write them, the limits of their values, and which surfaces and lights
//! they are: one file for each, and below them what several have.
//!
//! | module | idea |
//! |---|---|
//! | `supply` | what specifications name that stands elsewhere, and faults of values: [`Supply`], [`Fault`] |
//! | `color` | colours and curves, and their limits |
//! | `paint` | colours, images, cubes and squares over a surface: [`PaintSpec`] |
//! | `modulation` | change of a light's strength with time: [`ModulationSpec`] |
//! | `material` | surfaces: [`MaterialSpec`] |
//! | `light`, `light_motion` | lights, and how they move: [`LightSpec`], [`LightMotionSpec`] |

mod color;
mod light;
mod light_motion;
mod material;
mod modulation;
mod paint;
mod supply;

pub use self::light::{LightSpec, SkyCubeSpec, SkyImageSpec, SunSpec};
pub use self::light_motion::LightMotionSpec;
pub use self::material::{AbsorptionSpec, MaterialSpec};
pub use self::modulation::ModulationSpec;
pub use self::paint::{CheckerSpec, PaintSpec};
pub use self::supply::{AbbeSpec, ColorSpec, CubeSpec, Fault, ImageSpec, IorSpec, Supply};
pub use crate::tint::BRIGHTEST;
