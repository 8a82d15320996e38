//! The bands that a sensor chooses count its electrons as an integration in steps of a nanometre
//! does, which is done here by a plain sum.

use etendue_sensor::bands::TOLERANCE;
use etendue_sensor::{Factor, Illumination, Sensor, SensorSpec, Times};
use etendue_spectrum::{Bands, Curve, Illuminant, Outside, rgb};
use serde_json::{Value, json};

/// A channel's share of photons that become electrons, by wavelength (nm).
type Channel<'a> = &'a dyn Fn(f64) -> f64;

/// Keys of a sensor, lights, a filter, how many colours, channels and their wavelengths (nm).
type Trial<'a> = (Value, Vec<&'a Curve>, &'a Curve, usize, Vec<Channel<'a>>, [f64; 2]);

const HC: f64 = 6.626_070_15e-34 * 299_792_458.0;

fn sensor(keys: &Value) -> Sensor {
    let mut spec = json!({ "type": "raw", "radiometry": "physical", "system_gain": 1.0, "pixel_pitch": 1000.0 });
    for (key, value) in keys.as_object().unwrap() {
        spec[key] = value.clone();
    }
    let spec: SensorSpec = serde_json::from_value(spec).unwrap_or_else(|e| panic!("{keys}: {e}"));
    Sensor::new(&spec).unwrap_or_else(|e| panic!("{keys}: {e}"))
}

fn curve(illuminant: Illuminant) -> Curve {
    illuminant.curve().unwrap()
}

/// Electrons a second of light through filter and colours on a channel, in steps of 0.25 nm: for
/// flat quantum efficiencies 380 to 780 nm, else 200 to 2600.
fn summed(
    [light, filter]: [&Curve; 2],
    colours: &[usize],
    channel: &dyn Fn(f64) -> f64,
    [from, to]: [f64; 2],
) -> f64 {
    let step = 0.25;
    let mut sum = 0.0;
    let mut nm = from + 0.5 * step;
    while nm < to {
        let colour: f64 = colours.iter().map(|&k| rgb::PRIMARIES[k].held(nm)).product();
        let passed = filter.held(nm) * light.at(nm).unwrap_or(0.0) * colour;
        sum += passed * channel(nm) * nm * 1e-9 / HC * step;
        nm += step;
    }
    // The pixel is a square millimetre.
    sum * 1e-6
}

/// Electrons as a render would count them.
fn rendered(lit: &Sensor, channel: usize, [light, filter]: [&Curve; 2], colours: &[usize]) -> f64 {
    let bands = lit.bands();
    let light = bands.from_curve(light, Outside::Zero).unwrap();
    let filter = bands.from_curve(filter, Outside::Held).unwrap();
    let rows = bands.from_rgb();
    let electrons = lit.electrons_per_unit(channel).iter().enumerate();
    electrons
        .map(|(i, e)| {
            e * light[i] * filter[i] * colours.iter().map(|&k| rows[i][k]).product::<f64>()
        })
        .sum()
}

fn colours(count: usize) -> Vec<Vec<usize>> {
    let mut all = vec![vec![]];
    if count > 0 {
        all.extend((0..3).map(|k| vec![k]));
    }
    if count > 1 {
        all.extend((0..3).flat_map(|i| (i..3).map(move |k| vec![i, k])));
    }
    all
}

