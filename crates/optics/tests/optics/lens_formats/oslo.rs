//! Files of OSLO.

use etendue_optics::train::{Focus, LensFormat};
use serde_json::{Value, json};

use super::{build, elements, read, refused, try_at};

/// An OSLO file of a front and a back surface with their statements.
fn oslo(system: &str, front: &str, back: &str, footer: &str) -> String {
    format!(
        "// OSLO 6.6\nLEN NEW \"Lens of ours\" 50 3\n{system}\nUNI 1.0\n// SRF 0\nAIR\nTH 1.0e+20\nAP 1e20\nNXT // SRF 1\n{front}\n\
         NXT // SRF 2\nAIR\n{back}\nNXT // SRF 3\nAIR\nWV 0.58756 0.48613 0.65627\nWW 1 2 1\nEND 3\n{footer}"
    )
}

const FRONT: &str = "GLA BK7\nRD 50.0\nTH 4.0\nAP CHK 8.0\nAST";

const BACK: &str = "RD -50.0\nTH 47\nAP 8";

fn read_oslo(front: &str, back: &str) -> Vec<Value> {
    elements(&read(LensFormat::Oslo, &oslo("EBR 5.0\nANG 10", front, back, "")))
}

#[test]
fn a_lens_of_oslo_is_read_with_its_system() {
    let lens = read(LensFormat::Oslo, &oslo("EBR 5.0\nANG 10", FRONT, BACK, ""));
    assert_eq!(
        (lens.file.name.as_str(), lens.file.source.as_str()),
        ("Lens of ours", "an OSLO file")
    );
    assert_eq!(lens.file.wavelengths_nm(), [587.56, 486.13, 656.27]);
    let train = build(&lens);
    let pupil = train.paraxial(587.56).unwrap().entrance_pupil;
    assert!((pupil.diameter.unwrap() - 10.0).abs() < 1e-12, "EBR is a radius");
    // Shares of a field are shares of its tangent.
    let part = (0.7 * 10_f64.to_radians().tan()).atan().to_degrees();
    assert_eq!(
        lens.file.field_angles(),
        [0.0, part, (10_f64.to_radians().tan()).atan().to_degrees()]
    );
    let all = elements(&lens);
    assert_eq!((&all[0]["glass"], &all[0]["curvature"]), (&json!("BK7"), &json!(0.02)));
    assert_eq!((&all[0]["stop"], &all[1]["semi_diameter"]), (&json!(true), &json!(8.0)));
    // Fields by the table behind the lens: y and then x.
    let table = "RST NEW\nF 1 0 0 0 0 0 -1 1 -1 1 1\nF 2 -0.5 0 0 0 0 -1 1 -1 1 1\nEND\n";
    let lens = read(LensFormat::Oslo, &oslo("FNO 5\nANG 10", FRONT, BACK, table));
    assert_eq!(
        lens.file.field_angles(),
        [0.0, -(0.5 * 10_f64.to_radians().tan()).atan().to_degrees()]
    );
    let train = build(&lens);
    assert!((train.paraxial(587.56).unwrap().f_number.unwrap() - 5.0).abs() < 1e-9);
    // Units of 10 mm.
    let scaled = oslo(
        "EBR 0.5\nANG 10",
        &FRONT.replace("50.0", "5").replace("4.0", "0.4").replace("8.0", "0.8"),
        "RD -5\nTH 4.7\nAP 0.8",
        "",
    )
    .replace("UNI 1.0", "UNI 10");
    let scaled = elements(&read(LensFormat::Oslo, &scaled));
    assert_eq!(scaled[0]["thickness"], all[0]["thickness"]);
    // An object 100 mm away, and the height of its ray at the first surface.
    let near = oslo("EBR 5.0\nOBH 10", FRONT, BACK, "").replace("TH 1.0e+20", "TH 100");
    let near = read(LensFormat::Oslo, &near);
    let train = build(&near);
    let pupil = train.paraxial(587.56).unwrap().entrance_pupil;
    // The stop is the first surface, so that the entrance pupil stands there.
    assert!((pupil.diameter.unwrap() - 10.0).abs() < 1e-9, "{pupil:?}");
}

