//! What a tree is built over, and how a ray gets there.
//!
//! A *part* is a set of triangles in one frame: a mesh in its own frame, shared by all its
//! placements, or several placements *baked* into a frame that is parallel to the world's. An
//! *instance* is a part at a place. Every frame has its origin among its triangles and a power of
//! two as its scale, so that coordinates in it are at most about 1 and single precision is spent on
//! what matters.
//!
//! Rays reach a frame in f64, as seen from the instance, and know how far rounding may have moved
//! them against the triangles (see [`LocalRay::pad`]): boxes are widened by that, so nothing is
//! culled that the exact test would hit.

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Bounds, Geometry, MISS, Placement, Positions, Transform};

use crate::tree::Ref;
use crate::{BuildError, BuildOptions};

/// Origin and scale of a part: `p ↦ (p − origin) · scale`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Frame {
    pub(crate) origin: DVec3,
    /// A power of two.
    pub(crate) scale: f64,
}

impl Frame {
    /// A frame in which `bounds` lies within about −1..1. The origin stays where it is unless it is
    /// far away, because f32 coordinates stay exact then.
    pub(crate) fn around(bounds: Bounds) -> Self {
        if bounds.is_empty() {
            return Self { origin: DVec3::ZERO, scale: 1.0 };
        }
        let centre = bounds.min * 0.5 + bounds.max * 0.5;
        let half = bounds.max * 0.5 - bounds.min * 0.5;
        let far = centre.abs().max_element() > 4.0 * half.max_element();
        let origin = if far { centre } else { DVec3::ZERO };
        let reach = (bounds.max - origin).abs().max((bounds.min - origin).abs()).max_element();
        let origin = if origin.is_finite() { origin } else { DVec3::ZERO };
        Self { origin, scale: reciprocal_power(reach) }
    }
}

impl Frame {
    /// A point of the mesh whose frame this is.
    #[inline(always)]
    fn local(&self, point: DVec3) -> DVec3 {
        (point - self.origin) * self.scale
    }

    /// A point of a mesh that `transform` places in the world.
    #[inline(always)]
    fn baked(&self, transform: &Transform, point: DVec3) -> DVec3 {
        transform.point_from(point, self.origin) * self.scale
    }
}

/// The power of two that brings `size` to at most 1 (1 for a size of 0), within f64's range.
#[expect(clippy::cast_possible_truncation, reason = "an exponent of f64 has 11 bits")]
fn reciprocal_power(size: f64) -> f64 {
    if size > 0.0 { 2f64.powi(-(size.log2().ceil().clamp(-1000.0, 1000.0) as i32)) } else { 1.0 }
}

/// Whose triangles a part holds.
#[derive(Debug, Clone)]
pub(crate) enum Members {
    /// One mesh, in its own frame, for any number of placements.
    Mesh(u32),
    /// These placements, parallel to the world.
    Baked(Vec<u32>),
}

/// A set of triangles in one frame.
#[derive(Debug, Clone)]
pub(crate) struct Part {
    pub(crate) frame: Frame,
    pub(crate) members: Members,
}

/// A part at a place.
#[derive(Debug, Clone)]
pub(crate) struct Instance {
    pub(crate) part: u32,
    /// The placement, or [`MISS`] for a baked part, which knows its triangles' placements.
    pub(crate) placement: u32,
    /// The frame's scale where the frame is parallel to the world, else 0.
    pub(crate) parallel_scale: f64,
    /// From world directions to the part's frame, with its scale.
    linear: DMat3,
    translation: DVec3,
    translation_low: DVec3,
    /// The frame's origin in its own scaled units: what is left to subtract.
    origin: DVec3,
    pad: f64,
    pad_per_distance: f64,
}

/// A ray in a part's frame. It has the same distances as in the world: its direction is not unit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LocalRay {
    pub(crate) origin: DVec3,
    pub(crate) direction: DVec3,
    /// How far f64 rounding may have moved the ray against any triangle near it, along an axis.
    pub(crate) pad: f64,
}

/// As [`LocalRay`], many.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LocalRays<const N: usize> {
    pub(crate) origin: [[f64; N]; 3],
    pub(crate) direction: [[f64; N]; 3],
    pub(crate) pad: [f64; N],
}

/// All parts and instances of a scene, and the frame of the tree over the instances.
#[derive(Debug)]
pub(crate) struct Layout {
    pub(crate) parts: Vec<Part>,
    pub(crate) instances: Vec<Instance>,
    /// Where the whole scene lies, parallel to the world.
    pub(crate) world: Instance,
    pub(crate) world_frame: Frame,
}

