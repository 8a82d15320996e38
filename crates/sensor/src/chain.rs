//! The chain of EMVA 1288 (Release 4.0, linear model), from mean electrons to digital numbers, a
//! block of neighbouring pixels of a row at a time.
//!
//! | stage | symbols |
//! |---|---|
//! | [`photo_response`] | `μₑ ← μₑ·(1 + PRNU·z)` |
//! | [`dark_signal`] | `μ = μₑ + μ_I·T`, of each pixel its own with DCNU |
//! | [`shot_noise`] | `n ~ Poisson(μ)`, or its approximation |
//! | [`full_well`] | `n ← min(n, capacity)`, and what of that is read near saturation |
//! | [`read_out`] | `n + σ_read·z + DSNU·z′ + row + column` |
//! | [`convert`] | `y = clip(round(K·n + black), 0, 2ᵇ − 1)` |
//!
//! DSNU is an offset of the read-out, as the standard measures it: inside the Poisson distribution
//! it could not be negative, so that a sensor with little dark current would lose half of it.
//!
//! # The paper's approximation
//!
//! [`NoiseModel::Normal`] is the one of the paper this program follows: `n ~ N(μₑ, μₑ)` (its Eq. 5)
//! plus `N(μ_I·T, μ_I·T + σ_read²)` (its Eq. 6). Eq. (5) prints the variance as K²·g; that is DN² only
//! if g counts electrons. With g as a grey value in DN, μₑ = g/K and the variance is K·g, which is what
//! happens here: the draw is in electrons and K comes after.

use std::sync::Arc;

use crate::chip::Effects;
use crate::effects::Defect;
use crate::moments::PixelLaw;
use crate::normal::{ln, pair};
use crate::philox::{DrawUse, PhiloxKey, Site, unit32, unit52};
use crate::poisson::{FINISHED_TOGETHER, OpenPixel, PD_FROM, finish, first_try, small_means};
use crate::spec::NoiseModel;

/// Pixels of a block: enough to fill vectors, few enough to stay in the nearest cache.
pub(crate) const BLOCK: usize = 128;

/// Pixels whose special cases are looked at together.
const GROUP: usize = 32;

/// One number a pixel of a block.
pub(crate) type BlockValues = [f64; BLOCK];

/// 2⁵²: a number below 2³², added to it, is rounded to an integer (half to even) that stands in the
/// low bits.
const TO_INTEGER: f64 = 4_503_599_627_370_496.0;

/// All that the chain needs to know of a sensor and an exposure.
#[derive(Debug, Clone)]
pub(crate) struct Chain {
    pub(crate) noise: NoiseModel,
    /// `μ_I·T` (e⁻).
    pub(crate) dark: f64,
    /// Capacity (e⁻), +inf when nothing but the converter saturates.
    pub(crate) full_well: f64,
    /// `σ_read` (e⁻).
    pub(crate) read_noise: f64,
    /// K (DN/e⁻).
    pub(crate) gain: f64,
    /// Black level (DN).
    pub(crate) black: f64,
    /// 2ᵇ − 1 (DN).
    pub(crate) white: f64,
    /// Standard deviation of the relative sensitivity.
    pub(crate) prnu: f64,
    /// Standard deviation of the offset (e⁻).
    pub(crate) dsnu: f64,
    /// Relative standard deviation of the dark signal.
    pub(crate) dcnu: f64,
    /// Share of hot pixels, and the mean of their extra dark signal (e⁻).
    pub(crate) hot: [f64; 2],
    /// Shares of pixels that collect nothing, and that are always saturated.
    pub(crate) dead: f64,
    pub(crate) stuck: f64,
    /// Listed defects, and what is read near saturation.
    pub(crate) effects: Arc<Effects>,
    /// The seed of temporal noise.
    pub(crate) temporal: PhiloxKey,
    /// The seed of what a second read-out of the same electrons adds; `None` of the first.
    pub(crate) second: Option<PhiloxKey>,
    /// The serial number.
    pub(crate) pattern: PhiloxKey,
}

/// A block's place: `site` and its first column.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BlockPlace {
    pub(crate) site: Site,
    pub(crate) column: u32,
}

