//! `docs/development/validation.md`: the files and the tests that it names exist.

use std::fs;

use crate::generated::root;

/// Words in backticks.
fn code(cell: &str) -> Vec<&str> {
    cell.split('`').skip(1).step_by(2).collect()
}

#[test]
fn every_effect_has_its_files_and_its_test() {
    let page = fs::read_to_string(root().join("docs/development/validation.md")).expect("the page");
    let crates = root().join("crates");
    let mut effects = 0;
    for row in page.lines().filter(|line| line.starts_with("| ") && line.contains('`')) {
        let cells: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
        let [effect, implementation, _, test, held] = cells[..] else { panic!("{row}") };
        assert!(!held.is_empty(), "{effect}: held to nothing");
        let files = code(implementation);
        assert!(!files.is_empty(), "{effect}: no file");
        for file in files {
            assert!(crates.join(file).exists(), "{effect}: there is no crates/{file}");
        }
        let [file, name] = code(test)[..] else { panic!("{effect}: no test in {test}") };
        let text = fs::read_to_string(crates.join(file));
        let text = text.unwrap_or_else(|error| panic!("{effect}: crates/{file}: {error}"));
        let is_test = text.split("#[test]").skip(1).any(|after| {
            after.split_once("fn ").is_some_and(|(_, named)| named.starts_with(&format!("{name}(")))
        });
        assert!(is_test, "{effect}: crates/{file} has no test {name}");
        effects += 1;
    }
    assert!(effects > 35, "{effects} effects");
}
