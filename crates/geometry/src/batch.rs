//! Rays and hits as structures of arrays: a tile of the sensor is traced a few hundred rays at a
//! time, and nothing on the way is called once per ray through a pointer.

use glam::DVec3;

/// The placement and triangle of a ray that hit nothing.
pub const MISS: u32 = u32::MAX;

/// A triangle of a placement, as [`RayBatch::push_between_triangles`] takes it: both numbers are [`MISS`]
/// where there is none.
pub type PlacedTriangle = [u32; 2];

/// A batch of rays in world space (metres), one array a quantity. All arrays have one entry a ray: they
/// are read as slices, and change through methods that keep them so.
#[derive(Debug, Clone, Default)]
pub struct RayBatch {
    origins: [Vec<f64>; 3],
    directions: [Vec<f64>; 3],
    t_min: Vec<f64>,
    t_max: Vec<f64>,
    /// Empty as long as no ray has any.
    endpoint_triangles: Vec<[PlacedTriangle; 2]>,
    /// Empty as long as all rays are at time 0.
    times: Vec<f64>,
    /// Neighbours in the batch run close together (pixels of one block, samples of one pixel), so
    /// they are worth tracing as packets. Scattered rays are traced one by one.
    pub coherent: bool,
    /// The rays start on surfaces, outside by no more than a hit's own error: near their ends only
    /// f64 can tell what counts. `false` for rays that start in the open.
    pub from_surface: bool,
    /// Precision of the hits.
    pub precision: HitPrecision,
}

/// Precision of hits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum HitPrecision {
    /// To f64, decided by the exact test at edges and where rays start: for data.
    #[default]
    Double,
    /// As single precision has them, where a backend works in it: for light, whose noise is far above
    /// that. Rays that leave surfaces start clear of them by what f32 may misplace.
    Single,
}

