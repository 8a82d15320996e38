//! Search for the directions from a point of the sensor that leave the lens: the rectangle of
//! slopes that holds them all, found by grids of rays.

use glam::{DVec2, DVec3};

use crate::element::{Clip, LensRays, RayStatus};
use crate::train::aim::towards_lens;
use crate::train::{MonochromaticTrain, OpticalTrain, Side};

/// Cells a side of a search grid. Not a setting: what is smaller than a cell is found by finer grids, and light by none
/// is lost for good.
const GRID: u32 = 48;

/// Cells a side of a search grid, for trains through which rays take long to be traced.
const COARSE_GRID: u32 = 16;

/// Cells a side of the last resort, which finds what is 1/36 000 of the widest window.
const FINE_GRID: u32 = 192;

fn grid(at: &MonochromaticTrain) -> u32 {
    if at.is_costly() { COARSE_GRID } else { GRID }
}

/// A rectangle of slopes x/−z, y/−z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlopeWindow {
    pub(crate) min: DVec2,
    pub(crate) max: DVec2,
}

impl SlopeWindow {
    fn centred(centre: DVec2, half: DVec2) -> Self {
        Self { min: centre - half, max: centre + half }
    }

    pub(crate) fn centre(&self) -> DVec2 {
        0.5 * (self.min + self.max)
    }

    pub(crate) fn half(&self) -> DVec2 {
        0.5 * (self.max - self.min)
    }

    /// The window of all directions from `film` (mm) in which rays leave the lens, wider than
    /// needed by at most a cell of 1/48 on each side, of 1/16 for a train that is costly; `None` when there are none.
    pub fn find(train: &OpticalTrain, at: &MonochromaticTrain, film: DVec3) -> Option<Self> {
        Self::first_guesses(train, at, film)
            .into_iter()
            .find_map(|guess| guess.grown(at, film))
            .or_else(|| Self::widest(train, film)?.passing(at, film, FINE_GRID))
            .map(|found| found.tightened(at, film))
    }

    /// As [`Self::find`], begun from a guess; `None` when the guess holds nothing.
    pub(crate) fn near(
        centre: DVec2,
        half: DVec2,
        at: &MonochromaticTrain,
        film: DVec3,
    ) -> Option<Self> {
        let found = Self::centred(centre, half).grown(at, film)?;
        Some(found.tightened(at, film))
    }

    /// Rays from `film` over the whole rear of the lens.
    pub(crate) fn probe(train: &OpticalTrain, film: DVec3) -> Option<LensRays> {
        Some(Self::widest(train, film)?.rays(film, FINE_GRID))
    }

    /// Around the chief ray, around the paraxial exit pupil, and the whole rear of the lens.
    fn first_guesses(train: &OpticalTrain, at: &MonochromaticTrain, film: DVec3) -> Vec<Self> {
        let mut guesses = Vec::new();
        if let Ok(paraxial) = train.paraxial(at.wavelength())
            && let (Some(z), Some(diameter)) = (paraxial.exit_pupil.z, paraxial.exit_pupil.diameter)
        {
            let half = DVec2::splat(diameter / (film.z - z).abs());
            if half.x > 0.0 && half.is_finite() {
                guesses.push(Self::centred(-film.truncate() / (film.z - z), half));
                if let Some(chief) = train.chief_direction(at, film) {
                    guesses.push(Self::centred(-chief.truncate() / chief.z, half));
                }
            }
        }
        guesses.extend(Self::widest(train, film));
        guesses
    }

    /// The directions to the last element that has a rim.
    fn widest(train: &OpticalTrain, film: DVec3) -> Option<Self> {
        let rim = train.elements.iter().rev().find(|e| e.clear_radius().is_finite())?;
        let depth = (film.z - rim.frame.vertex.z).abs().max(1e-3);
        let reach = 1.5 * rim.clear_radius() / depth;
        let centre = (rim.frame.vertex.truncate() - film.truncate()) / depth;
        (reach > 0.0).then(|| Self::centred(centre, DVec2::splat(reach)))
    }

    /// The passing part of the window, looked for in wider windows as long as it touches the edge.
    fn grown(self, at: &MonochromaticTrain, film: DVec3) -> Option<Self> {
        let mut outer = self;
        let mut found = outer.passing(at, film, grid(at))?;
        for _ in 0..12 {
            let touches = found.min.cmple(outer.min).any() || found.max.cmpge(outer.max).any();
            if !touches {
                break;
            }
            outer = Self::centred(found.centre(), 2.0 * found.half());
            found = outer.passing(at, film, grid(at))?;
        }
        Some(found)
    }

    /// Narrowed until the grid's cells are small against it.
    fn tightened(self, at: &MonochromaticTrain, film: DVec3) -> Self {
        let mut window = self;
        for _ in 0..6 {
            let Some(next) = window.passing(at, film, grid(at)) else { break };
            let shrunk = next.half().cmplt(0.9 * window.half()).any();
            window = next;
            if !shrunk {
                break;
            }
        }
        window
    }

    /// The middle of cell `i` of a grid.
    fn cell(&self, i: u32, grid: u32) -> DVec2 {
        let place = DVec2::new(f64::from(i % grid) + 0.5, f64::from(i / grid) + 0.5);
        self.min + place * (self.max - self.min) / f64::from(grid)
    }

    fn rays(&self, film: DVec3, grid: u32) -> LensRays {
        let mut rays = LensRays::with_capacity((grid * grid) as usize);
        for i in 0..grid * grid {
            rays.push(film, towards_lens(self.cell(i, grid)));
        }
        rays
    }

    /// The cells of a grid whose centres pass, and one more on each side.
    fn passing(self, at: &MonochromaticTrain, film: DVec3, grid: u32) -> Option<Self> {
        let size = (self.max - self.min) / f64::from(grid);
        let mut rays = self.rays(film, grid);
        at.trace(Side::Sensor, Clip::On, &mut rays);
        let (mut min, mut max) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for i in (0..grid * grid).filter(|&i| rays.status(i as usize) == RayStatus::Exited) {
            min = min.min(self.cell(i, grid));
            max = max.max(self.cell(i, grid));
        }
        let margin = 1.5 * size;
        (min.x <= max.x)
            .then(|| Self { min: min - margin, max: max + margin })
            .map(|w| Self { min: w.min.max(self.min - size), max: w.max.min(self.max + size) })
    }
}
