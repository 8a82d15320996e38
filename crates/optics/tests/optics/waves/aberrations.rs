//! Third-order sums and Coddington's foci against real rays of small apertures and fields.

use etendue_optics::analysis::astigmatism::foci;
use etendue_optics::analysis::fans::{distortion_grid, fans};
use etendue_optics::analysis::seidel::seidel;
use etendue_optics::analysis::{AnalysisError, ObjectPoint};
use etendue_optics::train::{Focus, OpticalTrain};

use crate::{build, preset};

/// A lens with all kinds of surfaces: a conic, an asphere of r² and r⁴, a plane.
fn aspheric() -> OpticalTrain {
    build(
        r#"{"elements": [
        {"type": "surface", "radius": 40, "conic": -0.7, "thickness": 5, "glass": {"nd": 1.6, "vd": 40}},
        {"type": "surface", "radius": 300, "aspheric": {"2": 1e-4, "4": 3e-6}, "thickness": 3},
        {"type": "aperture", "shape": "circular", "radius": 5, "stop": true, "thickness": 4},
        {"type": "surface", "radius": -60, "thickness": 2, "glass": {"nd": 1.7, "vd": 30}},
        {"type": "surface", "thickness": 2, "aspheric": {"4": -2e-6}}]}"#,
    )
}

/// a of a + b x² + c x⁴, by its values at x, 2x and 4x.
fn at_zero([one, two, four]: [f64; 3]) -> f64 {
    let first = [(4.0 * one - two) / 3.0, (4.0 * two - four) / 3.0];
    (16.0 * first[0] - first[1]) / 15.0
}

fn close(value: f64, expected: f64, share: f64, what: &str) {
    assert!((value - expected).abs() <= share * expected.abs(), "{what}: {value} {expected}");
}

fn lenses() -> Vec<(&'static str, OpticalTrain)> {
    vec![
        ("double Gauss", preset("double-gauss").with_f_number(4.0).unwrap()),
        ("triplet", preset("cooke-triplet").with_f_number(8.0).unwrap()),
        ("aspheric", aspheric()),
    ]
}

#[test]
fn spherical_aberration_and_coma_are_those_of_small_apertures() {
    for (name, train) in lenses() {
        let at = train.at(train.wavelength()).unwrap();
        let image = train.sensor_z(Focus::Infinity).unwrap();
        let colours = [486.13, 656.27];
        let waves = 1.0 / (train.wavelength() * 1e-6);
        // W040 = S_I/8 on the paraxial plane.
        let sums = seidel(&train, &ObjectPoint::field(1.0), colours).unwrap().total;
        let fan = fans(&train, &at, ObjectPoint::field(0.0), image, None).unwrap().tangential;
        let over = |k: usize, power: i32| {
            let middle = fan.iter().position(|ray| ray.pupil == 0.0).unwrap();
            fan[middle + k].waves / fan[middle + k].pupil.powi(power)
        };
        let spherical = at_zero([2, 4, 8].map(|k| over(k, 4)));
        close(spherical, sums.spherical / 8.0 * waves, 1e-4, name);
        // W131 = S_II/2: the odd part of a small field, which is linear in it.
        let odd = |field: f64| {
            let fan = fans(&train, &at, ObjectPoint::field(field), image, None).unwrap().tangential;
            let middle = fan.iter().position(|ray| ray.pupil == 0.0).unwrap();
            let coma = |k: usize| {
                let [up, down] = [fan[middle + k], fan[middle - k]];
                0.5 * (up.waves - down.waves) / up.pupil.powi(3) / field.to_radians().tan()
            };
            at_zero([2, 4, 8].map(coma))
        };
        let coma = at_zero([0.25, 0.5, 1.0].map(odd));
        let expected = sums.coma / 2.0 * waves / 1.0_f64.to_radians().tan();
        close(coma, expected, 1e-3, name);
    }
}

