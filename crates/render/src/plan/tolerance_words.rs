//! Notes, in words, on what is taken of a scene's tolerance.

use etendue_report::{Decision, DecisionKind as Kind};
use etendue_scene::Scene;

use super::Plan;
use crate::tolerance::{TakenBounces, TakenCamera, TakenDetail};

impl Plan {
    /// Decision of what is taken of the scene's tolerance.
    pub(super) fn explain_tolerance(&self, scene: &Scene) -> Option<Decision> {
        let tolerance = scene.tolerance?;
        let choice =
            format!("{} px, {} % of light", tolerance.displacement.0, 100.0 * tolerance.light.0);
        let Some(taken) = &self.taken else {
            let because = "what is taken of it is found when the scene is built";
            return Some(Decision::new(Kind::Tolerance, choice, because).forced(true));
        };
        let camera = taken.camera.as_ref().map(|TakenCamera { camera, finding }| {
            let groups = match camera.band_groups(&self.bands).len() {
                groups if groups > 1 && groups < self.bands.count() => {
                    format!(" in {groups} groups of {} bands", self.bands.count())
                }
                _ => String::new(),
            };
            format!(
                "the lens as `{}`{groups}, displaced by {:.3} px at most and {:.2} % of light",
                finding.model,
                finding.displacement(),
                100.0 * finding.light.value
            )
        });
        let bounces = taken.bounces.map(|TakenBounces { bounces, share }| {
            format!(
                "{bounces} surfaces of a path, which leave out {:.2} % of light in 99 % of blocks of 8 × 8 pixels",
                100.0 * share
            )
        });
        let detail = taken.detail.map(|TakenDetail { triangles: [all, left], displacement, light, .. }| {
            format!(
                "{left} of {all} placed triangles, of which places are displaced by {displacement:.3} px at most and areas \
                 differ by {:.2} %",
                100.0 * light
            )
        });
        let images = (taken.images > 0).then(|| {
            format!(
                "images in as few texels as the nearest view can tell apart: {} of them",
                taken.images
            )
        });
        let all = camera.into_iter().chain(bounces).chain(detail).chain(images);
        let all: Vec<String> = all.collect();
        let what = if all.is_empty() { "nothing".to_owned() } else { all.join("; ") };
        let notes: String = taken.notes.iter().map(|note| format!("; {note}")).collect();
        let because = format!("the cheapest within it are taken: {what}{notes}");
        Some(Decision::new(Kind::Tolerance, choice, because).forced(true))
    }
}
