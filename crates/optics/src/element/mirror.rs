//! A mirror: plane, sphere, conic or even asphere, with a hole where it has one.
//!
//! # Unfolded coordinates
//!
//! Behind a mirror light runs against the axis. A train is traced unfolded: space behind a mirror is itself
//! seen in a mirror, in the plane through the vertex and square to the axis, so that light goes on along +z and
//! every gap that is passed counts forwards (R. Kingslake and R. B. Johnson, *Lens Design Fundamentals*, 2nd ed.,
//! 2010, 3.2; V. N. Mahajan, *Optical Imaging and Aberrations* I, 1998, 1.4). A flat mirror leaves every ray of
//! the unfolded space as it is; one of curvature c has the power −2 n c. Focal lengths, pupils, chief rays, spots
//! and pictures then follow as behind a lens.
//!
//! # Reflection
//!
//! d' = d − 2 (d·m) m/|m|² is refraction with μ = −1, but for its sign: the refracting kernels give −d', and
//! [`Fold`] turns that round on its way into the unfolded space.

use std::collections::BTreeMap;
use std::sync::Arc;

use etendue_geometry::units::Millimetres;
use etendue_spectrum::Curve;
use glam::{DMat3, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Frame;
use super::coating::{MirrorCoating, MirrorCoatingSpec};
use super::rays::{Block, Clip, LANES, Ray, RayStatus, Traversal};
use super::real::Real;
use super::surface::{Surface, SurfaceSpec};

/// A mirror as a lens file writes it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MirrorSpec {
    /// Radius of curvature (mm), positive when its centre lies at greater z, whichever way light goes. A flat
    /// mirror has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius: Option<Millimetres>,
    /// 1/radius (1/mm), instead of the radius; 0 is flat.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub curvature: Option<f64>,
    /// Half the clear diameter (mm): rays farther from the axis are stopped. Unlimited when absent; a mirror that
    /// has one stops the rays that meet its back on their way to other elements.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub semi_diameter: Option<Millimetres>,
    /// The radius of a hole in its middle (mm), through which light passes on its way to other elements.
    #[serde(skip_serializing_if = "super::is_default")]
    pub hole: Millimetres,
    /// The conic constant: 0 a sphere, −1 a paraboloid.
    #[serde(skip_serializing_if = "super::is_default")]
    pub conic: f64,
    /// Coefficients of the even asphere by their power of r, `{"4": 1e-6}` (mm to 1 − power).
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub aspheric: BTreeMap<String, f64>,
    /// True if the axis is folded by the mirror's tilt, as that of a fold mirror: what is behind stands on the axis
    /// as the tilted vertex reflects it. Otherwise the tilt is one of the mirror alone.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub fold: bool,
    /// The share of light that it reflects (0..=1) by wavelength: a number, or a list of [nm, share]. All of it when
    /// absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reflectance: Option<Curve>,
    /// Instead of `reflectance`: a metal or glass with films on it, that reflects by the angle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coating: Option<MirrorCoatingSpec>,
}

/// A mirror in its own frame (mm), as light that runs along +z meets it.
#[derive(Debug, Clone, PartialEq)]
pub struct Mirror {
    /// Its shape and clear aperture.
    pub surface: Surface,
    /// Properties of the mirror apart from its shape.
    pub mount: MirrorMount,
}

/// Properties of a mirror apart from its shape.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MirrorMount {
    /// The radius of the hole in its middle (mm); 0 without.
    pub hole: f64,
    /// True if the mirror's tilt folds the axis.
    pub folds_axis: bool,
    /// The share of light that it reflects; all of it when there is none.
    pub reflectance: Option<Curve>,
    /// Films that reflect by the angle.
    pub coating: Option<Arc<MirrorCoating>>,
}

impl MirrorMount {
    /// Builds it from what a file has.
    ///
    /// # Errors
    ///
    /// A sentence on a hole or a share that is none.
    pub(super) fn build(
        hole: Millimetres,
        fold: bool,
        reflectance: Option<&Curve>,
        semi_diameter: f64,
    ) -> Result<Self, String> {
        let hole = hole.0;
        if !(hole >= 0.0 && hole.is_finite()) {
            return Err(format!("hole is {hole} mm; it must be a length from 0 on"));
        }
        if hole > 0.0 && hole >= semi_diameter {
            return Err(format!(
                "hole is {hole} mm and semi_diameter {semi_diameter} mm: nothing of the mirror is left; make the \
                 hole smaller"
            ));
        }
        let reflectance =
            reflectance.map(|curve| curve.clone().within(0.0, 1.0).map_err(|e| e.to_string()));
        Ok(Self { hole, folds_axis: fold, reflectance: reflectance.transpose()?, coating: None })
    }
}

impl MirrorSpec {
    /// The mirror.
    ///
    /// # Errors
    ///
    /// A sentence on the first number that describes no mirror.
    pub fn build(&self) -> Result<Mirror, String> {
        let surface = SurfaceSpec {
            radius: self.radius,
            curvature: self.curvature,
            glass: None,
            semi_diameter: self.semi_diameter,
            conic: self.conic,
            aspheric: self.aspheric.clone(),
        }
        .build()?;
        let mount = MirrorMount::build(
            self.hole,
            self.fold,
            self.reflectance.as_ref(),
            surface.semi_diameter,
        )?;
        let mut mirror = Mirror { surface, mount };
        if let Some(coating) = &self.coating {
            if self.reflectance.is_some() {
                return Err("give either reflectance or coating".to_owned());
            }
            let coating = coating.build().map_err(|why| format!("coating: {why}"))?;
            mirror.mount.coating = Some(coating.into());
        }
        Ok(mirror)
    }
}

