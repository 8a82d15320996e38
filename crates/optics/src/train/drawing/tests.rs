//! Tests of the content of drawings.

use super::*;
use crate::train::{Inquiry, LensFile, LensReport, OpticalTrain};

fn preset(name: &str) -> (OpticalTrain, LensReport) {
    let path = format!("{}/../../scenes/lenses/{name}.json", env!("CARGO_MANIFEST_DIR"));
    let file = LensFile::from_json(&std::fs::read_to_string(path).unwrap()).unwrap();
    let train = file.build(&|name: &str| Err(name.to_owned())).unwrap();
    let report = LensReport::new(&train, &Inquiry::default()).unwrap();
    (train, report)
}

fn all(train: &OpticalTrain, report: &LensReport) -> [String; 3] {
    [
        layout(train, report).unwrap(),
        spots(train, report).unwrap(),
        relative_illumination(train, report).unwrap(),
    ]
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
    assert_eq!(drawing.matches("class=\"s0\"").count(), 9 + 1);
    assert!(drawing.matches("class=\"s2\"").count() > 2);
    let dispersive = preset("achromat");
    let drawing = spots(&dispersive.0, &dispersive.1).unwrap();
    for wavelength in ["486.13 nm", "587.56 nm", "656.27 nm"] {
        assert!(drawing.contains(wavelength));
    }
}

#[test]
fn no_ray_leaves_the_picture_and_the_legend_names_drawn_fields_alone() {
    for name in ["fisheye", "double-gauss", "telephoto"] {
        let (train, mut report) = preset(name);
        // From far behind no light comes.
        report.fields.push(170.0);
        let drawing = layout(&train, &report).unwrap();
        let height: f64 =
            drawing.split("height=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap();
        for path in drawing.split(" d=\"").skip(1) {
            let numbers = path.split('"').next().unwrap();
            let numbers = numbers.split(|c: char| !(c.is_ascii_digit() || "-.".contains(c)));
            let numbers: Vec<f64> = numbers.filter_map(|n| n.parse().ok()).collect();
            for point in numbers.as_chunks::<2>().0 {
                let inside =
                    (-1.0..=961.0).contains(&point[0]) && (-1.0..=height + 1.0).contains(&point[1]);
                assert!(inside, "{name}: {point:?}");
            }
        }
        assert!(!drawing.contains("170\u{b0}"), "{name}");
    }
}

#[test]
fn a_fan_begins_on_a_plane_square_to_it() {
    let (train, report) = preset("double-gauss");
    let at = train.at(train.wavelength()).unwrap();
    let field = report.fields[2];
    let rays = super::layout::fan_of(&train, &at, &report, field);
    let (sine, cosine) = field.to_radians().sin_cos();
    let along: Vec<f64> = rays.iter().map(|ray| ray[0][0] * cosine + ray[0][1] * sine).collect();
    assert!(along.len() > 2);
    for place in &along {
        assert!((place - along[0]).abs() < 1e-9, "{along:?}");
    }
}

#[test]
fn a_box_of_spots_has_the_rms_of_all_its_wavelengths() {
    let (train, report) = preset("singlet");
    let z = report.sensor_z.unwrap();
    let points: Vec<glam::DVec2> = [486.13, 587.56, 656.27]
        .iter()
        .filter_map(|&nm| {
            crate::train::analysis::spot(&train, &train.at(nm).unwrap(), &FieldSpec::at(0.0), z)
        })
        .flat_map(|spot| spot.points)
        .collect();
    // On the axis all centroids are the same.
    let square: f64 = points.iter().map(|point| point.length_squared()).sum();
    let rms = 1e3 * (square / points.len() as f64).sqrt();
    let drawing = spots(&train, &report).unwrap();
    assert!(drawing.contains(&format!("RMS {} \u{b5}m", short(rms))), "{rms}");
    assert!(short(rms) != short(1e3 * report.spots[0].rms));
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
        let train =
            LensFile::from_json(json).unwrap().build(&|name: &str| Err(name.to_owned())).unwrap();
        let report = LensReport::new(&train, &Inquiry::default()).unwrap();
        for drawing in all(&train, &report) {
            assert!(!drawing.contains("NaN") && !drawing.contains("inf"), "{json}");
        }
    }
}
