//! Meshes in as much detail as a tolerance asks for: of corners that lie together within a cell of a grid, one is left,
//! the mean of them, and of triangles those whose corners are in three cells (J. Rossignac & P. Borrel,
//! "Multi-resolution 3D approximations for rendering complex scenes", 1993).
//!
//! Where a mesh ends, the mean is that of the corners on its border alone, which it would draw inwards else.
//!
//! The mean of points in a cube of side h is in the cube, so no corner moves by more than its diagonal, √3 h, and no
//! point of a triangle by more than its corners do. A cell is so small that this, at the nearest distance at which the
//! camera sees anything, is the share [`SHARE`] of the displacement allowed: of shadows, too, which fall where something
//! is seen. What is coarser than that, folds and fur, tells itself by its area: a mesh whose triangles lose or gain more
//! of theirs than half of the light allowed stays as it is.
//!
//! What is placed farther off, as most trees of a forest are, is coarser by as much, in steps of two, where its shadow is
//! as far: see [`octaves`].
//!
//! It is not done where something could show the mesh larger than the camera sees it, or where its corners carry more
//! than their places: see [`coarser`].

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{
    Bounds, Geometry, Mesh, Placement, Positions, RayBatch, Transform, Vertices,
};
use etendue_scene::Scene;
use etendue_tracer::material::Alpha;
use etendue_tracer::{
    EnvironmentImage, LayerSpec, Light, LightKind, Material, Scattering, TextureScope,
};

/// Meshes of fewer triangles are built and traced as soon as they are looked at.
const WORTH: usize = 20_000;

/// The share of the displacement allowed that detail may take before a lens, which a model may displace by the rest.
const SHARE: f64 = 0.25;

/// What f32 may take of that.
const SHARE_OF_ROUNDING: f64 = 1.0 / 8.0;

/// The share of the light allowed by which the area of a mesh may change.
const SHARE_OF_LIGHT: f64 = 0.5;

/// Roughness of a glTF surface from which on no other surface is seen in it.
const ROUGH: f64 = 0.3;

/// The most factors of two by which what is far is coarser: each is one more look at the mesh, and saves a quarter of what the
/// one before did.
const MOST_OCTAVES: u32 = 6;

/// Columns and rows of places where the extent of a pixel is taken, the corners among them.
const PLACES: u32 = 5;

/// What detail was left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TakenDetail {
    /// Triangles of the scene, each stored one once, and those that are left.
    pub triangles: [u64; 2],
    /// Meshes that are coarser.
    pub meshes: usize,
    /// How far a place of the picture is displaced at most (pixels).
    pub displacement: f64,
    /// By which share the area of a mesh differs, at most.
    pub light: f64,
}

/// The meshes of `scene` in as much detail as its tolerance asks for, and what was left out; `None` of a scene without
/// a tolerance, and where nothing can be left out.
///
/// That is so where layers of data, or the picture's alpha, are to be exact; where a surface mirrors or bends light, or a
/// light stands near, which could enlarge what it shows or its shadow; with several slots or a moving camera. A mesh stays
/// as it is where it moves, changes its shape, shines, or has colours, a pattern or holes on it.
#[must_use]
pub fn coarser(scene: &Scene) -> Option<(Geometry, TakenDetail)> {
    let tolerance = scene.tolerance?;
    if scene.geometry.meshes.iter().all(|mesh| mesh.triangles.len() < WORTH) || !is_plain(scene) {
        return None;
    }
    let displacement = (1.0 - SHARE_OF_ROUNDING) * share(scene) * tolerance.displacement.0;
    // How far (m) corners may move.
    let nearest = nearest(scene)?;
    let reach = displacement * pixel_extent(scene, nearest)?;
    let light = SHARE_OF_LIGHT * tolerance.light.0;
    let before = scene.geometry.triangles_unique();
    let mut taken = TakenDetail { triangles: [before; 2], meshes: 0, displacement, light: 0.0 };
    let octaves = octaves(scene, nearest);
    let mut geometry = Geometry::clone(&scene.geometry);
    for (number, mesh) in scene.geometry.meshes.iter().enumerate() {
        let Some(stretch) = stretch_of(scene, number) else { continue };
        let placed = scene.geometry.placements.iter().zip(&octaves).enumerate();
        let placed = placed.filter(|(_, (placement, _))| placement.mesh as usize == number);
        let placed: Vec<(usize, u32)> = placed.map(|(i, (_, octave))| (i, *octave)).collect();
        let wanted: BTreeSet<u32> = placed.iter().map(|(_, octave)| *octave).collect();
        let own = area(mesh);
        let before = geometry.meshes.len();
        for octave in wanted {
            let side = reach * f64::from(octave).exp2() / (3f64.sqrt() * stretch);
            let Some(less) = clustered(mesh, side) else { continue };
            let change = (area(&less) - own).abs() / own;
            // What is not a number is no small change.
            if change <= light {
                taken.light = taken.light.max(change);
                #[expect(clippy::cast_possible_truncation, reason = "there are few")]
                let last = geometry.meshes.len() as u32;
                geometry.meshes.push(less);
                let farther = placed.iter().filter(|(_, own)| *own >= octave);
                farther.for_each(|&(i, _)| geometry.placements[i].mesh = last);
            }
        }
        if geometry.meshes.len() > before {
            taken.meshes += 1;
            give_place_of(number, &mut geometry);
        }
    }
    taken.triangles[1] = geometry.triangles_unique();
    (taken.meshes > 0).then_some((geometry, taken))
}

