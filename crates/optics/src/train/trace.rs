//! Rays through a lens at one wavelength.

mod within;

use std::sync::Arc;

use etendue_spectrum::Curve;
use glam::DVec3;
use multiversion::multiversion;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::OpticalTrain;
use super::folds::Obstruction;
use crate::element::gradient::medium::{GradedMedium, GradientPair};
use crate::element::{
    Action, Block, Clip, ElementStep, Fold, Frame, LensRays, Loss, Ray, RayStatus,
};
use crate::glass::GlassError;

pub use within::RimTrace;

/// More elements than these make a train long: the largest zoom lenses have some fifty surfaces.
const LONG: f64 = 64.0;

/// Time of a ray from the element before to this one, in elements: a step in a graded medium looks at the index
/// thrice and at the surface, which counts as two.
fn cost(step: &ElementStep) -> f64 {
    let graded = step.graded.as_ref().and_then(|graded| graded.media[0].as_ref());
    1.0 + graded.map_or(0.0, |medium| 2.0 * medium.steps())
}

/// Side from which rays come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// From the object towards the sensor: elements in their order.
    Object,
    /// From the sensor towards the object: the last element first.
    Sensor,
}

/// A lens at one wavelength.
#[derive(Debug, Clone)]
pub struct MonochromaticTrain {
    wavelength: f64,
    indices: Indices,
    forward: Vec<ElementStep>,
    backward: Vec<ElementStep>,
    /// Time of a ray, in elements.
    cost_of_a_ray: f64,
    /// True if rays take long to be traced through the train.
    is_costly: bool,
}

/// One ray's way through a lens.
#[derive(Debug, Clone, PartialEq)]
pub struct RayPath {
    /// Outcome of the ray.
    pub status: RayStatus,
    /// Points where the ray met each element that it reached (mm), in the order in which it met
    /// them. The last one is that at which it was vignetted or totally reflected, if it was.
    pub points: Vec<DVec3>,
    /// Its direction behind the last element; `None` unless it left.
    pub direction: Option<DVec3>,
    /// The share of light that is left by apertures, filters and, where they are asked for, losses.
    pub throughput: f64,
}

impl OpticalTrain {
    /// The lens at `wavelength` (nm).
    ///
    /// # Errors
    ///
    /// When a glass has no index there. Being outside of a glass' stated range is no error here;
    /// see [`Self::outside_of_range`].
    pub fn at(&self, wavelength: f64) -> Result<MonochromaticTrain, GlassError> {
        self.at_with(wavelength, &|curve| curve.held(wavelength))
    }

    /// As [`Self::at`], with filters that pass what `transmission` makes of their curves.
    ///
    /// # Errors
    ///
    /// When a glass has no index there.
    pub fn at_with(
        &self,
        wavelength: f64,
        transmission: &dyn Fn(&Curve) -> f64,
    ) -> Result<MonochromaticTrain, GlassError> {
        let indices = self.indices(wavelength)?;
        let (mut forward, mut backward) = (Vec::new(), Vec::new());
        let obstructions = self.obstructions();
        for (element, placed) in self.elements.iter().enumerate() {
            shade(&obstructions[element], [&mut forward, &mut backward]);
            let [before, behind] = [indices[element], indices[element + 1]];
            let [towards_sensor, towards_object] =
                placed.part.actions(before, behind, wavelength, transmission);
            let absorption = |medium: usize| self.media[medium].absorption(wavelength);
            let coating = placed.part.mirror().and_then(|mirror| mirror.coating.as_ref());
            let loss = |indices: [f64; 2], medium| {
                let loss = Loss::new(&self.losses, indices, absorption(medium), wavelength);
                match coating {
                    Some(coating) => Some(Loss::of_mirror(loss, coating, indices[0], wavelength)),
                    None => loss,
                }
            };
            let fold = placed.part.mirror().map(|mirror| {
                let reflectance = mirror.reflectance.as_ref().map_or(1.0, transmission);
                Fold::new(mirror, &placed.frame, reflectance)
            });
            let add = |steps: &mut Vec<ElementStep>,
                       action: Action,
                       loss: Option<Loss>,
                       fold,
                       frame: Frame| {
                // Sheets do not move rays: what absorbs before one is counted at the next surface.
                let loss = loss.filter(|_| action.moves());
                let graded = None;
                steps.push(ElementStep {
                    element,
                    frame,
                    axial: frame.is_axial(),
                    action,
                    loss,
                    fold,
                    graded,
                });
            };
            add(&mut forward, towards_sensor, loss([before, behind], element), fold, placed.frame);
            let (frame, fold) = match fold.map(|fold| fold.seen_from_behind(&placed.frame)) {
                Some((frame, fold)) => (frame, Some(fold)),
                None => (placed.frame, None),
            };
            add(&mut backward, towards_object, loss([behind, before], element + 1), fold, frame);
        }
        shade(&obstructions[self.elements.len()], [&mut forward, &mut backward]);
        for (steps, from) in [(&mut forward, Side::Object), (&mut backward, Side::Sensor)] {
            self.grade(&indices, steps, from);
        }
        backward.reverse();
        let cost_of_a_ray = forward.iter().map(cost).sum();
        let is_costly = cost_of_a_ray > LONG || forward.iter().any(ElementStep::has_wall);
        Ok(MonochromaticTrain { wavelength, indices, forward, backward, cost_of_a_ray, is_costly })
    }

