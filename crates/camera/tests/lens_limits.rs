//! Where lenses fail, and what must happen there: a fate, a clear error, or an exact limit.

use etendue_camera::element::{Clip, Fate, LensRays};
use etendue_camera::train::{
    ExitPupil, ExitPupilError, Focus, FocusError, LensFile, OpticalTrain, Side,
};
use glam::DVec3;

fn build(json: &str) -> OpticalTrain {
    try_build(json).unwrap_or_else(|e| panic!("{e}"))
}

fn try_build(json: &str) -> Result<OpticalTrain, String> {
    let file = LensFile::from_json(json).map_err(|e| e.to_string())?;
    file.build(&|name| Err(format!("{name}: no files"))).map_err(|e| e.to_string())
}

fn preset(name: &str) -> OpticalTrain {
    let path = format!("{}/../../scenes/lenses/{name}.json", env!("CARGO_MANIFEST_DIR"));
    build(&std::fs::read_to_string(path).unwrap())
}

fn fate(train: &OpticalTrain, clip: Clip, origin: [f64; 3], direction: [f64; 3]) -> Fate {
    let at = train.at(587.56).unwrap();
    let path = at.path(Side::Object, clip, origin.into(), direction.into());
    assert!(path.points.iter().all(|p| p.is_finite()));
    let mut rays = LensRays::default();
    rays.push(origin.into(), direction.into());
    at.trace(Side::Object, clip, &mut rays);
    assert_eq!(rays.fate(0), path.fate, "a batch of one ends as the single ray does");
    assert!(rays.position(0).is_finite() && rays.direction(0).is_finite());
    path.fate
}

const SPHERE: &str = r#"{"elements": [{"type": "surface", "radius": 10, "glass": {"n": 1.5}}]}"#;

#[test]
fn rays_past_a_sphere_miss_it() {
    let train = build(SPHERE);
    let beside = fate(&train, Clip::Off, [0.0, 10.001, -5.0], [0.0, 0.0, 1.0]);
    assert_eq!(beside, Fate::Missed { element: 0 });
    assert_eq!(fate(&train, Clip::Off, [0.0, 9.999, -5.0], [0.0, 0.0, 1.0]), Fate::Exited);
    let along = fate(&train, Clip::Off, [0.0, -30.0, -5.0], [0.0, 1.0, 0.0]);
    assert_eq!(along, Fate::Missed { element: 0 });
}

#[test]
fn the_back_half_of_a_sphere_is_not_the_surface() {
    let train = build(SPHERE);
    // From behind the vertex, inside the ball, onwards: only the back half lies ahead.
    let inside = fate(&train, Clip::Off, [0.0, 1.0, 5.0], [0.0, 0.0, 1.0]);
    assert_eq!(inside, Fate::Missed { element: 0 });
}

#[test]
fn total_reflection_ends_a_ray_at_the_surface_where_it_happens() {
    let train = build(
        r#"{"elements": [{"type": "surface", "thickness": 9, "glass": {"n": 1.5}},
                         {"type": "surface", "radius": -10}]}"#,
    );
    // At height 6.7 the ball's slope is 0.67 > 1/1.5; at 6.6 it is 0.66.
    let at = |y| fate(&train, Clip::Off, [0.0, y, -5.0], [0.0, 0.0, 1.0]);
    assert_eq!(at(6.7), Fate::TotalInternalReflection { element: 1 });
    assert_eq!(at(6.6), Fate::Exited);
    assert_eq!(at(10.1), Fate::Missed { element: 1 });
}

#[test]
fn equal_indices_on_both_sides_are_no_surface_at_all() {
    let train = build(
        r#"{"elements": [{"type": "surface", "radius": 7, "thickness": 3, "glass": {"n": 1}},
                         {"type": "surface", "radius": -9, "conic": -2}]}"#,
    );
    let at = train.at(587.56).unwrap();
    let direction = DVec3::new(0.1, 0.2, 1.0).normalize();
    let path = at.path(Side::Object, Clip::On, DVec3::new(0.5, 0.0, -4.0), direction);
    assert_eq!(path.direction, Some(direction));
    let paraxial = train.paraxial(587.56).unwrap();
    assert_eq!((paraxial.efl, paraxial.bfl, paraxial.f_number), (None, None, None));
    assert_eq!(train.sensor_z(Focus::Infinity), Err(FocusError::Afocal));
}

