//! The files that a command reads, which it must not write over.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::OutputError;

/// The inputs of this process, by name and by what they are.
static INPUTS: Mutex<Vec<(PathBuf, FileIdentity)>> = Mutex::new(Vec::new());

/// What two names of one file share, links followed: device and inode.
#[cfg(unix)]
type FileIdentity = (u64, u64);

/// What two names of one file share: its place without links.
#[cfg(not(unix))]
type FileIdentity = PathBuf;

#[cfg(unix)]
fn identity(path: &Path) -> Option<FileIdentity> {
    use std::os::unix::fs::MetadataExt;
    std::fs::metadata(path).ok().map(|data| (data.dev(), data.ino()))
}

#[cfg(not(unix))]
fn identity(path: &Path) -> Option<FileIdentity> {
    path.canonicalize().ok()
}

/// Has every file of `paths` that exists refused as an output from now on, under any name.
pub fn protect_inputs<'p>(paths: impl IntoIterator<Item = &'p Path>) {
    let mut inputs = INPUTS.lock().unwrap_or_else(PoisonError::into_inner);
    for path in paths {
        if let Some(identity) =
            identity(path).filter(|new| inputs.iter().all(|(_, old)| old != new))
        {
            inputs.push((path.to_owned(), identity));
        }
    }
}

/// Checks that none of `targets` is an input, also through links.
///
/// # Errors
///
/// [`OutputError::IsInput`] with the first that is.
pub fn refuse_inputs<'p>(targets: impl IntoIterator<Item = &'p Path>) -> Result<(), OutputError> {
    let inputs = INPUTS.lock().unwrap_or_else(PoisonError::into_inner);
    for target in targets {
        let Some(identity) = identity(target) else { continue };
        if let Some((input, _)) = inputs.iter().find(|(_, known)| *known == identity) {
            return Err(OutputError::IsInput { path: target.to_owned(), input: input.clone() });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    #[cfg(unix)]
    fn an_input_is_refused_under_all_its_names() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        for name in ["input", "other"] {
            fs::write(path(name), "").unwrap();
        }
        fs::hard_link(path("input"), path("hard")).unwrap();
        std::os::unix::fs::symlink("input", path("soft")).unwrap();
        std::os::unix::fs::symlink("soft", path("softer")).unwrap();
        fs::create_dir(path("sub")).unwrap();
        protect_inputs([&*path("input"), &path("missing")]);
        for name in ["input", "hard", "soft", "softer", "sub/../input"] {
            let error = refuse_inputs([&*path("other"), &path(name)]).unwrap_err().to_string();
            assert!(error.contains(&*path(name).to_string_lossy()), "{error}");
            assert!(error.contains("is read by this command"), "{error}");
        }
        refuse_inputs([&*path("other"), &path("missing"), &path("sub")]).unwrap();
    }
}
