//! Rays that optiland 0.6.3 traced through its own lenses (`scripts/lens_opinions.py`), through the same files here.

use std::path::PathBuf;

use etendue_optics::element::Frame;
use etendue_optics::train::{Focus, GivenRay, LensFormat, RaysFile, Side, ZemaxLens};
use glam::DVec3;
use serde_json::Value;

/// Ends agree to this (mm): optiland's iterations end at steps of 1e-14 mm, which slopes and 600 mm of way make 1e-12.
const APART: f64 = 1e-10;

/// The lens of a file, and its rays by place, direction and end.
fn opinion(path: &std::path::Path) -> (ZemaxLens, Vec<[DVec3; 3]>) {
    let text = std::fs::read_to_string(path).unwrap();
    // Infinite numbers stand in the lens as Python writes them; what is behind it has none.
    let (lens, rays) = text.split_once(", \"rays\": ").unwrap();
    let lens = lens.strip_prefix("{\"optic\": ").unwrap();
    let lens = ZemaxLens::read_as(LensFormat::Optiland, lens.as_bytes(), None, &[])
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let rays: Vec<Value> =
        serde_json::from_str(rays.trim_end().strip_suffix('}').unwrap()).unwrap();
    let vector = |value: &Value| DVec3::from_array(serde_json::from_value(value.clone()).unwrap());
    let rays = rays.iter().map(|ray| ["origin", "direction", "end"].map(|key| vector(&ray[key])));
    (lens, rays.collect())
}

#[test]
fn rays_of_a_second_package_end_at_the_same_places() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/optics/optiland");
    let mut worst: Vec<(String, f64)> = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let (lens, rays) = opinion(&path);
        let train = lens.file.build(&|name: &str| Err(name.to_owned())).unwrap();
        let spaces = train.built();
        let [.., before_last, built] = spaces[..] else { panic!("{}", path.display()) };
        let mount = lens.file.sensor.unwrap_or_default();
        // Of mirrors an even number, or a sensor that stands straight.
        let sensor = Frame::placed(
            train.sensor_z(Focus::AsWritten).unwrap(),
            mount.decentre.map(|length| length.0),
            mount.tilt.map(|angle| angle.0),
        );
        let given = rays.iter().map(|[origin, direction, _]| GivenRay {
            origin: origin.to_array(),
            direction: direction.to_array(),
            wavelength: 550.0,
        });
        let file = RaysFile { from: Side::Object, clip: false, rays: given.collect() };
        let traced = train.trace_file(&file).unwrap();
        let mut apart = 0.0_f64;
        for (ours, [.., end]) in traced.rays.iter().zip(&rays) {
            assert!(ours.direction.is_some(), "{}: {ours:?}", path.display());
            // Points stand in the space before their element.
            let from = before_last.place(DVec3::from_array(*ours.points.last().unwrap()));
            let along = built.direction(DVec3::from_array(ours.direction.unwrap()));
            let distance = (*end - from).cross(along).length();
            let normal = built.direction(sensor.rotation.z_axis);
            let before = (*end - built.place(sensor.vertex)).dot(normal).abs();
            apart = apart.max(distance).max(before);
        }
        assert_eq!(traced.rays.len(), 16);
        worst.push((path.file_stem().unwrap().to_string_lossy().into_owned(), apart));
    }
    worst.sort_by(|a, b| a.1.total_cmp(&b.1));
    println!("{worst:?}");
    assert_eq!(worst.len(), 15, "{worst:?}");
    assert!(worst.iter().all(|(_, apart)| *apart < APART), "{worst:?}");
}
