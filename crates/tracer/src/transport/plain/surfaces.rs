//! What is looked up for the hits of a block one by one, in double precision: colours and normals that are not alike
//! all over a surface, and sheets of facets, whose arithmetic ([`crate::bsdf::sheets`]) is the same as of other scenes.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use etendue_geometry::RayBlock;
use etendue_geometry::block::{Floats as Row, LANES};
use etendue_geometry::glam::DVec3;

use super::kernel::{Hits, Stage, double, round, single};
use crate::bsdf::sheets::Sheets;
use crate::footprint::Footprint;
use crate::reference::SurfacePoint;
use crate::surface::facing;
use crate::transport::metal::{mean_reflectance, multiple};
use crate::{Scattering, Tint};

type Doubles = [f64; LANES];

/// The sheets of facets that a block hit, with their colours by band.
#[derive(Debug, Default)]
pub(super) struct PlainSheets {
    sheets: Sheets<LANES>,
    normal: [Doubles; 3],
    shading: [Doubles; 3],
    color: [Doubles; 3],
    highlight: [Doubles; 3],
    /// What the reflectance of a measured metal lacks of Schlick's.
    dip: [Doubles; 3],
    /// Of light that met several facets.
    deep: [Doubles; 3],
}

/// Looks up the hits that have to be, of a block whose first path has a number.
pub(super) fn look_up(
    stage: &Stage<'_>,
    (block, first): (&RayBlock, usize),
    hits: &mut Hits,
    sheets: &mut PlainSheets,
) {
    let scene = &stage.ctx.scene;
    for lane in (0..LANES).filter(|&lane| hits.varies[lane]) {
        let number = block.placement[lane];
        let Some(placed) = stage.ctx.placed.get(number) else { continue };
        let Some(placement) = scene.geometry.placements.get(number as usize) else { continue };
        let corner = SurfacePoint::corner(scene.geometry, placement, block.triangle[lane] as usize);
        let u = f64::from(block.u[lane]).clamp(0.0, 1.0);
        let v = f64::from(block.v[lane]).clamp(0.0, 1.0);
        let footprint = footprint(stage, hits, (lane, first + lane));
        let point = SurfacePoint { weights: [1.0 - u - v, u, v], footprint, ..corner };
        let Some(material) = scene.material(&point) else { continue };
        if placed.is_tilted {
            let front = double(&block.normal, lane).normalize();
            let direction = double(&block.direction, lane);
            let side = if front.dot(direction) <= 0.0 { 1.0 } else { -1.0 };
            let tilted = point.tilted_normal(scene, material, placed.turn.as_ref(), front);
            put(&mut hits.shading, lane, facing(tilted * side, front * side, -direction));
        }
        let tint = placed
            .color
            .unwrap_or_else(|| scene.base_tint(stage.ctx.spectral, material, &point).0.clamped());
        for band in 0..3 {
            hits.color[band][lane] = round(tint.color[band]);
        }
        if hits.is_sheet[lane] {
            sheets.look_up(stage, lane, (&point, &material.scattering), &tint);
        }
    }
    if hits.has_sheets {
        sheets.view(block, hits);
    }
}

/// How much of a surface a camera's ray covers; `None` of others, which are scattered by chance.
fn footprint(stage: &Stage<'_>, hits: &Hits, (lane, ray): (usize, usize)) -> Option<Footprint> {
    let rays = stage.camera?;
    let direction = rays.direction(ray);
    let way = (stage.plain.origin + double(&hits.point, lane)) - rays.origin(ray);
    let cone = stage.ctx.scene.view.cone(direction)?.after(way.dot(direction));
    Some(Footprint { direction, width: cone.width })
}

