//! Meshes that change their shapes while the shutter is open: in so many steps that straight lines between them are near enough to
//! what the animation says for the camera.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;

use etendue_camera::{Camera, PixelExtent};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, Geometry, Motion, Placement, Transform};

use crate::SceneError;
use crate::doctor::memory::STEP_BYTES;
use crate::file::SceneFile;
use crate::import::{Deformer, NoSteps};
use crate::memory::{Budget, TooMuch};

/// Points nearer to the camera than this share of their mesh's size are taken for as far: nothing could be
/// fine enough for what touches the camera.
const NEAREST: f64 = 0.01;

/// Of more placements than these the nearest one counts for all points.
const MOST_PLACES: usize = 16;

impl SceneFile {
    /// The geometry with the steps of what changes its shape while the camera's shutter is open.
    pub(super) fn deformed(
        &self,
        geometry: Arc<Geometry>,
        deformers: &BTreeMap<u32, Arc<Deformer>>,
        camera: &Camera,
        budget: &Budget,
    ) -> Result<Arc<Geometry>, SceneError> {
        let span = camera.exposure_span();
        let moving = |(_, deformer): &(&u32, &Arc<Deformer>)| deformer.moves_within(span);
        if !deformers.iter().any(|one| moving(&one)) {
            return Ok(geometry);
        }
        let mut all = (*geometry).clone();
        for (&number, deformer) in deformers.iter().filter(moving) {
            let places: Vec<&Placement> =
                geometry.placements.iter().filter(|placement| placement.mesh == number).collect();
            let mesh = &mut all.meshes[number as usize];
            let allowed = self.spec.accuracy.deformation_error;
            let eyes = Eyes::new(&places, mesh.bounds, camera, allowed);
            let bytes = STEP_BYTES * mesh.triangles.len() as u64;
            let mut count = 0_u32;
            let mut take = |step: u64| {
                count += 1;
                budget.take(step.saturating_add(bytes))
            };
            let tolerance = |point: DVec3| eyes.tolerance(point);
            let key = eyes.key(span);
            let steps = deformer.steps(&mesh.triangles, span, key, &tolerance, &mut take);
            mesh.steps = Some(steps.map_err(|why| self.no_steps(&mesh.name, count, why))?);
        }
        for placement in &mut all.placements {
            if all.meshes[placement.mesh as usize].steps.is_some() && placement.motion.is_none() {
                let place = Motion::default().then_inner(&placement.world_from_mesh);
                placement.motion = Some(Arc::new(place));
            }
        }
        Ok(Arc::new(all))
    }

    fn no_steps(&self, name: &str, count: u32, why: NoSteps<TooMuch>) -> SceneError {
        match why {
            NoSteps::Room(why) => {
                let what = format!(
                    "step {count} of the shapes of mesh \"{name}\" while the shutter is open (a shorter exposure has \
                     fewer, and without `plays` there is one) {why}"
                );
                SceneError::refused(self.path(), what)
            }
            NoSteps::Broken(error) => {
                let why = format!(
                    "mesh \"{name}\" of an animation that plays: {error}\nhint: export it again, or leave `plays` out"
                );
                self.fault("objects", why)
            }
        }
    }
}

/// From where a mesh is seen while the shutter is open.
struct Eyes {
    /// Tolerance of a point's distance from where the animation has it (pixels of the picture).
    allowed: f64,
    /// Of a pixel: its side per distance, or its side (m).
    pixel: PixelExtent,
    /// The camera (m, world), where the mesh stands, and by how much that stretches it at most.
    views: Vec<(DVec3, Transform, f64)>,
    /// The most by which any place stretches it.
    stretch: f64,
    /// Distances (m) are no less.
    least: f64,
    /// The least distance (m), where it counts for all points.
    nearest: Option<f64>,
}

impl Eyes {
    fn new(places: &[&Placement], bounds: Bounds, camera: &Camera, allowed: f64) -> Self {
        let [open, close] = camera.exposure_span();
        let [width, height] = camera.resolution().map(f64::from);
        // What sees all around has half a turn over its longer side at least.
        let wide = PixelExtent::Angle(PI / width.max(height));
        let pixel = camera.pixel_extent().unwrap_or(wide);
        let mut views = Vec::new();
        for time in [open, 0.5 * (open + close), close] {
            let eye = camera.pose_at(time).position;
            views.extend(places.iter().map(|placement| {
                let place = placement.world_from_mesh_at(time);
                let axes = place.linear;
                let axes = [axes.x_axis, axes.y_axis, axes.z_axis].map(DVec3::length_squared);
                (eye, place, axes.iter().sum::<f64>().sqrt())
            }));
        }
        let radius = 0.5 * bounds.diagonal();
        let stretch = views.iter().map(|(.., stretch)| *stretch).fold(0.0, f64::max);
        let least = NEAREST * radius * stretch;
        let to_ball = |(eye, place, stretch): &(DVec3, Transform, f64)| {
            eye.distance(place.point(bounds.centre())) - radius * stretch
        };
        let nearest = (places.len() > MOST_PLACES)
            .then(|| views.iter().map(to_ball).fold(f64::INFINITY, f64::min).max(least));
        Self { allowed, pixel, views, stretch, least, nearest }
    }

    /// Tolerance of a point of the mesh from its place (m, in the mesh's frame).
    fn tolerance(&self, point: DVec3) -> f64 {
        let at = |distance: f64, stretch: f64| {
            let pixel = match self.pixel {
                PixelExtent::Width(width) => width,
                PixelExtent::Angle(angle) => angle * distance.max(self.least),
            };
            self.allowed * pixel / stretch
        };
        if let Some(nearest) = self.nearest {
            return at(nearest, self.stretch);
        }
        let of = |(eye, place, stretch): &(DVec3, Transform, f64)| {
            at(eye.distance(place.point(point)), *stretch)
        };
        self.views.iter().map(of).fold(f64::INFINITY, f64::min)
    }

    /// All that tolerances within `span` depend on, as bits.
    fn key(&self, span: [f64; 2]) -> Vec<u64> {
        let (kind, pixel) = match self.pixel {
            PixelExtent::Angle(angle) => (0.0, angle),
            PixelExtent::Width(width) => (1.0, width),
        };
        let nearest = self.nearest.unwrap_or(-1.0);
        let mut key = vec![span[0], span[1], self.allowed, kind, pixel, self.least, nearest];
        for (eye, place, _) in &self.views {
            key.extend(eye.to_array());
            key.extend(place.linear.to_cols_array());
            key.extend(place.translation.to_array());
        }
        key.into_iter().map(f64::to_bits).collect()
    }
}
