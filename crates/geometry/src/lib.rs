#![doc = include_str!("../README.md")]
//!
//! # Conventions
//!
//! * The world is right-handed, in metres, +Y up. A camera looks along its −Z (glTF).
//! * Directions of rays are unit vectors, so a hit's `t` is a distance in metres.
//! * A triangle's front is the side from which its corners run counter-clockwise; a transform of
//!   negative determinant turns this over, as glTF 2.0 (section 3.7.4) prescribes, so a mirrored
//!   closed mesh still has its outside outside.
//! * Coordinates are stored as the file gives them (mostly f32) and computed with in f64.
//!
//! # Map
//!
//! | module | idea |
//! |---|---|
//! | [`batch`] | [`RayBatch`] and [`HitBatch`], structures of arrays |
//! | [`block`] | [`RayBlock`], sixteen rays in single precision |
//! | [`bounds`] | axis-aligned boxes, and which triangles are points or lines |
//! | [`buffer`] | shared numbers, owned by a `Vec` or by a mapped file |
//! | [`disk`] | the unit square on the unit disk |
//! | [`mesh`] | a triangle mesh and its vertex attributes |
//! | [`hermite`] | the curve through points at uneven times |
//! | [`joint`] | frames that move in each other |
//! | [`motion`] | where a body is at each time of an exposure |
//! | [`steps`] | which shape a mesh has at each time of an exposure |
//! | [`transform`] | affine maps whose translation keeps 106 bits |
//! | [`units`] | lengths, angles and times with their units, as files write them |
//! | [`world`] | meshes and their placements, and which triangles have an area |

pub mod batch;
pub mod block;
pub mod bounds;
pub mod buffer;
pub mod coplanar;
pub mod disk;
pub mod float;
pub mod hermite;
pub mod joint;
pub mod mesh;
pub mod motion;
pub mod steps;
pub mod transform;
pub mod units;
pub mod world;

pub use batch::{Detail, HitBatch, HitPrecision, MISS, PlacedTriangle, RayBatch, RaysMut};
pub use block::{RayBlock, RayBlocks};
pub use bounds::{Bounds, is_degenerate};
pub use buffer::{Buffer, Vertices};
pub use coplanar::{Coplanar, CoplanarPair};
pub use float::Float;
pub use hermite::Interpolation;
pub use joint::{Between, Joint, Link, Track};
pub use mesh::{Mesh, Positions, Tangents};
pub use motion::{Motion, MotionError, Steady, Sweep};
pub use steps::{Moment, Steps};
pub use transform::Transform;
pub use world::{AreaTest, Geometry, Placement};

pub use glam;
