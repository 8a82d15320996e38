//! Commands of Zemax files without a counterpart here: each in a file of its own, refused by its name and with
//! what to do.

use etendue_geometry::units::Degrees;
use etendue_optics::glass::AgfCatalogue;
use etendue_optics::train::{FieldSpec, Inquiry, LensReport, VignettingSpec, ZemaxLens};
use glam::DVec2;

/// A singlet in which `object` and `first` are lines more of SURF 0 and SURF 1, and of this glass.
fn file(object: &str, first: &str, glass: &str) -> String {
    format!(
        "MODE SEQ\nENPD 8\nFTYP 0 0 1 1\nYFLN 0\nWAVL 0.55\nSURF 0\n  TYPE STANDARD\n  DISZ INFINITY\n{object}\
         SURF 1\n  TYPE STANDARD\n  STOP\n  CURV 0.02\n  DISZ 4\n  GLAS {glass}\n  DIAM 4\n{first}\
         SURF 2\n  TYPE STANDARD\n  CURV -0.02\n  DISZ 48\n  DIAM 4\nSURF 3\n  TYPE STANDARD\n  DISZ 0\n"
    )
}

const GLASS: &str = "N-BK7 0 0 1.5168 64.17";

fn read(text: &str) -> Result<ZemaxLens, String> {
    ZemaxLens::read(text.as_bytes(), &[]).map_err(|error| error.to_string())
}

fn says(text: &str, words: &[&str]) {
    let message = read(text).unwrap_err();
    for word in words {
        assert!(message.contains(word), "expected \"{word}\" in: {message}");
    }
}

#[test]
fn rings_in_the_way_are_refused_with_a_remedy_and_what_covers_nothing_is_none() {
    says(
        &file("", "  OBSC 0.5 1.5 0\n", GLASS),
        &["line 16", "OBSC", "take the line out", "--save"],
    );
    let bare = read(&file("", "", GLASS)).unwrap().file;
    for line in ["OBSC 0 0 0", "SQOB 0 0 0", "ELOB 1 0 0", "CLAP INF", "CLAP 0 INFINITY 0"] {
        assert_eq!(read(&file("", &format!("  {line}\n"), GLASS)).unwrap().file, bare, "{line}");
    }
    says(&file("", "  SQOB -1 1 0\n", GLASS), &["line 16", "SQOB", "positive"]);
}

#[test]
fn apertures_by_points_and_tilts_of_a_surface_by_itself_are_refused_with_a_remedy() {
    for command in ["UDAP", "UDAD", "USAP", "USOB"] {
        let line = format!("  {command} 3 2 0\n");
        says(&file("", &line, GLASS), &["line 16", command, "take the line out", "outline"]);
    }
    says(&file("", "  SCBD 0 45 0\n", GLASS), &["line 16", "SCBD", "COORDBRK"]);
    assert!(read(&file("", "  SCBD 0 0.0 0\n", GLASS)).is_ok());
}

#[test]
fn an_object_in_a_glass_is_refused_with_a_remedy() {
    let object = format!("  GLAS {GLASS}\n");
    says(
        &file(&object, "", GLASS),
        &["line 9", "the object stands in a glass", "take the line out"],
    );
}

#[test]
fn glasses_without_published_data_are_read_from_a_catalogue() {
    for name in ["D-ZK3M", "L-TIM28_MOLD"] {
        let text = file("", "", &format!("{name} 0 0 1.6 60"));
        says(
            &text,
            &["line 14", name, "--glass-catalog", "`glass_catalogs`", "GLAS ___BLANK 1 0 nd vd"],
        );
        let own =
            format!("CC made up\nNM {name} 2 0 1.6 60 0 1\nCD 1.5 0.01 0 0 0 0\nLD 0.35 2.5\n");
        let own = [AgfCatalogue::read("own", own.as_bytes()).unwrap()];
        assert!(ZemaxLens::read(text.as_bytes(), &own).is_ok(), "{name}");
    }
}

