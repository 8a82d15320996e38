//! Files of the repository that the program writes: they are as it writes them. `make generated` runs these
//! tests with `ETENDUE_GENERATE=1`, which writes the files in place of comparing them.

mod keys;
mod layers;
mod presets;

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::run::{Bench, text};

/// The repository, where the tests stand in it.
pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The command's standard output, in lines of 100 columns.
fn output(arguments: &[&str]) -> String {
    let output = Bench::new().run_in(arguments, &[("COLUMNS", "100")]);
    assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

/// Holds the file `name` of the repository against what it is to be, or writes it.
fn hold(name: &str, wanted: &str) {
    let path = root().join(name);
    if std::env::var_os("ETENDUE_GENERATE").is_some() {
        fs::create_dir_all(path.parent().expect("a folder")).expect("a writable folder");
        fs::write(&path, wanted).expect("a writable file");
        return;
    }
    let found = fs::read_to_string(&path).unwrap_or_default();
    let differs = found.lines().zip(wanted.lines()).position(|(found, wanted)| found != wanted);
    let line = differs.unwrap_or_else(|| found.lines().count().min(wanted.lines().count())) + 1;
    assert!(found == wanted, "{name}:{line} is not what the program writes; run `make generated`");
}

/// The page `name` with `lines` between the marks of its `part`.
fn with_part(name: &str, part: &str, lines: &str) -> String {
    let page = fs::read_to_string(root().join(name)).expect("the page");
    let [begin, end] = ["begin", "end"].map(|side| format!("<!-- {part} {side} -->\n"));
    let (before, rest) = page.split_once(&begin).expect("a mark where the part begins");
    let (_, after) = rest.split_once(&end).expect("a mark where the part ends");
    format!("{before}{begin}{lines}{end}{after}")
}

fn schema(of: &str) -> Value {
    serde_json::from_str(&output(&["schema", of])).expect("JSON")
}

#[test]
fn schemas_are_those_of_the_program() {
    for of in ["scene", "lens", "rays"] {
        hold(&format!("schema/{of}.schema.json"), &output(&["schema", of]));
    }
}

#[test]
fn the_page_of_keys_is_that_of_the_schemas() {
    let [scene, lens, rays] = ["scene", "lens", "rays"].map(schema);
    hold("docs/reference/keys.md", &keys::page(&scene, &lens, &rays));
}

#[test]
fn the_table_of_presets_is_that_of_the_program() {
    let cards: Vec<Value> = serde_json::from_str(&output(&["sensor", "--json"])).expect("JSON");
    let page = "docs/reference/sensors.md";
    hold(page, &with_part(page, "presets", &presets::table(&cards)));
}

#[test]
fn the_table_of_layers_is_that_of_the_program() {
    let page = "docs/reference/outputs.md";
    hold(page, &with_part(page, "layers", &layers::table()));
}

/// The commands that `etendue --help` lists.
fn commands(help: &str) -> Vec<String> {
    let lines = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let lines = lines.take_while(|line| !line.is_empty());
    // What goes on in the next line is indented farther.
    let names = lines.filter_map(|line| line.strip_prefix("  "));
    let names = names.filter_map(|line| line.split(' ').next()).filter(|name| !name.is_empty());
    names.filter(|name| *name != "help").map(str::to_owned).collect()
}

#[test]
fn the_page_of_the_command_line_is_the_help_of_all_commands() {
    let help = output(&["--help"]);
    let mut page = format!(
        "# The command line\n\nWhat `etendue --help` and `etendue COMMAND --help` print. `etendue man DIR` writes \
         it as man pages, and `etendue\ncompletions SHELL` prints what completes it in a shell; `make install` \
         installs both. Written by `make generated`.\n\n```text\n{help}```\n"
    );
    let commands = commands(&help);
    assert!(commands.len() >= 11 && commands.iter().any(|name| name == "man"), "{commands:?}");
    for command in commands {
        let help = output(&[&command, "--help"]);
        page.push_str(&format!("\n## `etendue {command}`\n\n```text\n{help}```\n"));
    }
    // Trailing blanks of clap's empty lines.
    let lines: Vec<&str> = page.lines().map(str::trim_end).collect();
    hold("docs/reference/command-line.md", &(lines.join("\n") + "\n"));
}
