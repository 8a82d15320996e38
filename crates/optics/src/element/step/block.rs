//! A block of rays at an element: ordinary cases in vector registers, the others one by one.

use super::{Action, ElementStep, limit};
use crate::element::aperture::{Opening, in_circle, in_polygon};
use crate::element::crossings::{ProfileBoundary, Slopes, cross_block, cross_first_after};
use crate::element::mirror::Shadow;
use crate::element::newton::Profile;
use crate::element::rays::{Block, Clip, LANES, PENDING, Ray, RayStatus, Traversal};
use crate::element::refract::{RefractedRay, each_lane};
use crate::element::thin_lens::at_thin_lens;

impl ElementStep {
    /// Takes a block of rays through the element.
    #[inline(always)]
    pub(crate) fn run(&self, block: &mut Block, clip: Clip) {
        if let Some(graded) = &self.graded {
            return self.run_graded(graded, block, clip);
        }
        let Some(fold) = &self.fold else { return self.meet(block, clip) };
        let before = block.outcome;
        self.meet(block, clip);
        fold.unfold(block, &before, clip, RayStatus::Vignetted { element: self.element }.code());
    }

    #[inline(always)]
    fn meet(&self, block: &mut Block, clip: Clip) {
        match &self.loss {
            None => self.pass(block, clip),
            Some(loss) => {
                let before = block.clone();
                self.pass(block, clip);
                loss.dim(block, &before);
            }
        }
    }

    #[inline(always)]
    fn pass(&self, block: &mut Block, clip: Clip) {
        if self.axial {
            self.run_at(block, clip, self.frame.vertex.z);
        } else {
            self.run_placed(block, clip);
        }
    }

    /// For an element off the axis: in its own frame, and back.
    #[inline(never)]
    fn run_placed(&self, block: &mut Block, clip: Clip) {
        for lane in 0..LANES {
            if block.outcome[lane] == 0 {
                block.outcome[lane] = PENDING;
            }
        }
        self.decide(block, clip);
    }

    #[inline(always)]
    fn run_at(&self, block: &mut Block, clip: Clip, z: f64) {
        // A kernel for each action; those that cannot decide a ray leave it pending.
        let pending = match &self.action {
            Action::Plane(refraction) => {
                let clip2 = limit(refraction.surface.semi_diameter, clip);
                each_lane(block, self.element, z, |ray| refraction.at_plane(ray, clip2))
            }
            Action::Sphere(refraction) => {
                let clip2 = limit(refraction.surface.semi_diameter, clip);
                let near = |ray| refraction.at_near_root::<true, f64>(ray, clip2);
                each_lane(block, self.element, z, near)
            }
            Action::Conic(refraction) => {
                let clip2 = limit(refraction.surface.semi_diameter, clip);
                let near = |ray| refraction.at_near_root::<false, f64>(ray, clip2);
                each_lane(block, self.element, z, near)
            }
            Action::Asphere(refraction) => {
                let clip2 = limit(refraction.surface.semi_diameter, clip);
                self.cross_block(&refraction.boundary(), block, z, clip2);
                false
            }
            Action::Biconic { surface, media, slopes } => {
                let clip2 = limit(surface.semi_diameter, clip);
                let boundary = ProfileBoundary { surface, media: *media, slopes };
                self.cross_block(&boundary, block, z, clip2);
                false
            }
            Action::ThinLens { power, semi_diameter } => {
                let clip2 = limit(*semi_diameter, clip);
                each_lane(block, self.element, z, |ray| at_thin_lens(*power, ray, clip2))
            }
            Action::Opening(opening) => {
                self.open(block, opening, clip, z);
                false
            }
            Action::Filter { filter, transmissions } if filter.is_uniform() => {
                self.dim(block, transmissions[0], limit(filter.semi_diameter, clip), clip, z);
                false
            }
            Action::Filter { .. } => {
                self.run_placed(block, clip);
                false
            }
            Action::Lenslets(lenslets) if lenslets.transmissions.is_empty() => {
                lenslets.lanes(block, self.element, z, clip)
            }
            Action::Lenslets(_) => {
                self.run_placed(block, clip);
                false
            }
            Action::Freeform { surface, media, efficiency } => {
                let clip2 = limit(surface.shape.semi_diameter, clip);
                let boundary =
                    ProfileBoundary { surface, media: *media, slopes: &Slopes::default() };
                self.cross_block(&boundary, block, z, clip2);
                block.throughput.iter_mut().for_each(|share| *share *= efficiency);
                false
            }
            Action::Shadow(shadow) => {
                self.shade(block, shadow, clip, z);
                false
            }
            Action::Turn(turn) => {
                turn.renew(block, z);
                false
            }
        };
        // Rays that are left go one by one.
        if pending {
            self.decide(block, clip);
        }
    }