/// Puts the last mesh in the place of mesh `number`, where nothing places that any more.
#[expect(clippy::cast_possible_truncation, reason = "placements count meshes in 32 bits")]
fn give_place_of(number: usize, geometry: &mut Geometry) {
    if geometry.placements.iter().any(|placement| placement.mesh as usize == number) {
        return;
    }
    let last = geometry.meshes.len() - 1;
    geometry.meshes.swap_remove(number);
    for placement in &mut geometry.placements {
        if placement.mesh as usize == last {
            placement.mesh = number as u32;
        }
    }
}

/// By how many factors of two farther than `nearest` (m) the camera sees each placement and all shadows of it: those of
/// light that comes from one side go on without an end. 0 where light comes from an image of all directions, which may
/// have a sun in it, or moves.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
fn octaves(scene: &Scene, nearest: f64) -> Vec<u32> {
    let placements = &scene.geometry.placements;
    let is_known = |light: &Light| {
        let image = EnvironmentImage::of(light);
        light.motion.is_none() && matches!(image, None | Some(EnvironmentImage::Constant))
    };
    if !scene.lights.iter().all(is_known) {
        return vec![0; placements.len()];
    }
    let eye = scene.camera.pose().position;
    let octave = |placement: &Placement| {
        let bounds = scene.geometry.loose_bounds_of(placement);
        let own = (eye.clamp(bounds.min, bounds.max) - eye).length();
        let shadow = |light: &Light| match light.kind {
            LightKind::Directional { along, cos_radius } => {
                Some(shadow_distance(eye, &bounds, along, cos_radius))
            }
            _ => None,
        };
        let distance = scene.lights.iter().filter_map(shadow).fold(own, f64::min);
        // What is no number, of shadows about the camera, is 0.
        (distance / nearest).log2().clamp(0.0, f64::from(MOST_OCTAVES)) as u32
    };
    placements.iter().map(octave).collect()
}

/// The distance (m) from a place to the shadow of a box, of light that goes `along` (unit) from a disk with this cosine of
/// its radius, or to the ball about that box; below 0 within it.
fn shadow_distance(from: DVec3, bounds: &Bounds, along: DVec3, cos_radius: f64) -> f64 {
    let (centre, radius) = (bounds.centre(), 0.5 * (bounds.max - bounds.min).length());
    // The shadow's ball grows by this much a metre.
    let growth = (1.0 - cos_radius * cos_radius).max(0.0).sqrt() / cos_radius;
    if !(0.0..1.0).contains(&growth) {
        return 0.0;
    }
    let there = from - centre;
    let middle = there.dot(along);
    let aside = (there - middle * along).length();
    // Where √(aside² + (s - middle)²) - growth · s is least.
    let s = (middle + aside * growth / (1.0 - growth * growth).sqrt()).max(0.0);
    (there - s * along).length() - radius - growth * s
}

