//! Nanoseconds that one thread takes for a ray through a lens, for `benches/lens_peers.py`: the lens
//! file and the number of rounds; the rounds of every way, as JSON.
//!
//! ```sh
//! cargo run --release -p etendue-camera --example trace_lens -- scenes/lenses/double-gauss.json 9
//! ```
#![allow(clippy::disallowed_methods, reason = "an example reads what it is told to")]

use std::error::Error;
use std::hint::black_box;

use etendue_optics::element::{Clip, LensRays};
use etendue_optics::train::{LensFile, MonochromaticTrain, Part, Registers, Side};
use glam::{DVec2, DVec3};
use multiversion::multiversion;
use rustix::time::{ClockId, clock_gettime};

/// A tile's worth of rays.
const RAYS: u32 = 512;

/// Number of passes of the rays through the lens in a round.
const TIMES: u32 = 1000;

/// Radius of the beam (mm): inside of the double Gauss' entrance pupil at f/2.
const RADIUS: f64 = 10.0;

/// Parallel rays, 1° off the axis: as many in any place as Vogel's spiral has.
fn beam() -> LensRays {
    let mut rays = LensRays::with_capacity(RAYS as usize);
    for i in 0..RAYS {
        let r = RADIUS * ((f64::from(i) + 0.5) / f64::from(RAYS)).sqrt();
        let place = DVec2::from_angle(2.399_963_229_728_653 * f64::from(i)) * r;
        rays.push(place.extend(-10.0), DVec3::new(0.0, 0.02, 1.0));
    }
    rays
}

/// Two square roots and a division for each surface, which is what a sphere takes, and nothing else.
#[multiversion(targets = "simd")]
fn roots_and_divisions(values: &mut [[f64; 32]], surfaces: usize) {
    for block in values {
        for _ in 0..surfaces {
            for x in block.iter_mut() {
                let root = (*x + 1.5).sqrt();
                *x = root / (root + 1.25).sqrt();
            }
        }
    }
}

/// The processor time of this thread (s), which other processes disturb less than they do wall time.
fn thread_seconds() -> f64 {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [lens, rounds] = arguments.as_slice() else { return Err("expected LENS ROUNDS".into()) };
    let file = LensFile::from_json(&std::fs::read_to_string(lens)?)?;
    let train = file.build(&|name: &str| Err(format!("{name}: a lens of its own file alone")))?;
    let at = train.at(train.wavelength())?;
    let surfaces = train.elements().iter().filter(|e| matches!(e.part, Part::Surface(_))).count();
    let rays = beam();
    let mut check = rays.clone();
    at.trace(Side::Object, Clip::On, &mut check);
    if check.exited() != RAYS as usize {
        return Err("not every ray passes: the lens is too narrow for this beam".into());
    }
    let on = |registers| {
        move |at: &MonochromaticTrain, rays: &mut LensRays| {
            at.trace_on(registers, Side::Object, Clip::On, rays);
        }
    };
    let (mut work, mut numbers) = (rays.clone(), [[1.0; 32]; RAYS as usize / 32]);
    let mut times = serde_json::Map::new();
    for _ in 0..rounds.parse()? {
        let mut timed = |name: &str, run: &mut dyn FnMut()| {
            let start = thread_seconds();
            (0..TIMES).for_each(|_| run());
            let each = (thread_seconds() - start) * 1e9 / f64::from(TIMES * RAYS);
            let list = times.entry(name).or_insert_with(|| serde_json::json!([]));
            if let Some(list) = list.as_array_mut() {
                list.push(each.into());
            }
        };
        let mut through = |name: &str, trace: &dyn Fn(&MonochromaticTrain, &mut LensRays)| {
            timed(name, &mut || {
                work.clone_from(black_box(&rays));
                trace(&at, &mut work);
            });
        };
        through("widest", &on(Registers::Widest));
        through("four", &on(Registers::FourLanes));
        through("baseline", &on(Registers::Baseline));
        through("singly", &|at, rays| at.trace_singly(Side::Object, Clip::On, rays));
        through("copy", &|_, _| ());
        timed("roots", &mut || roots_and_divisions(black_box(&mut numbers), surfaces));
    }
    println!("{}", serde_json::json!({ "surfaces": surfaces, "ns": times }));
    Ok(())
}
