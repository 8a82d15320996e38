//! Matte surfaces of one colour and flat triangles, many hits at a time: what most rays of most scenes
//! meet. The same light and the same directions as surfaces in general have ([`crate::bsdf`]), in loops
//! that vectorise.

use std::f64::consts::PI;
use std::ops::Range;

use etendue_geometry::glam::DVec3;
use etendue_geometry::{HitBatch, MISS, disk};

use super::numbers::Draw;
use super::paths::Paths;
use super::shadows::Shadows;
use super::{Follow, Scratch, Tracing};
use crate::bsdf::{Bsdf, Model};
use crate::lamps::AreaLight;
use crate::light::Lights;
use crate::sampling::triangle_point;
use crate::spawn::{Anchor, ROUNDINGS, magnitudes};
use crate::{Color, Paint, Scattering};

/// Hits worked on side by side.
const LANES: usize = 64;

type Row = [f64; LANES];

/// A placement whose surface is matte and alike all over.
#[derive(Debug, Clone, Copy)]
pub(super) struct Matte {
    color: Color,
    /// What its own numbers add to the rounding of a hit (m).
    magnitudes: DVec3,
}

/// Hits on one placement, and what leaves them.
#[derive(Debug)]
pub(super) struct Patch {
    count: usize,
    /// Of each path: its number, and which of those that go on it is.
    path: [(usize, usize); LANES],
    origin: [Row; 3],
    direction: [Row; 3],
    t: Row,
    /// On the viewer's side.
    normal: [Row; 3],
    point: [Row; 3],
    error: Row,
    away: Away,
    lamps: Chosen,
}

/// The lamps that the hits of a patch ask, as [`AreaLight`] has them.
#[derive(Debug)]
struct Chosen {
    /// Which lamp, and its placement and triangle.
    chosen: [(usize, [u32; 2]); LANES],
    /// The place on it, as the weights of two of its corners.
    weights: [Row; 2],
    corner: [Row; 3],
    translation: [[Row; 3]; 2],
    edges: [[Row; 3]; 2],
    normal: [Row; 3],
    magnitudes: [Row; 3],
    /// Its chance over its area (1/m²).
    pdf: Row,
    /// 1 when it shines on both sides.
    two_sided: Row,
}

/// Rays that leave a patch.
#[derive(Debug)]
struct Away {
    start: [Row; 3],
    along: [Row; 3],
    /// How far (m).
    reach: Row,
    /// The share of light that the surface turns to the viewer per colour, over the density of the
    /// direction; or the density itself where the direction was drawn.
    value: Row,
}

impl Default for Patch {
    fn default() -> Self {
        const ZERO: Row = [0.0; LANES];
        Self {
            count: 0,
            path: [(0, 0); LANES],
            origin: [ZERO; 3],
            direction: [ZERO; 3],
            t: ZERO,
            normal: [ZERO; 3],
            point: [ZERO; 3],
            error: ZERO,
            away: Away { start: [ZERO; 3], along: [ZERO; 3], reach: ZERO, value: ZERO },
            lamps: Chosen {
                chosen: [(0, [0; 2]); LANES],
                weights: [ZERO; 2],
                corner: [ZERO; 3],
                translation: [[ZERO; 3]; 2],
                edges: [[ZERO; 3]; 2],
                normal: [ZERO; 3],
                magnitudes: [ZERO; 3],
                pdf: ZERO,
                two_sided: ZERO,
            },
        }
    }
}

impl Patch {
    /// Takes up to [`LANES`] of the paths that go on, from the first of `which` on, and leaves out
    /// those that have had their surfaces.
    fn gather(
        &mut self,
        (now, hits, alive): (&Paths, &HitBatch, &[u32]),
        which: &mut Range<usize>,
        bounces: u32,
    ) {
        self.count = 0;
        while self.count < LANES
            && let Some(k) = which.next()
        {
            let i = alive[k] as usize;
            if now.states[i].is_last || now.states[i].bounces >= bounces {
                continue;
            }
            let lane = self.count;
            self.path[lane] = (i, k);
            self.t[lane] = hits.t[i];
            for axis in 0..3 {
                self.origin[axis][lane] = now.rays.origins()[axis][i];
                self.direction[axis][lane] = now.rays.directions()[axis][i];
                self.normal[axis][lane] = hits.normal[axis][i];
            }
            self.count += 1;
        }
    }

