//! Values of surfaces that are not alike all over, where paths hit them, and the footprints of paths on them.

use etendue_geometry::block::{LANES, vector};

use etendue_geometry::glam::DVec3;

use super::lane::{Lane, round, single, wide};
use super::surfaces::{Surfaces, TextureLookup, TextureLookups};
use super::{LAST, SPECULAR, TraceStep, Workspace};
use crate::Scattering;
use crate::footprint::{Cone, Footprint};
use crate::placed::{Facets, LEAST_ALPHA, SurfaceKind, SurfaceTable};
use crate::reference::SurfacePoint;
use crate::transport::Tracing;

impl<const RGB: bool> Tracing<'_, RGB> {
    /// Looks up the colours, facets and normals of hits on surfaces that are not alike all over.
    pub(super) fn look_up_varied<F: Lane>(
        &self,
        step: TraceStep<'_>,
        surfaces: Surfaces<'_, F>,
        workspace: &mut Workspace<F>,
    ) {
        if !surfaces.all.are_varied {
            workspace.varied.lookups.clear();
            workspace.singles.clear();
            return;
        }
        let mut varied = std::mem::take(&mut workspace.varied);
        let mut singles = std::mem::take(&mut workspace.singles);
        singles.clear();
        let (len, count) = (workspace.carried.len, self.count());
        varied.lookups.resize(len, TextureLookup::default());
        if !RGB {
            varied.colors.resize(len * count, 0.0);
            varied.facet_bands.resize(len * count, [0.0; 2]);
        }
        for lane in 0..len {
            let placement = workspace.rays.blocks()[lane / LANES].placement[lane % LANES];
            let own = surfaces.all.all.get(placement as usize);
            let Some(own) = own.filter(|own| own.is_varied) else { continue };
            if workspace.carried.flags.get(lane).is_some_and(|flags| flags & LAST != 0) {
                continue;
            }
            let mut is_single = own.kind == SurfaceKind::Other;
            varied.lookups[lane].is_single = false;
            if !is_single {
                self.look_up_lane(step, surfaces, workspace, lane, &mut varied);
                is_single = varied.lookups[lane].is_single;
            }
            if is_single {
                self.look_up_single(step, workspace, lane, &mut singles);
            }
        }
        workspace.varied = varied;
        workspace.singles = singles;
    }

    /// The same of one lane; what its surface has that is alike all over is left.
    fn look_up_lane<F: Lane>(
        &self,
        step: TraceStep<'_>,
        surfaces: Surfaces<'_, F>,
        workspace: &Workspace<F>,
        lane: usize,
        varied: &mut TextureLookups,
    ) -> Option<()> {
        let (block, i) = (&workspace.rays.blocks()[lane / LANES], lane % LANES);
        let (scene, spectral) = (&self.ctx.scene, self.ctx.spectral);
        let number_of = block.placement[i];
        let placement = scene.geometry.placements.get(number_of as usize)?;
        let (placed, own) =
            (self.ctx.placed.get(number_of)?, &surfaces.all.all[number_of as usize]);
        let corner = SurfacePoint::corner(scene.geometry, placement, block.triangle[i] as usize);
        let [u, v] = [block.u[i], block.v[i]].map(|weight| wide(weight).clamp(0.0, 1.0));
        let cone = self.cone(step, workspace, lane);
        let direction = || step.direction(lane, || vector(&block.direction, i));
        let footprint = cone.map(|Cone { width, .. }| Footprint { direction: direction(), width });
        let time = self.time_of(workspace.carried.ray[lane]);
        let point = SurfacePoint { weights: [1.0 - u - v, u, v], time, footprint, ..corner };
        let material = scene.material(&point)?;
        let is_measured = material.scattering.measured_metal().is_some();
        let looked_up = || scene.base_tint(spectral, material, &point).0.clamped();
        let tint = placed.color.unwrap_or_else(looked_up);
        let bands = lane * self.count()..(lane + 1) * self.count();
        let found = &mut varied.lookups[lane];
        (found.color, found.base_peak) = (tint.color.map(round), tint.peak());
        if is_measured && RGB {
            found.color = *surfaces.all.rgb_of(own.material);
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
            found.facets = Facets::of_sheet(&sheet);
            if sheet.alpha < LEAST_ALPHA {
                found.is_single = true;
                return Some(());
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

    /// The cone that the path of a lane stands for where it hit; a point where it was scattered by chance.
    pub(super) fn cone<F: Lane>(
        &self,
        step: TraceStep<'_>,
        workspace: &Workspace<F>,
        lane: usize,
    ) -> Option<Cone> {
        let (block, i) = (&workspace.rays.blocks()[lane / LANES], lane % LANES);
        let t = wide(block.t_max[i]);
        let hit = || {
            let start: DVec3 = F::origin(self.ctx.accel) + vector(&block.origin, i);
            start + vector(&block.direction, i) * t
        };
        if step.number > 0 {
            let is_specular = workspace.carried.flags.get(lane)? & SPECULAR != 0;
            let [width, spread] = workspace.carried.cone.each_ref().map(|row| wide(row[lane]));
            let from = workspace.passages.from.get(lane);
            let t = from.map_or(t, |from| (hit() - *from).length());
            return (is_specular && width >= 0.0).then(|| Cone { width, spread }.after(t));
        }
        // A block's ray may start nearer.
        let start = step.camera.rays.origin(lane);
        let direction = step.direction(lane, || vector(&block.direction, i));
        let cone = self.ctx.scene.view.cone(direction)?;
        Some(cone.after((hit() - start).dot(direction)))
    }

    /// Gives paths that leave mirrors and smooth boundaries the cones that met these.
    pub(super) fn carry_cones<F: Lane>(
        &self,
        step: TraceStep<'_>,
        surfaces: &SurfaceTable,
        workspace: &mut Workspace<F>,
    ) {
        let are_textured = self.ctx.lights.bounds().are_textured;
        if !(surfaces.carry_cones || (are_textured && surfaces.are_smooth)) {
            return;
        }
        for i in 0..workspace.next.len {
            let is_specular = workspace.next.carried.flags[i] & SPECULAR != 0;
            let left = workspace.next.left[i] as usize;
            let cone = self.cone(step, workspace, left).filter(|_| is_specular);
            // Less than nothing where it is a point.
            let own: [F; 2] = cone.map_or([-1.0; 2], |cone| [cone.width, cone.spread]).map(round);
            for (row, own) in workspace.next.carried.cone.iter_mut().zip(own) {
                row[i] = own;
            }
        }
    }
}
