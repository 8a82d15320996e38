#![doc = include_str!("../README.md")]
//!
//! The bindings are generated from the installed header. On Embree 4 every name here is Embree's
//! own. On Embree 3 (Debian 12) a shim of inlined functions gives the queries, their arguments and
//! their flags the names and signatures of Embree 4:
//!
//! | names | on Embree 3 |
//! |---|---|
//! | `rtcIntersect1/4/8/16`, `rtcOccluded1/4/8/16` | translate to an `RTCIntersectContext` on the stack |
//! | `RTCIntersectArguments`, `RTCOccludedArguments` | without the callbacks of user geometries |
//! | `RTCRayQueryContext` | handed to filters, see [`filter_context`]; not written by Embree |
//! | `RTCRayQueryFlags`, `RTCFeatureFlags` | the feature mask is ignored: Embree 3 has none |
//! | `RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS` | Embree 3's flag of the same meaning |
//!
//! What the two releases name and mean alike (devices, scenes, geometries, buffers, point queries)
//! is not touched. `cfg(embree3)` and `cfg(embree4)` are known inside this crate only; a dependent's
//! build script reads the major release from `DEP_EMBREE_MAJOR`, other code from [`VERSION`].
//!
//! # What Embree demands of rays
//!
//! `tnear` at least 0 and at most `tfar`, `time` in 0..=1, `flags` 0, `mask` other than 0; before a
//! closest-hit query `hit.geomID` and `hit.instID` are [`RTC_INVALID_GEOMETRY_ID`], and a miss
//! leaves them so. `Default` zeroes a record, ids and masks included, so set these. Lanes of a
//! packet are on where the valid mask is -1 and off where it is 0, and the mask is aligned as its
//! packet: 16, 32 or 64 bytes.

#![allow(non_snake_case, reason = "Embree's own names")]

mod bindings {
    #![allow(
        dead_code,
        missing_docs,
        non_camel_case_types,
        non_snake_case,
        non_upper_case_globals,
        unreachable_pub,
        unsafe_op_in_unsafe_fn,
        clippy::all,
        reason = "generated from Embree's header"
    )]
    include!(concat!(env!("OUT_DIR"), "/bindings.rs"));
}
#[cfg(embree3)]
mod embree3;
mod query;

pub use bindings::*;
// Names given one by one win over the glob above: where Embree 3 has its own, these replace them.
#[cfg(embree3)]
pub use embree3::{
    RTC_FEATURE_FLAG_ALL, RTC_FEATURE_FLAG_INSTANCE, RTC_FEATURE_FLAG_NONE,
    RTC_FEATURE_FLAG_TRIANGLE, RTC_RAY_QUERY_FLAG_COHERENT, RTC_RAY_QUERY_FLAG_INCOHERENT,
    RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER, RTC_RAY_QUERY_FLAG_NONE,
    RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS, RTCFeatureFlags, RTCIntersectArguments,
    RTCOccludedArguments, RTCRayQueryContext, RTCRayQueryFlags, rtcIntersect1, rtcIntersect4,
    rtcIntersect8, rtcIntersect16, rtcOccluded1, rtcOccluded4, rtcOccluded8, rtcOccluded16,
};
pub use query::{
    filter_context, rtcInitIntersectArguments, rtcInitOccludedArguments, rtcInitRayQueryContext,
};

/// The id of no geometry, primitive or instance: what a hit record says before a hit.
pub const RTC_INVALID_GEOMETRY_ID: u32 = u32::MAX;

/// The release these bindings were generated from, e.g. `"4.3.3"`.
pub const VERSION: &str = match RTC_VERSION_STRING.to_str() {
    Ok(version) => version,
    Err(_) => panic!("Embree's version is not UTF-8"),
};

// Embree loads packets with aligned instructions, so the alignment has to be in the types.
const _: () = {
    assert!(align_of::<RTCRay>() == 16 && align_of::<RTCRayHit>() == 16);
    assert!(align_of::<RTCRay4>() == 16 && align_of::<RTCRayHit4>() == 16);
    assert!(align_of::<RTCRay8>() == 32 && align_of::<RTCRayHit8>() == 32);
    assert!(align_of::<RTCRay16>() == 64 && align_of::<RTCRayHit16>() == 64);
    assert!(align_of::<RTCBounds>() == 16);
    assert!(RTC_VERSION_MAJOR == if cfg!(embree3) { 3 } else { 4 });
};