    /// Chooses a lamp and a place on it for each hit.
    fn choose(&mut self, lights: &Lights, drawn: &[Vec<[f64; 2]>]) {
        let [choices, squares] = [Draw::Choice, Draw::Light].map(|draw| &drawn[draw as usize]);
        for lane in 0..self.count {
            let (_, k) = self.path[lane];
            let choice = choices.get(k).map_or(0.5, |pair| pair[0]);
            let Some((index, lamp, chance)) = lights.lamp(choice) else { continue };
            self.lamps.set(lane, (index, lamp), chance);
            let [u, v] = triangle_point(squares[k]);
            (self.lamps.weights[0][lane], self.lamps.weights[1][lane]) = (u, v);
        }
    }

    fn point(&self, lane: usize) -> DVec3 {
        at(&self.point, lane)
    }

    fn anchor(&self, lane: usize) -> Anchor {
        let normal = at(&self.normal, lane);
        Anchor { point: self.point(lane), normal, error: self.error[lane] }
    }
}

impl Chosen {
    fn set(&mut self, lane: usize, (index, lamp): (usize, &AreaLight), chance: f64) {
        self.chosen[lane] = (index, lamp.id);
        for axis in 0..3 {
            self.corner[axis][lane] = lamp.corner[axis];
            self.normal[axis][lane] = lamp.shape.normal[axis];
            self.magnitudes[axis][lane] = lamp.magnitudes[axis];
            for k in 0..2 {
                self.translation[k][axis][lane] = lamp.translation[k][axis];
                self.edges[k][axis][lane] = lamp.shape.edges[k][axis];
            }
        }
        self.pdf[lane] = chance / lamp.shape.area;
        self.two_sided[lane] = f64::from(u8::from(lamp.two_sided));
    }
}

fn at(axes: &[Row; 3], lane: usize) -> DVec3 {
    DVec3::new(axes[0][lane], axes[1][lane], axes[2][lane])
}