    /// Gives steps the gradients on their sides.
    fn grade(&self, indices: &Indices, steps: &mut [ElementStep], from: Side) {
        if !self.is_graded() {
            return;
        }
        for step in steps.iter_mut().filter(|step| !step.is_shadow()) {
            let element = step.element;
            let medium = |index: usize| {
                let gap = self.gradients[index].clone()?;
                let before = index.checked_sub(1)?;
                let z = |i: usize| self.elements.get(i).map(|element| element.frame.vertex.z);
                let length = z(index)? - z(before)?;
                Some(GradedMedium {
                    gap,
                    z: z(before)?,
                    base: indices[index],
                    element: before,
                    length,
                })
            };
            let mut media = [medium(element), medium(element + 1)];
            let mut of = [indices[element], indices[element + 1]];
            if from == Side::Sensor {
                media.reverse();
                of.reverse();
            }
            if media.iter().any(Option::is_some) {
                let part = self.elements[element].part.clone();
                let loss = step.loss.take();
                step.graded = Some(Arc::new(GradientPair { media, indices: of, part, loss }));
            }
        }
    }

    /// True if the index of a medium varies in space.
    #[must_use]
    pub fn is_graded(&self) -> bool {
        self.gradients.iter().any(Option::is_some)
    }

    /// The index of each medium at `wavelength` (nm), from the object's to the sensor's.
    pub(crate) fn indices(&self, wavelength: f64) -> Result<Indices, GlassError> {
        let of =
            self.media.iter().map(|glass| glass.index(wavelength)).collect::<Result<_, _>>()?;
        Ok(Indices { wavelength, of })
    }
}

/// The index of each medium of a train at a wavelength.
#[derive(Debug, Clone)]
pub(crate) struct Indices {
    /// In nm.
    pub(crate) wavelength: f64,
    /// From the object's medium to the sensor's.
    pub(crate) of: Vec<f64>,
}

impl std::ops::Deref for Indices {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.of
    }
}

/// Adds the mirrors in the way of a leg.
fn shade(obstructions: &[Obstruction], steps: [&mut Vec<ElementStep>; 2]) {
    for steps in steps {
        steps.extend(obstructions.iter().map(|obstruction| ElementStep {
            element: obstruction.element,
            frame: obstruction.frame,
            axial: obstruction.frame.is_axial(),
            action: Action::Shadow(obstruction.shadow),
            loss: None,
            fold: None,
            graded: None,
        }));
    }
}

impl MonochromaticTrain {
    /// The wavelength (nm).
    #[must_use]
    pub fn wavelength(&self) -> f64 {
        self.wavelength
    }

    /// True if rays take long to be traced through the train: it has more elements than lenses have
    /// that somebody built, a surface as steep as none has, or a medium through which rays are
    /// followed in many steps.
    pub(crate) fn is_costly(&self) -> bool {
        self.is_costly
    }

    /// Cost of tracing a ray, in elements.
    pub(crate) fn cost_of_a_ray(&self) -> f64 {
        self.cost_of_a_ray
    }

    /// The index of the medium between the last element and the sensor.
    #[must_use]
    pub fn index_before_sensor(&self) -> f64 {
        self.indices[self.indices.len() - 1]
    }

    /// The index of the medium behind element `i`.
    pub(crate) fn index_behind(&self, i: usize) -> f64 {
        self.indices[i + 1]
    }

    /// The index of the medium before element `i`.
    pub(crate) fn index_before(&self, i: usize) -> f64 {
        self.indices[i]
    }

    /// The elements as light from the object meets them.
    pub(crate) fn forward_steps(&self) -> &[ElementStep] {
        &self.forward
    }

    pub(super) fn steps(&self, from: Side) -> &[ElementStep] {
        match from {
            Side::Object => &self.forward,
            Side::Sensor => &self.backward,
        }
    }

    /// Takes a batch through the lens: positions end on the last refracting element, directions are
    /// those behind it, throughputs are multiplied by what apertures and filters pass, and statuses say
    /// who left. Rays that ended already stay as they are.
    ///
    /// The same ray gives the same bits in any batch, and on any processor: the arithmetic is
    /// without fused operations, whatever the width of the registers.
    pub fn trace(&self, from: Side, clip: Clip, rays: &mut LensRays) {
        trace_blocks(&mut rays.blocks, self.steps(from), clip);
    }

    /// As [`Self::trace`] on registers of a stated width, to measure what width gains; a width that
    /// the processor lacks is replaced by the widest that it has.
    pub fn trace_on(&self, registers: Registers, from: Side, clip: Clip, rays: &mut LensRays) {
        let (blocks, steps) = (&mut rays.blocks, self.steps(from));
        match registers {
            Registers::Widest => trace_blocks(blocks, steps, clip),
            Registers::FourLanes => trace_blocks_of_four(blocks, steps, clip),
            Registers::Baseline => all_blocks(blocks, steps, clip),
        }
    }

