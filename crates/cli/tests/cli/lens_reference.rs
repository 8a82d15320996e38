//! `etendue lens` against another program: the systems of `reference/optics` through the command.

use std::path::PathBuf;

use serde_json::{Value, json};

use crate::run::{Bench, assets, text};

/// A ray's points agree to this (mm).
const POINT: f64 = 1e-9;
/// A ray's direction cosines agree to this.
const COSINE: f64 = 1e-10;
/// First-order data agree to this share.
const PARAXIAL: f64 = 1e-8;

pub(crate) fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// The reference systems; empty when they are not there.
fn systems(test: &str) -> Vec<Value> {
    let Some(assets) = assets(test) else { return Vec::new() };
    let entries = std::fs::read_dir(assets.join("reference/optics")).expect("reference systems");
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|e| e == "json"));
    paths.sort();
    assert!(paths.len() >= 9, "{} systems", paths.len());
    let read = |path: &PathBuf| serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    paths.iter().map(read).collect()
}

/// A reference system as a lens file.
fn lens_file(system: &Value) -> Value {
    let mut elements = Vec::new();
    for (i, row) in system["surfaces"].as_array().unwrap().iter().enumerate() {
        let mut element = json!({"type": "surface", "thickness": row["thickness"],
            "conic": row["conic"], "aspheric": row["aspheric"],
            "semi_diameter": row["semi_diameter"], "stop": system["stop_index"] == i});
        if !row["radius"].is_null() {
            element["radius"] = row["radius"].clone();
        }
        if let Some(name) = row["material"]["glass"].as_str() {
            element["glass"] = name.into();
        } else if !row["material"]["n"].is_null() {
            element["glass"] = json!({"n": row["material"]["n"]});
        }
        elements.push(element);
    }
    json!({"name": system["id"], "elements": elements})
}

fn bench(lens: &Value) -> Bench {
    let bench = Bench::new();
    bench.write("lens.json", lens.to_string().as_bytes());
    bench
}