#[test]
fn electrons_are_those_of_an_integration_by_the_nanometre() {
    let silicon =
        json!([[300, 0.05], [400, 0.4], [530, 0.84], [700, 0.6], [1000, 0.08], [1100, 0]]);
    let qe: Curve = serde_json::from_value(silicon.clone()).unwrap();
    let line = Curve::sampled(vec![
        [300.0, 0.0],
        [589.0, 0.0],
        [590.0, 0.9],
        [600.0, 0.9],
        [601.0, 0.0],
        [1100.0, 0.0],
    ])
    .unwrap();
    let one = Curve::ONE;
    let visible = [380.0, 780.0];
    let (a, d65) = (curve(Illuminant::A), curve(Illuminant::D65));
    let clear = |_: f64| 1.0;
    let primary = |k: usize| move |nm: f64| rgb::PRIMARIES[k].at(nm).unwrap_or(0.0);
    let (red, green, blue) = (primary(0), primary(1), primary(2));
    let of_silicon = |nm: f64| qe.at(nm).unwrap_or(0.0);
    let narrow = Curve::sampled(vec![[584.0, 0.0], [589.0, 1.0], [594.0, 0.0]]).unwrap();
    let rgbw: Vec<Channel<'_>> = vec![&red, &green, &blue, &clear];
    let cases: [Trial<'_>; 10] = [
        (json!({ "cfa": "rgbw" }), vec![&narrow], &one, 2, rgbw, visible),
        (json!({ "cfa": "rgbw" }), vec![&a], &one, 0, vec![&red, &green, &blue, &clear], visible),
        (json!({ "cfa": "rgbw" }), vec![&a], &one, 2, vec![&red, &green, &blue, &clear], visible),
        (json!({}), vec![&d65], &one, 2, vec![&clear], visible),
        (json!({}), vec![&one], &one, 2, vec![&clear], visible),
        (json!({}), vec![&one], &line, 1, vec![&clear], visible),
        (
            json!({ "quantum_efficiency": silicon }),
            vec![&a],
            &one,
            2,
            vec![&of_silicon],
            [300.0, 1100.0],
        ),
        (
            json!({ "quantum_efficiency": silicon }),
            vec![&a, &d65, &one],
            &one,
            1,
            vec![&of_silicon],
            [300.0, 1100.0],
        ),
        (
            json!({ "type": "rgb", "quantum_efficiency": [[380, 1], [780, 1]] }),
            vec![&a],
            &one,
            2,
            vec![&red, &green, &blue],
            visible,
        ),
        (
            json!({ "quantum_efficiency": silicon, "cfa": "rggb" }),
            vec![&a, &one],
            &one,
            2,
            vec![],
            visible,
        ),
    ];
    for trial in cases {
        check(trial);
    }
}

/// Chooses bands for a trial and compares every light and colour in every channel.
fn check((keys, lights, filter, colored, channels, range): Trial<'_>) {
    let own = sensor(&keys);
    let illumination = Illumination {
        spectra: lights.iter().copied().cloned().collect(),
        filters: if *filter == Curve::ONE { vec![] } else { vec![filter.clone()] },
        colored,
        ..Illumination::default()
    };
    let chosen = own.bands_under(&illumination, TOLERANCE).unwrap();
    let error = chosen.error.unwrap();
    println!(
        "{keys} {} lights, {colored} colours: {} bands, {error:.1e}",
        lights.len(),
        chosen.bands.count()
    );
    assert!(error <= TOLERANCE, "{keys}: {error}");
    let lit = own.clone().in_bands(chosen.bands).unwrap();
    for (c, channel) in channels.iter().enumerate() {
        for light in &lights {
            let white = summed([light, filter], &[], *channel, range);
            for colours in colours(colored) {
                let exact = summed([light, filter], &colours, *channel, range);
                let found = rendered(&lit, c, [light, filter], &colours);
                // The promise, and what steps of a quarter of a nanometre lose at edges of filters.
                let dark = [1.0, 0.1, 1.0][colours.len()];
                let within = 1.05 * TOLERANCE * exact.max(dark * white) + 1e-4 * exact;
                assert!(
                    (found - exact).abs() <= within,
                    "{keys} channel {c} {colours:?}: {found} {exact}"
                );
            }
        }
    }
}

#[test]
fn one_light_on_grey_takes_one_band_whatever_the_sensor() {
    let silicon = json!([[350, 0.1], [530, 0.8], [1000, 0.05]]);
    let own = sensor(&json!({ "quantum_efficiency": silicon }));
    let lit = |spectra: Vec<Curve>| Illumination { spectra, ..Illumination::default() };
    let chosen =
        own.bands_under(&lit(vec![curve(Illuminant::BlackBody(3200.0))]), TOLERANCE).unwrap();
    assert_eq!(chosen.bands.count(), 1);
    assert!(chosen.error.unwrap() < 1e-12);
    assert_eq!(chosen.bands.range(), [350.0, 1000.0]);
    // Daylight is known up to 830 nm.
    let chosen = own.bands_under(&lit(vec![curve(Illuminant::D65)]), TOLERANCE).unwrap();
    assert_eq!(chosen.bands.range(), [350.0, 830.0]);
}

