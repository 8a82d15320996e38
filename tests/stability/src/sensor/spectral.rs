//! Light of many wavelengths in few numbers.

use anyhow::{Context, Result};
use etendue_sensor::bands::TOLERANCE;
use etendue_sensor::{Illumination, Sensor, SensorSpec};
use etendue_spectrum::{Curve, Illuminant, Outside, PLANCK, SPEED_OF_LIGHT, rgb};
use serde_json::{Value, json};

use crate::{Outcome, Scale};

/// A channel's share of photons that become electrons, by wavelength (nm).
type Channel<'a> = &'a dyn Fn(f64) -> f64;

/// A sensor of pixels of a square millimetre that counts photons.
fn counting(keys: &Value) -> Result<Sensor> {
    let mut spec = json!({
        "type": "raw", "radiometry": "physical", "system_gain": 1.0, "pixel_pitch": 1000.0,
    });
    for (key, value) in keys.as_object().into_iter().flatten() {
        spec[key] = value.clone();
    }
    let spec: SensorSpec = serde_json::from_value(spec)?;
    Ok(Sensor::new(&spec)?)
}

/// Electrons a second, by midpoints of steps.
fn summed(
    light: &Curve,
    colours: &[usize],
    channel: Channel<'_>,
    range: [u32; 2],
    step: f64,
) -> f64 {
    let [from, to] = range.map(f64::from);
    let mut sum = 0.0;
    let mut nm = from + 0.5 * step;
    while nm < to {
        let colour: f64 = colours.iter().map(|&k| rgb::PRIMARIES[k].held(nm)).product();
        sum += light.at(nm).unwrap_or(0.0) * colour * channel(nm) * nm;
        nm += step;
    }
    1e-15 * sum * step / (PLANCK * SPEED_OF_LIGHT)
}

/// Electrons a second as a render adds them up in bands.
fn in_bands(sensor: &Sensor, channel: usize, light: &Curve, colours: &[usize]) -> Result<f64> {
    let bands = sensor.bands();
    let (light, rows) = (bands.from_curve(light, Outside::Zero)?, bands.from_rgb());
    let electrons = sensor.electrons_per_unit(channel).iter().zip(light).zip(rows);
    let colour = |row: [f64; 3]| colours.iter().map(|&k| row[k]).product::<f64>();
    Ok(electrons.map(|((e, light), row)| e * light * colour(row)).sum())
}

/// The worst error of a sensor's channels under one light, as a part of what is promised to be small,
/// and how many bands it took.
fn worst(
    keys: &Value,
    light: &Curve,
    channels: &[Channel<'_>],
    range: [u32; 2],
) -> Result<(f64, usize)> {
    let own = counting(keys)?;
    let spectra = vec![light.clone()];
    let bands = own
        .bands_under(&Illumination { spectra, colored: 2, ..Illumination::default() }, TOLERANCE)?
        .bands;
    let count = bands.count();
    let sensor = own.in_bands(bands)?;
    // Fine beside a line of 10 nm: in steps of 0.5 nm the sum itself is 0.03 % off.
    let step = 0.1;
    let pairs = (0..3).flat_map(|i| (i..3).map(move |k| vec![i, k]));
    let colours: Vec<Vec<usize>> =
        std::iter::once(vec![]).chain((0..3).map(|k| vec![k])).chain(pairs).collect();
    let mut worst = 0.0_f64;
    for (c, channel) in channels.iter().enumerate() {
        let white = summed(light, &[], *channel, range, step);
        for colours in &colours {
            let exact = summed(light, colours, *channel, range, step);
            let part = [1.0, 0.1, 1.0][colours.len()];
            let off = in_bands(&sensor, c, light, colours)? - exact;
            worst = worst.max(off.abs() / exact.max(part * white));
        }
    }
    Ok((worst, count))
}

/// Error that is promised, and what the sums' own steps may add to it.
const LIMIT: f64 = 1.1e-3;

pub(super) fn coloured_light(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let primary = |k: usize| move |nm: f64| rgb::PRIMARIES[k].at(nm).unwrap_or(0.0);
    let (red, green, blue) = (primary(0), primary(1), primary(2));
    let clear = |_: f64| 1.0;
    let colours: &[Channel<'_>] = &[&red, &green, &blue, &clear];
    let line = vec![[584.0, 0.0], [589.0, 1.0], [594.0, 0.0]];
    for (name, light) in [
        ("A", Illuminant::A.curve()?),
        ("D65", Illuminant::D65.curve()?),
        ("a line of 10 nm", Curve::sampled(line)?),
    ] {
        for keys in [
            json!({ "cfa": "rgbw" }),
            json!({ "cfa": "rgbw", "quantum_efficiency": [[380, 1], [780, 1]] }),
        ] {
            let (off, bands) = worst(&keys, &light, colours, [380, 780])?;
            outcome.must(off <= LIMIT, || format!("{name}, {keys}: {off}"));
            outcome.measured(format!("{name}: {:.3} % in {bands} bands", 100.0 * off));
        }
    }
    Ok(outcome)
}

pub(super) fn infrared(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let silicon = json!([[300, 0.1], [550, 0.8], [900, 0.2], [1100, 0]]);
    let near = json!([[700, 0.3], [960, 0.6]]);
    for (curve, range) in [(silicon, [300, 1100]), (near, [700, 960])] {
        let keys = json!({ "quantum_efficiency": curve });
        let efficiency: Curve = serde_json::from_value(curve)?;
        let seen = |nm: f64| efficiency.at(nm).unwrap_or(0.0);
        for (name, light) in [
            ("equal energy", Curve::ONE),
            ("A", Illuminant::A.curve()?),
            ("3200 K", Illuminant::BlackBody(3200.0).curve()?),
        ] {
            let (off, bands) = worst(&keys, &light, &[&seen], range)?;
            outcome.must(off <= LIMIT, || format!("{name}, {range:?}: {off}"));
            let all = summed(&light, &[], &seen, range, 0.5);
            let visible = summed(&light, &[], &seen, [range[0].max(380), range[1].min(780)], 0.5);
            outcome.measured(format!(
                "{name} on {} to {} nm: {:.3} % off in {bands} bands ({:.0} % of it visible)",
                range[0],
                range[1],
                100.0 * off,
                100.0 * visible / all
            ));
        }
    }
    let blind = counting(&json!({ "quantum_efficiency": [[900, 0.3], [1000, 0.3]] }))?;
    let spectra = vec![Illuminant::D65.curve()?];
    let light = Illumination { spectra, ..Illumination::default() };
    let error =
        blind.bands_under(&light, TOLERANCE).err().context("daylight in the dark is accepted")?;
    let message = error.to_string();
    let named = message.contains("900..=1000 nm") && message.contains("300..=830 nm");
    outcome.must(named, || format!("\"{message}\""));
    Ok(outcome)
}
