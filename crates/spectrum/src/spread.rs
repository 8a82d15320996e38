//! Wavelengths that together stand for a wide band, where one in its middle would hide what happens
//! within it: a lens of glass is sharp at one of them and blurs the others.

use crate::colour::OBSERVER;
use crate::{Bands, Curve, VISIBLE, rgb};

/// The width of a band (nm) that one wavelength may stand for.
const STEP: f64 = 25.0;

/// Cells in which light is summed over a band: far narrower than the narrowest band of a filter.
const CELLS: u32 = 4000;

/// Wavelengths of equal weight, and what filters leave of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Spread {
    /// In ascending order (nm), each the mean of an equal share of the band's light behind the
    /// filters. So their own mean is that of the light.
    pub wavelengths: Vec<f64>,
    /// Share of light that passes all filters one behind the other, over the product of what passes
    /// each of them alone: 1 for fewer than two, 0 for two that pass different light.
    pub overlap: f64,
}

impl Bands {
    /// Wavelengths that stand for band `i` behind `filters`: one for each 25 nm of a wide band, each
    /// the mean of an equal share of its light, or [`wavelength`](Self::wavelength) alone when the
    /// band is narrow or no light is left. What depends on the wavelength linearly thus comes out as
    /// it does with all of the light.
    ///
    /// The light of a band is counted as photons, as a sensor does, that of weighted bands by their
    /// weights; that of red, green and blue as the CIE 1931 observer's x̄ + ȳ + z̄ sees it.
    #[must_use]
    pub fn spread(&self, i: usize, filters: &[&Curve]) -> Spread {
        let [from, to] = self.ends(i);
        let cell = (to - from) / f64::from(CELLS);
        let middle = |c: u32| from + (f64::from(c) + 0.5) * cell;
        let (mut total, mut passed, mut moment) = (0.0, 0.0, 0.0);
        let mut alone = vec![0.0; filters.len()];
        let mut sums = Vec::with_capacity(CELLS as usize);
        for nm in (0..CELLS).map(middle) {
            let light = self.light(i, nm);
            let mut left = light;
            for (alone, filter) in alone.iter_mut().zip(filters) {
                *alone += light * filter.held(nm);
                left *= filter.held(nm);
            }
            total += light;
            passed += left;
            moment += left * nm;
            sums.push([passed, moment]);
        }
        let independent = alone.iter().map(|alone| alone / total).product::<f64>();
        let overlap = if independent > 0.0 { passed / total / independent } else { 1.0 };
        let count = ((to - from) / STEP).ceil().max(1.0);
        if count < 2.0 || passed <= 0.0 {
            return Spread { wavelengths: vec![self.wavelength(i)], overlap };
        }
        // The moment of the light up to where so much of it has passed; within a cell light is even.
        let moment_at = |light: f64| {
            let c = sums.partition_point(|&[sum, _]| sum < light).min(sums.len() - 1);
            let [before, moment] = if c > 0 { sums[c - 1] } else { [0.0; 2] };
            let share = (light - before) / (sums[c][0] - before);
            moment + (light - before) * (from + (c as f64 + 0.5 * share) * cell)
        };
        let each = passed / count;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few dozen")]
        let ends = (1..count as u32).map(|k| moment_at(f64::from(k) * each)).chain([moment]);
        let mut before = 0.0;
        let mean = |end: f64| (end - std::mem::replace(&mut before, end)) / each;
        Spread { wavelengths: ends.map(mean).collect(), overlap }
    }

    /// Wavelengths (nm, ascending) between which lie equal shares of the light of band `i`, counted as
    /// [`Self::spread`] counts it: `shares` + 1 of them, of which the outer ones are the band's ends.
    ///
    /// # Panics
    ///
    /// When `shares` is 0.
    #[must_use]
    pub fn quantiles(&self, i: usize, shares: usize) -> Vec<f64> {
        assert!(shares > 0, "no shares");
        let [from, to] = self.ends(i);
        let cell = (to - from) / f64::from(CELLS);
        let even = || (0..=shares).map(|k| from + (to - from) * k as f64 / shares as f64).collect();
        let mut sum = 0.0;
        let sums: Vec<f64> = (0..CELLS)
            .map(|c| {
                sum += self.light(i, from + (f64::from(c) + 0.5) * cell);
                sum
            })
            .collect();
        if sum <= 0.0 {
            return even();
        }
        let inner = (1..shares).map(|k| {
            let light = sum * k as f64 / shares as f64;
            let c = sums.partition_point(|&passed| passed < light);
            let before = if c > 0 { sums[c - 1] } else { 0.0 };
            from + (c as f64 + (light - before) / (sums[c] - before)) * cell
        });
        std::iter::once(from).chain(inner).chain([to]).collect()
    }

    /// The wavelengths between which band `i` lies (nm).
    fn ends(&self, i: usize) -> [f64; 2] {
        match self {
            Self::Grey | Self::Rgb => VISIBLE,
            Self::Spectral(grid) => [grid.edges()[i], grid.edges()[i + 1]],
            Self::Weighted(bands) => [bands.grid().edges()[i], bands.grid().edges()[i + 1]],
        }
    }