#[test]
fn astigmatism_petzval_and_distortion_are_those_of_small_fields() {
    for (name, train) in lenses() {
        let at = train.at(train.wavelength()).unwrap();
        let image = train.sensor_z(Focus::Infinity).unwrap();
        let table = seidel(&train, &ObjectPoint::field(1.0), [486.13, 656.27]).unwrap();
        let (sums, slope) = (table.total, table.image_slope);
        let tan = 1.0_f64.to_radians().tan();
        // Foci at −(S_IV + S_III)/(2 u'²) and −(S_IV + 3 S_III)/(2 u'²), quadratic in the field.
        let over = |field: f64| {
            let foci = foci(&train, &at, ObjectPoint::field(field), image).unwrap().unwrap();
            let share = (tan / field.to_radians().tan()).powi(2);
            [foci.sagittal.unwrap() * share, foci.tangential.unwrap() * share]
        };
        let all = [0.5, 1.0, 2.0].map(over);
        let [sagittal, tangential] = [0, 1].map(|axis| at_zero(all.map(|foci| foci[axis])));
        let scale = -0.5 / (slope * slope);
        close(sagittal, scale * (sums.petzval + sums.astigmatism), 1e-4, name);
        close(tangential, scale * (sums.petzval + 3.0 * sums.astigmatism), 1e-4, name);
        // Heights off by S_V/(2 n' u') from f tan θ, cubic in the field.
        let efl = train.paraxial(train.wavelength()).unwrap().efl.unwrap();
        let off = |field: f64| {
            let foci = foci(&train, &at, ObjectPoint::field(field), image).unwrap().unwrap();
            let slope = field.to_radians().tan();
            (foci.height - efl * slope) * (tan / slope).powi(3)
        };
        let distortion = at_zero([0.5, 1.0, 2.0].map(off));
        close(distortion, sums.distortion / (2.0 * slope), 1e-3, name);
    }
}

#[test]
fn colour_sums_are_those_of_the_paraxial_images() {
    let train = preset("achromat");
    // Neighbouring wavelengths, so that the sums, which are differentials, are differences.
    let colours = [587.06, 588.06];
    let table = seidel(&train, &ObjectPoint::field(1.0), colours).unwrap();
    let [short, long] = colours.map(|nm| train.paraxial(nm).unwrap().bfl.unwrap());
    let expected = table.total.longitudinal_colour / table.image_slope.powi(2);
    close(long - short, expected, 1e-2, "longitudinal");
    assert_eq!(table.surfaces.len(), train.elements().len());
    let sum: f64 = table.surfaces.iter().map(|s| s.petzval).sum();
    close(sum, table.total.petzval, 1e-12, "sum");
}

#[test]
fn a_single_surface_has_the_sums_of_the_book() {
    // A sphere R = 50 from air to n = 1.5, stop at the surface, h = 10, ū = 0.1: by hand
    // A = h/R = 0.2, Δ(u/n) = −h/R (1 − 1/n)/n², Ā = ū, H = −ū h, c Δ(1/n) = −1/150.
    let train = build(
        r#"{"elements": [{"type": "surface", "radius": 50, "glass": {"n": 1.5}, "semi_diameter": 10, "stop": true}]}"#,
    );
    let field = ObjectPoint::field(0.1_f64.atan().to_degrees());
    let sums = seidel(&train, &field, [486.13, 656.27]).unwrap().total;
    let change = -0.2 * (1.0 - 1.0 / 1.5) / 2.25;
    close(sums.spherical, -0.04 * 10.0 * (change * 1.5), 1e-9, "by u' = -h(n-1)/(n R)");
    // u' = −h (n − 1)/(n R) = −1/15, Δ(u/n) = −1/22.5.
    close(sums.spherical, 0.04 * 10.0 / 22.5, 1e-9, "spherical");
    close(sums.coma, 0.2 * 0.1 * 10.0 / 22.5, 1e-9, "coma");
    close(sums.astigmatism, 0.01 * 10.0 / 22.5, 1e-9, "astigmatism");
    close(sums.petzval, 1.0 / 150.0, 1e-9, "petzval");
    // S_V = −Ā³ h Δ(1/n²) with h̄ = 0: 1e-3 · 10 · (1 − 4/9).
    close(sums.distortion, 0.01 * (1.0 - 4.0 / 9.0), 1e-9, "distortion");
    assert_eq!([sums.longitudinal_colour, sums.lateral_colour], [0.0; 2]);
}

