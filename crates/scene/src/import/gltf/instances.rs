//! Placements of the meshes of the scene's nodes. `EXT_mesh_gpu_instancing`: a node's mesh at many
//! places.

use serde_json::Value;

use super::chains::Chains;
use super::document::GltfNode;
use super::hierarchy::SceneNodes;
use super::pose::trs;
use super::primitive::ShapeSet;
use super::reader::GltfReader;
use crate::import::{Import, ImportedPlacement, Refusal};
use etendue_geometry::glam::{DQuat, DVec3};
use etendue_geometry::{Link, Placement, Transform, Vertices};

/// Places the primitives of each mesh at each of its nodes, and at each instance of those.
pub(super) fn place(
    reader: &GltfReader<'_>,
    scene: &SceneNodes,
    chains: &Chains<'_>,
    shapes: &ShapeSet,
    import: &mut Import,
) -> Result<(), Refusal> {
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

/// True if `node` has the extension.
fn has(node: &GltfNode) -> bool {
    node.extensions.contains_key(NAME)
}

/// Placements of the instances of `node` in its frame: one at the node itself without the extension.
fn transforms(
    reader: &GltfReader<'_>,
    node: &GltfNode,
    index: usize,
) -> Result<Vec<Transform>, Refusal> {
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
            "they differ in their number of instances\nhint: export the file again",
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
    reader: &GltfReader<'_>,
    attributes: Option<&Value>,
    name: &str,
    place: &impl Fn(&str) -> String,
) -> Result<Option<Vertices<N>>, Refusal> {
    let Some(index) = attributes.and_then(|a| a.get(name)) else {
        return Ok(None);
    };
    let place = place(name);
    let Some(index) = index.as_u64().and_then(|index| usize::try_from(index).ok()) else {
        return Err(reader
            .damaged(place, "expected the number of an accessor\nhint: export the file again"));
    };
    let accessor = reader.accessor(index, &place)?;
    match accessor.floats(0.0) {
        Some(values) if accessor.components == N => Ok(Some(values)),
        _ => Err(reader.damaged(
            place,
            format!(
                "it has {} components, not {N}\nhint: export the file again",
                accessor.components
            ),
        )),
    }
}
