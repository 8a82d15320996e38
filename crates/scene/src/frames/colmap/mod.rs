//! COLMAP's sparse models, as text or binary: the poses of `images`, and the intrinsics of the `cameras` beside it
//! (<https://colmap.github.io/format.html>).

mod binary;
mod model;
mod text;

use std::collections::BTreeMap;

use etendue_camera::{Convention, Maps, PoseSpec};

use super::Station;
use super::intrinsics::FileCamera;

pub(super) use binary::{cameras as binary_cameras, images as binary_images};
pub(super) use text::{cameras as text_cameras, images as text_images};

/// An image that was reconstructed.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Image {
    /// Where it stands in its file, as sentences go on: `in line 3`.
    place: String,
    /// World to camera, the real part first.
    quaternion: [f64; 4],
    /// World to camera.
    translation: [f64; 3],
    /// The number of its camera.
    camera: u32,
    name: String,
}

/// Cameras by their numbers.
pub(super) type Cameras = BTreeMap<u32, FileCamera>;

/// The images in the order of their names, as COLMAP's own tools have them; without `cameras` they have the
/// scene's. The error goes on after the name of the file of images.
pub(super) fn stations(
    mut images: Vec<Image>,
    cameras: Option<&Cameras>,
) -> Result<Vec<Station>, String> {
    images.sort_by(|a, b| a.name.cmp(&b.name));
    let station = |image: Image| {
        let Image { place, quaternion: [w, x, y, z], translation, camera, .. } = image;
        let pose = PoseSpec::Quaternion {
            quaternion: [x, y, z, w],
            translation,
            maps: Maps::CameraFromWorld,
            convention: Convention::Opencv,
        };
        let settings = match cameras.map(|cameras| cameras.get(&camera)) {
            None => Vec::new(),
            Some(Some(of)) => of
                .settings()
                .map_err(|why| format!("names camera {camera} {place}, which has {why}"))?,
            Some(None) => {
                return Err(format!(
                    "names camera {camera} {place}, and the file of cameras beside it has none of that number"
                ));
            }
        };
        Ok(Station { settings, ..Station::new(pose) })
    };
    images.into_iter().map(station).collect()
}
