//! Devices, pipes, and what this process has as its standard output or error: they are written to, and not
//! replaced.

use std::fs::{self, File};
use std::io::{self, Seek, Write};
use std::path::Path;

/// A target that is no regular file to be replaced.
#[derive(Debug)]
pub(crate) enum Special {
    /// A device, a pipe or a socket.
    Device,
    /// What this process writes to as its standard output or error.
    Stream(File),
}

impl Special {
    /// What `target` is when it is no regular file to be replaced.
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
