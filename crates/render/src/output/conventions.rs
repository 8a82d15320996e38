//! Layers as benchmarks and their tools keep them: 16-bit depth and disparity, flow, indexed masks.
//!
//! Sources: Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems", 2012 (depth times 5000);
//! Menze and Geiger, "Object Scene Flow for Autonomous Vehicles", 2015, and KITTI's development kits (depth
//! and disparity times 256, flow times 64 above 2¹⁵); Baker et al., "A Database and Evaluation Methodology
//! for Optical Flow", 2011 (`.flo`).

use std::io::{BufWriter, Write};
use std::path::Path;

use super::look::{Bits, ColourType, LayerImage, fill, indices};
use super::{Layer, OutputError, Picture, png};
use crate::losses::Losses;
use crate::memory::NoMemory;
use etendue_files::Transaction;

/// Numbers a metre in TUM's depth images.
pub const TUM_DEPTH: f64 = 5000.0;

/// Numbers a metre in KITTI's depth images, and a pixel in its disparities.
pub const KITTI_DEPTH: f64 = 256.0;

/// Numbers a pixel in KITTI's flow, of which 0 stands at 2¹⁵.
pub const KITTI_FLOW: f64 = 64.0;

/// Value of unknown pixels in `.flo` files: anything above 10⁹.
const UNKNOWN: f32 = 1e10;

/// The layer as 16-bit PNG of `factor` a unit.
pub(super) fn write_scaled(
    files: &Transaction,
    path: &Path,
    picture: &Picture,
    layer: &Layer,
    factor: f64,
    unit: &str,
) -> Result<(), OutputError> {
    png::write_shown(files, path, picture, layer, &scaled(layer, factor, unit)?)
}

/// The layer as KITTI's flow.
pub(super) fn write_flow(
    files: &Transaction,
    path: &Path,
    picture: &Picture,
    layer: &Layer,
) -> Result<(), OutputError> {
    png::write_shown(files, path, picture, layer, &flow(layer)?)
}

/// The numbers of the layer as indices of a palette; `false` where they do not fit.
pub(super) fn write_indexed(
    files: &Transaction,
    path: &Path,
    picture: &Picture,
    layer: &Layer,
) -> Result<bool, OutputError> {
    let Some(shown) = indices(layer)? else { return Ok(false) };
    png::write_shown(files, path, picture, layer, &shown).map(|()| true)
}

/// The nearest of `1..=65535`; 0 where it is another number.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within 1 to 65535")]
fn sixteen_bits(value: f64) -> u16 {
    let rounded = value.round();
    if (1.0..=65535.0).contains(&rounded) { rounded as u16 } else { 0 }
}

fn scaled(layer: &Layer, factor: f64, unit: &str) -> Result<LayerImage, NoMemory> {
    let plane = &layer.channels[0].values;
    let bytes = fill(&[plane], |i| [sixteen_bits(plane.at(i) * factor).to_be_bytes()])?;
    let most = 65535.0 / factor;
    let note = format!(
        "data: {unit} times {factor}; 0 is nothing, and what is not above 0 or beyond {most:.3} {unit}"
    );
    Ok(LayerImage { channels: ColourType::Grey, bits: Bits::Sixteen, bytes, is_data: true, note })
}

/// Number of the layer's hits that become 0 in 16 bits of `factor` a unit.
pub(super) fn lost_by_scaling(layer: &Layer, factor: f64) -> Losses {
    let plane = &layer.channels[0].values;
    let hits = (0..plane.len()).map(|i| plane.at(i)).filter(|value| value.is_finite());
    Losses::count(hits.map(|value| sixteen_bits(value * factor) == 0))
}

/// Number of the layer's hits that KITTI's flow has as unknown.
pub(super) fn lost_by_flow(layer: &Layer) -> Losses {
    let [x, y] = [0, 1].map(|k| &layer.channels[k].values);
    let hits = (0..x.len()).map(|i| [x.at(i), y.at(i)]).filter(|[u, v]| (u + v).is_finite());
    Losses::count(hits.map(|flow| kitti_flow(flow)[2] == 0))
}

/// The three numbers of a pixel.
fn kitti_flow(flow: [f64; 2]) -> [u16; 3] {
    let [u, v] = flow.map(|part| sixteen_bits(part * KITTI_FLOW + 32768.0));
    if u == 0 || v == 0 { [0; 3] } else { [u, v, 1] }
}

fn flow(layer: &Layer) -> Result<LayerImage, NoMemory> {
    let [x, y] = [0, 1].map(|k| &layer.channels[k].values);
    let bytes = fill(&[x], |i| kitti_flow([x.at(i), y.at(i)]).map(u16::to_be_bytes))?;
    let note = format!(
        "data: red and green are 32768 + {KITTI_FLOW} times the flow right and down (pixels), blue is 1 \
         where it is known; flow of 512 pixels and more is not"
    );
    Ok(LayerImage { channels: ColourType::Rgb, bits: Bits::Sixteen, bytes, is_data: true, note })
}

