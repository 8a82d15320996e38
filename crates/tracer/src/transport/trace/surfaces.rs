//! The surfaces that the lanes of a block hit, looked up, and the normals that light is scattered about.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use std::hint::select_unpredictable;

use etendue_geometry::block::{Floats as Row, LANES};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Geometry, RayBlock};

use super::compaction::{Mask, mask};
use super::lane::{Lane, single};
use crate::placed::{Facets, PlacedSurfaces, SurfaceKind, SurfaceRow, SurfaceTable};
use crate::surface::LEAST_ELEVATION;

/// The surfaces of a scene, and where their meshes are.
#[derive(Debug, Clone, Copy)]
pub(in crate::transport) struct Surfaces<'a, F> {
    pub(super) all: &'a SurfaceTable,
    pub(super) placed: &'a PlacedSurfaces,
    pub(super) geometry: &'a Geometry,
    pub(super) varied: &'a TextureLookups,
    /// Bound on the error of a hit, and of what leaves it, relative to the numbers that it is worked out of.
    pub(super) roundings: F,
    /// Hits are beside an edge of their triangle where their least barycentric weight is below this
    /// ([`super::EDGE_WEIGHT`]).
    pub(super) edge_weight: F,
}

/// Values by lane of surfaces that are not alike all over; empty where all are.
#[derive(Debug, Default)]
pub(in crate::transport) struct TextureLookups {
    pub(super) lookups: Vec<TextureLookup>,
    /// Colours, `[lane][band]`, and those of highlights with the dips of measured metals, where bands are not red, green
    /// and blue.
    pub(super) colors: Vec<f32>,
    pub(super) facet_bands: Vec<[f64; 2]>,
}

impl TextureLookups {
    /// Those of surfaces that are all alike all over.
    pub(super) const NONE: &'static Self =
        &Self { lookups: Vec::new(), colors: Vec::new(), facet_bands: Vec::new() };
}

/// Values of a surface that is not alike all over, where it was hit.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct TextureLookup {
    /// Red, green and blue, and the largest band of any.
    pub(super) color: [f32; 3],
    pub(super) base_peak: f64,
    /// About which light is scattered, of any length and side, where normals are mapped.
    pub(super) normal: [f64; 3],
    /// Its facets, where these are not alike all over.
    pub(super) facets: Facets,
    /// It is worked out by itself.
    pub(super) is_single: bool,
}

impl<F: Lane> Surfaces<'_, F> {
    /// Magnitudes of a placement's own numbers, which add to the rounding of a hit (m) and which single precision need not hold.
    #[inline(always)]
    fn magnitudes(&self, placement: u32, surface: &SurfaceRow) -> [F; 3] {
        if F::HAS_ENDS {
            let placed = self.placed.get(placement);
            let Some(placed) = placed else { return [F::ZERO; 3] };
            return single(placed.magnitudes);
        }
        let [x, y, z] = surface.magnitudes;
        [F::from(x), F::from(y), F::from(z)]
    }

    /// The normal of a mesh's corners where a lane hit one of its triangles, in the world, of any length and side; zero
    /// of a mesh without.
    #[inline(always)]
    fn mesh_normal(&self, block: &RayBlock<F>, lane: usize, turn: &[[f32; 3]; 3]) -> [F; 3] {
        let Some(placement) = self.geometry.placements.get(block.placement[lane] as usize) else {
            return [F::ZERO; 3];
        };
        let mesh = self.geometry.mesh_of(placement);
        let Some(normals) = &mesh.normals else { return [F::ZERO; 3] };
        let [a, b, c] = mesh.triangles[block.triangle[lane] as usize];
        // No `map`: what it is given becomes a call for each number, since it has not this function's instructions.
        let (a, b, c) = (normals.get(a as usize), normals.get(b as usize), normals.get(c as usize));
        let (u, v) = (block.u[lane], block.v[lane]);
        let (mut own, mut normal) = ([F::ZERO; 3], [F::ZERO; 3]);
        for k in 0..3 {
            own[k] = (F::ONE - u - v) * F::from(a[k]) + u * F::from(b[k]) + v * F::from(c[k]);
        }
        for k in 0..3 {
            let [x, y, z] = turn[k];
            normal[k] = F::from(x) * own[0] + F::from(y) * own[1] + F::from(z) * own[2];
        }
        normal
    }
}

