//! Loops over the hits of a patch that vectorise: where they are, how light reaches them, and where a
//! matte surface sends it. The same light and the same directions as [`crate::bsdf`] has.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use std::f64::consts::PI;

use etendue_geometry::block::LANES as BLOCK;
use etendue_geometry::glam::DVec3;
use etendue_geometry::{RayBlock, disk};

use super::patch::{BESIDE, Patch, Picks};
use crate::LANES;
use crate::area_light::AreaLight;
use crate::sampling::ONE_BELOW;
use crate::surface::facing;

/// Rays and hits of blocks, whose coordinates are relative to `origin` (m), in the world.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn unpack(patch: &mut Patch, blocks: &[RayBlock], origin: [f64; 3]) {
    let seen = &mut patch.seen;
    for (number, block) in blocks.iter().enumerate() {
        let lanes = number * BLOCK..(number + 1) * BLOCK;
        let row = |to: &mut [f64; LANES], from: &[f32; BLOCK], offset: f64| {
            for (to, &from) in to[lanes.clone()].iter_mut().zip(from) {
                *to = f64::from(from) + offset;
            }
        };
        for axis in 0..3 {
            row(&mut seen.origin[axis], &block.origin[axis], origin[axis]);
            row(&mut seen.direction[axis], &block.direction[axis], 0.0);
        }
        row(&mut seen.t, &block.t_max, 0.0);
        let [x, y, z] = block.normal.map(|axis| axis.map(f64::from));
        let mut scale = [0.0; BLOCK];
        for i in 0..BLOCK {
            scale[i] = 1.0 / (x[i] * x[i] + y[i] * y[i] + z[i] * z[i]).sqrt();
        }
        for (axis, own) in [x, y, z].into_iter().enumerate() {
            for i in 0..BLOCK {
                let unit = own[i] * scale[i];
                seen.normal[axis][lanes.start + i] = unit;
                seen.shading[axis][lanes.start + i] = unit;
            }
        }
        for i in 0..BLOCK {
            let (u, v) = (f64::from(block.u[i]), f64::from(block.v[i]));
            let (rest, least) = (1.0 - u - v, if u < v { u } else { v });
            let least = if rest < least { rest } else { least };
            seen.is_beside[lanes.start + i] = if least < BESIDE { 1.0 } else { 0.0 };
        }
    }
}

/// Points, their errors of so many `roundings`, and normals on the viewer's side.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn measure(patch: &mut Patch, roundings: f64) {
    let seen = &mut patch.seen;
    let (direction, normal, shading) = (&seen.direction, &mut seen.normal, &mut seen.shading);
    for i in 0..LANES {
        let (x, y, z) = (normal[0][i], normal[1][i], normal[2][i]);
        let along = x * direction[0][i] + y * direction[1][i] + z * direction[2][i];
        let side = if along <= 0.0 { 1.0 } else { -1.0 };
        for axis in 0..3 {
            normal[axis][i] *= side;
            shading[axis][i] *= side;
        }
    }
    seen.error.fill(0.0);
    for axis in 0..3 {
        for i in 0..LANES {
            let start = seen.origin[axis][i];
            let here = start + direction[axis][i] * seen.t[i];
            seen.point[axis][i] = here;
            let magnitudes = here.abs() + start.abs() + seen.magnitudes[axis][i];
            seen.error[i] += normal[axis][i].abs() * magnitudes;
        }
    }
    for error in &mut seen.error {
        *error *= roundings;
    }
    bring_back(patch, roundings);
}

/// How far rays that leave hits of f32 beside an edge start back, over the bound of [`crate::spawn`], which
/// counts more roundings for safety than these two: of the hit, and of the origin of the ray that leaves it.
pub(super) const BACK: f64 = 0.25;

/// What rays that leave hits of f32 beside edges start back by, along the surface, against the ray that hit.
/// In f32 a hit is misplaced, and what leaves it is rounded, by some 10⁻⁷ of the coordinates: where two walls
/// meet, what starts nearer to the other wall than that may start behind it, and sees what is outside of a
/// closed room. The ray that hit came from inside.
#[inline(always)]
fn bring_back(patch: &mut Patch, roundings: f64) {
    let seen = &mut patch.seen;
    for i in 0..LANES {
        let (mut most, mut across) = (0.0_f64, 0.0);
        for axis in 0..3 {
            across += seen.normal[axis][i] * seen.direction[axis][i];
            let magnitudes =
                seen.point[axis][i].abs() + seen.origin[axis][i].abs() + seen.magnitudes[axis][i];
            most = most.max(magnitudes);
        }
        let back = seen.is_beside[i] * BACK * roundings * most;
        for axis in 0..3 {
            seen.back[axis][i] = (seen.normal[axis][i] * across - seen.direction[axis][i]) * back;
        }
    }
}

