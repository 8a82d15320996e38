//! Light-field cameras: what their sensor sees through lenslets, against the views of an ideal lens.

use etendue_camera::{Camera, CameraRays, CameraSpec, FilmSamples, Projection};
use etendue_geometry::{Bounds, RayBatch};
use etendue_spectrum::Bands;
use glam::DVec3;

fn camera(json: &str) -> Result<Camera, String> {
    let spec: CameraSpec = serde_json::from_str(json).map_err(|e| e.to_string())?;
    let text = serde_json::to_string(&spec).unwrap();
    assert_eq!(spec, serde_json::from_str(&text).unwrap(), "{text}");
    spec.build(|| Bounds::EMPTY, &|name: &str| Err(format!("{name}: no files")))
        .map_err(|e| e.to_string())
}

/// A camera of 20 mm f/4, with keys of the microlenses and of the camera.
fn light_field(microlenses: &str, more: &str) -> Result<Camera, String> {
    camera(&format!(
        r#"{{"type": "light_field", "focal_length": 20, "f_number": 4, "focus_distance": 0.5,
            "microlenses": {{"pitch": 0.1, {microlenses} }}, {more}
            "pose": {{"from": [0, 0, 0.5], "look_at": [0, 0, 0]}},
            "sensor": {{"resolution": [240, 200], "pixel_pitch": 10}}}}"#
    ))
}

fn ray(camera: &Camera, [column, row]: [f64; 2]) -> Option<(DVec3, DVec3)> {
    let mut rays = RayBatch::default();
    camera.rays_through(&[column], &[row], &mut rays);
    (rays.t_max()[0] > 0.0).then(|| (rays.origin(0), rays.direction(0)))
}

/// Point of a ray at z (m).
fn at(z: f64, (origin, direction): (DVec3, DVec3)) -> DVec3 {
    origin + direction * ((z - origin.z) / direction.z)
}

