//! Where the library is.

use std::ffi::{OsStr, OsString};

use libloading::Library;

use crate::OidnError;
use crate::api::Api;

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
