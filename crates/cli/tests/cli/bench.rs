//! `etendue bench`: a tiny scene from end to end, and what is refused.

use etendue_accel::AccelName;

use crate::run::{Bench, text, under};

const SCENE: &str = r#"{"etendue": 1,
    "camera": {"type": "pinhole", "sensor": {"resolution": [48, 32]}},
    "objects": [{"shape": "sphere", "radius": 1}, {"shape": "box", "transform": {"translate": [3, 0, 0]}}]}"#;

/// Of light, Sobol's points are taken with hits in both precisions that Embree has, which come to one error.
#[cfg(feature = "embree")]
#[test]
fn light_is_charted_in_both_precisions() {
    let bench = Bench::with_scene(
        r#"{"etendue": 1, "tracer": {"type": "direct"},
            "camera": {"type": "pinhole", "sensor": {"resolution": [32, 32]}},
            "objects": [{"shape": "sphere", "radius": 1}],
            "lights": [{"type": "environment", "radiance": [1, 1, 1]}]}"#,
    );
    let run = ["bench", "scene.json", "-o", "out", "--quick", "--only", "samplers"];
    let output = bench.run(&[&run[..], &["--rounds", "1", "--seconds", "0.1"]].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let found = bench.json("out/bench.json");
    let rows = found["samplers"]["findings"].as_array().unwrap();
    let rmse = |sampler: &str| {
        let row = rows.iter().find(|row| row["sampler"] == sampler && row["samples"] == 16);
        row.unwrap_or_else(|| panic!("{sampler}: {rows:?}"))["rmse"].as_f64().unwrap()
    };
    // The same samples: what f32 adds is lost in their noise.
    let [single, double] = ["sobol", "sobol, hits in f64"].map(rmse);
    assert!((single / double - 1.0).abs() < 0.05 && double > 0.0, "{single} {double}");
    let chart = text(&std::fs::read(bench.path("out/samplers-time.svg")).unwrap());
    assert!(chart.contains("hits in f64"), "{chart}");
}

#[test]
fn a_quick_run_leaves_tables_and_charts() {
    let bench = Bench::with_scene(SCENE);
    let output = bench.run(&[
        "bench",
        "scene.json",
        "-o",
        "out",
        "--quick",
        "--rounds",
        "1",
        "--seconds",
        "0.1",
    ]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let table = text(&output.stdout);
    let found = bench.json("out/bench.json");
    let rows = found["accelerators"].as_array().unwrap();
    for method in AccelName::built().filter(|accel| !accel.has_single()).map(AccelName::name) {
        assert!(table.lines().any(|line| line.starts_with(method)), "{table}");
        let row = rows.iter().find(|row| row["method"] == method).unwrap();
        let errors = &row["errors"];
        assert_eq!(errors["rays"], 48 * 32);
        let wrong = ["missed", "false_hits", "wrong_triangle"].map(|key| errors[key].as_u64());
        assert_eq!(wrong, [Some(0); 3], "{method}: {errors}");
        assert!(row["mrays_per_second"].as_f64().unwrap() > 0.0);
    }
    let csv = text(&std::fs::read(bench.path("out/accelerators.csv")).unwrap());
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines.len(), 1 + rows.len());
    let columns = lines[0].split(',').count();
    assert!(lines.iter().all(|line| line.split(',').count() == columns), "{csv}");
    let samplers = found["samplers"]["findings"].as_array().unwrap();
    assert_eq!(samplers.len(), 5 * 4, "five samplers at four numbers of samples");
    let rmse = |sampler: &str, samples: u64| {
        let of = samplers.iter().find(|f| f["sampler"] == sampler && f["samples"] == samples);
        of.unwrap()["relative_rmse"].as_f64().unwrap()
    };
    for sampler in ["independent", "stratified", "hammersley", "sobol", "blue_noise"] {
        // Random numbers promise 1/√16, from 4 samples to 64; the others more.
        assert!(rmse(sampler, 64) < 0.5 * rmse(sampler, 4), "{sampler}: {samplers:?}");
    }
    assert!(found["cameras"].is_null(), "a pinhole has no lens");
    assert!(text(&output.stderr).contains("the camera has none"), "{}", text(&output.stderr));
    for chart in ["accelerators-hits", "accelerators-depth", "accelerators-batch"] {
        let svg = text(&std::fs::read(bench.path(&format!("out/{chart}.svg"))).unwrap());
        assert!(svg.contains(">\nbvh\n<") || svg.contains(">bvh<"), "every method is named: {svg}");
        let png = std::fs::read(bench.path(&format!("out/{chart}.png"))).unwrap();
        assert_eq!(&png[1..4], b"PNG");
    }
}

