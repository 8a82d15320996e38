//! Shapes that need no file: tessellated on load, the same on every machine and for any number of
//! threads.
//!
//! Round shapes are made of rings (`globe.rs`) and have shared vertices, so they are closed. With
//! texture coordinates the vertices of one meridian exist twice, at the same place to the bit.
//!
//! Shapes with flat faces.

mod globe;
mod relief;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::import::Wanted;
use etendue_geometry::glam::DVec3;
use etendue_geometry::units::Metres;
use etendue_geometry::{Mesh, Positions, Vertices};
use globe::Globe;
pub use globe::GoOn;
use relief::Relief;

/// The most triangles of a shape: 12 GiB of indices.
const MOST_TRIANGLES: u64 = 1 << 30;

/// A shape as the scene file writes it. All are centred on the origin of their own frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "shape", rename_all = "snake_case", deny_unknown_fields)]
pub enum ShapeSpec {
    /// A rectangle in the plane z = 0 that faces +Z. Texture coordinates start at its upper left.
    Rectangle {
        /// Along x (m).
        #[serde(default = "one_metre")]
        width: Metres,
        /// Along y (m).
        #[serde(default = "one_metre")]
        height: Metres,
    },
    /// A box along the axes. Each face has the whole range of texture coordinates.
    Box {
        /// Along x, y and z (m).
        #[serde(default = "one_metre_each")]
        size: [Metres; 3],
    },
    /// A sphere: rings of triangles whose corners are on it.
    Sphere {
        /// Its radius (m).
        #[serde(default = "one_metre")]
        radius: Metres,
        /// Number of triangles, counted as for a blob.
        #[serde(default = "sphere_triangles")]
        triangles: u64,
    },
    /// A disk in the plane z = 0 that faces +Z: a polygon whose corners are on the circle.
    Disk {
        /// Its radius (m).
        #[serde(default = "one_metre")]
        radius: Metres,
        /// At least as many triangles, the next 4 n².
        #[serde(default = "disk_triangles")]
        triangles: u64,
    },
    /// A sphere with hills and valleys, closed, of any number of triangles.
    Blob {
        /// The mean radius (m).
        #[serde(default = "one_metre")]
        radius: Metres,
        /// Number of triangles: exactly as many from 128 on, an odd number rounded up; the next
        /// 8 n² below.
        #[serde(default = "sphere_triangles")]
        triangles: u64,
        /// Number of the blob.
        #[serde(default)]
        seed: u64,
        /// The largest displacement as a fraction of the radius (0..=0.9).
        #[serde(default = "default_amplitude")]
        amplitude: f64,
    },
}

fn one_metre() -> Metres {
    Metres(1.0)
}

fn one_metre_each() -> [Metres; 3] {
    [Metres(1.0); 3]
}

fn sphere_triangles() -> u64 {
    32_768
}

fn disk_triangles() -> u64 {
    4_096
}

fn default_amplitude() -> f64 {
    0.25
}

/// A key of a shape that holds an impossible value.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{key}` {reason}")]
pub struct ShapeError {
    /// The key.
    pub key: &'static str,
    /// Description of the error, and of what is valid.
    pub reason: String,
}

