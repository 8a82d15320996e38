//! Light in bands: written, looked at, and put before a sensor again.

use etendue::{
    ExposeOptions, LightImage, LightUnit, Options, Outputs, PixelLight, Progress, Session, Still,
};
use etendue_scene::file::SensorFile;
use serde_json::{Value, json};

/// Names of bands beyond 1000 nm sort before those of others.
fn sensor() -> Value {
    json!({
        "type": "multispectral", "bands": [400, 450, 505, 700, 1500], "resolution": [6, 4],
        "radiometry": "physical", "system_gain": 0.5, "exposure": 2e-5
    })
}

fn scene() -> Value {
    json!({
        "etendue": 1, "tracer": {"type": "facing"}, "render": {"samples": 1},
        "camera": {"type": "orthographic", "height": 2.5, "sensor": sensor(),
                   "pose": {"from": [0, 0, 2], "look_at": [0, 0, 0]}},
        "objects": [{"shape": "sphere", "material": "paint"}],
        "materials": {"paint": {"type": "matte", "color": [2e-4, 1e-4, 3e-4]}}
    })
}

#[test]
fn both_forms_of_light_in_bands_are_looked_at_and_exposed() {
    let folder = tempfile::tempdir().unwrap();
    let outputs = Outputs { exr: true, envi: true, ..Outputs::NONE };
    let options = Options { outputs, ..Options::default() };
    let mut session = Session::from_json_with(folder.path(), scene(), options).unwrap();
    let rendering = session.render(&Progress::none()).unwrap();
    let out = folder.path().join("out");
    rendering.write(&out, outputs).unwrap();
    let own = rendering.layer("Spectrum").unwrap();
    let exposure = rendering.exposures().next().unwrap();
    let raw = rendering.raw(exposure).unwrap().unwrap();
    assert!(raw.values.iter().any(|value| *value > 50), "no light, no test");
    let name = folder.path().join("sensor.json");
    let file = SensorFile::of_value(&name, sensor(), &[]).unwrap();
    for name in ["layers.exr", "spectrum.hdr", "spectrum.img"] {
        let path = out.join(name);
        assert!(Still::is_named(&path), "{name}");
        let still = Still::open(&path).unwrap();
        let seen = still.layers().iter().find(|layer| layer.name == "Spectrum").unwrap();
        let names: Vec<&str> = seen.channels.iter().map(|channel| &*channel.name).collect();
        assert_eq!(names, ["425nm", "477_5nm", "602_5nm", "1100nm"], "{name}");
        for (a, b) in seen.channels.iter().zip(&own.channels) {
            let equal = (0..24).all(|i| a.values.at(i) == b.values.at(i));
            assert!(equal, "{name}: {} is another", a.name);
        }
        // The picture is the first layer, and a pixel tells its bands with their unit.
        assert_eq!(still.layers()[0].name, "", "{name}");
        still.screen("").unwrap();
        let reading = still.reading([3.0, 2.0]);
        let bands = reading.iter().find(|(layer, _)| layer == "Spectrum").unwrap();
        assert!(bands.1.ends_with("W.m^-2.nm^-1"), "{name}: {reading:?}");

        let image = LightImage::open(&path, None, None).unwrap();
        assert_eq!((image.size(), image.unit()), ([6, 4], Some("W.m^-2.nm^-1")));
        let PixelLight::Bands(film) = image.light() else { panic!("{name} has no bands") };
        assert_eq!(film.bands.grid().unwrap().edges(), [400.0, 450.0, 505.0, 700.0, 1500.0]);
        let exposed = image.on(&file, &ExposeOptions::default()).unwrap();
        assert_eq!(exposed.raw(exposure).unwrap(), raw, "{name}");
    }
    // What a user says of the unit counts, and not the file.
    let doubled = ExposeOptions { unit: Some(LightUnit::Irradiance(2.0)), ..Default::default() };
    let image = LightImage::open(&out.join("spectrum.hdr"), None, None).unwrap();
    let more = image.on(&file, &doubled).unwrap().raw(exposure).unwrap();
    assert!(more.values.iter().zip(&raw.values).any(|(a, b)| a > b));
}
