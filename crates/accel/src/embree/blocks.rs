//! Rays in blocks, which are packets of sixteen as they stand. Processors with narrower registers get them in packets of
//! their own width: Embree would trace sixteen there without looking at the mask, and what lanes without a ray hold ends the
//! process. Where packets may never come back the rays of a block are traced one by one.

use std::mem::offset_of;

use embree4_sys as sys;
use etendue_geometry::block::LANES;
use etendue_geometry::{MISS, RayBlock};

use super::CommittedScene;
use super::trace::{
    MOST_SPREAD, PacketAligned, intersect_arguments, live_lanes, occluded_arguments,
};

/// True if a [`RayBlock`] is a packet of the installed Embree as it stands: same rows, and room for all of them.
const BLOCKS_ARE_PACKETS: bool = size_of::<sys::RTCRayHit16>() <= size_of::<RayBlock>()
    && align_of::<sys::RTCRayHit16>() <= align_of::<RayBlock>()
    && offset_of!(sys::RTCRayHit16, ray) == 0
    && offset_of!(sys::RTCRay16, org_x) == offset_of!(RayBlock, origin)
    && offset_of!(sys::RTCRay16, tnear) == offset_of!(RayBlock, t_min)
    && offset_of!(sys::RTCRay16, dir_x) == offset_of!(RayBlock, direction)
    && offset_of!(sys::RTCRay16, time) == offset_of!(RayBlock, time)
    && offset_of!(sys::RTCRay16, tfar) == offset_of!(RayBlock, t_max)
    && offset_of!(sys::RTCRay16, mask) == offset_of!(RayBlock, mask)
    && offset_of!(sys::RTCRay16, id) == offset_of!(RayBlock, id)
    && offset_of!(sys::RTCRay16, flags) == offset_of!(RayBlock, flags)
    && offset_of!(sys::RTCRayHit16, hit.Ng_x) == offset_of!(RayBlock, normal)
    && offset_of!(sys::RTCRayHit16, hit.u) == offset_of!(RayBlock, u)
    && offset_of!(sys::RTCRayHit16, hit.v) == offset_of!(RayBlock, v)
    && offset_of!(sys::RTCRayHit16, hit.primID) == offset_of!(RayBlock, triangle)
    && offset_of!(sys::RTCRayHit16, hit.geomID) == offset_of!(RayBlock, placement)
    && offset_of!(sys::RTCRayHit16, hit.instID) == offset_of!(RayBlock, instance);

impl CommittedScene {
    /// True if rays in blocks can be traced: where blocks are packets.
    pub(crate) const fn takes_blocks() -> bool {
        BLOCKS_ARE_PACKETS
    }

    /// The closest hits of blocks, with normals in the frames of what was hit. Only where [they are
    /// taken](Self::takes_blocks).
    pub(crate) fn closest_of_blocks(&self, blocks: &mut [RayBlock], coherent: bool) {
        debug_assert!(Self::takes_blocks(), "checked by the caller");
        let mut arguments = intersect_arguments(coherent);
        // As for batches: only packets that keep together are known to come back from instances.
        let in_packets = coherent || !self.has_instances;
        for block in blocks {
            block.clear_hits();
            if !in_packets {
                self.closest_of_block(block, &mut arguments);
                continue;
            }
            match self.device.width {
                16 => self.closest_of_packet(block, &mut arguments),
                8 => self.closest_by_8(block, &mut arguments),
                4 => self.closest_by_4(block, &mut arguments),
                _ => {
                    self.closest_of_block(block, &mut arguments);
                    continue;
                }
            }
            if self.has_instances {
                for (placement, &instance) in block.placement.iter_mut().zip(&block.instance) {
                    *placement = if instance == MISS { *placement } else { instance };
                }
            }
        }
    }

    /// The closest hits of a block whose hits were cleared, as the packet that it is.
    fn closest_of_packet(&self, block: &mut RayBlock, arguments: &mut sys::RTCIntersectArguments) {
        let valid = PacketAligned(live_lanes::<LANES>(&block.t_max));
        if !BLOCKS_ARE_PACKETS || none_is_live(&valid.0) {
            return;
        }
        let packet: *mut sys::RTCRayHit16 = std::ptr::from_mut(block).cast();
        // SAFETY: the scene is committed; `BLOCKS_ARE_PACKETS` has that the block is a packet, aligned as
        // one; lanes without a ray are masked off; Embree keeps no pointer.
        unsafe {
            let scene = self.handle.0.as_ptr();
            sys::rtcIntersect16(valid.0.as_ptr(), scene, packet, arguments);
        }
    }

