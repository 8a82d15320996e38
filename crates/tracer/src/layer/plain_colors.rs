//! Layers of colours where each surface is alike all over, by blocks of rays of single precision.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use etendue_geometry::block::{Floats, LANES, vector};
use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Float, Geometry, MISS, RayBlock};

use super::LayerSpec;
use super::fill::{AMBIENT, headlight, visible};
use crate::SceneView;

/// Layers of colours, and what they look up of each placement.
#[derive(Debug)]
pub struct PlainColors<'a> {
    geometry: &'a Geometry,
    layers: Vec<LayerSpec>,
    placements: Vec<PlainSurface>,
    has_normals: bool,
}

/// A placement of one colour.
#[derive(Debug, Clone, Copy)]
struct PlainSurface {
    color: [f32; 3],
    /// Its mesh has normals of its own, which this carries into the world, column by column.
    turn: Option<[[f32; 3]; 3]>,
}

impl<'a> PlainColors<'a> {
    /// Layers of a scene; `None` where some show more than the colours of surfaces under a headlight, or some surface
    /// changes from place to place, or moves.
    #[must_use]
    pub fn of(scene: SceneView<'a>, layers: &[LayerSpec]) -> Option<Self> {
        let is_of_colors = |layer: &LayerSpec| matches!(layer, LayerSpec::Facing | LayerSpec::Flat);
        if layers.is_empty() || !layers.iter().all(is_of_colors) {
            return None;
        }
        let mut placements = Vec::new();
        placements.try_reserve_exact(scene.geometry.placements.len()).ok()?;
        for placement in &scene.geometry.placements {
            let material = scene.materials.get(placement.material as usize);
            let mesh = scene.geometry.mesh_of(placement);
            let is_still = placement.motion.is_none() && mesh.steps.is_none();
            if !is_still || material.is_some_and(|material| material.occlusion.is_some()) {
                return None;
            }
            let color = scene.plain_color(placement)?.map(f32::of);
            let turn = mesh.normals.is_some().then(|| {
                let turn = placement.world_from_mesh.normal_matrix();
                turn.to_cols_array_2d().map(|column| column.map(f32::of))
            });
            placements.push(PlainSurface { color, turn });
        }
        let has_normals = placements.iter().any(|own| own.turn.is_some());
        let (geometry, layers) = (scene.geometry, layers.to_vec());
        Some(Self { geometry, layers, placements, has_normals })
    }

    /// Refills `rows`, `[block][layer][red, green, blue]`, of blocks whose hits were found.
    pub fn fill(&self, blocks: &[RayBlock], rows: &mut Vec<Floats>) {
        rows.resize(blocks.len() * self.layers.len() * 3, [0.0; LANES]);
        fill(self, blocks, rows);
    }

    /// The colours of a block's hits; those of misses are black.
    #[inline(always)]
    fn colors(&self, block: &RayBlock) -> [Floats; 3] {
        let mut colors = [[0.0; LANES]; 3];
        let first = block.placement[0];
        let mut differ = 0;
        for i in 0..LANES {
            differ |= block.placement[i] ^ first;
        }
        // Most blocks hit one thing.
        if differ == 0 {
            if let Some(own) = self.placements.get(first as usize) {
                for band in 0..3 {
                    colors[band] = [own.color[band]; LANES];
                }
            }
            return colors;
        }
        for lane in 0..LANES {
            if let Some(own) = self.placements.get(block.placement[lane] as usize) {
                for band in 0..3 {
                    colors[band][lane] = own.color[band];
                }
            }
        }
        colors
    }

    /// Light of the headlight on a block's hits: cosines between rays and normals, of the meshes' own where they have any.
    #[inline(always)]
    fn cosines(&self, block: &RayBlock) -> Floats {
        let RayBlock { direction: [dx, dy, dz], normal: [nx, ny, nz], .. } = block;
        let mut cosines = [0.0; LANES];
        for i in 0..LANES {
            // Normals are as long as triangles are large, whose squares single precision may not hold.
            let largest = nx[i].abs().max(ny[i].abs()).max(nz[i].abs());
            let (x, y, z) = (nx[i] / largest, ny[i] / largest, nz[i] / largest);
            let product = x * dx[i] + y * dy[i] + z * dz[i];
            cosines[i] = product.abs() / (x * x + y * y + z * z).sqrt();
        }
        if self.has_normals {
            for lane in 0..LANES {
                if let Some(cosine) = self.smooth_cosine(block, lane) {
                    cosines[lane] = cosine;
                }
            }
        }
        cosines
    }

