//! The choice of the light that is asked for a point.
//!
//! Lights far away are chosen by the irradiance of a surface that faces them (W/m², of the mean of the three
//! colours): `E` of parallel light, `π L` of an environment (half of that where it is alike from all sides). Among
//! lights near by, one is chosen by what it may send to the point ([`crate::light_tree`]); where there are very few or
//! very many, and nothing is far away, by power (W): a triangle of an emissive mesh by `π A L` for one side. Between
//! near and far the point decides by the same irradiances, but neither is chosen less often than in one of four cases:
//! what is near may be behind a wall, and what is far outside of it.

use std::f64::consts::PI;

use etendue_geometry::Bounds;
use etendue_geometry::glam::DVec3;

use crate::light_tree::{self, Choice, Choices, Cluster, LightTree, NumberedCluster};
use crate::sampling::{DiscreteDistribution, ONE_BELOW};

pub(crate) use crate::light_tree::Receiver;

/// The least chance of a light near by, and of one far away, where there are both.
const LEAST_SHARE: f64 = 0.25;

/// So many lights are few.
const FEW: usize = 8;

/// A point that asks a light which it chose.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LightQuery {
    /// m.
    pub(crate) from: DVec3,
    /// s from the frame's time.
    pub(crate) time: f64,
    /// The light, and the chance with which it was chosen.
    pub(crate) choice: Choice,
    /// The numbers in 0..1 by which a place on it is chosen.
    pub(crate) square: [f64; 2],
}

/// A light that may be chosen.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Candidate {
    /// It has a place.
    Near {
        /// W.
        power: f64,
        cluster: Cluster,
    },
    /// It has none.
    Far {
        /// W/m².
        irradiance: f64,
    },
    /// It sends nothing.
    Dark,
}

impl Candidate {
    /// A light that has a place, with its power (W).
    pub(crate) fn near(power: f64, cluster: Cluster) -> Self {
        Self::Near { power, cluster }
    }
}

/// The lights by their chances.
#[derive(Debug)]
pub(crate) struct LightSampler {
    /// Those that are in no tree.
    others: DiscreteDistribution,
    /// The irradiance that those send (W/m²), where there is a tree.
    far: f64,
    tree: Option<LightTree>,
}

impl LightSampler {
    /// Over `candidates`, by their order, in a scene of these bounds (m).
    pub(crate) fn new(candidates: &[Candidate], bounds: Bounds) -> Self {
        let irradiance = |candidate: &Candidate| match candidate {
            Candidate::Far { irradiance } => *irradiance,
            Candidate::Near { .. } | Candidate::Dark => 0.0,
        };
        let far = candidates.iter().map(irradiance).sum();
        let tree = plant(candidates, far > 0.0);
        // What falls onto the sphere around the scene.
        let radius = 0.5 * bounds.diagonal();
        let across = if radius > 0.0 { PI * radius * radius } else { PI };
        let weight = |candidate: &Candidate| match candidate {
            Candidate::Near { power, .. } if tree.is_none() => *power,
            Candidate::Far { irradiance } => across * irradiance,
            Candidate::Near { .. } | Candidate::Dark => 0.0,
        };
        let weights: Vec<f64> = candidates.iter().map(weight).collect();
        let others = match weights.iter().any(|&weight| weight > 0.0) {
            true => DiscreteDistribution::new(&weights),
            false => DiscreteDistribution::default(),
        };
        Self { others, far, tree }
    }

    /// The sum of the chances of all lights before each and 1 at the end, where they are few and alike from
    /// everywhere.
    pub(crate) fn few(&self) -> Option<&[f64]> {
        let is_few = self.tree.is_none() && (1..=FEW).contains(&self.others.len());
        is_few.then(|| self.others.below())
    }

    /// True if there is nothing to choose from.
    pub(crate) fn is_empty(&self) -> bool {
        self.others.is_empty() && self.tree.is_none()
    }

    /// The chance with which a light of the tree is chosen for the point `from` (m), and none of the others.
    fn share_of_tree(&self, tree: &LightTree, from: DVec3) -> f64 {
        if self.others.is_empty() { 1.0 } else { self.share(tree.importance(from)) }
    }

