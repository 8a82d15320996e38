//! Light of the sky.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use std::f64::consts::FRAC_1_PI;

use etendue_geometry::RayBlocks;
use etendue_geometry::block::{Floats as Row, LANES, vector};
use etendue_geometry::glam::{DMat3, DVec3};

use super::block_lights::{BlockLights, OTHER};
use super::choose::{ChosenLights, OtherPlace};
use super::lane::{Lane, round, single, wide, widen};
use super::{Columns, RayColumns, SCATTERED, SPECULAR, TraceStep, Workspace};
use crate::Spectral;
use crate::environment::{EnvironmentMap, MapLookup, MapSampler, place};
use crate::sampling::GridCell;
use crate::transport::Tracing;

/// The sky of a scene.
#[derive(Debug, Clone, Copy)]
pub(super) struct SkyView<'a> {
    /// Its number among all lights.
    pub(super) index: usize,
    pub(super) map: Option<(&'a EnvironmentMap, &'a MapSampler)>,
    world_from_map: DMat3,
    /// Radiance where its image has 1.
    pub(super) bands: &'a [f64],
    visible: bool,
    /// All lights, where the bands are not those of its colours.
    of_spectra: Option<&'a crate::lights::Lights>,
}

/// Paths that met the sky, side by side.
struct SkyHits<F> {
    direction: [Row<F>; 3],
    /// Density (1/sr) of the direction, and the chance with which the sky was asked where it began; 1 and 0 where no
    /// light was asked in its stead.
    pdf: Row<F>,
    chance: Row<F>,
    /// Of the surface that they left.
    normal: [Row<F>; 3],
}

impl<F: Lane> SkyHits<F> {
    const NOTHING: Self = Self {
        direction: [[F::ZERO; LANES]; 3],
        pdf: [F::ONE; LANES],
        chance: [F::ZERO; LANES],
        normal: [[F::ZERO; LANES]; 3],
    };

