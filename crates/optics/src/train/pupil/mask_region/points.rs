//! Points of what is visible of a mask: drawn, and looked up.

use std::collections::BTreeSet;
use std::f64::consts::PI;

use glam::DVec2;

use super::{CHECKS, FILM, FilmCell, LINES, MaskRegion, PARTS, Visibility, split};
use crate::element::{Clip, LensRays, RayStatus};
use crate::train::Side;
use crate::train::aim::towards_lens;
use crate::train::pupil::mask_cells::MaskCells;
use crate::train::pupil::mask_map::{MappedScene, NO_TERMS, roberts};

/// A point of the mask.
#[derive(Debug, Clone, Copy)]
pub(in crate::train::pupil) struct MaskPoint {
    pub(in crate::train::pupil) at: DVec2,
    /// Per mm².
    pub(in crate::train::pupil) density: f64,
}

impl MaskRegion {
    /// A point of the mask for a place in the unit square, as a point of the sensor (mm) sees it; `None` for
    /// places that are given up, whose density counts as drawn.
    pub(in crate::train::pupil) fn draw(
        &self,
        cells: &MaskCells,
        film: DVec2,
        [u, v]: [f64; 2],
    ) -> Option<MaskPoint> {
        let (part, view) = self.view(film)?;
        let interval = self.intervals[part].as_ref()?;
        let mut left = v * interval.mass;
        let mut chosen = interval.bands.first()?;
        for band in &interval.bands {
            chosen = band;
            if left < band.mass {
                break;
            }
            left -= band.mass;
        }
        let (y, row) = cells.draw_row(chosen, (left / chosen.mass).clamp(0.0, 1.0));
        let columns = match interval.is_cut {
            true => cells.columns(self.ends(&view, y, cells.bounds())?),
            false => chosen.columns(),
        };
        let (x, across) = cells.draw_column(row, columns, u)?;
        let along = cells.row_density(chosen.columns(), row) / interval.mass;
        Some(MaskPoint { at: DVec2::new(x, y), density: along * across })
    }

    /// The density (per mm²) with which [`Self::draw`] draws a point (mm).
    pub(in crate::train::pupil) fn density(
        &self,
        cells: &MaskCells,
        film: DVec2,
        at: DVec2,
    ) -> f64 {
        let Some((part, view)) = self.view(film) else { return 0.0 };
        let Some(interval) = &self.intervals[part] else { return 0.0 };
        let [low, high] = cells.bounds();
        if at.cmplt(low).any() || at.cmpgt(high).any() {
            return 0.0;
        }
        let row = cells.row_at(at.y);
        let Some(band) = interval.bands.iter().find(|band| band.holds(row)) else { return 0.0 };
        let columns = match interval.is_cut {
            true => {
                let Some([left, right]) = self.ends(&view, at.y, [low, high]) else { return 0.0 };
                if at.x < left || at.x > right {
                    return 0.0;
                }
                cells.columns([left, right])
            }
            false => band.columns(),
        };
        let along = cells.row_density(band.columns(), row) / interval.mass;
        along * cells.column_density(row, columns, at.x)
    }

    /// The part of an interval of the sensor around a point (mm), and the weights of the interval's corners.
    fn view(&self, film: DVec2) -> Option<(usize, FilmCell)> {
        let along = |x: f64, half: f64| {
            let at = if half > 0.0 { 0.5 * (x / half + 1.0) } else { 0.0 };
            (-1e-9..=1.0 + 1e-9).contains(&at).then(|| split(at.clamp(0.0, 1.0), FILM))
        };
        let (column, right) = along(film.x, self.half_size.x)?;
        let (row, down) = along(film.y, self.half_size.y)?;
        let view = FilmCell::new(Self::corners(row * FILM + column), [right, down]);
        let part = |low: usize, share: f64| low * PARTS + split(share, PARTS).0;
        Some((part(row, down) * FILM * PARTS + part(column, right), view))
    }

    /// The ends (mm) of the line at a height; `None` above and below what is visible.
    fn ends(&self, view: &FilmCell, y: f64, [low, high]: [DVec2; 2]) -> Option<[f64; 2]> {
        let chords = view.corners.map(|node| match &self.nodes[node] {
            Visibility::Part(chords) => Some(&**chords),
            Visibility::All | Visibility::Nothing => None,
        });
        let (mut heights, mut margin) = ([0.0; 2], 0.0);
        for (chords, weight) in chords.iter().zip(view.weights) {
            let own = (*chords)?;
            heights = [heights[0] + own.heights[0] * weight, heights[1] + own.heights[1] * weight];
            margin += own.margin * weight;
        }
        let margin = margin * (high - low);
        let [bottom, top] = [heights[0] - margin.y, heights[1] + margin.y];
        if y < bottom || y > top {
            return None;
        }
        // The margin stretches the lines, so that the outermost ones do not end in nothing.
        let cosine = (bottom + top - 2.0 * y) / (top - bottom);
        let (line, share) = split(cosine.clamp(-1.0, 1.0).acos() / PI, LINES);
        let mut ends = [0.0; 2];
        for (chords, weight) in chords.iter().zip(view.weights) {
            let own = &(*chords)?.ends;
            for (i, end) in ends.iter_mut().enumerate() {
                *end += weight * (own[line][i] + share * (own[line + 1][i] - own[line][i]));
            }
        }
        Some([ends[0] - margin.x, ends[1] + margin.x])
    }

    /// The nodes around those of many random rays that pass the lens and are not drawn.
    pub(super) fn missed(
        &self,
        scenes: &[MappedScene<'_>],
        [low, high]: [DVec2; 2],
    ) -> BTreeSet<usize> {
        let mut nodes = BTreeSet::new();
        for MappedScene { scene, map } in scenes {
            let mut rays = LensRays::with_capacity(CHECKS as usize);
            let mut places = Vec::with_capacity(CHECKS as usize);
            for i in 0..CHECKS {
                let film = (2.0 * roberts(i) - 1.0) * scene.half_size;
                let share = |step: f64| (0.5 + step * f64::from(i)).fract();
                let share = DVec2::new(share(0.628_706_721_037_806), share(0.538_597_270_645_735));
                let at = low + share * (high - low);
                let mut room = NO_TERMS;
                let Some(local) = map.at(film, &mut room) else { continue };
                rays.push(scene.sensor.point(film.extend(0.0)), towards_lens(local.slopes(at).0));
                places.push((film, at));
            }
            scene.lens.trace(Side::Sensor, Clip::On, &mut rays);
            let passed = (0..rays.len()).filter(|i| rays.status(*i) == RayStatus::Exited);
            for (film, at) in passed.map(|i| places[i]) {
                if !self.holds(film, at, [low, high]) {
                    nodes.extend(self.view(film).map_or([0; 4], |(_, view)| view.corners));
                }
            }
        }
        nodes
    }

    /// True if a point of the mask may be drawn where the mask is open.
    fn holds(&self, film: DVec2, at: DVec2, bounds: [DVec2; 2]) -> bool {
        let Some((_, view)) = self.view(film) else { return true };
        let is_cut =
            view.corners.iter().all(|node| matches!(self.nodes[*node], Visibility::Part(_)));
        let ends = || self.ends(&view, at.y, bounds);
        !is_cut || ends().is_some_and(|[left, right]| at.x >= left && at.x <= right)
    }
}
