//! Zemax files with mirrors, folds, freeforms, gratings and apertures: what each command becomes.

use etendue_optics::element::PartSpec;
use etendue_optics::train::{LensFile, OpticalTrain, ZemaxLens};
use glam::DVec3;
use serde_json::{Value, json};

use crate::preset;

/// A file of these surfaces between an object at infinity and an image.
fn file(surfaces: &[&str]) -> String {
    let mut text = "MODE SEQ\nUNIT MM\nENPD 10\nFTYP 0 0 1 1\nYFLN 0\nWAVL 0.55\nSURF 0\n  TYPE STANDARD\n  DISZ INFINITY\n".to_owned();
    for (i, lines) in surfaces.iter().enumerate() {
        text += &format!("SURF {}\n", i + 1);
        for line in lines.split(';') {
            text += &format!("  {}\n", line.trim());
        }
    }
    text + &format!("SURF {}\n  TYPE STANDARD\n  DISZ 0\n", surfaces.len() + 1)
}

fn try_read(surfaces: &[&str]) -> Result<ZemaxLens, String> {
    ZemaxLens::read(file(surfaces).as_bytes(), &[]).map_err(|error| error.to_string())
}

fn read(surfaces: &[&str]) -> ZemaxLens {
    try_read(surfaces).unwrap_or_else(|error| panic!("{error}\n{}", file(surfaces)))
}

fn build(file: &LensFile) -> OpticalTrain {
    file.build(&|name: &str| Err(name.to_owned())).unwrap()
}

/// The elements as a lens file has them.
fn elements(lens: &ZemaxLens) -> Vec<Value> {
    let text = serde_json::to_value(&lens.file).unwrap();
    // What is saved is read again, and is the same.
    let back: LensFile = serde_json::from_value(text.clone()).unwrap();
    assert_eq!(back, lens.file);
    text["elements"].as_array().unwrap().clone()
}

#[test]
fn a_newtonian_with_coordinate_breaks_is_the_one_of_the_lens_file() {
    let lens = read(&[
        "TYPE STANDARD; STOP; CURV -6.25E-4; CONI -1; DISZ -650; GLAS MIRROR 0 0 1.5 40; DIAM 75",
        "TYPE COORDBRK; PARM 3 45; DISZ 0",
        "TYPE STANDARD; GLAS MIRROR 0 0 1.5 40; DISZ 0; DIAM 24",
        "TYPE COORDBRK; PARM 3 45; DISZ 150",
    ]);
    let mut file = lens.file.clone();
    if let PartSpec::Mirror(mirror) = &mut file.elements[0].part {
        mirror.semi_diameter = Some(etendue_geometry::units::Millimetres(75.0));
    }
    let (ours, theirs) = (build(&file), preset("newtonian"));
    assert_eq!(ours.elements().len(), 2);
    for (a, b) in ours.elements().iter().zip(theirs.elements()) {
        assert_eq!(a.part, b.part);
        assert!((a.frame.vertex - b.frame.vertex).length() < 1e-12, "{a:?}");
        let [x, y] = [a, b].map(|element| element.frame.rotation.z_axis);
        assert!((x - y).length() < 1e-14);
    }
    let sensors = [&ours, &theirs].map(|train| {
        let z = train.sensor_z(etendue_optics::train::Focus::AsWritten).unwrap();
        train.built().last().unwrap().place(DVec3::new(0.0, 0.0, z))
    });
    assert!((sensors[0] - sensors[1]).length() < 1e-12, "{sensors:?}");
    assert!(
        (sensors[0] - DVec3::new(0.0, -150.0, -650.0)).length() < 1e-9 || sensors[0].y > 149.0,
        "{sensors:?}"
    );
}

