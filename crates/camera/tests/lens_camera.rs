//! Cameras with a lens, from what a scene writes to the rays in the world.

use std::f64::consts::PI;

use etendue_camera::{Camera, CameraRays, CameraSpec, FilmSamples};
use etendue_geometry::{Bounds, RayBatch};
use etendue_spectrum::{Bands, Grid};
use glam::DVec3;

fn try_build(json: &str) -> Result<Camera, String> {
    let spec: CameraSpec = serde_json::from_str(json).map_err(|e| e.to_string())?;
    let presets = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes");
    let resolve = |name: &str| Ok(std::path::Path::new(presets).join(name));
    let frame = || Bounds { min: DVec3::splat(-0.5), max: DVec3::splat(0.5) };
    spec.build(frame, &resolve).map_err(|e| e.to_string())
}

fn build(json: &str) -> Camera {
    try_build(json).unwrap_or_else(|e| panic!("{e}"))
}

/// A camera at the origin that looks along −z: `{` and what is special about it are put in front.
fn at_origin(special: &str) -> Camera {
    let camera =
        build(&format!(r#"{{{special}, "pose": {{"from": [0, 0, 0], "look_at": [0, 0, -1]}}}}"#));
    camera.opened(&Bands::Rgb).unwrap()
}

fn chief(camera: &Camera, places: &[[f64; 2]]) -> RayBatch {
    let mut rays = RayBatch::default();
    let [columns, rows] = [0, 1].map(|k| places.iter().map(|p| p[k]).collect::<Vec<f64>>());
    camera.rays_through(&columns, &rows, &mut rays);
    rays
}

fn origin(rays: &RayBatch, i: usize) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|k| rays.origins()[k][i]))
}

fn direction(rays: &RayBatch, i: usize) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|k| rays.directions()[k][i]))
}

/// `count` rays from one place of the sensor, spread over the pupil by the R2 sequence and over wavelengths by the golden
/// section.
fn sampled(camera: &Camera, place: [f64; 2], group: usize, count: u32) -> CameraRays {
    let mut samples = FilmSamples { group, ..FilmSamples::default() };
    for i in 0..count {
        let unit = [0.754_877_666_246_693, 0.569_840_290_998_053, 0.618_033_988_749_895];
        let [u, v, w] = unit.map(|step: f64| (0.5 + step * f64::from(i)).fract());
        samples.push(place, [u, v], w);
    }
    let mut rays = CameraRays::default();
    camera.sample_rays(&samples, &mut rays);
    rays
}

fn mean_weight(rays: &CameraRays, count: u32) -> f64 {
    rays.weight.iter().sum::<f64>() / f64::from(count)
}

const THIN: &str = r#""type": "thin_lens", "focal_length": 50, "f_number": 2, "focus_distance": 2,
    "sensor": {"resolution": [300, 200], "pixel_pitch": 120}"#;

#[test]
fn a_thin_lens_is_registered_with_the_pinhole_of_its_field() {
    let thin = at_origin(THIN);
    let k = thin.opencv().k.unwrap();
    // The image of 2 m lies 50·2000/1950 mm behind the lens.
    let focal = 50.0 * 2000.0 / 1950.0 / 0.12;
    assert!((k[1][1] / focal - 1.0).abs() < 1e-12, "{k:?}");
    let fov = 2.0 * (100.0 / focal).atan().to_degrees();
    let pinhole = at_origin(&format!(
        r#""type": "pinhole", "fov": {fov}, "sensor": {{"resolution": [300, 200]}}"#
    ));
    let by_fov = at_origin(&format!(
        r#""type": "thin_lens", "fov": {fov}, "f_number": 2, "focus_distance": 2,
           "sensor": {{"resolution": [300, 200], "pixel_pitch": 120}}"#
    ));
    let places = [[150.0, 100.0], [0.0, 0.0], [300.0, 0.0], [0.0, 200.0], [299.5, 171.3]];
    let [a, b, c] = [&thin, &pinhole, &by_fov].map(|camera| chief(camera, &places));
    for i in 0..places.len() {
        // Newton stops within 1e-11 mm of the stop's centre, 51 mm away.
        assert!((direction(&a, i) - direction(&b, i)).length() < 1e-12, "{i}");
        assert!((direction(&c, i) - direction(&b, i)).length() < 1e-12, "{i}");
        assert!(origin(&a, i).length() < 1e-14 && a.t_min()[i] < 1e-14, "{i}");
    }
    assert!(direction(&a, 2).x > 0.0 && direction(&a, 2).y > 0.0, "pictures are upright");
}

