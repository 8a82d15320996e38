//! Rows of the [`super::table`] to begin with, what they need, and the words that several share.

use std::borrow::Cow;

use super::{Layer, Look, RaySource, ValueKind};
use crate::{Needs, NormalKind, Space};

/// A row to begin with: a measurement along the chief ray.
pub(super) fn measured(name: &'static str, channels: &'static [&'static str], look: Look) -> Layer {
    Layer {
        name: name.into(),
        channels,
        kept: ValueKind::Measured,
        taken: RaySource::ChiefRay,
        look,
        needs: Needs::default(),
        meaning: Vec::new(),
        apart: None,
    }
}

/// A row to begin with: a colour, averaged over the samples.
pub(super) fn colour(name: &'static str) -> Layer {
    Layer {
        kept: ValueKind::Shown,
        taken: RaySource::Samples,
        ..measured(name, &["R", "G", "B"], Look::Color)
    }
}

/// A row to begin with: light that a tracer follows.
pub(super) fn light(name: &'static str) -> Layer {
    Layer {
        taken: RaySource::Light,
        needs: Needs { normals: true, light: true, ..BASE_COLOUR },
        ..colour(name)
    }
}

/// A row of the light that came through a part of the pupil.
pub(super) fn part_of_pupil(name: &'static str) -> Layer {
    Layer {
        meaning: vec![
            (
                "definition",
                "the part of the picture's light that came through one part of the entrance pupil, halves or \
                 quarters as the camera sees them; the picture is the sum of all parts",
            ),
            LINEAR,
        ],
        ..light(name)
    }
}

/// A row of the light that comes from a group of lights.
pub(super) fn part_of_lights(name: Cow<'static, str>) -> Layer {
    Layer {
        name,
        meaning: vec![
            (
                "definition",
                "the part of the picture's light that comes from the lights whose `group` is the layer's name, \
                 and for `other` from those without one; the picture is the sum of all groups, to rounding",
            ),
            LINEAR,
            ("miss", "the environment's radiance, in its group"),
        ],
        ..light("")
    }
}

pub(super) const SURFACE: Needs = Needs {
    surface: true,
    normals: false,
    materials: false,
    uvs: false,
    light: false,
    ambient: false,
};
pub(super) const BASE_COLOUR: Needs = Needs { materials: true, uvs: true, ..SURFACE };

/// Ray that data layers are taken along.
pub(super) const CHIEF_RAY: (&str, &str) = ("taken along", "the chief ray of the pixel's centre");

/// The unit of colours.
pub(super) const LINEAR: (&str, &str) = ("unit", "1 (linear light, sRGB primaries)");

/// Definition of a frame that vectors refer to.
pub(super) fn frame(space: Space) -> (&'static str, &'static str) {
    match space {
        Space::World => ("frame", "world: right-handed, +Y up"),
        Space::Camera => (
            "frame",
            "camera, in OpenGL's convention: right-handed, looking along -Z, +Y up, +X right; \
             camera.json has OpenCV's: turn the signs of y and z, or ask for \"space\": \"opencv\"",
        ),
        Space::Opencv => (
            "frame",
            "camera, in OpenCV's convention, as in camera.json: right-handed, looking along +Z, +Y \
             down, +X right",
        ),
    }
}

/// The name of a layer in a frame.
pub(super) fn name_in(space: Space, name: &'static str) -> Cow<'static, str> {
    match space {
        Space::World => name.into(),
        Space::Camera => format!("{name}Camera").into(),
        Space::Opencv => format!("{name}Opencv").into(),
    }
}

/// The name of a layer of normals.
pub(super) fn name_of_normals(space: Space, kind: NormalKind) -> Cow<'static, str> {
    match kind {
        NormalKind::Geometric => name_in(space, "Normal"),
        NormalKind::Shading => name_in(space, "NormalShading"),
    }
}

/// Definition of each kind of normal.
pub(super) fn definition_of_normals(kind: NormalKind) -> (&'static str, &'static str) {
    match kind {
        NormalKind::Geometric => {
            ("definition", "unit normal of the triangle, on the viewer's side")
        }
        NormalKind::Shading => (
            "definition",
            "unit normal interpolated from the file's vertex normals (the triangle's where there \
             are none), on the viewer's side",
        ),
    }
}