/// How far off surfaces (m) rays may start under the tolerance of `scene`; `None` of a scene without one, and where
/// something tells more of a surface than the camera sees.
pub(crate) fn hidden_offset(scene: &Scene) -> Option<f64> {
    let pixels = scene.tolerance.filter(|_| is_plain(scene))?.displacement.0;
    Some(SHARE_OF_ROUNDING * share(scene) * pixels * pixel_extent(scene, nearest(scene)?)?)
}

/// The share of the displacement allowed that is for what surfaces have of detail, and for rounding.
fn share(scene: &Scene) -> f64 {
    if scene.camera.lens().is_some() { SHARE } else { 1.0 }
}

/// Whether nothing of the scene tells more of a mesh than the camera sees, but for the mesh itself.
fn is_plain(scene: &Scene) -> bool {
    let is_light = |layer: &LayerSpec| layer.is_light() || layer.is_of_sampling();
    let is_far = |kind: &LightKind| match kind {
        LightKind::Directional { .. } | LightKind::Environment { .. } => true,
        LightKind::Point(_)
        | LightKind::Spot { .. }
        | LightKind::Projector(_)
        | LightKind::Goniometric(_) => false,
    };
    let is_picture = scene.layers.contains(&LayerSpec::Radiance)
        && scene.layers.iter().all(is_light)
        && !scene.render.alpha;
    let is_still =
        scene.slots == 0 && scene.camera.motion().is_none() && scene.camera.light_field().is_none();
    let mut placed = vec![false; scene.materials.len()];
    for placement in &scene.geometry.placements {
        placed.get_mut(placement.material as usize).into_iter().for_each(|placed| *placed = true);
    }
    let mut materials = scene.materials.iter().zip(placed).filter(|(_, placed)| *placed);
    is_picture
        && is_still
        && scene.lights.iter().all(|light| is_far(&light.kind))
        && materials
            .all(|(material, _)| shows_nothing_else(material) && material.emission.is_none())
}

/// Whether no other surface is seen in a material, mirrored or through it.
fn shows_nothing_else(material: &Material) -> bool {
    match &material.scattering {
        Scattering::Black | Scattering::Matte | Scattering::Unlit => true,
        Scattering::Mirror | Scattering::Dielectric(_) => false,
        Scattering::Metal { roughness, .. } => *roughness >= ROUGH,
        Scattering::Gltf(surface) => {
            let has_images = !material.textures(TextureScope::ALL).is_empty();
            !has_images
                && surface.transmission == 0.0
                && surface.clearcoat == 0.0
                && surface.roughness >= ROUGH
        }
    }
}

/// The distance (m) from the camera to the nearest box around a thing; `None` where it stands within one, or there is
/// nothing.
fn nearest(scene: &Scene) -> Option<f64> {
    let eye = scene.camera.pose().position;
    let distance = |bounds: Bounds| (eye.clamp(bounds.min, bounds.max) - eye).length();
    let boxes = scene.geometry.placements.iter().map(|p| scene.geometry.loose_bounds_of(p));
    let boxes = boxes.filter(|bounds| !bounds.is_empty());
    boxes.map(distance).reduce(f64::min).filter(|distance| *distance > 0.0)
}

/// What the narrowest pixel covers at `distance` (m) from the camera.
fn pixel_extent(scene: &Scene, distance: f64) -> Option<f64> {
    let [width, height] = scene.camera.resolution().map(f64::from);
    let at = |i: u32, side: f64| f64::from(i) / f64::from(PLACES - 1) * (side - 1.0).max(0.0);
    let places = (0..PLACES * PLACES).map(|i| [at(i % PLACES, width), at(i / PLACES, height)]);
    // Each with its neighbours on the right and below.
    let around = places.flat_map(|[x, y]| [[x, y], [x + 1.0, y], [x, y + 1.0]]);
    let (columns, rows): (Vec<f64>, Vec<f64>) = around.map(|[x, y]| (x, y)).unzip();
    let mut rays = RayBatch::default();
    scene.camera.rays_through(&columns, &rows, &mut rays);
    let point = |i: usize| rays.origin(i) + distance * rays.direction(i);
    let is_seen = |i: usize| rays.t_max()[i] >= 0.0;
    let extents = (0..rays.len()).step_by(3).filter(|&i| (i..i + 3).all(is_seen));
    let extents =
        extents.map(|i| point(i).distance(point(i + 1)).min(point(i).distance(point(i + 2))));
    extents.reduce(f64::min).filter(|extent| *extent > 0.0 && extent.is_finite())
}

