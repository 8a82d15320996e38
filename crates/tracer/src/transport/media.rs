//! The media that a path is in, and those on both sides of a surface.

use etendue_geometry::glam::DVec3;
use etendue_geometry::{MISS, PlacedTriangle};

use crate::placed::PlacedSurfaces;

/// The most bodies that a path can be in at once; of more the last entered are not noted.
const DEPTH: usize = 6;

/// The bodies that a path is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Media {
    /// Placements of closed bodies, [`MISS`] behind the last.
    bodies: [u32; DEPTH],
    /// The placement of an open sheet that the path passed to its back: the medium as far as the next hit.
    sheet: u32,
}

impl Media {
    /// In the open.
    pub(super) const NONE: Self = Self { bodies: [MISS; DEPTH], sheet: MISS };

    pub(super) fn with(mut self, body: u32) -> Self {
        if !self.bodies.contains(&body)
            && let Some(place) = self.bodies.iter_mut().find(|place| **place == MISS)
        {
            *place = body;
        }
        self
    }

    fn without(mut self, body: u32) -> Self {
        if let Some(place) = self.bodies.iter().position(|&own| own == body) {
            self.bodies[place..].rotate_left(1);
            self.bodies[DEPTH - 1] = MISS;
        }
        self
    }

    /// The placement whose medium is around; [`MISS`] in the open.
    pub(super) fn medium(&self, placed: &PlacedSurfaces) -> u32 {
        if self.sheet != MISS {
            return self.sheet;
        }
        let ranked = self.bodies.iter().take_while(|&&body| body != MISS);
        let rank = |body: u32| Some(placed.get(body)?.body?.rank);
        ranked.copied().max_by_key(|&body| rank(body)).unwrap_or(MISS)
    }
}

/// The boundary of another body in the very place of a hit, of a lens cemented to another or a liquid in its glass.
#[derive(Debug, Clone, Copy)]
pub(super) struct CoincidentBoundary {
    /// [`MISS`] where there is none.
    pub(super) placement: u32,
    pub(super) triangle: u32,
    /// The ray came from its front.
    pub(super) front: bool,
}

impl CoincidentBoundary {
    pub(super) const NONE: Self = Self { placement: MISS, triangle: MISS, front: false };

    /// The placement's triangle.
    pub(super) fn id(self) -> PlacedTriangle {
        [self.placement, self.triangle]
    }
}

/// The media on both sides of a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct MediumInterface {
    /// Before the front of its triangles.
    pub(super) outside: Media,
    /// Behind it.
    pub(super) inside: Media,
}

impl MediumInterface {
    /// Those that a path which was in `media` finds at a boundary. That it met the front of a body says that it was not
    /// in it, and the back that it was, whatever it crossed before.
    pub(super) fn of(
        media: Media,
        placement: u32,
        second: CoincidentBoundary,
        front: bool,
        placed: &PlacedSurfaces,
    ) -> Self {
        let open = Media { sheet: MISS, ..media };
        if second.placement != MISS {
            // Both at once, as the ray meets them.
            let sides = [(placement, front), (second.placement, second.front)];
            let side = |behind: bool| {
                sides.into_iter().fold(open, |media, (body, front)| match front == behind {
                    true => media.with(body),
                    false => media.without(body),
                })
            };
            let [here, behind] = [side(false), side(true)];
            let [outside, inside] = if front { [here, behind] } else { [behind, here] };
            return Self { outside, inside };
        }
        if placed.get(placement).is_some_and(|placed| placed.body.is_some()) {
            let outside = open.without(placement);
            return Self { outside, inside: outside.with(placement) };
        }
        Self { outside: open, inside: Media { sheet: placement, ..open } }
    }

    /// The medium of a path that leaves along `direction`; `front` is the side of the triangle's normal.
    pub(super) fn after(&self, direction: DVec3, front: DVec3) -> Media {
        if direction.dot(front) < 0.0 { self.inside } else { self.outside }
    }
}
