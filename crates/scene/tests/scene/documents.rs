//! Tests that the documents' JSON is understood, and that what they link to is there.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use etendue_optics::train::remove_notes;
use etendue_scene::import::Wanted;
use etendue_scene::{LoadOptions, SceneFile};
use serde_json::{Value, json};

/// The documents that people write, with their text; `None` where the tests stand without them.
fn documents() -> Option<Vec<(PathBuf, String)>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut paths: Vec<PathBuf> =
        ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"].map(|name| root.join(name)).to_vec();
    if !root.join("docs").exists() {
        println!("skipped: there is no folder docs beside the sources");
        return None;
    }
    files_below(&root.join("docs"), &mut paths);
    paths.retain(|path| path.extension().is_some_and(|end| end == "md"));
    for crates in ["crates", "sys"] {
        let mut found = Vec::new();
        files_below(&root.join(crates), &mut found);
        paths.extend(found.into_iter().filter(|path| path.ends_with("README.md")));
    }
    paths.sort();
    Some(paths.into_iter().map(|path| (path.clone(), fs::read_to_string(&path).unwrap())).collect())
}

/// Adds the files below a folder, at any depth, without those that builds and tests leave.
fn files_below(folder: &Path, paths: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_file() {
            paths.push(path);
        } else if path.is_dir() && !matches!(&*name, "target" | "out" | ".git") {
            files_below(&path, paths);
        }
    }
}

/// The blocks of JSON of a document.
fn blocks(text: &str) -> impl Iterator<Item = &str> {
    text.split("```json\n").skip(1).filter_map(|rest| rest.split("```").next())
}

/// Lines outside of code.
fn prose(text: &str) -> String {
    let parts = text.split("```").step_by(2);
    parts.collect()
}

