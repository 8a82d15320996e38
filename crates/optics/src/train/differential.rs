//! Rays with their derivatives through a lens: where rays beside one go.

use glam::DVec3;

use super::{MonochromaticTrain, Side};
use crate::element::Ray;
use crate::element::real::Dual;

/// A ray and two small changes of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayDifferential {
    /// Its place (mm) and unit direction.
    pub ray: [DVec3; 2],
    /// Change of place and of direction by one unit of each of the two parameters. A change of
    /// direction is square to the direction itself.
    pub changes: [[DVec3; 2]; 2],
}

impl RayDifferential {
    fn dual(self) -> Ray<Dual<f64>> {
        let numbers = |part: usize| {
            std::array::from_fn(|axis| Dual {
                v: self.ray[part][axis],
                d: self.changes.map(|change| change[part][axis]),
            })
        };
        Ray { position: numbers(0), direction: numbers(1) }
    }

    fn of(ray: Ray<Dual<f64>>) -> Self {
        let parts = [ray.position, ray.direction];
        let changed = |by: usize| parts.map(|part| DVec3::from(part.map(|number| number.d[by])));
        Self {
            ray: parts.map(|part| DVec3::from(part.map(|number| number.v))),
            changes: [changed(0), changed(1)],
        }
    }
}