/// How much longer any line of a mesh is where it is placed, at most; `None` of a mesh that stays as it is.
fn stretch_of(scene: &Scene, number: usize) -> Option<f64> {
    let geometry = &scene.geometry;
    let mesh = &geometry.meshes[number];
    if mesh.triangles.len() < WORTH || mesh.steps.is_some() || mesh.colors.is_some() {
        return None;
    }
    let mut placed =
        geometry.placements.iter().filter(|placement| placement.mesh as usize == number);
    placed.try_fold(0.0, |most: f64, placement| {
        let material = scene.materials.get(placement.material as usize)?;
        let is_simple = placement.motion.is_none()
            && !material.is_patterned()
            && material.alpha == Alpha::Opaque;
        let stretch = stretch(&placement.world_from_mesh);
        is_simple.then_some(most.max(stretch))
    })
}

/// The greatest stretch of a transform, or a little more: its square is the greatest eigenvalue of `AᵀA`, which is no
/// more than the greatest sum of absolute values of a row (S. Gerschgorin, 1931), and just that of what is turned and
/// scaled alike.
fn stretch(transform: &Transform) -> f64 {
    let square: DMat3 = transform.linear.transpose() * transform.linear;
    let columns = [square.x_axis, square.y_axis, square.z_axis];
    columns.map(|column| column.abs().element_sum()).into_iter().fold(0.0, f64::max).sqrt()
}

/// `mesh` with one corner a cell of this side (m, of its own frame); `None` where that would leave a quarter of its
/// triangles or more.
fn clustered(mesh: &Mesh, side: f64) -> Option<Mesh> {
    let extent = mesh.bounds.max - mesh.bounds.min;
    let faces = extent.x * extent.y + extent.y * extent.z + extent.z * extent.x;
    // A surface through a cell leaves some two triangles there; a box has each of its faces twice.
    let expected = 4.0 * faces / (side * side);
    let is_coarse = side.is_finite() && expected < 0.25 * mesh.triangles.len() as f64;
    if !is_coarse || mesh.bounds.is_empty() {
        return None;
    }
    let cells = Cells::over(&mesh.bounds, side);
    let mut clusters = Clusters::new(&cells, mesh.positions.len());
    let of_corner: Vec<u32> = (0..mesh.positions.len())
        .map(|i| {
            let normal =
                mesh.normals.as_ref().map(|normals| DVec3::from(normals.get(i).map(f64::from)));
            clusters.add(cells.of(mesh.positions.get(i)), mesh.positions.get(i), normal)
        })
        .collect();
    // Those that keep three cells apart, each once, from its least cell on.
    let mut triangles: Vec<[[u32; 3]; 2]> = mesh
        .triangles
        .iter()
        .filter_map(|triangle| {
            let corners = triangle.map(|corner| of_corner[corner as usize]);
            let cells @ [a, b, c] = corners.map(|corner| clusters.cell_of(corner));
            let first = match a.min(b).min(c) {
                least if least == a => 0,
                least if least == b => 1,
                _ => 2,
            };
            let turned = |of: [u32; 3]| [0, 1, 2].map(|k| of[(first + k) % 3]);
            (a != b && b != c && c != a).then(|| [turned(cells), turned(corners)])
        })
        .collect();
    triangles.sort_unstable();
    triangles.dedup_by_key(|[cells, _]| *cells);
    if triangles.len() >= mesh.triangles.len() / 4 {
        return None;
    }
    clusters.keep_borders(mesh, &of_corner, &triangles);
    let triangles: Vec<[u32; 3]> = triangles.into_iter().map(|[_, corners]| corners).collect();
    let positions = clusters.positions(&mesh.positions);
    let mut less = Mesh::new(mesh.name.clone(), positions, triangles.into());
    less.normals = mesh.normals.as_ref().map(|_| clusters.normals());
    Some(less)
}

/// A grid of cubes over a box.
struct Cells {
    origin: DVec3,
    side: f64,
    /// Columns, rows and layers.
    counts: [u64; 3],
}

