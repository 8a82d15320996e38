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
        surfaces::WHITE_METAL,
        surfaces::COLOURED_PANE,
        lights::ON_A_SURFACE,
        lights::POINT_ON_A_SURFACE,
        lights::TOUCHING,
        lights::IN_A_FLOOR,
        lights::ONE_BRIGHT_PIXEL,
        lights::SMALL_SUN,
        lights::SKY_SPECTRUM,
        paths::FIREFLIES,
        paths::ROULETTE,
        precision::DARK_BOX,
        precision::CORNER,
        media::THIN,
        media::NESTED,
        media::WITHIN,
    ],
};
