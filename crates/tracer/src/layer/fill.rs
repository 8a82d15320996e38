//! The functions that fill layers, a whole batch at a time: those that most renders write in loops that
//! vectorise.

use std::ops::Range;

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Float, HitBatch, MISS, Placement};

use super::{Columns, LayerContext};
use crate::{Color, NormalKind, Paint, SceneView, Space, TracedBatch};

impl LayerContext<'_> {
    /// Refills the first columns with `value` of each ray.
    pub(super) fn each<const N: usize>(
        &self,
        out: &mut Columns,
        value: impl Fn(usize) -> [f64; N],
    ) {
        let columns = self.clear(&mut out[..N], 0.0);
        for i in 0..self.traced.rays.len() {
            for (column, value) in columns.iter_mut().zip(value(i)) {
                column[i] = value;
            }
        }
    }

    /// Sets `columns` to `value` for each ray.
    fn clear<'c>(&self, columns: &'c mut [Vec<f64>], value: f64) -> &'c mut [Vec<f64>] {
        for column in &mut *columns {
            column.clear();
            column.resize(self.traced.rays.len(), value);
        }
        columns
    }

    /// Distances along the camera's axis (m), `+inf` for a miss.
    pub(super) fn depths(&self, [out, ..]: &mut Columns) {
        self.clear(std::slice::from_mut(out), f64::INFINITY);
        depths(self.traced, self.scene.view.origin, self.scene.view.forward(), out);
    }

    /// Distances along the rays (m), `+inf` for a miss.
    pub(super) fn distances(&self, [out, ..]: &mut Columns) {
        out.clone_from(&self.traced.hits.t);
    }

    /// Unit normals on the side that the rays came from, zero for a miss.
    pub(super) fn normals(&self, space: Space, kind: NormalKind, out: &mut Columns) {
        match kind {
            NormalKind::Shading => {
                self.each(out, |i| self.scene.normal(self.traced, i, kind, space).to_array());
            }
            NormalKind::Geometric => {
                self.clear(&mut out[..3], 0.0);
                let axes = self.scene.view.axes_of(space);
                normals(self.traced, [axes.x_axis, axes.y_axis, axes.z_axis], out);
            }
        }
    }

    /// Angles of incidence on the triangles (radians, 0 to π/2), `+inf` for a miss.
    pub(super) fn incidences(&self, out: &mut Columns) {
        let TracedBatch { rays, hits } = self.traced;
        self.each(out, |i| {
            let (normal, direction) = (hits.normal(i), rays.direction(i));
            // The arc cosine would lose half of the digits near 0.
            let angle = normal.cross(direction).length().atan2(normal.dot(direction).abs());
            [if hits.is_hit(i) { angle } else { f64::INFINITY }]
        });
    }

    /// Base colour under a headlight: something to look at, not light transport. A little of it does
    /// not depend on the colour, so that black things show their shape as well. Misses are black.
    pub(super) fn facings(&self, out: &mut Columns) {
        let Self { scene, traced, .. } = *self;
        self.flats(out);
        let mut cosine = vec![0.0; traced.rays.len()];
        let mut ambient = vec![AMBIENT; traced.rays.len()];
        for (run, placement) in scene.runs(traced.hits) {
            let material = scene.materials.get(placement.material as usize);
            if material.is_some_and(|material| material.occlusion.is_some()) {
                run.clone().for_each(|i| ambient[i] *= scene.unoccluded(traced, i));
            }
            match &scene.geometry.mesh_of(placement).normals {
                None => cosines(traced, run, &mut cosine),
                Some(_) => scene.shading_cosines(traced, run, placement, &mut cosine),
            }
        }
        let hits = &traced.hits.placement;
        for array in &mut out[..3] {
            let light = cosine.iter().zip(&ambient);
            for ((color, (&cosine, &ambient)), &hit) in array.iter_mut().zip(light).zip(hits) {
                let lit = visible(*color) * headlight(cosine, ambient);
                *color = if hit == MISS { 0.0 } else { lit };
            }
        }
    }

    /// Base colours over the footprint of each ray; misses are black.
    pub(super) fn flats(&self, out: &mut Columns) {
        self.colors(|i| self.scene.flat(self.traced, i), out);
    }

    /// Base colours at the very points that were hit; misses are black.
    pub(super) fn albedos(&self, out: &mut Columns) {
        self.colors(|i| self.scene.albedo(self.traced.hits, i), out);
    }

    /// Base colours over the footprint of each ray, and 1 where a surface shows others; misses are black.
    pub(super) fn guiding_albedos(&self, out: &mut Columns) {
        self.flats(out);
        for (run, placement) in self.scene.runs(self.traced.hits) {
            let material = self.scene.materials.get(placement.material as usize);
            if material.is_some_and(|material| material.scattering.shows_others()) {
                out[..3].iter_mut().for_each(|column| column[run.clone()].fill(1.0));
            }
        }
    }

    /// 1 where a ray hits something, 1 for every ray, and 0: of weighted sums, the first is a share of
    /// the second. A lens that lets less through in the corners of the picture does not make them
    /// transparent.
    pub(super) fn shares(&self, out: &mut Columns) {
        let hits = &self.traced.hits.placement;
        self.each(out, |i| [f64::from(u8::from(hits[i] != MISS)), 1.0, 0.0]);
    }

    /// The environment's radiance along each ray that hits nothing, in red, green and blue; 0 along
    /// others, without light, and with bands other than these three.
    pub(super) fn backdrops(&self, out: &mut Columns) {
        let light = self.light.filter(|light| light.spectral.count() == 3);
        self.each(out, |i| {
            let mut color = [0.0; 3];
            if let (Some(light), MISS) = (light, self.traced.hits.placement[i]) {
                let direction = self.traced.rays.direction(i);
                light.lights.backdrop(light.spectral, direction, &mut color);
            }
            color
        });
    }

    /// Base colours, by `color` where a placement has several.
    fn colors(&self, color: impl Fn(usize) -> Color, out: &mut Columns) {
        let columns = self.clear(&mut out[..3], 0.0);
        for (run, placement) in self.scene.runs(self.traced.hits) {
            if let Some(color) = self.scene.plain_color(placement) {
                for (array, c) in columns.iter_mut().zip(color) {
                    array[run.clone()].fill(c);
                }
                continue;
            }
            for i in run {
                for (array, c) in columns.iter_mut().zip(color(i)) {
                    array[i] = c;
                }
            }
        }
    }
}

