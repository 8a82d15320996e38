//! Which kinds of file a render leaves.

/// The kinds of file to write.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Outputs {
    /// All layers in one EXR.
    pub exr: bool,
    /// A picture or preview of each layer.
    pub png: bool,
    /// An array of each layer.
    pub npy: bool,
    /// Raw files of a sensor.
    pub dng: bool,
    /// Depth as 16-bit PNG of the TUM RGB-D benchmark.
    pub tum: bool,
    /// Depth, disparity and flow as 16-bit PNG of KITTI.
    pub kitti: bool,
    /// Flow as `.flo` files.
    pub flo: bool,
    /// Numbers of things as PNG with a palette.
    pub indexed: bool,
    /// Light in bands as an ENVI cube.
    pub envi: bool,
    /// The picture without its noise, as a layer beside it and as the picture's PNG: see
    /// [`crate::denoise`].
    pub denoised: bool,
}

impl Outputs {
    /// Nothing.
    pub const NONE: Self = Self {
        exr: false,
        png: false,
        npy: false,
        dng: false,
        tum: false,
        kitti: false,
        flo: false,
        indexed: false,
        envi: false,
        denoised: false,
    };

    /// All but what only single benchmarks read.
    pub const ALL: Self = Self { exr: true, png: true, npy: true, dng: true, ..Self::NONE };

    /// From a comma-separated list such as `exr,png`.
    ///
    /// # Errors
    ///
    /// When a name is unknown or the list is empty; the message names the known ones.
    pub fn from_list(list: &str) -> Result<Self, String> {
        let mut outputs = Self::NONE;
        for name in list.split(',').map(str::trim) {
            let wanted = match name {
                "exr" => &mut outputs.exr,
                "png" => &mut outputs.png,
                "npy" => &mut outputs.npy,
                "dng" => &mut outputs.dng,
                "tum" => &mut outputs.tum,
                "kitti" => &mut outputs.kitti,
                "flo" => &mut outputs.flo,
                "indexed" => &mut outputs.indexed,
                "envi" => &mut outputs.envi,
                other => {
                    return Err(format!(
                        "unknown kind \"{other}\"; known: exr, png, npy, dng, tum, kitti, flo, indexed, \
                         envi"
                    ));
                }
            };
            *wanted = true;
        }
        Ok(outputs)
    }
}
