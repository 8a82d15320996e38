//! Images in as few texels as the nearest view can tell apart.
//!
//! What the camera sees of an image, directly or in mirrors, is averaged over what a sample covers, which is at least as
//! wide as at the nearest place of what has the image on it: cones grow with their way (`tracer::footprint`), and no way
//! is shorter than the straight one. So the levels of its pyramid whose texels are narrower are never asked for, and it
//! is decoded without them ([`Coarseness`]). What is left is that of the whole image but for the rounding of its levels
//! to 16 bits.
//!
//! Light that was scattered by chance looks at points: there it finds the mean of as much as the camera tells apart. Who
//! receives it is as far from the eye, and tells no more apart by itself, or so far from the image that it sees many
//! texels at once.
//!
//! Images are whole where they may be looked at by the point: that of holes, of what shines and of what lights throw,
//! of the nearest texel alone; beside layers of data; and on what moves.

use etendue_camera::{Camera, PixelExtent};
use etendue_geometry::glam::{DMat2, DVec2, DVec3};
use etendue_geometry::{Bounds, Placement, RayBatch};
use etendue_image::Coarseness;
use etendue_scene::Scene;
use etendue_tracer::material::Alpha;
use etendue_tracer::texture::{Encoding, Filter, TextureUse};
use etendue_tracer::{LayerSpec, Light, TextureScope};
use rayon::prelude::*;

use crate::Plan;

/// Images that take less decoded (bytes) are decoded sooner than looked at: a thousand texels a side.
const WORTH: u64 = 3 << 20;

/// Triangles that are looked at, at most.
const MOST_TRIANGLES: usize = 2_000_000;

/// Share of a cosine to the camera's axis that is counted on: rays through a pupil lie beside the chief ray.
const SAFE_COSINE: f64 = 0.9;

/// Columns and rows of places at which rays' angles are taken, the corners among them.
const PLACES: u32 = 5;

/// Permitted coarseness of each image of `scene`; `None` of those that are to be whole, as all are
/// of a scene without a tolerance.
#[must_use]
pub fn coarse_images(scene: &Scene, plan: &Plan) -> Vec<Option<Coarseness>> {
    let mut coarse = vec![None; scene.textures.len()];
    if scene.tolerance.is_none() || !plan.footprint || !shows_light_alone(scene) {
        return coarse;
    }
    let Some(widths) = Widths::of(scene, plan.samples) else { return coarse };
    for (number, coarse) in coarse.iter_mut().enumerate() {
        let texture = &scene.textures[number];
        if texture.filter == Filter::Nearest || texture.decoded_bytes() < WORTH {
            continue;
        }
        let Some(uses) = uses(scene, number) else { continue };
        let width = nearest(scene, &uses).map_or(0.0, |distance| widths.at(distance));
        let least = uses
            .iter()
            .map(|used| density(scene, used))
            .try_fold(f64::INFINITY, |a, b| Some(a.min(b?)));
        let is_srgb = uses.iter().any(|used| used.image.encoding == Encoding::Srgb);
        let footprint = least.map_or(0.0, |least| least * width);
        *coarse =
            (footprint > 0.0 && footprint.is_finite()).then_some(Coarseness { footprint, is_srgb });
    }
    coarse
}

/// True if nothing but light is rendered, of one still camera.
fn shows_light_alone(scene: &Scene) -> bool {
    let is_light = |layer: &LayerSpec| layer.is_light() || layer.is_of_sampling();
    scene.layers.contains(&LayerSpec::Radiance)
        && scene.layers.iter().all(is_light)
        && !scene.render.alpha
        && scene.slots == 0
        && scene.camera.motion().is_none()
        && scene.camera.light_field().is_none()
}

/// An image on what a material is on.
struct PlacedImage {
    image: TextureUse,
    material: u32,
}

