//! Commands of Zemax files without a counterpart here: each in a file of its own, refused by its name and with
//! what to do.

use etendue_optics::glass::AgfCatalogue;
use etendue_optics::train::ZemaxLens;

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
fn what_stands_in_the_way_and_is_no_disk_is_refused_with_a_remedy() {
    for line in ["OBSC 0.5 1.5 0", "SQOB 1 1 0", "ELOB 1 1 0"] {
        let command = line.split(' ').next().unwrap();
        says(
            &file("", &format!("  {line}\n"), GLASS),
            &["line 16", command, "take the line out", "--save"],
        );
    }
    // One without a radius covers nothing.
    let open = read(&file("", "  OBSC 0 0 0\n", GLASS)).unwrap();
    assert_eq!(open.file, read(&file("", "", GLASS)).unwrap().file);
}

#[test]
fn apertures_by_points_are_refused_with_a_remedy() {
    says(&file("", "  UDAP 3 2 0\n", GLASS), &["line 16", "UDAP", "CLAP 0", "take the line out"]);
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