impl BlockPlace {
    /// The column of pixel `i` of the block.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "less than a block")]
    fn at(self, i: usize) -> u32 {
        self.column.wrapping_add(i as u32)
    }

    /// The counter of what is the same in every frame.
    #[inline(always)]
    fn fixed(self, i: usize, draw_use: DrawUse) -> [u32; 4] {
        Site { frame: 0, ..self.site }.counter(self.at(i), draw_use, 0)
    }
}

/// Exposes one block: mean photo-electrons in, digital numbers out. `offset` holds what rows and
/// columns add (e⁻) and is used up.
#[multiversion::multiversion(targets = "simd")]
pub(crate) fn expose(
    chain: &Chain,
    place: BlockPlace,
    mean: &mut BlockValues,
    offset: &mut BlockValues,
    out: &mut [u16; BLOCK],
) {
    if chain.noise == NoiseModel::None {
        dark_signal(chain.dark, mean);
        full_well(chain.full_well, mean);
        read_near_saturation(chain, mean);
        return convert(chain, mean, out);
    }
    match chain.has_pattern() {
        true => pattern(chain, place, mean, offset),
        false => dark_signal(chain.dark, mean),
    }
    let mut normals = [[0.0; BLOCK]; 2];
    let mut units = [0.0; BLOCK];
    deviates(&chain.temporal, place, &mut normals, &mut units);
    if let Some(key) = &chain.second {
        second_deviates(key, place, &mut normals[1]);
    }
    match chain.noise {
        NoiseModel::Poisson => shot_noise(chain, place, mean, &normals[0], &units),
        NoiseModel::Normal | NoiseModel::None => normal_shot_noise(mean, &normals[0]),
    }
    full_well(chain.full_well, mean);
    read_near_saturation(chain, mean);
    read_out(chain.read_noise, &normals[1], offset, mean);
    convert(chain, mean, out);
}

/// Mean and variance over frames (DN, DN²) of the first `count` pixels of a block: mean photo-electrons
/// in, mean out. `shared` is the variance of row and column offsets that change from frame to frame (e⁻²), `offset`
/// what rows and columns add in each (e⁻), which is used up.
pub(crate) fn moments(
    chain: &Chain,
    shared: f64,
    place: BlockPlace,
    count: usize,
    mean: &mut BlockValues,
    offset: &mut BlockValues,
    variance: &mut BlockValues,
) {
    match chain.has_pattern() && chain.noise != NoiseModel::None {
        true => pattern(chain, place, mean, offset),
        false => dark_signal(chain.dark, mean),
    }
    let read_noise = (chain.read_noise * chain.read_noise + shared).sqrt();
    for i in 0..count {
        let law = PixelLaw {
            noise: chain.noise,
            mean: mean[i],
            full_well: chain.full_well,
            curve: chain.effects.nonlinearity.as_ref(),
            offset: offset[i],
            read_noise,
            gain: chain.gain,
            black: chain.black,
            white: chain.white,
        };
        [mean[i], variance[i]] = law.moments();
    }
}

impl Chain {
    /// Defect of a pixel, by its number in 0..1 that decides it.
    #[inline(always)]
    fn defect(&self, chance: f64) -> Option<Defect> {
        let [hot, _] = self.hot;
        match chance {
            x if x < hot => Some(Defect::Hot),
            x if x < hot + self.dead => Some(Defect::Dead),
            x if x < hot + self.dead + self.stuck => Some(Defect::Stuck),
            _ => None,
        }
    }

    /// Defect of the pixel of a column of a site.
    pub(crate) fn defect_at(&self, site: Site, column: u32) -> Option<Defect> {
        let place = BlockPlace { site, column };
        let [.., word] = self.pattern.words(place.fixed(0, DrawUse::Pattern));
        self.defect(unit32(word))
    }

    fn has_pattern(&self) -> bool {
        let all = [self.prnu, self.dsnu, self.dcnu * self.dark, self.hot[0], self.dead, self.stuck];
        all.iter().any(|&part| part > 0.0) || !self.effects.listed.is_empty()
    }

