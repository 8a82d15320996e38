//! Words on a picture: in the headers of its files, and in notes.

use etendue_render::Rendered;
use etendue_render::expose::{self, LightUnit};
use etendue_render::output::HeaderEntry;
use etendue_scene::Scene;
use etendue_scene::escape::one_line;
use etendue_scene::import::Note;
use etendue_sensor::Radiometry;

use crate::Error;
use crate::neighbours::Neighbour;

/// That layers compare with a frame in which things were exchanged.
pub(crate) const NOT_FOLLOWED: &str = "some meshes are others in the frame that layers compare this one with; their \
                            points are not followed (+inf)";

/// Entries in the header of every file.
pub(crate) fn header(scene: &Scene, fingerprints: &[HeaderEntry]) -> Vec<HeaderEntry> {
    let more = [
        ("seed", scene.render.seed.to_string()),
        ("pixel_origin", "pixel centres lie at half-integers from the picture's corner".to_owned()),
        ("camera", serde_json::to_string(&scene.camera.opencv()).unwrap_or_default()),
    ]
    .map(|(key, text)| HeaderEntry::new(key, text));
    fingerprints.iter().cloned().chain(more).chain(light(scene)).collect()
}

/// The seed of the sensor's noise.
pub(crate) const NOISE_SEED: &str = "noise_seed";

/// The unit of the picture's values, where it is one.
pub(crate) const LIGHT_UNIT: &str = "light_unit";

/// The projected solid angle of the camera's pupil (sr).
pub(crate) const PUPIL: &str = "pupil_solid_angle";

/// From one pixel's centre to the next (µm).
pub(crate) const PITCH: &str = "pixel_pitch";

/// Header entries that another sensor needs to be exposed to the picture.
fn light(scene: &Scene) -> Vec<HeaderEntry> {
    let Some(sensor) = &scene.sensor else { return Vec::new() };
    let mut entries = vec![HeaderEntry::new(NOISE_SEED, expose::noise_seed(scene).to_string())];
    if sensor.radiometry() == Radiometry::Physical {
        entries.push(HeaderEntry::new(LIGHT_UNIT, LightUnit::of(scene).to_string()));
        entries.push(HeaderEntry::new(PITCH, sensor.pixel_pitch().to_string()));
        let pupil = scene.camera.pupil_solid_angle();
        entries.extend(pupil.map(|pupil| HeaderEntry::new(PUPIL, pupil.to_string())));
    }
    entries
}

/// Fingerprints that tell whether files show the same scene, compared with the same other frames.
pub(crate) fn fingerprints(
    scene: &Scene,
    neighbours: &[Neighbour],
) -> Result<Vec<HeaderEntry>, Error> {
    let own = Ok(HeaderEntry::new("scene_hash", scene.hash()?.to_string()));
    std::iter::once(own).chain(neighbours.iter().map(Neighbour::header)).collect()
}

/// A note as one line.
pub(crate) fn in_words(note: &Note) -> String {
    let Note { subject, message, .. } = note;
    one_line(&match note.count {
        0 | 1 => format!("{subject}: {message}"),
        count => format!("{subject} (x{count}): {message}"),
    })
    .into_owned()
}

/// Models that another program wrote to meanwhile.
pub(crate) fn changed(scene: &Scene) -> impl Iterator<Item = String> {
    scene.changed_files().into_iter().map(|path| {
        let path = path.display();
        format!(
            "{path} changed while it was rendered: what is seen may be old or new; render again"
        )
    })
}

/// That some light was left out, if it was.
pub(crate) fn not_finite(rendered: &Rendered) -> Option<String> {
    let count = rendered.light.not_finite;
    (count > 0).then(|| format!("{count} contributions of light were not finite and are left out"))
}
