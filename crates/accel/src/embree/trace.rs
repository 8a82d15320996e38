//! Tracing a committed scene: one by one, or in packets of the width that the processor has.

use embree4_sys as sys;
use etendue_geometry::{Geometry, MISS, Mesh, Positions};

use super::CommittedScene;
use super::filter::{self, ExactFilter, NearestSearch};
use crate::single::Rays32;

/// Hits that single precision found for a batch of rays.
#[derive(Debug, Default)]
pub(crate) struct FoundHits {
    /// Placement of each hit, or [`MISS`].
    pub(crate) placement: Vec<u32>,
    /// Triangle of each hit, or [`MISS`].
    pub(crate) triangle: Vec<u32>,
    /// Single-precision distance from the moved origin.
    pub(crate) t: Vec<f32>,
    /// True if the rest is wanted, too.
    pub(crate) has_surface: bool,
    /// Barycentric weights of the second and the third corner.
    pub(crate) weights: [Vec<f32>; 2],
    /// Normals in the frame of what was hit, of any length, on the side from which its corners run
    /// counter-clockwise.
    pub(crate) normal: [Vec<f32>; 3],
}

impl FoundHits {
    fn resize(&mut self, len: usize) {
        self.placement.resize(len, MISS);
        self.triangle.resize(len, MISS);
        self.t.resize(len, f32::INFINITY);
        if self.has_surface {
            for array in self.weights.iter_mut().chain(&mut self.normal) {
                array.resize(len, 0.0);
            }
        }
    }
}

impl CommittedScene {
    /// The closest hit of each ray in single precision.
    pub(crate) fn closest(&self, rays: &Rays32, coherent: bool, found: &mut FoundHits) {
        self.intersect(rays, coherent, &mut intersect_arguments(coherent), found);
    }

    /// As [`Self::closest`], one by one, for rays that start on surfaces: hits near the start are
    /// decided in f64.
    pub(crate) fn closest_from_surfaces(
        &self,
        rays: &Rays32,
        judged: &mut ExactFilter<'_>,
        found: &mut FoundHits,
    ) {
        let mut arguments = intersect_arguments(false);
        arguments.flags |= sys::RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER;
        arguments.filter = Some(filter::keep_clear);
        arguments.context = judged.context();
        self.intersect(rays, false, &mut arguments, found);
    }

    /// Looks with all of `rays`, which stand for one, for the nearest exact hit.
    pub(crate) fn search(
        &self,
        rays: &Rays32,
        search: &mut NearestSearch<'_>,
        found: &mut FoundHits,
    ) {
        let coherent = rays.len() > 1;
        let mut arguments = intersect_arguments(coherent);
        arguments.flags |= sys::RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER;
        arguments.filter = Some(filter::search);
        arguments.context = search.context();
        self.intersect(rays, coherent, &mut arguments, found);
    }

    /// As [`Self::closest`], in packets whether coherent or not: for hits that nobody judges.
    pub(crate) fn closest_in_packets(&self, rays: &Rays32, coherent: bool, found: &mut FoundHits) {
        found.has_surface = true;
        // As for occlusion: only packets that keep together are known to come back from instances.
        let in_packets = coherent || !self.has_instances;
        self.intersect(rays, in_packets, &mut intersect_arguments(coherent), found);
        found.has_surface = false;
    }

    /// As [`Self::occluded`], in packets whether coherent or not.
    pub(crate) fn occluded_in_packets(&self, rays: &Rays32, coherent: bool, blocked: &mut [bool]) {
        self.occlude(rays, true, &mut occluded_arguments(coherent), blocked);
    }

    fn intersect(
        &self,
        rays: &Rays32,
        in_packets: bool,
        arguments: &mut sys::RTCIntersectArguments,
        found: &mut FoundHits,
    ) {
        found.resize(rays.len());
        match (in_packets, self.device.width) {
            (true, 16) => self.closest16(rays, arguments, found),
            (true, 8) => self.closest8(rays, arguments, found),
            (true, 4) => self.closest4(rays, arguments, found),
            _ => self.closest1(rays, arguments, found),
        }
    }

    /// Tests whether anything lies between each ray's ends, in single precision.
    pub(crate) fn occluded(&self, rays: &Rays32, coherent: bool, blocked: &mut [bool]) {
        self.occlude(rays, coherent, &mut occluded_arguments(coherent), blocked);
    }

