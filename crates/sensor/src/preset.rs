//! Sensors of the trade: what is published of them, by whom, and what had to be assumed.

use std::sync::LazyLock;

use etendue_spectrum::Curve;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A sensor of the trade.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[expect(missing_docs, reason = "the names are those of the data sheets")]
pub enum Model {
    Imx174,
    Imx178,
    Imx183,
    Imx249,
    Imx250,
    Imx255,
    Imx273,
    Imx455,
    Icx625,
    #[serde(alias = "kaf-8300")]
    Kaf8300,
    #[serde(alias = "kaf-50100")]
    Kaf50100,
    #[serde(alias = "kaf-3200me")]
    Kaf3200me,
    #[serde(alias = "kac-12040")]
    Kac12040,
    Mt9m031,
}

impl Model {
    /// All of them.
    pub const ALL: [Self; 14] = [
        Self::Imx174,
        Self::Imx178,
        Self::Imx183,
        Self::Imx249,
        Self::Imx250,
        Self::Imx255,
        Self::Imx273,
        Self::Imx455,
        Self::Icx625,
        Self::Kaf8300,
        Self::Kaf50100,
        Self::Kaf3200me,
        Self::Kac12040,
        Self::Mt9m031,
    ];

    /// The model of this name, written in any case and with or without hyphens and spaces.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        let plain = |name: &str| -> String {
            name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
        };
        Self::ALL.into_iter().find(|model| plain(model.preset().name) == plain(name))
    }
}

/// Source of a figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// The maker of the sensor or of a camera with it says so.
    Published,
    /// Somebody measured it and wrote it down.
    Measured,
    /// Computed from published or measured figures.
    Derived,
    /// Nobody says of this sensor; it is a plausible value.
    Assumed,
}

/// A figure with its origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fact<T> {
    /// The figure.
    pub value: T,
    /// Origin of the fact.
    pub origin: Origin,
}

impl<T> Fact<T> {
    pub(crate) const fn published(value: T) -> Self {
        Self { value, origin: Origin::Published }
    }

    pub(crate) const fn measured(value: T) -> Self {
        Self { value, origin: Origin::Measured }
    }

    pub(crate) const fn derived(value: T) -> Self {
        Self { value, origin: Origin::Derived }
    }

    pub(crate) const fn assumed(value: T) -> Self {
        Self { value, origin: Origin::Assumed }
    }
}

/// A quantum efficiency of a preset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Efficiency {
    /// A curve that comes with the program.
    Curve(KnownCurve),
    /// One value at one wavelength `(η, nm)`, and the shape of another sensor's curve.
    Shape(f64, f64, KnownCurve),
    /// Points `[nm, η]`.
    Points(&'static [[f64; 2]]),
}

/// Curves that come with the program (see `data/README.md` of this crate).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KnownCurve {
    /// Back-lit CMOS: Sony IMX183.
    Imx183,
    /// Front-lit CMOS: that of the ASI1600MM.
    FrontLitCmos,
    /// Full-frame CCD: KAF-8300.
    Kaf8300,
    /// Full-frame CCD: KAF-50100.
    Kaf50100,
}

/// Data of a sensor. Dark current is in e⁻/s at `dark_current_temperature` (K).
#[derive(Debug)]
pub struct Preset {
    /// As its maker writes it.
    pub name: &'static str,
    /// Maker, technology and shutter.
    pub kind: &'static str,
    /// Columns and rows.
    pub resolution: Fact<[u32; 2]>,
    /// Pixel pitch (µm).
    pub pixel_pitch: Fact<f64>,
    /// Bits of the converter.
    pub bit_depth: Fact<u32>,
    /// K (DN/e⁻).
    pub system_gain: Fact<f64>,
    /// `σ_read` (e⁻).
    pub read_noise: Fact<f64>,
    /// `μ_I` (e⁻/s).
    pub dark_current: Fact<f64>,
    /// Temperature at which it was measured (K).
    pub dark_current_temperature: Fact<f64>,
    /// Warming that doubles it (K).
    pub dark_current_doubling: Fact<f64>,
    /// Capacity (e⁻).
    pub full_well: Fact<f64>,
    /// Black level (DN).
    pub black_level: Fact<f64>,
    /// Relative standard deviation of sensitivity.
    pub prnu: Fact<f64>,
    /// Standard deviation of offsets (e⁻).
    pub dsnu: Fact<f64>,
    /// η.
    pub quantum_efficiency: Fact<Efficiency>,
    /// Sources of the data, and what was made of them.
    pub sources: &'static str,
}

