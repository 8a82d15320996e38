//! From values to colours: how a layer is made visible in a preview.

pub use etendue_tracer::layer::Look;
use rayon::prelude::*;

use super::layer::{Layer, Values};
use crate::memory::{NoMemory, filled};

/// Reason why `layer` cannot be shown as it looks, if there is one.
pub(super) fn lacks(layer: &Layer) -> Option<&'static str> {
    let channels = layer.channels.len();
    let (fits, needs) = match layer.look {
        Look::Color => (channels == 1 || channels == 3, "one channel or three"),
        Look::Distance | Look::Share => (channels == 1, "one channel"),
        Look::Direction => (channels == 3, "three channels"),
        Look::Extent => ((1..=3).contains(&channels), "one to three channels"),
        Look::Cube => (true, ""),
        Look::Ids => (matches!(layer.type_name(), "u2" | "u4"), "integers"),
        Look::Counts { bits } => (
            (channels == 1 || channels == 3)
                && layer.type_name() == "u2"
                && (1..=16).contains(&bits)
                && layer.channels.iter().all(|channel| fits_bits(&channel.values, bits)),
            "one channel or three of 16-bit integers, none larger than its 1 to 16 bits hold",
        ),
    };
    (!fits).then_some(needs)
}

fn fits_bits(values: &Values, bits: u8) -> bool {
    match values {
        Values::U16(values) => values.par_iter().max().is_none_or(|&m| u32::from(m) >> bits == 0),
        Values::F32(_) | Values::F64(_) | Values::U32(_) => false,
    }
}

/// Bits a channel of a preview.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Bits {
    /// 256 steps, as screens have them.
    #[default]
    Eight,
    /// 65 536 steps.
    Sixteen,
}

/// A layer made visible: bytes as PNG has them, rows from the top, 16-bit samples big-endian.
pub(super) struct LayerImage {
    pub(super) channels: ColourType,
    pub(super) bits: Bits,
    pub(super) bytes: Vec<u8>,
    /// It holds the layer's own numbers, where others are previews.
    pub(super) is_data: bool,
    /// Explanation of how to read it.
    pub(super) note: String,
}

/// Channels of a preview's pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ColourType {
    Grey,
    Rgb,
    Rgba,
    /// Indices of [`palette`].
    Indexed,
}

/// Shows `layer`, whose channels fit its look.
pub(super) fn show(layer: &Layer, bits: Bits) -> Result<LayerImage, NoMemory> {
    let planes: Vec<_> = layer.channels.iter().map(|channel| &channel.values).collect();
    let planes = planes.as_slice();
    match layer.look {
        Look::Color => color(planes, bits),
        Look::Distance => distance(planes, bits),
        Look::Direction => direction(planes, bits),
        Look::Extent => extent(planes, bits),
        Look::Ids => ids(planes, bits),
        Look::Share => {
            let note = "linear grey: black is 0, white is 1".into();
            let grey = |i| [unit(planes[0].at(i))];
            LayerImage::new(ColourType::Grey, bits, planes, grey, note)
        }
        Look::Cube => {
            let note = "grey: the channels' mean through the sRGB curve".into();
            let mean =
                |i| planes.iter().map(|plane| plane.at(i)).sum::<f64>() / planes.len() as f64;
            LayerImage::new(ColourType::Grey, bits, planes, |i| [srgb(mean(i))], note)
        }
        Look::Counts { bits } => counts(planes, bits),
    }
}

impl LayerImage {
    /// Shades every pixel with `N` values in 0..=1, by all threads of the current rayon pool.
    pub(super) fn new<const N: usize>(
        channels: ColourType,
        bits: Bits,
        planes: &[&Values],
        shade: impl Fn(usize) -> [f32; N] + Sync,
        note: String,
    ) -> Result<Self, NoMemory> {
        let bytes = match bits {
            Bits::Eight => {
                fill(planes, |i| shade(i).map(|v| [quantize(v, 255.0).to_be_bytes()[1]]))
            }
            Bits::Sixteen => fill(planes, |i| shade(i).map(|v| quantize(v, 65535.0).to_be_bytes())),
        };
        Ok(Self { channels, bits, bytes: bytes?, is_data: false, note })
    }
}

