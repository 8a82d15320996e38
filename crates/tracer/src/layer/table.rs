//! The table of layers: a row each, and at the end of the row the function that fills it.
//!
//! To add a layer, add a row. Files name it as the row does, `render.layers` and `--layers` accept
//! it, headers say its meaning, and the compiler asks for nothing else. The function that fills it
//! stands in `fill.rs` beside this file when it is longer than a line.

use serde::{Deserialize, Serialize};

use super::layers::layers;
use super::rows::{
    BASE_COLOUR, CHIEF_RAY, LINEAR, SURFACE, colour, definition_of_normals, frame, light, measured,
    name_in, name_of_normals, part_of_lights, part_of_pupil,
};
use super::{Columns, FrameStep, Layer, LayerContext, Look, RaySource, ValueKind};
use crate::{LightGroup, Needs, NormalKind, Space};

layers! {
    files name {
        /// `Depth.Z`: distance along the camera's axis from the entrance pupil (m).
        Depth = "depth": Layer {
            meaning: vec![
                (
                    "definition",
                    "distance along the camera's axis from the entrance pupil: computer vision's depth, \
                     OpenCV's z",
                ),
                ("unit", "m"),
                CHIEF_RAY,
                ("miss", "+inf"),
            ],
            ..measured("Depth", &["Z"], Look::Distance)
        }, |seen, out| seen.depths(out);

        /// `Distance.Z`: distance along the ray from the entrance pupil, or for parallel rays from the
        /// plane through the camera's origin (m).
        Distance = "distance": Layer {
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
            ..measured("Distance", &["Z"], Look::Distance)
        }, |seen, out| seen.distances(out);

        /// `Normal.X Y Z`: unit normal that faces the viewer.
        Normal {
            /// The frame.
            space: Space,
            /// The normal that it shows.
            kind: NormalKind
        } = "normal": Layer {
            name: name_of_normals(space, kind),
            needs: Needs { normals: kind == NormalKind::Shading, ..SURFACE },
            meaning: vec![
                definition_of_normals(kind),
                ("unit", "1"),
                frame(space),
                CHIEF_RAY,
                ("miss", "0 0 0"),
            ],
            ..measured("", &["X", "Y", "Z"], Look::Direction)
        }, |seen, out| seen.normals(space, kind, out);

        /// `Incidence.X`: angle between the ray and the triangle's normal (radians).
        Incidence = "incidence": Layer {
            needs: SURFACE,
            meaning: vec![
                (
                    "definition",
                    "angle of incidence: between the ray and the normal of the triangle, 0 to pi/2",
                ),
                ("unit", "rad"),
                CHIEF_RAY,
                ("miss", "+inf"),
            ],
            ..measured("Incidence", &["X"], Look::Extent)
        }, |seen, out| seen.incidences(out);

        /// `Position.X Y Z`: the point that was hit (m).
        Position {
            /// The frame.
            space: Space
        } = "position": Layer {
            name: name_in(space, "Position"),
            meaning: vec![
                ("definition", "the point that was hit"),
                ("unit", "m"),
                frame(space),
                CHIEF_RAY,
                ("miss", "+inf"),
            ],
            ..measured("", &["X", "Y", "Z"], Look::Extent)
        }, |seen, out| {
            seen.each(out, |i| seen.scene.position(seen.traced, i, space).to_array());
        };

        /// `Id.object.X`, `Id.instance.X`, `Id.node.X` and `Id.primitive.X`: which object, which copy
        /// of it, which node of its model, and which triangle of its mesh.
        Ids = "ids": Layer {
            kept: ValueKind::Counted,
            meaning: vec![CHIEF_RAY, ("miss", "0")],
            apart: Some(&[
                "number of the object in the scene, from 1",
                "number of the copy that was hit, from 1 through all objects; an object without \
                 copies has one",
                "number of the model's node (or group) that was hit, from 1 through all objects",
                "number of the triangle in its mesh, from 1",
            ]),
            ..measured("Id", &["object", "instance", "node", "primitive"], Look::Ids)
        }, |seen, out| {
            seen.each(out, |i| seen.scene.ids(seen.traced.hits, i).map(f64::from));
        };

        /// `Time.S`: when the pixel is seen, in the frame's clock (s).
        Time = "time": Layer {
            meaning: vec![
                (
                    "definition",
                    "when data layers see the pixel, since the frame's shutter opened; 0 without a shutter",
                ),
                ("unit", "s"),
                CHIEF_RAY,
                ("miss", "as elsewhere"),
            ],
            ..measured("Time", &["S"], Look::Extent)
        }, |seen, out| seen.each(out, |i| [seen.traced.rays.time(i)]);

        /// `Coverage.A`: 1 where the pixel's chief ray hits, else 0.
        Coverage = "coverage": Layer {
            kept: ValueKind::Shown,
            meaning: vec![
                ("definition", "1 where something was hit, else 0"),
                CHIEF_RAY,
                ("miss", "0"),
            ],
            ..measured("Coverage", &["A"], Look::Share)
        }, |seen, out| {
            seen.each(out, |i| [f64::from(u8::from(seen.traced.hits.is_hit(i)))]);
        };

        /// `Flat.R G B`: base colour without light.
        Flat = "flat": Layer {
            needs: BASE_COLOUR,
            meaning: vec![
                ("definition", "base colour without light, mean over the pixel's samples"),
                LINEAR,
                ("miss", "0 0 0"),
            ],
            ..colour("Flat")
        }, |seen, out| seen.flats(out);

        /// `Facing.R G B`: base colour under a headlight, to look at.
        Facing = "facing": Layer {
            needs: Needs { normals: true, ambient: true, ..BASE_COLOUR },
            meaning: vec![
                (
                    "definition",
                    "base colour under a headlight, (0.08 + 0.92 base colour) * (0.15 + 0.85 cos a), a between \
                     ray and shading normal, mean over the pixel's samples: to look at, not a measurement",
                ),
                LINEAR,
                ("miss", "0 0 0"),
            ],
            ..colour("Facing")
        }, |seen, out| seen.facings(out);

        /// `Albedo.R G B`: base colour along the chief ray, not averaged.
        Albedo = "albedo": Layer {
            taken: RaySource::ChiefRay,
            needs: BASE_COLOUR,
            meaning: vec![
                ("definition", "base colour without light along the chief ray, not averaged"),
                LINEAR,
                CHIEF_RAY,
                ("miss", "0 0 0"),
            ],
            ..colour("Albedo")
        }, |seen, out| seen.albedos(out);

        /// `MeanAlbedo.R G B`: colour of the first surfaces, mean over the picture's samples.
        MeanAlbedo = "mean_albedo": Layer {
            taken: RaySource::PictureSamples,
            needs: BASE_COLOUR,
            meaning: vec![
                (
                    "definition",
                    "base colour of what is hit first, 1 of mirrors, metals and glass, mean over the \
                     picture's samples, weighted as they are: a guide for denoisers",
                ),
                LINEAR,
                ("miss", "0 0 0"),
            ],
            ..colour("MeanAlbedo")
        }, |seen, out| seen.guiding_albedos(out);

        /// `MeanNormal.X Y Z`: shading normals of the first surfaces, mean over the picture's samples.
        MeanNormal = "mean_normal": Layer {
            kept: ValueKind::Shown,
            taken: RaySource::PictureSamples,
            needs: Needs { normals: true, ..SURFACE },
            meaning: vec![
                (
                    "definition",
                    "shading normal of what is hit first, mean over the picture's samples, weighted as they \
                     are, and so no longer of length 1: a guide for denoisers; where a lens parts colours, x \
                     goes the way of red, y of green and z of blue",
                ),
                ("unit", "1"),
                frame(Space::World),
                ("miss", "0 0 0"),
            ],
            ..measured("MeanNormal", &["X", "Y", "Z"], Look::Direction)
        }, |seen, out| seen.normals(Space::World, NormalKind::Shading, out);

        /// `Uv.U V`: texture coordinates of the first set.
        Uv = "uv": Layer {
            needs: Needs { uvs: true, ..SURFACE },
            meaning: vec![
                (
                    "definition",
                    "texture coordinates of the first set, v down; 0 0 on meshes without any",
                ),
                ("unit", "1"),
                CHIEF_RAY,
                ("miss", "0 0"),
            ],
            ..measured("Uv", &["U", "V"], Look::Extent)
        }, |seen, out| {
            seen.each(out, |i| seen.scene.first_uv(seen.traced.hits, i));
        };

        /// `MaterialId.X`: which material.
        MaterialId = "material_id": Layer {
            kept: ValueKind::Counted,
            meaning: vec![
                ("definition", "number of the material in the scene, counted from 1"),
                CHIEF_RAY,
                ("miss", "0"),
            ],
            ..measured("MaterialId", &["X"], Look::Ids)
        }, |seen, out| {
            seen.each(out, |i| [f64::from(seen.scene.material_id(seen.traced.hits, i))]);
        };

        /// `Flow.X Y`: from where a pixel's point is seen to where another frame sees it (pixels).
        Flow {
            /// The other frame.
            to: FrameStep
        } = "flow": Layer {
            name: to.name("Flow"),
            needs: SURFACE,
            meaning: vec![
                (
                    "definition",
                    "where another frame sees the point that was hit, less where this one does; the \
                     point stays on its object when that moves, turns or is bent; given also where it is \
                     hidden there or outside of the picture: see Occlusion",
                ),
                ("unit", "px, x right and y down"),
                to.meaning(),
                CHIEF_RAY,
                ("miss", "+inf +inf, also for what is behind the other camera"),
            ],
            ..measured("", &["X", "Y"], Look::Extent)
        }, |seen, out| seen.flows(to, out);

        /// `Disparity.X`: how far left of its place here another frame sees a pixel's point (pixels).
        Disparity {
            /// The other frame.
            to: FrameStep
        } = "disparity": Layer {
            name: to.name("Disparity"),
            needs: SURFACE,
            meaning: vec![
                (
                    "definition",
                    "column in which the point that was hit is seen, less the column in which another \
                     frame sees it; of a pair side by side: focal length times baseline over depth",
                ),
                ("unit", "px"),
                to.meaning(),
                CHIEF_RAY,
                ("miss", "+inf, also for what is behind the other camera"),
            ],
            ..measured("", &["X"], Look::Extent)
        }, |seen, out| seen.disparities(to.across(), out);

        /// `Occlusion.hidden.X` and `Occlusion.outside.X`: 1 where another frame does not see a pixel's
        /// point, because something is before it, or because its picture ends.
        Occlusion {
            /// The other frame.
            to: FrameStep
        } = "occlusion": Layer {
            name: to.name("Occlusion"),
            needs: SURFACE,
            kept: ValueKind::Shown,
            meaning: vec![to.meaning(), CHIEF_RAY, ("miss", "0")],
            apart: Some(&[
                "1 where something is before the point in another frame (nearer by more than 1e-9 of its \
                 distance), else 0",
                "1 where the point is beyond the edge of another frame or behind its camera, else 0",
            ]),
            ..measured("", &["hidden", "outside"], Look::Share)
        }, |seen, out| seen.occlusions(to, out);

        /// `Alpha.A`: share of the pixel's samples that hit something.
        Alpha = "alpha": Layer {
            kept: ValueKind::Shown,
            taken: RaySource::PictureShare,
            meaning: vec![
                (
                    "definition",
                    "share of the pixel's samples that hit something; holes that a texture's alpha cuts \
                     count as surface",
                ),
                ("miss", "0"),
            ],
            ..measured("Alpha", &["A"], Look::Share)
        }, |seen, out| seen.shares(out);

        /// `Direct.R G B`: the part of the picture's light that one surface scattered at most.
        Direct = "direct": Layer {
            meaning: vec![
                (
                    "definition",
                    "the part of the picture's light that came straight from lights to the camera, or was \
                     scattered, mirrored or refracted by one surface; this and Indirect add up to the picture, to \
                     rounding",
                ),
                LINEAR,
                ("miss", "the environment's radiance"),
            ],
            ..light("Direct")
        }, |_seen, _out| {};

        /// `Indirect.R G B`: the rest of the picture's light.
        Indirect = "indirect": Layer {
            meaning: vec![
                (
                    "definition",
                    "the part of the picture's light that two surfaces or more scattered, mirrored or \
                     refracted on its way",
                ),
                LINEAR,
                ("miss", "0 0 0"),
            ],
            ..light("Indirect")
        }, |_seen, _out| {};

        /// `LeftPupil.R G B`: the part of the picture's light that came through the left half of the pupil.
        LeftPupil = "left_pupil": part_of_pupil("LeftPupil"), |_seen, _out| {};

        /// `RightPupil.R G B`: the part that came through the right half.
        RightPupil = "right_pupil": part_of_pupil("RightPupil"), |_seen, _out| {};

        /// `TopLeftPupil.R G B`: the part that came through the upper left quarter.
        TopLeftPupil = "top_left_pupil": part_of_pupil("TopLeftPupil"), |_seen, _out| {};

        /// `TopRightPupil.R G B`: the part that came through the upper right quarter.
        TopRightPupil = "top_right_pupil": part_of_pupil("TopRightPupil"), |_seen, _out| {};

        /// `BottomLeftPupil.R G B`: the part that came through the lower left quarter.
        BottomLeftPupil = "bottom_left_pupil": part_of_pupil("BottomLeftPupil"), |_seen, _out| {};

        /// `BottomRightPupil.R G B`: the part that came through the lower right quarter.
        BottomRightPupil = "bottom_right_pupil": part_of_pupil("BottomRightPupil"), |_seen, _out| {};

        /// A layer `Light.NAME` for each group of lights: see [`Self::LightGroup`], which takes its place.
        LightGroups = "light_groups": part_of_lights("Light".into()), |_seen, _out| {};

        /// `SampleCount.X`: samples that the pixel got.
        SampleCount = "sample_count": Layer {
            kept: ValueKind::Counted,
            taken: RaySource::Sampling,
            meaning: vec![
                (
                    "definition",
                    "samples that the pixel's mean was taken over, where they go on until an error is reached",
                ),
                ("unit", "1"),
            ],
            ..measured("SampleCount", &["X"], Look::Extent)
        }, |_seen, _out| {};

        /// `Variance.R G B`: variance of the picture's pixels, by their samples.
        Variance = "variance": Layer {
            kept: ValueKind::Shown,
            taken: RaySource::Sampling,
            meaning: vec![
                (
                    "definition",
                    "variance of the mean that is the picture's pixel, one channel a spectral band, \
                     estimated with one degree of freedom from two independent sets of samples: \
                     take means over some pixels",
                ),
                ("unit", "that of the picture, squared"),
            ],
            ..measured("Variance", &["R", "G", "B"], Look::Extent)
        }, |_seen, _out| {};
    }
    no file names {
        /// `Light.NAME.R G B`: the part of the picture's light that comes from the lights of a group. No
        /// file names it; [`Self::LightGroups`] asks for all.
        LightGroup {
            /// The group.
            group: LightGroup
        }: part_of_lights(format!("Light.{group}").into()), |_seen, _out| {};

        /// `Backdrop.R G B`: the part of the picture's radiance that came past everything. No file
        /// names it; it comes with `render.alpha` and a tracer of light.
        Backdrop: Layer {
            taken: RaySource::PictureSamples,
            needs: Needs { light: true, ..Needs::default() },
            meaning: vec![
                (
                    "definition",
                    "the part of the picture that came from the environment past everything: the \
                     picture less this is what to put over another background, by Alpha; 0 with \
                     wavelengths other than RGB",
                ),
                LINEAR,
                ("miss", "the environment's radiance"),
            ],
            ..colour("Backdrop")
        }, |seen, out| seen.backdrops(out);

        /// The picture of a tracer of light: radiance, one channel a spectral band. No file names it;
        /// it comes with the tracer, which fills it.
        Radiance: Layer {
            meaning: vec![
                (
                    "definition",
                    "radiance that the camera gathers, mean over the pixel's samples; 1 is full \
                     scale",
                ),
                ("unit", "1 (linear light; R G B: sRGB primaries)"),
                ("miss", "the environment's radiance"),
            ],
            ..light("Radiance")
        }, |_seen, _out| {};
    }
}
