//! Rays and triangles.

mod directions;
mod exposures;
mod field;
mod leaks;
mod limits;
mod motion;
mod places;
mod triangles;

use crate::Method;

/// Closest hit and occlusion.
pub const METHOD: Method = Method {
    name: "Intersection",
    cases: &[
        leaks::DEFAULT,
        leaks::OCCLUSION,
        leaks::WITHOUT_F64,
        leaks::FAST,
        directions::IN_THE_PLANE,
        directions::GRAZING,
        directions::ZEROS,
        triangles::NEEDLES,
        triangles::NEEDLES_IN_EMBREE,
        triangles::WITHOUT_AREA,
        triangles::NOT_FINITE,
        triangles::COPLANAR,
        triangles::COPIES_IN_EMBREE,
        triangles::ONE,
        triangles::TWO_TO_THE_31,
        places::FAR,
        places::SIZES,
        places::TWICE,
        places::MIRRORED,
        limits::SMALL_IN_WIDE,
        limits::SCATTERED,
        limits::BESIDE_A_WALL,
        limits::INSTRUCTION_SETS,
        motion::MOTION,
        exposures::SHUT_OUT,
        exposures::WHOLE_TURNS,
        exposures::COPIES,
        exposures::LAMPS,
    ],
};