/// `N` samples of `B` bytes a pixel.
pub(super) fn fill<const N: usize, const B: usize>(
    planes: &[&Values],
    pixel: impl Fn(usize) -> [[u8; B]; N] + Sync,
) -> Result<Vec<u8>, NoMemory> {
    const BAND: usize = 1 << 12;
    let pixels = planes.first().map_or(0, |plane| plane.len());
    let mut bytes = filled(0, pixels * N * B)?;
    bytes.par_chunks_mut(BAND * N * B).enumerate().for_each(|(band, out)| {
        for (k, slot) in out.chunks_exact_mut(N * B).enumerate() {
            slot.copy_from_slice(pixel(band * BAND + k).as_flattened());
        }
    });
    Ok(bytes)
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to 0..=max, which is at most 65535"
)]
fn quantize(value: f32, max: f32) -> u16 {
    (value.clamp(0.0, 1.0) * max + 0.5) as u16
}

#[expect(clippy::cast_possible_truncation, reason = "a preview has at most 16 bits")]
pub(super) fn unit(value: f64) -> f32 {
    value as f32
}

/// The sRGB curve (IEC 61966-2-1:1999, 5.2), in f32: its error of some 10⁻⁷ is far below a step of
/// 16 bits, and every value of a picture passes here.
pub(super) fn srgb(linear: f64) -> f32 {
    let linear = unit(linear.clamp(0.0, 1.0));
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

fn color(planes: &[&Values], bits: Bits) -> Result<LayerImage, NoMemory> {
    let note = "sRGB; light above full scale is clipped".into();
    match *planes {
        [r, g, b] => {
            let rgb = |i| [r, g, b].map(|plane| srgb(plane.at(i)));
            LayerImage::new(ColourType::Rgb, bits, planes, rgb, note)
        }
        _ => LayerImage::new(ColourType::Grey, bits, planes, |i| [srgb(planes[0].at(i))], note),
    }
}

/// Brightness of the farthest distance shown: darker is only a miss.
const FAR_GREY: f64 = 0.125;

fn distance(planes: &[&Values], bits: Bits) -> Result<LayerImage, NoMemory> {
    let plane = planes[0];
    let Some((near, far)) = spread(plane) else {
        let note = "every pixel is a miss (black)".into();
        return LayerImage::new(ColourType::Grey, bits, planes, |_| [0.0], note);
    };
    // Reciprocal distances give a plane that runs to the horizon, or a room, even steps; they need
    // a range on one side of zero.
    let reciprocal = near > 0.0;
    let nearness = |d: f64| if reciprocal { d.recip() } else { -d };
    let (low, range) = (nearness(far), nearness(near) - nearness(far));
    let grey = |i| {
        let d = plane.at(i);
        if !d.is_finite() {
            return [0.0];
        }
        let share = if range > 0.0 { (nearness(d.clamp(near, far)) - low) / range } else { 1.0 };
        [unit(FAR_GREY + (1.0 - FAR_GREY) * share)]
    };
    let note = format!(
        "grey, linear in {}: white is {near} or nearer (nearest hundredth of the pixels), {FAR_GREY} \
         of white is {far} or farther (farthest hundredth), black is a miss",
        if reciprocal { "the reciprocal distance" } else { "the distance" },
    );
    LayerImage::new(ColourType::Grey, bits, planes, grey, note)
}

/// The 1st and the 99th percentile of finite values, from an even sample of all: single outliers
/// must not darken the rest.
pub(super) fn spread(plane: &Values) -> Option<(f64, f64)> {
    const SAMPLE: usize = 1 << 16;
    // An odd step visits all columns, also of a width that is a power of two.
    let step = (plane.len() / SAMPLE) | 1;
    let every = |step| -> Vec<f64> {
        (0..plane.len()).step_by(step).map(|i| plane.at(i)).filter(|v| v.is_finite()).collect()
    };
    let mut sample = every(step);
    if sample.len() < SAMPLE / 100 {
        // Few hits among the misses: take them all.
        sample = every(1);
    }
    sample.sort_unstable_by(f64::total_cmp);
    let last = sample.len().checked_sub(1)?;
    Some((sample[last / 100], sample[last - last / 100]))
}

fn direction(planes: &[&Values], bits: Bits) -> Result<LayerImage, NoMemory> {
    let rgba = |i| {
        let n = [0, 1, 2].map(|axis| planes[axis].at(i));
        if n == [0.0; 3] {
            return [0.0; 4];
        }
        let [r, g, b] = n.map(|n| unit((n + 1.0) / 2.0));
        [r, g, b, 1.0]
    };
    let note = "red, green, blue are (n + 1)/2 of x, y, z; transparent is a miss".into();
    LayerImage::new(ColourType::Rgba, bits, planes, rgba, note)
}

fn extent(planes: &[&Values], bits: Bits) -> Result<LayerImage, NoMemory> {
    let ranges: Vec<_> = planes.iter().map(|plane| finite_range(plane)).collect();
    let rgba = |i| {
        let mut shade = [0.0, 0.0, 0.0, 1.0];
        for (k, (plane, &(low, high))) in planes.iter().zip(&ranges).enumerate() {
            let value = plane.at(i);
            if !value.is_finite() {
                return [0.0; 4];
            }
            // Halves, so that the whole range of f64 cannot overflow.
            let span = high / 2.0 - low / 2.0;
            shade[k] = if span > 0.0 { unit((value / 2.0 - low / 2.0) / span) } else { 1.0 };
        }
        if planes.len() == 1 {
            let [grey, ..] = shade;
            return [grey, grey, grey, 1.0];
        }
        shade
    };
    let colours: &[&str] = if planes.len() == 1 { &["grey"] } else { &["red", "green", "blue"] };
    let axes: Vec<_> = colours
        .iter()
        .zip(&ranges)
        .filter(|(_, (low, high))| low <= high)
        .map(|(colour, (low, high))| format!("{colour} from {low} to {high}"))
        .collect();
    let note = format!("{}; transparent is a miss", axes.join(", "));
    LayerImage::new(ColourType::Rgba, bits, planes, rgba, note)
}

/// The least and the greatest finite value; `+inf` and `−inf` when there is none.
fn finite_range(plane: &Values) -> (f64, f64) {
    (0..plane.len())
        .into_par_iter()
        .map(|i| plane.at(i))
        .filter(|value| value.is_finite())
        .map(|value| (value, value))
        .reduce(|| (f64::INFINITY, f64::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)))
}