/// The arrays of a batch, to be filled in place: their length stays.
#[derive(Debug)]
pub struct RaysMut<'a> {
    /// Origins (m), one array an axis.
    pub origins: [&'a mut [f64]; 3],
    /// Unit directions, one array an axis.
    pub directions: [&'a mut [f64]; 3],
    /// Nearest distances at which a hit counts (m, ≥ 0).
    pub t_min: &'a mut [f64],
    /// Farthest distances at which a hit counts (m, may be +inf).
    pub t_max: &'a mut [f64],
}

impl RayBatch {
    /// An empty batch with room for `capacity` rays.
    #[must_use]
    pub fn with_capacity(capacity: usize) -> Self {
        let array = || Vec::with_capacity(capacity);
        Self {
            origins: [array(), array(), array()],
            directions: [array(), array(), array()],
            t_min: array(),
            t_max: array(),
            ..Self::default()
        }
    }

    /// The batch with [`Self::coherent`] set.
    #[must_use]
    pub fn with_coherence(mut self, coherent: bool) -> Self {
        self.coherent = coherent;
        self
    }

    /// The batch with [`Self::from_surface`] set to `true`.
    #[must_use]
    pub fn from_surfaces(mut self) -> Self {
        self.from_surface = true;
        self
    }

    /// The number of rays.
    #[must_use]
    pub fn len(&self) -> usize {
        self.t_min.len()
    }

    /// True if there are no rays.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.t_min.is_empty()
    }

    /// Origins (m), one array an axis.
    #[must_use]
    pub fn origins(&self) -> [&[f64]; 3] {
        self.origins.each_ref().map(Vec::as_slice)
    }

    /// Unit directions, one array an axis.
    #[must_use]
    pub fn directions(&self) -> [&[f64]; 3] {
        self.directions.each_ref().map(Vec::as_slice)
    }

    /// Nearest distances at which a hit counts (m, ≥ 0).
    #[must_use]
    pub fn t_min(&self) -> &[f64] {
        &self.t_min
    }

    /// Farthest distances at which a hit counts (m, may be +inf). A ray that ends before it begins
    /// (below zero) hits nothing.
    #[must_use]
    pub fn t_max(&self) -> &[f64] {
        &self.t_max
    }

    /// The triangles at the start and at the end of each ray, which are not in between; `None` when no
    /// ray has any.
    #[must_use]
    pub fn endpoint_triangles(&self) -> Option<&[[PlacedTriangle; 2]]> {
        (!self.endpoint_triangles.is_empty()).then_some(&*self.endpoint_triangles)
    }

    /// Time of each ray (s from the frame's time); empty when all are at 0.
    #[must_use]
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Time of ray `i` (s from the frame's time).
    #[must_use]
    #[inline]
    pub fn time(&self, i: usize) -> f64 {
        self.times.get(i).copied().unwrap_or(0.0)
    }

    /// Says when the rays are (s from the frame's time): one time a ray, or none when all are at 0.
    ///
    /// # Panics
    ///
    /// When there are other than as many times as rays, or none.
    pub fn set_times(&mut self, times: impl IntoIterator<Item = f64>) {
        self.times.clear();
        self.times.extend(times);
        assert!(self.times.is_empty() || self.times.len() == self.len(), "a time for each ray");
    }

    /// Says when the last rays are, as many as there are `times` (s from the frame's time).
    pub fn end_at_times(&mut self, times: impl ExactSizeIterator<Item = f64>) {
        let first = self.len() - times.len();
        self.times.resize(first, 0.0);
        self.times.extend(times);
    }

    /// The origin of ray `i` (m).
    #[must_use]
    pub fn origin(&self, i: usize) -> DVec3 {
        DVec3::new(self.origins[0][i], self.origins[1][i], self.origins[2][i])
    }

    /// The unit direction of ray `i`.
    #[must_use]
    pub fn direction(&self, i: usize) -> DVec3 {
        DVec3::new(self.directions[0][i], self.directions[1][i], self.directions[2][i])
    }

    /// All arrays, to be filled in place.
    #[must_use]
    pub fn arrays_mut(&mut self) -> RaysMut<'_> {
        RaysMut {
            origins: self.origins.each_mut().map(Vec::as_mut_slice),
            directions: self.directions.each_mut().map(Vec::as_mut_slice),
            t_min: &mut self.t_min,
            t_max: &mut self.t_max,
        }
    }

    /// Removes all rays and keeps the memory.
    pub fn clear(&mut self) {
        self.arrays().for_each(Vec::clear);
        self.endpoint_triangles.clear();
        self.times.clear();
    }

    /// Makes room for `len` rays without limits and without triangles at their ends, whose origins and
    /// directions are to be set, at time 0; memory is kept.
    pub fn reset(&mut self, len: usize) {
        for array in self.origins.iter_mut().chain(&mut self.directions) {
            array.resize(len, 0.0);
        }
        refill(&mut self.t_min, len, 0.0);
        refill(&mut self.t_max, len, f64::INFINITY);
        self.endpoint_triangles.clear();
        self.times.clear();
    }

    /// Takes the rays of `other`; memory is kept.
    pub fn copy_from(&mut self, other: &Self) {
        self.arrays().zip(other.shared_arrays()).for_each(|(own, other)| own.clone_from(other));
        self.endpoint_triangles.clone_from(&other.endpoint_triangles);
        self.times.clone_from(&other.times);
        self.coherent = other.coherent;
        self.from_surface = other.from_surface;
        self.precision = other.precision;
    }

    /// Takes those rays of `other` whose numbers `order` gives, in that order; memory is kept.
    pub fn gather(&mut self, other: &Self, order: impl Iterator<Item = usize> + Clone) {
        for (own, other) in self.arrays().zip(other.shared_arrays()) {
            own.clear();
            own.extend(order.clone().map(|i| other[i]));
        }
        self.endpoint_triangles.clear();
        if let Some(triangles) = other.endpoint_triangles() {
            self.endpoint_triangles.extend(order.clone().map(|i| triangles[i]));
        }
        self.times.clear();
        if !other.times.is_empty() {
            self.times.extend(order.map(|i| other.times[i]));
        }
        self.coherent = other.coherent;
        self.from_surface = other.from_surface;
        self.precision = other.precision;
    }

    /// Keeps the rays whose number `is_kept` says, in their order.
    pub fn retain(&mut self, is_kept: impl Fn(usize) -> bool) {
        let len = self.len();
        let kept = || (0..len).filter(|&i| is_kept(i)).enumerate();
        let count = kept().count();
        for array in self.arrays() {
            kept().for_each(|(to, from)| array[to] = array[from]);
            array.truncate(count);
        }
        if !self.endpoint_triangles.is_empty() {
            kept()
                .for_each(|(to, from)| self.endpoint_triangles[to] = self.endpoint_triangles[from]);
            self.endpoint_triangles.truncate(count);
        }
        if !self.times.is_empty() {
            kept().for_each(|(to, from)| self.times[to] = self.times[from]);
            self.times.truncate(count);
        }
    }

    /// Appends a ray from `origin` along the unit vector `direction`, without limits.
    pub fn push(&mut self, origin: DVec3, direction: DVec3) {
        self.push_between(origin, direction, 0.0, f64::INFINITY);
    }

    /// Appends a ray that counts hits at distances in `t_min..=t_max` (m).
    pub fn push_between(&mut self, origin: DVec3, direction: DVec3, t_min: f64, t_max: f64) {
        self.put(origin, direction, [t_min, t_max]);
        if !self.endpoint_triangles.is_empty() {
            self.endpoint_triangles.push([[MISS; 2]; 2]);
        }
    }

    /// Appends a ray as [`Self::push_between`] does, which leaves the first of `triangles` and ends on the
    /// second: neither is in between.
    pub fn push_between_triangles(
        &mut self,
        origin: DVec3,
        direction: DVec3,
        [t_min, t_max]: [f64; 2],
        triangles: [PlacedTriangle; 2],
    ) {
        // Rays that were pushed before without triangles have none.
        self.endpoint_triangles.resize(self.len(), [[MISS; 2]; 2]);
        self.put(origin, direction, [t_min, t_max]);
        self.endpoint_triangles.push(triangles);
    }

    /// Appends the first `count` rays of a block, one array an axis, without limits.
    pub fn extend_from_block<const N: usize>(
        &mut self,
        origins: &[[f64; N]; 3],
        directions: &[[f64; N]; 3],
        count: usize,
    ) {
        let from = origins.iter().chain(directions);
        for (own, from) in self.origins.iter_mut().chain(&mut self.directions).zip(from) {
            own.extend_from_slice(&from[..count]);
        }
        let len = self.t_min.len() + count;
        self.t_min.resize(len, 0.0);
        self.t_max.resize(len, f64::INFINITY);
        if !self.endpoint_triangles.is_empty() {
            self.endpoint_triangles.resize(len, [[MISS; 2]; 2]);
        }
        self.extend_times();
    }

    /// Says of the last rays, as many as `triangles` there are, which triangles are at their ends.
    pub fn end_on_triangles(
        &mut self,
        triangles: impl ExactSizeIterator<Item = [PlacedTriangle; 2]>,
    ) {
        let first = self.len() - triangles.len();
        self.endpoint_triangles.resize(first, [[MISS; 2]; 2]);
        self.endpoint_triangles.extend(triangles);
    }

    fn put(&mut self, origin: DVec3, direction: DVec3, [t_min, t_max]: [f64; 2]) {
        for axis in 0..3 {
            self.origins[axis].push(origin[axis]);
            self.directions[axis].push(direction[axis]);
        }
        self.t_min.push(t_min);
        self.t_max.push(t_max);
        self.extend_times();
    }

    /// Puts new rays at time 0, when others are not.
    #[inline]
    fn extend_times(&mut self) {
        if !self.times.is_empty() {
            self.times.resize(self.t_min.len(), 0.0);
        }
    }

    fn arrays(&mut self) -> impl Iterator<Item = &mut Vec<f64>> {
        let limits = [&mut self.t_min, &mut self.t_max];
        self.origins.iter_mut().chain(&mut self.directions).chain(limits)
    }

    fn shared_arrays(&self) -> impl Iterator<Item = &Vec<f64>> {
        self.origins.iter().chain(&self.directions).chain([&self.t_min, &self.t_max])
    }
}