    /// The same, where the tree may send so much (W/m²).
    #[inline(always)]
    fn share(&self, near: f64) -> f64 {
        let share = (near / (near + self.far)).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE);
        if near > 0.0 { share } else { 0.0 }
    }

    /// Makes ready for so many points that choose a light each.
    pub(crate) fn restart(&self, choices: &mut Choices, most: usize) {
        choices.restart(self.tree.as_ref(), most);
    }

    /// Chooses a light for each of some points.
    pub(crate) fn pick(&self, choices: &mut Choices) {
        let Some(tree) = &self.tree else {
            for number in 0..choices.len() {
                choices.set(number, self.pick_other(choices.get(number).u, 1.0));
            }
            return;
        };
        if self.others.is_empty() {
            for number in 0..choices.len() {
                choices.leave_to_tree(number, 1.0, choices.get(number).u);
            }
        } else {
            tree.sum_importance(choices);
            for number in 0..choices.len() {
                let (share, u) = (self.share(choices.importance(number)), choices.get(number).u);
                if u < share {
                    choices.leave_to_tree(number, share, u / share);
                } else {
                    let rest = ((u - share) / (1.0 - share)).min(ONE_BELOW);
                    choices.set(number, self.pick_other(rest, 1.0 - share));
                }
            }
        }
        tree.pick(choices);
    }

    /// A choice by a number `u` in 0..1 among the lights that are in no tree, of which `share` is the chance.
    #[inline(always)]
    pub(crate) fn pick_other(&self, u: f64, share: f64) -> Choice {
        let (light, rest, chance) = match self.others.len() {
            0 => (0, u, 0.0),
            1 => (0, u, 1.0),
            _ => {
                let (light, rest) = self.others.pick(u);
                (light, rest, self.others.probability(light))
            }
        };
        let light = u32::try_from(light).unwrap_or(u32::MAX);
        Choice { light, u: rest, chance: share * chance }
    }

    /// The chance with which [`Self::pick`] picks light `index`, which is in no tree, for a point that chose.
    pub(crate) fn chance_of_other(&self, choices: &Choices, number: usize, index: usize) -> f64 {
        if self.others.is_empty() {
            return 0.0;
        }
        let share = match &self.tree {
            Some(_) => self.share(choices.importance(number)),
            None => 0.0,
        };
        (1.0 - share) * self.others.probability(index)
    }

    /// The chance with which [`Self::pick`] picks light `index` for a point.
    pub(crate) fn chance(&self, receiver: &Receiver, index: usize) -> f64 {
        let other = || if self.others.is_empty() { 0.0 } else { self.others.probability(index) };
        match &self.tree {
            None => other(),
            Some(tree) => {
                let share = self.share_of_tree(tree, receiver.point);
                match tree.holds(index) {
                    true => share * tree.chance(receiver, index),
                    false => (1.0 - share) * other(),
                }
            }
        }
    }
}

/// The tree over what has a place, when that is worth one.
fn plant(candidates: &[Candidate], is_far: bool) -> Option<LightTree> {
    let cluster = |candidate: &Candidate| match candidate {
        Candidate::Near { cluster, .. } if cluster.intensity > 0.0 => Some(*cluster),
        _ => None,
    };
    let near = (0_u32..).zip(candidates).filter_map(|(number, candidate)| {
        Some(NumberedCluster { number, cluster: cluster(candidate)? })
    });
    let near: Vec<NumberedCluster> = near.collect();
    let least = if is_far { 1 } else { light_tree::LEAST };
    let is_worth_it = (least..=light_tree::MOST).contains(&near.len());
    is_worth_it.then(|| LightTree::new(near, candidates.len()))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    /// A light of one W/sr at the origin that shines along +Y.
    fn facing_up() -> Candidate {
        let bounds = Bounds { min: DVec3::ZERO, max: DVec3::ZERO };
        let cluster =
            Cluster { bounds, axis: DVec3::Y, cone: 0.0, reach: FRAC_PI_2, intensity: 1.0 };
        Candidate::near(PI, cluster)
    }

    /// A point that gets light from all sides.
    fn open(point: DVec3) -> Receiver {
        Receiver { point, normal: DVec3::ZERO }
    }

    fn one(sampler: &LightSampler, from: Receiver, u: f64) -> Choice {
        let mut choices = Choices::default();
        sampler.restart(&mut choices, 1);
        choices.push(&from, u);
        sampler.pick(&mut choices);
        choices.get(0)
    }

    fn scene() -> Bounds {
        Bounds { min: DVec3::splat(-50.0), max: DVec3::splat(50.0) }
    }

    /// Lights far away and one near by, of which a point farther away gets less.
    #[test]
    fn chances_are_those_of_picks_and_go_with_distance() {
        let far = [2.0, 0.0, 1.0].map(|irradiance| Candidate::Far { irradiance });
        let all = [far[0], facing_up(), far[1], Candidate::Dark, far[2]];
        let sampler = LightSampler::new(&all, scene());
        // By 1/d² against 3, and never below a quarter or above three; nothing behind it.
        let expected =
            [(1.0, 0.25), (0.5, 4.0 / 7.0), (0.4, 6.25 / 9.25), (0.1, 0.75), (-1.0, 0.0)];
        for (height, share) in expected {
            let from = open(DVec3::Y * height);
            let mut counts = [0_u32; 5];
            let n = 10_000_u32;
            for k in 0..n {
                let u = (f64::from(k) + 0.5) / f64::from(n);
                let Choice { light, u, chance, .. } = one(&sampler, from, u);
                assert!((0.0..1.0).contains(&u));
                assert!((chance - sampler.chance(&from, light as usize)).abs() < 1e-12);
                counts[light as usize] += 1;
            }
            let chances = [0, 1, 2, 3, 4].map(|k| sampler.chance(&from, k));
            assert!((chances[1] - share).abs() < 1e-12, "{height}: {chances:?}");
            assert!(
                (chances[0] - (1.0 - share) * 2.0 / 3.0).abs() < 1e-12,
                "{height}: {chances:?}"
            );
            assert_eq!(chances[2..4], [0.0; 2]);
            for (count, chance) in counts.iter().zip(chances) {
                // A regular grid meets an interval to within one step at each end.
                assert!((f64::from(*count) / f64::from(n) - chance).abs() < 2.0 / f64::from(n));
            }
        }
    }

    #[test]
    fn a_few_lights_alone_are_chosen_by_power_and_none_is_dark() {
        let sampler = LightSampler::new(&[facing_up(), facing_up()], scene());
        assert_eq!(sampler.chance(&open(DVec3::NEG_Y), 0), 0.5);
        assert!(!sampler.is_empty());
        assert!(LightSampler::new(&[Candidate::Dark], scene()).is_empty());
        let dark = one(&LightSampler::new(&[], scene()), open(DVec3::ZERO), 0.5);
        assert_eq!(dark.chance, 0.0);
    }
}
