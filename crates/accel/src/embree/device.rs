//! An Embree device: its threads, its memory, its errors, and what it says of itself; and references to its scenes.

use std::ffi::{CStr, CString, c_char, c_void};
use std::fmt;
use std::ptr::{self, NonNull};
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};
use std::sync::{Mutex, PoisonError};

use embree4_sys as sys;

use crate::{BuildError, BuildOptions, Quality};

/// State that Embree's callbacks write to while a device lives.
#[derive(Default)]
struct DeviceWatch {
    /// The first error since it was last taken.
    error: Mutex<Option<(sys::RTCError, String)>>,
    /// Bytes that Embree holds now.
    bytes: AtomicI64,
    limit: Option<i64>,
    over_limit: AtomicBool,
}

/// An Embree device: its threads, its memory and its errors.
pub(crate) struct Device {
    pub(super) handle: NonNull<sys::RTCDeviceTy>,
    watch: Box<DeviceWatch>,
    /// Rays per packet: 16, 8, 4, or 1 where the processor has no packets worth it.
    pub(super) width: usize,
}

// SAFETY: the handle is reference-counted atomically by Embree, its functions may be called from any
// thread, and everything in `DeviceWatch` is atomic or locked.
unsafe impl Send for Device {}
// SAFETY: as above.
unsafe impl Sync for Device {}

impl Device {
    /// Opens a device for `options`.
    pub(crate) fn new(options: &BuildOptions) -> Result<Self, BuildError> {
        let mut config = format!("threads={}", options.threads);
        if let Some(isa) = &options.isa {
            config.push_str(",isa=");
            config.push_str(check_isa(isa)?);
        }
        let config = CString::new(config).unwrap_or_default();
        // SAFETY: the string is terminated and lives through the call.
        let handle = unsafe { sys::rtcNewDevice(config.as_ptr()) };
        let Some(handle) = NonNull::new(handle) else {
            // SAFETY: the null device reports the error of the failed creation on this thread.
            let code = unsafe { sys::rtcGetDeviceError(ptr::null_mut()) };
            if code == sys::RTC_ERROR_OUT_OF_MEMORY {
                return Err(BuildError::OutOfMemory { backend: "Embree", call: "rtcNewDevice" });
            }
            return Err(BuildError::Library {
                call: "rtcNewDevice",
                message: format!("Embree could not open a device (error {})", code.0),
            });
        };
        let limit = options.memory_limit.map(|bytes| i64::try_from(bytes).unwrap_or(i64::MAX));
        let watch = Box::new(DeviceWatch { limit, ..DeviceWatch::default() });
        let user: *mut c_void = ptr::from_ref(&*watch).cast_mut().cast();
        // SAFETY: `watch` is boxed, so its address holds for as long as the device, which is
        // released in `drop` before it. The callbacks only read it, through atomics and a lock.
        unsafe {
            sys::rtcSetDeviceErrorFunction(handle.as_ptr(), Some(on_error), user);
            sys::rtcSetDeviceMemoryMonitorFunction(handle.as_ptr(), Some(on_memory), user);
        }
        let mut device = Self { handle, watch, width: 1 };
        device.width = device.native_width();
        Ok(device)
    }

    fn property(&self, property: sys::RTCDeviceProperty) -> isize {
        // SAFETY: the handle is live; unknown properties return 0 and set an error.
        unsafe { sys::rtcGetDeviceProperty(self.handle.as_ptr(), property) as isize }
    }

    fn native_width(&self) -> usize {
        if self.property(sys::RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) != 0 {
            16
        } else if self.property(sys::RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) != 0 {
            8
        } else if self.property(sys::RTC_DEVICE_PROPERTY_NATIVE_RAY4_SUPPORTED) != 0 {
            4
        } else {
            1
        }
    }

    /// Bytes that Embree holds now.
    pub(crate) fn bytes(&self) -> u64 {
        u64::try_from(self.watch.bytes.load(Ordering::Relaxed)).unwrap_or(0)
    }

    /// Fails with what Embree reported since the last call, if anything.
    pub(super) fn check(&self, call: &'static str) -> Result<(), BuildError> {
        let message = self.watch.error.lock().unwrap_or_else(PoisonError::into_inner).take();
        let Some((code, message)) = message else { return Ok(()) };
        if self.watch.over_limit.load(Ordering::Relaxed) {
            let limit = u64::try_from(self.watch.limit.unwrap_or(0)).unwrap_or(0);
            return Err(BuildError::MemoryLimit { backend: "Embree", limit });
        }
        Err(match code {
            sys::RTC_ERROR_CANCELLED => BuildError::Stopped,
            sys::RTC_ERROR_OUT_OF_MEMORY => BuildError::OutOfMemory { backend: "Embree", call },
            // TBB's words for threads whose stacks have no room; of these Embree knows no code.
            _ if message.contains("pthread_create") => {
                BuildError::OutOfMemory { backend: "Embree", call }
            }
            _ => BuildError::Library { call, message },
        })
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: this is the one reference that `new` was given; scenes hold their own.
        unsafe {
            sys::rtcSetDeviceErrorFunction(self.handle.as_ptr(), None, ptr::null_mut());
            sys::rtcSetDeviceMemoryMonitorFunction(self.handle.as_ptr(), None, ptr::null_mut());
            sys::rtcReleaseDevice(self.handle.as_ptr());
        }
    }
}

impl fmt::Debug for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Device").field("width", &self.width).field("bytes", &self.bytes()).finish()
    }
}