#[test]
fn a_rim_wider_than_the_sphere_is_told_and_rays_there_miss() {
    let train = build(
        r#"{"elements": [{"type": "surface", "radius": 10, "thickness": 5, "glass": {"n": 1.5},
                          "semi_diameter": 12}, {"type": "surface", "semi_diameter": 12}]}"#,
    );
    assert!(train.notes()[0].contains("its surface ends 10 mm"), "{:?}", train.notes());
    let beyond = fate(&train, Clip::On, [0.0, 11.0, -5.0], [0.0, 0.0, 1.0]);
    assert_eq!(beyond, Fate::Missed { element: 0 });
}

#[test]
fn crossing_edges_are_told_and_rays_there_miss_the_second_surface() {
    let train = build(
        r#"{"elements": [
            {"type": "surface", "radius": 20, "thickness": 1, "glass": {"n": 1.5}, "semi_diameter": 10},
            {"type": "surface", "radius": -20, "semi_diameter": 10}]}"#,
    );
    // The two spheres meet where 1 = 2 (20 − √(400 − r²)): r = √(400 − 19.5²) = 4.444.
    assert!(train.notes()[0].contains("cut through each other 4.53"), "{:?}", train.notes());
    let at = |y| fate(&train, Clip::On, [0.0, y, -5.0], [0.0, 0.0, 1.0]);
    assert_eq!(at(4.4), Fate::Exited);
    assert_eq!(at(4.6), Fate::Missed { element: 1 });
}

#[test]
fn a_steep_asphere_ends_rays_and_makes_no_nonsense() {
    let train = build(
        r#"{"elements": [{"type": "surface", "radius": 50, "thickness": 8, "glass": {"n": 1.5},
                          "aspheric": {"4": 4e-3, "6": -9e-5, "8": 5e-7}},
                         {"type": "surface"}]}"#,
    );
    let at = train.at(587.56).unwrap();
    let mut ends = [0, 0, 0];
    for i in 0..4000 {
        let y = 0.005 * f64::from(i);
        let slope = 0.3 * f64::from(i % 7) - 0.9;
        let mut rays = LensRays::default();
        rays.push(DVec3::new(0.1, y - 20.0 * slope, -20.0), DVec3::new(0.0, slope, 1.0));
        at.trace(Side::Object, Clip::Off, &mut rays);
        assert!(rays.position(0).is_finite() && rays.direction(0).is_finite());
        match rays.fate(0) {
            Fate::Exited => ends[0] += 1,
            Fate::Missed { .. } => ends[1] += 1,
            _ => ends[2] += 1,
        }
    }
    assert!(ends[0] > 500 && ends[1] > 100, "{ends:?}");
}