#[test]
fn a_mirror_between_breaks_that_undo_one_another_is_tilted_alone() {
    let lens = read(&[
        "TYPE COORDBRK; PARM 1 1.5; PARM 3 2; DISZ 0",
        "TYPE STANDARD; STOP; CURV -1E-3; DISZ 0; GLAS MIRROR; DIAM 30",
        "TYPE COORDBRK; PARM 1 -1.5; PARM 3 -2; PARM 6 1; DISZ -500",
    ]);
    let element = &elements(&lens)[0];
    assert_eq!(element["type"], "mirror");
    assert_eq!(element.get("fold"), None);
    assert!((element["tilt"][0].as_f64().unwrap() - 2.0).abs() < 1e-12);
    assert_eq!(element["decentre"], json!([1.5, 0.0]));
    assert!((element["thickness"].as_f64().unwrap() + 500.0).abs() < 1e-12);
    // The sensor stands square to the axis, on it.
    assert_eq!(lens.file.sensor, None);
    // And one that folds the axis of a curved mirror.
    let lens = read(&[
        "TYPE COORDBRK; PARM 3 10; DISZ 0",
        "TYPE STANDARD; STOP; CURV -1E-3; DISZ 0; GLAS MIRROR; DIAM 30",
        "TYPE COORDBRK; PARM 3 10; DISZ -500",
    ]);
    assert_eq!(elements(&lens)[0]["fold"], true);
    assert_eq!(lens.file.sensor, None);
}

#[test]
fn apertures_become_sheets_at_the_vertex() {
    let glass = "TYPE STANDARD; STOP; CURV 0.02; DISZ 4; GLAS N-BK7 0 0 1.5168 64.17; DIAM 8";
    let back = "TYPE STANDARD; CURV -0.02; DISZ 48; DIAM 8";
    for (line, expected) in [
        ("OBSC 0 1.5 0", json!({"shape": "annular", "inner_radius": 1.5})),
        (
            "SQOB 3 2 0",
            json!({"shape": "rectangular", "width": 6.0, "height": 4.0, "obscures": true}),
        ),
        (
            "ELOB 3 2 0",
            json!({"shape": "elliptical", "width": 6.0, "height": 4.0, "obscures": true}),
        ),
        ("CLAP 2 1E+10 0", json!({"shape": "annular", "inner_radius": 2.0})),
        ("CLAP 2 7 0", json!({"shape": "annular", "inner_radius": 2.0})),
        ("SQAP 3 2 0", json!({"shape": "rectangular", "width": 6.0, "height": 4.0})),
        ("ELAP 3 2 0", json!({"shape": "elliptical", "width": 6.0, "height": 4.0})),
        ("SPID 0.5 4 0", json!({"shape": "spider", "arms": 4, "width": 0.5})),
        (
            "SQAP 3 2 0; OBDC 1 -0.5",
            json!({"shape": "rectangular", "width": 6.0, "height": 4.0, "decentre": [1.0, -0.5]}),
        ),
        (
            "CLAP 0 3 0; OBDC 1 0",
            json!({"shape": "circular", "radius": 3.0, "decentre": [1.0, 0.0]}),
        ),
    ] {
        let mut expected = expected;
        expected["type"] = json!("aperture");
        let elements = elements(&read(&[&format!("{glass}; {line}"), back]));
        assert_eq!(elements[0], expected, "{line}");
        assert_eq!((elements.len(), &elements[1]["stop"]), (3, &json!(true)), "{line}");
    }
    // The hole of a mirror is its own.
    let mirror = "TYPE STANDARD; STOP; CURV -0.001; DISZ -400; GLAS MIRROR; CLAP 2 90 0";
    assert_eq!(elements(&read(&[mirror]))[0]["hole"], 2.0);
}

