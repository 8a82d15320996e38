//! Errors of glTF files.

use std::fmt::Display;
use std::path::Path;

use crate::import::Refusal;
pub(super) use crate::import::error::damaged;

/// Advice on a file of glTF's first version.
pub(super) fn first_version() -> String {
    "this is glTF 1.0, which is not supported\nhint: convert it: npx gltf-pipeline -i OLD.gltf -o NEW.glb, or \
     export it as glTF 2.0"
        .to_owned()
}

/// The error that `from` names the `what` number `index`, of which there are only `count`.
pub(super) fn absent(
    file: &Path,
    from: impl Display,
    what: &str,
    index: usize,
    count: usize,
) -> Refusal {
    let reason = format!("there is no {what} {index}; the file has {count}\nhint: export it again");
    damaged(file, from, reason)
}
