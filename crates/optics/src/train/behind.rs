//! Properties behind an element of a lens file: a gradient of its glass, or an axis that breaks.

use super::file::{WHOLE_TURN, along};
use super::folds::{self, Isometry};
use super::{Element, LensError, LensFile};
use crate::element::{
    BiconicSpec, CoordinateBreak, CoordinateBreakSpec, FreeformSpec, Gradient, Mount, PartSpec,
    SurfaceSpec,
};
use crate::glass::Glass;

impl LensFile {
    /// Axis behind a break at z (mm), in the direction of the light.
    pub(super) fn axis_behind(
        &self,
        index: usize,
        broken: &CoordinateBreakSpec,
        z: f64,
        sense: f64,
        before: &[Element],
    ) -> Result<CoordinateBreak, String> {
        let mount = &self.elements[index].mount;
        if mount.stop {
            return Err(
                "a coordinate_break stops nothing; mark another element as the stop".to_owned()
            );
        }
        let tilt = mount.tilt.map(|angle| along(sense, angle.0));
        let decentre = mount.decentre.map(|length| length.0);
        if broken.rotation.0.is_nan() || broken.rotation.0.abs() > WHOLE_TURN {
            return Err(format!(
                "rotation is {} degrees; an angle lies between -360 and 360",
                broken.rotation.0
            ));
        }
        let Some(to) = broken.return_to else { return Ok(broken.build(tilt, decentre)) };
        let bare = Mount { thickness: mount.thickness, ..Mount::default() };
        let alone = CoordinateBreakSpec { return_to: Some(to), ..CoordinateBreakSpec::default() };
        if *mount != bare || *broken != alone {
            return Err("give either return_to, or tilt, rotation and decentre".to_owned());
        }
        if to >= index {
            return Err(format!("return_to is {to}; it must be an element before this one"));
        }
        let spaces = folds::built(before);
        let there = spaces[to].after(&Isometry::along(before[to].frame.vertex.z - z));
        spaces[index].inverse().after(&there).to_break(z).ok_or_else(|| {
            format!(
                "return_to is {to}, and an odd number of mirrors stands between; write the turns"
            )
        })
    }

    /// The gradient behind an element, if it has one.
    pub(super) fn gradient(
        &self,
        index: usize,
        medium: &Glass,
        wavelength: f64,
    ) -> Result<Option<Gradient>, LensError> {
        let Some(gradient) = &self.elements[index].mount.gradient else { return Ok(None) };
        let error = |why: String| LensError::Element { index, why };
        let (PartSpec::Surface(SurfaceSpec { semi_diameter, .. })
        | PartSpec::Biconic(BiconicSpec { semi_diameter, .. })
        | PartSpec::Freeform(FreeformSpec { semi_diameter, mirror: false, .. })) =
            &self.elements[index].part
        else {
            let why = "a gradient is that of the glass behind a surface, a biconic or a freeform; \
                       write it there";
            return Err(error(why.to_owned()));
        };
        let rim = semi_diameter.map_or(f64::INFINITY, |length| length.0);
        let base = medium.index(wavelength).map_err(|source| LensError::Glass { index, source })?;
        // Up to the surface that ends it, past sheets.
        let behind = self.elements[index + 1..].iter();
        let end = { behind }
            .position(|spec| !matches!(spec.part, PartSpec::Aperture(_) | PartSpec::Filter(_)));
        let Some(end) = end.map(|end| index + 1 + end) else {
            let why = "a gradient ends at a surface; add the one behind it";
            return Err(error(why.to_owned()));
        };
        for at in [index, end] {
            let bends = match &self.elements[at].part {
                PartSpec::Surface(_) | PartSpec::Biconic(_) => true,
                PartSpec::Freeform(surface) => !surface.mirror && surface.phase.is_none(),
                PartSpec::ThinLens(_)
                | PartSpec::Aperture(_)
                | PartSpec::Filter(_)
                | PartSpec::MicrolensArray(_)
                | PartSpec::Mirror(_)
                | PartSpec::CoordinateBreak(_) => false,
            };
            if !bends {
                return Err(error(format!(
                    "a gradient lies between surfaces without a phase, and elements[{at}] is none; put glass without a \
                     gradient between"
                )));
            }
        }
        let thickness = self.elements[index..end].iter().map(|spec| spec.mount.thickness.0).sum();
        gradient.build(rim, base, thickness).map(Some).map_err(error)
    }
}
