//! From the picture's light to the colours of a PNG: exposure, tone map, and what shows through.
//!
//! EXR and NPY hold linear radiance; nothing here touches them.
//!
//! # Sources
//!
//! * Automatic exposure: Reinhard, Stark, Shirley and Ferwerda, "Photographic Tone Reproduction for
//!   Digital Images", 2002, equation 1: the mean of the logarithm of luminance goes to 0.18.
//! * `agx`: Sobotka's `AgX` (2022) in the polynomial of Wrensch, "Minimal `AgX` Implementation", 2023.
//! * `aces`: Hill's fit of the ACES reference rendering and sRGB output transforms, in Pettineo and
//!   Neubelt, *Baking Lab*, 2016.

use etendue_scene::file::{Exposure, RenderSpec, ToneMap};
use serde_json::{Value, json};

use super::layer::{Layer, Values};
use super::look::{Bits, ColourType, LayerImage, srgb, unit};
use crate::memory::NoMemory;

/// Settings of how a PNG shows the picture's light.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Development {
    /// Light is multiplied by 2 to this power first.
    pub stops: f64,
    /// True if the picture's own light decided `stops`.
    pub is_automatic: bool,
    /// Tone mapping, which brings light above full scale into range.
    pub tone_map: ToneMap,
    /// True if the background is transparent.
    pub alpha: bool,
}

impl Development {
    /// Development that `spec` asks for, of a picture whose light is in this layer.
    #[must_use]
    pub fn new(spec: &RenderSpec, own: Option<&Layer>) -> Self {
        let (stops, is_automatic) = match spec.exposure {
            Exposure::Stops(stops) => (stops, false),
            Exposure::Auto(_) => (own.and_then(fitting_stops).unwrap_or(0.0), true),
        };
        Self { stops, is_automatic, tone_map: spec.tone_map, alpha: spec.alpha }
    }

    /// Description of the development for `layers.json`.
    pub(super) fn in_json(&self) -> Value {
        json!({
            "exposure": self.stops,
            "exposure_by": if self.is_automatic { "auto" } else { "render.exposure" },
            "tone_map": tone_map_name(self.tone_map),
            "formula": formula(self.tone_map),
            "alpha": self.alpha,
        })
    }

    /// Description of the development in words.
    fn in_words(&self) -> String {
        let Self { stops, is_automatic, tone_map, alpha } = *self;
        let by = if is_automatic { ", chosen by the picture's light" } else { "" };
        let exposure = match stops {
            0.0 => String::new(),
            _ => format!("exposure {stops:+.2} stops (light times 2^stops{by}); "),
        };
        let see_through = match alpha {
            true => "; alpha is the share of a pixel's samples that hit something",
            false => "",
        };
        format!("{exposure}{}{see_through}", formula(tone_map))
    }

    /// Linear light as sRGB, each channel 0 to 1.
    pub(crate) fn encode(&self, rgb: [f64; 3]) -> [f32; 3] {
        let gain = self.stops.exp2();
        // Far above all that any of the curves tells apart, and far below an overflow.
        let exposed = rgb.map(|c| (c * gain).clamp(0.0, 1e9));
        match self.tone_map {
            ToneMap::None => exposed.map(srgb),
            ToneMap::Agx => agx(exposed),
            ToneMap::Aces => aces(exposed).map(srgb),
        }
    }

    /// True if a channel of this light is beyond what the PNG can show.
    pub(crate) fn clips(&self, rgb: [f64; 3]) -> bool {
        match self.tone_map {
            // What is 1 but for noise or rounding is not lost.
            ToneMap::None => rgb.iter().any(|c| c * self.stops.exp2() > 1.01),
            ToneMap::Agx | ToneMap::Aces => self.encode(rgb).iter().all(|c| *c > 0.995),
        }
    }

    /// The picture's own layer, of one channel or three, as a PNG shows it, by its alpha and backdrop.
    pub(super) fn show(
        &self,
        layer: &Layer,
        [alpha, backdrop]: [Option<&Layer>; 2],
        bits: Bits,
    ) -> Result<LayerImage, NoMemory> {
        let planes: Vec<_> = layer.channels.iter().map(|channel| &channel.values).collect();
        let light = |i: usize| match *planes.as_slice() {
            [r, g, b] => [r, g, b].map(|plane| plane.at(i)),
            _ => [planes[0].at(i); 3],
        };
        let note = format!("sRGB; {}", self.in_words());
        // Without alpha: colour, or grey of one channel.
        let alpha = alpha.and_then(|layer| layer.channels.first());
        let Some(alpha) = alpha.filter(|_| self.alpha) else {
            return match planes.len() {
                3 => {
                    LayerImage::new(ColourType::Rgb, bits, &planes, |i| self.encode(light(i)), note)
                }
                _ => {
                    let grey = |i| [self.encode(light(i))[0]];
                    LayerImage::new(ColourType::Grey, bits, &planes, grey, note)
                }
            };
        };
        // With it: light without the backdrop, over the share that the subject has.
        let backdrop: Vec<&Values> = backdrop
            .map(|layer| layer.channels.iter().map(|channel| &channel.values).collect())
            .unwrap_or_default();
        let rgba = |i| {
            let share = alpha.values.at(i);
            if share <= 0.0 {
                return [0.0; 4];
            }
            let mut rgb = light(i);
            for (c, behind) in rgb.iter_mut().zip(&backdrop) {
                *c = (*c - behind.at(i)).max(0.0);
            }
            let [r, g, b] = self.encode(rgb.map(|c| c / share));
            [r, g, b, unit(share)]
        };
        LayerImage::new(ColourType::Rgba, bits, &planes, rgba, note)
    }
}