/// A heading's name in links, as GitHub makes it.
fn anchor(heading: &str) -> String {
    // Of a link only its words count.
    let words = heading.replace("](", "\u{0}").split(['[', ']']).collect::<String>();
    let words = words.split('\u{0}').next().unwrap_or_default().trim().to_lowercase();
    let kept = words.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

#[test]
fn scenes_and_lenses_in_the_documents_load() {
    let Some(documents) = documents() else { return };
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("model.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let mut loaded = 0;
    for (document, text) in documents {
        // A file that stands for any.
        let text = text.replace("model.glb", "model.obj");
        for (number, block) in blocks(&text).enumerate() {
            let at = format!("{}, block {number}", document.display());
            // Some show what the program writes, shortened.
            let Ok(value) = serde_json::from_str::<Value>(block) else { continue };
            let scene = match value {
                Value::Object(ref keys) if keys.contains_key("etendue") => value,
                Value::Object(ref keys) if keys.contains_key("elements") => {
                    json!({ "etendue": 1, "camera": { "type": "lens", "lens": value, "fov": 10 } })
                }
                _ => continue,
            };
            let path = folder.path().join("scene.json");
            fs::write(&path, scene.to_string()).unwrap();
            let file = SceneFile::read(&path, &[]).unwrap_or_else(|error| panic!("{at}: {error}"));
            let scene = file.load(Wanted::EVERYTHING, &LoadOptions::default());
            scene.unwrap_or_else(|error| panic!("{at}: {error}"));
            loaded += 1;
        }
    }
    assert!(loaded >= 15, "only {loaded} were found");
}

#[test]
fn the_first_scene_of_the_readme_is_the_file() {
    let Some(documents) = documents() else { return };
    let readme = documents.iter().find(|(path, _)| path.ends_with("README.md")).unwrap();
    let shown: Value = serde_json::from_str(blocks(&readme.1).next().unwrap()).unwrap();
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/first-light.json");
    let mut file: Value = serde_json::from_str(&fs::read_to_string(file).unwrap()).unwrap();
    // The schema's address holds in the file's folder alone.
    remove_notes(&mut file);
    assert_eq!(shown, file);
}

#[test]
fn links_lead_somewhere() {
    let Some(documents) = documents() else { return };
    let headings = |text: &str| -> BTreeSet<String> {
        let prose = prose(text);
        let lines = prose.lines().filter(|line| line.starts_with('#'));
        lines.map(|line| anchor(line.trim_start_matches('#'))).collect()
    };
    for (document, text) in &documents {
        let folder = document.parent().unwrap();
        for link in prose(text).split("](").skip(1) {
            let link = link.split(')').next().unwrap();
            if link.contains("://") {
                continue;
            }
            let (file, heading) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() { document.clone() } else { folder.join(file) };
            assert!(target.exists(), "{}: no {link}", document.display());
            let known = heading.is_empty()
                || headings(&fs::read_to_string(target).unwrap()).contains(heading);
            assert!(known, "{}: no heading {link}", document.display());
        }
    }
}

/// The pages that a user reads are bounded: the pages of guides, how-tos and explanations, and the
/// README. Words are those between blanks; blocks of code and rows of tables are not counted, nor
/// are reference, measurements and development.
#[test]
fn the_pages_that_a_user_reads_are_few_and_short() {
    let Some(documents) = documents() else { return };
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let kinds = ["docs/guide", "docs/how-to", "docs/explanation"].map(|kind| root.join(kind));
    let is_read = |path: &Path| {
        path == root.join("README.md") || kinds.iter().any(|kind| path.starts_with(kind))
    };
    let pages: Vec<_> = documents.iter().filter(|(path, _)| is_read(path)).collect();
    let words = |text: &str| -> usize {
        let text = prose(text);
        let lines = text.lines().filter(|line| !line.trim_start().starts_with('|'));
        lines.map(|line| line.split_whitespace().count()).sum()
    };
    let counts = pages.iter().map(|(path, text)| (path.file_name().unwrap(), words(text)));
    let counts: Vec<_> = counts.collect();
    let sum: usize = counts.iter().map(|(_, count)| count).sum();
    assert!((6..=12).contains(&counts.len()), "{counts:?}");
    assert!((5_000..=25_000).contains(&sum), "{sum}: {counts:?}");
    // Each page of the documents is of one kind, and the README leads to it, or to its folder.
    let (_, readme) = documents.iter().find(|(path, _)| *path == root.join("README.md")).unwrap();
    for (path, _) in documents.iter().filter(|(path, _)| path.starts_with(root.join("docs"))) {
        let name = path.strip_prefix(&root).unwrap().to_string_lossy().into_owned();
        assert!(readme.contains(&format!("]({name})")), "README.md does not lead to {name}");
    }
}

/// Comments, messages, scripts and the Makefile name documents by their paths in the repository.
#[test]
fn documents_that_the_sources_name_are_there() {
    if documents().is_none() {
        return;
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut files = vec![root.join("Makefile"), root.join("CONTRIBUTING.md")];
    for folder in ["benches", "crates", "scenes", "schema", "scripts", "sys", "tests", "examples"] {
        files_below(&root.join(folder), &mut files);
    }
    let is_text = |path: &PathBuf| {
        let end = path.extension().unwrap_or_default().to_string_lossy().into_owned();
        path.ends_with("Makefile") || ["rs", "py", "sh", "md", "json", "toml"].contains(&&*end)
    };
    let is_path = |c: char| c.is_alphanumeric() || matches!(c, '/' | '-' | '_' | '.');
    let mut named = 0;
    for file in files.iter().filter(|path| is_text(path)) {
        let text = fs::read_to_string(file).unwrap_or_default();
        for (at, _) in text.match_indices("docs/") {
            // Of another place, as in an address, or pieced together from parts.
            let before = text[..at].chars().next_back();
            let rest = &text[at..];
            let path = &rest[..rest.find(|c| !is_path(c)).unwrap_or(rest.len())];
            let path = path.trim_end_matches('.');
            let is_whole = [".md", ".png", ".svg"].iter().any(|end| path.ends_with(end));
            if !is_whole || before.is_some_and(|c| is_path(c) && c != '/') {
                continue;
            }
            assert!(root.join(path).exists(), "{}: no {path}", file.display());
            named += 1;
        }
    }
    assert!(named > 60, "only {named} were found");
}

#[test]
fn the_map_of_the_tree_names_files_that_are_there() {
    let Some(documents) = documents() else { return };
    let (_, map) = documents.iter().find(|(path, _)| path.ends_with("architecture.md")).unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let code = map.split('`').skip(1).step_by(2);
    let paths: Vec<&str> =
        code.filter(|name| name.contains("/src/") || name.contains("/tests/")).collect();
    assert!(paths.len() > 40, "{paths:?}");
    for path in paths {
        let found = [root.join("crates").join(path), root.join(path)].iter().any(|p| p.exists());
        assert!(found, "docs/development/architecture.md: no {path}");
    }
}

/// A name in brackets behind a file in the table "To add a …" stands in that file.
#[test]
fn the_table_of_additions_names_what_its_files_have() {
    let Some(documents) = documents() else { return };
    let (_, map) = documents.iter().find(|(path, _)| path.ends_with("architecture.md")).unwrap();
    let table = map.split("## To add a").nth(1).unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let is_name = |word: &str| word.chars().all(|c| c.is_alphanumeric() || matches!(c, '_' | ':'));
    let mut names = 0;
    for file in table.split('`').skip(1).step_by(2).filter(|code| code.ends_with(".rs")) {
        let path = [root.join("crates").join(file), root.join(file)];
        let Some(path) = path.iter().find(|path| path.exists()) else { continue };
        let text = fs::read_to_string(path).unwrap();
        for behind in table.split(&format!("`{file}` (")).skip(1) {
            let brackets = behind.split(')').next().unwrap_or_default();
            for name in brackets.split('`').skip(1).step_by(2).filter(|name| is_name(name)) {
                let last = name.rsplit("::").next().unwrap_or_default();
                assert!(
                    text.contains(last),
                    "docs/development/architecture.md: no {name} in {file}"
                );
                names += 1;
            }
        }
    }
    assert!(names >= 50, "only {names} names were found");
}
