//! COLMAP's binary files, in little-endian order: `images.bin` and `cameras.bin`
//! (`src/colmap/scene/reconstruction_io.cc`).

use super::model::Model;
use super::{Cameras, Image};

/// The bytes of a point that an image sees: two coordinates and a number.
const POINT_BYTES: u64 = 24;

/// The images. The error goes on after the file's name.
pub(in super::super) fn images(bytes: &[u8]) -> Result<Vec<Image>, String> {
    let mut rest = Rest { bytes, at: 0 };
    let mut images = Vec::new();
    for _ in 0..rest.long()? {
        let place = format!("at byte {}", rest.at);
        rest.word()?;
        let quaternion = rest.numbers()?;
        let translation = rest.numbers()?;
        let camera = rest.word()?;
        let name = rest.text()?;
        let points = rest.long()?;
        rest.skip(points.saturating_mul(POINT_BYTES))?;
        images.push(Image { place, quaternion, translation, camera, name });
    }
    rest.end()?;
    Ok(images)
}

/// The cameras. The error goes on after the file's name.
pub(in super::super) fn cameras(bytes: &[u8]) -> Result<Cameras, String> {
    let mut rest = Rest { bytes, at: 0 };
    let mut cameras = Cameras::new();
    for _ in 0..rest.long()? {
        let at = rest.at;
        let wrong = |why: String| format!("has at byte {at} {why}");
        let id = rest.word()?;
        let model = Model::by_number(i32::from_le_bytes(rest.take()?)).map_err(wrong)?;
        let mut side = || {
            let side = rest.long()?;
            u32::try_from(side)
                .map_err(|_| wrong(format!("a picture with a side of {side} pixels")))
        };
        let resolution = [side()?, side()?];
        let parameters =
            (0..model.count()).map(|_| rest.number()).collect::<Result<Vec<_>, _>>()?;
        cameras.insert(id, model.camera(resolution, &parameters).map_err(wrong)?);
    }
    rest.end()?;
    match cameras.is_empty() {
        true => Err("has no camera; export the model again, or remove the file".to_owned()),
        false => Ok(cameras),
    }
}

/// What is still to be read.
struct Rest<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Rest<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let taken = self.bytes[self.at..].first_chunk().copied().ok_or_else(|| self.cut_off())?;
        self.at += N;
        Ok(taken)
    }

    fn cut_off(&self) -> String {
        format!("ends inside what begins at byte {}; copy it again", self.at)
    }

    fn word(&mut self) -> Result<u32, String> {
        self.take().map(u32::from_le_bytes)
    }

    fn long(&mut self) -> Result<u64, String> {
        self.take().map(u64::from_le_bytes)
    }

    fn number(&mut self) -> Result<f64, String> {
        let at = self.at;
        let number = f64::from_le_bytes(self.take()?);
        let fault = || format!("has {number} at byte {at}, where a finite number is due");
        number.is_finite().then_some(number).ok_or_else(fault)
    }

    fn numbers<const N: usize>(&mut self) -> Result<[f64; N], String> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.number()?;
        }
        Ok(numbers)
    }

    /// Text up to a byte of zero.
    fn text(&mut self) -> Result<String, String> {
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(|&byte| byte == 0).ok_or_else(|| self.cut_off())?;
        self.at += length + 1;
        Ok(String::from_utf8_lossy(&rest[..length]).into_owned())
    }

    fn skip(&mut self, count: u64) -> Result<(), String> {
        let left = (self.bytes.len() - self.at) as u64;
        let count = usize::try_from(count).ok().filter(|_| count <= left);
        self.at += count.ok_or_else(|| self.cut_off())?;
        Ok(())
    }

    fn end(&self) -> Result<(), String> {
        match self.bytes.len() - self.at {
            0 => Ok(()),
            more => Err(format!("has {more} bytes after its last entry; is it COLMAP's?")),
        }
    }
}
