//! Light transport.

mod lights;
mod media;
mod paths;
mod precision;
mod surfaces;

use crate::Method;

/// Tracers of light, materials and lights.
pub const METHOD: Method = Method {
    name: "Light",
    cases: &[
        surfaces::GRAZING,
        surfaces::SMOOTH,
        lights::ON_A_SURFACE,
        lights::POINT_ON_A_SURFACE,
        lights::TOUCHING,
        lights::ONE_BRIGHT_PIXEL,
        lights::SMALL_SUN,
        paths::FIREFLIES,
        paths::ROULETTE,
        precision::DARK_BOX,
        precision::CORNER,
        media::THIN,
        media::NESTED,
    ],
};
