//! Speed and memory of the window: how soon and how often there are pictures, and that memory
//! stays: `cargo test --release -p etendue-window measured -- --ignored --nocapture`.

use std::path::Path;
use std::time::{Duration, Instant};

use super::*;

/// Time for which the scene is turned.
const TURN: Duration = Duration::from_secs(5);

/// Number of changes that are waited for.
const CHANGES: usize = 15;

/// Opens a scene, turns it, and prints what was seen.
fn measure(path: &Path) {
    let start = Instant::now();
    let mut window = Driver::open(path);
    window.until("a first picture", |app| app.picture.is_some());
    let first = start.elapsed();
    window.settle();
    let whole = start.elapsed();
    let (start, mut shown, mut updates, mut frame) = (Instant::now(), 0, 0_u32, 0.0);
    while start.elapsed() < TURN {
        // A hand gives a new place sixty times a second.
        frame += 1.0;
        let viewpoint = window.app.viewpoint().unwrap().orbited([0.01, 0.0]);
        let ctx = window.ctx.clone();
        window.app.stand(&ctx, &viewpoint);
        while start.elapsed().as_secs_f64() < frame / 60.0 {
            window.step(Vec::new());
            let number = window.app.picture.as_ref().map_or(0, |picture| picture.number);
            updates += u32::from(number != shown);
            shown = number;
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    let rate = f64::from(updates) / start.elapsed().as_secs_f64();
    let size = window.app.picture.as_ref().unwrap().screen.size;
    let [still, busy] = [true, false].map(|is_settled| delays(&mut window, is_settled));
    println!(
        "{}: first picture after {:.2} s, whole after {:.2} s; {rate:.0} pictures a second while turned, of {} x {}; \
         from a change to its picture {still} at rest, {busy} while it renders",
        path.file_name().unwrap_or_default().display(),
        first.as_secs_f64(),
        whole.as_secs_f64(),
        size[0],
        size[1],
    );
}

/// The median and the longest time from a change of the camera to the first picture of it; of a picture
/// that is whole when it is changed, or is still being refined.
fn delays(window: &mut Driver, is_settled: bool) -> String {
    let mut delays: Vec<_> = (0..CHANGES)
        .map(|_| {
            let wait = Instant::now();
            match is_settled {
                true => window.settle(),
                // Refining has begun, as after a hand that rested for a moment.
                false => window.until("a while", |_| wait.elapsed() > Duration::from_millis(150)),
            }
            let viewpoint = window.app.viewpoint().unwrap().orbited([0.02, 0.0]);
            let ctx = window.ctx.clone();
            let before = window.app.picture.as_ref().map_or(0, |picture| picture.number);
            let start = Instant::now();
            window.app.stand(&ctx, &viewpoint);
            window.until("a picture of the change", |app| {
                app.picture.as_ref().is_some_and(|picture| picture.number > before)
            });
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    delays.sort_by(f64::total_cmp);
    format!("{:.0} ms (longest {:.0})", delays[CHANGES / 2], delays[CHANGES - 1])
}

#[test]
#[ignore = "measures, on a machine that does nothing else"]
fn measured_speed() {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    measure(&scenes.join("first-light.json"));
    measure(&scenes.join("double-gauss.json"));
    // A model with textures, of the reference data.
    if let Some(assets) = std::env::var_os("ETENDUE_ASSETS") {
        measure(&Path::new(&assets).join("data/gltf/Avocado/Avocado.gltf"));
    }
}

/// Pages of this process that are in memory.
#[cfg(target_os = "linux")]
fn resident() -> u64 {
    let statistics = fs::read_to_string("/proc/self/statm").unwrap();
    statistics.split_whitespace().nth(1).unwrap().parse().unwrap()
}

#[test]
#[cfg(target_os = "linux")]
#[ignore = "takes minutes"]
fn measured_memory_stays_over_ten_thousand_changes() {
    let folder = tempfile::tempdir().unwrap();
    let mut window = Driver::open(&scene_file(folder.path()));
    window.settle();
    let change = |window: &mut Driver, i: u32| {
        let ctx = window.ctx.clone();
        let opening = 1.4 + 0.001 * f64::from(i % 5000);
        window.app.edit(&ctx, &[Edit::set("camera.f_number", opening)]);
        window.time += 1.0;
        window.until("the wish is followed", |app| !app.is_behind());
    };
    (0..1000).for_each(|i| change(&mut window, i));
    let before = resident();
    (1000..11_000).for_each(|i| change(&mut window, i));
    let after = resident();
    println!("{before} pages after 1000 changes, {after} after 11 000");
    // A page a change would be ten thousand; allocators round and cache less than this.
    assert!(after < before + 2000, "{before} pages became {after}");
}
