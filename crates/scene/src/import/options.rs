//! Options of an import, and what is wanted of a model.

use std::path::PathBuf;
use std::sync::Arc;

use crate::memory::Budget;

/// Attributes of a model that the render uses; the rest of the file is left alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Wanted {
    /// Shading normals.
    pub normals: bool,
    /// Texture coordinates.
    pub uvs: bool,
    /// Vertex colours.
    pub colors: bool,
    /// Images of materials. They are located, not decoded.
    pub textures: bool,
    /// Lights, and all that materials say of light.
    pub light: bool,
    /// The images of ambient occlusion.
    pub occlusion: bool,
}

impl Wanted {
    /// Geometry alone.
    pub const NOTHING: Self = Self {
        normals: false,
        uvs: false,
        colors: false,
        textures: false,
        light: false,
        occlusion: false,
    };
    /// All that is understood.
    pub const EVERYTHING: Self = Self {
        normals: true,
        uvs: true,
        colors: true,
        textures: true,
        light: true,
        occlusion: true,
    };
}

/// Treatment of defects in the data, such as a NaN position.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Strictness {
    /// The triangle (or value) is dropped and a note counts it.
    #[default]
    Tolerant,
    /// The file is refused.
    Strict,
}

/// Options of an import.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Treatment of defects in the data.
    pub strictness: Strictness,
    /// The folder that the files named inside the model may not leave (after links are followed);
    /// `None` allows any place.
    pub root: Option<PathBuf>,
    /// The account of what the models take; without a limit by default.
    pub budget: Arc<Budget>,
    /// Read files into memory instead of mapping them, so that they may change meanwhile.
    pub copy: bool,
    /// The animation to show a moment of; glTF only. At rest when absent.
    pub animation: Option<Play>,
}

/// A moment of an animation.
#[derive(Debug, Clone, PartialEq)]
pub struct Play {
    /// The animation's name, or its number from 0; the first when absent.
    pub which: Option<String>,
    /// Time of the animation (s): before the first key and after the last, things stand as there.
    pub time: f64,
    /// True if the animation goes on from there: placements then have links.
    pub plays: bool,
}
