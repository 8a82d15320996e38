//! The default scene: which nodes stand in it, and where.

use std::path::Path;

use super::document::{GltfDocument, absent};
use super::pose::NodePoses;
use super::tracks::Playing;
use crate::import::error::{Note, damaged};
use crate::import::{CameraProjection, ImportedCamera, ImportedLight, Refusal};
use etendue_geometry::Transform;

/// Nodes that stand in the scene, by what they are.
#[derive(Default)]
pub(super) struct SceneNodes {
    pub pose: NodePoses,
    pub meshes: Vec<PlacedMesh>,
    pub cameras: Vec<ImportedCamera>,
    /// With the nodes that they are of.
    pub lights: Vec<(usize, ImportedLight)>,
}

/// A node with a mesh.
pub(super) struct PlacedMesh {
    pub node: usize,
    pub shape: NodeShape,
    pub model_from_node: Transform,
}

/// A mesh of the document as a node shows it: with a skin, and with weights for its morph targets.
/// Each is loaded once; a mesh of two skins is two of them.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct NodeShape {
    pub mesh: usize,
    pub skin: Option<usize>,
    /// The bits of the weights; none when all are 0.
    weights: Vec<u64>,
    /// The node whose weights change while the animation plays.
    played_by: Option<usize>,
}

impl NodeShape {
    /// `mesh` as node `index` shows it: the node's weights go before the mesh's own.
    fn of(document: &GltfDocument, index: usize, mesh: usize, playing: &Playing) -> Self {
        let node = &document.nodes[index];
        let own = document.root.meshes.get(mesh).and_then(|mesh| mesh.weights.as_ref());
        let weights: Vec<f64> = match (&node.weights, own) {
            (Some(weights), _) => weights.clone(),
            (None, Some(weights)) => weights.iter().copied().map(f64::from).collect(),
            (None, None) => Vec::new(),
        };
        let moves = weights.iter().any(|&weight| weight != 0.0);
        let weights =
            if moves { weights.into_iter().map(f64::to_bits).collect() } else { Vec::new() };
        let played_by = playing.morphed.contains_key(&index).then_some(index);
        Self { mesh, skin: node.skin, weights, played_by }
    }

    /// The node whose weights change while the animation plays; no node's number where none do.
    pub(super) fn played_by(&self) -> usize {
        self.played_by.unwrap_or(usize::MAX)
    }

    /// The weights of the morph targets; none when all are 0.
    pub(super) fn weights(&self) -> impl Iterator<Item = f64> {
        self.weights.iter().copied().map(f64::from_bits)
    }
}

/// Collects what the nodes of the default scene show.
pub(super) fn walk(
    path: &Path,
    document: &GltfDocument,
    playing: &Playing,
    notes: &mut Vec<Note>,
) -> Result<SceneNodes, Refusal> {
    let pose = NodePoses::at_rest(path, document)?;
    let mut scene = SceneNodes::default();
    for &index in &pose.shown {
        let node = &document.nodes[index];
        let model_from_node = pose.of(index).unwrap_or_default();
        let hidden = pose.hidden[index];
        if let Some(mesh) = node.mesh.filter(|_| !hidden) {
            let shape = NodeShape::of(document, index, mesh, playing);
            scene.meshes.push(PlacedMesh { node: index, shape, model_from_node });
        }
        if let Some(camera) = node.camera {
            scene.cameras.push(placed_camera(path, document, index, camera, model_from_node)?);
        }
        if !hidden && let Some(light) = super::lights::placed(path, document, node, index, notes)? {
            let links = Vec::new();
            let light = ImportedLight { light, model_from_light: model_from_node, links };
            scene.lights.push((index, light));
        }
    }
    scene.pose = pose;
    Ok(scene)
}

fn placed_camera(
    path: &Path,
    document: &GltfDocument,
    node: usize,
    index: usize,
    model_from_camera: Transform,
) -> Result<ImportedCamera, Refusal> {
    let place = || format!("cameras[{index}]");
    let Some(camera) = document.cameras.get(index) else {
        let from = format!("nodes[{node}].camera");
        return Err(absent(path, from, "camera", index, document.cameras.len()));
    };
    let positive = |value: f64| value.is_finite() && value > 0.0;
    let projection = match (&camera.perspective, &camera.orthographic) {
        (Some(view), _)
            if positive(view.yfov)
                && view.yfov < std::f64::consts::PI
                && view.aspect_ratio.is_none_or(positive) =>
        {
            CameraProjection::Perspective { yfov: view.yfov, aspect_ratio: view.aspect_ratio }
        }
        // Some exporters write negative magnifications for mirrored views.
        (None, Some(view)) if positive(view.xmag.abs()) && positive(view.ymag.abs()) => {
            CameraProjection::Orthographic { xmag: view.xmag.abs(), ymag: view.ymag.abs() }
        }
        _ => {
            return Err(damaged(
                path,
                place(),
                "it needs a perspective with yfov between 0 and pi and a positive aspectRatio, or \
                 an orthographic view with xmag and ymag other than 0",
            ));
        }
    };
    let name = document.nodes[node].name.as_ref().or(camera.name.as_ref());
    let name = name.cloned().unwrap_or_default();
    Ok(ImportedCamera { name, model_from_camera, projection })
}
