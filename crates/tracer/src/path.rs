//! Global illumination: all paths from the camera to light (Kajiya, "The Rendering Equation", 1986),
//! lights asked at each surface and weighed against directions that meet them by themselves.

use crate::transport::{
    Follow, LightingContext, RaySamples, RayStats, Rules, Scratch, Tracer, trace,
};

/// Surfaces after which dim paths end by chance.
const ROULETTE_AFTER: u32 = 4;

/// Paths of any kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Path {
    /// The most surfaces on a path.
    pub max_bounces: u32,
}

impl Tracer for Path {
    fn radiance(
        &self,
        stage: &LightingContext<'_>,
        beam: &RaySamples<'_>,
        scratch: &mut Scratch,
        out: &mut Vec<f64>,
    ) -> RayStats {
        let roulette = Some(ROULETTE_AFTER);
        let rules = Rules { bounces: self.max_bounces, follow: Follow::All, roulette };
        trace(rules, stage, beam, scratch, out)
    }
}
