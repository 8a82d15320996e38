#![expect(unsafe_code, reason = "Open Image Denoise's C interface, found at run time")]
#![doc = include_str!("../README.md")]
//!
//! The library is what the environment variable `ETENDUE_OIDN` names (a path), or else what the dynamic
//! loader finds as `libOpenImageDenoise.so.2`, `.so.1` or `.so`. Versions from 1.4 on are understood.
//!
//! # Sources
//!
//! * Áfra, *Intel Open Image Denoise*, <https://www.openimagedenoise.org/documentation.html>: the filter
//!   `RT`, and guides that lose their own noise first ("prefiltering").

mod api;

use std::ffi::{CStr, c_char, c_int, c_void};
use std::fmt;
use std::ptr::{self, NonNull};

use api::Api;

pub use api::OidnError;

/// Knowledge of the first surfaces that a picture shows. Each image has three values a pixel, row by
/// row, and may have noise of its own.
#[derive(Debug, Clone)]
pub struct Guides {
    /// Their colours, independent of light and direction, 0..=1.
    pub albedo: Vec<f32>,
    /// Their normals, each value −1..=1; zero where there is none.
    pub normal: Vec<f32>,
}

/// Open Image Denoise on the processor.
pub struct Denoiser {
    api: Api,
    device: NonNull<c_void>,
    version: String,
}

// SAFETY: the functions of Open Image Denoise may be called from any thread; calls of one device wait for
// each other inside of it (its documentation, "Open Image Denoise API").
unsafe impl Send for Denoiser {}
// SAFETY: as above.
unsafe impl Sync for Denoiser {}

impl fmt::Debug for Denoiser {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Denoiser").field("version", &self.version).finish_non_exhaustive()
    }
}

/// `OIDN_DEVICE_TYPE_CPU`.
const CPU: c_int = 1;

/// `OIDN_FORMAT_FLOAT3`.
const FLOAT3: c_int = 3;

/// The number of the oldest version with guides that lose their noise first: 1.4.0.
const OLDEST: c_int = 10_400;

impl Denoiser {
    /// Loads the library and opens its device, which works on `threads` threads.
    ///
    /// # Errors
    ///
    /// When there is no library, or none that works on this machine.
    pub fn open(threads: usize) -> Result<Self, OidnError> {
        let (api, library) = api::find()?;
        let unusable = |why: String| OidnError::Unusable { library: library.clone(), why };
        // SAFETY: the type of device is one of the interface's.
        let device = NonNull::new(unsafe { (api.new_device)(CPU) });
        let device = device.ok_or_else(|| unusable("it makes no device".to_owned()))?;
        let mut denoiser = Self { api, device, version: String::new() };
        // SAFETY: the device is valid until the denoiser is dropped, and the names are strings of C. Its
        // own threads are not bound to processors, which others use as well.
        unsafe {
            let threads = c_int::try_from(threads).unwrap_or(0);
            (denoiser.api.set_device_int)(device.as_ptr(), c"numThreads".as_ptr(), threads);
            (denoiser.api.set_device_bool)(device.as_ptr(), c"setAffinity".as_ptr(), false);
            (denoiser.api.commit_device)(device.as_ptr());
        }
        if let Some(why) = denoiser.error() {
            return Err(unusable(why));
        }
        // SAFETY: as above.
        let number = unsafe { (denoiser.api.device_int)(device.as_ptr(), c"version".as_ptr()) };
        denoiser.version = format!("{}.{}.{}", number / 10_000, number / 100 % 100, number % 100);
        if number < OLDEST {
            return Err(unusable(format!("it is version {}", denoiser.version)));
        }
        Ok(denoiser)
    }

    /// The version of the library, as `2.5.1`.
    #[must_use]
    pub fn version(&self) -> &str {
        &self.version
    }

