//! Point spread and transfer functions of pupils that have closed forms or one-dimensional integrals.
//!
//! The tolerance is 1e-4 of the peak, and of the modulation, throughout: what sums over 128 to 256
//! cells across a pupil leave of its edge.

use std::f64::consts::{FRAC_2_PI, PI, TAU};

use etendue_optics::analysis::spread::{WeightedFields, strehl};
use etendue_optics::analysis::transfer::{
    geometric_modulation, geometric_modulations, modulation_at,
};
use etendue_optics::analysis::zernike::ZernikeFit;
use etendue_optics::analysis::{
    CellGrid, CellSpread, PointSpread, PupilField, ReferenceSphere, Transfer,
};
use etendue_optics::zernike::ZernikeOrder;
use glam::DVec2;

/// Wavelength (mm and nm) and numerical aperture.
const LENGTH: f64 = 500e-6;
const NM: f64 = 500.0;
const NA: f64 = 0.05;

/// Tolerance of sums over cells.
const TOLERANCE: f64 = 1e-4;

fn field(cells: usize, inner: f64, waves: impl Fn(DVec2) -> f64) -> PupilField {
    let passes = |p: DVec2| p.length() <= 1.0 && p.length() >= inner;
    PupilField::from_fn(cells, NA, NM, passes, waves)
}

fn pupil(cells: usize, inner: f64, waves: impl Fn(DVec2) -> f64) -> WeightedFields {
    WeightedFields::one(field(cells, inner, waves))
}

/// 2 J₁(x)/x.
fn jinc(x: f64) -> f64 {
    if x.abs() < 1e-9 { 1.0 } else { 2.0 * libm::j1(x) / x }
}

/// The transfer function of a clear circle at a share of its limit.
fn clear_circle(s: f64) -> f64 {
    let s = s.min(1.0);
    FRAC_2_PI * (s.acos() - s * (1.0 - s * s).sqrt())
}

/// The limit of the circle (cycles/mm).
const LIMIT: f64 = 2.0 * NA / LENGTH;

/// The greatest differences from `expected`, a function of place over λ/NA.
fn worst_spread(spread: &PointSpread, reach: f64, expected: impl Fn(DVec2) -> f64) -> f64 {
    let places =
        (0..spread.values.len()).map(|i| (spread.place(i) * NA / LENGTH, spread.values[i]));
    let near = places.filter(|(place, _)| place.length() < reach);
    near.map(|(place, value)| (value / spread.perfect - expected(place)).abs()).fold(0.0, f64::max)
}

/// The greatest differences from `expected`, a function of shares of the limit.
fn worst_transfer(transfer: &Transfer, expected: impl Fn(f64) -> f64) -> f64 {
    let shares = (0..=160).map(|k| f64::from(k) / 160.0);
    let off = shares.map(|s| {
        let [y, x] = transfer.modulation(s * LIMIT);
        (y - expected(s).abs()).abs().max((x - expected(s).abs()).abs())
    });
    off.fold(0.0, f64::max)
}

#[test]
fn a_clear_circle_makes_airys_pattern() {
    let fields = pupil(192, 0.0, |_| 0.0);
    let spread = PointSpread::by_fft(&fields, 1);
    let off = worst_spread(&spread, 20.0, |p| jinc(TAU * p.length()).powi(2));
    assert!(off < TOLERANCE, "{off}");
    let transfer = Transfer::of(&spread);
    let off = worst_transfer(&transfer, clear_circle);
    assert!(off < TOLERANCE, "{off}");
    // Encircled energy: 1 − J₀² − J₁² (Lord Rayleigh, 1881).
    let radii: Vec<f64> = (0..40).map(|k| 0.13 * f64::from(k) * LENGTH / NA).collect();
    for (r, share) in radii.iter().zip(transfer.encircled(DVec2::ZERO, &radii)) {
        let x = TAU * NA * r / LENGTH;
        let expected = 1.0 - libm::j0(x).powi(2) - libm::j1(x).powi(2);
        assert!((share - expected).abs() < TOLERANCE, "{r}: {share} {expected}");
    }
    let (place, ratio) = strehl(&fields);
    assert!(place.length() < 1e-9 && (ratio - 1.0).abs() < 1e-9, "{place} {ratio}");
    // All rays land on one point.
    let all = geometric_modulation(&fields, 1000.0);
    assert!(all.iter().all(|value| (value - 1.0).abs() < 1e-9), "{all:?}");
}

