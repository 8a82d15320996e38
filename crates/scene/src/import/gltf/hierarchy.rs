//! The default scene: which nodes stand in it, and where.

use std::path::Path;

use etendue_geometry::Transform;
use etendue_geometry::glam::{DMat3, DQuat, DVec3};

use super::document::{Document, Node};
use super::{Reader, damaged, instancing};
use crate::import::note::{self, Note, NoteKind};
use crate::import::{
    Import, ImportError, ImportedCamera, ImportedLight, ImportedPlacement, Projection,
};

/// What stands in the scene.
#[derive(Default)]
pub(super) struct Scene {
    pub meshes: Vec<PlacedMesh>,
    pub cameras: Vec<ImportedCamera>,
    pub lights: Vec<ImportedLight>,
}

/// A node with a mesh.
pub(super) struct PlacedMesh {
    pub node: usize,
    pub mesh: usize,
    pub model_from_node: Transform,
}

/// Visits the nodes of the default scene, parents before children, in the order of the file.
///
/// The default scene is the one that the document names, else its first; a document without scenes
/// shows all nodes that are nobody's children.
pub(super) fn walk(
    path: &Path,
    document: &Document,
    notes: &mut Vec<Note>,
) -> Result<Scene, ImportError> {
    let mut scene = Scene::default();
    let mut visited = vec![false; document.nodes.len()];
    // Last in, first out: pushed in reverse, nodes come in the order of the file.
    let mut open: Vec<(usize, Transform)> =
        roots(path, document)?.into_iter().rev().map(|node| (node, Transform::IDENTITY)).collect();
    while let Some((index, model_from_parent)) = open.pop() {
        let place = || format!("nodes[{index}]");
        let (Some(node), Some(visited)) = (document.nodes.get(index), visited.get_mut(index))
        else {
            return Err(damaged(path, place(), "there is no such node; export the file again"));
        };
        if std::mem::replace(visited, true) {
            return Err(damaged(
                path,
                place(),
                "it has two parents or is its own ancestor; export the file again",
            ));
        }
        let model_from_node = model_from_parent.then_inner(&local(path, node, index)?);
        if let Some(mesh) = node.mesh {
            let model_from_node = if node.skin.is_some() {
                note_skin(notes);
                // glTF 2.0, section 3.7.3.3: only the joints place a skinned mesh.
                Transform::IDENTITY
            } else {
                model_from_node
            };
            scene.meshes.push(PlacedMesh { node: index, mesh, model_from_node });
        }
        if let Some(camera) = node.camera {
            scene.cameras.push(placed_camera(path, document, node, camera, model_from_node)?);
        }
        if let Some(light) = super::lights::placed(path, document, node, index, notes)? {
            scene.lights.push(ImportedLight { light, model_from_light: model_from_node });
        }
        open.extend(node.children.iter().rev().map(|&child| (child, model_from_node)));
    }
    Ok(scene)
}

fn roots(path: &Path, document: &Document) -> Result<Vec<usize>, ImportError> {
    if document.scenes.is_empty() {
        let mut is_child = vec![false; document.nodes.len()];
        for &child in document.nodes.iter().flat_map(|node| &node.children) {
            if let Some(is_child) = is_child.get_mut(child) {
                *is_child = true;
            }
        }
        return Ok((0..document.nodes.len()).filter(|&node| !is_child[node]).collect());
    }
    let default = document.root.scene.map_or(0, |scene| scene.value());
    match document.scenes.get(default) {
        Some(scene) => Ok(scene.nodes.clone()),
        None => Err(damaged(
            path,
            "scene",
            format!("there is no scene {default}; the file has {}", document.scenes.len()),
        )),
    }
}

fn note_skin(notes: &mut Vec<Note>) {
    note::push(
        notes,
        Note::new(
            NoteKind::Unsupported,
            "skins",
            "skinned meshes are shown as they were bound, without their joints; bake the pose \
             into the mesh before exporting",
        ),
    );
}

/// From the node's frame to its parent's.
fn local(path: &Path, node: &Node, index: usize) -> Result<Transform, ImportError> {
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

fn placed_camera(
    path: &Path,
    document: &Document,
    node: &Node,
    index: usize,
    model_from_camera: Transform,
) -> Result<ImportedCamera, ImportError> {
    let place = || format!("cameras[{index}]");
    let Some(camera) = document.cameras.get(index) else {
        return Err(damaged(path, place(), "there is no such camera; export the file again"));
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
    let name = node.name.clone().or_else(|| camera.name.clone()).unwrap_or_default();
    Ok(ImportedCamera { name, model_from_camera, projection })
}

/// Places the primitives of each mesh at each of its nodes, and at each instance of those.
pub(super) fn place(
    reader: &Reader<'_>,
    scene: &Scene,
    primitives: &[Vec<Option<super::primitive::Loaded>>],
    import: &mut Import,
) -> Result<(), ImportError> {
    for placed in &scene.meshes {
        let node = &reader.document.nodes[placed.node];
        let instances = instancing::transforms(reader, node, placed.node)?;
        let mesh = reader.document.root.meshes.get(placed.mesh);
        let name = node.name.clone().or_else(|| mesh.and_then(|m| m.name.clone()));
        let name = name.unwrap_or_default();
        let loaded = primitives.get(placed.mesh).into_iter().flatten().flatten();
        for primitive in loaded {
            for node_from_instance in &instances {
                import.placements.push(ImportedPlacement {
                    mesh: primitive.mesh,
                    material: primitive.material,
                    model_from_mesh: placed.model_from_node.then_inner(node_from_instance),
                    name: name.clone(),
                });
            }
        }
    }
    Ok(())
}
