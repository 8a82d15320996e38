//! A Python with the reference implementation of EMVA 1288 (`emva1288` 1.0.2 of Python's package
//! index), in an environment of its own below the target directory.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// A Python that has the reference implementation; `Err` says why there is none.
pub(crate) fn python() -> Result<PathBuf, String> {
    let venv = Path::new(env!("CARGO_TARGET_TMPDIR")).join("emva1288-1.0.2");
    let (python, ready) = (venv.join("bin/python"), venv.join("ready"));
    // Two tests that want it at once must not both make it.
    let lock = std::fs::File::create(venv.with_extension("lock")).map_err(|e| e.to_string())?;
    lock.lock().map_err(|error| error.to_string())?;
    if ready.exists() {
        return Ok(python);
    }
    let run = |program: &Path, arguments: &[&str]| {
        let out = Command::new(program).args(arguments).output();
        let out = out.map_err(|error| format!("{} cannot be run: {error}", program.display()))?;
        let last = String::from_utf8_lossy(&out.stderr).lines().last().unwrap_or("").to_owned();
        if out.status.success() { Ok(()) } else { Err(format!("{}: {last}", arguments.join(" "))) }
    };
    let folder = venv.to_str().ok_or("the target directory's name is not UTF-8")?;
    run(Path::new("python3"), &["-m", "venv", "--clear", folder])?;
    let pip = ["-m", "pip", "install", "--quiet", "numpy<2", "emva1288==1.0.2"];
    run(&python, &pip)?;
    std::fs::write(&ready, "").map_err(|error| error.to_string())?;
    Ok(python)
}

/// What the reference implementation makes of the series that `descriptor` lists.
pub(crate) fn characterised(python: &Path, descriptor: &Path) -> Value {
    // The file of this module is compiled into the tests of another crate, too.
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("a folder of crates");
    let script = crates.join("sensor/tests/emva/characterise.py");
    let out = Command::new(python).arg(script).arg(descriptor).output().unwrap();
    let errors = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "the reference implementation failed: {errors}");
    serde_json::from_slice(&out.stdout).unwrap_or_else(|error| panic!("{error}: {out:?}"))
}
