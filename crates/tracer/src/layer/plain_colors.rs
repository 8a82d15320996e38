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
    layers: Vec<PlainLayer>,
    placements: Vec<PlainSurface>,
    has_normals: bool,
}

/// A layer of colours.
#[derive(Debug, Clone, Copy)]
struct PlainLayer {
    /// It is under a headlight.
    is_facing: bool,
}

/// A placement of one colour.
#[derive(Debug, Clone, Copy)]
struct PlainSurface {
    color: [f32; 3],
    /// Its mesh has normals of its own, which this carries into the world.
    turn: Option<DMat3>,
}

impl<'a> PlainColors<'a> {
    /// Layers of a scene; `None` where some show more than the colours of surfaces under a headlight, or some surface
    /// changes from place to place, or moves.
    #[must_use]
    pub fn of(scene: SceneView<'a>, layers: &[LayerSpec]) -> Option<Self> {
        let is_of_colors = |layer: &LayerSpec| {
            matches!(layer, LayerSpec::Facing | LayerSpec::Flat | LayerSpec::Albedo)
        };
        if !layers.iter().all(is_of_colors) {
            return None;
        }
        let mut placements = Vec::with_capacity(scene.geometry.placements.len());
        for placement in &scene.geometry.placements {
            let material = scene.materials.get(placement.material as usize);
            let mesh = scene.geometry.mesh_of(placement);
            let is_still = placement.motion.is_none() && mesh.steps.is_none();
            if !is_still || material.is_some_and(|material| material.occlusion.is_some()) {
                return None;
            }
            let color = scene.plain_color(placement)?.map(f32::of);
            let turn = mesh.normals.is_some().then(|| placement.world_from_mesh.normal_matrix());
            placements.push(PlainSurface { color, turn });
        }
        let has_normals = placements.iter().any(|own| own.turn.is_some());
        let layer = |layer: &LayerSpec| PlainLayer { is_facing: *layer == LayerSpec::Facing };
        let (geometry, layers) = (scene.geometry, layers.iter().map(layer).collect());
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
            let product = nx[i] * dx[i] + ny[i] * dy[i] + nz[i] * dz[i];
            let square = nx[i] * nx[i] + ny[i] * ny[i] + nz[i] * nz[i];
            cosines[i] = product.abs() / square.sqrt();
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
        let turn = self.placements.get(number)?.turn?;
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
            if !layer.is_facing {
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
