//! Notes for the user on an exposure: how much of it is saturated or black, and what would mend it.

use etendue_sensor::{EXPOSURES, Exposure, Film, Radiometry, RawImage, Sensor};

use crate::losses::{CLIPPED, Losses};

/// Standard deviations of the dark noise within which a pixel tells nothing from black or from
/// saturation: of 10⁸ pixels less than one is further off by chance.
const SIGMAS: f64 = 6.0;

/// Sentences on an image much of which is saturated, or black where light falls.
pub(super) fn on(sensor: &Sensor, film: Film<'_>, image: &RawImage, shot: Exposure) -> Vec<String> {
    let gain = sensor.system_gain();
    let dark = gain * sensor.dark_current() * shot.exposure;
    let [_, dsnu] = sensor.non_uniformity();
    let noise = SIGMAS * gain * sensor.dark_noise(shot.exposure).hypot(dsnu) + 0.5;
    let top = sensor.saturation_level();
    // Behind a full well there is noise of the read-out; at the converter's end there is none.
    let is_saturated =
        |&y: &u16| f64::from(y) >= if top < sensor.white_level() { top - noise } else { top };
    let is_black = |&y: &u16| f64::from(y) <= sensor.black_level() + dark + noise;
    let pixels = || image.values.chunks_exact(image.depth.max(1));
    let saturated = Losses::count(pixels().map(|channels| channels.iter().any(is_saturated)));
    // A pixel without light is black as it should be; an image without any light is not.
    let is_lit = |light: &[f32]| light.iter().any(|&value| value > 0.0 && value.is_finite());
    let lit = || film.values.chunks_exact(sensor.bands().count()).map(is_lit);
    let is_any_lit = lit().any(|is_lit| is_lit);
    let seen = pixels().zip(lit()).filter(|&(_, is_lit)| is_lit || !is_any_lit);
    let black = Losses::count(seen.map(|(channels, _)| channels.iter().all(is_black)));
    let time = format!("at an exposure of {} s", shot.exposure);
    let which = |losses: Losses, which: &str| match losses.lost == losses.of {
        true => "every pixel is".to_owned(),
        false => format!("{losses} of the pixels{which} are"),
    };
    let saturated = saturated.is_clipped().then(|| {
        let which = which(saturated, "");
        format!("{which} saturated {time} ({top} DN): {}", less(sensor, film, shot))
    });
    let black = black.is_black().then(|| {
        let which = which(black, " that light falls on");
        let level = sensor.black_level();
        format!("{which} black {time} (within noise of {level} DN): {}", more(sensor, film, shot))
    });
    saturated.into_iter().chain(black).collect()
}

/// Advice on how to get less than saturation.
fn less(sensor: &Sensor, film: Film<'_>, shot: Exposure) -> String {
    let dark = sensor.dark_current() * shot.exposure;
    if dark >= 0.5 * sensor.saturation() {
        return format!(
            "the dark signal alone is {dark:.0} e⁻ of {:.0}; set the sensor's `exposure` or `temperature` lower",
            sensor.saturation()
        );
    }
    match sensor.radiometry() {
        Radiometry::Digital => {
            "in `digital` radiometry light of 1 is full scale whatever the exposure \
             time; make the lights weaker"
                .to_owned()
        }
        Radiometry::Physical => {
            let bright = sensor.electrons_of_brightest(film, shot.exposure, CLIPPED);
            let time = shot.exposure * 0.5 * sensor.saturation() / bright;
            if time < EXPOSURES[0] {
                return "no exposure is as short; use a smaller pupil, or make the lights weaker"
                    .to_owned();
            }
            format!(
                "set the sensor's `exposure` to {} s, at which nine pixels of ten have less than half of that, or \
                 use a smaller pupil",
                short(time)
            )
        }
    }
}

/// Advice on how to see something.
fn more(sensor: &Sensor, film: Film<'_>, shot: Exposure) -> String {
    let mean = sensor.mean_electrons(film, shot.exposure);
    if mean <= 0.0 {
        return "no light falls on the sensor; look at the lights and at where the camera looks"
            .into();
    }
    match sensor.radiometry() {
        Radiometry::Digital => format!(
            "light of 1 is full scale, and the mean is {}; make the lights stronger",
            short(mean / sensor.full_scale())
        ),
        Radiometry::Physical => {
            let time = shot.exposure * 0.5 * sensor.saturation() / mean;
            if time > EXPOSURES[1] {
                return "no exposure is as long; use a wider pupil, or make the lights stronger"
                    .to_owned();
            }
            format!(
                "light makes {} e⁻ a pixel; set the sensor's `exposure` to {} s for half of saturation, or \
                 make the lights stronger",
                short(mean),
                short(time)
            )
        }
    }
}

/// Two figures of a number.
fn short(value: f64) -> String {
    match value.abs() {
        0.01..1000.0 => format!("{value:.2}"),
        _ => format!("{value:.1e}"),
    }
}

/// A sentence on a pattern that few raw converters know.
pub(super) fn on_pattern(sensor: &Sensor) -> Option<String> {
    let [rows, columns] = sensor.cfa()?.period();
    let known = [rows, columns] == [2, 2] || [rows, columns] == [6, 6];
    (!known).then(|| {
        format!(
            "raw.dng has a pattern of {rows} by {columns} filters: DNG can say so, but many raw \
             converters read two by two alone; raw.npy and raw.preview.png are right"
        )
    })
}