#[test]
fn the_blur_of_a_thin_lens_camera_is_the_formula_at_ten_distances() {
    // At distance d all rays of a point in focus at s are in a disk of diameter D |d − s|/s around
    // the chief ray: similar triangles over the pupil D.
    let camera = at_origin(THIN);
    let (pupil, focus) = (0.025, 2.0);
    for place in [[150.0, 100.0], [20.0, 190.0]] {
        let centre = direction(&chief(&camera, &[place]), 0);
        let rays = sampled(&camera, place, 0, 4096);
        for distance in [0.3, 0.5, 0.9, 1.4, 1.9, 2.0, 2.2, 3.0, 8.0, 100.0] {
            let on_axis = centre * (distance / -centre.z);
            let mut widest = 0.0_f64;
            for i in 0..rays.rays.len() {
                let (o, d) = (origin(&rays.rays, i), direction(&rays.rays, i));
                let there = o + d * ((distance + o.z) / -d.z);
                widest = widest.max(2.0 * (there - on_axis).length());
            }
            let formula = pupil * (distance - focus).abs() / focus;
            // 4096 points leave the outermost 1/4096 of the disk's area free: 1e-4 of its radius,
            // more along the rim's own unevenness; rays are exact.
            let error = widest - formula;
            assert!(
                error < 1e-12 + 1e-9 * formula && error > -2e-3 * formula - 1e-12,
                "{distance}"
            );
        }
    }
}

#[test]
fn no_ray_of_a_thin_lens_is_lost_at_its_rim() {
    for special in ["", r#", "sensor_tilt": [5, -3], "sensor_decentre": [4, 1]"#] {
        let camera = at_origin(&format!("{THIN}{special}"));
        for place in [[150.0, 100.0], [0.0, 0.0], [299.5, 12.25]] {
            let rays = sampled(&camera, place, 0, 10_000);
            assert_eq!((rays.statuses.exited, rays.statuses.total()), (10_000, 10_000), "{special}");
            assert_eq!(rays.rays.len(), 10_000);
        }
    }
}

#[test]
fn light_falls_off_with_the_fourth_power_of_the_cosine() {
    let camera = at_origin(
        r#""type": "thin_lens", "focal_length": 50, "f_number": 32, "sensor_distance": 50,
           "sensor": {"resolution": [300, 200], "pixel_pitch": 240}"#,
    );
    const COUNT: u32 = 20_000;
    let on_axis = mean_weight(&sampled(&camera, [150.0, 100.0], 0, COUNT), COUNT);
    // Weights differ by (D/2f)² = 2.4e-4 over the disk, which 20 000 places even out.
    assert!((on_axis - 1.0).abs() < 1e-6, "{on_axis}");
    for [column, row] in [[220.0, 100.0], [150.0, 0.0], [290.0, 30.0], [0.0, 0.0]] {
        let tangent = f64::hypot(column - 150.0, row - 100.0) * 0.24 / 50.0;
        let cosine4 = (1.0 + tangent * tangent).powi(-2);
        let rays = sampled(&camera, [column, row], 0, COUNT);
        let measured = mean_weight(&rays, COUNT);
        // f/32 is no point: (D/2f)² = 2.4e-4 of it differs; and the error of counting.
        assert!((measured / cosine4 - 1.0).abs() < 2e-3, "{column} {row}: {measured} {cosine4}");
    }
}

