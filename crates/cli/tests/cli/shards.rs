//! Renders that are divided over processes, and renders that are killed: their files are those of one
//! undisturbed process, to the bit.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::json;

use crate::run::{Bench, text, under};

/// Light through a lens that disperses onto a sensor with noise, and data beside it.
fn scene() -> Bench {
    let surface = |radius: f64, glass: &str| json!({ "type": "surface", "radius": radius, "thickness": 2, "glass": glass, "semi_diameter": 4 });
    let bench = Bench::with_scene(
        &json!({
            "etendue": 1,
            "tracer": { "type": "path" },
            "layers": ["depth", "normal", "ids"],
            "camera": {
                "type": "lens", "lens": "lens.json", "focus_distance": "2 m", "sensor_height": "4 mm",
                "pose": { "from": [0, 0, 2], "look_at": [0, 0, 0] },
                "sensor": { "type": "raw", "cfa": "rggb", "resolution": [40, 70], "read_noise": 2, "system_gain": 0.5,
                    "exposure": "10 ms" }
            },
            "objects": [
                { "shape": "sphere", "radius": 0.4, "material": "paint" },
                { "shape": "box", "size": [0.3, 0.3, 0.3], "transform": { "translate": [0.3, 0.3, 0] } },
                { "shape": "rectangle", "width": 9, "height": 9, "transform": { "translate": [0, 0, -1] } }
            ],
            "materials": { "paint": { "type": "matte", "color": [0.8, 0.4, 0.2] } },
            "render": { "samples": 40, "seed": 5 }
        })
        .to_string(),
    );
    let last = json!({ "type": "surface", "radius": -30, "thickness": 1, "semi_diameter": 4 });
    let stop = json!({ "type": "aperture", "shape": "circular", "radius": 2, "thickness": 1, "stop": true });
    let elements = json!({ "elements": [surface(30.0, "N-BK7"), last, stop] });
    bench.write("lens.json", elements.to_string().as_bytes());
    bench
}

/// All files of a folder.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries =
        std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry"));
    entries
        .map(|entry| {
            let bytes = std::fs::read(entry.path()).expect("a file");
            (entry.file_name().to_string_lossy().into_owned(), bytes)
        })
        .collect()
}

fn assert_same(bench: &Bench, one: &str, other: &str) {
    let (one, other) = (files(&bench.path(one)), files(&bench.path(other)));
    let names = |files: &BTreeMap<String, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&one), names(&other));
    assert!(one.len() > 8, "{:?}", names(&one));
    // The manifest tells when files were written.
    for (name, bytes) in one.iter().filter(|(name, _)| *name != "etendue-manifest.json") {
        assert!(bytes == &other[name], "{name} differs");
    }
}

/// Runs a command that must succeed.
fn done(bench: &Bench, arguments: &[&str]) {
    let output = bench.run(arguments);
    assert!(output.status.success(), "{}", text(&output.stderr));
}

/// Renders share `number` of `count` into `shares`.
fn share(bench: &Bench, number: u32, count: u32, more: &[&str]) -> String {
    let shard = format!("{number}/{count}");
    let arguments = ["render", "scene.json", "-o", "shares", "--quiet", "--shard", &shard];
    done(bench, &[&arguments, more].concat());
    format!("shares/shard-{number}-of-{count}.film")
}

/// Message of a merge that must be refused.
fn refused(bench: &Bench, shares: &[&str]) -> String {
    let message = bench.refusal(&[&["merge", "merged"], shares].concat());
    assert!(!bench.path("merged").exists(), "nothing is written");
    message
}

#[test]
fn shares_make_the_files_of_one_machine() {
    let bench = scene();
    bench.render(&[]);
    let shares: Vec<String> =
        [3, 1, 2].map(|number| share(&bench, number, 3, &["--threads", "1"])).into();
    let shares: Vec<&str> = shares.iter().map(String::as_str).collect();
    let arguments = [&["merge", "merged", "--report", "report.json"], shares.as_slice()].concat();
    done(&bench, &arguments);
    assert_same(&bench, "out", "merged");
    done(&bench, &["render", "scene.json", "-o", "out", "--report", "whole.json"]);
    let (merged, whole) = (bench.json("report.json"), bench.json("whole.json"));
    for key in ["image_hash", "scene_hash", "samples", "rays", "lens_rays", "lens_losses"] {
        assert_eq!(merged[key], whole[key], "{key}");
    }
}

