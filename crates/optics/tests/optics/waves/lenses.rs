//! Wavefronts of lenses that have none, and of lenses that do by other means.

use etendue_optics::analysis::conjugate::{Conjugate, with_numerical_aperture};
use etendue_optics::analysis::spread::{WeightedFields, strehl};
use etendue_optics::analysis::wavefront::Cells;
use etendue_optics::analysis::zernike::ZernikeFit;
use etendue_optics::analysis::{AnalysisError, ObjectPoint, PointSpread, Transfer, Wavefront};
use etendue_optics::train::{Focus, FocusError, OpticalTrain};
use etendue_optics::zernike::ZernikeOrder;
use glam::DVec2;

use crate::{build, preset};

/// Rays are good to 1e-13 mm, of waves of 6e-4 mm; spheres of up to 1e5 mm cost three digits more.
const NO_WAVES: f64 = 1e-6;

fn wavefront(train: &OpticalTrain, object: ObjectPoint, image_z: f64) -> Wavefront {
    let at = train.at(train.wavelength()).unwrap();
    Wavefront::new(train, &at, object, image_z, Cells::Given(64)).unwrap()
}

fn ideal(focal_length: f64, radius: f64) -> OpticalTrain {
    build(&format!(
        r#"{{"elements": [{{"type": "thin_lens", "focal_length": {focal_length}}},
        {{"type": "aperture", "shape": "circular", "radius": {radius}, "stop": true}}]}}"#
    ))
}

#[test]
fn a_hyperbola_behind_a_plane_makes_a_perfect_sphere_of_a_parallel_beam() {
    // k = −n², f = −R/(n − 1): R. Descartes, 1637.
    let train = build(
        r#"{"elements": [
        {"type": "surface", "thickness": 6, "glass": {"n": 1.5}, "semi_diameter": 12, "stop": true},
        {"type": "surface", "radius": -25, "conic": -2.25, "semi_diameter": 14}]}"#,
    );
    let wave = wavefront(&train, ObjectPoint::field(0.0), 6.0 + 50.0);
    assert!(wave.pupil.statistics().peak_to_valley < NO_WAVES, "{:?}", wave.pupil.statistics());
    // Off the axis it has coma, and much.
    let wave = wavefront(&train, ObjectPoint::field(0.1), 6.0 + 50.0);
    assert!(wave.pupil.statistics().peak_to_valley > 1.0);
}

#[test]
fn an_ideal_lens_has_no_waves_at_any_field_and_conjugate() {
    let train = ideal(50.0, 5.0);
    for field in [0.0, 5.0, 15.0] {
        let wave = wavefront(&train, ObjectPoint::field(field), 50.0);
        let statistics = wave.pupil.statistics();
        assert!(statistics.peak_to_valley < NO_WAVES, "{field}: {statistics:?}");
        let fields = WeightedFields::one(wave.pupil);
        assert!((strehl(&fields).1 - 1.0).abs() < 1e-6, "{field}");
    }
    for magnification in [-0.2, -1.0, -3.0] {
        let planes =
            Conjugate::Magnification(magnification).planes(&train, Focus::AsWritten).unwrap();
        // 1/s + 1/s' = 1/f.
        let object = 50.0 * (1.0 - 1.0 / magnification);
        assert!((planes.object_z.unwrap() + object).abs() < 1e-9, "{planes:?}");
        assert!((planes.image_z - 50.0 * (1.0 - magnification)).abs() < 1e-9, "{planes:?}");
        assert!((planes.magnification.unwrap() - magnification).abs() < 1e-12);
        for height in [0.0, 4.0] {
            let wave = wavefront(&train, planes.point(height), planes.image_z);
            assert!((wave.sphere.centre[1] - magnification * height).abs() < 1e-9, "{height}");
            assert!(wave.pupil.statistics().peak_to_valley < NO_WAVES, "{height}");
        }
        let again = Conjugate::Distance(object).planes(&train, Focus::AsWritten).unwrap();
        assert!((again.image_z - planes.image_z).abs() < 1e-9);
    }
}

#[test]
fn pupils_at_infinity_do_no_harm() {
    // A stop in the front focal plane: the chief rays run along the axis behind the lens; and in the
    // rear one: in front of it.
    let image = build(
        r#"{"elements": [
        {"type": "aperture", "shape": "circular", "radius": 4, "stop": true, "thickness": 50},
        {"type": "thin_lens", "focal_length": 50}]}"#,
    );
    let planes = Conjugate::Infinity.planes(&image, Focus::Infinity).unwrap();
    assert!(planes.is_image_telecentric && !planes.is_object_telecentric);
    let wave = wavefront(&image, ObjectPoint::field(8.0), planes.image_z);
    assert!((wave.sphere.radius - 1e5).abs() < 1e-3);
    // A radius of 1e5 mm takes five of the sixteen digits.
    assert!(wave.pupil.statistics().peak_to_valley < 1e-4, "{:?}", wave.pupil.statistics());
    let object = build(
        r#"{"elements": [{"type": "thin_lens", "focal_length": 50, "thickness": 50},
        {"type": "aperture", "shape": "circular", "radius": 4, "stop": true}]}"#,
    );
    let planes = Conjugate::Magnification(-0.5).planes(&object, Focus::AsWritten).unwrap();
    assert!(planes.is_object_telecentric && !planes.is_image_telecentric);
    let wave = wavefront(&object, planes.point(3.0), planes.image_z);
    assert!((wave.sphere.centre[1] + 1.5).abs() < 1e-9);
    assert!(wave.pupil.statistics().peak_to_valley < NO_WAVES, "{:?}", wave.pupil.statistics());
}

