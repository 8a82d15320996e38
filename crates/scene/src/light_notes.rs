//! Light that a scene asks for and no picture will show.

use std::collections::BTreeMap;

use etendue_geometry::{Geometry, Mesh, Placement};
use etendue_tracer::{Light, LightKind, Material, Scattering};

use crate::import::{Note, NoteKind};

/// What of the lights and the surfaces that shine finds no way into a picture, in words.
pub(crate) fn of(geometry: &Geometry, materials: &[Material], lights: &[Light]) -> Vec<Note> {
    let mut placed: BTreeMap<u32, f64> = BTreeMap::new();
    let mut bends: Vec<&str> = Vec::new();
    // Some area of every material that shines, and the glasses.
    for placement in &geometry.placements {
        let Some(material) = materials.get(placement.material as usize) else { continue };
        if material.emission.is_some() {
            let area = placed.entry(placement.material).or_default();
            if *area == 0.0 {
                *area = some_area(geometry.mesh_of(placement), placement);
            }
        }
        let is_glass = matches!(material.scattering, Scattering::Dielectric(_));
        if is_glass && !bends.contains(&material.name.as_str()) {
            bends.push(&material.name);
        }
    }
    // Materials that shine and have none.
    let mut notes: Vec<Note> = placed
        .into_iter()
        .filter(|(_, area)| *area == 0.0)
        .map(|(number, _)| {
            let message = "shines, and no triangle that it is on has an area: it lights nothing";
            note(format!("material \"{}\"", materials[number as usize].name), message)
        })
        .collect();
    // Lights that no path can find behind glass.
    let is_point = |light: &&Light| !matches!(light.kind, LightKind::Environment { .. });
    let points = lights.iter().filter(is_point).count() as u64;
    if points > 0 && !bends.is_empty() {
        let message = format!(
            "the light of suns, spots, points and projectors does not find its way through surfaces that bend it \
             ({}): what it shines on through them, or from within, is black; give the light a size \
             (`emissive`, `environment`) and take the tracer `path`",
            bends.join(", ")
        );
        notes.push(Note { count: points, ..note("lights".to_owned(), &message) });
    }
    notes
}

fn note(subject: String, message: &str) -> Note {
    Note { kind: NoteKind::Unsupported, subject, message: message.to_owned(), count: 1 }
}

/// The area (m²) of the first triangle of a placement that has one; 0 when none has.
fn some_area(mesh: &Mesh, placement: &Placement) -> f64 {
    let turn = &placement.world_from_mesh.linear;
    let area = |triangle: usize| {
        let [a, b, c] = mesh.corners(triangle);
        0.5 * (*turn * (b - a)).cross(*turn * (c - a)).length()
    };
    (0..mesh.triangles.len()).map(area).find(|area| *area > 0.0).unwrap_or(0.0)
}
