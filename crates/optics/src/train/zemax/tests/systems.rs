//! Data of the whole lens in a file: wavelengths, fields and the aperture; and the notes on them.

use super::*;
use crate::train::analysis::chief_height;

#[test]
fn wavelengths_and_fields_in_use_are_taken_the_primary_first() {
    let header = [
        "FTYP 0 0 3 3 0 0 0",
        "XFLN 0 0 3 0 0",
        "YFLN 0 7 4 0 0",
        "WAVM 1 0.4861327 1",
        "WAVM 2 0.5875618 1",
        "WAVM 3 0.6562725 1",
        "WAVM 4 0.55 1",
        "WAVM 5 0.55 1",
        "PWAV 2",
    ];
    let lens = read(&file(&header, &SINGLET));
    assert_eq!(lens.file.wavelengths_nm(), [587.5618, 486.1327, 656.2725]);
    assert_eq!(lens.file.wavelength, Some(Nanometres(587.5618)));
    assert_eq!(lens.file.field_angles()[..2], [0.0, 7.0]);
    let (three, four) = (3_f64.to_radians().tan(), 4_f64.to_radians().tan());
    assert!((lens.file.field_angles()[2] - three.hypot(four).atan().to_degrees()).abs() < 1e-14);
}

/// A file whose object is `distance` in front of its first surface.
fn near(distance: f64, header: &[&str], surfaces: &[&[&str]]) -> ZemaxLens {
    read(&file(header, surfaces).replace("DISZ INFINITY", &format!("DISZ {distance}")))
}

#[test]
fn heights_become_the_angles_of_their_chief_rays() {
    let by = |kind: u32, heights: &str| {
        let kind = format!("FTYP {kind} 0 3 1 0 0 0");
        read(&file(&[&kind, &format!("YFLN {heights}")], &SINGLET))
    };
    let lens = train(&by(0, "0 7 4").file);
    let at = lens.at(lens.wavelength()).unwrap();
    let lands = |angle| chief_height(&lens, &at, angle, 52.0).unwrap();
    // Real heights, on the image 47 mm behind the lens: there and back.
    let real = by(3, "0 7 4").file.field_angles();
    for (angle, height) in real.iter().zip([0.0, 7.0, 4.0]) {
        assert!((lands(*angle) - height).abs() < 1e-9, "{real:?}");
    }
    // Paraxial ones, by the slope on the axis.
    let paraxial = by(2, "0 7 4").file.field_angles();
    let scale = lands(1e-4) / 1e-4_f64.to_radians();
    for (angle, height) in paraxial.iter().zip([0.0, 7.0, 4.0]) {
        assert!((angle.to_radians().tan() * scale - height).abs() < 1e-6, "{paraxial:?}");
    }
    assert!(real[1] != paraxial[1], "the lens distorts");
    let beyond = by(3, "0 700");
    assert_eq!(beyond.file.field_angles(), [0.0]);
    assert!(beyond.notes.iter().any(|note| note.contains("image height of 700 mm")));
    // Heights of an object 200 mm in front of the stop, which is the first vertex; a plane that is
    // left out in front of the lens changes no distance.
    let object = near(200.0, &["FTYP 1 0 2 1 0 0 0", "YFLN 0 20"], &SINGLET).file.field_angles();
    assert!((object[1] + 0.1_f64.atan().to_degrees()).abs() < 1e-12, "{object:?}");
    let dummy: &[&str] = &["TYPE STANDARD", "CURV 0.0", "DISZ 10", "DIAM 30 0"];
    let further =
        near(190.0, &["FTYP 1 0 2 1 0 0 0", "YFLN 0 20"], &[dummy, SINGLET[0], SINGLET[1]]);
    assert!(
        (further.file.field_angles()[1] - object[1]).abs() < 1e-12,
        "{:?}",
        further.file.field_angles()
    );
    let nowhere = by(1, "0 7");
    assert!(nowhere.notes.iter().any(|note| note.contains("object at infinity")));
    assert!(by(4, "0 7").notes.iter().any(|note| note.contains("kind 4")));
}

#[test]
fn an_aperture_given_at_the_object_sets_the_stop() {
    let lens = near(200.0, &["OBNA 0.02 0"], &SINGLET);
    let pupil = train(&lens.file).paraxial(587.56).unwrap().entrance_pupil;
    let expected = 2.0 * 200.0 * 0.02_f64.asin().tan();
    assert!((pupil.diameter.unwrap() - expected).abs() < 1e-9, "{pupil:?}");
    // The half angle of the cone in degrees.
    let cone = near(200.0, &[&format!("OBNA {} 1", 0.02_f64.asin().to_degrees())], &SINGLET);
    let radius = |lens: &ZemaxLens| train(&lens.file).stop_radius();
    assert!((radius(&cone) - radius(&lens)).abs() < 1e-12, "degrees there and back");
    let far = refused(&file(&["OBNA 0.02 0"], &SINGLET));
    assert!(far.contains("line 3: OBNA: the object is at infinity"), "{far}");
    assert!(refused(&file(&["OBNA 1.2 0"], &SINGLET)).contains("below 1"));
}

#[test]
fn a_stated_focal_length_is_compared() {
    let efl = train(&read(&file(&[], &SINGLET)).file).paraxial(587.56).unwrap().efl.unwrap();
    let same = read(&file(&[&format!("NAME Singlet, EFL = {efl:.2} mm")], &SINGLET));
    assert_eq!(same.stated_efl, Some((efl * 100.0).round() / 100.0));
    assert!(same.notes[0].contains("and it is"), "{:?}", same.notes);
    let other = read(&file(&["NOTE 0 EFFL 60"], &SINGLET));
    assert!(other.notes[0].contains("BUT IT IS"), "{:?}", other.notes);
    let target = read(&file(&["EFFL 0 1 0 0 0 0 50.5 1 0 0"], &SINGLET));
    assert_eq!(target.stated_efl, Some(50.5));
    assert_eq!(read(&file(&["EFFL 0 1 0 0 0 0 50.5 0 0 0"], &SINGLET)).stated_efl, None);
}

#[test]
fn planes_in_air_that_do_nothing_are_left_out_and_told() {
    let dummy: &[&str] = &["TYPE STANDARD", "CURV 0.0", "DISZ 10", "DIAM 30 0"];
    let baffle: &[&str] = &["TYPE STANDARD", "CURV 0.0", "DISZ 10", "DIAM 30 0", "CLAP 0 12 0"];
    let lens = read(&file(&[], &[dummy, SINGLET[0], SINGLET[1], baffle]));
    assert_eq!(lens.file.elements.len(), 3);
    assert!(lens.notes.iter().any(|note| note.contains("left out") && note.contains("line 8")));
    assert_eq!(lens.file.elements[2].part, PartSpec::circular(12.0));
}

#[test]
fn glasses_are_looked_for_in_the_files_catalogues() {
    let f2 = |catalogues| {
        let first: Vec<&str> = SINGLET[0]
            .iter()
            .map(|line| if line.starts_with("GLAS") { "GLAS F2 0 0 1.5 40" } else { line })
            .collect();
        read(&file(&[catalogues], &[&first, SINGLET[1]])).file.elements[0].part.clone()
    };
    let glass = |part| match part {
        PartSpec::Surface(surface) => surface.glass.unwrap(),
        other => panic!("{other:?}"),
    };
    assert_eq!(glass(f2("GCAT CDGM SCHOTT")), GlassSpec::Named("CDGM:F2".to_owned()));
    assert_eq!(glass(f2("GCAT SCHOTT_2000")), GlassSpec::Named("Schott:F2".to_owned()));
}
