//! A surface of any shape as rays meet it, at a wavelength: where it lies, its slopes, and what becomes of light there.

use std::sync::Arc;

use super::Freeform;
use crate::element::newton::Profile;
use crate::element::rays::Ray;
use crate::element::real::{Dual, Real};
use crate::element::refract::{IndexPair, Root, meet_conic};

/// A surface at a wavelength, met from one side.
#[derive(Debug, Clone)]
pub(crate) struct FreeformSurface {
    pub(crate) shape: Arc<Freeform>,
    /// Change of the direction behind the surface per radian a millimetre of phase; as a kernel of
    /// mirrors has it.
    kick: f64,
    /// The path (mm) that a radian of phase adds.
    path: f64,
}

impl FreeformSurface {
    /// At a wavelength (nm), with the index behind it.
    pub(crate) fn new(shape: Arc<Freeform>, behind: f64, wavelength: f64) -> Self {
        let path = shape.phase.as_ref().map_or(0.0, |phase| phase.path_per_radian(wavelength));
        let sign = if shape.mirror.is_some() { -1.0 } else { 1.0 };
        Self { shape, kick: sign * path / behind, path }
    }

    /// The path (mm) that its phase adds at a place of its own frame.
    pub(crate) fn added_path(&self, place: [f64; 2]) -> f64 {
        self.shape.phase.as_ref().map_or(0.0, |phase| self.path * phase.at(place))
    }
}

impl Profile for FreeformSurface {
    /// ∂z/∂x and ∂z/∂y.
    type Slope<T: Real> = [T; 2];

    fn begin(&self, ray: Ray) -> (Ray, f64) {
        let on_plane = || {
            let travel = -ray.position[2] / ray.direction[2];
            (ray.advanced(travel), travel)
        };
        if self.shape.is_fresnel
            || self.shape.rotation.is_some()
            || self.shape.base.curvature == 0.0
        {
            return on_plane();
        }
        let base = match self.shape.sense < 0.0 {
            true => self.shape.base.flipped(),
            false => self.shape.base.clone(),
        };
        let hit = meet_conic::<false, f64>(&base, ray, Root::Near);
        if hit.t.is_finite() { (hit.ray, hit.t) } else { on_plane() }
    }

    fn sag_and_slope<T: Real>(&self, at: Ray<T>) -> (T, [T; 2]) {
        if self.shape.is_in_a_plane() {
            return (T::constant(0.0), [T::constant(0.0); 2]);
        }
        let [x, y, _] = at.position;
        self.shape.sag_and_slopes([x, y])
    }

    fn slope_at(&self, root: Ray, _slope: [f64; 2]) -> [f64; 2] {
        self.sag_and_slope(root).1
    }

    fn along<T: Real>(&self, at: Ray<T>, [along_x, along_y]: [T; 2]) -> T {
        let [u, v, w] = at.direction;
        w - along_x * u - along_y * v
    }

    fn exists(&self, place: [f64; 2]) -> bool {
        self.shape.holds(place)
    }

    fn refract<T: Real>(&self, media: IndexPair, at: Ray<T>, slope: [T; 2]) -> (Ray<T>, bool) {
        let [x, y, _] = at.position;
        let [along_x, along_y] = match self.shape.is_fresnel {
            true => self.shape.sag_and_slopes([x, y]).1,
            false => slope,
        };
        let (one, [u, v, w]) = (T::constant(1.0), at.direction);
        let normal = [-along_x, -along_y, one];
        let length2 = one + along_x * along_x + along_y * along_y;
        let along = u * normal[0] + v * normal[1] + w;
        match &self.shape.phase {
            None => media.refract(at, normal, length2, along * along, along),
            Some(phase) => {
                let gradient = phase.at(Dual::place([x, y])).d;
                let [kick_x, kick_y] = gradient.map(|along| along.times(self.kick));
                let kick = [kick_x, kick_y, T::constant(0.0)];
                media.diffract(at, normal, length2, along, kick)
            }
        }
    }

    fn extent(&self) -> [f64; 2] {
        let shape = &self.shape;
        let [width, height] = shape.half_size();
        let end = shape.base.domain().min(width.hypot(height));
        let end = if shape.rotation.is_some() { width.hypot(height) } else { end };
        let c = shape.base.curvature;
        [end, if c == 0.0 { 10.0 } else { (2.0 / c).abs() }]
    }

    fn clear_radius(&self) -> f64 {
        self.shape.semi_diameter
    }

    fn sag_range(&self, reach: f64) -> [f64; 2] {
        /// Places a side at which the sag is looked at; waves between are within the slack of a tenth that is added.
        const PLACES: i32 = 12;
        if self.shape.is_in_a_plane() {
            return [0.0, 0.0];
        }
        let at = |i: i32| reach * f64::from(i) / f64::from(PLACES);
        let places =
            (-PLACES..=PLACES).flat_map(|i| (-PLACES..=PLACES).map(move |j| [at(i), at(j)]));
        let sags = places.map(|[x, y]| {
            let ray = Ray { position: [x, y, 0.0], direction: [0.0, 0.0, 1.0] };
            self.sag_and_slope::<f64>(ray).0
        });
        let finite = sags.filter(|sag| sag.is_finite());
        finite.fold([0.0, 0.0], |[low, high]: [f64; 2], sag| [low.min(sag), high.max(sag)])
    }

    fn sag_bounds(&self, _ray: Ray, _part: [f64; 2]) -> [f64; 2] {
        if self.shape.is_in_a_plane() { [0.0, 0.0] } else { [f64::NEG_INFINITY, f64::INFINITY] }
    }

    fn along_bounds(&self, ray: Ray, _part: [f64; 2]) -> [f64; 2] {
        match self.shape.is_in_a_plane() {
            true => [ray.direction[2]; 2],
            false => [f64::NEG_INFINITY, f64::INFINITY],
        }
    }
}