#[test]
fn rays_scatter_from_what_the_camera_sees() {
    let bench = Bench::with_scene(SCENE);
    let words = ["bench", "scene.json", "-o", "out", "--quick", "--rounds", "1", "--scattered"];
    let words = [&words[..], &["--only", "accelerators"]].concat();
    let output = bench.run(&words);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let found = bench.json("out/bench.json");
    let rows = found["accelerators"].as_array().unwrap();
    let errors = &rows.iter().find(|row| row["method"] == "bvh").unwrap()["errors"];
    let rays = errors["rays"].as_u64().unwrap();
    assert!(0 < rays && rays < 48 * 32, "one from each pixel that sees something: {errors}");
    let wrong = ["missed", "false_hits", "wrong_triangle"].map(|key| errors[key].as_u64());
    assert_eq!(wrong, [Some(0); 3], "{errors}");
    assert!(text(&output.stdout).contains(&format!("Rays: {rays} scattered")));
    let nothing = bench.run(&[&words[..], &["--set", "objects=[]"]].concat());
    assert_eq!(nothing.status.code(), Some(2));
    insta::assert_snapshot!(bench.said(&nothing), @"error: --scattered: the camera sees nothing that rays could scatter from");
}

#[test]
fn models_of_a_lens_are_compared_with_the_full_train() {
    let scene = r#"{"etendue": 1, "tracer": {"type": "facing"},
        "camera": {"type": "lens", "sensor_height": 24, "focus_distance": 2, "f_number": 2.8,
            "lens": {"elements": [
                {"type": "surface", "radius": 40, "thickness": 10, "glass": {"n": 1.6}, "semi_diameter": 14},
                {"type": "surface", "radius": -60, "thickness": 3, "semi_diameter": 14},
                {"type": "aperture", "shape": "circular", "radius": 8, "thickness": 30, "stop": true}]},
            "pose": {"from": [0, 0, 2], "look_at": [0, 0, 0]},
            "sensor": {"resolution": [48, 32]}},
        "materials": {"dice": {"type": "checker", "colors": [[1, 1, 1], [0.1, 0.1, 0.1]], "squares": 8}},
        "objects": [{"shape": "rectangle", "width": 4, "height": 4, "material": "dice"},
            {"shape": "box", "size": [0.2, 0.2, 0.2], "material": "dice", "transform": {"translate": [0.2, 0.1, 0.8]}}]}"#;
    let bench = Bench::with_scene(scene);
    let output = bench.run(&[
        "bench",
        "scene.json",
        "-o",
        "out",
        "--only",
        "cameras",
        "--rounds",
        "1",
        "--seconds",
        "0.1",
        "--sample-counts",
        "4,64",
    ]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let found = bench.json("out/bench.json");
    let findings = found["cameras"]["findings"].as_array().unwrap();
    let rmse = |model: &str| {
        let of = findings.iter().find(|f| f["model"] == model && f["samples"] == 64);
        of.unwrap_or_else(|| panic!("{model}: {found}"))["relative_rmse"].as_f64().unwrap()
    };
    // What a model leaves out of the lens, more samples do not bring back.
    assert!(rmse("full") < 0.5 * rmse("thick"), "{findings:?}");
    assert!(rmse("thin") < rmse("pinhole") && rmse("thick") < rmse("pinhole"), "{findings:?}");
    assert!(bench.path("out/cameras-time.svg").exists() && bench.path("out/cameras.csv").exists());
    assert!(
        !bench.path("out/samplers.csv").exists() && !bench.path("out/accelerators.csv").exists()
    );
}

