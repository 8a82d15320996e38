//! Landings of the rays of a block, side by side: where rays start, those that are traced, and where they land.

use std::ops::Range;

use etendue_optics::element::{Block, LANES};
use etendue_optics::train::RimTrace;
use glam::DVec3;

use crate::FilmSamples;
use crate::lens::nodes::{MOST_NODES, NextTerm};
use crate::lens::opened::BandInterpolation;

type Row = [f64; LANES];

/// No pixel.
pub(super) const NOWHERE: u32 = u32::MAX;

/// The film, and the margin beside it from which rays start (pixels).
#[derive(Debug, Clone, Copy)]
pub(super) struct StartArea {
    pub(super) resolution: [u32; 2],
    pub(super) margin: f64,
}

impl StartArea {
    /// True if a place is on the film.
    pub(super) fn is_seen(&self, [x, y]: [f64; 2]) -> bool {
        let [width, height] = self.size();
        x >= 0.0 && y >= 0.0 && x < width && y < height
    }

    /// Width and height of the film.
    pub(super) fn size(&self) -> [f64; 2] {
        self.resolution.map(f64::from)
    }

    /// The lowest places from which rays start, and the first beyond the highest.
    pub(super) fn bounds(&self) -> [[f64; 2]; 2] {
        [[-self.margin; 2], self.size().map(|side| side + self.margin)]
    }

    /// Index of the pixel in which a place of the film lies.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "of a picture")]
    pub(super) fn pixel_at(&self, [x, y]: [f64; 2]) -> u32 {
        y as u32 * self.resolution[0] + x as u32
    }
}

/// Data from which the places of rays on the film follow.
pub(super) struct LandingContext<'a> {
    pub(super) paths: &'a BandInterpolation,
    pub(super) area: &'a StartArea,
    /// The next term, in pixels of the film.
    pub(super) next: NextTerm,
    /// Pixels in a mm.
    pub(super) to_pixels: f64,
}

impl LandingContext<'_> {
    /// The lanes, a bit each, of those `count` rays from `start` on whose places at all nodes follow from how they start, as
    /// they pass at each without loss.
    pub(super) fn known_lanes(&self, rims: &RimTrace, start: usize, count: usize) -> u32 {
        let BandInterpolation { nodes, rims: bounds, displacements, has_losses, .. } = self.paths;
        if displacements.is_none() && (nodes.len() > 1 || *has_losses) {
            return 0;
        }
        let is_within = |lane: usize| u32::from(bounds.is_none() || rims.is_within(start + lane));
        (0..count).fold(0, |known, lane| known | is_within(lane) << lane)
    }
}

/// Rays that leave the lens at one node, and where they end at all of them.
#[derive(Debug, Clone, Default)]
pub(super) struct TracedRays {
    /// Number among the rays that leave the camera.
    pub(super) ray: Vec<usize>,
    /// The point where it leaves the lens (mm), its direction, its weight before the lens, and its node.
    pub(super) points: Vec<DVec3>,
    pub(super) directions: Vec<DVec3>,
    pub(super) weights: Vec<f64>,
    pub(super) leading: Vec<usize>,
    /// True of one that keeps away from rims by more than wavelengths part, as was found at its node.
    pub(super) is_inner: Vec<bool>,
    /// True of one that passes at all wavelengths, as far as was found at other nodes.
    pub(super) is_within: Vec<bool>,
    /// `[ray][node]`: the place (pixels), and the share that the lens passes, 0 where it ends.
    pub(super) places: Vec<[f64; 2]>,
    pub(super) shares: Vec<f64>,
}

/// The start of a ray on the film.
#[derive(Debug, Clone, Copy)]
pub(super) struct RayStart {
    /// Number among the rays that leave the camera.
    pub(super) ray: usize,
    /// Place on the film (pixels), and the ray's weight there.
    pub(super) place: [f64; 2],
    pub(super) weight: f64,
    /// As of [`TracedRays`].
    pub(super) is_inner: bool,
    pub(super) is_within: bool,
}

impl TracedRays {
    pub(super) fn clear(&mut self) {
        self.ray.clear();
        self.points.clear();
        self.directions.clear();
        self.weights.clear();
        self.leading.clear();
        self.is_inner.clear();
        self.is_within.clear();
        self.places.clear();
        self.shares.clear();
    }

    /// Appends the ray in a lane of a block that left the lens at a node of so many.
    pub(super) fn push(
        &mut self,
        start: &RayStart,
        [node, nodes]: [usize; 2],
        block: &Block,
        lane: usize,
    ) {
        let &RayStart { ray, place, weight, is_inner, is_within } = start;
        let vector = |axes: &[[f64; LANES]; 3]| DVec3::from_array(axes.map(|axis| axis[lane]));
        self.ray.push(ray);
        self.is_inner.push(is_inner);
        self.is_within.push(is_within);
        self.points.push(vector(&block.position));
        self.directions.push(vector(&block.direction));
        self.weights.push(weight);
        self.leading.push(node);
        let end = self.places.len();
        self.places.resize(end + nodes, [f64::NAN; 2]);
        self.shares.resize(end + nodes, 0.0);
        self.places[end + node] = place;
        self.shares[end + node] = block.throughput[lane] / weight;
    }
}

