//! ENVI cubes of two files: a header, and numbers beside it.

use std::path::{Path, PathBuf};

use etendue_files::MappedFile;
use etendue_image::{Cube, Limits, envi};

/// Error of a cube that cannot be read: its file, and a sentence that goes on after the file's
/// name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EnviFault {
    /// The file.
    pub path: PathBuf,
    /// Description of the error.
    pub why: String,
}

/// The ENVI cube of which `path` is one of the two files, and both. `written` is what it was called, from which the
/// names of the other are made; `partner` says where the first of those is, if any is there.
///
/// # Errors
///
/// When the other file is missing or may not be read, the header makes no sense, the cube is over `limits`, or there are
/// fewer numbers than it promises.
pub fn read_envi(
    (written, path): (&Path, &Path),
    limits: Limits,
    partner: impl FnOnce(Vec<PathBuf>) -> Result<Option<PathBuf>, String>,
) -> Result<(Cube, Vec<PathBuf>), EnviFault> {
    let fault = |path: &Path, why: String| EnviFault { path: path.to_owned(), why };
    let own = |why: String| fault(path, why);
    let head = etendue_files::read_head(path, 16).map_err(|error| own(error.to_string()))?;
    let (header, data) = match envi::is_header(&head) {
        true => {
            let data = partner(envi::data_names(written).collect()).map_err(own)?;
            let why = "is an ENVI header without its numbers, a file of the same name and .img, .dat or another ending";
            (path.to_owned(), data.ok_or_else(|| own(why.to_owned()))?)
        }
        false => {
            let header = partner(envi::header_names(written).collect()).map_err(own)?;
            let why = "has no ENVI header beside it, of the same name and `.hdr`";
            (header.ok_or_else(|| own(why.to_owned()))?, path.to_owned())
        }
    };
    let of_header = |why: String| fault(&header, why);
    let text = etendue_files::read(&header, envi::MOST_HEADER_BYTES);
    let text = text.map_err(|error| of_header(error.to_string()))?;
    let parsed = envi::Header::parse(&text).map_err(|error| of_header(error.to_string()))?;
    let map = MappedFile::open(&data).map_err(|error| fault(&data, error.to_string()))?;
    let cube = parsed.decode(map.bytes(), limits);
    let cube = cube.map_err(|error| of_header(error.to_string()))?;
    Ok((cube, vec![header, data]))
}
