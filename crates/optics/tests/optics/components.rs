//! Freeform surfaces and phases in trains: batches against single rays, ways back, focal lengths, refusals.

use etendue_optics::element::{Clip, LensRays, Ray, RayStatus};
use etendue_optics::train::{LensFile, OpticalTrain, Registers, Side};
use glam::DVec3;

use crate::{build, try_build};

/// One of each kind, as the front of a lens of glass.
const SURFACES: [&str; 9] = [
    r#"{"radius": 40, "aspheric": {"3": 2e-5, "4": 1e-6}}"#,
    r#"{"radius": 40, "conic": -0.5, "rotation_radius": 55}"#,
    r#"{"radius": 40, "sag": [{"type": "zernike", "radius": 9, "coefficients": {"5": 0.02, "7": -0.01, "11": 0.01}}]}"#,
    r#"{"radius": 40, "sag": [{"type": "chebyshev", "half_size": [9, 9], "coefficients": [[2, 2, 0.02], [4, 0, 0.01], [0, 0, -0.03]]}]}"#,
    r#"{"radius": 40, "sag": [{"type": "polynomial", "radius": 10, "coefficients": [[3, 0, 0.02], [1, 2, 0.03]]}]}"#,
    r#"{"radius": 40, "sag": [{"type": "q_bfs", "radius": 9, "coefficients": [0.05, -0.02, 0.01]}]}"#,
    r#"{"radius": 40, "conic": -1, "sag": [{"type": "q_con", "radius": 9, "coefficients": [0.05, -0.02, 0.01]}]}"#,
    r#"{"radius": 40, "conic": -1, "fresnel": true}"#,
    r#"{"phase": {"pattern": {"type": "grating", "period": 0.02, "rotation": 30}, "order": -1}}"#,
];

fn lens(surface: &str) -> OpticalTrain {
    let rest = surface.strip_prefix('{').unwrap();
    build(&format!(
        r#"{{"elements": [{{"type": "freeform", "thickness": 4, "glass": "N-BK7", "semi_diameter": 8, "stop": true, {rest},
            {{"type": "surface", "radius": -90, "semi_diameter": 9}}]}}"#
    ))
}

fn start(i: u32) -> Ray {
    let x = 0.37 * f64::from(i % 43) - 8.0;
    let y = 5.0 * (1.3 * f64::from(i)).sin();
    Ray::new(DVec3::new(x, y, -15.0), DVec3::new(0.02, -0.01 * f64::from(i % 5), 1.0)).unwrap()
}

#[test]
fn light_goes_back_the_way_it_came_and_batches_keep_every_bit() {
    for surface in SURFACES {
        let train = lens(surface);
        let at = train.at(550.0).unwrap();
        let mut rays = LensRays::default();
        let mut returned = 0;
        for ray in (0..200).map(start) {
            rays.push(ray.position.into(), ray.direction.into());
            let out = at.run(Side::Object, Clip::On, ray);
            if out.status != RayStatus::Exited {
                continue;
            }
            let reversed = Ray { direction: out.ray.direction.map(|d| -d), ..out.ray };
            let back = at.run(Side::Sensor, Clip::On, reversed);
            assert_eq!(back.status, RayStatus::Exited, "{surface}");
            let apart = DVec3::from(back.ray.direction) + DVec3::from(ray.direction);
            // Some roundings of slopes of order 1.
            assert!(apart.length() < 1e-13, "{surface}: {apart}");
            returned += 1;
        }
        assert!(returned > 100, "{surface}: {returned}");
        for registers in [Registers::Widest, Registers::Baseline] {
            let (mut batch, mut single) = (rays.clone(), rays.clone());
            at.trace_on(registers, Side::Object, Clip::On, &mut batch);
            at.trace_singly(Side::Object, Clip::On, &mut single);
            for i in 0..rays.len() {
                assert_eq!(batch.status(i), single.status(i), "{surface} {i}");
                if batch.status(i) == RayStatus::Exited {
                    assert_eq!(batch.position(i), single.position(i), "{surface} {i}");
                    assert_eq!(batch.direction(i), single.direction(i), "{surface} {i}");
                }
            }
        }
    }
}

/// Rays very near the axis meet where the focal length says, along y: (height 1e-4 mm)² of curvature is 1e-9 of f.
#[test]
fn focal_lengths_are_those_of_rays_near_the_axis() {
    for surface in &SURFACES[..8] {
        let train = lens(surface);
        // Terms that tilt the vertex turn the axis; those here do not.
        let at = train.at(550.0).unwrap();
        let ray = |y: f64| {
            let ray = Ray::new(DVec3::new(0.0, y, -15.0), DVec3::Z).unwrap();
            at.run(Side::Object, Clip::On, ray).ray
        };
        let [up, down] = [ray(1e-4), ray(-1e-4)];
        let slope =
            (up.direction[1] / up.direction[2] - down.direction[1] / down.direction[2]) / 2e-4;
        let efl = train.paraxial(550.0).unwrap().efl.unwrap();
        assert!((-1.0 / slope / efl - 1.0).abs() < 1e-6, "{surface}: {} {efl}", -1.0 / slope);
    }
}