#[test]
fn foci_of_an_ideal_lens_lie_in_the_image_and_no_ray_from_behind_has_any() {
    let ideal = build(
        r#"{"elements": [{"type": "thin_lens", "focal_length": 50, "semi_diameter": 5, "thickness": 8},
        {"type": "thin_lens", "focal_length": 80}]}"#,
    );
    let at = ideal.at(550.0).unwrap();
    let image = ideal.sensor_z(Focus::Infinity).unwrap();
    for object in [ObjectPoint::field(0.0), ObjectPoint::field(12.0)] {
        let foci = foci(&ideal, &at, object, image).unwrap().unwrap();
        assert!(foci.sagittal.unwrap().abs() < 1e-9 && foci.tangential.unwrap().abs() < 1e-9);
    }
    let corner = ObjectPoint::field(10.0);
    let efl = ideal.paraxial(550.0).unwrap().efl.unwrap();
    let grid = distortion_grid(&ideal, &at, &corner, image, efl, 5);
    assert_eq!(grid.len(), 25);
    for point in &grid {
        assert!(point.percent < 1e-7, "{point:?}");
    }
    let far = grid.iter().map(|p| p.ideal[0].hypot(p.ideal[1])).fold(0.0, f64::max);
    close(far, efl * 10.0_f64.to_radians().tan(), 1e-12, "corner");
    let wide = foci(&ideal, &ideal.at(550.0).unwrap(), ObjectPoint::field(120.0), image);
    assert!(matches!(wide, Err(AnalysisError::NoChiefRay { .. })), "{wide:?}");
}

/// Coddington's equations at a sphere that is turned by θ about its vertex: n'/s' = c (n' cos I' − n cos I) and
/// n' cos² I'/t' = the same, along the refracted ray.
#[test]
fn foci_behind_a_tilted_sphere_and_a_biconic_are_those_of_coddington() {
    let (radius, n) = (50.0_f64, 1.5_f64);
    for degrees in [1.0_f64, 25.0] {
        let tilted = build(&format!(
            r#"{{"elements": [{{"type": "surface", "radius": {radius}, "glass": {{"n": {n}}}, "semi_diameter": 5,
                "tilt": [{degrees}, 0]}}]}}"#
        ));
        let at = tilted.at(550.0).unwrap();
        let foci = foci(&tilted, &at, ObjectPoint::field(0.0), 0.0).unwrap().unwrap();
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let behind = (1.0 - (sine / n).powi(2)).sqrt();
        let power = (n * behind - cosine) / radius;
        let turned = degrees.to_radians() - (sine / n).asin();
        close(foci.sagittal.unwrap(), n / power * turned.cos(), 1e-12, "sagittal");
        close(
            foci.tangential.unwrap(),
            n * behind * behind / power * turned.cos(),
            1e-12,
            "tangential",
        );
    }
    let biconic = build(
        r#"{"elements": [{"type": "biconic", "radius": 50, "radius_x": -80, "glass": {"n": 1.5}, "semi_diameter": 5}]}"#,
    );
    let at = biconic.at(550.0).unwrap();
    let foci = foci(&biconic, &at, ObjectPoint::field(0.0), 0.0).unwrap().unwrap();
    close(foci.sagittal.unwrap(), -80.0 * 1.5 / 0.5, 1e-12, "along x");
    close(foci.tangential.unwrap(), 50.0 * 1.5 / 0.5, 1e-12, "along y");
}

