//! RGB to spectrum: linear, energy-conserving, exact on the way back.
//!
//! A colour in linear sRGB becomes the sum of three fixed spectra, weighted by its red, green and
//! blue. The three are nowhere negative and sum to 1 at every wavelength. So black is 0, white is 1 everywhere, a
//! colour in 0..=1 is a reflectance in 0..=1, and mixing colours mixes spectra.
//!
//! # Sources
//!
//! I. Mallett and C. Yuksel, "Spectral Primary Decomposition for Rendering with sRGB Reflectance",
//! EGSR 2019. Ours divides each row of their table by its sum (within 1e-5 of 1), holds the ends
//! beyond 380..=780 nm, and uses the same spectra for light, so the RGB white of a light is equal
//! energy, the white that a colour of 1 leaves as it is.
//!
//! The basis spectra of sRGB reflectances.
//!
//! # Sources
//!
//! I. Mallett and C. Yuksel, "Spectral Primary Decomposition for Rendering with sRGB Reflectance",
//! Eurographics Symposium on Rendering 2019, supplemental tables.

use std::iter;
use std::sync::LazyLock;

use crate::colour::{
    Matrix3, OBSERVER, SRGB_FROM_XYZ, apply, inverse, srgb_of_reflectance, transpose,
};
use crate::curve::integral;
use crate::{Curve, Illuminant};

/// The spectra of pure red, green and blue, 380..=780 nm; held beyond, they stay a partition of 1.
pub static PRIMARIES: LazyLock<[Curve; 3]> = LazyLock::new(|| {
    std::array::from_fn(|k| {
        let row = |(i, row): (usize, &[f64; 3])| {
            [START + STEP * i as f64, row[k] / row.iter().sum::<f64>()]
        };
        Curve::trusted(BASIS.iter().enumerate().map(row).collect())
    })
});

/// The wavelengths that stand for red, green and blue where one is asked for (nm): the centroids of
/// their spectra as the CIE 1931 observer sees them (weights x̄ + ȳ + z̄).
pub const PRIMARY_WAVELENGTHS: [f64; 3] = [609.5, 547.6, 455.5];

/// The spectrum of a linear sRGB colour over all that the observer sees, 360..=830 nm. Parts that
/// are not finite count as 0.
#[must_use]
pub fn spectrum(rgb: [f64; 3]) -> Curve {
    let rgb = rgb.map(|part| if part.is_finite() { part } else { 0.0 });
    let [low, high] = OBSERVER[0].range();
    let wavelengths = PRIMARIES[0].samples().iter().map(|s| s[0]);
    let mix = |nm: f64| [nm, (0..3).map(|k| rgb[k] * PRIMARIES[k].held(nm)).sum()];
    Curve::trusted(iter::once(low).chain(wavelengths).chain(iter::once(high)).map(mix).collect())
}

/// The linear sRGB colour of a spectrum, the inverse of [`spectrum`]: the colour of a surface of
/// that reflectance under D65, its white being (1, 1, 1) exactly. Saturated spectra lie outside of
/// 0..=1.
#[must_use]
pub fn colour(spectrum: &Curve) -> [f64; 3] {
    apply(&ROUND_TRIP, srgb_of_reflectance(spectrum, Illuminant::D65).unwrap_or_default())
}

/// Weights of a spectrum's mean over `from..to` (nm) in its linear sRGB colour, as [`colour`].
#[must_use]
pub fn colour_of_band(from: f64, to: f64) -> [f64; 3] {
    let xyz = std::array::from_fn(|k| integral(&[&*DAYLIGHT, &OBSERVER[k]], from, to) / *WHITE_Y);
    apply(&ROUND_TRIP, apply(&SRGB_FROM_XYZ, xyz))
}

static DAYLIGHT: LazyLock<Curve> = LazyLock::new(|| Illuminant::D65.curve().unwrap_or(Curve::ONE));

static WHITE_Y: LazyLock<f64> =
    LazyLock::new(|| integral(&[&*DAYLIGHT, &OBSERVER[1]], 300.0, 900.0));

/// Turns colours of the three primaries, as integration of the tables finds them, into (1, 0, 0),
/// (0, 1, 0) and (0, 0, 1): within 3e-3 of the identity, for the authors integrated another way.
static ROUND_TRIP: LazyLock<Matrix3> = LazyLock::new(|| {
    let pure = |k: usize| spectrum(std::array::from_fn(|i| f64::from(u8::from(i == k))));
    let seen = |k: usize| srgb_of_reflectance(&pure(k), Illuminant::D65).unwrap_or_default();
    inverse(&transpose(std::array::from_fn(seen))).unwrap_or_default()
});

/// The wavelength of the first row (nm).
pub(crate) const START: f64 = 380.0;

/// From one row to the next (nm).
pub(crate) const STEP: f64 = 5.0;

