//! The default scene: which nodes stand in it, and where.
//!
//! `EXT_mesh_gpu_instancing`: a node's mesh at many places.

use std::path::Path;

use serde_json::Value;

use super::animation::Playing;
use super::chains::Chains;
use super::document::{Document, Node};
use super::pose::{Pose, trs};
use super::primitive::Shapes;
use super::{Reader, absent, damaged};
use crate::import::error::Note;
use crate::import::{
    Import, ImportError, ImportedCamera, ImportedLight, ImportedPlacement, Projection,
};
use etendue_geometry::glam::{DQuat, DVec3};
use etendue_geometry::{Link, Placement, Transform, Vertices};

/// What stands in the scene.
#[derive(Default)]
pub(super) struct Scene {
    pub pose: Pose,
    pub meshes: Vec<PlacedMesh>,
    pub cameras: Vec<ImportedCamera>,
    /// With the nodes that they are of.
    pub lights: Vec<(usize, ImportedLight)>,
}

/// A node with a mesh.
pub(super) struct PlacedMesh {
    pub node: usize,
    pub shape: Shape,
    pub model_from_node: Transform,
}

/// A mesh of the document as a node shows it: with a skin, and with weights for its morph targets.
/// Each is loaded once; a mesh of two skins is two of them.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Shape {
    pub mesh: usize,
    pub skin: Option<usize>,
    /// The bits of the weights; none when all are 0.
    weights: Vec<u64>,
    /// The node whose weights change while the animation plays.
    played_by: Option<usize>,
}

impl Shape {
    /// `mesh` as node `index` shows it: the node's weights go before the mesh's own.
    fn of(document: &Document, index: usize, mesh: usize, playing: &Playing) -> Self {
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
    document: &Document,
    playing: &Playing,
    notes: &mut Vec<Note>,
) -> Result<Scene, ImportError> {
    let pose = Pose::at_rest(path, document)?;
    let mut scene = Scene::default();
    for &index in &pose.shown {
        let node = &document.nodes[index];
        let model_from_node = pose.of(index).unwrap_or_default();
        let hidden = pose.hidden[index];
        if let Some(mesh) = node.mesh.filter(|_| !hidden) {
            let shape = Shape::of(document, index, mesh, playing);
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
    document: &Document,
    node: usize,
    index: usize,
    model_from_camera: Transform,
) -> Result<ImportedCamera, ImportError> {
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
            Projection::Perspective { yfov: view.yfov, aspect_ratio: view.aspect_ratio }
        }
        // Some exporters write negative magnifications for mirrored views.
        (None, Some(view)) if positive(view.xmag.abs()) && positive(view.ymag.abs()) => {
            Projection::Orthographic { xmag: view.xmag.abs(), ymag: view.ymag.abs() }
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

/// Places the primitives of each mesh at each of its nodes, and at each instance of those.
pub(super) fn place(
    reader: &Reader<'_>,
    (scene, chains): (&Scene, &Chains<'_>),
    shapes: &Shapes,
    import: &mut Import,
) -> Result<(), ImportError> {
    for placed in &scene.meshes {
        let node = &reader.document.nodes[placed.node];
        let instances = transforms(reader, node, placed.node)?;
        let mesh = reader.document.root.meshes.get(placed.shape.mesh);
        let name = node.name.clone().or_else(|| mesh.and_then(|m| m.name.clone()));
        let name = name.unwrap_or_default();
        let each = size_of::<ImportedPlacement>() + size_of::<Placement>() + 2 * name.len();
        for primitive in shapes.primitives(&placed.shape) {
            let bytes = instances.len().saturating_mul(each) as u64;
            reader.files.take(bytes, || format!("nodes[{}]", placed.node))?;
            // glTF 2.0, section 3.7.3.3: only the joints place a skinned mesh.
            let model_from_node =
                if primitive.skinned { Transform::IDENTITY } else { placed.model_from_node };
            let links = if primitive.skinned { Vec::new() } else { chains.of(placed.node) };
            for (k, node_from_instance) in (0..).zip(&instances) {
                let mut links = links.clone();
                if !links.is_empty() {
                    links.push(Link::Fixed(*node_from_instance));
                }
                import.placements.push(ImportedPlacement {
                    mesh: primitive.mesh,
                    material: primitive.material,
                    model_from_mesh: model_from_node.then_inner(node_from_instance),
                    name: name.clone(),
                    node: u32::try_from(placed.node).unwrap_or(u32::MAX),
                    instance: has(node).then_some(k),
                    links,
                });
            }
        }
    }
    Ok(())
}

const NAME: &str = "EXT_mesh_gpu_instancing";

/// Whether `node` says so.
pub(super) fn has(node: &Node) -> bool {
    node.extensions.contains_key(NAME)
}

/// Where the instances of `node` stand in its frame: one at the node itself without the extension.
pub(super) fn transforms(
    reader: &Reader<'_>,
    node: &Node,
    index: usize,
) -> Result<Vec<Transform>, ImportError> {
    let Some(extension) = node.extensions.get(NAME) else {
        return Ok(vec![Transform::IDENTITY]);
    };
    let attributes = extension.get("attributes");
    let place = |attribute: &str| format!("nodes[{index}], {NAME}, {attribute}");
    let translations = values::<3>(reader, attributes, "TRANSLATION", &place)?;
    let rotations = values::<4>(reader, attributes, "ROTATION", &place)?;
    let scales = values::<3>(reader, attributes, "SCALE", &place)?;
    let counts = [
        translations.as_ref().map(Vertices::len),
        rotations.as_ref().map(Vertices::len),
        scales.as_ref().map(Vertices::len),
    ];
    let count = counts.iter().flatten().copied().max().unwrap_or(0);
    if counts.iter().flatten().any(|&each| each != count) {
        return Err(reader.damaged(
            place("attributes"),
            "they differ in their number of instances; export the file again",
        ));
    }
    let bytes = (count * size_of::<Transform>()) as u64;
    reader.files.take(bytes, || place("attributes"))?;
    let transform = |i: usize| {
        let translation =
            translations.as_ref().map_or(DVec3::ZERO, |v| v.get(i).map(f64::from).into());
        let rotation = rotations
            .as_ref()
            .map_or(DQuat::IDENTITY, |v| DQuat::from_array(v.get(i).map(f64::from)));
        let scale = scales.as_ref().map_or(DVec3::ONE, |v| v.get(i).map(f64::from).into());
        let transform = trs(translation, rotation, scale);
        transform.is_finite().then_some(transform).ok_or_else(|| {
            reader.damaged(
                place(&format!("instance {i}")),
                "its transform is not finite, or its rotation is 0 0 0 0",
            )
        })
    };
    (0..count).map(transform).collect()
}

fn values<const N: usize>(
    reader: &Reader<'_>,
    attributes: Option<&Value>,
    name: &str,
    place: &impl Fn(&str) -> String,
) -> Result<Option<Vertices<N>>, ImportError> {
    let Some(index) = attributes.and_then(|a| a.get(name)) else {
        return Ok(None);
    };
    let place = place(name);
    let Some(index) = index.as_u64().and_then(|index| usize::try_from(index).ok()) else {
        return Err(
            reader.damaged(place, "expected the number of an accessor; export the file again")
        );
    };
    let accessor = reader.accessor(index, &place)?;
    match accessor.floats(0.0) {
        Some(values) if accessor.components == N => Ok(Some(values)),
        _ => Err(reader.damaged(
            place,
            format!("it has {} components, not {N}; export the file again", accessor.components),
        )),
    }
}
