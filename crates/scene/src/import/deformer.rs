//! The shape of a mesh at any time: morph targets by their weights, then the joints of a skin (glTF 2.0, sections 3.7.2.2
//! and 3.7.3.1); and the steps between which straight lines are near enough to it.

use std::sync::{Arc, Mutex, PoisonError};

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Between, Link, Steps, Track, Transform, Vertices};
use etendue_report::Refusal;
use rayon::prelude::*;

use super::precision::single;

/// Deformation of a mesh over time, in s from the moment that is shown.
#[derive(Debug)]
pub struct Deformer {
    /// As the file has them (m).
    pub(super) points: Vec<DVec3>,
    pub(super) normals: Option<Vec<DVec3>>,
    pub(super) morphs: Vec<Morph>,
    pub(super) skin: Option<(Joints, Influences)>,
    /// The last steps, and what they were made for.
    pub(super) kept: Mutex<Option<(Vec<u64>, Arc<Steps>)>>,
}

/// A morph target.
#[derive(Debug)]
pub(super) struct Morph {
    /// The first number is its weight.
    pub weight: Track,
    /// Offsets of the points at weight 1 (m).
    pub points: Option<Vertices<3>>,
    pub normals: Option<Vertices<3>>,
}

/// Links that carry the vertices of a mesh from where they were bound to where the joints of a skin are, by joint: from
/// the mesh's frame to the model's, the outermost frame first; one at least each.
#[derive(Debug, Clone)]
pub(super) struct Joints(pub Vec<Vec<Link>>);

impl Joints {
    /// The joint matrices at a time (s).
    pub(super) fn at(&self, time: f64) -> Vec<Transform> {
        let of = |links: &Vec<Link>| {
            let inner = links.last().map_or(Transform::IDENTITY, |link| link.at(time));
            let outer = links.iter().rev().skip(1);
            outer.fold(inner, |inner, link| link.at(time).then_inner(&inner))
        };
        self.0.iter().map(of).collect()
    }
}

/// The numbers and weights of the joints that carry each vertex, four a set.
#[derive(Debug)]
pub(super) struct Influences {
    pub sets: Vec<[Vertices<4>; 2]>,
}

impl Influences {
    /// The joints of vertex `i` that weigh something, with their weights.
    pub(super) fn of(&self, i: usize) -> impl Iterator<Item = (f32, f64)> {
        let set = move |[joints, weights]: &[Vertices<4>; 2]| {
            let (joints, weights) = (joints.get(i), weights.get(i));
            std::array::from_fn::<_, 4, _>(|k| (joints[k], f64::from(weights[k])))
        };
        self.sets.iter().flat_map(set).filter(|&(_, weight)| weight != 0.0)
    }

    /// The sum of the weights of vertex `i`.
    pub(super) fn total(&self, i: usize) -> f64 {
        self.of(i).map(|(_, weight)| weight).sum()
    }

    /// The mean of the joint matrices of vertex `i` by their weights: linear blend skinning.
    fn blend(&self, joints: &[Transform], i: usize) -> Transform {
        let total = self.total(i);
        if total == 0.0 {
            return joints[0];
        }
        let (mut linear, mut translation) = (DMat3::ZERO, DVec3::ZERO);
        for (joint, weight) in self.of(i) {
            if let Some(joint) = number(joint, joints.len()) {
                let joint = &joints[joint];
                linear += joint.linear * (weight / total);
                translation += joint.offset_from(DVec3::ZERO) * (weight / total);
            }
        }
        Transform::new(linear, translation)
    }

    /// Moves all vertices, and turns their normals.
    fn apply(&self, joints: &[Transform], points: &mut [DVec3], normals: Option<&mut [DVec3]>) {
        points.par_iter_mut().enumerate().for_each(|(i, point)| {
            *point = self.blend(joints, i).point(*point);
        });
        if let Some(normals) = normals {
            normals.par_iter_mut().enumerate().for_each(|(i, normal)| {
                *normal = self.blend(joints, i).normal_matrix() * *normal;
            });
        }
    }
}

