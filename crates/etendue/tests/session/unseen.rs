//! A session leaves out of its structure what the picture cannot see, and builds it for whoever looks elsewhere.

use etendue::{Progress, Session};
use etendue_geometry::{Detail, HitBatch, RayBatch, glam::DVec3};
use serde_json::json;

fn session(folder: &std::path::Path) -> Session {
    let scene = json!({
        "etendue": 1,
        "camera": { "type": "pinhole", "fov": 30, "sensor": { "resolution": [24, 18] },
            "pose": { "from": [0, 0, 3], "look_at": [0, 0, 0] } },
        "layers": ["depth"],
        "objects": [{ "shape": "sphere" },
            { "shape": "sphere", "transform": { "translate": [0, 0, 8] } }],
    });
    let path = folder.join("scene.json");
    std::fs::write(&path, scene.to_string()).unwrap();
    Session::open(&path).unwrap()
}

/// True if a ray from the camera backwards meets the ball that stands there, by its number.
fn behind(session: &mut Session) -> bool {
    let (_, accel) = session.scene_and_accel(&Progress::none()).unwrap();
    let mut rays = RayBatch::default();
    rays.push(DVec3::new(0.0, 0.0, 3.0), DVec3::Z);
    let mut hits = HitBatch::new(Detail::Distance);
    accel.closest(&rays, &mut hits);
    hits.is_hit(0)
}

#[test]
fn what_a_picture_cannot_see_is_there_for_other_rays() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = session(folder.path());
    let bytes = |session: &mut Session| {
        let done = session.render(&Progress::none()).unwrap();
        let report = done.report().clone();
        (report.bvh_bytes, report.triangles, report.image_hash)
    };
    let part = bytes(&mut session);
    assert!(behind(&mut session), "the structure lacks what is behind the camera");
    let whole = bytes(&mut session);
    assert!(part.0 < whole.0, "{part:?} {whole:?}");
    // What is told of the scene and the picture is the same.
    assert_eq!((part.1, &part.2), (whole.1, &whole.2));
    // A camera that turns round sees it.
    session.set("camera.pose.look_at", json!([0, 0, 9])).unwrap();
    let turned = bytes(&mut session);
    assert_ne!(turned.2, whole.2);
    let mut fresh = self::session(folder.path());
    fresh.set("camera.pose.look_at", json!([0, 0, 9])).unwrap();
    assert_eq!(bytes(&mut fresh).2, turned.2);
    // And one that turns round before anybody asked for all.
    let mut again = self::session(folder.path());
    bytes(&mut again);
    again.set("camera.pose.look_at", json!([0, 0, 9])).unwrap();
    assert_eq!(bytes(&mut again).2, turned.2);
}