impl SceneView<'_> {
    /// Runs of rays that hit the same placement.
    fn runs(&self, hits: &HitBatch) -> impl Iterator<Item = (Range<usize>, &Placement)> {
        let mut start = 0;
        hits.placement.chunk_by(|a, b| a == b).filter_map(move |run| {
            let range = start..start + run.len();
            start = range.end;
            (run[0] != MISS).then(|| (range, &self.geometry.placements[run[0] as usize]))
        })
    }

    /// The base colour of a placement that has the same everywhere.
    pub(super) fn plain_color(&self, placement: &Placement) -> Option<Color> {
        let Some(material) = self.materials.get(placement.material as usize) else {
            return Some([0.0; 3]);
        };
        let colored = material.vertex_colors && self.geometry.mesh_of(placement).colors.is_some();
        match material.base_color {
            Paint::Plain(color) | Paint::Curve { look: color, .. } if !colored => Some(color),
            Paint::Plain(_)
            | Paint::Curve { .. }
            | Paint::Checker { .. }
            | Paint::Image { .. }
            | Paint::Cube { .. } => None,
        }
    }

    /// Cosines between rays of a run and the mesh's own normals, on the side of the triangle that the
    /// ray came from.
    fn shading_cosines(
        &self,
        traced: TracedBatch<'_>,
        run: Range<usize>,
        placement: &Placement,
        out: &mut [f64],
    ) {
        let transform = &placement.world_from_mesh;
        let turn = (transform.linear != DMat3::IDENTITY).then(|| transform.normal_matrix());
        for i in run {
            let (geometric, direction) = (traced.hits.normal(i), traced.rays.direction(i));
            let side = if geometric.dot(direction) > 0.0 { 1.0 } else { -1.0 };
            let point = self.point(traced.hits, i);
            let normal = point.and_then(|point| point.turned_normal(turn.as_ref(), geometric));
            out[i] = (normal.unwrap_or(geometric).dot(direction) * side).max(0.0);
        }
    }
}

/// Light of a headlight that comes from all sides.
pub(super) const AMBIENT: f64 = 0.15;

/// Light of a headlight that meets a surface at an angle of this cosine, beside so much from all sides.
#[inline(always)]
pub(super) fn headlight<F: Float>(cosine: F, ambient: F) -> F {
    ambient + F::of(0.85) * cosine
}

/// A colour as a headlight shows it: black things are seen, too.
#[inline(always)]
pub(super) fn visible<F: Float>(color: F) -> F {
    F::of(0.08) + F::of(0.92) * color
}

/// Cosines between rays and the triangles' normals.
#[multiversion::multiversion(targets = "simd")]
fn cosines(traced: TracedBatch<'_>, run: Range<usize>, out: &mut [f64]) {
    let [dx, dy, dz] = traced.rays.directions().map(|array| &array[run.clone()]);
    let [nx, ny, nz] = traced.hits.normal.each_ref().map(|array| &array[run.clone()]);
    for (i, out) in out[run].iter_mut().enumerate() {
        *out = (nx[i] * dx[i] + ny[i] * dy[i] + nz[i] * dz[i]).abs();
    }
}

#[multiversion::multiversion(targets = "simd")]
fn depths(traced: TracedBatch<'_>, from: DVec3, forward: DVec3, out: &mut [f64]) {
    let [ox, oy, oz] = traced.rays.origins().map(|array| &array[..out.len()]);
    let [dx, dy, dz] = traced.rays.directions().map(|array| &array[..out.len()]);
    let t = &traced.hits.t[..out.len()];
    for i in 0..out.len() {
        let start = (ox[i] - from.x) * forward.x
            + (oy[i] - from.y) * forward.y
            + (oz[i] - from.z) * forward.z;
        let along = dx[i] * forward.x + dy[i] * forward.y + dz[i] * forward.z;
        // A miss is no product: a ray across the axis would make 0 × ∞ of it.
        out[i] = if t[i] == f64::INFINITY { t[i] } else { start + t[i] * along };
    }
}

#[multiversion::multiversion(targets = "simd")]
fn normals(traced: TracedBatch<'_>, axes: [DVec3; 3], out: &mut Columns) {
    let [a, b, c, _] = out;
    let len = a.len();
    let (b, c) = (&mut b[..len], &mut c[..len]);
    let [dx, dy, dz] = traced.rays.directions().map(|array| &array[..len]);
    let [nx, ny, nz] = traced.hits.normal.each_ref().map(|array| &array[..len]);
    for i in 0..len {
        let (x, y, z) = (nx[i], ny[i], nz[i]);
        let side = if x * dx[i] + y * dy[i] + z * dz[i] > 0.0 { -1.0 } else { 1.0 };
        let (x, y, z) = (x * side, y * side, z * side);
        a[i] = x * axes[0].x + y * axes[0].y + z * axes[0].z;
        b[i] = x * axes[1].x + y * axes[1].y + z * axes[1].z;
        c[i] = x * axes[2].x + y * axes[2].y + z * axes[2].z;
    }
}