#[test]
fn the_object_side_aperture_sets_the_stop() {
    let train = ideal(50.0, 5.0);
    let planes = Conjugate::Magnification(-1.0).planes(&train, Focus::AsWritten).unwrap();
    let train = with_numerical_aperture(train, &planes, 0.06).unwrap();
    assert!((train.stop_radius() - 100.0 * 0.06 / (1.0 - 0.0036_f64).sqrt()).abs() < 1e-9);
    let wave = wavefront(&train, planes.point(0.0), planes.image_z);
    let transfer = Transfer::diffraction(&WeightedFields::one(wave.pupil));
    // Nothing beyond 2 NA/λ, and something just before.
    let limit = 2.0 * 0.06 / 587.56e-6;
    assert!(transfer.modulation(1.01 * limit)[0] < 1e-4);
    assert!(transfer.modulation(0.95 * limit)[0] > 5e-3);
    for wrong in [0.0, 1.0, f64::NAN] {
        assert!(with_numerical_aperture(train.clone(), &planes, wrong).is_err());
    }
}

#[test]
fn defocus_is_found_by_the_best_sphere_and_by_zernikes_fourth_term() {
    let train = ideal(50.0, 2.5);
    let wave = wavefront(&train, ObjectPoint::field(0.0), 50.2);
    // W = n' (1 − cos θ) δz, of which the defocus term is half but for the cap's depth.
    let sine = 2.5 / 50.0_f64.hypot(2.5);
    let waves = 0.2 * (1.0 - (1.0 - sine * sine).sqrt()) / 587.56e-6;
    let fit = ZernikeFit::new(&wave.pupil, ZernikeOrder::Fringe, 37).unwrap();
    let defocus = fit.coefficients[3].waves.abs();
    // The plane is 0.4 % beyond the pupil's own image: the sphere's radius makes up for it; the unit
    // circle is found from 64 cells to half a percent.
    assert!((defocus - 0.5 * waves).abs() < 2e-2 * waves, "{defocus} {waves}");
    assert!(fit.residual < 1e-4, "{}", fit.residual);
    let best = wave.best_fit().unwrap();
    assert!((best.sphere.centre[2] - 50.0).abs() < 1e-3, "{:?}", best.sphere);
    assert!(best.pupil.statistics().rms < 2e-3, "{:?}", best.pupil.statistics());
}

#[test]
fn rays_land_where_the_wavefront_leans() {
    // Δx = ∂W/∂p: two ways to one number, off the axis and through glass.
    let train = preset("double-gauss").with_f_number(4.0).unwrap();
    let image = train.sensor_z(Focus::Infinity).unwrap();
    let at = train.at(486.13).unwrap();
    for field in [0.0, 8.0, 14.0] {
        let object = ObjectPoint::field(field);
        let wave = Wavefront::new(&train, &at, object, image, Cells::Needed).unwrap();
        let pupil = &wave.pupil;
        let n = pupil.cells;
        let inner = |i: usize| [i - 2, i - 1, i, i + 1, i + 2, i - 2 * n, i - n, i + n, i + 2 * n];
        let largest = pupil.lit().map(|i| pupil.landing[i].length()).fold(0.0, f64::max);
        let mut compared = 0;
        for i in pupil.lit().filter(|&i| inner(i).iter().all(|&k| pupil.clear[k] == 1.0)) {
            let by = |step: usize| {
                let near = pupil.waves[i + step] - pupil.waves[i - step];
                let far = pupil.waves[i + 2 * step] - pupil.waves[i - 2 * step];
                (8.0 * near - far) / (12.0 * pupil.step)
            };
            let lean = DVec2::new(by(1), by(n)) * 486.13e-6;
            // The sphere is finite: the ways differ by the aberration over its radius, 1e-3.
            let off = (lean - pupil.landing[i]).length();
            assert!(off < 3e-3 * largest, "{field}, {i}: {lean} {}", pupil.landing[i]);
            compared += 1;
        }
        assert!(compared > 2000, "{compared}");
    }
}

