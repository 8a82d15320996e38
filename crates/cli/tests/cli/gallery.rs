//! The page of pictures: its commands run, on small pictures, and leave the files that it shows.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::run::{Bench, text};

/// The page, and the folder that its commands are given in; `None` where the tests stand without them.
fn page() -> Option<(String, PathBuf)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let Ok(page) = fs::read_to_string(root.join("docs/guide/gallery.md")) else {
        println!("skipped: there is no docs/guide/gallery.md beside the sources");
        return None;
    };
    Some((page, root))
}

/// The page's commands, without the word `etendue`.
fn commands(page: &str) -> Vec<&str> {
    let blocks = page.split("```sh\n").skip(1).filter_map(|rest| rest.split("```").next());
    blocks.flat_map(str::lines).filter_map(|line| line.strip_prefix("etendue ")).collect()
}

/// Comments of a kind, `TARGET = SOURCE`, by their two sides.
fn comments<'a>(page: &'a str, kind: &str) -> Vec<(&'a str, &'a str)> {
    let opening = format!("<!-- {kind}: ");
    let found = page.split(&*opening).skip(1).filter_map(|rest| rest.split(" -->").next());
    found.map(|comment| comment.split_once(" = ").expect("TARGET = SOURCE")).collect()
}

/// Copies a folder, its scenes with few pixels and few triangles.
fn copy_small(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let (path, copy) = {
            let entry = entry.unwrap();
            (entry.path(), to.join(entry.file_name()))
        };
        if path.is_dir() {
            copy_small(&path, &copy);
            continue;
        }
        fs::copy(&path, &copy).unwrap();
        let written =
            fs::read_to_string(&path).ok().and_then(|text| serde_json::from_str(&text).ok());
        if let Some(mut written @ Value::Object(_)) = written {
            if written["etendue"] == 1 {
                shrink(&mut written);
            } else if written["pose"].is_object() {
                shrink_camera(&mut written);
            }
            fs::write(&copy, written.to_string()).unwrap();
        }
    }
}

fn shrink_camera(camera: &mut Value) {
    // Behind exaggerated lenslets a few have to be whole.
    let size = if camera["microlenses"].is_null() { [24, 18] } else { [72, 54] };
    camera["sensor"]["resolution"] = json!(size);
    // The page has one command that asks for waves, which stays as it is.
    if camera["diffraction"] == true {
        camera["diffraction"] = json!(false);
    }
}

fn shrink(scene: &mut Value) {
    // A camera may stand in a file of its own.
    if scene["camera"].is_object() {
        shrink_camera(&mut scene["camera"]);
    }
    scene["render"]["samples"] = json!(1);
    for object in scene["objects"].as_array_mut().into_iter().flatten() {
        if object["triangles"].as_u64().is_some_and(|count| count > 2000) {
            object["triangles"] = json!(2000);
        }
    }
}

/// The scenes, few pixels of each, in a folder of their own.
fn small(root: &Path) -> Bench {
    let bench = Bench::new();
    copy_small(&root.join("scenes"), &bench.path("scenes"));
    bench
}

/// Apart from their pictures, so that the two share no test's time: whatever asks for a lens' pupil looks for it anew.
#[test]
fn scenes_of_the_gallery_check() {
    let Some((page, root)) = page() else { return };
    let bench = small(&root);
    let rendered = commands(&page).into_iter().filter_map(|command| {
        command.strip_prefix("render ").and_then(|rest| rest.split_whitespace().next())
    });
    let scenes: BTreeSet<&str> = rendered.collect();
    assert!(scenes.len() > 20, "only {scenes:?} were found");
    for scene in scenes {
        let check = bench.run(&["check", scene]);
        assert!(check.status.success(), "{scene}: {}", text(&check.stderr));
    }
}

#[test]
fn pictures_of_the_gallery_render_small() {
    let Some((page, root)) = page() else { return };
    let bench = small(&root);
    let mut rendered = 0;
    for command in commands(&page) {
        // What the picture is without its noise is for tests that have the library.
        let command = command.replace(" --denoise", "").replace("/denoised.npy", "/picture.npy");
        let mut arguments: Vec<&str> = command.split_whitespace().collect();
        if let Some(at) = arguments.iter().position(|word| *word == "--samples") {
            arguments.drain(at..at + 2);
        }
        if !["render", "expose"].contains(&arguments[0]) {
            continue;
        }
        let render = bench.run(&[&*arguments, &["--quiet"]].concat());
        assert!(render.status.success(), "{command}: {}", text(&render.stderr));
        rendered += 1;
    }
    assert!(rendered > 20, "only {rendered} were found");
    let kinds = ["picture", "bands", "refocus"];
    for (shown, source) in kinds.into_iter().flat_map(|kind| comments(&page, kind)) {
        let file = source.split_whitespace().next().unwrap();
        // Benchmarks are not run here.
        let is_there = file.starts_with("bench/") || bench.path("out/gallery").join(file).exists();
        assert!(is_there, "no command leaves {file}");
        assert!(page.contains(&format!("]({shown})")), "{shown} is not shown");
        assert!(
            root.join("docs/guide").join(shown).exists(),
            "docs/guide/{shown} is missing: make gallery"
        );
    }
}

#[test]
fn every_figure_and_every_scene_of_the_gallery_is_on_its_page() {
    let Some((page, root)) = page() else { return };
    let commands = commands(&page).join("\n");
    for folder in ["paper", "gallery"] {
        for entry in fs::read_dir(root.join("scenes").join(folder)).unwrap() {
            let name = entry.unwrap().file_name().to_string_lossy().into_owned();
            let is_scene = name.ends_with(".json");
            let scene = format!("scenes/{folder}/{name} ");
            assert!(!is_scene || commands.contains(&scene), "no command renders {scene}");
        }
    }
}

#[test]
fn a_dozen_pictures_of_the_gallery_are_large() {
    let Some((page, root)) = page() else { return };
    let large = comments(&page, "picture").into_iter().filter(|(shown, _)| {
        let path = root.join("docs/guide").join(shown);
        image::image_dimensions(&path).is_ok_and(|(width, _)| width >= 1280)
    });
    let large: Vec<_> = large.map(|(shown, _)| shown).collect();
    assert!(large.len() >= 12, "1280 pixels and wider: {large:?}");
}