/// The lens with its stop moved to where a sum is said to be nothing has none of it, and all other sums as they
/// were said to be: of the same marginal ray.
#[test]
fn a_shifted_stop_has_the_sums_that_were_said() {
    let lens = |stop: &str| {
        build(&format!(
            r#"{{"elements": [{stop}
            {{"type": "surface", "radius": 60, "thickness": 4, "glass": "N-BK7", "semi_diameter": 20}},
            {{"type": "surface", "radius": -300, "semi_diameter": 20}}]}}"#
        ))
    };
    let aperture = |radius: f64, gap: f64| {
        lens(&format!(
            r#"{{"type": "aperture", "shape": "circular", "radius": {radius}, "thickness": {gap}, "stop": true}},"#
        ))
    };
    let (field, colours) = (ObjectPoint::field(3.0), [486.13, 656.27]);
    let table = seidel(&aperture(5.0, 1.0), &field, colours).unwrap();
    let names: Vec<_> = table.stop_shifts.iter().map(|shift| shift.without).collect();
    assert_eq!(names, ["coma", "lateral_colour"]);
    let shift = &table.stop_shifts[0];
    // In front of the lens, whose first vertex is a millimetre behind the old stop.
    let z = shift.stop_z.unwrap();
    assert!(z < -1.0, "{shift:?}");
    close(shift.entrance_pupil_z.unwrap(), z, 1e-12, "a stop in front is its own image");
    let moved = seidel(&aperture(5.0, 1.0 - z), &field, colours).unwrap().total;
    assert!(moved.coma.abs() < 1e-9 * table.total.coma.abs(), "{moved:?}");
    for (own, said) in [
        (moved.spherical, shift.total.spherical),
        (moved.astigmatism, shift.total.astigmatism),
        (moved.petzval, shift.total.petzval),
        (moved.distortion, shift.total.distortion),
        (moved.lateral_colour, shift.total.lateral_colour),
    ] {
        close(own, said, 1e-9, "after the shift");
    }
}

/// A stop in front of the lens is its own image without errors; behind the lens the chief ray misses the middle of
/// the paraxial entrance pupil by the third power of the field.
#[test]
fn aberrations_of_the_pupil_are_those_of_what_lies_before_the_stop() {
    let glass = r#"{"type": "surface", "radius": 60, "thickness": 4, "glass": "N-BK7", "semi_diameter": 20},
        {"type": "surface", "radius": -60, "thickness": 15, "semi_diameter": 20}"#;
    let stop =
        r#"{"type": "aperture", "shape": "circular", "radius": 4, "thickness": 15, "stop": true}"#;
    let front = build(&format!(r#"{{"elements": [{stop}, {glass}]}}"#));
    let rear = build(&format!(r#"{{"elements": [{glass}, {stop}]}}"#));
    let fans_of = |train: &OpticalTrain, degrees: f64| {
        let at = train.at(587.56).unwrap();
        fans(train, &at, ObjectPoint::field(degrees), 100.0, None).unwrap()
    };
    let ideal = fans_of(&front, 5.0);
    assert!(ideal.pupil_shift.unwrap()[1].abs() < 1e-9, "{:?}", ideal.pupil_shift);
    for ray in &ideal.sagittal {
        assert!(ray.pupil_aberration.unwrap().abs() < 1e-6, "{ray:?}");
    }
    let [small, large] = [2.0, 4.0].map(|degrees| fans_of(&rear, degrees).pupil_shift.unwrap()[1]);
    // Tangents of 4 and 2 degrees: 2.0049, to the third power; the fifth order is a few percent of it.
    assert!((large / small / 8.06 - 1.0).abs() < 0.05, "{large} {small}");
    assert!(small.abs() > 1e-4);
    // The rim's ray of the axis, traced by itself.
    let on_axis = fans_of(&rear, 0.0);
    let rim = on_axis.tangential.iter().find(|ray| (ray.pupil - 0.9375).abs() < 1e-9).unwrap();
    let at = rear.at(587.56).unwrap();
    let height = 0.9375 * on_axis.half_pupil;
    let path = at.path(
        etendue_optics::train::Side::Object,
        etendue_optics::element::Clip::Off,
        glam::DVec3::new(0.0, height, -10.0),
        glam::DVec3::Z,
    );
    let expected = 100.0 * (path.points[2].y - 0.9375 * 4.0) / 4.0;
    close(rim.pupil_aberration.unwrap(), expected, 1e-6, "rim");
}