/// Rays of a block, and where they land.
#[derive(Debug, Clone, Default)]
pub(super) struct BlockLandings {
    /// Places at each node (pixels), and the shares that pass, 0 where a ray ends.
    places: [[Row; 2]; MOST_NODES],
    shares: [Row; MOST_NODES],
    /// Points where rays leave the lens, across its axis (mm).
    points: [Row; 2],
    /// Weights before the lens; and in the mean over the samples of a pixel, but for what the lens passes.
    weights: Row,
    scales: Row,
    spectrum: Row,
    /// The pixel on which a ray lands in all bands; nowhere if there are several.
    only: [u32; LANES],
    /// Of a ray that lands on several: `[lane][band]`.
    pixel: Vec<u32>,
    weight: Vec<f64>,
}

impl BlockLandings {
    /// Takes the starts of the samples of these numbers, and their weights.
    pub(super) fn read(&mut self, samples: &FilmSamples, numbers: &[u32], weights: &[f64]) {
        let [columns, rows] = &mut self.places[0];
        for (lane, (&number, &weight)) in numbers.iter().zip(weights).enumerate() {
            let i = number as usize;
            (columns[lane], rows[lane]) = (samples.columns[i], samples.rows[i]);
            (self.weights[lane], self.spectrum[lane]) = (weight, samples.spectrum[i]);
        }
    }

    /// Places the rays that were read, which led at a node and passed the lens, at all nodes.
    pub(super) fn displace(
        &mut self,
        node: usize,
        ctx: &LandingContext<'_>,
        rims: &RimTrace,
        block: &Block,
        start: usize,
    ) {
        let Self { places, shares, points, .. } = self;
        points.copy_from_slice(&block.position[..2]);
        let starts = places[0];
        for other in 0..ctx.paths.nodes.len() {
            shares[other] = [1.0; LANES];
            places[other] = starts;
            if let Some(known) = ctx.paths.displacements.as_ref().filter(|_| other != node) {
                let (before, _) = rims.starts().block_at(start);
                let by = [ctx.to_pixels, -ctx.to_pixels];
                known.displace([node, other], before, by, &mut places[other]);
            }
        }
    }

    /// Takes rays whose places are known at all nodes, each with its place in the spectrum.
    pub(super) fn read_traced(
        &mut self,
        ctx: &LandingContext<'_>,
        traced: &TracedRays,
        range: Range<usize>,
        spectrum: impl Fn(usize) -> f64,
    ) {
        let nodes = ctx.paths.nodes.len();
        for (lane, k) in range.enumerate() {
            for node in 0..nodes {
                let [x, y] = traced.places[k * nodes + node];
                (self.places[node][0][lane], self.places[node][1][lane]) = (x, y);
                self.shares[node][lane] = traced.shares[k * nodes + node];
            }
            let point = traced.points[k];
            (self.points[0][lane], self.points[1][lane]) = (point.x, point.y);
            (self.weights[lane], self.spectrum[lane]) =
                (traced.weights[k], spectrum(traced.ray[k]));
        }
    }

    /// Place at a node of the ray in a lane (pixels).
    #[cfg(test)]
    pub(super) fn place(&self, node: usize, lane: usize) -> [f64; 2] {
        [self.places[node][0][lane], self.places[node][1][lane]]
    }

    /// True if a ray passes at all nodes, so that its places in between are interpolated.
    pub(super) fn passes(&self, lane: usize, nodes: usize) -> bool {
        self.shares[..nodes].iter().all(|shares| shares[lane] > 0.0)
    }

    /// Weight of a ray in the mean over the samples of a pixel, but for what the lens passes.
    pub(super) fn scale(&self, lane: usize) -> f64 {
        self.scales[lane]
    }

    /// Place of a ray in the spectrum.
    pub(super) fn spectrum(&self, lane: usize) -> f64 {
        self.spectrum[lane]
    }

    /// Computes where each band's light of the rays in these lanes (a bit each) lands, and its weight.
    pub(super) fn place_bands(&mut self, ctx: &LandingContext<'_>, lanes: u32) {
        weigh(self, ctx);
        let is_one = |lane: usize| u32::from(self.only[lane] != NOWHERE);
        let are_one = (0..LANES).fold(0, |all, lane| all | is_one(lane) << lane);
        let lanes = lanes & !are_one;
        if lanes == 0 {
            return;
        }
        let bands = ctx.paths.weights.bands();
        self.pixel.resize(LANES * bands, NOWHERE);
        self.weight.resize(LANES * bands, 0.0);
        match ctx.paths.nodes.len() {
            1 => split::<1>(self, ctx, lanes),
            2 => split::<2>(self, ctx, lanes),
            3 => split::<3>(self, ctx, lanes),
            4 => split::<4>(self, ctx, lanes),
            _ => split::<MOST_NODES>(self, ctx, lanes),
        }
    }

