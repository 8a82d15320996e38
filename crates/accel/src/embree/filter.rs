//! Filters: what Embree asks about each hit that single precision finds, decided in f64.
//!
//! A filter sees every triangle that the single-precision ray meets on its way, not only the
//! nearest, and Embree looks on behind what it refuses. So *whether* a triangle counts is the exact
//! test's word, and single precision only has to come near it.

use std::ffi::c_int;

use embree4_sys as sys;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Geometry, MISS, RayBatch};

use crate::nearest::{Nearest, PlacementView, Query, Triangle, Verdict};
use crate::single::{self, Rays32};

/// The hits that a filter is asked about: one for each lane of a packet.
struct PacketHits {
    valid: *mut c_int,
    ray: *mut f32,
    hit: *const u32,
    width: usize,
}

// Which of the arrays of `RTCRayN` and `RTCHitN` holds what (rtcore_ray.h).
const RAY_TFAR: usize = 8;
const RAY_ID: usize = 10;
const HIT_PRIMITIVE: usize = 5;
const HIT_GEOMETRY: usize = 6;
const HIT_INSTANCE: usize = 7;

impl PacketHits {
    /// # Safety
    ///
    /// `args` must be what Embree passed to a filter, and not outlive the call.
    unsafe fn of(args: *const sys::RTCFilterFunctionNArguments) -> Self {
        // SAFETY: the caller vouches for `args`.
        let args = unsafe { &*args };
        Self {
            valid: args.valid,
            ray: args.ray.cast(),
            hit: args.hit.cast_const().cast(),
            width: args.N as usize,
        }
    }

    /// Calls `keep` for every hit there is, and refuses those for which it answers `false`.
    fn judge(&self, mut keep: impl FnMut(LaneHit<'_>) -> bool) {
        for lane in 0..self.width {
            // SAFETY: Embree gives `width` flags, and as many of each number of rays and hits.
            unsafe {
                if *self.valid.add(lane) != 0 && !keep(LaneHit { lanes: self, lane }) {
                    *self.valid.add(lane) = 0;
                }
            }
        }
    }
}

/// One lane.
struct LaneHit<'a> {
    lanes: &'a PacketHits,
    lane: usize,
}

impl LaneHit<'_> {
    fn of_ray(&self, array: usize) -> f32 {
        // SAFETY: the arrays of a ray stand behind each other, `width` numbers of four bytes each.
        unsafe { *self.lanes.ray.add(array * self.lanes.width + self.lane) }
    }

    fn of_hit(&self, array: usize) -> u32 {
        // SAFETY: as above.
        unsafe { *self.lanes.hit.add(array * self.lanes.width + self.lane) }
    }

    /// The number that the query gave its ray.
    fn id(&self) -> usize {
        self.of_ray(RAY_ID).to_bits() as usize
    }

    fn t(&self) -> f32 {
        self.of_ray(RAY_TFAR)
    }

    /// Makes Embree look as far as `t` from here on. "Intersection filters may modify tfar", say
    /// Embree's kernels.
    fn look_to(&self, t: f32) {
        // SAFETY: as above; Embree lets filters write here.
        unsafe { *self.lanes.ray.add(RAY_TFAR * self.lanes.width + self.lane) = t }
    }

    /// Placement and triangle.
    fn ids(&self) -> [u32; 2] {
        let instance = self.of_hit(HIT_INSTANCE);
        let placement = if instance == MISS { self.of_hit(HIT_GEOMETRY) } else { instance };
        [placement, self.of_hit(HIT_PRIMITIVE)]
    }

    fn triangle(&self, geometry: &Geometry) -> Triangle {
        let [placement, triangle] = self.ids();
        Triangle::of(geometry, placement, triangle)
    }
}

/// Verdict of the exact test on a ray and a triangle.
fn verdict(geometry: &Geometry, query: &Query, triangle: &Triangle) -> Verdict {
    let placement = &geometry.placements[triangle.placement as usize];
    query.judge(&PlacementView::new(&placement.world_from_mesh), triangle.corners)
}

/// The rays of a query whose hits are decided one by one.
#[repr(C)]
pub(crate) struct ExactFilter<'a> {
    /// First, because this is what Embree hands on.
    context: sys::RTCRayQueryContext,
    geometry: &'a Geometry,
    rays: &'a RayBatch,
    rays32: &'a Rays32,
    /// Rays that met a triangle in single precision and pass beside it in f64: they may have hit its
    /// neighbour.
    pub(super) doubtful: &'a mut Vec<u32>,
}

impl<'a> ExactFilter<'a> {
    pub(crate) fn new(
        geometry: &'a Geometry,
        rays: &'a RayBatch,
        rays32: &'a Rays32,
        doubtful: &'a mut Vec<u32>,
    ) -> Self {
        Self { context: sys::RTCRayQueryContext::default(), geometry, rays, rays32, doubtful }
    }

    /// True if a hit is certainly behind the ray's nearest distance that counts.
    fn is_clear(&self, hit: &LaneHit<'_>) -> bool {
        let i = hit.id();
        let near = f64::from(self.rays32.t_near[i]);
        f64::from(hit.t()) > near + 2.0 * self.rays32.slack(i, near)
    }

    fn keeps(&mut self, hit: &LaneHit<'_>) -> bool {
        let i = hit.id();
        let ends = self.rays.endpoint_triangles();
        if ends.is_some_and(|ends| ends[i].contains(&hit.ids())) {
            return false;
        }
        let Some(query) = Query::of(self.rays, i) else { return false };
        match verdict(self.geometry, &query, &hit.triangle(self.geometry)) {
            Verdict::Hit(_) => true,
            Verdict::OutOfRange => false,
            Verdict::Miss => {
                #[expect(clippy::cast_possible_truncation, reason = "batches are small")]
                self.doubtful.push(i as u32);
                false
            }
        }
    }

