//! Lenses.

mod bench;
mod crossings;
mod fates;
mod focus;
mod masks;
mod openings;
mod random;

use crate::Method;

/// Tracing through lens trains, their focus, pupils and openings.
pub const METHOD: Method = Method {
    name: "Optics",
    cases: &[
        fates::TOTAL_REFLECTION,
        fates::MISSED,
        fates::WRONG_ROOT,
        fates::STEEP_ASPHERE,
        crossings::CROSSINGS,
        fates::RIM_BEYOND_THE_RADIUS,
        fates::FLAT,
        fates::EQUAL_INDICES,
        fates::CROSSING_EDGES,
        focus::FOCUS,
        focus::WAVELENGTH,
        focus::ZOOM,
        openings::CLOSED,
        openings::F_0_5,
        openings::F_0_01,
        openings::ONE_PIXEL,
        masks::WIDER_THAN_THE_LENS,
        masks::LITTLE_OPEN,
        random::ANY_LENS,
    ],
};
