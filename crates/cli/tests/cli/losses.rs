//! Losses of files: what they clip, saturate or show black is told, from the shares on that the limits page names.

use serde_json::{Value, json};

use crate::run::{Bench, text};

/// Walls of given radiance side by side, before an orthographic camera of 16 by 16 pixels that each wall
/// covers whole columns of: `(columns, radiance)` from the left. Where there is no wall there are misses.
fn walls(columns: &[(u32, f64)], scene: Value) -> Bench {
    let mut all = json!({
        "etendue": 1,
        "camera": {"type": "orthographic", "height": 16, "sensor": {"resolution": [16, 16]},
                   "pose": {"from": [0, 0, 2], "look_at": [0, 0, 0]}},
        "tracer": {"type": "direct"}, "objects": [], "materials": {},
    });
    let mut left = -8.0;
    for (i, &(columns, radiance)) in columns.iter().enumerate() {
        let width = f64::from(columns);
        let name = format!("wall {i}");
        all["materials"][&name] = match radiance {
            0.0 => json!({"type": "matte", "color": [0, 0, 0]}),
            r => json!({"type": "emissive", "radiance": [r, r, r]}),
        };
        all["objects"].as_array_mut().expect("a list").push(json!({
            "shape": "rectangle", "width": width, "height": 16, "material": name,
            "transform": {"translate": [left + 0.5 * width, 0, 0]},
        }));
        left += width;
    }
    for (key, value) in scene.as_object().expect("an object") {
        all[key] = value.clone();
    }
    Bench::with_scene(&all.to_string())
}

/// The notes of a render, which stand in the report and on standard error alike.
fn notes(bench: &Bench, more: &[&str]) -> Vec<String> {
    let fixed = ["render", "scene.json", "-o", "out", "--samples", "1", "--report", "report.json"];
    let output = bench.run(&[&fixed[..], more].concat());
    let said = text(&output.stderr);
    assert!(output.status.success(), "{said}");
    let report = bench.json("report.json");
    let notes = report["notes"].as_array().expect("a list").iter();
    let notes: Vec<String> = notes.map(|note| note.as_str().expect("words").to_owned()).collect();
    for note in &notes {
        assert!(said.contains(note.as_str()), "{note} in {said}");
    }
    notes
}

/// The one note with `word`, if any.
fn about<'a>(notes: &'a [String], word: &str) -> Option<&'a str> {
    let mut found = notes.iter().filter(|note| note.contains(word));
    let first = found.next();
    assert!(found.next().is_none(), "{word} twice in {notes:?}");
    first.map(String::as_str)
}

#[test]
fn depth_beyond_what_sixteen_bits_hold_is_told() {
    // TUM's depth ends at 13.107 m, KITTI's at 255.996 m.
    let sphere = |distance: f64| {
        let scene = json!({
            "etendue": 1, "layers": ["depth"],
            "camera": {"type": "pinhole", "fov": 20, "sensor": {"resolution": [16, 16]},
                       "pose": {"from": [0, 0, distance + 1.0], "look_at": [0, 0, 0]}},
            "objects": [{"shape": "sphere", "radius": 1.0}],
        });
        Bench::with_scene(&scene.to_string())
    };
    for (distance, outputs, told) in [
        (10.0, "tum,kitti", None),
        (20.0, "tum,kitti", Some("depth.tum.png: 100 % of the hits")),
        (250.0, "kitti", None),
        (400.0, "kitti", Some("depth.kitti.png: 100 % of the hits")),
    ] {
        let bench = sphere(distance);
        let fov = format!("camera.fov={}", 400.0 / distance);
        let notes = notes(&bench, &["--outputs", outputs, "--set", &fov]);
        let found = about(&notes, "of the hits are outside");
        assert_eq!(found.is_some(), told.is_some(), "{distance}: {notes:?}");
        let told = told.unwrap_or_default();
        assert!(found.unwrap_or_default().starts_with(told), "{distance}: {notes:?}");
    }
}