impl Cells {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 2²⁰")]
    fn over(bounds: &Bounds, side: f64) -> Self {
        let extent = (bounds.max - bounds.min) / side;
        let counts = extent.to_array().map(|cells| (cells.floor() as u64 + 1).min(1 << 20));
        Self { origin: bounds.min, side, counts }
    }

    /// All of them, and one for what is no point.
    fn len(&self) -> u64 {
        self.counts.iter().product::<u64>() + 1
    }

    /// The number of a point's cell. Those outside of the box, which no triangle with an area has, are in its outermost
    /// cells.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "it saturates")]
    fn of(&self, point: DVec3) -> u64 {
        if !point.is_finite() {
            return self.len() - 1;
        }
        let cell = ((point - self.origin) / self.side).to_array();
        let [x, y, z] = [0, 1, 2].map(|k| (cell[k].max(0.0) as u64).min(self.counts[k] - 1));
        (z * self.counts[1] + y) * self.counts[0] + x
    }
}

/// By cell, the number of what is in it.
enum NumberOfCell {
    /// Of all cells, where they are not many more than what is put into them.
    Dense(Vec<u32>),
    Sparse(HashMap<u64, u32>),
}

/// None yet.
const NONE: u32 = u32::MAX;

/// Corners that were put together.
struct Clusters {
    number: NumberOfCell,
    /// Of each cell the corner for each way that normals point ([`facing`]); without normals the first alone.
    corners: Vec<[u32; 6]>,
    /// Sums of the places in each cell, and how many.
    places: Vec<(DVec3, f64)>,
    /// The cell of each corner, and the sum of its normals.
    of_corner: Vec<(u32, DVec3)>,
}

impl Clusters {
    /// For so many corners in the cells of a grid.
    fn new(cells: &Cells, corners: usize) -> Self {
        let number = match usize::try_from(cells.len()) {
            Ok(count) if count <= 4 * corners => NumberOfCell::Dense(vec![NONE; count]),
            _ => NumberOfCell::Sparse(HashMap::new()),
        };
        Self { number, corners: Vec::new(), places: Vec::new(), of_corner: Vec::new() }
    }

    /// Adds a corner: where it went. Normals of both sides of a sheet are kept apart.
    #[expect(clippy::cast_possible_truncation, reason = "a mesh has fewer than 2³² corners")]
    fn add(&mut self, cell: u64, place: DVec3, normal: Option<DVec3>) -> u32 {
        let known = match &mut self.number {
            NumberOfCell::Dense(numbers) => &mut numbers[cell as usize],
            NumberOfCell::Sparse(numbers) => numbers.entry(cell).or_insert(NONE),
        };
        if *known == NONE {
            *known = self.places.len() as u32;
            self.places.push((DVec3::ZERO, 0.0));
            self.corners.push([NONE; 6]);
        }
        let number = *known;
        let (sum, count) = &mut self.places[number as usize];
        *sum += place;
        *count += 1.0;
        let corner = &mut self.corners[number as usize][normal.map_or(0, facing)];
        if *corner == NONE {
            *corner = self.of_corner.len() as u32;
            self.of_corner.push((number, DVec3::ZERO));
        }
        self.of_corner[*corner as usize].1 += normal.unwrap_or_default();
        *corner
    }

    fn cell_of(&self, corner: u32) -> u32 {
        self.of_corner[corner as usize].0
    }

    /// Where the coarser triangles, of these cells and corners, end, the place of a cell is the mean of those of its
    /// corners on the border of the mesh.
    fn keep_borders(&mut self, mesh: &Mesh, of_corner: &[u32], triangles: &[[[u32; 3]; 2]]) {
        let mut is_border = vec![false; self.places.len()];
        let coarse = edges_of_one(triangles.iter().flat_map(|[cells, _]| edges(*cells)));
        if coarse.is_empty() {
            return;
        }
        coarse.iter().flatten().for_each(|&cell| is_border[cell as usize] = true);
        let cell = |corner: u32| self.cell_of(of_corner[corner as usize]) as usize;
        // Both triangles at an edge that ends in such a cell are among those that do.
        let near = mesh
            .triangles
            .iter()
            .filter(|triangle| triangle.iter().any(|&corner| is_border[cell(corner)]));
        let mut places = vec![(DVec3::ZERO, 0.0); self.places.len()];
        for &corner in edges_of_one(near.flat_map(|triangle| edges(*triangle))).iter().flatten() {
            let (sum, count) = &mut places[cell(corner)];
            *sum += mesh.positions.get(corner as usize);
            *count += 1.0;
        }
        let on_border = places.into_iter().zip(is_border).enumerate();
        for (cell, (place, _)) in on_border.filter(|(_, (place, is))| *is && place.1 > 0.0) {
            self.places[cell] = place;
        }
    }