#[test]
fn an_unvignetted_pixel_on_the_axis_weighs_1_and_corners_are_vignetted() {
    let gauss = r#""type": "lens", "lens": "lenses/double-gauss.json", "focus_distance": 1.5,
        "sensor": {"resolution": [360, 240], "pixel_pitch": 100}"#;
    let camera = at_origin(gauss);
    const COUNT: u32 = 50_000;
    let axis = sampled(&camera, [180.0, 120.0], 0, COUNT);
    // As in the thin lens, and 1e-4 for the sum over a grid that is the yardstick.
    assert!((mean_weight(&axis, COUNT) - 1.0).abs() < 1e-3);
    assert!(axis.statuses.exited as f64 > 0.95 * f64::from(COUNT), "{:?}", axis.statuses.losses());
    assert_eq!(axis.statuses.total(), u64::from(COUNT));
    let corner = sampled(&camera, [0.0, 0.0], 0, COUNT);
    let weight = mean_weight(&corner, COUNT);
    let tangent: f64 = 21.6 / 50.0;
    let cosine4 = (1.0 + tangent * tangent).powi(-2);
    assert!(weight < 0.6 * cosine4 && weight > 0.1, "{weight} against {cosine4}");
    // Focused: rays of the axis meet within the lens' spot, 1.2 mm at 1.5 m, and what its colours add:
    // blue is focused 0.05 mm nearer, 0.05 / 50² · 1500 mm of the pupil's radius of 12.4 mm.
    for i in 0..axis.rays.len() {
        let (o, d) = (origin(&axis.rays, i), direction(&axis.rays, i));
        let there = o + d * ((1.5 + o.z) / -d.z);
        assert!(there.truncate().length() < 1.6e-3, "{there}");
    }
    // The camera's origin is the entrance pupil; the front of the lens is before it.
    let rays = chief(&camera, &[[180.0, 120.0], [300.0, 40.0]]);
    assert!(rays.t_min().iter().all(|&t| t > 0.01 && t < 0.05), "{:?}", rays.t_min());
    assert!(origin(&rays, 0).length() < 1e-12);
    assert!(origin(&rays, 1).length() < 2e-3, "pupil aberration moves it a little");
    // Near the axis K is what is traced.
    let k = camera.opencv().k.unwrap();
    let rays = chief(&camera, &[[181.0, 119.0]]);
    let d = direction(&rays, 0);
    assert!((d.x / -d.z * k[0][0] - 1.0).abs() < 1e-4 && (d.y / -d.z * k[1][1] - 1.0).abs() < 1e-4);
}

#[test]
fn a_stop_in_the_rear_focal_plane_keeps_sizes() {
    let camera = at_origin(
        r#""type": "thin_lens", "focal_length": 40, "sensor_distance": 60,
           "elements": [{"type": "aperture", "shape": "circular", "radius": 2, "at": 40, "stop": true}],
           "sensor": {"resolution": [100, 100], "pixel_pitch": 100}"#,
    );
    let file = camera.opencv();
    assert_eq!(file.k, None);
    // Image distance 60 behind a lens of 40: magnification 1 − 60/40 = −1/2.
    let pixel = file.orthographic.unwrap().metres_per_pixel;
    assert!((pixel - 0.2e-3).abs() < 1e-15, "{pixel}");
    let rays = chief(&camera, &[[50.0, 50.0], [70.0, 40.0]]);
    assert!((direction(&rays, 1) - DVec3::NEG_Z).length() < 1e-12);
    assert!((origin(&rays, 1) - DVec3::new(20.0, 10.0, 0.0) * pixel).length() < 1e-12);
}