/// Shading normals as light is scattered by.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn bend(patch: &mut Patch) {
    let seen = &mut patch.seen;
    for i in 0..LANES {
        let vector = |axes: &[[f64; LANES]; 3]| DVec3::new(axes[0][i], axes[1][i], axes[2][i]);
        let (normal, wo) = (vector(&seen.normal), -vector(&seen.direction));
        let shading = facing(vector(&seen.shading), normal, wo);
        seen.shading[0][i] = shading.x;
        seen.shading[1][i] = shading.y;
        seen.shading[2][i] = shading.z;
    }
}

/// Picks one of few lights for each hit by the first numbers of the squares, as
/// [`crate::sampling::DiscreteDistribution::pick`] does.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn pick(picks: &mut Picks, below: &[f64]) {
    let Picks { index, square: [place, _], chance } = picks;
    if let [_, _] = below {
        *index = [0; LANES];
        *chance = [1.0; LANES];
        return;
    }
    let (mut start, mut end) = ([0.0; LANES], [1.0; LANES]);
    *index = [0; LANES];
    for k in 0..below.len() - 1 {
        for i in 0..LANES {
            let is_in = (below[k] <= place[i]) & (below[k] < below[k + 1]);
            start[i] = if is_in { below[k] } else { start[i] };
            end[i] = if is_in { below[k + 1] } else { end[i] };
            #[expect(clippy::cast_possible_truncation, reason = "few")]
            let number = k as u32;
            index[i] = if is_in { number } else { index[i] };
        }
    }
    for i in 0..LANES {
        let rest = (place[i] - start[i]) / (end[i] - start[i]);
        let rest = if rest > 0.0 { rest } else { 0.0 };
        place[i] = if rest < ONE_BELOW { rest } else { ONE_BELOW };
        chance[i] = end[i] - start[i];
    }
}

/// Weights of the second and third corner by squares, uniform over triangles
/// ([`crate::sampling::triangle_point`]).
#[multiversion::multiversion(targets = "simd")]
pub(super) fn spread_over_triangles(picks: &mut Picks) {
    let [u, v] = &mut picks.square;
    for i in 0..LANES {
        let root = u[i].sqrt();
        u[i] = root * (1.0 - v[i]);
        v[i] *= root;
    }
}

/// Places on the triangles that were picked, which are few, as [`super::patch::Targets::set_triangle`] has them.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn place_on_triangles(patch: &mut Patch, area_lights: &[Option<AreaLight>]) {
    let Patch { picks, targets, .. } = patch;
    let [second, third] = &picks.square;
    for (number, area_light) in (0_u32..).zip(area_lights) {
        let Some(area_light) = area_light else { continue };
        let [corner, rest] = area_light.corner;
        let edges = area_light.shape.edges;
        for axis in 0..3 {
            let [of_corner, of_rest, of_across] = &mut targets.place;
            for i in 0..LANES {
                let across = edges[0][axis] * second[i] + edges[1][axis] * third[i];
                let is_own = picks.index[i] == number;
                of_corner[axis][i] = if is_own { corner[axis] } else { of_corner[axis][i] };
                of_rest[axis][i] = if is_own { rest[axis] } else { of_rest[axis][i] };
                of_across[axis][i] = if is_own { across } else { of_across[axis][i] };
            }
            let (of_normal, of_magnitudes) = (&mut targets.normal, &mut targets.magnitudes);
            let (normal, magnitudes) = (area_light.shape.normal[axis], area_light.magnitudes[axis]);
            for i in 0..LANES {
                let is_own = picks.index[i] == number;
                of_normal[axis][i] = if is_own { normal } else { of_normal[axis][i] };
                of_magnitudes[axis][i] = if is_own { magnitudes } else { of_magnitudes[axis][i] };
            }
        }
        let (area, two_sided) =
            (area_light.shape.area, if area_light.two_sided { 1.0 } else { 0.0 });
        for i in 0..LANES {
            let is_own = picks.index[i] == number;
            let density =
                if picks.chance[i] > 0.0 { picks.chance[i] / area } else { f64::INFINITY };
            targets.density[i] = if is_own { density } else { targets.density[i] };
            targets.two_sided[i] = if is_own { two_sided } else { targets.two_sided[i] };
        }
        for i in 0..LANES {
            if picks.index[i] == number {
                targets.id[i] = area_light.id;
            }
        }
    }
    targets.is_far = [0.0; LANES];
    targets.is_delta = [0.0; LANES];
    targets.is_triangle = [1.0; LANES];
}

