//! Rays that keep away from all rims of a lens, told from those that come near one or end there.

use super::{MonochromaticTrain, Side};
use crate::element::{Clip, LANES, LensRays, RayStatus};

/// The outcome of a batch of rays at the rims of a lens, and the batch before it.
#[derive(Debug, Clone, Default)]
pub struct RimTrace {
    starts: LensRays,
    is_within: Vec<bool>,
    /// Rays that are traced once more, and their numbers.
    again: LensRays,
    numbers: Vec<usize>,
}

impl RimTrace {
    /// The rays before they were traced.
    #[must_use]
    pub fn starts(&self) -> &LensRays {
        &self.starts
    }

    /// True if ray `i` passed the narrower lens, too.
    #[must_use]
    pub fn is_within(&self, i: usize) -> bool {
        self.is_within[i]
    }
}

impl MonochromaticTrain {
    /// As [`Self::trace`] with clipping, and tells which rays pass `narrowed`, too: the lens with rims that are narrower
    /// ([`OpticalTrain::with_wider_rims`](crate::train::OpticalTrain::with_wider_rims)), whose numbers these rays have.
    /// They are the same to the bit but on aspheres, which are met where a search within their rim ends.
    pub fn trace_within(
        &self,
        narrowed: &Self,
        from: Side,
        rays: &mut LensRays,
        rims: &mut RimTrace,
    ) {
        let RimTrace { starts, is_within, again, numbers } = rims;
        starts.copy_from(rays);
        narrowed.trace(from, Clip::On, rays);
        is_within.clear();
        is_within.extend((0..rays.len()).map(|i| rays.status(i) == RayStatus::Exited));
        // The others through the lens as it is.
        numbers.clear();
        again.clear();
        let near = |&i: &usize| !is_within[i] && starts.status(i) == RayStatus::Exited;
        for i in (0..rays.len()).filter(near) {
            let (block, lane) = (&starts.blocks[i / LANES], i % LANES);
            again.push_ray(Some(block.ray(lane)), block.throughput[lane]);
            numbers.push(i);
        }
        self.trace(from, Clip::On, again);
        for (k, &i) in numbers.iter().enumerate() {
            let (block, lane) = (&again.blocks[k / LANES], k % LANES);
            let (own, at) = (&mut rays.blocks[i / LANES], i % LANES);
            own.set_ray(at, block.ray(lane));
            own.throughput[at] = block.throughput[lane];
            own.outcome[at] = block.outcome[lane];
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};

    use super::*;
    use crate::train::{LensFile, OpticalTrain};

    fn double_gauss() -> OpticalTrain {
        let path = format!("{}/../../scenes/lenses/double-gauss.json", env!("CARGO_MANIFEST_DIR"));
        let file = LensFile::from_json(&std::fs::read_to_string(path).unwrap()).unwrap();
        file.build(&|name: &str| Err(format!("{name}: presets have no files"))).unwrap()
    }

    /// Rays through rims that are half a millimetre narrower are some of those that pass, and all rays end as they do
    /// without a look at the rims.
    #[test]
    fn rays_end_as_they_do_without_a_look_at_the_rims() {
        let train = double_gauss();
        let lens = train.at(550.0).unwrap();
        let narrowed = train.with_wider_rims(&[-0.5; 11]).unwrap().at(550.0).unwrap();
        let mut rays = LensRays::default();
        for i in 0..2000_u32 {
            let turn = DVec2::from_angle(2.4 * f64::from(i));
            let at = (turn * 0.25 * f64::from(i).sqrt()).extend(38.0);
            rays.push(DVec3::new(8.0, 3.0, 75.0), at - DVec3::new(8.0, 3.0, 75.0));
        }
        let (mut plain, mut rims) = (rays.clone(), RimTrace::default());
        lens.trace(Side::Sensor, Clip::On, &mut plain);
        lens.trace_within(&narrowed, Side::Sensor, &mut rays, &mut rims);
        let (mut within, mut passed) = (0, 0);
        for i in 0..rays.len() {
            assert_eq!(rays.status(i), plain.status(i));
            assert_eq!(rays.position(i), plain.position(i));
            assert_eq!(rays.direction(i), plain.direction(i));
            assert!(!rims.is_within(i) || rays.status(i) == RayStatus::Exited);
            within += u32::from(rims.is_within(i));
            passed += u32::from(rays.status(i) == RayStatus::Exited);
        }
        assert!(within > 100 && within < passed && passed < 2000, "{within} of {passed}");
    }

    #[test]
    fn rims_that_are_no_circles_are_not_moved() {
        let text = r#"{"elements": [
            {"type": "surface", "radius": 40, "thickness": 3, "glass": "N-BK7", "semi_diameter": 10},
            {"type": "surface", "radius": -40, "thickness": 2, "semi_diameter": 10},
            {"type": "aperture", "shape": "annular", "radius": 5, "inner_radius": 2, "stop": true}]}"#;
        let train = LensFile::from_json(text).unwrap();
        let train = train.build(&|_: &str| Err(String::new())).unwrap();
        assert!(train.with_wider_rims(&[0.1; 3]).is_none());
    }
}
