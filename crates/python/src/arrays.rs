//! Errors and arrays between Rust and Python.

use std::borrow::Cow;
use std::io;

use etendue::Error;
use etendue_geometry::{Mesh, Vertices};
use etendue_render::output::{Layer, Values};
use numpy::{IntoPyArray, PyArrayMethods, PyReadonlyArray2};
use pyo3::exceptions::{
    PyFileNotFoundError, PyKeyboardInterrupt, PyOSError, PyPermissionError, PyRuntimeError,
    PyValueError,
};
use pyo3::prelude::*;

/// An error as Python has it: what the system refused is an `OSError`, such as `FileNotFoundError`, what
/// else the caller can mend a `ValueError`.
pub(crate) fn raised(error: Error) -> PyErr {
    let message = in_python(&error.message());
    match system_error(&error) {
        _ if error.is_stopped() => PyKeyboardInterrupt::new_err("stopped"),
        Some(io::ErrorKind::NotFound) => PyFileNotFoundError::new_err(message),
        Some(io::ErrorKind::PermissionDenied) => PyPermissionError::new_err(message),
        Some(_) => PyOSError::new_err(message),
        None if error.is_refused() => PyValueError::new_err(message),
        None => PyRuntimeError::new_err(message),
    }
}

/// The system's own error about a file, if that is at the root of `error`.
fn system_error(error: &Error) -> Option<io::ErrorKind> {
    if let Error::Scene(scene) = error
        && scene.is_missing_file()
    {
        return Some(io::ErrorKind::NotFound);
    }
    let error: &(dyn std::error::Error + 'static) = error;
    std::iter::successors(Some(error), |error| error.source()).find_map(|cause| {
        let io = cause.downcast_ref::<io::Error>()?;
        // What a reader makes up of a file's contents has no number.
        io.raw_os_error().map(|_| io.kind())
    })
}

/// A `ValueError` of what something says.
pub(crate) fn refused(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(in_python(&error.to_string()))
}

/// Rows of three numbers, where they are if they lie in rows.
pub(crate) fn triples<'a, T: numpy::Element + Copy>(
    name: &str,
    array: &'a PyReadonlyArray2<'_, T>,
) -> PyResult<Cow<'a, [[T; 3]]>> {
    let in_rows = array.as_slice();
    let array = array.as_array();
    match (array.shape(), in_rows) {
        ([_, 3], Ok(numbers)) => Ok(Cow::Borrowed(numbers.as_chunks().0)),
        ([_, 3], Err(_)) => {
            Ok(array.rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect())
        }
        (other, _) => Err(refused(format!("{name} has the shape {other:?} instead of (n, 3)"))),
    }
}

/// Rows of `N` numbers, as meshes have what is known at their vertices.
pub(crate) fn rows<const N: usize>(
    name: &str,
    array: Option<PyReadonlyArray2<'_, f32>>,
) -> PyResult<Option<Vec<[f32; N]>>> {
    let Some(array) = array else { return Ok(None) };
    let array = array.as_array();
    match array.shape() {
        [_, columns] if *columns == N => {
            Ok(Some(array.rows().into_iter().map(|row| std::array::from_fn(|k| row[k])).collect()))
        }
        other => Err(refused(format!("{name} has the shape {other:?} instead of (n, {N})"))),
    }
}

/// An attribute of the vertices of a mesh, as an array (n, N); nothing where it is not.
pub(crate) fn of_vertices<'py, const N: usize>(
    py: Python<'py>,
    values: Option<&Vertices<N>>,
) -> PyResult<Option<Bound<'py, PyAny>>> {
    let Some(values) = values else { return Ok(None) };
    let flat: Vec<f32> = (0..values.len()).flat_map(|i| values.get(i)).collect();
    Ok(Some(flat.into_pyarray(py).reshape([values.len(), N])?.into_any()))
}