    /// The cosine between a lane's ray and the normal of its mesh's corners, on the side of the triangle that the ray came
    /// from; `None` of meshes without, and of normals without a direction.
    fn smooth_cosine(&self, block: &RayBlock, lane: usize) -> Option<f32> {
        let number = block.placement[lane] as usize;
        let turn = DMat3::from_cols_array_2d(
            &self.placements.get(number)?.turn?.map(|column| column.map(f64::from)),
        );
        let mesh = self.geometry.mesh_of(&self.geometry.placements[number]);
        let normals = mesh.normals.as_ref()?;
        let [a, b, c] = mesh.triangles[block.triangle[lane] as usize];
        let [a, b, c] = [a, b, c].map(|corner| {
            let [x, y, z] = normals.get(corner as usize);
            DVec3::new(x.into(), y.into(), z.into())
        });
        let [u, v] = [block.u[lane], block.v[lane]].map(|weight| f64::from(weight.clamp(0.0, 1.0)));
        let normal = (turn * (a * (1.0 - u - v) + b * u + c * v)).try_normalize()?;
        let [geometric, direction] =
            [&block.normal, &block.direction].map(|axes| vector(axes, lane));
        // Some files' normals point inwards; the triangle's winding decides.
        let is_inward = normal.dot(geometric) < 0.0;
        let is_behind = geometric.dot(direction) > 0.0;
        let cosine = normal.dot(direction);
        Some(f32::of(if is_inward == is_behind { -cosine } else { cosine }.max(0.0)))
    }
}

#[multiversion::multiversion(targets = "simd")]
fn fill(plain: &PlainColors<'_>, blocks: &[RayBlock], rows: &mut [Floats]) {
    let (layers, _) = rows.as_chunks_mut::<3>();
    for (block, layers) in blocks.iter().zip(layers.chunks_exact_mut(plain.layers.len().max(1))) {
        let colors = plain.colors(block);
        for (out, layer) in layers.iter_mut().zip(&plain.layers) {
            *out = colors;
            if !matches!(layer, LayerSpec::Facing) {
                continue;
            }
            let cosines = plain.cosines(block);
            let [r, g, b] = out;
            for i in 0..LANES {
                let light = headlight(cosines[i], f32::of(AMBIENT));
                let light = if block.placement[i] == MISS { 0.0 } else { light };
                r[i] = visible(r[i]) * light;
                g[i] = visible(g[i]) * light;
                b[i] = visible(b[i]) * light;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use etendue_geometry::{Mesh, Positions, Transform, Vertices};

    use super::*;
    use crate::view::View;

    /// Normals are as long as triangles are large: from those of 10⁻¹² m to those of 10¹² m the headlight is as bright.
    #[test]
    fn the_headlight_does_not_depend_on_the_size_of_triangles() {
        let corners = Vertices::from_arrays(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let mesh = Mesh::new("", Positions::F32(corners), vec![[0, 1, 2]].into());
        let geometry = Geometry::alone(mesh, Transform::IDENTITY);
        let view = View { origin: DVec3::ZERO, axes: DMat3::IDENTITY, pixel: None };
        let scene = SceneView { geometry: &geometry, materials: &[], images: &[], view };
        let plain = PlainColors::of(scene, &[LayerSpec::Facing, LayerSpec::Flat]).unwrap();
        for exponent in [-24, -12, -3, 0, 6, 18, 24] {
            let length = 10_f32.powi(exponent);
            let mut block = RayBlock::EMPTY;
            block.placement = [0; LANES];
            block.placement[1] = MISS;
            block.triangle = [0; LANES];
            block.direction[2] = [-1.0; LANES];
            block.normal = [[0.0; LANES], [0.6 * length; LANES], [0.8 * length; LANES]];
            let mut rows = Vec::new();
            plain.fill(&[block], &mut rows);
            // Black, as of no material: what is left of it is a share of the headlight.
            let due = 0.08 * (0.15 + 0.85 * 0.8);
            assert!((rows[0][0] - due).abs() < 1e-6 * due, "10^{exponent}: {}", rows[0][0]);
            // Misses are black, and so are colours without light.
            assert_eq!([rows[0][1], rows[3][0]], [0.0; 2]);
        }
    }
}
