#![forbid(unsafe_code)]
//! Parts that the benchmarks share: meshes, rays, the contestants, and how they are timed.
//!
//! **The limit** is Embree called directly, a bare loop over prepared records with nothing of ours
//! in between ([`etendue_accel::limit`]). Everything else is given as a ratio to it, measured in the same run, the
//! contestants taking turns. Medians and the machine's description come from [`etendue_bench`].
//!
//! # Map
//!
//! | module | idea |
//! |---|---|
//! | [`meshes`] | blob, soup and forest, made by generators |
//! | [`rays`] | primary, sampled, incoherent and occlusion rays in batches |
//! | [`contest`] | who is timed, on which clock, and in which order |
//! | [`field`] | all contestants on one scene |
//! | [`effort`] | how heavy the meshes are, how often everything is timed |
//! | [`files`] | the meshes as GLB, OBJ and PLY, and a scene around them |
#![allow(
    clippy::disallowed_methods,
    reason = "programs of measurements and tests write their own files"
)]

pub mod contest;
pub mod effort;
pub mod field;
pub mod files;
pub mod meshes;
pub mod rays;
