//! Where the copies of an object stand: transforms of the scene file, or an NPY file of matrices.
//!
//! The file is what `numpy.save` writes of an array `[copy][row][column]`, so a million copies cost
//! 128 MB and no parsing.

use std::path::{Path, PathBuf};

use etendue_files::{InputFolder, MappedFile};
use etendue_geometry::Transform;
use rayon::prelude::*;

use crate::error::not_found;
use crate::file::{InstancesSpec, TransformSpec, join, join_index};
use crate::memory::has_room;
use crate::npy;

/// The copies of an object.
#[derive(Debug)]
pub(crate) struct Instances {
    /// Where each stands, before the object's own transform.
    pub(crate) transforms: Vec<Transform>,
    /// The file that says so.
    pub(crate) file: Option<PathBuf>,
}

impl Instances {
    /// The copies that a scene file asks for. `at` is the JSON path of
    /// the list; the error is the path of what is wrong, and the reason. So many copies as `fits` refuses are
    /// not made.
    pub(crate) fn resolve(
        spec: Option<&InstancesSpec>,
        at: &str,
        folder: &InputFolder,
        fits: &dyn Fn(u64) -> Result<(), String>,
    ) -> Result<Self, (String, String)> {
        match spec {
            None => Ok(Self { transforms: vec![Transform::IDENTITY], file: None }),
            Some(InstancesSpec::List(list)) => {
                fits(list.len() as u64).map_err(|why| (at.to_owned(), why))?;
                let built = list.iter().enumerate().map(|(index, spec)| {
                    spec.build().map_err(|(key, why)| {
                        let at = join_index(at, index);
                        (if key.is_empty() { at } else { join(&at, key) }, why)
                    })
                });
                Ok(Self { transforms: built.collect::<Result<_, _>>()?, file: None })
            }
            Some(InstancesSpec::File(written)) => {
                let fault = |why: String| (at.to_owned(), why);
                let path = folder.find(written).map_err(|error| fault(not_found(error)))?.path;
                let transforms =
                    read(&path, fits).map_err(|why| fault(format!("\"{written}\" {why}")))?;
                Ok(Self { transforms, file: Some(path) })
            }
        }
    }
}

/// The matrices of an NPY file; the error goes on after the file's name.
fn read(path: &Path, fits: &dyn Fn(u64) -> Result<(), String>) -> Result<Vec<Transform>, String> {
    let map = MappedFile::open(path).map_err(|error| format!("cannot be read: {error}"))?;
    let array = npy::read(map.bytes(), |shape| match shape {
        [_, 3 | 4, 4] => Ok(()),
        other => Err(format!("has the shape {other:?} instead of n × 4 × 4 or n × 3 × 4")),
    })?;
    let [count, rows] = [array.shape[0], array.shape[1]];
    fits(count as u64)?;
    // They are made side by side with what is wrong with them, and then kept alone.
    if !has_room(2 * count as u64 * size_of::<Transform>() as u64) {
        return Err(format!("holds {count} matrices, and the system has no memory for them"));
    }
    let transforms = array.numbers.par_chunks_exact(4 * rows).enumerate().map(|(index, matrix)| {
        of_rows(matrix).build().map_err(|(_, why)| format!("has a matrix {index} that {why}"))
    });
    // In order, so that the first fault of the file is the one that is told.
    transforms.collect::<Vec<_>>().into_iter().collect()
}

/// A matrix of three or four rows of four.
fn of_rows(numbers: &[f64]) -> TransformSpec {
    let mut matrix = [[0.0, 0.0, 0.0, 1.0]; 4];
    for (row, numbers) in matrix.iter_mut().zip(numbers.chunks_exact(4)) {
        row.copy_from_slice(numbers);
    }
    TransformSpec { matrix: Some(matrix), ..TransformSpec::default() }
}
