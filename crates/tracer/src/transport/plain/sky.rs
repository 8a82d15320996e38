//! Light of the sky in plain scenes.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use std::f32::consts::FRAC_1_PI;

use etendue_geometry::block::{Floats as Row, LANES, vector};
use etendue_geometry::glam::DMat3;

use super::kernel::{ZERO, round, single};
use super::lamps::{ChosenLamps, Lights, OTHER, OtherPlace};
use super::{Columns, PlainScratch, RayColumns, SPECULAR};
use crate::Spectral;
use crate::environment::{EnvironmentMap, MapLookup, MapSampler};
use crate::sampling::GridCell;
use crate::transport::{RaySamples, Tracing};

/// The sky of a plain scene.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlainSky<'a> {
    /// Which of the lights it is.
    pub(super) index: usize,
    pub(super) map: Option<(&'a EnvironmentMap, &'a MapSampler)>,
    world_from_map: DMat3,
    /// Radiance where its image has 1.
    pub(super) bands: &'a [f64],
    visible: bool,
}

/// What paths that met the sky brought there, side by side.
struct SkyHits {
    direction: [Row; 3],
    /// Density (1/sr) of the direction, and the chance with which the sky was asked where it began; 1 and 0 where no
    /// light was asked in its stead.
    pdf: Row,
    chance: Row,
    /// Of the surface that they left.
    normal: [Row; 3],
}

impl SkyHits {
    const NOTHING: Self =
        Self { direction: [ZERO; 3], pdf: [1.0; LANES], chance: ZERO, normal: [ZERO; 3] };

    /// Takes a path, which left a surface where the sky may have been asked, too.
    #[inline(always)]
    fn put(
        &mut self,
        i: usize,
        (carried, own): (&Columns, usize),
        direction: [f32; 3],
        was_asked: bool,
    ) {
        for axis in 0..3 {
            self.direction[axis][i] = direction[axis];
        }
        if was_asked {
            (self.pdf[i], self.chance[i]) = (carried.pdf[own], carried.sky_chance[own]);
            for axis in 0..3 {
                self.normal[axis][i] = carried.normal[axis][own];
            }
        }
    }
}

impl<'a> PlainSky<'a> {
    /// That of all lights.
    pub(super) fn of(lights: &'a crate::lights::Lights, count: usize) -> Option<Self> {
        let sky = lights.sky.as_ref()?;
        Some(Self {
            index: sky.index,
            map: sky.map.as_ref().map(|(map, sampler)| (&**map, sampler)),
            world_from_map: sky.world_from_map,
            bands: lights.bands_of(sky.index, count),
            visible: sky.visible,
        })
    }

    /// A band of the light that comes where its image has a colour, of 1 without one.
    #[inline(always)]
    fn band<const RGB: bool>(&self, spectral: &Spectral, color: [f32; 3], band: usize) -> f64 {
        let own = match (RGB, self.map) {
            (_, None) => 1.0,
            (true, _) => f64::from(color[band]),
            (false, _) => spectral.band(&color.map(f64::from), band),
        };
        own * self.bands[band]
    }
}

/// The colours of a sky's image along the ways that paths arrived by, and their weights against having been asked.
struct SkyLight {
    color: [Row; 3],
    weight: Row,
}

impl SkyLight {
    #[inline(always)]
    fn color(&self, lane: usize) -> [f32; 3] {
        [self.color[0][lane], self.color[1][lane], self.color[2][lane]]
    }
}

/// Vectors carried by a rotation, row by row.
#[inline(always)]
fn turned(rows: DMat3, [x, y, z]: &[Row; 3]) -> [Row; 3] {
    let mut turned = [ZERO; 3];
    for axis in 0..3 {
        let row = rows.row(axis);
        let [a, b, c] = [round(row.x), round(row.y), round(row.z)];
        for i in 0..LANES {
            turned[axis][i] = a * x[i] + b * y[i] + c * z[i];
        }
    }
    turned
}

#[multiversion::multiversion(targets = "simd")]
fn light_of(sky: &PlainSky<'_>, arrived: &SkyHits, light: &mut SkyLight) {
    let (mut density, mut color) = (ZERO, [[1.0; LANES]; 3]);
    match sky.map {
        Some((map, sampler)) => {
            let own = turned(sky.world_from_map.transpose(), &arrived.direction);
            let lit: MapLookup<f32, LANES> = sampler.in_directions(map, own);
            (density, color) = (lit.densities, lit.colors);
        }
        None => {
            for i in 0..LANES {
                let (mut cosine, mut is_one_sided) = (0.0, false);
                for axis in 0..3 {
                    cosine += arrived.normal[axis][i] * arrived.direction[axis][i];
                    is_one_sided |= arrived.normal[axis][i] != 0.0;
                }
                let shown = if cosine > 0.0 { cosine } else { 0.0 };
                density[i] = if is_one_sided { shown } else { 0.25 } * FRAC_1_PI;
            }
        }
    }
    light.color = color;
    for i in 0..LANES {
        let ratio = arrived.chance[i] * density[i] / arrived.pdf[i];
        light.weight[i] = 1.0 / (1.0 + ratio * ratio);
    }
}

