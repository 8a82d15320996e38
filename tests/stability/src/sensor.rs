//! The sensor, from no electron to more than it holds.

mod absorbing;
mod moments;
mod neutral;
mod spectral;

use anyhow::Result;
use etendue_sensor::{Exposure, Film, RawImage, Sensor, SensorSpec};
use serde_json::{Value, json};

use crate::{Case, Method, Outcome, Scale};

/// EMVA 1288.
pub const METHOD: Method = Method {
    name: "Sensor",
    cases: &[
        Case {
            name: "no_electrons",
            regime: "no light, no dark current, `poisson` and `normal`; and 4 e⁻ of read noise on a black \
                level of 0",
            must: "exactly black without read noise; with it, never below 0: half of the pixels are 0 and \
                the others are half a normal distribution",
            limit: None,
            run: no_electrons,
        },
        Case {
            name: "one_electron",
            regime: "one electron a pixel on average, K = 1",
            must: "0, 1, 2, … electrons as often as Poisson's e⁻¹/k!, each within 4.5 standard errors",
            limit: None,
            run: one_electron,
        },
        Case {
            name: "normal_at_one_electron",
            regime: "the same with `noise: normal`",
            must: "the shares of 0 and 1 electrons show that it is no Poisson distribution",
            limit: Some(
                "A normal distribution has no skewness and no floor. `noise: poisson` is the default; \
                 docs/measurements/sensors.md says from how many electrons on the other will do.",
            ),
            run: normal_at_one_electron,
        },
        Case {
            name: "saturation",
            regime: "light of 10⁹ times the full well, with and without noise; a well above and below the \
                converter's range",
            must: "exactly K times the full well plus black, or exactly 2ᵇ − 1: it never wraps",
            limit: None,
            run: saturation,
        },
        Case {
            name: "gain_near_zero",
            regime: "K = 10⁻⁹ DN/e⁻, up to 6·10¹³ electrons; and K = 10⁻³⁰⁰",
            must: "the mean is right to 4 standard errors or half a DN; what cannot be counted is refused \
                by its key",
            limit: None,
            run: gain_near_zero,
        },
        Case {
            name: "gain_huge",
            regime: "K = 10⁹ DN/e⁻ at half an electron a pixel",
            must: "every pixel is 0 or 65535; 0 as often as e^−½, within 4 standard errors",
            limit: None,
            run: gain_huge,
        },
        Case {
            name: "one_bit",
            regime: "a converter of one bit, K = 1",
            must: "1 exactly where there is an electron: 1 − e⁻ᵘ of the pixels, within 4 standard errors",
            limit: None,
            run: one_bit,
        },
        Case {
            name: "exposures",
            regime: "T of a nanosecond, a second and a day, 1000 e⁻/s of dark current",
            must: "the dark electrons are 10⁻⁶, 10³ and 8.64·10⁷ on average, within 4 standard errors; a \
                well of 10⁵ is full after a day, exactly; light grows as T to 10⁻⁶",
            limit: None,
            run: exposures,
        },
        Case {
            name: "coloured_light",
            regime: "physical radiometry under illuminant A, daylight and a 10 nm line; clear, ideal red, \
                green and blue pixels; white, pure colours and two of them one behind the other; \
                quantum efficiency as a number and as a curve",
            must: "in the bands that the plan chooses, electrons are those of a sum in steps of 0.1 nm to \
                0.1 % (of a tenth of white for pure colours, of white for two)",
            limit: None,
            run: spectral::coloured_light,
        },
        Case {
            name: "infrared",
            regime: "silicon of 300 to 1100 nm and of 700 to 960 nm, under equal energy, illuminant A and a \
                black body",
            must: "light beyond the visible is counted as within it, to 0.1 %; light that no pixel sees is \
                refused by a message that names both ranges",
            limit: None,
            run: spectral::infrared,
        },
        Case {
            name: "two_cameras",
            regime: "one seed, two serial numbers, two frames",
            must: "temporal noise is as unlike as chance has it (4.5 standard errors); frames of one serial \
                number share their pattern, other serial numbers do not",
            limit: None,
            run: two_cameras,
        },
        moments::MOMENTS,
        absorbing::ABSORBING,
        neutral::NEUTRAL,
    ],
};