/// What is baked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Baking {
    /// Meshes used once that are not too fine for the scene's single precision, in one part.
    UsedOnce,
    /// Only what has no inverse.
    Singular,
}

/// Half the distance from 1 to the next f64.
const ROUNDING: f64 = f64::EPSILON / 2.0;

/// Roundings, each of at most one [`ROUNDING`] of the magnitudes involved, that box tests allow for.
/// On a ray's or a corner's way into a frame there are about fifty:
/// inverting a 3 × 3 matrix (about 14 per condition number), applying it twice
/// (4 each), the sums of the offset (3), and the box test itself (4). The rest is for a distance
/// that [`crate::watertight::intersect`] rounds to before its box begins.
const ROUNDINGS: f64 = 1024.0;

/// A worse conditioned placement is baked: its inverse would eat into single precision's slack.
const WORST_CONDITION: f64 = 1e5;

/// A mesh is baked with others while its typical triangle is this much larger than what single
/// precision resolves in the scene's frame.
const BAKED_RESOLUTION: f64 = 64.0;

/// Triangles of one part that a tree can certainly number: the fast backend has 2²⁸ cells, of which
/// a triangle takes two to three.
const MOST_TRIANGLES: usize = 90_000_000;

impl Layout {
    pub(crate) fn new(geometry: &Geometry, baking: Baking) -> Self {
        let world_frame = Frame::around(geometry.loose_bounds());
        let uses = geometry.uses();
        let mut layout = Self {
            parts: Vec::new(),
            instances: Vec::new(),
            world: Instance::parallel(MISS, world_frame, 0.0),
            world_frame,
        };
        let mut part_of_mesh = vec![None; geometry.meshes.len()];
        let mut baked = Vec::new();
        for (i, placement) in geometry.placements.iter().enumerate() {
            let i = index(i);
            let mesh = geometry.mesh_of(placement);
            if mesh.triangles.is_empty() || !placement.world_from_mesh.is_finite() {
                continue;
            }
            let once = baking == Baking::UsedOnce && uses[placement.mesh as usize] == 1;
            if once && is_coarse(geometry, placement, world_frame) {
                baked.push(i);
                continue;
            }
            let frame = Frame::around(mesh.bounds);
            let Some(instance) = Instance::placed(placement, i, frame, mesh.bounds) else {
                layout.bake(geometry, vec![i]);
                continue;
            };
            let part = *part_of_mesh[placement.mesh as usize].get_or_insert_with(|| {
                let members = Members::Mesh(placement.mesh);
                layout.parts.push(Part { frame, members });
                index(layout.parts.len() - 1)
            });
            layout.instances.push(Instance { part, ..instance });
        }
        let mut together = Vec::new();
        let mut triangles = 0;
        for i in baked {
            let more = geometry.mesh_of(&geometry.placements[i as usize]).triangles.len();
            if triangles + more > MOST_TRIANGLES && !together.is_empty() {
                layout.bake(geometry, std::mem::take(&mut together));
                triangles = 0;
            }
            together.push(i);
            triangles += more;
        }
        if !together.is_empty() {
            layout.bake(geometry, together);
        }
        let reach = geometry.placements.iter().map(|p| baked_reach(geometry, p, world_frame));
        layout.world = Instance::parallel(MISS, world_frame, reach.fold(0.0, f64::max));
        layout
    }

    /// Triangles of all parts: each shared mesh once, and what is baked.
    pub(crate) fn triangles(&self, geometry: &Geometry) -> u64 {
        self.parts.iter().map(|part| part.len(geometry) as u64).sum()
    }

    /// Refuses what cannot be numbered, and what would take more than the caller's memory limit at
    /// so many bytes a triangle and an instance.
    ///
    /// # Errors
    ///
    /// [`BuildError::TooLarge`] and [`BuildError::MemoryLimit`].
    pub(crate) fn check_size(
        &self,
        geometry: &Geometry,
        options: &BuildOptions,
        backend: &'static str,
        [per_triangle, per_instance]: [u64; 2],
    ) -> Result<(), BuildError> {
        for part in &self.parts {
            if part.len(geometry) > MOST_TRIANGLES {
                return Err(part.too_large(geometry, backend));
            }
        }
        let bytes = self
            .triangles(geometry)
            .saturating_mul(per_triangle)
            .saturating_add((self.instances.len() as u64).saturating_mul(per_instance));
        match options.memory_limit {
            Some(limit) if bytes > limit => Err(BuildError::MemoryLimit { backend, limit }),
            _ => Ok(()),
        }
    }