fn ids(planes: &[&Values], bits: Bits) -> Result<LayerImage, NoMemory> {
    let rgba = |i| match planes[0].at(i) {
        0.0 => [0.0; 4],
        id => {
            let [r, g, b] = id_color(id);
            [r, g, b, 1.0]
        }
    };
    let note = "each number in a colour of its own, which means nothing; transparent is 0, a miss";
    LayerImage::new(ColourType::Rgba, bits, planes, rgba, note.into())
}

/// A colour for a number: hues a golden section apart, so that neighbours differ most, in two
/// strengths of saturation and three of value.
fn id_color(id: f64) -> [f32; 3] {
    const GOLDEN_SECTION: f64 = 0.618_033_988_749_894_9;
    let hue = (id * GOLDEN_SECTION).fract() * 6.0;
    let saturation = if id % 2.0 == 0.0 { 0.85 } else { 0.55 };
    let value = 1.0 - 0.2 * (id % 3.0);
    // Distance of the hue from red, green and blue on a wheel of 6, as in any HSV.
    let wheel = |from: f64| {
        let apart = (hue - from).abs();
        (2.0 - apart.min(6.0 - apart)).clamp(0.0, 1.0)
    };
    [0.0, 2.0, 4.0].map(|from| unit(value * (1.0 - saturation * (1.0 - wheel(from)))))
}

/// Numbers of a layer of ids as they are; `None` when one has more than 16 bits.
pub(super) fn mask(layer: &Layer) -> Result<Option<LayerImage>, NoMemory> {
    let plane = layer.channels.first().map(|channel| &channel.values);
    let Some(plane) = plane.filter(|plane| plane.largest_integer() <= u16::MAX.into()) else {
        return Ok(None);
    };
    let number = |i: usize| match plane {
        Values::U16(values) => values[i].to_be_bytes(),
        // The last two bytes are all of it.
        Values::U32(values) => values[i].to_be_bytes()[2..].try_into().unwrap_or_default(),
        Values::F32(_) | Values::F64(_) => [0; 2],
    };
    let bytes = fill(&[plane], |i| [number(i)])?;
    let note = "data: the numbers themselves, not scaled; 0 is nothing".into();
    Ok(Some(LayerImage {
        channels: ColourType::Grey,
        bits: Bits::Sixteen,
        bytes,
        is_data: true,
        note,
    }))
}

