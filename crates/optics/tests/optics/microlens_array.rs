//! Arrays of lenslets against closed forms, and their pupils against rays aimed at the whole array.

use etendue_optics::element::{Clip, LensRays, RayStatus};
use etendue_optics::train::{
    ExitPupil, Focus, Inquiry, LensFile, LensReport, MonochromaticTrain, OpticalTrain, Side,
};
use glam::{DVec2, DVec3};

fn lens(json: &str) -> OpticalTrain {
    let file = LensFile::from_json(json).unwrap();
    file.build(&|name: &str| Err(format!("{name}: no files here"))).unwrap()
}

fn array(keys: &str) -> OpticalTrain {
    lens(&format!(
        r#"{{"elements": [{{"type": "microlens_array", "size": [4, 3], "pitch": 0.5, {keys}}}]}}"#
    ))
}

fn fault(keys: &str) -> String {
    let text = format!(r#"{{"elements": [{{"type": "microlens_array", {keys}}}]}}"#);
    let file = match LensFile::from_json(&text) {
        Ok(file) => file,
        Err(error) => return error.to_string(),
    };
    file.build(&|name: &str| Err(name.to_owned())).unwrap_err().to_string()
}

/// Point, 3 mm behind the array, of a ray through (x, y) of the array's plane with slopes (0.01,
/// −0.02).
fn behind(train: &OpticalTrain, x: f64, y: f64) -> Result<DVec2, RayStatus> {
    let slopes = DVec3::new(0.01, -0.02, 1.0);
    let start = DVec3::new(x, y, 0.0) - 5.0 * slopes;
    let path = train.at(550.0).unwrap().path(Side::Object, Clip::On, start, slopes);
    let direction = path.direction.ok_or(path.status)?;
    let last = *path.points.last().unwrap();
    Ok((last + direction * ((3.0 - last.z) / direction.z)).truncate())
}

#[test]
fn thin_lenslets_bend_as_thin_lenses_around_their_own_centres() {
    let train = array(r#""focal_length": 3, "offset": [0.1, 0.05]"#);
    // In the focal plane only the slope tells where the light goes: to the centre plus f times slope.
    for (x, y, centre) in
        [(0.0, 0.0, [0.1, 0.05]), (0.9, -0.3, [1.1, -0.45]), (-1.9, 1.4, [-1.9, 1.55])]
    {
        let at = behind(&train, x, y).unwrap();
        let expected = DVec2::from(centre) + 3.0 * DVec2::new(0.01, -0.02);
        assert!((at - expected).length() < 1e-13, "{x} {y}: {at}");
    }
    assert_eq!(behind(&train, 2.01, 0.0), Err(RayStatus::Vignetted { element: 0 }), "the border");
    assert!(behind(&train, 1.999, 0.0).is_ok());
}

#[test]
fn hexagonal_rows_are_moved_by_half_a_pitch_and_turn_with_the_array() {
    let train = array(r#""focal_length": 3, "grid": "hexagonal", "rotation": 90"#);
    let height = 0.5 * 3.0_f64.sqrt() / 2.0;
    // Row 1 begins half a pitch along +y, and lies at −x after a quarter of a turn.
    let centre = DVec2::new(-height, 0.25);
    let at = behind(&train, centre.x + 0.1, centre.y - 0.05).unwrap();
    assert!((at - centre - 3.0 * DVec2::new(0.01, -0.02)).length() < 1e-13, "{at}");
}

#[test]
fn gaps_stop_light_or_let_it_by_unbent() {
    let round = r#""focal_length": 3, "aperture": "round", "fill": 0.8"#;
    let opaque = array(round);
    assert!(behind(&opaque, 0.19, 0.0).is_ok());
    assert_eq!(behind(&opaque, 0.21, 0.0), Err(RayStatus::Vignetted { element: 0 }));
    let clear = array(&format!(r#"{round}, "gaps": "clear""#));
    let at = behind(&clear, 0.21, 0.0).unwrap();
    assert!((at - DVec2::new(0.21, 0.0) - 3.0 * DVec2::new(0.01, -0.02)).length() < 1e-13);
    let at = behind(&clear, 0.19, 0.0).unwrap();
    assert!((at - 3.0 * DVec2::new(0.01, -0.02)).length() < 1e-13);
    // Openings from flat to flat: a hexagon reaches 2/√3 further in its corners.
    let hexagon = array(r#""focal_length": 3, "aperture": "hexagonal", "fill": 0.8"#);
    assert!(behind(&hexagon, 0.0, 0.23).is_ok());
    assert!(behind(&hexagon, 0.0, 0.232).is_err());
    assert!(behind(&hexagon, 0.201, 0.0).is_err());
}

#[test]
fn types_repeat_and_have_filters_of_their_own() {
    let train = array(
        r#""types": [{"focal_length": 3}, {"focal_length": 6, "transmission": 0.25}],
           "pattern": [[0, 1], [1, 1]]"#,
    );
    let slope = DVec2::new(0.01, -0.02);
    for (cell, f) in [([0, 0], 3.0), ([1, 0], 6.0), ([0, 1], 6.0), ([1, 1], 6.0), ([2, -2], 3.0)] {
        let centre = 0.5 * DVec2::new(f64::from(cell[0]), f64::from(cell[1]));
        let place = centre + DVec2::new(0.1, 0.2);
        let at = behind(&train, place.x, place.y).unwrap();
        let expected = place + 3.0 * (slope - DVec2::new(0.1, 0.2) / f);
        assert!((at - expected).length() < 1e-13, "{cell:?}");
    }
    let at = train.at(550.0).unwrap();
    let share =
        |x| at.path(Side::Sensor, Clip::On, DVec3::new(x, 0.0, 9.0), DVec3::NEG_Z).throughput;
    assert_eq!((share(0.1), share(0.6)), (1.0, 0.25));
}

/// A face is a surface, moved to its lenslet's centre.
#[test]
fn faces_refract_as_surfaces_around_their_own_centres() {
    let face = r#""radius": 1.5, "glass": "N-BK7", "grid": "hexagonal", "thickness": 0.4"#;
    let train = lens(&format!(
        r#"{{"elements": [{{"type": "microlens_array", "size": [4, 3], "pitch": 0.5, {face}}},
            {{"type": "surface"}}]}}"#
    ));
    let lattice_row = 0.25 * 3.0_f64.sqrt();
    let centre = DVec2::new(0.75, lattice_row);
    let single = lens(&format!(
        r#"{{"elements": [{{"type": "surface", "radius": 1.5, "glass": "N-BK7", "thickness": 0.4,
            "decentre": [{}, {}]}}, {{"type": "surface"}}]}}"#,
        centre.x, centre.y
    ));
    let mut checked = 0;
    for k in 0..100 {
        let away = DVec2::new(f64::from(k % 10) - 4.5, f64::from(k / 10) - 4.5) * 0.02;
        let start = (centre + away).extend(-1.0);
        let direction = DVec3::new(0.02, -0.01, 1.0);
        for (side, start, direction) in [
            (Side::Object, start, direction),
            (Side::Sensor, (centre + away).extend(3.0), DVec3::new(0.02, -0.01, -1.0)),
        ] {
            let path = |train: &OpticalTrain| {
                train.at(550.0).unwrap().path(side, Clip::On, start, direction)
            };
            let (a, b) = (path(&train), path(&single));
            let (Some(out), Some(expected)) = (a.direction, b.direction) else { continue };
            assert!((out - expected).length() < 1e-13, "{away} {side:?}: {out} {expected}");
            assert!(a.points.iter().zip(&b.points).all(|(p, q)| p.distance(*q) < 1e-13));
            checked += 1;
        }
    }
    assert_eq!(checked, 200);
}

