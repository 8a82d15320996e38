//! Bands that share paths have all their light in the outermost pixels, too: it comes along paths that start beside the
//! picture.

use etendue_camera::SharedPaths;
use etendue_spectrum::{Bands, Grid};
use serde_json::{Value, json};

use crate::band_paths::{COLUMNS, ROWS, light, scene};
use crate::steps::mean;

const SAMPLES: u32 = 64;
const SEEDS: u32 = 4;

/// The cemented achromat with a stop of 4 mm before it or behind, and a sensor of pixels of 20 µm to the right of and above the
/// axis. Before it, green light of a ray lands up to a pixel nearer to the axis than its blue and its red light; behind
/// it, up to a quarter farther off (secondary lateral colour).
fn achromat(is_before: bool) -> Value {
    let stop = |thickness: f64| json!({ "type": "aperture", "shape": "circular", "radius": 2, "thickness": thickness, "stop": true });
    let last = if is_before { 0 } else { 20 };
    let doublet = [
        json!({ "type": "surface", "radius": 62.8, "thickness": 4, "glass": "N-BK7", "semi_diameter": 12 }),
        json!({ "type": "surface", "radius": -45.7, "thickness": 2.5, "glass": "N-SF5", "semi_diameter": 12.7 }),
        json!({ "type": "surface", "radius": -128.2, "thickness": last, "semi_diameter": 12.7 }),
    ];
    let elements: Vec<Value> = match is_before {
        true => std::iter::once(stop(40.0)).chain(doublet).collect(),
        false => doublet.into_iter().chain([stop(1.0)]).collect(),
    };
    json!({ "type": "lens", "lens": { "elements": elements }, "focus_distance": 4, "sensor_height": 1.6,
            "sensor_decentre": [12, 9] })
}

/// The mean of the outermost columns and rows of a picture: left, right, top and bottom.
fn borders(values: &[f64]) -> [f64; 4] {
    let column = |x: usize| (0..ROWS).map(|y| values[y * COLUMNS + x]).collect::<Vec<_>>();
    let row = |y: usize| values[y * COLUMNS..(y + 1) * COLUMNS].to_vec();
    [column(0), column(COLUMNS - 1), row(0), row(ROWS - 1)].map(|border| mean(&border))
}

/// Under an even sky the outermost pixels are as bright as where each band is traced by itself, whichever way green light is
/// displaced, with a number of samples and with samples until an error. Two wavelengths are traced, at the ends of the
/// spectrum, so that green light of the outermost pixels comes along rays which start beside the picture.
///
/// The numbers of samples that land on a border vary by no more than if each fell by chance: by the root of their number,
/// of which four times is allowed.
#[test]
fn the_outermost_pixels_have_all_of_their_light() {
    let bands = Bands::Spectral(Grid::equal(400.0, 700.0, 3).unwrap());
    let until = json!({ "relative_error": 0.5, "min": SAMPLES, "max": 2 * SAMPLES });
    for (is_before, samples) in [(true, json!(SAMPLES)), (false, json!(SAMPLES)), (true, until)] {
        let of = |seed: u32, samples: &Value, shares: bool| {
            let more = json!({ "render": { "samples": samples, "seed": seed },
                               "accuracy": { "band_place_error": 0.1 } });
            let scene = scene(achromat(is_before), false, 1, &more);
            if !shares {
                let opened = scene.camera.opened(&bands).unwrap();
                let SharedPaths { traced, margin, .. } =
                    opened.lens().unwrap().opened_paths().unwrap();
                assert!(traced == 2 && margin > 0.2, "{traced} wavelengths, {margin} pixels");
            }
            light(&scene, &bands, shares)
        };
        let apart = of(SEEDS, &json!(SAMPLES), false);
        let shared: Vec<_> = (0..SEEDS).map(|seed| of(seed, &samples, true)).collect();
        for (band, apart) in apart.iter().enumerate() {
            let found = shared.iter().map(|bands| borders(&bands[band]));
            let found = found.fold([0.0; 4], |sums, of| std::array::from_fn(|k| sums[k] + of[k]));
            for (side, (sum, expected)) in found.into_iter().zip(borders(apart)).enumerate() {
                let off = sum / f64::from(SEEDS) / expected - 1.0;
                let pixels = if side < 2 { ROWS } else { COLUMNS };
                let noise = (f64::from(SEEDS * SAMPLES) * pixels as f64).sqrt().recip();
                println!("before {is_before}, band {band}, side {side}: {off:.2e} of {noise:.2e}");
                assert!(
                    off.abs() < 4.0 * noise,
                    "before {is_before}, {samples}, band {band}: {off}"
                );
            }
        }
    }
}