impl PlainSheets {
    /// What is known of a sheet of facets of this colour.
    fn look_up(
        &mut self,
        stage: &Stage<'_>,
        lane: usize,
        (point, scattering): (&SurfacePoint<'_>, &Scattering),
        tint: &Tint,
    ) {
        let spectral = stage.ctx.spectral;
        let Some((surface, named)) = scattering.sheet(point, &stage.ctx.scene, spectral) else {
            return;
        };
        surface.put(&mut self.sheets, lane, tint);
        for band in 0..3 {
            let [color, dip] = match named {
                Some(named) => spectral.metal(named, band),
                None => [tint.color[band], 0.0],
            };
            self.color[band][lane] = color;
            self.dip[band][lane] = dip;
            self.highlight[band][lane] = surface.highlight.color[band];
        }
    }

    /// As seen by the rays of a block.
    #[inline(always)]
    fn view(&mut self, block: &RayBlock, hits: &Hits) {
        (self.normal, self.shading) = (doubles(&hits.normal), doubles(&hits.shading));
        self.sheets.view(&self.shading, &doubles(&block.direction));
        for band in 0..3 {
            for i in 0..LANES {
                let reflectance = mean_reflectance(self.color[band][i], self.dip[band][i]);
                self.deep[band][i] = multiple(reflectance, self.sheets.mean[i]);
            }
        }
    }

    /// For the hits on sheets, what they turn to the viewer of the light that is asked, over its density, and its
    /// colour.
    #[inline(always)]
    pub(super) fn reflect(
        &mut self,
        hits: &Hits,
        (toward, pdf, is_delta): (&[Row; 3], &Row, &[bool; LANES]),
        (value, color): (&mut Row, &mut [Row; 3]),
    ) {
        let normals = [&self.normal, &self.shading];
        let (pdf, mut delta, mut share) = (double_row(pdf), [0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            delta[i] = if is_delta[i] { 1.0 } else { 0.0 };
        }
        self.sheets.reflect(normals, (&doubles(toward), &pdf, &delta), &mut share);
        for i in 0..LANES {
            value[i] = if hits.is_sheet[i] { round(share[i]) } else { value[i] };
        }
        for band in 0..3 {
            let own = self.in_band(band);
            for i in 0..LANES {
                color[band][i] = if hits.is_sheet[i] { own[i] } else { color[band][i] };
            }
        }
    }

    /// For the hits on sheets, directions by choices and squares, their densities (1/sr), and whether there are such;
    /// what is carried is multiplied by the surface's value over density.
    #[inline(always)]
    pub(super) fn scatter(
        &mut self,
        hits: &Hits,
        (choices, [u, v]): (&Row, [Row; 2]),
        (along, pdf, goes): (&mut [Row; 3], &mut Row, &mut [bool; LANES]),
        throughput: &mut [Row; 3],
    ) {
        let mut squares = [[0.0; 2]; LANES];
        for i in 0..LANES {
            squares[i] = [f64::from(u[i]), f64::from(v[i])];
        }
        let (mut own_along, mut own_pdf) = ([[0.0; LANES]; 3], [0.0; LANES]);
        let normals = [&self.normal, &self.shading];
        let chosen = (&double_row(choices), &squares);
        self.sheets.scatter(normals, chosen, (&mut own_along, &mut own_pdf));
        for axis in 0..3 {
            for i in 0..LANES {
                let own = round(own_along[axis][i]);
                along[axis][i] = if hits.is_sheet[i] { own } else { along[axis][i] };
            }
        }
        for i in 0..LANES {
            let own = round(own_pdf[i]);
            pdf[i] = if hits.is_sheet[i] { own } else { pdf[i] };
            goes[i] = if hits.is_sheet[i] { own > 0.0 } else { goes[i] };
        }
        for band in 0..3 {
            let own = self.in_band(band);
            for i in 0..LANES {
                throughput[band][i] *= if hits.is_sheet[i] { own[i] } else { 1.0 };
            }
        }
    }

    /// What the sheets have of light in a band, by the weights that were found last.
    #[inline(always)]
    fn in_band(&self, band: usize) -> Row {
        let [white, base, highlight, dip, deep] = self.sheets.rows();
        let mut sums = [0.0; LANES];
        for i in 0..LANES {
            let of_facets = white[i]
                + base[i] * self.color[band][i]
                + highlight[i] * self.highlight[band][i]
                + dip[i] * self.dip[band][i];
            let sum = of_facets + deep[i] * self.deep[band][i];
            sums[i] = round(if sum > 0.0 { sum } else { 0.0 });
        }
        sums
    }
}

#[inline(always)]
fn doubles(rows: &[Row; 3]) -> [Doubles; 3] {
    // Closures of `map` are not compiled for the processor's own instructions.
    [double_row(&rows[0]), double_row(&rows[1]), double_row(&rows[2])]
}

#[inline(always)]
fn double_row(row: &Row) -> Doubles {
    let mut doubles = [0.0; LANES];
    for i in 0..LANES {
        doubles[i] = f64::from(row[i]);
    }
    doubles
}

fn put(rows: &mut [Row; 3], lane: usize, v: DVec3) {
    let v = single(v);
    for axis in 0..3 {
        rows[axis][lane] = v[axis];
    }
}
