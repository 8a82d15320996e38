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
}

impl Outputs {
    /// All of them.
    pub const ALL: Self = Self { exr: true, png: true, npy: true, dng: true };

    /// From a comma-separated list such as `exr,png`.
    ///
    /// # Errors
    ///
    /// When a name is unknown or the list is empty; the message names the known ones.
    pub fn from_list(list: &str) -> Result<Self, String> {
        let mut outputs = Self { exr: false, png: false, npy: false, dng: false };
        for name in list.split(',').map(str::trim) {
            match name {
                "exr" => outputs.exr = true,
                "png" => outputs.png = true,
                "npy" => outputs.npy = true,
                "dng" => outputs.dng = true,
                other => {
                    return Err(format!("unknown kind \"{other}\"; known: exr, png, npy, dng"));
                }
            }
        }
        Ok(outputs)
    }
}