    /// Takes a path, which left a surface where the sky may have been asked, too.
    #[inline(always)]
    fn put(
        &mut self,
        i: usize,
        carried: &Columns<F>,
        own: usize,
        direction: [F; 3],
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

impl<'a> SkyView<'a> {
    /// That of all lights.
    pub(super) fn of(lights: &'a crate::lights::Lights, count: usize) -> Option<Self> {
        let sky = lights.sky.as_ref()?;
        Some(Self {
            index: sky.index,
            map: sky.map.as_ref().map(|(map, sampler)| (&**map, sampler)),
            world_from_map: sky.world_from_map,
            bands: lights.bands_of(sky.index, count),
            visible: sky.visible,
            of_spectra: (!sky.is_of_colors()).then_some(lights),
        })
    }

    /// The light that comes where its image has a colour, in all bands: of a sky of spectra by the place on its image.
    #[inline(always)]
    fn light<const RGB: bool>(
        &self,
        spectral: &Spectral,
        color: [f64; 3],
        at: impl FnOnce() -> [f64; 2],
        light: &mut [f64],
    ) {
        if !RGB && let Some(lights) = self.of_spectra {
            return lights.spread_sky(spectral, at(), &color.map(wide), light);
        }
        // How many there are of red, green and blue is known when the program is compiled.
        let bands = if RGB { 3 } else { light.len() };
        for (k, band) in light[..bands].iter_mut().enumerate() {
            *band = self.band::<RGB>(spectral, color, k);
        }
    }

    /// The place on its image of a lane's direction.
    fn place_of<F: Lane>(&self, directions: &[Row<F>; 3], lane: usize) -> [f64; 2] {
        place(self.world_from_map.transpose() * vector(directions, lane).normalize())
    }

    /// A band of the light that comes where its image has a colour, of 1 without one.
    #[inline(always)]
    fn band<const RGB: bool>(&self, spectral: &Spectral, color: [f64; 3], band: usize) -> f64 {
        let own = match (RGB, self.map) {
            (_, None) => 1.0,
            (true, _) => color[band],
            (false, _) => spectral.band(&color, band),
        };
        own * self.bands[band]
    }
}

/// The colours of a sky's image along the ways that paths arrived by, and their weights against having been asked.
struct SkyLight<F> {
    color: [Row<F>; 3],
    weight: Row<F>,
}

impl<F: Lane> SkyLight<F> {
    #[inline(always)]
    fn color(&self, lane: usize) -> [F; 3] {
        [self.color[0][lane], self.color[1][lane], self.color[2][lane]]
    }
}

/// Vectors carried by a rotation, row by row.
#[inline(always)]
fn turned<F: Lane>(rows: DMat3, [x, y, z]: &[Row<F>; 3]) -> [Row<F>; 3] {
    let mut turned = [[F::ZERO; LANES]; 3];
    for axis in 0..3 {
        let row = rows.row(axis);
        let [a, b, c] = single::<F>(row);
        for i in 0..LANES {
            turned[axis][i] = a * x[i] + b * y[i] + c * z[i];
        }
    }
    turned
}

#[multiversion::multiversion(targets = "simd")]
fn light_of<F: Lane>(sky: &SkyView<'_>, arrived: &SkyHits<F>, light: &mut SkyLight<F>) {
    let (mut density, mut color) = ([F::ZERO; LANES], [[F::ONE; LANES]; 3]);
    match sky.map {
        Some((map, sampler)) => {
            let own = turned(sky.world_from_map.transpose(), &arrived.direction);
            let lit: MapLookup<F, LANES> = sampler.in_directions(map, own);
            (density, color) = (lit.densities, lit.colors);
        }
        None => {
            for i in 0..LANES {
                let (mut cosine, mut is_one_sided) = (F::ZERO, false);
                for axis in 0..3 {
                    cosine += arrived.normal[axis][i] * arrived.direction[axis][i];
                    is_one_sided |= arrived.normal[axis][i] != F::ZERO;
                }
                let shown = if cosine > F::ZERO { cosine } else { F::ZERO };
                density[i] = if is_one_sided { shown } else { F::of(0.25) } * F::of(FRAC_1_PI);
            }
        }
    }
    light.color = color;
    for i in 0..LANES {
        let ratio = arrived.chance[i] * density[i] / arrived.pdf[i];
        light.weight[i] = F::ONE / (F::ONE + ratio * ratio);
    }
}

fn number_of(sky: &SkyView<'_>) -> u32 {
    u32::try_from(sky.index).unwrap_or_default()
}

/// Directions to the sky's image in the patches that lanes chose.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn place_on_sky<F: Lane, const RGB: bool>(
    sky: &SkyView<'_>,
    spectral: &Spectral,
    chosen: &mut ChosenLights<F>,
) {
    let Some((map, sampler)) = sky.map else { return };
    let (cells, mut radiance) =
        (std::mem::take(&mut chosen.cells), std::mem::take(&mut chosen.bands));
    for (number, run) in cells.chunks(LANES).enumerate() {
        let mut patches = [GridCell::default(); LANES];
        patches[..run.len()].copy_from_slice(run);
        let lit: MapLookup<F, LANES> = sampler.in_patches(map, &patches);
        let directions = turned(sky.world_from_map, &lit.directions);
        for i in 0..run.len() {
            let (lane, chance) = chosen.of_sky[number * LANES + i];
            let density = lit.densities[i] * chance;
            if density > F::ZERO {
                let axis = |rows: &[Row<F>; 3]| [rows[0][i], rows[1][i], rows[2][i]];
                let (is_far, is_delta) = (true, false);
                let (light, place) = (number_of(sky), axis(&directions));
                let own = OtherPlace { light, place, is_far, is_delta, density, side: None };
                let at = || [wide(lit.places[0][i]), wide(lit.places[1][i])];
                sky.light::<RGB>(spectral, widen(axis(&lit.colors)), at, &mut radiance);
                chosen.put(lane as usize, &own, &radiance);
            }
        }
    }
    (chosen.cells, chosen.bands) = (cells, radiance);
}

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Adds the light of disks far away, such as the sun's, to which the camera or mirrors and smooth boundaries alone led
    /// paths: surfaces that scatter light ask for theirs.
    pub(super) fn add_disks<F: Lane>(
        &mut self,
        step: TraceStep<'_>,
        workspace: &mut Workspace<F>,
        out: &mut [f64],
    ) {
        let Workspace { missed, rays, carried, light, .. } = workspace;
        if !self.ctx.lights.has_disks() || (step.number > 0 && carried.flags.is_empty()) {
            return;
        }
        let count = self.count();
        for &own in &*missed {
            let own = own as usize;
            if step.number > 0 && carried.flags[own] & SCATTERED != 0 {
                continue;
            }
            let direction = direction_of(step, rays, own).normalize();
            let time = self.time_of(carried.ray[own]);
            for (index, radiance) in self.ctx.lights.disks_in(direction, time, step.number == 0) {
                let throughput = carried.throughput.iter().map(|band| radiance * wide(band[own]));
                let bands = self.ctx.lights.bands_of(index, count);
                light.clear();
                light.extend(throughput.zip(bands).map(|(passed, band)| passed * band));
                let number_of_light = u32::try_from(index).unwrap_or_default();
                let group = || self.ctx.lights.group_of_any(&self.ctx.scene, number_of_light);
                let row = self.parts.row(carried.ray[own], step.number, group);
                self.add(light, row, out);
            }
        }
    }