#[test]
fn a_greater_tolerance_takes_fewer_bands_and_keeps_to_it() {
    let light = Illumination {
        spectra: vec![curve(Illuminant::D65)],
        colored: 2,
        ..Illumination::default()
    };
    let own = sensor(&json!({ "quantum_efficiency": [[400, 0.3], [550, 0.8], [700, 0.2]] }));
    let counts = [1e-4, TOLERANCE, 1e-2].map(|tolerance| {
        let chosen = own.bands_under(&light, tolerance).unwrap();
        assert!(chosen.error.unwrap() <= tolerance, "{chosen:?}");
        chosen.bands.count()
    });
    assert!(counts[0] > counts[1] && counts[1] > counts[2], "{counts:?}");
}

#[test]
fn bands_that_somebody_asked_for_stay_and_their_error_is_told() {
    let bands = json!({ "from": 400, "to": 700, "count": 6 });
    let spectra = vec![curve(Illuminant::A)];
    let light = Illumination { spectra, colored: 2, ..Illumination::default() };
    let coarse = sensor(&json!({ "bands": bands })).bands_under(&light, TOLERANCE).unwrap();
    assert_eq!(coarse.bands.count(), 6);
    assert!(coarse.error.unwrap() > TOLERANCE, "{coarse:?}");
    // The channels of a multispectral sensor are divided, and end where they are to end.
    let own = sensor(&json!({ "type": "multispectral", "bands": bands }));
    let chosen = own.bands_under(&light, TOLERANCE).unwrap();
    let edges = chosen.bands.grid().unwrap().edges().to_vec();
    assert!(edges.len() > 7 && (0..=6).all(|i| edges.contains(&(400.0 + 50.0 * f64::from(i)))));
    let error = chosen.error.unwrap();
    assert!(error <= TOLERANCE, "{error} in {} bands", edges.len() - 1);
    let lit = own.clone().in_bands(chosen.bands).unwrap();
    assert_eq!(
        lit.channels().collect::<Vec<_>>(),
        ["425nm", "475nm", "525nm", "575nm", "625nm", "675nm"]
    );
    let a = curve(Illuminant::A);
    for (c, from) in [400.0, 450.0, 500.0, 550.0, 600.0, 650.0].into_iter().enumerate() {
        let exact = summed([&a, &Curve::ONE], &[], &|_| 1.0, [from, from + 50.0]);
        let found = rendered(&lit, c, [&a, &Curve::ONE], &[]);
        // Bands of 50 nm that knew nothing of the light were 1.7 % off.
        assert!((found / exact - 1.0).abs() < 1e-5, "{c}: {found} {exact}");
    }
}

#[test]
fn infrared_alone_is_seen_and_where_it_cannot_be_the_remedy_is_named() {
    let own = sensor(&json!({ "quantum_efficiency": [[900, 0.5], [1000, 0.5]] }));
    let lit =
        |illuminant| Illumination { spectra: vec![curve(illuminant)], ..Illumination::default() };
    assert_eq!(
        own.bands_under(&lit(Illuminant::A), TOLERANCE).unwrap().bands.range(),
        [900.0, 1000.0]
    );
    let error = own.bands_under(&lit(Illuminant::D65), TOLERANCE).unwrap_err().to_string();
    for word in ["900..=1000 nm", "300..=830 nm", "black_body"] {
        assert!(error.contains(word), "{error}");
    }
    let spec =
        json!({ "type": "raw", "cfa": "rggb", "quantum_efficiency": [[900, 0.5], [1000, 0.5]] });
    let error = Sensor::new(&serde_json::from_value(spec).unwrap()).unwrap_err().to_string();
    assert!(error.contains("ideal r, g and b pass visible light alone"), "{error}");
    assert!(matches!(own.bands(), Bands::Spectral(_)));
}

