//! What a user should know of an exposure: that nothing can be seen in it, and what would mend it.

use etendue_sensor::{Exposure, Film, Radiometry, RawImage, Sensor};

/// Standard deviations of the dark noise within which a pixel tells nothing from black or from
/// saturation: of 10⁸ pixels less than one is further off by chance.
const SIGMAS: f64 = 6.0;

/// A sentence on an image that is saturated or black all over.
pub(super) fn on(
    sensor: &Sensor,
    film: Film<'_>,
    image: &RawImage,
    shot: Exposure,
) -> Option<String> {
    let gain = sensor.system_gain();
    let dark = gain * sensor.dark_current() * shot.exposure;
    let [_, dsnu] = sensor.non_uniformity();
    let noise = SIGMAS * gain * sensor.dark_noise(shot.exposure).hypot(dsnu) + 0.5;
    let top = sensor.saturation_level();
    // Behind a full well there is noise of the read-out; at the converter's end there is none.
    let saturated = if top < sensor.white_level() { top - noise } else { top };
    let black = sensor.black_level() + dark + noise;
    let all = |test: &dyn Fn(f64) -> bool| image.values.iter().all(|&y| test(f64::from(y)));
    let time = format!("at an exposure of {} s", shot.exposure);
    if all(&|y| y >= saturated) {
        return Some(format!(
            "every pixel is saturated {time} ({top} DN): {}",
            less(sensor, film, shot)
        ));
    }
    if all(&|y| y <= black) {
        return Some(format!(
            "every pixel is black {time} (within noise of {} DN): {}",
            sensor.black_level(),
            more(sensor, film, shot)
        ));
    }
    None
}

/// How to get less than saturation.
fn less(sensor: &Sensor, film: Film<'_>, shot: Exposure) -> String {
    let dark = sensor.dark_current() * shot.exposure;
    if dark >= 0.5 * sensor.saturation() {
        return format!(
            "the dark signal alone is {dark:.0} e⁻ of {:.0}; set sensor.exposure or sensor.temperature \
             lower",
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
            let mean = sensor.mean_electrons(film, shot.exposure);
            let time = shot.exposure * 0.5 * sensor.saturation() / mean;
            format!(
                "set sensor.exposure to {} s for half of it, or use a smaller pupil",
                short(time)
            )
        }
    }
}

/// How to see something.
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
            format!(
                "light makes {} e⁻ a pixel; set sensor.exposure to {} s for half of saturation, or make \
                 the lights stronger",
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
