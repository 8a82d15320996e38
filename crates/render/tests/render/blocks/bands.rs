//! Light in many bands, in blocks of rays and in batches.

use etendue_render::Plan;
use etendue_render::output::Outputs;
use etendue_spectrum::{Bands, Grid};

use super::{LAMP, LAYERS, POINTS, compare, room_of, save_waves};
use crate::steps::load_in;

/// As many bands as measured colours have, and more: facets, printed surfaces and a body that absorbs have a number of
/// their own in each, in a scene of few triangles and in one of many.
#[test]
fn paths_in_many_bands_are_the_same_in_blocks_and_batches() {
    let folder = tempfile::tempdir().unwrap();
    save_waves(folder.path(), 20);
    let path = r#"{"type": "path", "max_bounces": 4}"#;
    let image = r#"{"type": "environment", "image": "waves.png", "radiance": [2, 1, 0.5]}"#;
    let all = format!("{POINTS}, {image}");
    // Of few triangles the tree takes blocks, too.
    for (count, materials, ball, structures) in
        [(31, ["copper", "printed"], "box", 2), (64, ["plastic", "amber"], "sphere", 1)]
    {
        let scene = load_in(folder.path(), &room_of(materials, [path, &all, LAMP, ball]));
        let mut plan = Plan::new(&scene, Outputs::from_list("exr").unwrap());
        plan.bands = Bands::Spectral(Grid::equal(400.0, 700.0, count).unwrap());
        assert_eq!(plan.bands.count(), count);
        let compared = compare(&format!("{count} bands, {ball}"), &scene, &plan, &LAYERS);
        assert_eq!(compared, structures, "{count} bands");
    }
}