    /// Writes the landings of the ray in a lane, band by band.
    pub(super) fn write(&self, lane: usize, pixels: &mut [u32], weights: &mut [f64]) {
        let bands = pixels.len();
        if self.only[lane] == NOWHERE {
            pixels.copy_from_slice(&self.pixel[lane * bands..][..bands]);
            weights.copy_from_slice(&self.weight[lane * bands..][..bands]);
        } else {
            pixels.fill(self.only[lane]);
            weights.fill(self.scales[lane]);
        }
    }
}

/// Computes the weights of rays, and on which pixel each lands in all bands, as most do.
#[multiversion::multiversion(targets = "simd")]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "of a picture")]
fn weigh(rays: &mut BlockLandings, ctx: &LandingContext<'_>) {
    let BlockLandings { places, shares, points, weights, scales, only, .. } = rays;
    let nodes = ctx.paths.nodes.len();
    let [[left, top], [right, bottom]] = ctx.area.bounds();
    let [width, height] = ctx.area.size();
    let mut makes = [0.0; LANES];
    for (place, share) in places[..nodes].iter().zip(&shares[..nodes]) {
        for i in 0..LANES {
            let (x, y) = (place[0][i], place[1][i]);
            let is_inside = (x >= left) & (y >= top) & (x < right) & (y < bottom);
            makes[i] += if is_inside & (share[i] > 0.0) { 1.0 } else { 0.0 };
        }
    }
    for i in 0..LANES {
        let makes = if makes[i] > 1.0 { makes[i] } else { 1.0 };
        scales[i] = weights[i] * nodes as f64 / makes;
    }
    if !ctx.paths.is_clear() {
        *only = [NOWHERE; LANES];
        return;
    }
    let [low, high] = ctx.paths.bounds.corners(&places[..nodes], &more(places, points, ctx));
    for i in 0..LANES {
        let is_seen = (low[0][i] >= 0.0) & (low[1][i] >= 0.0);
        let is_seen = is_seen & (high[0][i] < width) & (high[1][i] < height);
        let [x, y] = [low[0][i] as u32, low[1][i] as u32];
        let is_one = is_seen & (x == high[0][i] as u32) & (y == high[1][i] as u32);
        only[i] =
            if is_one { y.wrapping_mul(ctx.area.resolution[0]).wrapping_add(x) } else { NOWHERE };
    }
}

/// The next term of each ray (pixels).
#[inline(always)]
fn more(places: &[[Row; 2]; MOST_NODES], points: &[Row; 2], ctx: &LandingContext<'_>) -> [Row; 2] {
    let mut more = [[0.0; LANES]; 2];
    for i in 0..LANES {
        let [x, y] = ctx.next.at([places[0][0][i], places[0][1][i]], [points[0][i], points[1][i]]);
        (more[0][i], more[1][i]) = (x, y);
    }
    more
}

/// Computes where the light of each band of the rays in these lanes (a bit each) lands, and its weight, between nodes of
/// which there are `NODES` at most.
#[multiversion::multiversion(targets = "simd")]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "of a picture")]
fn split<const NODES: usize>(rays: &mut BlockLandings, ctx: &LandingContext<'_>, lanes: u32) {
    let BlockLandings { places, shares, points, scales, spectrum, pixel, weight, .. } = rays;
    let BandInterpolation { nodes, weights, has_losses, .. } = ctx.paths;
    let (nodes, bands) = (nodes.len(), weights.bands());
    let ([width, height], row) = (ctx.area.size(), ctx.area.resolution[0]);
    let [more_x, more_y] = more(places, points, ctx);
    for lane in 0..LANES {
        if lanes >> lane & 1 == 0 {
            continue;
        }
        let rows = weights.at(spectrum[lane]);
        let (mut at, mut share, mut of_nodes) = ([[0.0; 2]; NODES], [0.0; NODES], [rows; NODES]);
        for node in 0..NODES {
            // Nodes that there are not count nothing.
            if node < nodes {
                at[node] = [places[node][0][lane], places[node][1][lane]];
                share[node] = shares[node][lane];
                of_nodes[node] = &rows[node * bands..];
            }
            of_nodes[node] = &of_nodes[node][..bands];
        }
        let next = &rows[nodes * bands..][..bands];
        let filters = &rows[(nodes + 1) * bands..][..bands];
        let pixel = &mut pixel[lane * bands..][..bands];
        let weight = &mut weight[lane * bands..][..bands];
        let ([more_x, more_y], scale) = ([more_x[lane], more_y[lane]], scales[lane]);
        for band in 0..bands {
            let (mut x, mut y, mut passed) = (more_x * next[band], more_y * next[band], 0.0);
            for node in 0..NODES {
                x += of_nodes[node][band] * at[node][0];
                y += of_nodes[node][band] * at[node][1];
                passed += of_nodes[node][band] * share[node];
            }
            let passed = if *has_losses { passed * filters[band] } else { filters[band] };
            let is_seen = (x >= 0.0) & (y >= 0.0) & (x < width) & (y < height);
            let lands = is_seen & (passed > 0.0);
            let on = (y as u32).wrapping_mul(row).wrapping_add(x as u32);
            pixel[band] = if lands { on } else { NOWHERE };
            weight[band] = if lands { scale * passed } else { 0.0 };
        }
    }
}
