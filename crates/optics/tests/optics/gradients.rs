//! Gradients: rays, paths and paraxial data against closed forms, and what is refused.

use etendue_optics::element::{Clip, LensRays, Ray, RayStatus};
use etendue_optics::train::optical_path::ThinLensPhases;
use etendue_optics::train::{Focus, LensFile, OpticalTrain, Side};
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

const D: f64 = 587.561_8;

fn build(elements: Value) -> Result<OpticalTrain, String> {
    let text = json!({ "elements": elements }).to_string();
    LensFile::from_json(&text)
        .map_err(|e| e.to_string())?
        .build(&|path: &str| Ok(path.into()))
        .map_err(|e| e.to_string())
}

/// A rod with flat ends of index `n` on its axis.
fn rod(n: f64, length: f64, gradient: Value) -> OpticalTrain {
    build(json!([
        {"type": "surface", "glass": {"n": n}, "thickness": length, "semi_diameter": 1.2, "gradient": gradient},
        {"type": "surface", "semi_diameter": 1.2, "stop": true}
    ]))
    .unwrap()
}

/// Closed form of the path of a ray through a rod of n² = n₀² (1 − g² r²), reached through air to
/// its front at z = 0: place and transverse optical direction at its end, and the optical path in
/// it.
fn closed_form(n0: f64, g: f64, length: f64, place: DVec2, across: DVec2) -> (DVec2, DVec2, f64) {
    let square = n0 * n0 * (1.0 - g * g * place.length_squared());
    let t = length / (square - across.length_squared()).sqrt();
    let w = n0 * g;
    let (sine, cosine) = (w * t).sin_cos();
    let b = across / w;
    // ∫ (p cos + b sin)² dt.
    let r2 = place.length_squared() * (t / 2.0 + sine * cosine / (2.0 * w))
        + b.length_squared() * (t / 2.0 - sine * cosine / (2.0 * w))
        + place.dot(b) * sine * sine / w;
    let path = n0 * n0 * (t - g * g * r2);
    (place * cosine + b * sine, (b * cosine - place * sine) * w, path)
}

/// Rays of air at the front: on the axis and off it, meridional and skew.
fn rays() -> Vec<(DVec2, DVec2)> {
    let places = [DVec2::ZERO, DVec2::new(0.0, 0.3), DVec2::new(-0.2, 0.45)];
    let across = [DVec2::ZERO, DVec2::new(0.0, 0.1), DVec2::new(0.12, -0.07), DVec2::new(0.2, 0.1)];
    places.iter().flat_map(|p| across.iter().map(|a| (*p, *a))).collect()
}

fn unit(across: DVec2) -> DVec3 {
    across.extend((1.0 - across.length_squared()).sqrt())
}

#[test]
fn rays_of_a_parabolic_rod_follow_its_closed_form_over_many_pitches() {
    for g in [0.05, 0.3, 0.6] {
        for pitches in [0.1, 0.25, 0.73, 3.1, 11.3] {
            let (n0, length) = (1.6, pitches * std::f64::consts::TAU / g);
            let exact = rod(n0, length, json!({"type": "rod", "g": g}));
            let terms = json!({"type": "squared_index", "radial": [-n0 * n0 * g * g]});
            // In closed form but for roundings; by Sharma's rule within 10⁻¹⁰ of a phase of 2π 11.3, for half a millimetre.
            for (train, tolerance) in [(exact, 1e-10), (rod(n0, length, terms), 1e-8)] {
                let at = train.at(D).unwrap();
                for (place, across) in rays() {
                    let (end, slope, path) = closed_form(n0, g, length, place, across);
                    let start = Ray::new(place.extend(0.0), unit(across)).unwrap();
                    let found = at.run(Side::Object, Clip::Off, start);
                    assert_eq!(found.status, RayStatus::Exited);
                    let [there, towards] = [found.ray.position, found.ray.direction]
                        .map(|v| DVec3::from(v).truncate());
                    assert!((there - end).length() < tolerance, "g {g}, {pitches}: {there} {end}");
                    assert!((towards - slope).length() < tolerance, "{towards} {slope}");
                    let along = at.run_with_path(Clip::Off, start, &ThinLensPhases::default());
                    // A path is as long as the rod: 10⁻⁸ of a metre.
                    let error = (along.length - path).abs();
                    assert!(error < tolerance * (1.0 + 1e-2 * length), "{g} {pitches} {error}");
                    // And back to where it came from.
                    let back =
                        Ray::new(found.ray.position.into(), -DVec3::from(found.ray.direction));
                    let back = at.run(Side::Sensor, Clip::Off, back.unwrap());
                    let error = (DVec3::from(back.ray.position) - place.extend(0.0)).length();
                    assert!(error < 2.0 * tolerance, "{error}");
                    let error = (DVec3::from(back.ray.direction) + unit(across)).length();
                    assert!(error < 2.0 * tolerance, "{error}");
                }
            }
        }
    }
}