#[test]
fn a_share_of_the_hits_is_clipped_from_a_tenth_and_black_from_three_tenths() {
    let none = json!({"lights": []});
    // Of 16 columns: 1 of them is 6 %, 2 are 13 %; 4 are 25 %, 5 are 31 %. Misses are not counted.
    for (columns, word, told) in [
        (&[(1, 3.0), (15, 0.5)][..], "is clipped", None),
        (&[(2, 3.0), (14, 0.5)], "is clipped", Some("12.5 %")),
        (&[(1, 3.0), (7, 0.5)], "is clipped", Some("12.5 %")),
        (&[(4, 1e-4), (12, 0.5)], "is black", None),
        (&[(5, 1e-4), (11, 0.5)], "is black", Some("31.2 %")),
        (&[(2, 1e-4), (4, 0.5)], "is black", Some("33.3 %")),
        (&[(4, 0.5)], "is black", None),
        (&[(4, 0.0), (12, 0.5)], "sends no light", None),
        (&[(5, 0.0), (11, 0.5)], "sends no light", Some("31.2 %")),
    ] {
        let notes = notes(&walls(columns, none.clone()), &[]);
        let found = about(&notes, word);
        assert_eq!(found.is_some(), told.is_some(), "{columns:?}: {notes:?}");
        assert!(found.unwrap_or_default().contains(told.unwrap_or_default()), "{notes:?}");
        if word == "sends no light" && told.is_some() {
            assert!(found.is_some_and(|note| note.contains("leave out the key `lights`")));
        }
    }
    // Both at once, and the previews of layers beside the picture.
    let scene = json!({"lights": [], "layers": ["direct"]});
    let notes = notes(&walls(&[(8, 3.0), (8, 1e-4)], scene), &[]);
    for word in
        ["picture: 50.0 % of what the camera sees is clipped", "is black", "direct.preview.png"]
    {
        assert!(about(&notes, word).is_some(), "{word}: {notes:?}");
    }
}

#[test]
fn a_sensor_tells_what_share_of_its_pixels_is_lost() {
    // In `digital` radiometry light of 1 is full scale: 3 saturates, and 1e-6 is far below a DN of 12 bits.
    let sensor = json!({"type": "raw", "resolution": [16, 16], "bit_depth": 12, "noise": "none",
                        "radiometry": "digital", "exposure": 0.01, "frames": 2});
    let camera = json!({"type": "orthographic", "height": 16, "sensor": sensor,
                        "pose": {"from": [0, 0, 2], "look_at": [0, 0, 0]}});
    let scene = json!({"lights": [], "camera": camera});
    for (columns, word, told) in [
        (&[(1, 3.0), (15, 0.5)][..], "of the pixels are saturated", None),
        (&[(2, 3.0), (14, 0.5)], "of the pixels are saturated", Some("12.5 %")),
        (&[(15, 3.0), (1, 0.5)], "of the pixels are saturated", Some("93.8 %")),
        (&[(4, 1e-6), (12, 0.5)], "of the pixels that light falls on are black", None),
        (&[(5, 1e-6), (11, 0.5)], "of the pixels that light falls on are black", Some("31.2 %")),
        (&[(2, 0.5)], "are black", None),
    ] {
        // Both frames say the same.
        let notes = notes(&walls(columns, scene.clone()), &[]);
        let found = about(&notes, word);
        assert_eq!(found.is_some(), told.is_some(), "{columns:?}: {notes:?}");
        assert!(found.unwrap_or_default().contains(told.unwrap_or_default()), "{notes:?}");
    }
}

#[test]
fn the_studio_lights_what_is_half_black() {
    // Grey walls that no lamp shines on, beside a screen that shines away from them.
    for (dark, studio) in [(8, false), (9, true)] {
        let mut scene = json!({"materials": {"grey": {"type": "matte", "color": [0.5, 0.5, 0.5]}}});
        let bench = walls(&[(16 - dark, 0.5)], json!({}));
        let all: Value = bench.json("scene.json");
        scene["materials"]["wall 0"] = all["materials"]["wall 0"].clone();
        let screen = all["objects"][0].clone();
        let wall = json!({"shape": "rectangle", "width": dark, "height": 16, "material": "grey",
                          "transform": {"translate": [8.0 - 0.5 * f64::from(dark), 0, 0]}});
        scene["objects"] = json!([screen, wall]);
        let notes = notes(&walls(&[], scene), &[]);
        assert_eq!(about(&notes, "a grey studio").is_some(), studio, "{dark}: {notes:?}");
    }
}

#[test]
fn a_closed_room_gets_one_note_on_the_studio_and_none_that_asks_for_it() {
    // The camera stands in a cube, which nothing gets into.
    let scene = json!({
        "etendue": 1, "tracer": {"type": "path"},
        "camera": {"type": "pinhole", "fov": 60, "pose": {"from": [0, 0, 0], "look_at": [0, 0, 1]},
                   "sensor": {"resolution": [8, 8]}},
        "objects": [{"shape": "box", "size": [4, 4, 4]}],
    });
    let notes = notes(&Bench::with_scene(&scene.to_string()), &[]);
    assert!(about(&notes, "lit by a grey studio").is_some(), "{notes:?}");
    let black = about(&notes, "sends no light at all").expect("that it is black");
    assert!(black.contains("stand within it") && !black.contains("leave out"), "{black}");
}
