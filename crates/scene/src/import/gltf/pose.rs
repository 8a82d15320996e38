//! Placements of the nodes of a document: the one place where their transforms are evaluated.

use std::path::Path;

use etendue_geometry::Transform;
use etendue_geometry::glam::{DMat3, DQuat, DVec3};

use super::document::{GltfDocument, GltfNode, absent};
use crate::import::Refusal;
use crate::import::error::damaged;

/// The nodes of a document with each of them somewhere.
#[derive(Debug, Default)]
pub(super) struct NodePoses {
    /// The nodes of the default scene, parents before children, in the order of the file.
    pub shown: Vec<usize>,
    /// For each node whether it or one above it is hidden (`KHR_node_visibility`): its mesh and
    /// light are not there, its camera is.
    pub hidden: Vec<bool>,
    /// From each node's frame to the model's (m); `None` for nodes below a broken one that the
    /// default scene does not show.
    model_from_node: Vec<Option<Transform>>,
}

impl NodePoses {
    /// The nodes as the file has them at rest.
    ///
    /// # Errors
    ///
    /// When the default scene has a node that is absent, stands below itself or two parents, or has
    /// a transform that is not finite.
    pub(super) fn at_rest(path: &Path, document: &GltfDocument) -> Result<Self, Refusal> {
        Self::evaluate(path, document, |index, node| local(path, node, index))
    }

    /// The nodes with each one's transform to its parent's frame by `local`.
    fn evaluate(
        path: &Path,
        document: &GltfDocument,
        local: impl Fn(usize, &GltfNode) -> Result<Transform, Refusal>,
    ) -> Result<Self, Refusal> {
        let count = document.nodes.len();
        let (hidden, model_from_node) = (vec![false; count], vec![None; count]);
        let mut pose = Self { shown: Vec::new(), hidden, model_from_node };
        // Last in, first out: pushed in reverse, nodes come in the order of the file.
        let mut open: Vec<(usize, Transform)> = Vec::new();
        open.extend(roots(path, document)?.into_iter().rev().map(|n| (n, Transform::IDENTITY)));
        while let Some((index, model_from_parent)) = open.pop() {
            if pose.model_from_node[index].is_some() {
                let reason = "it has two parents or is its own ancestor; export the file again";
                return Err(damaged(path, format!("nodes[{index}]"), reason));
            }
            let node = &document.nodes[index];
            let model_from_node = model_from_parent.then_inner(&local(index, node)?);
            pose.model_from_node[index] = Some(model_from_node);
            pose.shown.push(index);
            pose.hidden[index] |= is_hidden(node);
            for (place, &child) in node.children.iter().enumerate().rev() {
                exists(path, child, count, || format!("nodes[{index}].children[{place}]"))?;
                pose.hidden[child] |= pose.hidden[index];
                open.push((child, model_from_node));
            }
        }
        pose.evaluate_others(document, local);
        Ok(pose)
    }

    /// Places what the default scene does not show, for joints of skins that stand there. Nobody
    /// sees these nodes: broken ones are passed over.
    fn evaluate_others(
        &mut self,
        document: &GltfDocument,
        local: impl Fn(usize, &GltfNode) -> Result<Transform, Refusal>,
    ) {
        let mut open: Vec<(usize, Transform)> =
            orphans(document).into_iter().map(|node| (node, Transform::IDENTITY)).collect();
        while let Some((index, model_from_parent)) = open.pop() {
            let Some(node) = document.nodes.get(index) else { continue };
            if self.model_from_node[index].is_some() {
                continue;
            }
            if let Ok(parent_from_node) = local(index, node) {
                let model_from_node = model_from_parent.then_inner(&parent_from_node);
                self.model_from_node[index] = Some(model_from_node);
                open.extend(node.children.iter().map(|&child| (child, model_from_node)));
            }
        }
    }

    /// From the frame of node `index` to the model's (m); `None` when it stands nowhere.
    pub(super) fn of(&self, index: usize) -> Option<Transform> {
        self.model_from_node.get(index).copied().flatten()
    }
}

/// Refuses a reference to a node that is not there; `from` is where it is made.
pub(super) fn exists(
    path: &Path,
    node: usize,
    count: usize,
    from: impl Fn() -> String,
) -> Result<(), Refusal> {
    if node < count {
        return Ok(());
    }
    Err(absent(path, from(), "node", node, count))
}

/// The roots of the default scene: the one that the document names, else its first; a document
/// without scenes shows all nodes that are nobody's children.
fn roots(path: &Path, document: &GltfDocument) -> Result<Vec<usize>, Refusal> {
    if document.scenes.is_empty() {
        return Ok(orphans(document));
    }
    let default = document.root.scene.map_or(0, |scene| scene.value());
    let Some(scene) = document.scenes.get(default) else {
        return Err(absent(path, "scene", "scene", default, document.scenes.len()));
    };
    for (place, &node) in scene.nodes.iter().enumerate() {
        let from = || format!("scenes[{default}].nodes[{place}]");
        exists(path, node, document.nodes.len(), from)?;
    }
    Ok(scene.nodes.clone())
}

/// The nodes that are nobody's children.
fn orphans(document: &GltfDocument) -> Vec<usize> {
    let mut is_child = vec![false; document.nodes.len()];
    for &child in document.nodes.iter().flat_map(|node| &node.children) {
        if let Some(is_child) = is_child.get_mut(child) {
            *is_child = true;
        }
    }
    (0..is_child.len()).filter(|&node| !is_child[node]).collect()
}

fn is_hidden(node: &GltfNode) -> bool {
    let visible = node.extensions.get("KHR_node_visibility").and_then(|e| e.get("visible"));
    visible.and_then(serde_json::Value::as_bool) == Some(false)
}

/// From the node's frame to its parent's, as the file has it.
pub(super) fn local(path: &Path, node: &GltfNode, index: usize) -> Result<Transform, Refusal> {
    let place = || format!("nodes[{index}]");
    let transform = match node.matrix {
        Some(matrix) => affine(&matrix).ok_or_else(|| {
            damaged(path, place(), "its matrix is a projection: the last row must be 0 0 0 1")
        })?,
        None => trs(
            DVec3::from(node.translation.unwrap_or_default()),
            DQuat::from_array(node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0])),
            DVec3::from(node.scale.unwrap_or([1.0; 3])),
        ),
    };
    if transform.is_finite() {
        Ok(transform)
    } else {
        Err(damaged(path, place(), "its transform is not finite, or its rotation is 0 0 0 0"))
    }
}

/// A column-major matrix whose last row is that of an affine map.
fn affine(matrix: &[f64; 16]) -> Option<Transform> {
    let [a0, a1, a2, a3, b0, b1, b2, b3, c0, c1, c2, c3, t0, t1, t2, t3] = *matrix;
    let linear = DMat3::from_cols_array(&[a0, a1, a2, b0, b1, b2, c0, c1, c2]);
    ([a3, b3, c3, t3] == [0.0, 0.0, 0.0, 1.0])
        .then(|| Transform::new(linear, DVec3::new(t0, t1, t2)))
}

/// glTF's TRS. Files hold rotations in seven digits or so: they are made unit length again; one of
/// length 0 gives NaN.
pub(super) fn trs(translation: DVec3, rotation: DQuat, scale: DVec3) -> Transform {
    let unit = rotation / rotation.length();
    Transform::from_trs(translation, unit, scale)
}