/// The surfaces that the lanes of a block hit, looked up.
#[derive(Debug)]
pub(super) struct BlockLookup<F> {
    /// The block's first lane, counted from the first block.
    pub(super) first: usize,
    /// Red, green and blue; or what has each lane's bands: its material, or with the bit [`VARIED`] itself, counted from
    /// the first block.
    color: [Row<F>; 3],
    source: [u32; LANES],
    pub(super) magnitudes: [Row<F>; 3],
    pub(super) scatters: Mask,
    /// Those that scatter light which are sheets of facets, and which are smooth.
    pub(super) sheets: Mask,
    pub(super) smooth: Mask,
    /// Those that are worked out one by one; of these, which scatter light of single directions alone, and whose surfaces
    /// light may pass.
    pub(super) single: Mask,
    pub(super) delta: Mask,
    pub(super) passed: Mask,
    /// The normals of meshes, of any length and side, where some lane has one; else zero.
    pub(super) tilted: Option<[Row<F>; 3]>,
}

/// The bit of lanes whose colours are looked up.
const VARIED: u32 = 1 << 31;

impl<F: Lane> BlockLookup<F> {
    /// Nothing yet, of the block whose first lane that is.
    #[inline(always)]
    pub(super) fn nothing(first: usize) -> Self {
        Self {
            first,
            color: [[F::ZERO; LANES]; 3],
            source: [0; LANES],
            magnitudes: [[F::ZERO; LANES]; 3],
            scatters: [0; LANES],
            sheets: [0; LANES],
            smooth: [0; LANES],
            single: [0; LANES],
            delta: [0; LANES],
            passed: [0; LANES],
            tilted: None,
        }
    }

    /// All lanes' colours by band, of which `rows` has room for those that are not red, green and blue.
    #[inline(always)]
    pub(super) fn colors<'b, const RGB: bool>(
        &'b self,
        surfaces: Surfaces<'_, F>,
        rows: &'b mut [Row<F>],
    ) -> &'b [Row<F>] {
        if RGB {
            return &self.color;
        }
        let count = rows.len();
        for (lane, source) in self.source.into_iter().enumerate() {
            let first = (source & !VARIED) as usize * count;
            let own = match source & VARIED {
                0 => surfaces.all.color_of(source),
                _ => surfaces.varied.colors.get(first..first + count).unwrap_or_default(),
            };
            for (row, band) in rows.iter_mut().zip(own) {
                row[lane] = F::from(*band);
            }
        }
        rows
    }

    /// Lanes that ask for light.
    #[inline(always)]
    pub(super) fn asks(&self) -> Mask {
        let mut asks = self.scatters;
        for i in 0..LANES {
            asks[i] &= !(self.smooth[i] | self.delta[i]);
        }
        asks
    }

    /// Tests whether some lane hit a matte surface.
    #[inline(always)]
    pub(super) fn has_matte(&self) -> bool {
        let mut matte = self.scatters;
        for i in 0..LANES {
            matte[i] &= !(self.sheets[i] | self.smooth[i] | self.single[i]);
        }
        matte != [0; LANES]
    }

    /// Tests whether some lane hit a sheet or a smooth surface.
    #[inline(always)]
    pub(super) fn has_facets(&self) -> bool {
        (self.sheets != [0; LANES]) | (self.smooth != [0; LANES])
    }

    /// Looks up what the lanes of a block hit, of which the first `count` are rays; each that hit what shines goes to
    /// `meets`, each that hit nothing to `misses`.
    #[inline(always)]
    pub(super) fn look_up<const TILTED: bool, const RICH: bool, const RGB: bool>(
        &mut self,
        surfaces: Surfaces<'_, F>,
        block: &RayBlock<F>,
        count: usize,
        mut meets: impl FnMut(usize),
        mut misses: impl FnMut(usize),
    ) {
        let first = self.first;
        let all = &*surfaces.all.all;
        let Some(last) = all.len().checked_sub(1) else { return };
        for lane in 0..LANES {
            let surface = &all[(block.placement[lane] as usize).min(last)];
            let is_varied = RICH && surface.is_varied && lane < count;
            let varied = surfaces.varied.lookups.get(first + lane).filter(|_| is_varied);
            if RGB {
                let own = || surfaces.all.rgb_of(surface.material);
                let color = varied.map_or_else(own, |varied| &varied.color);
                for band in 0..3 {
                    self.color[band][lane] = F::from(color[band]);
                }
            } else if lane < count {
                #[expect(clippy::cast_possible_truncation, reason = "a batch has few")]
                let own = (first + lane) as u32 | VARIED;
                self.source[lane] = if varied.is_some() { own } else { surface.material };
            }
            let magnitudes = surfaces.magnitudes(block.placement[lane], surface);
            for axis in 0..3 {
                self.magnitudes[axis][lane] = magnitudes[axis];
            }
            let is_hit = surface.is_there & (lane < count);
            let scatters = (surface.kind != SurfaceKind::Black) & is_hit;
            self.scatters[lane] = mask(scatters);
            if RICH {
                let is_single = surface.kind == SurfaceKind::Other
                    || varied.is_some_and(|varied| varied.is_single);
                self.single[lane] = mask(is_single & is_hit);
                let is_sheet = (surface.kind == SurfaceKind::Sheet) & !is_single;
                self.sheets[lane] = mask(is_sheet & is_hit);
                self.smooth[lane] = mask((surface.kind == SurfaceKind::Smooth) & is_hit);
            }
            if surface.shines & is_hit {
                meets(lane);
            }
            if RICH && (!surface.is_there & (lane < count)) {
                misses(lane);
            }
            if !TILTED || !scatters || (RICH && self.single[lane] != 0) {
                continue;
            }
            if let Some(turn) = &surface.turn {
                let normal = match varied.filter(|_| surface.is_mapped) {
                    Some(varied) => single(DVec3::from_array(varied.normal)),
                    None => surfaces.mesh_normal(block, lane, turn),
                };
                let tilted = self.tilted.get_or_insert([[F::ZERO; LANES]; 3]);
                (tilted[0][lane], tilted[1][lane], tilted[2][lane]) = normal.into();
            }
        }
    }
}

