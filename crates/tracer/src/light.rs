//! A light of the scene, beside its emissive surfaces: where it is, and what it sends.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use etendue_geometry::glam::{DMat3, DVec3};
use etendue_geometry::{Bounds, Motion, Transform};
use etendue_spectrum::Curve;

use crate::goniometric::Goniometric;
use crate::light_tree::Cluster;
use crate::projector::Projector;
use crate::reference::SceneView;
use crate::{ClearSky, Color, Cube, LightGroup, Modulation, TextureUse};

/// A light of the scene, beside its emissive surfaces.
#[derive(Debug, Clone, PartialEq)]
pub struct Light {
    /// Its kind with its geometry, in the frame of [`Self::motion`] where it has one.
    pub kind: LightKind,
    /// Its motion, from that frame to the world, in the frame's clock; `None` when it stands still.
    pub motion: Option<Arc<Motion>>,
    /// Radiant intensity, irradiance or radiance, by the kind: linear RGB.
    pub color: Color,
    /// The spectrum that the colour multiplies; equal energy when absent.
    pub illuminant: Option<Arc<Curve>>,
    /// Its light as a curve, which takes the place of colour and illuminant in bands of wavelengths.
    pub spectrum: Option<Arc<Curve>>,
    /// The group that it is of, if it names one.
    pub group: Option<LightGroup>,
    /// Change of its strength with time, in the frame's clock; `None` when it does not change.
    pub modulation: Option<Arc<Modulation>>,
}

impl Light {
    /// The light of a model that brings none of its own.
    pub const STUDIO: Self = Self {
        kind: LightKind::Environment {
            image: EnvironmentImage::Studio,
            turn: DMat3::IDENTITY,
            visible: true,
        },
        motion: None,
        color: [1.0; 3],
        illuminant: None,
        spectrum: None,
        group: None,
        modulation: None,
    };

    /// A light of equal energy that is of no group, and as strong all the time.
    #[must_use]
    pub fn steady(kind: LightKind, color: Color) -> Self {
        let (illuminant, spectrum, group) = (None, None, None);
        Self { kind, motion: None, color, illuminant, spectrum, group, modulation: None }
    }

    /// Its pose at a time (s from the frame's time).
    #[inline(always)]
    pub(crate) fn pose(&self, time: f64) -> LightPose {
        LightPose(self.motion.as_ref().map(|motion| motion.at(time)))
    }

    /// True if it is a disk far away, such as the sun's.
    pub(crate) fn is_disk(&self) -> bool {
        matches!(self.kind, LightKind::Directional { cos_radius, .. } if cos_radius < 1.0)
    }

    /// True if it moves between two times (s from the frame's time).
    #[must_use]
    pub fn moves_within(&self, span: [f64; 2]) -> bool {
        self.motion.as_ref().is_some_and(|motion| motion.moves_within(span))
    }

    /// Its cluster within `span` (s from the frame's time), with an intensity (W/sr); `None` of what is far away.
    pub(crate) fn cluster(
        &self,
        intensity: f64,
        scene: &SceneView<'_>,
        span: [f64; 2],
    ) -> Option<Cluster> {
        let own = self.kind.cluster(intensity, scene)?;
        let Some(motion) = &self.motion else { return Some(own) };
        let bounds = motion.swept(own.bounds, span);
        if motion.turns_within(span) {
            return Some(Cluster { bounds, cone: PI, reach: FRAC_PI_2, ..own });
        }
        Some(Cluster { bounds, axis: self.pose(span[0]).direction(own.axis), ..own })
    }

    /// Its intensity in the middle, or of what is measured the mean, over the three colours (W/sr).
    pub(crate) fn intensity(&self) -> f64 {
        let measured = match &self.kind {
            LightKind::Goniometric(measured) => measured.photometry.mean(),
            LightKind::Point(_)
            | LightKind::Spot { .. }
            | LightKind::Directional { .. }
            | LightKind::Projector(_)
            | LightKind::Environment { .. } => 1.0,
        };
        measured * mean(&self.color)
    }

    /// The texture that it throws.
    #[must_use]
    pub fn texture(&self) -> Option<&TextureUse> {
        match &self.kind {
            LightKind::Projector(projector) => projector.image.image(),
            LightKind::Point(_)
            | LightKind::Spot { .. }
            | LightKind::Directional { .. }
            | LightKind::Goniometric(_)
            | LightKind::Environment { .. } => None,
        }
    }

