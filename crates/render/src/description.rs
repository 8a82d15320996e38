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

/// Where data layers look.
const CHIEF_RAY: (&str, &str) = ("taken along", "the chief ray of the pixel's centre");

/// The names and the meaning of a layer.
#[expect(clippy::too_many_lines, reason = "a table, alone in its file")]
pub(crate) fn describe(spec: LayerSpec) -> Description {
    let world = ("frame", "world: right-handed, +Y up");
    let camera = ("frame", "camera: right-handed, looking along -Z, +Y up, +X right");
    let frame = |space| if space == Space::World { world } else { camera };
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
                (Space::World, NormalKind::Shading) => "NormalShading",
                (Space::Camera, NormalKind::Shading) => "NormalShadingCamera",
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
            name: if space == Space::World { "Position" } else { "PositionCamera" },
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
            channels: &["object", "primitive"],
            look: Look::Ids,
            meaning: vec![
                (
                    "definition",
                    "number of the object in the scene, and of the triangle in its mesh, both \
                     counted from 1",
                ),
                CHIEF_RAY,
                ("miss", "0"),
            ],
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
            channels: &["material"],
            look: Look::Ids,
            meaning: vec![
                ("definition", "number of the material in the scene, counted from 1"),
                CHIEF_RAY,
                ("miss", "0"),
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