#[test]
fn counts_that_make_no_sense_are_refused() {
    let bench = Bench::with_scene(SCENE);
    let refused = |options: [&str; 2]| {
        let said = bench.refusal(&[&["bench", "scene.json", "-o", "out"], &options[..]].concat());
        assert!(!bench.path("out").exists(), "{options:?}");
        said
    };
    let cases = [
        ["--rounds", "0"],
        ["--threads", "1,0"],
        ["--batches", "a"],
        ["--rays", "-3"],
        ["--sample-counts", "0"],
        ["--seconds", "nan"],
        ["--only", "lenses"],
    ];
    insta::assert_snapshot!(
        cases.map(|options| under(&options.join(" "), &refused(options))).concat()
    );
    // How much it takes is the accelerator's own.
    let limited = refused(["--memory-limit", "1"]);
    assert!(limited.contains("--memory-limit"), "{limited}");
    insta::assert_snapshot!(bench.refusal(&["bench", "none.json", "-o", "out"]), @r#"
    error: none.json: no such file
    hint: did you mean "scene.json"?
    "#);
    assert_eq!(bench.run(&["bench", "scene.json"]).status.code(), Some(2), "-o is needed");
}

/// A lit scene before a raw sensor.
const LIT: &str = r#"{"etendue": 1, "tracer": {"type": "path"}, "layers": ["sample_count", "depth"],
    "render": {"accel": "bvh", "samples": {"relative_error": 0.05}},
    "camera": {"type": "pinhole", "pose": {"from": [0, 1, 3], "look_at": [0, 0, 0]},
        "sensor": {"type": "raw", "resolution": [32, 24], "system_gain": 0.5, "bit_depth": 12, "full_well": 8000,
            "quantum_efficiency": 0.6, "read_noise": 3}},
    "lights": [{"type": "environment", "radiance": [0.3, 0.3, 0.3]}],
    "objects": [{"shape": "sphere", "radius": 0.5},
        {"shape": "rectangle", "width": 6, "height": 6,
         "transform": {"translate": [0, -0.5, 0], "rotate": [1, 0, 0, -90]}}]}"#;

#[test]
fn the_settings_that_reach_an_error_soonest_are_found_and_verified() {
    let bench = Bench::with_scene(LIT);
    let words =
        ["bench", "scene.json", "-o", "out", "--quick", "--target", "5%", "--seconds", "300"];
    let output = bench.run(&words);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let table = text(&output.stdout);
    assert!(table.contains("Soonest: ") && table.contains("'render.samples="), "{table}");
    let found = &bench.json("out/bench.json")["target"];
    let verified = &found["verified"];
    // It was rendered for itself, and is within the target; how long it took, no test asserts.
    assert!(verified["error"].as_f64().unwrap() <= 0.05, "{verified}");
    assert!(verified["samples"].as_u64().unwrap() >= 1);
    let names: Vec<&str> = found["contenders"]
        .as_array()
        .unwrap()
        .iter()
        .map(|c| c["name"].as_str().unwrap())
        .collect();
    let all = [
        "as the plan takes it",
        "independent samples",
        "2 surfaces",
        "a high build",
        "samples by the light",
    ];
    for name in all {
        assert!(names.contains(&name), "{names:?}");
    }
    // Independent samples are noisier than Sobol's points.
    let renders = found["renders"].as_array().unwrap();
    let error = |name: &str| {
        let of = |render: &&serde_json::Value| render["name"] == name && render["samples"] == 16;
        renders.iter().find(of).unwrap()["error"].as_f64().unwrap()
    };
    assert!(error("independent samples") > error("as the plan takes it"));
    let equal_time = found["equal_time"].as_array().unwrap();
    assert_eq!(equal_time[0]["name"], "as the plan takes it", "{equal_time:?}");
    assert!(table.contains("In the time that the soonest takes"), "{table}");
    for file in [
        "target.csv",
        "target-time.svg",
        "target-time.png",
        "target-equal-time.csv",
        "target-equal-time.png",
    ] {
        assert!(bench.path("out").join(file).is_file(), "{file}");
    }
    assert!(!bench.path("out/samplers.csv").exists(), "only what was asked for");
}

