//! The reference backend: f64 throughout, hits decided by exact signs. Slow and right; every other
//! backend is measured against it.
//!
//! Two levels of binary trees: one a mesh, in the mesh's frame, and one over the placements. The
//! trees only ever narrow down which triangles are looked at; their boxes are f64, and every ray
//! widens them by what rounding may have moved it, so that a triangle which
//! [`watertight::intersect`](crate::watertight::intersect) would hit is always looked at. The
//! answer is the same as without trees, to the bit.

#![forbid(unsafe_code)]

use std::fmt;
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Coplanar, Geometry, HitBatch, MISS, RayBatch};
use rayon::prelude::*;

use crate::nearest::{Nearest, PlacementView, Query, Triangle, settle};
use crate::parts::{Baking, Blas, Layout, LocalRay, PartInstance, outward};
use crate::tree::{BinaryNode, LeafSize, MAX_DEPTH, Ref, Tree};
use crate::{Accel, BuildError, BuildOptions, BuildReport, BuildWatch, Quality, with_threads};

/// The exact f64 backend.
pub struct Exact {
    geometry: Arc<Geometry>,
    layout: Layout,
    parts: Vec<Boxes>,
    top: Boxes,
    coplanar: Coplanar,
    time: Duration,
}

/// A tree with f64 boxes.
#[derive(Debug, Default)]
pub(crate) struct Boxes {
    nodes: Vec<ExactNode>,
    /// In leaf order: placement and triangle, or a number of an instance twice.
    items: Vec<[u32; 2]>,
}

/// A node of [`Tree`] with its box in f64.
#[derive(Debug)]
struct ExactNode {
    bounds: Bounds,
    node: BinaryNode,
}

const LEAF: LeafSize = LeafSize { most: 4, block: 1 };

/// Bytes a triangle at the height of a build: refs twice, nodes (at most one and a half with this
/// leaf size), items.
const BYTES_PER_TRIANGLE: u64 = 2 * size_of::<Ref>() as u64
    + 3 * (size_of::<ExactNode>() + size_of::<BinaryNode>()) as u64 / 2
    + size_of::<[u32; 2]>() as u64;
const BYTES_PER_INSTANCE: u64 = BYTES_PER_TRIANGLE + size_of::<PartInstance>() as u64;

impl Exact {
    /// Builds the trees over `geometry`. Of the options, threads, memory limit and progress are
    /// heeded; the others make no difference here.
    ///
    /// # Errors
    ///
    /// [`BuildError::MemoryLimit`], before anything large is allocated; [`BuildError::Scale`] beyond 10¹² m and below
    /// 10⁻¹² m; [`BuildError::TooLarge`] for a mesh of more than 2³¹ triangles; [`BuildError::Stopped`] when the
    /// progress function answered `false`; [`BuildError::Library`] when threads cannot be had.
    pub fn build(geometry: Arc<Geometry>, options: &BuildOptions) -> Result<Self, BuildError> {
        let start = Instant::now();
        let layout = Layout::new(&geometry, Baking::Singular);
        layout.check_size(&geometry, options, "exact", [BYTES_PER_TRIANGLE, BYTES_PER_INSTANCE])?;
        let total = layout.triangles(&geometry) + layout.instances.len() as u64;
        let watch = BuildWatch::new(options, total);
        let (parts, top) = with_threads(options, || {
            let mut parts = Vec::with_capacity(layout.parts.len());
            for part in &layout.parts {
                parts.push(Boxes::over_part(part, &geometry, &watch)?);
            }
            let top = Boxes::over_instances(&layout, &geometry, &parts, &watch)?;
            Ok((parts, top))
        })?;
        let coplanar = Coplanar::of(&geometry);
        Ok(Self { geometry, layout, parts, top, coplanar, time: start.elapsed() })
    }

    /// The closest hit of one ray.
    fn nearest(&self, query: &Query, stack: &mut ExactStack) -> Nearest {
        let mut nearest = Nearest::none(query.t_max);
        self.visit(query, stack, &mut |placement, triangle| {
            let triangle = Triangle::of(&self.geometry, placement, triangle);
            if let Some(hit) = self.test(query, &triangle) {
                nearest.offer(hit, &triangle);
            }
            Some(nearest.t)
        });
        nearest
    }

    fn test(&self, query: &Query, triangle: &Triangle) -> Option<crate::watertight::Hit> {
        let placement = &self.geometry.placements[triangle.placement as usize];
        query.test(&PlacementView::new(&placement.world_from_mesh), triangle.corners)
    }