    /// In the precision of those that were put together.
    fn positions(&self, before: &Positions) -> Positions {
        let places = self.of_corner.iter().map(|(cell, _)| {
            let (sum, count) = self.places[*cell as usize];
            sum / count
        });
        match before {
            Positions::F32(_) => {
                let places = places.map(|place| place.as_vec3().to_array());
                Positions::F32(Vertices::from_arrays(&places.collect::<Vec<_>>()))
            }
            Positions::F64(_) => {
                Positions::F64(places.map(|place| place.to_array()).collect::<Vec<_>>().into())
            }
        }
    }

    fn normals(&self) -> Vertices<3> {
        let normals =
            self.of_corner.iter().map(|(_, sum)| sum.normalize_or_zero().as_vec3().to_array());
        Vertices::from_arrays(&normals.collect::<Vec<_>>())
    }
}

/// The edges of a triangle, each from its lower corner.
fn edges([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]].map(|[a, b]| [a.min(b), a.max(b)])
}

/// Those that occur once.
fn edges_of_one(edges: impl Iterator<Item = [u32; 2]>) -> Vec<[u32; 2]> {
    let mut edges: Vec<[u32; 2]> = edges.collect();
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).filter(|same| same.len() == 1).map(|same| same[0]).collect()
}

/// Along which axis a normal points most, and to which side of it: a number below 6.
fn facing(normal: DVec3) -> usize {
    let size = normal.abs();
    let axis = match size.max_element() {
        most if most == size.x => 0,
        most if most == size.y => 1,
        _ => 2,
    };
    2 * axis + usize::from(normal[axis] < 0.0)
}

/// The area of all triangles of a mesh (m², of its own frame).
fn area(mesh: &Mesh) -> f64 {
    let of_one = |i: usize| {
        let [a, b, c] = mesh.corners(i);
        0.5 * (b - a).cross(c - a).length()
    };
    (0..mesh.triangles.len()).map(of_one).sum()
}

/// `scene` with these meshes in the place of its own.
#[must_use]
pub fn with_meshes(scene: &Scene, geometry: Geometry) -> Scene {
    let mut scene = scene.clone();
    scene.geometry = Arc::new(geometry);
    scene
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A waved square of 200 × 200 in 40 × 40 cells keeps its border and its area, and a place of each cell is in the
    /// cell. Means of all corners there would draw the border in by half a cell: 5 % of the area.
    #[test]
    fn an_open_mesh_keeps_its_border() {
        let side = 200_u32;
        let corner = |i: u32| {
            let [x, y] = [i % (side + 1), i / (side + 1)].map(|k| k as f32 / side as f32);
            [x, y, 0.01 * (6.0 * x).sin()]
        };
        let corners: Vec<[f32; 3]> = (0..(side + 1).pow(2)).map(corner).collect();
        let square = |k: u32| {
            let i = k / side * (side + 1) + k % side;
            [[i, i + 1, i + side + 2], [i, i + side + 2, i + side + 1]]
        };
        let triangles: Vec<[u32; 3]> = (0..side * side).flat_map(square).collect();
        let positions = Positions::F32(Vertices::from_arrays(&corners));
        let mesh = Mesh::new("sheet", positions, triangles.into());
        let cell = 0.025 - 1e-6;
        let less = clustered(&mesh, cell).unwrap();
        assert!(less.triangles.len() < 5000, "{}", less.triangles.len());
        let change = area(&less) / area(&mesh) - 1.0;
        // The four outermost corners lose a quarter of a cell each.
        assert!(change.abs() < 2e-3, "{change}");
        let [own, others] = [&mesh, &less].map(|mesh| mesh.bounds);
        assert!((own.max - others.max).abs().max_element() < 0.01 * cell, "{others:?}");
        assert!((own.min - others.min).abs().max_element() < 0.01 * cell, "{others:?}");
    }
}
