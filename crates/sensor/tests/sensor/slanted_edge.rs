//! Edges whose modulation is known, and regions without one.

use etendue_sensor::slanted_edge::{EdgeError, Lattice, slanted_edge};

/// A picture of an edge that is spread by a Gaussian, on pixels: by the mean over each.
fn gaussian(size: [usize; 2], slope: f64, sigma: f64, mean: bool) -> Vec<f64> {
    let [width, height] = size;
    let cosine = slope.atan().cos();
    let value = |x: f64, y: f64| {
        let distance = (x - 0.5 * width as f64 - 0.3 - slope * (y - 0.5 * height as f64)) * cosine;
        0.1 + 0.8 * 0.5 * libm::erfc(-distance / sigma / std::f64::consts::SQRT_2)
    };
    let n = if mean { 12 } else { 1 };
    let part = |k: usize| (k as f64 + 0.5) / n as f64;
    let pixel = |i: usize| {
        let (x, y) = ((i % width) as f64, (i / width) as f64);
        let all = (0..n * n).map(|k| value(x + part(k % n), y + part(k / n)));
        all.sum::<f64>() / (n * n) as f64
    };
    (0..width * height).map(pixel).collect()
}

/// The transform of a Gaussian is one, exp(−2π²σ²ν²), and pixels take their own.
#[test]
fn an_edge_that_is_known_is_measured() {
    for (slope, sigma, is_turned) in
        [(0.09, 0.5, false), (0.09, 1.5, false), (-0.12, 0.8, true), (0.31, 0.6, false)]
    {
        for mean in [false, true] {
            let size = [96, 120];
            let mut values = gaussian(size, slope, sigma, mean);
            let mut region = size;
            if is_turned {
                let turned = |i: usize| values[(i % 120) * 96 + i / 120];
                values = (0..values.len()).map(turned).collect();
                region = [120, 96];
            }
            let edge = slanted_edge(&values, region, Lattice::ALL).unwrap();
            assert_eq!(edge.is_upright, !is_turned);
            // A thousandth of a degree: centroids of noiseless lines.
            assert!((edge.angle - slope.atan().to_degrees()).abs() < 2e-2, "{}", edge.angle);
            assert!((edge.contrast - 0.8).abs() < 1e-3);
            for k in 0..=10 {
                let f = 0.05 * f64::from(k);
                let own = (-2.0 * (std::f64::consts::PI * sigma * f).powi(2)).exp();
                let expected = if mean { own * edge.modulation_of_pixels(f) } else { own };
                let measured = edge.modulation_at(f);
                assert!(
                    (measured - expected).abs() < 5e-3,
                    "{slope} {sigma} {f}: {measured} {expected}"
                );
            }
        }
    }
}

/// One colour of a mosaic is measured at its own places.
#[test]
fn every_second_pixel_tells_the_same() {
    let values = gaussian([160, 200], 0.09, 1.2, true);
    let lattice = Lattice { step: [2, 2], first: [1, 0] };
    let edge = slanted_edge(&values, [160, 200], lattice).unwrap();
    for k in 0..=8 {
        let f = 0.05 * f64::from(k);
        let own = (-2.0 * (std::f64::consts::PI * 1.2 * f).powi(2)).exp();
        assert!((edge.modulation_at(f) - own * edge.modulation_of_pixels(f)).abs() < 5e-3);
    }
}

#[test]
fn what_is_no_slanted_edge_is_refused() {
    let flat = vec![0.5; 64 * 64];
    let refused = |values: &[f64], size| slanted_edge(values, size, Lattice::ALL).unwrap_err();
    assert!(matches!(refused(&flat, [64, 64]), EdgeError::NotOne | EdgeError::NoStep { .. }));
    assert_eq!(refused(&flat, [64, 8]), EdgeError::Small([64, 8]));
    let upright = gaussian([64, 64], 0.0, 1.0, false);
    assert!(matches!(refused(&upright, [64, 64]), EdgeError::Angle(angle) if angle < 0.5));
    let mut broken = gaussian([64, 64], 0.1, 1.0, false);
    broken[77] = f64::NAN;
    assert_eq!(refused(&broken, [64, 64]), EdgeError::NotFinite(1));
    // An edge that leaves the region on the way.
    let steep = gaussian([32, 200], 0.4, 1.0, false);
    assert!(matches!(refused(&steep, [32, 200]), EdgeError::NotOne | EdgeError::Angle(_)));
}
