//! Lenses traced and analysed elsewhere: nine systems of `reference/optics`, computed with 50 digits
//! and checked there against two lens-design packages.

use std::path::PathBuf;

use etendue_geometry::units::Millimetres;
use etendue_optics::element::{Clip, ElementSpec, LensRays, PartSpec, RayStatus, SurfaceSpec};
use etendue_optics::glass::GlassSpec;
use etendue_optics::train::analysis::{colour_shifts, distortion, illumination, spot};
use etendue_optics::train::{FieldSpec, LensFile, MonochromaticTrain, OpticalTrain, Side};
use glam::DVec3;
use serde_json::Value;

/// A ray's points agree to this (mm).
const POINT: f64 = 1e-9;
/// A ray's direction cosines agree to this.
const COSINE: f64 = 1e-10;
/// First-order data agree to this share.
const PARAXIAL: f64 = 1e-8;

struct System {
    name: String,
    json: Value,
    train: OpticalTrain,
}

impl System {
    fn at(&self, wavelength: f64) -> MonochromaticTrain {
        self.train.at(wavelength).unwrap()
    }

    fn reference_z(&self) -> f64 {
        number(&self.json["reference_image_z"])
    }
}

/// The systems, or `None` with a line on why there are none.
fn systems() -> Option<Vec<System>> {
    let shared = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let assets = std::env::var_os("ETENDUE_ASSETS").map_or(shared, PathBuf::from);
    let folder = assets.join("reference/optics");
    let Ok(entries) = std::fs::read_dir(&folder) else {
        println!("skipped: no reference data (set ETENDUE_ASSETS to the folder that holds it)");
        return None;
    };
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|e| e == "json"));
    paths.sort();
    assert!(paths.len() >= 9, "{} systems", paths.len());
    Some(paths.iter().map(|path| read(path)).collect())
}

fn read(path: &std::path::Path) -> System {
    let json: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let stop = index(&json["stop_index"]);
    let mut elements = Vec::new();
    for (i, row) in json["surfaces"].as_array().unwrap().iter().enumerate() {
        let spec = SurfaceSpec {
            radius: row["radius"].as_f64().map(Millimetres),
            glass: glass(&row["material"]),
            semi_diameter: row["semi_diameter"].as_f64().map(Millimetres),
            conic: number(&row["conic"]),
            aspheric: serde_json::from_value(row["aspheric"].clone()).unwrap(),
            curvature: None,
        };
        let element = ElementSpec::new(PartSpec::Surface(spec), number(&row["thickness"]));
        elements.push(if i == stop { element.as_stop() } else { element });
    }
    let mut file = LensFile::new(elements);
    file.wavelength = Some(etendue_geometry::units::Nanometres(587.56));
    // Through the text, so that the format is tested too.
    let file = LensFile::from_json(&serde_json::to_string(&file).unwrap()).unwrap();
    let train = file.build(&|name: &str| Err(format!("{name}: no files"))).unwrap();
    System { name: json["id"].as_str().unwrap().to_owned(), json, train }
}

