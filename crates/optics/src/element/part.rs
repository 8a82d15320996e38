//! The closed set of parts: as a lens file writes them, and ready to be traced. One match a verb, so
//! that a new part is asked for all of them here and nowhere else.

use std::sync::Arc;

use etendue_chart::significant;
use etendue_spectrum::Curve;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::coordinate_break::{CoordinateBreak, CoordinateBreakSpec};
use super::freeform::{Freeform, FreeformSpec};
use super::mirror::{Mirror, MirrorMount, MirrorSpec};
use super::{
    ApertureSpec, Biconic, BiconicSpec, CircularSpec, Filter, FilterSpec, Gaps, MicrolensArray,
    MicrolensArraySpec, Opening, Resolve, Surface, SurfaceSpec, ThinLens, ThinLensSpec,
};
use crate::glass::GlassSpec;
use etendue_geometry::units::Millimetres;

/// A part as a lens file writes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum PartSpec {
    /// A refracting surface.
    Surface(SurfaceSpec),
    /// A refracting surface of two curvatures.
    Biconic(BiconicSpec),
    /// An ideal thin lens.
    ThinLens(ThinLensSpec),
    /// An opening in an opaque sheet.
    Aperture(ApertureSpec),
    /// A sheet that absorbs.
    Filter(FilterSpec),
    /// An array of lenslets.
    MicrolensArray(MicrolensArraySpec),
    /// A mirror.
    Mirror(MirrorSpec),
    /// A surface of any shape.
    Freeform(FreeformSpec),
    /// From here on the axis runs elsewhere.
    CoordinateBreak(CoordinateBreakSpec),
}

/// Kind of an element with its data, ready to be traced.
#[derive(Debug, Clone, PartialEq)]
pub enum Part {
    /// A refracting surface between the media before and behind it.
    Surface(Surface),
    /// A refracting surface of two curvatures.
    Biconic(Biconic),
    /// An ideal thin lens.
    ThinLens(ThinLens),
    /// An opening in an opaque sheet.
    Aperture(Arc<Opening>),
    /// A sheet that absorbs.
    Filter(Arc<Filter>),
    /// An array of lenslets.
    MicrolensArray(Arc<MicrolensArray>),
    /// A mirror.
    Mirror(Mirror),
    /// A surface of any shape.
    Freeform(Arc<Freeform>),
    /// From here on the axis runs elsewhere.
    CoordinateBreak(CoordinateBreak),
}

/// Drawing symbol of a part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Symbol {
    /// By its section: a boundary between media.
    Surface,
    /// By a line with arrow heads.
    ThinLens {
        /// 1 when they point outwards, −1 inwards.
        converging: f64,
    },
    /// By the walls of its opening.
    Opening,
    /// By two lines.
    Sheet,
    /// Not at all.
    Nothing,
}

impl From<SurfaceSpec> for PartSpec {
    fn from(spec: SurfaceSpec) -> Self {
        Self::Surface(spec)
    }
}

impl PartSpec {
    /// A round aperture of the given radius (mm).
    #[must_use]
    pub fn circular(radius: f64) -> Self {
        Self::Aperture(ApertureSpec::Circular(CircularSpec { radius: Millimetres(radius) }))
    }

    /// A spherical surface: radius (mm, infinite for a plane), what follows it, semi-diameter (mm).
    #[must_use]
    pub fn spherical(radius: f64, glass: Option<GlassSpec>, semi_diameter: f64) -> Self {
        let radius = radius.is_finite().then_some(Millimetres(radius));
        let semi_diameter = semi_diameter.is_finite().then_some(Millimetres(semi_diameter));
        Self::Surface(SurfaceSpec { radius, glass, semi_diameter, ..SurfaceSpec::default() })
    }

    /// Medium behind the part, on the sensor's side: `None` for a sheet, which changes no medium,
    /// and `Some(None)` for air.
    #[must_use]
    pub fn medium_behind(&self) -> Option<Option<&GlassSpec>> {
        match self {
            Self::Surface(surface) => Some(surface.glass.as_ref()),
            Self::Biconic(surface) => Some(surface.glass.as_ref()),
            Self::Freeform(surface) => (!surface.mirror).then_some(surface.glass.as_ref()),
            Self::MicrolensArray(array) => array.has_faces().then_some(array.glass.as_ref()),
            Self::ThinLens(_)
            | Self::Aperture(_)
            | Self::Filter(_)
            | Self::Mirror(_)
            | Self::CoordinateBreak(_) => None,
        }
    }