#[test]
fn batches_are_single_rays_to_the_bit() {
    let kinds = [
        r#""focal_length": 3, "rotation": 7"#,
        r#""focal_length": 3, "grid": "hexagonal", "aperture": "round", "gaps": "clear""#,
        r#""radius": 2, "glass": {"n": 1.6}, "grid": "hexagonal""#,
        r#""radius": -2, "conic": -0.5, "aperture": "round", "fill": 0.9, "gaps": "clear""#,
        r#""types": [{"focal_length": 3}, {"focal_length": 4, "transmission": 0.5}]"#,
        r#""types": [{"radius": 3}, {"radius": -4}, {"radius": 5}], "glass": {"n": 1.5}"#,
        r#""focal_length": 2, "tilt": [4, -3], "decentre": [0.1, 0.2]"#,
    ];
    for keys in kinds {
        let train = array(keys);
        let at = train.at(550.0).unwrap();
        for side in [Side::Object, Side::Sensor] {
            let z = if side == Side::Object { -4.0 } else { 4.0 };
            let mut rays = LensRays::default();
            for k in 0..4000 {
                let r = |alpha: f64| (f64::from(k) * alpha).fract() - 0.5;
                let place = DVec3::new(5.0 * r(0.754_877_666), 4.0 * r(0.569_840_291), z);
                let slopes =
                    DVec3::new(0.8 * r(0.618_033_989), 0.8 * r(0.414_213_562), -z.signum());
                rays.push(place, slopes);
            }
            let mut singly = rays.clone();
            at.trace(side, Clip::On, &mut rays);
            at.trace_singly(side, Clip::On, &mut singly);
            for i in 0..rays.len() {
                assert_eq!(rays.status(i), singly.status(i), "{keys} {side:?} {i}");
                assert_eq!(rays.position(i), singly.position(i), "{keys} {side:?} {i}");
                assert_eq!(rays.direction(i), singly.direction(i), "{keys} {side:?} {i}");
                assert_eq!(rays.throughput(i), singly.throughput(i), "{keys} {side:?} {i}");
                assert!(rays.direction(i).is_finite() && rays.position(i).is_finite());
            }
            assert!(rays.exited() > 1000, "{keys}: {}", rays.exited());
        }
    }
}

