//! Rays and hits as structures of arrays: a tile of the sensor is traced a few hundred rays at a
//! time, and nothing on the way is called once per ray through a pointer.

use glam::DVec3;

/// The placement and triangle of a ray that hit nothing.
pub const MISS: u32 = u32::MAX;

/// A batch of rays in world space (metres). All arrays have one entry a ray.
#[derive(Debug, Clone, Default)]
pub struct RayBatch {
    /// Origins (m), one array an axis.
    pub origin: [Vec<f64>; 3],
    /// Unit directions, one array an axis.
    pub direction: [Vec<f64>; 3],
    /// Nearest distance at which a hit counts (m, ≥ 0).
    pub t_min: Vec<f64>,
    /// Farthest distance at which a hit counts (m, may be +inf).
    pub t_max: Vec<f64>,
    /// Neighbours in the batch run close together (pixels of one block, samples of one pixel), so
    /// they are worth tracing as packets. Scattered rays are traced one by one.
    pub coherent: bool,
    /// The rays start on surfaces, outside by no more than a hit's own error: near their ends only
    /// f64 can tell what counts. `false` for rays that start in the open.
    pub from_surface: bool,
    /// The placement and the triangle at either end of each ray, which are not in between; [`MISS`]
    /// for none, and empty when nobody says.
    pub ends: Vec<[[u32; 2]; 2]>,
}

impl RayBatch {
    /// An empty batch with room for `capacity` rays.
    #[must_use]
    pub fn with_capacity(capacity: usize) -> Self {
        let array = || Vec::with_capacity(capacity);
        Self {
            origin: [array(), array(), array()],
            direction: [array(), array(), array()],
            t_min: array(),
            t_max: array(),
            coherent: false,
            from_surface: false,
            ends: Vec::new(),
        }
    }

    /// The number of rays.
    #[must_use]
    pub fn len(&self) -> usize {
        self.t_min.len()
    }

    /// Whether there is no ray.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.t_min.is_empty()
    }

    /// Removes all rays and keeps the memory.
    pub fn clear(&mut self) {
        for array in self.origin.iter_mut().chain(&mut self.direction) {
            array.clear();
        }
        self.t_min.clear();
        self.t_max.clear();
        self.ends.clear();
    }

    /// Takes the rays of `other`; memory is kept.
    pub fn copy_from(&mut self, other: &Self) {
        let arrays = self.origin.iter_mut().chain(&mut self.direction);
        for (own, other) in arrays.zip(other.origin.iter().chain(&other.direction)) {
            own.clone_from(other);
        }
        self.t_min.clone_from(&other.t_min);
        self.t_max.clone_from(&other.t_max);
        self.coherent = other.coherent;
        self.from_surface = other.from_surface;
        self.ends.clone_from(&other.ends);
    }

    /// Appends a ray from `origin` along the unit vector `direction`, without limits.
    pub fn push(&mut self, origin: DVec3, direction: DVec3) {
        self.push_between(origin, direction, 0.0, f64::INFINITY);
    }

    /// Appends a ray that counts hits at distances in `t_min..=t_max` (m).
    pub fn push_between(&mut self, origin: DVec3, direction: DVec3, t_min: f64, t_max: f64) {
        for axis in 0..3 {
            self.origin[axis].push(origin[axis]);
            self.direction[axis].push(direction[axis]);
        }
        self.t_min.push(t_min);
        self.t_max.push(t_max);
    }

    /// The origin of ray `i` (m).
    #[must_use]
    pub fn origin(&self, i: usize) -> DVec3 {
        DVec3::new(self.origin[0][i], self.origin[1][i], self.origin[2][i])
    }

    /// The unit direction of ray `i`.
    #[must_use]
    pub fn direction(&self, i: usize) -> DVec3 {
        DVec3::new(self.direction[0][i], self.direction[1][i], self.direction[2][i])
    }
}

/// How much of a hit is worked out. What nobody asks for costs nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum Detail {
    /// Distance, placement and triangle; `u`, `v` and `normal` stay empty.
    #[default]
    Distance,
    /// Also the barycentric coordinates and the geometric normal.
    Surface,
}

/// What a batch of rays hit: entry `i` belongs to ray `i`.
#[derive(Debug, Clone, Default)]
pub struct HitBatch {
    /// What the accelerator has to fill in.
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
        if self.detail == Detail::Surface {
            for array in [&mut self.u, &mut self.v].into_iter().chain(&mut self.normal) {
                array.resize(len, 0.0);
            }
        }
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

    /// Whether the batch is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// Whether ray `i` hit something.
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
