//! Mirrors and glass, and direct light where they end (Whitted, "An Improved Illumination Model for
//! Shaded Display", 1980). Where a boundary reflects and refracts, one of the two is followed, by
//! Fresnel's share.

use crate::transport::{
    Follow, LightingContext, RaySamples, RayStats, Rules, Scratch, Tracer, trace,
};

/// Direct light seen through any number of mirrors and clear boundaries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Whitted {
    /// The most surfaces on a path.
    pub max_bounces: u32,
}

impl Tracer for Whitted {
    fn radiance(
        &self,
        stage: &LightingContext<'_>,
        beam: &RaySamples<'_>,
        scratch: &mut Scratch,
        out: &mut Vec<f64>,
    ) -> RayStats {
        let rules = Rules { bounces: self.max_bounces, follow: Follow::Single, roulette: None };
        trace(rules, stage, beam, scratch, out)
    }
}
