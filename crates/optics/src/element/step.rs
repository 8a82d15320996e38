//! One element at one wavelength, met from one side: what a ray does there.
//!
//! Two ways through the same arithmetic. [`ElementStep::run`] takes a block of rays, decides the ordinary
//! cases in vector registers and leaves the others marked; [`ElementStep::run_one`] takes a single ray and
//! decides everything. Both give the same bits.

use std::sync::Arc;

use glam::DVec3;

use super::Frame;
use super::aperture::{Opening, in_circle, in_polygon};
use super::biconic::Biconic;
use super::coordinate_break::CoordinateBreak;
use super::crossings::{ProfileBoundary, Slopes, cross_first, cross_first_after};
use super::freeform::FreeformSurface;
use super::gradient::step::GradientPair;
use super::lenslets::Lenslets;
use super::losses::{Filter, Loss};
use super::mirror::{Fold, Shadow};
use super::newton::{Profile, cross_block};
use super::rays::{Block, LANES, PENDING, Ray, RayStatus};
use super::refract::{IndexPair, RefractedRay, Refraction, each_lane};
use super::thin_lens::at_thin_lens;

/// Clipping of rays by clear apertures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Clip {
    /// Semi-diameters, apertures and opaque parts of filters end a ray.
    #[default]
    On,
    /// Only missed surfaces and total reflection end a ray.
    Off,
}

/// An element as one ray meets it.
#[derive(Debug, Clone)]
pub(crate) struct ElementStep {
    /// The element's index from the object side.
    pub(crate) element: usize,
    pub(crate) frame: Frame,
    pub(crate) axial: bool,
    pub(crate) action: Action,
    /// Losses of light at the step, when they are asked for.
    pub(crate) loss: Option<Loss>,
    /// Direction of the light behind a mirror.
    pub(crate) fold: Option<Fold>,
    /// Gradients before or behind it.
    pub(crate) graded: Option<Arc<GradientPair>>,
}

/// Action of an element on a ray.
#[derive(Debug, Clone)]
pub(crate) enum Action {
    Plane(Refraction),
    Sphere(Refraction),
    Conic(Refraction),
    Asphere(Refraction),
    Biconic {
        surface: Biconic,
        media: IndexPair,
        slopes: Slopes,
    },
    ThinLens {
        power: f64,
        semi_diameter: f64,
    },
    Opening(Arc<Opening>),
    Filter {
        filter: Arc<Filter>,
        transmissions: Vec<f64>,
    },
    Lenslets(Lenslets),
    /// A surface of any shape, and the share of light in its order.
    Freeform {
        surface: FreeformSurface,
        media: IndexPair,
        efficiency: f64,
    },
    /// A mirror in the way to another element.
    Shadow(Shadow),
    /// The axis runs elsewhere behind it: rays are written down anew, and stay where they are.
    Turn(CoordinateBreak),
}

impl Action {
    /// True if the action moves rays to the element; sheets only look at them.
    pub(crate) fn moves(&self) -> bool {
        !matches!(self, Self::Opening(_) | Self::Filter { .. } | Self::Shadow(_) | Self::Turn(_))
    }

    /// The kernel that a surface needs.
    pub(crate) fn refract(refraction: Refraction) -> Self {
        let surface = &refraction.surface;
        if !surface.aspheric.is_empty() {
            Self::Asphere(refraction)
        } else if surface.curvature == 0.0 {
            Self::Plane(refraction)
        } else if surface.conic == 0.0 {
            Self::Sphere(refraction)
        } else {
            Self::Conic(refraction)
        }
    }
}

/// Outcome of a single ray at an element.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Traversal {
    pub(crate) status: RayStatus,
    /// The ray as it goes on; as it came unless [`RayStatus::Exited`].
    pub(crate) ray: Ray,
    /// Point where the ray met the element, in lens coordinates; `None` when it missed.
    pub(crate) point: Option<[f64; 3]>,
    /// The share of light that goes on.
    pub(crate) transmission: f64,
}

impl Traversal {
    /// Shifts the traversal along the axis by `z` (mm).
    #[inline(always)]
    fn raised(mut self, z: f64) -> Self {
        self.ray.position[2] += z;
        if let Some(point) = &mut self.point {
            point[2] += z;
        }
        self
    }
}

