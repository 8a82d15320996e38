//! Bands of wavelengths through a lens, filters, and what glass takes from light.

use etendue_camera::{Camera, CameraRays};
use etendue_spectrum::{Bands, Grid};

use super::{at_origin, direction, mean_weight, origin, sampled};

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
