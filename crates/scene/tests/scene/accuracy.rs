//! Numbers that trade accuracy for speed: their limits, their rows in the plan, and what contradicts them.

use std::path::Path;

use etendue_camera::LensAccuracy;
use etendue_report::DecisionKind;
use etendue_scene::file::{AccuracySetting, AccuracySpec, SceneFile};
use etendue_scene::{LoadOptions, Note, NoteKind, Scene, Wanted};
use serde_json::{Value, json};

fn read(scene: Value) -> Result<AccuracySpec, String> {
    let opener = LoadOptions::default().opener;
    let file = SceneFile::from_json(&opener, Path::new("."), scene);
    file.map(|file| file.spec.accuracy).map_err(|error| error.to_string())
}

#[test]
fn every_setting_lies_within_its_limits_and_is_refused_beyond_them() {
    for AccuracySetting { name, path, default, range: [least, most], .. } in
        AccuracySpec::default().settings()
    {
        assert!(least <= default && default <= most, "{name}");
        let set = |value: f64| {
            // Whole numbers as the format writes them.
            let value: Value = serde_json::from_str(&value.to_string()).unwrap();
            read(json!({ "accuracy": { name: value } }))
        };
        for value in [least, most] {
            let found = set(value).unwrap();
            let own = found.settings().into_iter().find(|own| own.name == name).unwrap();
            assert_eq!(own.value, value, "{name}");
        }
        for value in [least - 1.0, 2.0 * most + 1.0] {
            let error = set(value).unwrap_err();
            assert!(error.contains(path), "{error}");
        }
    }
    assert!(read(json!({ "accuracy": { "pathnoise": 1 } })).unwrap_err().contains("path_noise"));
}

#[test]
fn what_is_set_is_a_row_of_the_plan_and_nothing_else_is() {
    assert_eq!(AccuracySpec::default().decisions(), []);
    let spec = AccuracySpec { view_psnr: 40.0, ..AccuracySpec::default() };
    let [row] = &spec.decisions()[..] else { panic!("one row") };
    assert_eq!((row.kind, row.key), (DecisionKind::Accuracy, Some("accuracy.view_psnr")));
    assert!(row.is_forced && row.reason.ends_with("43 by itself"), "{}", row.reason);
}

#[test]
fn what_the_scene_says_elsewhere_is_contradicted_by_name() {
    let precision =
        json!({ "accuracy": { "path_noise": 1 }, "plan": { "light_precision": "double" } });
    let error = read(precision).unwrap_err();
    assert!(error.contains("accuracy.path_noise") && error.contains("light_precision"), "{error}");
    let bands = json!({ "from": 400, "to": 700, "count": 6 });
    let sensor = |kind: &str| {
        let sensor = json!({ "type": kind, "resolution": [4, 4], "bands": bands });
        json!({ "accuracy": { "band_error": 0.01 }, "camera": { "type": "pinhole", "sensor": sensor } })
    };
    let error = read(sensor("raw")).unwrap_err();
    assert!(error.contains("accuracy.band_error") && error.contains("`bands`"), "{error}");
    // A multispectral sensor's bands are its channels, which are divided further.
    assert!(read(sensor("multispectral")).is_ok());
    let shared =
        json!({ "accuracy": { "band_place_error": 0.1 }, "plan": { "shared_paths": false } });
    let error = read(shared).unwrap_err();
    assert!(
        error.contains("accuracy.band_place_error") && error.contains("`plan.shared_paths`"),
        "{error}"
    );
    let points =
        json!({ "accuracy": { "texture_lookups": 16 }, "plan": { "texture_filter": false } });
    let error = read(points).unwrap_err();
    assert!(
        error.contains("accuracy.texture_lookups") && error.contains("`plan.texture_filter`"),
        "{error}"
    );
}

#[test]
fn a_lens_is_measured_as_the_scene_says() {
    let scene = json!({
        "accuracy": { "pupil_margin": 0.01, "pupil_checks": 2048, "wavefront_error": 0.01, "fit_places": 9,
                      "band_place_error": 0.1 },
        "camera": { "type": "thin_lens", "focal_length": 50, "f_number": 2, "focus_distance": 2,
                    "sensor_height": 24, "pose": { "from": [0, 0, 2], "look_at": [0, 0, 0] },
                    "sensor": { "resolution": [8, 8] } },
        "objects": [{ "shape": "sphere" }],
    });
    let options = LoadOptions::default();
    let file = SceneFile::from_json(&options.opener, Path::new("."), scene).unwrap();
    let scene = file.load(Wanted::NOTHING, &options).unwrap();
    let mut expected = LensAccuracy::DEFAULT;
    (expected.pupil.margin, expected.pupil.checks) = (0.01, 2048);
    (expected.waves.error, expected.fit_places, expected.sharing.places) = (0.01, 9, 0.1);
    assert_eq!(scene.camera.lens().unwrap().accuracy(), expected);
}

