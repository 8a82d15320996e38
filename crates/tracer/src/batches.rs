//! Layers worked out a whole batch at a time, in loops that vectorise: what most renders write.

use std::ops::Range;

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{HitBatch, MISS, Placement};

use crate::{Color, Paint, SceneView, Space, Traced};

/// Vector units that loops are compiled for beside the portable ones.
macro_rules! vectorised {
    ($(#[$doc:meta])* fn $name:ident($($argument:ident: $kind:ty),* $(,)?) $body:block) => {
        $(#[$doc])*
        #[multiversion::multiversion(targets(
            "x86_64+avx512f+avx512dq+avx512vl",
            "x86_64+avx2",
            "aarch64+neon"
        ))]
        fn $name($($argument: $kind),*) $body
    };
}

impl SceneView<'_> {
    /// [`SceneView::depth`] of every ray (m): `out` is refilled.
    pub fn depths(&self, traced: Traced<'_>, out: &mut Vec<f64>) {
        out.clear();
        out.resize(traced.rays.len(), f64::INFINITY);
        depths(traced, self.view.origin, self.view.forward(), out);
    }

    /// [`SceneView::normal`] of every ray, of the triangles' planes: the arrays of `out` are
    /// refilled.
    pub fn geometric_normals(&self, traced: Traced<'_>, space: Space, out: &mut [Vec<f64>; 3]) {
        for array in out.iter_mut() {
            array.clear();
            array.resize(traced.rays.len(), 0.0);
        }
        let axes = self.view.axes_of(space);
        normals(traced, [axes.x_axis, axes.y_axis, axes.z_axis], out);
    }

    /// Base colour under a headlight, of every ray: something to look at, not light transport. A
    /// little of it does not depend on the colour, so that black things show their shape as well.
    /// Misses are black. The arrays of `out` are refilled.
    pub fn facings(&self, traced: Traced<'_>, out: &mut [Vec<f64>; 3]) {
        self.flats(traced, out);
        let mut cosine = vec![0.0; traced.rays.len()];
        let mut ambient = vec![0.15; traced.rays.len()];
        for (run, placement) in self.runs(traced.hits) {
            let material = self.materials.get(placement.material as usize);
            if material.is_some_and(|material| material.occlusion.is_some()) {
                run.clone().for_each(|i| ambient[i] *= self.unoccluded(traced, i));
            }
            match &self.geometry.mesh_of(placement).normals {
                None => cosines(traced, run, &mut cosine),
                Some(_) => self.shading_cosines(traced, run, placement, &mut cosine),
            }
        }
        let hits = &traced.hits.placement;
        for array in out {
            let light =
                cosine.iter().zip(&ambient).map(|(cosine, ambient)| ambient + 0.85 * cosine);
            for ((color, light), &hit) in array.iter_mut().zip(light).zip(hits) {
                let lit = (0.08 + 0.92 * *color) * light;
                *color = if hit == MISS { 0.0 } else { lit };
            }
        }
    }

    /// [`SceneView::flat`] of every ray: the arrays of `out` are refilled.
    pub fn flats(&self, traced: Traced<'_>, out: &mut [Vec<f64>; 3]) {
        self.colors(traced, |i| self.flat(traced, i), out);
    }

    /// [`SceneView::albedo`] of every ray: the arrays of `out` are refilled.
    pub fn albedos(&self, traced: Traced<'_>, out: &mut [Vec<f64>; 3]) {
        self.colors(traced, |i| self.albedo(traced.hits, i), out);
    }

    /// Base colours, by `color` where a placement has several.
    fn colors(&self, traced: Traced<'_>, color: impl Fn(usize) -> Color, out: &mut [Vec<f64>; 3]) {
        for array in out.iter_mut() {
            array.clear();
            array.resize(traced.rays.len(), 0.0);
        }
        for (run, placement) in self.runs(traced.hits) {
            if let Some(color) = self.plain_color(placement) {
                for (array, c) in out.iter_mut().zip(color) {
                    array[run.clone()].fill(c);
                }
                continue;
            }
            for i in run {
                for (array, c) in out.iter_mut().zip(color(i)) {
                    array[i] = c;
                }
            }
        }
    }

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
    fn plain_color(&self, placement: &Placement) -> Option<Color> {
        let Some(material) = self.materials.get(placement.material as usize) else {
            return Some([0.0; 3]);
        };
        let colored = material.vertex_colors && self.geometry.mesh_of(placement).colors.is_some();
        match material.base_color {
            Paint::Plain(color) if !colored => Some(color),
            _ => None,
        }
    }

    /// Cosines between rays of a run and the mesh's own normals, on the side of the triangle that the
    /// ray came from.
    fn shading_cosines(
        &self,
        traced: Traced<'_>,
        run: Range<usize>,
        placement: &Placement,
        out: &mut [f64],
    ) {
        let transform = &placement.world_from_mesh;
        let turn = (transform.linear != DMat3::IDENTITY).then(|| transform.normal_matrix());
        for i in run {
            let (geometric, direction) = (traced.hits.normal(i), traced.rays.direction(i));
            let side = if geometric.dot(direction) > 0.0 { 1.0 } else { -1.0 };
            let spot = self.spot(traced.hits, i);
            let normal = spot.and_then(|spot| spot.turned_normal(turn.as_ref(), geometric));
            out[i] = (normal.unwrap_or(geometric).dot(direction) * side).max(0.0);
        }
    }
}

vectorised! {
    /// Cosines between rays and the triangles' normals.
    fn cosines(traced: Traced<'_>, run: Range<usize>, out: &mut [f64]) {
        let [dx, dy, dz] = traced.rays.directions().map(|array| &array[run.clone()]);
        let [nx, ny, nz] = traced.hits.normal.each_ref().map(|array| &array[run.clone()]);
        for (i, out) in out[run].iter_mut().enumerate() {
            *out = (nx[i] * dx[i] + ny[i] * dy[i] + nz[i] * dz[i]).abs();
        }
    }
}

vectorised! {
    fn depths(traced: Traced<'_>, from: DVec3, forward: DVec3, out: &mut [f64]) {
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
}

vectorised! {
    fn normals(traced: Traced<'_>, axes: [DVec3; 3], out: &mut [Vec<f64>; 3]) {
        let [a, b, c] = out;
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
}
