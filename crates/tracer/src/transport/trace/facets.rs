//! Sheets of facets and smooth surfaces among the hits of a block, in double precision: few numbers are theirs alone,
//! and highlights of smooth sheets are narrower than what single precision resolves.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use etendue_geometry::RayBlock;
use etendue_geometry::block::{Floats as Row, LANES};

use super::compaction::{Mask, mask};
use super::lane::{Lane, round};
use super::surfaces::{BlockLookup, Hits, Surfaces};
use crate::bsdf::Weights;
use crate::bsdf::metal::{mean_reflectance, multiple};
use crate::bsdf::sheets::{LightSamples, Sheets};
use crate::bsdf::smooth::SmoothSurfaces;

/// A row in double precision.
type WideRow = [f64; LANES];

/// The facets of a block's hits, kept for the next block.
#[derive(Debug, Default)]
pub(super) struct BlockFacets<F> {
    sheets: Box<Sheets<LANES>>,
    smooth: Box<SmoothSurfaces<LANES>>,
    normal: [WideRow; 3],
    shading: [WideRow; 3],
    direction: [WideRow; 3],
    bands: Vec<FacetBand>,
    /// Of what was scattered by chance what goes on, by band.
    scattered: Vec<Row<F>>,
}

/// A band of a block's facets.
#[derive(Debug, Clone, Copy, Default)]
struct FacetBand {
    base: WideRow,
    highlight: WideRow,
    dip: WideRow,
    /// Of what met several facets of a sheet.
    deep: WideRow,
}

/// The hits of a block, as facets are seen there.
pub(super) struct FacetHits<'a, F> {
    pub(super) block: &'a RayBlock<F>,
    pub(super) found: &'a BlockLookup<F>,
    pub(super) hits: &'a Hits<F>,
    /// Normals that light is scattered about.
    pub(super) shading: &'a [Row<F>; 3],
    /// By band.
    pub(super) colors: &'a [Row<F>],
}

/// The rays that leave a block's hits by chance, and what they carry.
pub(super) struct BsdfSamples<F> {
    pub(super) start: [Row<F>; 3],
    pub(super) along: [Row<F>; 3],
    pub(super) pdf: Row<F>,
    pub(super) goes: Mask,
    /// Those whose directions only their surfaces can give.
    pub(super) specular: Mask,
}

impl<F: Lane> BlockFacets<F> {
    /// Takes the facets of a block's hits as they are seen.
    #[inline(always)]
    pub(super) fn see<const RGB: bool>(
        &mut self,
        surfaces: Surfaces<'_, F>,
        seen: FacetHits<'_, F>,
    ) {
        see::<F, RGB>(self, surfaces, seen);
    }

    /// Puts the share of light from directions to lights that sheets turn to the viewer into `value`, in the lanes of
    /// sheets. How much of it in each band [`Self::sheets_in_band`] says.
    #[inline(always)]
    pub(super) fn reflect(
        &mut self,
        lanes: &Mask,
        samples: LightSamples<'_, F>,
        value: &mut Row<F>,
    ) {
        reflect(self, lanes, samples, value);
    }

    /// Puts the directions in which sheets and smooth surfaces send the paths in place of what is there. How much of the
    /// light in each band [`Self::in_band`] says.
    #[inline(always)]
    pub(super) fn scatter(
        &mut self,
        found: &BlockLookup<F>,
        hits: &Hits<F>,
        choice: &Row<F>,
        square: &[Row<F>; 2],
        scattered: &mut BsdfSamples<F>,
    ) {
        if found.sheets != [0; LANES] {
            scatter_sheets(self, &found.sheets, choice, square, scattered);
        }
        if found.smooth != [0; LANES] {
            scatter_smooth(self, &found.smooth, hits, choice, scattered);
        }
        let mut shares = std::mem::take(&mut self.scattered);
        shares.resize(self.bands.len(), [F::ZERO; LANES]);
        for (band, share) in shares.iter_mut().enumerate() {
            if found.sheets != [0; LANES] {
                self.sheets_in_band(&found.sheets, band, share);
            }
            if found.smooth != [0; LANES] {
                self.smooth_in_band(&found.smooth, band, share);
            }
        }
        self.scattered = shares;
    }

