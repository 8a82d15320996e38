//! Hits that are worked out one by one, looked up: how their surfaces scatter light, between which media; and glass that
//! parts wavelengths, which sends a path of each band.

use etendue_geometry::block::LANES;

use super::lane::{Lane, round, single, wide};
use super::single::{SingleHit, SingleHits};
use super::{SCATTERED, SPECULAR, TraceStep, Workspace};
use crate::Scattering;
use crate::transport::dispersion::Boundary;
use crate::transport::{Draw, Tracing};

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Looks up the scattering of light by the surface that a lane hit, which is worked out by itself.
    pub(super) fn look_up_single<F: Lane>(
        &self,
        step: TraceStep<'_>,
        workspace: &mut Workspace<F>,
        lane: usize,
        singles: &mut SingleHits,
    ) -> Option<()> {
        let hit = self.hit_of(&workspace.rays, lane, workspace.carried.ray[lane]);
        let placement = hit.id[0];
        let mut interaction = self.interaction_of(step, workspace, lane, &hit)?;
        let (media, coincident) = (workspace.carried.media_of(lane), self.coincident_of(&hit));
        let crossing = self.cross(media, placement, coincident, &mut interaction);
        let (scene, spectral) = (&self.ctx.scene, self.ctx.spectral);
        let mut wavelength = workspace.carried.wavelength_of(lane);
        let mut is_parted = false;
        if let Scattering::Dielectric(glass) = &interaction.material.scattering
            && wavelength.is_none()
            && interaction.disperses(scene)
        {
            is_parted = glass.roughness == 0.0;
            if is_parted {
                let bsdf = interaction.bsdf(scene, spectral, spectral.wavelength(0))?;
                let boundary = Boundary { lane, interaction: &interaction, bsdf };
                self.part(step.number, workspace, &boundary);
            } else {
                wavelength = self.keep_one_of(workspace, lane);
            }
        }
        let wavelength = wavelength.unwrap_or_else(|| spectral.wavelength(0));
        let bsdf = interaction.bsdf(scene, spectral, wavelength)?;
        let passes = self.ctx.placed.get(placement).is_some_and(|placed| !placed.is_opaque);
        let lane = u32::try_from(lane).unwrap_or(u32::MAX);
        singles.push(SingleHit { lane, bsdf, passes, crossing, is_parted });
        Some(())
    }

    /// Keeps one band of the path of a lane; its wavelength (nm).
    fn keep_one_of<F: Lane>(&self, workspace: &mut Workspace<F>, lane: usize) -> Option<f64> {
        let u = wide(workspace.numbers[Draw::Choice as usize][0][lane]);
        let light = &mut workspace.light;
        light.clear();
        light.extend(workspace.carried.throughput.iter().map(|column| wide(column[lane])));
        let wavelength = self.keep_one(u, light);
        for (column, band) in workspace.carried.throughput.iter_mut().zip(light) {
            column[lane] = round(*band);
        }
        workspace.carried.wavelengths.resize(workspace.carried.len, None);
        workspace.carried.wavelengths[lane] = wavelength;
        wavelength
    }

    /// Sends the paths that leave a boundary whose index is each band's own, before those of all other surfaces.
    fn part<F: Lane>(&self, number: u32, workspace: &mut Workspace<F>, boundary: &Boundary<'_>) {
        let lane = boundary.lane;
        let drawn = |draw: Draw, k: usize| {
            workspace.numbers[draw as usize][k].get(lane).map_or(0.5, |&number| wide(number))
        };
        let light = [drawn(Draw::Light, 0), drawn(Draw::Light, 1)];
        let (choice, chance) = (drawn(Draw::Choice, 1), drawn(Draw::Chance, 1));
        let carried = &workspace.carried;
        let bands = carried.throughput.iter().map(|column| wide(column[lane]));
        let before: Vec<f64> = bands.collect();
        let origin = F::origin(self.ctx.accel);
        let next = &mut workspace.next;
        self.part_bands(boundary, &before, light, choice, |way, wavelength, part| {
            if !self.goes_on(number + 1, chance, &before, part) {
                return;
            }
            let to = next.len;
            next.reserve(to + LANES, part.len(), true);
            let start = single(boundary.interaction.anchor.leave(way.direction) - origin);
            let along = single(way.direction);
            for axis in 0..3 {
                next.start[axis][to] = start[axis];
                next.along[axis][to] = along[axis];
            }
            next.reach[to] = F::INFINITY;
            next.left[to] = u32::try_from(lane).unwrap_or(u32::MAX);
            next.carried.ray[to] = carried.ray[lane];
            next.carried.flags[to] = SPECULAR | (carried.flags[lane] & SCATTERED);
            for (column, band) in next.carried.throughput.iter_mut().zip(part) {
                column[to] = round(*band);
            }
            next.carried.wavelengths.push(wavelength);
            next.len += 1;
        });
    }
}