/// Pearson's correlation of two images.
fn correlation(a: &RawImage, b: &RawImage) -> f64 {
    let (ma, mb) = (mean(a), mean(b));
    let pairs =
        || a.values.iter().zip(&b.values).map(|(x, y)| (f64::from(*x) - ma, f64::from(*y) - mb));
    let sum = |f: fn((f64, f64)) -> f64| pairs().map(f).sum::<f64>();
    sum(|(x, y)| x * y) / (sum(|(x, _)| x * x) * sum(|(_, y)| y * y)).sqrt()
}

fn two_cameras(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let frame = |serial: u32, dsnu: f64, number: u32| -> Result<RawImage> {
        let keys = json!({ "system_gain": 1.0, "black_level": 1000, "read_noise": 5.0, "dsnu": dsnu, "serial": serial });
        let sensor = sensor(side(scale), &keys)?;
        let [width, height] = sensor.resolution();
        #[expect(clippy::cast_possible_truncation, reason = "films hold f32")]
        let light = (400.0 / sensor.electrons_per_unit(0)[0]) as f32;
        let film = vec![light; (width * height) as usize];
        let shot = Exposure { exposure: 0.01, frame: number };
        Ok(sensor.expose(Film { values: &film }, shot, 7)?)
    };
    let one = frame(1, 0.0, 0)?;
    let chance = 4.5 / (one.values.len() as f64).sqrt();
    for (what, other) in [("serial number", frame(2, 0.0, 0)?), ("frame", frame(1, 0.0, 1)?)] {
        let found = correlation(&one, &other);
        outcome.must(found.abs() < chance, || format!("another {what} correlates by {found}"));
        outcome.measured(format!("temporal noise of another {what} correlates by {found:+.5}"));
    }
    let patterned = frame(1, 100.0, 0)?;
    let [same, other] =
        [frame(1, 100.0, 1)?, frame(2, 100.0, 0)?].map(|b| correlation(&patterned, &b));
    outcome.must(same > 0.9, || format!("frames share {same} of their pattern"));
    outcome.must(other.abs() < chance, || format!("patterns of two serial numbers: {other}"));
    outcome
        .measured(format!("with a DSNU of 100 e⁻, {same:.3} of one sensor and {other:+.5} of two"));
    Ok(outcome)
}

/// A monochrome sensor of `side` × `side` pixels with these keys besides the usual ones.
fn sensor(side: u32, keys: &Value) -> Result<Sensor> {
    let mut spec = json!({ "type": "raw", "resolution": [side, side], "noise": "poisson" });
    for (key, value) in keys.as_object().into_iter().flatten() {
        spec[key] = value.clone();
    }
    let spec: SensorSpec = serde_json::from_value(spec)?;
    Ok(Sensor::new(&spec)?)
}

/// A frame under even light of about `electrons` a pixel, and how many it is after rounding to the
/// film's f32.
fn even(sensor: &Sensor, electrons: f64, exposure: f64) -> Result<(RawImage, f64)> {
    let worth = sensor.electrons_per_unit(0)[0];
    #[expect(clippy::cast_possible_truncation, reason = "films hold f32")]
    let light = (electrons / worth) as f32;
    let [width, height] = sensor.resolution();
    let film = vec![light; (width * height) as usize];
    let image = sensor.expose(Film { values: &film }, Exposure { exposure, frame: 0 }, 7)?;
    Ok((image, f64::from(light) * worth))
}

fn share(image: &RawImage, of: impl Fn(u16) -> bool) -> f64 {
    image.values.iter().filter(|value| of(**value)).count() as f64 / image.values.len() as f64
}

fn mean(image: &RawImage) -> f64 {
    image.values.iter().map(|&v| f64::from(v)).sum::<f64>() / image.values.len() as f64
}

/// By how many standard errors a share of so many pixels is off.
fn errors_of_share(found: f64, expected: f64, pixels: usize) -> f64 {
    (found - expected) / (expected * (1.0 - expected) / pixels as f64).sqrt()
}

fn side(scale: Scale) -> u32 {
    scale.pick(300, 2_000)
}

