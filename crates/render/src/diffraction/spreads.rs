//! The spread of light by place of the picture, depth and band: at nodes over the picture, between which
//! light belongs to the four around it, to each by its share.

use etendue_camera::{LensCamera, WaveLens};
use etendue_optics::analysis::{AnalysisError, CellGrid, CellSpread, FieldsBetween};
use etendue_scene::file::AccuracySpec;
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

use super::layers::DepthLayers;

/// Nodes a side behind an ideal lens, over whose picture nothing changes but what is cut off.
const IDEAL_NODES: usize = 3;

/// Waves of defocus that one depth may stand for. Not a setting: so few change a spread by less than what counts as
/// alike.
const ONE_DEPTH: f64 = 0.02;

/// Factor by which a dark node looks towards the middle each time.
const INWARDS: f64 = 0.88;

/// Cells a side of the tiles of a picture of one spread.
const TILE: usize = 512;

/// The most tiles a side.
const TILES: usize = 16;

/// Nodes over a picture with the fields of each.
pub(crate) struct Spreads {
    /// Nodes a side.
    pub(crate) side: usize,
    /// True if all of them have one spread: they are tiles then, which share no light.
    pub(crate) is_uniform: bool,
    /// Those of the nodes that others are seen in a mirror from, and of those that stand for themselves.
    fields: Vec<Option<FieldsBetween>>,
    /// Whose fields each node has, and whether in a mirror along x and y.
    own: Vec<(usize, [bool; 2])>,
    /// The wavelengths (nm) of each band.
    bands: Vec<Vec<f64>>,
    /// Of each layer (1/mm).
    nearness: Vec<f64>,
    grid: CellGrid,
}

/// Nodes a side, of an ideal lens or not.
fn nodes(is_ideal: bool, accuracy: &AccuracySpec) -> usize {
    if is_ideal { IDEAL_NODES } else { accuracy.spread_nodes as usize }
}

/// Depths at which fields are traced, at most: polynomials through three have all between, as defocus is linear.
const DEPTHS: usize = 3;

/// Bytes of the fields of all nodes, and of what is made of them on the way to so many `planes` of pixels: for each
/// thread the transforms of a node's cells, and the pixels that all nodes light. `cells` a pixel, of which λN has
/// `unit`, of a lens that draws sharply, and of things that lie within one depth or not.
pub(crate) fn bytes(
    lens: &LensCamera,
    accuracy: &AccuracySpec,
    resolution: [u32; 2],
    cells: u32,
    unit: f64,
    planes: usize,
    is_flat: bool,
) -> u64 {
    /// The spread, a plane, its transform and the scratch of that.
    const TRANSFORMS: usize = 4;
    let (is_ideal, wavelengths) = lens.waves_to_trace();
    let side = nodes(is_ideal, accuracy);
    let summed = accuracy.spread_wavelengths as usize;
    let traced = if lens.is_mirrored(resolution) { side.div_ceil(2) } else { side };
    let depths = if is_flat { 1 } else { DEPTHS };
    let fields = (traced * traced * wavelengths * depths + 2 * summed) * FieldsBetween::FIELD_BYTES;
    let size = resolution.map(|pixels| pixels as usize * cells as usize);
    let half = CellSpread::half_of_sharp(unit, size[0].max(size[1]));
    let window = |size: usize| size.min(2 * size / (side - 1)) + 2 * half;
    let cells_of_node = window(size[0]) * window(size[1]);
    let threads = rayon::current_num_threads();
    let transforms = threads * cells_of_node * (TRANSFORMS * size_of::<Complex64>() + 8 * planes);
    let lit = |size: usize| window(size).min(size) / cells as usize;
    let pixels = side * side * planes * size_of::<f64>() * lit(size[0]) * lit(size[1]);
    (fields + transforms + pixels) as u64
}

