//! What is looked up for the hits of a patch, by kind of surface: colours, shading normals, facets, indices.

use super::Tracing;
use super::dispersion::Boundary;
use super::media::Coincident;
use super::patch::{Patch, SheetColors, at, put};
use super::paths::{Draw, Paths, Step, Workspace};
use super::rays::Rays;
use crate::bsdf::{Bsdf, Model};
use crate::placed::PlacedSurface;
use crate::reference::SurfacePoint;
use crate::shading::SheetSurface;
use crate::surface::SurfaceInteraction;
use crate::{Conductor, LANES, Scattering, Tint};

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Place of a hit on its mesh, as path `i` sees it.
    pub(super) fn point_of<R: Rays>(
        &self,
        step: &Step<'_>,
        now: &Paths<R>,
        i: usize,
    ) -> Option<(u32, SurfacePoint<'_>)> {
        let geometry = self.ctx.scene.geometry;
        let hit = now.rays.hit(i);
        let placement = geometry.placements.get(hit.id[0] as usize)?;
        let corner = SurfacePoint::corner(geometry, placement, hit.id[1] as usize);
        let [u, v] = hit.weights.map(|w| w.clamp(0.0, 1.0));
        let (weights, footprint) = ([1.0 - u - v, u, v], self.footprint(step, now, i));
        Some((hit.id[0], SurfacePoint { weights, time: hit.time, footprint, ..corner }))
    }

    /// Looks up what is known of a hit on a matte surface: its colour, and its shading normal where that is not the
    /// triangle's.
    #[inline(always)]
    pub(super) fn look_up_matte<R: Rays>(
        &self,
        step: &Step<'_>,
        now: &Paths<R>,
        patch: &mut Patch,
        (i, lane): (usize, usize),
        placed: &PlacedSurface,
    ) {
        put(&mut patch.seen.magnitudes, lane, placed.magnitudes);
        if let (Some(color), false) = (placed.color, placed.is_tilted) {
            patch.colors[lane] = color;
        } else if let Some((_, surface_point)) = self.point_of(step, now, i) {
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
        let scene = &self.ctx.scene;
        let Some(material) = scene.material(surface_point) else { return };
        if placed.is_tilted {
            patch.is_tilted = true;
            let front = at(&patch.seen.normal, lane);
            let tilted = surface_point.tilted_normal(scene, material, placed.turn.as_ref(), front);
            put(&mut patch.seen.shading, lane, tilted);
        }
        patch.colors[lane] = placed.color.unwrap_or_else(|| {
            scene.base_tint(self.ctx.spectral, material, surface_point).0.clamped()
        });
    }

    /// Looks up what is known of a hit on a sheet of facets, and returns whether it is rough.
    pub(super) fn look_up_sheet<R: Rays>(
        &self,
        step: &Step<'_>,
        now: &Paths<R>,
        patch: &mut Patch,
        (i, lane): (usize, usize),
        placed: &PlacedSurface,
    ) -> bool {
        let scene = &self.ctx.scene;
        let Some((_, surface_point)) = self.point_of(step, now, i) else { return false };
        let Some(material) = scene.material(&surface_point) else { return false };
        let (surface, named, is_metal) = match &material.scattering {
            Scattering::Metal { roughness, named } => {
                let (alpha, highlight) = (roughness * roughness, Tint::WHITE);
                let metal = SheetSurface { metallic: 1.0, alpha, f0: 0.0, f90: 0.0, highlight };
                (metal, named.as_ref().map(Conductor::id), 1.0)
            }
            Scattering::Gltf(surface) => {
                (surface.sheet(&surface_point, scene, self.ctx.spectral), None, 0.0)
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
        patch.sheet_colors[lane] = SheetColors { highlight, named };
        true
    }

    /// Looks up what is known of a hit on a smooth surface.
    pub(super) fn look_up_smooth<R: Rays>(
        &self,
        step: &Step<'_>,
        now: &Paths<R>,
        patch: &mut Patch,
        (i, lane): (usize, usize),
        placed: &PlacedSurface,
    ) {
        self.look_up_matte(step, now, patch, (i, lane), placed);
        let scene = &self.ctx.scene;
        let placement = now.rays.placement(i);
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
            let index = glass.ior.at(self.ctx.spectral.wavelength(0));
            let seen = &patch.seen;
            let is_front = at(&seen.normal, lane).dot(at(&seen.direction, lane)) <= 0.0;
            smooth.eta[lane] = if is_front { index } else { 1.0 / index };
        }
        patch.sheet_colors.resize(LANES, SheetColors::default());
        patch.sheet_colors[lane] = SheetColors { named, ..SheetColors::default() };
    }

    /// Looks up how a surface of any other kind scatters light, and returns whether there is anything to be worked on
    /// of it: a path may pass a surface that is not there, and be parted by a glass.
    pub(super) fn look_up_other<R: Rays>(
        &self,
        step: &Step<'_>,
        workspace: &mut Workspace<R>,
        patch: &mut Patch,
        ((i, k), lane): ((usize, usize), usize),
        placed: &PlacedSurface,
    ) -> bool {
        let scene = &self.ctx.scene;
        put(&mut patch.seen.magnitudes, lane, placed.magnitudes);
        if !placed.is_opaque {
            // Rays that pass a surface leave it on the other side.
            patch.seen.is_beside[lane] = 0.0;
        }
        let now = &workspace.now;
        let (direction, hit) = (now.rays.direction(i), now.rays.hit(i));
        let black = Bsdf::new(Model::Black, [hit.normal; 2], -direction, [Tint::BLACK; 2]);
        patch.bsdfs.push(black);
        patch.crossings.push(None);
        let found = self.point_of(step, now, i);
        let ray = (now.rays.origin(i), direction);
        let found = found
            .and_then(|point| SurfaceInteraction::at(self.ctx, point, ray, (hit.t, hit.normal)));
        let Some(mut interaction) = found else { return false };
        if interaction.material.has_alpha()
            && workspace.number(Draw::Chance, k)[0] >= interaction.opacity()
        {
            let start = interaction.anchor.leave(direction);
            self.pass(step, workspace, i, (start, [hit.id, Coincident::NONE.id()]), None);
            return false;
        }
        let coplanar = workspace.coincident.get(i).copied().unwrap_or(Coincident::NONE);
        let own = workspace.now.carried.media_of(i);
        let crossing = self.cross(own, (hit.id[0], coplanar), &mut interaction);
        if let Some(vanished) = self.vanishes(hit.id[0], &interaction) {
            let start = interaction.anchor.leave(direction);
            let media = crossing.map(|crossing| crossing.after(direction, hit.normal));
            if vanished.is_tinted {
                let (tint, count) = (interaction.color(), self.count());
                let bands = &mut workspace.now.carried.throughput[i * count..(i + 1) * count];
                bands.iter_mut().enumerate().for_each(|(k, band)| *band *= self.band(&tint, k));
            }
            self.pass(step, workspace, i, (start, [hit.id, coplanar.id()]), media);
            return false;
        }
        let bounces = workspace.now.bounces(step.number, i);
        if workspace.now.carried.ways[i].is_last || bounces >= self.rules.bounces {
            return false;
        }
        let spectral = self.ctx.spectral;
        let mut wavelength = workspace.now.carried.wavelength_of(i);
        if let Scattering::Dielectric(glass) = &interaction.material.scattering
            && wavelength.is_none()
            && interaction.disperses(scene)
        {
            if glass.roughness == 0.0 {
                let bsdf = interaction.bsdf(scene, spectral, spectral.wavelength(0));
                let boundary = Boundary { path: (i, k), interaction: &interaction, crossing, bsdf };
                self.disperse(step, &boundary, workspace);
                return false;
            }
            wavelength = self.keep_one(workspace, (i, k));
        }
        let wavelength = wavelength.unwrap_or_else(|| spectral.wavelength(0));
        patch.bsdfs[lane] = interaction.bsdf(scene, spectral, wavelength);
        patch.crossings[lane] = crossing;
        true
    }
}