impl Preset {
    /// The quantum efficiency as a curve.
    #[must_use]
    pub fn efficiency(&self) -> Curve {
        match self.quantum_efficiency.value {
            Efficiency::Curve(known) => known.curve().clone(),
            Efficiency::Points(points) => Curve::sampled(points.to_vec()).unwrap_or(Curve::ONE),
            Efficiency::Shape(value, at, known) => {
                let curve = known.curve();
                curve.scaled(value / curve.held(at)).unwrap_or(Curve::ONE)
            }
        }
    }

    /// The keys of the figures that nobody has published or measured.
    #[must_use]
    pub fn assumed(&self) -> Vec<&'static str> {
        let facts = self.facts().into_iter();
        facts.filter(|fact| fact.2 == Origin::Assumed).map(|fact| fact.0).collect()
    }

    /// Every figure as `(key of the scene file, value, origin)`.
    #[must_use]
    pub fn facts(&self) -> Vec<(&'static str, String, Origin)> {
        let number = |key, fact: &Fact<f64>| (key, format!("{:.6}", fact.value), fact.origin);
        let trimmed = |(key, text, origin): (&'static str, String, Origin)| {
            (key, text.trim_end_matches('0').trim_end_matches('.').to_owned(), origin)
        };
        let [columns, rows] = self.resolution.value;
        // Whole numbers, numbers, and the curve in words.
        let mut facts = vec![
            ("resolution", format!("{columns} × {rows}"), self.resolution.origin),
            ("bit_depth", self.bit_depth.value.to_string(), self.bit_depth.origin),
        ];
        facts.extend(
            [
                number("pixel_pitch", &self.pixel_pitch),
                number("system_gain", &self.system_gain),
                number("read_noise", &self.read_noise),
                number("dark_current", &self.dark_current),
                number("dark_current_temperature", &self.dark_current_temperature),
                number("dark_current_doubling", &self.dark_current_doubling),
                number("full_well", &self.full_well),
                number("black_level", &self.black_level),
                number("prnu", &self.prnu),
                number("dsnu", &self.dsnu),
            ]
            .map(trimmed),
        );
        let curve = self.efficiency();
        let peak = curve.peak().unwrap_or_default();
        let efficiency = format!("{:.3} at most, at {peak:.0} nm", curve.extent()[1]);
        facts.push(("quantum_efficiency", efficiency, self.quantum_efficiency.origin));
        facts
    }
}

impl KnownCurve {
    /// The curve. The files come with the program and its tests read all of them.
    #[must_use]
    pub fn curve(self) -> &'static Curve {
        macro_rules! embedded {
            ($file:literal) => {{
                static CURVE: LazyLock<Curve> = LazyLock::new(|| {
                    columns(include_str!(concat!("../data/gunagala/", $file)))
                        .pop()
                        .unwrap_or(Curve::ONE)
                });
                &CURVE
            }};
        }
        match self {
            Self::Imx183 => embedded!("ZWO_ASI183MM_QE.csv"),
            Self::FrontLitCmos => embedded!("ZWO_QE_asi1600.csv"),
            Self::Kaf8300 => embedded!("ML8300M_QE.csv"),
            Self::Kaf50100 => embedded!("ML50100_QE.csv"),
        }
    }
}

