//! Models of a lens agree with it in what they keep: the scale and centre of the picture, the plane in
//! focus, the pupil.

use std::path::{Path, PathBuf};

use etendue_bench::cameras::models;
use etendue_camera::CameraSpec;
use etendue_geometry::{Bounds, RayBatch};

#[test]
fn models_keep_pupil_focus_and_chief_rays() {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let resolve = |name: &str| -> Result<PathBuf, String> { Ok(scenes.join(name)) };
    for (lens, f_number) in [
        ("lenses/double-gauss.json", 2.8),
        ("lenses/cooke-triplet.json", 5.6),
        ("lenses/telephoto.json", 8.0),
    ] {
        let json = format!(
            r#"{{"type": "lens", "lens": "{lens}", "f_number": {f_number}, "focus_distance": 3,
                "sensor_height": 10, "sensor_decentre": [1, 0.5],
                "pose": {{"from": [1, 2, 3], "look_at": [0, 0, 0]}},
                "sensor": {{"resolution": [60, 40]}}}}"#
        );
        let spec: CameraSpec = serde_json::from_str(&json).unwrap();
        let full = spec.build(|| Bounds::EMPTY, &resolve).unwrap();
        let (models, notes) = models(&full).unwrap();
        let names: Vec<&str> = models.iter().map(|(name, _)| *name).collect();
        assert_eq!(names, ["pinhole", "thin", "thick", "full"], "{lens}: {notes:?}");
        let chief = |camera: &etendue_camera::Camera, column: f64, row: f64| {
            let mut rays = RayBatch::default();
            camera.rays_through(&[column], &[row], &mut rays);
            (rays.origin(0), rays.direction(0))
        };
        for (name, model) in &models {
            if let (Some(model), Some(full)) = (model.lens(), full.lens()) {
                let [a, b] = [model, full].map(|lens| lens.focused().object_distance());
                assert!((a / b - 1.0).abs() < 1e-9, "{lens} {name}: in focus {a} m for {b} m");
                let [a, b] = [model, full]
                    .map(|lens| lens.focused().paraxial().entrance_pupil.diameter.unwrap());
                assert!((a / b - 1.0).abs() < 1e-9, "{lens} {name}: pupil {a} mm for {b} mm");
            }
            // 3 pixels from the axis, which is 1 mm and 0.5 mm from the middle; distortion there is
            // of the third order: (3/120)³ of the slope at most.
            let (columns, rows) = (30.0 + 1.0 / 0.25, 20.0 - 0.5 / 0.25);
            let (_, own) = chief(model, columns + 3.0, rows + 1.0);
            let (_, real) = chief(&full, columns + 3.0, rows + 1.0);
            assert!((own - real).length() < 1e-4, "{lens} {name}: {own} {real}");
        }
    }
}