    /// Tests whether anything lies between each ray's ends by the exact test.
    pub(crate) fn occluded_exactly(
        &self,
        rays: &Rays32,
        coherent: bool,
        judged: &mut ExactFilter<'_>,
        blocked: &mut [bool],
    ) {
        let mut arguments = occluded_arguments(coherent);
        arguments.flags |= sys::RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER;
        arguments.filter = Some(filter::keep_exact);
        arguments.context = judged.context();
        self.occlude(rays, coherent, &mut arguments, blocked);
    }

    /// True if packets come back from occlusion. Debian 12's Embree keeps the 16 rays of a packet that meets instances
    /// in 16 bits and reads 64 of them: by what lies beside, it never comes back. Nor does it from packets through small
    /// boxes in its compact mode.
    pub(super) fn packets_come_back(&self) -> bool {
        !self.has_instances && !self.is_compact
    }

    fn occlude(
        &self,
        rays: &Rays32,
        in_packets: bool,
        arguments: &mut sys::RTCOccludedArguments,
        blocked: &mut [bool],
    ) {
        match (in_packets && self.packets_come_back(), self.device.width) {
            (true, 16) => self.occluded16(rays, arguments, blocked),
            (true, 8) => self.occluded8(rays, arguments, blocked),
            (true, 4) => self.occluded4(rays, arguments, blocked),
            _ => self.occluded1(rays, arguments, blocked),
        }
    }

    fn closest1(
        &self,
        rays: &Rays32,
        arguments: &mut sys::RTCIntersectArguments,
        found: &mut FoundHits,
    ) {
        let mut ahead = Ahead::new(&self.geometry);
        for i in 0..rays.len() {
            let mut query = sys::RTCRayHit { ray: single_ray(rays, i), ..Default::default() };
            query.hit.geomID = MISS;
            query.hit.primID = MISS;
            query.hit.instID[0] = MISS;
            // SAFETY: the scene is committed; the query is of the C type, aligned by it, with ids
            // and mask set; Embree keeps no pointer to it.
            unsafe { sys::rtcIntersect1(self.handle.0.as_ptr(), &mut query, arguments) };
            let hit = &query.hit;
            found.placement[i] = if hit.instID[0] == MISS { hit.geomID } else { hit.instID[0] };
            found.triangle[i] = hit.primID;
            found.t[i] = query.ray.tfar;
            if found.has_surface {
                (found.weights[0][i], found.weights[1][i]) = (hit.u, hit.v);
                for (axis, n) in found.normal.iter_mut().zip([hit.Ng_x, hit.Ng_y, hit.Ng_z]) {
                    axis[i] = n;
                }
            }
            ahead.fetch(found.placement[i], found.triangle[i]);
        }
        ahead.fetch(MISS, MISS);
    }

    fn occluded1(
        &self,
        rays: &Rays32,
        arguments: &mut sys::RTCOccludedArguments,
        blocked: &mut [bool],
    ) {
        for (i, blocked) in blocked.iter_mut().enumerate() {
            *blocked = self.is_occluded(rays, i, arguments);
        }
    }

    fn is_occluded(
        &self,
        rays: &Rays32,
        i: usize,
        arguments: &mut sys::RTCOccludedArguments,
    ) -> bool {
        let mut ray = single_ray(rays, i);
        // SAFETY: as in `closest1`.
        unsafe { sys::rtcOccluded1(self.handle.0.as_ptr(), &mut ray, arguments) };
        ray.tfar == f32::NEG_INFINITY
    }
}

/// Fetches the corners of the triangles that were hit while the next rays are traced: solving for
/// them in f64 comes next, and Embree's own structure holds copies elsewhere.
struct Ahead<'a> {
    geometry: &'a Geometry,
    /// The hit before the last, whose indices have come meanwhile.
    before: Option<(&'a Mesh, u32)>,
}

impl<'a> Ahead<'a> {
    fn new(geometry: &'a Geometry) -> Self {
        Self { geometry, before: None }
    }

    /// Takes note of a hit ([`MISS`]: none), and fetches what the one before it needs.
    #[inline(always)]
    fn fetch(&mut self, placement: u32, triangle: u32) {
        if let Some((mesh, triangle)) = self.before.take() {
            for corner in mesh.triangles[triangle as usize] {
                match &mesh.positions {
                    Positions::F32(vertices) => {
                        prefetch(&vertices.floats()[corner as usize * vertices.stride()]);
                    }
                    Positions::F64(vertices) => prefetch(&vertices[corner as usize]),
                }
            }
        }
        if placement != MISS {
            let mesh = self.geometry.mesh_of(&self.geometry.placements[placement as usize]);
            prefetch(&mesh.triangles[triangle as usize]);
            self.before = Some((mesh, triangle));
        }
    }
}