/// Detail to which a hit is worked out. What nobody asks for costs nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum Detail {
    /// Distance, placement and triangle; `u`, `v` and `normal` stay empty.
    #[default]
    Distance,
    /// Also the barycentric coordinates and the geometric normal.
    Surface,
}

/// Hits of a batch of rays: entry `i` belongs to ray `i`.
#[derive(Debug, Clone, Default)]
pub struct HitBatch {
    /// Detail that the accelerator has to fill in.
    pub detail: Detail,
    /// Distance along the ray (m), `+inf` for a miss.
    pub t: Vec<f64>,
    /// Index into [`crate::Geometry::placements`], or [`MISS`].
    pub placement: Vec<u32>,
    /// Index of the triangle in its mesh, or [`MISS`].
    pub triangle: Vec<u32>,
    /// Barycentric weight of the triangle's second corner (0 on a miss).
    pub u: Vec<f64>,
    /// Barycentric weight of the triangle's third corner (0 on a miss).
    pub v: Vec<f64>,
    /// Unit geometric normal in world space on the triangle's front (0 on a miss), one array an
    /// axis. It does not face the ray: the sign of its product with the direction tells the side.
    pub normal: [Vec<f64>; 3],
    /// Times of the rays, where something moves; else empty.
    times: Vec<f64>,
}

