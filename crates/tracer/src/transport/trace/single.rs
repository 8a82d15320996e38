//! Hits on surfaces that are neither matte nor bare sheets nor smooth, such as coats, brushed metal and frosted glass, and
//! on sheets too smooth for single precision: they are worked out one by one, by [`Bsdf`], among those of their block.
#![expect(clippy::needless_range_loop, reason = "a lane is an index into many arrays")]

use etendue_geometry::block::{Floats as Row, LANES};
use etendue_geometry::glam::DVec3;

use super::facets::BsdfSamples;
use super::lane::{Lane, round, single, wide};
use super::surfaces::{BlockLookup, Hits};
use crate::bsdf::sheets::LightSamples;
use crate::bsdf::{Bsdf, Weights};
use crate::sampling::power_heuristic;
use crate::transport::Tracing;
use crate::transport::media::MediumInterface;

/// Hits that are worked out one by one, in the order of their lanes.
#[derive(Debug, Default)]
pub(super) struct SingleHits {
    hits: Vec<SingleHit>,
    /// Shares that go to the viewer of the light that was asked, or on of what was scattered by chance, `[hit][band]`.
    shares: Vec<f64>,
}

/// A hit that is worked out by itself.
#[derive(Debug, Clone, Copy)]
pub(super) struct SingleHit {
    /// Counted from the first block.
    pub(super) lane: u32,
    pub(super) bsdf: Bsdf,
    /// Light may pass the surface.
    pub(super) passes: bool,
    /// The media on its sides, where they count.
    pub(super) crossing: Option<MediumInterface>,
    /// It has sent all paths that leave it, as glass that parts wavelengths does.
    pub(super) is_parted: bool,
}

impl SingleHits {
    pub(super) fn clear(&mut self) {
        self.hits.clear();
    }

    pub(super) fn is_empty(&self) -> bool {
        self.hits.is_empty()
    }

    /// Appends the hit of a lane, behind those before it.
    pub(super) fn push(&mut self, hit: SingleHit) {
        self.hits.push(hit);
    }

    /// The media on the sides of a lane's boundary.
    pub(super) fn crossing(&self, lane: usize) -> Option<MediumInterface> {
        let place = self.hits.binary_search_by_key(&lane, |own| own.lane as usize);
        self.hits[place.ok()?].crossing
    }

    /// Those of the block whose first lane that is, by their numbers, each with its lane in the block.
    fn of_block(&self, first: usize) -> impl Iterator<Item = (usize, usize)> {
        let lane = |own: &SingleHit| own.lane as usize;
        let start = self.hits.partition_point(|own| lane(own) < first);
        let own = self.hits[start..].iter().take_while(move |own| lane(own) < first + LANES);
        own.zip(start..).map(move |(own, number)| (number, own.lane as usize - first))
    }

    /// Says of a block's lanes what hits have that is known before they are measured.
    #[inline(never)]
    pub(super) fn mark<F: Lane>(&self, found: &mut BlockLookup<F>) {
        for (number, lane) in self.of_block(found.first) {
            let SingleHit { bsdf, passes, is_parted, .. } = &self.hits[number];
            if *is_parted {
                (found.scatters[lane], found.single[lane]) = (0, 0);
            }
            if bsdf.is_delta() {
                found.delta[lane] = u32::MAX;
            }
            if *passes {
                found.passed[lane] = u32::MAX;
            }
        }
    }

    /// Gives the hits of a block the normals by which lights are chosen for them: zero where light comes from both sides.
    #[inline(never)]
    pub(super) fn put_normals<F: Lane>(&self, first: usize, bent: &mut [Row<F>; 3]) {
        for (number, lane) in self.of_block(first) {
            let normal = single(self.hits[number].bsdf.receiving_normal());
            for axis in 0..3 {
                bent[axis][lane] = normal[axis];
            }
        }
    }

