//! Files that are whole or not there: written beside their place, under `.NAME.XXXXXX.part`, and
//! renamed when complete. What stood there before stays until that moment.
//!
//! Only regular files are replaced. To a device, a named pipe, and what this process has as its
//! standard output or error, the whole content is written once it is complete.
//!
//! The random middle of the name keeps two processes that write the same file apart; the last to
//! finish wins. The rename is atomic for everyone who looks at the folder; data may still be on its
//! way to the disk when it happens, so a power cut within seconds can lose it.
//!
//! Files of one [`Transaction`](crate::Transaction) take their names when all of them are complete.
//!
//! Part files are locked by the process that writes them. One that is not is left from a process that
//! was killed, and the next one that writes into the folder removes it.
//!
//! Devices, pipes, and what this process has as its standard output or error: they are written to, and not
//! replaced.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::{Builder, NamedTempFile};

use crate::WriteError;

/// The part files of this process, for a signal handler: what a signal ends is not dropped.
static OPEN: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn open_set() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    OPEN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The files that this process has begun and not finished.
#[must_use]
pub fn open_parts() -> Vec<PathBuf> {
    open_set().iter().cloned().collect()
}

/// Removes the files that this process has begun and not finished, as far as the system lets it.
/// For a signal handler, which ends the process right after.
pub fn remove_open_parts() {
    for path in open_parts() {
        // Nobody is left to tell, and the next path deserves its turn.
        let _ = fs::remove_file(path);
    }
}

/// Makes `folder` and checks that files can be made in it, so that a render does not find out in
/// the end.
///
/// # Errors
///
/// [`WriteError::Io`] when it cannot be made or written to.
pub fn prepare_folder(folder: &Path) -> Result<(), WriteError> {
    fs::create_dir_all(folder).map_err(|source| WriteError::io(folder, source))?;
    let probe = open_beside(&folder.join(PROBE));
    probe.map(drop).map_err(|source| WriteError::io(folder, source))?;
    let is_ours =
        |target: &str| target == PROBE || ENDINGS.iter().any(|ending| target.ends_with(ending));
    remove_leftovers(folder, is_ours);
    Ok(())
}

/// The name of the file that is written to see whether a folder can be written to.
const PROBE: &str = "etendue";

/// Endings of the files that commands write into folders. What a killed process left of others is not known to be ours, and
/// stays.
pub const ENDINGS: [&str; 15] = [
    ".exr", ".npy", ".png", ".dng", ".json", ".svg", ".csv", ".txt", ".flo", ".hdr", ".img",
    ".ply", ".pfm", ".cfg", ".film",
];

