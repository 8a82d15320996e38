//! Paths under way, in arrays, and what each remembers.

use etendue_geometry::glam::DVec3;
use etendue_geometry::{HitBatch, HitPrecision, MISS, RayBatch};

use super::media::Media;
use crate::footprint::{Cone, Footprint};
use crate::light_sampler::Receiver;
use crate::sampling::power_heuristic;

/// Paths under way.
#[derive(Debug, Default)]
pub(super) struct Paths {
    pub(super) rays: RayBatch,
    pub(super) states: Vec<State>,
    /// `[path][band]`.
    pub(super) throughput: Vec<f64>,
    /// Lanes of a patch whose paths are added.
    pub(super) kept: Vec<usize>,
}

/// What a path remembers.
#[derive(Debug, Clone, Copy)]
pub(super) struct State {
    /// The camera's ray.
    pub(super) ray: u32,
    /// Steps taken, for numbers not to be used twice.
    pub(super) steps: u32,
    /// Surfaces that have scattered light.
    pub(super) bounces: u32,
    /// Density (1/sr) of the direction; `+inf` when no light can be asked instead.
    pub(super) pdf: f64,
    /// The surface that it left, as lights were chosen for it.
    pub(super) receiver: Receiver,
    /// The wavelength (nm) of the one band left, after a glass has parted them.
    pub(super) wavelength: Option<f64>,
    /// The media that it is in, where they count.
    pub(super) media: Media,
    /// Looks for light and goes no farther.
    pub(super) is_last: bool,
    /// What the path stands for, as long as it only met mirrors and clear boundaries; as wide as at
    /// its vertex.
    pub(super) cone: Option<Cone>,
}

impl State {
    /// The weight of light that the path met by itself against having asked for it with density `pdf`
    /// (1/sr).
    pub(super) fn weight_against(&self, pdf: f64) -> f64 {
        match self.pdf {
            f64::INFINITY => 1.0,
            own => power_heuristic(own, pdf),
        }
    }
}

impl Paths {
    pub(super) fn clear(&mut self) {
        self.rays.clear();
        self.states.clear();
        self.throughput.clear();
    }

    /// Empties it for paths that leave surfaces.
    pub(super) fn restart(&mut self, precision: HitPrecision) {
        self.clear();
        self.rays.from_surface = true;
        self.rays.coherent = false;
        self.rays.precision = precision;
    }

    /// Puts each path at the time of the camera's ray that it goes on from.
    pub(super) fn take_times(&mut self, times: &[f64]) {
        if !times.is_empty() {
            self.rays.set_times(self.states.iter().map(|state| times[state.ray as usize]));
        }
    }

    /// What path `i` carries in its `count` bands.
    pub(super) fn throughput_of(&self, i: usize, count: usize) -> &[f64] {
        &self.throughput[i * count..(i + 1) * count]
    }

    /// What path `i` covers of what it hit.
    pub(super) fn footprint(&self, hits: &HitBatch, i: usize) -> Option<Footprint> {
        let width = self.states[i].cone?.after(hits.t[i]).width;
        Some(Footprint { direction: self.rays.direction(i), width })
    }

    /// Adds a path that leaves a placement's triangle: where it starts, and its direction.
    pub(super) fn push(&mut self, ray: (DVec3, DVec3), left: [u32; 2], state: State) {
        self.push_beside(ray, [left, [MISS; 2]], state);
    }

    /// Adds a path that leaves two triangles in one place.
    pub(super) fn push_beside(&mut self, ray: (DVec3, DVec3), left: [[u32; 2]; 2], state: State) {
        let limits = [0.0, f64::INFINITY];
        self.rays.push_between_triangles(ray.0, ray.1, limits, left);
        self.states.push(state);
    }
}