    /// The file of an environment's image, or of a measured distribution.
    #[must_use]
    pub fn file(&self) -> Option<&std::path::PathBuf> {
        match &self.kind {
            LightKind::Environment { image: EnvironmentImage::File(path), .. } => Some(path),
            LightKind::Goniometric(measured) => Some(&measured.file),
            LightKind::Point(_)
            | LightKind::Spot { .. }
            | LightKind::Directional { .. }
            | LightKind::Projector(_)
            | LightKind::Environment { .. } => None,
        }
    }
}

/// The pose of a light, which may move, at some time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LightPose(Option<Transform>);

impl LightPose {
    /// A point of its frame (m), in the world.
    #[inline(always)]
    pub(crate) fn point(&self, own: DVec3) -> DVec3 {
        self.0.map_or(own, |place| place.point(own))
    }

    /// A direction of its frame, in the world (unit).
    #[inline(always)]
    pub(crate) fn direction(&self, own: DVec3) -> DVec3 {
        let turned = |place: Transform| (place.linear * own).try_normalize();
        self.0.map_or(own, |place| turned(place).unwrap_or(own))
    }

    /// A point of the world (m), in its frame.
    #[inline(always)]
    pub(crate) fn seen(&self, from: DVec3) -> DVec3 {
        self.0.map_or(from, |place| place.linear.inverse() * -place.offset_from(from))
    }
}

/// The kinds of lights.
#[derive(Debug, Clone, PartialEq)]
pub enum LightKind {
    /// A point (m) with an intensity.
    Point(DVec3),
    /// A point (m) with an intensity in a cone.
    Spot {
        /// Its position (m).
        at: DVec3,
        /// Direction that it is aimed in (unit).
        axis: DVec3,
        /// Cosine of the half-angle outside of which it is dark.
        cos_outer: f64,
        /// Cosine of the half-angle inside of which it is at its full.
        cos_inner: f64,
    },
    /// Light from afar, with an irradiance.
    Directional {
        /// Direction in which it goes (unit).
        along: DVec3,
        /// Cosine of the half-angle of the disk that it comes from; 1 of parallel light.
        cos_radius: f64,
        /// The camera sees the disk where nothing is in the way, as mirrors and glass do.
        visible: bool,
    },
    /// A point that throws an image, with an axial intensity.
    Projector(Box<Projector>),
    /// A point that shines by a measured distribution, which the colour multiplies.
    Goniometric(Box<Goniometric>),
    /// Radiance from all around.
    Environment {
        /// Its image.
        image: EnvironmentImage,
        /// The turn that brings the image's directions into the world: its middle from −Z, its top from +Y.
        turn: DMat3,
        /// The camera sees it where nothing is in the way.
        visible: bool,
    },
}

impl LightKind {
    /// The solid angle over which it shines, each direction as much as it is bright there beside the middle (sr, of
    /// measured lights cd·sr); `None` of what is far away, and of what throws an image.
    pub(crate) fn spread(&self) -> Option<f64> {
        match self {
            Self::Point(_) => Some(4.0 * PI),
            // Full within the inner cone, and between the cones the mean of a square over equal parts of the sphere.
            Self::Spot { cos_outer, cos_inner, .. } => {
                Some(2.0 * PI * ((1.0 - cos_inner) + (cos_inner - cos_outer) / 3.0))
            }
            Self::Goniometric(measured) => Some(4.0 * PI * measured.photometry.mean()),
            Self::Projector(_) | Self::Directional { .. } | Self::Environment { .. } => None,
        }
    }

    /// Its position (m), in its own frame; `None` of what is far away.
    pub(crate) fn place(&self) -> Option<DVec3> {
        match self {
            Self::Point(at) | Self::Spot { at, .. } => Some(*at),
            Self::Projector(projector) => Some(projector.at),
            Self::Goniometric(measured) => Some(measured.at),
            Self::Directional { .. } | Self::Environment { .. } => None,
        }
    }

    /// Its cluster, with an intensity (W/sr); `None` of what is far away.
    pub(crate) fn cluster(&self, intensity: f64, scene: &SceneView<'_>) -> Option<Cluster> {
        let (at, axis, cone, reach) = match self {
            Self::Point(at) => (*at, DVec3::Y, PI, FRAC_PI_2),
            Self::Spot { at, axis, cos_outer, cos_inner } => {
                let [outer, inner] = [cos_outer.acos(), cos_inner.acos()];
                (*at, *axis, inner, outer - inner)
            }
            Self::Projector(projector) => {
                (projector.at, projector.axis(), projector.cone(scene), 0.0)
            }
            Self::Goniometric(measured) => {
                (measured.at, measured.axis(), measured.photometry.reach(), 0.0)
            }
            Self::Directional { .. } | Self::Environment { .. } => return None,
        };
        let bounds = Bounds { min: at, max: at };
        Some(Cluster { bounds, axis, cone, reach, intensity })
    }
}

