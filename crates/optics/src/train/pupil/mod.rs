//! The exit pupil as each point of the sensor sees it, and samples of it.
//!
//! Rays that leave the sensor in directions in which no light can come are wasted: around a double
//! Gauss at f/2 a third of those aimed at a rectangle around the pupil. Here the outline of the
//! passing directions is known at nodes over the sensor, in slopes (x/−z, y/−z), as a frame (centre
//! and half axes) and a table of radii by angle in that frame. Frames and radii are joined by
//! straight lines over the sensor and over the angle, so the bound has no steps and a picture no
//! rings.
//!
//! # No bias
//!
//! A bound that cuts off part of the pupil would darken the picture, so each radius in the table is
//! the greatest of those measured at the nine nearest places of a grid twice as fine, in the sensor
//! and in the angle, plus a margin; the interpolated bound is then at least the true outline at all
//! measured places between. What the fine grid itself could miss is looked for with random rays just
//! outside the bound when it is built, and the bound is widened until none of them passes. Radii are
//! those of the outermost passing ray, so an outline needs not be convex.
//!
//! # Obscuration
//!
//! Where something may stand in the middle of the light, the innermost passing rays are measured in the same way as
//! the outermost, the least of those nearby less a margin is kept, and random rays just inside of it are let through
//! until none passes: samples are drawn between the two.
//!
//! # Weights
//!
//! For the irradiance of Eq. (1) of Nürnberg et al. (2019), E = ∫ L cos θ dΩ: a sample stands for
//! dm = π a b ρ² of slopes, in which dΩ = cos³θ dm, θ from the axis, and the sensor sees it under its
//! own cosine. In a medium of index n before the sensor the radiance is n² that of the object.
//!
//! The bounds that this replaces: C. Kolb, D. Mitchell, P. Hanrahan, "A realistic camera model for
//! computer graphics", 1995; M. Pharr, W. Jakob, G. Humphreys, *Physically Based Rendering*, 6.4.5.

mod accuracy;
mod bound;
mod clear;
mod coded;
mod disk;
mod lenslets;
mod make;
mod mask_cells;
mod mask_map;
mod mask_region;
mod measure;
mod outline_table;
mod place;
mod refusals;
mod region;
mod samples;
mod search;
mod wavelengths;

use glam::{DVec2, DVec3};

use self::coded::MaskView;
use super::BehindLenslets;
use crate::element::Frame;

pub use accuracy::PupilAccuracy;
pub use clear::{without_dimming, without_filters};
pub use disk::{Disk, PupilSamples};
pub use measure::lit_radius;
pub use refusals::{blocked, dark_array, unbounded};
pub use search::SlopeWindow;

/// Angles in the table of a node. Not a setting: tables have this size when they are compiled, and what angles miss
/// between them is [`PupilAccuracy::margin`]'s.
const ANGLES: usize = 128;

/// Directions in which the outline's extent is kept.
const NORMALS: usize = 16;

/// One sample of the exit pupil.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PupilSample {
    /// The unit direction from the point of the sensor into the lens, in lens coordinates.
    pub direction: DVec3,
    /// Projected solid angle that the sample stands for (sr): the mean of weight times radiance
    /// over samples, blocked ones counted as 0, is the irradiance.
    pub weight: f64,
}

/// Exit pupil: the directions from which light can come, for each point of a sensor.
#[derive(Debug, Clone)]
pub struct ExitPupil {
    sensor: Frame,
    half_size: DVec2,
    layout: NodeLayout,
    /// The pupil in closed form; there are no nodes then.
    disk: Option<Disk>,
    nodes: Vec<PupilOutline>,
    /// The first mask, which is sampled by what it passes.
    coded: Option<MaskView>,
    /// The lenslets through which light comes; there are no nodes then.
    lenslets: Option<Box<LensletPupil>>,
    index2: f64,
    /// Distance from the sensor's centre to the outermost node of a radial layout (mm).
    radius: f64,
    accuracy: PupilAccuracy,
}

/// Layout of the nodes on the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum NodeLayout {
    /// On a radius, for all directions across the sensor.
    Radial,
    /// On a grid.
    Planar,
}

/// The passing directions from one point of the sensor.
#[derive(Debug, Clone)]
struct PupilOutline {
    /// The middle of the frame in slopes.
    centre: DVec2,
    /// The frame's half axes in slopes; 0 when nothing passes.
    half: DVec2,
    /// Radii in the frame by angle; the first again at the end.
    reach: [f64; ANGLES + 1],
    /// Radii within which nothing passes, by angle; the first again at the end. 0 where nothing obscures.
    inner: [f64; ANGLES + 1],
    /// The greatest of the outer ones.
    widest: f64,
    /// The slopes of the chief ray.
    chief: Option<DVec2>,
}

