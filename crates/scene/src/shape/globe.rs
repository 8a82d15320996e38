//! A sphere in rings: ring r of 2n, at r/2n of the way from pole to pole, has 4·min(r, 2n − r)
//! vertices, so triangles are of nearly one size everywhere: 8 n² of them over 4 n² + 2 vertices.
//!
//! To reach a number of triangles between two such squares, edges spread over the sphere are cut in
//! half, each of which turns two triangles into four.

use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Mesh, Positions, Vertices};
use rayon::prelude::*;

use super::relief::{Relief, sin_cos_turns};
use crate::import::{Wanted, count_degenerate};

/// Vertices that one task makes.
const CHUNK: usize = 1 << 12;

/// Floats behind the last vertex: Embree reads 16 bytes there.
const PADDING: usize = 4;

/// From this many rings on there are enough edges to cut.
const RINGS_TO_CUT: u32 = 4;

/// Answers whether to go on, on any thread.
pub type GoOn<'a> = &'a (dyn Fn() -> bool + Sync);

/// The rings of a sphere and how many of its edges are cut.
#[derive(Debug, Clone, Copy)]
pub(super) struct Globe {
    /// Rings from a pole to the equator.
    n: u32,
    /// Edges cut in half.
    cuts: u32,
}

/// Place of a vertex: fractions of a half turn from the north pole and of a turn to the east.
#[derive(Debug, Clone, Copy)]
struct GlobePoint {
    south: f64,
    east: f64,
}

/// Triangles between two rings, in one quadrant: `2m + 1` of them.
#[derive(Clone, Copy)]
struct GlobeRow {
    /// Index of the row from the north, 0..2n.
    index: u32,
    /// Rings from the nearer pole to the inner ring.
    m: u32,
}

impl Globe {
    /// With `triangles` triangles, rounded up to an even number; below `8·4²` the next 8 n².
    pub(super) fn new(triangles: u64) -> Self {
        let even = triangles.next_multiple_of(2);
        let n = (even / 8).isqrt().max(1);
        let n = match u32::try_from(n) {
            Ok(n) if n >= RINGS_TO_CUT || 8 * u64::from(n).pow(2) >= even => n,
            Ok(n) => n + 1,
            Err(_) => u32::from(u16::MAX),
        };
        let left = even.saturating_sub(8 * u64::from(n).pow(2));
        Self { n, cuts: u32::try_from(left / 2).unwrap_or(0) }
    }

    /// Makes the surface that `relief` describes; `None` once `go_on` says no.
    pub(super) fn build(
        &self,
        name: &str,
        relief: &Relief,
        wanted: Wanted,
        go_on: GoOn<'_>,
    ) -> Option<Mesh> {
        let cuts = self.cut_edges();
        let triangles = self.triangles(&cuts, wanted.uvs, go_on)?;
        // Places first; normals and texture coordinates where they are wanted.
        let places = GlobeVertices { globe: self, cuts: &cuts, seam: wanted.uvs, go_on };
        let (floats, bounds) = places.positions(relief)?;
        let count = places.count();
        let positions = Positions::F32(vertices(floats, count));
        let normals = match wanted.normals {
            true => Some(vertices(places.normals(relief)?, count)),
            false => None,
        };
        let uvs = if wanted.uvs { vec![vertices(places.uvs()?, count)] } else { Vec::new() };
        let degenerate = count_degenerate(&positions, &triangles);
        let triangles = triangles.into();
        Some(Mesh {
            name: name.to_owned(),
            positions,
            triangles,
            normals,
            uvs,
            colors: None,
            tangents: None,
            bounds,
            degenerate,
            steps: None,
        })
    }

    /// Vertices of the rings alone.
    fn ring_vertices(&self) -> usize {
        4 * (self.n as usize).pow(2) + 2
    }

    /// Vertices of ring `r`; the poles are rings of one.
    fn ring_size(&self, r: u32) -> u32 {
        (4 * r.min(2 * self.n - r)).max(1)
    }

    /// The first vertex of ring `r`.
    fn ring_start(&self, r: u32) -> usize {
        let from_pole = r.min(2 * self.n - r) as usize;
        if r == 0 {
            0
        } else if r <= self.n {
            1 + 2 * from_pole * (from_pole - 1)
        } else {
            self.ring_vertices() - 1 - 2 * from_pole * (from_pole + 1)
        }
    }

