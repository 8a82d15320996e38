//! Files of OSLO, optiland, ISET, pbrt and `PhotonsToPhotos`: what each command becomes, and what is refused.

mod oslo;

use etendue_optics::element::PartSpec;
use etendue_optics::train::{Focus, LensFile, LensFormat, OpticalTrain, ZemaxLens};
use serde_json::{Value, json};

fn try_at(
    format: LensFormat,
    text: &str,
    configuration: Option<usize>,
) -> Result<ZemaxLens, String> {
    ZemaxLens::read_as(format, text.as_bytes(), configuration, &[])
        .map_err(|error| error.to_string())
}

fn read(format: LensFormat, text: &str) -> ZemaxLens {
    try_at(format, text, None).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// The elements as a lens file has them, which comes back the same.
fn elements(lens: &ZemaxLens) -> Vec<Value> {
    let text = serde_json::to_string(&lens.file).unwrap();
    assert_eq!(LensFile::from_json(&text).unwrap(), lens.file);
    let value: Value = serde_json::from_str(&text).unwrap();
    value["elements"].as_array().unwrap().clone()
}

fn build(lens: &ZemaxLens) -> OpticalTrain {
    lens.file.build(&|name: &str| Err(name.to_owned())).unwrap()
}

fn efl(lens: &ZemaxLens) -> f64 {
    let train = build(lens);
    train.paraxial(train.wavelength()).unwrap().efl.unwrap()
}

fn refused(format: LensFormat, text: &str, words: &[&str]) {
    let error = try_at(format, text, None).expect_err(text);
    for word in words {
        assert!(error.contains(word), "`{word}` is not in `{error}`\n{text}");
    }
}

/// The thick lens of nd 1.5, radii 50 and −50 mm, 4 mm thick: n f = … by the lensmaker's formula.
fn lensmaker(n: f64, radii: [f64; 2], thickness: f64) -> f64 {
    let [a, b] = radii.map(|radius| 1.0 / radius);
    1.0 / ((n - 1.0) * (a - b + (n - 1.0) * thickness * a * b / n))
}

const PBRT: &str = "# Biconvex of ours\n# radius sep n aperture\n50 4 1.5 20\n-50 1 1 20\n0 46 0 8\n60 2 1.6 18 # a comment\n\
                    -60 0 1 18\n";

#[test]
fn a_table_of_pbrt_has_radius_thickness_index_and_diameter() {
    let lens = read(LensFormat::Pbrt, PBRT);
    assert_eq!(lens.file.name, "Biconvex of ours");
    let elements = elements(&lens);
    assert_eq!(elements.len(), 5);
    assert_eq!(
        elements[0],
        json!({"type": "surface", "curvature": 0.02, "glass": {"n": 1.5}, "semi_diameter": 10.0, "thickness": 4.0})
    );
    assert_eq!((&elements[2]["type"], &elements[2]["radius"]), (&json!("aperture"), &json!(4.0)));
    assert_eq!(elements[2]["stop"], true);
    // A film at 0 stands where infinity is sharp.
    let train = build(&lens);
    let image = train.paraxial(train.wavelength()).unwrap().image_z.unwrap();
    assert!((train.sensor_z(Focus::AsWritten).unwrap() - image).abs() < 1e-12);
    // One biconvex lens alone has the lensmaker's focal length; the film stands where the table has it.
    let one = read(LensFormat::Pbrt, "50 4 1.5 20\n-50 40 1 20");
    assert!((efl(&one) - lensmaker(1.5, [50.0, -50.0], 4.0)).abs() < 1e-10);
    assert!(one.notes.iter().any(|note| note.contains("40 mm behind")), "{:?}", one.notes);
    // The focal length on top of tables of pbrt-v2-spectral.
    let older = read(LensFormat::Pbrt, "50.1\n50 4 1.5 20\n-50 40 1 20");
    assert_eq!(older.file.elements, one.file.elements);
}

#[test]
fn tables_of_pbrt_that_are_broken_are_refused_by_line() {
    let pbrt = LensFormat::Pbrt;
    refused(pbrt, "50 4 1.5 20\n-50 40 1", &["line 2", "7 numbers", "four", "cut short"]);
    refused(pbrt, "50 4 1.5 x", &["line 1", "`x`"]);
    refused(pbrt, "50 4 1.5 inf", &["line 1", "inf"]);
    refused(pbrt, "50 4 1.5 20\n0 2 0 8\n-50 40 1 20", &["line 2", "the stop", "glass"]);
    refused(pbrt, "0 2 1.5 8\n-50 40 1 20", &["line 1", "the stop"]);
    refused(pbrt, "0 2 0 8\n50 4 1.5 20\n-50 1 1 20\n0 2 0 8", &["line 4", "second stop"]);
    refused(pbrt, "50 4 1.5 -20", &["line 1", "below zero"]);
    refused(pbrt, "# nothing\n", &["no surface"]);
    refused(pbrt, "50 4 0.5 20\n-50 40 1 20", &["line 1", "the index", "n must be"]);
}

#[test]
fn lenses_of_iset_have_the_surfaces_of_their_table() {
    let text = r#"{"name": "ours", "description": "d", "type": "multi element lens", "surfaces": [
        {"radius": 50, "thickness": 4, "ior": 1.5, "semi_aperture": 10, "conic_constant": [-0.5, -0.5]},
        {"radius": [-50, -50], "thickness": 1, "ior": 1, "semi_aperture": 10},
        {"radius": 0, "thickness": 46, "ior": 0, "semi_aperture": 4},
        {"radius": [60, 55], "thickness": 2, "ior": [[400, 500, 600, 700], [1.62, 1.61, 1.605, 1.602]], "semi_aperture": 9},
        {"radius": -60, "thickness": 0, "ior": 1, "semi_aperture": 9}], "metadata": {"focalLength": 1}}"#;
    let lens = read(LensFormat::Iset, text);
    let all = elements(&lens);
    assert_eq!((&all[0]["conic"], &all[0]["curvature"]), (&json!(-0.5), &json!(0.02)));
    assert_eq!((&all[2]["type"], &all[2]["stop"]), (&json!("aperture"), &json!(true)));
    assert_eq!((&all[3]["type"], &all[3]["radius_x"]), (&json!("biconic"), &json!(60.0)));
    let PartSpec::Biconic(biconic) = &lens.file.elements[3].part else { panic!("{:?}", all[3]) };
    let glass = biconic.glass.as_ref().unwrap().resolve().unwrap();
    for (nm, n) in [(400.0, 1.62), (500.0, 1.61), (600.0, 1.605), (700.0, 1.602)] {
        // What the fit is allowed to miss.
        assert!((glass.index(nm).unwrap() - n).abs() < 1e-4, "{nm}");
    }
    assert!(lens.notes.iter().any(|note| note.contains("metadata")), "{:?}", lens.notes);
    // Spheres by centre and radius: the vertices stand at −4, −1 and 0.
    let spheres = r#"{"name": "s", "units": "mm", "apertureMiddleD": 6, "surfaceArray": [
        {"subtype": "refractive", "sRadius": 50, "sCenter": [0, 0, 46], "wave": [400, 700], "n": [1.5, 1.5], "apertureD": 20, "asphericity": 0},
        {"subtype": "refractive", "sRadius": -50, "sCenter": [0, 0, -51], "wave": [400, 700], "n": [1, 1], "apertureD": 20, "asphericity": 0},
        {"subtype": "diaphragm", "sRadius": 0, "sCenter": [0, 0, 0], "wave": [400, 700], "n": [1, 1], "apertureD": 20, "asphericity": 0}]}"#;
    let lens = read(LensFormat::Iset, spheres);
    let all = elements(&lens);
    assert_eq!(
        all.iter().map(|e| e["thickness"].as_f64()).collect::<Vec<_>>(),
        [Some(3.0), Some(1.0), None]
    );
    assert_eq!(all[2]["radius"], 3.0, "the narrower diaphragm");
    assert!((efl(&lens) - lensmaker(1.5, [50.0, -50.0], 3.0)).abs() < 1e-10);
}