impl MonochromaticTrain {
    /// A ray behind the lens with what becomes there of two small changes of its place and direction, by the derivatives
    /// of the whole way. Clear apertures stop nothing.
    ///
    /// `None` when it does not get through, and in lenses with lenslets or gradients.
    #[must_use]
    pub fn differential(&self, from: Side, ray: RayDifferential) -> Option<RayDifferential> {
        let end = self.steps(from).iter().try_fold(ray.dual(), |ray, step| step.run_in(ray))?;
        Some(RayDifferential::of(end))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::Clip;
    use crate::train::{LensFile, OpticalTrain};

    fn built(elements: &str) -> OpticalTrain {
        let file = LensFile::from_json(&format!(r#"{{"elements": [{elements}]}}"#)).unwrap();
        file.build(&|name: &str| Err(name.to_owned())).unwrap()
    }

    /// A train with every kernel that has derivatives: planes, spheres, conics, aspheres, biconics, freeforms with and
    /// without a phase, thin lenses, mirrors that fold, breaks of the axis, and what is turned and moved.
    const ALL: &str = r#"
        {"type": "surface", "thickness": 3, "glass": {"n": 1.6}, "tilt": [3, -2]},
        {"type": "surface", "radius": -80, "thickness": 2, "decentre": [0.3, -0.2]},
        {"type": "surface", "radius": 60, "conic": -0.8, "thickness": 4, "glass": {"n": 1.5}},
        {"type": "surface", "radius": -90, "conic": 0.4, "aspheric": {"4": 1e-5, "6": -1e-8}, "thickness": 3},
        {"type": "biconic", "radius": 70, "radius_x": -150, "conic": -0.5, "thickness": 4, "glass": {"n": 1.7}},
        {"type": "freeform", "radius": -120, "conic": -0.3, "aspheric": {"3": 1e-5}, "thickness": 5,
         "sag": [{"type": "zernike", "radius": 12, "coefficients": {"5": 2e-3, "8": 1e-3}}]},
        {"type": "freeform", "radius": 200, "rotation_radius": 90, "thickness": 3, "glass": {"n": 1.5}, "phase":
         {"pattern": {"type": "polynomial", "radius": 10, "coefficients": [[2, 1, 30], [0, 2, -50]]}, "order": 2}},
        {"type": "freeform", "radius": -100, "fresnel": true, "thickness": 6},
        {"type": "coordinate_break", "tilt": [2, 1], "decentre": [0.2, 0.1], "rotation": 20, "thickness": 2},
        {"type": "thin_lens", "focal_length": 90, "thickness": 10, "tilt": [1, 2]},
        {"type": "mirror", "radius": -300, "conic": -1, "tilt": [20, 5], "fold": true, "thickness": -20},
        {"type": "freeform", "radius": 400, "aspheric": {"4": 1e-7}, "mirror": true, "thickness": 40}"#;

    fn start(place: DVec3, direction: DVec3) -> RayDifferential {
        let direction = direction.normalize();
        let across = direction.cross(DVec3::Y).normalize();
        let along = across.cross(direction);
        // The place goes along one axis and the direction about the other, both in both.
        let changes = [[across + 0.3 * along, 0.01 * along], [along, 0.02 * across - 0.01 * along]];
        RayDifferential { ray: [place, direction], changes }
    }

    #[test]
    fn derivatives_through_all_kernels_are_those_of_rays_beside_one_another() {
        let train = built(ALL);
        let at = train.at(train.wavelength()).unwrap();
        for from in [Side::Object, Side::Sensor] {
            for (x, y) in [(0.0, 0.0), (2.0, -3.0), (-4.0, 1.0)] {
                let (z, sense) = match from {
                    Side::Object => (-10.0, 1.0),
                    Side::Sensor => (train.last_vertex() + 10.0, -1.0),
                };
                let ray = start(DVec3::new(x, y, z), DVec3::new(0.02, -0.03, sense));
                let end = at.differential(from, ray).unwrap();
                let run = |[place, direction]: [DVec3; 2]| {
                    let end = at.run(from, Clip::Off, Ray::new(place, direction).unwrap());
                    assert_eq!(end.status, crate::element::RayStatus::Exited);
                    [DVec3::from(end.ray.position), DVec3::from(end.ray.direction)]
                };
                let same = run(ray.ray);
                for part in 0..2 {
                    assert!((end.ray[part] - same[part]).length() < 1e-12, "{end:?} {same:?}");
                }
                for (change, by) in ray.changes.iter().zip(end.changes) {
                    let near = |k: f64| {
                        let step = 1e-3 * k;
                        run([ray.ray[0] + step * change[0], ray.ray[1] + step * change[1]])
                    };
                    // Of fourth order: (1e-3)⁴ times derivatives of a few units, and roundings of 1e-14 over 1e-3.
                    let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(near);
                    for part in 0..2 {
                        let difference =
                            (8.0 * (c[part] - b[part]) - (d[part] - a[part])) / (12.0 * 1e-3);
                        let apart = (difference - by[part]).length();
                        assert!(apart < 1e-9, "{from:?} {x} {y}: {apart:e} {by:?}");
                    }
                }
            }
        }
    }

    /// On the axis the derivatives are the matrix of first-order optics: the focal length and where it is.
    #[test]
    fn derivatives_on_the_axis_are_paraxial() {
        for name in ["double-gauss", "cooke-triplet", "cassegrain", "asphere"] {
            let path = format!("{}/../../scenes/lenses/{name}.json", env!("CARGO_MANIFEST_DIR"));
            let file = LensFile::from_json(&std::fs::read_to_string(path).unwrap()).unwrap();
            let train = file.build(&|name: &str| Err(name.to_owned())).unwrap();
            let at = train.at(train.wavelength()).unwrap();
            let changes = [[DVec3::X, DVec3::ZERO], [DVec3::Y, DVec3::ZERO]];
            let ray = RayDifferential { ray: [DVec3::new(0.0, 0.0, -10.0), DVec3::Z], changes };
            let end = at.differential(Side::Object, ray).unwrap();
            let paraxial = train.paraxial(train.wavelength()).unwrap();
            for (axis, [place, direction]) in end.changes.into_iter().enumerate() {
                let efl = -1.0 / direction[axis];
                assert!((efl / paraxial.efl.unwrap() - 1.0).abs() < 1e-12, "{name}: {efl}");
                let image = end.ray[0].z - place[axis] / direction[axis];
                assert!((image - paraxial.image_z.unwrap()).abs() < 1e-10 * efl.abs(), "{name}");
            }
        }
    }

    #[test]
    fn what_has_no_derivatives_has_none() {
        let lost = built(r#"{"type": "surface", "radius": 5, "glass": {"n": 1.5}}"#);
        let at = lost.at(550.0).unwrap();
        let ray = start(DVec3::new(0.0, 9.0, -10.0), DVec3::Z);
        assert_eq!(at.differential(Side::Object, ray), None);
        let lenslets =
            r#"{"type": "microlens_array", "size": [4, 4], "pitch": 1, "focal_length": 5}"#;
        let at = built(lenslets).at(550.0).unwrap();
        let ray = start(DVec3::new(0.0, 0.0, -10.0), DVec3::Z);
        assert_eq!(at.differential(Side::Object, ray), None);
    }
}