/// Removes part files of `folder` that no process writes to any more, of the targets that
/// `is_ours` says. What cannot be looked at or removed stays.
fn remove_leftovers(folder: &Path, is_ours: impl Fn(&str) -> bool) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let Some(target) = name.to_str().and_then(target_of_part) else { continue };
        if open_set().contains(&absolute(&entry.path())) {
            continue;
        }
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        if is_file
            && is_ours(target)
            && File::open(entry.path()).is_ok_and(|file| file.try_lock().is_ok())
        {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// `depth.exr` of `.depth.exr.a1B2c3.part`.
fn target_of_part(name: &str) -> Option<&str> {
    let (target, random) = name.strip_prefix('.')?.strip_suffix(".part")?.rsplit_once('.')?;
    let is_random = random.len() == 6 && random.bytes().all(|b| b.is_ascii_alphanumeric());
    is_random.then_some(target)
}

/// Place of a file's content until it is complete.
#[derive(Debug)]
pub(crate) enum Content {
    /// Beside its place, to be renamed.
    Beside {
        file: NamedTempFile,
        // After the file, so that the entry outlives it: a signal in between finds a path too many
        // rather than a file too many.
        entry: PartRegistration,
    },
    /// In a file without a name, to be copied to where it goes.
    Apart { file: File, to: Special },
}

impl Content {
    /// None as yet, of what is to be written to `target`.
    pub(crate) fn begin(target: &Path) -> io::Result<Self> {
        if let Some(to) = Special::of(target) {
            return Ok(Self::Apart { file: tempfile::tempfile()?, to });
        }
        if let (Some(name), Some(folder)) = (target.file_name(), folder_of(target)) {
            remove_leftovers(folder, |left| name == left);
        }
        // The set is locked until the new file is in it: a handler that reads it misses none.
        let mut open = open_set();
        let file = open_beside(target)?;
        let path = absolute(file.path());
        open.insert(path.clone());
        drop(open);
        Ok(Self::Beside { file, entry: PartRegistration(path) })
    }

    /// The file that it is written to.
    pub(crate) fn file(&mut self) -> &mut File {
        match self {
            Self::Beside { file, .. } => file.as_file_mut(),
            Self::Apart { file, .. } => file,
        }
    }
}

/// A whole file that is of use while the work lasts. It goes when this is dropped, and with the files
/// that are not finished when a signal ends the process.
#[derive(Debug)]
pub struct Temporary(PartRegistration);

impl Temporary {
    /// Of the file that is or will be at `path`.
    #[must_use]
    pub fn new(path: &Path) -> Self {
        let path = absolute(path);
        open_set().insert(path.clone());
        Self(PartRegistration(path))
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        // It may never have been written.
        let _ = fs::remove_file(&self.0.0);
    }
}

/// A path in [`OPEN`], for as long as this lives.
#[derive(Debug)]
pub(crate) struct PartRegistration(PathBuf);

impl Drop for PartRegistration {
    fn drop(&mut self) {
        open_set().remove(&self.0);
    }
}

/// `path` as it is found from any folder: another thread or a signal handler may have another one.
fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

/// The folder of `target`.
fn folder_of(target: &Path) -> Option<&Path> {
    let folder = target.parent()?;
    Some(if folder.as_os_str().is_empty() { Path::new(".") } else { folder })
}

/// A new file beside `target`, as readable as any new file is (`tempfile`'s own are private).
fn open_beside(target: &Path) -> io::Result<NamedTempFile> {
    let mut prefix = OsString::from(".");
    prefix.push(target.file_name().unwrap_or_default());
    prefix.push(".");
    let folder = folder_of(target).unwrap_or(Path::new("."));
    let mut refusal = None;
    let made = Builder::new().prefix(&prefix).suffix(".part").make_in(folder, |path| {
        let opened = File::options().read(true).write(true).create_new(true).open(path);
        let file = opened.inspect_err(|error| refusal = error.raw_os_error())?;
        // Where files cannot be locked, they are not taken for leftovers either.
        let _ = file.try_lock();
        match path.exists() {
            true => Ok(file),
            // Another process took it for a leftover before it was locked: once more.
            false => Err(io::ErrorKind::AlreadyExists.into()),
        }
    });
    // The system's own answer, without the hidden name that `tempfile` adds to it.
    made.map_err(|error| refusal.map_or(error, io::Error::from_raw_os_error))
}

/// A target that is no regular file to be replaced.
#[derive(Debug)]
pub(crate) enum Special {
    /// A device, a pipe or a socket.
    Device,
    /// Standard output or error of this process.
    Stream(File),
}

impl Special {
    /// Returns what `target` is when it is no regular file to be replaced.
    pub(crate) fn of(target: &Path) -> Option<Self> {
        let found = fs::metadata(target).ok()?;
        match own_stream(&found) {
            Some(stream) => Some(Self::Stream(stream)),
            None => (!found.is_file()).then_some(Self::Device),
        }
    }

    /// Writes all of `content`.
    pub(crate) fn fill(self, target: &Path, content: &mut File) -> io::Result<()> {
        content.rewind()?;
        let mut to = match self {
            Self::Stream(stream) => stream,
            // Not made anew when it is gone: then it is no device any more.
            Self::Device => File::options().write(true).open(target)?,
        };
        io::copy(content, &mut to)?;
        to.flush()
    }
}

/// The standard output or error of this process, when it goes to `target`: opened by its path, as
/// /dev/stdout is, a file would be written from its start.
#[cfg(unix)]
fn own_stream(target: &fs::Metadata) -> Option<File> {
    use std::os::fd::AsFd;
    use std::os::unix::fs::MetadataExt;
    let (out, error) = (io::stdout(), io::stderr());
    [out.as_fd(), error.as_fd()].into_iter().find_map(|stream| {
        let stream = File::from(stream.try_clone_to_owned().ok()?);
        let found = stream.metadata().ok()?;
        ((found.dev(), found.ino()) == (target.dev(), target.ino())).then_some(stream)
    })
}

#[cfg(not(unix))]
fn own_stream(_target: &fs::Metadata) -> Option<File> {
    None
}

#[cfg(test)]
mod tests {
    use std::io::SeekFrom;

    use super::*;
    use crate::Transaction;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn the_old_file_stays_until_the_new_one_is_complete() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("depth.exr");
        fs::write(&target, "old").unwrap();
        let files = Transaction::at_once();
        let mut part = files.create(&target).unwrap();
        part.write_all(b"new").unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"old");
        let ours: Vec<PathBuf> =
            open_parts().into_iter().filter(|path| path.starts_with(folder.path())).collect();
        let [path] = ours.try_into().unwrap();
        let hidden = path.file_name().unwrap().to_str().unwrap().to_owned();
        assert!(hidden.starts_with(".depth.exr.") && hidden.ends_with(".part"), "{hidden}");
        part.finish().unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["depth.exr"]);
        assert!(!open_parts().contains(&path));
    }

    #[test]
    fn an_interrupted_write_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("depth.exr");
        fs::write(&target, "old").unwrap();
        let error = Transaction::at_once()
            .write(&target, |part| {
                part.write_all(b"half of the n")?;
                Err(io::ErrorKind::StorageFull.into())
            })
            .unwrap_err();
        assert!(error.to_string().contains("free some space"), "{error}");
        assert_eq!(fs::read(&target).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["depth.exr"]);
        assert!(open_parts().iter().all(|path| !path.starts_with(folder.path())));
    }

    #[test]
    fn parts_of_a_killed_process_go_and_those_of_a_living_one_stay() {
        let folder = tempfile::tempdir().unwrap();
        let put = |name: &str| fs::write(folder.path().join(name), "").unwrap();
        let others =
            [".depth.exr.abcdef.bak", ".depth.exr.abc.part", ".notes.abcdef.part", "a.part"];
        others.iter().for_each(|name| put(name));
        let left = [
            ".depth.exr.abcdef.part",
            ".picture.preview.png.X1y2Z3.part",
            ".flow.flo.X1y2Z3.part",
            ".etendue.a1B2c3.part",
        ];
        left.iter().for_each(|name| put(name));
        let files = Transaction::at_once();
        let living = files.create(&folder.path().join("depth.exr")).unwrap();
        assert!(!names(folder.path()).contains(&".depth.exr.abcdef.part".to_owned()));
        prepare_folder(folder.path()).unwrap();
        let mut expected: Vec<String> = others.map(str::to_owned).into();
        let parts = open_parts().into_iter().filter(|path| path.starts_with(folder.path()));
        expected.extend(parts.map(|path| path.file_name().unwrap().to_str().unwrap().to_owned()));
        assert_eq!(expected.len(), others.len() + 1);
        expected.sort();
        assert_eq!(names(folder.path()), expected);
        living.finish().unwrap();
    }

    #[test]
    fn a_panic_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("depth.exr");
        let panicked = std::panic::catch_unwind(|| {
            Transaction::at_once().write(&target, |_| panic!("on purpose"))
        });
        assert!(panicked.is_err());
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn a_signal_handler_finds_and_removes_what_is_open() {
        let folder = tempfile::tempdir().unwrap();
        let files = Transaction::at_once();
        let part = files.create(&folder.path().join("a.exr")).unwrap();
        // As `remove_open_parts` does, but only here: other tests have files open too.
        for path in open_parts().into_iter().filter(|path| path.starts_with(folder.path())) {
            fs::remove_file(path).unwrap();
        }
        assert!(names(folder.path()).is_empty());
        assert!(part.finish().is_err(), "there is nothing left to rename");
    }

    #[test]
    #[cfg(unix)]
    fn pipes_are_written_to_and_stay() {
        use std::os::unix::fs::FileTypeExt;
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let reader = std::thread::spawn({
            let pipe = pipe.clone();
            move || fs::read(pipe).unwrap()
        });
        Transaction::at_once()
            .write(&pipe, |part| {
                // Out of order, as the writer of EXR files does.
                part.write_all(b"a c")?;
                part.seek(SeekFrom::Start(1))?;
                part.write_all(b"b")
            })
            .unwrap();
        assert_eq!(reader.join().unwrap(), b"abc");
        assert!(fs::metadata(&pipe).unwrap().file_type().is_fifo());
        assert_eq!(names(folder.path()), ["pipe"]);
    }

    #[test]
    fn a_folder_that_refuses_is_named_with_a_remedy() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("missing").join("a.exr");
        let message = Transaction::at_once().create(&missing).unwrap_err().to_string();
        assert!(message.contains("missing/a.exr"), "{message}");
        assert!(message.contains("create the folder first"), "{message}");

        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        let message = Transaction::at_once().create(&file.join("a.exr")).unwrap_err().to_string();
        assert!(message.contains("file/a.exr"), "{message}");
        assert!(message.contains("a part of the path is a file"), "{message}");
        assert!(prepare_folder(&file).is_err(), "a file is no folder");

        let message = Transaction::at_once().create(folder.path()).unwrap_err().to_string();
        assert!(message.contains("a folder has this name"), "{message}");
        assert_eq!(names(folder.path()), ["file"], "no attempt may leave anything");
    }

    #[test]
    #[cfg(unix)]
    fn an_unwritable_folder_is_named_with_a_remedy() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o555)).unwrap();
        // The superuser may write anywhere but into the kernel's own folders.
        let superuser = fs::write(folder.path().join("probe"), "").is_ok();
        let refusing = if superuser { Path::new("/sys/kernel") } else { folder.path() };
        if !refusing.is_dir() {
            println!("skipped: this user may write everywhere, and there is no /sys/kernel");
            return;
        }
        for error in [
            Transaction::at_once().create(&refusing.join("a.exr")).unwrap_err(),
            prepare_folder(refusing).unwrap_err(),
        ] {
            let message = error.to_string();
            assert!(message.contains(&*refusing.to_string_lossy()), "{message}");
            assert!(message.contains("make the folder writable"), "{message}");
            assert!(!message.contains(".part"), "the hidden name is of no interest: {message}");
        }
    }

    #[test]
    #[cfg(unix)]
    fn a_finished_file_is_as_readable_as_any_new_one() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("plain"), "").unwrap();
        Transaction::at_once().write(&folder.path().join("ours"), |_| Ok(())).unwrap();
        let mode = |name| fs::metadata(folder.path().join(name)).unwrap().permissions().mode();
        assert_eq!(mode("ours"), mode("plain"));
    }
}