    /// Adds a part for `placements`, parallel to the world.
    fn bake(&mut self, geometry: &Geometry, placements: Vec<u32>) {
        let members = || placements.iter().map(|&i| &geometry.placements[i as usize]);
        let bounds = members().fold(Bounds::EMPTY, |all, p| all.union(loose_bounds(geometry, p)));
        let frame = Frame::around(bounds);
        let reach = members().map(|p| baked_reach(geometry, p, frame)).fold(0.0, f64::max);
        let part = index(self.parts.len());
        self.parts.push(Part { frame, members: Members::Baked(placements) });
        self.instances.push(Instance::parallel(part, frame, reach));
    }
}

/// Placements, parts and triangles are counted in u32 by the contract.
#[expect(clippy::cast_possible_truncation, reason = "counted in u32 by the contract")]
fn index(i: usize) -> u32 {
    i as u32
}

fn largest(bounds: Bounds) -> f64 {
    if bounds.is_empty() { 0.0 } else { bounds.min.abs().max(bounds.max.abs()).max_element() }
}

fn loose_bounds(geometry: &Geometry, placement: &Placement) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    let local = geometry.mesh_of(placement).bounds;
    if !local.is_empty() {
        for corner in local.corners() {
            bounds.include(placement.world_from_mesh.point(corner));
        }
    }
    bounds
}

/// The magnitudes that a placement's corners are summed from in `frame`.
fn baked_reach(geometry: &Geometry, placement: &Placement, frame: Frame) -> f64 {
    let transform = &placement.world_from_mesh;
    let local = largest(geometry.mesh_of(placement).bounds);
    let offset = transform.offset_from(frame.origin).abs().max_element();
    (norm(&transform.linear) * local + offset) * frame.scale
}

/// Whether a placed mesh's typical triangle is large against what f32 resolves in `frame`.
fn is_coarse(geometry: &Geometry, placement: &Placement, frame: Frame) -> bool {
    let triangles = geometry.mesh_of(placement).triangles.len() as f64;
    let size = loose_bounds(geometry, placement).diagonal() / triangles.sqrt();
    size * frame.scale > BAKED_RESOLUTION * f64::from(f32::EPSILON)
}

/// The Frobenius norm.
fn norm(matrix: &DMat3) -> f64 {
    let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
    (x.length_squared() + y.length_squared() + z.length_squared()).sqrt()
}

impl Instance {
    /// A frame parallel to the world.
    fn parallel(part: u32, frame: Frame, reach: f64) -> Self {
        Self {
            part,
            placement: MISS,
            parallel_scale: frame.scale,
            linear: DMat3::from_diagonal(DVec3::splat(frame.scale)),
            translation: frame.origin,
            translation_low: DVec3::ZERO,
            origin: DVec3::ZERO,
            pad: ROUNDINGS * ROUNDING * (1.0 + reach),
            pad_per_distance: ROUNDINGS * ROUNDING * frame.scale,
        }
    }

    /// The mesh's own frame at `placement`; `None` when that has no good inverse.
    fn placed(placement: &Placement, i: u32, frame: Frame, bounds: Bounds) -> Option<Self> {
        let transform = &placement.world_from_mesh;
        // At unit scale, so that a determinant of 10⁻³⁰⁰ is not mistaken for 0.
        let unit = reciprocal_power(norm(&transform.linear));
        let scaled = transform.linear * unit;
        if scaled.determinant() == 0.0 {
            return None;
        }
        let inverse = scaled.inverse();
        let condition = norm(&scaled) * norm(&inverse);
        let linear = inverse * (unit * frame.scale);
        if !(condition <= WORST_CONDITION && linear.is_finite() && transform.is_finite()) {
            return None;
        }
        let error = ROUNDINGS * ROUNDING * condition;
        Some(Self {
            part: 0,
            placement: i,
            parallel_scale: 0.0,
            linear,
            translation: transform.translation,
            translation_low: transform.translation_low,
            origin: frame.origin * frame.scale,
            pad: error * (1.0 + largest(bounds) * frame.scale),
            pad_per_distance: error * norm(&linear),
        })
    }

    /// A world ray in the part's frame.
    #[inline(always)]
    pub(crate) fn ray(&self, origin: DVec3, direction: DVec3) -> LocalRay {
        let offset = (self.translation - origin) + self.translation_low;
        let distance = offset.abs();
        let pad = self.pad_at(distance.x + distance.y + distance.z);
        if self.parallel_scale > 0.0 {
            let scale = self.parallel_scale;
            return LocalRay { origin: -offset * scale, direction: direction * scale, pad };
        }
        let origin = -(self.linear * offset) - self.origin;
        LocalRay { origin, direction: self.linear * direction, pad }
    }