/// The Nikon D5100's red, green and blue, relative to their peaks.
pub(crate) fn nikon_d5100() -> &'static [Curve] {
    static CURVES: LazyLock<Vec<Curve>> =
        LazyLock::new(|| columns(include_str!("../data/colour/nikon_5100_npl.csv")));
    &CURVES
}

/// The curves of a table: a line of titles, then a wavelength and a value a column.
fn columns(table: &str) -> Vec<Curve> {
    let rows: Vec<Vec<f64>> = table
        .lines()
        .skip(1)
        .map(|line| line.split(',').filter_map(|cell| cell.trim().parse().ok()).collect())
        .filter(|row: &Vec<f64>| row.len() > 1)
        .collect();
    let width = rows.iter().map(Vec::len).min().unwrap_or(1);
    let column = |k: usize| Curve::sampled(rows.iter().map(|row| [row[0], row[k]]).collect()).ok();
    (1..width).filter_map(column).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn embedded_curves_are_the_published_ones() {
        // The peaks that the sources name.
        for (known, peak, at, samples) in [
            (KnownCurve::Imx183, 0.843, 533.0, 193),
            (KnownCurve::Kaf8300, 0.568, 549.0, 120),
            (KnownCurve::Kaf50100, 0.619, 540.0, 112),
            (KnownCurve::FrontLitCmos, 0.595, 530.0, 66),
        ] {
            let curve = known.curve();
            assert_eq!(curve.samples().len(), samples);
            assert!((curve.extent()[1] - peak).abs() < 1e-3, "{known:?} {:?}", curve.extent());
            assert!((curve.peak().unwrap() - at).abs() < 12.0, "{known:?} {:?}", curve.peak());
        }
        assert_eq!(nikon_d5100().len(), 3);
        assert!(nikon_d5100().iter().all(|c| c.range() == [380.0, 780.0] && c.extent()[1] == 1.0));
    }

    #[test]
    fn the_kaf_3200me_sees_what_is_published() {
        let curve = Model::Kaf3200me.preset().efficiency();
        // R. Berry's review and C. Buil's measurement; 96 % at 540 nm was another chip's shape.
        for (nm, efficiency) in [(400.0, 0.60), (600.0, 0.80), (656.0, 0.79), (760.0, 0.60)] {
            assert!((curve.held(nm) - efficiency).abs() < 0.011, "{nm}: {}", curve.held(nm));
        }
        assert_eq!((curve.peak(), curve.extent()[1]), (Some(600.0), 0.80));
    }

    #[test]
    fn presets_hold_together() {
        assert_eq!(Model::from_name("kaf 8300"), Some(Model::Kaf8300));
        assert_eq!(Model::from_name("imx999"), None);
        for model in Model::ALL {
            let preset = model.preset();
            let plain: String =
                preset.name.to_lowercase().chars().filter(|c| c.is_alphanumeric()).collect();
            assert_eq!(serde_json::to_value(model).unwrap(), plain, "table out of order");
            assert_eq!(Model::from_name(preset.name), Some(model));
            let curve = preset.efficiency();
            assert_ne!(curve, Curve::ONE, "{}: the curve was not read", preset.name);
            assert!(curve.within(0.0, 1.0).is_ok(), "{}", preset.name);
            // A converter that clips long before the well is full is a slip in K or in the well.
            let white = f64::from((1u32 << preset.bit_depth.value) - 1);
            let converter = (white - preset.black_level.value) / preset.system_gain.value;
            let well = preset.full_well.value;
            let ratio = converter / well;
            let gain_is_for_low_light = model == Model::Imx183;
            assert!(
                (0.85..1.4).contains(&ratio) || gain_is_for_low_light,
                "{}: {ratio}",
                preset.name
            );
            assert_eq!(preset.facts().len(), 13);
            assert!(preset.prnu.value > 0.0 && preset.dsnu.value > 0.0, "{}", preset.name);
            assert!(preset.assumed().contains(&"dsnu"), "{}", preset.name);
        }
    }
}