    /// Adds the light of the sky that paths met.
    pub(super) fn add_sky<F: Lane>(
        &mut self,
        step: TraceStep<'_>,
        lights: &BlockLights<'_, F>,
        workspace: &Workspace<F>,
        out: &mut [f64],
    ) {
        let Some(sky) = lights.sky.filter(|sky| sky.visible || step.number > 0) else { return };
        let (flags, throughput) = (&workspace.carried.flags, &workspace.carried.throughput);
        let (mut lit, mut light) =
            (SkyLight { color: [[F::ZERO; LANES]; 3], weight: [F::ZERO; LANES] }, Vec::new());
        light.resize(self.count(), 0.0);
        for missed in workspace.missed.chunks(LANES) {
            let mut arrived = SkyHits::NOTHING;
            for (i, &own) in missed.iter().enumerate() {
                let own = own as usize;
                let direction = direction_of(step, &workspace.rays, own);
                let is_specular = flags.get(own).is_some_and(|flags| flags & SPECULAR != 0);
                let was_asked = step.number > 0 && !is_specular;
                arrived.put(i, &workspace.carried, own, single(direction), was_asked);
            }
            light_of(&sky, &arrived, &mut lit);
            for (i, &own) in missed.iter().enumerate() {
                let own = own as usize;
                let at = || sky.place_of(&arrived.direction, i);
                sky.light::<RGB>(self.ctx.spectral, widen(lit.color(i)), at, &mut light);
                for (k, band) in light.iter_mut().enumerate() {
                    *band *= wide(throughput[k][own] * lit.weight[i]);
                }
                let group = || self.ctx.lights.group_of_sky();
                let row = self.parts.row(workspace.carried.ray[own], step.number, group);
                self.add(&light, row, out);
            }
        }
    }
}

/// The direction of a path that met nothing. The camera's rays are not all traced: those that cannot hit anything are other
/// ones in blocks.
#[inline(always)]
fn direction_of<F: Lane>(step: TraceStep<'_>, rays: &RayBlocks<F>, own: usize) -> DVec3 {
    step.direction(own, || vector(&rays.blocks()[own / LANES].direction, own % LANES))
}

/// Makes last directions that meet nothing else that shines rays to the sky: they bring its light unless something is in between.
pub(super) fn ask_sky<F: Lane, const RGB: bool>(
    sky: &SkyView<'_>,
    spectral: &Spectral,
    last: &mut RayColumns<F>,
    shadows: &mut RayColumns<F>,
) {
    let mut lit = SkyLight { color: [[F::ZERO; LANES]; 3], weight: [F::ZERO; LANES] };
    let bands = shadows.carried.count::<RGB>();
    let (mut three, mut more) = ([0.0; 3], if RGB { Vec::new() } else { vec![0.0; bands] });
    let light: &mut [f64] = if RGB { &mut three } else { &mut more };
    for first in (0..last.len).step_by(LANES) {
        let mut arrived = SkyHits::NOTHING;
        let count = LANES.min(last.len - first);
        for i in 0..count {
            let [x, y, z] = &last.along;
            let direction = [x[first + i], y[first + i], z[first + i]];
            arrived.put(i, &last.carried, first + i, direction, true);
        }
        light_of(sky, &arrived, &mut lit);
        for i in 0..count {
            let (from, to) = (first + i, shadows.len);
            for axis in 0..3 {
                shadows.start[axis][to] = last.start[axis][from];
                shadows.along[axis][to] = last.along[axis][from];
            }
            let at = || sky.place_of(&arrived.direction, i);
            sky.light::<RGB>(spectral, widen(lit.color(i)), at, light);
            for band in 0..bands {
                let carried = wide(last.carried.throughput[band][from] * lit.weight[i]);
                shadows.carried.throughput[band][to] = round(carried * light[band]);
            }
            shadows.reach[to] = F::INFINITY;
            shadows.light[to] = number_of(sky) | OTHER;
            shadows.carried.ray[to] = last.carried.ray[from];
            shadows.left[to] = last.left[from];
            shadows.len += 1;
        }
    }
    last.len = 0;
}
