//! NPY: one layer as an array that `numpy.load` gives back as it was.
//!
//! Shape `[height, width]` for a layer of one channel, else `[height, width, channels]` in the
//! layer's own order of channels; `<f4`, `<f8`, `<u2` or `<u4`, little-endian, row-major. What the
//! numbers mean stands in the sidecar.
//!
//! Source of the format: NumPy Enhancement Proposal 1, *A Simple File Format for NumPy Arrays*.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use npyz::{DType, TypeStr, WriterBuilder};

use super::layer::LE_BAND;
use super::{Layer, OutputError, Picture};
use etendue_files::Transaction;

/// Writes the layer called `name` (empty for the picture itself) to `path`.
///
/// # Errors
///
/// When there is no such layer, or the file cannot be written.
pub fn write(
    files: &Transaction,
    path: &Path,
    picture: &Picture,
    name: &str,
) -> Result<(), OutputError> {
    let layer = picture.require(name)?;
    Ok(files.write(path, |part| {
        let mut file = BufWriter::with_capacity(1 << 20, part);
        write_header(&mut file, picture, layer)?;
        write_values(&mut file, picture.width() * picture.height(), layer)?;
        file.flush()
    })?)
}

/// Writes `values` as an array of any number of dimensions, row-major.
///
/// # Errors
///
/// When the file cannot be written.
pub fn write_array(
    files: &Transaction,
    path: &Path,
    shape: &[u64],
    values: &[f32],
) -> Result<(), OutputError> {
    Ok(files.write(path, |part| {
        let mut file = BufWriter::with_capacity(1 << 20, part);
        header(&mut file, "<f4", shape)?;
        for value in values {
            file.write_all(&value.to_le_bytes())?;
        }
        file.flush()
    })?)
}

fn write_header(file: &mut impl Write, picture: &Picture, layer: &Layer) -> io::Result<()> {
    let mut shape = vec![picture.height() as u64, picture.width() as u64];
    if layer.channels.len() > 1 {
        shape.push(layer.channels.len() as u64);
    }
    header(file, &format!("<{}", layer.type_name()), &shape)
}

fn header(file: &mut impl Write, dtype: &str, shape: &[u64]) -> io::Result<()> {
    let dtype: TypeStr = dtype
        .parse()
        .map_err(|error| io::Error::new(io::ErrorKind::InvalidInput, format!("{error}")))?;
    npyz::WriteOptions::new_header_only()
        .dtype(DType::Plain(dtype))
        .shape(shape)
        .writer(file)
        .write_header_only()
        .map(drop)
}

/// Channels are woven together a band of pixels at a time.
fn write_values(file: &mut impl Write, pixels: usize, layer: &Layer) -> io::Result<()> {
    let value_bytes = layer.channels.first().map_or(0, |channel| channel.values.value_bytes());
    let stride = value_bytes * layer.channels.len();
    let mut bytes = Vec::new();
    for start in (0..pixels).step_by(LE_BAND) {
        let end = pixels.min(start + LE_BAND);
        bytes.resize((end - start) * stride, 0);
        for (k, channel) in layer.channels.iter().enumerate() {
            channel.values.put_le(start..end, &mut bytes[k * value_bytes..], stride);
        }
        file.write_all(&bytes)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::{Channel, Look, Values};
    use super::*;

    fn read(values: Vec<Values>) -> npyz::NpyFile<io::Cursor<Vec<u8>>> {
        let pixels = values[0].len();
        let channels = values
            .into_iter()
            .zip(["X", "Y", "Z"])
            .map(|(values, name)| Channel { name: name.into(), values });
        let look = Look::Extent;
        let layer =
            Layer { name: "P".into(), look, channels: channels.collect(), meaning: Vec::new() };
        let picture = Picture::new(pixels / 2, 2, vec![layer], Vec::new()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.npy");
        write(&Transaction::at_once(), &path, &picture, "P").unwrap();
        npyz::NpyFile::new(io::Cursor::new(fs::read(path).unwrap())).unwrap()
    }

    #[test]
    fn one_channel_is_a_plane() {
        let file = read(vec![Values::U16((0..6).collect())]);
        assert_eq!(file.shape(), [2, 3]);
        assert_eq!(file.into_vec::<u16>().unwrap(), [0, 1, 2, 3, 4, 5]);
    }

    #[test]
    fn channels_are_the_last_axis() {
        // More pixels than a band, so that channels are woven across its end.
        let pixels = 2 * (LE_BAND / 2 + 5);
        let plane = |k: usize| (0..pixels).map(|i| (i * 3 + k) as f64).collect::<Vec<_>>();
        let file = read((0..3).map(|k| Values::F64(plane(k))).collect());
        assert_eq!(file.shape(), [2, pixels as u64 / 2, 3]);
        let expected: Vec<f64> = (0..pixels * 3).map(|i| i as f64).collect();
        assert!(file.into_vec::<f64>().unwrap() == expected);
    }

    #[test]
    fn an_unknown_layer_is_refused_with_those_there_are() {
        let channels = vec![Channel { name: "Z".into(), values: Values::F32(vec![1.0]) }];
        let layer =
            Layer { name: "Depth".into(), look: Look::Distance, channels, meaning: Vec::new() };
        let picture = Picture::new(1, 1, vec![layer], Vec::new()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let error =
            write(&Transaction::at_once(), &folder.path().join("a.npy"), &picture, "Normal")
                .unwrap_err();
        assert_eq!(error.to_string(), "the picture has no layer \"Normal\"; it has \"Depth\"");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