#[test]
fn numbers_of_accuracy_contend_for_a_target() {
    let bench = Bench::with_scene(LIT);
    let output = bench.run(&[
        "bench",
        "scene.json",
        "-o",
        "out",
        "--quick",
        "--target",
        "20%",
        "--seconds",
        "100",
        "--sweep",
        "accuracy.roulette_after",
        "--sweep",
        "accuracy.path_noise=0.1,1",
    ]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let found = &bench.json("out/bench.json")["target"];
    let contenders = found["contenders"].as_array().unwrap();
    let settings = |name: &str| {
        let contender = contenders.iter().find(|contender| contender["name"] == name);
        contender.unwrap_or_else(|| panic!("{name}: {contenders:?}"))["settings"].clone()
    };
    // A quarter, half, twice and four times 5, in whole numbers.
    for value in ["1", "3", "10", "20"] {
        let name = format!("accuracy.roulette_after {value}");
        assert_eq!(settings(&name), serde_json::json!([["accuracy.roulette_after", value]]));
    }
    settings("accuracy.path_noise 0.1");
    settings("accuracy.path_noise 1");
    let refused = |sweep: &str| {
        bench.refusal(&["bench", "scene.json", "-o", "no", "--target", "20%", "--sweep", sweep])
    };
    insta::assert_snapshot!(refused("render.seed"), @"
    error: --sweep render.seed: no number of `accuracy`, which alone are swept without values
    hint: write --sweep render.seed=VALUE,VALUE, or one of accuracy.band_error, accuracy.path_offset_of_edge, accuracy.path_offset_of_extent, accuracy.path_noise, accuracy.path_clearance, accuracy.path_absorption, accuracy.path_probes, accuracy.path_contact, accuracy.band_place_error, accuracy.band_share_error, accuracy.roulette_after, accuracy.dispersion_paths, accuracy.sample_sigmas, accuracy.sample_error, accuracy.sample_growth, accuracy.sample_floor, accuracy.view_psnr, accuracy.view_color_shift, accuracy.view_rays, accuracy.view_cubic_rays, accuracy.view_nodes, accuracy.white_samples, accuracy.pupil_margin, accuracy.pupil_radial_intervals, accuracy.pupil_planar_intervals, accuracy.pupil_wavelengths, accuracy.pupil_checks, accuracy.image_circle_error, accuracy.mask_aim_error, accuracy.lenslet_margin, accuracy.lenslet_nodes, accuracy.lenslet_checks, accuracy.wavefront_wavelengths, accuracy.wavefront_error, accuracy.spread_nodes, accuracy.spread_wavelengths, accuracy.spread_difference, accuracy.defocus_step, accuracy.spread_detail_cells, accuracy.spread_pixel_cells, accuracy.illumination_places, accuracy.illumination_rays, accuracy.fit_places, accuracy.tolerance_rays, accuracy.tolerance_samples, accuracy.deformation_error, accuracy.texture_lookups, accuracy.sky_rows, accuracy.matte_samples
    ");
    insta::assert_snapshot!(refused("accuracy.path_noise=-1"), @"
    error: --set accuracy.path_noise=-1: accuracy.path_noise: -1 is below the least, 0.000001
    hint: give a number from 1e-6 to 1000, or leave it out for 0.25
    ");
    insta::assert_snapshot!(refused("accuracy.pathnoise=1"), @"
    error: --set accuracy.pathnoise=1: accuracy.pathnoise: unknown key
    hint: did you mean `path_noise`? known: `band_error`, `band_place_error`, `band_share_error`, `defocus_step`, `deformation_error`, `dispersion_paths`, `fit_places`, `illumination_places`, `illumination_rays`, `image_circle_error`, `lenslet_checks`, `lenslet_margin`, `lenslet_nodes`, `mask_aim_error`, `matte_samples`, `path_absorption`, `path_clearance`, `path_contact`, `path_noise`, `path_offset_of_edge`, `path_offset_of_extent`, `path_probes`, `pupil_checks`, `pupil_margin`, `pupil_planar_intervals`, `pupil_radial_intervals`, `pupil_wavelengths`, `roulette_after`, `sample_error`, `sample_floor`, `sample_growth`, `sample_sigmas`, `sky_rows`, `spread_detail_cells`, `spread_difference`, `spread_nodes`, `spread_pixel_cells`, `spread_wavelengths`, `texture_lookups`, `tolerance_rays`, …
    ");
}

#[test]
fn a_target_that_is_none_is_refused() {
    let bench = Bench::with_scene(LIT);
    let messages = ["0", "150%", "-1%", "much"].map(|target| {
        let option = format!("--target={target}");
        under(&option, &bench.refusal(&["bench", "scene.json", "-o", "out", &option]))
    });
    insta::assert_snapshot!(messages.concat());
    let facing = "tracer={\"type\": \"facing\"}";
    let flat = ["bench", "scene.json", "-o", "out", "--target", "1%", "--set", facing];
    insta::assert_snapshot!(bench.refusal(&flat), @"
    error: --target: the scene has no picture of light, whose error samples could mend
    hint: name a `tracer` such as path
    ");
}
