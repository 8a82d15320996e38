//! Seconds that one thread takes for a frame, for `scripts/bench-sensor.sh`: columns, rows, the
//! electrons of the brightest column (the darkest has none) and how often; the least of those times,
//! as JSON.
//!
//! ```sh
//! cargo run --release -p etendue-sensor --example expose_frame -- 2736 1824 16000 5
//! ```

use std::error::Error;
use std::time::Instant;

use etendue_sensor::{Film, NoiseModel, Sensor, Shot};
use rayon::ThreadPoolBuilder;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [columns, rows, electrons, times] = arguments.as_slice() else {
        return Err("expected COLUMNS ROWS ELECTRONS TIMES".into());
    };
    let (columns, rows): (u32, u32) = (columns.parse()?, rows.parse()?);
    let (electrons, times): (f64, u32) = (electrons.parse()?, times.parse()?);
    let sensor = Sensor::new(&serde_json::from_value(serde_json::json!({
        "type": "raw", "resolution": [columns, rows], "system_gain": 4095.0 / electrons,
        "bit_depth": 12, "read_noise": 2.5, "dark_current": 1, "black_level": 0
    }))?)?;
    let film: Vec<f32> =
        (0..rows).flat_map(|_| (0..columns).map(|x| x as f32 / columns as f32)).collect();
    let pool = ThreadPoolBuilder::new().num_threads(1).build()?;
    let seconds = |noise| -> Result<f64, Box<dyn Error>> {
        let sensor = sensor.clone().with_noise(noise);
        let mut least = f64::INFINITY;
        for frame in 0..times {
            let start = Instant::now();
            let shot = Shot { exposure: 0.01, frame };
            let image = pool.install(|| sensor.expose(Film { values: &film }, shot, 0))?;
            least = least.min(start.elapsed().as_secs_f64());
            assert_eq!(image.values.len(), film.len());
        }
        Ok(least)
    };
    let (poisson, normal) = (seconds(NoiseModel::Poisson)?, seconds(NoiseModel::Normal)?);
    println!("{}", serde_json::json!({ "poisson": poisson, "normal": normal }));
    Ok(())
}