    /// The closest hits of a block whose hits were cleared, ray by ray.
    fn closest_of_block(&self, block: &mut RayBlock, arguments: &mut sys::RTCIntersectArguments) {
        let live = block.t_max.map(|t_max| t_max > 0.0);
        for lane in (0..LANES).filter(|&lane| live[lane]) {
            let mut query = sys::RTCRayHit { ray: ray_of(block, lane), ..Default::default() };
            query.hit.geomID = MISS;
            query.hit.primID = MISS;
            query.hit.instID[0] = MISS;
            // SAFETY: the scene is committed; the query is of the C type, aligned by it, with ids and mask
            // set; Embree keeps no pointer to it.
            unsafe { sys::rtcIntersect1(self.handle.0.as_ptr(), &mut query, arguments) };
            let hit = &query.hit;
            if hit.geomID == MISS {
                continue;
            }
            block.placement[lane] = if hit.instID[0] == MISS { hit.geomID } else { hit.instID[0] };
            block.triangle[lane] = hit.primID;
            block.t_max[lane] = query.ray.tfar;
            (block.u[lane], block.v[lane]) = (hit.u, hit.v);
            for (axis, n) in block.normal.iter_mut().zip([hit.Ng_x, hit.Ng_y, hit.Ng_z]) {
                axis[lane] = n;
            }
        }
    }

    /// Occlusion of blocks. Only where [they are taken](Self::takes_blocks).
    pub(crate) fn occluded_of_blocks(&self, blocks: &mut [RayBlock], coherent: bool) {
        debug_assert!(Self::takes_blocks(), "checked by the caller");
        let mut arguments = occluded_arguments(coherent);
        let mut spread = occluded_arguments(false);
        let in_packets = self.packets_come_back();
        for block in blocks {
            let live = live_lanes::<LANES>(&block.t_max);
            let apart = coherent && spread_out(&block.direction, |lane| live[lane] != 0);
            let arguments = if apart { &mut spread } else { &mut arguments };
            match if in_packets { self.device.width } else { 1 } {
                16 => self.occluded_of_packet(block, live, arguments),
                8 => self.occluded_by_8(block, arguments),
                4 => self.occluded_by_4(block, arguments),
                _ => self.occluded_of_block(block, arguments),
            }
        }
    }

    /// Occlusion of a block, as the packet that it begins with, of which these lanes have rays.
    fn occluded_of_packet(
        &self,
        block: &mut RayBlock,
        live: [i32; LANES],
        arguments: &mut sys::RTCOccludedArguments,
    ) {
        if !BLOCKS_ARE_PACKETS || live == [0; LANES] {
            return;
        }
        let valid = PacketAligned(live);
        let packet: *mut sys::RTCRay16 = std::ptr::from_mut(block).cast();
        // SAFETY: as above; rays are the first part of a packet of rays and hits.
        unsafe {
            let scene = self.handle.0.as_ptr();
            sys::rtcOccluded16(valid.0.as_ptr(), scene, packet, arguments);
        }
    }

    /// Occlusion of a block, ray by ray.
    fn occluded_of_block(&self, block: &mut RayBlock, arguments: &mut sys::RTCOccludedArguments) {
        let live = block.t_max.map(|t_max| t_max > 0.0);
        for lane in (0..LANES).filter(|&lane| live[lane]) {
            let mut ray = ray_of(block, lane);
            // SAFETY: as in `closest_of_block`.
            unsafe { sys::rtcOccluded1(self.handle.0.as_ptr(), &mut ray, arguments) };
            block.t_max[lane] = ray.tfar;
        }
    }
}

