//! The depths of things that are so small in the picture that even rays pass them by.
//!
//! The box of a placement says where in the picture it can be, and at which depths: rays from the entrance pupil are
//! aimed at those boxes that even rays may miss. What is hidden is not hit, so depths are those of what is seen.

use std::ops::Range;

use etendue_accel::Accel;
use etendue_camera::lens::focused::View;
use etendue_camera::{Camera, Intrinsics, Pose};
use etendue_geometry::glam::{DVec2, DVec3};
use etendue_geometry::{Bounds, Detail, Geometry, HitBatch, RayBatch};
use rayon::prelude::*;

use super::taken::Place;

/// Rays to each side of a box that are aimed at it.
const AIMED: u32 = 8;

/// Things of these steps between even rays, at most, are aimed at: larger ones are met by several of these.
const SMALL: f64 = 4.0;

/// The most boxes that are aimed at: those whose depths differ most from what even rays found there.
const MOST: usize = 4096;

/// A box in the picture.
struct ScreenBox {
    /// Slopes to the right and down, the least and the greatest.
    slopes: [DVec2; 2],
    /// The cells of the picture in which it is, by columns and rows.
    cells: [Range<usize>; 2],
    /// By how much its nearness (1/m) differs from what was found in these cells.
    beyond: f64,
}

/// Places of the picture in even columns and rows.
pub(super) struct PictureGrid {
    /// Numbers of columns and rows.
    pub(super) count: [usize; 2],
    /// From one to the next (pixels).
    pub(super) step: [f64; 2],
    /// Between even rays (pixels).
    pub(super) ray_step: f64,
}

/// The view of a camera that looks out of one place.
struct Eye<'a> {
    pose: &'a Pose,
    intrinsics: &'a Intrinsics,
}

impl Eye<'_> {
    /// The slopes of a box to the right and down, and its nearest and farthest depths (m); `None` where it is not all
    /// before the camera.
    fn bounds(&self, of: &Bounds) -> Option<([DVec2; 2], [f64; 2])> {
        let start = ([DVec2::INFINITY, DVec2::NEG_INFINITY], [f64::INFINITY, 0.0_f64]);
        of.corners().into_iter().try_fold(start, |([least, most], [near, far]), corner| {
            let place = self.pose.rotation.transpose() * (corner - self.pose.position);
            let depth = -place.z;
            let slope = DVec2::new(place.x, -place.y) / depth;
            let bounds = ([least.min(slope), most.max(slope)], [near.min(depth), far.max(depth)]);
            (depth > 0.0).then_some(bounds)
        })
    }

    /// The way of the ray of a slope, whose length along the axis is 1.
    fn way(&self, slope: DVec2) -> DVec3 {
        self.pose.rotation * DVec3::new(slope.x, -slope.y, -1.0)
    }

    fn pixel(&self, slope: DVec2) -> DVec2 {
        let [focal, centre] = [self.intrinsics.focal, self.intrinsics.centre].map(DVec2::from);
        centre + focal * slope
    }
}

impl PictureGrid {
    /// The cells that a part of the picture touches, whose middles are even places with the corners among them.
    fn of(&self, least: DVec2, most: DVec2) -> [Range<usize>; 2] {
        [0, 1].map(|axis| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "it saturates"
            )]
            let cell = |at: f64| (at / self.step[axis] + 0.5).floor().max(0.0) as usize;
            let (first, last) = (cell(least[axis]), cell(most[axis]));
            // Outside of the picture there are none.
            let is_left = most[axis] < 0.0;
            if is_left { 0..0 } else { first..(last + 1).min(self.count[axis]) }
        })
    }

    fn places(&self, [columns, rows]: &[Range<usize>; 2]) -> impl Iterator<Item = usize> + use<> {
        let (columns, across) = (columns.clone(), self.count[0]);
        rows.clone().flat_map(move |row| columns.clone().map(move |column| row * across + column))
    }

    /// Adds to the depths of `places` those of small things of `geometry` that are nearer or farther.
    pub(super) fn look_for_small(
        &self,
        geometry: &Geometry,
        accel: &dyn Accel,
        camera: &Camera,
        places: &mut [Place],
    ) {
        let Some(View::Perspective(intrinsics)) = camera.lens().map(|lens| lens.focused().view())
        else {
            return;
        };
        let eye = Eye { pose: camera.pose(), intrinsics: &intrinsics };
        let known: &[Place] = places;
        let targets = geometry.placements.par_iter().filter_map(|placement| {
            let bounds = geometry.loose_bounds_of(placement);
            self.target(&eye, known, &bounds)
        });
        let mut targets: Vec<ScreenBox> = targets.collect();
        targets.sort_by(|a, b| b.beyond.total_cmp(&a.beyond));
        targets.truncate(MOST);
        let mut rays = RayBatch::default();
        for ScreenBox { slopes: [least, most], .. } in &targets {
            let share = |k: u32| (f64::from(k) + 0.5) / f64::from(AIMED);
            for (x, y) in (0..AIMED).flat_map(|y| (0..AIMED).map(move |x| (x, y))) {
                let slope = *least + (*most - *least) * DVec2::new(share(x), share(y));
                rays.push(eye.pose.position, eye.way(slope));
            }
        }
        let mut hits = HitBatch::new(Detail::Distance);
        accel.closest(&rays, &mut hits);
        let a_target = (AIMED * AIMED) as usize;
        for (k, target) in targets.iter().enumerate() {
            let hit = (k * a_target..(k + 1) * a_target).filter(|&i| hits.is_hit(i));
            // Along the axis, as the ways are.
            let depths: Vec<f64> = hit.map(|i| hits.t[i]).collect();
            for place in self.places(&target.cells) {
                depths.iter().for_each(|&depth| places[place].widen(depth));
            }
        }
    }

    /// Returns the box to be aimed at of a placement in a box; `None` where even rays meet it, where it is not seen, or
    /// where its depths lie within those that are known.
    fn target(&self, eye: &Eye<'_>, places: &[Place], bounds: &Bounds) -> Option<ScreenBox> {
        if bounds.is_empty() {
            return None;
        }
        let (slopes, [near, far]) = eye.bounds(bounds)?;
        let [least, most] = slopes.map(|slope| eye.pixel(slope));
        if (most - least).min_element() > SMALL * self.ray_step {
            return None;
        }
        let cells = self.of(least, most);
        let beyond = |place: usize| {
            let depths = &places[place].depths;
            let ends = depths.first().zip(depths.last());
            let outside = |(first, last): (&f64, &f64)| {
                (1.0 / near - 1.0 / first).max(1.0 / last - 1.0 / far)
            };
            ends.map_or(f64::INFINITY, outside)
        };
        let beyond = self.places(&cells).map(beyond).fold(0.0, f64::max);
        (beyond > 0.0).then_some(ScreenBox { slopes, cells, beyond })
    }
}

impl Place {
    /// Has a depth (m) among its own, in the place of the nearest or the farthest where it is outside of these.
    fn widen(&mut self, depth: f64) {
        let ends = self.depths.first().copied().zip(self.depths.last().copied());
        match ends {
            Some((first, last)) if (first..=last).contains(&depth) => {}
            Some((first, _)) if depth < first => self.put(0, depth),
            Some(_) => self.put(self.depths.len(), depth),
            None => self.depths.push(depth),
        }
    }

    /// Puts a depth at an end, of three in the place of what stands there.
    fn put(&mut self, at: usize, depth: f64) {
        match self.depths.len() {
            3 => self.depths[at.min(2)] = depth,
            _ => self.depths.insert(at, depth),
        }
    }
}