    /// The seed of what the read-out adds.
    pub(crate) fn of_read_out(&self) -> &PhiloxKey {
        self.second.as_ref().unwrap_or(&self.temporal)
    }
}

/// Two normal deviates and a uniform one a pixel.
#[inline(always)]
fn deviates(
    key: &PhiloxKey,
    place: BlockPlace,
    normals: &mut [BlockValues; 2],
    units: &mut BlockValues,
) {
    for i in 0..BLOCK {
        let counter = place.site.counter(place.at(i), DrawUse::Temporal, 0);
        let [a, b, c, d] = key.words(counter);
        [normals[0][i], normals[1][i]] = pair([a, b, c]);
        units[i] = unit32(d);
    }
}

/// Normal deviates of a second read-out.
#[inline(always)]
fn second_deviates(key: &PhiloxKey, place: BlockPlace, normals: &mut BlockValues) {
    for (i, normal) in normals.iter_mut().enumerate() {
        let [a, b, c, _] = key.words(place.site.counter(place.at(i), DrawUse::Temporal, 0));
        [_, *normal] = pair([a, b, c]);
    }
}

/// Charge of a stuck pixel, more than any other's (e⁻).
const STUCK: f64 = 1e18;

/// PRNU, DSNU, the dark signal with DCNU, and defective pixels: the same in every frame of a sensor.
#[inline(always)]
fn pattern(chain: &Chain, place: BlockPlace, mean: &mut BlockValues, offset: &mut BlockValues) {
    let mut chance = [0.0; BLOCK];
    for i in 0..BLOCK {
        let [a, b, c, d] = chain.pattern.words(place.fixed(i, DrawUse::Pattern));
        let [response, dark] = pair([a, b, c]);
        mean[i] = photo_response(chain.prnu, response, mean[i]);
        offset[i] += chain.dsnu * dark;
        chance[i] = unit32(d);
    }
    let [share, extra] = chain.hot;
    if share > 0.0 {
        for (i, mean) in mean.iter_mut().enumerate() {
            if chance[i] < share {
                let words = chain.pattern.words(place.fixed(i, DrawUse::HotPixel));
                *mean -= extra * ln(unit52(words[0], words[1]));
            }
        }
    }
    match chain.dcnu > 0.0 {
        true => uneven_dark_signal(chain, place, mean),
        false => dark_signal(chain.dark, mean),
    }
    if chain.dead + chain.stuck > 0.0 {
        for i in 0..BLOCK {
            match chain.defect(chance[i]) {
                Some(Defect::Dead) => mean[i] = 0.0,
                Some(Defect::Stuck) => offset[i] = STUCK,
                Some(Defect::Hot) | None => {}
            }
        }
    }
    if !chain.effects.listed.is_empty() {
        listed_defects(chain, place, mean, offset);
    }
}

/// The defects of a map, as those by chance.
fn listed_defects(
    chain: &Chain,
    place: BlockPlace,
    mean: &mut BlockValues,
    offset: &mut BlockValues,
) {
    let Site { row, channel, .. } = place.site;
    #[expect(clippy::cast_possible_truncation, reason = "a block is short")]
    let columns = place.column..place.column.saturating_add(BLOCK as u32);
    for listed in chain.effects.listed_in(row, columns, channel) {
        let i = (listed.column - place.column) as usize;
        match listed.kind {
            Defect::Dead => mean[i] = 0.0,
            Defect::Stuck => offset[i] = STUCK,
            Defect::Hot => {
                let words = chain.pattern.words(place.fixed(i, DrawUse::HotPixel));
                mean[i] -= chain.hot[1] * ln(unit52(words[0], words[1]));
            }
        }
    }
}

/// `μ = μₑ + μ_I·T·(1 + DCNU·z)`; a dark current cannot be negative.
#[inline(always)]
fn uneven_dark_signal(chain: &Chain, place: BlockPlace, mean: &mut BlockValues) {
    for (i, mean) in mean.iter_mut().enumerate() {
        let [a, b, c, _] = chain.pattern.words(place.fixed(i, DrawUse::DarkCurrent));
        let [z, _] = pair([a, b, c]);
        *mean += chain.dark * (1.0 + chain.dcnu * z).max(0.0);
    }
}

