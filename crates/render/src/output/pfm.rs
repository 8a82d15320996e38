//! PFM: one plane of 32-bit floats, as stereo and light-field benchmarks keep disparities.
//!
//! `Pf`, width and height, −1 for little-endian, and rows from the bottom up (P. Debevec's format).

use std::io::{BufWriter, Write};
use std::path::Path;

use super::OutputError;
use etendue_files::Transaction;

/// Writes `values` of columns and rows `size`, row by row from the top.
///
/// # Errors
///
/// When the file cannot be written.
pub fn write(
    files: &Transaction,
    path: &Path,
    size: [u32; 2],
    values: &[f64],
) -> Result<(), OutputError> {
    let [width, height] = size;
    Ok(files.write(path, |part| {
        let mut file = BufWriter::new(part);
        write!(file, "Pf\n{width} {height}\n-1.0\n")?;
        for row in values.chunks(width.max(1) as usize).rev() {
            for value in row {
                #[expect(clippy::cast_possible_truncation, reason = "the format's precision")]
                let value = *value as f32;
                file.write_all(&value.to_le_bytes())?;
            }
        }
        file.flush()
    })?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_stand_from_the_bottom_up() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.pfm");
        write(&Transaction::at_once(), &path, [2, 2], &[1.0, 2.0, 3.0, f64::INFINITY]).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert_eq!(&bytes[..12], b"Pf\n2 2\n-1.0\n");
        let numbers: Vec<f32> =
            bytes[12..].chunks(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
        assert_eq!(numbers, [3.0, f32::INFINITY, 1.0, 2.0]);
    }
}
