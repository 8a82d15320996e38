//! What surfaces that are not alike all over have where paths hit them, and how much of them each path sees.

use etendue_geometry::block::{LANES, vector};
use etendue_geometry::glam::DVec3;

use super::kernel::{round, single};
use super::single::SingleHits;
use super::surfaces::{Surfaces, TextureLookup, Varied};
use super::{PlainScratch, SPECULAR};
use crate::Scattering;
use crate::footprint::{Cone, Footprint};
use crate::placed::{LEAST_ALPHA, PlainFacets, PlainKind, PlainSurfaces};
use crate::reference::SurfacePoint;
use crate::surface::SurfaceInteraction;
use crate::transport::{RaySamples, Tracing};

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Looks up the colours, facets and normals of hits on surfaces that are not alike all over.
    pub(super) fn look_up_varied(
        &self,
        (camera, number): (&RaySamples<'_>, u32),
        surfaces: Surfaces<'_>,
        plain: &mut PlainScratch,
    ) {
        if !surfaces.all.are_varied {
            plain.varied.lookups.clear();
            plain.singles.clear();
            return;
        }
        let mut varied = std::mem::take(&mut plain.varied);
        let mut singles = std::mem::take(&mut plain.singles);
        singles.clear();
        let (len, count) = (plain.carried.len, self.count());
        varied.lookups.resize(len, TextureLookup::default());
        if !RGB {
            varied.colors.resize(len * count, 0.0);
            varied.facet_bands.resize(len * count, [0.0; 2]);
        }
        for lane in 0..len {
            let placement = plain.rays.blocks()[lane / LANES].placement[lane % LANES];
            let own = surfaces.all.all.get(placement as usize);
            if own.is_some_and(|own| own.is_varied) {
                let found = (&mut varied, &mut singles);
                self.look_up_lane((camera, number), surfaces, plain, (lane, found));
            }
        }
        plain.varied = varied;
        plain.singles = singles;
    }

    /// The same of one lane; what its surface has that is alike all over is left.
    fn look_up_lane(
        &self,
        (camera, number): (&RaySamples<'_>, u32),
        surfaces: Surfaces<'_>,
        plain: &PlainScratch,
        (lane, (varied, singles)): (usize, (&mut Varied, &mut SingleHits)),
    ) -> Option<()> {
        let (block, i) = (&plain.rays.blocks()[lane / LANES], lane % LANES);
        let (scene, spectral) = (&self.ctx.scene, self.ctx.spectral);
        let number_of = block.placement[i];
        let placement = scene.geometry.placements.get(number_of as usize)?;
        let (placed, own) =
            (self.ctx.placed.get(number_of)?, &surfaces.all.all[number_of as usize]);
        let corner = SurfacePoint::corner(scene.geometry, placement, block.triangle[i] as usize);
        let [u, v] = [block.u[i], block.v[i]].map(|weight| f64::from(weight).clamp(0.0, 1.0));
        let cone = self.plain_cone((camera, number), plain, lane);
        let direction = || match number {
            0 => camera.rays.direction(lane),
            _ => vector(&block.direction, i),
        };
        let footprint = cone.map(|Cone { width, .. }| Footprint { direction: direction(), width });
        let time = self.time_of(plain.carried.ray[lane]);
        let point = SurfacePoint { weights: [1.0 - u - v, u, v], time, footprint, ..corner };
        let material = scene.material(&point)?;
        varied.lookups[lane].is_single = false;
        if own.kind == PlainKind::Other {
            return self.look_up_single((plain, direction()), (number_of, point), (lane, singles));
        }
        let is_measured = matches!(&material.scattering, Scattering::Metal { named: Some(_), .. });
        let looked_up = || scene.base_tint(spectral, material, &point).0.clamped();
        let tint = placed.color.unwrap_or_else(looked_up);
        let bands = lane * self.count()..(lane + 1) * self.count();
        let found = &mut varied.lookups[lane];
        (found.color, found.base_peak) = (tint.color.map(round), tint.peak());
        if is_measured {
            found.color = own.color;
        }
        if !RGB {
            let known = surfaces.all.color_of(own.material);
            for (k, band) in varied.colors[bands.clone()].iter_mut().enumerate() {
                *band = if is_measured { known[k] } else { round(spectral.tint(&tint, k)) };
            }
        }
        if let Scattering::Gltf(surface) = &material.scattering
            && own.has_own_facets
        {
            let sheet = surface.sheet(&point, scene, spectral);
            found.facets = PlainFacets::of_sheet(&sheet);
            if sheet.alpha < LEAST_ALPHA {
                found.is_single = true;
                let hit = (plain, direction());
                return self.look_up_single(hit, (number_of, point), (lane, singles));
            }
            if !RGB {
                for (k, band) in varied.facet_bands[bands].iter_mut().enumerate() {
                    *band = [spectral.tint(&sheet.highlight, k), 0.0];
                }
            }
        }
        if own.is_mapped {
            let front = vector(&block.normal, i).normalize();
            let turn = placed.turn.as_ref();
            found.normal = single(point.tilted_normal(scene, material, turn, front));
        }
        Some(())
    }

    /// How the surface that a lane hit scatters light, which is worked out by itself.
    fn look_up_single(
        &self,
        (plain, direction): (&PlainScratch, DVec3),
        (placement, point): (u32, SurfacePoint<'_>),
        (lane, singles): (usize, &mut SingleHits),
    ) -> Option<()> {
        let (block, i) = (&plain.rays.blocks()[lane / LANES], lane % LANES);
        let origin = self.ctx.accel.blocks().map_or(DVec3::ZERO, |blocks| blocks.origin());
        let from = (origin + vector(&block.origin, i), direction);
        let hit = (f64::from(block.t_max[i]), vector(&block.normal, i).normalize());
        let interaction = SurfaceInteraction::at(self.ctx, (placement, point), from, hit)?;
        let spectral = self.ctx.spectral;
        let bsdf = interaction.bsdf(&self.ctx.scene, spectral, spectral.wavelength(0));
        let passes = self.ctx.placed.get(placement).is_some_and(|placed| !placed.is_opaque);
        singles.push(u32::try_from(lane).unwrap_or(u32::MAX), bsdf, passes);
        Some(())
    }

    /// What the path of a lane stands for where it hit, which is a point where it was scattered by chance.
    fn plain_cone(
        &self,
        (camera, number): (&RaySamples<'_>, u32),
        plain: &PlainScratch,
        lane: usize,
    ) -> Option<Cone> {
        let (block, i) = (&plain.rays.blocks()[lane / LANES], lane % LANES);
        let t = f64::from(block.t_max[i]);
        if number > 0 {
            let is_specular = plain.carried.flags.get(lane)? & SPECULAR != 0;
            let [width, spread] = plain.carried.cone.each_ref().map(|row| f64::from(row[lane]));
            return (is_specular && width >= 0.0).then(|| Cone { width, spread }.after(t));
        }
        let origin = self.ctx.accel.blocks().map_or(DVec3::ZERO, |blocks| blocks.origin());
        let hit = origin + vector(&block.origin, i) + vector(&block.direction, i) * t;
        // A block's ray may start nearer.
        let (start, direction) = (camera.rays.origin(lane), camera.rays.direction(lane));
        let cone = self.ctx.scene.view.cone(direction)?;
        Some(cone.after((hit - start).dot(direction)))
    }

    /// Gives paths that leave mirrors and smooth boundaries the cones that met these.
    pub(super) fn carry_cones(
        &self,
        (camera, number): (&RaySamples<'_>, u32),
        surfaces: &PlainSurfaces,
        plain: &mut PlainScratch,
    ) {
        if !(surfaces.are_varied && surfaces.are_smooth) {
            return;
        }
        for i in 0..plain.next.len {
            let is_specular = plain.next.carried.flags[i] & SPECULAR != 0;
            let left = plain.next.left[i] as usize;
            let cone = self.plain_cone((camera, number), plain, left).filter(|_| is_specular);
            // Less than nothing where it is a point.
            let own = cone.map_or([-1.0; 2], |cone| [cone.width, cone.spread].map(round));
            for (row, own) in plain.next.carried.cone.iter_mut().zip(own) {
                row[i] = own;
            }
        }
    }
}