/// All uses of an image in what is placed; `None` where one of them may look at it by the point, or each in another
/// encoding.
fn uses(scene: &Scene, number: usize) -> Option<Vec<PlacedImage>> {
    let is_thrown = |light: &Light| light.texture().is_some_and(|it| it.texture as usize == number);
    if scene.lights.iter().any(is_thrown) {
        return None;
    }
    let mut uses: Vec<PlacedImage> = Vec::new();
    for (material, index) in scene.materials.iter().zip(0..) {
        let mut copy = material.clone();
        let own = copy.textures_mut(TextureScope::ALL).into_iter();
        let own: Vec<TextureUse> =
            own.filter(|used| used.texture as usize == number).map(|used| used.clone()).collect();
        if own.is_empty() || !scene.geometry.placements.iter().any(|p| p.material == index) {
            continue;
        }
        if material.alpha != Alpha::Opaque || material.emission.is_some() {
            return None;
        }
        uses.extend(own.into_iter().map(|image| PlacedImage { image, material: index }));
    }
    let first = uses.first()?.image.encoding;
    uses.iter().all(|used| used.image.encoding == first).then_some(uses)
}

/// The least that a sample of the picture covers of what it sees.
enum Widths {
    /// A width (m) wherever it is.
    Everywhere(f64),
    /// A width by the distance from the camera.
    ByDistance(f64),
}

impl Widths {
    fn of(scene: &Scene, samples: u32) -> Option<Self> {
        let share = 1.0 / f64::from(samples).sqrt();
        Some(match scene.camera.pixel_extent()? {
            PixelExtent::Width(width) => Self::Everywhere(share * width),
            PixelExtent::Angle(angle) => {
                let cosine = SAFE_COSINE * least_cosine(&scene.camera)?;
                // As a cone widens (`tracer::footprint`).
                Self::ByDistance(share * angle * cosine * cosine.sqrt())
            }
        })
    }

    fn at(&self, distance: f64) -> f64 {
        match self {
            Self::Everywhere(width) => *width,
            Self::ByDistance(width) => width * distance,
        }
    }
}

/// The cosine of the chief ray farthest from the camera's axis; `None` where one runs sideways or back.
fn least_cosine(camera: &Camera) -> Option<f64> {
    let [width, height] = camera.resolution().map(f64::from);
    let at = |i: u32, side: f64| f64::from(i) / f64::from(PLACES - 1) * side;
    let places = (0..PLACES * PLACES).map(|i| [at(i % PLACES, width), at(i / PLACES, height)]);
    let (columns, rows): (Vec<f64>, Vec<f64>) = places.map(|[x, y]| (x, y)).unzip();
    let mut rays = RayBatch::default();
    camera.rays_through(&columns, &rows, &mut rays);
    let seen = (0..rays.len()).filter(|&i| rays.t_max()[i] >= 0.0);
    let cosines = seen.map(|i| rays.direction(i).dot(camera.pose().forward()));
    cosines.reduce(f64::min).filter(|cosine| *cosine > 0.0)
}

/// The distance (m) from where rays leave the camera to the nearest surface with an image on it: that of boxes around
/// things, and around each triangle of those in whose box it stands. `None` where one of them may touch it, moves or
/// changes its shape.
fn nearest(scene: &Scene, uses: &[PlacedImage]) -> Option<f64> {
    let eye = scene.camera.pose().position;
    let geometry = &scene.geometry;
    let is_still = |placement: &Placement| {
        placement.motion.is_none() && geometry.mesh_of(placement).steps.is_none()
    };
    let of_placement = |placement: &Placement| {
        let bounds = geometry.loose_bounds_of(placement);
        if bounds.is_empty() {
            return f64::INFINITY;
        }
        let outside = to_box(eye, bounds);
        let mesh = geometry.mesh_of(placement);
        if outside > 0.0 || mesh.triangles.len() > MOST_TRIANGLES {
            return outside;
        }
        let distances = (0..mesh.triangles.len()).into_par_iter().map(|triangle| {
            let corners = mesh.corners(triangle).map(|p| placement.world_from_mesh.point(p));
            to_box(eye, Bounds::of_points(corners))
        });
        distances.reduce(|| f64::INFINITY, f64::min)
    };
    let has_image = |p: &&Placement| uses.iter().any(|used| used.material == p.material);
    let mut placed = geometry.placements.iter().filter(has_image);
    let nearest = placed.try_fold(f64::INFINITY, |nearest, placement| {
        is_still(placement).then(|| nearest.min(of_placement(placement)))
    })?;
    // Rays leave a lens in front of where the camera stands, by less than twice its length (mm).
    let reach = scene.camera.lens().map_or(0.0, |lens| 2e-3 * lens.focused().sensor_z().abs());
    let left = nearest - reach;
    (left > 0.0 && left.is_finite()).then_some(left)
}

