//! docs/measurements/limits.md: its list of unsafe code is the tree's.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The Rust files below a folder.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry")) {
        let path = entry.path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
    found
}

/// True if a line has unsafe code, and not only words on it.
fn is_unsafe(line: &str) -> bool {
    let code = line.split("//").next().unwrap_or_default();
    ["unsafe {", "unsafe fn", "unsafe impl", "unsafe extern"].iter().any(|word| code.contains(word))
}

#[test]
fn every_file_with_unsafe_code_stands_on_the_page() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let crates = fs::read_dir(root.join("crates")).expect("the crates");
    let crates = crates.map(|entry| entry.expect("an entry").path().join("src"));
    let found: BTreeSet<String> = crates
        .chain(["sys/src", "sys/oidn/src", "benches/src"].map(|folder| root.join(folder)))
        .flat_map(|folder| sources(&folder))
        .filter(|path| fs::read_to_string(path).expect("a source").lines().any(is_unsafe))
        .map(|path| path.strip_prefix(&root).expect("in the tree").display().to_string())
        .collect();
    let page = fs::read_to_string(root.join("docs/measurements/limits.md")).expect("the page");
    let (_, list) = page.split_once("## Unsafe code").expect("the section");
    let listed = list.split('`').filter(|word| word.ends_with(".rs")).map(str::to_owned);
    assert_eq!(found, listed.collect());
}
