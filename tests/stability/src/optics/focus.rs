//! Focus where there is none, and wavelengths that no glass knows.

use anyhow::Result;
use etendue_optics::train::{Focus, FocusError, ZemaxLens};

use super::bench::{YELLOW, lens};
use crate::{Case, Outcome, Scale};

pub(super) const FOCUS: Case = Case {
    name: "focus_at_and_within_the_focal_length",
    regime: "a thin lens of 50 mm focused at 50 mm, 30 mm, 0, a negative distance, NaN, at 0.1 to 10⁹ m, \
        10³⁰⁰ m and infinity; and a diverging lens",
    must: "at and within f an error that names the least distance; elsewhere 1/s′ = 1/f − 1/s to 10⁻¹²; \
        far away exactly f",
    limit: None,
    run: focus,
};

pub(super) const ZOOM: Case = Case {
    name: "configurations_of_a_zoom_lens",
    regime: "a Zemax file of two singlets with 2 to 50 configurations, each with curvatures, thicknesses and a stop of its \
        own",
    must: "each has the focal length of a paraxial ray through its own four surfaces, to 10⁻⁶, and the f-number of its own stop, whichever \
        others the file has; one beyond the last is refused",
    limit: None,
    run: zoom,
};

pub(super) const WAVELENGTH: Case = Case {
    name: "wavelength_outside_of_a_glass",
    regime: "an achromat at 2600 nm, where its glasses are not measured, and at 10 170 nm, where a formula \
        has no index",
    must: "a note of each glass and its range, once; an error that names glass and wavelength",
    limit: None,
    run: wavelength,
};

/// The numbers of a configuration: curvatures (1/mm), thicknesses (mm) behind all surfaces but the last, and the
/// diameter of the entrance pupil (mm).
struct Configuration {
    curvatures: [f64; 4],
    thicknesses: [f64; 3],
    pupil: f64,
}

impl Configuration {
    /// The `k`-th: every number goes its own way.
    fn of(k: u32) -> Self {
        let k = f64::from(k);
        Self {
            curvatures: [0.02 + 1e-4 * k, -0.01 - 2e-4 * k, 0.005 - 1e-4 * k, -0.015 + 5e-5 * k],
            thicknesses: [4.0 + 0.02 * k, 10.0 + 0.5 * k, 3.0 + 0.01 * k],
            pupil: 4.0 + 0.05 * k,
        }
    }

    /// The focal length (mm) of two glasses: a paraxial ray is refracted by `n' u' = n u − y (n' − n) c`, and is
    /// lower by `t u` at the next surface.
    fn focal_length(&self, indices: [f64; 2]) -> f64 {
        let [first, second] = indices;
        let (mut y, mut bent) = (1.0, 0.0);
        let behind = [first, 1.0, second, 1.0];
        let mut before = 1.0;
        for (k, (behind, curvature)) in behind.into_iter().zip(self.curvatures).enumerate() {
            bent -= y * (behind - before) * curvature;
            y += self.thicknesses.get(k).unwrap_or(&0.0) * bent / behind;
            before = behind;
        }
        -1.0 / bent
    }
}

fn zoom(scale: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let indices = [1.6, 1.7];
    let mut worst = 0.0_f64;
    let counts: &[u32] = scale.pick(&[2, 7], &[2, 3, 7, 20, 50]);
    for &count in counts {
        // A file stands at its first configuration.
        let own = Configuration::of(1);
        let mut text = format!(
            "MODE SEQ\nENPD {}\nFTYP 0 0 1 1\nYFLN 0\nWAVL 0.58756\nSURF 0\n  TYPE STANDARD\n  DISZ INFINITY\n",
            own.pupil
        );
        for (k, curvature) in own.curvatures.iter().enumerate() {
            let stop = if k == 0 { "  STOP\n" } else { "" };
            let glass = [Some(indices[0]), None, Some(indices[1]), None][k]
                .map_or_else(String::new, |n| format!("  GLAS ___BLANK 1 0 {n} 50\n"));
            let thickness = own.thicknesses.get(k).unwrap_or(&40.0);
            text += &format!(
                "SURF {}\n  TYPE STANDARD\n{stop}  CURV {curvature}\n  DISZ {thickness}\n{glass}  DIAM 8\n",
                k + 1
            );
        }
        text += &format!("SURF 5\n  TYPE STANDARD\n  DISZ 0\nMNUM {count} 1\n");
        // The last operand first: what belongs together does not stand together.
        for k in (1..=count).rev() {
            let of = Configuration::of(k);
            text += &format!("APER 0 {k} {} 0\n", of.pupil);
            for (surface, curvature) in of.curvatures.iter().enumerate() {
                text += &format!("CRVT {} {k} {curvature} 0\n", surface + 1);
            }
            for (surface, thickness) in of.thicknesses.iter().enumerate() {
                text += &format!("THIC {} {k} {thickness} 0 0\n", surface + 1);
            }
        }
        for k in 1..=count {
            let read = ZemaxLens::read_configuration(text.as_bytes(), Some(k as usize), &[])?;
            let train = read.file.build(&|name: &str| Err(format!("{name}: no files")))?;
            let paraxial = train.paraxial(YELLOW)?;
            let of = Configuration::of(k);
            let exact = of.focal_length(indices);
            let found = [paraxial.efl.unwrap_or(0.0), paraxial.f_number.unwrap_or(0.0)];
            for (found, exact) in found.into_iter().zip([exact, exact.abs() / of.pupil]) {
                let off = (found / exact - 1.0).abs();
                // The wavelength is the d line to five digits.
                outcome.must(off <= 1e-6, || format!("{k} of {count}: {found}, not {exact}"));
                worst = worst.max(off);
            }
        }
        let beyond = ZemaxLens::read_configuration(text.as_bytes(), Some(count as usize + 1), &[]);
        let message = beyond.err().map(|error| error.to_string()).unwrap_or_default();
        outcome.must(message.contains(&format!("has {count}")), || message.clone());
    }
    outcome.measured(format!("at most {worst:.1e} off"));
    Ok(outcome)
}

