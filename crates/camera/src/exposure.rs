//! A camera in time: what its shutter and its motion make of it, and rays that are carried to where it is at theirs.

use std::sync::Arc;

use glam::DVec3;

use crate::{Camera, CameraRays, FilmSamples, Kinematics, Pose, Shutter, Trajectory, TruthAt};
use etendue_geometry::{RayBatch, RaysMut};

/// Steps in which the row of a point is found that a moving camera sees; each is nearer by the ratio of the picture's
/// speed to the shutter's.
const STEPS: usize = 60;

/// Moments (s) so near that they are the same.
const SAME_MOMENT: f64 = 1e-15;

impl Camera {
    /// The shutter, where the scene gives one or the camera moves.
    #[must_use]
    pub fn shutter(&self) -> Option<&Shutter> {
        self.time.as_deref().map(|time| &time.shutter)
    }

    /// The camera's motion, where it moves while its shutter is open.
    #[must_use]
    pub fn motion(&self) -> Option<&Trajectory> {
        self.time.as_deref()?.motion.as_ref()
    }

    /// Sets whether something of the scene moves while the shutter is open.
    #[must_use]
    pub fn among_moving_things(mut self, things_move: bool) -> Self {
        if let Some(time) = &mut self.time {
            Arc::make_mut(time).things_move = things_move;
        }
        self
    }

    /// Sets whether some light of the scene changes with time.
    #[must_use]
    pub fn under_changing_lights(mut self, lights_change: bool) -> Self {
        if let Some(time) = &mut self.time {
            Arc::make_mut(time).lights_change = lights_change;
        }
        self
    }

    /// Returns the camera, in the same pose of the frame, with data layers that see another moment
    /// of each row's exposure.
    #[must_use]
    pub fn with_truth_at(mut self, truth_at: TruthAt) -> Self {
        if let Some(time) = &mut self.time {
            let time = Arc::make_mut(time);
            time.shutter = time.shutter.with_truth_at(truth_at);
        }
        self
    }

    /// True if some light of the scene changes with time.
    #[must_use]
    pub fn lights_change(&self) -> bool {
        self.time.as_deref().is_some_and(|time| time.lights_change)
    }

    /// Times at which the first row opens and the last one closes (s); no time without a shutter.
    #[must_use]
    pub fn exposure_span(&self) -> [f64; 2] {
        self.shutter().map_or([0.0; 2], Shutter::whole_span)
    }

    /// True if rays have times: the camera or something in the scene moves while the shutter is open.
    #[must_use]
    pub fn is_timed(&self) -> bool {
        self.time.as_deref().is_some_and(|time| time.motion.is_some() || time.things_move)
    }

    /// True if pixels of different rows see different moments.
    #[must_use]
    pub fn rows_differ(&self) -> bool {
        self.is_timed() && self.shutter().is_some_and(Shutter::rows_differ)
    }

    /// True if pixels of different rows get light of different moments.
    #[must_use]
    pub fn light_of_rows_differs(&self) -> bool {
        let changes = self.is_timed() || self.lights_change();
        changes && self.shutter().is_some_and(Shutter::rows_differ)
    }

    /// The pose at a time of the frame's clock (s).
    #[must_use]
    pub fn pose_at(&self, time: f64) -> Pose {
        self.motion().map_or(*self.pose(), |motion| motion.at(time))
    }

    /// Pose and motion of the camera at a time of the frame's clock (s), whether its shutter is open or not.
    #[must_use]
    pub fn kinematics(&self, time: f64) -> Kinematics {
        match self.time.as_deref().and_then(|time| time.trajectory.as_ref()) {
            Some(trajectory) => trajectory.kinematics(time),
            None => Kinematics::still(*self.pose()),
        }
    }

    /// The moment (s) at which data layers see what is at a place (rows from the top edge).
    #[must_use]
    pub fn truth_time(&self, row: f64) -> f64 {
        self.shutter().map_or(0.0, |shutter| shutter.truth(row))
    }

    /// The camera as it stands at a time (s): without motion.
    #[must_use]
    pub fn standing_at(&self, time: f64) -> Self {
        let mut still = self.clone();
        still.pose = self.pose_at(time);
        still.time = None;
        still
    }

    /// The camera as it stands in the frame's pose: without motion.
    #[must_use]
    pub fn standing(&self) -> Self {
        let mut still = self.clone();
        still.time = None;
        still
    }

    /// Gives chief rays the times at which data layers see their rows, and carries them, which stand as the frame's pose
    /// has them, to where the camera is then.
    pub(crate) fn carry_chief(&self, rows: &[f64], rays: &mut RayBatch) {
        let Some(shutter) = self.shutter() else { return };
        let mut last = None;
        if let Some(motion) = self.motion().filter(|_| self.is_timed()) {
            self.carry(rays, |i| {
                // Of one row, all pixels have the pose.
                let time = shutter.truth(rows[i].floor() + 0.5);
                match last {
                    Some((at, pose)) if at == time => pose,
                    _ => last.insert((time, motion.at(time))).1,
                }
            });
        }
        rays.set_times(rows[..rays.len()].iter().map(|row| shutter.truth(row.floor() + 0.5)));
    }

    /// Carries the rays of samples that have times to where the camera is then, and weighs them by how long their rows
    /// are open.
    pub(crate) fn carry_samples(&self, samples: &FilmSamples, out: &mut CameraRays) {
        if !samples.times.is_empty() {
            let CameraRays { rays, sample, .. } = &mut *out;
            let time = |sample: &u32| samples.times[*sample as usize];
            if let Some(motion) = self.motion() {
                self.carry(rays, |i| motion.at(time(&sample[i])));
            }
            rays.set_times(sample.iter().map(time));
        }
        if !samples.open_shares.is_empty() {
            let shares = out.sample.iter().map(|&sample| samples.open_shares[sample as usize]);
            out.weight.iter_mut().zip(shares).for_each(|(weight, share)| *weight *= share);
        }
    }

    fn carry(&self, rays: &mut RayBatch, mut pose_of: impl FnMut(usize) -> Pose) {
        let start = *self.pose();
        let back = start.rotation.transpose();
        let RaysMut { origins, directions, t_max, .. } = rays.arrays_mut();
        for i in 0..t_max.len() {
            let pose = pose_of(i);
            if pose == start {
                continue;
            }
            let at = |arrays: &[&mut [f64]; 3]| DVec3::from_array([0, 1, 2].map(|k| arrays[k][i]));
            let origin = at(&origins) - start.position;
            let direction = at(&directions);
            let origin = pose.position + pose.rotation * (back * origin);
            let direction = pose.rotation * (back * direction);
            for axis in 0..3 {
                origins[axis][i] = origin[axis];
                directions[axis][i] = direction[axis];
            }
        }
    }

    /// The place on the sensor of a moving camera, as [`Camera::place_of`]: the row says when the point is seen, and
    /// that where.
    pub(crate) fn moving_place_of(&self, offset: DVec3) -> Option<[f64; 2]> {
        let shutter = self.shutter()?;
        let mut time = shutter.truth(0.5 * f64::from(self.resolution()[1]));
        let mut place = None;
        for _ in 0..STEPS {
            let still = self.standing_at(time);
            let found = still.place_of(offset + (self.pose().position - still.pose().position))?;
            place = Some(found);
            let seen = shutter.truth(found[1]);
            if (seen - time).abs() < SAME_MOMENT {
                break;
            }
            time = seen;
        }
        place
    }
}