/// Numbers of a layer of ids as indices of [`palette`]; `None` when one has more than 8 bits.
pub(super) fn indices(layer: &Layer) -> Result<Option<LayerImage>, NoMemory> {
    let plane = layer.channels.first().map(|channel| &channel.values);
    if plane.is_none_or(|plane| plane.largest_integer() > u8::MAX.into()) {
        return Ok(None);
    }
    let Some(LayerImage { mut bytes, .. }) = mask(layer)? else { return Ok(None) };
    // Of two bytes the second is all of it.
    for i in 0..bytes.len() / 2 {
        bytes[i] = bytes[2 * i + 1];
    }
    bytes.truncate(bytes.len() / 2);
    let note = "data: the index of a pixel is the number itself; 0 is nothing".into();
    Ok(Some(LayerImage {
        channels: ColourType::Indexed,
        bits: Bits::Eight,
        bytes,
        is_data: true,
        note,
    }))
}

/// The colours of the numbers from 0 to 255, as previews have them; nothing is black.
pub(super) fn palette() -> Vec<u8> {
    let color = |id: u8| match id {
        0 => [0; 3],
        id => id_color(id.into()).map(|c| quantize(c, 255.0).to_be_bytes()[1]),
    };
    (0..=255).flat_map(color).collect()
}

fn counts(planes: &[&Values], bits: u8) -> Result<LayerImage, NoMemory> {
    // `lacks` has seen to the type.
    fn number(plane: &Values, i: usize) -> [u8; 2] {
        let Values::U16(values) = plane else { return [0; 2] };
        values[i].to_be_bytes()
    }
    let (channels, bytes) = match *planes {
        [r, g, b] => (ColourType::Rgb, fill(planes, |i| [r, g, b].map(|p| number(p, i)))?),
        _ => (ColourType::Grey, fill(planes, |i| [number(planes[0], i)])?),
    };
    let note = format!("digital numbers (DN), 0 to {}, not scaled", (1_u32 << bits) - 1);
    Ok(LayerImage { channels, bits: Bits::Sixteen, bytes, is_data: true, note })
}

#[cfg(test)]
mod tests {
    use super::super::Channel;
    use super::*;

    fn layer(look: Look, planes: Vec<Values>) -> Layer {
        let channels = planes
            .into_iter()
            .zip(["X", "Y", "Z"])
            .map(|(values, name)| Channel { name: name.into(), values })
            .collect();
        Layer { name: "L".into(), look, channels, meaning: Vec::new() }
    }

    fn eight(look: Look, planes: Vec<Values>) -> (ColourType, Vec<u8>) {
        let shown = show(&layer(look, planes), Bits::Eight).unwrap();
        (shown.channels, shown.bytes)
    }

    #[test]
    fn colour_follows_the_srgb_curve() {
        // Encoded values of IEC 61966-2-1: 0.5 → 0.735357, 0.18 → 0.461356, 0.002 → 0.02584.
        let linear = Values::F32(vec![0.0, 0.002, 0.18, 0.5, 1.0, 7.0, -1.0, f32::INFINITY]);
        let (channels, bytes) = eight(Look::Color, vec![linear]);
        assert_eq!(channels, ColourType::Grey);
        assert_eq!(bytes, [0, 7, 118, 188, 255, 255, 0, 255]);
    }

    #[test]
    fn sixteen_bits_are_big_endian_and_finer() {
        let shown =
            show(&layer(Look::Share, vec![Values::F32(vec![0.5, 1.0])]), Bits::Sixteen).unwrap();
        assert_eq!(shown.bytes, [0x80, 0x00, 0xff, 0xff]);
    }

    #[test]
    fn near_is_bright_far_is_dark_and_a_miss_is_black() {
        let (_, bytes) =
            eight(Look::Distance, vec![Values::F32(vec![2.0, 4.0, f32::INFINITY, 1.0])]);
        // 1/d is 0.5, 0.25, 1: shares 1/3, 0 and 1 of what lies above 0.125.
        assert_eq!(bytes, [106, 32, 0, 255]);
        let (_, flat) = eight(Look::Distance, vec![Values::F64(vec![3.0, 3.0, f64::INFINITY])]);
        assert_eq!(flat, [255, 255, 0]);
        let (_, signed) = eight(Look::Distance, vec![Values::F64(vec![-1.0, 0.0, 1.0])]);
        assert_eq!(signed, [255, 143, 32]);
        let (_, none) = eight(Look::Distance, vec![Values::F64(vec![f64::INFINITY; 3])]);
        assert_eq!(none, [0; 3]);
    }

