//! Files written here, as OpticStudio writes them.

mod systems;

use std::fmt::Write;

use glam::DVec3;

use super::*;
use crate::element::{Clip, RayStatus};
use crate::train::Side;

/// A surface's lines.
fn surface(number: usize, lines: &[&str]) -> String {
    let mut text = format!("SURF {number}\r\n");
    for line in lines {
        let _ = write!(text, "  {line}\r\n");
    }
    text
}

/// A file of the given header lines and surfaces, between an object at infinity and an image.
fn file(header: &[&str], surfaces: &[&[&str]]) -> String {
    let mut text = String::from("VERS 140730 201 26155\r\nMODE SEQ\r\n");
    for line in header {
        let _ = write!(text, "{line}\r\n");
    }
    let object = ["TYPE STANDARD", "CURV 0.0 0 0 0 0 \"\"", "MIRR 2 0", "DISZ INFINITY"];
    text += &surface(0, &object);
    for (i, lines) in surfaces.iter().enumerate() {
        text += &surface(i + 1, lines);
    }
    text += &surface(surfaces.len() + 1, &["TYPE STANDARD", "CURV 0.0 0 0 0 0 \"\"", "DISZ 0"]);
    text
}

fn read(text: &str) -> ZemaxLens {
    ZemaxLens::read(text.as_bytes(), &[]).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn refused(text: &str) -> String {
    ZemaxLens::read(text.as_bytes(), &[]).unwrap_err().to_string()
}

fn train(file: &LensFile) -> OpticalTrain {
    file.build(&|name: &str| Err(name.to_owned())).unwrap()
}

const SINGLET: [&[&str]; 2] = [
    &[
        "STOP",
        "TYPE STANDARD",
        "CURV 2.0E-2 0 0 0 0 \"\"",
        "MIRR 2 0",
        "DISZ 5",
        "GLAS N-BK7 0 0 1.5168 64.17 0 0 0 0 0 0",
        "DIAM 10 1 0 0 1 \"\"",
    ],
    &["TYPE STANDARD", "CURV -2.0E-2 0 0 0 0 \"\"", "DISZ 47", "DIAM 10 1 0 0 1 \"\""],
];

/// Singlet as a lens file.
fn singlet(more: &str) -> OpticalTrain {
    let text = format!(
        r#"{{"elements": [
            {{"type": "surface", "curvature": 0.02, "thickness": 5, "glass": "N-BK7",
              "semi_diameter": 10, "stop": true}},
            {{"type": "surface", "curvature": -0.02, "thickness": 47, "semi_diameter": 10 {more}}}]}}"#
    );
    train(&LensFile::from_json(&text).unwrap())
}

/// Rows with one line changed.
trait Lines {
    fn map_line(&self, from: &str, to: &str) -> Vec<String>;
}

impl Lines for &[&str] {
    fn map_line(&self, from: &str, to: &str) -> Vec<String> {
        let change =
            |line: &&str| if line.starts_with(from) { to.to_owned() } else { (*line).to_owned() };
        self.iter().map(change).collect()
    }
}

#[test]
fn a_singlet_is_the_same_lens_in_every_encoding() {
    let text = file(&["NAME \"Singlet\"", "UNIT MM X W X CM MR CPMM"], &SINGLET);
    let units: Vec<u16> = text.encode_utf16().collect();
    let little: Vec<u8> = units.iter().flat_map(|unit| unit.to_le_bytes()).collect();
    let big: Vec<u8> = units.iter().flat_map(|unit| unit.to_be_bytes()).collect();
    let marked = |mark: &[u8], bytes: &[u8]| [mark, bytes].concat();
    let files = [
        text.clone().into_bytes(),
        marked(&[0xef, 0xbb, 0xbf], text.as_bytes()),
        marked(&[0xff, 0xfe], &little),
        marked(&[0xfe, 0xff], &big),
        little,
        big,
    ];
    for bytes in files {
        let lens = ZemaxLens::read(&bytes, &[]).unwrap();
        assert_eq!(lens.file.name, "Singlet");
        let ours = train(&lens.file);
        assert_eq!(ours.elements(), singlet("").elements());
        assert_eq!((ours.stop(), ours.media()), (0, singlet("").media()));
        assert!(lens.notes.iter().any(|note| note.contains("MIRR (2 times, first in line 8)")));
    }
    // An old file's degree sign is one byte.
    let mut latin = b"NOTE 0 20\xb0 off axis\r\n".to_vec();
    latin.extend(text.as_bytes());
    assert!(ZemaxLens::read(&latin, &[]).is_ok());
}