    /// The light of band `i` at a wavelength (nm), to a factor.
    fn light(&self, i: usize, nm: f64) -> f64 {
        match self {
            Self::Grey | Self::Spectral(_) => nm,
            Self::Weighted(bands) => bands.weight(nm),
            Self::Rgb => {
                rgb::PRIMARIES[i].held(nm) * OBSERVER.iter().map(|c| c.held(nm)).sum::<f64>()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::curve::integral;
    use crate::{Bands, Grid};

    fn mean(of: &[f64]) -> f64 {
        of.iter().sum::<f64>() / of.len() as f64
    }

    #[test]
    fn narrow_bands_keep_their_middle_and_wide_ones_spread_over_all_of_their_light() {
        let bands = Bands::Spectral(Grid::from_edges(vec![400.0, 425.0, 525.0]).unwrap());
        assert_eq!(bands.spread(0, &[]).wavelengths, [412.5]);
        let wide = bands.spread(1, &[]).wavelengths;
        assert_eq!(wide.len(), 4);
        // Photons: densities of λ, so that the first quarter is the widest. Its mean by hand.
        let edge = |share: f64| (425f64.powi(2) + share * (525f64.powi(2) - 425f64.powi(2))).sqrt();
        for (k, nm) in (0..4).zip(&wide) {
            let [a, b] = [edge(f64::from(k) / 4.0), edge((f64::from(k) + 1.0) / 4.0)];
            let mean = 2.0 / 3.0 * (b.powi(3) - a.powi(3)) / (b.powi(2) - a.powi(2));
            // Cells are 0.025 nm wide.
            assert!((nm - mean).abs() < 1e-4, "{wide:?}");
        }
        let grey = Bands::Grey.spread(0, &[]).wavelengths;
        assert!(grey.len() == 16 && grey[0] < 400.0 && grey[15] > 765.0, "{grey:?}");
    }

    #[test]
    fn quantiles_share_the_light_evenly() {
        let bands = Bands::Spectral(Grid::from_edges(vec![400.0, 425.0, 525.0]).unwrap());
        // Photons: densities of λ, whose integral is λ²/2.
        let edge = |share: f64| (425f64.powi(2) + share * (525f64.powi(2) - 425f64.powi(2))).sqrt();
        for (k, nm) in bands.quantiles(1, 4).into_iter().enumerate() {
            // Cells are 0.025 nm wide.
            assert!((nm - edge(k as f64 / 4.0)).abs() < 1e-4, "{k}: {nm}");
        }
        let seen = |i: usize, from, to| -> f64 {
            let primary = &rgb::PRIMARIES[i];
            OBSERVER.iter().map(|c| integral(&[primary, c], from, to)).sum()
        };
        for i in 0..3 {
            let edges = Bands::Rgb.quantiles(i, 16);
            let all = seen(i, VISIBLE[0], VISIBLE[1]);
            for pair in edges.windows(2) {
                // Cells are 0.1 nm wide: what they misplace is 2e-3 of a share at most.
                let share = 16.0 * seen(i, pair[0], pair[1]) / all;
                assert!((share - 1.0).abs() < 2e-3, "{i} {pair:?}: {share}");
            }
        }
    }

    #[test]
    fn the_mean_of_the_wavelengths_is_that_of_the_light() {
        let nm = Curve::sampled(vec![[380.0, 380.0], [780.0, 780.0]]).unwrap();
        let check = |bands: Bands, i: usize, filters: &[&Curve], [moment, light]: [f64; 2]| {
            let found = bands.spread(i, filters).wavelengths;
            assert!(found.is_sorted() && found.len() == 16, "{found:?}");
            // The midpoints of cells of 0.1 nm are off by about its square.
            let (found, centroid) = (mean(&found), moment / light);
            assert!((found - centroid).abs() < 1e-3, "{found}, {centroid}");
        };
        // By the integrals of the polygons: of what the observer sees of each colour,
        let seen = |curves: &[&Curve]| -> f64 {
            OBSERVER.iter().map(|c| integral(&[curves, &[c]].concat(), 380.0, 780.0)).sum()
        };
        for (i, primary) in rgb::PRIMARIES.iter().enumerate() {
            check(Bands::Rgb, i, &[], [seen(&[&nm, primary]), seen(&[primary])]);
        }
        // and of photons behind a filter.
        let skewed = [[380.0, 0.9], [450.0, 0.0], [520.0, 1.0], [700.0, 0.05], [780.0, 0.3]];
        let filter = Curve::sampled(skewed.to_vec()).unwrap();
        let passed = |curves: &[&Curve]| integral(curves, 380.0, 780.0);
        let expected = [passed(&[&nm, &nm, &filter]), passed(&[&nm, &filter])];
        check(Bands::Grey, 0, &[&filter], expected);
    }

    #[test]
    fn filters_choose_the_wavelengths_and_what_two_of_them_leave() {
        let band = |from: f64, to: f64| {
            let [before, behind] = [from - 0.01, to + 0.01];
            Curve::sampled(vec![
                [300.0, 0.0],
                [before, 0.0],
                [from, 1.0],
                [to, 1.0],
                [behind, 0.0],
                [900.0, 0.0],
            ])
            .unwrap()
        };
        let [line, low, high] = [band(500.0, 510.0), band(400.0, 600.0), band(550.0, 700.0)];
        let through = Bands::Grey.spread(0, &[&line]);
        assert!(through.wavelengths.iter().all(|nm| (499.0..511.0).contains(nm)), "{through:?}");
        assert!((through.overlap - 1.0).abs() < 1e-12);
        // Photons of 550..600 nm, by ∫ λ dλ, over the product of both alone.
        let photons =
            |from: f64, to: f64| (to * to - from * from) / (780f64.powi(2) - 380f64.powi(2));
        let both = Bands::Grey.spread(0, &[&low, &high]);
        let expected = photons(550.0, 600.0) / (photons(400.0, 600.0) * photons(550.0, 700.0));
        // Cells are 0.1 nm wide.
        assert!((both.overlap / expected - 1.0).abs() < 2e-3, "{} {expected}", both.overlap);
        let none = Bands::Grey.spread(0, &[&line, &high]);
        assert_eq!((none.wavelengths.as_slice(), none.overlap), ([555.0].as_slice(), 0.0));
    }
}