/// The hits of a block.
pub(super) struct Hits<F> {
    pub(super) point: [Row<F>; 3],
    pub(super) normal: [Row<F>; 3],
    /// The normals of meshes that light is scattered about, on the viewer's side, where there are any.
    pub(super) bent: [Row<F>; 3],
    pub(super) error: Row<F>,
    pub(super) back: [Row<F>; 3],
    /// Lanes whose surfaces light may pass, so that rays to lights may leave them on either side.
    pub(super) passed: Mask,
    /// Lanes that see the front.
    pub(super) front: Mask,
}

impl<F: Lane> Hits<F> {
    /// The normals that light is scattered about.
    #[inline(always)]
    pub(super) fn shading<const TILTED: bool>(&self) -> &[Row<F>; 3] {
        if TILTED { &self.bent } else { &self.normal }
    }
}

/// Normals that light is scattered about, of the meshes' own, as [`crate::surface::facing`] bends them; the triangle's,
/// which faces the viewer, where there is none.
#[inline(always)]
pub(super) fn bend<F: Lane>(
    tilted: &[Row<F>; 3],
    normal: &[Row<F>; 3],
    direction: &[Row<F>; 3],
) -> [Row<F>; 3] {
    let (mut shading, mut squared, mut along) =
        ([[F::ZERO; LANES]; 3], [F::ZERO; LANES], [F::ZERO; LANES]);
    // Squares of what is as long as a file has it may be too small or too large.
    let (mut unit, mut largest) = (*tilted, [F::ZERO; LANES]);
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
        let scale = if along[i] < F::ZERO { -F::ONE } else { F::ONE } / squared[i].sqrt();
        let has = (squared[i] > F::ZERO) & (squared[i] <= F::MAX);
        for axis in 0..3 {
            let own = unit[axis][i] * scale;
            shading[axis][i] = select_unpredictable(has, own, normal[axis][i]);
        }
    }
    let dot = |a: &[Row<F>; 3], b: &[Row<F>; 3], i: usize| {
        a[0][i] * b[0][i] + a[1][i] * b[1][i] + a[2][i] * b[2][i]
    };
    let mut bent = [[F::ZERO; LANES]; 3];
    for i in 0..LANES {
        let cosine = -dot(&shading, direction, i);
        let (mut above, slope) = (F::ZERO, dot(&shading, normal, i));
        let (mut mirrored, mut half) = ([F::ZERO; 3], [F::ZERO; 3]);
        for axis in 0..3 {
            mirrored[axis] = F::of(2.0) * cosine * shading[axis][i] + direction[axis][i];
            above += normal[axis][i] * mirrored[axis];
        }
        let lacking = -F::of(LEAST_ELEVATION) * dot(normal, direction, i) - above;
        let (mut length, lift) = (F::ZERO, lacking / slope);
        for axis in 0..3 {
            mirrored[axis] += shading[axis][i] * lift;
            length += mirrored[axis] * mirrored[axis];
        }
        let (inverse, mut size) = (F::ONE / length.sqrt(), F::ZERO);
        for axis in 0..3 {
            half[axis] = mirrored[axis] * inverse - direction[axis][i];
            size += half[axis] * half[axis];
        }
        let inverse = F::ONE / size.sqrt();
        let bends =
            (lacking > F::ZERO) & (slope > F::ZERO) & (inverse > F::ZERO) & (inverse <= F::MAX);
        for axis in 0..3 {
            let own = select_unpredictable(bends, half[axis] * inverse, shading[axis][i]);
            bent[axis][i] = select_unpredictable(cosine > F::ZERO, own, normal[axis][i]);
        }
    }
    bent
}