#[test]
fn the_centre_of_the_pattern_is_that_of_the_rays() {
    // The centroid of |U|² is the mean of the waves' slopes: where rays land, by power.
    let train = preset("cooke-triplet").with_f_number(8.0).unwrap();
    let image = train.sensor_z(Focus::Infinity).unwrap();
    let object = ObjectPoint::field(10.0);
    let at = train.at(train.wavelength()).unwrap();
    let wave = Wavefront::new(&train, &at, object, image, Cells::Needed).unwrap();
    let pupil = &wave.pupil;
    let power = pupil.total_power();
    let rays: DVec2 = pupil.lit().map(|i| pupil.landing[i] * pupil.power[i]).sum::<DVec2>() / power;
    // By the phase of the transfer function next to 0.
    let transfer = Transfer::diffraction(&WeightedFields::one(pupil.clone()));
    let small = 2.0 * transfer.step;
    let phase = |along: DVec2| -transfer.at(along * small).arg() / (std::f64::consts::TAU * small);
    let waves = DVec2::new(phase(DVec2::X), phase(DVec2::Y));
    let spot = pupil.lit().map(|i| pupil.landing[i].length()).fold(0.0, f64::max);
    // The edge of the pupil has no slope of its own, and cells there count less.
    assert!((waves - rays).length() < 0.02 * spot, "{waves} {rays} of {spot}");
    assert!(rays.y.abs() > 0.03 * spot, "coma is there to be seen: {rays} of {spot}");
}

#[test]
fn huygens_and_fft_agree_through_glass() {
    let train = preset("double-gauss").with_f_number(4.0).unwrap();
    let image = train.sensor_z(Focus::Infinity).unwrap();
    let at = train.at(train.wavelength()).unwrap();
    let wave = Wavefront::new(&train, &at, ObjectPoint::field(6.0), image, Cells::Needed).unwrap();
    let fft = PointSpread::by_fft(&WeightedFields::one(wave.pupil.clone()), 1);
    let sum = PointSpread::by_huygens(&wave.pupil, &wave.sphere, 32, fft.pitch);
    let peak = fft.values.iter().copied().fold(0.0, f64::max);
    for i in 0..sum.values.len() {
        let at = |k: usize| k + fft.size / 2 - sum.size / 2;
        let same = fft.values[at(i / sum.size) * fft.size + at(i % sum.size)];
        // Places 20 µm off on a sphere of 60 mm: (0.02 mm)²/60 mm/2, a hundredth of a wave.
        assert!((sum.values[i] - same).abs() < 0.02 * peak, "{i}: {} {same}", sum.values[i]);
    }
}

#[test]
fn what_cannot_be_analysed_is_refused_with_what_it_needs() {
    let train = preset("double-gauss");
    let at = train.at(train.wavelength()).unwrap();
    let image = train.sensor_z(Focus::Infinity).unwrap();
    let try_with =
        |field: f64, cells| Wavefront::new(&train, &at, ObjectPoint::field(field), image, cells);
    let coarse = try_with(14.0, Cells::Given(16)).unwrap_err();
    let AnalysisError::Coarse { cells: 16, needed, .. } = coarse else { panic!("{coarse:?}") };
    assert!(coarse.to_string().contains(&format!("it needs {needed} cells a side")), "{coarse}");
    assert!(try_with(14.0, Cells::Given(needed)).is_ok(), "{needed}");
    let few = try_with(0.0, Cells::Given(8)).unwrap_err().to_string();
    assert_eq!(few, "8 cells over the pupil\nhint: take from 16 to 1024");
    let dark = try_with(70.0, Cells::Needed).unwrap_err().to_string();
    assert!(dark.contains("beyond the image circle"), "{dark}");
    // An afocal pair.
    let afocal = build(
        r#"{"elements": [{"type": "thin_lens", "focal_length": 100, "thickness": 150, "semi_diameter": 9},
        {"type": "thin_lens", "focal_length": 50}]}"#,
    );
    let refused = Conjugate::Infinity.planes(&afocal, Focus::Infinity).unwrap_err();
    assert_eq!(refused, AnalysisError::Focus(FocusError::Afocal));
    let refused = Conjugate::Magnification(-1.0).planes(&afocal, Focus::AsWritten).unwrap_err();
    assert!(refused.to_string().contains("the lens is afocal"), "{refused}");
    // But a near object has an image there, half as large.
    let planes = Conjugate::Distance(120.0).planes(&afocal, Focus::AsWritten);
    assert!(planes.is_ok_and(|p| (p.magnification.unwrap().abs() - 0.5).abs() < 1e-12));
    let open = build(r#"{"elements": [{"type": "thin_lens", "focal_length": 100}]}"#);
    let at = open.at(550.0).unwrap();
    let refused = Wavefront::new(&open, &at, ObjectPoint::field(0.0), 100.0, Cells::Needed);
    let unlimited = refused.unwrap_err().to_string();
    assert!(unlimited.starts_with("nothing limits the beam\nhint: "), "{unlimited}");
}