    /// Puts a band of what [`Self::scatter`] passes on in place of what is there.
    #[inline(always)]
    pub(super) fn in_band(&self, found: &BlockLookup<F>, band: usize, share: &mut Row<F>) {
        for i in 0..LANES {
            let is_own = found.sheets[i] | found.smooth[i] != 0;
            share[i] = if is_own { self.scattered[band][i] } else { share[i] };
        }
    }

    /// Puts a band of what sheets were last asked in place of what is there.
    #[inline(always)]
    pub(super) fn sheets_in_band(&self, lanes: &Mask, band: usize, share: &mut Row<F>) {
        for i in 0..LANES {
            let own = round(self.bands[band].of(self.sheets.weights(i), i));
            share[i] = if lanes[i] != 0 { own } else { share[i] };
        }
    }

    /// The same of smooth surfaces.
    #[inline(always)]
    fn smooth_in_band(&self, lanes: &Mask, band: usize, share: &mut Row<F>) {
        for i in 0..LANES {
            let own = round(self.bands[band].of(self.smooth.weights(i), i));
            share[i] = if lanes[i] != 0 { own } else { share[i] };
        }
    }
}

impl FacetBand {
    /// A lane's share of light.
    #[inline(always)]
    fn of(&self, value: Weights, lane: usize) -> f64 {
        let sum = value.white
            + value.base * self.base[lane]
            + value.highlight * self.highlight[lane]
            + value.dip * self.dip[lane]
            + value.deep * self.deep[lane];
        if sum > 0.0 { sum } else { 0.0 }
    }
}

#[inline(always)]
fn widen<F: Lane>(rows: &[Row<F>; 3], to: &mut [WideRow; 3]) {
    for axis in 0..3 {
        for i in 0..LANES {
            to[axis][i] = rows[axis][i].into();
        }
    }
}

#[multiversion::multiversion(targets = "simd")]
fn see<F: Lane, const RGB: bool>(
    facets: &mut BlockFacets<F>,
    surfaces: Surfaces<'_, F>,
    seen: FacetHits<'_, F>,
) {
    let FacetHits { block, found, hits, shading, colors } = seen;
    let first = found.first;
    widen(&hits.normal, &mut facets.normal);
    widen(shading, &mut facets.shading);
    widen(&block.direction, &mut facets.direction);
    let count = if RGB { 3 } else { surfaces.all.count() };
    let BlockFacets { sheets, smooth, bands, .. } = facets;
    bands.resize(count, FacetBand::default());
    for (band, color) in bands.iter_mut().zip(colors) {
        for i in 0..LANES {
            band.base[i] = color[i].into();
        }
    }
    // What lanes of other surfaces hold is of no use, and a number.
    sheets.alpha = [1.0; LANES];
    for lane in 0..LANES {
        if found.sheets[lane] | found.smooth[lane] == 0 {
            continue;
        }
        let surface = &surfaces.all.all[block.placement[lane] as usize];
        let varied = surfaces.varied.lookups.get(first + lane).filter(|_| surface.is_varied);
        let own = match varied.filter(|_| surface.has_own_facets) {
            Some(varied) => &varied.facets,
            None => &surfaces.all.facets[surface.material as usize],
        };
        if RGB {
            for k in 0..3 {
                (bands[k].highlight[lane], bands[k].dip[lane]) = (own.highlight[k], own.dip[k]);
            }
        } else {
            let own = match surface.has_own_facets {
                true => &surfaces.varied.facet_bands[(first + lane) * count..][..count],
                false => surfaces.all.facet_bands_of(surface.material),
            };
            for (band, [highlight, dip]) in bands.iter_mut().zip(own) {
                (band.highlight[lane], band.dip[lane]) = (*highlight, *dip);
            }
        }
        let is_metal = f64::from(u8::from(own.is_metal));
        if found.sheets[lane] != 0 {
            (sheets.alpha[lane], sheets.metallic[lane]) = (own.alpha, own.metallic);
            (sheets.f0[lane], sheets.f90[lane]) = (own.f0, own.f90);
            sheets.base_peak[lane] = match varied {
                Some(varied) => varied.base_peak,
                None => surfaces.all.facets[surface.material as usize].base_peak,
            };
            sheets.f0_peak[lane] = own.f0_peak;
            sheets.is_metal[lane] = is_metal;
        } else {
            smooth.is_metal[lane] = is_metal;
            let is_front = hits.front[lane] != 0;
            // Of a mirror 0.
            let from_behind = if own.ior > 0.0 { 1.0 / own.ior } else { 0.0 };
            smooth.eta[lane] = if is_front { own.ior } else { from_behind };
        }
    }
    if found.sheets == [0; LANES] {
        return;
    }
    sheets.view(&facets.shading, &facets.direction);
    for band in bands {
        for i in 0..LANES {
            let reflectance = mean_reflectance(band.base[i], band.dip[i]);
            band.deep[i] = multiple(reflectance, sheets.mean[i]);
        }
    }
}