fn no_electrons(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    for noise in ["poisson", "normal"] {
        let keys = json!({ "system_gain": 2.0, "black_level": 10, "noise": noise });
        let (image, _) = even(&sensor(side(scale), &keys)?, 0.0, 0.01)?;
        let other = image.values.iter().filter(|&&v| v != 10).count();
        outcome.must(other == 0, || format!("{noise}: {other} pixels are not black"));
    }
    outcome.measured("every pixel reads the black level");
    let keys = json!({ "system_gain": 1.0, "read_noise": 4.0 });
    let (image, _) = even(&sensor(side(scale), &keys)?, 0.0, 0.01)?;
    // Rounded to 0: below half a DN, an eighth of a standard deviation: Φ(1/8).
    let (zero, expected) = (share(&image, |v| v == 0), 0.549_738);
    let errors = errors_of_share(zero, expected, image.values.len());
    outcome.must(errors.abs() <= 4.0, || format!("{zero} of the pixels are 0"));
    let most = image.values.iter().max().copied().unwrap_or_default();
    outcome.must(most < 40, || format!("a pixel wraps to {most}"));
    outcome
        .measured(format!("with read noise {:.2} % read 0, {errors:+.1} errors off", 100.0 * zero));
    Ok(outcome)
}

fn one_electron(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let sensor = sensor(side(scale), &json!({ "system_gain": 1.0, "bit_depth": 8 }))?;
    let (image, electrons) = even(&sensor, 1.0, 0.01)?;
    let (mut expected, mut worst) = ((-electrons).exp(), 0.0_f64);
    for k in 0..=7_u16 {
        let found = share(&image, |v| v == k);
        worst = worst.max(errors_of_share(found, expected, image.values.len()).abs());
        expected *= electrons / f64::from(k + 1);
    }
    outcome.measured(format!("shares of 0 to 7 electrons at most {worst:.1} standard errors off"));
    // Eight shares, of which one is beyond 4.5 once in 20 000 times.
    outcome.must(worst <= 4.5, || format!("{worst} standard errors off"));
    Ok(outcome)
}

fn normal_at_one_electron(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let keys = json!({ "system_gain": 1.0, "bit_depth": 8, "noise": "normal" });
    let (image, _) = even(&sensor(side(scale), &keys)?, 1.0, 0.01)?;
    let [none, one] = [0, 1].map(|k| share(&image, |v| v == k));
    let poisson = (-1.0_f64).exp();
    outcome.measured(format!(
        "{:.1} % of the pixels have no electron and {:.1} % one; Poisson has {:.1} % of each",
        100.0 * none,
        100.0 * one,
        100.0 * poisson
    ));
    let apart = (none - poisson).abs().max((one - poisson).abs());
    outcome.must(apart > 0.01, || "it cannot be told from Poisson".to_owned());
    Ok(outcome)
}

fn saturation(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    for noise in ["poisson", "normal", "none"] {
        for (well, expected) in [(1000.0, 510_u16), (1e4, 4095)] {
            let keys = json!({
                "system_gain": 0.5, "bit_depth": 12, "black_level": 10, "full_well": well, "noise": noise,
            });
            let sensor = sensor(100, &keys)?;
            let (image, _) = even(&sensor, 1e9 * well, 0.01)?;
            let other = image.values.iter().filter(|&&v| v != expected).count();
            outcome.must(other == 0, || format!("{noise}, {well} e⁻: {:?}", &image.values[..4]));
        }
    }
    outcome.measured("every pixel reads 510 (a well of 1000 e⁻, K = ½, black 10) or 4095");
    Ok(outcome)
}

fn gain_near_zero(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let keys = json!({ "system_gain": 1e-9, "read_noise": 1e9 });
    for electrons in [1e12, 3e13, 6e13] {
        let (image, electrons) = even(&sensor(300, &keys)?, electrons, 0.01)?;
        // One DN of read noise hides the converter's steps.
        let spread = (1e-18 * electrons + 1.0 + 1.0 / 12.0).sqrt() / 300.0;
        let errors = (mean(&image) - 1e-9 * electrons) / spread;
        outcome.must(errors.abs() <= 4.0, || format!("{electrons:e} e⁻: {errors} errors off"));
        outcome.measured(format!("{electrons:.0e} e⁻: {errors:+.1} standard errors off"));
    }
    let refused = sensor(4, &json!({ "system_gain": 1e-300 }));
    let message = refused.err().map(|error| error.to_string()).unwrap_or_default();
    outcome.must(message.contains("sensor.system_gain"), || format!("10⁻³⁰⁰: \"{message}\""));
    outcome.measured(format!("“{message}”"));
    Ok(outcome)
}