    /// Puts the share of light from directions to lights that hits turn to the viewer into `value`, in their lanes. How
    /// much of it in each band [`Self::in_band`] says.
    #[inline(never)]
    pub(super) fn reflect<F: Lane, const RGB: bool>(
        &mut self,
        tracing: &Tracing<'_, RGB>,
        found: &BlockLookup<F>,
        LightSamples { toward, pdf, is_delta }: LightSamples<'_, F>,
        value: &mut Row<F>,
    ) {
        let own: Vec<(usize, usize)> = self.of_block(found.first).collect();
        for (number, lane) in own {
            if found.single[lane] == 0 {
                continue;
            }
            let bsdf = self.hits[number].bsdf;
            let toward = at(toward, lane).normalize();
            let (weights, density) = match pdf[lane] < F::INFINITY {
                true => bsdf.evaluate(toward),
                false => (Weights::default(), 0.0),
            };
            let pdf = wide(pdf[lane]);
            let balance =
                if wide(is_delta[lane]) > 0.0 { 1.0 } else { power_heuristic(pdf, density) };
            value[lane] = if weights.is_zero() { F::ZERO } else { round(balance / pdf) };
            self.put_shares(tracing, number, &bsdf, weights);
        }
    }

    /// Puts the directions in which hits send the paths in place of what is there; those that only the surface can give
    /// are marked. How much goes on in each band [`Self::in_band`] says.
    #[inline(never)]
    pub(super) fn scatter<F: Lane, const RGB: bool>(
        &mut self,
        tracing: &Tracing<'_, RGB>,
        found: &BlockLookup<F>,
        hits: &Hits<F>,
        choice: &Row<F>,
        square: &[Row<F>; 2],
        left: &mut BsdfSamples<F>,
    ) {
        let own: Vec<(usize, usize)> = self.of_block(found.first).collect();
        for (number, lane) in own {
            if found.single[lane] == 0 {
                continue;
            }
            left.goes[lane] = 0;
            let bsdf = self.hits[number].bsdf;
            let square = [square[0][lane], square[1][lane]].map(wide);
            let Some(sample) = bsdf.sample(wide(choice[lane]), square) else { continue };
            let (along, normal) = (single(sample.direction), at(&hits.normal, lane));
            let is_behind = sample.direction.dot(normal) < 0.0;
            let side = if is_behind { -hits.error[lane] } else { hits.error[lane] };
            for axis in 0..3 {
                let lifted = hits.normal[axis][lane] * side + hits.back[axis][lane];
                left.start[axis][lane] = hits.point[axis][lane] + lifted;
                left.along[axis][lane] = along[axis];
            }
            // What is denser than single precision holds is as good as specular against any light.
            left.pdf[lane] = round(sample.pdf.min(wide(F::MAX)));
            left.goes[lane] = u32::MAX;
            left.specular[lane] = if sample.is_specular { u32::MAX } else { 0 };
            self.put_shares(tracing, number, &bsdf, sample.weights);
        }
    }

    fn put_shares<const RGB: bool>(
        &mut self,
        tracing: &Tracing<'_, RGB>,
        number: usize,
        bsdf: &Bsdf,
        weights: Weights,
    ) {
        let count = tracing.count();
        let end = (number + 1) * count;
        if self.shares.len() < end {
            self.shares.resize(end, 0.0);
        }
        for (k, share) in self.shares[number * count..end].iter_mut().enumerate() {
            *share = tracing.in_band(bsdf, weights, k);
        }
    }

    /// Puts a band, of so many, of what hits were last asked in place of what is there.
    #[inline(never)]
    pub(super) fn in_band<F: Lane>(
        &self,
        found: &BlockLookup<F>,
        band: usize,
        count: usize,
        share: &mut Row<F>,
    ) {
        for (number, lane) in self.of_block(found.first) {
            if found.single[lane] != 0 {
                share[lane] = round(self.shares.get(number * count + band).copied().unwrap_or(0.0));
            }
        }
    }
}

fn at<F: Lane>(axes: &[Row<F>; 3], lane: usize) -> DVec3 {
    DVec3::new(axes[0][lane].into(), axes[1][lane].into(), axes[2][lane].into())
}