/// The spectra of red, green and blue from 380 to 780 nm.
#[rustfmt::skip]
pub(crate) const BASIS: [[f64; 3]; 81] = [
    [0.327_457_413_8, 0.331_861_713_1, 0.340_680_791_5],
    [0.323_750_578_3, 0.329_688_187_8, 0.346_561_186_6],
    [0.313_439_461_3, 0.327_860_021_6, 0.358_700_493_1],
    [0.288_879_382_8, 0.319_173_580_2, 0.391_947_026_6],
    [0.239_205_681_2, 0.294_322_583_7, 0.466_471_730_6],
    [0.189_702_036_9, 0.258_697_064_8, 0.551_600_895_6],
    [0.121_746_068, 0.188_894_319_3, 0.689_359_610_9],
    [0.074_578_270_7, 0.125_388_382, 0.800_033_346_9],
    [0.044_433_158_6, 0.078_687_060_3, 0.876_879_780_9],
    [0.028_928_632_1, 0.053_143_270_9, 0.917_928_097_4],
    [0.022_316_653_5, 0.042_288_146, 0.935_395_200_7],
    [0.016_911_307_3, 0.033_318_345_5, 0.949_770_347_1],
    [0.014_181_107_1, 0.029_755_948_2, 0.956_062_944_8],
    [0.013_053_142_7, 0.030_331_250_5, 0.956_615_606_9],
    [0.011_986_163_6, 0.030_988_571_9, 0.957_025_264_9],
    [0.011_288_714_7, 0.031_686_355_2, 0.957_024_930_5],
    [0.010_906_066_5, 0.034_669_961_5, 0.954_423_972_7],
    [0.010_400_713_5, 0.034_551_957_4, 0.955_047_329],
    [0.010_637_360_3, 0.040_684_806_2, 0.948_677_833_1],
    [0.010_907_662_5, 0.054_460_037_4, 0.934_632_299_8],
    [0.011_032_712_4, 0.080_905_287_4, 0.908_061_999_9],
    [0.011_310_656_6, 0.146_348_302_9, 0.842_341_039_5],
    [0.011_154_642_1, 0.379_679_643_3, 0.609_165_715_4],
    [0.010_148_770_4, 0.766_744_268_7, 0.223_106_961],
    [0.008_918_582_1, 0.876_214_747_6, 0.114_866_670_3],
    [0.007_685_576_3, 0.918_491_655_6, 0.073_822_767_9],
    [0.006_705_708_3, 0.940_655_562_5, 0.052_638_728_8],
    [0.005_995_806, 0.953_731_884_5, 0.040_272_309],
    [0.005_537_256_6, 0.961_643_279_8, 0.032_819_462_7],
    [0.005_193_784_2, 0.967_200_019_7, 0.027_606_195_9],
    [0.005_025_362_3, 0.970_989_746_4, 0.023_984_891_1],
    [0.005_136_362_8, 0.972_852_303_6, 0.022_011_333_4],
    [0.005_433_200_3, 0.973_116_594_1, 0.021_450_205_3],
    [0.005_819_985_9, 0.973_351_069_2, 0.020_828_944_5],
    [0.006_400_572_8, 0.973_351_115_5, 0.020_248_311_4],
    [0.007_449_528_7, 0.972_261_079_7, 0.020_289_391_5],
    [0.008_583_635_8, 0.973_351_021_7, 0.018_065_342_3],
    [0.010_395_762_5, 0.973_148_495_2, 0.016_455_742_2],
    [0.013_565_433_5, 0.971_061_306_3, 0.015_373_260_1],
    [0.019_384_515_8, 0.966_371_306, 0.014_244_178_5],
    [0.032_084_071_2, 0.954_941_967_5, 0.012_973_961_6],
    [0.074_356_037_8, 0.913_578_989_6, 0.012_064_974_1],
    [0.624_393_724_2, 0.364_348_803_9, 0.011_257_478_2],
    [0.918_310_032_8, 0.071_507_242_5, 0.010_182_724_7],
    [0.949_253_030_2, 0.041_230_434_5, 0.009_516_535_4],
    [0.958_187_833_3, 0.032_423_874_2, 0.009_388_292_7],
    [0.958_187_751_3, 0.031_924_629_8, 0.009_887_619_1],
    [0.958_187_625_1, 0.031_276_033_2, 0.010_536_342],
    [0.955_679_060_8, 0.032_630_370_4, 0.011_690_568_8],
    [0.958_006_154_9, 0.029_530_872_1, 0.012_462_972_9],
    [0.954_101_573_5, 0.031_561_761_2, 0.014_336_665_2],
    [0.947_607_606_2, 0.035_674_218_3, 0.016_718_175_3],
    [0.938_681_328_4, 0.041_403_005_4, 0.019_915_666_1],
    [0.924_466_682_8, 0.050_604_260_4, 0.024_929_056_2],
    [0.904_606_025_3, 0.063_434_300_4, 0.031_959_673_6],
    [0.880_412_198_9, 0.078_918_245_3, 0.040_669_554_1],
    [0.847_787_873_2, 0.099_542_742_7, 0.052_669_382_4],
    [0.805_779_126_6, 0.125_595_760_1, 0.068_625_110_5],
    [0.752_531_853_9, 0.157_590_910_4, 0.089_877_232_3],
    [0.686_439_396_8, 0.195_398_239, 0.118_162_358_9],
    [0.618_694_570_9, 0.231_474_474_8, 0.149_830_947_4],
    [0.540_264_444, 0.268_852_136_1, 0.190_883_409_3],
    [0.472_964_416_3, 0.296_029_164_2, 0.231_006_403],
    [0.432_701_596_7, 0.309_754_994_4, 0.257_543_385_4],
    [0.405_358_045_5, 0.317_815_883_4, 0.276_826_038_7],
    [0.385_491_835, 0.322_990_347_4, 0.291_517_772_8],
    [0.370_983_584_6, 0.326_353_847_9, 0.302_662_506_1],
    [0.357_608_701_5, 0.329_143_902_3, 0.313_247_301_3],
    [0.348_712_800_1, 0.330_808_726_8, 0.320_478_325_1],
    [0.344_880_119_3, 0.331_482_689_9, 0.323_636_994_7],
    [0.341_917_877_3, 0.331_984_550_4, 0.326_097_308_8],
    [0.339_531_093, 0.332_341_172_5, 0.328_127_369_3],
    [0.337_169_503_8, 0.332_912_009_4, 0.329_917_976],
    [0.336_172_018_5, 0.332_919_279_7, 0.330_907_901_2],
    [0.335_167_443_4, 0.333_027_672_6, 0.331_803_633_1],
    [0.334_421_625_3, 0.333_179_704_7, 0.332_396_627_3],
    [0.334_008_760_4, 0.333_247_031, 0.332_740_780_7],
    [0.333_915_792_8, 0.333_259_349_2, 0.332_820_857_1],
    [0.333_818_454_9, 0.333_275_050_3, 0.332_901_731_3],
    [0.333_672_774_9, 0.333_294_328_4, 0.333_025_967_5],
    [0.333_569_513_4, 0.333_309_425, 0.333_111_083_1],
];

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_primaries_are_a_partition_of_one() {
        let [r, g, b] = &*PRIMARIES;
        for i in 300..=900 {
            let nm = f64::from(i);
            let parts = [r.held(nm), g.held(nm), b.held(nm)];
            assert!(parts.iter().all(|&part| (0.0..=1.0).contains(&part)));
            assert!((parts.iter().sum::<f64>() - 1.0).abs() < 4.0 * f64::EPSILON, "{nm}");
        }
    }

    #[test]
    fn the_correction_is_small() {
        for (i, row) in ROUND_TRIP.iter().enumerate() {
            for (k, value) in row.iter().enumerate() {
                let identity = f64::from(u8::from(i == k));
                assert!((value - identity).abs() < 3e-3, "{ROUND_TRIP:?}");
            }
        }
    }

    #[test]
    fn the_stated_wavelengths_are_the_centroids() {
        let weights: Vec<[f64; 2]> = OBSERVER[0]
            .samples()
            .iter()
            .map(|&[nm, _]| [nm, OBSERVER.iter().filter_map(|c| c.at(nm)).sum()])
            .collect();
        let weights = Curve::sampled(weights).unwrap();
        let ramp = Curve::sampled(vec![[380.0, 380.0], [780.0, 780.0]]).unwrap();
        for (curve, stated) in PRIMARIES.iter().zip(PRIMARY_WAVELENGTHS) {
            let first = integral(&[curve, &weights, &ramp], 380.0, 780.0);
            let centroid = first / integral(&[curve, &weights], 380.0, 780.0);
            assert!((centroid - stated).abs() < 0.1, "{centroid} {stated}");
        }
    }

    proptest! {
        #[test]
        fn colours_come_back_and_reflect_no_more_than_falls_in(
            r in 0.0..=1.0f64, g in 0.0..=1.0f64, b in 0.0..=1.0f64,
        ) {
            let reflectance = spectrum([r, g, b]);
            let [low, high] = reflectance.extent();
            prop_assert!(low >= 0.0 && high <= 1.0 + 4.0 * f64::EPSILON);
            let back = colour(&reflectance);
            for (value, given) in back.iter().zip([r, g, b]) {
                // Sums of a few hundred terms.
                prop_assert!((value - given).abs() < 1e-12, "{back:?}");
            }
        }

        #[test]
        fn mixing_colours_mixes_spectra(a in 0.0..4.0f64, b in 0.0..4.0f64, nm in 380.0..780.0f64) {
            let (one, other) = ([0.2, 0.7, 0.1], [0.9, 0.3, 0.4]);
            let mixed = spectrum(std::array::from_fn(|k| a * one[k] + b * other[k]));
            let expected = a * spectrum(one).held(nm) + b * spectrum(other).held(nm);
            prop_assert!((mixed.held(nm) - expected).abs() < 1e-14 * (1.0 + expected));
        }
    }
}
