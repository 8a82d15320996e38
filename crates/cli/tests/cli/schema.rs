//! The committed JSON Schema, by a validator that is not ours: an editor that knows it marks what the program
//! refuses, and nothing else.

use std::fs;
use std::path::{Path, PathBuf};

use boon::{Compiler, SchemaIndex, Schemas};
use serde_json::Value;

use crate::generated::root;
use crate::run::{Bench, text};

struct Validator {
    schemas: Schemas,
    index: SchemaIndex,
}

impl Validator {
    fn of(kind: &str) -> Self {
        Self::of_part(kind, "")
    }

    /// That of one definition, by its pointer.
    fn of_part(kind: &str, pointer: &str) -> Self {
        let path = root().join(format!("schema/{kind}.schema.json"));
        let (mut schemas, mut compiler) = (Schemas::new(), Compiler::new());
        let index =
            compiler.compile(&format!("{}{pointer}", path.to_str().expect("UTF-8")), &mut schemas);
        Self { index: index.unwrap_or_else(|error| panic!("{kind}: {error}")), schemas }
    }

    fn validate(&self, value: &Value) -> Result<(), String> {
        self.schemas.validate(value, self.index).map_err(|error| format!("{error:#}"))
    }
}

/// The JSON files below `folder`.
fn files(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files(&path, into);
        } else if path.extension().is_some_and(|end| end == "json") {
            into.push(path);
        }
    }
}

#[test]
fn example_files_name_their_schema_and_satisfy_it() {
    let kinds = ["scene", "lens"].map(|kind| (kind, Validator::of(kind)));
    let parts = ["CameraSpec", "SensorSpec"]
        .map(|part| Validator::of_part("scene", &format!("#/$defs/{part}")));
    let mut paths = Vec::new();
    files(&root().join("scenes"), &mut paths);
    assert!(paths.len() > 30, "{} files", paths.len());
    for path in paths {
        let value: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
        // Cameras and sensors in files of their own are parts of scenes.
        if value["etendue"].is_null() && value["elements"].is_null() {
            let part = &parts[usize::from(value["pose"].is_null())];
            part.validate(&value).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            continue;
        }
        let (kind, validator) = &kinds[usize::from(value["etendue"].is_null())];
        validator.validate(&value).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let named = value["$schema"].as_str().unwrap_or_default();
        let named = path.parent().unwrap().join(named).canonicalize().ok();
        let wanted = root().join(format!("schema/{kind}.schema.json")).canonicalize().ok();
        assert_eq!(named, wanted, "{}", path.display());
    }
}