impl ShapeSpec {
    /// The word behind `shape` in the file.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Rectangle { .. } => "rectangle",
            Self::Box { .. } => "box",
            Self::Sphere { .. } => "sphere",
            Self::Disk { .. } => "disk",
            Self::Blob { .. } => "blob",
        }
    }

    /// Number of triangles that the shape is asked to have, and the bytes of memory that they take.
    pub(crate) fn cost(&self, wanted: Wanted) -> (u64, u64) {
        let (triangles, is_flat) = match *self {
            Self::Rectangle { .. } | Self::Box { .. } => (12, true),
            Self::Disk { triangles, .. } => (triangles, true),
            Self::Sphere { triangles, .. } | Self::Blob { triangles, .. } => (triangles, false),
        };
        // Three indices a triangle, and a vertex for every other one (Euler's formula).
        let normals = if wanted.normals && !is_flat { 12 } else { 0 };
        let vertex = 12 + normals + if wanted.uvs { 8 } else { 0 };
        (triangles, triangles.saturating_mul(12 + vertex / 2))
    }

    /// Makes the mesh, with normals and texture coordinates where `wanted`. Flat shapes have no normals but those of
    /// their triangles.
    ///
    /// # Errors
    ///
    /// When a size is not positive or a number of triangles is out of range.
    pub fn build(&self, wanted: Wanted) -> Result<Mesh, ShapeError> {
        let stopped = || ShapeError { key: "shape", reason: "was stopped".to_owned() };
        self.build_while(wanted, &|| true)?.ok_or_else(stopped)
    }

    /// Makes the mesh as [`Self::build`] does, and asks now and then whether to go on: `None` when
    /// it was stopped.
    ///
    /// # Errors
    ///
    /// When a size is not positive or a number of triangles is out of range.
    pub fn build_while(&self, wanted: Wanted, go_on: GoOn<'_>) -> Result<Option<Mesh>, ShapeError> {
        Ok(match *self {
            Self::Rectangle { width, height } => {
                let half = [half("width", width)?, half("height", height)?];
                Some(rectangle(half, wanted))
            }
            Self::Box { size: [x, y, z] } => {
                let half = [half("size", x)?, half("size", y)?, half("size", z)?];
                Some(cuboid(half, wanted))
            }
            Self::Sphere { radius, triangles } => {
                let relief = Relief::none(positive("radius", radius)?);
                Globe::new(in_range(triangles)?).build("sphere", &relief, wanted, go_on)
            }
            Self::Disk { radius, triangles } => {
                let radius = positive("radius", radius)?;
                globe::disk(radius, in_range(triangles)?, wanted, go_on)
            }
            Self::Blob { radius, triangles, seed, amplitude } => {
                let radius = positive("radius", radius)?;
                if !(0.0..=0.9).contains(&amplitude) {
                    let reason = format!("is {amplitude}; it has to be from 0 to 0.9");
                    return Err(ShapeError { key: "amplitude", reason });
                }
                let relief = Relief::new(radius, amplitude, seed);
                Globe::new(in_range(triangles)?).build("blob", &relief, wanted, go_on)
            }
        })
    }
}

fn positive(key: &'static str, length: Metres) -> Result<f64, ShapeError> {
    // Within these bounds squares of f32 coordinates neither vanish nor overflow.
    if (1e-18..=1e18).contains(&length.0) {
        Ok(length.0)
    } else {
        let reason = format!("is {} m; it has to be a length from 1e-18 m to 1e18 m", length.0);
        Err(ShapeError { key, reason })
    }
}

fn half(key: &'static str, length: Metres) -> Result<f64, ShapeError> {
    positive(key, length).map(|length| length / 2.0)
}

fn in_range(triangles: u64) -> Result<u64, ShapeError> {
    if (1..=MOST_TRIANGLES).contains(&triangles) {
        Ok(triangles)
    } else {
        let reason = format!("is {triangles}; it has to be from 1 to {MOST_TRIANGLES}");
        Err(ShapeError { key: "triangles", reason })
    }
}

/// Corners of a face, in units of its half axes, counter-clockwise from the lower left.
const CORNERS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

/// A face's centre and half axes, to the right and up as seen from its front.
struct FaceAxes {
    centre: DVec3,
    right: DVec3,
    up: DVec3,
}

/// A rectangle of half width and half height in the plane z = 0, facing +Z.
fn rectangle([width, height]: [f64; 2], wanted: Wanted) -> Mesh {
    let face = FaceAxes { centre: DVec3::ZERO, right: DVec3::X * width, up: DVec3::Y * height };
    mesh("rectangle", &[face], wanted)
}

/// A box of these half sizes.
fn cuboid([x, y, z]: [f64; 3], wanted: Wanted) -> Mesh {
    let [x, y, z] = [DVec3::X * x, DVec3::Y * y, DVec3::Z * z];
    let faces = [
        FaceAxes { centre: x, right: -z, up: y },
        FaceAxes { centre: -x, right: z, up: y },
        FaceAxes { centre: y, right: x, up: -z },
        FaceAxes { centre: -y, right: x, up: z },
        FaceAxes { centre: z, right: x, up: y },
        FaceAxes { centre: -z, right: -x, up: y },
    ];
    mesh("box", &faces, wanted)
}

