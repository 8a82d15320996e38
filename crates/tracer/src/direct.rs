//! Light that one surface scatters to the camera: one bounce, with shadows.

use crate::transport::{
    Follow, LightingContext, RaySamples, RayStats, Rules, Scratch, Tracer, trace,
};

/// Direct light: what lights send to the first surface, and what it shows of them as a mirror.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Direct;

impl Tracer for Direct {
    fn radiance(
        &self,
        stage: &LightingContext<'_>,
        beam: &RaySamples<'_>,
        scratch: &mut Scratch,
        out: &mut Vec<f64>,
    ) -> RayStats {
        let rules = Rules { bounces: 1, follow: Follow::Single, roulette: None };
        trace(rules, stage, beam, scratch, out)
    }
}