    /// Shows every triangle near the ray to `see`, roughly from near to far, which answers how far
    /// it still looks, or `None` when it has seen enough.
    fn visit(
        &self,
        query: &Query,
        stack: &mut ExactStack,
        see: &mut impl FnMut(u32, u32) -> Option<f64>,
    ) {
        let world = self.layout.world.ray(query.origin, query.direction);
        let mut t_max = query.t_max;
        let mut enough = false;
        let [outer, inner] = &mut stack.0;
        self.top.visit(&world, query.t_min, &mut t_max, outer, &mut |[i, _], t_max| {
            let instance = &self.layout.instances[i as usize];
            let ray = instance.ray(query.origin, query.direction);
            let part = &self.parts[instance.part as usize];
            part.visit(&ray, query.t_min, t_max, inner, &mut |[placement, triangle], t_max| {
                let placement = if placement == MISS { instance.placement } else { placement };
                match see(placement, triangle) {
                    Some(limit) => *t_max = limit,
                    None => enough = true,
                }
                !enough
            });
            !enough
        });
    }
}

/// Nodes still to visit with the distance at which the ray enters them, one list a level.
#[derive(Default)]
struct ExactStack([Vec<WaitingNode>; 2]);

impl ExactStack {
    fn new() -> Self {
        Self([(); 2].map(|()| Vec::with_capacity(MAX_DEPTH)))
    }
}

impl Accel for Exact {
    fn closest(&self, rays: &RayBatch, hits: &mut HitBatch) {
        hits.reset(rays.len());
        let mut stack = ExactStack::new();
        for i in 0..rays.len() {
            if let Some(query) = Query::of(rays, i) {
                self.nearest(&query, &mut stack).write(&self.geometry, hits, i);
            }
        }
        settle(&self.coplanar, &self.geometry, rays, hits);
    }

    fn occluded(&self, rays: &RayBatch, blocked: &mut Vec<bool>) {
        blocked.clear();
        let mut stack = ExactStack::new();
        blocked.extend((0..rays.len()).map(|i| {
            let Some(query) = Query::of(rays, i) else { return false };
            let mut found = false;
            self.visit(&query, &mut stack, &mut |placement, triangle| {
                let triangle = Triangle::of(&self.geometry, placement, triangle);
                found = self.test(&query, &triangle).is_some();
                (!found).then_some(query.t_max)
            });
            found
        }));
    }

    fn report(&self) -> BuildReport {
        let trees = self.parts.iter().chain([&self.top]);
        let instances = self.layout.instances.capacity() * size_of::<PartInstance>();
        BuildReport {
            backend: "exact f64".to_owned(),
            quality: Quality::Medium,
            time: self.time,
            bytes: (trees.map(Boxes::bytes).sum::<usize>() + instances) as u64,
            copied_bytes: 0,
        }
    }
}

impl fmt::Debug for Exact {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Exact")
            .field("parts", &self.parts.len())
            .field("instances", &self.layout.instances.len())
            .finish_non_exhaustive()
    }
}

impl Boxes {
    fn over_part(
        part: &Blas,
        geometry: &Geometry,
        watch: &BuildWatch<'_>,
    ) -> Result<Self, BuildError> {
        let tree = Tree::build(part.refs(geometry), LEAF, watch)?;
        Ok(Self::refitted(tree, |[placement, triangle]| {
            let mut bounds = Bounds::EMPTY;
            part.corners(geometry, placement, triangle).into_iter().for_each(|p| bounds.include(p));
            bounds
        }))
    }

    fn over_instances(
        layout: &Layout,
        geometry: &Geometry,
        parts: &[Self],
        watch: &BuildWatch<'_>,
    ) -> Result<Self, BuildError> {
        let bounds = |i: u32| {
            let instance = &layout.instances[i as usize];
            let local = parts[instance.part as usize].bounds();
            layout.bounds_of(instance, geometry, local)
        };
        let count = u32::try_from(layout.instances.len()).unwrap_or(u32::MAX);
        let refs = (0..count).into_par_iter().map(|i| {
            let bounds = bounds(i);
            let (lo, hi) = outward([bounds.min, bounds.max]);
            Ref { lo, first: i, hi, second: i }
        });
        let tree = Tree::build(refs.collect(), LEAF, watch)?;
        Ok(Self::refitted(tree, |[i, _]| bounds(i)))
    }

    /// Builds the boxes of a tree from the leaves up.
    pub(crate) fn refitted(tree: Tree, bounds: impl Fn([u32; 2]) -> Bounds + Sync) -> Self {
        let items: Vec<[u32; 2]> = tree.refs.par_iter().map(|r| [r.first, r.second]).collect();
        drop(tree.refs);
        let leaf = |node: &BinaryNode| {
            let range = node.leaf().unwrap_or(0..0);
            items[range].iter().fold(Bounds::EMPTY, |all, &item| all.union(bounds(item)))
        };
        let nodes = tree.nodes.into_par_iter();
        let mut nodes: Vec<ExactNode> =
            nodes.map(|node| ExactNode { bounds: leaf(&node), node }).collect();
        // Children stand after their parents.
        for i in (0..nodes.len()).rev() {
            if nodes[i].node.leaf().is_none() {
                let right = i + nodes[i].node.right();
                nodes[i].bounds = nodes[i + 1].bounds.union(nodes[right].bounds);
            }
        }
        Self { nodes, items }
    }