fn mesh(name: &str, faces: &[FaceAxes], wanted: Wanted) -> Mesh {
    let per_corner = |value: &dyn Fn(&FaceAxes, [f64; 2]) -> DVec3| -> Vec<[f32; 3]> {
        let corners = faces.iter().flat_map(|face| CORNERS.map(|corner| value(face, corner)));
        corners.map(|v| v.as_vec3().to_array()).collect()
    };
    let positions = per_corner(&|face, [u, v]| face.centre + face.right * u + face.up * v);
    let first_corners = (0_u32..).step_by(4).take(faces.len());
    let triangles: Vec<[u32; 3]> =
        first_corners.flat_map(|i| [[i, i + 1, i + 2], [i, i + 2, i + 3]]).collect();
    let positions = Positions::F32(Vertices::from_arrays(&positions));
    let mut mesh = Mesh::new(name, positions, triangles.into());
    if wanted.uvs {
        let corner_uvs = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
        mesh.uvs = vec![Vertices::from_arrays(&corner_uvs.repeat(faces.len()))];
    }
    mesh
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;
    use etendue_geometry::Positions;
    use etendue_geometry::glam::DVec3;

    fn blob(triangles: u64, seed: u64) -> ShapeSpec {
        ShapeSpec::Blob { radius: Metres(0.5), triangles, seed, amplitude: 0.25 }
    }

    /// Edges by direction: on a closed surface of one orientation each is used once each way.
    fn assert_closed(mesh: &Mesh) {
        let mut uses: BTreeMap<(u32, u32), i32> = BTreeMap::new();
        for &[a, b, c] in mesh.triangles.iter() {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                assert_ne!(from, to);
                *uses.entry((from, to)).or_default() += 1;
            }
        }
        for (&(from, to), &count) in &uses {
            assert_eq!((count, uses.get(&(to, from))), (1, Some(&1)), "edge {from} to {to}");
        }
    }

    fn volume(mesh: &Mesh) -> f64 {
        let signed = |i: usize| {
            let [a, b, c] = mesh.corners(i);
            a.dot(b.cross(c)) / 6.0
        };
        (0..mesh.triangles.len()).map(signed).sum()
    }

    #[test]
    fn making_can_be_stopped() {
        // Of a blob's triangles there are 706 tasks, one a row, and 123 of its vertices; of a disk's vertices 124, one
        // after another, and 1000 of the rows. Those that other threads have begun are ended.
        let disk = ShapeSpec::Disk { radius: Metres(1.0), triangles: 1_000_000 };
        for (shape, before) in [(blob(1_000_000, 1), [5, 720]), (disk, [5, 140])] {
            for before in before {
                let asked = AtomicUsize::new(0);
                let stop = || asked.fetch_add(1, Ordering::Relaxed) < before;
                let made = shape.build_while(Wanted::EVERYTHING, &stop);
                assert!(matches!(made, Ok(None)), "{made:?}");
                let asked = asked.into_inner() - before;
                assert!((1..95).contains(&asked), "{asked}");
            }
        }
        assert!(matches!(blob(64, 1).build_while(Wanted::EVERYTHING, &|| true), Ok(Some(_))));
    }

    #[test]
    fn blobs_have_the_triangles_asked_for_and_are_closed() {
        for triangles in [128, 130, 199, 200, 1_000, 1_024, 9_998, 10_000, 100_000] {
            let mesh = blob(triangles, 7).build(Wanted::NOTHING).unwrap();
            let expected = usize::try_from(triangles.next_multiple_of(2)).unwrap();
            assert_eq!(mesh.triangles.len(), expected);
            assert_eq!(mesh.positions.len(), expected / 2 + 2, "Euler's formula");
            assert_closed(&mesh);
        }
        for (asked, has) in [(1, 8), (8, 8), (9, 32), (33, 72), (100, 128)] {
            let mesh = blob(asked, 7).build(Wanted::NOTHING).unwrap();
            assert_eq!(mesh.triangles.len(), has, "{asked}");
            assert_closed(&mesh);
        }
    }

    #[test]
    fn a_sphere_is_round_and_faces_outwards() {
        let sphere = ShapeSpec::Sphere { radius: Metres(2.0), triangles: 20_000 };
        let mesh = sphere.build(Wanted::EVERYTHING).unwrap();
        let normals = mesh.normals.as_ref().unwrap();
        for i in 0..mesh.positions.len() {
            let p = mesh.positions.get(i);
            assert!((p.length() - 2.0).abs() < 3e-7, "rounded to f32: {p}");
            let normal = DVec3::from(normals.get(i).map(f64::from));
            assert!((normal - p / 2.0).length() < 3e-7, "{normal} at {p}");
        }
        let exact = 4.0 / 3.0 * std::f64::consts::PI * 8.0;
        // A facet of edge h ≈ √(16π r²/√3/20000) = 0.076 lies up to h²/6r below the sphere.
        let missing = 1.0 - volume(&mesh) / exact;
        assert!((0.0..1.5e-3).contains(&missing), "{missing}");
        let small = (0..mesh.triangles.len()).map(|i| {
            let [a, b, c] = mesh.corners(i);
            (b - a).cross(c - a).length() / 2.0
        });
        let (low, high) = small.fold((f64::INFINITY, 0.0_f64), |(l, h), a| (l.min(a), h.max(a)));
        // A cut halves a triangle; rings differ in area by π/2 over 4/π.
        assert!(high / low < 5.0, "{low} to {high}");
    }

    #[test]
    fn normals_of_a_blob_are_those_of_its_surface() {
        let mesh = blob(200_000, 3).build(Wanted::EVERYTHING).unwrap();
        assert!(volume(&mesh) > 0.0);
        let normals = mesh.normals.as_ref().unwrap();
        let mut worst: f64 = 1.0;
        for (i, triangle) in mesh.triangles.iter().enumerate() {
            let [a, b, c] = mesh.corners(i);
            let flat = (b - a).cross(c - a).normalize();
            let mean: DVec3 =
                triangle.iter().map(|&v| DVec3::from(normals.get(v as usize).map(f64::from))).sum();
            worst = worst.min(flat.dot(mean.normalize()));
        }
        // Edges of 6 mm on waves of 7 cm and more, of small heights, bend by a few degrees.
        assert!(worst > 5.0_f64.to_radians().cos(), "{worst}");
    }

    #[test]
    fn texture_coordinates_run_around_once_and_down() {
        let sphere = ShapeSpec::Sphere { radius: Metres(1.0), triangles: 1_000 };
        let mesh = sphere.build(Wanted::EVERYTHING).unwrap();
        let plain = sphere.build(Wanted::NOTHING).unwrap();
        assert_eq!(mesh.triangles.len(), plain.triangles.len());
        let uvs = &mesh.uvs[0];
        for (triangle, bare) in mesh.triangles.iter().zip(plain.triangles.iter()) {
            let us = triangle.map(|v| uvs.get(v as usize)[0]);
            let (low, high) = us.iter().fold((1.0_f32, 0.0_f32), |(l, h), &u| (l.min(u), h.max(u)));
            let span = high - low;
            assert!(span <= 0.51, "no triangle runs back over the seam: {us:?}");
            let at = |mesh: &Mesh, t: &[u32; 3]| t.map(|v| mesh.positions.get(v as usize));
            assert_eq!(at(&mesh, triangle), at(&plain, bare), "the seam's doubles are in place");
        }
        assert_eq!(uvs.get(0), [0.5, 0.0], "the north pole");
    }

    #[test]
    fn flat_shapes_face_as_documented() {
        let mesh = ShapeSpec::Rectangle { width: Metres(4.0), height: Metres(2.0) }
            .build(Wanted::EVERYTHING)
            .unwrap();
        assert_eq!(mesh.bounds.min, DVec3::new(-2.0, -1.0, 0.0));
        assert_eq!(mesh.bounds.max, DVec3::new(2.0, 1.0, 0.0));
        for i in 0..2 {
            let [a, b, c] = mesh.corners(i);
            assert_eq!((b - a).cross(c - a), DVec3::Z * 8.0);
        }
        let upper_left = (0..4).find(|&i| mesh.positions.get(i) == DVec3::new(-2.0, 1.0, 0.0));
        assert_eq!(mesh.uvs[0].get(upper_left.unwrap()), [0.0, 0.0]);

        let size = [Metres(1.0), Metres(2.0), Metres(3.0)];
        let mesh = ShapeSpec::Box { size }.build(Wanted::EVERYTHING).unwrap();
        assert_eq!((mesh.triangles.len(), volume(&mesh)), (12, 6.0));
        for i in 0..mesh.triangles.len() {
            let [a, b, c] = mesh.corners(i);
            let normal = (b - a).cross(c - a).normalize();
            // The face whose plane it is in: an axis, outwards.
            let half = DVec3::new(0.5, 1.0, 1.5);
            assert_eq!(normal.abs().max_element(), 1.0);
            assert_eq!(normal.dot(a), (normal * half).abs().max_element());
        }
        assert!(mesh.normals.is_none(), "light would be scattered about what the triangles tell");

        let disk = ShapeSpec::Disk { radius: Metres(2.0), triangles: 4_096 };
        let mesh = disk.build(Wanted::EVERYTHING).unwrap();
        assert_eq!(mesh.triangles.len(), 4_096);
        let area: f64 = (0..mesh.triangles.len())
            .map(|i| mesh.corners(i))
            .map(|[a, b, c]| (b - a).cross(c - a).z / 2.0)
            .sum();
        // A polygon of 128 corners: (n/2) r² sin(2π/n), and coordinates rounded to f32.
        let polygon = 256.0 * (std::f64::consts::TAU / 128.0).sin();
        assert!((area - polygon).abs() < 1e-6, "{area} {polygon}");
    }

    #[test]
    fn seeds_differ_and_threads_do_not() {
        let bits = |spec: &ShapeSpec| {
            let mesh = spec.build(Wanted::EVERYTHING).unwrap();
            let Positions::F32(v) = &mesh.positions else { panic!("shapes are f32") };
            let normals = mesh.normals.unwrap();
            v.floats()
                .iter()
                .chain(normals.floats().iter())
                .map(|x| x.to_bits())
                .collect::<Vec<_>>()
        };
        let one = bits(&blob(50_000, 1));
        assert_ne!(one, bits(&blob(50_000, 2)));
        for threads in [1, 3, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert!(pool.install(|| bits(&blob(50_000, 1))) == one, "{threads} threads");
        }
    }

    #[test]
    fn files_name_shapes_and_impossible_ones_are_refused() {
        let read = |json: &str| serde_json::from_str::<ShapeSpec>(json);
        let spec = read(r#"{"shape": "blob", "triangles": 1000, "seed": 7, "radius": "50 cm"}"#);
        let expected =
            ShapeSpec::Blob { radius: Metres(0.5), triangles: 1000, seed: 7, amplitude: 0.25 };
        assert_eq!(spec.unwrap(), expected);
        assert!(read(r#"{"shape": "box", "sizes": [1, 2, 3]}"#).is_err());
        for (json, key) in [
            (r#"{"shape": "sphere", "radius": 0}"#, "radius"),
            (r#"{"shape": "sphere", "radius": -1}"#, "radius"),
            (r#"{"shape": "disk", "triangles": 0}"#, "triangles"),
            (r#"{"shape": "blob", "triangles": 99999999999}"#, "triangles"),
            (r#"{"shape": "blob", "amplitude": 1}"#, "amplitude"),
            (r#"{"shape": "box", "size": [1, 0, 1]}"#, "size"),
            (r#"{"shape": "rectangle", "width": 1e30}"#, "width"),
        ] {
            assert_eq!(read(json).unwrap().build(Wanted::NOTHING).unwrap_err().key, key, "{json}");
        }
    }
}