#[test]
fn rays_along_a_gradient_of_the_squared_index_are_parabolas() {
    for b in [-0.04, 0.03, 0.2] {
        let (n0, length): (f64, f64) = (1.55, 7.0);
        let train = rod(n0, length, json!({"type": "squared_index", "axial": [b]}));
        let at = train.at(D).unwrap();
        for (place, across) in rays() {
            // z = T t + b t²/4.
            let first = (n0 * n0 - across.length_squared()).sqrt();
            let t = 2.0 * length / (first + (first * first + b * length).sqrt());
            let end =
                at.run(Side::Object, Clip::Off, Ray::new(place.extend(0.0), unit(across)).unwrap());
            let there = DVec3::from(end.ray.position).truncate();
            // Runge and Kutta's rule has a constant force without an error.
            assert!((there - place - across * t).length() < 1e-11, "{b}: {there}");
            // The path is ∫ n² dt = n₀² t + b ∫ z dt.
            let path = n0 * n0 * t + b * (first * t * t / 2.0 + b * t * t * t / 12.0);
            let along = at.run_with_path(
                Clip::Off,
                Ray::new(place.extend(0.0), unit(across)).unwrap(),
                &ThinLensPhases::default(),
            );
            assert!((along.length - path).abs() < 1e-11, "{} {path}", along.length);
        }
    }
}

#[test]
fn paraxial_data_of_a_rod_are_its_cosines_and_those_of_any_gradient_what_rays_near_the_axis_do() {
    let n0: f64 = 1.6;
    for (g, length) in [(0.1, 4.0), (0.3, 12.0), (0.3, 3.0), (0.6, 17.0)] {
        let train = rod(n0, length, json!({"type": "rod", "g": g}));
        let paraxial = train.paraxial(D).unwrap();
        let phase: f64 = g * length;
        let efl = 1.0 / (n0 * g * phase.sin());
        assert!((paraxial.efl.unwrap() / efl - 1.0).abs() < 1e-12, "{:?} {efl}", paraxial.efl);
        assert!((paraxial.bfl.unwrap() - efl * phase.cos()).abs() < 1e-10 * efl.abs());
    }
    let mixed = [
        json!({"type": "index", "radial": [-0.01, 1e-4, -1e-5], "axial": [0.01, -5e-4, 1e-5]}),
        json!({"type": "index", "radial": [0.008], "axial": [-0.01]}),
        json!({"type": "squared_index", "radial": [-0.02, 3e-4], "axial": [0.02, 1e-3]}),
        json!({"type": "squared_index", "radial": [0.02]}),
    ];
    for gradient in mixed {
        let train = build(json!([
            {"type": "surface", "radius": 9.0, "glass": {"n": n0}, "thickness": 5.0, "semi_diameter": 1.0,
             "gradient": gradient},
            {"type": "surface", "radius": -14.0, "semi_diameter": 1.0, "stop": true}
        ]))
        .unwrap();
        let at = train.at(D).unwrap();
        let h = 1e-4;
        let end =
            at.run(Side::Object, Clip::Off, Ray::new(DVec3::new(0.0, h, -1.0), DVec3::Z).unwrap());
        let [place, direction] = [end.ray.position, end.ray.direction];
        let slope = direction[1] / direction[2];
        let paraxial = train.paraxial(D).unwrap();
        // Aberrations are the square of a height of 10⁻⁴ mm over a few millimetres.
        assert!((-h / slope / paraxial.efl.unwrap() - 1.0).abs() < 1e-7, "{gradient} {slope}");
        let focus = place[2] - place[1] / slope;
        assert!(
            (focus - paraxial.image_z.unwrap()).abs() < 1e-6 * focus.abs(),
            "{gradient} {focus}"
        );
    }
}