#[test]
fn what_is_no_array_is_refused_in_words() {
    assert!(fault(r#""pitch": 1, "focal_length": 1"#).contains("size"));
    assert!(fault(r#""size": [4, 3], "pitch": 0, "focal_length": 1"#).contains("above zero"));
    assert!(
        fault(r#""size": [4, 3], "pitch": 3.5, "focal_length": 1"#).contains("not one lenslet")
    );
    let size = r#""size": [4, 3], "pitch": 0.5"#;
    assert!(fault(size).contains("give the lenslets a focal_length"));
    assert!(fault(&format!(r#"{size}, "focal_length": 0"#)).contains("at least"));
    assert!(fault(&format!(r#"{size}, "focal_length": 1, "radius": 2"#)).contains("either"));
    assert!(fault(&format!(r#"{size}, "focal_length": 1, "fill": 1.2"#)).contains("at most 1"));
    assert!(fault(&format!(r#"{size}, "radius": 0.3"#)).contains("the face ends"));
    assert!(fault(&format!(r#"{size}, "radius": 1, "glass": "N-BK8""#)).contains("N-BK"));
    let types = r#""types": [{"focal_length": 1}]"#;
    assert!(fault(&format!(r#"{size}, {types}, "pattern": [[0, 1]]"#)).contains("names type 1"));
    assert!(fault(&format!(r#"{size}, {types}, "pattern": [[0], [0, 0]]"#)).contains("pattern[1]"));
}

/// A main lens of 40 mm, f/4, and lenslets at its focus (mm).
fn plenoptic(array: &str, behind: f64) -> OpticalTrain {
    lens(&format!(
        r#"{{"elements": [
            {{"type": "aperture", "shape": "circular", "radius": 5, "stop": true}},
            {{"type": "thin_lens", "focal_length": 40, "thickness": 40}},
            {{"type": "microlens_array", {array}, "thickness": {behind}}}]}}"#
    ))
}

fn real() -> OpticalTrain {
    let path = format!("{}/../../scenes/lenses/double-gauss.json", env!("CARGO_MANIFEST_DIR"));
    let mut file = LensFile::from_json(&std::fs::read_to_string(path).unwrap()).unwrap();
    let plain = file.build(&|_: &str| Err(String::new())).unwrap();
    let gap = plain.sensor_z(Focus::Infinity).unwrap() - plain.last_vertex();
    file.elements.last_mut().unwrap().mount.thickness.0 = gap;
    let more = r#"{"elements": [
        {"type": "microlens_array", "size": [4, 3], "pitch": 0.3, "grid": "hexagonal",
         "aperture": "round", "radius": 1.2, "glass": "N-BK7", "thickness": 0.9},
        {"type": "surface", "thickness": 1.73}]}"#;
    file.elements.extend(LensFile::from_json(more).unwrap().elements);
    // As fast as the lenslets: f/7.7.
    file.build(&|_: &str| Err(String::new())).unwrap().with_f_number(7.7).unwrap()
}

/// The share of rays that get through of those that start in the image of a lenslet: where the ray through
/// the middle of their own lenslet does.
fn share_inside(
    train: &OpticalTrain,
    at: &MonochromaticTrain,
    pupil: &ExitPupil,
    film: &[DVec2],
    rays: &LensRays,
) -> f64 {
    let Some(view) = train.behind_lenslets() else { return 0.0 };
    let z = view.exit_pupil_z().unwrap();
    let chief = |place: DVec2| Some(-place / (view.front_z - z));
    let (mut begun, mut through) = (0, 0);
    // Every eighth: a share of some ten thousand is known to half a percent.
    for (i, &film) in film.iter().enumerate().step_by(8) {
        let start = pupil.film_point(film);
        let cell = view.own_cell(start, chief).unwrap();
        let direction = view.central_slopes(start, cell).extend(-1.0);
        if at.path(Side::Sensor, Clip::On, start, direction).status == RayStatus::Exited {
            begun += 1;
            through += u32::from(rays.status(i) == RayStatus::Exited);
        }
    }
    f64::from(through) / f64::from(begun)
}

/// Points of an area of the sensor, and the rays from there with their statuses.
fn traced(
    train: &OpticalTrain,
    pupil: &ExitPupil,
    half: [f64; 2],
    count: u32,
) -> (Vec<DVec2>, LensRays) {
    let at = train.at(587.56).unwrap();
    let (mut film, mut places) = (Vec::new(), Vec::new());
    for i in 0..count {
        let r = |alpha: f64| (0.5 + alpha * f64::from(i)).fract();
        film.push((2.0 * DVec2::new(r(0.856_674_883), r(0.733_891_857)) - 1.0) * DVec2::from(half));
        places.push([r(0.628_706_721), r(0.538_597_270)]);
    }
    let mut rays = LensRays::default();
    pupil.push_rays(&film, &places, 587.56, &mut rays);
    at.trace(Side::Sensor, Clip::On, &mut rays);
    (film, rays)
}

/// Mean throughput and its standard error.
fn irradiance(rays: &LensRays) -> [f64; 2] {
    let values = (0..rays.len())
        .map(|i| if rays.status(i) == RayStatus::Exited { rays.throughput(i) } else { 0.0 });
    let (sum, squares) = values.fold((0.0, 0.0), |(s, q), v| (s + v, q + v * v));
    let n = rays.len() as f64;
    let mean = sum / n;
    [mean, ((squares / n - mean * mean) / n).sqrt()]
}

/// The pupils of lenslets lose few rays and no light: the same irradiance over parts of the sensor as
/// rays that are aimed at all of the array, within 4 standard errors of those.
#[test]
fn lenslet_pupils_are_unbiased_and_lose_few_rays() {
    let square = r#""size": [2.4, 1.8], "pitch": 0.25, "focal_length": 1"#;
    let cases = [
        ("matched", plenoptic(square, 1.0), [0.6, 0.45], 0.97),
        (
            "slower lenslets overlap",
            plenoptic(r#""size": [2.4, 1.8], "pitch": 0.25, "focal_length": 2"#, 2.0),
            [0.6, 0.45],
            0.97,
        ),
        (
            "turned by 45°",
            plenoptic(&format!(r#"{square}, "rotation": 45"#), 1.0),
            [0.6, 0.45],
            0.97,
        ),
        (
            "focused",
            plenoptic(
                r#""size": [2.4, 1.8], "pitch": 0.25, "grid": "hexagonal", "aperture": "round", "focal_length": 1"#,
                1.25,
            ),
            [0.6, 0.45],
            0.93,
        ),
        (
            "virtual image",
            plenoptic(r#""size": [2.4, 1.8], "pitch": 0.25, "focal_length": 1"#, 0.8),
            [0.6, 0.45],
            0.93,
        ),
        (
            "clear gaps",
            plenoptic(
                r#""size": [2.4, 1.8], "pitch": 0.25, "aperture": "round", "fill": 0.8, "gaps": "clear", "focal_length": 1"#,
                1.0,
            ),
            [0.6, 0.45],
            0.9,
        ),
        (
            "three types",
            plenoptic(
                r#""size": [2.4, 1.8], "pitch": 0.25, "grid": "hexagonal", "types": [{"focal_length": 0.9}, {"focal_length": 1}, {"focal_length": 1.1}]"#,
                1.2,
            ),
            [0.6, 0.45],
            0.92,
        ),
        (
            "exaggerated",
            plenoptic(r#""size": [8, 6], "pitch": 2, "focal_length": 8, "aperture": "round""#, 8.0),
            [3.0, 2.0],
            0.9,
        ),
        ("border", plenoptic(square, 1.0), [1.5, 1.2], 0.9),
        ("real", real(), [1.2, 0.9], 0.9),
    ];
    for (name, train, half, least) in cases {
        let z = train.sensor_z(Focus::AsWritten).unwrap();
        let pupil = ExitPupil::new(&train, &[587.56], z, half).unwrap();
        assert!(pupil.lenslets().is_some(), "{name}");
        let first = train.first_array().unwrap();
        let brute = ExitPupil::of_rear(&train, first, &[587.56], z, half).unwrap();
        let (film, rays) = traced(&train, &pupil, half, 1 << 18);
        let [mean, error] = irradiance(&rays);
        let through = share_inside(&train, &train.at(587.56).unwrap(), &pupil, &film, &rays);
        let [expected, spread] = irradiance(&traced(&train, &brute, half, 1 << 20).1);
        let off = (mean - expected) / error.hypot(spread);
        println!(
            "{name}: {mean:.6} {expected:.6} +- {spread:.6} ({off:.1}), {through:.3} get through"
        );
        assert!(off.abs() < 4.0, "{name}: {mean} {expected} {spread}");
        assert!(through > least, "{name}: {through}");
    }
}

#[test]
fn paraxial_data_and_focus_are_those_of_the_lens_before_the_array() {
    let train = plenoptic(r#""size": [2.4, 1.8], "pitch": 0.25, "focal_length": 1"#, 1.0);
    let paraxial = train.paraxial(587.56).unwrap();
    assert!((paraxial.efl.unwrap() - 40.0).abs() < 1e-12);
    assert!((paraxial.f_number.unwrap() - 4.0).abs() < 1e-12);
    // Focused at 1 m the lenslets stand at the image, 1/(1/40 − 1/1000) mm, and the sensor 1 mm behind.
    let near = train.with_lenslets_focused(1.0).unwrap();
    let image = 1.0 / (1.0 / 40.0 - 1e-3);
    assert!((near.elements()[2].frame.vertex.z - image).abs() < 1e-9);
    assert!((near.sensor_z(Focus::AsWritten).unwrap() - image - 1.0).abs() < 1e-9);
    // Lenslets at 1.25 mm see sharp what is 1/(1/1 − 1/1.25) = 5 mm in front of them.
    let focused = plenoptic(r#""size": [2.4, 1.8], "pitch": 0.25, "focal_length": 1"#, 1.25);
    let near = focused.with_lenslets_focused(1.0).unwrap();
    assert!((near.elements()[2].frame.vertex.z - image - 5.0).abs() < 1e-9);
    let report = LensReport::new(&train, &Inquiry::default()).unwrap();
    assert!(report.notes.iter().any(|note| note.contains("microlens array")));
}

#[test]
fn an_array_beside_the_light_is_an_error_that_says_so() {
    let train = lens(
        r#"{"elements": [
            {"type": "aperture", "shape": "circular", "radius": 5, "stop": true},
            {"type": "thin_lens", "focal_length": 40, "thickness": 40},
            {"type": "microlens_array", "size": [1, 1], "pitch": 0.25, "focal_length": 1,
             "decentre": [30, 0], "thickness": 1}]}"#,
    );
    let error = ExitPupil::new(&train, &[587.56], 41.0, [1.5, 1.0]).unwrap_err();
    assert!(error.to_string().contains("microlens array elements[2]"), "{error}");
}