impl Tracing<'_> {
    /// What a placement is, if it is that simple.
    pub(super) fn matte(&self, placement: u32) -> Option<Matte> {
        let around = &self.stage.surroundings;
        let placement = around.geometry.placements.get(placement as usize)?;
        let material = around.materials.get(placement.material as usize)?;
        let mesh = around.geometry.mesh_of(placement);
        let colored = material.vertex_colors && mesh.colors.is_some();
        let tilted = material.normal_map.is_some() || mesh.normals.is_some();
        if material.scattering != Scattering::Matte || material.has_alpha() || colored || tilted {
            return None;
        }
        let Paint::Plain(color) = material.base_color else { return None };
        let color = color.map(|c| c.clamp(0.0, 1.0));
        Some(Matte { color, magnitudes: magnitudes(placement, mesh) })
    }

    /// The step of the paths `which` of those that go on, all of which met `matte`.
    pub(super) fn step_matte(
        &mut self,
        scratch: &mut Scratch,
        matte: &Matte,
        mut which: Range<usize>,
    ) {
        while !which.is_empty() {
            let Scratch { now, hits, alive, patch, .. } = &mut *scratch;
            patch.gather((now, hits, alive), &mut which, self.rules.bounces);
            measure(patch, matte.magnitudes);
            self.ask_from(scratch, matte);
            self.scatter_from(scratch, matte);
        }
    }

    /// Asks one light for each hit.
    fn ask_from(&mut self, scratch: &mut Scratch, matte: &Matte) {
        let lights = self.stage.lights;
        if let Some((light, bands)) = lights.lone_point(self.count) {
            aim_at(&mut scratch.patch, light);
            for (k, band) in scratch.radiance.iter_mut().enumerate() {
                *band = bands[k] * self.stage.spectral.band(&matte.color, k);
            }
            let Scratch { now, hits, shadows, radiance, patch, .. } = scratch;
            patch.lamps.chosen.fill((0, [MISS; 2]));
            let (radiance, value) = (&*radiance, &patch.away.value);
            self.note_shadows((now, hits, patch), shadows, |throughput, lane| {
                radiance.iter().zip(throughput).map(move |(l, t)| l * t * value[lane])
            });
        } else if lights.has_lamps() {
            let Scratch { now, hits, numbers, shadows, radiance, patch, .. } = scratch;
            patch.choose(lights, &numbers.drawn);
            aim_at_lamps(patch);
            self.stage.spectral.spread(&matte.color, radiance);
            let (color, value) = (&*radiance, &patch.away.value);
            self.note_shadows((now, hits, patch), shadows, |throughput, lane| {
                let (lamp, _) = patch.lamps.chosen[lane];
                let light = lights.bands_of_lamp(lamp, self.count).iter().zip(throughput);
                light.zip(color).map(move |((l, t), c)| l * t * c * value[lane])
            });
        } else if !lights.is_dark() {
            let Scratch { now, hits, numbers, shadows, radiance, patch, .. } = scratch;
            for lane in 0..patch.count {
                let (i, k) = patch.path[lane];
                let anchor = patch.anchor(lane);
                let wo = -at(&patch.direction, lane);
                let bsdf = Bsdf::new(Model::Matte, [anchor.normal; 2], wo, [matte.color; 2]);
                let throughput = &now.throughput[i * self.count..(i + 1) * self.count];
                let left = [hits.placement[i], hits.triangle[i]];
                let ray = now.states[i].ray;
                let numbers = numbers.of(k);
                self.sample_light(
                    &bsdf,
                    (&anchor, left),
                    (throughput, ray),
                    &numbers,
                    shadows,
                    radiance,
                );
            }
        }
    }

    /// Notes the rays of a patch to its lights. What the surface turns of their light to the viewer is
    /// `contribution`, by path and lane of the patch.
    fn note_shadows<'a, L: Iterator<Item = f64> + 'a>(
        &self,
        (now, hits, patch): (&'a Paths, &HitBatch, &'a Patch),
        shadows: &mut Shadows,
        contribution: impl Fn(&'a [f64], usize) -> L,
    ) {
        let away = &patch.away;
        let lit = || (0..patch.count).filter(|&lane| away.value[lane] > 0.0);
        for lane in lit() {
            let (i, _) = patch.path[lane];
            shadows.rays.push_between_triangles(
                at(&away.start, lane),
                at(&away.along, lane),
                [0.0, away.reach[lane]],
                [[hits.placement[i], hits.triangle[i]], patch.lamps.chosen[lane].1],
            );
            shadows.ray.push(now.states[i].ray);
            // The lone point alone is on no triangle.
            shadows.is_delta.push(patch.lamps.chosen[lane].1 == [MISS; 2]);
            let throughput = &now.throughput[i * self.count..(i + 1) * self.count];
            shadows.contribution.extend(contribution(throughput, lane));
        }
    }

    /// Chooses a direction for each hit.
    fn scatter_from(&mut self, scratch: &mut Scratch, matte: &Matte) {
        let follows_any = self.rules.follow == Follow::All;
        let lights = self.stage.lights;
        let Scratch { now, next, last, hits, numbers, patch, .. } = scratch;
        let ends = |i: usize| now.states[i].bounces + 1 >= self.rules.bounces || !follows_any;
        if !lights.is_hittable() && patch.path[..patch.count].iter().all(|&(i, _)| ends(i)) {
            return;
        }
        let mut squares = [[0.5; 2]; LANES];
        let drawn = &numbers.drawn[Draw::Direction as usize];
        for (square, &(_, k)) in squares.iter_mut().zip(&patch.path[..patch.count]) {
            *square = drawn[k];
        }
        scatter(patch, &squares);
        for lane in 0..patch.count {
            let (i, k) = patch.path[lane];
            let is_last = ends(i);
            let pdf = patch.away.value[lane];
            if pdf <= 0.0 || (is_last && !lights.is_hittable()) {
                continue;
            }
            let throughput = &mut now.throughput[i * self.count..(i + 1) * self.count];
            for (k, band) in throughput.iter_mut().enumerate() {
                *band *= self.stage.spectral.band(&matte.color, k);
            }
            let state = super::State {
                steps: now.states[i].steps + 1,
                bounces: now.states[i].bounces + 1,
                pdf,
                vertex: patch.point(lane),
                is_last,
                cone: None,
                ..now.states[i]
            };
            let chance = numbers.drawn[Draw::Chance as usize].get(k).map_or(0.5, |pair| pair[1]);
            let ray = (at(&patch.away.start, lane), at(&patch.away.along, lane));
            let left = [hits.placement[i], hits.triangle[i]];
            self.follow(ray, left, throughput, (state, chance), [&mut *next, &mut *last]);
        }
    }
}

