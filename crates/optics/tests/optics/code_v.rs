//! CODE V's sequential files: what each command becomes, and what is refused.

use etendue_optics::train::{LensFile, ZemaxLens};
use serde_json::{Value, json};

const TRIPLET: &str = "RDM;LEN \"VERSION: 10.2\"\nTITLE 'Triplet of ours'   ! a title\nEPD 10.0\nDIM M\nWL 656.27 587.56 &\n 486.13\nREF 2\nYAN 0.0 7.0 10.0\nSO 0.0 0.1e14\n\
S 20.0 3.0 NBK7_SCHOTT\n  CIR 6.0\nS -50.0 2.0 517000.642000\nS 0.0 1.5\n  STO\n  CIR 4.0\nS 30.0 2.0 'SF2_SCHOTT'\n  ASP\n  K -0.5\n  A 1e-6; B -2e-8\n  CIR 5.0\n\
S -40.0 30.0\n  CIR 5.0\nSI 0.0 0.0\nGO\n";

fn read(text: &str) -> Result<ZemaxLens, String> {
    ZemaxLens::read_code_v(text.as_bytes(), &[]).map_err(|error| error.to_string())
}

fn elements(text: &str) -> Vec<Value> {
    let lens = read(text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    let value = serde_json::to_value(&lens.file).unwrap();
    let back: LensFile = serde_json::from_value(value.clone()).unwrap();
    assert_eq!(back, lens.file);
    value["elements"].as_array().unwrap().clone()
}

#[test]
fn a_triplet_is_read_with_its_system_and_its_glasses() {
    let lens = read(TRIPLET).unwrap();
    assert_eq!(lens.file.name, "Triplet of ours");
    assert_eq!(lens.file.wavelengths_nm(), [587.56, 656.27, 486.13], "the reference first");
    assert_eq!(lens.file.field_angles(), [0.0, 7.0, 10.0]);
    let elements = elements(TRIPLET);
    assert_eq!(elements.len(), 5);
    assert_eq!(elements[0]["glass"], "N-BK7");
    assert_eq!((&elements[0]["curvature"], &elements[0]["thickness"]), (&json!(0.05), &json!(3.0)));
    assert_eq!(elements[1]["glass"], json!({"nd": 1.517, "vd": 64.2}));
    // The stop is the flat back of the second glass.
    assert_eq!((&elements[2]["type"], &elements[2]["stop"]), (&json!("surface"), &json!(true)));
    assert_eq!(elements[3]["aspheric"], json!({"4": 1e-6, "6": -2e-8}));
    assert_eq!(elements[3]["conic"], -0.5);
    assert_eq!(elements[4]["semi_diameter"], 5.0);
    let train = lens.file.build(&|name: &str| Err(name.to_owned())).unwrap();
    // EPD sets the stop so that the entrance pupil is 10 mm wide.
    let pupil = train.paraxial(587.56).unwrap().entrance_pupil;
    assert!((pupil.diameter.unwrap() - 10.0).abs() < 1e-12);
}

#[test]
fn curvatures_units_and_mirrors_are_as_the_file_says() {
    let text = "RDM N;LEN\nEPD 1\nDIM I\nWL 550\nREF 1\nYAN 0\nSO 0 1e13\nS -0.01 -5 REFL\n  STO\n  CIR 2\n  CIR HOL 0.1\nSI 0 0\nGO\n";
    let mirror = &elements(text)[0];
    assert_eq!(mirror["type"], "mirror");
    assert!((mirror["curvature"].as_f64().unwrap() + 0.01 / 25.4).abs() < 1e-18);
    assert_eq!((&mirror["thickness"], &mirror["hole"]), (&json!(-127.0), &json!(0.1 * 25.4)));
}

#[test]
fn a_bend_folds_the_axis_and_a_return_tilts_the_mirror_alone() {
    let text = |command: &str| {
        format!(
            "RDM;LEN\nEPD 4\nDIM M\nWL 550\nREF 1\nYAN 0\nSO 0 1e13\nS -200 -50 REFL\n  STO\n  CIR 9\n  ADE 10\n  {command}\nSI 0 0\nGO\n"
        )
    };
    let bent = &elements(&text("BEN"))[0];
    assert_eq!(bent["fold"], true);
    // α turns left-handed.
    assert!((bent["tilt"][0].as_f64().unwrap() + 10.0).abs() < 1e-12);
    assert!((bent["thickness"].as_f64().unwrap() + 50.0).abs() < 1e-12);
    assert_eq!(read(&text("BEN")).unwrap().file.sensor, None);
    let returned = &elements(&text("DAR"))[0];
    assert_eq!(returned.get("fold"), None);
    assert!((returned["tilt"][0].as_f64().unwrap() + 10.0).abs() < 1e-12);
    assert_eq!(read(&text("DAR")).unwrap().file.sensor, None);
}

#[test]
fn what_has_no_counterpart_and_what_is_cut_short_is_refused() {
    let refused = |from: &str, to: &str| read(&TRIPLET.replace(from, to)).unwrap_err();
    let cut = refused("SI 0.0 0.0\nGO\n", "");
    assert!(cut.contains("line 22") && cut.contains("cut short"), "{cut}");
    for command in ["DIF GRT", "XTO", "SPS ZRN", "RET S1", "ZDE 3"] {
        let why = refused("  STO\n", &format!("  STO\n  {command}\n"));
        let word = command.split(' ').next().unwrap();
        assert!(why.starts_with("line 15") && why.contains(word), "{why}");
    }
    assert!(refused("NBK7_SCHOTT", "NOGLASS_SCHOTT").contains("line 10"));
    assert!(refused("S 20.0 3.0", "S twenty 3.0").contains("`twenty` is not a number"));
    assert!(refused("SO 0.0 0.1e14\n", "").contains("the object (SO) comes first"));
    assert!(read("hello\n").unwrap_err().contains("no SO"));
    assert!(read("").unwrap_err().contains("empty"));
    assert!(refused("EPD 10.0", "EPD -1").contains("EPD: -1 must be positive"));
    // What does not change the light's way is told.
    let lens = read(&TRIPLET.replace("REF 2", "REF 2\nWTW 1 1 1\nVUY 0 0.1 0.2")).unwrap();
    assert!(
        lens.notes.iter().any(|note| note.contains("WTW") && note.contains("VUY")),
        "{:?}",
        lens.notes
    );
}
