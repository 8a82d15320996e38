//! The tracers of light: one body, and the rules by which its paths end.

use super::{LightingContext, RaySamples, RayStats, Scratch, trace};

/// A tracer of light: where its paths end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rules {
    /// The most surfaces that scatter light on a path.
    pub bounces: u32,
    /// Directions that are followed beyond the first light that they meet.
    pub follow: Follow,
    /// Surfaces after which paths go on with a chance of the root of what they carry of their brightest band.
    pub roulette: Option<u32>,
    /// The most paths that one is parted into by glass that disperses. Of more bands each path keeps one of a few
    /// neighbours.
    pub parts: u32,
}

/// Scattered directions that a tracer follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Follow {
    /// Those of mirrors and clear glass alone.
    Single,
    /// All.
    All,
}

impl Rules {
    /// Surfaces after which dim paths of [`Rules::path`] end by chance.
    pub const ROULETTE_AFTER: u32 = 5;

    /// Paths that one is parted into, at most, where nothing else is said.
    pub const PARTS: u32 = 32;

    /// Direct light: what lights send to the first surface, with shadows, and what it shows of them
    /// as a mirror.
    #[must_use]
    pub fn direct() -> Self {
        Self { bounces: 1, follow: Follow::Single, roulette: None, parts: Self::PARTS }
    }

    /// Direct light seen through any number of mirrors and clear boundaries, at most `bounces`
    /// (Whitted, "An Improved Illumination Model for Shaded Display", 1980). Where a boundary reflects
    /// and refracts, one of the two is followed, by Fresnel's share.
    #[must_use]
    pub fn whitted(bounces: u32) -> Self {
        Self { bounces, follow: Follow::Single, roulette: None, parts: Self::PARTS }
    }

    /// Global illumination: all paths from the camera to light of at most `bounces` surfaces (Kajiya,
    /// "The Rendering Equation", 1986). Lights are sampled at each surface and weighed against
    /// directions that meet them by themselves.
    #[must_use]
    pub fn path(bounces: u32) -> Self {
        let roulette = Some(Self::ROULETTE_AFTER);
        Self { bounces, follow: Follow::All, roulette, parts: Self::PARTS }
    }

    /// The radiance that arrives along each ray against its direction, in `camera.bands`: `out` is
    /// `[ray][part][band]` with `camera.parts` and all bands of the context, and is refilled; other bands are 0.
    pub fn radiance(
        self,
        ctx: &LightingContext<'_>,
        camera: &RaySamples<'_>,
        scratch: &mut Scratch,
        out: &mut Vec<f64>,
    ) -> RayStats {
        trace(self, ctx, camera, scratch, out)
    }
}