#[test]
fn sheets_in_a_rod_change_no_ray_and_batches_are_as_single_rays() {
    let gradient = json!({"type": "index", "radial": [-0.03, 1e-3], "axial": [0.004]});
    let front = |thickness: f64| {
        json!({"type": "surface", "radius": 12.0, "glass": {"nd": 1.6, "vd": 40.0}, "thickness": thickness,
               "semi_diameter": 1.2, "gradient": gradient})
    };
    let back = json!({"type": "surface", "radius": -8.0, "conic": -0.4, "semi_diameter": 1.2});
    let stop = json!({"type": "aperture", "shape": "circular", "radius": 0.7, "thickness": 4.0, "stop": true});
    let plain = build(json!([front(7.0), back])).unwrap();
    let stopped = build(json!([front(3.0), stop, back])).unwrap();
    let aspheric =
        json!({"type": "surface", "radius": -8.0, "aspheric": {"4": 1e-4}, "semi_diameter": 1.2});
    let aspheric = build(json!([front(3.0), stop, aspheric])).unwrap();
    for nm in [450.0, D] {
        let [one, other] = [&plain, &stopped].map(|train| train.at(nm).unwrap());
        for (place, across) in rays() {
            let ray = Ray::new(place.extend(-1.0), unit(across)).unwrap();
            let [a, b] = [&one, &other].map(|at| at.run(Side::Object, Clip::Off, ray).ray);
            let [a, b] = [a, b].map(|r| (DVec3::from(r.position), DVec3::from(r.direction)));
            // Steps begin elsewhere: errors of the rule, 10⁻¹⁰ of a phase.
            assert!((a.0 - b.0).length() < 1e-9 && (a.1 - b.1).length() < 1e-9, "{a:?} {b:?}");
        }
    }
    for train in [&stopped, &aspheric] {
        let at = train.at(D).unwrap();
        for (side, z, sign) in [(Side::Object, -1.0, 1.0), (Side::Sensor, 12.0, -1.0)] {
            let mut batch = LensRays::default();
            for (place, across) in rays() {
                batch.push(place.extend(z), unit(across) * DVec3::new(1.0, 1.0, sign));
            }
            let mut single = batch.clone();
            at.trace(side, Clip::On, &mut batch);
            at.trace_singly(side, Clip::On, &mut single);
            for i in 0..batch.len() {
                let of = |rays: &LensRays| {
                    (rays.status(i), rays.position(i), rays.direction(i), rays.throughput(i))
                };
                assert_eq!(of(&batch), of(&single));
            }
            assert!(batch.exited() > 4, "{} of {}", batch.exited(), batch.len());
        }
    }
}

/// The relay of `scenes/lenses`: what is to be focused, and how, follows from its cosines.
#[test]
fn a_rod_of_a_little_more_than_half_a_pitch_relays_upright_where_its_cosines_say() {
    let train = crate::preset("selfoc-relay");
    // 0.6 of a pitch: infinity is behind the rod's end at cos/(n₀ g sin), and a second picture stands upright.
    let (n0, g, length): (f64, f64, f64) = (1.5637, 0.2, 0.6 * std::f64::consts::TAU / 0.2);
    let (sine, cosine) = (g * length).sin_cos();
    let paraxial = train.paraxial(train.wavelength()).unwrap();
    assert!((paraxial.efl.unwrap() * n0 * g * sine - 1.0).abs() < 1e-9, "n₀ is that of the d line");
    let z = train.sensor_z(Focus::Infinity).unwrap();
    assert!((z - length - cosine / (n0 * g * sine)).abs() < 1e-8);
    // The efl is negative: what is above stays above.
    assert!(paraxial.efl.unwrap() < 0.0);
    let at = train.at(train.wavelength()).unwrap();
    let chief = train.chief_ray(&at, 3.0).unwrap();
    let end = at.run(Side::Object, Clip::On, Ray::new(chief.position, chief.direction).unwrap());
    assert_eq!(end.status, RayStatus::Exited);
    let [place, way] = [end.ray.position, end.ray.direction].map(DVec3::from);
    let height = place.y + way.y / way.z * (z - place.z);
    // Distortion is of the third order: a thousandth of the height at 3°.
    let paper = paraxial.efl.unwrap() * 3_f64.to_radians().tan();
    assert!((height / paper - 1.0).abs() < 3e-3, "{height} {paper}");
    let wave = train.to_plane(z).unwrap();
    assert!(wave.a.abs() < 1e-9, "infinity is sharp there");
}

