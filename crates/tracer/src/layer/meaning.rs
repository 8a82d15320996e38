//! Words that several rows of the table of layers share.

use std::borrow::Cow;

use super::{NormalKind, Space};

/// Where data layers look.
pub(super) const CHIEF_RAY: (&str, &str) = ("taken along", "the chief ray of the pixel's centre");

/// The unit of colours.
pub(super) const LINEAR: (&str, &str) = ("unit", "1 (linear light, sRGB primaries)");

/// What vectors of a frame refer to.
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

/// What each kind of normal is.
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
