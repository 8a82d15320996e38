//! Layers worked out a whole batch at a time, in loops that vectorise: what most renders write.

use etendue_geometry::glam::DVec3;

use crate::{Space, Surroundings, Traced};

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

impl Surroundings<'_> {
    /// [`Surroundings::depth`] of every ray (m): `out` is refilled.
    pub fn depths(&self, traced: Traced<'_>, out: &mut Vec<f64>) {
        out.clear();
        out.resize(traced.rays.len(), f64::INFINITY);
        depths(traced, self.view.origin, self.view.forward(), out);
    }

    /// [`Surroundings::normal`] of every ray, of the triangles' planes: the arrays of `out` are
    /// refilled.
    pub fn geometric_normals(&self, traced: Traced<'_>, space: Space, out: &mut [Vec<f64>; 3]) {
        for array in out.iter_mut() {
            array.clear();
            array.resize(traced.rays.len(), 0.0);
        }
        let axes = match space {
            Space::World => [DVec3::X, DVec3::Y, DVec3::Z],
            Space::Camera => {
                let axes = self.view.axes;
                [axes.x_axis, axes.y_axis, axes.z_axis]
            }
        };
        normals(traced, axes, out);
    }
}

vectorised! {
    fn depths(traced: Traced<'_>, from: DVec3, forward: DVec3, out: &mut [f64]) {
        let [ox, oy, oz] = traced.rays.origin.each_ref().map(|array| &array[..out.len()]);
        let [dx, dy, dz] = traced.rays.direction.each_ref().map(|array| &array[..out.len()]);
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
        let [dx, dy, dz] = traced.rays.direction.each_ref().map(|array| &array[..len]);
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
