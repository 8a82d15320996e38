//! Meshes in as much detail as a tolerance asks for, of one corner a cell of a grid ([`clustered`]).
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

use std::collections::BTreeSet;
use std::sync::Arc;

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Bounds, Geometry, Placement, RayBatch, Transform};
use etendue_scene::Scene;
use etendue_tracer::material::Alpha;
use etendue_tracer::{
    EnvironmentImage, LayerSpec, Light, LightKind, Material, Scattering, TextureScope,
};

use super::clusters::{area, clustered};

/// Meshes of fewer triangles are built and traced as soon as they are looked at.
const WORTH: usize = 20_000;

/// The share of the displacement allowed that detail may take before a lens, which a model may displace by the rest.
const SHARE: f64 = 0.25;

/// Share of that which f32 may take.
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

/// Detail that was left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TakenDetail {
    /// Triangles of the scene, as often as they are placed, and those that are left: of a mesh whose copies stand near and
    /// far several versions are stored.
    pub triangles: [u64; 2],
    /// Meshes that are coarser.
    pub meshes: usize,
    /// Greatest displacement of a place of the picture (pixels).
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
    let all = scene.geometry.triangles();
    let mut taken = TakenDetail { triangles: [all; 2], meshes: 0, displacement, light: 0.0 };
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
    taken.triangles[1] = geometry.triangles();
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
            LightKind::Directional { along, cos_radius, .. } => {
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

/// Distance off surfaces (m) at which rays may start under the tolerance of `scene`; `None` of a
/// scene without one, and where something tells more of a surface than the camera sees.
pub(crate) fn hidden_offset(scene: &Scene) -> Option<f64> {
    let pixels = scene.tolerance.filter(|_| is_plain(scene))?.displacement.0;
    Some(SHARE_OF_ROUNDING * share(scene) * pixels * pixel_extent(scene, nearest(scene)?)?)
}

/// The share of the displacement allowed that is for what surfaces have of detail, and for rounding.
fn share(scene: &Scene) -> f64 {
    if scene.camera.lens().is_some() { SHARE } else { 1.0 }
}

/// True if nothing of the scene tells more of a mesh than the camera sees, but for the mesh itself.
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

/// True if no other surface is seen in a material, mirrored or through it.
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

/// Extent of the narrowest pixel at `distance` (m) from the camera.
fn pixel_extent(scene: &Scene, distance: f64) -> Option<f64> {
    let [width, height] = scene.camera.resolution().map(f64::from);
    let at = |i: u32, side: f64| f64::from(i) / f64::from(PLACES - 1) * (side - 1.0).max(0.0);
    let places = (0..PLACES * PLACES).map(|i| [at(i % PLACES, width), at(i / PLACES, height)]);
    // Each with its neighbours on the right and below.
    let corners = places.flat_map(|[x, y]| [[x, y], [x + 1.0, y], [x, y + 1.0]]);
    let (columns, rows): (Vec<f64>, Vec<f64>) = corners.map(|[x, y]| (x, y)).unzip();
    let mut rays = RayBatch::default();
    scene.camera.rays_through(&columns, &rows, &mut rays);
    let point = |i: usize| rays.origin(i) + distance * rays.direction(i);
    let is_seen = |i: usize| rays.t_max()[i] >= 0.0;
    let extents = (0..rays.len()).step_by(3).filter(|&i| (i..i + 3).all(is_seen));
    let extents =
        extents.map(|i| point(i).distance(point(i + 1)).min(point(i).distance(point(i + 2))));
    extents.reduce(f64::min).filter(|extent| *extent > 0.0 && extent.is_finite())
}

/// Greatest factor by which a line of a mesh is longer where it is placed; `None` of a mesh that stays as it is.
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

/// `scene` with these meshes in the place of its own.
#[must_use]
pub fn with_meshes(scene: &Scene, geometry: Geometry) -> Scene {
    let mut scene = scene.clone();
    scene.geometry = Arc::new(geometry);
    scene
}