#[test]
fn statements_of_surfaces_of_oslo_are_their_parts() {
    let first = |more: &str| read_oslo(&format!("{FRONT}\n{more}"), BACK)[0].clone();
    for (more, key, expected) in [
        (
            "CC -0.5; AD 1e-6; AE -2e-9; AF 1e-12; AG -1e-15",
            "aspheric",
            json!({"4": 1e-6, "6": -2e-9, "8": 1e-12, "10": -1e-15}),
        ),
        ("CC -0.5", "conic", json!(-0.5)),
        ("CV 0.03", "curvature", json!(0.03)),
        ("ASP ASR 3\nAS1 1e-4\nAS3 1e-9", "aspheric", json!({"2": 1e-4, "6": 1e-9})),
        ("ASP ARA 3\nAS3 1e-5", "aspheric", json!({"3": 1e-5})),
        (
            "ASP ASX 9\nAS4 2e-5\nAS6 1e-7",
            "sag",
            json!([{"type": "polynomial", "radius": 1.0, "coefficients": [[1, 1, 2e-5], [3, 0, 1e-7]]}]),
        ),
        ("CVX 0.01", "rotation_radius", json!(100.0)),
        ("RDX 0", "rotation_radius", json!(0.0)),
        (
            "GSP 0.01; GOR 2",
            "phase",
            json!({"pattern": {"type": "grating", "period": 0.01, "rotation": 0.0}, "order": 2}),
        ),
        ("GLA 1.5", "glass", json!({"n": 1.5})),
        ("GLA MOD 1.62 60.3", "glass", json!({"nd": 1.62, "vd": 60.3})),
        ("TH 3; PK TH 0 2", "thickness", json!(f64::INFINITY)),
    ] {
        if key == "thickness" {
            continue;
        }
        assert_eq!(first(more)[key], expected, "{more}");
    }
    // Indices at the file's wavelengths go through all of them.
    let glass = first("GLA MOD M 1.62 1.63 1.615")["glass"]["cauchy"].clone();
    let terms: Vec<f64> = serde_json::from_value(glass).unwrap();
    for (um, n) in [(0.58756_f64, 1.62), (0.48613, 1.63), (0.65627, 1.615)] {
        let found = terms[0] + terms[1] / um.powi(2) + terms[2] / um.powi(4);
        assert!((found - n).abs() < 1e-12, "{um}: {found}");
    }
    let ideal = read_oslo("AIR\nTH 10\nPFL 50\nAST", BACK);
    assert_eq!((&ideal[0]["type"], &ideal[0]["focal_length"]), (&json!("thin_lens"), &json!(50.0)));
    let mirror = read_oslo("RFL\nRD -200\nCC -1\nTH -50\nAP 9", "CV 0\nTH -50\nAP 9");
    assert_eq!((&mirror[0]["type"], &mirror[0]["conic"]), (&json!("mirror"), &json!(-1.0)));
}

#[test]
fn pickups_of_oslo_take_the_values_of_surfaces_before() {
    for (back, key, expected) in [
        ("PK CV 1\nTH 5", "curvature", json!(0.02)),
        ("PK CVM 1 0.01\nTH 5", "curvature", json!(-0.01)),
        ("PK CVM -1\nTH 5", "conic", json!(-0.5)),
        ("RD -50\nPK TH 1 0.5", "thickness", json!(4.5)),
        ("RD -50\nPK THM 1 10", "thickness", json!(6.0)),
        ("RD -50\nPK LN 1 2 0.25", "thickness", json!(4.25)),
        ("RD -50\nTH 5\nPK AP 1", "semi_diameter", json!(8.0)),
    ] {
        let all = read_oslo(&format!("{FRONT}\nCC -0.5"), back);
        assert_eq!(all[1][key], expected, "{back}");
    }
    // Undone by its own reverse: the second stands as if nothing were, 4 mm along the tilted axis.
    let tilted = read_oslo(&format!("{FRONT}\nTLA 3"), "RD -50\nTH 5\nPK TDM 1");
    assert!(tilted[1].get("tilt").is_none(), "{tilted:?}");
    let moved = tilted[1]["decentre"][1].as_f64().unwrap();
    assert!((moved - 4.0 * 3_f64.to_radians().sin()).abs() < 1e-12, "{tilted:?}");
}

#[test]
fn tilts_of_oslo_are_left_handed_about_x_and_y() {
    // The surface alone, and what follows stands where it would without.
    let alone = read_oslo(&format!("{FRONT}\nDCX 0.3; DCY -0.2\nTLA 2\nRCO"), BACK);
    assert_eq!(alone[0]["decentre"], json!([0.3, -0.2]));
    assert!((alone[0]["tilt"][0].as_f64().unwrap() + 2.0).abs() < 1e-12, "{}", alone[0]);
    assert!(alone[1].get("tilt").is_none() && alone[1].get("decentre").is_none(), "{}", alone[1]);
    assert!((alone[0]["thickness"].as_f64().unwrap() - 4.0).abs() < 1e-12);
    // Without RCO all that follows goes along: the second vertex stands 4 mm along the tilted axis.
    let along = read_oslo(&format!("{FRONT}\nTLA 2"), BACK);
    let (sine, cosine) = 2_f64.to_radians().sin_cos();
    assert!((along[1]["decentre"][1].as_f64().unwrap() - 4.0 * sine).abs() < 1e-12, "{}", along[1]);
    assert!((along[0]["thickness"].as_f64().unwrap() - 4.0 * cosine).abs() < 1e-12);
    // A mirror that bends the axis, and one that does not.
    let bent = read_oslo("RFL\nRD 0\nTH -50\nAP 9\nTLA 20\nBEN", "RFL\nRD 300\nTH 60\nAP 9");
    assert_eq!(bent[0]["fold"], true, "{bent:?}");
    assert!(bent[1].get("tilt").is_none(), "{bent:?}");
    let whole = read_oslo("RFL\nRD 0\nTH -50\nAP 9\nTLA 1\nRCO", "RFL\nRD 300\nTH 60\nAP 9");
    assert!(whole[0].get("fold").is_none(), "{whole:?}");
}

