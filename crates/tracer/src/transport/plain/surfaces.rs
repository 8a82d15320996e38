//! What is looked up for the hits of a block, and the normals that light is scattered about.

use std::hint::select_unpredictable;

use etendue_geometry::block::{Floats as Row, LANES};
use etendue_geometry::{Geometry, RayBlock};

use super::kernel::{Mask, ZERO, mask};
use crate::placed::PlainSurface;

#[expect(clippy::cast_possible_truncation, reason = "single precision is enough for it")]
const LEAST_ELEVATION: f32 = crate::surface::LEAST_ELEVATION as f32;

/// The surfaces of a plain scene by placement, behind the last one that is not there, and where their meshes are.
#[derive(Debug, Clone, Copy)]
pub(in crate::transport) struct Surfaces<'a> {
    pub(super) all: &'a [PlainSurface],
    pub(super) geometry: &'a Geometry,
    /// Some scatter light about other normals than those of their triangles.
    pub(super) are_tilted: bool,
}

impl Surfaces<'_> {
    /// The normal of a mesh's corners where a lane hit one of its triangles, in the world, of any length and side; zero
    /// of a mesh without.
    #[inline(always)]
    fn mesh_normal(&self, block: &RayBlock, lane: usize, turn: &[[f32; 3]; 3]) -> [f32; 3] {
        let Some(placement) = self.geometry.placements.get(block.placement[lane] as usize) else {
            return [0.0; 3];
        };
        let mesh = self.geometry.mesh_of(placement);
        let Some(normals) = &mesh.normals else { return [0.0; 3] };
        let [a, b, c] = mesh.triangles[block.triangle[lane] as usize];
        let [a, b, c] = [a, b, c].map(|corner| normals.get(corner as usize));
        let (u, v) = (block.u[lane], block.v[lane]);
        let mut own = [0.0; 3];
        for k in 0..3 {
            own[k] = (1.0 - u - v) * a[k] + u * b[k] + v * c[k];
        }
        let [x, y, z] = turn;
        let along = |row: &[f32; 3]| row[0] * own[0] + row[1] * own[1] + row[2] * own[2];
        [along(x), along(y), along(z)]
    }
}

/// What is looked up for the hits of a block.
pub(super) struct Found {
    pub(super) color: [Row; 3],
    pub(super) magnitudes: [Row; 3],
    pub(super) scatters: Mask,
    /// The normals of meshes, of any length and side, where some lane has one; else zero.
    pub(super) tilted: Option<[Row; 3]>,
}

impl Found {
    /// What the lanes of a block hit, of which so many are rays; each that hit what shines goes to `meets`.
    #[inline(always)]
    pub(super) fn of<const TILTED: bool>(
        surfaces: Surfaces<'_>,
        (block, count): (&RayBlock, usize),
        mut meets: impl FnMut(usize),
    ) -> Self {
        let mut found =
            Self { color: [ZERO; 3], magnitudes: [ZERO; 3], scatters: [0; LANES], tilted: None };
        let Some(last) = surfaces.all.len().checked_sub(1) else { return found };
        for lane in 0..LANES {
            let surface = &surfaces.all[(block.placement[lane] as usize).min(last)];
            for axis in 0..3 {
                found.color[axis][lane] = surface.color[axis];
                found.magnitudes[axis][lane] = surface.magnitudes[axis];
            }
            let is_hit = surface.is_there & (lane < count);
            let scatters = surface.scatters & is_hit;
            found.scatters[lane] = mask(scatters);
            if surface.shines & is_hit {
                meets(lane);
            }
            if !TILTED || !scatters {
                continue;
            }
            if let Some(turn) = &surface.turn {
                let normal = surfaces.mesh_normal(block, lane, turn);
                let tilted = found.tilted.get_or_insert([ZERO; 3]);
                (tilted[0][lane], tilted[1][lane], tilted[2][lane]) = normal.into();
            }
        }
        found
    }
}

/// Normals that light is scattered about, of the meshes' own, as [`crate::surface::facing`] bends them; the triangle's,
/// which faces the viewer, where there is none.
#[inline(always)]
pub(super) fn bend(tilted: &[Row; 3], normal: &[Row; 3], direction: &[Row; 3]) -> [Row; 3] {
    let (mut shading, mut squared, mut along) = ([ZERO; 3], ZERO, ZERO);
    // Squares of what is as long as a file has it may be too small or too large.
    let (mut unit, mut largest) = (*tilted, ZERO);
    for row in tilted {
        for i in 0..LANES {
            let size = row[i].abs();
            largest[i] = if size > largest[i] { size } else { largest[i] };
        }
    }
    for axis in 0..3 {
        for i in 0..LANES {
            unit[axis][i] /= largest[i];
            squared[i] += unit[axis][i] * unit[axis][i];
            along[i] += unit[axis][i] * normal[axis][i];
        }
    }
    for i in 0..LANES {
        // Some files' normals point inwards; the triangle's winding decides.
        let scale = if along[i] < 0.0 { -1.0 } else { 1.0 } / squared[i].sqrt();
        let has = (squared[i] > 0.0) & (squared[i] <= f32::MAX);
        for axis in 0..3 {
            let own = unit[axis][i] * scale;
            shading[axis][i] = select_unpredictable(has, own, normal[axis][i]);
        }
    }
    let dot = |a: &[Row; 3], b: &[Row; 3], i: usize| {
        a[0][i] * b[0][i] + a[1][i] * b[1][i] + a[2][i] * b[2][i]
    };
    let mut bent = [ZERO; 3];
    for i in 0..LANES {
        let cosine = -dot(&shading, direction, i);
        let (mut above, slope) = (0.0, dot(&shading, normal, i));
        let (mut mirrored, mut half) = ([0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            mirrored[axis] = 2.0 * cosine * shading[axis][i] + direction[axis][i];
            above += normal[axis][i] * mirrored[axis];
        }
        let lacking = -LEAST_ELEVATION * dot(normal, direction, i) - above;
        let (mut length, lift) = (0.0, lacking / slope);
        for axis in 0..3 {
            mirrored[axis] += shading[axis][i] * lift;
            length += mirrored[axis] * mirrored[axis];
        }
        let (inverse, mut size) = (1.0 / length.sqrt(), 0.0);
        for axis in 0..3 {
            half[axis] = mirrored[axis] * inverse - direction[axis][i];
            size += half[axis] * half[axis];
        }
        let inverse = 1.0 / size.sqrt();
        let bends = (lacking > 0.0) & (slope > 0.0) & (inverse > 0.0) & (inverse <= f32::MAX);
        for axis in 0..3 {
            let own = select_unpredictable(bends, half[axis] * inverse, shading[axis][i]);
            bent[axis][i] = select_unpredictable(cosine > 0.0, own, normal[axis][i]);
        }
    }
    bent
}
