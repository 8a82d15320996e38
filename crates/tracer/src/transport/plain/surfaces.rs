//! What is looked up for the hits of a block, and the normals that light is scattered about.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use std::hint::select_unpredictable;

use etendue_geometry::block::{Floats as Row, LANES};
use etendue_geometry::{Geometry, RayBlock};

use super::kernel::{Mask, ZERO, mask};
use crate::placed::{PlainFacets, PlainKind, PlainSurfaces};

#[expect(clippy::cast_possible_truncation, reason = "single precision is enough for it")]
const LEAST_ELEVATION: f32 = crate::surface::LEAST_ELEVATION as f32;

/// The surfaces of a plain scene, and where their meshes are.
#[derive(Debug, Clone, Copy)]
pub(in crate::transport) struct Surfaces<'a> {
    pub(super) all: &'a PlainSurfaces,
    pub(super) geometry: &'a Geometry,
    pub(super) varied: &'a Varied,
}

/// What surfaces that are not alike all over have, by lane; empty where all are.
#[derive(Debug, Default)]
pub(in crate::transport) struct Varied {
    pub(super) lookups: Vec<TextureLookup>,
    /// Where bands are not red, green and blue: colours, `[lane][band]`, and those of highlights with the dips of
    /// measured metals.
    pub(super) colors: Vec<f32>,
    pub(super) facet_bands: Vec<[f64; 2]>,
}

impl Varied {
    /// What all have that are alike all over.
    pub(super) const NONE: &'static Self =
        &Self { lookups: Vec::new(), colors: Vec::new(), facet_bands: Vec::new() };
}

/// What a surface that is not alike all over has where it was hit.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct TextureLookup {
    /// Red, green and blue, and the largest band of any.
    pub(super) color: [f32; 3],
    pub(super) base_peak: f64,
    /// About which light is scattered, of any length and side, where normals are mapped.
    pub(super) normal: [f32; 3],
    /// Where these are not alike all over.
    pub(super) facets: PlainFacets,
    /// It is worked out by itself.
    pub(super) is_single: bool,
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
#[derive(Debug)]
pub(super) struct Found {
    /// Red, green and blue; or what has each lane's bands: its material, or with the bit [`VARIED`] itself, counted from
    /// the first block.
    color: [Row; 3],
    source: [u32; LANES],
    pub(super) magnitudes: [Row; 3],
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
    pub(super) tilted: Option<[Row; 3]>,
}

/// The bit of lanes whose colours are looked up.
const VARIED: u32 = 1 << 31;

impl Found {
    pub(super) const NOTHING: Self = Self {
        color: [ZERO; 3],
        source: [0; LANES],
        magnitudes: [ZERO; 3],
        scatters: [0; LANES],
        sheets: [0; LANES],
        smooth: [0; LANES],
        single: [0; LANES],
        delta: [0; LANES],
        passed: [0; LANES],
        tilted: None,
    };

    /// All lanes' colours by band, of which `rows` has room for those that are not red, green and blue.
    #[inline(always)]
    pub(super) fn colors<'b, const RGB: bool>(
        &'b self,
        surfaces: Surfaces<'_>,
        rows: &'b mut [Row],
    ) -> &'b [Row] {
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
                row[lane] = *band;
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

    /// Tests whether some lane hit anything but a matte surface.
    #[inline(always)]
    pub(super) fn has_facets(&self) -> bool {
        (self.sheets != [0; LANES]) | (self.smooth != [0; LANES])
    }

    /// What the lanes of a block hit from the first on, of which so many are rays; each that hit what shines goes to `meets`, each that
    /// hit nothing to `misses`.
    #[inline(always)]
    pub(super) fn look_up<const TILTED: bool, const RICH: bool, const RGB: bool>(
        &mut self,
        surfaces: Surfaces<'_>,
        (block, first, count): (&RayBlock, usize, usize),
        (mut meets, mut misses): (impl FnMut(usize), impl FnMut(usize)),
    ) {
        let all = &*surfaces.all.all;
        let Some(last) = all.len().checked_sub(1) else { return };
        for lane in 0..LANES {
            let surface = &all[(block.placement[lane] as usize).min(last)];
            let is_varied = RICH && surface.is_varied && lane < count;
            let varied = surfaces.varied.lookups.get(first + lane).filter(|_| is_varied);
            if RGB {
                let color = varied.map_or(&surface.color, |varied| &varied.color);
                for band in 0..3 {
                    self.color[band][lane] = color[band];
                }
            } else if lane < count {
                #[expect(clippy::cast_possible_truncation, reason = "a batch has few")]
                let own = (first + lane) as u32 | VARIED;
                self.source[lane] = if varied.is_some() { own } else { surface.material };
            }
            for axis in 0..3 {
                self.magnitudes[axis][lane] = surface.magnitudes[axis];
            }
            let is_hit = surface.is_there & (lane < count);
            let scatters = (surface.kind != PlainKind::Black) & is_hit;
            self.scatters[lane] = mask(scatters);
            if RICH {
                let is_single = surface.kind == PlainKind::Other
                    || varied.is_some_and(|varied| varied.is_single);
                self.single[lane] = mask(is_single & is_hit);
                let is_sheet = (surface.kind == PlainKind::Sheet) & !is_single;
                self.sheets[lane] = mask(is_sheet & is_hit);
                self.smooth[lane] = mask((surface.kind == PlainKind::Smooth) & is_hit);
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
                    Some(varied) => varied.normal,
                    None => surfaces.mesh_normal(block, lane, turn),
                };
                let tilted = self.tilted.get_or_insert([ZERO; 3]);
                (tilted[0][lane], tilted[1][lane], tilted[2][lane]) = normal.into();
            }
        }
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