/// From the space before a mirror to the unfolded one behind it: a reflection in a plane through the vertex.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Fold {
    /// The mirror's vertex (mm).
    vertex: DVec3,
    /// The plane's unit normal.
    normal: DVec3,
    /// The mirror's own axis on this side.
    axis: DVec3,
    /// The square of the hole's radius (mm²).
    hole2: f64,
    /// The share of light that is reflected.
    reflectance: f64,
}

impl Fold {
    /// Of a mirror that stands in `frame`.
    pub(crate) fn new(mount: &MirrorMount, frame: &Frame, reflectance: f64) -> Self {
        let axis = frame.rotation.z_axis;
        let normal = if mount.folds_axis { axis } else { DVec3::Z };
        Self { vertex: frame.vertex, normal, axis, hole2: mount.hole * mount.hole, reflectance }
    }

    /// The mirror's frame as light that comes from behind meets it, and the fold on its way.
    pub(crate) fn seen_from_behind(&self, frame: &Frame) -> (Frame, Self) {
        let behind = self.frame_behind(frame);
        (behind, Self { axis: behind.rotation.z_axis, ..*self })
    }

    /// The mirror's frame as it stands in the unfolded space behind it.
    fn frame_behind(&self, frame: &Frame) -> Frame {
        if self.normal == DVec3::Z && frame.rotation == DMat3::IDENTITY {
            return *frame;
        }
        let flip = DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0));
        Frame { rotation: self.reflection() * frame.rotation * flip, ..*frame }
    }

    /// The reflection of directions.
    fn reflection(&self) -> DMat3 {
        let n = self.normal;
        DMat3::from_cols(
            DVec3::X - 2.0 * n.x * n,
            DVec3::Y - 2.0 * n.y * n,
            DVec3::Z - 2.0 * n.z * n,
        )
    }

    /// From the unfolded space behind the mirror to that before it, as a rotation with reflection and a shift.
    pub(crate) fn map(&self) -> (DMat3, DVec3) {
        let reflection = self.reflection();
        (reflection, self.vertex - reflection * self.vertex)
    }

    /// True if a point of the mirror (mm) is in its hole.
    #[inline(always)]
    fn is_hole(&self, [x, y, z]: [f64; 3]) -> bool {
        let (x, y, z) = (x - self.vertex.x, y - self.vertex.y, z - self.vertex.z);
        let along = x * self.axis.x + y * self.axis.y + z * self.axis.z;
        x * x + y * y + z * z - along * along < self.hole2
    }

    /// A ray as a kernel of μ = −1 leaves it, in the unfolded space.
    #[inline(always)]
    pub(super) fn unfolded<T: Real>(&self, ray: Ray<T>) -> Ray<T> {
        let Ray { position: [x, y, z], direction: [u, v, w] } = ray;
        let (n, vertex) = (self.normal, self.vertex);
        let twice = (x.plus(-vertex.x).times(n.x)
            + y.plus(-vertex.y).times(n.y)
            + z.plus(-vertex.z).times(n.z))
        .times(2.0);
        let along = (u.times(n.x) + v.times(n.y) + w.times(n.z)).times(2.0);
        Ray {
            position: [x - twice.times(n.x), y - twice.times(n.y), z - twice.times(n.z)],
            direction: [along.times(n.x) - u, along.times(n.y) - v, along.times(n.z) - w],
        }
    }

    /// Goes on with the rays of a block that were on their way, as `before` has it, and were reflected.
    #[inline(always)]
    pub(super) fn unfold(&self, block: &mut Block, before: &[u64; LANES], clip: Clip, ended: u64) {
        for (lane, &before) in before.iter().enumerate() {
            let old = block.ray(lane);
            let reflected = (before == 0) & (block.outcome[lane] == 0);
            let stopped = reflected & (clip == Clip::On) & self.is_hole(old.position);
            let new = self.unfolded(old);
            let goes_on = reflected & !stopped;
            let position = if goes_on { new.position } else { old.position };
            let direction = if goes_on { new.direction } else { old.direction };
            block.set_ray(lane, Ray { position, direction });
            block.throughput[lane] *= if goes_on { self.reflectance } else { 1.0 };
            block.outcome[lane] = if stopped { ended } else { block.outcome[lane] };
        }
    }

    /// Unfolds one ray, that came as `ray`.
    pub(super) fn unfold_one(
        &self,
        ray: Ray,
        traversal: Traversal,
        clip: Clip,
        element: usize,
    ) -> Traversal {
        if traversal.status != RayStatus::Exited {
            return traversal;
        }
        if clip == Clip::On && self.is_hole(traversal.ray.position) {
            return Traversal { status: RayStatus::Vignetted { element }, ray, ..traversal };
        }
        Traversal {
            ray: self.unfolded(traversal.ray),
            transmission: traversal.transmission * self.reflectance,
            ..traversal
        }
    }
}

/// A mirror in the way of light that is meant for another element: what its rim encloses, but for its hole.
///
/// A ray that crosses the disk within the rim and not that within the hole's rim crosses the mirror between.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Shadow {
    /// Depth (mm) and squared radius (mm²) of the mirror's rim.
    pub(crate) rim: [f64; 2],
    /// Depth (mm) and squared radius (mm²) of the hole's rim.
    pub(crate) hole: [f64; 2],
}

impl Shadow {
    /// True if the mirror stops a ray, given in the mirror's frame.
    #[inline(always)]
    pub(super) fn stops(&self, ray: Ray) -> bool {
        let Ray { position: [x, y, z], direction: [u, v, w] } = ray;
        let square = |depth: f64| {
            let t = (depth - z) / w;
            let (x, y) = (x + t * u, y + t * v);
            x * x + y * y
        };
        let within = square(self.rim[0]) <= self.rim[1];
        let through_hole = square(self.hole[0]) < self.hole[1];
        within & !through_hole
    }
}
