//! A Python with the reference implementation of EMVA 1288 (`emva1288` 1.0.2 of Python's package
//! index), in an environment of its own below the target directory.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use super::environment;

/// A Python that has the reference implementation; `Err` says why there is none.
pub(crate) fn python() -> Result<PathBuf, String> {
    environment::python_with("emva1288-1.0.2", &["numpy<2", "emva1288==1.0.2"])
}

/// Evaluation by the reference implementation of the series that `descriptor` lists.
pub(crate) fn characterised(python: &Path, descriptor: &Path) -> Value {
    // The file of this module is compiled into the tests of another crate, too.
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("a folder of crates");
    let script = crates.join("sensor/tests/sensor/emva/characterise.py");
    let out = Command::new(python).arg(script).arg(descriptor).output().unwrap();
    let errors = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "the reference implementation failed: {errors}");
    serde_json::from_slice(&out.stdout).unwrap_or_else(|error| panic!("{error}: {out:?}"))
}