#[inline(always)]
fn limit(semi_diameter: f64, clip: Clip) -> f64 {
    match clip {
        Clip::On => semi_diameter * semi_diameter,
        Clip::Off => f64::INFINITY,
    }
}

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

    /// True if rays take long to be traced through the element: an asphere with a wall.
    pub(crate) fn has_wall(&self) -> bool {
        matches!(&self.action, Action::Asphere(refraction) if refraction.surface.has_wall())
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

    /// True if the element moves rays to itself; sheets only look at them.
    pub(crate) fn moves(&self) -> bool {
        self.action.moves()
    }

    /// Takes one ray through the element.
    #[inline]
    pub(crate) fn run_one(&self, ray: Ray, clip: Clip) -> Traversal {
        if let Some(graded) = &self.graded {
            return self.graded_one(graded, ray, clip);
        }
        let mut traversal = self.pass_one(ray, clip);
        if let (Some(loss), RayStatus::Exited) = (&self.loss, traversal.status) {
            traversal.transmission *= loss.share(ray, traversal.ray);
        }
        match &self.fold {
            Some(fold) => fold.unfold_one(ray, traversal, clip, self.element),
            None => traversal,
        }
    }

    /// The path (mm) that a phase of the element adds at a place (mm) of the lens.
    pub(crate) fn added_path(&self, place: DVec3) -> f64 {
        let Action::Freeform { surface, .. } = &self.action else { return 0.0 };
        let local = self.frame.rotation.transpose() * (place - self.frame.vertex);
        surface.added_path([local.x, local.y])
    }

    /// True if the step stands for a mirror on the way to another element.
    pub(crate) fn is_shadow(&self) -> bool {
        matches!(self.action, Action::Shadow(_))
    }

    #[inline]
    pub(super) fn pass_one(&self, ray: Ray, clip: Clip) -> Traversal {
        if self.axial {
            let z = self.frame.vertex.z;
            let mut local = ray;
            local.position[2] -= z;
            return self.settle(ray, self.local(local, clip).raised(z));
        }
        let mut traversal = self.local(self.frame.enter(ray), clip);
        traversal.ray = self.frame.leave(traversal.ray);
        traversal.point = traversal.point.map(|p| self.frame.point(p.into()).to_array());
        self.settle(ray, traversal)
    }

    /// Rays that end, and rays that only pass a sheet, stay as they came to the last bit.
    fn settle(&self, ray: Ray, traversal: Traversal) -> Traversal {
        let changes = self.moves() || matches!(self.action, Action::Turn(_));
        if traversal.status == RayStatus::Exited && changes {
            traversal
        } else {
            Traversal { ray, ..traversal }
        }
    }

    fn local(&self, ray: Ray, clip: Clip) -> Traversal {
        match &self.action {
            Action::Plane(refraction) | Action::Sphere(refraction) | Action::Conic(refraction) => {
                let clip2 = limit(refraction.surface.semi_diameter, clip);
                self.crossed(refraction.exactly(ray, clip2))
            }
            Action::Asphere(refraction) => {
                let clip2 = limit(refraction.surface.semi_diameter, clip);
                self.crossed(cross_first(&refraction.boundary(), ray, clip2))
            }
            Action::Biconic { surface, media, slopes } => {
                let clip2 = limit(surface.semi_diameter, clip);
                let boundary = ProfileBoundary { surface, media: *media, slopes };
                self.crossed(cross_first(&boundary, ray, clip2))
            }
            Action::ThinLens { power, semi_diameter } => {
                self.crossed(at_thin_lens(*power, ray, limit(*semi_diameter, clip)))
            }
            Action::Opening(opening) => self.sheet_crossed(ray, clip, |[x, y]| {
                let transmission = opening.transmission(x, y);
                if clip == Clip::On { transmission } else { 1.0 }
            }),
            Action::Filter { filter, transmissions } => self.sheet_crossed(ray, clip, |[x, y]| {
                let inside = x * x + y * y <= limit(filter.semi_diameter, clip);
                filter.curve_at(x, y).filter(|_| inside).map_or(0.0, |i| transmissions[i])
            }),
            Action::Lenslets(lenslets) => {
                let (crossing, kind) = lenslets.exactly(ray, clip);
                let passes = kind.and_then(|kind| lenslets.transmissions.get(kind).copied());
                Traversal { transmission: passes.unwrap_or(1.0), ..self.crossed(crossing) }
            }
            Action::Freeform { surface, media, efficiency } => {
                let clip2 = limit(surface.shape.semi_diameter, clip);
                let boundary =
                    ProfileBoundary { surface, media: *media, slopes: &Slopes::default() };
                let crossing = cross_first(&boundary, ray, clip2);
                Traversal { transmission: *efficiency, ..self.crossed(crossing) }
            }
            Action::Turn(turn) => turn.renewed_one(ray),
            Action::Shadow(shadow) => {
                let stopped = clip == Clip::On && shadow.stops(ray);
                let status = match stopped {
                    true => RayStatus::Vignetted { element: self.element },
                    false => RayStatus::Exited,
                };
                let t = (shadow.rim[0] - ray.position[2]) / ray.direction[2];
                let point = stopped.then(|| ray.advanced(t).position);
                Traversal { status, ray, point, transmission: 1.0 }
            }
        }
    }

    fn crossed(&self, crossing: RefractedRay) -> Traversal {
        let element = self.element;
        let status = match crossing {
            RefractedRay { hit: false, .. } => RayStatus::Missed { element },
            RefractedRay { clear: false, .. } => RayStatus::Vignetted { element },
            RefractedRay { through: false, .. } => RayStatus::TotalInternalReflection { element },
            _ => RayStatus::Exited,
        };
        let point = crossing.hit.then_some(crossing.ray.position);
        Traversal { status, ray: crossing.ray, point, transmission: 1.0 }
    }

    fn sheet_crossed(
        &self,
        ray: Ray,
        clip: Clip,
        transmission: impl Fn([f64; 2]) -> f64,
    ) -> Traversal {
        let element = self.element;
        let t = -ray.position[2] / ray.direction[2];
        if !t.is_finite() {
            return Traversal {
                status: RayStatus::Missed { element },
                ray,
                point: None,
                transmission: 0.0,
            };
        }
        let mut point = ray.advanced(t).position;
        point[2] = 0.0;
        let transmission = transmission([point[0], point[1]]);
        let passes = transmission > 0.0 || clip == Clip::Off;
        let status = if passes { RayStatus::Exited } else { RayStatus::Vignetted { element } };
        Traversal { status, ray, point: Some(point), transmission }
    }
}