/// Has the processor fetch what is at a place, without waiting for it.
#[inline(always)]
fn prefetch<T>(place: &T) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: a hint, which reads nothing; every x86-64 processor has it.
    unsafe {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(place).cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = place;
}

/// True if Embree is told to keep packets together.
fn is_coherent(flags: sys::RTCRayQueryFlags) -> bool {
    flags.0 & sys::RTC_RAY_QUERY_FLAG_COHERENT.0 != 0
}

/// True if rays spread by more than a few degrees, as those to lamps on all sides do. Embree follows a packet by the
/// frustum around it, and where that is wide, occlusion takes longer than one by one: a hundred times as long for rays
/// aimed at all corners of a mesh (`corners_and_edges_occlusion` of the stability suite). Told that they are not
/// coherent, it follows each ray of the packet by itself.
fn run_apart(rays: &Rays32, start: usize, count: usize) -> bool {
    rays.direction.iter().any(|axis| {
        let directions = &axis[start..start + count];
        let least = directions.iter().copied().fold(f32::INFINITY, f32::min);
        let most = directions.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        most - least > MOST_SPREAD
    })
}

/// The widest range of a component of directions that run together.
pub(super) const MOST_SPREAD: f32 = 0.25;

fn single_ray(rays: &Rays32, i: usize) -> sys::RTCRay {
    sys::RTCRay {
        org_x: rays.origin[0][i],
        org_y: rays.origin[1][i],
        org_z: rays.origin[2][i],
        dir_x: rays.direction[0][i],
        dir_y: rays.direction[1][i],
        dir_z: rays.direction[2][i],
        tnear: rays.t_near[i],
        tfar: rays.t_far[i],
        mask: u32::MAX,
        id: number(i),
        ..Default::default()
    }
}

#[expect(clippy::cast_possible_truncation, reason = "batches are small")]
fn number(i: usize) -> u32 {
    i as u32
}

pub(super) fn intersect_arguments(coherent: bool) -> sys::RTCIntersectArguments {
    let mut arguments = sys::RTCIntersectArguments::default();
    // SAFETY: a plain C initialiser of a struct of ours.
    unsafe { sys::rtcInitIntersectArguments(&mut arguments) };
    arguments.flags = if coherent {
        sys::RTC_RAY_QUERY_FLAG_COHERENT
    } else {
        sys::RTC_RAY_QUERY_FLAG_INCOHERENT
    };
    arguments
}

pub(super) fn occluded_arguments(coherent: bool) -> sys::RTCOccludedArguments {
    let mut arguments = sys::RTCOccludedArguments::default();
    // SAFETY: a plain C initialiser of a struct of ours.
    unsafe { sys::rtcInitOccludedArguments(&mut arguments) };
    arguments.flags = if coherent {
        sys::RTC_RAY_QUERY_FLAG_COHERENT
    } else {
        sys::RTC_RAY_QUERY_FLAG_INCOHERENT
    };
    arguments
}