#[test]
fn a_kinoform_has_the_focal_length_of_its_order_at_each_wavelength() {
    let f = 100.0;
    let design = 550.0;
    let a = -std::f64::consts::PI * 25.0 / (design * 1e-6 * f);
    for order in [1, 2, 3] {
        let train = build(&format!(
            r#"{{"elements": [{{"type": "freeform", "semi_diameter": 5, "stop": true, "phase":
              {{"pattern": {{"type": "radial", "radius": 5, "coefficients": [{a}]}}, "order": {order}, "blaze_wavelength": 550}}}}]}}"#
        ));
        assert!(train.is_dispersive() && train.is_rotationally_symmetric());
        for wavelength in [450.0, 550.0, 650.0] {
            let expected = f * design / (wavelength * f64::from(order));
            let efl = train.paraxial(wavelength).unwrap().efl.unwrap();
            assert!((efl / expected - 1.0).abs() < 1e-14, "{order} {wavelength}");
            // sin θ = m λ/2π dφ/dr = r/f exactly, and the light of the order alone.
            let at = train.at(wavelength).unwrap();
            let end = at.run(
                Side::Object,
                Clip::On,
                Ray::new(DVec3::new(0.0, 4.0, -1.0), DVec3::Z).unwrap(),
            );
            assert!((end.ray.direction[1] + 4.0 / expected).abs() < 1e-15);
            let off = std::f64::consts::PI * (design / wavelength - f64::from(order));
            let share = if off.abs() < 1e-9 { 1.0 } else { (off.sin() / off).powi(2) };
            assert!((end.throughput - share).abs() < 1e-12);
        }
    }
}

#[test]
fn evanescent_orders_are_counted_where_they_end() {
    let train = build(
        r#"{"elements": [{"type": "freeform", "semi_diameter": 5, "stop": true, "phase":
          {"pattern": {"type": "grating", "period": 0.0006}, "order": 1}}]}"#,
    );
    let mut rays = LensRays::default();
    rays.push(DVec3::new(0.0, 0.0, -1.0), DVec3::Z);
    for (wavelength, status) in
        [(550.0, RayStatus::Exited), (650.0, RayStatus::TotalInternalReflection { element: 0 })]
    {
        let mut traced = rays.clone();
        train.at(wavelength).unwrap().trace(Side::Object, Clip::On, &mut traced);
        assert_eq!(traced.status(0), status, "{wavelength}");
        assert!(traced.direction(0).is_finite());
    }
}

/// A lens whose file `name` is a grey picture.
fn with_picture(columns: u32, values: &[u8], element: &str) -> Result<OpticalTrain, String> {
    let folder = tempfile::tempdir().unwrap();
    let rows = u32::try_from(values.len()).unwrap() / columns;
    image::GrayImage::from_raw(columns, rows, values.to_vec())
        .unwrap()
        .save(folder.path().join("map.png"))
        .unwrap();
    let file = LensFile::from_json(&format!(r#"{{"elements": [{element}]}}"#))
        .map_err(|e| e.to_string())?;
    file.build(&|name: &str| Ok(folder.path().join(name))).map_err(|e| e.to_string())
}

#[test]
fn a_height_map_of_a_ramp_is_a_wedge_and_pictures_that_are_none_are_refused() {
    // 21 columns of 10 levels more each: the sag rises by 10/255 of 0.255 mm a millimetre: 0.01.
    let ramp: Vec<u8> = (0..21 * 21).map(|i| u8::try_from(10 * (i % 21)).unwrap()).collect();
    let element = r#"{"type": "freeform", "glass": {"n": 1.5}, "sag": [{"type": "height_map", "file": "map.png", "width": 21, "depth": 0.255}]}"#;
    let train = with_picture(21, &ramp, element).unwrap();
    let at = train.at(550.0).unwrap();
    for (x, y) in [(0.0, 0.0), (3.3, -4.2), (-7.7, 5.0)] {
        let end =
            at.run(Side::Object, Clip::On, Ray::new(DVec3::new(x, y, -3.0), DVec3::Z).unwrap());
        let tilt = 0.01_f64.atan();
        let bent = tilt - (tilt.sin() / 1.5).asin();
        assert!((end.ray.direction[0] + bent.sin()).abs() < 1e-13, "{x} {y}: {:?}", end.ray);
        assert!((end.ray.position[2] - 0.01 * (x + 10.0)).abs() < 1e-13);
    }
    // Beyond the picture there is no surface.
    let end =
        at.run(Side::Object, Clip::On, Ray::new(DVec3::new(10.6, 0.0, -3.0), DVec3::Z).unwrap());
    assert_eq!(end.status, RayStatus::Missed { element: 0 });
    let mask = |depth: f64| {
        format!(
            r#"{{"type": "freeform", "phase": {{"pattern": {{"type": "image", "file": "map.png", "width": 21, "depth": {depth}}}}}}}"#
        )
    };
    assert!(with_picture(21, &ramp, &mask(60.0)).is_ok());
    let coarse = with_picture(21, &ramp, &mask(900.0)).unwrap_err();
    assert!(coarse.contains("map.png") && coarse.contains("from a pixel to the next"), "{coarse}");
}

#[test]
fn a_hole_in_a_height_map_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.exr");
    exr::prelude::write_rgb_file(&path, 3, 3, |x, y| {
        let grey = if (x, y) == (1, 2) { f32::NAN } else { 0.5 };
        (grey, grey, grey)
    })
    .unwrap();
    let file = LensFile::from_json(
        r#"{"elements": [{"type": "freeform", "sag": [{"type": "height_map", "file": "map.exr", "width": 3, "depth": 1}]}]}"#,
    );
    let error = file.unwrap().build(&|_: &str| Ok(path.clone())).unwrap_err().to_string();
    assert!(error.contains("elements[0]") && error.contains("map.exr"), "{error}");
}

#[test]
fn keys_of_other_kinds_are_refused() {
    let error = try_build(r#"{"elements": [{"type": "freeform", "fold": true}]}"#).unwrap_err();
    assert!(error.contains("elements[0]") && error.contains("fold is for mirrors"), "{error}");
}
