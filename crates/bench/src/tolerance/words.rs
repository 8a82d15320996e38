//! A comparison in words.

use std::fmt;

use etendue_render::tolerance::lens_models::LensModelKind;
use etendue_report::{Cell, Table};

use super::{Comparison, ModelError, WaveFinding, Worst};

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "What a pixel sees through each model of the lens, against the full train: the greatest \
             difference at {} places of the picture, at the depths that the scene has there{}.\n",
            self.places.len(),
            self.range()
        )?;
        write!(f, "{}", Table::of_rows(self.models.iter().map(cells).collect()))?;
        for (finding, scene) in self.models.iter().zip(&self.scenes) {
            if finding.model != LensModelKind::Full {
                writeln!(f, "\n{}: {}; {scene} takes it", finding.model, where_it_misses(finding))?;
            }
        }
        if let Some(first) = self.waves.first() {
            writeln!(
                f,
                "\nThe full train by rays, and by waves as `camera.diffraction` spreads light: the modulation of a \
                 quarter of a cycle a pixel at {} nm, along y and along x.\n",
                first.wavelength
            )?;
            write!(f, "{}", Table::of_rows(self.waves.iter().map(of_waves).collect()))?;
            let most = self.waves.iter().map(WaveFinding::difference).fold(0.0, f64::max);
            writeln!(
                f,
                "\nconvolved: at most {most:.3} of the modulation; {{\"camera\":{{\"diffraction\":true}}}} takes it"
            )?;
        }
        writeln!(f)?;
        for note in &self.notes {
            writeln!(f, "note: {note}")?;
        }
        self.verdict(f)
    }
}

impl Comparison {
    fn range(&self) -> String {
        match self.depths[..] {
            [near, far] if far.is_finite() => format!(", {near:.3} to {far:.3} m"),
            [near, _] if near.is_finite() => format!(", {near:.3} m to infinity"),
            [only] if only.is_finite() => format!(", {only:.3} m"),
            _ => String::new(),
        }
    }

    fn verdict(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let pixels = self.tolerance.pixels;
        let light = match self.tolerance.light {
            Some(share) => format!(" and {} % of light", 100.0 * share),
            None => " (light is told and not judged: give a share as well, such as \
                     --tolerance \"0.5 px,5 %\")"
                .to_owned(),
        };
        let saving = match self.saving {
            Some(saving) if self.cheapest != LensModelKind::Full => {
                format!("; its picture took 1/{saving:.2} of the full train's time here")
            }
            _ => String::new(),
        };
        write!(f, "cheapest within {pixels} px{light}: {}{saving}", self.cheapest)
    }
}

fn cells(finding: &ModelError) -> Vec<(&'static str, Cell)> {
    let ModelError { model, chief_ray, centroid, blur, colour, light, .. } = finding;
    let pixels = |worst: &Worst| Cell::number(worst.value, format!("{:.3}", worst.value));
    let percent = 100.0 * light.value;
    let number = |value: Option<f64>, decimals: usize| {
        value.map_or_else(Cell::none, |value| Cell::number(value, format!("{value:.decimals$}")))
    };
    vec![
        ("model", Cell::word(model.name())),
        ("chief ray (px)", pixels(chief_ray)),
        ("centroid (px)", pixels(centroid)),
        ("blur (px)", pixels(blur)),
        ("colour (px)", pixels(colour)),
        ("light (%)", Cell::number(percent, format!("{percent:.2}"))),
        ("ns a sample", number(finding.seconds_a_sample.map(|seconds| 1e9 * seconds), 0)),
        ("times as fast", number(finding.speed, 2)),
        ("", Cell::word(if finding.is_within { "within" } else { "" })),
    ]
}

fn of_waves(finding: &WaveFinding) -> Vec<(&'static str, Cell)> {
    let shown = |value: f64| Cell::number(value, format!("{value:.3}"));
    let ([rays_y, rays_x], [waves_y, waves_x]) = (finding.rays, finding.waves);
    vec![
        ("column (px)", Cell::number(finding.at[0], format!("{:.0}", finding.at[0]))),
        ("row (px)", Cell::number(finding.at[1], format!("{:.0}", finding.at[1]))),
        ("depth (m)", finding.depth.map_or_else(|| Cell::word("infinity"), shown)),
        ("rays, y", shown(rays_y)),
        ("waves, y", shown(waves_y)),
        ("rays, x", shown(rays_x)),
        ("waves, x", shown(waves_x)),
    ]
}

/// Words for where the greatest differences of a model are.
fn where_it_misses(finding: &ModelError) -> String {
    let place = |name: &str, worst: &Worst| {
        let [column, row] = worst.at;
        let depth = match worst.depth {
            Some(depth) => format!(", {depth:.3} m away"),
            None => String::new(),
        };
        (worst.value > 0.0).then(|| format!("{name} at ({column:.0}, {row:.0}){depth}"))
    };
    let all = [
        place("chief ray", &finding.chief_ray),
        place("centroid", &finding.centroid),
        place("blur", &finding.blur),
        place("colour", &finding.colour),
        place("light", &finding.light),
    ];
    let all: Vec<String> = all.into_iter().flatten().collect();
    if all.is_empty() { "the same".to_owned() } else { format!("most {}", all.join("; ")) }
}