fn gain_huge(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let sensor = sensor(side(scale), &json!({ "system_gain": 1e9, "full_well": 1e5 }))?;
    // A film of 1 is the converter's range of 6.6·10⁻⁵ electrons; half an electron is far beyond.
    let (image, electrons) = even(&sensor, 0.5, 0.01)?;
    let zero = share(&image, |v| v == 0);
    let between = share(&image, |v| v != 0 && v != 65_535);
    let errors = errors_of_share(zero, (-electrons).exp(), image.values.len());
    outcome.must(between == 0.0, || format!("{between} of the pixels are neither"));
    outcome.must(errors.abs() <= 4.0, || format!("{zero} of the pixels are 0"));
    outcome.measured(format!("{:.2} % read 0, {errors:+.1} standard errors off", 100.0 * zero));
    Ok(outcome)
}

fn one_bit(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let sensor = sensor(side(scale), &json!({ "system_gain": 1.0, "bit_depth": 1 }))?;
    for electrons in [0.01, 0.7, 5.0] {
        let (image, electrons) = even(&sensor, electrons, 0.01)?;
        let one = share(&image, |v| v == 1);
        let beyond = share(&image, |v| v > 1);
        let errors = errors_of_share(one, 1.0 - (-electrons).exp(), image.values.len());
        outcome.must(beyond == 0.0 && errors.abs() <= 4.0, || format!("{electrons} e⁻: {one}"));
        outcome.measured(format!("{electrons:.2} e⁻: {errors:+.1} standard errors off"));
    }
    Ok(outcome)
}

fn exposures(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let day = 86_400.0;
    for (seconds, gain) in [(1e-9, 1.0), (1.0, 1.0), (day, 5e-4)] {
        let keys = json!({ "system_gain": gain, "dark_current": 1000.0 });
        let (image, _) = even(&sensor(side(scale), &keys)?, 0.0, seconds)?;
        let dark = 1000.0 * seconds;
        // The converter's steps add 1/12 DN² where the noise does not hide within them.
        let steps = if gain < 1.0 { 1.0 / 12.0 } else { 0.0 };
        let spread = ((gain * gain * dark + steps) / image.values.len() as f64).sqrt();
        let errors = (mean(&image) - gain * dark) / spread;
        outcome.must(errors.abs() <= 4.0, || format!("{seconds:e} s: {errors} errors off"));
        outcome.measured(format!("{seconds:.0e} s: {errors:+.1} standard errors off"));
    }
    let keys = json!({ "system_gain": 0.5, "dark_current": 1000.0, "full_well": 1e5 });
    let (image, _) = even(&sensor(100, &keys)?, 0.0, day)?;
    let other = image.values.iter().filter(|&&v| v != 50_000).count();
    outcome.must(other == 0, || format!("{other} pixels are not full after a day"));
    let keys = json!({ "system_gain": 1.0, "radiometry": "physical", "noise": "none" });
    let sensor = sensor(1, &keys)?;
    let worth = sensor.electrons_per_unit(0)[0];
    for seconds in [1e-9, 1.0, day] {
        // As much light as makes 20 000 electrons in this time.
        #[expect(clippy::cast_possible_truncation, reason = "films hold f32")]
        let light = (2e4 / (worth * seconds)) as f32;
        let shot = Exposure { exposure: seconds, frame: 0 };
        let moments = sensor.moments(Film { values: &[light] }, shot)?;
        let expected = f64::from(light) * worth * seconds;
        let off = f64::from(moments.mean[0]) / expected - 1.0;
        outcome.must(off.abs() <= 1e-6, || format!("{seconds:e} s: light is {off:e} off"));
    }
    Ok(outcome)
}