#[test]
fn surfaces_of_other_shapes_are_their_parts() {
    let back = "TYPE STANDARD; CURV -0.02; DISZ 48; DIAM 8";
    let glass = "STOP; CURV 0.025; CONI -0.5; DISZ 4; GLAS N-BK7 0 0 1.5168 64.17; DIAM 8";
    for (lines, key, expected) in [
        ("TYPE ODDASPHE; PARM 3 2E-5; PARM 4 1E-6", "aspheric", json!({"3": 2e-5, "4": 1e-6})),
        ("TYPE TOROIDAL; PARM 1 -60; PARM 3 1E-6", "rotation_radius", json!(-60.0)),
        ("TYPE TOROIDAL; PARM 1 -60; PARM 3 1E-6", "aspheric", json!({"4": 1e-6})),
        ("TYPE TOROIDAL", "rotation_radius", json!(0.0)),
        ("TYPE BICONICX; PARM 1 55; PARM 2 0.3", "radius_x", json!(55.0)),
        (
            "TYPE SZERNSAG; PARM 2 1E-6; XDAT 1 6; XDAT 2 9; XDAT 7 0.02; XDAT 8 -0.01",
            "sag",
            json!([{"type": "zernike", "radius": 9.0, "order": "noll", "coefficients": {"5": 0.02, "6": -0.01}}]),
        ),
        (
            "TYPE FZERNSAG; XDAT 1 9; XDAT 2 9; XDAT 11 0.02",
            "sag",
            json!([{"type": "zernike", "radius": 9.0, "order": "fringe", "coefficients": {"9": 0.02}}]),
        ),
        ("TYPE FRESNELS; PARM 2 1E-6", "fresnel", json!(true)),
        (
            "TYPE TILTSURF; PARM 1 0.1; PARM 2 -0.2",
            "sag",
            json!([{"type": "polynomial", "radius": 1.0, "coefficients": [[1, 0, 0.1], [0, 1, -0.2]]}]),
        ),
        (
            "TYPE DGRATING; PARM 1 0.2; PARM 2 -1",
            "phase",
            json!({"pattern": {"type": "grating", "period": 0.005, "rotation": 0.0}, "order": -1}),
        ),
        (
            "TYPE BINARY_2; PARM 0 2; XDAT 1 2; XDAT 2 10; XDAT 3 -300; XDAT 4 5",
            "phase",
            json!({"pattern": {"type": "radial", "radius": 10.0, "coefficients": [-300.0, 5.0]}, "order": 2}),
        ),
    ] {
        let lens = read(&[&format!("{lines}; {glass}"), back]);
        assert_eq!(elements(&lens)[0][key], expected, "{lines}");
    }
}

#[test]
fn what_has_no_counterpart_is_refused_with_its_line() {
    let back = "TYPE STANDARD; CURV -0.02; DISZ 48; DIAM 8";
    let error = |surfaces: &[&str]| try_read(surfaces).unwrap_err();
    let turned = error(&[
        "TYPE COORDBRK; PARM 5 30; DISZ 0",
        "TYPE TOROIDAL; STOP; PARM 1 9; CURV 0.02; DISZ 4; DIAM 3",
        back,
    ]);
    assert!(
        turned.starts_with("line 14") && turned.contains("turned about its own axis"),
        "{turned}"
    );
    let order = error(&["TYPE DGRATING; STOP; PARM 1 1; PARM 2 0.5; DISZ 9; DIAM 3", back]);
    assert!(order.contains("order of diffraction is 0.5"), "{order}");
    let radius = error(&["TYPE BINARY_2; STOP; XDAT 1 1; XDAT 3 5; DISZ 9; DIAM 3", back]);
    assert!(radius.contains("must be positive"), "{radius}");
    let backwards = error(&["TYPE STANDARD; STOP; CURV -0.02; DISZ 40; GLAS MIRROR; DIAM 3"]);
    assert!(backwards.contains("write -40"), "{backwards}");
}

