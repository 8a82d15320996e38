//! Place of the library, and the calls of `oidn.h` that are made: those of versions 1.4 and 2, which differ in names
//! alone. Also what may go wrong with it.

use std::ffi::{OsStr, OsString, c_char, c_int, c_void};

use libloading::{Error, Library};

/// The reason why a picture was not denoised.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OidnError {
    /// There is no library.
    #[error(
        "Open Image Denoise is not found: install it (`pip install pyoidn` brings it as \
         pyoidn/oidn/lib/libOpenImageDenoise.so.2, and https://www.openimagedenoise.org has releases), and \
         name its library by the environment variable ETENDUE_OIDN where the dynamic loader does not find it"
    )]
    Missing,
    /// The file that was named is no such library, or lacks something itself.
    #[error(
        "{library} cannot be used as Open Image Denoise ({why}); let ETENDUE_OIDN name the file \
         libOpenImageDenoise.so.2 of version 1.4 or later, beside the libraries that came with it"
    )]
    Unusable {
        /// The library.
        library: String,
        /// The message of the dynamic loader or the library.
        why: String,
    },
    /// The library failed at its work.
    #[error("Open Image Denoise {version}: {why}")]
    Failed {
        /// Its version.
        version: String,
        /// Its message.
        why: String,
    },
    /// An image has another number of values than its pixels take.
    #[error("an image of {width} x {height} pixels has {found} values where three a pixel belong")]
    Size {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Number of values that there are.
        found: usize,
    },
}

impl OidnError {
    /// True if the caller can mend it: by another library, or by installing one.
    #[must_use]
    pub fn is_refused(&self) -> bool {
        matches!(self, Self::Missing | Self::Unusable { .. })
    }
}

/// A device or a filter of the library.
type Handle = *mut c_void;

/// Functions of the library, which stays loaded.
pub(crate) struct Api {
    pub(crate) new_device: unsafe extern "C" fn(c_int) -> Handle,
    pub(crate) set_device_int: unsafe extern "C" fn(Handle, *const c_char, c_int),
    pub(crate) set_device_bool: unsafe extern "C" fn(Handle, *const c_char, bool),
    pub(crate) device_int: unsafe extern "C" fn(Handle, *const c_char) -> c_int,
    pub(crate) commit_device: unsafe extern "C" fn(Handle),
    pub(crate) device_error: unsafe extern "C" fn(Handle, *mut *const c_char) -> c_int,
    pub(crate) release_device: unsafe extern "C" fn(Handle),
    pub(crate) new_filter: unsafe extern "C" fn(Handle, *const c_char) -> Handle,
    /// Filter, name, values, format, columns, rows, and in bytes: offset, strides of pixels and rows.
    pub(crate) set_image: unsafe extern "C" fn(
        Handle,
        *const c_char,
        *mut c_void,
        c_int,
        usize,
        usize,
        usize,
        usize,
        usize,
    ),
    pub(crate) set_filter_bool: unsafe extern "C" fn(Handle, *const c_char, bool),
    pub(crate) commit_filter: unsafe extern "C" fn(Handle),
    pub(crate) execute_filter: unsafe extern "C" fn(Handle),
    pub(crate) release_filter: unsafe extern "C" fn(Handle),
}

impl Api {
    /// The functions of a library.
    ///
    /// # Safety
    ///
    /// The library must be Open Image Denoise, and stay loaded.
    pub(crate) unsafe fn of(library: &Library) -> Result<Self, Error> {
        // SAFETY: the caller says that it is the library whose header gives these names their types.
        unsafe {
            Ok(Self {
                new_device: function(library, &["oidnNewDevice"])?,
                set_device_int: function(library, &["oidnSetDeviceInt", "oidnSetDevice1i"])?,
                set_device_bool: function(library, &["oidnSetDeviceBool", "oidnSetDevice1b"])?,
                device_int: function(library, &["oidnGetDeviceInt", "oidnGetDevice1i"])?,
                commit_device: function(library, &["oidnCommitDevice"])?,
                device_error: function(library, &["oidnGetDeviceError"])?,
                release_device: function(library, &["oidnReleaseDevice"])?,
                new_filter: function(library, &["oidnNewFilter"])?,
                set_image: function(library, &["oidnSetSharedFilterImage"])?,
                set_filter_bool: function(library, &["oidnSetFilterBool", "oidnSetFilter1b"])?,
                commit_filter: function(library, &["oidnCommitFilter"])?,
                execute_filter: function(library, &["oidnExecuteFilter"])?,
                release_filter: function(library, &["oidnReleaseFilter"])?,
            })
        }
    }
}

/// The function that goes by the first of these names which the library has.
///
/// # Safety
///
/// It must be of type `T`.
unsafe fn function<T: Copy>(library: &Library, names: &[&str]) -> Result<T, Error> {
    // SAFETY: the caller answers for the type.
    let found = |name: &&str| unsafe { library.get::<T>(name.as_bytes()) }.map(|symbol| *symbol);
    let [first, others @ ..] = names else { return Err(Error::DlSymUnknown) };
    others.iter().fold(found(first), |before, name| before.or_else(|_| found(name)))
}

/// The names that the dynamic loader is asked for, the best first.
const NAMES: [&str; 3] =
    ["libOpenImageDenoise.so.2", "libOpenImageDenoise.so.1", "libOpenImageDenoise.so"];

/// The environment variable that names the library.
const VARIABLE: &str = "ETENDUE_OIDN";

/// The functions of the library that is named, or else found, and what it is called.
pub(crate) fn find() -> Result<(Api, String), OidnError> {
    let named = std::env::var_os(VARIABLE).filter(|name| !name.is_empty());
    let found = match &named {
        Some(name) => {
            load(name).map_err(|why| unusable(name, &why)).map(|library| (name.clone(), library))?
        }
        None => {
            let loaded = |name: &str| Some((OsString::from(name), load(OsStr::new(name)).ok()?));
            NAMES.iter().find_map(|name| loaded(name)).ok_or(OidnError::Missing)?
        }
    };
    let (name, library) = found;
    // SAFETY: its name says that it is Open Image Denoise, and it is not unloaded.
    let api = unsafe { Api::of(&library) };
    // Its threads may outlive what was asked of it.
    std::mem::forget(library);
    Ok((api.map_err(|why| unusable(&name, &why))?, name.to_string_lossy().into_owned()))
}

fn load(name: &OsStr) -> Result<Library, libloading::Error> {
    // SAFETY: what runs when the library is loaded is its own start; the user, or the system's dynamic
    // loader, has chosen it.
    unsafe { Library::new(name) }
}

fn unusable(name: &OsStr, why: &libloading::Error) -> OidnError {
    OidnError::Unusable { library: name.to_string_lossy().into_owned(), why: why.to_string() }
}
