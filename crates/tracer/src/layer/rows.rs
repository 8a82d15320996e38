//! Rows of the [`super::table`] to begin with, and what they need.

use super::meaning::LINEAR;
use super::{Kept, Layer, Look, Taken};
use crate::Needs;

/// A row to begin with: a measurement along the chief ray.
pub(super) fn measured(name: &'static str, channels: &'static [&'static str], look: Look) -> Layer {
    Layer {
        name: name.into(),
        channels,
        kept: Kept::Measured,
        taken: Taken::ChiefRay,
        look,
        needs: Needs::default(),
        meaning: Vec::new(),
        apart: None,
    }
}

/// A row to begin with: a colour, averaged over the samples.
pub(super) fn colour(name: &'static str) -> Layer {
    Layer {
        kept: Kept::Shown,
        taken: Taken::Samples,
        ..measured(name, &["R", "G", "B"], Look::Color)
    }
}

/// A row to begin with: light that a tracer follows.
pub(super) fn light(name: &'static str) -> Layer {
    Layer {
        taken: Taken::Light,
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

pub(super) const SURFACE: Needs = Needs {
    surface: true,
    normals: false,
    materials: false,
    uvs: false,
    light: false,
    ambient: false,
};
pub(super) const BASE_COLOUR: Needs = Needs { materials: true, uvs: true, ..SURFACE };
