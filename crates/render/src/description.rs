//! What each layer is called in files, and what its numbers mean: the text in every header.

use etendue_tracer::{LayerSpec, NormalKind, Space};

use crate::output::Look;

/// What is known of a layer without rendering it.
#[derive(Debug)]
pub(crate) struct Description {
    pub(crate) name: &'static str,
    pub(crate) channels: &'static [&'static str],
    pub(crate) look: Look,
    pub(crate) meaning: Vec<(&'static str, &'static str)>,
}

/// What each channel of [`LayerSpec::Ids`] counts.
pub(crate) fn id_definition(channel: &str) -> &'static str {
    match channel {
        "object" => "number of the object in the scene, from 1",
        "instance" => {
            "number of the copy that was hit, from 1 through all objects; an object without copies \
             has one"
        }
        "node" => "number of the model's node (or group) that was hit, from 1 through all objects",
        _ => "number of the triangle in its mesh, from 1",
    }
}

/// Where data layers look.
const CHIEF_RAY: (&str, &str) = ("taken along", "the chief ray of the pixel's centre");

/// The names and the meaning of a layer.
#[expect(clippy::too_many_lines, reason = "a table, alone in its file")]
pub(crate) fn describe(spec: LayerSpec) -> Description {
    let frame = |space| match space {
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
    };
    match spec {
        LayerSpec::Depth => Description {
            name: "Depth",
            channels: &["Z"],
            look: Look::Distance,
            meaning: vec![
                ("definition", "distance along the camera's axis from the entrance pupil"),
                ("unit", "m"),
                CHIEF_RAY,
                ("miss", "+inf"),
            ],
        },
        LayerSpec::Distance => Description {
            name: "Distance",
            channels: &["Z"],
            look: Look::Distance,
            meaning: vec![
                (
                    "definition",
                    "distance along the ray from the entrance pupil (parallel rays: from the plane \
                     through the camera's origin)",
                ),
                ("unit", "m"),
                CHIEF_RAY,
                ("miss", "+inf"),
            ],
        },
        LayerSpec::Normal { space, kind } => Description {
            name: match (space, kind) {
                (Space::World, NormalKind::Geometric) => "Normal",
                (Space::Camera, NormalKind::Geometric) => "NormalCamera",
                (Space::Opencv, NormalKind::Geometric) => "NormalOpencv",
                (Space::World, NormalKind::Shading) => "NormalShading",
                (Space::Camera, NormalKind::Shading) => "NormalShadingCamera",
                (Space::Opencv, NormalKind::Shading) => "NormalShadingOpencv",
            },
            channels: &["X", "Y", "Z"],
            look: Look::Direction,
            meaning: vec![
                match kind {
                    NormalKind::Geometric => {
                        ("definition", "unit normal of the triangle, on the viewer's side")
                    }
                    NormalKind::Shading => (
                        "definition",
                        "unit normal interpolated from the file's vertex normals (the triangle's \
                         where there are none), on the viewer's side",
                    ),
                },
                ("unit", "1"),
                frame(space),
                CHIEF_RAY,
                ("miss", "0 0 0"),
            ],
        },
        LayerSpec::Position { space } => Description {
            name: match space {
                Space::World => "Position",
                Space::Camera => "PositionCamera",
                Space::Opencv => "PositionOpencv",
            },
            channels: &["X", "Y", "Z"],
            look: Look::Extent,
            meaning: vec![
                ("definition", "the point that was hit"),
                ("unit", "m"),
                frame(space),
                CHIEF_RAY,
                ("miss", "+inf"),
            ],
        },
        LayerSpec::Ids => Description {
            name: "Id",
            channels: &["object", "instance", "node", "primitive"],
            look: Look::Ids,
            meaning: vec![CHIEF_RAY, ("miss", "0")],
        },
        LayerSpec::Coverage => Description {
            name: "Coverage",
            channels: &["A"],
            look: Look::Share,
            meaning: vec![("definition", "1 where something was hit, else 0"), CHIEF_RAY],
        },
        LayerSpec::Flat => Description {
            name: "Flat",
            channels: &["R", "G", "B"],
            look: Look::Color,
            meaning: vec![
                ("definition", "base colour without light, mean over the pixel's samples"),
                ("unit", "1 (linear light, sRGB primaries)"),
                ("miss", "0 0 0"),
            ],
        },
        LayerSpec::Facing => Description {
            name: "Facing",
            channels: &["R", "G", "B"],
            look: Look::Color,
            meaning: vec![
                (
                    "definition",
                    "base colour under a headlight, mean over the pixel's samples: to look at, not \
                     a measurement",
                ),
                ("unit", "1 (linear light, sRGB primaries)"),
                ("miss", "0 0 0"),
            ],
        },
        LayerSpec::Albedo => Description {
            name: "Albedo",
            channels: &["R", "G", "B"],
            look: Look::Color,
            meaning: vec![
                ("definition", "base colour without light"),
                ("unit", "1 (linear light, sRGB primaries)"),
                CHIEF_RAY,
                ("miss", "0 0 0"),
            ],
        },
        LayerSpec::Uv => Description {
            name: "Uv",
            channels: &["U", "V"],
            look: Look::Extent,
            meaning: vec![
                (
                    "definition",
                    "texture coordinates of the first set, v down; 0 0 on meshes without any",
                ),
                ("unit", "1"),
                CHIEF_RAY,
                ("miss", "0 0"),
            ],
        },
        LayerSpec::MaterialId => Description {
            name: "MaterialId",
            channels: &["X"],
            look: Look::Ids,
            meaning: vec![
                ("definition", "number of the material in the scene, counted from 1"),
                CHIEF_RAY,
                ("miss", "0"),
            ],
        },
        LayerSpec::Alpha => Description {
            name: "Alpha",
            channels: &["A"],
            look: Look::Share,
            meaning: vec![(
                "definition",
                "share of the pixel's samples that hit something; holes that a texture's alpha cuts \
                 count as surface",
            )],
        },
        LayerSpec::Backdrop => Description {
            name: "Backdrop",
            channels: &["R", "G", "B"],
            look: Look::Color,
            meaning: vec![
                (
                    "definition",
                    "the part of the picture that came from the environment past everything: the \
                     picture less this is what to put over another background, by Alpha; 0 with \
                     wavelengths other than RGB",
                ),
                ("unit", "1 (linear light, sRGB primaries)"),
            ],
        },
        LayerSpec::Radiance => Description {
            name: "Radiance",
            channels: &["R", "G", "B"],
            look: Look::Color,
            meaning: vec![
                (
                    "definition",
                    "radiance that the camera gathers, mean over the pixel's samples; 1 is full \
                     scale",
                ),
                ("unit", "1 (linear light; R G B: sRGB primaries)"),
                ("miss", "the environment's radiance"),
            ],
        },
    }
}