#[test]
fn an_annulus_has_a_sharper_peak_and_brighter_rings() {
    let inner = 0.5;
    let fields = pupil(256, inner, |_| 0.0);
    let spread = PointSpread::by_fft(&fields, 1);
    let amplitude = |x: f64| (jinc(x) - inner * inner * jinc(inner * x)) / (1.0 - inner * inner);
    let off = worst_spread(&spread, 20.0, |p| amplitude(TAU * p.length()).powi(2));
    assert!(off < TOLERANCE, "{off}");
    // Overlaps of two rings by those of circles (E. L. O'Neill, J. Opt. Soc. Am. 46, 285 (1956)).
    let lens = |a: f64, b: f64, d: f64| -> f64 {
        if d >= a + b {
            0.0
        } else if d <= (a - b).abs() {
            PI * a.min(b).powi(2)
        } else {
            let [x, y] = [(d * d + a * a - b * b) / (2.0 * d), (d * d + b * b - a * a) / (2.0 * d)];
            let part = |r: f64, x: f64| r * r * (x / r).acos() - x * (r * r - x * x).sqrt();
            part(a, x) + part(b, y)
        }
    };
    let ring = |s: f64| {
        let d = 2.0 * s;
        let both = lens(1.0, 1.0, d) - 2.0 * lens(1.0, inner, d) + lens(inner, inner, d);
        both / (PI * (1.0 - inner * inner))
    };
    let off = worst_transfer(&Transfer::of(&spread), ring);
    assert!(off < TOLERANCE, "{off}");
}

/// The transfer function of a circle W = w ρ² out of focus: the overlap of two circles, along x a
/// closed form, summed over y (H. H. Hopkins, Proc. R. Soc. A 231, 91 (1955)).
fn defocused(w: f64, s: f64) -> f64 {
    const SLICES: u32 = 4000;
    let top = (1.0 - s * s).max(0.0).sqrt();
    let slice = |k: u32| {
        let y = top * ((f64::from(k) + 0.5) / f64::from(SLICES) * 2.0 - 1.0);
        let half = (1.0 - y * y).sqrt() - s;
        let turn = TAU * 4.0 * w * s;
        2.0 * if turn < 1e-9 { half } else { (turn * half).sin() / turn }
    };
    (0..SLICES).map(slice).sum::<f64>() * 2.0 * top / f64::from(SLICES) / PI
}

#[test]
fn defocus_has_hopkins_transfer_function_and_lommels_axis() {
    for w in [0.25, 1.0, 2.0] {
        let fields = pupil(192, 0.0, |p| w * p.length_squared());
        let transfer = Transfer::diffraction(&fields);
        let off = worst_transfer(&transfer, |s| defocused(w, s));
        assert!(off < TOLERANCE, "{w}: {off}");
        // On the axis sin²(πw)/(πw)².
        let spread = PointSpread::by_fft(&fields, 1);
        let middle = spread.values[spread.size / 2 * (spread.size + 1)] / spread.perfect;
        let expected = ((PI * w).sin() / (PI * w)).powi(2);
        assert!((middle - expected).abs() < TOLERANCE, "{w}: {middle} {expected}");
    }
    // By rays an even disc: 2 J₁(x)/x, of radius 2 w λ/NA.
    let fields = pupil(128, 0.0, |p| 2.0 * p.length_squared());
    for frequency in [20.0, 50.0, 80.0, 150.0] {
        let expected = jinc(TAU * frequency * 4.0 * LENGTH / NA).abs();
        let modulation = geometric_modulation(&fields, frequency);
        assert!((modulation[0] - expected).abs() < TOLERANCE, "{modulation:?} {expected}");
        assert!((modulation[1] - expected).abs() < TOLERANCE, "{modulation:?} {expected}");
    }
}

