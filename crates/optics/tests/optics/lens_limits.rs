//! Tests of lens files at their limits, and of what is no lens. (Where tracing fails: the stability
//! suite.)

use etendue_optics::element::{Clip, LensRays, RayStatus};
use etendue_optics::train::{Focus, OpticalTrain, Side};
use glam::DVec3;

use crate::{build, preset, try_build};

fn status(train: &OpticalTrain, clip: Clip, origin: [f64; 3], direction: [f64; 3]) -> RayStatus {
    let at = train.at(587.56).unwrap();
    let path = at.path(Side::Object, clip, origin.into(), direction.into());
    assert!(path.points.iter().all(|p| p.is_finite()));
    let mut rays = LensRays::default();
    rays.push(origin.into(), direction.into());
    at.trace(Side::Object, clip, &mut rays);
    assert_eq!(rays.status(0), path.status, "a batch of one ends as the single ray does");
    assert!(rays.position(0).is_finite() && rays.direction(0).is_finite());
    path.status
}

#[test]
fn focus_is_measured_from_the_entrance_pupil() {
    let train = preset("double-gauss");
    let pupil = train.paraxial(train.wavelength()).unwrap().entrance_pupil.z.unwrap();
    let inside = train.sensor_z(Focus::Distance(0.5e-3 * pupil)).unwrap_err().to_string();
    assert!(inside.contains("lies inside the lens"), "{inside}");
    // A paraxial ray from the point in focus comes to the axis on the sensor.
    let distance = 0.8;
    let z = train.sensor_z(Focus::Distance(distance)).unwrap();
    let at = train.at(train.wavelength()).unwrap();
    let object = DVec3::new(0.0, 0.0, pupil - 1e3 * distance);
    let path = at.path(Side::Object, Clip::On, object, DVec3::new(0.0, 1e-6, 1.0));
    let (last, direction) = (path.points[10], path.direction.unwrap());
    let meets = last.z - last.y * direction.z / direction.y;
    // The ray's height of 1e-3 mm leaves spherical aberration of about (1e-3/12)² of the depth.
    assert!((meets - z).abs() < 1e-5, "{meets} and {z}");
}

#[test]
fn what_is_no_lens_is_refused_with_its_place() {
    let error = |json| try_build(json).unwrap_err();
    assert!(error(r#"{"elements": []}"#).contains("no elements"));
    let glass = r#"{"elements": [{"type": "surface"}, {"type": "surface", "glass": "N-BK8"}]}"#;
    assert!(
        error(glass).starts_with("elements[1].glass: unknown glass \"N-BK8\""),
        "{}",
        error(glass)
    );
    let stops =
        r#"{"elements": [{"type": "surface", "stop": true}, {"type": "surface", "stop": true}]}"#;
    assert!(error(stops).contains("elements[1].stop: elements[0] is the stop already"));
    let radius = r#"{"elements": [{"type": "surface", "radius": 0}]}"#;
    assert!(error(radius).starts_with("elements[0]: radius is 0"), "{}", error(radius));
    let unknown = r#"{"elements": [], "lenses": 3}"#;
    assert!(error(unknown).contains("unknown field `lenses`"));
    let wavelength = r#"{"elements": [{"type": "surface"}], "wavelength": -5}"#;
    assert!(error(wavelength).contains("wavelength is -5 nm"));
}

#[test]
fn a_stop_without_a_mark_is_the_element_that_limits_the_beam() {
    let train = build(
        r#"{"elements": [
            {"type": "thin_lens", "focal_length": 50, "semi_diameter": 10, "thickness": 25},
            {"type": "thin_lens", "focal_length": 80, "semi_diameter": 4}]}"#,
    );
    // Behind 25 mm a beam of 10 mm from infinity is 5 mm high, and the second lens passes 4.
    assert_eq!(train.stop(), 1);
    let f_number = train.paraxial(587.56).unwrap().f_number.unwrap();
    let half = train.clone().with_f_number(2.0 * f_number).unwrap();
    assert!((half.stop_radius() - 2.0).abs() < 1e-14);
    assert!(train.with_f_number(0.0).is_err());
}

#[test]
fn a_stop_may_be_drawn_behind_the_vertex_of_a_lens_that_bulges_past_it() {
    // As in telephones: the sheet at z = 0, the lens' vertex 0.3 mm in front of it.
    let train = build(
        r#"{"elements": [
            {"type": "aperture", "shape": "circular", "radius": 1, "thickness": -0.3, "stop": true},
            {"type": "surface", "radius": 2, "thickness": 1, "glass": {"n": 1.5}},
            {"type": "surface", "radius": -4}]}"#,
    );
    for y in [0.0, 0.3, 0.9, 0.999] {
        assert_eq!(
            status(&train, Clip::On, [0.0, y, -5.0], [0.0, 0.0, 1.0]),
            RayStatus::Exited,
            "{y}"
        );
    }
    let outside = status(&train, Clip::On, [0.0, 1.001, -5.0], [0.0, 0.0, 1.0]);
    assert_eq!(outside, RayStatus::Vignetted { element: 0 });
}

#[test]
fn the_axial_colour_of_a_thin_singlet_is_the_paraxial_formula() {
    // A thin lens has f (n − 1) constant; one 0.01 mm thick is thin to 1e-4.
    let train = build(
        r#"{"elements": [
            {"type": "surface", "radius": 100, "thickness": 0.01, "glass": "N-BK7", "semi_diameter": 10},
            {"type": "surface", "radius": -100, "semi_diameter": 10}]}"#,
    );
    let glass = &train.media()[1];
    let [f, d, c] = [486.13, 587.56, 656.27].map(|nm| train.paraxial(nm).unwrap().bfl.unwrap());
    let [nf, nd, nc] = [486.13, 587.56, 656.27].map(|nm| glass.index(nm).unwrap());
    let formula = d * (nd - 1.0) * (1.0 / (nf - 1.0) - 1.0 / (nc - 1.0));
    assert!(((f - c) / formula - 1.0).abs() < 2e-4, "{} and {formula}", f - c);
}

#[test]
fn the_blur_of_a_thin_lens_is_the_formula_at_ten_distances() {
    let (f, a, focus) = (50.0, 8.0, 1.2);
    let train = build(&format!(
        r#"{{"elements": [{{"type": "thin_lens", "focal_length": {f}}},
            {{"type": "aperture", "shape": "circular", "radius": {a}}}]}}"#
    ));
    let z = train.sensor_z(Focus::Distance(focus)).unwrap();
    let at = train.at(587.56).unwrap();
    for i in 0..10 {
        let distance = 150.0 * 1.9_f64.powi(i);
        let object = DVec3::new(20.0, -10.0, -distance);
        let mut low = DVec3::INFINITY;
        let mut high = DVec3::NEG_INFINITY;
        for k in 0..360 {
            let angle = f64::from(k).to_radians();
            // Just inside the rim.
            let through = DVec3::new(angle.cos(), angle.sin(), 0.0) * (a * (1.0 - 1e-12));
            let path = at.path(Side::Object, Clip::On, object, through - object);
            let (point, direction) = (path.points[0], path.direction.unwrap());
            let hit = point + direction * ((z - point.z) / direction.z);
            (low, high) = (low.min(hit), high.max(hit));
        }
        // c = 2a |s' − v|/s', with 1/s' = 1/f − 1/s for the object and v the sensor.
        let image = 1.0 / (1.0 / f - 1.0 / distance);
        let blur = 2.0 * a * (image - z).abs() / image;
        let measured = high.x - low.x;
        assert!((measured - blur).abs() < 1e-9, "at {distance} mm: {measured} and {blur}");
    }
}