/// Blocks in packets of a width below sixteen: the same code on C types of another size.
macro_rules! narrow_packets {
    ($closest:ident, $occluded:ident, $width:literal, $rayhit:ident, $ray:ident, $intersect:ident,
     $occlude:ident) => {
        impl CommittedScene {
            /// The closest hits of a block whose hits were cleared.
            fn $closest(&self, block: &mut RayBlock, arguments: &mut sys::RTCIntersectArguments) {
                let mut query = PacketAligned(sys::$rayhit::default());
                for start in (0..LANES).step_by($width) {
                    let valid =
                        PacketAligned(live_lanes::<$width>(&block.t_max[start..start + $width]));
                    if none_is_live(&valid.0) {
                        continue;
                    }
                    put_rays!(query.0.ray, block, start);
                    query.0.hit.geomID = [MISS; $width];
                    query.0.hit.primID = [MISS; $width];
                    query.0.hit.instID[0] = [MISS; $width];
                    // SAFETY: the scene is committed; packet and mask have the C types' layout and are aligned to 64
                    // bytes by `PacketAligned`; lanes without a ray are masked off; Embree keeps no pointer.
                    unsafe {
                        let scene = self.handle.0.as_ptr();
                        sys::$intersect(valid.0.as_ptr(), scene, &mut query.0, arguments);
                    }
                    let hit = &query.0.hit;
                    put(&mut block.placement, start, &hit.geomID);
                    put(&mut block.triangle, start, &hit.primID);
                    put(&mut block.instance, start, &hit.instID[0]);
                    put(&mut block.u, start, &hit.u);
                    put(&mut block.v, start, &hit.v);
                    for (axis, n) in block.normal.iter_mut().zip([hit.Ng_x, hit.Ng_y, hit.Ng_z]) {
                        put(axis, start, &n);
                    }
                    put(&mut block.t_max, start, &query.0.ray.tfar);
                }
            }

            /// Occlusion of a block.
            fn $occluded(&self, block: &mut RayBlock, arguments: &mut sys::RTCOccludedArguments) {
                let mut query = PacketAligned(sys::$ray::default());
                for start in (0..LANES).step_by($width) {
                    let valid =
                        PacketAligned(live_lanes::<$width>(&block.t_max[start..start + $width]));
                    if none_is_live(&valid.0) {
                        continue;
                    }
                    put_rays!(query.0, block, start);
                    // SAFETY: as above.
                    unsafe {
                        let scene = self.handle.0.as_ptr();
                        sys::$occlude(valid.0.as_ptr(), scene, &mut query.0, arguments);
                    }
                    put(&mut block.t_max, start, &query.0.tfar);
                }
            }
        }
    };
}

/// Puts the rays of a block from a lane on into a packet.
macro_rules! put_rays {
    ($ray:expr, $block:expr, $start:expr) => {{
        let (ray, start) = (&mut $ray, $start);
        let RayBlock { origin, direction, t_min, t_max, mask, .. } = &*$block;
        take(&mut ray.org_x, &origin[0], start);
        take(&mut ray.org_y, &origin[1], start);
        take(&mut ray.org_z, &origin[2], start);
        take(&mut ray.dir_x, &direction[0], start);
        take(&mut ray.dir_y, &direction[1], start);
        take(&mut ray.dir_z, &direction[2], start);
        take(&mut ray.tnear, t_min, start);
        take(&mut ray.tfar, t_max, start);
        take(&mut ray.mask, mask, start);
    }};
}

/// Takes the lanes of a row from `start` on.
#[inline(always)]
#[expect(
    clippy::manual_memcpy,
    reason = "a copy between slices is a call, where instructions differ"
)]
fn take<T: Copy, const W: usize>(lanes: &mut [T; W], row: &[T; LANES], start: usize) {
    let row = &row[start..start + W];
    for i in 0..W {
        lanes[i] = row[i];
    }
}

/// Puts lanes into a row from `start` on.
#[inline(always)]
#[expect(
    clippy::manual_memcpy,
    reason = "a copy between slices is a call, where instructions differ"
)]
fn put<T: Copy, const W: usize>(row: &mut [T; LANES], start: usize, lanes: &[T; W]) {
    let row = &mut row[start..start + W];
    for i in 0..W {
        row[i] = lanes[i];
    }
}

narrow_packets!(closest_by_4, occluded_by_4, 4, RTCRayHit4, RTCRay4, rtcIntersect4, rtcOccluded4);
narrow_packets!(closest_by_8, occluded_by_8, 8, RTCRayHit8, RTCRay8, rtcIntersect8, rtcOccluded8);

fn ray_of(block: &RayBlock, lane: usize) -> sys::RTCRay {
    let [origin, direction] = [&block.origin, &block.direction];
    sys::RTCRay {
        org_x: origin[0][lane],
        org_y: origin[1][lane],
        org_z: origin[2][lane],
        dir_x: direction[0][lane],
        dir_y: direction[1][lane],
        dir_z: direction[2][lane],
        tnear: block.t_min[lane],
        tfar: block.t_max[lane],
        mask: block.mask[lane],
        ..Default::default()
    }
}

/// True if no ray of a packet is to be traced. (Arrays are compared by a call.)
#[inline(always)]
fn none_is_live(valid: &[i32]) -> bool {
    valid.iter().fold(0, |any, lane| any | lane) == 0
}

/// True if the live lanes of a block spread by more than a few degrees.
fn spread_out(direction: &[[f32; LANES]; 3], is_live: impl Fn(usize) -> bool) -> bool {
    direction.iter().any(|axis| {
        let pick = |lane: usize, other: f32| if is_live(lane) { axis[lane] } else { other };
        let least = (0..LANES).map(|k| pick(k, f32::INFINITY)).fold(f32::INFINITY, f32::min);
        let most = (0..LANES).map(|k| pick(k, f32::NEG_INFINITY));
        most.fold(f32::NEG_INFINITY, f32::max) - least > MOST_SPREAD
    })
}
