//! Functions that Embree's header defines inline, and so no library exports: initial values of the
//! records of a query. The same on both releases.

use std::ops::{BitOr, BitOrAssign};

use crate::{
    RTC_FEATURE_FLAG_ALL, RTC_MAX_INSTANCE_LEVEL_COUNT, RTC_RAY_QUERY_FLAG_INCOHERENT,
    RTCFilterFunctionNArguments, RTCIntersectArguments, RTCOccludedArguments, RTCRayQueryContext,
    RTCRayQueryFlags, RTCSceneFlags,
};

/// Sets the arguments of closest-hit queries to Embree's defaults: incoherent rays, every feature,
/// no context and no callbacks.
///
/// # Safety
/// `args` must be valid for writes; it need not be initialised.
#[inline]
pub unsafe fn rtcInitIntersectArguments(args: *mut RTCIntersectArguments) {
    // SAFETY: the caller vouches for `args`; all zero is a valid value of each of its fields (no
    // flags, null, no callback, 0.0), including those that only some configurations have.
    unsafe {
        args.write_bytes(0, 1);
        (*args).flags = RTC_RAY_QUERY_FLAG_INCOHERENT;
        (*args).feature_mask = RTC_FEATURE_FLAG_ALL;
    }
}

/// Sets the arguments of occlusion queries to Embree's defaults: incoherent rays, every feature,
/// no context and no callbacks.
///
/// # Safety
/// `args` must be valid for writes; it need not be initialised.
#[inline]
pub unsafe fn rtcInitOccludedArguments(args: *mut RTCOccludedArguments) {
    // SAFETY: as in `rtcInitIntersectArguments`.
    unsafe {
        args.write_bytes(0, 1);
        (*args).flags = RTC_RAY_QUERY_FLAG_INCOHERENT;
        (*args).feature_mask = RTC_FEATURE_FLAG_ALL;
    }
}

/// Sets a context to being inside no instance.
///
/// # Safety
/// `context` must be valid for writes; it need not be initialised.
#[inline]
pub unsafe fn rtcInitRayQueryContext(context: *mut RTCRayQueryContext) {
    // SAFETY: the caller vouches for `context`, a record of `u32` alone: ids, for which all ones is
    // the invalid id, behind the depth of the instance stack where stacks may be deeper than one.
    unsafe {
        context.write_bytes(0xFF, 1);
        if RTC_MAX_INSTANCE_LEVEL_COUNT > 1 {
            context.cast::<u32>().write(0);
        }
    }
}

/// The context that was passed with the query in whose course a filter function is called.
///
/// Embree 4 has it in the filter's arguments. There Embree 3 has its own context, and the query's
/// behind it.
///
/// # Safety
/// `args` must be what Embree passed to a filter function, in a query made through this crate.
#[inline]
pub unsafe fn filter_context(args: *const RTCFilterFunctionNArguments) -> *mut RTCRayQueryContext {
    // SAFETY: the caller vouches for `args`, whose context is that of a query of this crate.
    unsafe {
        #[cfg(embree3)]
        return crate::embree3::query_context((*args).context);
        #[cfg(embree4)]
        return (*args).context;
    }
}

macro_rules! starts_as {
    ($($record:ty: $init:ident),+) => {$(
        /// As its `rtcInit` function sets it.
        impl Default for $record {
            #[inline]
            fn default() -> Self {
                let mut record = std::mem::MaybeUninit::uninit();
                // SAFETY: the pointer is to a local, and `init` sets every byte.
                unsafe {
                    $init(record.as_mut_ptr());
                    record.assume_init()
                }
            }
        }
    )+};
}

starts_as!(
    RTCIntersectArguments: rtcInitIntersectArguments,
    RTCOccludedArguments: rtcInitOccludedArguments,
    RTCRayQueryContext: rtcInitRayQueryContext
);

macro_rules! combine {
    ($($flags:ident),+) => {$(
        impl BitOr for $flags {
            type Output = Self;

            #[inline]
            fn bitor(self, other: Self) -> Self {
                Self(self.0 | other.0)
            }
        }

        impl BitOrAssign for $flags {
            #[inline]
            fn bitor_assign(&mut self, other: Self) {
                self.0 |= other.0;
            }
        }
    )+};
}

combine!(RTCRayQueryFlags, RTCSceneFlags);
