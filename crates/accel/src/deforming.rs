//! A mesh that changes its shape while the shutter is open, in its own frame: one tree whose boxes have a place for each step
//! of the shape, and go in straight lines from one to the next as the corners do.
//!
//! A box at a time holds all its triangles at that time, for a mean of two boxes with the same weights holds the mean of what
//! they hold (Christensen et al., "A ray tracing hardware architecture for dynamic scenes", 2006; Embree's motion blur has the same).
//! The boxes only tell which triangles are looked at: each is solved in f64 with its corners at the ray's time, by the
//! exact test of all backends. Neighbours get the same corners, so that a closed mesh has no gaps at any time.

#![forbid(unsafe_code)]

use std::fmt;
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

use etendue_geometry::glam::Vec3;
use etendue_geometry::{Bounds, Geometry, HitBatch, Mesh, Moment, RayBatch, Steps, Transform};
use rayon::prelude::*;

use crate::exact::{NodeBox, Slabs, WaitingNode, descend};
use crate::nearest::{Nearest, PlacementView, Query, Triangle};
use crate::parts::{LocalRay, outward};
use crate::tree::{BinaryNode, LeafSize, MAX_DEPTH, Ref, Tree};
use crate::watertight::Hit;
use crate::{Accel, BuildError, BuildOptions, BuildReport, BuildWatch, Quality};

const LEAF: LeafSize = LeafSize { most: 4, block: 1 };

/// The structure of one mesh with steps.
pub(crate) struct DeformingMesh {
    geometry: Arc<Geometry>,
    steps: Arc<Steps>,
    nodes: Vec<BinaryNode>,
    /// Triangles in leaf order.
    triangles: Vec<u32>,
    /// Of each step the box of each node.
    boxes: Vec<Vec<[[f32; 3]; 2]>>,
    time: Duration,
}

impl DeformingMesh {
    /// The structure of a mesh with these steps.
    ///
    /// # Errors
    ///
    /// [`BuildError::MemoryLimit`] before boxes are made, and [`BuildError::Stopped`].
    pub(crate) fn build(
        mesh: &Mesh,
        steps: &Arc<Steps>,
        options: &BuildOptions,
    ) -> Result<Self, BuildError> {
        let start = Instant::now();
        let count = mesh.triangles.len();
        let watch = BuildWatch::new(options, count as u64);
        // The tree is that of the shape in the middle.
        let times = steps.times();
        let middle = 0.5 * (times[0] + times[times.len() - 1]);
        let refs = (0..count).into_par_iter().with_min_len(1 << 12).map(|i| {
            let (lo, hi) = outward(mesh.corners_at(i, middle));
            let number = u32::try_from(i).unwrap_or(u32::MAX);
            Ref { lo, first: number, hi, second: number }
        });
        let Tree { nodes, refs } = Tree::build(refs.collect(), LEAF, &watch)?;
        let triangles: Vec<u32> = refs.into_iter().map(|r| r.first).collect();
        let bytes = (times.len() * nodes.len() * size_of::<[[f32; 3]; 2]>()) as u64;
        if let Some(limit) = options.memory_limit.filter(|limit| bytes > *limit) {
            return Err(BuildError::MemoryLimit { backend: "deforming", limit });
        }
        let boxes = times.par_iter().map(|&time| boxes(mesh, &nodes, &triangles, time)).collect();
        let geometry = Arc::new(Geometry::alone(mesh.clone(), Transform::IDENTITY));
        let steps = Arc::clone(steps);
        Ok(Self { geometry, steps, nodes, triangles, boxes, time: start.elapsed() })
    }

    fn bytes(&self) -> usize {
        let boxes: usize = self.boxes.iter().map(|boxes| size_of_val(&boxes[..])).sum();
        boxes + size_of_val(&self.nodes[..]) + size_of_val(&self.triangles[..])
    }

    /// The box of a node at a moment.
    #[inline]
    fn bounds(&self, node: usize, Moment { step, next, share }: Moment) -> Bounds {
        let corners =
            |step: usize| self.boxes[step][node].map(|corner| Vec3::from_array(corner).as_dvec3());
        let ([a, b], [c, d]) = (corners(step), corners(next));
        Bounds { min: a + (c - a) * share, max: b + (d - b) * share }
    }