    /// As [`Self::trace`], ray by ray through the single-ray code: the yardstick for what batches
    /// gain, and the check that they change nothing.
    pub fn trace_singly(&self, from: Side, clip: Clip, rays: &mut LensRays) {
        for block in &mut rays.blocks {
            for lane in 0..block.outcome.len() {
                if block.outcome[lane] == RayStatus::Exited.code() {
                    let end = self.run(from, clip, block.ray(lane));
                    block.set_ray(lane, end.ray);
                    block.throughput[lane] *= end.throughput;
                    block.outcome[lane] = end.status.code();
                }
            }
        }
    }

    /// One ray's way, point by point.
    #[must_use]
    pub fn path(&self, from: Side, clip: Clip, position: DVec3, direction: DVec3) -> RayPath {
        let mut path = RayPath {
            status: RayStatus::Missed { element: 0 },
            points: Vec::new(),
            direction: None,
            throughput: 1.0,
        };
        let Some(mut ray) = Ray::new(position, direction) else { return path };
        for step in self.steps(from) {
            let traversal = step.run_one(ray, clip);
            path.points.extend(traversal.point.map(DVec3::from));
            path.throughput *= traversal.transmission;
            path.status = traversal.status;
            ray = traversal.ray;
            if traversal.status != RayStatus::Exited {
                return path;
            }
        }
        path.status = RayStatus::Exited;
        path.direction = Some(ray.direction.into());
        path
    }

    /// Places (mm) of a ray's way from the object through the gradient before each element; none where there is none.
    pub(crate) fn ways_through_gradients(
        &self,
        position: DVec3,
        direction: DVec3,
    ) -> Vec<Vec<DVec3>> {
        /// Enough for a curve of a few pitches.
        const PLACES: u32 = 48;
        let Some(mut ray) = Ray::new(position, direction) else { return Vec::new() };
        let steps = self.forward.iter().filter(|step| !step.is_shadow());
        let mut way = |step: &ElementStep| {
            let places = step.graded_way(ray, PLACES);
            ray = step.run_one(ray, Clip::Off).ray;
            places
        };
        steps.map(&mut way).collect()
    }

    /// One ray to its end.
    #[inline]
    pub fn run(&self, from: Side, clip: Clip, ray: Ray) -> End {
        let mut end = End { status: RayStatus::Exited, ray, throughput: 1.0 };
        for step in self.steps(from) {
            let traversal = step.run_one(end.ray, clip);
            end.throughput *= traversal.transmission;
            end.status = traversal.status;
            end.ray = traversal.ray;
            if traversal.status != RayStatus::Exited {
                if let (RayStatus::Vignetted { .. }, Some(point)) =
                    (traversal.status, traversal.point)
                    && step.moves()
                {
                    end.ray.position = point;
                }
                break;
            }
        }
        end
    }

    /// Point where a ray crosses an element, in the element's own frame and without any clipping;
    /// `None` when it does not get there.
    pub(crate) fn crossing(&self, from: Side, element: usize, mut ray: Ray) -> Option<[f64; 2]> {
        for step in self.steps(from) {
            let traversal = step.run_one(ray, Clip::Off);
            if step.element == element && !step.is_shadow() {
                let local = step.frame.rotation.transpose()
                    * (DVec3::from(traversal.point?) - step.frame.vertex);
                return Some([local.x, local.y]);
            }
            if traversal.status != RayStatus::Exited {
                return None;
            }
            ray = traversal.ray;
        }
        None
    }
}

/// A single ray at its end.
#[derive(Debug, Clone, Copy)]
pub struct End {
    /// Outcome: where and how the ray ended.
    pub status: RayStatus,
    /// The ray as it leaves, or where it ended (mm).
    pub ray: Ray,
    /// Share of the ray's light that apertures and filters pass.
    pub throughput: f64,
}

/// Vector registers to trace with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Registers {
    /// The widest that the processor has, found at run time.
    #[default]
    Widest,
    /// Four lanes of f64 (AVX2).
    FourLanes,
    /// Registers that the program was compiled for, without a look at the processor.
    Baseline,
}

// Widest first: the first set that the processor has is taken, at run time.
#[multiversion(targets = "simd")]
fn trace_blocks(blocks: &mut [Block], steps: &[ElementStep], clip: Clip) {
    all_blocks(blocks, steps, clip);
}

#[multiversion(targets("x86_64+avx2"))]
fn trace_blocks_of_four(blocks: &mut [Block], steps: &[ElementStep], clip: Clip) {
    all_blocks(blocks, steps, clip);
}

/// Elements between looks at whether any ray of a block is still on its way.
const STEPS_BETWEEN_LOOKS: usize = 8;

#[inline(always)]
fn all_blocks(blocks: &mut [Block], steps: &[ElementStep], clip: Clip) {
    for block in blocks {
        for some in steps.chunks(STEPS_BETWEEN_LOOKS) {
            if block.is_over() {
                break;
            }
            for step in some {
                step.run(block, clip);
            }
        }
    }
}