/// True if a focus is refused with these words.
fn says(focus: &Result<f64, FocusError>, words: &str) -> bool {
    focus.as_ref().is_err_and(|error| error.to_string().contains(words))
}

fn focus(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let train = lens(r#"{"type": "thin_lens", "focal_length": 50, "semi_diameter": 10}"#)?;
    let z = |distance| train.sensor_z(Focus::Distance(distance));
    let at = z(0.05);
    let message = at.err().map(|error| error.to_string()).unwrap_or_default();
    outcome.must(message.contains("is at the front focal point"), || message.clone());
    outcome.must(message.contains("must exceed 0.05 m"), || message.clone());
    outcome.measured(format!("at f: “{message}”"));
    let within = z(0.03);
    let is_virtual = says(&within, "has no real image behind the lens");
    outcome.must(is_virtual, || format!("{within:?}"));
    for distance in [0.0, -1.0, f64::NAN] {
        let none = z(distance);
        let refused = says(&none, "it must be a positive number");
        outcome.must(refused, || format!("at {distance} m: {none:?}"));
    }
    let mut worst = 0.0_f64;
    for s in [0.1, 1.2, 1e3, 1e9] {
        let exact = 1.0 / (1.0 / 50.0 - 1e-3 / s);
        worst = worst.max((z(s)? / exact - 1.0).abs());
    }
    outcome.measured(format!("from 0.1 to 10⁹ m: {worst:.0e} off the law, relatively"));
    outcome.must(worst <= 1e-12, || format!("{worst:e} off the law"));
    for distance in [1e300, f64::INFINITY] {
        let far = z(distance);
        outcome.must(far == Ok(50.0), || format!("at {distance:e} m: {far:?}"));
    }
    let diverging = lens(r#"{"type": "thin_lens", "focal_length": -50}"#)?;
    let virtual_image = diverging.sensor_z(Focus::Infinity);
    let place = says(&virtual_image, "it would be at z = -50 mm");
    outcome.must(place, || format!("diverging: {virtual_image:?}"));
    Ok(outcome)
}

fn wavelength(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let train = lens(
        r#"{"type": "surface", "radius": 61.47, "thickness": 6, "glass": "N-BK7", "semi_diameter": 12.5},
           {"type": "surface", "radius": -44.64, "thickness": 2.5, "glass": "N-SF5", "semi_diameter": 12.5},
           {"type": "surface", "radius": -129.94, "semi_diameter": 12.5}"#,
    )?;
    let inside = train.outside_of_range(&[550.0]);
    outcome.must(inside.is_empty(), || format!("at 550 nm: {inside:?}"));
    let notes = train.outside_of_range(&[2600.0]);
    let ranges = notes.iter().all(|note| note.contains("is known from"));
    outcome.must(notes.len() == 2 && ranges, || format!("at 2600 nm: {notes:?}"));
    outcome.must(train.at(2600.0).is_ok(), || "2600 nm is refused".to_owned());
    let message = train.at(10_170.0).err().map(|error| error.to_string()).unwrap_or_default();
    let named = message.contains("N-BK7 has no refractive index at 10170 nm");
    outcome.must(named, || format!("at 10 170 nm: \"{message}\""));
    outcome.measured(format!("2600 nm: “{}”", notes.join("”, “")));
    outcome.measured(format!("10 170 nm: “{message}”"));
    Ok(outcome)
}
