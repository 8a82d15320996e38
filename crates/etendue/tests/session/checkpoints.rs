//! Worth of a checkpoint to a render with more samples: all of it where the first samples stay the same.

use std::path::Path;
use std::time::Duration;

use etendue::{Channel, Checkpoint, Error, Layer, Progress, Rendering, Session};
use serde_json::{Value, json};

fn scene(sampler: &str, samples: u32) -> Value {
    json!({
        "etendue": 1, "tracer": {"type": "path", "max_bounces": 2}, "layers": ["depth", "mean_albedo"],
        "render": {"sampler": sampler, "samples": samples, "accel": "bvh"},
        "camera": {"type": "thin_lens", "focal_length": 50, "fov": 40, "f_number": 2, "focus_distance": 3,
                   "sensor": {"resolution": [12, 8]}, "pose": {"from": [0, 1, 3], "look_at": [0, 0, 0]}},
        "objects": [{"shape": "sphere", "material": "clay"}],
        "materials": {"clay": {"type": "matte", "color": [0.6, 0.5, 0.4]}},
        "lights": [{"type": "environment", "radiance": [1, 1, 1]}]
    })
}

/// Renders with what is kept in `folder`.
fn kept(folder: &Path, scene: Value) -> Result<Rendering, Error> {
    let mut session = Session::from_json(".", scene).unwrap();
    let path = folder.join("checkpoint.film");
    session.keep_at(Some(Checkpoint { path, every: Duration::ZERO }));
    session.render(&Progress::none())
}

/// All planes to the bit.
fn planes(rendering: &Rendering) -> Vec<(String, String)> {
    let planes = |layer: &Layer| {
        let plane = |channel: &Channel| (layer.full_name(channel), format!("{:?}", channel.values));
        layer.channels.iter().map(plane).collect::<Vec<_>>()
    };
    rendering.layers().iter().flat_map(planes).collect()
}

fn fresh(scene: Value) -> Vec<(String, String)> {
    planes(&Session::from_json(".", scene).unwrap().render(&Progress::none()).unwrap())
}

#[test]
fn more_samples_go_on_from_fewer_to_the_same_bits() {
    for sampler in ["sobol", "independent"] {
        let folder = tempfile::tempdir().unwrap();
        // The first four of eight are kept before the picture is complete, and eight of sixteen.
        kept(folder.path(), scene(sampler, 8)).unwrap();
        for samples in [4, 5, 8, 16, 33] {
            let rendering = kept(folder.path(), scene(sampler, samples)).unwrap();
            assert_eq!(rendering.report().samples, samples, "{sampler}");
            assert_eq!(planes(&rendering), fresh(scene(sampler, samples)), "{sampler}, {samples}");
        }
        // By now there are more than four.
        let error = kept(folder.path(), scene(sampler, 4)).unwrap_err().to_string();
        assert!(error.contains("samples a pixel, and 4 are asked for"), "{error}");
        assert!(error.contains("ask for as many or more, or remove it"), "{error}");
    }
    // Within a power of two these are of one set.
    let folder = tempfile::tempdir().unwrap();
    kept(folder.path(), scene("blue_noise", 12)).unwrap();
    let rendering = kept(folder.path(), scene("blue_noise", 14)).unwrap();
    assert_eq!(planes(&rendering), fresh(scene("blue_noise", 14)));
}

#[test]
fn samples_that_depend_on_their_number_are_not_gone_on_from() {
    let mut patterned = scene("sobol", 8);
    patterned["materials"]["clay"] = json!({"type": "checker", "squares": 9});
    for mut scene in
        [scene("stratified", 8), scene("hammersley", 8), scene("blue_noise", 8), patterned]
    {
        let folder = tempfile::tempdir().unwrap();
        kept(folder.path(), scene.clone()).unwrap();
        scene["render"]["samples"] = json!(16);
        let error = kept(folder.path(), scene.clone()).unwrap_err().to_string();
        assert!(error.contains("number of samples is"), "{scene}: {error}");
    }
    // Nor is another scene's.
    let folder = tempfile::tempdir().unwrap();
    kept(folder.path(), scene("sobol", 8)).unwrap();
    let mut other = scene("sobol", 16);
    other["materials"]["clay"]["color"] = json!([0.6, 0.5, 0.3]);
    let error = kept(folder.path(), other).unwrap_err().to_string();
    assert!(error.contains("its scene hash is"), "{error}");
}