    /// The frame's translation as seen from a place in the world.
    #[inline(always)]
    pub(crate) fn offset(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let (high, low) = (self.translation, self.translation_low);
        [(high.x - x) + low.x, (high.y - y) + low.y, (high.z - z) + low.z]
    }

    /// The pad of a ray that begins at an offset whose components' sizes sum up to `distance`.
    #[inline(always)]
    pub(crate) fn pad_at(&self, distance: f64) -> f64 {
        self.pad + self.pad_per_distance * distance
    }

    /// World rays in the part's frame, as [`Self::ray`] has them, side by side.
    #[inline(always)]
    pub(crate) fn rays<const N: usize>(
        &self,
        origin: [&[f64; N]; 3],
        direction: [&[f64; N]; 3],
    ) -> LocalRays<N> {
        let zero = [0.0; N];
        let mut rays = LocalRays { origin: [zero; 3], direction: [zero; 3], pad: zero };
        let [lx, ly, lz] = [self.linear.x_axis, self.linear.y_axis, self.linear.z_axis];
        for i in 0..N {
            let [x, y, z] = self.offset([origin[0][i], origin[1][i], origin[2][i]]);
            rays.origin[0][i] = -(lx.x * x + ly.x * y + lz.x * z) - self.origin.x;
            rays.origin[1][i] = -(lx.y * x + ly.y * y + lz.y * z) - self.origin.y;
            rays.origin[2][i] = -(lx.z * x + ly.z * y + lz.z * z) - self.origin.z;
            rays.pad[i] = self.pad_at(x.abs() + y.abs() + z.abs());
            let (x, y, z) = (direction[0][i], direction[1][i], direction[2][i]);
            rays.direction[0][i] = lx.x * x + ly.x * y + lz.x * z;
            rays.direction[1][i] = lx.y * x + ly.y * y + lz.y * z;
            rays.direction[2][i] = lx.z * x + ly.z * y + lz.z * z;
        }
        rays
    }

    /// A box around the box `lo..hi` of this instance's part, in `world` coordinates.
    pub(crate) fn world_bounds(
        &self,
        layout: &Layout,
        geometry: &Geometry,
        local: Bounds,
    ) -> Bounds {
        let part = &layout.parts[self.part as usize];
        let frame = layout.world_frame;
        let mut bounds = Bounds::EMPTY;
        for corner in local.corners() {
            let corner = corner / part.frame.scale + part.frame.origin;
            let point = match geometry.placements.get(self.placement as usize) {
                Some(placement) => placement.world_from_mesh.point_from(corner, frame.origin),
                None => corner - frame.origin,
            };
            bounds.include(point * frame.scale);
        }
        bounds
    }
}

impl Part {
    /// The number of triangles.
    pub(crate) fn len(&self, geometry: &Geometry) -> usize {
        match &self.members {
            Members::Mesh(mesh) => geometry.meshes[*mesh as usize].triangles.len(),
            Members::Baked(placements) => {
                let mesh = |&i: &u32| geometry.mesh_of(&geometry.placements[i as usize]);
                placements.iter().map(|i| mesh(i).triangles.len()).sum()
            }
        }
    }

    /// The error that says so.
    pub(crate) fn too_large(&self, geometry: &Geometry, backend: &'static str) -> BuildError {
        BuildError::TooLarge {
            mesh: self.name(geometry).to_owned(),
            what: format!("its number of triangles, {},", self.len(geometry)),
            backend,
            limit: MOST_TRIANGLES as u64,
        }
    }