/// Standard output of `etendue lens` as JSON.
pub(crate) fn run(bench: &Bench, more: &[&str]) -> Value {
    let output = bench.run(&[&["lens", "lens.json", "--json"], more].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

fn trace(bench: &Bench, from: &str, clip: bool, rays: &[Value]) -> Vec<Value> {
    let file = json!({"from": from, "clip": clip, "rays": rays});
    bench.write("rays.json", file.to_string().as_bytes());
    let traced = run(bench, &["--rays", "rays.json"]);
    traced["rays"].as_array().expect("rays").clone()
}

fn assert_near(ours: &Value, theirs: &Value, tolerance: f64, what: &str) {
    for axis in 0..3 {
        let difference = (number(&ours[axis]) - number(&theirs[axis])).abs();
        assert!(difference < tolerance, "{what}: {ours} for {theirs}");
    }
}

/// One ray, traced without clipping, against the reference.
fn assert_unclipped(ours: &Value, theirs: &Value, what: &str) {
    let (status, element) = match theirs["status"].as_str().unwrap() {
        "ok" => ("exited", &Value::Null),
        "miss" => ("missed", &theirs["fail_surface"]),
        _ => ("total_internal_reflection", &theirs["fail_surface"]),
    };
    assert_eq!((ours["status"].as_str().unwrap(), &ours["element"]), (status, element), "{what}");
    let points = theirs["points"].as_array().unwrap();
    assert_eq!(ours["points"].as_array().unwrap().len(), points.len(), "{what}");
    for (i, point) in points.iter().enumerate() {
        assert_near(&ours["points"][i], point, POINT, what);
    }
    match status {
        "exited" => assert_near(&ours["direction"], &theirs["exit_dir"], COSINE, what),
        _ => assert!(ours["direction"].is_null(), "{what}"),
    }
}

/// One ray, traced with clipping, against the reference.
fn assert_clipped(ours: &Value, theirs: &Value, what: &str) {
    if !theirs["contested"].is_null() {
        assert_ne!(ours["status"], "exited", "{what}: contested rays are dead");
    } else if !theirs["clip_surface"].is_null() {
        assert_eq!(ours["status"], "vignetted", "{what}");
        assert_eq!(ours["element"], theirs["clip_surface"], "{what}");
    } else {
        assert_unclipped(ours, theirs, what);
    }
}

#[test]
fn every_reference_ray_goes_where_it_should() {
    let mut count = 0;
    for system in systems("lens rays") {
        let bench = bench(&lens_file(&system));
        for (name, from) in [("forward", "object"), ("sensor", "sensor")] {
            let theirs: Vec<&Value> = system["rays"]
                .as_array()
                .unwrap()
                .iter()
                .filter(|r| r["direction"] == name)
                .collect();
            let rays: Vec<Value> = theirs
                .iter()
                .map(|r| {
                    json!({"origin": r["origin"], "direction": r["dir"],
                           "wavelength": r["wavelength"]})
                })
                .collect();
            let open = trace(&bench, from, false, &rays);
            let clipped = trace(&bench, from, true, &rays);
            assert_eq!((open.len(), clipped.len()), (theirs.len(), theirs.len()));
            for (i, theirs) in theirs.iter().enumerate() {
                let what = format!("{} {} {}", system["id"], theirs["tag"], from);
                if theirs["contested"].is_null() {
                    assert_unclipped(&open[i], theirs, &what);
                }
                assert_clipped(&clipped[i], theirs, &what);
                count += 1;
            }
        }
    }
    println!("{count} rays, each with and without clipping");
}

#[test]
fn first_order_data_of_every_reference_system_agree() {
    for system in systems("lens paraxial") {
        let bench = bench(&lens_file(&system));
        for (wavelength, theirs) in system["paraxial"].as_object().unwrap() {
            let report = run(&bench, &["--wavelengths", wavelength, "--fields", "0"]);
            let ours = &report["paraxial"];
            let pairs = [
                ("efl", &ours["efl"]),
                ("bfl", &ours["bfl"]),
                ("ffl", &ours["ffl"]),
                ("enp_z", &ours["entrance_pupil"]["z"]),
                ("enp_diam", &ours["entrance_pupil"]["diameter"]),
                ("exp_z", &ours["exit_pupil"]["z"]),
                ("exp_diam", &ours["exit_pupil"]["diameter"]),
                ("fno", &ours["f_number"]),
                ("image_z", &ours["image_z"]),
            ];
            for (key, value) in pairs {
                // An afocal plate has no pupils in the reference; that its stop has an image is true.
                let Some(expected) = theirs[key].as_f64() else { continue };
                let error = (number(value) - expected).abs() / expected.abs().max(1.0);
                assert!(error < PARAXIAL, "{} {key} at {wavelength}: {value}", system["id"]);
            }
        }
    }
}

#[test]
fn spots_distortion_and_illumination_of_every_reference_system_agree() {
    for system in systems("lens analysis") {
        let fields: Vec<String> = ["spots"]
            .iter()
            .flat_map(|key| system[key].as_array().unwrap())
            .map(|spot| spot["field_deg"].to_string())
            .collect();
        if fields.is_empty() {
            continue;
        }
        let bench = bench(&lens_file(&system));
        let report = run(&bench, &["--fields", &fields.join(",")]);
        for (ours, theirs) in
            report["spots"].as_array().unwrap().iter().zip(system["spots"].as_array().unwrap())
        {
            let difference = number(&ours["rms"]) - number(&theirs["rms_at_ref"]);
            // Sums of up to 812 rounded numbers; the plane is ours, 1e-14 mm from theirs.
            assert!(difference.abs() < 1e-10, "{} {}", system["id"], theirs["field_deg"]);
            assert_eq!(ours["rays_passed"], theirs["rays_passed"]);
        }
        let theirs = system["relative_illumination"]["points"].as_array();
        for theirs in theirs.into_iter().flatten() {
            let points = report["relative_illumination"].as_array().unwrap();
            let Some(ours) = points.iter().find(|p| p["field"] == theirs["field_deg"]) else {
                continue;
            };
            let error = number(&ours["relative"]) - number(&theirs["relative"]);
            // Both are sums over 500 x 500 cells, good to the cells on the rim: 2.5e-4 or so.
            assert!(error.abs() < 5e-4, "{} {}: {error}", system["id"], theirs["field_deg"]);
        }
    }
}
