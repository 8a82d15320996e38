//! The pure-Rust backend: for machines without Embree, and to measure Embree against.
//!
//! * **Build.** Binned surface-area heuristic over all cores ([`tree`](crate::tree)), folded into
//!   nodes of eight boxes ([`wide`]). Meshes used once are baked together; others are instances
//!   under a tree of their own ([`parts`](crate::parts)).
//! * **Traversal** in f32, in frames whose coordinates are about 1, eight boxes or triangles side by
//!   side ([`lanes`], [`traverse`]). It never decides anything: boxes and edges are widened by the
//!   rounding error ([`ray`]), and what remains, rarely more than the triangle that is hit, goes
//!   through the exact f64 test that [`exact`](crate::exact) uses.
//!
//! So its answers are those of `exact`, and as watertight.

#![forbid(unsafe_code)]

mod lanes;
mod ray;
mod traverse;
mod wide;

use std::fmt;
use std::sync::Arc;
use std::time::{Duration, Instant};

use etendue_geometry::glam::Vec3;
use etendue_geometry::{Bounds, Geometry, HitBatch, RayBatch};
use pulp::NullaryFnOnce;
use rayon::prelude::*;

use self::lanes::{Lanes, Portable};
use self::ray::{BoxTest, NarrowRay, TriangleTest};
use self::traverse::{Stack, traverse};
use self::wide::{Instances, Triangles, WideTree};
use crate::nearest::{Nearest, Query};
use crate::parts::{Baking, Instance, Layout, Members, Part, outward};
use crate::tree::{LeafSize, Ref, Tree};
use crate::watch::{Watch, with_threads};
use crate::{Accel, BuildError, BuildOptions, BuildReport, Quality};

/// The pure-Rust bounding volume hierarchy.
pub struct Bvh {
    geometry: Arc<Geometry>,
    layout: Layout,
    parts: Vec<Shape>,
    /// Over the instances; empty when there is only one.
    top: WideTree,
    isa: Isa,
    time: Duration,
}

/// A part's tree.
#[derive(Debug)]
struct Shape {
    tree: WideTree,
    /// Whose triangles these are.
    owner: Owner,
}

#[derive(Debug, Clone, Copy)]
enum Owner {
    /// Of this placement, all of them.
    Placement(u32),
    /// Of the placement that the instance names.
    Instance,
    /// Of the placements that stand in the leaves.
    Leaf,
}

/// The instruction set chosen when the program runs.
#[derive(Debug, Clone, Copy)]
enum Isa {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2(pulp::x86::V3),
}

impl Isa {
    fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(token) = pulp::x86::V3::try_new() {
            return Self::Avx2(token);
        }
        Self::Portable
    }

    fn name(self) -> &'static str {
        match self {
            Self::Portable => Portable::NAME,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => <pulp::x86::V3 as Lanes>::NAME,
        }
    }
}

const LEAF: LeafSize = LeafSize { most: 8, block: 4 };
const INSTANCE_LEAF: LeafSize = LeafSize { most: 1, block: 1 };

/// Bytes a triangle at the height of a build: refs twice, binary nodes (one for every two
/// triangles, twice while they are joined), then leaves of 13 numbers and an eighth of a node,
/// twice while they are joined.
const BYTES_PER_TRIANGLE: u64 = 2 * size_of::<Ref>() as u64 + 32 + 2 * (13 * 4 + 16);
const BYTES_PER_INSTANCE: u64 = size_of::<Instance>() as u64 + 2 * 32 + 64 + 64;

impl Bvh {
    /// Builds the trees over `geometry`. Of the options, threads, memory limit and progress are
    /// heeded; answers are always robust and refined, and every quality builds the same tree.
    ///
    /// # Errors
    ///
    /// [`BuildError::MemoryLimit`], before anything large is allocated; [`BuildError::TooLarge`]
    /// for more triangles than leaves can number; [`BuildError::Stopped`] when the progress
    /// function answered `false`; [`BuildError::Library`] when threads cannot be had.
    pub fn build(geometry: Arc<Geometry>, options: &BuildOptions) -> Result<Self, BuildError> {
        let start = Instant::now();
        let layout = Layout::new(&geometry, Baking::UsedOnce);
        layout.check_size(&geometry, options, "bvh", [BYTES_PER_TRIANGLE, BYTES_PER_INSTANCE])?;
        let total = layout.triangles(&geometry) + layout.instances.len() as u64;
        let watch = Watch::new(options, total);
        let (parts, top) = with_threads(options, || {
            let mut parts = Vec::with_capacity(layout.parts.len());
            for part in &layout.parts {
                parts.push(Shape::new(part, &geometry, &watch)?);
            }
            let top = top_tree(&layout, &geometry, &parts, &watch)?;
            Ok((parts, top))
        })?;
        Ok(Self { geometry, layout, parts, top, isa: Isa::detect(), time: start.elapsed() })
    }