    fn bounds(&self) -> Bounds {
        self.nodes.first().map_or(Bounds::EMPTY, |root| root.bounds)
    }

    pub(crate) fn bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<ExactNode>()
            + self.items.capacity() * size_of::<[u32; 2]>()
    }

    /// Shows the items of all leaves whose box the ray meets between `t_min` and `t_max`, which
    /// `see` may lower, until `see` answers `false`.
    pub(crate) fn visit(
        &self,
        ray: &LocalRay,
        t_min: f64,
        t_max: &mut f64,
        stack: &mut Vec<WaitingNode>,
        see: &mut impl FnMut([u32; 2], &mut f64) -> bool,
    ) {
        let slabs = Slabs::new(ray, t_min);
        let node = |i: usize| NodeBox { node: &self.nodes[i].node, bounds: self.nodes[i].bounds };
        let leaf = |range: Range<usize>, t_max: &mut f64| {
            self.items[range].iter().all(|&item| see(item, t_max))
        };
        if !self.nodes.is_empty() {
            descend(&slabs, t_max, stack, node, leaf);
        }
    }
}

/// A node of a tree with its box.
pub(crate) struct NodeBox<'t> {
    pub(crate) node: &'t BinaryNode,
    pub(crate) bounds: Bounds,
}

/// A node that is still to be looked at, and the distance at which the ray enters its box.
#[derive(Clone, Copy)]
pub(crate) struct WaitingNode {
    number: u32,
    near: f64,
}

/// Goes down a tree from its root, nearer children first: shows all leaves whose box the ray meets up to `t_max`, which
/// `leaf` may lower, until `leaf` answers `false`.
#[inline(always)]
pub(crate) fn descend<'t>(
    slabs: &Slabs,
    t_max: &mut f64,
    stack: &mut Vec<WaitingNode>,
    node: impl Fn(usize) -> NodeBox<'t>,
    mut leaf: impl FnMut(Range<usize>, &mut f64) -> bool,
) {
    stack.clear();
    let near = slabs.enter(node(0).bounds, *t_max);
    stack.extend(near.map(|near| WaitingNode { number: 0, near }));
    while let Some(WaitingNode { number, near }) = stack.pop() {
        if near > *t_max {
            continue;
        }
        let i = number as usize;
        let own = node(i).node;
        if let Some(range) = own.leaf() {
            if !leaf(range, t_max) {
                return;
            }
            continue;
        }
        let [a, b] = [i + 1, i + own.right()].map(|child| {
            let near = slabs.enter(node(child).bounds, *t_max);
            #[expect(clippy::cast_possible_truncation, reason = "nodes are numbered in u32")]
            near.map(|near| WaitingNode { number: child as u32, near })
        });
        let a_first = matches!((a, b), (Some(a), Some(b)) if a.near < b.near);
        let (far, close) = if a_first { (b, a) } else { (a, b) };
        stack.extend(far);
        stack.extend(close);
    }
}

/// A ray prepared for box tests.
pub(crate) struct Slabs {
    origin: DVec3,
    inverse: DVec3,
    pad: DVec3,
    t_min: f64,
}

impl Slabs {
    pub(crate) fn new(ray: &LocalRay, t_min: f64) -> Self {
        // Small enough to move no point of a box by a rounding, and its reciprocal times any
        // coordinate of a frame is finite.
        let least = 1e-150 * ray.direction.abs().max_element();
        let steer = |d: f64| if d.abs() < least { least.copysign(d) } else { d };
        let direction = DVec3::from_array(ray.direction.to_array().map(steer));
        // The test's own roundings are relative to coordinates and the origin, a few each.
        let pad = ray.pad + 8.0 * f64::EPSILON * (1.0 + ray.origin.abs().max_element());
        Self { origin: ray.origin, inverse: direction.recip(), pad: DVec3::splat(pad), t_min }
    }

    /// The distance at which the ray enters the widened box; `None` when it misses it, or only
    /// meets it outside `t_min..=t_max`.
    #[inline]
    pub(crate) fn enter(&self, bounds: Bounds, t_max: f64) -> Option<f64> {
        let a = (bounds.min - self.pad - self.origin) * self.inverse;
        let b = (bounds.max + self.pad - self.origin) * self.inverse;
        let near = a.min(b).max_element().max(self.t_min);
        let far = a.max(b).min_element().min(t_max);
        // Distances are rounded too; the next box may begin where this one ends.
        let slack = 8.0 * f64::EPSILON * far.abs();
        (near <= far + slack).then_some(near - slack)
    }
}