fn glass(material: &Value) -> Option<GlassSpec> {
    if let Some(n) = material["n"].as_f64() {
        return Some(GlassSpec::Constant(n));
    }
    material["glass"].as_str().map(|name| GlassSpec::Named(name.to_owned()))
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn vector(value: &Value) -> DVec3 {
    DVec3::new(number(&value[0]), number(&value[1]), number(&value[2]))
}

fn side(ray: &Value) -> Side {
    if ray["direction"] == "forward" { Side::Object } else { Side::Sensor }
}

fn index(value: &Value) -> usize {
    usize::try_from(value.as_u64().unwrap()).unwrap()
}

#[test]
fn glasses_have_the_reference_indices() {
    for system in systems().into_iter().flatten() {
        for (name, glass) in system.json["glasses"].as_object().unwrap() {
            let ours = GlassSpec::Named(name.clone()).resolve().unwrap();
            for (wavelength, n) in glass["n"].as_object().unwrap() {
                let difference = ours.index(wavelength.parse().unwrap()).unwrap() - number(n);
                assert!(difference.abs() < 1e-14, "{name} at {wavelength}: {difference}");
            }
        }
    }
}

#[test]
fn every_ray_meets_every_surface_where_it_should() {
    let (mut rays, mut worst_point, mut worst_cosine) = (0, 0.0_f64, 0.0_f64);
    for system in systems().into_iter().flatten() {
        for ray in system.json["rays"].as_array().unwrap() {
            if !ray["contested"].is_null() {
                continue;
            }
            let at = system.at(number(&ray["wavelength"]));
            let [origin, direction] = [vector(&ray["origin"]), vector(&ray["dir"])];
            let path = at.path(side(ray), Clip::Off, origin, direction);
            let what = format!("{} {}", system.name, ray["tag"]);
            let expected = match ray["status"].as_str().unwrap() {
                "ok" => RayStatus::Exited,
                "miss" => RayStatus::Missed { element: index(&ray["fail_surface"]) },
                _ => RayStatus::TotalInternalReflection { element: index(&ray["fail_surface"]) },
            };
            assert_eq!(path.status, expected, "{what}");
            let points = ray["points"].as_array().unwrap();
            assert_eq!(path.points.len(), points.len(), "{what}");
            for (ours, theirs) in path.points.iter().zip(points) {
                let difference = (*ours - vector(theirs)).abs().max_element();
                assert!(difference < POINT, "{what}: {difference} mm");
                worst_point = worst_point.max(difference);
            }
            if expected == RayStatus::Exited {
                let difference =
                    (path.direction.unwrap() - vector(&ray["exit_dir"])).abs().max_element();
                assert!(difference < COSINE, "{what}: {difference}");
                worst_cosine = worst_cosine.max(difference);
            }
            rays += 1;
        }
    }
    println!("{rays} rays: points to {worst_point:.1e} mm, cosines to {worst_cosine:.1e}");
}

#[test]
fn rays_are_clipped_at_the_first_surface_that_they_meet_outside_its_rim() {
    for system in systems().into_iter().flatten() {
        for ray in system.json["rays"].as_array().unwrap() {
            let at = system.at(number(&ray["wavelength"]));
            let [origin, direction] = [vector(&ray["origin"]), vector(&ray["dir"])];
            let status = at.path(side(ray), Clip::On, origin, direction).status;
            let what = format!("{} {}", system.name, ray["tag"]);
            if !ray["contested"].is_null() {
                assert_ne!(status, RayStatus::Exited, "{what}: contested rays are dead");
                continue;
            }
            match (&ray["clip_surface"], ray["status"].as_str().unwrap()) {
                (element @ Value::Number(_), _) => {
                    assert_eq!(status, RayStatus::Vignetted { element: index(element) }, "{what}");
                }
                (_, "ok") => assert_eq!(status, RayStatus::Exited, "{what}"),
                (_, _) => assert_eq!(status.element(), Some(index(&ray["fail_surface"])), "{what}"),
            }
        }
    }
}

#[test]
fn a_batch_gives_the_bits_of_single_rays() {
    for system in systems().into_iter().flatten() {
        let at = system.at(587.56);
        for from in [Side::Object, Side::Sensor] {
            for clip in [Clip::On, Clip::Off] {
                let mut batch = LensRays::default();
                for ray in system.json["rays"].as_array().unwrap() {
                    if side(ray) == from {
                        batch.push(vector(&ray["origin"]), vector(&ray["dir"]));
                    }
                }
                let mut single = batch.clone();
                at.trace(from, clip, &mut batch);
                at.trace_singly(from, clip, &mut single);
                for i in 0..batch.len() {
                    let what = format!("{} ray {i} {from:?} {clip:?}", system.name);
                    assert_eq!(batch.status(i), single.status(i), "{what}");
                    assert_eq!(batch.position(i), single.position(i), "{what}");
                    assert_eq!(batch.direction(i), single.direction(i), "{what}");
                }
            }
        }
    }
}

#[test]
fn first_order_data_agree() {
    for system in systems().into_iter().flatten() {
        for (wavelength, theirs) in system.json["paraxial"].as_object().unwrap() {
            let ours = system.train.paraxial(wavelength.parse().unwrap()).unwrap();
            let pairs = [
                ("efl", ours.efl),
                ("bfl", ours.bfl),
                ("ffl", ours.ffl),
                ("enp_z", ours.entrance_pupil.z),
                ("enp_diam", ours.entrance_pupil.diameter),
                ("exp_z", ours.exit_pupil.z),
                ("exp_diam", ours.exit_pupil.diameter),
                ("fno", ours.f_number),
                ("image_z", ours.image_z),
            ];
            for (key, value) in pairs {
                let Some(expected) = theirs[key].as_f64() else {
                    let pupil = key.starts_with("en") || key.starts_with("ex");
                    assert!(value.is_none() || pupil, "{} {key}: {value:?}", system.name);
                    continue;
                };
                let value = value.unwrap_or_else(|| panic!("{} has no {key}", system.name));
                let error = (value - expected).abs() / expected.abs().max(1.0);
                assert!(error < PARAXIAL, "{} {key} at {wavelength}: {value}", system.name);
            }
        }
    }
}

#[test]
fn spots_agree() {
    for system in systems().into_iter().flatten() {
        let at = system.at(587.56);
        for theirs in system.json["spots"].as_array().unwrap() {
            let field = number(&theirs["field_deg"]);
            let ours =
                spot(&system.train, &at, &FieldSpec::at(field), system.reference_z()).unwrap();
            let what = format!("{} at {field}°", system.name);
            assert_eq!(ours.rays_launched, index(&theirs["rays_launched"]), "{what}");
            assert_eq!(ours.rays_passed, index(&theirs["rays_passed"]), "{what}");
            let pairs = [
                ("rms", ours.best_rms),
                ("geo", ours.best_geometric),
                ("dz_from_ref", ours.best_focus),
                ("rms_at_ref", ours.rms),
                ("geo_at_ref", ours.geometric),
                ("centroid_y_at_ref", ours.centroid_y),
            ];
            for (key, value) in pairs {
                // Sums of up to 812 rounded numbers, as far apart as the packages are.
                let difference = value - number(&theirs[key]);
                assert!(difference.abs() < 1e-10, "{what} {key}: {value}, off by {difference}");
            }
        }
    }
}

#[test]
fn distortion_agrees() {
    for system in systems().into_iter().flatten() {
        let theirs = &system.json["distortion"];
        if theirs.is_null() {
            continue;
        }
        let field = number(&theirs["field_deg"]);
        let at = system.at(587.56);
        let ours = distortion(&system.train, &at, field, system.reference_z()).unwrap();
        // The chief ray passes the stop's centre to 1e-9 mm, and so lands about that well.
        for (key, value) in
            [("y_real", ours.y_real), ("y_paraxial", ours.y_paraxial), ("percent", ours.percent)]
        {
            let difference = value - number(&theirs[key]);
            assert!(difference.abs() < 1e-8, "{} {key}: off by {difference}", system.name);
        }
    }
}

#[test]
fn longitudinal_colour_agrees() {
    for system in systems().into_iter().flatten() {
        let Some(theirs) = system.json["longitudinal_chromatic"].as_object() else { continue };
        let wavelengths: Vec<f64> = theirs.keys().map(|key| key.parse().unwrap()).collect();
        let shifts =
            colour_shifts(&system.train, &wavelengths, &[0.0], system.reference_z()).unwrap();
        for (ours, theirs) in shifts.iter().zip(theirs.values()) {
            let difference = ours.longitudinal.unwrap() - number(theirs);
            assert!(difference.abs() < 1e-9, "{}: off by {difference}", system.name);
        }
    }
}

#[test]
fn relative_illumination_agrees() {
    for system in systems().into_iter().flatten() {
        let theirs = system.json["relative_illumination"]["points"].as_array();
        let theirs = theirs.map_or(&[][..], Vec::as_slice);
        let fields: Vec<f64> = theirs.iter().map(|p| number(&p["field_deg"])).collect();
        let at = system.at(587.56);
        let ours = illumination(&system.train, &at, &fields, system.reference_z());
        assert_eq!(ours.len(), theirs.len());
        for (ours, theirs) in ours.iter().zip(theirs) {
            let what = format!("{} at {}°", system.name, ours.field);
            assert!((ours.image_y - number(&theirs["image_y"])).abs() < 1e-8, "{what}");
            let error = ours.projected_solid_angle / number(&theirs["E"]) - 1.0;
            // Both are sums over 500 × 500 cells, good to the cells on the rim: 1e-4 or so each,
            // as the reference's own grid_uncertainty says.
            let bound = 2.5e-4 + 2.0 * number(&theirs["grid_uncertainty"]);
            assert!(error.abs() < bound, "{what}: {error:.2e}");
        }
    }
}