impl Spreads {
    /// Traces the fields of all nodes of a picture of pixels of a `pitch` (mm), in so many `cells` a side.
    ///
    /// # Errors
    ///
    /// When the waves of a lens cannot be told.
    pub(crate) fn new(
        lens: &WaveLens<'_>,
        layers: &DepthLayers,
        resolution: [u32; 2],
        cells: f64,
        pitch: f64,
        accuracy: &AccuracySpec,
    ) -> Result<Self, AnalysisError> {
        let side = nodes(lens.is_ideal(), accuracy);
        let [low, high] = layers.span();
        let nearness = match (high - low) * layers.waves > ONE_DEPTH {
            true => vec![low, 0.5 * (low + high), high],
            false => vec![0.5 * (low + high)],
        };
        let size = resolution.map(f64::from);
        let share = |k: usize| k as f64 / (side - 1) as f64;
        let fields = |k: usize| {
            let from_middle =
                [share(k % side) - 0.5, share(k / side) - 0.5].map(|share| share.clamp(-0.5, 0.5));
            let mut inwards = 1.0;
            loop {
                let place = [0, 1].map(|axis| (0.5 + inwards * from_middle[axis]) * size[axis]);
                match lens.fields(place, &nearness) {
                    Ok(fields) => return Ok(Some(fields)),
                    // The nearest place with light has its spread.
                    Err(
                        AnalysisError::Dark { .. }
                        | AnalysisError::NoChiefRay { .. }
                        | AnalysisError::Singular { .. },
                    ) if inwards > 0.1 => inwards *= INWARDS,
                    Err(AnalysisError::Dark { .. }) => return Ok(None),
                    Err(error) => return Err(error),
                }
            }
        };
        let (traced, own) = sources(side, lens.is_mirrored(resolution));
        let trace = |spreads: &mut Self, nodes: &[usize]| -> Result<(), AnalysisError> {
            let found: Vec<_> = nodes.par_iter().map(|&k| fields(traced[k])).collect();
            // The first in order fails, however threads run.
            let found = found.into_iter().collect::<Result<Vec<_>, _>>()?;
            nodes.iter().zip(found).for_each(|(&k, found)| spreads.fields[k] = found);
            Ok(())
        };
        let most = resolution.map(|side| f64::from(side) * cells).into_iter().fold(1.0, f64::max);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a picture's size"
        )]
        let grid = CellGrid { pitch: pitch / cells, turn: lens.turn(), most: most as usize };
        let most = accuracy.spread_wavelengths as usize;
        let few = |all: &Vec<f64>| few(all, most);
        let mut spreads = Self {
            side,
            is_uniform: false,
            fields: vec![None; traced.len()],
            own,
            bands: lens.wavelengths().iter().map(few).collect(),
            nearness: layers.nearness.iter().map(|near| 1e-3 * near).collect(),
            grid,
        };
        let mut first: Vec<usize> = spreads.ends().into_iter().map(|k| spreads.own[k].0).collect();
        first.sort_unstable();
        first.dedup();
        trace(&mut spreads, &first)?;
        if spreads.are_alike(accuracy.spread_difference) {
            return Ok(spreads.joined());
        }
        let rest: Vec<usize> = (0..traced.len()).filter(|k| !first.contains(k)).collect();
        trace(&mut spreads, &rest)?;
        Ok(spreads)
    }

    /// The nodes in the middle and in the corners.
    fn ends(&self) -> [usize; 5] {
        let last = self.side - 1;
        [self.side / 2 * (self.side + 1), 0, last, last * self.side, last * (self.side + 1)]
    }

    /// True if the spreads in the corners differ from that in the middle by no more than a share of the light: in the
    /// first, the middle and the last band, of the rearmost and the foremost layer. Their modulation differs by less.
    fn are_alike(&self, most: f64) -> bool {
        let [middle, corners @ ..] = self.ends();
        let bands = self.bands.len();
        let mut ends = vec![0, bands / 2, bands.saturating_sub(1)];
        ends.dedup();
        let mut layers = vec![0, self.nearness.len().saturating_sub(1)];
        layers.dedup();
        if bands == 0 || self.nearness.is_empty() {
            return false;
        }
        ends.iter().all(|&band| {
            layers.iter().all(|&layer| {
                let is_asked = |node| node == middle || corners.contains(&node);
                let spreads = self.of_layer(is_asked, layer, band);
                let Some((own, _)) = self.of_node(&spreads, middle) else { return false };
                corners.iter().all(|&corner| {
                    let other = self.of_node(&spreads, corner);
                    other.is_some_and(|(other, _)| own.difference(other) <= most)
                })
            })
        })
    }

    /// Replaces the spreads by the middle's for all of the picture.
    fn joined(mut self) -> Self {
        let fields = self.fields.swap_remove(self.own[self.ends()[0]].0);
        self.fields = vec![fields];
        self.side = (self.grid.most / TILE).clamp(1, TILES);
        self.own = vec![(0, [false; 2]); self.side * self.side];
        self.is_uniform = true;
        self
    }

    /// The spreads of light of a layer in a band, of the fields that the nodes asked for have.
    pub(crate) fn of_layer(
        &self,
        is_asked: impl Fn(usize) -> bool,
        layer: usize,
        band: usize,
    ) -> Vec<Option<CellSpread>> {
        let mut wanted = vec![false; self.fields.len()];
        for (node, &(own, _)) in self.own.iter().enumerate() {
            wanted[own] |= is_asked(node);
        }
        let near = self.nearness[layer];
        let spread = |(fields, wanted): (&Option<FieldsBetween>, bool)| {
            wanted.then(|| {
                let Some(fields) = fields else { return CellSpread::point() };
                let of_band = self.bands[band].par_iter().map(|&nm| fields.at(nm, near));
                CellSpread::of(&of_band.collect::<Vec<_>>(), &self.grid)
            })
        };
        self.fields.par_iter().zip(wanted).map(spread).collect()
    }

    /// A node's own among them, and whether it is seen in a mirror along x and y.
    pub(crate) fn of_node<'a>(
        &self,
        spreads: &'a [Option<CellSpread>],
        node: usize,
    ) -> Option<(&'a CellSpread, [bool; 2])> {
        let (own, mirrored) = self.own[node];
        spreads[own].as_ref().map(|spread| (spread, mirrored))
    }
}

