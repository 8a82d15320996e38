//! Inspection of what the camera sees at one place of its picture.

use std::sync::Arc;

use etendue_accel::Accel;
use etendue_camera::PixelExtent;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Detail, HitBatch, RayBatch};
use etendue_report::Decision;
use etendue_scene::Scene;

use crate::session::PreparedScene;
use crate::{Error, Progress, Session, Viewpoint};

/// A scene with the structure over it, to be asked from any thread while the session goes on.
#[derive(Debug, Clone)]
pub struct Inspector {
    scene: Arc<Scene>,
    accel: Arc<dyn Accel>,
    decisions: Arc<[Decision]>,
}

/// Hit of the chief ray of a place of the picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Probe {
    /// Along the ray, from the camera's origin (m): the layer `distance`.
    pub distance: f64,
    /// Along the camera's axis (m): the layer `depth`, and what a lens is focused at.
    pub depth: f64,
    /// The point (m).
    pub position: DVec3,
    /// The triangle's unit normal, on the side that is seen.
    pub normal: DVec3,
    /// The object's name.
    pub object: String,
    /// The name of the node of its model; empty for a shape.
    pub node: String,
    /// The material's name.
    pub material: String,
    /// The number of the triangle in its mesh, from 0.
    pub triangle: u32,
}

impl Session {
    /// The scene as it is now, to be asked for what is where. Loads and builds what is needed.
    ///
    /// # Errors
    ///
    /// As [`Self::prepare`].
    pub fn inspector(&mut self, progress: &Progress) -> Result<Inspector, Error> {
        self.prepare(progress)?;
        let PreparedScene { scene, accel, .. } = self.prepared()?;
        let decisions = Arc::from(&*self.plan(progress)?.decisions);
        Ok(Inspector { scene, accel, decisions })
    }
}

impl Inspector {
    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Decisions of the plan, with their reasons.
    #[must_use]
    pub fn decisions(&self) -> &[Decision] {
        &self.decisions
    }

    /// Viewpoint of the camera, to be moved about what `probe` hit; without one, about what stands
    /// in the middle of the picture, or else about the middle of the scene.
    #[must_use]
    pub fn viewpoint(&self, probe: Option<&Probe>) -> Viewpoint {
        let camera = &self.scene.camera;
        let middle = camera.resolution().map(|side| 0.5 * f64::from(side));
        let distance = match probe {
            Some(probe) => probe.depth,
            None => self.probe(middle).map_or_else(|| self.distance_to_centre(), |hit| hit.depth),
        };
        Viewpoint::of(camera, distance)
    }

    /// Height in the world of the picture of a camera with parallel rays (m); `None` for others.
    #[must_use]
    pub fn picture_height(&self) -> Option<f64> {
        let camera = &self.scene.camera;
        match camera.pixel_extent() {
            Some(PixelExtent::Width(width)) => Some(width * f64::from(camera.resolution()[1])),
            _ => None,
        }
    }

    fn distance_to_centre(&self) -> f64 {
        let pose = self.scene.camera.pose();
        let bounds = self.scene.geometry.loose_bounds();
        (bounds.centre() - pose.position).dot(pose.forward())
    }

    /// Looks up what is seen at column and row coordinates `place` (pixels from the picture's corner; the first pixel's
    /// centre is at 0.5). `None` for the background, and where the camera sees nothing.
    #[must_use]
    pub fn probe(&self, [column, row]: [f64; 2]) -> Option<Probe> {
        let mut rays = RayBatch::default();
        self.scene.camera.rays_through(&[column], &[row], &mut rays);
        let mut hits = HitBatch::new(Detail::Surface);
        self.accel.closest(&rays, &mut hits);
        if !hits.is_hit(0) {
            return None;
        }
        let (origin, direction, distance) = (rays.origin(0), rays.direction(0), hits.t[0]);
        let position = origin + direction * distance;
        let normal = hits.normal(0);
        let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
        let pose = self.scene.camera.pose();
        let placement = self.scene.geometry.placements.get(hits.placement[0] as usize)?;
        let node = self.scene.nodes.get(placement.node as usize);
        let material = self.scene.materials.get(placement.material as usize);
        Some(Probe {
            distance,
            depth: (position - pose.position).dot(pose.forward()),
            position,
            normal,
            object: self.scene.objects.get(placement.object as usize).cloned().unwrap_or_default(),
            node: node.map(|node| node.name.clone()).unwrap_or_default(),
            material: material.map(|material| material.name.clone()).unwrap_or_default(),
            triangle: hits.triangle[0],
        })
    }
}