/// The pixel under a lenslet and the pixel of the view see along the same line: all grids, both set-ups.
#[test]
fn a_pixel_under_a_lenslet_looks_along_the_ray_of_its_view() {
    let cases = [
        r#""rotation": 0"#,
        r#""rotation": 3, "offset": [0.02, -0.03]"#,
        r#""rotation": 45"#,
        r#""grid": "hexagonal", "rotation": -2, "aperture": "round""#,
        r#""picture_distance": 2, "focal_length": 0.3"#,
        r#""picture_distance": -1, "focal_length": 0.5"#,
    ];
    for microlenses in cases {
        let raw = light_field(microlenses, r#""views": 5,"#).unwrap();
        let views = raw.reference_views().unwrap();
        let light_field = raw.light_field().unwrap();
        let (rows, cols) = (light_field.grid.rows, light_field.grid.cols);
        assert!(rows > 5 && cols > 5, "{microlenses}: {rows} x {cols}");
        assert_eq!(views.resolution(), [5 * cols, 5 * rows]);
        for (row, col) in [(0, 0), (rows / 2, cols / 2), (rows - 1, 1), (3, cols - 1)] {
            let centre = light_field.centre(raw.lens().unwrap(), row, col).unwrap();
            for (across, down) in [(2, 2), (0, 2), (4, 1), (1, 3)] {
                let [right, below] = light_field.offset(across, down);
                let seen = ray(&raw, [centre[0] + right, centre[1] + below]).unwrap();
                let place = [f64::from(across * cols + col), f64::from(down * rows + row)];
                let expected = ray(&views, place.map(|x| x + 0.5)).unwrap();
                for z in [0.4, 0.0, -2.0] {
                    let off = (at(z, seen) - at(z, expected)).length();
                    // The lens is ideal; Newton's method leaves 1e-9 mm on the stop.
                    assert!(off < 1e-9, "{microlenses} {row} {col} {across} {down} {z}: {off}");
                }
            }
        }
    }
}

/// Disparities by rays: a point that the middle view sees is seen from the next view where the formula
/// says.
#[test]
fn disparity_follows_the_formula_at_five_depths() {
    let grids = [
        (r#""f_number": 4"#, 1.0),
        (r#""rotation": 7"#, 1.0),
        (r#""rotation": 45"#, 1.0),
        (r#""rotation": -160"#, 1.0),
        (r#""grid": "hexagonal""#, 0.75_f64.sqrt()),
        (r#""grid": "hexagonal", "rotation": 11"#, 0.75_f64.sqrt()),
    ];
    for (microlenses, height) in grids {
        let raw = light_field(microlenses, "").unwrap();
        let camera = raw.reference_views().unwrap();
        let Projection::Views(views) = camera.projection() else { panic!() };
        assert!((views.focus() - 0.5).abs() < 1e-12, "{}", views.focus());
        assert!((views.row_height() - height).abs() < 1e-15, "{microlenses}");
        assert_eq!(views.disparity(views.focus()), 0.0);
        let [cols, rows] = views.view_resolution().map(f64::from);
        let middle = f64::from(views.views() / 2);
        for depth in [0.3, 0.4, 0.5, 0.8, 3.0] {
            let (column, row) = ((0.5 * cols).floor(), (0.5 * rows).floor());
            // Where a column and a row of a view see the plane.
            let seen = |view: [f64; 2], column: f64, row: f64| {
                let place = [view[0] * cols + column + 0.5, view[1] * rows + row + 0.5];
                at(0.5 - depth, ray(&camera, place).unwrap()).truncate()
            };
            let point = seen([middle; 2], column, row);
            let disparity = views.disparity(depth);
            for (next, expected) in
                [([1.0, 0.0], [-disparity, 0.0]), ([0.0, 1.0], [0.0, -disparity / height])]
            {
                let next = next.map(|step| middle + step);
                // A view's picture is linear in columns and, two by two in a hexagonal grid, in rows.
                let here = seen(next, column, row);
                let along = seen(next, column + 1.0, row) - here;
                let across = 0.5 * (seen(next, column, row + 2.0) - here);
                let away = point - here;
                let area = along.perp_dot(across);
                let shift = [away.perp_dot(across) / area, along.perp_dot(away) / area];
                for (found, expected_here) in shift.iter().zip(expected) {
                    let off = (found - expected_here).abs();
                    assert!(off < 1e-9, "{microlenses} {depth}: {shift:?} and {expected:?}");
                }
            }
        }
    }
}

/// Pixels at one offset behind the lenslets are views where lenslets image the opening, and only there:
/// b/f − 1 of a lenslet's width is how far parallel light is spread.
#[test]
fn only_cameras_whose_lenslets_image_the_opening_have_views() {
    let why = |microlenses: &str| {
        let camera = light_field(microlenses, "").unwrap();
        camera.no_views().map(str::to_owned).unwrap_or_default()
    };
    for microlenses in [
        r#""rotation": 360"#,
        r#""grid": "hexagonal", "aperture": "round", "rotation": -45"#,
        r#""radii": [0.3, null], "thickness": 0.4, "glass": "N-BK7""#,
        // 0.1 mm x 0.09 are 0.9 pixels of 10 um.
        r#""focal_length": 0.4, "sensor_distance": 0.436"#,
        r#""types": [{"focal_length": 0.4}, {"focal_length": 0.43}], "pattern": [[0, 1]]"#,
    ] {
        assert_eq!(why(microlenses), "", "{microlenses}");
    }
    let cases = [
        (r#""picture_distance": 0.3, "sensor_distance": 0.4"#, "focused"),
        (r#""picture_distance": -0.9, "sensor_distance": 0.4"#, "focused"),
        (r#""picture_distance": 2, "focal_length": 0.3"#, "1.8 pixels"),
        (r#""picture_distance": -1, "focal_length": 0.5"#, "focused"),
        (r#""focal_length": 0.4, "sensor_distance": 0.444"#, "1.1 pixels"),
        (
            r#""types": [{"focal_length": 0.4}, {"focal_length": 0.5}], "pattern": [[0, 1]]"#,
            "2.0 pixels",
        ),
        // 0.15 mm x 5/20.83 are 3.6 pixels.
        (r#""focal_length": 0.15"#, "3.60 pixels"),
        (r#""focal_length": 0.7"#, "fewer than 5"),
        // Images that overlap by more than a half, of an unfocused camera and of a focused one.
        (r#""focal_length": 0.75"#, "f-number of the main lens"),
        (r#""picture_distance": -3, "sensor_distance": 0.9"#, "fewer than 5"),
        // Images are 28 times as wide as they are apart.
        (r#""picture_distance": 0.41, "focal_length": 0.4"#, "fewer than 5"),
    ];
    let said = cases.iter().map(|&(microlenses, words)| (microlenses, words, why(microlenses)));
    let misses: Vec<_> = said.filter(|(_, words, why)| !why.contains(words)).collect();
    assert!(misses.is_empty(), "{misses:#?}");
}

/// The focal length that makes images touch, and the sentences when they do not.
#[test]
fn distances_follow_from_f_numbers_and_mismatches_are_told() {
    let matched = light_field("\"fill\": 1", "").unwrap();
    let lens = matched.lens().unwrap();
    let [diameter, pitch] = lens.lenslets().unwrap().fit();
    assert!((diameter / pitch - 1.0).abs() < 1e-12, "{diameter} {pitch}");
    // The image of 0.5 m is 20.8333 mm behind the lens; b = p D/(d − p).
    let distance = 1.0 / (1.0 / 20.0 - 1.0 / 500.0);
    let expected = 0.1 * distance / (5.0 - 0.1);
    let focused = lens.focused();
    let b = focused.sensor_z() - focused.train().last_vertex();
    assert!((b - expected).abs() < 1e-12, "{b} {expected}");
    assert!((focused.object_distance() - 0.5).abs() < 1e-12);
    let implausible = |camera: &Camera| camera.lens().unwrap().implausible().join("; ");
    assert!(!implausible(&matched).contains("lenslets"), "{}", implausible(&matched));
    assert!(implausible(&light_field(r#""f_number": 6"#, "").unwrap()).contains("overlap"));
    assert!(implausible(&light_field(r#""f_number": 3"#, "").unwrap()).contains("dark"));
    let opaque = light_field(r#""transmission": 0"#, "").unwrap_err().to_string();
    assert!(opaque.contains("no light gets through any lenslet"), "{opaque}");
}

#[test]
fn thick_lenslets_stand_where_they_see_the_picture_sharp() {
    let thick = light_field(
        r#""grid": "hexagonal", "radii": [0.3, null], "thickness": 0.4, "glass": "N-BK7""#,
        "",
    )
    .unwrap();
    let focused = thick.lens().unwrap().focused();
    assert!((focused.object_distance() - 0.5).abs() < 1e-9, "{}", focused.object_distance());
    // Parallel light of a lenslet comes together on the sensor: n R/(n − 1) in glass.
    let n = 1.516_80;
    let in_air = (n * 0.3 / (n - 1.0) - 0.4) / n;
    let b = focused.sensor_z() - focused.train().last_vertex();
    assert!((b - in_air).abs() < 1e-4, "{b} {in_air}: the index is that to 5 digits");
}

/// A camera with planoconvex lenslets of a radius and thickness (mm), on pixels of 5 um.
fn planoconvex(radius: f64, thickness: f64) -> Camera {
    camera(&format!(
        r#"{{"type": "light_field", "focal_length": 20, "f_number": 4, "focus_distance": 0.5,
            "microlenses": {{"pitch": 0.1, "radii": [{radius}, null], "thickness": {thickness},
                "glass": "N-BK7"}},
            "pose": {{"from": [0, 0, 0.5], "look_at": [0, 0, 0]}},
            "sensor": {{"resolution": [480, 400], "pixel_pitch": 5}}}}"#
    ))
    .unwrap()
}

/// Thick lenslets of focal length R/(n − 1) image the opening of 5 mm at 20.83 mm: as wide as that is, so many
/// views there are, all of whose pixels are within a round image.
#[test]
fn views_are_as_many_as_images_are_wide() {
    for (radius, views) in [(0.215, 11), (0.13, 7), (0.1, 5)] {
        let camera = planoconvex(radius, 0.05);
        let light_field = camera.light_field().unwrap();
        // The index is that to 5 digits; the pupil is seen from the principal plane, nearer by up to 0.1 mm.
        let width = radius / 0.516_80 * 5.0 / (1.0 / (1.0 / 20.0 - 1.0 / 500.0)) / 5e-3;
        let found = light_field.image_diameter;
        assert!((found / width - 1.0).abs() < 0.005, "{radius}: {found} {width}");
        assert_eq!((light_field.views, light_field.step), (views, 1.0), "{radius}: {found} px");
        let [right, below] = light_field.offset(views - 1, views - 1);
        assert!(right.hypot(below) < 0.5 * found - 1.5, "{radius}: {right} of {found} px");
    }
}

/// Behind a front face that bends, glass of thickness t and a flat one, the ray of slope s through the vertex gets
/// to the sensor at s (t/n + b): n is that of each colour, by Sellmeier's formula of N-BK7.
#[test]
fn images_in_each_colour_have_their_own_middles() {
    let index = |nm: f64| {
        let l2 = (nm * 1e-3).powi(2);
        let term = |b: f64, c: f64| b * l2 / (l2 - c);
        let sum = term(1.039_612_12, 0.006_000_698_67)
            + term(0.231_792_344, 0.020_017_914_4)
            + term(1.010_469_45, 103.560_653);
        (1.0 + sum).sqrt()
    };
    let thickness = 0.3;
    let raw = planoconvex(0.3, thickness);
    let (lens, light_field) = (raw.lens().unwrap(), raw.light_field().unwrap());
    let bands = lens.lenslets_by_band(&Bands::Rgb).unwrap();
    assert_eq!(bands.len(), 3);
    let b = lens.focused().sensor_z() - lens.focused().train().last_vertex();
    let middle = lens
        .focused()
        .pixel_of(lens.lenslets().unwrap().view().centre(light_field.grid.cell(0, 0)));
    let away = |of| light_field.centre_by(lens, of, 0, 0).unwrap()[0] - middle[0];
    let by_design = light_field.centre(lens, 0, 0).unwrap()[0] - middle[0];
    let [red, green, blue] = [609.5, 547.6, 455.5].map(|nm| thickness / index(nm) + b);
    for (k, expected) in [red, green, blue].into_iter().enumerate() {
        let share = away(&bands[k]) / by_design;
        let expected = expected / (thickness / index(587.6) + b);
        // Chief rays are solved to 1e-9 mm, and design wavelengths differ by 0.04 nm.
        assert!((share - expected).abs() < 1e-6, "{k}: {share} {expected}");
    }
    assert!(away(&bands[0]) / away(&bands[2]) > 1.001, "red and blue are apart");
    let thin = light_field_of_thin();
    assert!(thin.lens().unwrap().lenslets_by_band(&Bands::Rgb).unwrap().is_empty());
}

fn light_field_of_thin() -> Camera {
    light_field("\"fill\": 1", "").unwrap()
}

/// The light of a lenslet's image, by its middle: the sum over samples of all pixels around it.
#[test]
fn the_centroid_of_a_white_image_is_the_lenslets_centre() {
    for microlenses in [r#""rotation": 3"#, r#""grid": "hexagonal", "aperture": "round""#] {
        let raw = light_field(microlenses, "").unwrap();
        let light_field = raw.light_field().unwrap();
        for (row, col) in [(0, 0), (light_field.grid.rows - 1, 2)] {
            let [x, y] = light_field.centre(raw.lens().unwrap(), row, col).unwrap();
            let mut samples = FilmSamples::default();
            let half = 0.5 * light_field.image_pitch;
            for k in 0..40_000_u32 {
                let r = |alpha: f64| (0.5 + alpha * f64::from(k)).fract();
                let away = [r(0.856_674_883), r(0.733_891_857)].map(|u| (2.0 * u - 1.0) * half);
                samples.push([x + away[0], y + away[1]], [r(0.628_706_721), r(0.538_597_270)], 0.5);
            }
            let mut rays = CameraRays::default();
            raw.opened(&Bands::Rgb).unwrap().sample_rays(&samples, &mut rays);
            let (mut sum, mut mean) = (0.0, [0.0; 2]);
            for (weight, sample) in rays.weight.iter().zip(&rays.sample) {
                let i = *sample as usize;
                // What comes through the lenslet's neighbours is outside of the circle.
                let away = [samples.columns[i] - x, samples.rows[i] - y];
                if away[0].hypot(away[1]) < half {
                    sum += weight;
                    mean = [mean[0] + weight * away[0], mean[1] + weight * away[1]];
                }
            }
            let off = (mean[0] / sum).hypot(mean[1] / sum);
            // cos⁴ falls across an image by 4 × 0.06 × 1/8 of its light at slope 0.06 off the axis, which
            // moves its centroid by 0.0375 of 1 pixel.
            assert!(off < 0.045, "{microlenses} {row} {col}: {off} px");
        }
    }
}

/// Text of an error, or a note that there is none.
fn refused(camera: Result<Camera, String>) -> String {
    camera.err().unwrap_or_else(|| "it is accepted".to_owned())
}

#[test]
fn what_is_no_light_field_is_refused_in_words() {
    // Of the lenslets and of the camera itself: numbers out of range, pictures that lenslets do not image, images that
    // vanish, faces that gather nothing or too soon, and types.
    let cases = [
        (r#""rotation": 361"#, "", "a turn"),
        (r#""rotation": -400"#, "", "a turn"),
        (r#""rotation": 1e300"#, "", "a turn"),
        (r#""fill": 2"#, "", "fill is 2"),
        (r#""fill": 1"#, r#""views": 20,"#, "views: 20 views"),
        (r#""fill": 1"#, r#""refocus_distance": 0,"#, "refocus_distance"),
        (r#""fill": 1"#, r#""refocus_distance": -1,"#, "refocus_distance"),
        (r#""focal_length": 1, "f_number": 2"#, "", "remove one"),
        (r#""picture_distance": -30"#, "", "microlenses.picture_distance"),
        (r#""picture_distance": 1, "focal_length": 2"#, "", "sensor_distance"),
        (
            r#""picture_distance": 0.3, "focal_length": 0.4"#,
            "",
            "farther away than the focal length",
        ),
        (r#""picture_distance": 0.01"#, "", "half the pitch of 0.1 mm"),
        (r#""picture_distance": -0.01"#, "", "half the pitch of 0.1 mm"),
        (r#""picture_distance": -20.5"#, "", "smaller than a pixel"),
        // A sensor so near sees an image of a pixel of the opening, or less.
        (r#""picture_distance": 2, "sensor_distance": 0.02"#, "", "smaller than a pixel"),
        (
            r#""radii": [null, null], "thickness": 0.1, "glass": "N-BK7""#,
            "",
            "give one face a radius",
        ),
        (r#""radii": [0.1, null], "thickness": 0.4, "glass": "N-BK7""#, "", "thinner"),
        // Thick lenslets that spread light, or behind which the picture is within the glass, have no image behind them.
        (
            r#""radii": [-0.3, null], "thickness": 0.1, "glass": "N-BK7""#,
            "",
            "microlenses.sensor_distance",
        ),
        (
            r#""radii": [0.1, null], "thickness": 0.33, "glass": "N-BK7", "picture_distance": 2"#,
            "",
            "thinner",
        ),
        (
            r#""radii": [0.2, null], "thickness": 0.1, "glass": "N-BK7", "types": [{}, {}]"#,
            "",
            "remove those, or `radii`",
        ),
        (
            r#""types": [{"focal_length": 0.4}], "pattern": [[0, 1]]"#,
            "",
            "names type 1; there are 0 to 0",
        ),
        (
            r#""types": [{"focal_length": 0.4}, {"focal_length": 0}]"#,
            "",
            "types[1]: focal_length is 0 mm",
        ),
        (r#""size": [0.05, 0.05]"#, "", "not one lenslet"),
        (r#""radii": [0.3, null]"#, "", "missing beside `radii`"),
    ];
    let misses: Vec<String> = cases
        .iter()
        .map(|&(microlenses, more, words)| {
            (microlenses, words, refused(light_field(microlenses, more)))
        })
        .filter(|(_, words, error)| !error.contains(words))
        .map(|(microlenses, words, error)| format!("{microlenses}: {error:?} without {words:?}"))
        .collect();
    assert!(misses.is_empty(), "{misses:#?}");
    assert!(light_field("\"fill\": 1", "\"refocus_distance\": \"infinity\",").is_ok());
}

#[test]
fn cameras_that_lack_what_a_light_field_needs_are_refused_in_words() {
    let base = |keys: &str| camera(&format!(r#"{{"type": "light_field", {keys}}}"#)).unwrap_err();
    let sensor = r#""sensor": {"resolution": [240, 200], "pixel_pitch": 10}"#;
    assert!(
        base(&format!(
            r#""microlenses": {{"pitch": 0}}, "focal_length": 9, "f_number": 2, {sensor}"#
        ))
        .contains("not above zero")
    );
    assert!(
        base(&format!(
            r#""microlenses": {{"pitch": 0.015}}, "focal_length": 9, "f_number": 2, {sensor}"#
        ))
        .contains("pixels apart")
    );
    assert!(
        base(&format!(
            r#""microlenses": {{"pitch": 5}}, "focal_length": 9, "f_number": 2, {sensor}"#
        ))
        .contains("exit pupil")
    );
    let tiny = r#""microlenses": {"pitch": 0.1, "focal_length": 0.4}, "focal_length": 20, "f_number": 400"#;
    assert!(base(&format!("{tiny}, {sensor}")).contains("smaller than a pixel"));
    assert!(
        base(&format!(r#""microlenses": {{"pitch": 0.1}}, {sensor}"#)).contains("focal_length")
    );
    assert!(
        base(r#""microlenses": {"pitch": 0.1}, "focal_length": 9, "f_number": 2"#)
            .contains("pixel_pitch")
    );
}