/// The irradiance at a place (λ/NA) of a circle with these waves, over its peak without: a sum in
/// polar coordinates, even in ρ², which weighs all places alike.
fn by_rings(waves: &dyn Fn(DVec2) -> f64, place: DVec2) -> f64 {
    const RINGS: u32 = 800;
    const ANGLES: u32 = 96;
    let (mut re, mut im) = (0.0, 0.0);
    for ring in 0..RINGS {
        let rho = ((f64::from(ring) + 0.5) / f64::from(RINGS)).sqrt();
        for angle in 0..ANGLES {
            let p = DVec2::from_angle(TAU * f64::from(angle) / f64::from(ANGLES)) * rho;
            let (sine, cosine) = (TAU * (waves(p) - p.dot(place))).sin_cos();
            (re, im) = (re + cosine, im + sine);
        }
    }
    let count = f64::from(RINGS * ANGLES);
    (re * re + im * im) / (count * count)
}

#[test]
fn single_zernike_terms_spread_light_as_sums_over_rings_say() {
    let terms = ZernikeOrder::Fringe.terms(16);
    // Defocus, both kinds of astigmatism and of coma, spherical, trefoil, and a higher one.
    for (index, waves) in
        [(4, 0.6), (5, 0.5), (6, -0.5), (7, 0.4), (8, 0.4), (9, 0.5), (10, 0.4), (16, 0.3)]
    {
        let term = terms[index - 1];
        let shape = move |p: DVec2| waves * term.value(p);
        let fields = pupil(192, 0.0, shape);
        let spread = PointSpread::by_fft(&fields, 1);
        let some = (0..spread.values.len()).filter(|i| {
            let place = spread.place(*i) * NA / LENGTH;
            place.length() < 2.5 && i % 11 == 0
        });
        for i in some {
            let expected = by_rings(&shape, spread.place(i) * NA / LENGTH);
            let value = spread.values[i] / spread.perfect;
            assert!((value - expected).abs() < TOLERANCE, "{index} at {i}: {value} {expected}");
        }
        // And the fit finds the term again, alone.
        let fit = ZernikeFit::new(&field(128, 0.0, shape), ZernikeOrder::Fringe, 16).unwrap();
        for coefficient in &fit.coefficients {
            let expected = if coefficient.index == index { waves } else { 0.0 };
            // The unit circle is found to a twentieth of a cell, 5e-4 of its radius, and the slope of
            // these terms there is at most 20.
            assert!((coefficient.waves - expected).abs() < 1e-2 * waves.abs(), "{coefficient:?}");
        }
    }
}

#[test]
fn huygens_and_fft_agree_where_the_sphere_is_large() {
    let waves = |p: DVec2| 0.5 * p.length_squared() * p.y - 0.3 * p.x * p.x + 0.2 * p.y;
    let one = field(128, 0.0, waves);
    let fft = PointSpread::by_fft(&WeightedFields::one(one.clone()), 1);
    let sphere = ReferenceSphere { centre: [0.0; 3], radius: 1e4, index: 1.0 };
    let sum = PointSpread::by_huygens(&one, &sphere, 24, fft.pitch);
    assert!((sum.perfect - fft.perfect).abs() < 1e-9 * fft.perfect);
    for i in 0..sum.values.len() {
        let at = |k: usize| k + fft.size / 2 - sum.size / 2;
        let same = fft.values[at(i / sum.size) * fft.size + at(i % sum.size)];
        // A sphere of 10 m bends the ways to places a hundredth of a millimetre off by 1e-8 mm.
        assert!((sum.values[i] - same).abs() < 1e-4 * fft.perfect, "{i}: {same}");
    }
}

