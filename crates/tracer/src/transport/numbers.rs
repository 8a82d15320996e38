//! The random numbers of a step: those that it does without are not made.

use super::Samples;
use super::paths::State;

/// What a path uses random numbers for at each step.
#[derive(Debug, Clone, Copy)]
pub(super) enum Draw {
    /// Choosing among the ways in which a surface scatters.
    Choice,
    /// Choosing a light and a place on it; or the band that stays where glass splits them.
    Light,
    /// The direction to follow.
    Direction,
    /// Whether a surface is there, and whether a path goes on.
    Chance,
}

/// How many uses there are.
pub(super) const DRAWS: u32 = 4;

impl Draw {
    pub(super) const ALL: [Self; DRAWS as usize] =
        [Self::Choice, Self::Light, Self::Direction, Self::Chance];
}

/// The numbers of the paths that go on.
#[derive(Debug, Default)]
pub(super) struct Numbers {
    wanted: Vec<(u32, u32)>,
    /// By [`Draw`], one a path that goes on; empty where not needed.
    drawn: [Vec<[f64; 2]>; DRAWS as usize],
}

impl Numbers {
    /// Makes what the paths `alive` among `states` need.
    pub(super) fn draw(
        &mut self,
        samples: &dyn Samples,
        needs: impl Fn(Draw) -> bool,
        (states, alive): (&[State], &[u32]),
    ) {
        for draw in Draw::ALL {
            let drawn = &mut self.drawn[draw as usize];
            drawn.clear();
            if needs(draw) {
                let pair = |state: &State| state.steps * DRAWS + draw as u32;
                let states = alive.iter().map(|&i| &states[i as usize]);
                self.wanted.clear();
                self.wanted.extend(states.map(|state| (state.ray, pair(state))));
                samples.squares(&self.wanted, drawn);
            }
        }
    }

    /// Those of the `k`-th path that goes on, for one use.
    #[inline]
    pub(super) fn of(&self, draw: Draw, k: usize) -> [f64; 2] {
        self.drawn[draw as usize].get(k).copied().unwrap_or([0.5; 2])
    }
}
