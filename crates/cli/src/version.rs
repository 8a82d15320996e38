//! `etendue --version`.

use crate::fault::print_text;

/// Prints the program's version and what traces its rays.
pub(crate) fn print() {
    #[cfg(feature = "embree")]
    let accel = match etendue_accel::embree_version() {
        Ok(version) => version.to_string(),
        Err(error) => format!("Embree: {error}"),
    };
    #[cfg(not(feature = "embree"))]
    let accel = "without Embree (pure Rust)";
    let _ = print_text(&format!("etendue {}\n{accel}", env!("CARGO_PKG_VERSION")));
}