#[test]
fn inches_scale_lengths_curvatures_and_coefficients() {
    let inches = file(
        &["UNIT IN X W X CM MR CPMM"],
        &[
            &[
                "STOP",
                "TYPE EVENASPH",
                "CURV 1.0",
                "CONI -0.5",
                "PARM 1 0",
                "PARM 2 0.01",
                "PARM 3 -0.002",
                "DISZ 0.2",
                "GLAS ___BLANK 1 0 1.5 0 0 0",
                "DIAM 0.4",
            ],
            &["TYPE STANDARD", "CURV 0.0", "DISZ 2"],
        ],
    );
    let lens = read(&inches);
    let PartSpec::Surface(first) = &lens.file.elements[0].part else { panic!() };
    let near = |a: f64, b: f64| (a - b).abs() <= 1e-15 * b.abs().max(1e-300) * 4.0;
    assert!(near(first.curvature.unwrap(), 1.0 / 25.4) && first.conic == -0.5);
    assert!(near(first.aspheric["4"], 0.01 / 25.4_f64.powi(3)));
    assert!(near(first.aspheric["6"], -0.002 / 25.4_f64.powi(5)));
    assert!(near(first.semi_diameter.unwrap().0, 10.16));
    assert_eq!(lens.file.elements[0].mount.thickness, Millimetres(0.2 * 25.4));
    assert_eq!(first.glass, Some(GlassSpec::Constant(1.5)));
}

#[test]
fn extended_aspheres_have_a_normalising_radius() {
    let text = file(
        &[],
        &[
            &[
                "STOP",
                "TYPE XASPHERE",
                "CURV 0.01",
                "XDAT 1 2",
                "XDAT 2 10",
                "XDAT 3 0.5",
                "XDAT 4 0.1",
                "XDAT 5 7",
                "DISZ 3",
                "GLAS N-BK7 0 0",
                "DIAM 5",
            ],
            &["CURV 0", "DISZ 9"],
        ],
    );
    let PartSpec::Surface(first) = read(&text).file.elements[0].part.clone() else { panic!() };
    // The third coefficient is beyond the number of terms.
    assert_eq!(first.aspheric.len(), 2);
    assert!((first.aspheric["2"] - 0.005).abs() < 1e-18);
    assert!((first.aspheric["4"] - 1e-5).abs() < 1e-20);
}