fn number_of(sky: &PlainSky<'_>) -> u32 {
    u32::try_from(sky.index).unwrap_or_default()
}

/// Directions to the sky's image in the patches that lanes chose.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn place_on_sky<const RGB: bool>(
    sky: &PlainSky<'_>,
    spectral: &Spectral,
    chosen: &mut ChosenLamps,
) {
    let Some((map, sampler)) = sky.map else { return };
    let (cells, mut radiance) =
        (std::mem::take(&mut chosen.cells), std::mem::take(&mut chosen.light));
    for (number, run) in cells.chunks(LANES).enumerate() {
        let mut patches = [GridCell::default(); LANES];
        patches[..run.len()].copy_from_slice(run);
        let lit: MapLookup<f32, LANES> = sampler.in_patches(map, &patches);
        let directions = turned(sky.world_from_map, &lit.directions);
        for i in 0..run.len() {
            let (lane, chance) = chosen.of_sky[number * LANES + i];
            let density = lit.densities[i] * chance;
            if density > 0.0 {
                let axis = |rows: &[Row; 3]| [rows[0][i], rows[1][i], rows[2][i]];
                let (is_far, is_delta) = (true, false);
                let (light, place) = (number_of(sky), axis(&directions));
                let own = OtherPlace { light, place, is_far, is_delta, density };
                let color = axis(&lit.colors);
                for (k, band) in radiance.iter_mut().enumerate() {
                    *band = sky.band::<RGB>(spectral, color, k);
                }
                chosen.put(lane as usize, &own, &radiance);
            }
        }
    }
    (chosen.cells, chosen.light) = (cells, radiance);
}

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Adds the light of the sky that paths met.
    pub(super) fn add_sky_plain(
        &mut self,
        (camera, number): (&RaySamples<'_>, u32),
        lights: &Lights<'_>,
        plain: &PlainScratch,
        out: &mut [f64],
    ) {
        let Some(sky) = lights.sky.filter(|sky| sky.visible || number > 0) else { return };
        let (flags, throughput) = (&plain.carried.flags, &plain.carried.throughput);
        let (mut lit, mut light) = (SkyLight { color: [ZERO; 3], weight: ZERO }, Vec::new());
        light.resize(self.count(), 0.0);
        for missed in plain.missed.chunks(LANES) {
            let mut arrived = SkyHits::NOTHING;
            for (i, &own) in missed.iter().enumerate() {
                let own = own as usize;
                // The camera's rays are not all traced: those that cannot hit anything are other ones in blocks.
                let direction = match number {
                    0 => camera.rays.direction(own),
                    _ => vector(&plain.rays.blocks()[own / LANES].direction, own % LANES),
                };
                let is_specular = flags.get(own).is_some_and(|flags| flags & SPECULAR != 0);
                let was_asked = number > 0 && !is_specular;
                arrived.put(i, (&plain.carried, own), single(direction), was_asked);
            }
            light_of(&sky, &arrived, &mut lit);
            for (i, &own) in missed.iter().enumerate() {
                let own = own as usize;
                for (k, band) in light.iter_mut().enumerate() {
                    let carried = f64::from(throughput[k][own] * lit.weight[i]);
                    *band = carried * sky.band::<RGB>(self.ctx.spectral, lit.color(i), k);
                }
                let group = || self.ctx.lights.group_of_sky();
                let row = self.parts.row(plain.carried.ray[own], number, group);
                self.add(&light, row, out);
            }
        }
    }
}

/// Makes last directions rays to the sky, where nothing else shines: they bring its light unless something is in between.
pub(super) fn ask_sky<const RGB: bool>(
    sky: &PlainSky<'_>,
    spectral: &Spectral,
    last: &mut RayColumns,
    shadows: &mut RayColumns,
) {
    let mut lit = SkyLight { color: [ZERO; 3], weight: ZERO };
    for first in (0..last.len).step_by(LANES) {
        let mut arrived = SkyHits::NOTHING;
        let count = LANES.min(last.len - first);
        for i in 0..count {
            let direction = [0, 1, 2].map(|axis| last.along[axis][first + i]);
            arrived.put(i, (&last.carried, first + i), direction, true);
        }
        light_of(sky, &arrived, &mut lit);
        for i in 0..count {
            let (from, to) = (first + i, shadows.len);
            for axis in 0..3 {
                shadows.start[axis][to] = last.start[axis][from];
                shadows.along[axis][to] = last.along[axis][from];
            }
            for band in 0..shadows.carried.count::<RGB>() {
                let carried = f64::from(last.carried.throughput[band][from] * lit.weight[i]);
                let light = carried * sky.band::<RGB>(spectral, lit.color(i), band);
                shadows.carried.throughput[band][to] = round(light);
            }
            shadows.reach[to] = f32::INFINITY;
            shadows.lamp[to] = number_of(sky) | OTHER;
            shadows.carried.ray[to] = last.carried.ray[from];
            shadows.len += 1;
        }
    }
    last.len = 0;
}
