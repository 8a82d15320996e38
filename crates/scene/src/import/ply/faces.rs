//! Faces: polygons and triangle strips into triangles.

use etendue_geometry::glam::DVec3;
use etendue_geometry::{Buffer, Positions};

use super::header::Element;
use crate::import::polygon;

/// What the lists of an element are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Lists {
    Polygons,
    /// Strips, each ended by −1.
    Strips,
}

impl Lists {
    /// The lists of `element` and the number of the property; `None` when it has no surface.
    pub(super) fn of(element: &Element) -> Option<(Self, usize)> {
        let kind = match element.name.as_str() {
            "face" | "faces" => Self::Polygons,
            "tristrips" => Self::Strips,
            _ => return None,
        };
        let column = element.find(&["vertex_indices", "vertex_index"])?;
        element.properties[column].list.map(|_| (kind, column))
    }
}

/// The faces of a file.
#[derive(Debug, Default)]
pub(super) struct Faces {
    triangles: Vec<[u32; 3]>,
    /// Corners of faces with more than three.
    corners: Vec<u32>,
    /// Where in `corners` each of those ends.
    ends: Vec<usize>,
}

impl Faces {
    /// From triangles alone.
    pub(super) fn from_triangles(triangles: Vec<[u32; 3]>) -> Self {
        Self { triangles, ..Self::default() }
    }

    /// Adds one list. Indices below zero are given as the two's complement.
    pub(super) fn push(&mut self, lists: Lists, corners: &[u32]) {
        match (lists, corners) {
            (Lists::Strips, _) => {
                for strip in corners.split(|&corner| corner == u32::MAX) {
                    self.triangles.extend(strip.windows(3).enumerate().map(|(i, t)| {
                        if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] }
                    }));
                }
            }
            (Lists::Polygons, &[a, b, c]) => self.triangles.push([a, b, c]),
            (Lists::Polygons, [_, _, _, _, ..]) => {
                self.corners.extend_from_slice(corners);
                self.ends.push(self.corners.len());
            }
            (Lists::Polygons, _) => {}
        }
    }

    /// Adds what another part of the file has.
    pub(super) fn append(&mut self, mut other: Self) {
        let before = self.corners.len();
        self.triangles.append(&mut other.triangles);
        self.corners.append(&mut other.corners);
        self.ends.extend(other.ends.iter().map(|end| before + end));
    }

    /// Bytes of the triangles that polygons are cut into.
    pub(super) fn bytes_to_cut(&self) -> u64 {
        let triangles = self.corners.len().saturating_sub(2 * self.ends.len());
        (triangles * size_of::<[u32; 3]>()) as u64
    }

    /// All faces as triangles: triangles in the order of the file, then those of polygons.
    pub(super) fn triangles(mut self, positions: &Positions) -> Buffer<[u32; 3]> {
        let mut start = 0;
        let mut cut = Vec::new();
        for &end in &self.ends {
            let corners = &self.corners[start..end];
            start = end;
            // What does not exist is refused where all triangles are checked.
            let point = |&corner: &u32| match corner as usize {
                corner if corner < positions.len() => positions.get(corner),
                _ => DVec3::NAN,
            };
            let points: Vec<DVec3> = corners.iter().map(point).collect();
            cut.clear();
            polygon::triangulate(&points, &mut cut);
            self.triangles.extend(cut.iter().map(|t| t.map(|corner| corners[corner as usize])));
        }
        self.triangles.into()
    }
}
