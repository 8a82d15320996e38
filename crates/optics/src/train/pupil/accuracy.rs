//! Numbers by which an exit pupil is measured.

/// Numbers by which an exit pupil is measured, which trade samples that are lost, and light, for time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PupilAccuracy {
    /// Margin added to every radius of the bound (share of it): what rays measured on a grid may be short of.
    pub margin: f64,
    /// Intervals between nodes over the sensor's half diagonal, for lenses with rotational symmetry.
    pub radial_intervals: u32,
    /// Intervals between nodes over each side of the sensor, for other lenses.
    pub planar_intervals: u32,
    /// The most wavelengths at which a lens of glass is measured, two at least.
    pub wavelengths: u32,
    /// Random rays of a round of the closing check.
    pub checks: u32,
    /// Precision of the edge of the light on the sensor (share of its distance from the sensor's centre).
    pub image_circle: f64,
    /// Tolerance of a ray's landing from where it is aimed on a mask, when polynomials can do it (share of the mask's
    /// pixel).
    pub mask_aim: f64,
    /// Margin added to the outline that lenslets see on all sides, to begin with (share of its width).
    pub lenslet_margin: f64,
    /// Nodes over each side of an array of lenslets at which that outline is measured, two at least.
    pub lenslet_nodes: u32,
    /// Random rays of a round of the check of what lenslets see.
    pub lenslet_checks: u32,
}

impl PupilAccuracy {
    /// Those of a scene that does not say.
    pub const DEFAULT: Self = Self {
        margin: 0.004,
        radial_intervals: 40,
        planar_intervals: 8,
        wavelengths: 5,
        checks: 1 << 16,
        image_circle: 5e-3,
        mask_aim: 0.004,
        lenslet_margin: 0.002,
        lenslet_nodes: 17,
        lenslet_checks: 1 << 14,
    };
}