/// The number of a joint that is one of `count`.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 65 535")]
pub(super) fn number(joint: f32, count: usize) -> Option<usize> {
    (joint >= 0.0 && joint < count as f32).then_some(joint as usize)
}

/// Points (m) and normals of any length, of all vertices: straight lines of weights are straight lines of both.
pub(super) type Shape = (Vec<DVec3>, Option<Vec<DVec3>>);

/// Tolerance of a shape's distance from the straight line between two steps (m, in the mesh's frame), at a point.
pub(crate) type Tolerance<'a> = &'a (dyn Fn(DVec3) -> f64 + Sync);

/// Shares of the way between two steps at which the straight line is compared. The cubic whose middle is on it is farthest
/// from it at 0.21 and 0.79.
const LOOKED_AT: [f64; 3] = [0.25, 0.5, 0.75];

/// Share of the tolerance that is used up where it is looked at; between those places a cubic is at
/// most 1.03 times as far.
const USED: f64 = 0.95;

/// Error of a deformation without steps.
#[derive(Debug)]
pub(crate) enum NoSteps<E> {
    /// There is no room for them.
    Room(E),
    /// A shape is not finite.
    Broken(Refusal),
}

impl Deformer {
    /// Points and normals at a time (s).
    pub(super) fn shape(&self, time: f64) -> Shape {
        let mut points = self.points.clone();
        let mut normals = self.normals.clone();
        for Morph { weight, points: moved, normals: turned } in &self.morphs {
            let weight = weight.at(time).x;
            if weight == 0.0 {
                continue;
            }
            add(&mut points, weight, moved.as_ref());
            if let Some(normals) = &mut normals {
                add(normals, weight, turned.as_ref());
            }
        }
        if let Some((joints, influences)) = &self.skin {
            influences.apply(&joints.at(time), &mut points, normals.as_deref_mut());
        }
        (points, normals)
    }

    /// The tracks that change something.
    fn tracks(&self) -> impl Iterator<Item = &Track> {
        let joints = self.skin.iter().flat_map(|(joints, _)| joints.0.iter().flatten());
        self.morphs.iter().map(|morph| &morph.weight).chain(joints.flat_map(Link::tracks))
    }

    /// True if the shape changes between two times (s).
    pub(crate) fn moves_within(&self, span: [f64; 2]) -> bool {
        span[0] < span[1] && self.tracks().any(|track| track.moves_within(span))
    }

    /// From when until when there are keys (s), where there are any.
    pub(crate) fn played_span(&self) -> Option<[f64; 2]> {
        let times = || {
            let tracks = self.tracks().filter(|track| track.times.len() > 1);
            tracks.flat_map(|track| track.times.iter().copied())
        };
        Some([times().reduce(f64::min)?, times().reduce(f64::max)?])
    }

    /// Bytes of one step.
    pub(crate) fn step_bytes(&self) -> u64 {
        let corner = size_of::<[f64; 3]>();
        let normal = if self.normals.is_some() { size_of::<[f32; 3]>() } else { 0 };
        (self.points.len() * (corner + normal)) as u64
    }

