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
//!
//! From a place in a leaf to a triangle's corners in its mesh's frame, for the exact test.

#![forbid(unsafe_code)]

mod bundle;
mod fold;
mod lanes;
mod packet;
mod queries;
mod ray;
mod single;
mod traverse;
mod wide;

use std::fmt;
use std::sync::Arc;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use self::fold::{InstanceLeafWriter, Triangles, fold};
use self::lanes::{Lanes, Portable};
use self::wide::{LeafNumbers, LeafUnits, MOST_IN_LEAF, WideTree};
use crate::few::FewTriangles;
use crate::nearest::{PlacementView, Triangle};
use crate::parts::{Baking, Blas, Layout, Members, PartInstance, outward};
use crate::tree::{LeafSize, Ref, Tree};
use crate::{BuildError, BuildOptions, BuildWatch, with_threads};
use etendue_geometry::glam::Vec3;
use etendue_geometry::{Bounds, Coplanar, Geometry, MISS, Mesh};

/// The pure-Rust bounding volume hierarchy.
pub struct Bvh {
    geometry: Arc<Geometry>,
    layout: Layout,
    parts: Vec<PartTree>,
    /// Over the instances; empty when there is only one.
    top: WideTree,
    coplanar: Coplanar,
    few: Option<FewTriangles>,
    isa: Isa,
    time: Duration,
}

/// A part's tree.
#[derive(Debug)]
struct PartTree {
    tree: WideTree,
    /// Whose triangles these are.
    owner: TriangleOwner,
    /// Map from the coordinates in the leaves to the meshes' own, when it holds to the bit: then a
    /// hit needs nothing but the leaf.
    units: Option<LeafUnits>,
}

#[derive(Debug, Clone, Copy)]
enum TriangleOwner {
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
    #[cfg(target_arch = "x86_64")]
    Avx512(pulp::x86::V4),
}

impl Isa {
    fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(token) = pulp::x86::V4::try_new() {
            return Self::Avx512(token);
        }
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
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => <pulp::x86::V4 as Lanes>::NAME,
        }
    }
}

const LEAF: LeafSize = LeafSize { most: MOST_IN_LEAF, block: 8 };
const INSTANCE_LEAF: LeafSize = LeafSize { most: 1, block: 1 };

/// Instances that the cells of a tree can certainly number: one each and a node for every few.
const MOST_INSTANCES: u64 = 1 << 26;

/// Bytes a triangle at the height of a build: refs twice, binary nodes (one for every two
/// triangles, twice while they are joined), then leaves of 13 numbers and an eighth of a node,
/// twice while they are joined.
const BYTES_PER_TRIANGLE: u64 = 2 * size_of::<Ref>() as u64 + 32 + 2 * (13 * 4 + 16);
const BYTES_PER_INSTANCE: u64 = size_of::<PartInstance>() as u64 + 2 * 32 + 64 + 64;

impl Bvh {
    /// Builds the trees over `geometry`. Of the options, threads, memory limit and progress are
    /// heeded; answers are always robust and refined, and every quality builds the same tree.
    ///
    /// # Errors
    ///
    /// [`BuildError::MemoryLimit`], before anything large is allocated; [`BuildError::Scale`] beyond 10¹² m and below
    /// 10⁻¹² m; [`BuildError::TooLarge`] for more triangles than leaves can number; [`BuildError::Stopped`] when the
    /// progress function answered `false`; [`BuildError::Library`] when threads cannot be had.
    pub fn build(geometry: Arc<Geometry>, options: &BuildOptions) -> Result<Self, BuildError> {
        let start = Instant::now();
        let layout = Layout::new(&geometry, Baking::UsedOnce);
        layout.check_size(&geometry, options, "bvh", [BYTES_PER_TRIANGLE, BYTES_PER_INSTANCE])?;
        let total = layout.triangles(&geometry) + layout.instances.len() as u64;
        let watch = BuildWatch::new(options, total);
        let (parts, top) = with_threads(options, || {
            let mut parts = Vec::with_capacity(layout.parts.len());
            for part in &layout.parts {
                parts.push(PartTree::new(part, &geometry, &watch)?);
            }
            let top = top_tree(&layout, &geometry, &parts, &watch)?;
            Ok((parts, top))
        })?;
        let (coplanar, isa) = (Coplanar::of(&geometry), Isa::detect());
        let few = FewTriangles::of(&geometry);
        Ok(Self { geometry, layout, parts, top, coplanar, few, isa, time: start.elapsed() })
    }