#[test]
fn focus_at_and_inside_the_focal_length_is_an_error_and_far_away_an_exact_limit() {
    let train =
        build(r#"{"elements": [{"type": "thin_lens", "focal_length": 50, "semi_diameter": 10}]}"#);
    let z = |distance| train.sensor_z(Focus::Distance(distance));
    assert!(matches!(z(0.05), Err(FocusError::AtFocalPoint { least: 0.05, .. })), "{:?}", z(0.05));
    assert!(matches!(z(0.03), Err(FocusError::Virtual { .. })), "{:?}", z(0.03));
    assert!(matches!(z(0.0), Err(FocusError::NotPositive { .. })));
    assert!(matches!(z(-1.0), Err(FocusError::NotPositive { .. })));
    assert!(matches!(z(f64::NAN), Err(FocusError::NotPositive { .. })));
    // 1/s' = 1/50 − 1/s.
    for s in [0.1, 1.2, 1e3, 1e9] {
        let exact = 1.0 / (1.0 / 50.0 - 1e-3 / s);
        assert!((z(s).unwrap() - exact).abs() < 1e-12 * exact, "{s} m");
    }
    assert_eq!(z(1e300), Ok(50.0));
    assert_eq!(z(f64::INFINITY), Ok(50.0));
    assert_eq!(train.sensor_z(Focus::Sensor(52.5)), Ok(52.5));
    let message = z(0.05).unwrap_err().to_string();
    assert!(message.contains("must exceed 0.05 m"), "{message}");
    let diverging = build(r#"{"elements": [{"type": "thin_lens", "focal_length": -50}]}"#);
    let error = diverging.sensor_z(Focus::Infinity).unwrap_err();
    assert!(matches!(error, FocusError::Virtual { image: -50.0, .. }), "{error}");
}

#[test]
fn focus_is_measured_from_the_entrance_pupil() {
    let train = preset("double-gauss");
    let pupil = train.paraxial(train.wavelength()).unwrap().entrance_pupil.z.unwrap();
    let inside = train.sensor_z(Focus::Distance(0.5e-3 * pupil));
    assert!(matches!(inside, Err(FocusError::Inside { .. })), "{inside:?}");
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
fn a_closed_aperture_is_an_error_that_names_it() {
    let closed = build(
        r#"{"elements": [
            {"type": "thin_lens", "focal_length": 50, "semi_diameter": 10, "thickness": 2},
            {"type": "aperture", "shape": "circular", "radius": 0}]}"#,
    );
    assert_eq!(closed.stop(), 1);
    let paraxial = closed.paraxial(587.56).unwrap();
    assert_eq!((paraxial.f_number, paraxial.entrance_pupil.diameter), (None, Some(0.0)));
    let z = closed.sensor_z(Focus::Infinity).unwrap();
    let error = ExitPupil::new(&closed, &[587.56], z, [5.0, 5.0]).unwrap_err();
    assert!(matches!(error, ExitPupilError::Dark { element: 1, .. }), "{error}");
    let on_axis = fate(&closed, Clip::On, [0.0, 0.0, -5.0], [0.0, 0.0, 1.0]);
    assert_eq!(on_axis, Fate::Exited, "the axis itself passes a hole of radius 0");
    let beside = fate(&closed, Clip::On, [0.0, 1e-9, -5.0], [0.0, 0.0, 1.0]);
    assert_eq!(beside, Fate::Vignetted { element: 1 });
}

#[test]
fn f_0_5_traces_and_samples() {
    let wide = build(
        r#"{"elements": [{"type": "thin_lens", "focal_length": 50},
                         {"type": "aperture", "shape": "circular", "radius": 50}]}"#,
    );
    assert_eq!(wide.paraxial(587.56).unwrap().f_number, Some(0.5));
    let pupil = ExitPupil::new(&wide, &[587.56], 50.0, [5.0, 5.0]).unwrap();
    // Half the sphere's projected solid angle on the axis: π sin² 45°.
    let sample = |i: u32| {
        let u = [f64::from(i % 200) / 200.0 + 0.0025, f64::from(i / 200) / 200.0 + 0.0025];
        pupil.sample(glam::DVec2::ZERO, u).unwrap()
    };
    let within = |s: &etendue_camera::train::PupilSample| -s.direction.z >= 0.5_f64.sqrt();
    let sum: f64 = (0..40_000).map(sample).filter(within).map(|s| s.weight).sum();
    // The grid of 200 × 200 loses or gains half a ring: 1/200 of the area.
    assert!((sum / 40_000.0 / (0.5 * std::f64::consts::PI) - 1.0).abs() < 1e-2);
    // A real lens at f/0.5 loses its rim to misses and total reflection, by name.
    let real = build(
        r#"{"elements": [
            {"type": "surface", "radius": 12, "thickness": 14, "glass": {"n": 1.8}, "semi_diameter": 11.9, "stop": true},
            {"type": "surface", "radius": -60, "semi_diameter": 11.9}]}"#,
    );
    let ends: Vec<Fate> = (0..120)
        .map(|i| fate(&real, Clip::On, [0.0, 0.1 * f64::from(i), -9.0], [0.0, 0.0, 1.0]))
        .collect();
    assert_eq!(ends[0], Fate::Exited);
    assert!(ends.iter().any(|f| *f != Fate::Exited), "{ends:?}");
}

#[test]
fn a_wavelength_outside_of_a_glass_is_told_and_one_without_an_index_is_an_error() {
    let train = preset("achromat");
    assert!(train.outside_of_range(550.0).is_empty());
    let notes = train.outside_of_range(2600.0);
    assert!(notes[0].contains("N-BK7 is known from 300 to 2500 nm"), "{notes:?}");
    assert_eq!(notes.len(), 2, "each glass once: {notes:?}");
    assert!(train.at(2600.0).is_ok());
    let error = train.at(10_170.0).unwrap_err();
    assert!(error.to_string().contains("N-BK7 has no refractive index at 10170 nm"), "{error}");
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
        assert_eq!(fate(&train, Clip::On, [0.0, y, -5.0], [0.0, 0.0, 1.0]), Fate::Exited, "{y}");
    }
    let outside = fate(&train, Clip::On, [0.0, 1.001, -5.0], [0.0, 0.0, 1.0]);
    assert_eq!(outside, Fate::Vignetted { element: 0 });
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
