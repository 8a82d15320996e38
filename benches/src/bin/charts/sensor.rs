//! Exact Poisson noise against its normal approximation.

use std::cell::RefCell;

use etendue_bench::timing::{Turn, take_turns, wall};
use etendue_benches::effort::Effort;
use etendue_chart::{Axis, Chart, Mark, Point, Series};
use etendue_sensor::approximation::Deviation;
use etendue_sensor::{Exposure, Film, NoiseModel, Sensor};

use crate::page::Page;

/// Columns and rows that are exposed at a time.
const SIDES: [u32; 2] = [1024, 1024];

/// Electrons at full scale, and of read noise.
const FULL: f32 = 16_000.0;
const READ_NOISE: f64 = 2.0;

/// Mean electrons.
const MEANS: [f32; 5] = [1.0, 10.0, 100.0, 1_000.0, 10_000.0];

const ADVICE: &str = "\
    Pick `poisson`, the default, for anything that is to be measured in dim light. Pick `normal` to repeat what was made \
    with the approximation, or for series of bright frames when the time shown matters.";

pub(crate) fn measure(effort: Effort, page: &mut Page) -> anyhow::Result<()> {
    page.heading("Poisson noise and its normal approximation");
    page.paragraph(&format!(
        "Even light on a raw sensor of {READ_NOISE} e⁻ read noise, on all threads. The error is Kolmogorov's distance: \
         the largest difference of the two distribution functions of a pixel before the converter."
    ));
    let spec = serde_json::json!({
        "type": "raw", "resolution": SIDES, "system_gain": 4095.0 / f64::from(FULL), "bit_depth": 12,
        "read_noise": READ_NOISE, "exposure": 0.01
    });
    let exact = Sensor::new(&serde_json::from_value(spec)?)?;
    let pixels = SIDES[0] as usize * SIDES[1] as usize;
    let films = MEANS.map(|mean| vec![mean / FULL; pixels]);
    let fault = RefCell::new(None);
    let mut turns: Vec<Turn<'_>> = Vec::new();
    for noise in [NoiseModel::Poisson, NoiseModel::Normal] {
        for film in &films {
            let (sensor, fault) = (exact.clone().with_noise(noise), &fault);
            turns.push(Box::new(move || {
                let shot = Exposure { exposure: 0.01, frame: 0 };
                let (seconds, image) = wall(|| sensor.expose(Film { values: film }, shot, 0));
                if let Err(error) = image {
                    fault.borrow_mut().get_or_insert(error);
                }
                seconds
            }));
        }
    }
    let series = take_turns(effort.rounds(), &mut turns);
    drop(turns);
    if let Some(error) = fault.into_inner() {
        return Err(error.into());
    }
    let nanos: Vec<f64> = series.iter().map(|s| s.median() / pixels as f64 * 1e9).collect();
    let (poisson, normal) = nanos.split_at(MEANS.len());
    page.chart("noise", &chart(poisson, normal), ADVICE)?;
    let rows = MEANS.iter().zip(poisson).zip(normal).map(|((&mean, poisson), normal)| {
        let distance = Deviation::new(f64::from(mean), READ_NOISE).distance;
        vec![
            mean.to_string(),
            format!("{poisson:.2}"),
            format!("{normal:.2}"),
            format!("{distance:.5}"),
        ]
    });
    let titles =
        ["mean e⁻", "`poisson` (ns a pixel)", "`normal` (ns a pixel)", "distance of `normal`"];
    page.table(&titles, &rows.collect::<Vec<_>>());
    Ok(())
}

fn chart(poisson: &[f64], normal: &[f64]) -> Chart {
    let point = |at| Point { at, mark: Mark::Disk };
    let one = |name: String, colour, at| Series {
        name,
        points: vec![point(at)],
        colour,
        contends: true,
        ..Series::default()
    };
    let mut series = Vec::new();
    for ((&mean, &exact), &approximate) in MEANS.iter().zip(poisson).zip(normal) {
        let distance = Deviation::new(f64::from(mean), READ_NOISE).distance;
        series.push(one(format!("poisson, {mean} e⁻"), 0, [exact, 0.0]));
        series.push(one(format!("normal, {mean} e⁻"), 4, [approximate, distance]));
    }
    Chart {
        title: "Exposure noise: error against time".to_owned(),
        axes: [
            Axis::new("wall time a pixel (ns), all threads"),
            Axis::new("Kolmogorov's distance to the true distribution").with_zero("exact"),
        ],
        series,
        ..Chart::default()
    }
}