/// A layer as an array: `[h, w]` for one channel, else `[h, w, channels]`.
pub(crate) fn of_layer<'py>(
    py: Python<'py>,
    layer: &Layer,
    [width, height]: [usize; 2],
) -> PyResult<Bound<'py, PyAny>> {
    let planes: Vec<&Values> = layer.channels.iter().map(|channel| &channel.values).collect();
    macro_rules! woven {
        ($kind:path) => {{
            let mut all = Vec::with_capacity(width * height * planes.len());
            let slices: Vec<_> = planes
                .iter()
                .filter_map(|plane| if let $kind(values) = plane { Some(values) } else { None })
                .collect();
            for i in 0..width * height {
                all.extend(slices.iter().map(|plane| plane[i]));
            }
            shaped(all.into_pyarray(py).into_any(), [height, width, slices.len()])
        }};
    }
    match planes.first() {
        Some(Values::F32(_)) => woven!(Values::F32),
        Some(Values::F64(_)) => woven!(Values::F64),
        Some(Values::U16(_)) => woven!(Values::U16),
        Some(Values::U32(_)) => woven!(Values::U32),
        None => Err(refused("a layer without channels")),
    }
}

/// An array in rows, columns and channels; without the last when there is one.
pub(crate) fn shaped(
    flat: Bound<'_, PyAny>,
    [height, width, channels]: [usize; 3],
) -> PyResult<Bound<'_, PyAny>> {
    match channels {
        1 => flat.call_method1("reshape", ((height, width),)),
        _ => flat.call_method1("reshape", ((height, width, channels),)),
    }
}

/// An array of rows of three.
pub(crate) fn of_triples(py: Python<'_>, rows: Vec<[f64; 3]>) -> PyResult<Bound<'_, PyAny>> {
    let count = rows.len();
    Ok(rows.into_flattened().into_pyarray(py).reshape([count, 3])?.into_any())
}

/// Vertices (m) and faces of a mesh.
pub(crate) fn of_mesh<'py>(
    py: Python<'py>,
    mesh: &Mesh,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let positions = &mesh.positions;
    let vertices = (0..positions.len()).map(|i| positions.get(i).to_array()).collect();
    let faces: Vec<u32> = mesh.triangles.iter().copied().flatten().collect();
    let faces = faces.into_pyarray(py).reshape([mesh.triangles.len(), 3])?.into_any();
    Ok((of_triples(py, vertices)?, faces))
}

/// Options whose words in Python are not their names with underscores.
const OPTIONS: [(&str, &str); 6] = [
    ("--set ", ""),
    ("`--up z`, or its object ", "the scene \"up\": \"z\", or its object "),
    ("pass --allow-outside", "pass allow_outside=True"),
    ("without --strict", "without strict=True"),
    ("--accel bvh", "render.accel \"bvh\""),
    ("added with --glass-catalog FILE.agf, or by", "added by"),
];

/// `message` without options of the command line: `--set camera.fov=x` is `camera.fov=x`, and
/// `--memory-limit` is `memory_limit`.
pub(crate) fn in_python(message: &str) -> String {
    let mut words = message.to_owned();
    for (option, keyword) in OPTIONS {
        words = words.replace(option, keyword);
    }
    // What follows a blank or a mark is an option, what follows a letter or a slash a part of a name.
    let starts = |before: &str| before.ends_with([' ', '`', '(', ',']) || before.is_empty();
    let mut message = String::with_capacity(words.len());
    let mut left = &*words;
    while let Some((before, after)) = left.split_once("--") {
        message.push_str(before);
        let length = after.find(|c: char| !(c.is_ascii_lowercase() || c == '-'));
        let (name, rest) = after.split_at(length.unwrap_or(after.len()));
        match starts(before) && !name.is_empty() {
            true => message.push_str(&name.replace('-', "_")),
            false => message.extend(["--", name]),
        }
        left = rest;
    }
    message + left
}