/// Sums are merged as exactly as two f64 hold them, so that what is left of the order in which they were added
/// is far below the f32 of the picture: here all files are the same, in whatever order the shares are given.
#[test]
fn shares_of_the_samples_make_the_picture_of_one_machine() {
    let bench = scene();
    bench.render(&[]);
    let by_samples = ["--shard-by", "samples"];
    for number in [3, 1, 2] {
        share(&bench, number, 3, &by_samples);
    }
    let [first, second, third] =
        [1, 2, 3].map(|number| format!("shares/samples-{number}-of-3.film"));
    let size = |path: &str| std::fs::metadata(bench.path(path)).expect("a share").len();
    assert!(size(&first) > size(&second), "data layers are in the first share alone");
    insta::assert_snapshot!(refused(&bench, &[&first, &third]), @r#"
    note: lights: nothing in the scene shines: it is lit by a grey studio; name `lights` in the scene for others, or `"lights": []` for none
    error: 2 of 3 shares are here; missing: 2/3
    hint: render them first
    "#);
    let of_rows = share(&bench, 2, 3, &[]);
    insta::assert_snapshot!(refused(&bench, &[&first, &of_rows, &third]), @r#"
    note: lights: nothing in the scene shines: it is lit by a grey studio; name `lights` in the scene for others, or `"lights": []` for none
    error: shares/shard-2-of-3.film: is a share of the rows, and shares/samples-1-of-3.film is one of the samples
    "#);
    done(&bench, &["merge", "merged", "--report", "report.json", &third, &first, &second]);
    assert_same(&bench, "out", "merged");
    done(&bench, &["render", "scene.json", "-o", "out", "--report", "whole.json"]);
    let (merged, whole) = (bench.json("report.json"), bench.json("whole.json"));
    for key in ["image_hash", "samples", "rays", "lens_rays", "lens_losses"] {
        assert_eq!(merged[key], whole[key], "{key}");
    }
}

/// Settings are those of the shares; the scene may have been moved.
#[test]
fn a_merge_asks_for_what_its_shares_were_asked_for() {
    let bench = scene();
    let more = ["--samples", "4", "--set", "camera.sensor.resolution=[24,20]", "--outputs", "npy"];
    let shares = [1, 2].map(|number| share(&bench, number, 2, &more));
    bench.render(&more);
    std::fs::create_dir(bench.path("moved")).expect("a folder");
    for name in ["scene.json", "lens.json"] {
        std::fs::rename(bench.path(name), bench.path("moved").join(name)).expect("a file");
    }
    let shares = shares.each_ref().map(String::as_str);
    insta::assert_snapshot!(refused(&bench, &shares), @"
    error: FOLDER/scene.json: the shares are of this scene, which is not here
    hint: say by --scene where it is
    ");
    done(&bench, &["merge", "merged", "--scene", "moved/scene.json", shares[0], shares[1]]);
    assert_same(&bench, "out", "merged");
}

#[test]
fn shares_that_are_missing_doubled_or_foreign_are_refused_by_name() {
    let bench = scene();
    let few = ["--samples", "2"];
    let [first, second] = [1, 2].map(|number| share(&bench, number, 2, &few));
    insta::assert_snapshot!(refused(&bench, &[&first]), @r#"
    note: lights: nothing in the scene shines: it is lit by a grey studio; name `lights` in the scene for others, or `"lights": []` for none
    error: 1 of 2 shares are here; missing: 2/2
    hint: render them first
    "#);
    insta::assert_snapshot!(refused(&bench, &[&first, &second, &first]), @r#"
    note: lights: nothing in the scene shines: it is lit by a grey studio; name `lights` in the scene for others, or `"lights": []` for none
    error: shares/shard-1-of-2.film: is share 1/2, as shares/shard-1-of-2.film is
    hint: give each once
    "#);
    let third = share(&bench, 1, 3, &few);
    insta::assert_snapshot!(refused(&bench, &[&first, &third]), @r#"
    note: lights: nothing in the scene shines: it is lit by a grey studio; name `lights` in the scene for others, or `"lights": []` for none
    error: shares/shard-1-of-3.film: is share 1/3, and shares/shard-1-of-2.film is one of 2
    "#);
    let foreign = Bench::new();
    std::fs::copy(bench.path(&second), foreign.path("second.film")).expect("a copy");
    for (setting, word) in [("render.seed=9", "seed"), ("camera.f_number=8", "scene hash")] {
        share(&bench, 2, 2, &["--samples", "2", "--set", setting]);
        // It tells both hashes, or seeds.
        let said = refused(&bench, &[&first, &second]);
        assert!(said.contains(&second) && said.contains(word), "{said}");
    }
    std::fs::copy(foreign.path("second.film"), bench.path(&second)).expect("a copy");
    done(&bench, &["merge", "merged", "--quiet", &first, &second]);
}

#[test]
fn files_that_are_no_whole_shares_are_refused() {
    let bench = scene();
    let [first, second] = [1, 2].map(|number| share(&bench, number, 2, &["--samples", "2"]));
    let whole = std::fs::read(bench.path(&second)).expect("a share");
    let mut turned = whole.clone();
    turned[whole.len() / 2] ^= 1;
    let files: [(&str, &[u8]); 5] = [
        ("empty", b""),
        ("of another kind", b"PNG and other bytes"),
        ("without its last byte", &whole[..whole.len() - 1]),
        ("its first 15 bytes", &whole[..15]),
        ("with a bit turned", &turned),
    ];
    let messages = files.map(|(what, bytes)| {
        bench.write(&second, bytes);
        under(what, &refused(&bench, &[&first, &second]))
    });
    insta::assert_snapshot!(messages.concat());
    insta::assert_snapshot!(refused(&bench, &[&first, "nowhere.film"]), @"error: nowhere.film: No such file or directory (os error 2)");
    bench.write(&second, &whole);
    done(&bench, &["merge", "merged", "--quiet", &first, &second]);
}

#[test]
fn shares_of_what_cannot_be_divided_are_refused() {
    let bench = scene();
    let adaptive = "render.samples={\"relative_error\": 0.5}";
    let commands: [&[&str]; 6] = [
        &["--shard", "0/4"],
        &["--shard", "5/4"],
        &["--shard", "1/2", "--report", "r.json"],
        &["--shard-by", "samples"],
        &["--shard", "1/2", "--shard-by", "samples", "--set", adaptive],
        &["--shard", "1/2", "--set", "frames=[{\"render.seed\": 1}]"],
    ];
    let messages = commands.map(|more| {
        let arguments = [&["render", "scene.json", "-o", "shares"], more].concat();
        under(&more.join(" "), &bench.refusal(&arguments))
    });
    insta::assert_snapshot!(messages.concat());
}

/// More shares than strips of rows: the others are empty.
#[test]
fn empty_shares_are_shares() {
    let bench = scene();
    let more = ["--samples", "1", "--set", "camera.sensor.resolution=[8,20]"];
    bench.render(&more);
    let shares: Vec<String> = (1..=5).map(|number| share(&bench, number, 5, &more)).collect();
    let shares: Vec<&str> = shares.iter().map(String::as_str).collect();
    done(&bench, &[&["merge", "merged"], shares.as_slice()].concat());
    assert_same(&bench, "out", "merged");
    // And more than samples.
    let more = [more.as_slice(), &["--shard-by", "samples"]].concat();
    (1..=3).for_each(|number| drop(share(&bench, number, 3, &more)));
    let shares = [1, 2, 3].map(|number| format!("shares/samples-{number}-of-3.film"));
    done(&bench, &["merge", "merged", &shares[0], &shares[1], &shares[2]]);
    assert_same(&bench, "out", "merged");
}

/// SIGKILL at twenty moments, each a while after something more was kept.
#[test]
fn a_render_that_is_killed_goes_on_where_it_was() {
    let bench = scene();
    let pinhole = r#"camera={"type": "pinhole", "pose": {"from": [0, 0, 2], "look_at": [0, 0, 0]},
        "sensor": {"type": "raw", "resolution": [16, 40], "read_noise": 2, "system_gain": 0.5}}"#;
    let more = ["--set", pinhole, "--samples", "2000"];
    let ends = ["--threads", "1", "--checkpoint", "0.001"];
    let arguments = [&["render", "scene.json", "-o", "out", "--quiet"], &more[..], &ends].concat();
    let file = bench.path("out/checkpoint.film");
    let kept = || file.metadata().and_then(|data| data.modified()).ok();
    let mut kills = 0;
    for moment in 0..20 {
        let before = kept();
        let mut command = Command::new(env!("CARGO_BIN_EXE_etendue"));
        let command = command.args(&arguments).current_dir(bench.path(""));
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("runs");
        while kept() == before && child.try_wait().expect("a child").is_none() {
            std::thread::sleep(Duration::from_millis(1));
        }
        std::thread::sleep(Duration::from_millis(17 * moment % 60));
        child.kill().expect("a child");
        kills += u32::from(!child.wait().expect("a child").success());
    }
    assert!(kills >= 10, "{kills} of 20 were killed");
    done(&bench, &arguments);
    assert!(!file.exists(), "it has served");
    let whole = [&["render", "scene.json", "-o", "whole", "--quiet"], &more[..]].concat();
    done(&bench, &whole);
    assert_same(&bench, "whole", "out");
}

#[test]
fn a_checkpoint_of_another_render_is_refused() {
    let bench = scene();
    let [first, kept] =
        [share(&bench, 1, 2, &["--samples", "2"]), "out/checkpoint.film".to_owned()];
    std::fs::create_dir(bench.path("out")).expect("a folder");
    std::fs::copy(bench.path(&first), bench.path(&kept)).expect("a copy");
    let output = bench.run(&["render", "scene.json", "-o", "out", "--checkpoint"]);
    assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));
    let said = text(&output.stderr);
    assert!(said.contains("checkpoint.film") && said.contains("another render"), "{said}");
    assert!(said.contains("remove it"), "{said}");
}
