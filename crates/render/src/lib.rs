#![forbid(unsafe_code)]
//! From a scene to files: what a render needs, how it is carried out, and the images it leaves.
//!
//! # Map
//!
//! | module | idea |
//! |---|---|
//! | [`output`] | the named layers of a render, and EXR, PNG, NPY and JSON files of them |

pub mod output;