/// All numbers as they are by themselves, for a scene to write.
fn all_as_they_are() -> Value {
    let written = |setting: &AccuracySetting| {
        let value: Value = serde_json::from_str(&setting.default.to_string()).unwrap();
        (setting.name.to_owned(), value)
    };
    Value::Object(AccuracySpec::default().settings().iter().map(written).collect())
}

/// The scene of a ball that writes all numbers, loaded with the keys of `more`.
fn loaded(more: Value) -> Result<Scene, String> {
    let mut scene = json!({ "accuracy": all_as_they_are(), "objects": [{ "shape": "sphere" }] });
    scene.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    let options = LoadOptions::default();
    let file = SceneFile::from_json(&options.opener, Path::new("."), scene);
    let loaded = file.and_then(|file| file.load(Wanted::EVERYTHING, &options));
    loaded.map_err(|error| error.to_string())
}

/// The numbers that are noted as deciding nothing.
fn idle_in(scene: &Scene) -> Vec<String> {
    let own = scene.notes.iter().filter(|note| note.message.starts_with("decides nothing here: "));
    let name = |note: &Note| {
        assert_eq!(note.kind, NoteKind::Unused);
        let name = note.subject.strip_prefix("`accuracy.").and_then(|it| it.strip_suffix('`'));
        name.expect("a key of `accuracy`").to_owned()
    };
    own.map(name).collect()
}

fn pose() -> Value {
    json!({ "from": [0, 0, 2], "look_at": [0, 0, 0] })
}

/// A lens of glass behind an opening of six blades, which is not round: its pupil is measured all over the sensor.
fn bladed_lens() -> Value {
    json!({ "type": "lens", "focus_distance": 2, "sensor_height": 6, "pose": pose(), "sensor": { "resolution": [4, 4] },
        "lens": { "elements": [
            { "type": "surface", "radius": 30, "thickness": 2, "glass": "N-BK7", "semi_diameter": 4 },
            { "type": "surface", "radius": -30, "thickness": 1, "semi_diameter": 4 },
            { "type": "aperture", "shape": "polygon", "radius": 2, "blades": 6, "thickness": 1, "stop": true }] } })
}

#[test]
fn refused_numbers_have_a_hint_with_their_range_and_what_they_are_by_themselves() {
    for AccuracySetting { name, path, default, range: [_, most], .. } in
        AccuracySpec::default().settings()
    {
        for wrong in [json!(2.0 * most + 1.5), json!("much"), json!(null), json!([1])] {
            let error = read(json!({ "accuracy": { name: wrong } })).unwrap_err();
            let (why, hint) = error.split_once("\nhint: give a ").expect("a hint");
            assert!(why.contains(&format!("{path}: ")), "{error}");
            assert!(
                hint.contains("number from ") && hint.contains(&format!(" to {most}")),
                "{error}"
            );
            assert!(hint.ends_with(&format!("or leave it out for {default}")), "{error}");
        }
    }
}

/// Beside what decides by itself a number is refused even as it is by itself: it is written, and decides nothing.
#[test]
fn a_number_is_contradicted_whatever_it_is() {
    let bands = json!({ "from": 400, "to": 700, "count": 6 });
    let sensor = json!({ "type": "raw", "resolution": [4, 4], "bands": bands });
    let camera = json!({ "type": "pinhole", "sensor": sensor });
    let cases = [
        ("band_error", json!({ "camera": camera }), "`bands` of the camera's sensor"),
        ("band_place_error", json!({ "plan": { "shared_paths": false } }), "`plan.shared_paths`"),
        ("band_share_error", json!({ "plan": { "dispersion": false } }), "`plan.dispersion`"),
        ("texture_lookups", json!({ "plan": { "textures": false } }), "`plan.textures`"),
        (
            "texture_lookups",
            json!({ "plan": { "texture_filter": false } }),
            "`plan.texture_filter`",
        ),
        ("path_probes", json!({ "plan": { "light_precision": "single" } }), "\"single\""),
    ];
    let all = all_as_they_are();
    for (name, mut scene, what) in cases {
        scene["accuracy"] = json!({ name: all[name] });
        let error = read(scene.clone()).unwrap_err();
        let begins = format!("accuracy.{name}: contradicts ");
        assert!(error.contains(&begins) && error.contains(what), "{error}");
        assert!(error.ends_with("\nhint: leave one of them out"), "{error}");
        scene["accuracy"] = json!({});
        assert!(read(scene).is_ok(), "{name}");
    }
}