    /// A number that differs when the trees do.
    #[doc(hidden)]
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        let trees = self.parts.iter().map(|part| &part.tree).chain([&self.top]);
        trees.fold(0, |sum, tree| tree.fingerprint(sum))
    }
}

impl PartTree {
    fn new(part: &Blas, geometry: &Geometry, watch: &BuildWatch<'_>) -> Result<Self, BuildError> {
        let tree = Tree::build(part.refs(geometry), LEAF, watch)?;
        let owner = match &part.members {
            Members::Mesh(_) => TriangleOwner::Instance,
            Members::Baked(placements) if placements.len() == 1 => {
                TriangleOwner::Placement(placements[0])
            }
            Members::Baked(_) => TriangleOwner::Leaf,
        };
        let leaf = Triangles {
            part,
            geometry,
            only: match owner {
                TriangleOwner::Placement(placement) => Some(part.source(geometry, placement)),
                TriangleOwner::Instance => Some(part.source(geometry, MISS)),
                TriangleOwner::Leaf => None,
            },
            units: LeafUnits::of(part.frame),
            is_exact: part.is_unturned(geometry).into(),
        };
        let tree = fold(&tree, &leaf).ok_or_else(|| part.too_large(geometry, "bvh"))?;
        let units = leaf.is_exact.into_inner().then_some(leaf.units);
        Ok(Self { tree, owner, units })
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
    parts: &[PartTree],
    watch: &BuildWatch<'_>,
) -> Result<WideTree, BuildError> {
    let count = u32::try_from(layout.instances.len()).unwrap_or(u32::MAX);
    if count < 2 {
        return Ok(WideTree::default());
    }
    let refs = (0..count).into_par_iter().map(|i| {
        let instance = &layout.instances[i as usize];
        let local = parts[instance.part as usize].bounds();
        let bounds = layout.bounds_of(instance, geometry, local);
        let (lo, hi) = outward([bounds.min, bounds.max]);
        Ref { lo, first: i, hi, second: i }
    });
    let tree = Tree::build(refs.collect(), INSTANCE_LEAF, watch)?;
    fold(&tree, &InstanceLeafWriter).ok_or_else(|| BuildError::TooLarge {
        mesh: "all".to_owned(),
        what: format!("the number of instances, {count},"),
        backend: "bvh",
        limit: MOST_INSTANCES,
    })
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

/// A placement with what the exact test needs of it.
#[derive(Clone, Copy)]
struct ExactPlacement<'a> {
    placement: u32,
    view: PlacementView<'a>,
    mesh: &'a Mesh,
}

impl<'a> ExactPlacement<'a> {
    #[inline(always)]
    fn new(bvh: &'a Bvh, placement: u32) -> Self {
        let place = &bvh.geometry.placements[placement as usize];
        let view = PlacementView::new(&place.world_from_mesh);
        Self { placement, view, mesh: bvh.geometry.mesh_of(place) }
    }
}

/// The triangles of an instance.
struct PlacedTriangles<'a> {
    bvh: &'a Bvh,
    /// The placement, where there is but one.
    only: Option<ExactPlacement<'a>>,
    units: Option<LeafUnits>,
}

impl<'a> PlacedTriangles<'a> {
    #[inline(always)]
    fn new(bvh: &'a Bvh, instance: &PartInstance) -> Self {
        let shape = &bvh.parts[instance.part as usize];
        let only = match shape.owner {
            TriangleOwner::Placement(placement) => Some(ExactPlacement::new(bvh, placement)),
            TriangleOwner::Instance => Some(ExactPlacement::new(bvh, instance.placement)),
            TriangleOwner::Leaf => None,
        };
        Self { bvh, only, units: shape.units }
    }

    /// Triangle `i` of the `n` in a leaf with these numbers, and its placement.
    #[inline(always)]
    fn get(
        &self,
        numbers: &LeafNumbers,
        n: usize,
        i: usize,
    ) -> Option<(ExactPlacement<'a>, Triangle)> {
        let number = numbers.get(9 * n + i)?.to_bits();
        let placed = match self.only {
            Some(placed) => placed,
            None => ExactPlacement::new(self.bvh, numbers.get(10 * n + i)?.to_bits()),
        };
        let corners = match self.units {
            Some(units) => units.corners(numbers, n, i),
            None => placed.mesh.corners(number as usize),
        };
        Some((placed, Triangle { placement: placed.placement, number, corners }))
    }
}