/// The lenses of `scenes/lenses`, and one for each kind of surface and aperture beside them.
fn lenses_for_zemax_files() -> Vec<LensFile> {
    let mut files = Vec::new();
    let folder = format!("{}/../../scenes/lenses", env!("CARGO_MANIFEST_DIR"));
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|ending| ending == "json") {
            let text = std::fs::read_to_string(path).unwrap();
            files.push(LensFile::from_json(&text).unwrap());
        }
    }
    let more = [
        r#"{"type": "freeform", "radius": 40, "aspheric": {"3": 2e-5, "4": 1e-6}, "thickness": 3, "glass": {"n": 1.6}, "semi_diameter": 8, "stop": true}"#,
        r#"{"type": "freeform", "radius": 40, "rotation_radius": -55, "aspheric": {"4": 1e-6}, "thickness": 3, "glass": {"nd": 1.6, "vd": 50}, "semi_diameter": 8, "stop": true}"#,
        r#"{"type": "freeform", "radius": 40, "sag": [{"type": "zernike", "radius": 9, "coefficients": {"5": 0.02}}], "thickness": 3, "glass": "N-BK7", "semi_diameter": 8, "stop": true}"#,
        r#"{"type": "freeform", "radius": 40, "fresnel": true, "thickness": 3, "glass": "N-BK7", "semi_diameter": 8, "stop": true}"#,
        r#"{"type": "freeform", "phase": {"pattern": {"type": "grating", "period": 0.0078125}, "order": -1}, "thickness": 3, "glass": "N-BK7", "semi_diameter": 8, "stop": true}"#,
        r#"{"type": "freeform", "phase": {"pattern": {"type": "radial", "radius": 8, "coefficients": [-90, 1]}, "order": 2}, "thickness": 3, "glass": "N-BK7", "semi_diameter": 8, "stop": true}"#,
        r#"{"type": "biconic", "radius": 40, "radius_x": 55, "conic_x": 0.5, "thickness": 3, "glass": "N-BK7", "semi_diameter": 8, "stop": true}"#,
        r#"{"type": "aperture", "shape": "rectangular", "width": 7, "height": 5, "thickness": 3, "stop": true}"#,
        r#"{"type": "aperture", "shape": "elliptical", "width": 7, "height": 5, "decentre": [0, 0.25], "thickness": 3, "stop": true}"#,
        r#"{"type": "aperture", "shape": "annular", "inner_radius": 1, "radius": 5, "thickness": 3, "stop": true}"#,
        r#"{"type": "aperture", "shape": "annular", "inner_radius": 1, "thickness": 3}"#,
        r#"{"type": "aperture", "shape": "spider", "arms": 3, "width": 0.5, "radius": 5, "inner_radius": 1, "thickness": 3, "stop": true}"#,
        r#"{"type": "aperture", "shape": "spider", "arms": 4, "width": 0.5, "inner_radius": 1, "thickness": 3}"#,
        r#"{"type": "aperture", "shape": "spider", "arms": 4, "width": 0.5, "thickness": 3}"#,
        r#"{"type": "aperture", "shape": "rectangular", "width": 2, "height": 1, "obscures": true, "thickness": 3}"#,
        r#"{"type": "aperture", "shape": "elliptical", "width": 2, "height": 1, "obscures": true, "thickness": 3}"#,
        r#"{"type": "surface", "radius": 40, "tilt": [2, -1], "decentre": [0.3, 0.1], "thickness": 3, "glass": "N-BK7", "semi_diameter": 8, "stop": true}"#,
    ];
    for element in more {
        let text = format!(
            r#"{{"elements": [{element}, {{"type": "surface", "radius": -90, "thickness": 40, "semi_diameter": 9}}]}}"#
        );
        files.push(LensFile::from_json(&text).unwrap());
    }
    let tilted = r#"{"sensor": {"tilt": [3, 0], "decentre": [0, 1]}, "elements": [{"type": "mirror", "radius": -200, "tilt": [5, 3], "fold": true, "thickness": -100, "semi_diameter": 8, "stop": true}]}"#;
    files.push(LensFile::from_json(tilted).unwrap());
    files
}

/// True if the axis of a lens breaks: from a Zemax file its elements come back as placed in one
/// frame, with the same rays (`coordinate_breaks`).
fn has_break(file: &LensFile) -> bool {
    file.elements.iter().any(|element| matches!(element.part, PartSpec::CoordinateBreak(_)))
}