    /// Steps of the mesh of these `triangles` between the times of `span` (s), between which no point is farther from the
    /// straight line than `tolerance` says: all keys of tracks are steps, and between them the way is divided until it holds.
    /// Each step takes room by `take`. The last steps that were made for the same `key` are those.
    pub(crate) fn steps<E>(
        &self,
        triangles: &[[u32; 3]],
        span: [f64; 2],
        key: Vec<u64>,
        tolerance: Tolerance<'_>,
        take: &mut dyn FnMut(u64) -> Result<(), E>,
    ) -> Result<Arc<Steps>, NoSteps<E>> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((known, steps)) = &*kept
            && *known == key
        {
            return Ok(Arc::clone(steps));
        }
        let mut way = DeformationSteps { deformer: self, tolerance, take, steps: Vec::new() };
        let marks = self.marks(span);
        way.add(marks[0], self.shape(marks[0])).map_err(NoSteps::Room)?;
        for pair in marks.windows(2) {
            way.go([pair[0], pair[1]]).map_err(NoSteps::Room)?;
        }
        let (mut times, mut corners, mut normals) = (Vec::new(), Vec::new(), Vec::new());
        for (time, (points, directions)) in way.steps {
            times.push(time);
            corners.push(points.into_iter().map(|point| point.to_array()).collect());
            let narrow = |normal: DVec3| normal.to_array().map(single);
            let directions = directions.map(|all| all.into_iter().map(narrow).collect::<Vec<_>>());
            normals.extend(directions.map(|all| Vertices::from_arrays(&all)));
        }
        let steps = Steps::new(times, corners, normals, triangles).map_err(NoSteps::Broken)?;
        let steps = Arc::new(steps);
        *kept = Some((key, Arc::clone(&steps)));
        Ok(steps)
    }

    /// The ends of `span` and the keys between them; before a key at which something leaps, the time just before it, too.
    fn marks(&self, [open, close]: [f64; 2]) -> Vec<f64> {
        let mut marks = vec![open, close];
        for track in self.tracks() {
            let keys = track.times.iter().filter(|&&key| open < key && key < close);
            for &key in keys {
                marks.push(key);
                if track.between == Between::Step {
                    marks.push(key.next_down().max(open));
                }
            }
        }
        marks.sort_unstable_by(f64::total_cmp);
        marks.dedup();
        marks
    }
}

fn add(values: &mut [DVec3], weight: f64, moves: Option<&Vertices<3>>) {
    let Some(moves) = moves else { return };
    values.par_iter_mut().enumerate().for_each(|(i, value)| {
        *value += weight * DVec3::from(moves.get(i).map(f64::from));
    });
}

/// Steps on their way through an exposure.
struct DeformationSteps<'a, E> {
    deformer: &'a Deformer,
    tolerance: Tolerance<'a>,
    take: &'a mut dyn FnMut(u64) -> Result<(), E>,
    steps: Vec<(f64, Shape)>,
}

impl<E> DeformationSteps<'_, E> {
    fn add(&mut self, time: f64, shape: Shape) -> Result<(), E> {
        (self.take)(self.deformer.step_bytes())?;
        self.steps.push((time, shape));
        Ok(())
    }

    /// Goes on from the last step, which is at `from`, until `to`.
    fn go(&mut self, [from, to]: [f64; 2]) -> Result<(), E> {
        let end = self.deformer.shape(to);
        let start = self.steps.last().map_or(&end.0, |(_, shape)| &shape.0);
        let mut worst = 0.0_f64;
        for share in LOOKED_AT {
            let (points, _) = self.deformer.shape(from + (to - from) * share);
            worst = worst.max(self.distance([start, &points, &end.0], share));
        }
        // A chord's distance falls with the square of its length.
        let parts = (worst / USED).sqrt().ceil();
        let length = (to - from) / parts;
        let is_least = from + length <= from || to - length >= to;
        if worst <= USED || is_least {
            return self.add(to, end);
        }
        let parts = parts.clamp(2.0, MOST_PARTS);
        let mut before = from;
        let mut part = 1.0;
        while before < to {
            let next = if part >= parts { to } else { from + (to - from) * (part / parts) };
            if next > before {
                self.go([before, next])?;
            }
            (before, part) = (next, part + 1.0);
        }
        Ok(())
    }

    /// Greatest distance of points from the straight lines between two shapes, at a share of the
    /// way, over what is allowed.
    fn distance(&self, [start, points, end]: [&Vec<DVec3>; 3], share: f64) -> f64 {
        let of = |i: usize| {
            let straight = start[i].lerp(end[i], share);
            straight.distance(points[i]) / (self.tolerance)(straight)
        };
        // Not finite are corners that no triangle has.
        (0..points.len())
            .into_par_iter()
            .map(of)
            .filter(|far| far.is_finite())
            .reduce(|| 0.0, f64::max)
    }
}

/// Parts of a way that are looked at before they are divided again.
const MOST_PARTS: f64 = 64.0;