impl HitBatch {
    /// An empty batch whose hits will have `detail`.
    #[must_use]
    pub fn new(detail: Detail) -> Self {
        Self { detail, ..Self::default() }
    }

    /// Makes room for `len` hits, all of them misses.
    pub fn reset(&mut self, len: usize) {
        refill(&mut self.t, len, f64::INFINITY);
        refill(&mut self.placement, len, MISS);
        refill(&mut self.triangle, len, MISS);
        self.times.clear();
        if self.detail == Detail::Surface {
            for array in [&mut self.u, &mut self.v].into_iter().chain(&mut self.normal) {
                refill(array, len, 0.0);
            }
        }
    }

    /// Makes room for `len` hits without setting them, for whoever sets all of them.
    pub fn resize(&mut self, len: usize) {
        self.t.resize(len, f64::INFINITY);
        self.placement.resize(len, MISS);
        self.triangle.resize(len, MISS);
        self.times.clear();
        if self.detail == Detail::Surface {
            for array in [&mut self.u, &mut self.v].into_iter().chain(&mut self.normal) {
                array.resize(len, 0.0);
            }
        }
    }

    /// Says when the rays are (s from the frame's time), each or, by no times, all at 0; memory is kept.
    pub fn set_times(&mut self, times: &[f64]) {
        self.times.clear();
        self.times.extend_from_slice(times);
    }

    /// Time of ray `i` (s from the frame's time), as far as that counts: 0 where nothing moves.
    #[must_use]
    #[inline]
    pub fn time(&self, i: usize) -> f64 {
        self.times.get(i).copied().unwrap_or(0.0)
    }

    /// Turns hit `i` into a miss.
    pub fn clear_hit(&mut self, i: usize) {
        self.t[i] = f64::INFINITY;
        self.placement[i] = MISS;
        self.triangle[i] = MISS;
        if self.detail == Detail::Surface {
            for array in [&mut self.u, &mut self.v].into_iter().chain(&mut self.normal) {
                array[i] = 0.0;
            }
        }
    }

    /// The number of hits and misses.
    #[must_use]
    pub fn len(&self) -> usize {
        self.t.len()
    }

    /// True if the batch is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// True if ray `i` hit something.
    #[must_use]
    pub fn is_hit(&self, i: usize) -> bool {
        self.placement[i] != MISS
    }

    /// The geometric normal of hit `i`; zero on a miss or when the detail has none.
    #[must_use]
    pub fn normal(&self, i: usize) -> DVec3 {
        match self.normal[0].get(i) {
            Some(&x) => DVec3::new(x, self.normal[1][i], self.normal[2][i]),
            None => DVec3::ZERO,
        }
    }
}

fn refill<T: Copy>(array: &mut Vec<T>, len: usize, value: T) {
    array.clear();
    array.resize(len, value);
}

#[cfg(test)]
mod tests;