fn tone_map_name(tone_map: ToneMap) -> &'static str {
    match tone_map {
        ToneMap::None => "none",
        ToneMap::Agx => "agx",
        ToneMap::Aces => "aces",
    }
}

fn formula(tone_map: ToneMap) -> &'static str {
    match tone_map {
        ToneMap::None => "light above full scale is clipped",
        ToneMap::Agx => "tone map AgX (Sobotka 2022; polynomial of Wrensch 2023)",
        ToneMap::Aces => "tone map ACES (fit of Hill, in Pettineo and Neubelt 2016)",
    }
}

/// Relative luminance of linear sRGB (IEC 61966-2-1).
pub(crate) fn luminance([r, g, b]: [f64; 3]) -> f64 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// The stops that bring the mean of the logarithm of luminance to 0.18; `None` without light. What is
/// black counts for nothing: it is background more often than not.
fn fitting_stops(layer: &Layer) -> Option<f64> {
    const MIDDLE_GREY: f64 = 0.18;
    let planes: Vec<_> = layer.channels.iter().map(|channel| &channel.values).collect();
    let (mut sum, mut count) = (0.0, 0.0);
    for i in 0..planes.first()?.len() {
        let y = match *planes.as_slice() {
            [r, g, b] => luminance([r, g, b].map(|plane| plane.at(i))),
            _ => planes[0].at(i),
        };
        if y > 0.0 && y.is_finite() {
            sum += y.log2();
            count += 1.0;
        }
    }
    (count > 0.0).then(|| MIDDLE_GREY.log2() - sum / count)
}