/// The nodes that are traced, and which of them each node has its fields from, and in which mirrors.
fn sources(side: usize, is_mirrored: bool) -> (Vec<usize>, Vec<(usize, [bool; 2])>) {
    let traced = if is_mirrored { side.div_ceil(2) } else { side };
    let own = |k: usize| if k < traced { k } else { side - 1 - k };
    let nodes = (0..traced * traced).map(|k| k / traced * side + k % traced).collect();
    let source = |node: usize| {
        let place = [node % side, node / side];
        let [x, y] = place.map(own);
        (y * traced + x, place.map(|k| k >= traced))
    };
    (nodes, (0..side * side).map(source).collect())
}

/// So many wavelengths at most that stand for all, each for a run of them.
fn few(all: &[f64], most: usize) -> Vec<f64> {
    let count = all.len().clamp(1, most);
    let run = |k: usize| &all[k * all.len() / count..(k + 1) * all.len() / count];
    let mean = |run: &[f64]| run.iter().sum::<f64>() / run.len().max(1) as f64;
    (0..count).map(|k| mean(run(k))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each node has the fields of the traced one that is as far from the middle in both directions.
    #[test]
    fn nodes_are_seen_in_mirrors() {
        for (side, is_mirrored) in [(5, true), (3, true), (5, false)] {
            let (traced, own) = sources(side, is_mirrored);
            assert_eq!(
                traced.len(),
                if is_mirrored { side.div_ceil(2).pow(2) } else { side * side }
            );
            for (node, (source, mirrored)) in own.into_iter().enumerate() {
                let flipped = |k: usize, is_flipped| if is_flipped { side - 1 - k } else { k };
                let from = [traced[source] % side, traced[source] / side];
                let seen = [flipped(from[0], mirrored[0]), flipped(from[1], mirrored[1])];
                assert_eq!(seen, [node % side, node / side], "{side} {is_mirrored}");
            }
        }
    }
}
