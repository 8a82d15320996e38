//! Bodies that take light away on the way through them, by Beer and Lambert (`KHR_materials_volume`).

use etendue_geometry::MISS;
use etendue_geometry::glam::DVec3;

use super::{Scratch, Tracing};

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Takes from each path what the body that it went through absorbs. A path that leaves into the open
    /// without having met the body's other side (a surface that is not closed) loses nothing.
    pub(super) fn absorb(&self, scratch: &mut Scratch) {
        let Scratch { now, hits, .. } = scratch;
        let spectral = self.stage.spectral;
        for (i, state) in now.states.iter().enumerate() {
            let body = self.stage.placed.get(state.inside).and_then(|placed| placed.absorption);
            let Some(absorption) = body.filter(|_| hits.is_hit(i)) else { continue };
            let ways = hits.t[i] / absorption.distance;
            let throughput = &mut now.throughput[i * self.count()..(i + 1) * self.count()];
            for (k, band) in throughput.iter_mut().enumerate() {
                *band *= spectral.band(&absorption.color, k).max(0.0).powf(ways);
            }
        }
    }

    /// The body in which a path is that leaves a placement along `direction`; `front` is the side of its
    /// triangle's normal.
    pub(super) fn body_behind(&self, placement: u32, direction: DVec3, front: DVec3) -> u32 {
        let absorbs = self.stage.placed.get(placement).is_some_and(|p| p.absorption.is_some());
        if absorbs && direction.dot(front) < 0.0 { placement } else { MISS }
    }
}
