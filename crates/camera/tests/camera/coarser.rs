//! A coarser grid of pixels is the same view: the same place has the same ray.

use etendue_camera::{Camera, CameraSpec};
use etendue_geometry::glam::DVec3;
use etendue_geometry::{Bounds, RayBatch};

fn camera(json: &str) -> Camera {
    let spec: CameraSpec = serde_json::from_str(json).unwrap_or_else(|e| panic!("{e}: {json}"));
    let bounds = Bounds { min: DVec3::splat(-1.0), max: DVec3::splat(1.0) };
    spec.build(|| bounds, &|name: &str| Err(format!("{name}: no files here"))).unwrap()
}

#[test]
fn places_keep_their_rays_on_coarser_pixels() {
    let cameras = [
        r#"{"type": "pinhole", "fov": 40, "sensor": {"resolution": [640, 481]}}"#,
        r#"{"type": "pinhole", "intrinsics": {"fx": 700, "fy": 680.5, "cx": 300.25, "cy": 260.75,
            "skew": 12.5, "pixel_origin": "center"}, "sensor": {"resolution": [640, 480]}}"#,
        r#"{"type": "pinhole", "intrinsics": {"fx": 700, "fy": 680, "cx": 300, "cy": 260,
            "pixel_origin": "corner"}, "distortion": {"type": "brown_conrady", "k1": -0.3},
            "sensor": {"resolution": [640, 480]}}"#,
        r#"{"type": "orthographic", "sensor": {"resolution": [640, 480]}}"#,
        r#"{"type": "thin_lens", "focal_length": 50, "f_number": 2, "focus_distance": 3,
            "sensor": {"resolution": [640, 480], "pixel_pitch": 20}}"#,
    ];
    for json in cameras {
        let fine = camera(json);
        let coarse = fine.coarser(3);
        assert_eq!(coarse.resolution(), fine.resolution().map(|side| side / 3), "{json}");
        let places = [[0.0, 0.0], [12.5, 77.25], [639.0, 3.0], [320.0, 470.0]];
        let [mut a, mut b] = [RayBatch::default(), RayBatch::default()];
        let [columns, rows] = [0, 1].map(|k| places.map(|place| place[k]));
        fine.rays_through(&columns, &rows, &mut a);
        coarse.rays_through(&columns.map(|x| x / 3.0), &rows.map(|y| y / 3.0), &mut b);
        for i in 0..places.len() {
            let apart =
                (a.direction(i) - b.direction(i)).length() + (a.origin(i) - b.origin(i)).length();
            // A few roundings of coordinates of about one.
            assert!(apart < 1e-13, "{json}: {apart:e}");
        }
    }
    assert_eq!(camera(cameras[0]).coarser(1000).resolution(), [1, 1]);
}