/// μₑ·(1 + PRNU·z); a sensitivity cannot be negative.
#[inline(always)]
fn photo_response(prnu: f64, z: f64, mean: f64) -> f64 {
    mean * (1.0 + prnu * z).max(0.0)
}

/// `μ = μₑ + μ_I·T`.
#[inline(always)]
fn dark_signal(dark: f64, mean: &mut BlockValues) {
    for mean in mean {
        *mean += dark;
    }
}

/// n ~ Poisson(μ): electrons of light and of heat together, for a sum of Poisson variables is one.
#[inline(always)]
fn shot_noise(
    chain: &Chain,
    place: BlockPlace,
    mean: &mut BlockValues,
    normals: &BlockValues,
    units: &BlockValues,
) {
    // A first try for all; most pixels are done with it.
    let mut electrons = [0.0; BLOCK];
    for i in 0..BLOCK {
        electrons[i] = first_try(mean[i], normals[i], units[i]);
    }
    // Small means by a table; pixels whose try was refused are left open.
    let mut open = [0; BLOCK];
    let mut count = 0;
    let parts = electrons.as_chunks_mut::<GROUP>().0.iter_mut();
    let means = mean.as_chunks::<GROUP>().0.iter().zip(units.as_chunks::<GROUP>().0);
    for (group, (electrons, (mean, units))) in parts.zip(means).enumerate() {
        if any(mean, |mean| mean < PD_FROM) {
            small_means(mean, units, electrons);
        }
        if any(electrons, |n| n < 0.0) {
            for (i, n) in electrons.iter().enumerate() {
                open[count] = group * GROUP + i;
                count += usize::from(*n < 0.0);
            }
        }
    }
    // Those are finished, as many together as there are.
    for chosen in open[..count].chunks(FINISHED_TOGETHER) {
        let pixel = |i: usize| OpenPixel {
            mean: mean[i],
            normal: normals[i],
            unit: units[i],
            column: place.at(i),
        };
        let pixels = std::array::from_fn(|j| pixel(chosen[j.min(chosen.len() - 1)]));
        for (&i, n) in chosen.iter().zip(finish(&pixels, &chain.temporal, place.site)) {
            electrons[i] = n;
        }
    }
    *mean = electrons;
}

/// Tests whether a condition holds somewhere, without a branch a pixel.
#[inline(always)]
fn any(values: &[f64; GROUP], condition: impl Fn(f64) -> bool) -> bool {
    let mut any = false;
    for &value in values {
        any |= condition(value);
    }
    any
}

/// n ~ N(μ, μ), the approximation.
#[inline(always)]
fn normal_shot_noise(mean: &mut BlockValues, normals: &BlockValues) {
    for (mean, z) in mean.iter_mut().zip(normals) {
        *mean += mean.sqrt() * z;
    }
}

/// No more electrons than the pixel holds.
#[inline(always)]
fn full_well(capacity: f64, electrons: &mut BlockValues) {
    for electrons in electrons {
        *electrons = electrons.min(capacity);
    }
}

/// `n ← C·f(n/C)` where a sensor has such a curve.
#[inline(always)]
fn read_near_saturation(chain: &Chain, electrons: &mut BlockValues) {
    if let Some(curve) = &chain.effects.nonlinearity {
        for electrons in electrons {
            *electrons = chain.full_well * curve.read(*electrons / chain.full_well);
        }
    }
}

/// `n + σ_read·z` + offsets (e⁻).
#[inline(always)]
fn read_out(sigma: f64, normals: &BlockValues, offset: &BlockValues, electrons: &mut BlockValues) {
    for i in 0..BLOCK {
        electrons[i] += sigma * normals[i] + offset[i];
    }
}

/// y = clip(round(K·n + black), 0, 2ᵇ − 1), half to even.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "at most 2¹⁶ − 1 after clipping")]
fn convert(chain: &Chain, electrons: &BlockValues, out: &mut [u16; BLOCK]) {
    for i in 0..BLOCK {
        let level = (chain.gain * electrons[i] + chain.black).clamp(0.0, chain.white);
        out[i] = (level + TO_INTEGER).to_bits() as u16;
    }
}
