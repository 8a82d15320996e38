//! Seconds for a frame, for `benches/sensor_peers.py`: columns, rows, the light (`ramp`, from nothing
//! on the left to full scale on the right, or mean electrons all over), rounds and threads; the
//! rounds of exact Poisson noise and of its normal approximation, which take turns, as JSON.
//!
//! ```sh
//! cargo run --release -p etendue-sensor --example expose_frame -- 2736 1824 ramp 5 1
//! ```

use std::error::Error;
use std::time::Instant;

use etendue_sensor::{Exposure, Film, NoiseModel, Sensor};
use rayon::ThreadPoolBuilder;

/// Full scale (e⁻).
const FULL: f64 = 16_000.0;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [columns, rows, light, rounds, threads] = arguments.as_slice() else {
        return Err("expected COLUMNS ROWS LIGHT ROUNDS THREADS".into());
    };
    let (columns, rows, rounds): (u32, u32, u32) =
        (columns.parse()?, rows.parse()?, rounds.parse()?);
    let sensor = Sensor::new(&serde_json::from_value(serde_json::json!({
        "type": "raw", "resolution": [columns, rows], "system_gain": 4095.0 / FULL,
        "bit_depth": 12, "read_noise": 2.5, "dark_current": 1, "black_level": 0
    }))?)?;
    let row: Vec<f32> = if light == "ramp" {
        (0..columns).map(|x| x as f32 / columns as f32).collect()
    } else {
        #[expect(clippy::cast_possible_truncation, reason = "films hold f32")]
        let level = (light.parse::<f64>()? / FULL) as f32;
        vec![level; columns as usize]
    };
    let film = row.repeat(rows as usize);
    let pool = ThreadPoolBuilder::new().num_threads(threads.parse()?).build()?;
    let models = [NoiseModel::Poisson, NoiseModel::Normal];
    let sensors = models.map(|noise| sensor.clone().with_noise(noise));
    let mut seconds = [const { Vec::new() }; 2];
    // The first round, which touches the memory for the first time, does not count.
    for frame in 0..=rounds {
        for (sensor, seconds) in sensors.iter().zip(&mut seconds) {
            let start = Instant::now();
            let shot = Exposure { exposure: 0.01, frame };
            let image = pool.install(|| sensor.expose(Film { values: &film }, shot, 0))?;
            let taken = start.elapsed().as_secs_f64();
            assert_eq!(image.values.len(), film.len());
            if frame > 0 {
                seconds.push(taken);
            }
        }
    }
    let [poisson, normal] = seconds;
    println!("{}", serde_json::json!({ "poisson": poisson, "normal": normal }));
    Ok(())
}