#[test]
fn orthographic_pictures_keep_sizes_at_all_distances() {
    let camera =
        at_origin(r#""type": "orthographic", "height": 2, "sensor": {"resolution": [200, 200]}"#);
    let rays = chief(&camera, &[[30.0, 100.0], [130.0, 100.0]]);
    for distance in [0.1, 1.0, 1e3] {
        let apart = origin(&rays, 1) - origin(&rays, 0)
            + (direction(&rays, 1) - direction(&rays, 0)) * distance;
        assert_eq!(apart, DVec3::X, "100 pixels of 2 m / 200");
    }
}

#[test]
fn wavelengths_are_traced_apart_only_where_they_differ() {
    let of = |lens: &str| {
        at_origin(&format!(
            r#"{lens}, "front_radius": 50, "rear_radius": -50, "thickness": 6, "semi_diameter": 8,
               "sensor_distance": 48, "sensor": {{"resolution": [60, 40], "pixel_pitch": 50}}"#
        ))
    };
    let plain = of(r#""type": "real_lens", "refractive_index": 1.5168"#);
    assert_eq!(plain.band_groups(&Bands::Rgb).len(), 1);
    let glass = of(r#""type": "chromatic_real_lens", "glass": "N-BK7""#);
    assert_eq!(glass.band_groups(&Bands::Grey).len(), 1);
    let groups = glass.band_groups(&Bands::Rgb);
    assert_eq!(groups.len(), 3);
    let opened = glass.opened(&Bands::Rgb).unwrap();
    // Where the rays of the axis cross it in front of the lens: blue is focused nearest.
    let focus = |group| {
        let found = vergences(&sampled(&opened, [30.0, 20.0], group, 20_000));
        found.iter().sum::<f64>() / found.len() as f64
    };
    let vergence: Vec<f64> = (0..groups.len()).map(focus).collect();
    // Paraxial: Δ(1/f) = Δn/(n − 1)/f, 1/m; rays within 1 mm have 1e-3 of spherical aberration.
    let [red, blue] = [groups[0].wavelength.unwrap(), groups[2].wavelength.unwrap()];
    let measured = vergence[2] - vergence[0];
    let formula = crown_power(blue) - crown_power(red);
    assert!((measured / formula - 1.0).abs() < 0.02, "{measured} and {formula}");
}

/// The vergences (1/m) at which the rays of the axis that pass within 1 mm of it leave a lens, sorted.
fn vergences(rays: &CameraRays) -> Vec<f64> {
    let vergence = |i: usize| {
        let (o, d) = (origin(&rays.rays, i), direction(&rays.rays, i));
        1.0 / (-o.z - d.z * o.truncate().length() / d.truncate().length())
    };
    let near = |i: &usize| (2e-4..1e-3).contains(&origin(&rays.rays, *i).truncate().length());
    let mut found: Vec<f64> = (0..rays.rays.len()).filter(near).map(vergence).collect();
    found.sort_by(f64::total_cmp);
    found
}

/// 1/(1 m) of a biconvex lens of N-BK7, 50 mm and 50 mm, 6 mm thick.
fn crown_power(nm: f64) -> f64 {
    let um2 = (nm * 1e-3).powi(2);
    let [b, c] = [
        [1.039_612_12, 0.231_792_344, 1.010_469_45],
        [0.006_000_698_67, 0.020_017_914_4, 103.560_653],
    ];
    let n = (1.0 + (0..3).map(|i| b[i] * um2 / (um2 - c[i])).sum::<f64>()).sqrt();
    (n - 1.0) * (2.0 / 0.05 - (n - 1.0) * 0.006 / (n * 0.05 * 0.05))
}

#[test]
fn a_grey_sensor_sees_all_the_wavelengths_of_its_band() {
    let crown = |elements: &str| {
        let camera = at_origin(&format!(
            r#""type": "chromatic_real_lens", "glass": "N-BK7", "front_radius": 50,
               "rear_radius": -50, "thickness": 6, "semi_diameter": 8, "sensor_distance": 48,
               "elements": [{elements}], "sensor": {{"resolution": [60, 40], "pixel_pitch": 50}}"#
        ));
        camera.opened(&Bands::Grey).unwrap()
    };
    const COUNT: u32 = 20_000;
    let clear = sampled(&crown(""), [30.0, 20.0], 0, COUNT);
    let found = vergences(&clear);
    // The same photons at every wavelength's weight λ, by the formula.
    let grid = (0..4000).map(|i| 380.0 + 0.1 * (f64::from(i) + 0.5));
    let (mean, weight) = grid.fold((0.0, 0.0), |(sum, w), nm| (sum + nm * crown_power(nm), w + nm));
    let against = |nm: f64| crown_power(nm) - mean / weight;
    let measured = found.iter().sum::<f64>() / found.len() as f64;
    // Everything against the mean, so that the sensor's own vergence drops out; 1 mm of height
    // aberrates by 1e-3 of the power of 20.7 1/m.
    let ends = [found[0] - measured, found[found.len() - 1] - measured];
    let expected = [against(780.0), against(380.0)];
    for (end, expected) in ends.iter().zip(expected) {
        let share = end / expected;
        assert!(
            (0.8..1.1).contains(&share),
            "{ends:?} {expected:?}: 16 medians end before the rim"
        );
    }
    // A line of 10 nm: no ray is wasted on what it stops, and all see its own focus.
    let line = r#"{"type": "filter", "at": 3, "transmission":
        [[380, 0], [449.9, 0], [450, 1], [460, 1], [460.1, 0], [780, 0]]}"#;
    let through = sampled(&crown(line), [30.0, 20.0], 0, COUNT);
    assert!(through.sample.len() * 100 > clear.sample.len() * 99, "rays are lost to the filter");
    let share = mean_weight(&through, COUNT) / mean_weight(&clear, COUNT);
    // ∫ λ dλ over the line and its flanks, against 380..780 nm.
    let photons = (460.05f64.powi(2) - 449.95f64.powi(2)) / (780f64.powi(2) - 380f64.powi(2));
    assert!((share / photons - 1.0).abs() < 2e-3, "{share} and {photons}");
    let blue = vergences(&through);
    let shift = blue.iter().sum::<f64>() / blue.len() as f64 - measured;
    assert!((shift / against(455.0) - 1.0).abs() < 0.03, "{shift} {}", against(455.0));
    assert!(blue[blue.len() - 1] - blue[0] < 0.3 * (ends[1] - ends[0]), "{blue:?}");
}

#[test]
fn filters_dim_each_band_by_its_own_mean() {
    let camera = at_origin(
        r#""type": "thin_lens", "focal_length": 50, "f_number": 4, "sensor_distance": 50,
           "elements": [{"type": "filter", "transmission": [[380, 0], [499, 0], [501, 1], [780, 1]], "at": -1}],
           "sensor": {"resolution": [30, 20], "pixel_pitch": 50}"#,
    );
    let opened = camera.opened(&Bands::Rgb).unwrap();
    const COUNT: u32 = 4096;
    let weights: Vec<f64> = (0..opened.band_groups(&Bands::Rgb).len())
        .map(|group| mean_weight(&sampled(&opened, [15.0, 10.0], group, COUNT), COUNT))
        .collect();
    assert!(weights[1] > 0.8 && weights[2] < 0.2, "yellow passes, blue does not: {weights:?}");
    let halves = at_origin(
        r#""type": "thin_lens", "focal_length": 50, "f_number": 4, "sensor_distance": 50,
           "elements": [{"type": "filter", "transmission": 0.5, "at": 3}],
           "sensor": {"resolution": [30, 20], "pixel_pitch": 50}"#,
    );
    assert_eq!(halves.band_groups(&Bands::Rgb).len(), 1, "a grey filter tells nothing apart");
    let half = mean_weight(&sampled(&halves, [15.0, 10.0], 0, COUNT), COUNT);
    assert!((half - 0.5).abs() < 1e-3, "{half}");
}

#[test]
fn losses_are_those_of_the_surfaces_and_of_the_way_and_only_when_asked_for() {
    let of = |losses: &str| {
        at_origin(&format!(
            r#""type": "chromatic_real_lens", "front_radius": 500, "rear_radius": -500, "thickness": 6,
               "glass": "N-BK7", "semi_diameter": 5, "sensor_distance": 480, {losses}
               "sensor": {{"resolution": [30, 20], "pixel_pitch": 50}}"#
        ))
    };
    const COUNT: u32 = 4096;
    let value = |camera: &Camera| {
        // A band so narrow that one wavelength stands for it.
        let line = Bands::Spectral(Grid::from_edges(vec![580.0, 595.12]).unwrap());
        let opened = camera.opened(&line).unwrap();
        mean_weight(&sampled(&opened, [15.0, 10.0], 0, COUNT), COUNT)
    };
    let lossless = value(&of(""));
    let bare = value(&of(r#""losses": {"reflection": "uncoated"},"#)) / lossless;
    // Rays are within 1.5° of the normals: ((n − 1)/(n + 1))² at both surfaces, to the square of it.
    let reflected = (0.5168 / 2.5168_f64).powi(2);
    assert!((bare - (1.0 - reflected).powi(2)).abs() < 1e-4, "{bare}");
    let coated = r#""losses": {"reflection": {"index": 1.38, "thickness": 106.4}},"#;
    let coated = value(&of(coated)) / lossless;
    let least = ((1.5168 - 1.9044) / (1.5168 + 1.9044_f64)).powi(2);
    assert!((coated - (1.0 - least).powi(2)).abs() < 1e-4, "{coated}");
    let absorbed = value(&of(r#""losses": {"absorption": true},"#)) / lossless;
    assert!(absorbed < 1.0 && absorbed > 0.98, "6 mm of crown glass are clear: {absorbed}");
}

#[test]
fn a_tilted_sensor_puts_a_tilted_plane_in_focus() {
    // Scheimpflug: the planes of lens, sensor and object meet in one line, here at y = −f'/tan τ.
    let camera = at_origin(
        r#""type": "thin_lens", "focal_length": 50, "f_number": 2, "sensor_distance": 52,
           "sensor_tilt": [6, 0], "sensor": {"resolution": [30, 200], "pixel_pitch": 100}"#,
    );
    let tilt = 6_f64.to_radians();
    for row in [40.0, 100.0, 170.0] {
        let film = (row - 100.0) * 0.1;
        // Turned about x, right-handed: y goes towards +z, away from the lens.
        let (y, s) = (film * tilt.cos(), 52.0 + film * tilt.sin());
        let object = 1.0 / (1.0 / 50.0 - 1.0 / s);
        let focus = DVec3::new(0.0, -y / s * object, -object) * 1e-3;
        let rays = sampled(&camera, [15.0, row], 0, 200);
        assert!(rays.rays.len() > 150);
        for i in 0..rays.rays.len() {
            let (o, d) = (origin(&rays.rays, i), direction(&rays.rays, i));
            let past = (focus - o).cross(d).length();
            assert!(past < 1e-12 * object, "{row}: {past}");
        }
    }
}

#[test]
fn data_end_at_the_image_circle_of_a_shifted_lens_too() {
    // Behind the lens light goes straight: the lens' disk (2 mm) and an aperture (3 mm) 30 mm behind
    // it overlap as seen from the sensor 50 mm behind it up to (2·20 + 3·50)/30 mm off the axis.
    let camera = at_origin(
        r#""type": "thin_lens", "focal_length": 50, "sensor_distance": 50,
           "aperture": {"shape": "circular", "radius": 2},
           "elements": [{"type": "aperture", "shape": "circular", "radius": 3, "at": 30}],
           "sensor_decentre": [4, 2], "sensor": {"resolution": [100, 70], "pixel_pitch": 200}"#,
    );
    let circle = (2.0 * 20.0 + 3.0 * 50.0) / 30.0;
    let places: Vec<[f64; 2]> =
        (0..7000).map(|i| [f64::from(i % 100) + 0.5, f64::from(i / 100) + 0.5]).collect();
    let rays = chief(&camera, &places);
    let (mut inside, mut outside) = (0, 0);
    for (i, [column, row]) in places.into_iter().enumerate() {
        // Pictures are upright, so the sensor's axes are turned.
        let off_axis = f64::hypot(-(column - 50.0) * 0.2 + 4.0, (row - 35.0) * 0.2 + 2.0);
        let seen = rays.t_max()[i] > 0.0;
        // Edges are found to 0.5 %, and 32 of them are joined by straight lines.
        if off_axis < 0.97 * circle {
            inside += 1;
            assert!(seen, "{column} {row}: {off_axis} mm");
        } else if off_axis > 1.03 * circle {
            outside += 1;
            assert!(!seen, "{column} {row}: {off_axis} mm");
        }
    }
    assert!(inside > 1000 && outside > 1000, "{inside} {outside}");
}

#[test]
fn a_camera_without_a_pose_frames_the_box_and_focuses_on_it() {
    for special in [
        r#""type": "thin_lens", "focal_length": 35, "f_number": 2, "sensor_height": 24"#,
        r#""type": "lens", "lens": "lenses/double-gauss.json", "sensor_height": 24"#,
        r#""type": "lens", "lens": "lenses/fisheye.json", "sensor_height": 10"#,
    ] {
        let camera = build(&format!(r#"{{{special}, "sensor": {{"resolution": [300, 200]}}}}"#));
        let distance = -(camera.pose().rotation.transpose() * -camera.pose().position).z;
        let focus = camera.lens().unwrap().focused().object_distance();
        assert!((focus / distance - 1.0).abs() < 0.01, "{special}: {focus} at {distance}");
        let by_name = camera.opencv();
        assert!(by_name.lens.is_some() && by_name.pixel_pitch_um.is_some());
    }
}

#[test]
fn the_field_of_view_gives_the_size_of_the_pixels() {
    let fisheye = at_origin(
        r#""type": "lens", "lens": "lenses/fisheye.json", "fov": 120, "sensor": {"resolution": [300, 200]}"#,
    );
    let rays = chief(&fisheye, &[[150.0, 0.0], [150.0, 200.0]]);
    for (i, up) in [(0, 1.0), (1, -1.0)] {
        let d = direction(&rays, i);
        let expected = DVec3::new(0.0, up * 60_f64.to_radians().sin(), -0.5);
        // Both chief rays pass within 1e-9 mm of the stop's centre.
        assert!((d - expected).length() < 1e-8, "{d}");
    }
}

#[test]
fn what_makes_no_camera_is_refused_with_its_place() {
    let thin = |keys: &str| try_build(&format!(r#"{{"type": "thin_lens", {keys}}}"#));
    let sensor = r#""sensor": {"resolution": [30, 20], "pixel_pitch": 50}"#;
    for (camera, place, words) in [
        (thin(sensor), "focal_length:", "give this, or `fov`"),
        (thin(&format!(r#""focal_length": 50, {sensor}"#)), "f_number:", "or `aperture`"),
        (thin(r#""focal_length": 50, "f_number": 2"#), "sensor.pixel_pitch:", "`sensor_height`"),
        (
            thin(&format!(r#""focal_length": 50, "f_number": 2, "fov": 30, {sensor}"#)),
            "fov:",
            "both give the size",
        ),
        (
            thin(&format!(r#""focal_length": 50, "f_number": 0, {sensor}"#)),
            "f_number:",
            "must be positive",
        ),
        (
            thin(&format!(
                r#""focal_length": 50, "f_number": 2, "focus_distance": 0.05, {sensor}"#
            )),
            "focus_distance:",
            "front focal point",
        ),
        (
            thin(&format!(
                r#""focal_length": 50, "f_number": 2, "focus_distance": 0.03, {sensor}"#
            )),
            "focus_distance:",
            "no real image",
        ),
        (
            thin(&format!(
                r#""focal_length": 50, "f_number": 2, "focus_distance": 1, "sensor_distance": 51, {sensor}"#
            )),
            "sensor_distance:",
            "remove one",
        ),
        (
            thin(&format!(
                r#""focal_length": 50, "aperture": {{"shape": "circular", "radius": 0}}, {sensor}"#
            )),
            ": no light passes the lens",
            "vignetted at element 1",
        ),
        (
            thin(&format!(
                r#""focal_length": 50, "f_number": 2, "elements": [{{"type": "aperture",
                   "shape": "polygon", "blades": 2, "radius": 1, "at": 3}}], {sensor}"#
            )),
            "elements[0]:",
            "3 to 1024",
        ),
        (
            try_build(&format!(
                r#"{{"type": "lens", "lens": {{"elements": [{{"type": "surface", "glass": "N-BK8"}}]}}, {sensor}}}"#
            )),
            "lens.elements[0].glass:",
            "N-BK7",
        ),
        (
            try_build(&format!(r#"{{"type": "lens", "lens": "lenses/none.json", {sensor}}}"#)),
            "lens:",
            "cannot be read",
        ),
        (
            try_build(&format!(
                r#"{{"type": "real_lens", "thickness": 5, "front_radius": 50, "refractive_index": 1.5, {sensor}}}"#
            )),
            ": the lens passes light in all directions",
            "semi_diameter",
        ),
    ] {
        let error = camera.expect_err(words);
        assert!(error.starts_with(place) && error.contains(words), "{error}");
    }
}

#[test]
fn the_weights_of_a_small_lens_are_its_solid_angle() {
    let camera = at_origin(THIN);
    let image = 50.0 * 2000.0 / 1950.0;
    // π sin²θ of the cone from the axis to the rim of 12.5 mm.
    let exact = PI * 12.5 * 12.5 / (12.5 * 12.5 + image * image);
    let measured = camera.lens().unwrap().solid_angle();
    // A grid of 500 cells across cuts a rim of 1500 cells.
    assert!((measured / exact - 1.0).abs() < 2e-4, "{measured} and {exact}");
}

#[test]
fn points_on_chief_rays_are_placed_where_these_start() {
    let sensor = r#""sensor": {"resolution": [640, 480], "pixel_pitch": "20 um"}"#;
    for special in [
        format!(
            r#""type": "thin_lens", "focal_length": "50 mm", "f_number": 2, "focus_distance": 2, {sensor}"#
        ),
        format!(
            r#""type": "lens", "lens": "lenses/double-gauss.json", "focus_distance": 2, {sensor}"#
        ),
    ] {
        let camera = at_origin(&special);
        let places = [[320.0, 240.0], [100.5, 400.25], [639.0, 1.0]];
        let rays = chief(&camera, &places);
        for (i, place) in places.iter().enumerate() {
            for far in [0.8, 2.0, 70.0] {
                let point = origin(&rays, i) + direction(&rays, i) * far;
                let found = camera.place_of(point).unwrap_or_else(|| panic!("{special} {place:?}"));
                let off = (found[0] - place[0]).hypot(found[1] - place[1]);
                // The stop's centre is met to 1e-9 mm, from 50 mm away, on pixels of 0.02 mm.
                assert!(off < 1e-6, "{off} px: {special} {place:?} {far}");
            }
        }
        assert_eq!(camera.place_of(DVec3::Z), None, "behind: {special}");
    }
}
