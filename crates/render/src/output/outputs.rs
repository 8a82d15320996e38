//! Kinds of file that a render leaves.

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
    /// Masks of what each copy of an object covers, in COCO's file: see [`crate::annotations`].
    pub coco: bool,
    /// Masks of the copies with poses, models and masks in BOP's folder.
    pub bop: bool,
    /// Names by their shares of each pixel, as Cryptomatte.
    pub cryptomatte: bool,
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
        coco: false,
        bop: false,
        cryptomatte: false,
        denoised: false,
    };

    /// All but what only single benchmarks read.
    pub const ALL: Self = Self { exr: true, png: true, npy: true, dng: true, ..Self::NONE };

    /// True if the scene's copies are told apart in files of their own.
    #[must_use]
    pub fn annotates(self) -> bool {
        self.coco || self.bop
    }

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
                "coco" => &mut outputs.coco,
                "bop" => &mut outputs.bop,
                "cryptomatte" => &mut outputs.cryptomatte,
                other => {
                    return Err(format!(
                        "unknown kind \"{other}\"; known: exr, png, npy, dng, tum, kitti, flo, indexed, \
                         envi, coco, bop, cryptomatte"
                    ));
                }
            };
            *wanted = true;
        }
        Ok(outputs)
    }
}
