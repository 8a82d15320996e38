//! The frames of nodes that move in each other while an animation plays.

use etendue_geometry::{Link, Transform};

use super::pose::{NodePoses, local};
use super::reader::GltfReader;
use crate::import::Import;
use crate::import::error::{Note, NoteKind, push};

/// Parents of the nodes.
pub(super) struct Chains<'a> {
    reader: &'a GltfReader<'a>,
    parents: Vec<Option<usize>>,
}

impl<'a> Chains<'a> {
    /// Those of a document whose nodes have one parent each.
    pub(super) fn new(reader: &'a GltfReader<'a>) -> Self {
        let nodes = &reader.document.nodes;
        let mut parents = vec![None; nodes.len()];
        for (parent, node) in nodes.iter().enumerate() {
            for &child in &node.children {
                if let Some(place) = parents.get_mut(child) {
                    *place = Some(parent);
                }
            }
        }
        Self { reader, parents }
    }

    /// The node and all above it; each once, also where broken nodes go round.
    fn above(&self, node: usize) -> Vec<usize> {
        let mut path = Vec::new();
        let mut open = Some(node);
        while let Some(node) = open.filter(|node| !path.contains(node)) {
            path.push(node);
            open = self.parents.get(node).copied().flatten();
        }
        path
    }

    fn moves(&self, node: usize) -> bool {
        !self.reader.playing.joints.is_empty()
            && self.above(node).iter().any(|node| self.reader.playing.joints.contains_key(node))
    }

    /// From the node's frame to the model's, the outermost frame first; nothing of a node that stands still.
    pub(super) fn of(&self, node: usize) -> Vec<Link> {
        if !self.moves(node) {
            return Vec::new();
        }
        let mut links: Vec<Link> = Vec::new();
        for node in self.above(node).into_iter().rev() {
            if let Some(joint) = self.reader.playing.joints.get(&node) {
                links.push(Link::Joint(Box::new(joint.clone())));
                continue;
            }
            // Of a document that is shown, all nodes have finite transforms.
            let own = local(self.reader.file, &self.reader.document.nodes[node], node);
            let own = own.unwrap_or(Transform::IDENTITY);
            match links.last_mut() {
                Some(Link::Fixed(before)) => *before = before.then_inner(&own),
                _ => links.push(Link::Fixed(own)),
            }
        }
        links
    }

    /// Notes that cameras of nodes that move stand still.
    pub(super) fn note(&self, pose: &NodePoses, import: &mut Import) {
        let document = self.reader.document;
        for &node in pose.shown.iter().filter(|node| self.moves(**node)) {
            let shown = &document.nodes[node];
            if shown.camera.is_some() {
                let message = "its camera stands still within an exposure, as it is in the moment that is shown";
                let note = Note::new(NoteKind::Unsupported, format!("nodes[{node}]"), message);
                push(&mut import.notes, note);
            }
        }
    }
}