/// `PIEH`, columns and rows, and two little-endian floats a pixel.
pub(super) fn write_flo(
    files: &Transaction,
    path: &Path,
    picture: &Picture,
    layer: &Layer,
) -> Result<(), OutputError> {
    let [x, y] = [0, 1].map(|k| &layer.channels[k].values);
    let side = |side: usize| {
        i32::try_from(side)
            .map_err(|_| OutputError::format(path, "a side is longer than 2147483647"))
    };
    let (width, height) = (side(picture.width())?, side(picture.height())?);
    Ok(files.write(path, |part| {
        let mut file = BufWriter::new(part);
        file.write_all(b"PIEH")?;
        file.write_all(&width.to_le_bytes())?;
        file.write_all(&height.to_le_bytes())?;
        for i in 0..x.len() {
            for plane in [x, y] {
                #[expect(clippy::cast_possible_truncation, reason = "the format's precision")]
                let flow = plane.at(i) as f32;
                let flow = if flow.is_finite() { flow } else { UNKNOWN };
                file.write_all(&flow.to_le_bytes())?;
            }
        }
        file.flush()
    })?)
}

#[cfg(test)]
mod tests {
    use super::super::{Channel, LayerFile, Look, Values};
    use super::*;

    fn picture(name: &str, look: Look, planes: Vec<Values>) -> Picture {
        let channel = |(k, values): (usize, Values)| Channel { name: ["X", "Y"][k].into(), values };
        let channels = planes.into_iter().enumerate().map(channel).collect();
        let layer = Layer { name: name.into(), look, channels, meaning: Vec::new() };
        Picture::new(4, 1, vec![layer], Vec::new()).unwrap()
    }

    fn read(manner: LayerFile, picture: &Picture, name: &str) -> image::DynamicImage {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        assert!(manner.write(&Transaction::at_once(), &path, picture, name).unwrap());
        image::open(&path).unwrap()
    }

    #[test]
    fn depth_is_sixteen_bits_of_a_stated_factor() {
        let depth = Values::F64(vec![1.0, 2.5, f64::INFINITY, 14.0]);
        let picture = picture("Depth", Look::Distance, vec![depth]);
        let image::DynamicImage::ImageLuma16(tum) = read(LayerFile::TumDepth, &picture, "Depth")
        else {
            panic!("16 bits, grey")
        };
        // 14 m is beyond 13.107 m.
        assert_eq!(tum.into_raw(), [5000, 12500, 0, 0]);
        let kitti = read(LayerFile::KittiDepth, &picture, "Depth").into_luma16();
        assert_eq!(kitti.into_raw(), [256, 640, 0, 3584]);
    }

    #[test]
    fn flow_is_kittis_and_middleburys() {
        let x = Values::F64(vec![0.0, -1.5, f64::INFINITY, 600.0]);
        let y = Values::F64(vec![1.0, 0.25, f64::INFINITY, 0.0]);
        let picture = picture("Flow", Look::Extent, vec![x, y]);
        let image::DynamicImage::ImageRgb16(kitti) = read(LayerFile::KittiFlow, &picture, "Flow")
        else {
            panic!("16 bits, three channels")
        };
        let expected = [[32768, 32832, 1], [32672, 32784, 1], [0, 0, 0], [0, 0, 0]];
        assert_eq!(kitti.into_raw(), expected.as_flattened());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.flo");
        assert!(LayerFile::Flo.write(&Transaction::at_once(), &path, &picture, "Flow").unwrap());
        let bytes = std::fs::read(&path).unwrap();
        let float = |i: usize| f32::from_le_bytes(bytes[4 * i..4 * i + 4].try_into().unwrap());
        // The sanity check of the benchmark's own reader.
        assert_eq!(float(0), 202_021.25);
        assert_eq!((&bytes[4..12], bytes.len()), (&[4, 0, 0, 0, 1, 0, 0, 0][..], 12 + 32));
        assert_eq!([3, 4, 5, 6, 7].map(float), [0.0, 1.0, -1.5, 0.25, 1e10]);
    }

    #[test]
    fn masks_are_indices_of_a_palette_as_long_as_they_fit() {
        let ids =
            |largest| picture("Id.object", Look::Ids, vec![Values::U32(vec![0, 1, 2, largest])]);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        assert!(
            LayerFile::Indexed
                .write(&Transaction::at_once(), &path, &ids(255), "Id.object")
                .unwrap()
        );
        let decoder =
            ::png::Decoder::new(std::io::BufReader::new(std::fs::File::open(&path).unwrap()));
        let mut reader = decoder.read_info().unwrap();
        assert_eq!(reader.info().color_type, ::png::ColorType::Indexed);
        assert_eq!(reader.info().palette.as_ref().unwrap().len(), 3 * 256);
        let mut bytes = [0; 4];
        reader.next_frame(&mut bytes).unwrap();
        assert_eq!(bytes, [0, 1, 2, 255]);
        assert!(
            !LayerFile::Indexed
                .write(&Transaction::at_once(), &path, &ids(256), "Id.object")
                .unwrap()
        );
    }
}
