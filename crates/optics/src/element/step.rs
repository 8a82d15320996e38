//! One element at one wavelength, met from one side: what a ray does there.
//!
//! Two ways through the same arithmetic. [`ElementStep::run`] takes a block of rays, decides the ordinary
//! cases in vector registers and leaves the others marked; [`ElementStep::run_one`] takes a single ray and
//! decides everything. Both give the same bits.

mod block;

use std::sync::Arc;

use glam::DVec3;

use super::aperture::Opening;
use super::biconic::Biconic;
use super::coordinate_break::CoordinateBreak;
use super::crossings::{ProfileBoundary, Slopes, cross_first};
use super::frame::Frame;
use super::freeform::FreeformSurface;
use super::gradient::medium::GradientPair;
use super::lenslets::Lenslets;
use super::losses::{Filter, Loss};
use super::mirror::{Fold, Shadow};
use super::rays::{Clip, Ray, RayStatus, Traversal};
use super::refract::{IndexPair, RefractedRay};
use super::refraction::Refraction;
use super::thin_lens::at_thin_lens;

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
    /// True if rays take long to be traced through the element: an asphere with a wall.
    pub(crate) fn has_wall(&self) -> bool {
        matches!(&self.action, Action::Asphere(refraction) if refraction.surface.has_wall())
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