/// A file that is cut behind one of its surfaces would be another lens.
#[test]
fn files_that_are_cut_short_are_refused_wherever_they_are_cut() {
    let whole = file("", "", GLASS);
    assert!(read(&whole).is_ok());
    let lines: Vec<&str> = whole.split_inclusive('\n').collect();
    let image = lines.iter().position(|line| line.starts_with("SURF 3")).unwrap();
    // Behind every line of the surfaces, and in the middle of it.
    for kept in 9..lines.len() {
        let cut = lines[..kept].concat();
        assert!(read(&cut).is_err(), "{cut}");
        if kept > image {
            says(&cut, &["SURF 3 has no DISZ", "cut short"]);
        }
        let middle = format!("{cut}{}", &lines[kept][..lines[kept].len() / 2]);
        assert!(read(&middle).is_err(), "{middle}");
    }
    // At the end of a surface.
    says(&lines[..image].concat(), &["line 20", "SURF 2", "48", "DISZ", "cut short"]);
    says(whole.trim_end(), &["line 23", "no end", "line break"]);
    // An exponent is the end of a number, though nothing follows.
    let exponent = whole.trim_end().replace("DISZ 0", "DISZ 0.0000E+00");
    assert!(read(&exponent).is_ok());
    says(&exponent[..exponent.len() - 1], &["line 23", "no end"]);
    says(&whole.replace("DISZ 0\n", "DISZ 0\n  GLAS N-BK7 0 0 1.5 64\n"), &["SURF 3", "no image"]);
}

#[test]
fn weights_and_vignetting_factors_are_those_of_the_file() {
    let weighted = |more: &str| read(&file("", "", GLASS).replace("WAVL 0.55\n", more)).unwrap();
    let lens = weighted("WAVM 1 0.48 0.5\nWAVM 2 0.55 1\nWAVM 3 0.65 0.25\nPWAV 2\n");
    let lens = (lens.file.wavelengths_nm(), lens.file.weights);
    // Those behind FTYP's count of one are slots that are not in use.
    assert_eq!(lens, (vec![480.0], vec![]));
    let three = file("", "", GLASS).replace("FTYP 0 0 1 1", "FTYP 0 0 1 3");
    let three =
        three.replace("WAVL 0.55\n", "WAVM 1 0.48 0.5\nWAVM 2 0.55 1\nWAVM 3 0.65 0.25\nPWAV 2\n");
    let lens = read(&three).unwrap();
    assert_eq!(lens.file.wavelengths_nm(), [550.0, 480.0, 650.0]);
    assert_eq!(lens.file.weights, [1.0, 0.5, 0.25]);
    // Equal ones weigh nothing against each other, and those of zero make no mean.
    assert!(
        read(&three.replace("0.5\nWAVM", "1\nWAVM").replace("0.65 0.25", "0.65 1"))
            .unwrap()
            .file
            .weights
            .is_empty()
    );
    let fields = file("", "", GLASS)
        .replace("FTYP 0 0 1 1", "FTYP 0 0 2 1")
        .replace("YFLN 0\n", "YFLN 0 5 9\nFWGN 1 3 1\nVDXN 0 0.1 0\nVDYN 0 0 0\nVCYN 0 0.2 0\n");
    let lens = read(&fields).unwrap().file;
    let vignetting =
        VignettingSpec { decentre: [0.1, 0.0], compression: [0.0, 0.2], rotation: Degrees(0.0) };
    let second = FieldSpec { weight: 3.0, vignetting, ..FieldSpec::at(5.0) };
    assert_eq!(lens.fields, [FieldSpec::at(0.0), second]);
    // Half the pupil's height, moved up by a fifth of its radius and turned by a right angle.
    let place = |spec: VignettingSpec, x, y| spec.place(DVec2::new(x, y));
    let turned =
        VignettingSpec { decentre: [0.0, 0.2], compression: [0.0, 0.5], rotation: Degrees(90.0) };
    assert!((place(turned, 0.0, 1.0) - DVec2::new(-0.7, 0.0)).length() < 1e-15);
    assert!((place(turned, 1.0, 0.0) - DVec2::new(-0.2, 1.0)).length() < 1e-15);
    assert_eq!(turned.area(), 0.5);
    // A field along x is looked at along y, and its pupil is turned with it.
    let along_x = fields.replace("YFLN 0 5 9\n", "XFLN 0 5 9\nYFLN 0 0 0\n");
    let own = read(&along_x).unwrap().file.fields[1];
    assert!((own.angle.0 - 5.0).abs() < 1e-14);
    assert!((place(own.vignetting, 1.0, 0.0) - DVec2::new(0.0, 1.1)).length() < 1e-15);
    says(&fields.replace("VCYN 0 0.2", "VCYN 0 1"), &["line 8", "VCYN", "below 1"]);
}

