//! Embree 4's queries on Embree 3: the same names and signatures, translated in line.
//!
//! Embree 4 takes one record of arguments after the rays; Embree 3 took a context before them,
//! which held the flags, the filter and the stack of instance ids at once. The instance stack is
//! Embree's own business during a query, so the context is made anew on the stack for each call:
//! a handful of stores that an optimised build keeps where they belong.

use std::ptr;

use crate::RTC_INVALID_GEOMETRY_ID;
use crate::bindings::{
    self, RTC_INTERSECT_CONTEXT_FLAG_COHERENT, RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT,
    RTC_MAX_INSTANCE_LEVEL_COUNT, RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION, RTCFilterFunctionN,
    RTCIntersectContext, RTCRay, RTCRay4, RTCRay8, RTCRay16, RTCRayHit, RTCRayHit4, RTCRayHit8,
    RTCRayHit16, RTCScene, RTCSceneFlags,
};

/// Flags of the traversal of a query.
#[repr(transparent)]
#[derive(Debug, Clone, Copy, Default, Hash, PartialEq, Eq)]
pub struct RTCRayQueryFlags(pub u32);

/// Nothing asked for.
pub const RTC_RAY_QUERY_FLAG_NONE: RTCRayQueryFlags = RTCRayQueryFlags(0);
/// Calls the filter of the arguments on every geometry. Needs a scene with
/// [`RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS`].
pub const RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER: RTCRayQueryFlags = RTCRayQueryFlags(1 << 1);
/// The rays of neighbouring queries go different ways.
pub const RTC_RAY_QUERY_FLAG_INCOHERENT: RTCRayQueryFlags = RTCRayQueryFlags(0);
/// The rays of neighbouring queries go much the same way.
pub const RTC_RAY_QUERY_FLAG_COHERENT: RTCRayQueryFlags = RTCRayQueryFlags(1 << 16);

/// The kinds of geometry that traversal is to know. Embree 3 knows all of them always.
#[repr(transparent)]
#[derive(Debug, Clone, Copy, Default, Hash, PartialEq, Eq)]
pub struct RTCFeatureFlags(pub u32);

/// No feature.
pub const RTC_FEATURE_FLAG_NONE: RTCFeatureFlags = RTCFeatureFlags(0);
/// Triangle meshes.
pub const RTC_FEATURE_FLAG_TRIANGLE: RTCFeatureFlags = RTCFeatureFlags(1 << 1);
/// Instances.
pub const RTC_FEATURE_FLAG_INSTANCE: RTCFeatureFlags = RTCFeatureFlags(1 << 23);
/// Every feature.
pub const RTC_FEATURE_FLAG_ALL: RTCFeatureFlags = RTCFeatureFlags(u32::MAX);

/// The scene may be asked with a filter in the arguments of a query.
pub const RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS: RTCSceneFlags =
    RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION;

/// Record that goes with a query to its filter: extend it by making it the first field of a `repr(C)`
/// record. On Embree 3 the ids stay as they were set.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RTCRayQueryContext {
    /// The instances that the ray is inside.
    pub instID: [u32; RTC_MAX_INSTANCE_LEVEL_COUNT as usize],
}

/// Arguments of closest-hit queries.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RTCIntersectArguments {
    /// Flags of the traversal.
    pub flags: RTCRayQueryFlags,
    /// Ignored.
    pub feature_mask: RTCFeatureFlags,
    /// Handed to the filter; may be null.
    pub context: *mut RTCRayQueryContext,
    /// Called for each hit if the flags say so.
    pub filter: RTCFilterFunctionN,
}

/// Arguments of occlusion queries.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RTCOccludedArguments {
    /// Flags of the traversal.
    pub flags: RTCRayQueryFlags,
    /// Ignored.
    pub feature_mask: RTCFeatureFlags,
    /// Handed to the filter; may be null.
    pub context: *mut RTCRayQueryContext,
    /// Called for each hit if the flags say so.
    pub filter: RTCFilterFunctionN,
}

/// Embree 3's context of one query, with the caller's behind it for filters to find.
#[repr(C)]
struct Context {
    embree: RTCIntersectContext,
    query: *mut RTCRayQueryContext,
}

impl Context {
    #[inline]
    #[allow(clippy::needless_update, reason = "some configurations of Embree have more fields")]
    fn new(
        flags: RTCRayQueryFlags,
        filter: RTCFilterFunctionN,
        query: *mut RTCRayQueryContext,
    ) -> Self {
        let has = |flag: RTCRayQueryFlags| flags.0 & flag.0 != 0;
        let embree = RTCIntersectContext {
            flags: if has(RTC_RAY_QUERY_FLAG_COHERENT) {
                RTC_INTERSECT_CONTEXT_FLAG_COHERENT
            } else {
                RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT
            },
            // Embree 3 calls it whenever it is there.
            filter: if has(RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER) { filter } else { None },
            instID: [RTC_INVALID_GEOMETRY_ID; RTC_MAX_INSTANCE_LEVEL_COUNT as usize],
            ..RTCIntersectContext::default()
        };
        Self { embree, query }
    }
}

/// The caller's context of the query that Embree runs with `context`.
///
/// # Safety
/// `context` must be that of a running query of this module.
#[inline]
pub(crate) unsafe fn query_context(context: *mut RTCIntersectContext) -> *mut RTCRayQueryContext {
    // SAFETY: each query passes a whole `Context`, of which Embree's is the first field.
    unsafe { (*context.cast::<Context>()).query }
}

macro_rules! queries {
    ($($name:ident $([$valid:ident])? ($rays:ident: $Rays:ty, $Arguments:ty);)+) => {$(
        #[doc = concat!("Embree 4's `", stringify!($name), "`; `args` may be null.")]
        ///
        /// # Safety
        /// As Embree demands: a committed scene, and records valid and aligned for their types.
        #[inline]
        pub unsafe extern "C" fn $name(
            $($valid: *const std::ffi::c_int,)?
            scene: RTCScene,
            $rays: *mut $Rays,
            args: *mut $Arguments,
        ) {
            // SAFETY: the caller vouches for what is passed on; the context is a local, whose
            // pointer Embree drops before it returns.
            unsafe {
                let mut context = match args.as_ref() {
                    Some(args) => Context::new(args.flags, args.filter, args.context),
                    None => Context::new(RTC_RAY_QUERY_FLAG_NONE, None, ptr::null_mut()),
                };
                bindings::$name($($valid,)? scene, (&raw mut context).cast(), $rays);
            }
        }
    )+};
}

queries! {
    rtcIntersect1(rayhit: RTCRayHit, RTCIntersectArguments);
    rtcIntersect4[valid](rayhit: RTCRayHit4, RTCIntersectArguments);
    rtcIntersect8[valid](rayhit: RTCRayHit8, RTCIntersectArguments);
    rtcIntersect16[valid](rayhit: RTCRayHit16, RTCIntersectArguments);
    rtcOccluded1(ray: RTCRay, RTCOccludedArguments);
    rtcOccluded4[valid](ray: RTCRay4, RTCOccludedArguments);
    rtcOccluded8[valid](ray: RTCRay8, RTCOccludedArguments);
    rtcOccluded16[valid](ray: RTCRay16, RTCOccludedArguments);
}
