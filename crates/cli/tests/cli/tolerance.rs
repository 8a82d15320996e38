//! A tolerance on the command line: obeyed, told, verified, and refused where it makes no sense.

use serde_json::{Value, json};

use crate::run::{Bench, text, under};

fn scene() -> Value {
    json!({
        "etendue": 1,
        "camera": { "type": "thin_lens", "focal_length": 50, "f_number": 22, "focus_distance": "3 m",
            "sensor_height": "24 mm", "sensor": { "resolution": [96, 64] },
            "pose": { "from": [0, 0.6, 3], "look_at": [0, 0.2, 0] } },
        "tracer": { "type": "path" },
        "lights": [{ "type": "environment", "radiance": [1, 1, 1] }],
        "materials": { "grey": { "type": "matte", "color": [0.2, 0.2, 0.2] } },
        "objects": [{ "shape": "sphere", "radius": 0.3, "material": "grey",
                "transform": { "translate": [0, 0.3, 0] } },
            { "shape": "rectangle", "width": 9, "height": 9, "material": "grey",
              "transform": { "rotate": [1, 0, 0, -90] } }],
        "render": { "samples": 64, "accel": "bvh" },
    })
}

#[test]
fn a_tolerance_is_obeyed_told_and_verified() {
    let bench = Bench::with_scene(&scene().to_string());
    let plan = |more: &[&str]| {
        let output = bench.run(&[&["plan", "scene.json", "--json"], more].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        let rows: Value = serde_json::from_slice(&output.stdout).unwrap();
        let rows = rows.as_array().unwrap().clone();
        let of = |what: &str| rows.iter().find(|row| row["what"] == what).cloned();
        (of("tolerance"), of("shadows and bounces").unwrap(), text(&output.stderr))
    };
    let (none, bounces, _) = plan(&[]);
    assert!(none.is_none() && bounces["choice"] == "at most 32", "{none:?} {bounces}");
    let (row, bounces, told) = plan(&["--tolerance", "0.5 px, 4 %", "--verify"]);
    let row = row.unwrap();
    assert_eq!((&row["choice"], &row["forced"]), (&json!("0.5 px, 4 % of light"), &json!(true)));
    assert!(row["because"].as_str().unwrap().contains("the lens as `"), "{row}");
    assert!(bounces["key"] == "tolerance" && bounces["choice"] != "at most 32", "{bounces}");
    assert!(told.contains("verified: within the tolerance"), "{told}");
    // The render does as planned, and its picture is another one.
    bench.render(&["--outputs", "npy"]);
    let full = bench.array("picture");
    let output = bench.run(&[
        "render",
        "scene.json",
        "-o",
        "out",
        "--outputs",
        "npy",
        "--tolerance",
        "0.5 px, 4 %",
        "--verify",
    ]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(
        text(&output.stderr).contains("verified: within the tolerance"),
        "{}",
        text(&output.stderr)
    );
    let own = bench.array("picture");
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let off = mean(&own) / mean(&full) - 1.0;
    assert!(own != full && off.abs() < 0.04, "{off}");
}

#[test]
fn what_makes_no_tolerance_is_refused_with_its_place_and_a_remedy() {
    let bench = Bench::with_scene(&scene().to_string());
    let commands: [&[&str]; 9] = [
        &["--tolerance", "0.5 px"],
        &["--tolerance", "2 %"],
        &["--set", "tolerance={\"displacement\": \"0.5 px\", \"light\": 0}"],
        &["--set", "tolerance={\"displacement\": \"0.5 m\", \"light\": 0.1}"],
        &["--set", "tolerance={\"displacement\": -1, \"light\": 0.1}"],
        &["--set", "tolerance={\"displacement\": 1, \"light\": \"100 %\"}"],
        &["--tolerance", "1 px,1 %", "--set", "plan.dispersion=true"],
        &["--verify"],
        &["--set", "camera={\"type\": \"pinhole\", \"falloff\": {\"axis\": 0}}"],
    ];
    let messages = commands.map(|more| {
        let arguments = [&["render", "scene.json", "-o", "out", "--quiet"], more].concat();
        under(&more.join(" "), &bench.refusal(&arguments))
    });
    insta::assert_snapshot!(messages.concat());
}

/// A falloff multiplies samples of light by its polynomial, and leaves data as they are.
#[test]
fn a_pinhole_with_a_falloff_gets_darker_from_the_axis() {
    let mut scene = scene();
    scene["camera"] = json!({ "type": "pinhole", "sensor": { "resolution": [32, 32] },
        "intrinsics": { "fx": 20, "fy": 20, "cx": 16, "cy": 16, "pixel_origin": "corner" },
        "pose": { "from": [0, 0.6, 3], "look_at": [0, 0.6, 0] } });
    scene["objects"] = json!([]);
    scene["layers"] = json!(["depth"]);
    let bench = Bench::with_scene(&scene.to_string());
    bench.render(&["--outputs", "npy"]);
    let even = bench.array("picture");
    let falloff = "camera.falloff={\"axis\": 0.8, \"a1\": -0.6, \"a2\": 0.2, \"a3\": -0.05}";
    bench.render(&["--outputs", "npy", "--set", falloff]);
    let own = bench.array("picture");
    assert_eq!(even.len(), own.len());
    for pixel in 0..32 * 32 {
        let [x, y] = [pixel % 32, pixel / 32].map(|i| (i as f64 + 0.5 - 16.0) / 20.0);
        let u = x * x + y * y;
        let wanted = 0.8 * (1.0 - 0.6 * u + 0.2 * u * u - 0.05 * u * u * u);
        let found = own[3 * pixel] / even[3 * pixel];
        // The mean over a pixel of 1/20 in r is that at its middle to (1/20)² of the curvature, 1.2.
        assert!((found - wanted).abs() < 2e-3, "pixel {pixel}: {found} for {wanted}");
    }
}

#[test]
fn detail_is_left_out_of_the_picture_alone_told_and_verified() {
    let scene = json!({
        "etendue": 1,
        "camera": { "type": "pinhole", "fov": 40, "sensor": { "resolution": [72, 48] },
            "pose": { "from": [0, 0, 2.4], "look_at": [0, 0, 0] } },
        "tracer": { "type": "direct" },
        "lights": [{ "type": "directional", "direction": [-1, -1, -1], "irradiance": [3, 3, 3] }],
        "materials": { "grey": { "type": "matte", "color": [0.5, 0.5, 0.5] } },
        "objects": [{ "shape": "sphere", "radius": 0.3, "triangles": 600_000, "material": "grey" }],
        "render": { "samples": 16, "accel": "bvh" }, "tolerance": { "displacement": "0.5 px", "light": "2 %" },
    });
    let bench = Bench::with_scene(&scene.to_string());
    let output = bench.run(&["plan", "scene.json", "--json", "--verify"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let rows: Value = serde_json::from_slice(&output.stdout).unwrap();
    let row = rows.as_array().unwrap().iter().find(|row| row["what"] == "tolerance").unwrap();
    let because = row["because"].as_str().unwrap();
    assert!(because.contains("triangles, of which places are displaced by 0.438 px"), "{because}");
    let told = text(&output.stderr);
    assert!(told.contains("verified: within the tolerance"), "{told}");
    // The render has fewer triangles; data beside the picture have all of them again.
    let triangles = |more: &[&str]| {
        let output = bench.run(
            &[
                &["render", "scene.json", "-o", "out", "--outputs", "npy", "--report", "r.json"],
                more,
            ]
            .concat(),
        );
        assert!(output.status.success(), "{}", text(&output.stderr));
        bench.json("r.json")["triangles_unique"].as_u64().unwrap()
    };
    let all = triangles(&["--layers", "depth"]);
    assert!(all >= 600_000 && triangles(&[]) < all / 4, "{all}");
    // Nor is anything left out without a tolerance.
    assert_eq!(triangles(&["--set", "tolerance=null"]), all);
}