/// Points, their errors, and normals on the viewer's side.
#[multiversion::multiversion(targets = "simd")]
fn measure(patch: &mut Patch, own: DVec3) {
    let Patch { origin, direction, t, normal, point, error, .. } = patch;
    for i in 0..LANES {
        let (x, y, z) = (normal[0][i], normal[1][i], normal[2][i]);
        let along = x * direction[0][i] + y * direction[1][i] + z * direction[2][i];
        let side = if along <= 0.0 { 1.0 } else { -1.0 };
        normal[0][i] = x * side;
        normal[1][i] = y * side;
        normal[2][i] = z * side;
    }
    error.fill(0.0);
    for axis in 0..3 {
        for i in 0..LANES {
            let start = origin[axis][i];
            let here = start + direction[axis][i] * t[i];
            point[axis][i] = here;
            error[i] += normal[axis][i].abs() * (here.abs() + start.abs() + own[axis]);
        }
    }
    for error in error {
        *error *= ROUNDINGS;
    }
}

/// Rays from the hits to the point `light`, with cos θ / (π r²): 0 where it is behind the surface.
#[multiversion::multiversion(targets = "simd")]
fn aim_at(patch: &mut Patch, light: DVec3) {
    let Patch { normal, point, error, away, .. } = patch;
    for i in 0..LANES {
        let (x, y, z) = (normal[0][i], normal[1][i], normal[2][i]);
        let (px, py, pz) = (point[0][i], point[1][i], point[2][i]);
        let (dx, dy, dz) = (light.x - px, light.y - py, light.z - pz);
        let squared = dx * dx + dy * dy + dz * dz;
        let cosine = (dx * x + dy * y + dz * z) / squared.sqrt();
        let value = cosine / (PI * squared);
        away.value[i] = if cosine > 0.0 { value } else { 0.0 };
        let (sx, sy, sz) = (px + x * error[i], py + y * error[i], pz + z * error[i]);
        let (ax, ay, az) = (light.x - sx, light.y - sy, light.z - sz);
        let reach = (ax * ax + ay * ay + az * az).sqrt();
        let inverse = 1.0 / reach;
        away.start[0][i] = sx;
        away.start[1][i] = sy;
        away.start[2][i] = sz;
        away.along[0][i] = ax * inverse;
        away.along[1][i] = ay * inverse;
        away.along[2][i] = az * inverse;
        away.reach[i] = reach;
    }
}

