//! Files of reflectances and light by wavelength: NPY, ENVI and spectral EXR.

use std::path::{Path, PathBuf};

use etendue_files::{FindError, InputFolder, MappedFile};
use etendue_image::{BandAxis, Cube as Picture, Limits, MOST_BYTES, Quantity, envi, npy};
use etendue_tracer::spec::CubeSpec;

use crate::error::not_found;
use etendue_tracer::{Cube, CubeKind};

/// The cube that a scene names, and all files that it was read from.
///
/// # Errors
///
/// When a file is not there or holds no such cube; the message goes on after the name.
pub(crate) fn read(
    spec: &CubeSpec,
    kind: CubeKind,
    folder: &InputFolder,
) -> Result<(Cube, Vec<PathBuf>), String> {
    let path = folder.find(&spec.cube).map_err(not_found)?.path;
    let head = etendue_files::read_head(&path, 16).map_err(|error| error.to_string())?;
    if head.starts_with(b"\x93NUMPY") {
        return Ok((array(&path, spec, kind)?, vec![path]));
    }
    let is_exr = etendue_image::is_exr(&head);
    if !is_exr && !envi::is_header(&head) && !envi::is_data(&path) {
        let why = "is no cube that is read: NPY, ENVI and spectral EXR files are (an `image` is red, green and blue)";
        return Err(why.to_owned());
    }
    if spec.bands.is_some() {
        let why = "says itself at which wavelengths its bands are: leave out `bands`, which is for NPY files";
        return Err(why.to_owned());
    }
    let (Picture { size, axis, values, quantity, .. }, files) = match is_exr {
        true => (exr(&path, kind)?, vec![path]),
        false => envi_pair(&spec.cube, &path, folder)?,
    };
    if kind == CubeKind::Light && quantity == Quantity::Reflectance {
        return Err("holds what is reflected, which gives off no light".to_owned());
    }
    Ok((Cube::new(kind, size, axis, values, spec.wrap, spec.filter)?, files))
}

/// An array `[row][column][band]`.
fn array(path: &Path, spec: &CubeSpec, kind: CubeKind) -> Result<Cube, String> {
    let bands = spec.bands.as_ref().ok_or(
        "does not say at which wavelengths its bands are: give `bands`, their edges (nm) or \
         {\"from\": 400, \"to\": 700, \"count\": 31}",
    )?;
    let count = bands.len();
    let map = MappedFile::open(path).map_err(|error| error.to_string())?;
    let fits = |shape: &[usize]| match shape {
        [_, _, bands] if *bands == count => Ok(()),
        [_, _, bands] => Err(format!(
            "has {bands} bands a texel, and `bands` names {count}: their middles are the wavelengths"
        )),
        _ => Err(format!("has {} dimensions, not [row][column][band]", shape.len())),
    };
    let (shape, values) = npy::read_f32(map.bytes(), fits)?;
    let axis = BandAxis::between(bands.edges().to_vec())?;
    Cube::new(kind, [shape[1], shape[0]], axis, values, spec.wrap, spec.filter)
}

/// The reflectances or the light of an EXR file.
fn exr(path: &Path, kind: CubeKind) -> Result<Picture, String> {
    let channels = {
        let bytes = etendue_files::read(path, MOST_BYTES).map_err(|error| error.to_string())?;
        etendue_image::exr_channels(&bytes, Limits::default()).map_err(|error| error.to_string())?
    };
    let cube = match kind {
        CubeKind::Reflectance => Picture::reflectance_from_exr(channels),
        CubeKind::Light => Picture::from_exr(channels),
    };
    let cube = cube.map_err(|error| error.to_string())?;
    cube.ok_or_else(|| match kind {
        CubeKind::Reflectance => {
            "has no channels of reflectances (T.550,0nm); those of light (S0.550,0nm) are no colour of a surface".to_owned()
        }
        CubeKind::Light => "has no spectral channels (S0.550,0nm)".to_owned(),
    })
}

/// The ENVI cube of one of its two files, by its name as written and its path; and the paths of both.
fn envi_pair(
    written: &str,
    path: &Path,
    folder: &InputFolder,
) -> Result<(Picture, Vec<PathBuf>), String> {
    let partner = |names: Vec<PathBuf>| {
        for name in names.iter().filter_map(|name| name.to_str()) {
            match folder.find(name) {
                Ok(found) => return Ok(Some(found.path)),
                Err(FindError::Missing { .. }) => {}
                Err(refused) => return Err(format!("goes with another file: {refused}")),
            }
        }
        Ok(None)
    };
    read_envi(Path::new(written), path, Limits::default(), partner).map_err(|fault| fault.why)
}

/// The reason why there is no cube: the file of which it is said, and a sentence that goes on after its name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EnviFault {
    /// The file.
    pub path: PathBuf,
    /// The reason.
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
    written: &Path,
    path: &Path,
    limits: Limits,
    partner: impl FnOnce(Vec<PathBuf>) -> Result<Option<PathBuf>, String>,
) -> Result<(Picture, Vec<PathBuf>), EnviFault> {
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