    /// Shows triangles near the ray to `see`, which answers how far it still looks; `None` ends it.
    fn visit(
        &self,
        query: &Query,
        moment: Moment,
        stack: &mut Vec<WaitingNode>,
        see: &mut impl FnMut(&Triangle) -> Option<f64>,
    ) {
        let all = self.steps.bounds();
        let size = all.min.abs().max(all.max.abs()).max(query.origin.abs()).max_element();
        // Corners and boxes round three times each on their ways between steps.
        let pad = 16.0 * f64::EPSILON * size;
        let ray = LocalRay { origin: query.origin, direction: query.direction, pad };
        let slabs = Slabs::new(&ray, query.t_min);
        let mut t_max = query.t_max;
        let mesh = &self.geometry.meshes[0];
        let node = |i: usize| NodeBox { node: &self.nodes[i], bounds: self.bounds(i, moment) };
        let leaf = |range: Range<usize>, t_max: &mut f64| {
            self.triangles[range].iter().all(|&number| {
                let corner = |corner: u32| self.steps.corner(moment, corner as usize);
                let corners = mesh.triangles[number as usize].map(corner);
                let limit = see(&Triangle { placement: 0, number, corners });
                *t_max = limit.unwrap_or(*t_max);
                limit.is_some()
            })
        };
        if !self.nodes.is_empty() {
            descend(&slabs, &mut t_max, stack, node, leaf);
        }
    }
}

/// The boxes of all nodes at a step.
fn boxes(mesh: &Mesh, nodes: &[BinaryNode], triangles: &[u32], time: f64) -> Vec<[[f32; 3]; 2]> {
    let mut boxes = vec![[[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]]; nodes.len()];
    // Children stand after their parents.
    for i in (0..nodes.len()).rev() {
        boxes[i] = match nodes[i].leaf() {
            Some(range) => {
                let corners =
                    triangles[range].iter().flat_map(|&t| mesh.corners_at(t as usize, time));
                let Bounds { min, max } = Bounds::of_points(corners);
                let (lo, hi) = outward([min, max]);
                [lo, hi]
            }
            None => {
                let [[a, b], [c, d]] = [boxes[i + 1], boxes[i + nodes[i].right()]];
                let lower = |k: usize| a[k].min(c[k]);
                let upper = |k: usize| b[k].max(d[k]);
                [std::array::from_fn(lower), std::array::from_fn(upper)]
            }
        };
    }
    boxes
}

/// Intersects the ray with a triangle.
fn test(query: &Query, triangle: &Triangle) -> Option<Hit> {
    query.test(&PlacementView::new(&Transform::IDENTITY), triangle.corners)
}

impl Accel for DeformingMesh {
    fn closest(&self, rays: &RayBatch, hits: &mut HitBatch) {
        hits.reset(rays.len());
        let mut stack = Vec::with_capacity(MAX_DEPTH);
        for i in 0..rays.len() {
            let Some(query) = Query::of(rays, i) else { continue };
            let mut nearest = Nearest::none(query.t_max);
            self.visit(&query, self.steps.moment(rays.time(i)), &mut stack, &mut |triangle| {
                if let Some(hit) = test(&query, triangle) {
                    nearest.offer(hit, triangle);
                }
                Some(nearest.t)
            });
            nearest.write(&self.geometry, hits, i);
        }
    }

    fn occluded(&self, rays: &RayBatch, blocked: &mut Vec<bool>) {
        blocked.clear();
        let mut stack = Vec::with_capacity(MAX_DEPTH);
        blocked.extend((0..rays.len()).map(|i| {
            let Some(query) = Query::of(rays, i) else { return false };
            let mut found = false;
            self.visit(&query, self.steps.moment(rays.time(i)), &mut stack, &mut |triangle| {
                found = test(&query, triangle).is_some();
                (!found).then_some(query.t_max)
            });
            found
        }));
    }

    fn report(&self) -> BuildReport {
        BuildReport {
            backend: format!("deforming, {} steps", self.steps.times().len()),
            quality: Quality::Medium,
            time: self.time,
            bytes: self.bytes() as u64,
            copied_bytes: 0,
        }
    }
}

impl fmt::Debug for DeformingMesh {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("DeformingMesh")
            .field("nodes", &self.nodes.len())
            .field("steps", &self.steps.times().len())
            .finish_non_exhaustive()
    }
}