/// Rays from the hits to what they aim at, and the densities of their directions.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn aim(patch: &mut Patch, roundings: f64) {
    let Patch { seen, away, targets, .. } = patch;
    let (mut offset, mut squared) = ([[0.0; LANES]; 3], [0.0; LANES]);
    let (mut facing, mut blur, mut above) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    for axis in 0..3 {
        let [corner, rest, across] = targets.place.each_ref().map(|part| &part[axis]);
        for i in 0..LANES {
            let here = seen.point[axis][i];
            let way = ((corner[i] - here) + rest[i]) + across[i];
            let way = if targets.is_far[i] > 0.0 { corner[i] } else { way };
            let there = here + way;
            offset[axis][i] = way;
            squared[i] += way * way;
            facing[i] -= way * targets.normal[axis][i];
            above[i] += way * seen.normal[axis][i];
            let magnitudes = there.abs() + here.abs() + targets.magnitudes[axis][i];
            blur[i] += targets.normal[axis][i].abs() * magnitudes;
        }
    }
    let mut side = [0.0; LANES];
    for i in 0..LANES {
        let inverse = 1.0 / squared[i].sqrt();
        let shown = facing[i] * inverse;
        let shines = (shown > 0.0) | ((shown < 0.0) & (targets.two_sided[i] > 0.0));
        let of_triangle = squared[i] / shown.abs();
        let solid = if targets.is_triangle[i] > 0.0 { of_triangle } else { squared[i] };
        let solid = if targets.is_far[i] > 0.0 { 1.0 } else { solid };
        let sends = shines | (targets.is_triangle[i] == 0.0);
        away.pdf[i] = if sends { targets.density[i] * solid } else { f64::INFINITY };
        blur[i] *= if shown < 0.0 { -roundings } else { roundings };
        side[i] = if above[i] < 0.0 { -seen.error[i] } else { seen.error[i] };
        for axis in 0..3 {
            away.toward[axis][i] = offset[axis][i] * inverse;
        }
    }
    let mut length = [0.0; LANES];
    for axis in 0..3 {
        for i in 0..LANES {
            let lifted = seen.normal[axis][i] * side[i] + seen.back[axis][i];
            let way = (offset[axis][i] + targets.normal[axis][i] * blur[i]) - lifted;
            let way = if targets.is_far[i] > 0.0 { offset[axis][i] } else { way };
            away.start[axis][i] = seen.point[axis][i] + lifted;
            away.along[axis][i] = way;
            length[i] += way * way;
        }
    }
    for i in 0..LANES {
        let reach = length[i].sqrt();
        // Points that fall together see each other: a ray of no length meets nothing.
        let inverse = if reach > 0.0 { 1.0 / reach } else { 0.0 };
        for axis in 0..3 {
            away.along[axis][i] *= inverse;
        }
        away.reach[i] = if targets.is_far[i] > 0.0 { f64::INFINITY } else { reach };
    }
}

/// What matte surfaces turn to the viewer of the light that is aimed at: cos θ / π over the density,
/// weighed by the power heuristic against the density of [`scatter`]; 0 where there is none.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn reflect(patch: &mut Patch) {
    let Patch { seen, away, targets, .. } = patch;
    for i in 0..LANES {
        let [mut cosine, mut above] = [0.0; 2];
        for axis in 0..3 {
            cosine += away.toward[axis][i] * seen.shading[axis][i];
            above += away.toward[axis][i] * seen.normal[axis][i];
        }
        let pdf = away.pdf[i];
        let ratio = cosine / PI / pdf;
        let balance = if targets.is_delta[i] > 0.0 { 1.0 } else { 1.0 + ratio * ratio };
        let counts = (cosine > 0.0) & (above > 0.0) & (pdf < f64::INFINITY);
        away.value[i] = if counts { cosine / PI / (balance * pdf) } else { 0.0 };
    }
}

/// Directions about the shading normals with density cos θ / π ([`crate::sampling`]), which is 0 where
/// they run into the surface.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn scatter(patch: &mut Patch, squares: &[[f64; 2]; LANES]) {
    let Patch { seen, away, .. } = patch;
    let (normal, shading) = (&seen.normal, &seen.shading);
    for i in 0..LANES {
        let (x, y, z) = (shading[0][i], shading[1][i], shading[2][i]);
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
        let above = dx * normal[0][i] + dy * normal[1][i] + dz * normal[2][i];
        away.value[i] = if above > 0.0 { c / PI } else { 0.0 };
    }
    start_outside(patch);
}

/// Directions that smooth surfaces mirror or refract light from, and the rays along them. The value is 1 where there is
/// one.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn mirror_or_refract(patch: &mut Patch, choices: &[f64; LANES]) {
    let Patch { seen, away, smooth, .. } = patch;
    let found = (&mut away.along, &mut away.value);
    smooth.scatter([&seen.normal, &seen.shading], (&seen.direction, choices), found);
    for i in 0..LANES {
        let side = if smooth.refracts[i] > 0.0 { -seen.error[i] } else { seen.error[i] };
        for axis in 0..3 {
            let lifted = seen.normal[axis][i] * side + seen.back[axis][i];
            away.start[axis][i] = seen.point[axis][i] + lifted;
        }
    }
}

/// Starts rays that leave the hits on the viewer's side.
#[multiversion::multiversion(targets = "simd")]
pub(super) fn leave(patch: &mut Patch) {
    start_outside(patch);
}

#[inline(always)]
fn start_outside(patch: &mut Patch) {
    let Patch { seen, away, .. } = patch;
    for axis in 0..3 {
        for i in 0..LANES {
            let lifted = seen.normal[axis][i] * seen.error[i] + seen.back[axis][i];
            away.start[axis][i] = seen.point[axis][i] + lifted;
        }
    }
}
