//! Focus where there is none, and wavelengths that no glass knows.

use anyhow::Result;
use etendue_optics::train::{Focus, FocusError};

use super::bench::lens;
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

pub(super) const WAVELENGTH: Case = Case {
    name: "wavelength_outside_of_a_glass",
    regime: "an achromat at 2600 nm, where its glasses are not measured, and at 10 170 nm, where a formula \
        has no index",
    must: "a note of each glass and its range, once; an error that names glass and wavelength",
    limit: None,
    run: wavelength,
};

fn focus(_: Scale) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let train = lens(r#"{"type": "thin_lens", "focal_length": 50, "semi_diameter": 10}"#)?;
    let z = |distance| train.sensor_z(Focus::Distance(distance));
    let at = z(0.05);
    let least = matches!(at, Err(FocusError::AtFocalPoint { least: 0.05, .. }));
    outcome.must(least, || format!("at f: {at:?}"));
    let message = at.err().map(|error| error.to_string()).unwrap_or_default();
    outcome.must(message.contains("must exceed 0.05 m"), || message.clone());
    outcome.measured(format!("at f: “{message}”"));
    let within = z(0.03);
    outcome.must(matches!(within, Err(FocusError::Virtual { .. })), || format!("{within:?}"));
    for distance in [0.0, -1.0, f64::NAN] {
        let none = z(distance);
        let refused = matches!(none, Err(FocusError::NotPositive { .. }));
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
    let told = matches!(virtual_image, Err(FocusError::Virtual { image: -50.0, .. }));
    outcome.must(told, || format!("diverging: {virtual_image:?}"));
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
