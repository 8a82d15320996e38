//! A tree over lights of a place: for a point, one of them is chosen by its distance, its power, where it shines
//! and where the point faces, in a time that grows as the logarithm of their number.
//!
//! Each branch of a node knows of its lights a box, a cone of directions about which they shine, and the sum of
//! their intensities. From the top down one of a node's branches is chosen by what it may send to the point,
//!
//! ```text
//! I cos θ' cos θᵢ' / max(d², r²),  θ' = max(0, θ − θₒ − θᵤ),  θᵢ' = max(0, θᵢ − θᵤ),
//! and nothing where θ' ≥ θₑ or θᵢ' ≥ π/2
//! ```
//!
//! with `d` to the box's centre, `r` half its diagonal, `θ` between the cone's axis and the point, `θₒ` the
//! cone's half-angle, `θₑ` how far beyond it a light shines, `θᵢ` between the point's normal and the box's centre,
//! and `θᵤ` the half-angle of the box's sphere. Where light may come through a surface the normal is not asked.
//! These cosines are the largest that any light of the branch may have. Of branches near by they are far above the
//! mean, and what is wrong above is not made good below: an eighth of the bound and seven eighths of the cosine at the
//! box's centre (`max(0, θ − θₒ)` and `θᵢ`) are taken, which leaves out nothing that shines.
//! Nodes have eight branches, which are asked side by side: what bounds the time is how long one answer takes,
//! and a choice among eight knows more of the lights than three among two.
//!
//! All that is compared is single: lengths in the extent of all lights, intensities in their sum. Chances are those
//! of the very numbers that were drawn by, in double, so what rounding does to them changes no mean.
//!
//! # Sources
//!
//! A. Conty Estevez and C. Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting", HPG
//! 2018 (cones, the cost of a split); Pharr, Jakob and Humphreys, *Physically Based Rendering*, 4th
//! edition, section 12.6.3 (the bounds of `cos θ'` and `cos θᵢ'`). Where all lights of a branch shine the same way
//! and the point is far from it, one is chosen by its intensity at once: going down would change little and costs
//! time.

mod cluster;
mod descent;
mod node;
#[cfg(test)]
mod tests;
mod tree;

pub(crate) use self::cluster::{Cluster, NumberedCluster};
pub(crate) use self::descent::{Choice, Choices};
use self::descent::{descend, descend_together, is_any_far};
use self::node::LANES;
pub(crate) use self::node::Receiver;
pub(crate) use self::tree::LightTree;
use self::tree::{ALL, FIRST};

/// Fewer lights are chosen by their power where none is far away.
pub(crate) const LEAST: usize = 5;

/// So are more.
pub(crate) const MOST: usize = 1 << 16;

/// Sums, for each point that chooses one of a tree's lights, the irradiance that it may get from all of them if it
/// faces them all (W/m²).
#[multiversion::multiversion(targets = "simd")]
fn sum_importance(tree: &LightTree, choices: &mut Choices) {
    choices.importance.clear();
    for first in (0..choices.len()).step_by(LANES) {
        let (points, count) = choices.points(first);
        choices.importance.extend_from_slice(&tree.importances(&points)[..count]);
    }
}

impl LightTree {
    /// Makes those choices that were left to it.
    pub(crate) fn pick(&self, choices: &mut Choices) {
        let Some(whole) = self.nodes.first() else { return };
        let mut order = std::mem::take(&mut choices.descent.order);
        if is_any_far(whole, choices) {
            order.retain(|&number| {
                let number = number as usize;
                let viewer = choices.viewer(number);
                let goes_on = self.start(&viewer) != ALL;
                if !goes_on {
                    match self.sent(&viewer) > 0.0 {
                        true => self.settle(choices, number, &whole.branches[0]),
                        false => choices.chance[number] = 0.0,
                    }
                }
                goes_on
            });
        }
        choices.descent.nodes.clear();
        choices.descent.walkers.clear();
        if !order.is_empty() {
            choices.descent.nodes.push((FIRST, 0..order.len()));
        }
        choices.descent.order = order;
        descend_together(self, choices);
        let mut walkers = std::mem::take(&mut choices.descent.walkers);
        descend(&self.nodes, &mut walkers);
        for walker in &walkers {
            (choices.chance[walker.number], choices.u[walker.number]) = (walker.chance, walker.u);
            if walker.chance > 0.0 {
                self.settle(choices, walker.number, &walker.branch);
            }
        }
        choices.descent.walkers = walkers;
    }

    /// Notes, with all choices, the irradiance that each may get ([`Self::importance`]).
    pub(crate) fn sum_importance(&self, choices: &mut Choices) {
        sum_importance(self, choices);
    }
}