#[multiversion::multiversion(targets = "simd")]
fn reflect<F: Lane>(
    facets: &mut BlockFacets<F>,
    lanes: &Mask,
    samples: LightSamples<'_, F>,
    value: &mut Row<F>,
) {
    let mut toward = [[0.0; LANES]; 3];
    widen(samples.toward, &mut toward);
    let (mut pdf, mut is_delta, mut found) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    for i in 0..LANES {
        (pdf[i], is_delta[i]) = (samples.pdf[i].into(), samples.is_delta[i].into());
    }
    let wide = LightSamples { toward: &toward, pdf: &pdf, is_delta: &is_delta };
    facets.sheets.reflect([&facets.normal, &facets.shading], wide, &mut found);
    for i in 0..LANES {
        value[i] = if lanes[i] != 0 { round(found[i]) } else { value[i] };
    }
}

#[multiversion::multiversion(targets = "simd")]
fn scatter_sheets<F: Lane>(
    facets: &mut BlockFacets<F>,
    lanes: &Mask,
    choice: &Row<F>,
    square: &[Row<F>; 2],
    scattered: &mut BsdfSamples<F>,
) {
    let (mut choices, mut squares) = ([0.0; LANES], [[0.0; 2]; LANES]);
    for i in 0..LANES {
        choices[i] = choice[i].into();
        squares[i] = [square[0][i].into(), square[1][i].into()];
    }
    let (mut along, mut pdf) = ([[0.0; LANES]; 3], [0.0; LANES]);
    let normals = [&facets.normal, &facets.shading];
    facets.sheets.scatter(normals, &choices, &squares, &mut along, &mut pdf);
    for axis in 0..3 {
        for i in 0..LANES {
            let own = round(along[axis][i]);
            let row = &mut scattered.along[axis];
            row[i] = if lanes[i] != 0 { own } else { row[i] };
        }
    }
    for i in 0..LANES {
        let is_own = lanes[i] != 0;
        let density = round(pdf[i]);
        scattered.pdf[i] = if is_own { density } else { scattered.pdf[i] };
        let goes = mask((density > F::ZERO) & (density <= F::MAX));
        scattered.goes[i] = if is_own { goes } else { scattered.goes[i] };
    }
}

#[multiversion::multiversion(targets = "simd")]
fn scatter_smooth<F: Lane>(
    facets: &mut BlockFacets<F>,
    lanes: &Mask,
    hits: &Hits<F>,
    choice: &Row<F>,
    scattered: &mut BsdfSamples<F>,
) {
    let mut choices = [0.0; LANES];
    for i in 0..LANES {
        choices[i] = choice[i].into();
    }
    let (mut along, mut goes) = ([[0.0; LANES]; 3], [0.0; LANES]);
    let normals = [&facets.normal, &facets.shading];
    facets.smooth.scatter(normals, &facets.direction, &choices, &mut along, &mut goes);
    let smooth = &facets.smooth;
    for axis in 0..3 {
        for i in 0..LANES {
            let is_own = lanes[i] != 0;
            let (along, row) = (round(along[axis][i]), &mut scattered.along[axis]);
            row[i] = if is_own { along } else { row[i] };
            let side = if smooth.refracts[i] > 0.0 { -hits.error[i] } else { hits.error[i] };
            // Rays that pass a surface leave it on the other side.
            let back = if smooth.eta[i] > 0.0 { F::ZERO } else { hits.back[axis][i] };
            let start = hits.point[axis][i] + (hits.normal[axis][i] * side + back);
            let row = &mut scattered.start[axis];
            row[i] = if is_own { start } else { row[i] };
        }
    }
    for i in 0..LANES {
        let own = mask(goes[i] > 0.0);
        scattered.goes[i] = if lanes[i] != 0 { own } else { scattered.goes[i] };
    }
}