    /// The ring of vertex `i`.
    fn ring_of(&self, i: usize) -> u32 {
        // 1 + 2r(r − 1) ≤ i, solved for r; counted from the nearer pole.
        let from_pole = |i: usize| if i == 0 { 0 } else { usize::midpoint(1, (2 * i - 1).isqrt()) };
        let last = self.ring_vertices() - 1;
        let north = from_pole(i);
        let ring = if north <= self.n as usize {
            north
        } else {
            2 * self.n as usize - from_pole(last - i)
        };
        u32::try_from(ring).unwrap_or(u32::MAX)
    }

    fn rows(&self) -> impl Iterator<Item = GlobeRow> + use<> {
        let n = self.n;
        (0..2 * n).map(move |index| GlobeRow { index, m: index.min(2 * n - 1 - index) })
    }

    /// The first triangle of row `index`.
    fn row_start(&self, index: u32) -> usize {
        let (n, i) = (self.n as usize, index as usize);
        if i <= n { 4 * i * i } else { 8 * n * n - 4 * (2 * n - i).pow(2) }
    }

    /// The edges to cut, evenly spread over all pairs of triangles that could be.
    fn cut_edges(&self) -> Vec<Cut> {
        let n = u64::from(self.n);
        let (pairs, cuts) = (4 * n * (n - 1), u64::from(self.cuts));
        let mut rows = self.rows();
        let mut row = GlobeRow { index: 0, m: 0 };
        let (mut first, mut behind) = (0, 0);
        let mut edges = Vec::with_capacity(self.cuts as usize);
        for cut in 0..cuts {
            let pair = cut * pairs / cuts;
            while pair >= behind {
                let Some(next) = rows.next() else { return edges };
                row = next;
                first = behind;
                behind += 4 * u64::from(row.m);
            }
            let within = u32::try_from(pair - first).unwrap_or(0);
            edges.push(Cut { row, quadrant: within / row.m, j: within % row.m });
        }
        edges
    }

    /// All triangles; `None` when it was stopped. `seam`: the easternmost vertex of each ring is one of its own.
    fn triangles(&self, cuts: &[Cut], seam: bool, go_on: GoOn<'_>) -> Option<Vec<[u32; 3]>> {
        let whole = 8 * (self.n as usize).pow(2);
        let mut triangles = vec![[0; 3]; whole + 2 * cuts.len()];
        let mut rows: Vec<(GlobeRow, &mut [[u32; 3]])> = Vec::with_capacity(2 * self.n as usize);
        let mut rest = &mut triangles[..whole];
        for row in self.rows() {
            let (own, behind) = rest.split_at_mut(4 * (2 * row.m as usize + 1));
            rows.push((row, own));
            rest = behind;
        }
        rows.into_par_iter().try_for_each(|(row, own)| {
            self.fill_row(row, seam, own);
            go_on().then_some(())
        })?;
        for (e, cut) in (0_u32..).zip(cuts) {
            let per_quadrant = 2 * cut.row.m as usize + 1;
            let up = self.row_start(cut.row.index)
                + cut.quadrant as usize * per_quadrant
                + 2 * cut.j as usize;
            let middle = u32::try_from(self.ring_vertices()).unwrap_or(u32::MAX) + e;
            let behind = whole + 2 * e as usize;
            // The first triangle's edge from corner 0 to its outer corner is the second's too.
            let ([a, b, c], [_, _, d]) = (triangles[up], triangles[up + 1]);
            let (first, second) = if cut.row.index < self.n {
                ([[a, b, middle], [middle, b, c]], [[a, middle, d], [middle, c, d]])
            } else {
                // Turned over: (a, c, b) and (a, d, c).
                let (c, b, d) = (b, c, triangles[up + 1][1]);
                ([[a, middle, b], [middle, c, b]], [[a, d, middle], [middle, d, c]])
            };
            [triangles[up], triangles[behind]] = first;
            [triangles[up + 1], triangles[behind + 1]] = second;
        }
        Some(triangles)
    }