    /// A number that differs when the trees do.
    #[doc(hidden)]
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        let trees = self.parts.iter().map(|part| &part.tree).chain([&self.top]);
        trees.fold(0, |sum, tree| tree.fingerprint(sum))
    }
}

impl Shape {
    fn new(part: &Part, geometry: &Geometry, watch: &Watch<'_>) -> Result<Self, BuildError> {
        let tree = Tree::build(part.refs(geometry), LEAF, watch)?;
        let owner = match &part.members {
            Members::Mesh(_) => Owner::Instance,
            Members::Baked(placements) if placements.len() == 1 => Owner::Placement(placements[0]),
            Members::Baked(_) => Owner::Leaf,
        };
        let placements = matches!(owner, Owner::Leaf);
        let tree = WideTree::fold(&tree, &Triangles { part, geometry, placements });
        Ok(Self { tree, owner })
    }

    fn bounds(&self) -> Bounds {
        let [min, max] = [self.tree.lo, self.tree.hi].map(|v| Vec3::from_array(v).as_dvec3());
        Bounds { min, max }
    }
}

/// The tree over the instances, when there are several.
fn top_tree(
    layout: &Layout,
    geometry: &Geometry,
    parts: &[Shape],
    watch: &Watch<'_>,
) -> Result<WideTree, BuildError> {
    let count = u32::try_from(layout.instances.len()).unwrap_or(u32::MAX);
    if count < 2 {
        return Ok(WideTree::default());
    }
    let refs = (0..count).into_par_iter().map(|i| {
        let instance = &layout.instances[i as usize];
        let local = parts[instance.part as usize].bounds();
        let bounds = instance.world_bounds(layout, geometry, local);
        let (lo, hi) = outward([bounds.min, bounds.max]);
        Ref { lo, first: i, hi, second: i }
    });
    let tree = Tree::build(refs.collect(), INSTANCE_LEAF, watch)?;
    Ok(WideTree::fold(&tree, &Instances))
}

/// What a traversal needs besides the ray.
struct Scratch {
    outer: Stack,
    inner: Stack,
}

/// A batch of rays and what becomes of each.
struct Batch<'a, L, F> {
    lanes: L,
    bvh: &'a Bvh,
    rays: &'a RayBatch,
    /// Called for every ray with its number, when it can hit at all.
    each: F,
}

impl<L: Lanes, F: FnMut(&Finder<'_, L>, usize, &Query, &mut Scratch)> NullaryFnOnce
    for Batch<'_, L, F>
{
    type Output = ();

    #[inline(always)]
    fn call(mut self) {
        let finder = Finder { lanes: self.lanes, bvh: self.bvh };
        let mut scratch = Scratch { outer: Stack::new(), inner: Stack::new() };
        for i in 0..self.rays.len() {
            if let Some(query) = Query::of(self.rays, i) {
                (self.each)(&finder, i, &query, &mut scratch);
            }
        }
    }
}

struct Finder<'a, L> {
    lanes: L,
    bvh: &'a Bvh,
}