#[test]
fn lenses_of_iset_that_are_broken_are_refused_by_surface() {
    let iset = |surfaces: &str| format!(r#"{{"name": "a", "surfaces": [{surfaces}]}}"#);
    let plain = r#"{"radius": 50, "thickness": 4, "ior": 1.5, "semi_aperture": 10}"#;
    for (bad, words) in [
        (
            r#"{"radius": 50, "thickness": 4, "ior": 1.5, "semi_aperture": [3, 4]}"#,
            ["surfaces[1].semi_aperture", "circles"],
        ),
        (r#"{"thickness": 4, "ior": 1.5}"#, ["surfaces[1].radius", "missing"]),
        (r#"{"radius": 50, "thickness": "a", "ior": 1.5}"#, ["surfaces[1].thickness", "number"]),
        (r#"{"radius": 50, "thickness": 1, "ior": "glass"}"#, ["surfaces[1].ior", "number"]),
        (
            r#"{"radius": 50, "thickness": 1, "ior": [[400, 700], [1.5]]}"#,
            ["surfaces[1].ior", "2 wavelengths"],
        ),
        (
            r#"{"radius": 50, "thickness": 1, "ior": [[400, 500, 600, 700], [1.5, 1.9, 1.4, 1.8]]}"#,
            ["surfaces[1].ior", "misses"],
        ),
        (
            r#"{"radius": 50, "thickness": 1, "ior": 1, "transform": [[2, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]]}"#,
            ["surfaces[1].transform", "counterpart"],
        ),
        (r#"{"radius": 0, "thickness": 1, "ior": 0}"#, ["surfaces[1]", "the stop"]),
    ] {
        refused(LensFormat::Iset, &iset(&format!("{plain}, {bad}")), &words);
    }
    refused(LensFormat::Iset, &iset(""), &["no surface"]);
    refused(LensFormat::Iset, r#"{"surfaces": {}}"#, &["surfaces", "list"]);
    refused(LensFormat::Iset, r#"{"surfaces": [], "units": "cm"}"#, &["units", "mm"]);
    refused(
        LensFormat::Iset,
        r#"{"surfaces": [], "microlens": {"a": 1}}"#,
        &["microlens", "light_field"],
    );
    refused(LensFormat::Iset, "{\n\"surfaces\": [", &["line 2", "broken JSON"]);
}

const ZOOM: &str = "[descriptive data]\ntitle\tZoom of ours\n[constants]\n[variable distances]\nFocal Length\t48\t60\nF-Number\t4\t5\n\
    Angle of View\t40\t30\nImage Height\t40\nd0\tInfinity\nd2\t1\t3\nBf\t40\n[lens data]\n1\t50\t4\t1.5\t20\t64.2\n2\t-50\td2\t\t20\n\
    3\tAS\t2\t\t9\n4\tInfinity\t2\t1.6\t18\n5\t-60\t1\t\t18\n6\tCG\t1\t1.5168\t20\t64.2\n7\tFS\tBf\t\t20\n\
    [aspherical data]\n2\t-50\t-0.5\t1e-6\t-2e-9\n[notes]\nsomething\n";

#[test]
fn a_table_of_photons_to_photos_is_read_with_its_configurations() {
    let format = LensFormat::PhotonsToPhotos;
    let lens = read(format, ZOOM);
    assert_eq!(lens.file.name, "Zoom of ours");
    assert_eq!(
        (lens.file.field_angles().as_slice(), lens.file.wavelengths_nm()[0]),
        (&[0.0, 14.0, 20.0][..], 587.56)
    );
    let all = elements(&lens);
    assert_eq!(all[0]["glass"], json!({"nd": 1.5, "vd": 64.2}));
    assert_eq!((&all[0]["semi_diameter"], &all[1]["thickness"]), (&json!(10.0), &json!(1.0)));
    assert_eq!(
        (&all[1]["conic"], &all[1]["aspheric"]),
        (&json!(-0.5), &json!({"4": 1e-6, "6": -2e-9}))
    );
    assert_eq!((&all[2]["type"], &all[2]["stop"]), (&json!("aperture"), &json!(true)));
    assert_eq!(all[3]["glass"], json!({"n": 1.6}));
    let f_number = |lens: &ZemaxLens| {
        let train = build(lens);
        train.paraxial(train.wavelength()).unwrap().f_number.unwrap()
    };
    assert!((f_number(&lens) - 4.0).abs() < 1e-9);
    let notes = lens.notes.join("\n");
    for word in ["of 2 configurations, number 1", "no Abbe number", "[notes]", "Image Height"] {
        assert!(notes.contains(word), "{word}: {notes}");
    }
    let second = try_at(format, ZOOM, Some(2)).unwrap();
    assert_eq!(elements(&second)[1]["thickness"], 3.0);
    assert!((f_number(&second) - 5.0).abs() < 1e-9);
    assert_eq!(second.file.field_angles(), [0.0, 10.5, 15.0]);
    let error = try_at(format, ZOOM, Some(3)).unwrap_err();
    assert!(error.contains("no configuration 3: the file has 2"), "{error}");
    // A near object: the stop keeps the diameter of its row.
    let near = read(format, &ZOOM.replace("Infinity\nd2", "500\nd2"));
    assert!(near.notes.iter().any(|note| note.contains("near object")), "{:?}", near.notes);
    assert_eq!(elements(&near)[2]["radius"], 4.5);
}

#[test]
fn aspheres_of_photons_to_photos_have_powers_by_the_constants() {
    let with = |constant: &str| {
        let text = ZOOM.replace("[constants]\n", &format!("[constants]\n{constant}\n"));
        elements(&read(
            LensFormat::PhotonsToPhotos,
            &text.replace("1e-6\t-2e-9", "1e-6\t-2e-9\t3e-12"),
        ))[1]["aspheric"]
            .clone()
    };
    assert_eq!(with("AsphericalA2"), json!({"2": 1e-6, "4": -2e-9, "6": 3e-12}));
    assert_eq!(with("AsphericalOddCount\t0"), json!({"4": 1e-6, "6": -2e-9, "8": 3e-12}));
    assert_eq!(with("AsphericalOddCount\t1"), json!({"3": 1e-6, "4": -2e-9, "6": 3e-12}));
    assert_eq!(with("AsphericalOddCount\t2"), json!({"3": 1e-6, "4": -2e-9, "5": 3e-12}));
}

#[test]
fn tables_of_photons_to_photos_that_are_broken_are_refused_by_line() {
    for (from, to, words) in [
        ("1\t50\t4", "1\tx\t4", vec!["line 13", "radius `x`", "AS"]),
        ("2\t-50\td2", "2\t-50\td9", vec!["line 14", "`d9`", "[variable distances]"]),
        ("d2\t1\t3", "d2\t1\tx", vec![]),
        ("d2\t1\t3", "d2\tx\t3", vec!["line 10", "d2", "`x`"]),
        ("2\t-50\t-0.5\t1e-6", "9\t-50\t-0.5\t1e-6", vec!["line 21", "no surface `9`"]),
        ("1e-6\t-2e-9", "1e-6\tz", vec!["line 21", "`z`"]),
        (
            "[constants]\n",
            "[constants]\nAsphericalOddCount\tx\n",
            vec!["AsphericalOddCount", "whole"],
        ),
        ("[descriptive data]\n", "", vec!["line 1", "section"]),
        ("5\t-60\t1\t\t18", "5\t-60", vec!["line 17", "cut short"]),
        ("\t20\t64.2\n2", "\t-20\t64.2\n2", vec!["line 13", "diameter"]),
    ] {
        let text = ZOOM.replace(from, to);
        assert_ne!(text, ZOOM, "{from}");
        if words.is_empty() {
            read(LensFormat::PhotonsToPhotos, &text);
        } else {
            refused(LensFormat::PhotonsToPhotos, &text, &words);
        }
    }
    refused(LensFormat::PhotonsToPhotos, "[lens data]\n", &["[lens data]", "cut short"]);
}

/// A lens of optiland of one surface's text before a plain back.
fn optiland(front: &str, more: &str) -> String {
    let cs = |z: &str| {
        format!(
            r#"{{"x": 0.0, "y": 0.0, "z": {z}, "rx": 0.0, "ry": 0.0, "rz": 0.0, "reference_cs": null}}"#
        )
    };
    let air = r#"{"type": "IdealMaterial", "index": 1.0, "absorp": 0.0}"#;
    format!(
        r#"{{"version": 1.0, "name": "ours", {more} "surface_group": {{"surfaces": [
        {{"type": "ObjectSurface", "geometry": {{"type": "Plane", "cs": {}, "radius": Infinity}}, "material_post": {air}}},
        {{"type": "Surface", "is_stop": true, {}}},
        {{"type": "Surface", "geometry": {{"type": "StandardGeometry", "cs": {}, "radius": -50.0, "conic": 0.0}}, "material_post": {air}}},
        {{"type": "Surface", "geometry": {{"type": "Plane", "cs": {}, "radius": Infinity}}, "material_post": {air}}}]}}}}"#,
        cs("-Infinity"),
        front.replace("CS", &cs("0.0")),
        cs("4.0"),
        cs("50.0")
    )
}

const SYSTEM: &str = r#""aperture": {"type": "EPD", "value": 10}, "fields": {"fields": [{"x": 0, "y": 0}, {"x": 0, "y": 7}],
    "field_definition": {"field_type": "AngleField"}}, "wavelengths": {"wavelengths": [{"value": 0.48, "unit": "um", "weight": 2},
    {"value": 0.55, "is_primary": true, "unit": "um"}]}, "pickups": [], "#;

const FRONT_OF_OPTILAND: &str = r#""geometry": {"type": "StandardGeometry", "cs": CS, "radius": 50.0, "conic": -0.5},
    "material_post": {"type": "Material", "name": "SK16", "reference": "schott"},
    "aperture": {"type": "RadialAperture", "r_max": 9.0, "r_min": 0.0}"#;

#[test]
fn a_lens_of_optiland_is_read_with_its_system() {
    let lens = read(LensFormat::Optiland, &optiland(FRONT_OF_OPTILAND, SYSTEM));
    assert_eq!((lens.file.name.as_str(), lens.file.source.as_str()), ("ours", "an optiland file"));
    assert_eq!(
        (lens.file.field_angles().as_slice(), lens.file.wavelengths_nm().as_slice()),
        (&[0.0, 7.0][..], &[550.0, 480.0][..])
    );
    let all = elements(&lens);
    assert_eq!(
        (&all[0]["curvature"], &all[0]["conic"], &all[0]["thickness"]),
        (&json!(0.02), &json!(-0.5), &json!(4.0))
    );
    assert!(all[0]["glass"].as_str().unwrap().ends_with("SK16"), "{}", all[0]);
    assert_eq!(all[1]["thickness"], 46.0);
    let train = build(&lens);
    assert!((train.paraxial(550.0).unwrap().entrance_pupil.diameter.unwrap() - 10.0).abs() < 1e-12);
    // As versions before 0.3 wrote fields.
    let older = SYSTEM
        .replace(r#""field_definition": {"field_type": "AngleField"}"#, r#""field_type": "angle""#);
    assert_eq!(read(LensFormat::Optiland, &optiland(FRONT_OF_OPTILAND, &older)), lens);
    let other =
        SYSTEM.replace(r#"{"type": "EPD", "value": 10}"#, r#"{"type": "imageFNO", "value": 6}"#);
    let train = build(&read(LensFormat::Optiland, &optiland(FRONT_OF_OPTILAND, &other)));
    assert!((train.paraxial(550.0).unwrap().f_number.unwrap() - 6.0).abs() < 1e-9);
}

#[test]
fn lenses_of_optiland_that_are_broken_are_refused_by_surface() {
    let front = |from: &str, to: &str| {
        let text = FRONT_OF_OPTILAND.replace(from, to);
        assert_ne!(text, FRONT_OF_OPTILAND, "{from}");
        optiland(&text, SYSTEM)
    };
    let place = "surface_group.surfaces[1]";
    for (from, to, word) in [
        ("StandardGeometry", "NurbsGeometry", "NurbsGeometry"),
        ("StandardGeometry", "BiconicGeometry", "BiconicGeometry"),
        ("50.0", "\"a\"", "radius"),
        ("-0.5", "NaN", "conic"),
        ("\"Material\"", "\"MaterialFile\"", "MaterialFile"),
        ("SK16", "NOGLASS", "NOGLASS"),
        ("RadialAperture", "PolygonAperture", "PolygonAperture"),
        ("\"r_min\": 0.0", "\"r_min\": 9.5", "r_min"),
        (
            "\"aperture\"",
            "\"interaction_model\": {\"type\": \"DiffractiveModel\"}, \"aperture\"",
            "DiffractiveModel",
        ),
        (
            "\"aperture\"",
            "\"interaction_model\": {\"coating\": {\"type\": \"SimpleCoating\"}}, \"aperture\"",
            "coating",
        ),
    ] {
        refused(LensFormat::Optiland, &front(from, to), &[place, word]);
    }
    let system = |from: &str, to: &str| optiland(FRONT_OF_OPTILAND, &SYSTEM.replace(from, to));
    refused(LensFormat::Optiland, &system("EPD", "XPD"), &["aperture.type", "XPD"]);
    refused(LensFormat::Optiland, &system("AngleField", "OddField"), &["fields", "OddField"]);
    refused(LensFormat::Optiland, &system("0.48", "-1"), &["wavelengths.wavelengths[0].value"]);
    refused(LensFormat::Optiland, r#"{"surface_group": {}}"#, &["surface_group.surfaces", "list"]);
    refused(LensFormat::Optiland, "{\"surface_group\": \n", &["line 2", "broken JSON"]);
    refused(LensFormat::Optiland, r#"{"surface_group": {"surfaces": []}}"#, &["0 surfaces"]);
}

#[test]
fn files_are_known_by_ending_and_content() {
    let of = |name: &str, text: &str| LensFormat::of(std::path::Path::new(name), text.as_bytes());
    assert_eq!(of("a.LEN", ""), Some(LensFormat::Oslo));
    assert_eq!(of("a.dat", ""), Some(LensFormat::Pbrt));
    assert_eq!(of("a.zmx", ""), Some(LensFormat::Zemax));
    assert_eq!(of("a.seq", ""), Some(LensFormat::CodeV));
    assert_eq!(of("a.txt", ZOOM), Some(LensFormat::PhotonsToPhotos));
    assert_eq!(of("a.txt", "notes"), None);
    assert_eq!(of("a.json", &optiland(FRONT_OF_OPTILAND, SYSTEM)), Some(LensFormat::Optiland));
    assert_eq!(of("a.json", r#"{"surfaces": []}"#), Some(LensFormat::Iset));
    assert_eq!(of("a.json", r#"{"elements": [], "surfaces": []}"#), None);
    assert_eq!(of("a.json", r#"{"etendue": 1, "camera": {}}"#), None);
}