/// Every lens that a Zemax file can hold, through one and back: the same surfaces to the last bit where nothing is tilted, and
/// rays that leave alike.
#[test]
fn lenses_come_back_from_zemax_files_as_they_went() {
    use etendue_optics::element::{Clip, Ray};
    use etendue_optics::train::Side;
    let (mut compared, mut refused) = (0, Vec::new());
    for file in &lenses_for_zemax_files() {
        let Ok(before) = file.build(&|name: &str| Err(name.to_owned())) else { continue };
        if has_break(file) {
            continue;
        }
        if before.is_graded() {
            let why = file.to_zemax().unwrap_err();
            assert!(why.contains("elements[0]: a gradient has no counterpart"), "{why}");
            continue;
        }
        let text = match file.to_zemax() {
            Ok(text) => text,
            Err(why) => {
                assert!(why.starts_with("elements["), "{}: {why}", file.name);
                refused.push(file.name.clone());
                continue;
            }
        };
        let back = ZemaxLens::read(text.as_bytes(), &[]).unwrap_or_else(|e| panic!("{e}\n{text}"));
        let after = build(&back.file);
        assert_eq!(
            (before.elements().len(), before.stop()),
            (after.elements().len(), after.stop()),
            "{text}"
        );
        for (a, b) in before.elements().iter().zip(after.elements()) {
            assert_eq!(a.part, b.part, "{text}");
            // Sums of thicknesses, and sines of angles there and back.
            let size = 1.0 + a.frame.vertex.length();
            assert!((a.frame.vertex - b.frame.vertex).length() < 1e-14 * size, "{text}");
            assert!((a.frame.rotation.z_axis - b.frame.rotation.z_axis).length() < 1e-14, "{text}");
        }
        let wavelength = before.wavelength();
        let lenses = [&before, &after].map(|train| train.at(wavelength).unwrap());
        let reach = 0.4
            * before
                .paraxial(wavelength)
                .unwrap()
                .entrance_pupil
                .diameter
                .filter(|d| d.is_finite())
                .unwrap_or(4.0);
        for i in 0..50_u32 {
            let place =
                DVec3::new(reach * (f64::from(i)).sin(), reach * (1.7 * f64::from(i)).cos(), -30.0);
            let ray = Ray::new(place, DVec3::new(0.01, 0.0, 1.0)).unwrap();
            let [a, b] = lenses.each_ref().map(|at| at.run(Side::Object, Clip::On, ray));
            assert_eq!(a.status, b.status, "{text}");
            let apart = DVec3::from(a.ray.direction) - DVec3::from(b.ray.direction);
            assert!(apart.length() < 1e-12, "{text}: {apart}");
            compared += 1;
        }
    }
    assert!(compared >= 50 * 25, "{compared}; refused: {refused:?}");
}