    /// An asphere or a biconic, on the axis.
    #[inline(always)]
    fn cross_block<P: Profile>(
        &self,
        boundary: &ProfileBoundary<'_, P>,
        block: &mut Block,
        z: f64,
        clip2: f64,
    ) {
        cross_block(boundary, block, self.element, z, clip2, |block, lane, newton| {
            self.cross_lane(boundary, block, lane, z, clip2, newton);
        });
    }

    /// Decides a ray of a block that Newton's method has not brought to its first crossing.
    #[cold]
    #[inline(never)]
    fn cross_lane<P: Profile>(
        &self,
        boundary: &ProfileBoundary<'_, P>,
        block: &mut Block,
        lane: usize,
        z: f64,
        clip2: f64,
        newton: RefractedRay,
    ) {
        let ray = block.ray(lane);
        let mut local = ray;
        local.position[2] -= z;
        let crossing = cross_first_after(boundary, local, clip2, newton);
        let traversal = self.settle(ray, self.crossed(crossing).raised(z));
        self.set_lane(block, lane, traversal);
    }

    /// A sheet with an opening, on the axis.
    #[inline(always)]
    fn open(&self, block: &mut Block, opening: &Opening, clip: Clip, z: f64) {
        if clip == Clip::Off {
            return self.sheet(block, z, |_, _| true);
        }
        match opening {
            Opening::Circle { radius } => {
                self.sheet(block, z, |x, y| in_circle(*radius, x, y));
            }
            Opening::Polygon { normals, apothem, .. } => {
                self.sheet(block, z, |x, y| in_polygon(normals, *apothem, x, y));
            }
            Opening::Shaped(shape) => self.sheet(block, z, |x, y| shape.is_open(x, y)),
            Opening::Image(_) => self.run_placed(block, clip),
        }
    }

    /// A mirror in the way, on the axis.
    #[inline(always)]
    fn shade(&self, block: &mut Block, shadow: &Shadow, clip: Clip, z: f64) {
        let vignetted = RayStatus::Vignetted { element: self.element }.code();
        for lane in 0..LANES {
            let mut ray = block.ray(lane);
            ray.position[2] -= z;
            let stopped = (clip == Clip::On) & (block.outcome[lane] == 0) & shadow.stops(ray);
            block.outcome[lane] = if stopped { vignetted } else { block.outcome[lane] };
        }
    }

    /// A filter of one curve, on the axis.
    #[inline(always)]
    fn dim(&self, block: &mut Block, transmission: f64, clip2: f64, clip: Clip, z: f64) {
        for lane in 0..LANES {
            let alive = block.outcome[lane] == 0;
            block.throughput[lane] *= if alive { transmission } else { 1.0 };
        }
        let opaque = transmission <= 0.0 && clip == Clip::On;
        self.sheet(block, z, |x, y| (x * x + y * y <= clip2) & !opaque);
    }

    #[inline(always)]
    fn sheet(&self, block: &mut Block, z: f64, open: impl Fn(f64, f64) -> bool) {
        let vignetted = RayStatus::Vignetted { element: self.element }.code();
        let missed = RayStatus::Missed { element: self.element }.code();
        for lane in 0..LANES {
            let Ray { position, direction } = block.ray(lane);
            let t = (z - position[2]) / direction[2];
            let passes = open(position[0] + t * direction[0], position[1] + t * direction[1]);
            let reaches = t.abs() < f64::INFINITY;
            let ended = if reaches { vignetted } else { missed };
            let outcome = block.outcome[lane];
            block.outcome[lane] =
                if (outcome == 0) & !(passes & reaches) { ended } else { outcome };
        }
    }

    /// Decides the rays that a vector kernel has marked.
    #[cold]
    #[inline(never)]
    fn decide(&self, block: &mut Block, clip: Clip) {
        for lane in 0..LANES {
            if block.outcome[lane] == PENDING {
                let traversal = self.pass_one(block.ray(lane), clip);
                self.set_lane(block, lane, traversal);
            }
        }
    }

    /// A ray of a block as it goes on; one that is vignetted ends where it met the element.
    fn set_lane(&self, block: &mut Block, lane: usize, traversal: Traversal) {
        let mut ray = traversal.ray;
        if let (RayStatus::Vignetted { .. }, Some(point)) = (traversal.status, traversal.point)
            && self.moves()
        {
            ray.position = point;
        }
        block.set_ray(lane, ray);
        block.throughput[lane] *= traversal.transmission;
        block.outcome[lane] = traversal.status.code();
    }
}
