//! Memory that renders leave behind: a test program of its own, because memory is the process's.

use etendue::{Progress, Session};
use serde_json::json;

/// Private memory of this process (bytes), where the system tells.
fn private_memory() -> u64 {
    etendue_render::report::memory().1
}

#[test]
fn many_renders_keep_memory_flat() {
    // Allocators of several threads come and go by 7 MB on a busy machine; five kilobytes a render would be
    // 10 MB.
    keep_memory_flat([500, 2_000], 10 << 20);
}

/// Takes two minutes: `cargo nextest run -p etendue --run-ignored only ten_thousand`.
#[test]
#[ignore = "minutes"]
fn ten_thousand_renders_keep_memory_flat() {
    // Likewise; 1.2 kilobytes a render would be 10 MB.
    keep_memory_flat([1_000, 9_000], 10 << 20);
}

fn keep_memory_flat([first, then]: [u32; 2], most: u64) {
    let scene = json!({
        "tracer": {"type": "facing"}, "render": {"samples": 1}, "layers": ["depth"],
        "objects": [{"shape": "sphere"}, {"shape": "box"}],
        "camera": {"type": "thin_lens", "focal_length": "50 mm", "fov": 40, "f_number": 4,
                   "pose": {"from": [0, 0, 9], "look_at": [0, 0, 0]},
                   "sensor": {"resolution": [4, 4], "type": "raw"}}
    });
    let mut session = Session::from_json(".", scene).unwrap();
    let mut turn = |count: u32| {
        for i in 0..count {
            session.set("camera.f_number", 2 + i % 7).unwrap();
            session.set("objects[1].transform", json!({"translate": [i % 5, 0, 0]})).unwrap();
            // Other numbers each time: nothing may be kept of them.
            session.set("objects[0].radius", 1.0 + f64::from(i) * 1e-6).unwrap();
            session.render(&Progress::none()).unwrap();
        }
    };
    turn(first);
    let before = private_memory();
    turn(then);
    let after = private_memory();
    assert!(after < before + most, "{before} bytes before, {after} after");
}