    /// The part, ready to be traced.
    ///
    /// # Errors
    ///
    /// A sentence on what makes no part.
    pub fn build(&self, resolve: Resolve<'_>) -> Result<Part, String> {
        Ok(match self {
            Self::Surface(surface) => Part::Surface(surface.build()?),
            Self::Biconic(surface) => Part::Biconic(surface.build()?),
            Self::ThinLens(lens) => Part::ThinLens(lens.build()?),
            Self::Aperture(aperture) => Part::Aperture(aperture.build(resolve)?.into()),
            Self::Filter(filter) => Part::Filter(filter.build(resolve)?.into()),
            Self::MicrolensArray(array) => Part::MicrolensArray(array.build()?.into()),
            Self::Mirror(mirror) => Part::Mirror(mirror.build()?),
            Self::Freeform(surface) => Part::Freeform(surface.build(resolve)?.into()),
            // By how it is mounted, which the lens knows.
            Self::CoordinateBreak(_) => Part::CoordinateBreak(CoordinateBreak::default()),
        })
    }
}

impl Part {
    /// The word behind `type` in the file.
    #[must_use]
    pub fn type_name(&self) -> &'static str {
        match self {
            Self::Surface(_) => "surface",
            Self::Biconic(_) => "biconic",
            Self::ThinLens(_) => "thin_lens",
            Self::Aperture(_) => "aperture",
            Self::Filter(_) => "filter",
            Self::MicrolensArray(_) => "microlens_array",
            Self::Mirror(_) => "mirror",
            Self::Freeform(_) => "freeform",
            Self::CoordinateBreak(_) => "coordinate_break",
        }
    }

    /// Radius around its axis within which the part passes light (mm); infinite when unlimited.
    #[must_use]
    pub fn clear_radius(&self) -> f64 {
        match self {
            Self::Surface(surface) => surface.semi_diameter,
            Self::Biconic(surface) => surface.semi_diameter,
            Self::ThinLens(lens) => lens.semi_diameter,
            Self::Aperture(opening) => opening.radius(),
            Self::Filter(filter) => filter.radius(),
            Self::MicrolensArray(array) => array.radius(),
            Self::Mirror(mirror) => mirror.surface.semi_diameter,
            Self::Freeform(surface) => surface.semi_diameter,
            Self::CoordinateBreak(_) => f64::INFINITY,
        }
    }

    /// Opens or closes it to `radius` (mm).
    ///
    /// # Errors
    ///
    /// A sentence on why it has no radius to be set.
    pub(crate) fn set_clear_radius(&mut self, radius: f64) -> Result<(), &'static str> {
        match self {
            Self::Surface(surface) => surface.semi_diameter = radius,
            Self::Biconic(surface) => surface.semi_diameter = radius,
            Self::ThinLens(lens) => lens.semi_diameter = radius,
            Self::Filter(filter) => Arc::make_mut(filter).semi_diameter = radius,
            Self::Aperture(opening) => {
                let opening = Arc::make_mut(opening);
                *opening = opening.with_radius(radius).ok_or("it is a mask")?;
            }
            Self::MicrolensArray(_) => return Err("it is a microlens array"),
            Self::Mirror(mirror) => mirror.surface.semi_diameter = radius,
            Self::Freeform(surface) => Arc::make_mut(surface).semi_diameter = radius,
            Self::CoordinateBreak(_) => return Err("it is a break of the coordinates"),
        }
        Ok(())
    }

    /// The part with a rim that is wider by so much (mm; narrower for less than 0); `None` where more than one circle or
    /// polygon about its axis bounds it.
    pub(crate) fn with_wider_rim(&self, by: f64) -> Option<Self> {
        let wider = |radius: f64| (radius + by).max(0.0);
        let mut own = self.clone();
        match &mut own {
            Self::Surface(surface) => surface.semi_diameter = wider(surface.semi_diameter),
            Self::Biconic(surface) => surface.semi_diameter = wider(surface.semi_diameter),
            Self::ThinLens(lens) => lens.semi_diameter = wider(lens.semi_diameter),
            Self::Filter(filter) if filter.is_uniform() => {
                let filter = Arc::make_mut(filter);
                filter.semi_diameter = wider(filter.semi_diameter);
            }
            Self::Aperture(opening) => match Arc::make_mut(opening) {
                Opening::Circle { radius } => *radius = wider(*radius),
                Opening::Polygon { radius, apothem, .. } => {
                    let corner = *radius / *apothem;
                    *apothem = wider(*apothem);
                    *radius = if corner.is_finite() { corner * *apothem } else { *apothem };
                }
                Opening::Image(_) | Opening::Shaped(_) => return None,
            },
            Self::Filter(_)
            | Self::MicrolensArray(_)
            | Self::Mirror(_)
            | Self::Freeform(_)
            | Self::CoordinateBreak(_) => return None,
        }
        Some(own)
    }

    /// True if the part has no aberrations.
    #[must_use]
    pub fn is_ideal(&self) -> bool {
        match self {
            Self::Surface(_)
            | Self::Biconic(_)
            | Self::MicrolensArray(_)
            | Self::Mirror(_)
            | Self::Freeform(_)
            | Self::CoordinateBreak(_) => false,
            Self::ThinLens(_) | Self::Aperture(_) | Self::Filter(_) => true,
        }
    }

    /// True if the part is a plane at which only the change of media bends light.
    #[must_use]
    pub fn is_plane(&self) -> bool {
        match self {
            Self::Surface(surface) => surface.is_plane(),
            Self::Biconic(surface) => surface.curvature == [0.0; 2],
            Self::Aperture(_) | Self::Filter(_) => true,
            Self::ThinLens(_)
            | Self::MicrolensArray(_)
            | Self::Mirror(_)
            | Self::Freeform(_)
            | Self::CoordinateBreak(_) => false,
        }
    }

    /// The opening that it is, if it is nothing else.
    #[must_use]
    pub fn opening(&self) -> Option<&Opening> {
        match self {
            Self::Aperture(opening) => Some(opening),
            Self::Surface(_)
            | Self::Biconic(_)
            | Self::ThinLens(_)
            | Self::Filter(_)
            | Self::MicrolensArray(_)
            | Self::Mirror(_)
            | Self::Freeform(_)
            | Self::CoordinateBreak(_) => None,
        }
    }

    /// The greatest distance from its axis at which it exists (mm).
    #[must_use]
    pub fn domain(&self) -> f64 {
        match self {
            Self::Surface(surface) => surface.domain(),
            Self::Biconic(surface) => surface.domain(),
            Self::Mirror(mirror) => mirror.surface.domain(),
            Self::Freeform(surface) => surface.domain(),
            Self::ThinLens(_)
            | Self::Aperture(_)
            | Self::Filter(_)
            | Self::MicrolensArray(_)
            | Self::CoordinateBreak(_) => f64::INFINITY,
        }
    }

    /// z at a place across its axis (mm); `None` where it does not exist.
    #[must_use]
    pub fn sag(&self, [x, y]: [f64; 2]) -> Option<f64> {
        match self {
            Self::Surface(surface) => surface.sag((x * x + y * y).sqrt()),
            Self::Biconic(surface) => surface.sag([x, y]),
            Self::Mirror(mirror) => mirror.surface.sag((x * x + y * y).sqrt()),
            Self::Freeform(surface) => surface.sag([x, y]),
            Self::ThinLens(_)
            | Self::Aperture(_)
            | Self::Filter(_)
            | Self::MicrolensArray(_)
            | Self::CoordinateBreak(_) => Some(0.0),
        }
    }

    /// The length that tables give of it (mm): the radius of curvature at the vertex, or the focal
    /// length; infinite without any.
    #[must_use]
    pub fn radius(&self) -> f64 {
        match self {
            Self::Surface(surface) => 1.0 / surface.curvature,
            Self::Biconic(surface) => 1.0 / surface.curvature[1],
            Self::Mirror(mirror) => 1.0 / mirror.surface.curvature,
            Self::Freeform(surface) => 1.0 / surface.base_curvature(),
            Self::ThinLens(lens) => 1.0 / lens.power,
            Self::Aperture(_)
            | Self::Filter(_)
            | Self::MicrolensArray(_)
            | Self::CoordinateBreak(_) => f64::INFINITY,
        }
    }

    /// Words on how it differs from a sphere or a round hole.
    #[must_use]
    pub fn shape(&self) -> Vec<String> {
        match self {
            Self::Surface(surface) => surface.shape(),
            Self::Biconic(surface) => surface.shape(),
            Self::Freeform(surface) => surface.shape(),
            Self::Mirror(mirror) => {
                let hole = (mirror.mount.hole > 0.0)
                    .then(|| format!("hole of radius {} mm", mirror.mount.hole));
                mirror.surface.shape().into_iter().chain(hole).collect()
            }
            Self::Aperture(opening) => opening.shape().into_iter().collect(),
            Self::MicrolensArray(array) => {
                let [width, height] = array.half_size.map(|half| 2.0 * half);
                let pitch = array.lattice.pitch;
                let [pitch, width, height] = [pitch, width, height].map(significant);
                vec![format!("lenslets every {pitch} mm on {width} x {height} mm")]
            }
            Self::CoordinateBreak(_) => vec!["the axis runs elsewhere behind it".to_owned()],
            Self::ThinLens(_) | Self::Filter(_) => Vec::new(),
        }
    }

    /// Drawing symbol of the part.
    #[must_use]
    pub fn symbol(&self) -> Symbol {
        match self {
            Self::Surface(_) | Self::Biconic(_) | Self::Mirror(_) | Self::Freeform(_) => {
                Symbol::Surface
            }
            Self::ThinLens(lens) => Symbol::ThinLens { converging: lens.power.signum() },
            Self::Aperture(_) => Symbol::Opening,
            Self::Filter(_) | Self::MicrolensArray(_) => Symbol::Sheet,
            Self::CoordinateBreak(_) => Symbol::Nothing,
        }
    }

    /// True if a turn about its axis changes nothing.
    #[must_use]
    pub fn is_round(&self) -> bool {
        match self {
            Self::Surface(_) | Self::ThinLens(_) | Self::Mirror(_) => true,
            Self::Freeform(surface) => surface.is_round(),
            Self::Biconic(surface) => surface.is_round(),
            Self::Aperture(opening) => opening.is_round(),
            Self::Filter(filter) => filter.is_uniform(),
            Self::MicrolensArray(_) | Self::CoordinateBreak(_) => false,
        }
    }

    /// The curves that its filters have.
    #[must_use]
    pub fn curves(&self) -> &[Curve] {
        match self {
            Self::Filter(filter) => &filter.curves,
            Self::MicrolensArray(array) => &array.curves,
            Self::Mirror(_) | Self::Freeform(_) => {
                self.mirror().map_or(&[], |mirror| mirror.reflectance.as_slice())
            }
            Self::Surface(_)
            | Self::Biconic(_)
            | Self::ThinLens(_)
            | Self::Aperture(_)
            | Self::CoordinateBreak(_) => &[],
        }
    }

    /// The curve of all of its light, when it dims all places alike.
    #[must_use]
    pub fn uniform_curve(&self) -> Option<&Curve> {
        match self {
            Self::Filter(filter) if filter.is_uniform() => filter.curves.first(),
            Self::MicrolensArray(array) if array.gaps == Gaps::Opaque => match &array.curves[..] {
                [one] => Some(one),
                _ => None,
            },
            Self::Mirror(_) | Self::Freeform(_) => {
                self.mirror().and_then(|mirror| mirror.reflectance.as_ref())
            }
            Self::Surface(_)
            | Self::Biconic(_)
            | Self::ThinLens(_)
            | Self::Aperture(_)
            | Self::Filter(_)
            | Self::MicrolensArray(_)
            | Self::CoordinateBreak(_) => None,
        }
    }

    /// True if a mirror's coating or an order of diffraction loses light, by angle or wavelength.
    #[must_use]
    pub fn is_coated_or_blazed(&self) -> bool {
        let is_blazed = matches!(self, Self::Freeform(surface) if surface.is_blazed());
        is_blazed || self.mirror().is_some_and(|mirror| mirror.coating.is_some())
    }

    /// Returns the part with its mirror, if it has one, altered by `change`.
    pub(crate) fn with_mirror(&self, change: impl Fn(&mut MirrorMount)) -> Self {
        let mut part = self.clone();
        match &mut part {
            Self::Mirror(mirror) => change(&mut mirror.mount),
            Self::Freeform(surface) => Arc::make_mut(surface).mirror.iter_mut().for_each(change),
            Self::Surface(_)
            | Self::Biconic(_)
            | Self::ThinLens(_)
            | Self::Aperture(_)
            | Self::Filter(_)
            | Self::MicrolensArray(_)
            | Self::CoordinateBreak(_) => {}
        }
        part
    }

    /// The mirror's own, where it is one.
    #[must_use]
    pub fn mirror(&self) -> Option<&MirrorMount> {
        match self {
            Self::Mirror(mirror) => Some(&mirror.mount),
            Self::Freeform(surface) => surface.mirror.as_ref(),
            Self::Surface(_)
            | Self::Biconic(_)
            | Self::ThinLens(_)
            | Self::Aperture(_)
            | Self::Filter(_)
            | Self::MicrolensArray(_)
            | Self::CoordinateBreak(_) => None,
        }
    }
}
