//! A comparison in words.

use std::fmt;

use etendue_report::{Cell, Table};

use super::{Comparison, Finding, Worst};

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
            if finding.model != "full" {
                writeln!(f, "\n{}: {}; {scene} takes it", finding.model, where_it_misses(finding))?;
            }
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
            Some(saving) if self.cheapest != "full" => {
                format!("; its picture took 1/{saving:.2} of the full train's time here")
            }
            _ => String::new(),
        };
        write!(f, "cheapest within {pixels} px{light}: {}{saving}", self.cheapest)
    }
}

fn cells(finding: &Finding) -> Vec<(&'static str, Cell)> {
    let Finding { model, chief_ray, centroid, blur, colour, light, .. } = finding;
    let pixels = |worst: &Worst| Cell::number(worst.value, format!("{:.3}", worst.value));
    let percent = 100.0 * light.value;
    let number = |value: Option<f64>, decimals: usize| {
        value.map_or_else(Cell::none, |value| Cell::number(value, format!("{value:.decimals$}")))
    };
    vec![
        ("model", Cell::word(*model)),
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

/// Where the greatest differences of a model are.
fn where_it_misses(finding: &Finding) -> String {
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
