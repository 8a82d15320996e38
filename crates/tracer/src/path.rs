//! Global illumination: all paths from the camera to light (Kajiya, "The Rendering Equation", 1986),
//! lights asked at each surface and weighed against directions that meet them by themselves.

use crate::transport::{Beam, Follow, Rules, Scratch, Stage, Tally, Tracer, trace};

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
        stage: &Stage<'_>,
        beam: &Beam<'_>,
        scratch: &mut Scratch,
        out: &mut Vec<f64>,
    ) -> Tally {
        let roulette = Some(ROULETTE_AFTER);
        let rules = Rules { bounces: self.max_bounces, follow: Follow::All, roulette };
        trace(rules, stage, beam, scratch, out)
    }
}