#[test]
fn a_ray_that_leaves_the_side_of_a_rod_is_stopped_there_by_its_element() {
    let train = rod(1.6, 10.0, json!({"type": "rod", "g": 0.3, "semi_diameter": 0.5}));
    let at = train.at(D).unwrap();
    // It swings out to sin θ/(n₀ g): 0.48 mm is the most that stays within.
    for (sine, stays) in [(0.23, true), (0.239, true), (0.241, false), (0.3, false)] {
        let path = at.path(Side::Object, Clip::On, DVec3::ZERO, unit(DVec2::new(0.0, sine)));
        assert_eq!(path.status == RayStatus::Exited, stays, "{sine} {path:?}");
        if !stays {
            assert_eq!(path.status, RayStatus::Vignetted { element: 0 });
            let end = path.points.last().unwrap();
            assert!(end.z > 0.5 && end.z < 10.0 && end.y >= 0.5, "{end}");
        }
        let off = at.path(Side::Object, Clip::Off, DVec3::ZERO, unit(DVec2::new(0.0, sine)));
        assert_eq!(off.status, RayStatus::Exited);
    }
    // A ray that comes in beyond the side, through ends that are wider, is stopped there, though it is within after a step.
    let short = rod(1.6, 3.0, json!({"type": "rod", "g": 0.3, "semi_diameter": 0.5}));
    let at = short.at(D).unwrap();
    for (side, z, sense) in [(Side::Object, 0.0, 1.0), (Side::Sensor, 3.0, -1.0)] {
        for (height, stays) in [(0.499, true), (0.501, false)] {
            let inwards = unit(DVec2::new(0.0, -0.15)) * DVec3::new(1.0, 1.0, sense);
            let path = at.path(side, Clip::On, DVec3::new(0.0, height, z), inwards);
            assert_eq!(path.status == RayStatus::Exited, stays, "{side:?} {height} {path:?}");
        }
    }
}

#[test]
fn gradients_that_are_none_are_refused_by_element_and_remedy() {
    let lens = |gradient: Value, semi_diameter: f64, behind: Value| {
        let mut front =
            json!({"type": "surface", "glass": {"n": 1.5}, "thickness": 5.0, "gradient": gradient});
        if semi_diameter > 0.0 {
            front["semi_diameter"] = json!(semi_diameter);
        }
        build(json!([front, behind])).unwrap_err()
    };
    let end = || json!({"type": "surface"});
    let rod = || json!({"type": "rod", "g": 0.3});
    let refused = [
        (lens(json!({"type": "rod", "g": -1}), 1.0, end()), "must be a positive number"),
        (lens(rod(), 0.0, end()), "write its semi_diameter"),
        (lens(rod(), 2.6, end()), "must exceed 1 within the rim"),
        (lens(json!({"type": "rod", "g": 0.3, "semi_diameter": 4}), 1.0, end()), "a squared index of -"),
        (lens(json!({"type": "index", "radial": [-0.01], "step": 0}), 1.0, end()), "gradient.step is 0 mm"),
        (lens(json!({"type": "index", "radial": [-0.01], "step": 1e-9}), 1.0, end()), "write a longer gradient.step"),
        (lens(json!({"type": "index", "radial": [1e5]}), 1.0, end()), "and be at most 10: lessen its terms"),
        (lens(json!({"type": "index", "axial": [-0.2]}), 1.0, end()), "lessen its terms"),
        (lens(rod(), 1.0, json!({"type": "thin_lens", "focal_length": 5})), "elements[1] is none"),
        (lens(rod(), 1.0, json!({"type": "mirror"})), "elements[1] is none"),
        (lens(json!({"type": "rod", "g": 0.3, "step": 1}), 1.0, end()), "unknown field `step`"),
        (
            build(json!([{"type": "surface", "glass": {"n": 1.5}, "thickness": 5, "gradient": rod(), "semi_diameter": 1}]))
                .unwrap_err(),
            "add the one behind it",
        ),
        (
            build(json!([{"type": "thin_lens", "focal_length": 5, "thickness": 5, "gradient": rod()}, end()]))
                .unwrap_err(),
            "write it there",
        ),
    ];
    for (why, words) in refused {
        assert!(why.contains(words), "{why} / {words}");
    }
}
