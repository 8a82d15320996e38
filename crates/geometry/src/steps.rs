//! A mesh that changes its shape while the shutter is open: its corners at some times, and straight lines between them.

use etendue_report::Refusal;
use glam::DVec3;

use crate::{Bounds, Vertices};

/// The corners and the normals of a mesh at growing times; in between both go in straight lines, and before the first time
/// and after the last they stay.
#[derive(Debug, Clone)]
pub struct Steps {
    times: Vec<f64>,
    corners: Vec<Vec<[f64; 3]>>,
    /// Of each time; none where the mesh has none.
    normals: Vec<Vertices<3>>,
    bounds: Bounds,
}

/// A time between two steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// The step before it.
    pub step: usize,
    /// The step after it; the same before the first time and after the last.
    pub next: usize,
    /// The share of the way from one to the other, in 0..=1.
    pub share: f64,
}

impl Steps {
    /// Shapes of the mesh of these `triangles` at `times` (s from the frame's time): corners (m) and normals by time, the
    /// latter for all or for none.
    ///
    /// # Errors
    ///
    /// When times do not grow, a list is missing or too short, or a corner is not finite.
    pub fn new(
        times: Vec<f64>,
        corners: Vec<Vec<[f64; 3]>>,
        normals: Vec<Vertices<3>>,
        triangles: &[[u32; 3]],
    ) -> Result<Self, Refusal> {
        let has_normals = normals.is_empty() || normals.len() == times.len();
        if times.is_empty() || corners.len() != times.len() || !has_normals {
            let (times, corners, normals) = (times.len(), corners.len(), normals.len());
            let why = format!("{times} times, {corners} lists of corners and {normals} of normals");
            return Err(Refusal::new(why).hint("give one of each for each time"));
        }
        let follows = |i: usize| times[i].is_finite() && (i == 0 || times[i - 1] < times[i]);
        if let Some(wrong) = (0..times.len()).find(|&i| !follows(i)) {
            let why = format!("time {wrong} is not finite or not after the one before it");
            return Err(Refusal::new(why).hint("sort the times"));
        }
        let most =
            triangles.as_flattened().iter().copied().max().map_or(0, |most| most as usize + 1);
        let mut bounds = Bounds::EMPTY;
        for (i, shape) in corners.iter().enumerate() {
            let fits = shape.len() >= most && shape.len() == corners[0].len();
            if !fits || normals.get(i).is_some_and(|normals| normals.len() != shape.len()) {
                let why = format!("the shape at time {i} has not all corners");
                return Err(Refusal::new(why).hint("give each shape as many as the first has"));
            }
            for &corner in triangles.as_flattened() {
                let corner = DVec3::from(shape[corner as usize]);
                if !corner.is_finite() {
                    let why = format!("a corner of a triangle is not finite at time {i}");
                    return Err(why.into());
                }
                bounds.include(corner);
            }
        }
        Ok(Self { times, corners, normals, bounds })
    }

    /// The times (s from the frame's time).
    #[must_use]
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Place of a time (s) among the steps.
    #[must_use]
    #[inline]
    pub fn moment(&self, time: f64) -> Moment {
        let next = self.times.partition_point(|&step| step <= time);
        let last = self.times.len() - 1;
        match next {
            0 => Moment { step: 0, next: 0, share: 0.0 },
            next if next > last => Moment { step: last, next: last, share: 0.0 },
            next => {
                let [from, to] = [self.times[next - 1], self.times[next]];
                Moment { step: next - 1, next, share: (time - from) / (to - from) }
            }
        }
    }

    /// Corner `i` (m, in the mesh's frame) at a moment.
    #[must_use]
    #[inline]
    pub fn corner(&self, Moment { step, next, share }: Moment, i: usize) -> DVec3 {
        let [from, to] = [step, next].map(|step| DVec3::from(self.corners[step][i]));
        from + (to - from) * share
    }

    /// Normal `i` at a moment, of any length; `None` where the mesh has none.
    #[must_use]
    #[inline]
    pub fn normal(&self, Moment { step, next, share }: Moment, i: usize) -> Option<DVec3> {
        let at = |step: usize| {
            let normals = self.normals.get(step)?;
            Some(DVec3::from(normals.get(i).map(f64::from)))
        };
        let [from, to] = [at(step)?, at(next)?];
        Some(from + (to - from) * share)
    }

    /// The box around all triangles at all times (m, in the mesh's frame).
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Bytes of corners and normals.
    #[must_use]
    pub fn heap_bytes(&self) -> usize {
        let corners: usize = self.corners.iter().map(|shape| size_of_val(&shape[..])).sum();
        let normals: usize = self.normals.iter().map(|it| it.floats().heap_bytes()).sum();
        corners + normals + size_of_val(&self.times[..])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: [[u32; 3]; 1] = [[0, 1, 2]];

    fn shape(x: f64) -> Vec<[f64; 3]> {
        vec![[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, x]]
    }

    #[test]
    fn corners_go_in_straight_lines_and_stay_at_the_ends() {
        let shapes = [0.0, 1.0, 4.0].map(shape).to_vec();
        let steps = Steps::new(vec![-1.0, 1.0, 2.0], shapes, Vec::new(), &TRIANGLE).expect("sound");
        for (time, x) in [(-3.0, 0.0), (-1.0, 0.0), (0.0, 0.5), (1.0, 1.0), (1.5, 2.5), (9.0, 4.0)]
        {
            assert_eq!(steps.corner(steps.moment(time), 2), DVec3::new(x, 1.0, x), "at {time}");
        }
        assert_eq!(steps.normal(steps.moment(0.0), 0), None);
        assert_eq!(steps.bounds().max, DVec3::new(5.0, 1.0, 4.0));
    }

    #[test]
    fn what_makes_no_steps_is_refused() {
        let new = |times: &[f64], shapes: Vec<Vec<[f64; 3]>>| {
            let steps = Steps::new(times.to_vec(), shapes, Vec::new(), &TRIANGLE);
            steps.expect_err("unsound").why().to_owned()
        };
        assert_eq!(new(&[], Vec::new()), "0 times, 0 lists of corners and 0 of normals");
        let order = new(&[0.0, 0.0], vec![shape(0.0); 2]);
        assert_eq!(order, "time 1 is not finite or not after the one before it");
        let corners = new(&[0.0], vec![shape(0.0)[..2].to_vec()]);
        assert_eq!(corners, "the shape at time 0 has not all corners");
        let broken = new(&[0.0, 1.0], vec![shape(0.0), shape(f64::NAN)]);
        assert_eq!(broken, "a corner of a triangle is not finite at time 1");
    }
}