/// The source of an environment's image.
#[derive(Debug, Clone, PartialEq)]
pub enum EnvironmentImage {
    /// There is none: alike from all sides.
    Constant,
    /// The one that lights models without a light ([`crate::EnvironmentMap::studio`]).
    Studio,
    /// A clear sky.
    ClearSky(Box<ClearSky>),
    /// A file.
    File(std::path::PathBuf),
    /// Light by wavelength.
    Cube(Arc<Cube>),
}

impl EnvironmentImage {
    /// That of a light, of an environment.
    #[must_use]
    pub fn of(light: &Light) -> Option<&Self> {
        match &light.kind {
            LightKind::Environment { image, .. } => Some(image),
            LightKind::Point(_)
            | LightKind::Spot { .. }
            | LightKind::Directional { .. }
            | LightKind::Projector(_)
            | LightKind::Goniometric(_) => None,
        }
    }
}

/// glTF's fall-off between a spot light's cones (`KHR_lights_punctual`): the square of the share.
pub(crate) fn spot_falloff(cosine: f64, cos_outer: f64, cos_inner: f64) -> f64 {
    if cosine >= cos_inner {
        return 1.0;
    }
    let share = ((cosine - cos_outer) / (cos_inner - cos_outer)).clamp(0.0, 1.0);
    share * share
}

pub(crate) fn mean(color: &Color) -> f64 {
    (color[0] + color[1] + color[2]) / 3.0
}

/// Share of its irradiance by which an environment that is alike from all sides is chosen: paths find it by scattering as
/// well as by asking, so that beside other lights these are asked more often.
const EVEN_SHARE: f64 = 0.5;

/// Irradiance (W/m²) of a surface that faces a light far away, as that is chosen beside others ([`EVEN_SHARE`]); an
/// environment's image has this `brightness` in the mean. 0 of any other light.
pub(crate) fn sought_irradiance(light: &Light, brightness: f64) -> f64 {
    let own = mean(&light.color);
    match &light.kind {
        LightKind::Directional { .. } => own,
        LightKind::Environment { image: EnvironmentImage::Constant, .. } => EVEN_SHARE * PI * own,
        LightKind::Environment { .. } => PI * own * brightness,
        LightKind::Point(_)
        | LightKind::Spot { .. }
        | LightKind::Projector(_)
        | LightKind::Goniometric(_) => 0.0,
    }
}

/// Power of a light near by (W); 0 of one far away.
pub(crate) fn power(light: &Light, scene: &SceneView<'_>) -> f64 {
    let own = mean(&light.color);
    match &light.kind {
        LightKind::Point(_) => 4.0 * PI * own,
        // As bright as inside over the mean of both cones.
        LightKind::Spot { cos_outer, cos_inner, .. } => {
            2.0 * PI * (1.0 - 0.5 * (cos_outer + cos_inner)) * own
        }
        LightKind::Projector(projector) => projector.solid_angle(scene) * own,
        LightKind::Goniometric(_) => 4.0 * PI * light.intensity(),
        LightKind::Directional { .. } | LightKind::Environment { .. } => 0.0,
    }
}

/// Bounds of all lights.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LightBounds {
    /// The least area of a triangle (m²); infinite without any.
    pub(crate) least_area: f64,
    /// The largest absolute coordinate of what has a place and is no triangle that stands still (m).
    pub(crate) farthest: f64,
    /// Some need more than their place.
    pub(crate) has_others: bool,
    /// The largest band of those (W/sr, W/m² or W/(m² sr)).
    pub(crate) brightest: f64,
    /// Some of those are triangles: they are not alike all over, they move, or they are too many to be kept ready.
    pub(crate) has_other_triangles: bool,
    /// The light of some of these is looked up in a texture.
    pub(crate) are_textured: bool,
    /// All are far away.
    pub(crate) are_far: bool,
}

impl LightBounds {
    /// Those of no light.
    pub(crate) const NOTHING: Self = Self {
        least_area: f64::INFINITY,
        farthest: 0.0,
        has_others: false,
        brightest: 0.0,
        has_other_triangles: false,
        are_textured: false,
        are_far: false,
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skies_that_are_alike_all_over_are_sought_half() {
        let sky = |image| LightKind::Environment { image, turn: DMat3::IDENTITY, visible: true };
        let sought = |kind| sought_irradiance(&Light::steady(kind, [1.0; 3]), 3.0);
        assert_eq!(sought(sky(EnvironmentImage::Studio)), 3.0 * PI);
        assert_eq!(sought(sky(EnvironmentImage::Constant)), 0.5 * PI);
        assert_eq!(sought(LightKind::Point(DVec3::ZERO)), 0.0);
    }
}
