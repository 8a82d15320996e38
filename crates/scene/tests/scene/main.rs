//! Scenes and models from files: what is read, what is mended, what is refused.

mod assets;
mod bad_input;
mod doctor;
mod documents;
mod models;
mod scenes;