    /// The triangles of one row, quadrant by quadrant from west to east.
    fn fill_row(&self, row: GlobeRow, seam: bool, to: &mut [[u32; 3]]) {
        let north = row.index < self.n;
        let (inner, outer) =
            if north { (row.index, row.index + 1) } else { (row.index + 1, row.index) };
        let inner = self.ring(inner, seam);
        let outer = self.ring(outer, seam);
        let m = row.m;
        let per_quadrant = 2 * m as usize + 1;
        for (quadrant, triangles) in (0..4).zip(to.chunks_exact_mut(per_quadrant)) {
            let (west_in, west_out) = (quadrant * m, quadrant * (m + 1));
            for (s, triangle) in (0..).zip(triangles) {
                let j = s / 2;
                let [a, b, c] = if s % 2 == 0 {
                    [inner.at(west_in + j), outer.at(west_out + j), outer.at(west_out + j + 1)]
                } else {
                    [inner.at(west_in + j), outer.at(west_out + j + 1), inner.at(west_in + j + 1)]
                };
                *triangle = if north { [a, b, c] } else { [a, c, b] };
            }
        }
    }

    fn ring(&self, r: u32, seam: bool) -> GlobeRing {
        let index = |i: usize| u32::try_from(i).unwrap_or(u32::MAX);
        let start = index(self.ring_start(r));
        let is_pole = r == 0 || r == 2 * self.n;
        GlobeRing {
            start,
            size: self.ring_size(r),
            east: if seam && !is_pole {
                index(self.ring_vertices()) + self.cuts + (r - 1)
            } else {
                start
            },
        }
    }
}

/// The vertices of one ring.
struct GlobeRing {
    start: u32,
    size: u32,
    /// The vertex after the last: the first again, or its double on the seam.
    east: u32,
}

impl GlobeRing {
    fn at(&self, k: u32) -> u32 {
        if k < self.size { self.start + k } else { self.east }
    }
}

/// An edge to cut: between the triangles 2j and 2j + 1 of a row's quadrant.
#[derive(Clone, Copy)]
struct Cut {
    row: GlobeRow,
    quadrant: u32,
    j: u32,
}

/// Places of all vertices: of the rings, in the middle of cut edges, and on the seam.
struct GlobeVertices<'a> {
    globe: &'a Globe,
    cuts: &'a [Cut],
    seam: bool,
    go_on: GoOn<'a>,
}

impl GlobeVertices<'_> {
    fn count(&self) -> usize {
        let seam = if self.seam { 2 * self.globe.n as usize - 1 } else { 0 };
        self.globe.ring_vertices() + self.cuts.len() + seam
    }

    fn positions(&self, relief: &Relief) -> Option<(Vec<f32>, Bounds)> {
        let point = |place: GlobePoint| relief.point(place.direction()).as_vec3().to_array();
        let floats = self.each(point)?;
        let bounds = floats[..3 * self.count()]
            .par_chunks(3 * CHUNK)
            .map(|chunk| {
                let mut bounds = Bounds::EMPTY;
                for point in chunk.chunks_exact(3) {
                    bounds.include(DVec3::new(point[0].into(), point[1].into(), point[2].into()));
                }
                bounds
            })
            .reduce(|| Bounds::EMPTY, Bounds::union);
        Some((floats, bounds))
    }

    fn normals(&self, relief: &Relief) -> Option<Vec<f32>> {
        self.each(|place| relief.normal(place.direction()).as_vec3().to_array())
    }

    /// u to the east, v to the south. At a pole, where all meridians meet, u is that of the middle.
    fn uvs(&self) -> Option<Vec<f32>> {
        self.each(|place| {
            let is_pole = place.south <= 0.0 || place.south >= 1.0;
            let east = if is_pole { 0.5 } else { place.east };
            glam::DVec2::new(east, place.south).as_vec2().to_array()
        })
    }

    /// `N` floats for each vertex, in parallel, and the padding; `None` when it was stopped.
    fn each<const N: usize>(
        &self,
        value: impl Fn(GlobePoint) -> [f32; N] + Sync,
    ) -> Option<Vec<f32>> {
        let rings = self.globe.ring_vertices();
        let mut floats = vec![0.0; self.count() * N + PADDING];
        let (of_rings, of_others) = floats.split_at_mut(rings * N);
        of_rings.par_chunks_mut(CHUNK * N).enumerate().try_for_each(|(number, chunk)| {
            let mut walk = GlobeWalk::at(self.globe, number * CHUNK);
            for to in chunk.chunks_exact_mut(N) {
                to.copy_from_slice(&value(walk.next_place()));
            }
            (self.go_on)().then_some(())
        })?;
        let others = self.cuts.iter().map(|cut| cut.place(self.globe)).chain(self.seam_places());
        for (to, place) in of_others.chunks_exact_mut(N).zip(others) {
            to.copy_from_slice(&value(place));
        }
        Some(floats)
    }

    fn seam_places(&self) -> impl Iterator<Item = GlobePoint> {
        let rings = 2 * self.globe.n;
        let behind = if self.seam { rings } else { 1 };
        (1..behind).map(move |r| GlobePoint { south: f64::from(r) / f64::from(rings), east: 1.0 })
    }
}

