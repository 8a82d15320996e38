//! What the drawings hold.

use super::*;
use crate::train::{Inquiry, LensFile, LensReport, OpticalTrain};

fn preset(name: &str) -> (OpticalTrain, LensReport) {
    let path = format!("{}/../../scenes/lenses/{name}.json", env!("CARGO_MANIFEST_DIR"));
    let file = LensFile::from_json(&std::fs::read_to_string(path).unwrap()).unwrap();
    let train = file.build(&|name| Err(name.to_owned())).unwrap();
    let report = LensReport::new(&train, &Inquiry::default()).unwrap();
    (train, report)
}

fn all(train: &OpticalTrain, report: &LensReport) -> [String; 3] {
    [layout(train, report).unwrap(), spots(train, report).unwrap(), falloff(train, report).unwrap()]
}

#[test]
fn every_preset_is_drawn_without_a_number_that_is_none() {
    for name in ["achromat", "asphere", "double-gauss", "fisheye", "singlet", "telephoto"] {
        let (train, report) = preset(name);
        for drawing in all(&train, &report) {
            assert!(drawing.starts_with("<svg") && drawing.trim_end().ends_with("</svg>"));
            assert!(!drawing.contains("NaN") && !drawing.contains("inf"), "{name}");
        }
    }
}

#[test]
fn a_layout_has_its_surfaces_rays_and_stop() {
    let (train, report) = preset("double-gauss");
    let drawing = layout(&train, &report).unwrap();
    assert_eq!(drawing.matches("class=\"glass\"").count(), 6, "six lenses");
    assert!(drawing.contains(">\nstop\n<"), "{}", &drawing[drawing.len() - 900..]);
    // Nine rays of the axis and of the middle field; the widest is vignetted to what is left.
    assert_eq!(drawing.matches("class=\"c0\"").count(), 9 + 1);
    assert!(drawing.matches("class=\"c2\"").count() > 2);
    let dispersive = preset("achromat");
    let drawing = spots(&dispersive.0, &dispersive.1).unwrap();
    for wavelength in ["486.13 nm", "587.56 nm", "656.27 nm"] {
        assert!(drawing.contains(wavelength));
    }
}

#[test]
fn lenses_without_an_image_or_a_rim_are_drawn_as_far_as_they_go() {
    for json in [
        r#"{"elements": [{"type": "surface", "radius": -20, "thickness": 2, "glass": "N-BK7"},
            {"type": "surface"}]}"#,
        r#"{"elements": [{"type": "surface", "thickness": 0, "glass": "N-BK7"},
            {"type": "surface"}]}"#,
        r#"{"elements": [{"type": "aperture", "shape": "circular", "radius": 0}]}"#,
        r#"{"elements": [{"type": "thin_lens", "focal_length": 50}]}"#,
    ] {
        let train = LensFile::from_json(json).unwrap().build(&|name| Err(name.to_owned())).unwrap();
        let report = LensReport::new(&train, &Inquiry::default()).unwrap();
        for drawing in all(&train, &report) {
            assert!(!drawing.contains("NaN") && !drawing.contains("inf"), "{json}");
        }
    }
}

#[test]
fn lengths_of_scales_are_round() {
    assert_eq!(round_length(140.0), 100.0);
    assert_eq!(round_length(0.0049), 0.002);
    assert_eq!(round_length(5.0), 5.0);
    assert_eq!(round_length(0.0), 1.0);
    assert_eq!(short(0.123_456), "0.1235");
    assert_eq!(short(-20.0), "-20");
}
