//! From samples of the film to weighted rays in the world, through the lens.

use glam::{DMat3, DVec3};

use super::lens_camera::LensCamera;
use crate::{CameraRays, FilmSamples, Pose};
use etendue_optics::element::{Block, Clip, LANES};
use etendue_optics::train::pupil::PupilSamples;
use etendue_optics::train::{ExitPupil, MonochromaticTrain, Side};

impl LensCamera {
    /// The rays of `samples` that leave the lens, which was opened.
    pub(crate) fn sample_rays(&self, pose: &Pose, samples: &FilmSamples, out: &mut CameraRays) {
        out.clear();
        let opened = self.opened.as_ref().expect("the camera is opened before it is sampled");
        let group = &opened.groups[samples.group];
        let mut order = std::mem::take(&mut out.order);
        order.clear();
        order.extend(samples.spectrum.iter().zip(0..).map(|(&u, i)| (group.lens_at(u), i)));
        if group.lenses.len() > 1 {
            order.sort_unstable();
        }
        for samples_of_lens in order.chunk_by(|a, b| a.0 == b.0) {
            let lens = &group.lenses[samples_of_lens[0].0];
            let numbers = samples_of_lens.iter().map(|&(_, i)| i);
            self.trace_samples(pose, &opened.pupil, lens, samples, numbers, out);
        }
        out.order = order;
        out.rays.coherent = true;
    }

    /// Appends the rays of some of `samples`, all at the wavelength of one lens.
    fn trace_samples(
        &self,
        pose: &Pose,
        pupil: &ExitPupil,
        lens: &MonochromaticTrain,
        samples: &FilmSamples,
        numbers: impl Iterator<Item = u32>,
        out: &mut CameraRays,
    ) {
        let first = self.aim_samples(pupil, lens, samples, numbers, out);
        lens.trace(Side::Sensor, Clip::On, &mut out.in_lens);
        out.statuses.add_all(&out.in_lens);
        self.leave(pose, first, out);
    }

    /// Starts rays for some of `samples`, which `out` names from the number on that is returned.
    pub(super) fn aim_samples(
        &self,
        pupil: &ExitPupil,
        lens: &MonochromaticTrain,
        samples: &FilmSamples,
        numbers: impl Iterator<Item = u32>,
        out: &mut CameraRays,
    ) -> usize {
        let first = out.sample.len();
        out.sample.extend(numbers);
        let film = self.focused.film();
        let [x, y] = &mut out.places;
        let of_rays = &out.sample[first..];
        x.resize(of_rays.len(), 0.0);
        y.resize(of_rays.len(), 0.0);
        out.squares.resize(of_rays.len(), [0.0; 2]);
        let starts = x.iter_mut().zip(y.iter_mut()).zip(&mut out.squares);
        for (&number, ((x, y), square)) in of_rays.iter().zip(starts) {
            let i = number as usize;
            (*x, *y) = film.place(samples.columns[i], samples.rows[i]).into();
            *square = samples.pupil[i];
        }
        let scale = 1.0 / self.solid_angle;
        let bundle = PupilSamples { scale, film: [x, y], squares: &out.squares };
        if !pupil.fill(&bundle, &mut out.in_lens) {
            self.aim_one_by_one(pupil, lens, samples, first, out);
        }
        first
    }

    /// Starts rays for the samples that `out` names from `first` on, and leaves out those of places
    /// where no light arrives.
    fn aim_one_by_one(
        &self,
        pupil: &ExitPupil,
        lens: &MonochromaticTrain,
        samples: &FilmSamples,
        first: usize,
        out: &mut CameraRays,
    ) {
        let (film, rays) = (self.focused.film(), &mut out.in_lens);
        rays.clear();
        let mut kept = first;
        for k in first..out.sample.len() {
            let number = out.sample[k];
            let i = number as usize;
            let place = film.place(samples.columns[i], samples.rows[i]);
            match pupil.sample(place, samples.pupil[i], lens.wavelength()) {
                Some(sample) => {
                    let at = pupil.film_point(place);
                    rays.push_weighted(at, sample.direction, sample.weight / self.solid_angle);
                    out.sample[kept] = number;
                    kept += 1;
                }
                None => out.statuses.unlit += 1,
            }
        }
        out.sample.truncate(kept);
    }

    /// Brings the rays that left the lens into the world; `out` names their samples from `first` on.
    pub(super) fn leave(&self, pose: &Pose, first: usize, out: &mut CameraRays) {
        let to_world =
            ToWorld { position: pose.position, turn: pose.rotation, origin: self.focused.origin() };
        let mut kept = first;
        for start in (0..out.in_lens.len()).step_by(LANES) {
            let (block, count) = out.in_lens.block_at(start);
            let (position, direction) = to_world.block(block);
            if block.is_bright(count) {
                out.rays.extend_from_block(&position, &direction, count);
                out.weight.extend_from_slice(&block.throughput[..count]);
                let from = first + start;
                out.sample.copy_within(from..from + count, kept);
                kept += count;
                continue;
            }
            for lane in (0..count).filter(|&lane| block.is_bright_at(lane)) {
                let at = |axes: &[[f64; LANES]; 3]| DVec3::from_array(axes.map(|axis| axis[lane]));
                out.rays.push(at(&position), at(&direction));
                out.weight.push(block.throughput[lane]);
                out.sample[kept] = out.sample[first + start + lane];
                kept += 1;
            }
        }
        out.sample.truncate(kept);
    }
}

/// From lens coordinates (mm) to the world (m).
struct ToWorld {
    position: DVec3,
    turn: DMat3,
    /// z of the camera's origin (mm).
    origin: f64,
}

impl ToWorld {
    /// Places and directions of a block's rays, one array an axis.
    fn block(&self, block: &Block) -> ([[f64; LANES]; 3], [[f64; LANES]; 3]) {
        let (mut position, mut direction) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        turn_block(self, block, &mut position, &mut direction);
        (position, direction)
    }
}

#[multiversion::multiversion(targets = "simd")]
fn turn_block(
    to_world: &ToWorld,
    block: &Block,
    position: &mut [[f64; LANES]; 3],
    direction: &mut [[f64; LANES]; 3],
) {
    let ToWorld { position: at, turn, origin } = *to_world;
    let [px, py, pz] = &block.position;
    let [dx, dy, dz] = &block.direction;
    for axis in 0..3 {
        let [x, y, z] = [turn.x_axis[axis], turn.y_axis[axis], turn.z_axis[axis]];
        for i in 0..LANES {
            let local = x * (px[i] * 1e-3) + y * (py[i] * 1e-3) + z * ((pz[i] - origin) * 1e-3);
            position[axis][i] = at[axis] + local;
            direction[axis][i] = x * dx[i] + y * dy[i] + z * dz[i];
        }
    }
}