impl Cut {
    /// The middle of the edge.
    fn place(&self, globe: &Globe) -> GlobePoint {
        let (m, rings) = (self.row.m, f64::from(2 * globe.n));
        let north = self.row.index < globe.n;
        let inner = if north { self.row.index } else { self.row.index + 1 };
        let east_in = f64::from(self.quadrant * m + self.j) / f64::from(4 * m);
        let east_out = f64::from(self.quadrant * (m + 1) + self.j + 1) / f64::from(4 * (m + 1));
        let towards_equator = if north { 0.5 } else { -0.5 };
        GlobePoint {
            south: (f64::from(inner) + towards_equator) / rings,
            east: f64::midpoint(east_in, east_out),
        }
    }
}

impl GlobePoint {
    /// The unit direction: +Y at the north pole, +Z in the west and east, +X a quarter from there.
    #[inline]
    fn direction(self) -> DVec3 {
        let (across, up) = sin_cos_turns(self.south / 2.0);
        let (x, z) = sin_cos_turns(self.east);
        DVec3::new(across * x, up, across * z)
    }
}

/// Steps through the vertices of the rings.
struct GlobeWalk<'a> {
    globe: &'a Globe,
    ring: u32,
    k: u32,
}

impl<'a> GlobeWalk<'a> {
    fn at(globe: &'a Globe, vertex: usize) -> Self {
        let ring = globe.ring_of(vertex);
        let k = u32::try_from(vertex - globe.ring_start(ring)).unwrap_or(0);
        Self { globe, ring, k }
    }

    #[inline]
    fn next_place(&mut self) -> GlobePoint {
        let size = self.globe.ring_size(self.ring);
        let place = GlobePoint {
            south: f64::from(self.ring) / f64::from(2 * self.globe.n),
            east: f64::from(self.k) / f64::from(size),
        };
        self.k += 1;
        if self.k == size {
            self.k = 0;
            self.ring += 1;
        }
        place
    }
}

fn vertices<const N: usize>(floats: Vec<f32>, count: usize) -> Vertices<N> {
    Vertices::new(floats.into(), N, count).unwrap_or_else(|| Vertices::from_arrays(&[]))
}

/// A disk of `radius` in the plane z = 0, facing +Z: the northern half of a globe, looked at from
/// above and pressed flat, rings at even distances. The next 4 n² triangles; `None` once `go_on` says no.
pub(super) fn disk(radius: f64, triangles: u64, wanted: Wanted, go_on: GoOn<'_>) -> Option<Mesh> {
    let n = triangles.div_ceil(4).isqrt().max(1);
    let n = if 4 * n * n < triangles { n + 1 } else { n };
    let globe = Globe { n: u32::try_from(n).unwrap_or(u32::from(u16::MAX)), cuts: 0 };
    let count = globe.ring_start(globe.n) + globe.ring_size(globe.n) as usize;
    let mut walk = GlobeWalk::at(&globe, 0);
    // The place as a fraction of the radius along x and y, y up.
    let places = (0..count).map(|number| {
        let place = walk.next_place();
        let (y, x) = sin_cos_turns(place.east);
        (number % CHUNK > 0 || go_on()).then_some([x * 2.0 * place.south, y * 2.0 * place.south])
    });
    let places: Vec<[f64; 2]> = places.collect::<Option<_>>()?;
    let mut flat = globe.triangles(&[], false, go_on)?;
    flat.truncate(4 * (globe.n as usize).pow(2));
    let single = |value: f64| glam::DVec2::new(value, 0.0).as_vec2().x;
    let positions: Vec<[f32; 3]> =
        places.iter().map(|&[x, y]| [single(x * radius), single(y * radius), 0.0]).collect();
    let positions = Positions::F32(Vertices::from_arrays(&positions));
    let mut mesh = Mesh::new("disk", positions, flat.into());
    if wanted.uvs {
        let uvs: Vec<[f32; 2]> =
            places.iter().map(|&[x, y]| [single(0.5 + 0.5 * x), single(0.5 - 0.5 * y)]).collect();
        mesh.uvs = vec![Vertices::from_arrays(&uvs)];
    }
    Some(mesh)
}