/// A spot over what the factors leave is that of the same rays by themselves: here of a beam of half the width.
#[test]
fn spots_are_also_those_over_what_vignetting_factors_leave() {
    let text = file("", "", GLASS).replace("FTYP 0 0 1 1", "FTYP 0 0 2 1");
    let text = text.replace("YFLN 0\n", "YFLN 0 5\nVCXN 0.5 0\nVCYN 0.5 0\n");
    let report = |text: &str| {
        let lens = read(text).unwrap().file;
        let train = lens.build(&|name: &str| Err(name.to_owned())).unwrap();
        let fields = Some(lens.field_angles());
        LensReport::new(&train, &Inquiry { fields, stated: lens.fields, ..Inquiry::default() })
            .unwrap()
    };
    let whole = report(&text);
    let [row] = &whole.vignetted[..] else { panic!("{:?}", whole.vignetted) };
    assert_eq!((row.spot.field, row.stated, row.passed), (0.0, 0.25, 1.0));
    let narrow = report(&text.replace("ENPD 8", "ENPD 4"));
    let own = &narrow.spots[0];
    assert!((row.spot.rms / own.rms - 1.0).abs() < 1e-9, "{} {}", row.spot.rms, own.rms);
    assert!(row.spot.rms < whole.spots[0].rms, "{} {}", row.spot.rms, whole.spots[0].rms);
    assert!(whole.to_string().contains("factors leave"), "{whole}");
}

#[test]
fn numbers_of_surfaces_that_are_not_read_are_told() {
    let notes = |more: &str| read(&file("", more, GLASS)).unwrap().notes.join("\n");
    assert!(notes("  PARM 3 0.5\n").contains("line 16: PARM 3"), "{}", notes("  PARM 3 0.5\n"));
    assert!(!notes("  PARM 3 0\n").contains("PARM"));
    let toroid = "  TYPE TOROIDAL\n  PARM 1 50\n  PARM 9 1e-9\n";
    assert!(notes(toroid).contains("line 18: PARM 9"), "{}", notes(toroid));
}

#[test]
fn configurations_change_glasses_wavelengths_and_weights() {
    let values = "MNUM 2 1\nGLSS 1 1 N-BK7 0\nGLSS 1 2 SF11 0\nWAVE 1 1 0.55 0\nWAVE 1 2 0.65 0\nTHIC 1 2 5 0\n\
                  FLWT 1 2 2 0\nWLWT 1 2 3 0\n";
    let text = file("", "", GLASS) + values;
    let at = |number| ZemaxLens::read_configuration(text.as_bytes(), Some(number), &[]).unwrap();
    let glass = |lens: &ZemaxLens| {
        serde_json::to_value(&lens.file).unwrap()["elements"][0]["glass"].clone()
    };
    assert_eq!(
        (glass(&at(1)), at(1).file.wavelengths_nm()),
        (serde_json::json!("N-BK7"), vec![550.0])
    );
    assert_eq!(
        (glass(&at(2)), at(2).file.wavelengths_nm()),
        (serde_json::json!("Schott:SF11"), vec![650.0])
    );
    assert_eq!(at(2).file.elements[0].mount.thickness.0, 5.0);
    for (bad, word) in [
        ("GLSS 9 2 SF11 0", "no surface 9"),
        ("GLSS 1 2 MIRROR 0", "mirror"),
        ("WAVE 4 2 0.5 0", "no wavelength 4"),
        ("WLWT 4 2 0.5 0", "no wavelength or field 4"),
    ] {
        let text = format!("{text}{bad}\n");
        let error = ZemaxLens::read_configuration(text.as_bytes(), Some(2), &[]).unwrap_err();
        assert!(error.to_string().contains(word), "{error}");
    }
}
