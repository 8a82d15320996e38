//! The table of presets, in the order of [`Model`](crate::Model).

use crate::preset::Efficiency::{Curve, Points, Shape};
use crate::preset::{Fact, KnownCurve, Model, Preset};

/// 20 °C.
const ROOM: f64 = 293.15;

/// An order of magnitude for sensors that nobody cools (e⁻/s).
const UNCOOLED: Fact<f64> = Fact::assumed(1.0);

/// −20 °C, about where cooled cameras of astronomers are run whose dark current is given without a
/// temperature.
const COOLED: Fact<f64> = Fact::assumed(253.15);

/// Relative spread of the sensitivities and offsets of CMOS sensors, in order of magnitude: 0.3 to 0.4 % in Sony's
/// sensor of the A9 (J. Kasson 2017), 0.54 % in Sony's IMX363 (Lyu et al. 2021, arXiv:2105.04106).
const CMOS_PRNU: Fact<f64> = Fact::assumed(0.005);
const CMOS_DSNU: Fact<f64> = Fact::assumed(1.0);

/// Relative spread, likewise, of CCDs, whose larger pixels are as even, and whose single amplifier
/// adds no offsets of its own: what is left is dark current that differs.
const CCD_PRNU: Fact<f64> = Fact::assumed(0.01);
const CCD_DSNU: Fact<f64> = Fact::assumed(1.0);

/// Silicon doubles its dark current about every 6 to 8 K.
const DOUBLING: Fact<f64> = Fact::assumed(7.0);

impl Model {
    /// Data of the sensor.
    #[must_use]
    pub fn preset(self) -> &'static Preset {
        &PRESETS[self as usize]
    }
}