/// Fields, vignetting factors and weighted wavelengths through a Zemax file and back, to the last bit, and through JSON.
#[test]
fn fields_and_wavelengths_come_back_exactly() {
    let text = r#"{
        "fields": [{"angle": 0}, {"angle": 10.1, "weight": 2, "vignetting": {"decentre": [0, -0.1], "compression": [0.05, 0.3]}},
                   {"angle": -14.3, "vignetting": {"compression": [0, 0.45], "rotation": 3.5}}],
        "wavelengths": [587.5618, 486.1327, 656.2725], "weights": [1, 0.5, 0.25],
        "elements": [{"type": "surface", "radius": 50, "glass": "N-BK7", "thickness": 4, "semi_diameter": 5, "stop": true},
                     {"type": "surface", "radius": -50, "thickness": 48, "semi_diameter": 5}]}"#;
    let file = LensFile::from_json(text).unwrap();
    assert_eq!(build(&file).wavelength(), 587.5618);
    let json = serde_json::to_string(&file).unwrap();
    assert_eq!(LensFile::from_json(&json).unwrap(), file);
    let zemax = file.to_zemax().unwrap();
    let back = ZemaxLens::read(zemax.as_bytes(), &[]).unwrap().file;
    assert_eq!((&back.fields, &back.wavelengths), (&file.fields, &file.wavelengths));
    assert_eq!(back.weights, file.weights);
    let [own, other] = [&file, &back].map(build);
    let parts = |train: &OpticalTrain| {
        train.elements().iter().map(|e| format!("{:?}", e.part)).collect::<Vec<_>>()
    };
    assert_eq!(parts(&own), parts(&other));
    for (wrong, word) in [
        (r#""angle": 200"#, "fields[1]: angle is 200 degrees"),
        (r#""angle": 10.1, "weight": -1"#, "fields[1]: weight is -1"),
        (
            r#""angle": 10.1, "vignetting": {"compression": [0, 1]}"#,
            "fields[1]: vignetting: compression has 1",
        ),
    ] {
        let file = text.replacen(r#""angle": 10.1, "weight": 2, "vignetting": {"decentre": [0, -0.1], "compression": [0.05, 0.3]}"#, wrong, 1);
        let error = LensFile::from_json(&file).unwrap().build(&|n: &str| Err(n.to_owned()));
        assert!(error.unwrap_err().to_string().contains(word), "{word}");
    }
    for (from, to, word) in [
        (
            r#""weights": [1, 0.5, 0.25]"#,
            r#""weights": [1, 0.5]"#,
            "weights: give one for each of the 3",
        ),
        (
            r#""weights": [1, 0.5, 0.25]"#,
            r#""wavelength": 500"#,
            "wavelengths: 587.5618 nm is the first",
        ),
        ("486.1327", "-1", "wavelengths[1]: -1 nm"),
    ] {
        let error = LensFile::from_json(&text.replace(from, to)).unwrap();
        let error = error.build(&|n: &str| Err(n.to_owned())).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn what_zemax_files_have_no_counterpart_for_is_refused_by_its_element() {
    for (element, word) in [
        (r#"{"type": "filter", "transmission": 0.5}"#, "a filter"),
        (r#"{"type": "aperture", "shape": "polygon", "radius": 1, "blades": 5}"#, "blades"),
        (
            r#"{"type": "aperture", "shape": "rectangular", "width": 1, "height": 1, "rotation": 5}"#,
            "turned",
        ),
        (r#"{"type": "surface", "glass": {"cauchy": [1.5]}}"#, "AGF"),
        (r#"{"type": "mirror", "reflectance": 0.9}"#, "reflects"),
        (
            r#"{"type": "freeform", "sag": [{"type": "q_con", "radius": 1, "coefficients": [1]}]}"#,
            "added",
        ),
    ] {
        let file =
            LensFile::from_json(&format!(r#"{{"elements": [{{"type": "surface"}}, {element}]}}"#))
                .unwrap();
        let why = file.to_zemax().unwrap_err();
        assert!(why.starts_with("elements[1]: ") && why.contains(word), "{why}");
    }
}

/// Every lens of `scenes/lenses` to a Zemax file and back: the same parts at the same places to the last bit, and from there
/// on the same lens file.
#[test]
fn lenses_of_scenes_come_back_exactly_or_are_refused_by_element() {
    let folder = format!("{}/../../scenes/lenses", env!("CARGO_MANIFEST_DIR"));
    let (mut exact, mut refused) = (0, Vec::new());
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|ending| ending != "json") {
            continue;
        }
        let name = path.display();
        let file = LensFile::from_json(&std::fs::read_to_string(&path).unwrap()).unwrap();
        if has_break(&file) {
            continue;
        }
        let text = match file.to_zemax() {
            Ok(text) => text,
            Err(why) => {
                assert!(why.starts_with("elements["), "{name}: {why}");
                refused.push(why);
                continue;
            }
        };
        let once = ZemaxLens::read(text.as_bytes(), &[]).unwrap_or_else(|e| panic!("{name}: {e}"));
        let (before, after) = (build(&file), build(&once.file));
        assert_eq!(
            (before.elements().len(), before.stop()),
            (after.elements().len(), after.stop())
        );
        assert_eq!(
            (before.name(), before.wavelength()),
            (after.name(), after.wavelength()),
            "{name}"
        );
        let is_straight = |e: &etendue_optics::train::Element| {
            e.frame == etendue_optics::element::Frame::on_axis(e.frame.vertex.z)
        };
        let straight = before.elements().iter().all(is_straight);
        for (i, (a, b)) in before.elements().iter().zip(after.elements()).enumerate() {
            assert_eq!(a.part, b.part, "{name}: elements[{i}]");
            match straight {
                true => assert_eq!(a.frame, b.frame, "{name}: elements[{i}]"),
                // Sines of angles there and back.
                false => assert!(
                    (a.frame.vertex - b.frame.vertex).length() < 1e-12,
                    "{name}: elements[{i}]"
                ),
            }
        }
        let thickness =
            |file: &LensFile| file.elements.iter().map(|e| e.mount.thickness).collect::<Vec<_>>();
        if straight {
            assert_eq!(thickness(&file), thickness(&once.file), "{name}");
        }
        let again = once.file.to_zemax().unwrap();
        let twice = ZemaxLens::read(again.as_bytes(), &[]).unwrap();
        match straight {
            true => assert_eq!(twice.file, once.file, "{name}"),
            false => assert_eq!(twice.file.elements.len(), once.file.elements.len(), "{name}"),
        }
        exact += usize::from(straight);
    }
    assert!(exact >= 9, "{exact} lenses are exact; refused: {refused:?}");
}