#[test]
fn wavelengths_add_by_their_weights_and_weights_of_nothing_are_refused() {
    let cells = 128;
    let green = field(cells, 0.0, |_| 0.0);
    // The same pupil at 600 nm on cells that make the same pitch: 1.2 times as wide.
    let mut red = PupilField::dark(600.0, cells, green.step * 1.2, DVec2::ZERO, 1.0);
    let fine = PupilField::from_fn(cells, NA, 600.0, |p| p.length() <= 1.0, |_| 0.0);
    assert_eq!(fine.cells, red.cells);
    red.chief_slopes = DVec2::ZERO;
    for i in 0..cells * cells {
        let inside = (0..256_u32).filter(|k| {
            let offset = |k: u32| (f64::from(k) + 0.5) / 16.0 - 0.5;
            let p = red.place(i) + DVec2::new(offset(k % 16), offset(k / 16)) * red.step;
            p.length() <= NA
        });
        let clear = inside.count() as f64 / 256.0;
        (red.clear[i], red.amplitude[i], red.power[i]) = (clear, clear, clear);
    }
    let both = WeightedFields::new(vec![green.clone(), red], &[3.0, 1.0]).unwrap();
    let transfer = Transfer::diffraction(&both);
    for k in 0..50 {
        let frequency = LIMIT * f64::from(k) / 50.0;
        let expected =
            0.75 * clear_circle(frequency / LIMIT) + 0.25 * clear_circle(1.2 * frequency / LIMIT);
        let [y, _] = transfer.modulation(frequency);
        // The circle at 600 nm has but 104 cells.
        assert!((y - expected).abs() < 2.0 * TOLERANCE, "{frequency}: {y} {expected}");
    }
    for weights in [&[0.0][..], &[-1.0], &[f64::NAN], &[1.0, 1.0]] {
        let refused = WeightedFields::new(vec![green.clone()], weights);
        let refused = refused.unwrap_err().to_string();
        assert!(refused.contains("not all of them 0"), "{weights:?}: {refused}");
    }
}

/// Wide cells have the mean of Airy's pattern over themselves, less a 24th of its second differences.
#[test]
fn wide_cells_have_the_mean_of_airys_pattern() {
    let (aperture, wavelength) = (0.1, 500.0);
    let pupil = PupilField::from_fn(128, aperture, wavelength, |p| p.length() <= 1.0, |_| 0.0);
    // λN, of a diameter of 2 NA.
    let unit = wavelength * 1e-6 / (2.0 * aperture);
    let cell = 0.8;
    let spread = CellSpread::of(&[pupil], &CellGrid { pitch: cell * unit, turn: 1.0, most: 999 });
    let mean = |x: f64, y: f64| {
        const FINE: usize = 24;
        let offset = |k: usize| ((k as f64 + 0.5) / FINE as f64 - 0.5) * cell;
        let at = |k: usize| {
            let v = std::f64::consts::PI * (x + offset(k % FINE)).hypot(y + offset(k / FINE));
            jinc(v).powi(2) * std::f64::consts::FRAC_PI_4
        };
        (0..FINE * FINE).map(at).sum::<f64>() / (FINE * FINE) as f64 * cell * cell
    };
    let side = 2 * spread.half + 1;
    let peak = mean(0.0, 0.0);
    for (row, column) in [(0, 0), (0, 1), (1, 1), (2, 0), (0, 3), (3, 2)] {
        let [x, y] = [column, row].map(|k| k as f64 * cell);
        let own = mean(x, y);
        let neighbours =
            mean(x + cell, y) + mean(x - cell, y) + mean(x, y + cell) + mean(x, y - cell);
        let expected = (own - (neighbours - 4.0 * own) / 24.0).max(0.0);
        let share = spread.shares[(spread.half + row) * side + spread.half + column];
        // The rim on cells of the pupil, and what the ring beyond 40 λN takes for good.
        assert!((share - expected).abs() < 1e-3 * peak, "{row} {column}: {share} {expected}");
    }
    assert!((spread.shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
}

/// One frequency by itself is the same as out of the transform of all, and so are even ones by rays.
#[test]
fn single_frequencies_are_those_of_all_of_them() {
    let waves = |p: DVec2| 0.8 * p.length_squared() + 0.4 * p.y * p.length_squared();
    let fields = pupil(96, 0.0, waves);
    let transfer = Transfer::diffraction(&fields);
    for share in [0.1, 0.25, 0.4] {
        let frequency = share * transfer.limit;
        let [own, all] = [modulation_at(&fields, frequency), transfer.modulation(frequency)];
        for axis in 0..2 {
            // The same sums, in another order.
            assert!((own[axis] - all[axis]).abs() < 1e-10, "{share}: {own:?} {all:?}");
        }
    }
    let step = 0.05 * transfer.limit;
    for (k, own) in geometric_modulations(&fields, step, 12).into_iter().enumerate() {
        let all = geometric_modulation(&fields, step * k as f64);
        assert!((own[0] - all[0]).abs().max((own[1] - all[1]).abs()) < 1e-10, "{k}");
    }
}
