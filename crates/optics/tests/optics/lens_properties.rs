//! Properties that hold for any ray through a lens. (For any lens, with any ray: the stability
//! suite.)

use etendue_optics::element::Clip;
use etendue_optics::train::{LensFile, Side};
use glam::DVec3;
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    /// A ray sent back along its way arrives where it came from.
    #[test]
    fn light_can_go_back(radius in 15.0..60.0_f64, height in -6.0..6.0_f64, slope in -0.2..0.2_f64) {
        let file = format!(
            r#"{{"elements": [
                {{"type": "surface", "radius": {radius}, "thickness": 4, "glass": "N-BK7"}},
                {{"type": "surface", "radius": -40, "thickness": 2, "glass": "N-SF11", "conic": -0.7}},
                {{"type": "surface", "radius": -90, "aspheric": {{"4": 1e-5}}, "thickness": 7}},
                {{"type": "thin_lens", "focal_length": -120}}]}}"#
        );
        let train = LensFile::from_json(&file).unwrap().build(&|_: &str| Err(String::new())).unwrap();
        let at = train.at(550.0).unwrap();
        let start = DVec3::new(0.3, height, -12.0);
        let direction = DVec3::new(0.01, slope, 1.0).normalize();
        let out = at.path(Side::Object, Clip::Off, start, direction);
        if let Some(onwards) = out.direction {
            let beyond = *out.points.last().unwrap() + onwards * 10.0;
            let back = at.path(Side::Sensor, Clip::Off, beyond, -onwards);
            let home = back.direction.expect("the same way back");
            // Eight refractions, each good to a few roundings.
            prop_assert!((home + direction).length() < 1e-12, "{home} {direction}");
            let first = *back.points.last().unwrap();
            let miss = (start - first).cross(direction).length();
            prop_assert!(miss < 1e-10, "{miss}");
        }
    }
}