#[test]
fn a_coordinate_break_and_back_tilts_one_element() {
    let there = ["TYPE COORDBRK", "PARM 1 0.1", "PARM 2 -0.2", "PARM 3 3", "PARM 4 -2", "DISZ 0"];
    let back = [
        "TYPE COORDBRK",
        "PARM 1 -0.1",
        "PARM 2 0.2",
        "PARM 3 -3",
        "PARM 4 2",
        "PARM 6 1",
        "DISZ 47",
    ];
    let second = ["TYPE STANDARD", "CURV -2.0E-2 0", "DISZ 0", "DIAM 10 1"];
    let lens = read(&file(&[], &[SINGLET[0], &there, &second, &back]));
    assert_eq!(lens.file.elements.len(), 2);
    assert_eq!(lens.file.sensor, None);
    let (ours, theirs) = (
        train(&lens.file).at(587.56).unwrap(),
        singlet(r#", "decentre": [0.1, -0.2], "tilt": [3, -2]"#).at(587.56).unwrap(),
    );
    for (x, y) in [(0.0, 0.0), (3.0, -4.0), (-7.0, 2.0)] {
        let path = |at: &crate::train::MonochromaticTrain| {
            at.path(Side::Object, Clip::On, DVec3::new(x, y, -20.0), DVec3::new(0.01, 0.02, 1.0))
        };
        let (a, b) = (path(&ours), path(&theirs));
        assert_eq!((a.status, b.status), (RayStatus::Exited, RayStatus::Exited));
        // A few roundings of lengths near 20 mm.
        assert!((a.points[1] - b.points[1]).length() < 1e-13);
        assert!((a.direction.unwrap() - b.direction.unwrap()).length() < 1e-15);
    }
}

#[test]
fn a_break_that_stays_turns_the_sensor_too() {
    let turn = ["TYPE COORDBRK", "PARM 3 10", "DISZ 0"];
    let lens = read(&file(&[], &[SINGLET[0], &turn, SINGLET[1]]));
    let sensor = lens.file.sensor.unwrap();
    assert!((sensor.tilt[0].0 - 10.0).abs() < 1e-13, "one turn there and back: {sensor:?}");
    // A turn about x by 10 degrees takes +z towards -y.
    let (sine, cosine) = 10_f64.to_radians().sin_cos();
    assert!((sensor.decentre[1].0 + 47.0 * sine).abs() < 1e-12);
    let last = lens.file.elements[1].mount.thickness.0;
    assert!((last - 47.0 * cosine).abs() < 1e-12);
}

#[test]
fn the_systems_aperture_sets_the_stop() {
    let stop: &[&str] = &["STOP", "TYPE STANDARD", "CURV 0.0", "DISZ 2", "DIAM 0.001 0"];
    let lens = |aperture| read(&file(&[aperture], &[&SINGLET[0][1..], SINGLET[1], stop]));
    let paraxial = |lens: &ZemaxLens| train(&lens.file).paraxial(587.56).unwrap();
    let by_pupil = lens("ENPD 6.5");
    assert!((paraxial(&by_pupil).entrance_pupil.diameter.unwrap() - 6.5).abs() < 1e-12);
    assert!(by_pupil.notes.iter().any(|note| note.contains("radius")), "{:?}", by_pupil.notes);
    let by_number = lens("FNUM 8 0");
    assert!((paraxial(&by_number).f_number.unwrap() - 8.0).abs() < 1e-12);
    assert!(matches!(by_number.file.elements[2].part, PartSpec::Aperture(_)));
    assert!(by_number.file.elements[2].mount.stop);
}

#[test]
fn indentation_changes_nothing() {
    let header = ["NAME Singlet", "ENPD 6.5", "WAVM 1 0.55 1", "PWAV 1"];
    let text = file(&header, &SINGLET);
    let indented = read(&text);
    let efl = |lens: &ZemaxLens| train(&lens.file).paraxial(550.0).unwrap().efl.unwrap();
    let flush: String = text.lines().map(|line| format!("{}\r\n", line.trim())).collect();
    let deep: String = text.lines().map(|line| format!(" \t  {line}\r\n")).collect();
    let one = text.replace("  CURV -2.0E-2", "CURV -2.0E-2");
    for other in [flush, deep, one].map(|text| read(&text)) {
        assert_eq!(other, indented);
        assert!((efl(&other) - 49.0).abs() < 1.0, "{}", efl(&other));
    }
    // Below a line about the lens, nobody can tell to which surface one belongs.
    for command in ["CURV 0.1", "DISZ 3", "GLAS N-BK7 0 0", "STOP", "DIAM 3", "PARM 1 2", "CONI -1"]
    {
        let refused = refused(&format!("{text}PWAV 1\r\n{command}\r\n"));
        let name = command.split(' ').next().unwrap();
        assert!(refused.contains(name) && refused.contains("SURF"), "{refused}");
        let before = ZemaxLens::read(format!("{command}\r\n{text}").as_bytes(), &[]).unwrap_err();
        assert_eq!(before.line, 1, "{before}");
    }
}

#[test]
fn a_floating_stop_without_a_size_is_as_wide_as_the_beam() {
    let stop: &[&str] = &["STOP", "TYPE STANDARD", "CURV 0.0", "DISZ 2"];
    let front = &SINGLET[0][1..];
    let lens = read(&file(&["FLOA"], &[front, SINGLET[1], stop]));
    let train = train(&lens.file);
    let widest = train.widest_opening().unwrap();
    assert!((train.stop_radius() / widest.stop_radius - 1.0).abs() < 1e-9);
    assert!(lens.notes.iter().any(|note| note.contains("no DIAM")), "{:?}", lens.notes);
    let ideal: &[&str] = &["TYPE PARAXIAL", "PARM 1 50", "DISZ 5"];
    let unlimited = refused(&file(&["FLOA"], &[ideal, stop]));
    assert!(unlimited.contains("DIAM") && unlimited.contains("ENPD"), "{unlimited}");
}

#[test]
fn a_configuration_has_its_own_thicknesses_curvatures_and_apertures() {
    let of = |thickness: f64, curvature: f64, pupil: f64| {
        let first = SINGLET[0].map_line("CURV", &format!("CURV {curvature}"));
        let second = SINGLET[1].map_line("DISZ", &format!("DISZ {thickness}"));
        let [first, second] = [&first, &second].map(|row| row.iter().map(String::as_str).collect());
        let rows: [Vec<&str>; 2] = [first, second];
        file(&[&format!("ENPD {pupil}")], &[&rows[0], &rows[1]])
    };
    let values = "MNUM 3 1\r\nTHIC   2   1  47 0 0 0 1 1 1 0 0 \"\" 0\r\nTHIC 2 2 60.5 0 0\r\n\
                  THIC 2 3 71 0 0\r\nCRVT 1 1 0.02 0\r\nCRVT 1 2 0.015 0\r\nCRVT 1 3 0.01 0\r\n\
                  APER 0 1 6 0\r\nAPER 0 2 7 0\r\nAPER 0 3 8 0\r\n";
    let zoom = of(47.0, 0.02, 6.0) + values;
    let chosen = |i| ZemaxLens::read_configuration(zoom.as_bytes(), Some(i), &[]);
    for (i, [thickness, curvature, pupil]) in
        [[47.0, 0.02, 6.0], [60.5, 0.015, 7.0], [71.0, 0.01, 8.0]].into_iter().enumerate()
    {
        let lens = chosen(i + 1).unwrap();
        assert_eq!(lens.file, read(&of(thickness, curvature, pupil)).file);
        let note = format!("of 3 configurations, number {} is taken", i + 1);
        assert!(lens.notes.contains(&note), "{:?}", lens.notes);
    }
    assert_eq!(read(&zoom).file, chosen(1).unwrap().file);
    let error = chosen(4).unwrap_err().to_string();
    assert!(error.contains("no configuration 4") && error.contains("has 3"), "{error}");
    // What has no counterpart is named, unless it stays as it is.
    let stop = |second: &str| {
        let text = format!("{zoom}STPS 1 1 1 0\r\nSTPS 1 2 {second} 0\r\n");
        ZemaxLens::read_configuration(text.as_bytes(), Some(2), &[])
    };
    assert!(stop("1").is_ok());
    let error = stop("2").unwrap_err().to_string();
    assert!(error.contains("STPS") && error.contains("OpticStudio"), "{error}");
    let beyond = format!("{zoom}THIC 9 2 1 0\r\n");
    let error =
        ZemaxLens::read_configuration(beyond.as_bytes(), Some(2), &[]).unwrap_err().to_string();
    assert!(error.contains("no surface 9"), "{error}");
}

#[test]
fn what_has_no_counterpart_is_refused_by_name_and_line() {
    let changed = |from: &str, to: &str| {
        let lines: Vec<&str> =
            SINGLET[0].iter().map(|line| if line.starts_with(from) { to } else { line }).collect();
        refused(&file(&[], &[&lines, SINGLET[1]]))
    };
    let says = |message: String, words: &[&str]| {
        for word in words {
            assert!(message.contains(word), "expected \"{word}\" in: {message}");
        }
    };
    says(changed("GLAS", "GLAS UNOBTAINIUM 0 0 1.5 40"), &["line 14", "UNOBTAINIUM", "___BLANK"]);
    says(changed("GLAS", "GLAS ___BLANK 1 0 -2 40"), &["line 14", "nd must exceed 1"]);
    says(changed("TYPE", "TYPE BIREFRIN"), &["line 10", "BIREFRIN", "EVENASPH", "BINARY_2"]);
    says(changed("CURV", "CURV nan"), &["line 11", "CURV", "`nan`"]);
    says(changed("CURV", "CURV"), &["line 11", "missing"]);
    says(changed("DISZ", "DISZ INFINITY"), &["line 8", "infinite"]);
    says(changed("DIAM", "SQAP 3 0"), &["line 15", "SQAP", "positive"]);
    says(changed("DIAM", "UDAP 3 4"), &["line 15", "UDAP", "outline"]);
    says(changed("DIAM", "CLAP 10 3"), &["line 15", "below the outer"]);
    says(refused(""), &["line 1", "empty"]);
    says(refused("hello\n"), &["SURF"]);
    says(refused("\0\0\0"), &["no text"]);
    says(refused("MODE NSC\n"), &["line 1", "MODE SEQ"]);
    says(refused(&file(&["UNIT FURLONG"], &SINGLET)), &["line 3", "FURLONG", "METER"]);
    says(refused(&file(&["ENPD -3"], &SINGLET)), &["line 3", "ENPD", "positive"]);
    says(refused(&file(&[], &[])), &["2 surfaces"]);
    says(refused("SURF 0\nSURF 2\n"), &["line 2", "expected surface 1"]);
    says(refused(&String::from_utf8_lossy(&[b'S', b'U', 0xff]).replace("SU", "")), &["SURF"]);
    assert!(ZemaxLens::read(&[0xff, 0xfe, 0x00, 0xd8], &[]).is_err(), "half a surrogate");
    assert!(ZemaxLens::read(&[0xff, 0xfe, 0x41], &[]).is_err(), "half a character");
}

/// A lens file as OpticStudio would write it.
fn written(lens: &LensFile) -> String {
    let mut rows: Vec<Vec<String>> = Vec::new();
    for element in &lens.elements {
        let mut row = Vec::new();
        if element.mount.stop {
            row.push("STOP".to_owned());
        }
        row.push("TYPE STANDARD".to_owned());
        match &element.part {
            PartSpec::Surface(surface) => {
                let curvature = surface.radius.map_or(0.0, |radius| 1.0 / radius.0);
                row.push(format!("CURV {curvature:e} 0 0 0 0 \"\""));
                if let Some(GlassSpec::Abbe { nd, vd }) = surface.glass {
                    row.push(format!("GLAS ___BLANK 1 0 {nd} {vd} 0 0 0 0 0 0"));
                }
                row.push(format!("DIAM {:e} 1 0 0 1 \"\"", surface.semi_diameter.unwrap().0));
            }
            PartSpec::Aperture(crate::element::ApertureSpec::Circular(hole)) => {
                row.push("CURV 0.0 0 0 0 0 \"\"".to_owned());
                row.push(format!("DIAM {:e} 1 0 0 1 \"\"", hole.radius.0));
            }
            other => panic!("{other:?}"),
        }
        row.push(format!("DISZ {:e}", element.mount.thickness.0));
        rows.push(row);
    }
    let lines: Vec<Vec<&str>> =
        rows.iter().map(|row| row.iter().map(String::as_str).collect()).collect();
    let rows: Vec<&[&str]> = lines.iter().map(Vec::as_slice).collect();
    file(&["UNIT MM", "FLOA"], &rows)
}

#[test]
fn a_double_gauss_comes_back_as_it_went() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/lenses/double-gauss.json");
    let lens = LensFile::from_json(&std::fs::read_to_string(path).unwrap()).unwrap();
    let back = read(&written(&lens));
    let (before, after) = (train(&lens), train(&back.file));
    assert_eq!(after.stop(), before.stop());
    let (a, b) = (before.paraxial(587.56).unwrap(), after.paraxial(587.56).unwrap());
    assert!((a.efl.unwrap() - b.efl.unwrap()).abs() < 1e-13);
    let (a, b) = (before.at(587.56).unwrap(), after.at(587.56).unwrap());
    let mut exited = 0;
    for i in 0..400 {
        let (x, y) = (f64::from(i % 20) - 9.5, f64::from(i / 20) - 9.5);
        let path = |at: &crate::train::MonochromaticTrain| {
            at.path(Side::Object, Clip::On, DVec3::new(x, y, -20.0), DVec3::new(0.0, 0.1, 1.0))
        };
        let (a, b) = (path(&a), path(&b));
        assert_eq!(a.status, b.status);
        exited += u32::from(a.status == RayStatus::Exited);
        for (p, q) in a.points.iter().zip(&b.points) {
            assert!((*p - *q).length() < 1e-13, "a radius and its inverse's inverse");
        }
    }
    assert!(exited > 100, "{exited}");
    // The lens file of it is the same lens again.
    let text = serde_json::to_string(&back.file).unwrap();
    assert_eq!(train(&LensFile::from_json(&text).unwrap()).elements(), after.elements());
}