/// Packets of one width: the same code on C types of another size.
macro_rules! packets {
    ($closest:ident, $occluded:ident, $width:literal, $rayhit:ident, $ray:ident, $intersect:ident,
     $occlude:ident) => {
        impl CommittedScene {
            fn $closest(
                &self,
                rays: &Rays32,
                arguments: &mut sys::RTCIntersectArguments,
                found: &mut FoundHits,
            ) {
                let mut query = PacketAligned(sys::$rayhit::default());
                query.0.ray.mask = [u32::MAX; $width];
                for start in (0..rays.len()).step_by($width) {
                    let count = $width.min(rays.len() - start);
                    let valid =
                        PacketAligned(live_lanes::<$width>(&rays.t_far[start..start + count]));
                    fill_packet!(query.0.ray, rays, start, count, $width);
                    query.0.hit.geomID = [MISS; $width];
                    query.0.hit.primID = [MISS; $width];
                    query.0.hit.instID[0] = [MISS; $width];
                    if valid.0.iter().any(|&live| live != 0) {
                        // SAFETY: the scene is committed; packet and mask have the C types' layout and
                        // are aligned to 64 bytes by `PacketAligned`; lanes without a ray are masked off.
                        unsafe {
                            sys::$intersect(
                                valid.0.as_ptr(),
                                self.handle.0.as_ptr(),
                                &mut query.0,
                                arguments,
                            );
                        }
                    }
                    let hit = &query.0.hit;
                    let mut placement = hit.geomID;
                    for (placement, &instance) in placement.iter_mut().zip(&hit.instID[0]) {
                        *placement = if instance == MISS { *placement } else { instance };
                    }
                    put(&mut found.placement, start, count, &placement);
                    put(&mut found.triangle, start, count, &hit.primID);
                    put(&mut found.t, start, count, &query.0.ray.tfar);
                    if found.has_surface {
                        let FoundHits { weights: [u, v], normal: [x, y, z], .. } = found;
                        put(u, start, count, &hit.u);
                        put(v, start, count, &hit.v);
                        put(x, start, count, &hit.Ng_x);
                        put(y, start, count, &hit.Ng_y);
                        put(z, start, count, &hit.Ng_z);
                    }
                }
            }

            fn $occluded(
                &self,
                rays: &Rays32,
                arguments: &mut sys::RTCOccludedArguments,
                blocked: &mut [bool],
            ) {
                let mut query = PacketAligned(sys::$ray::default());
                query.0.mask = [u32::MAX; $width];
                let mut spread = *arguments;
                spread.flags = sys::RTC_RAY_QUERY_FLAG_INCOHERENT;
                for start in (0..rays.len()).step_by($width) {
                    let count = $width.min(rays.len() - start);
                    let apart = is_coherent(arguments.flags) && run_apart(rays, start, count);
                    if apart && arguments.filter.is_some() {
                        for i in start..start + count {
                            blocked[i] = self.is_occluded(rays, i, arguments);
                        }
                        continue;
                    }
                    let valid =
                        PacketAligned(live_lanes::<$width>(&rays.t_far[start..start + count]));
                    if valid.0 == [0; $width] {
                        blocked[start..start + count].fill(false);
                        continue;
                    }
                    fill_packet!(query.0, rays, start, count, $width);
                    // SAFETY: as above.
                    unsafe {
                        sys::$occlude(
                            valid.0.as_ptr(),
                            self.handle.0.as_ptr(),
                            &mut query.0,
                            if apart { &mut spread } else { &mut *arguments },
                        );
                    }
                    let tfar = &query.0.tfar[..count];
                    for (blocked, &t) in blocked[start..start + count].iter_mut().zip(tfar) {
                        *blocked = t == f32::NEG_INFINITY;
                    }
                }
            }
        }
    };
}

/// Copies `count` rays from `start` into a packet.
macro_rules! fill_packet {
    ($ray:expr, $rays:expr, $start:expr, $count:expr, $width:literal) => {{
        let ray = &mut $ray;
        take(&mut ray.org_x, &$rays.origin[0], $start, $count);
        take(&mut ray.org_y, &$rays.origin[1], $start, $count);
        take(&mut ray.org_z, &$rays.origin[2], $start, $count);
        take(&mut ray.dir_x, &$rays.direction[0], $start, $count);
        take(&mut ray.dir_y, &$rays.direction[1], $start, $count);
        take(&mut ray.dir_z, &$rays.direction[2], $start, $count);
        take(&mut ray.tnear, &$rays.t_near, $start, $count);
        take(&mut ray.tfar, &$rays.t_far, $start, $count);
        for lane in 0..$width {
            ray.id[lane] = number($start + lane);
        }
    }};
}

/// Takes `count` values from `start` on; a whole packet in one move.
#[inline(always)]
fn take<const W: usize>(lanes: &mut [f32; W], from: &[f32], start: usize, count: usize) {
    match from[start..].first_chunk::<W>() {
        Some(whole) => *lanes = *whole,
        None => lanes[..count].copy_from_slice(&from[start..start + count]),
    }
}

/// Puts the first `count` values from `start` on; a whole packet in one move.
#[inline(always)]
fn put<T: Copy, const W: usize>(to: &mut [T], start: usize, count: usize, lanes: &[T; W]) {
    match to[start..].first_chunk_mut::<W>() {
        Some(whole) => *whole = *lanes,
        None => to[start..start + count].copy_from_slice(&lanes[..count]),
    }
}

/// The mask of the lanes whose rays can hit anything, by their ends. From a coherent packet without any, Debian 12's
/// Embree never comes back.
#[inline(always)]
pub(super) fn live_lanes<const W: usize>(t_far: &[f32]) -> [i32; W] {
    let mut live = [0; W];
    for (lane, &t_far) in live.iter_mut().zip(t_far) {
        *lane = -i32::from(t_far > 0.0);
    }
    live
}

/// The alignment of the widest packet, for all of them.
#[repr(C, align(64))]
pub(super) struct PacketAligned<T>(pub(super) T);

packets!(closest4, occluded4, 4, RTCRayHit4, RTCRay4, rtcIntersect4, rtcOccluded4);
packets!(closest8, occluded8, 8, RTCRayHit8, RTCRay8, rtcIntersect8, rtcOccluded8);
packets!(closest16, occluded16, 16, RTCRayHit16, RTCRay16, rtcIntersect16, rtcOccluded16);