    /// Takes the noise out of `color`, linear light of any range in red, green and blue, row by row, in
    /// place. Values that are negative count as 0. With `guides`, edges of surfaces and patterns on them
    /// are kept.
    ///
    /// # Errors
    ///
    /// When an image has another number of values than three a pixel, or the library fails.
    pub fn denoise(
        &self,
        size: [usize; 2],
        color: &mut [f32],
        guides: Option<Guides>,
    ) -> Result<(), OidnError> {
        let mut guides = guides;
        if let Some(Guides { albedo, normal }) = &mut guides {
            for (name, image) in [(c"albedo", albedo), (c"normal", normal)] {
                let filter = FilterHandle::new(self)?;
                let data = checked(size, image)?;
                // SAFETY: the image has the pixels of `size`, and lives until the filter has run.
                unsafe {
                    filter.set_image(name, data, size);
                    filter.set_image(c"output", data, size);
                }
                filter.run()?;
            }
        }
        let filter = FilterHandle::new(self)?;
        let data = checked(size, color)?;
        // SAFETY: the images have the pixels of `size`, which was checked of the guides above, and live until
        // the filter has run: `guides` is not touched before.
        unsafe {
            filter.set_image(c"color", data, size);
            filter.set_image(c"output", data, size);
            if let Some(Guides { albedo, normal }) = &mut guides {
                filter.set_image(c"albedo", albedo.as_mut_ptr(), size);
                filter.set_image(c"normal", normal.as_mut_ptr(), size);
                filter.set_bool(c"cleanAux");
            }
            filter.set_bool(c"hdr");
        }
        filter.run()
    }

    /// The failure that the library reports since it was last asked.
    fn error(&self) -> Option<String> {
        let mut message: *const c_char = ptr::null();
        // SAFETY: the device is valid, and `message` takes a pointer to a string of the library's, which is
        // copied before the next call.
        let code = unsafe { (self.api.device_error)(self.device.as_ptr(), &raw mut message) };
        if code == 0 {
            return None;
        }
        if message.is_null() {
            return Some(format!("error {code}"));
        }
        // SAFETY: a message that is not null is a string of C.
        Some(unsafe { CStr::from_ptr(message) }.to_string_lossy().into_owned())
    }

    fn failed(&self, why: String) -> OidnError {
        OidnError::Failed { version: self.version.clone(), why }
    }
}

impl Drop for Denoiser {
    fn drop(&mut self) {
        // SAFETY: the device is released once, and nothing of it is used afterwards.
        unsafe { (self.api.release_device)(self.device.as_ptr()) };
    }
}

/// Pointer to the values of an image of this size.
fn checked([width, height]: [usize; 2], image: &mut [f32]) -> Result<*mut f32, OidnError> {
    let wanted = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(3));
    match wanted {
        Some(wanted) if wanted == image.len() => Ok(image.as_mut_ptr()),
        _ => Err(OidnError::Size { width, height, found: image.len() }),
    }
}

/// A filter of a device, until it has run.
struct FilterHandle<'a> {
    denoiser: &'a Denoiser,
    handle: NonNull<c_void>,
}

impl<'a> FilterHandle<'a> {
    fn new(denoiser: &'a Denoiser) -> Result<Self, OidnError> {
        // SAFETY: the device is valid, and the name is a string of C.
        let handle = unsafe { (denoiser.api.new_filter)(denoiser.device.as_ptr(), c"RT".as_ptr()) };
        let handle = NonNull::new(handle).ok_or_else(|| {
            denoiser.failed(denoiser.error().unwrap_or_else(|| "it makes no filter".to_owned()))
        })?;
        Ok(Self { denoiser, handle })
    }

    /// Gives the filter an image to read or to write.
    ///
    /// # Safety
    ///
    /// `data` must hold three values a pixel of `size`, and live until the filter has run.
    unsafe fn set_image(&self, name: &CStr, data: *mut f32, [width, height]: [usize; 2]) {
        let api = &self.denoiser.api;
        // SAFETY: the filter is valid, and the caller answers for the image. Strides of 0 are those of
        // values side by side.
        unsafe {
            let (name, data) = (name.as_ptr(), data.cast());
            (api.set_image)(self.handle.as_ptr(), name, data, FLOAT3, width, height, 0, 0, 0);
        }
    }

    /// Turns a switch of the filter on.
    fn set_bool(&self, name: &CStr) {
        // SAFETY: the filter is valid, and the name is a string of C.
        unsafe { (self.denoiser.api.set_filter_bool)(self.handle.as_ptr(), name.as_ptr(), true) };
    }

    /// Runs it, and returns when it is done.
    fn run(self) -> Result<(), OidnError> {
        let api = &self.denoiser.api;
        // SAFETY: the filter is valid, and who gave it images answers for them.
        unsafe {
            (api.commit_filter)(self.handle.as_ptr());
            (api.execute_filter)(self.handle.as_ptr());
        }
        self.denoiser.error().map_or(Ok(()), |why| Err(self.denoiser.failed(why)))
    }
}

impl Drop for FilterHandle<'_> {
    fn drop(&mut self) {
        // SAFETY: the filter is released once, and nothing of it is used afterwards.
        unsafe { (self.denoiser.api.release_filter)(self.handle.as_ptr()) };
    }
}
