//! Surfaces in one plane: the later one is seen, with every accelerator and precision.

use super::{assert_shows, patch, picture, ways};
use crate::steps::load;

/// A lamp in the floor, the one or the other first, straight and turned, at the origin and away from it.
#[test]
fn a_lamp_in_the_plane_of_a_floor() {
    for (at, turn) in [(0.0, 0), (0.3, 37), (100.0, 37)] {
        let sheet = |size: f64, material: &str| {
            format!(
                r#"{{"shape": "rectangle", "width": {size}, "height": {size}, "material": "{material}",
                    "transform": {{"translate": [{at}, {at}, {at}], "rotate": [1, 0.2, 0.3, {turn}]}}}}"#
            )
        };
        let (floor, lamp) = (sheet(4.0, "floor"), sheet(1.0, "lamp"));
        for (name, objects, known) in [
            ("lamp later", format!("{floor}, {lamp}"), 3.0),
            ("floor later", format!("{lamp}, {floor}"), 0.0),
        ] {
            let rest = format!(
                r#""lights": [], "objects": [{objects}],
                "materials": {{"floor": {{"type": "matte", "color": [0.5, 0.5, 0.5]}},
                    "lamp": {{"type": "emissive", "radiance": [3, 3, 3], "two_sided": true}}}}"#
            );
            for way in ways() {
                for tracer in ["direct", "path"] {
                    let eye = [[at + 0.1, at + 0.2, at + 2.0], [at + 0.1, at + 0.13, at]];
                    let scene = load(&patch(tracer, 4, eye[0], eye[1], &rest));
                    let name = format!("{name} at {at}, {tracer}, {way:?}");
                    // What shines along its own plane is a rounding of nothing.
                    assert_shows(&name, &picture(scene, way), known, 1e-9);
                }
            }
        }
    }
}