fn multiply(rows: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    rows.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Linear sRGB to sRGB as encoded.
fn agx(rgb: [f64; 3]) -> [f32; 3] {
    const INSET: [[f64; 3]; 3] = [
        [0.842_479_062_253_094, 0.078_433_599_999_999_2, 0.079_223_745_147_764_3],
        [0.042_328_242_261_012_3, 0.878_468_636_469_772, 0.079_166_127_460_543_4],
        [0.042_375_654_905_705_1, 0.078_433_6, 0.879_142_973_793_104],
    ];
    const OUTSET: [[f64; 3]; 3] = [
        [1.196_879_005_120_17, -0.098_020_881_140_136_8, -0.099_029_744_079_720_5],
        [-0.052_896_851_757_456_2, 1.151_903_129_904_17, -0.098_961_176_844_843_3],
        [-0.052_971_635_514_443_8, -0.098_043_450_117_124_1, 1.151_073_672_641_16],
    ];
    /// Stops of light around 1 that the curve spans.
    const STOPS: [f64; 2] = [-12.473_93, 4.026_069];
    let curve = |c: f64| {
        let x = (c.log2().clamp(STOPS[0], STOPS[1]) - STOPS[0]) / (STOPS[1] - STOPS[0]);
        let coefficients = [15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.002_32];
        coefficients.iter().fold(0.0, |sum, c| sum * x + c)
    };
    multiply(&OUTSET, multiply(&INSET, rgb).map(curve)).map(|c| unit(c.clamp(0.0, 1.0)))
}

/// Linear sRGB to linear sRGB.
fn aces(rgb: [f64; 3]) -> [f64; 3] {
    const INPUT: [[f64; 3]; 3] =
        [[0.597_19, 0.354_58, 0.048_23], [0.076, 0.908_34, 0.015_66], [0.0284, 0.133_83, 0.837_77]];
    const OUTPUT: [[f64; 3]; 3] = [
        [1.604_75, -0.531_08, -0.073_67],
        [-0.102_08, 1.108_13, -0.006_05],
        [-0.003_27, -0.072_76, 1.076_02],
    ];
    let curve = |v: f64| {
        let above = v * (v + 0.024_578_6) - 0.000_090_537;
        above / (v * (0.983_729 * v + 0.432_951) + 0.238_081)
    };
    multiply(&OUTPUT, multiply(&INPUT, rgb).map(curve)).map(|c| c.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::super::{Channel, Look, Picture};
    use super::*;

    fn by(tone_map: ToneMap, stops: f64) -> Development {
        Development { stops, tone_map, ..Development::default() }
    }

    #[test]
    fn a_stop_doubles_light() {
        for tone_map in [ToneMap::None, ToneMap::Agx, ToneMap::Aces] {
            let [bright, dim] = [by(tone_map, 2.0), by(tone_map, 0.0)];
            assert_eq!(bright.encode([0.02, 0.05, 0.1]), dim.encode([0.08, 0.2, 0.4]));
        }
    }

    /// Values of the published shaders worked out by hand at the ends and in the middle: the `AgX`
    /// polynomial at 0 is its constant, at 1 the sum of its coefficients.
    #[test]
    fn tone_maps_end_where_their_formulas_do() {
        let agx = by(ToneMap::Agx, 0.0);
        assert_eq!(agx.encode([0.0; 3]), [0.0; 3], "-0.00232 is below black");
        // 15.5 - 40.14 + 31.96 - 6.868 + 0.4298 + 0.1191 - 0.00232 = 0.99858, and the rows of both
        // matrices add to 1 within 2e-4.
        assert!(agx.encode([1e6; 3]).iter().all(|c| (c - 0.9986).abs() < 5e-4));
        // Middle grey lies at x = (log2 0.18 + 12.47393)/16.5 = 0.606061; the polynomial there: 0.4971.
        assert!(agx.encode([0.18; 3]).iter().all(|c| (c - 0.497).abs() < 2e-3));
        // Far above 1 Hill's curve goes to 1/0.983729, times rows of the output matrix that add to 1.
        let aces = by(ToneMap::Aces, 0.0);
        // The sRGB curve rounds 1 to 1 − 6e-8 in f32.
        assert!(aces.encode([1e9; 3]).iter().all(|c| *c > 0.999_999));
        assert_eq!(aces.encode([0.0; 3]), [0.0; 3]);
        // v = 0.18: (0.18 x 0.2045786 - 0.000090537)/(0.18 x 0.610022 + 0.238081) = 0.105591, in sRGB
        // 0.3585.
        assert!(aces.encode([0.18; 3]).iter().all(|c| (c - 0.3585).abs() < 1e-3));
    }

    #[test]
    fn tone_maps_never_darken_more_light() {
        for tone_map in [ToneMap::None, ToneMap::Agx, ToneMap::Aces] {
            let develop = by(tone_map, 0.0);
            let mut last = 0.0;
            for step in -400..400 {
                let [c, ..] = develop.encode([f64::from(step / 10).exp2(); 3]);
                // Wrensch's polynomial dips by 1e-3 at its ends.
                assert!(c >= last - 2e-3, "{tone_map:?} at {step}: {c} after {last}");
                last = c;
            }
        }
    }

    fn picture(values: Vec<f32>, more: Vec<Layer>) -> Picture {
        let planes = ["R", "G", "B"]
            .map(|name| Channel { name: name.into(), values: Values::F32(values.clone()) });
        let own = Layer {
            name: String::new(),
            look: Look::Color,
            channels: planes.into(),
            meaning: Vec::new(),
        };
        let layers = std::iter::once(own).chain(more).collect();
        Picture::new(values.len(), 1, layers, Vec::new()).unwrap()
    }

    #[test]
    fn automatic_exposure_brings_the_log_mean_to_middle_grey() {
        // Log mean of 0.09 x 2^{-3, 3} is 0.09: one stop below 0.18. Black counts for nothing.
        let picture = picture(vec![0.09 / 8.0, 0.09 * 8.0, 0.0], Vec::new());
        let spec = RenderSpec { exposure: Exposure::AUTO, ..RenderSpec::default() };
        let found = Development::new(&spec, picture.layer(""));
        // f32 holds the values to 6e-8 of themselves.
        assert!((found.stops - 1.0).abs() < 1e-6 && found.is_automatic, "{found:?}");
    }

    #[test]
    fn transparency_takes_the_background_out_of_the_colour() {
        let layer = |name: &str, channels: [&str; 1], values: Vec<f32>| Layer {
            name: name.into(),
            look: Look::Share,
            channels: channels
                .map(|name| Channel { name: name.into(), values: Values::F32(values.clone()) })
                .into(),
            meaning: Vec::new(),
        };
        let behind = layer("Backdrop", ["R"], vec![0.4, 0.2, 0.0]);
        let behind = Layer {
            look: Look::Color,
            channels: ["R", "G", "B"]
                .map(|name| Channel { name: name.into(), values: Values::F32(vec![0.4, 0.2, 0.0]) })
                .into(),
            ..behind
        };
        // Nothing, half of a surface of 0.8 before 0.4, and all of it.
        let all =
            picture(vec![0.4, 0.6, 0.8], vec![layer("Alpha", ["A"], vec![0.0, 0.5, 1.0]), behind]);
        let develop = Development { alpha: true, ..Development::default() };
        let all = all.developed(develop);
        let shown = all.show(all.layer("").unwrap(), Bits::Eight).unwrap();
        assert_eq!(shown.channels, ColourType::Rgba);
        let edge = &shown.bytes[4..8];
        // 0.8 is 0.9063 in sRGB, 231 of 255.
        assert_eq!(
            (shown.bytes[3], edge, &shown.bytes[8..]),
            (0, &[231, 231, 231, 128][..], &[231, 231, 231, 255][..])
        );
    }
}
