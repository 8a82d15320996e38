//! A comparison in words.

use std::fmt;

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
        writeln!(
            f,
            "model        chief ray (px)  centroid (px)  blur (px)  colour (px)  light (%)  \
             ns a sample  times as fast"
        )?;
        for finding in &self.models {
            line(f, finding)?;
        }
        for finding in self.models.iter().filter(|finding| finding.model != "full") {
            writeln!(f, "\n{}: {}", finding.model, where_it_misses(finding))?;
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
        let key = match self.cheapest {
            "undispersed" => ", which is `\"plan\": {\"dispersion\": false}`",
            _ => "",
        };
        write!(f, "cheapest within {pixels} px{light}: {}{key}{saving}", self.cheapest)
    }
}

fn line(f: &mut fmt::Formatter<'_>, finding: &Finding) -> fmt::Result {
    let Finding { model, chief_ray, centroid, blur, colour, light, .. } = finding;
    write!(
        f,
        "{model:11}  {:14.3}  {:13.3}  {:9.3}  {:11.3}  {:9.2}",
        chief_ray.value,
        centroid.value,
        blur.value,
        colour.value,
        100.0 * light.value
    )?;
    match (finding.seconds_a_sample, finding.speed) {
        (Some(seconds), Some(speed)) => write!(f, "  {:11.0}  {speed:13.2}", 1e9 * seconds)?,
        _ => write!(f, "  {:>11}  {:>13}", "-", "-")?,
    }
    writeln!(f, "{}", if finding.is_within { "  within" } else { "" })
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