    pub(super) fn context(&mut self) -> *mut sys::RTCRayQueryContext {
        std::ptr::from_mut(self).cast()
    }
}

/// Keeps what the exact test says is hit.
///
/// # Safety
///
/// For Embree, in queries whose context is a [`ExactFilter`].
pub(super) unsafe extern "C" fn keep_exact(args: *const sys::RTCFilterFunctionNArguments) {
    // SAFETY: Embree's own arguments, and the query's context, which nobody else uses meanwhile.
    let (lanes, judged) = unsafe {
        (PacketHits::of(args), &mut *sys::filter_context(args).cast::<ExactFilter<'_>>())
    };
    lanes.judge(|hit| judged.keeps(&hit));
}

/// As [`keep_exact`] near the start of a ray; keeps whatever lies well clear of it.
///
/// # Safety
///
/// As for [`keep_exact`].
pub(super) unsafe extern "C" fn keep_clear(args: *const sys::RTCFilterFunctionNArguments) {
    // SAFETY: as in `keep_exact`.
    let (lanes, judged) = unsafe {
        (PacketHits::of(args), &mut *sys::filter_context(args).cast::<ExactFilter<'_>>())
    };
    lanes.judge(|hit| judged.is_clear(&hit) || judged.keeps(&hit));
}

/// The nearest of the triangles that a bundle of rays around one ray meets and that one ray hits.
#[repr(C)]
pub(crate) struct NearestSearch<'a> {
    /// First, because this is what Embree hands on.
    context: sys::RTCRayQueryContext,
    geometry: &'a Geometry,
    query: Query,
    pub(crate) nearest: Nearest,
    /// Distance by which the bundle's rays were moved ahead (m).
    advance: f64,
    /// Distance up to which the bundle looks, from there: behind the nearest by what single precision may be off.
    limit: f32,
    slack: f64,
    /// A bit for each ray of the bundle that met a triangle which the ray itself passes by.
    pub(crate) missed: u32,
    /// The corner of those that is nearest to the ray: its moment d × p.
    nearest_moment: DVec3,
}

impl<'a> NearestSearch<'a> {
    /// For a ray of which nothing is known, moved `advance` ahead; distances may be off by `slack`.
    pub(crate) fn new(geometry: &'a Geometry, query: Query, advance: f64, slack: f64) -> Self {
        Self {
            context: sys::RTCRayQueryContext::default(),
            geometry,
            nearest: Nearest::none(query.t_max),
            query,
            advance,
            limit: f32::INFINITY,
            slack,
            missed: 0,
            nearest_moment: DVec3::INFINITY,
        }
    }

    pub(super) fn context(&mut self) -> *mut sys::RTCRayQueryContext {
        std::ptr::from_mut(self).cast()
    }

    fn note_corners(&mut self, triangle: &Triangle) {
        let placement = &self.geometry.placements[triangle.placement as usize];
        let view = PlacementView::new(&placement.world_from_mesh);
        for corner in view.seen_from(self.query.origin, triangle.corners) {
            let moment = moment(self.query.direction, corner);
            if moment.length_squared() < self.nearest_moment.length_squared() {
                self.nearest_moment = moment;
            }
        }
    }

    /// The way (m), sideways from the ray, to the nearest corner of the triangles that it passes by;
    /// `None` without any, or where the ray goes through it.
    pub(crate) fn nearest_corner(&self) -> Option<DVec3> {
        let moment = self.nearest_moment;
        let way = moment.cross(self.query.direction) / self.query.direction.length_squared();
        (moment.is_finite() && way != DVec3::ZERO).then_some(way)
    }

    fn keeps(&mut self, hit: &LaneHit<'_>) -> bool {
        let triangle = hit.triangle(self.geometry);
        let exact = match verdict(self.geometry, &self.query, &triangle) {
            Verdict::Hit(exact) => exact,
            Verdict::OutOfRange => return false,
            Verdict::Miss => {
                self.missed |= 1 << hit.id();
                self.note_corners(&triangle);
                return false;
            }
        };
        self.nearest.offer(exact, &triangle);
        let end = self.nearest.t - self.advance + self.slack;
        self.limit = self.limit.min(single::round(end));
        hit.look_to(self.limit);
        true
    }
}

/// `a` × `b`, each component to 1.5 units in its own last place, however much of it cancels (W. Kahan's
/// difference of products: C.-P. Jeannerod, N. Louvet and J.-M. Muller, *Math. Comp.* 82, 2245 (2013)).
fn moment(a: DVec3, b: DVec3) -> DVec3 {
    let difference = |a: f64, b: f64, c: f64, d: f64| {
        let subtracted = c * d;
        a.mul_add(b, -subtracted) - c.mul_add(d, -subtracted)
    };
    DVec3::new(
        difference(a.y, b.z, a.z, b.y),
        difference(a.z, b.x, a.x, b.z),
        difference(a.x, b.y, a.y, b.x),
    )
}

/// Notes the nearest exact hit in a [`NearestSearch`].
///
/// # Safety
///
/// For Embree, in closest-hit queries whose context is a [`NearestSearch`].
pub(super) unsafe extern "C" fn search(args: *const sys::RTCFilterFunctionNArguments) {
    // SAFETY: as in `keep_exact`.
    let (lanes, search) = unsafe {
        (PacketHits::of(args), &mut *sys::filter_context(args).cast::<NearestSearch<'_>>())
    };
    lanes.judge(|hit| search.keeps(&hit));
}
