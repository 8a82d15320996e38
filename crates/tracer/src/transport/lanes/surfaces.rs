//! What is looked up for the hits of a patch, by kind of surface: colours, shading normals, facets, indices.

use etendue_geometry::block::LANES as BLOCK;

use super::super::Tracing;
use super::super::patch::{LANES, Patch, SheetColors, at, put};
use super::{Paths, Stage};
use crate::bsdf::{Bsdf, Model};
use crate::placed::PlacedSurface;
use crate::reference::SurfacePoint;
use crate::scattering::SheetSurface;
use crate::surface::SurfaceInteraction;
use crate::{Conductor, Scattering, Tint};

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Where a hit is on its mesh, as path `i` sees it.
    pub(super) fn point_of(
        &self,
        stage: &Stage<'_>,
        now: &Paths,
        i: usize,
    ) -> Option<(u32, SurfacePoint<'_>)> {
        let geometry = self.stage.surroundings.geometry;
        let (block, lane) = (&now.rays.blocks()[i / BLOCK], i % BLOCK);
        let id = block.placement[lane];
        let placement = geometry.placements.get(id as usize)?;
        let corner = SurfacePoint::corner(geometry, placement, block.triangle[lane] as usize);
        let [u, v] = [block.u[lane], block.v[lane]].map(|w| f64::from(w.clamp(0.0, 1.0)));
        let footprint = self.footprint(stage, now, i);
        Some((id, SurfacePoint { weights: [1.0 - u - v, u, v], footprint, ..corner }))
    }

    /// What is known of a hit on a matte surface: its colour, and its shading normal where that is not the
    /// triangle's.
    #[inline(always)]
    pub(super) fn look_up_matte(
        &self,
        stage: &Stage<'_>,
        now: &Paths,
        patch: &mut Patch,
        (i, lane): (usize, usize),
        placed: &PlacedSurface,
    ) {
        put(&mut patch.seen.magnitudes, lane, placed.magnitudes);
        if let (Some(color), false) = (placed.color, placed.is_tilted) {
            patch.colors[lane] = color;
        } else if let Some((_, surface_point)) = self.point_of(stage, now, i) {
            self.look_up(patch, lane, placed, &surface_point);
        }
    }

    /// Colour and shading normal of a hit where they are not alike all over.
    fn look_up(
        &self,
        patch: &mut Patch,
        lane: usize,
        placed: &PlacedSurface,
        surface_point: &SurfacePoint<'_>,
    ) {
        let scene = &self.stage.surroundings;
        let Some(material) = scene.material(surface_point) else { return };
        if placed.is_tilted {
            patch.is_tilted = true;
            let front = at(&patch.seen.normal, lane);
            let tilted = surface_point.tilted_normal(scene, material, placed.turn.as_ref(), front);
            put(&mut patch.seen.shading, lane, tilted);
        }
        patch.colors[lane] = placed.color.unwrap_or_else(|| {
            scene.base_tint(self.stage.spectral, material, surface_point).0.clamped()
        });
    }

    /// What is known of a hit on a sheet of facets; whether it is rough.
    pub(super) fn look_up_sheet(
        &self,
        stage: &Stage<'_>,
        now: &Paths,
        patch: &mut Patch,
        (i, lane): (usize, usize),
        placed: &PlacedSurface,
    ) -> bool {
        let scene = &self.stage.surroundings;
        let Some((_, surface_point)) = self.point_of(stage, now, i) else { return false };
        let Some(material) = scene.material(&surface_point) else { return false };
        let (surface, named, is_metal) = match &material.scattering {
            Scattering::Metal { roughness, named } => {
                let (alpha, highlight) = (roughness * roughness, Tint::WHITE);
                let metal = SheetSurface { metallic: 1.0, alpha, f0: 0.0, f90: 0.0, highlight };
                (metal, named.as_ref().map(Conductor::id), 1.0)
            }
            Scattering::Gltf(surface) => {
                (surface.sheet(&surface_point, scene, self.stage.spectral), None, 0.0)
            }
            Scattering::Black
            | Scattering::Matte
            | Scattering::Unlit
            | Scattering::Mirror
            | Scattering::Dielectric(_) => return false,
        };
        if surface.alpha <= 0.0 {
            return false;
        }
        put(&mut patch.seen.magnitudes, lane, placed.magnitudes);
        self.look_up(patch, lane, placed, &surface_point);
        let SheetSurface { metallic, alpha, f0, f90, highlight } = surface;
        let sheets = &mut *patch.sheets;
        (sheets.alpha[lane], sheets.metallic[lane]) = (alpha, metallic);
        (sheets.f0[lane], sheets.f90[lane]) = (f0, f90);
        sheets.base_peak[lane] = patch.colors[lane].peak();
        sheets.f0_peak[lane] = (f0 * highlight.peak()).min(1.0);
        sheets.is_metal[lane] = is_metal;
        patch.sheet_colors.resize(LANES, SheetColors::default());
        patch.sheet_colors[lane] = SheetColors { highlight, deep: [0.0; 3], named };
        true
    }

    /// What is known of a hit on a smooth surface.
    pub(super) fn look_up_smooth(
        &self,
        stage: &Stage<'_>,
        now: &Paths,
        patch: &mut Patch,
        (i, lane): (usize, usize),
        placed: &PlacedSurface,
    ) {
        self.look_up_matte(stage, now, patch, (i, lane), placed);
        let scene = &self.stage.surroundings;
        let placement = now.rays.blocks()[i / BLOCK].placement[i % BLOCK];
        let material = scene.geometry.placements.get(placement as usize);
        let material = material.and_then(|p| scene.materials.get(p.material as usize));
        let scattering = material.map_or(&Scattering::Black, |material| &material.scattering);
        let named = match scattering {
            Scattering::Metal { named, .. } => named.as_ref().map(Conductor::id),
            _ => None,
        };
        let smooth = &mut patch.smooth;
        smooth.is_metal[lane] = f64::from(matches!(scattering, Scattering::Metal { .. }));
        smooth.eta[lane] = 0.0;
        if let Scattering::Dielectric(glass) = scattering {
            // Rays that pass a surface leave it on the other side.
            patch.seen.is_beside[lane] = 0.0;
            let index = glass.ior.at(self.stage.spectral.wavelength(0));
            let seen = &patch.seen;
            let is_front = at(&seen.normal, lane).dot(at(&seen.direction, lane)) <= 0.0;
            smooth.eta[lane] = if is_front { index } else { 1.0 / index };
        }
        patch.sheet_colors.resize(LANES, SheetColors::default());
        patch.sheet_colors[lane] = SheetColors { named, ..SheetColors::default() };
    }

    /// How a surface of any other kind scatters light.
    pub(super) fn look_up_other(
        &self,
        stage: &Stage<'_>,
        now: &Paths,
        patch: &mut Patch,
        (i, lane): (usize, usize),
        placed: &PlacedSurface,
    ) {
        let scene = &self.stage.surroundings;
        put(&mut patch.seen.magnitudes, lane, placed.magnitudes);
        if !placed.is_opaque {
            // Rays that pass a surface leave it on the other side.
            patch.seen.is_beside[lane] = 0.0;
        }
        let seen = &patch.seen;
        let ray = (at(&seen.origin, lane), at(&seen.direction, lane));
        let hit = (seen.t[lane], at(&seen.normal, lane));
        let found = self.point_of(stage, now, i);
        let found = found
            .and_then(|surface_point| SurfaceInteraction::at(self.stage, surface_point, ray, hit));
        let black = || Bsdf::new(Model::Black, [hit.1; 2], -ray.1, [Tint::BLACK; 2]);
        let bsdf = found.map(|interaction| {
            let spectral = self.stage.spectral;
            interaction.bsdf(scene, spectral, spectral.wavelength(0))
        });
        patch.bsdfs.push(bsdf.unwrap_or_else(black));
    }
}