    /// The name of the (first) mesh, for messages.
    fn name<'a>(&self, geometry: &'a Geometry) -> &'a str {
        let mesh = match &self.members {
            Members::Mesh(mesh) => Some(*mesh),
            Members::Baked(list) => list.first().map(|&i| geometry.placements[i as usize].mesh),
        };
        mesh.map_or("", |mesh| &geometry.meshes[mesh as usize].name)
    }

    /// The corners of a triangle in this part's frame.
    pub(crate) fn corners(&self, geometry: &Geometry, placement: u32, triangle: u32) -> [DVec3; 3] {
        match &self.members {
            Members::Mesh(mesh) => {
                let corners = geometry.meshes[*mesh as usize].corners(triangle as usize);
                corners.map(|corner| self.frame.local(corner))
            }
            Members::Baked(_) => {
                let placement = &geometry.placements[placement as usize];
                let corners = geometry.mesh_of(placement).corners(triangle as usize);
                corners.map(|corner| self.frame.baked(&placement.world_from_mesh, corner))
            }
        }
    }

    /// Where the triangles of one of this part's meshes are.
    pub(crate) fn source<'a>(&self, geometry: &'a Geometry, placement: u32) -> Source<'a> {
        let (mesh, transform) = match &self.members {
            Members::Mesh(mesh) => (*mesh, None),
            Members::Baked(_) => {
                let placement = &geometry.placements[placement as usize];
                let transform = &placement.world_from_mesh;
                (placement.mesh, (!transform.is_identity()).then_some(transform))
            }
        };
        let mesh = &geometry.meshes[mesh as usize];
        Source {
            frame: self.frame,
            transform,
            triangles: &mesh.triangles,
            positions: match &mesh.positions {
                Positions::F32(vertices) => Slice::F32(vertices.floats(), vertices.stride()),
                Positions::F64(vertices) => Slice::F64(vertices),
            },
        }
    }

    /// Whether all corners go into this part's frame without being turned or stretched.
    pub(crate) fn is_unturned(&self, geometry: &Geometry) -> bool {
        match &self.members {
            Members::Mesh(_) => true,
            Members::Baked(placements) => placements
                .iter()
                .all(|&i| geometry.placements[i as usize].world_from_mesh.is_identity()),
        }
    }

    /// A ref for every triangle: its box in this frame, its placement ([`MISS`] for a shared
    /// mesh) and its number.
    pub(crate) fn refs(&self, geometry: &Geometry) -> Vec<Ref> {
        use rayon::prelude::*;
        let mut refs = Vec::with_capacity(self.len(geometry));
        let mut append = |placement: u32| {
            let source = self.source(geometry, placement);
            let count = index(source.triangles.len());
            refs.par_extend((0..count).into_par_iter().with_min_len(1 << 12).map(|triangle| {
                let (lo, hi) = outward(source.corners(triangle));
                Ref { lo, first: placement, hi, second: triangle }
            }));
        };
        match &self.members {
            Members::Mesh(_) => append(MISS),
            Members::Baked(placements) => placements.iter().copied().for_each(append),
        }
        refs
    }
}

/// The triangles of one mesh on their way into a frame, for loops over many.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Source<'a> {
    frame: Frame,
    /// `None` when it changes nothing, or when the frame is the mesh's own.
    transform: Option<&'a Transform>,
    triangles: &'a [[u32; 3]],
    positions: Slice<'a>,
}

#[derive(Debug, Clone, Copy)]
enum Slice<'a> {
    F32(&'a [f32], usize),
    F64(&'a [[f64; 3]]),
}

impl Source<'_> {
    /// The corners of a triangle in the mesh's frame.
    #[inline(always)]
    pub(crate) fn local_corners(&self, triangle: u32) -> [DVec3; 3] {
        let [a, b, c] = self.triangles[triangle as usize];
        [self.position(a), self.position(b), self.position(c)]
    }

    /// The corners of a triangle in the part's frame.
    #[inline(always)]
    pub(crate) fn corners(&self, triangle: u32) -> [DVec3; 3] {
        let [a, b, c] = self.local_corners(triangle);
        match self.transform {
            None => [self.frame.local(a), self.frame.local(b), self.frame.local(c)],
            Some(t) => [self.frame.baked(t, a), self.frame.baked(t, b), self.frame.baked(t, c)],
        }
    }

    #[inline(always)]
    fn position(&self, i: u32) -> DVec3 {
        match self.positions {
            Slice::F32(floats, stride) => {
                let start = i as usize * stride;
                let p = &floats[start..start + 3];
                DVec3::new(p[0].into(), p[1].into(), p[2].into())
            }
            Slice::F64(positions) => positions[i as usize].into(),
        }
    }
}

/// The single-precision box around `points`, rounded outward.
#[inline]
pub(crate) fn outward<const N: usize>(points: [DVec3; N]) -> ([f32; 3], [f32; 3]) {
    let mut bounds = Bounds::EMPTY;
    for point in points {
        bounds.include(point);
    }
    (bounds.min.to_array().map(round_down), bounds.max.to_array().map(round_up))
}

/// The largest f32 not above `x`.
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "rounding is the point")]
pub(crate) fn round_down(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) > x { near.next_down() } else { near }
}

/// The smallest f32 not below `x`.
#[inline]
pub(crate) fn round_up(x: f64) -> f32 {
    -round_down(-x)
}