/// Bodies of any length take what an integration says: what they leave of light after ways of any
/// length, in every channel of a sensor: within what is promised down to a fiftieth of the light,
/// and a little more down to three thousandths.
#[test]
fn bodies_of_any_length_take_what_an_integration_says() {
    let silicon =
        json!([[380, 0.3], [450, 0.6], [530, 0.72], [600, 0.66], [700, 0.45], [780, 0.3]]);
    let efficiency: Curve = serde_json::from_value(silicon.clone()).unwrap();
    let primary = |k: usize| move |nm: f64| rgb::PRIMARIES[k].at(nm).unwrap_or(0.0);
    let (red, green, blue) = (primary(0), primary(1), primary(2));
    let all = |_: f64| 1.0;
    let channels: [Channel<'_>; 4] = [&red, &green, &blue, &all];
    // Simpson's rule in steps of half a nanometre, at whose ends are the knots of all curves.
    let nodes: Vec<f64> = (0..=1600).map(|k| 380.0 + 0.25 * f64::from(k)).collect();
    let weights = (0..=1600).map(|k| match k {
        0 | 1600 => 0.25 / 3.0,
        k if k % 2 == 1 => 1.0 / 3.0,
        _ => 0.5 / 3.0,
    });
    let weights: Vec<f64> = weights.collect();
    let sensors = [
        (json!({ "quantum_efficiency": silicon }), Illuminant::A, &channels[3..]),
        (json!({ "quantum_efficiency": silicon, "cfa": "rgbw" }), Illuminant::D65, &channels[..]),
    ];
    for (keys, light, channels) in sensors {
        let (own, light) = (sensor(&keys), curve(light));
        for color in [[0.9, 0.5, 0.3], [0.2, 0.6, 0.95], [0.97, 0.99, 0.9], [0.6, 0.9, 0.7]] {
            let body = rgb::spectrum(color);
            let factor = Factor { curve: body.clone(), times: Times::AnyPower };
            let illumination = Illumination {
                spectra: vec![light.clone()],
                factors: vec![factor],
                ..Illumination::default()
            };
            let chosen = own.bands_under(&illumination, TOLERANCE).unwrap();
            let count = chosen.bands.count();
            let lit = own.clone().in_bands(chosen.bands).unwrap();
            let passed: Vec<f64> = nodes.iter().map(|&nm| body.held(nm)).collect();
            // Down to a fiftieth of the light, and to three thousandths.
            let mut worst = [0.0_f64; 2];
            for (c, channel) in channels.iter().enumerate() {
                let seen =
                    |nm: f64| light.at(nm).unwrap_or(0.0) * channel(nm) * efficiency.held(nm);
                let electrons =
                    nodes.iter().zip(&weights).map(|(&nm, weight)| weight * seen(nm) * nm);
                let electrons: Vec<f64> = electrons.collect();
                let exact = |power: f64| -> f64 {
                    electrons.iter().zip(&passed).map(|(e, left)| e * left.powf(power)).sum()
                };
                let counted = |power: f64| counted(&lit, c, &light, &body, power);
                // The counts' unit is that of what no body takes from.
                let [white, unit] = [exact(0.0), counted(0.0)];
                let powers = (0..200).map(|k| 1e-3 * 1.1_f64.powi(k));
                for power in powers {
                    let left = exact(power) / white;
                    let off = (counted(power) / unit / left - 1.0).abs();
                    for (worst, least) in worst.iter_mut().zip([0.02, 0.003]) {
                        *worst = if left >= least { worst.max(off) } else { *worst };
                    }
                }
            }
            println!("{keys} {color:?}: {count} bands, {worst:?}");
            assert!(worst[0] <= TOLERANCE, "{keys} {color:?}: {worst:?}");
            assert!(worst[1] <= 1.5 * TOLERANCE, "{keys} {color:?}: {worst:?}");
        }
    }
}

/// The electrons of a channel as a render would count what a body leaves after a way.
fn counted(lit: &Sensor, channel: usize, light: &Curve, body: &Curve, power: f64) -> f64 {
    let light = lit.bands().from_curve(light, Outside::Zero).unwrap();
    let body = lit.bands().from_curve(body, Outside::Held).unwrap();
    let electrons = lit.electrons_per_unit(channel).iter();
    electrons.zip(light).zip(body).map(|((e, light), body)| e * light * body.powf(power)).sum()
}