impl<L: Lanes> Finder<'_, L> {
    #[inline(always)]
    fn nearest(&self, query: &Query, scratch: &mut Scratch) -> Nearest {
        let mut nearest = Nearest::none(query.t_max);
        self.visit(query, query.t_max, scratch, |hit, placement, triangle| {
            nearest.offer(hit, placement, triangle);
            Some(nearest.t)
        });
        nearest
    }

    #[inline(always)]
    fn is_blocked(&self, query: &Query, scratch: &mut Scratch) -> bool {
        let mut blocked = false;
        self.visit(query, query.t_max, scratch, |_, _, _| {
            blocked = true;
            None
        });
        blocked
    }

    /// Shows hits to `see`, roughly from near to far, which answers how far to look on.
    #[inline(always)]
    fn visit(
        &self,
        query: &Query,
        t_max: f64,
        scratch: &mut Scratch,
        mut see: impl FnMut(crate::watertight::Hit, u32, u32) -> Option<f64>,
    ) {
        let Scratch { outer, inner } = scratch;
        let mut t_max = t_max;
        if let [instance] = &self.bvh.layout.instances[..] {
            self.visit_instance(instance, query, &mut t_max, inner, &mut see);
            return;
        }
        if self.bvh.top.is_empty() {
            return;
        }
        let world = self.bvh.layout.world.ray(query.origin, query.direction);
        let world = NarrowRay::new(&world, query.t_min);
        let test = BoxTest::new(self.lanes, &world);
        let top = &self.bvh.top;
        traverse(self.lanes, &top.nodes, &test, world.far(t_max), outer, |leaf, _| {
            let place = leaf.place();
            for number in &top.numbers[place..place + leaf.count()] {
                let instance = &self.bvh.layout.instances[number.to_bits() as usize];
                if !self.visit_instance(instance, query, &mut t_max, inner, &mut see) {
                    return None;
                }
            }
            Some(world.far(t_max))
        });
    }

    /// As [`Self::visit`], within one instance; `false` when `see` has seen enough.
    #[inline(always)]
    fn visit_instance(
        &self,
        instance: &Instance,
        query: &Query,
        t_max: &mut f64,
        stack: &mut Stack,
        see: &mut impl FnMut(crate::watertight::Hit, u32, u32) -> Option<f64>,
    ) -> bool {
        let shape = &self.bvh.parts[instance.part as usize];
        let local = instance.ray(query.origin, query.direction);
        let ray = NarrowRay::new(&local, query.t_min);
        let boxes = BoxTest::new(self.lanes, &ray);
        let triangles = TriangleTest::new(self.lanes, &ray);
        let mut go_on = true;
        let far = ray.far(*t_max);
        traverse(self.lanes, &shape.tree.nodes, &boxes, far, stack, |leaf, far| {
            let (n, place) = (leaf.count(), leaf.place());
            let numbers = shape.tree.numbers.get(place..place + 96)?;
            let mut maybe = triangles.maybe(self.lanes, numbers, n, far);
            if maybe == 0 {
                return Some(far);
            }
            while maybe != 0 {
                let i = maybe.trailing_zeros() as usize;
                maybe &= maybe - 1;
                let triangle = numbers[9 * n + i].to_bits();
                let placement = match shape.owner {
                    Owner::Placement(placement) => placement,
                    Owner::Instance => instance.placement,
                    Owner::Leaf => numbers[10 * n + i].to_bits(),
                };
                if let Some(hit) = self.bvh.test(query, placement, triangle) {
                    match see(hit, placement, triangle) {
                        Some(limit) => *t_max = limit,
                        None => {
                            go_on = false;
                            return None;
                        }
                    }
                }
            }
            Some(ray.far(*t_max))
        });
        go_on
    }
}

impl Bvh {
    #[inline]
    fn test(&self, query: &Query, placement: u32, triangle: u32) -> Option<crate::watertight::Hit> {
        let placement = &self.geometry.placements[placement as usize];
        let corners = self.geometry.mesh_of(placement).corners(triangle as usize);
        query.test(placement, corners)
    }

    fn closest_by<L: Lanes>(&self, lanes: L, rays: &RayBatch, hits: &mut HitBatch) {
        lanes.run(Batch {
            lanes,
            bvh: self,
            rays,
            each: |finder: &Finder<'_, L>, i, query: &Query, scratch: &mut Scratch| {
                finder.nearest(query, scratch).write(&self.geometry, hits, i);
            },
        });
    }

    fn occluded_by<L: Lanes>(&self, lanes: L, rays: &RayBatch, blocked: &mut [bool]) {
        lanes.run(Batch {
            lanes,
            bvh: self,
            rays,
            each: |finder: &Finder<'_, L>, i, query: &Query, scratch: &mut Scratch| {
                blocked[i] = finder.is_blocked(query, scratch);
            },
        });
    }
}

impl Accel for Bvh {
    fn closest(&self, rays: &RayBatch, hits: &mut HitBatch) {
        hits.reset(rays.len());
        match self.isa {
            Isa::Portable => self.closest_by(Portable, rays, hits),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2(token) => self.closest_by(token, rays, hits),
        }
    }

    fn occluded(&self, rays: &RayBatch, blocked: &mut Vec<bool>) {
        blocked.clear();
        blocked.resize(rays.len(), false);
        match self.isa {
            Isa::Portable => self.occluded_by(Portable, rays, blocked),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2(token) => self.occluded_by(token, rays, blocked),
        }
    }

    fn report(&self) -> BuildReport {
        let trees = self.parts.iter().map(|part| &part.tree).chain([&self.top]);
        let instances = self.layout.instances.capacity() * size_of::<Instance>();
        BuildReport {
            backend: format!("bvh {}", self.isa.name()),
            quality: Quality::Medium,
            time: self.time,
            bytes: (trees.map(WideTree::bytes).sum::<usize>() + instances) as u64,
            copied_bytes: 0,
        }
    }
}

impl fmt::Debug for Bvh {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Bvh")
            .field("isa", &self.isa.name())
            .field("parts", &self.parts.len())
            .field("instances", &self.layout.instances.len())
            .finish_non_exhaustive()
    }
}
