//! Limits of what an image may take, the coarseness that it may have for that, and refusals of those that take more.

/// Side of the largest image that is decoded (texels).
pub const MOST_SIDE: u64 = 32_768;

/// Bytes that the largest image takes when it is decoded: 16 384 × 16 384 texels of 16-bit RGBA.
pub const MOST_BYTES: u64 = 1 << 31;

/// Permitted coarseness of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coarseness {
    /// The least width over which it is averaged whenever it is looked up, as a share of its shorter side.
    pub footprint: f64,
    /// True if integers are colours by the sRGB curve; else they are shares of full scale.
    pub is_srgb: bool,
}

impl Coarseness {
    /// Number of times that both sides may be halved, so that no texel is wider than what is averaged over.
    #[must_use]
    pub fn halvings(&self, size: [usize; 2]) -> u32 {
        let [width, height] = size;
        if width == 0 || height == 0 {
            return 0;
        }
        let even = width.trailing_zeros().min(height.trailing_zeros());
        let texels = self.footprint * width.min(height) as f64;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "it saturates")]
        let allowed = texels.log2().floor().max(0.0) as u32;
        allowed.min(even)
    }
}

/// The most that an image may take, and how coarse it may be for that.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Bytes of its decoded values.
    pub bytes: u64,
    /// Bytes of its file, which are out of proportion to much more.
    pub(crate) file: u64,
    /// As coarse as it may be decoded; as fine as its file where absent.
    pub(crate) coarse: Option<Coarseness>,
}

/// Bytes that an image may take, however small its file is.
const MADE_OF_NOTHING: u64 = 128 << 20;

/// As many more for each byte of its file: what deflate makes of one colour all over, 1032 to 1.
const MADE_PER_BYTE: u64 = 1024;

impl Default for Limits {
    fn default() -> Self {
        Self { bytes: MOST_BYTES, file: u64::MAX, coarse: None }
    }
}

impl Limits {
    /// [`MOST_BYTES`], or less where a whole render may not take as much.
    #[must_use]
    pub fn within(memory: Option<u64>) -> Self {
        Self { bytes: memory.unwrap_or(MOST_BYTES).min(MOST_BYTES), ..Self::default() }
    }

    /// Returns the limits for an image that may be as coarse: it is decoded in linear light, in as few texels.
    #[must_use]
    pub fn coarse(self, coarse: Option<Coarseness>) -> Self {
        Self { coarse, ..self }
    }

    /// Returns the limits, with no more than is in proportion to the `file`'s bytes.
    pub(crate) fn of(self, file: &[u8]) -> Self {
        Self { file: file.len() as u64, ..self }
    }

    /// The number of texels of an image of `width` × `height`, each of which takes `texel` bytes.
    pub(crate) fn judge(self, [width, height]: [u64; 2], texel: u64) -> Result<usize, DecodeError> {
        if width == 0 || height == 0 {
            return Err(DecodeError::Refused(format!("it has {width} x {height} texels")));
        }
        if width > MOST_SIDE || height > MOST_SIDE {
            return Err(DecodeError::Side { width, height });
        }
        let bytes = width * height * texel;
        if bytes > self.bytes {
            return Err(DecodeError::Size { width, height, bytes, most: self.bytes });
        }
        if bytes > MADE_OF_NOTHING.saturating_add(self.file.saturating_mul(MADE_PER_BYTE)) {
            return Err(DecodeError::Refused(format!(
                "it has {width} x {height} texels, which take {:.2} GB decoded, out of all proportion to the {} \
                 bytes of the file: make it smaller",
                giga(bytes),
                self.file
            )));
        }
        usize::try_from(width * height).map_err(|_| DecodeError::Memory { bytes })
    }
}

/// Error of an image that could not be decoded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DecodeError {
    /// It is too wide or too high.
    #[error(
        "it has {width} x {height} texels, and {MOST_SIDE} a side are the most: make it smaller"
    )]
    Side {
        /// Columns.
        width: u64,
        /// Rows.
        height: u64,
    },
    /// It takes too much memory.
    #[error(
        "it has {width} x {height} texels, which take {:.2} GB decoded, and {:.2} GB are the most: \
         make it smaller{}",
        giga(*bytes),
        giga(*most),
        if *most < MOST_BYTES { ", or raise --memory-limit" } else { "" }
    )]
    Size {
        /// Columns.
        width: u64,
        /// Rows.
        height: u64,
        /// Bytes that it takes.
        bytes: u64,
        /// Bytes that it may take.
        most: u64,
    },
    /// The system has less memory than it takes.
    #[error("it takes {:.2} GB decoded, and the system has less: make it smaller", giga(*bytes))]
    Memory {
        /// Bytes that it takes.
        bytes: u64,
    },
    /// The decoder says so.
    #[error(transparent)]
    Decoder(#[from] image::ImageError),
    /// The decoder of EXR files says so.
    #[error(transparent)]
    OpenExr(#[from] exr::error::Error),
    /// It is a JPEG file without an end, of which the decoder makes up the rest.
    #[error("it is cut off: a JPEG ends with a marker of its own, which is not there")]
    Cut,
    /// Anything else: the sentence goes on after the file's name.
    #[error("{0}")]
    Refused(String),
}

impl DecodeError {
    /// Error of an EXR file without the channels of a colour.
    #[must_use]
    pub fn no_color() -> Self {
        let why = "it has no channels R, G and B, nor Y, nor a single one (multi-part and deep data are not read)";
        Self::Refused(why.to_owned())
    }

    /// Error of a decoder that gave up with a panic.
    pub(crate) fn panicked() -> Self {
        let why = "its decoder failed: the file is damaged, or of a kind that it does not know";
        Self::Refused(why.to_owned())
    }
}

fn giga(bytes: u64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "a number to be read")]
    let bytes = bytes as f64;
    bytes / 1e9
}

/// Room for so many values.
///
/// # Errors
///
/// When the system has no memory for them.
pub fn room<T>(count: usize) -> Result<Vec<T>, DecodeError> {
    let mut values = Vec::new();
    let bytes = (count as u64).saturating_mul(size_of::<T>() as u64);
    values.try_reserve_exact(count).map_err(|_| DecodeError::Memory { bytes })?;
    Ok(values)
}