fn to_box(eye: DVec3, bounds: Bounds) -> f64 {
    (eye.clamp(bounds.min, bounds.max) - eye).length()
}

/// The least length in an image, as a share of its sides, of a line of one metre on what it is on; `None` where that is
/// not known.
fn density(scene: &Scene, used: &PlacedImage) -> Option<f64> {
    let geometry = &scene.geometry;
    let placed = geometry.placements.iter().filter(|p| p.material == used.material);
    let mut least = f64::INFINITY;
    let mut triangles = 0;
    for placement in placed {
        let mesh = geometry.mesh_of(placement);
        let uvs = mesh.uvs.get(used.image.uv_set as usize)?;
        triangles += mesh.triangles.len();
        if triangles > MOST_TRIANGLES {
            return None;
        }
        let [u, v] = used.image.transform;
        // Rows of the matrix that places the image.
        let image = DMat2::from_cols(DVec2::new(u[0], v[0]), DVec2::new(u[1], v[1]));
        let of_triangle = |triangle: usize| {
            let linear = placement.world_from_mesh.linear;
            let [a, b, c] = mesh.corners(triangle);
            let uv = mesh.triangles[triangle]
                .map(|corner| DVec2::from(uvs.get(corner as usize).map(f64::from)));
            let edges = [linear * (b - a), linear * (c - a)];
            least_stretch(edges, image * DMat2::from_cols(uv[1] - uv[0], uv[2] - uv[0]))
        };
        let all = (0..mesh.triangles.len()).into_par_iter().map(of_triangle);
        least = least.min(all.reduce(|| f64::INFINITY, f64::min));
    }
    Some(least)
}

/// The least length to which a plane's lines of length 1 are mapped where two of its vectors, `edges`, are mapped to the
/// columns of `images`: the lesser singular value. Infinite where the vectors lie on one line: no ray meets such a
/// triangle.
fn least_stretch([first, second]: [DVec3; 2], images: DMat2) -> f64 {
    let length = first.length();
    let along = first.dot(second) / length;
    let across = (second - first * (along / length)).length();
    if !(length > 0.0 && across > 1e-9 * second.length()) {
        return f64::INFINITY;
    }
    let x = images.x_axis / length;
    let y = (images.y_axis - x * along) / across;
    let squares = x.length_squared() + y.length_squared();
    let area = x.perp_dot(y).abs();
    // Both singular values' squares add up to `squares`, and their product is `area`.
    let difference = (squares * squares - 4.0 * area * area).max(0.0).sqrt();
    (0.5 * (squares - difference)).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_stretch_of_a_triangle_is_that_of_its_narrow_side() {
        // A square metre over 3 by 0.5 of an image, sheared in the plane and turned in space.
        let turn = etendue_geometry::glam::DQuat::from_rotation_x(0.7);
        let edges = [DVec3::new(2.0, 0.0, 0.0), DVec3::new(0.5, 1.5, 0.0)];
        let map = |p: DVec3| DVec2::new(3.0 * p.x, 0.5 * p.y);
        let images = DMat2::from_cols(map(edges[0]), map(edges[1]));
        let found = least_stretch(edges.map(|edge| turn * edge), images);
        assert!((found - 0.5).abs() < 1e-12, "{found}");
        assert_eq!(least_stretch([DVec3::X, 2.0 * DVec3::X], images), f64::INFINITY);
        // One line of the image on all of the triangle.
        let flat = DMat2::from_cols(DVec2::X, DVec2::X * 0.3);
        assert!(least_stretch(edges, flat) < 1e-7);
    }
}