    #[test]
    fn one_outlier_does_not_darken_the_rest() {
        let mut values: Vec<f32> = (0..1000_u16).map(|i| 1.0 + f32::from(i) / 1000.0).collect();
        values[500] = 1e6;
        let (_, bytes) = eight(Look::Distance, vec![Values::F32(values)]);
        assert_eq!((bytes[5], bytes[500]), (255, 32));
        // 1/d of 1.25 between 1 and 2 is a share of 0.6: 0.65 of white, ± the percentiles' 1 %.
        assert!((160..=172).contains(&bytes[250]), "{}", bytes[250]);
    }

    #[test]
    fn hits_that_a_sample_would_pass_over_still_count() {
        let mut values = vec![f32::INFINITY; 1 << 18];
        values[1] = 2.0;
        let (_, bytes) = eight(Look::Distance, vec![Values::F32(values)]);
        assert_eq!((bytes[0], bytes[1]), (0, 255));
    }

    #[test]
    fn directions_span_the_cube_and_misses_are_transparent() {
        let plane = |values: [f32; 3]| Values::F32(values.to_vec());
        let planes = vec![plane([1.0, 0.0, 0.0]), plane([0.0, -1.0, 0.0]), plane([0.0, 0.0, 0.0])];
        let (channels, bytes) = eight(Look::Direction, planes);
        assert_eq!(channels, ColourType::Rgba);
        assert_eq!(bytes, [255, 128, 128, 255, 128, 0, 128, 255, 0, 0, 0, 0]);
    }

    #[test]
    fn extents_are_stretched_per_channel() {
        let planes = vec![
            Values::F64(vec![-f64::MAX, f64::MAX, f64::INFINITY]),
            Values::F64(vec![3.0, 1.0, f64::INFINITY]),
        ];
        let (_, bytes) = eight(Look::Extent, planes);
        assert_eq!(bytes, [0, 255, 0, 255, 255, 0, 0, 255, 0, 0, 0, 0]);
        let (_, bytes) = eight(Look::Extent, vec![Values::F64(vec![2.0, 3.0, f64::NAN])]);
        assert_eq!(bytes, [0, 0, 0, 255, 255, 255, 255, 255, 0, 0, 0, 0], "one channel is grey");
    }

    #[test]
    fn ids_differ_and_are_never_taken_for_a_miss() {
        let (_, bytes) = eight(Look::Ids, vec![Values::U32((0..=64).chain([u32::MAX]).collect())]);
        let pixels = bytes.as_chunks::<4>().0;
        assert_eq!(pixels[0], [0; 4]);
        for (i, a) in pixels.iter().enumerate().skip(1) {
            assert!(a[3] == 255 && a[..3].iter().any(|&channel| channel > 100), "{i}: {a:?}");
            for (j, b) in pixels.iter().enumerate().skip(i + 1) {
                let apart = a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
                // What an eye can tell apart side by side.
                assert!(apart >= 8, "{i} and {j}: {a:?} {b:?}");
            }
        }
    }

    #[test]
    fn counts_are_the_numbers_themselves() {
        let shown = show(
            &layer(Look::Counts { bits: 12 }, vec![Values::U16(vec![0, 1, 4095])]),
            Bits::Eight,
        )
        .unwrap();
        assert_eq!((shown.channels, shown.bits), (ColourType::Grey, Bits::Sixteen));
        assert_eq!(shown.bytes, [0, 0, 0, 1, 0x0f, 0xff]);
        let planes = vec![Values::U16(vec![1]), Values::U16(vec![2]), Values::U16(vec![255])];
        let shown = show(&layer(Look::Counts { bits: 8 }, planes), Bits::Sixteen).unwrap();
        assert_eq!((shown.channels, shown.bits), (ColourType::Rgb, Bits::Sixteen));
        assert_eq!(shown.bytes, [0, 1, 0, 2, 0, 255]);
    }

    #[test]
    fn a_look_says_what_it_needs() {
        let one = || Values::F32(vec![1.0]);
        assert_eq!(lacks(&layer(Look::Direction, vec![one()])), Some("three channels"));
        assert_eq!(lacks(&layer(Look::Ids, vec![one()])), Some("integers"));
        let over = |bits| {
            let look = Look::Counts { bits };
            lacks(&layer(look, vec![Values::U16(vec![4095])])).is_some()
        };
        assert_eq!(
            [over(0), over(11), over(12), over(16), over(17)],
            [true, true, false, false, true]
        );
    }
}