static PRESETS: [Preset; Model::ALL.len()] = [
    Preset {
        name: "IMX174",
        kind: "Sony CMOS, global shutter",
        resolution: Fact::assumed([1936, 1216]),
        pixel_pitch: Fact::published(5.86),
        bit_depth: Fact::derived(16),
        system_gain: Fact::published(1.0 / 0.51),
        read_noise: Fact::published(6.83),
        dark_current: UNCOOLED,
        dark_current_temperature: Fact::assumed(ROOM),
        dark_current_doubling: DOUBLING,
        full_well: Fact::published(32_691.0),
        black_level: Fact::assumed(256.0),
        prnu: CMOS_PRNU,
        dsnu: CMOS_DSNU,
        quantum_efficiency: Fact::derived(Shape(0.77, 525.0, KnownCurve::FrontLitCmos)),
        sources: "pitch, gain (per DN of 16 bit, hence the bit depth), dark noise, saturation and 77 % \
            at 525 nm: a maker's EMVA 1288 sheet quoted by the fhotolab blog, 2016. Resolution: \
            that of the IMX249, which has the same pixel. Elsewhere than at 525 nm the quantum \
            efficiency has the shape of another front-lit CMOS sensor.",
    },
    Preset {
        name: "IMX178",
        kind: "Sony CMOS, rolling shutter",
        resolution: Fact::assumed([3096, 2080]),
        pixel_pitch: Fact::assumed(2.4),
        bit_depth: Fact::published(14),
        system_gain: Fact::measured(1.0 / 0.71),
        read_noise: Fact::measured(2.34),
        dark_current: UNCOOLED,
        dark_current_temperature: Fact::assumed(ROOM),
        dark_current_doubling: DOUBLING,
        full_well: Fact::derived(11_600.0),
        black_level: Fact::assumed(64.0),
        prnu: CMOS_PRNU,
        dsnu: CMOS_DSNU,
        quantum_efficiency: Fact::assumed(Shape(0.8, 533.0, KnownCurve::Imx183)),
        sources: "gain and dark noise of one setting: David's Astronomy Pages, 2017, measured on an \
            ASI178MC. Full well: what the converter can count at that gain.",
    },
    Preset {
        name: "IMX183",
        kind: "Sony CMOS, rolling shutter, back-lit",
        resolution: Fact::published([5496, 3672]),
        pixel_pitch: Fact::published(2.4),
        bit_depth: Fact::published(12),
        system_gain: Fact::measured(1.0 / 0.6806),
        read_noise: Fact::measured(2.0),
        dark_current: Fact::measured(0.002_15),
        dark_current_temperature: COOLED,
        dark_current_doubling: DOUBLING,
        full_well: Fact::published(15_000.0),
        black_level: Fact::measured(38.0),
        prnu: CMOS_PRNU,
        dsnu: CMOS_DSNU,
        quantum_efficiency: Fact::measured(Curve(KnownCurve::Imx183)),
        sources: "gunagala's performance table and curve for the ASI183MM (dark current without a \
            temperature, taken for −20 °C; a high gain, so the converter saturates at 2761 e⁻); full well: its \
            maker's page (gunagala's 1500 e⁻ is a slip).",
    },
    Preset {
        name: "IMX249",
        kind: "Sony CMOS, global shutter",
        resolution: Fact::published([1936, 1216]),
        pixel_pitch: Fact::published(5.86),
        bit_depth: Fact::published(12),
        system_gain: Fact::assumed(0.1244),
        read_noise: Fact::derived(7.2),
        dark_current: UNCOOLED,
        dark_current_temperature: Fact::assumed(ROOM),
        dark_current_doubling: DOUBLING,
        full_well: Fact::derived(32_400.0),
        black_level: Fact::assumed(64.0),
        prnu: CMOS_PRNU,
        dsnu: CMOS_DSNU,
        quantum_efficiency: Fact::assumed(Shape(0.77, 525.0, KnownCurve::FrontLitCmos)),
        sources: "mvBlueFOX3 manual: resolution, pitch, bits, and SNRmax 45.1 dB and dynamic range \
            73 dB, from which saturation and dark noise. Gain: saturation at full scale. Quantum \
            efficiency: that of the IMX174, which has the same pixel.",
    },
    Preset {
        name: "IMX250",
        kind: "Sony CMOS, global shutter",
        resolution: Fact::published([2464, 2056]),
        pixel_pitch: Fact::published(3.45),
        bit_depth: Fact::published(12),
        system_gain: Fact::derived(1.0 / (0.18 * 16.0)),
        read_noise: Fact::measured(2.45),
        dark_current: UNCOOLED,
        dark_current_temperature: Fact::assumed(ROOM),
        dark_current_doubling: DOUBLING,
        full_well: Fact::published(10_700.0),
        black_level: Fact::assumed(64.0),
        prnu: CMOS_PRNU,
        dsnu: CMOS_DSNU,
        quantum_efficiency: Fact::assumed(Shape(0.6, 525.0, KnownCurve::FrontLitCmos)),
        sources: "Genie Nano manual, M2450: resolution, pitch, bits, saturation. Gain (per DN of 16 bit) \
            and dark noise: a public simulation script for the BFS-PGE-51S5.",
    },
    Preset {
        name: "IMX255",
        kind: "Sony CMOS, global shutter",
        resolution: Fact::published([4112, 2176]),
        pixel_pitch: Fact::published(3.45),
        bit_depth: Fact::published(12),
        system_gain: Fact::assumed(1.0 / 2.8),
        read_noise: Fact::derived(2.9),
        dark_current: UNCOOLED,
        dark_current_temperature: Fact::assumed(ROOM),
        dark_current_doubling: DOUBLING,
        full_well: Fact::derived(10_700.0),
        black_level: Fact::assumed(64.0),
        prnu: CMOS_PRNU,
        dsnu: CMOS_DSNU,
        quantum_efficiency: Fact::assumed(Shape(0.6, 525.0, KnownCurve::FrontLitCmos)),
        sources: "mvBlueFOX3 manual: resolution, pitch, bits, and SNRmax 40.3 dB and dynamic range \
            71.3 dB, from which saturation and dark noise. Gain: that of Sony's 3.45 µm family at \
            0 dB and 12 bit (Moravian C1+ manual).",
    },
    Preset {
        name: "IMX273",
        kind: "Sony CMOS, global shutter",
        resolution: Fact::published([1456, 1088]),
        pixel_pitch: Fact::published(3.45),
        bit_depth: Fact::published(12),
        system_gain: Fact::assumed(1.0 / 2.8),
        read_noise: Fact::assumed(2.2),
        dark_current: UNCOOLED,
        dark_current_temperature: Fact::assumed(ROOM),
        dark_current_doubling: DOUBLING,
        full_well: Fact::published(11_000.0),
        black_level: Fact::assumed(64.0),
        prnu: CMOS_PRNU,
        dsnu: CMOS_DSNU,
        quantum_efficiency: Fact::assumed(Shape(0.6, 525.0, KnownCurve::FrontLitCmos)),
        sources: "Genie Nano manual, M1450: resolution, pitch, bits, saturation. Gain and dark noise: \
            those of Sony's 3.45 µm family at 0 dB and 12 bit (Moravian C1+ manual).",
    },
    Preset {
        name: "IMX455",
        kind: "Sony CMOS, rolling shutter, back-lit",
        resolution: Fact::derived([9576, 6384]),
        pixel_pitch: Fact::published(3.76),
        bit_depth: Fact::published(16),
        system_gain: Fact::published(1.0 / 0.779),
        read_noise: Fact::published(1.5),
        dark_current: Fact::measured(0.011),
        dark_current_temperature: Fact::measured(263.15),
        dark_current_doubling: DOUBLING,
        full_well: Fact::published(51_000.0),
        black_level: Fact::assumed(500.0),
        prnu: CMOS_PRNU,
        dsnu: CMOS_DSNU,
        quantum_efficiency: Fact::assumed(Curve(KnownCurve::Imx183)),
        sources: "Alarcon et al. 2023: pitch, bits, dark current at −10 °C; the rest: template of the \
            Glenlea exposure calculator for the ASI6200MM. Resolution: 36 × 24 mm over the pitch. \
            Quantum efficiency: that of the IMX183, which is back-lit too.",
    },
    Preset {
        name: "ICX625",
        kind: "Sony CCD, global shutter",
        resolution: Fact::assumed([2448, 2048]),
        pixel_pitch: Fact::assumed(3.45),
        bit_depth: Fact::assumed(12),
        system_gain: Fact::assumed(0.683),
        read_noise: Fact::published(8.28),
        dark_current: UNCOOLED,
        dark_current_temperature: Fact::assumed(ROOM),
        dark_current_doubling: DOUBLING,
        full_well: Fact::published(5903.0),
        black_level: Fact::assumed(64.0),
        prnu: CCD_PRNU,
        dsnu: CCD_DSNU,
        quantum_efficiency: Fact::derived(Shape(0.57, 525.0, KnownCurve::Kaf8300)),
        sources: "EMVA 1288 sheet of the GS3-PGE-50S5M quoted by the mengineer blog: dark noise, \
            saturation, 57 % at 525 nm (the shape is another CCD's). Gain: saturation at full scale.",
    },
    Preset {
        name: "KAF-8300",
        kind: "Kodak/onsemi CCD, full frame",
        resolution: Fact::published([3326, 2504]),
        pixel_pitch: Fact::published(5.4),
        bit_depth: Fact::published(16),
        system_gain: Fact::measured(1.0 / 0.37),
        read_noise: Fact::measured(9.3),
        dark_current: Fact::measured(0.04),
        dark_current_temperature: COOLED,
        dark_current_doubling: DOUBLING,
        full_well: Fact::published(25_500.0),
        black_level: Fact::measured(1100.0),
        prnu: CCD_PRNU,
        dsnu: CCD_DSNU,
        quantum_efficiency: Fact::measured(Curve(KnownCurve::Kaf8300)),
        sources: "gunagala's performance table and curve for the SBIG STF-8300M (dark current without a \
            temperature, taken for −20 °C).",
    },
    Preset {
        name: "KAF-50100",
        kind: "Kodak/onsemi CCD, full frame",
        resolution: Fact::published([8176, 6132]),
        pixel_pitch: Fact::published(6.0),
        bit_depth: Fact::published(16),
        system_gain: Fact::measured(1.0 / 0.6),
        read_noise: Fact::measured(12.0),
        dark_current: Fact::measured(0.015),
        dark_current_temperature: COOLED,
        dark_current_doubling: DOUBLING,
        full_well: Fact::published(40_300.0),
        black_level: Fact::measured(1000.0),
        prnu: CCD_PRNU,
        dsnu: CCD_DSNU,
        quantum_efficiency: Fact::measured(Curve(KnownCurve::Kaf50100)),
        sources: "gunagala's performance table and curve for the FLI ML50100 (dark current without a \
            temperature, taken for −20 °C).",
    },
    Preset {
        name: "KAF-3200ME",
        kind: "Kodak CCD, full frame",
        resolution: Fact::published([2184, 1472]),
        pixel_pitch: Fact::published(6.8),
        bit_depth: Fact::published(16),
        system_gain: Fact::measured(1.0 / 1.413),
        read_noise: Fact::measured(12.6),
        dark_current: Fact::measured(0.080),
        dark_current_temperature: Fact::measured(273.15),
        dark_current_doubling: DOUBLING,
        full_well: Fact::measured(70_000.0),
        black_level: Fact::assumed(500.0),
        prnu: CCD_PRNU,
        dsnu: CCD_DSNU,
        quantum_efficiency: Fact::published(Points(&[
            [350.0, 0.40],
            [400.0, 0.60],
            [600.0, 0.80],
            [656.0, 0.79],
            [760.0, 0.60],
            [1000.0, 0.05],
        ])),
        sources: "C. Buil's camera page, measured, with 79 % at 656 nm (the page prints 1742 rows, the \
            sensor has 1472). Quantum efficiency of about 60, 80 and 60 % at 400, 600 and 760 nm: \
            R. Berry's review of the sensor, after Kodak's data (joined by lines; the ends at 350 and \
            1000 nm are assumed).",
    },
    Preset {
        name: "KAC-12040",
        kind: "onsemi CMOS, rolling shutter",
        resolution: Fact::published([4000, 3000]),
        pixel_pitch: Fact::published(4.7),
        bit_depth: Fact::assumed(12),
        system_gain: Fact::assumed(0.252),
        read_noise: Fact::published(3.7),
        dark_current: UNCOOLED,
        dark_current_temperature: Fact::assumed(ROOM),
        dark_current_doubling: DOUBLING,
        full_well: Fact::published(16_000.0),
        black_level: Fact::assumed(64.0),
        prnu: CMOS_PRNU,
        dsnu: CMOS_DSNU,
        quantum_efficiency: Fact::derived(Points(&[
            [400.0, 0.45],
            [500.0, 0.53],
            [850.0, 0.15],
            [900.0, 0.10],
            [1000.0, 0.02],
        ])),
        sources: "data sheet, general table at 40 °C: resolution, pitch, dark noise with the rolling \
            shutter, saturation, 53, 15 and 10 % at 500, 850 and 900 nm (joined by lines; the ends \
            at 400 and 1000 nm are assumed). Gain: saturation at full scale.",
    },
    Preset {
        name: "MT9M031",
        kind: "Aptina/onsemi CMOS, global shutter",
        resolution: Fact::published([1280, 960]),
        pixel_pitch: Fact::published(3.75),
        bit_depth: Fact::published(12),
        system_gain: Fact::assumed(0.733),
        read_noise: Fact::derived(10.6),
        dark_current: UNCOOLED,
        dark_current_temperature: Fact::assumed(ROOM),
        dark_current_doubling: DOUBLING,
        full_well: Fact::derived(5500.0),
        black_level: Fact::assumed(64.0),
        prnu: CMOS_PRNU,
        dsnu: CMOS_DSNU,
        quantum_efficiency: Fact::assumed(Shape(0.6, 525.0, KnownCurve::FrontLitCmos)),
        sources: "Balluff's page of the mvBlueFOX3-1012b: resolution, pitch, bits, and by EMVA 1288 \
            SNRmax 37.4 dB and dynamic range 54.3 dB, from which saturation and dark noise. Gain: \
            saturation at full scale.",
    },
];