/// Rays from the hits to places on lamps, with cos θ / π over the density, weighed by the power
/// heuristic against the density of [`scatter`]: 0 where either side is turned away.
#[multiversion::multiversion(targets = "simd")]
fn aim_at_lamps(patch: &mut Patch) {
    let Patch { normal, point, error, away, lamps, .. } = patch;
    let (mut offset, mut end) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
    let (mut squared, mut turned, mut facing) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    let mut blur = [0.0; LANES];
    for axis in 0..3 {
        for i in 0..LANES {
            let here = point[axis][i];
            let corner = lamps.corner[axis][i]
                + ((lamps.translation[0][axis][i] - here) + lamps.translation[1][axis][i]);
            let across = lamps.edges[0][axis][i] * lamps.weights[0][i]
                + lamps.edges[1][axis][i] * lamps.weights[1][i];
            let way = corner + across;
            let there = here + way;
            offset[axis][i] = way;
            end[axis][i] = there;
            squared[i] += way * way;
            turned[i] += way * normal[axis][i];
            facing[i] -= way * lamps.normal[axis][i];
            let magnitudes = there.abs() + here.abs() + lamps.magnitudes[axis][i];
            blur[i] += lamps.normal[axis][i].abs() * magnitudes;
        }
    }
    for i in 0..LANES {
        let inverse = 1.0 / squared[i].sqrt();
        let (cosine, shown) = (turned[i] * inverse, facing[i] * inverse);
        let shines = (shown > 0.0) | ((shown < 0.0) & (lamps.two_sided[i] > 0.0));
        let pdf = lamps.pdf[i] * squared[i] / shown.abs();
        let ratio = cosine / PI / pdf;
        let value = cosine / PI / ((1.0 + ratio * ratio) * pdf);
        let counts = shines & (cosine > 0.0) & (pdf < f64::INFINITY);
        away.value[i] = if counts { value } else { 0.0 };
        blur[i] *= if shown < 0.0 { -ROUNDINGS } else { ROUNDINGS };
    }
    let mut length = [0.0; LANES];
    for axis in 0..3 {
        for i in 0..LANES {
            let start = point[axis][i] + normal[axis][i] * error[i];
            let way = (end[axis][i] + lamps.normal[axis][i] * blur[i]) - start;
            away.start[axis][i] = start;
            away.along[axis][i] = way;
            length[i] += way * way;
        }
    }
    for (reach, squared) in away.reach.iter_mut().zip(length) {
        *reach = squared.sqrt();
    }
    for along in &mut away.along {
        for (along, reach) in along.iter_mut().zip(&away.reach) {
            *along /= reach;
        }
    }
}

/// Directions about the normals with density cos θ / π ([`crate::sampling`]).
#[multiversion::multiversion(targets = "simd")]
fn scatter(patch: &mut Patch, squares: &[[f64; 2]; LANES]) {
    let Patch { normal, point, error, away, .. } = patch;
    for i in 0..LANES {
        let (x, y, z) = (normal[0][i], normal[1][i], normal[2][i]);
        let [a, b] = disk::point(squares[i]);
        let c = (1.0 - a * a - b * b).max(0.0).sqrt();
        // Duff et al., "Building an Orthonormal Basis, Revisited", 2017.
        let sign = if z < 0.0 { -1.0 } else { 1.0 };
        let f = -1.0 / (sign + z);
        let g = x * y * f;
        let (ux, uy, uz) = (1.0 + sign * x * x * f, sign * g, -sign * x);
        let (vx, vy, vz) = (g, sign + y * y * f, -y);
        let (dx, dy, dz) =
            (ux * a + vx * b + x * c, uy * a + vy * b + y * c, uz * a + vz * b + z * c);
        let inverse = 1.0 / (dx * dx + dy * dy + dz * dz).sqrt();
        away.along[0][i] = dx * inverse;
        away.along[1][i] = dy * inverse;
        away.along[2][i] = dz * inverse;
        away.start[0][i] = point[0][i] + x * error[i];
        away.start[1][i] = point[1][i] + y * error[i];
        away.start[2][i] = point[2][i] + z * error[i];
        away.value[i] = c / PI;
    }
}