#[test]
fn configurations_of_oslo_change_thicknesses() {
    let text = oslo("EBR 5\nANG 1", FRONT, BACK, "CFG NEW\nTH 2 2 30\nTH 2 3 25\nEND\n");
    let at = |number| {
        elements(&try_at(LensFormat::Oslo, &text, number).unwrap())[1]["thickness"].clone()
    };
    assert_eq!(
        [at(None), at(Some(1)), at(Some(2)), at(Some(3))],
        [47.0, 47.0, 30.0, 25.0].map(|t| json!(t))
    );
    let error = try_at(LensFormat::Oslo, &text, Some(4)).unwrap_err();
    assert!(error.contains("no configuration 4: the file has 3"), "{error}");
    let more = oslo("EBR 5\nANG 1", FRONT, BACK, "CFG NEW\nCV 1 2 0.1\nEND\n");
    refused(LensFormat::Oslo, &more, &["CV", "configuration", "TH"]);
}

#[test]
fn solves_of_oslo_keep_their_values() {
    let lens = read(LensFormat::Oslo, &oslo("EBR 5\nANG 1", FRONT, "RD -50\nPY 0", ""));
    let train = build(&lens);
    let image = train.paraxial(train.wavelength()).unwrap().image_z.unwrap();
    assert!((train.sensor_z(Focus::AsWritten).unwrap() - image).abs() < 1e-12);
    let stands = read(LensFormat::Oslo, &oslo("EBR 5\nANG 1", FRONT, "RD -50\nTH 45\nPY 0", ""));
    assert_eq!(elements(&stands)[1]["thickness"], 45.0);
    assert!(
        stands.notes.iter().any(|note| note.contains("PY is not solved")),
        "{:?}",
        stands.notes
    );
    refused(LensFormat::Oslo, &oslo("EBR 5\nANG 1", FRONT, "RD -50\nPY 0.3", ""), &["PY", "no TH"]);
}

#[test]
fn files_of_oslo_that_are_broken_are_refused_by_line() {
    let front = |more: &str| oslo("EBR 5\nANG 1", &format!("{FRONT}\n{more}"), BACK, "");
    for (more, words) in [
        ("APN 2", ["line 16", "APN"]),
        ("ASP ZER 4", ["line 16", "ZER"]),
        ("LMO NSS", ["line 16", "sequential"]),
        ("RD x", ["line 16", "`x`"]),
        ("RD", ["line 16", "missing"]),
        ("GLA NOGLASS", ["line 16", "NOGLASS"]),
        ("GLA", ["line 16", "missing"]),
        ("GLA 1.5 1.6", ["line 16", "2 indices for 3"]),
        ("PK CV 1", ["line 16", "before it"]),
        ("PK CV 7", ["line 16", "`7`"]),
        ("PK XX 0", ["line 16", "XX"]),
        ("ASP ASR\nAS99 1", ["line 10", "r^198"]),
        ("ASP ARA\nAS0 1", ["line 10", "r^0"]),
        ("CVX 0.01; GSP 0.01", ["line 10", "CVX"]),
        ("GSP 0.01; GOR 0.5", ["line 10", "whole order"]),
        ("TLA 3; BEN", ["line 10", "BEN"]),
        ("GC 3", ["line 16", "`3`"]),
        ("AP -1", ["line 16", "below zero"]),
        ("\"open", ["line 16", "cut short"]),
        ("WV9 0.5", ["line 16", "before it"]),
        ("UNI 0", ["line 16", "positive"]),
        ("LEN NEW \"b\" 1 2", ["line 16", "second lens"]),
    ] {
        refused(LensFormat::Oslo, &front(more), &words);
    }
    let whole = front("");
    refused(LensFormat::Oslo, &whole.replace("END 3\n", ""), &["before END", "cut short"]);
    refused(
        LensFormat::Oslo,
        &whole.replace("50 3\n", "50 4\n"),
        &["announces 4", "has 3", "missing"],
    );
    refused(LensFormat::Oslo, "RD 3\n", &["line 1", "LEN NEW"]);
    refused(LensFormat::Oslo, "// nothing\n", &["no LEN NEW"]);
    refused(LensFormat::Oslo, &whole.replace("EBR 5", "NAO 2"), &["NAO", "below 1"]);
    refused(LensFormat::Oslo, &whole.replace("EBR 5", "EBR -2"), &["EBR", "positive"]);
    // Its own words, none of Zemax'.
    let in_glass = whole.replace("// SRF 0\nAIR", "// SRF 0\nGLA BK7");
    let error = try_at(LensFormat::Oslo, &in_glass, None).unwrap_err();
    assert!(error.contains("surface 0") && !error.contains("SURF"), "{error}");
}
