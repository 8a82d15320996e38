#![doc = include_str!("../README.md")]
// PyO3's macros expand to code with casts and names of their own.
#![allow(missing_docs, missing_debug_implementations, reason = "items are seen from Python alone")]
#![allow(unreachable_pub, reason = "PyO3 exports what is public here")]

mod accel;
mod arrays;
mod lens;
mod light;
mod scene;
mod sensor;
mod work;

use pyo3::prelude::*;

/// The Python module `etendue._core`.
#[pymodule]
mod _core {
    #[pymodule_export]
    use super::accel::Accel;
    #[pymodule_export]
    use super::lens::Lens;
    #[pymodule_export]
    use super::light::{ExposedImage, LightImage};
    #[pymodule_export]
    use super::scene::{Rendering, Session};
    #[pymodule_export]
    use super::sensor::Sensor;
    #[pymodule_export]
    use super::{has_embree, layer_key, version};
}

/// True if Embree is built in.
#[pyfunction]
fn has_embree() -> bool {
    cfg!(feature = "embree")
}

/// A layer's key: `NormalCamera` is `normal_camera`, `Id.object` `id_object`, the picture's `picture`.
#[pyfunction]
fn layer_key(name: &str) -> String {
    etendue_render::output::layer_stem(name).replace("__", "_")
}

/// The version of the package.
#[pyfunction]
fn version() -> &'static str {
    env!("CARGO_PKG_VERSION")
}