unsafe extern "C" fn on_error(user: *mut c_void, code: sys::RTCError, text: *const c_char) {
    // SAFETY: `user` is the `DeviceWatch` that `Device::new` registered; the text is a C string or null.
    let (watch, text) = unsafe {
        let text = if text.is_null() { c"" } else { CStr::from_ptr(text) };
        (&*user.cast::<DeviceWatch>(), text.to_string_lossy())
    };
    let name = match code {
        sys::RTC_ERROR_INVALID_ARGUMENT => "invalid argument",
        sys::RTC_ERROR_INVALID_OPERATION => "invalid operation",
        sys::RTC_ERROR_OUT_OF_MEMORY => "out of memory",
        sys::RTC_ERROR_UNSUPPORTED_CPU => "unsupported CPU",
        sys::RTC_ERROR_CANCELLED => "cancelled",
        _ => "unknown error",
    };
    let mut slot = watch.error.lock().unwrap_or_else(PoisonError::into_inner);
    slot.get_or_insert_with(|| {
        (code, if text.is_empty() { name.to_owned() } else { format!("{name}: {text}") })
    });
}

unsafe extern "C" fn on_memory(user: *mut c_void, bytes: isize, post: bool) -> bool {
    // SAFETY: `user` is the `DeviceWatch` that `Device::new` registered.
    let watch = unsafe { &*user.cast::<DeviceWatch>() };
    let now = watch.bytes.fetch_add(bytes as i64, Ordering::Relaxed) + bytes as i64;
    // Embree only lets an allocation be refused before it is made.
    let refuse = bytes > 0 && !post && watch.limit.is_some_and(|limit| now > limit);
    if refuse {
        watch.over_limit.store(true, Ordering::Relaxed);
        watch.bytes.fetch_sub(bytes as i64, Ordering::Relaxed);
    }
    !refuse
}

/// An instruction set's name as Embree's `isa=` takes it, when this processor has it.
fn check_isa(isa: &str) -> Result<&str, BuildError> {
    #[cfg(target_arch = "x86_64")]
    let known = [
        ("sse2", true),
        ("sse4.2", is_x86_feature_detected!("sse4.2")),
        ("avx", is_x86_feature_detected!("avx")),
        ("avx2", is_x86_feature_detected!("avx2")),
        ("avx512", is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vl")),
    ];
    #[cfg(not(target_arch = "x86_64"))]
    let known: [(&str, bool); 0] = [];
    let refuse = |message: String| Err(BuildError::Library { call: "isa", message });
    match known.iter().find(|(name, _)| *name == isa) {
        Some((_, true)) => Ok(isa),
        Some((_, false)) => refuse(format!("this processor has no {isa}\nhint: leave `isa` out")),
        None => refuse(format!(
            "unknown instruction set \"{isa}\"; known here: {}",
            known.map(|(name, _)| name).join(", ")
        )),
    }
}

/// Version of Embree.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Version {
    /// `3.13.5`
    pub version: String,
    /// The widest instruction set its kernels use here.
    pub isa: &'static str,
    /// Tasking system, which runs its tasks.
    pub tasks: &'static str,
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Embree {} ({}, {})", self.version, self.isa, self.tasks)
    }
}

/// Asks the installed Embree for its version, instruction set and task system.
///
/// # Errors
///
/// When no device can be opened.
pub fn version() -> Result<Version, BuildError> {
    let device = Device::new(&BuildOptions { threads: 1, ..BuildOptions::default() })?;
    let number = |property| device.property(property);
    let isa = match device.width {
        16 => "AVX-512",
        8 if cpu_has_avx2() => "AVX2",
        8 => "AVX",
        4 => "SSE or NEON",
        _ => "unknown instruction set",
    };
    let tasks = match number(sys::RTC_DEVICE_PROPERTY_TASKING_SYSTEM) {
        0 => "internal tasks",
        1 => "TBB",
        2 => "PPL",
        _ => "unknown tasks",
    };
    let version = format!(
        "{}.{}.{}",
        number(sys::RTC_DEVICE_PROPERTY_VERSION_MAJOR),
        number(sys::RTC_DEVICE_PROPERTY_VERSION_MINOR),
        number(sys::RTC_DEVICE_PROPERTY_VERSION_PATCH)
    );
    Ok(Version { version, isa, tasks })
}

fn cpu_has_avx2() -> bool {
    #[cfg(target_arch = "x86_64")]
    return is_x86_feature_detected!("avx2");
    #[cfg(not(target_arch = "x86_64"))]
    return false;
}

impl Quality {
    pub(super) fn to_embree(self) -> sys::RTCBuildQuality {
        match self {
            Self::Low => sys::RTC_BUILD_QUALITY_LOW,
            Self::Medium => sys::RTC_BUILD_QUALITY_MEDIUM,
            Self::High => sys::RTC_BUILD_QUALITY_HIGH,
        }
    }
}

/// One reference to an Embree scene.
pub(super) struct SceneHandle(pub(super) NonNull<sys::RTCSceneTy>);

// SAFETY: references are counted atomically by Embree, so any thread may release one; a handle that is
// not a `SceneBuilder`'s alone is of a committed scene, which is read only, and queries are re-entrant.
unsafe impl Send for SceneHandle {}
// SAFETY: as above.
unsafe impl Sync for SceneHandle {}

impl Drop for SceneHandle {
    fn drop(&mut self) {
        // SAFETY: releases the reference that `rtcNewScene` gave.
        unsafe { sys::rtcReleaseScene(self.0.as_ptr()) };
    }
}
