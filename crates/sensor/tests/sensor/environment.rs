//! Pythons with packages of Python's package index, in environments of their own below the target
//! directory.

use std::path::{Path, PathBuf};
use std::process::Command;

/// A Python that has `packages`, in an environment called `name`; `Err` says why there is none.
pub(crate) fn python_with(name: &str, packages: &[&str]) -> Result<PathBuf, String> {
    let venv = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let (python, ready) = (venv.join("bin/python"), venv.join("ready"));
    // Two tests that want it at once must not both make it.
    let lock = std::fs::File::create(format!("{}.lock", venv.display()));
    let lock = lock.map_err(|error| error.to_string())?;
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
    run(&python, &[&["-m", "pip", "install", "--quiet"], packages].concat())?;
    std::fs::write(&ready, "").map_err(|error| error.to_string())?;
    Ok(python)
}