impl PupilOutline {
    const DARK: Self = Self {
        centre: DVec2::ZERO,
        half: DVec2::ZERO,
        reach: [0.0; ANGLES + 1],
        inner: [0.0; ANGLES + 1],
        widest: 0.0,
        chief: None,
    };

    fn is_dark(&self) -> bool {
        self.half == DVec2::ZERO
    }
}

/// The light that reaches a sensor through an array of lenslets.
#[derive(Debug, Clone)]
pub struct LensletPupil {
    view: BehindLenslets,
    table: OutlineTable,
    /// The opening of a lenslet around its centre, in the array's axes (mm).
    opening: Vec<DVec2>,
    /// Openings of a lenslet of the other arrays, by kind and array.
    others: Vec<Vec<DVec2>>,
    /// Gaps between openings that let light by, in pieces around the centre of a cell.
    gaps: Vec<Vec<DVec2>>,
    /// The area of an opening (mm²), and the radius of the circle around it (mm).
    area: f64,
    opening_radius: f64,
    /// Change of the slopes towards the pupil over the array (1/mm).
    drift: f64,
    margin: f64,
}

/// The exit pupil of the lens before, over the plane of the array: extents of its outline in slopes.
#[derive(Debug, Clone)]
struct OutlineTable {
    main: ExitPupil,
    half: DVec2,
    /// Nodes over each side of the array.
    across: u32,
    nodes: Vec<Option<OutlineNode>>,
}

/// An outline in slopes.
#[derive(Debug, Clone)]
struct OutlineNode {
    extent: [f64; NORMALS],
    centre: DVec2,
}

#[cfg(test)]
mod tests {
    use super::wavelengths::LensSplit;
    use super::*;
    use crate::train::{Focus, LensFile, OpticalTrain};

    const CHECKS: u32 = PupilAccuracy::DEFAULT.checks;

    pub(super) fn preset(name: &str) -> OpticalTrain {
        let path = format!("{}/../../scenes/lenses/{name}.json", env!("CARGO_MANIFEST_DIR"));
        let file = LensFile::from_json(&std::fs::read_to_string(path).unwrap()).unwrap();
        file.build(&|name: &str| Err(format!("{name}: presets have no files"))).unwrap()
    }

    /// The proof of the margin: the bound was closed with rays of the first rounds, and of the
    /// rounds after them, with which it had nothing to do, none passes outside of it.
    #[test]
    fn of_a_million_rays_just_outside_of_the_bound_none_passes() {
        // The last is searched coarsely.
        for name in ["double-gauss", "fisheye", "telephoto", "asphere", "gradient-singlet"] {
            let train = preset(name);
            let z = train.sensor_z(Focus::Infinity).unwrap();
            let lens = train.at(587.56).unwrap();
            assert_eq!(lens.is_costly(), name == "gradient-singlet");
            let pupil = ExitPupil::new(&train, &[587.56], z, [18.0, 12.0]).unwrap();
            let (mut looked_at, mut passed) = (0, 0);
            for round in 16..32 {
                passed += pupil.strays(&lens, round * CHECKS..(round + 1) * CHECKS).len();
                looked_at += CHECKS;
            }
            assert_eq!(passed, 0, "{name}: of {looked_at}");
        }
    }

    #[test]
    fn a_bound_drawn_too_tight_is_widened() {
        let train = preset("double-gauss");
        let z = train.sensor_z(Focus::Infinity).unwrap();
        let lens = train.at(587.56).unwrap();
        let mut pupil = ExitPupil::new(&train, &[587.56], z, [18.0, 12.0]).unwrap();
        for reach in pupil.nodes.iter_mut().flat_map(|node| &mut node.reach) {
            *reach *= 0.95;
        }
        let before = pupil.strays(&lens, 0..CHECKS).len();
        pupil.widen_until_tight(&LensSplit::of(&train, vec![lens.clone()], 5));
        let after = pupil.strays(&lens, 20 * CHECKS..21 * CHECKS).len();
        assert!(before > 1000 && after * 100 < before, "{before} and then {after}");
    }

    #[test]
    fn an_error_names_what_blocks_the_light() {
        let closed = preset("double-gauss").with_stop_radius(0.0).unwrap();
        let z = closed.sensor_z(Focus::Infinity).unwrap();
        let error = ExitPupil::new(&closed, &[587.56], z, [18.0, 12.0]).unwrap_err();
        assert!(error.why().contains("past elements[5]"), "{error}");
        assert!(error.why().contains("vignetted at element 5"), "{error}");
        let open =
            LensFile::from_json(r#"{"elements": [{"type": "thin_lens", "focal_length": 9}]}"#);
        let open = open.unwrap().build(&|_: &str| Err(String::new())).unwrap();
        let error = ExitPupil::new(&open, &[587.56], 9.0, [1.0, 1.0]).unwrap_err();
        assert_eq!(error, unbounded());
    }
}