#[test]
fn what_the_schema_forbids_the_program_refuses_and_the_reverse() {
    let validator = Validator::of("scene");
    let objects = r#""objects": [{"shape": "box"}]"#;
    for (is_valid, rest) in [
        (true, r#""etendue": 1"#),
        (true, r#""etendue": 1, "camera": {"type": "pinhole", "fov": "0.5 rad"}"#),
        (true, r#""etendue": 1, "camera": {"type": "pinhole", "sensor": {"resolution": "8x6"}}"#),
        (true, r#""etendue": 1, "render": {"exposure": "auto", "comment": ["a", "b"]}"#),
        (true, r#""etendue": 1, "layers": ["depth", "ids"], "tracer": {"type": "path"}"#),
        (false, ""),
        (false, r#""etendue": 2"#),
        (false, r#""etendue": 1, "colour": "red""#),
        (false, r#""etendue": 1, "camera": {"fov": 30}"#),
        (false, r#""etendue": 1, "camera": {"type": "pinhole", "fow": 30}"#),
        (false, r#""etendue": 1, "camera": {"type": "pinhole", "sensor": {"resolution": [8]}}"#),
        (false, r#""etendue": 1, "layers": ["dept"]"#),
        (false, r#""etendue": 1, "render": {"samples": -1}"#),
        (false, r#""etendue": 1, "render": {"exposure": "bright"}"#),
        (false, r#""etendue": 1, "materials": {"m": {"type": "matte", "color": "red"}}"#),
        // Light by wavelength.
        (
            true,
            r#""etendue": 1, "lights": [{"type": "point", "at": [0, 2, 0], "intensity": {"illuminant": "a"}, "lumens": 800}]"#,
        ),
        (
            true,
            r#""etendue": 1, "materials": {"m": {"type": "emissive", "radiance": {"line": 555}, "luminance": 250}}"#,
        ),
        (
            true,
            r#""etendue": 1, "materials": {"m": {"type": "emissive", "radiance": {"checker": [{"line": 555}, [1, 1, 1]]}}}"#,
        ),
        (
            false,
            r#""etendue": 1, "lights": [{"type": "point", "at": [0, 2, 0], "intensity": [1, 1, 1], "lumens": -1}]"#,
        ),
        (
            false,
            r#""etendue": 1, "lights": [{"type": "directional", "direction": [0, -1, 0], "irradiance": [1, 1, 1], "lumens": 1}]"#,
        ),
        (
            false,
            r#""etendue": 1, "lights": [{"type": "environment", "image": {"cube": "a.hdr", "wrap": "repeat"}}]"#,
        ),
        (false, r#""etendue": 1, "lights": [{"type": "environment", "image": 5}]"#),
    ] {
        let comma = if rest.is_empty() { "" } else { ", " };
        let scene = format!("{{{rest}{comma}{objects}}}");
        let found = validator.validate(&serde_json::from_str(&scene).expect("JSON"));
        assert_eq!(found.is_ok(), is_valid, "the schema of {scene}: {found:?}");
        let output = Bench::with_scene(&scene).run(&["check", "scene.json"]);
        assert_eq!(output.status.success(), is_valid, "{scene}: {}", text(&output.stderr));
    }
}

#[test]
fn what_the_schemas_of_lenses_and_rays_forbid_the_program_refuses_and_the_reverse() {
    let bench = Bench::new();
    let lens = r#"{"elements": [
        {"type": "aperture", "shape": "circular", "radius": 2, "thickness": 1, "stop": true},
        {"type": "surface", "radius": 50, "thickness": 5, "glass": "N-BK7", "semi_diameter": 4},
        {"type": "surface", "radius": -50, "semi_diameter": 4}]}"#;
    let held = |validator: &Validator, (is_valid, file): (bool, &str), arguments: &[&str]| {
        let found = validator.validate(&serde_json::from_str(file).expect("JSON"));
        assert_eq!(found.is_ok(), is_valid, "the schema of {file}: {found:?}");
        let output = bench.run(arguments);
        assert_eq!(output.status.success(), is_valid, "{file}: {}", text(&output.stderr));
    };
    let validator = Validator::of("lens");
    for (is_valid, from, to) in [
        (true, "", ""),
        (true, r#""glass": "N-BK7""#, r#""glass": {"nd": 1.5168, "vd": 64.17}"#),
        (true, r#""thickness": 5"#, r#""thickness": "5 mm""#),
        (true, r#"{"elements""#, r#"{"comment": "a remark", "elements""#),
        (false, "elements", "parts"),
        (false, r#""semi_diameter": 4}]"#, r#""semi_diameter": 4, "colour": "red"}]"#),
        (false, r#""type": "aperture""#, r#""type": "hole""#),
        (false, r#""radius": 50"#, r#""radius": [50]"#),
        (false, r#""stop": true"#, r#""stop": 1"#),
    ] {
        let changed = lens.replace(from, to);
        assert!(from.is_empty() || changed != lens, "{from}");
        let changed = if from.is_empty() { lens.to_owned() } else { changed };
        bench.write("lens.json", changed.as_bytes());
        held(&validator, (is_valid, &changed), &["lens", "lens.json"]);
    }
    bench.write("lens.json", lens.as_bytes());
    let validator = Validator::of("rays");
    let ray = r#"{"from": "object", "clip": true, "rays": [
        {"origin": [0, 1, -10], "direction": [0, 0, 1], "wavelength": 550}]}"#;
    for (is_valid, from, to) in [
        (true, "object", "sensor"),
        (true, "[0, 0, 1]", "[0, 0, 3]"),
        (false, "object", "image"),
        (false, r#""clip": true, "#, ""),
        (false, "[0, 1, -10]", "[0, 1]"),
        (false, r#", "wavelength": 550"#, ""),
        (false, "550", r#""green""#),
        (false, "wavelength", "colour"),
    ] {
        let changed = ray.replace(from, to);
        assert!(changed != ray, "{from}");
        bench.write("rays.json", changed.as_bytes());
        held(
            &validator,
            (is_valid, &changed),
            &["lens", "lens.json", "--rays", "rays.json", "--json"],
        );
    }
}
