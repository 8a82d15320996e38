//! The widest opening of a lens: what is accepted has its light, and what is wider is refused.

use std::f64::consts::PI;

use etendue_optics::train::analysis::projected_solid_angle;
use etendue_optics::train::{Focus, OpticalTrain};
use glam::DVec3;

use crate::{build, preset};

/// The projected solid angle of the exit pupil from the axis over π/(4N²), which is that of a lens
/// that obeys the sine condition (E. Abbe; W. J. Smith, *Modern Optical Engineering*).
fn light(train: &OpticalTrain) -> f64 {
    let z = train.sensor_z(Focus::Infinity).unwrap();
    let at = train.at(train.wavelength()).unwrap();
    let n = train.paraxial(train.wavelength()).unwrap().f_number.unwrap();
    projected_solid_angle(train, &at, DVec3::new(0.0, 0.0, z)) * 4.0 * n * n / PI
}

#[test]
fn a_lens_opened_as_far_as_it_goes_has_the_light_of_its_f_number() {
    for name in ["double-gauss", "telephoto", "fisheye"] {
        let train = preset(name);
        let widest = train.widest_opening().unwrap();
        let at = |share: f64| {
            light(&train.clone().with_stop_radius(share * widest.stop_radius).unwrap())
        };
        let [closed, open, beyond] = [0.96, 1.0, 1.04].map(at);
        // Up to there the light follows the f-number on paper, but for the lens' offence against the
        // sine condition; beyond it is the same light on a larger number.
        assert!((open / closed - 1.0).abs() < 0.015, "{name}: {open} and {closed}");
        assert!((beyond * 1.04 * 1.04 / open - 1.0).abs() < 0.015, "{name}: {beyond}, {open}");
        println!("{name}: f/{:.3}: {closed:.4} {open:.4} {beyond:.4}", widest.f_number);
        // A tenth of a stop wider is refused by the number that it has.
        let refused = train.with_f_number(0.965 * widest.f_number).unwrap_err().to_string();
        let number = format!("f/{}", (100.0 * widest.f_number).ceil() / 100.0);
        assert!(refused.contains(&number) && refused.contains("at most"), "{refused}");
    }
}

#[test]
fn the_f_number_that_a_lens_reports_can_be_asked_for() {
    for name in
        ["achromat", "asphere", "cooke-triplet", "double-gauss", "fisheye", "singlet", "telephoto"]
    {
        let train = preset(name);
        let reported = train.paraxial(train.wavelength()).unwrap().f_number.unwrap();
        let is_filled = !train.notes().iter().any(|note| note.contains("on paper"));
        // As tables print it: with two, three and four decimals.
        for decimals in 2..5 {
            let written: f64 = format!("{reported:.decimals$}").parse().unwrap();
            let asked = train.clone().with_f_number(written);
            assert!(asked.is_ok() || !is_filled, "{name}: f/{written} of f/{reported}: {asked:?}");
        }
    }
    let gauss = preset("double-gauss");
    assert!(gauss.clone().with_f_number(2.03).is_ok(), "it reports f/2.0302");
    assert!(gauss.with_f_number(1.9).is_err());
}

#[test]
fn a_rim_in_front_limits_the_beam_exactly() {
    // A thin lens of 50 mm behind a hole of radius 5: f/5, whatever the stop behind is.
    let train = build(
        r#"{"elements": [
            {"type": "aperture", "shape": "circular", "radius": 5, "thickness": 3},
            {"type": "thin_lens", "focal_length": 50},
            {"type": "aperture", "shape": "circular", "radius": 9, "stop": true}]}"#,
    );
    let widest = train.widest_opening().unwrap();
    // Forty halvings of a step of a tenth of a millimetre.
    assert!((widest.f_number - 5.0).abs() < 1e-10, "{widest:?}");
    assert_eq!(widest.element, 0);
    assert!(train.notes().iter().any(|note| note.contains("on paper")), "{:?}", train.notes());
    assert!(train.clone().with_f_number(4.9).is_err());
    assert!(train.with_f_number(5.0).is_ok());
}

/// Off the axis a ray may end at what stands there, and wider ones pass beside it: no beam is ended, however it is
/// turned, and closing the lens down is no opening.
#[test]
fn what_stands_in_a_beam_is_no_rim_that_ends_it() {
    for shape in [
        r#""shape": "outline", "corners": [[-1, 2], [1, 2], [0, 4]], "obscures": true"#,
        r#""shape": "rectangular", "width": 1, "height": 1, "obscures": true, "decentre": [2, 1]"#,
        r#""shape": "elliptical", "width": 2, "height": 1, "obscures": true, "decentre": [0, -3]"#,
        r#""shape": "annular", "inner_radius": 1, "decentre": [3, 0]"#,
        r#""shape": "spider", "arms": 3, "width": 0.5"#,
    ] {
        let train = build(&format!(
            r#"{{"elements": [
            {{"type": "aperture", "shape": "circular", "radius": 6.25, "thickness": 1, "stop": true}},
            {{"type": "aperture", {shape}, "thickness": 1}},
            {{"type": "thin_lens", "focal_length": 50, "semi_diameter": 10}}]}}"#
        ));
        let widest = train.widest_opening().unwrap();
        assert_eq!(widest.element, 2, "{shape}");
        assert!((widest.f_number - 2.5).abs() < 1e-6, "{shape}: {widest:?}");
        assert!(!train.notes().iter().any(|note| note.contains("on paper")), "{shape}");
        assert!(train.with_f_number(8.0).is_ok(), "{shape}");
    }
}

#[test]
fn irises_open_masks_do_not_limit_and_unlimited_lenses_have_no_widest() {
    let iris = build(
        r#"{"elements": [{"type": "thin_lens", "focal_length": 50, "semi_diameter": 12.5},
            {"type": "aperture", "shape": "polygon", "blades": 6, "radius": 2, "stop": true}]}"#,
    );
    let widest = iris.widest_opening().unwrap();
    assert!((widest.f_number - 2.0).abs() < 1e-10, "{widest:?}");
    assert!(iris.with_f_number(2.0).is_ok());
    let free = build(
        r#"{"elements": [{"type": "thin_lens", "focal_length": 50},
            {"type": "aperture", "shape": "circular", "radius": 2}]}"#,
    );
    assert_eq!(free.widest_opening(), None);
    assert!(free.with_f_number(0.5).is_ok());
}
