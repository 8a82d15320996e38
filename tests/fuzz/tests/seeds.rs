//! All seeds within the limits, and the layout of `fuzz/`.
#![allow(clippy::disallowed_methods, reason = "tests set their stage by hand")]

use std::path::Path;
use std::process::Command;

use etendue_fuzz::targets::TARGETS;

#[test]
fn every_seed_is_read_within_its_limits() {
    let output = Command::new(env!("CARGO_BIN_EXE_fuzz-smoke"))
        .args(["--seconds", "0"])
        .current_dir(std::env::temp_dir())
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{told}{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(told.lines().count(), TARGETS.len(), "{told}");
}

#[test]
fn every_target_has_its_file_for_cargo_fuzz() {
    let fuzz = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz");
    let manifest = std::fs::read_to_string(fuzz.join("Cargo.toml")).unwrap();
    for target in TARGETS {
        let name = target.name;
        let file = std::fs::read_to_string(fuzz.join(format!("fuzz_targets/{name}.rs"))).unwrap();
        assert!(file.contains(&format!("\"{name}\"")), "{name}");
        // Cargo takes no program twice.
        assert_eq!(manifest.matches(&format!("name = \"{name}\"\n")).count(), 1, "{name}");
    }
    let files = std::fs::read_dir(fuzz.join("fuzz_targets")).unwrap().count();
    assert_eq!(files, TARGETS.len());
}