#[test]
fn numbers_of_what_a_scene_lacks_are_noted() {
    let scene = loaded(json!({ "layers": ["depth"] })).unwrap();
    let idle = idle_in(&scene);
    // Whether there are mattes, no scene says.
    for AccuracySetting { name, .. } in AccuracySpec::default().settings() {
        assert_eq!(idle.iter().any(|it| it == name), name != "matte_samples", "{name}");
    }
    // What nobody writes is not noted.
    let silent = loaded(json!({ "layers": ["depth"], "accuracy": {} })).unwrap();
    assert_eq!(idle_in(&silent), Vec::<String>::new());
}

#[test]
fn numbers_of_what_a_scene_has_are_not_noted() {
    let path = json!({ "type": "path" });
    let clear_sky = json!([{ "type": "sky" }]);
    let glass = json!({ "glass": { "type": "dielectric", "ior": "N-BK7" } });
    let physical = json!({ "type": "pinhole", "sensor": { "type": "raw", "resolution": [4, 4], "radiometry": "physical",
        "system_gain": 0.5, "exposure": 0.01 } });
    let waves = json!({ "type": "thin_lens", "focal_length": 50, "f_number": 2, "focus_distance": 2, "sensor_height": 24,
        "diffraction": true, "pose": pose(), "sensor": { "resolution": [4, 4] } });
    let field = json!({ "type": "light_field", "focal_length": 20, "f_number": 4, "focus_distance": 0.5,
        "microlenses": { "pitch": 0.1 }, "pose": pose(), "sensor": { "resolution": [240, 180], "pixel_pitch": 8 } });
    let tolerance = json!({ "displacement": "0.5 px", "light": "2 %" });
    let cases: [(Value, &[&str]); 7] = [
        (
            json!({ "tracer": path, "lights": clear_sky, "render": { "accel": "embree" } }),
            &["roulette_after", "sky_rows", "path_noise", "path_contact"],
        ),
        (json!({ "tracer": path, "materials": glass }), &["dispersion_paths"]),
        (json!({ "tracer": path, "camera": physical }), &["band_error"]),
        (
            json!({ "tracer": path, "render": { "samples": { "until": "sensor-noise" } } }),
            &["sample_sigmas", "sample_growth", "sample_floor", "sample_error"],
        ),
        (
            json!({ "tracer": path, "camera": waves }),
            &["wavefront_error", "defocus_step", "spread_nodes", "fit_places"],
        ),
        (
            json!({ "tracer": path, "camera": bladed_lens(), "tolerance": tolerance }),
            &[
                "pupil_margin",
                "pupil_planar_intervals",
                "image_circle_error",
                "band_place_error",
                "tolerance_rays",
                "tolerance_samples",
            ],
        ),
        (
            json!({ "tracer": path, "camera": field }),
            &["view_psnr", "white_samples", "lenslet_nodes", "lenslet_checks"],
        ),
    ];
    for (more, names) in cases {
        let idle = idle_in(&loaded(more.clone()).unwrap());
        for name in names {
            assert!(!idle.iter().any(|it| it == name), "{name} of {more}");
        }
        assert!(idle.iter().any(|name| name == "deformation_error"), "{more}");
    }
}

/// The plan says it of those that it lists, too.
#[test]
fn a_row_of_the_plan_says_that_its_number_decides_nothing() {
    let scene = |camera: Value| {
        loaded(
            json!({ "accuracy": { "pupil_margin": 0.01 }, "camera": camera, "layers": ["depth"] }),
        )
        .unwrap()
    };
    let reason = |scene: &Scene| scene.accuracy_decisions()[0].reason.clone();
    let pinhole = scene(json!({ "type": "pinhole", "pose": pose() }));
    let (idle, own) = (reason(&pinhole), reason(&scene(bladed_lens())));
    assert!(
        idle.ends_with("0.004 by itself; decides nothing here: the camera has no lens"),
        "{idle}"
    );
    assert!(own.ends_with("0.004 by itself"), "{own}");
}

/// Rays of all bands that go through the lens together share nothing, unless its filters tell them apart.
#[test]
fn paths_are_not_shared_where_all_bands_are_one() {
    let plan = json!({ "dispersion": false, "shared_paths": true });
    let through =
        |camera: &Value| loaded(json!({ "accuracy": {}, "camera": camera, "plan": plan }));
    let mut lens = bladed_lens();
    for camera in [&lens, &json!({ "type": "pinhole", "pose": pose() })] {
        let error = through(camera).unwrap_err();
        assert!(error.contains("plan.shared_paths: contradicts `dispersion` false"), "{error}");
        assert!(error.ends_with("\nhint: leave one of them out"), "{error}");
    }
    let filter = json!({ "type": "filter", "transmission": [[400, 0.1], [700, 0.9]] });
    lens["lens"]["elements"].as_array_mut().unwrap().push(filter);
    assert!(through(&lens).is_ok(), "{:?}", through(&lens).err());
}
