//! A surface of any shape: a base of revolution or a toroid, what is added to its sag, a phase, and a mirror or glass
//! behind it.
//!
//! | module | idea |
//! |---|---|
//! | `terms` | Zernike, Chebyshev and Q polynomials, height maps |
//! | `grid` | pictures as smooth surfaces |
//! | `phase` | gratings, kinoforms, phase masks |
//! | `surface` | what the search for a ray's crossing asks, at a wavelength |
//!
//! # Bases
//!
//! z = c r² / (1 + √(1 − (1 + k) c² r²)) + Σ Aₚ rᵖ, p from 1 to 30. With a radius of rotation R a toroid: the same with y
//! in place of r, turned about an axis parallel to y at a distance R from the vertex (Zemax' `TOROIDAL`); a
//! cylinder is a toroid of infinite R, or a `biconic`.
//!
//! # Fresnel surfaces
//!
//! An ideal one lies in its plane and bends light as the facets would that have the slopes of the sag (Zemax'
//! `FRESNELS`); steps between facets cost no light.
//!
//! Rays are met by [Newton's method](super::newton), side by side or one by one, from where they meet the base's conic or
//! the plane.

mod grid;
mod phase;
mod surface;
mod terms;

use std::collections::BTreeMap;

use etendue_geometry::units::Millimetres;
use etendue_spectrum::Curve;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::phase::PhaseProfile;
use self::terms::Term;
use super::Resolve;
use super::mirror::MirrorMount;
use super::real::{Dual, Real};
use super::surface::{Surface, checked_semi_diameter, vertex_curvature};
use crate::glass::GlassSpec;

pub use grid::HeightMapSpec;
pub use phase::{PatternSpec, PhaseSpec};
pub(crate) use surface::FreeformSurface;
pub use terms::SagSpec;

/// The highest power of r that a base may have.
const HIGHEST_POWER: u32 = 30;

/// A surface of any shape as a lens file writes it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FreeformSpec {
    /// Radius of curvature (mm), positive when its centre lies at greater z. A flat base has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius: Option<Millimetres>,
    /// 1/radius (1/mm), instead of the radius; 0 is flat.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub curvature: Option<f64>,
    /// Medium behind the surface, on the sensor's side; air when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub glass: Option<GlassSpec>,
    /// Half the clear diameter (mm): rays farther from the axis are stopped. Unlimited when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub semi_diameter: Option<Millimetres>,
    /// The conic constant: 0 a sphere, −1 a paraboloid.
    #[serde(skip_serializing_if = "super::is_default")]
    pub conic: f64,
    /// Coefficients by their power of r, 1 to 30, odd ones too (mm to 1 − power); of y on a toroid.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub aspheric: BTreeMap<String, f64>,
    /// Makes a toroid: the radius of the circle (mm) on which the section along y goes along x, positive when its
    /// centre lies at greater z; 0 for a cylinder, that goes straight.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation_radius: Option<Millimetres>,
    /// Terms that are added to the base.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sag: Vec<SagSpec>,
    /// True if it is a Fresnel surface: a plane that bends light by the slopes of the sag.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub fresnel: bool,
    /// A phase that it adds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phase: Option<PhaseSpec>,
    /// True if it is a mirror; `thickness` behind one runs against the light before it.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub mirror: bool,
    /// Of a mirror: the radius of a hole in its middle (mm).
    #[serde(skip_serializing_if = "super::is_default")]
    pub hole: Millimetres,
    /// Of a mirror: whether its tilt folds the axis.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub fold: bool,
    /// Of a mirror: the share of light that it reflects (0..=1) by wavelength; all of it when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reflectance: Option<Curve>,
}

/// A surface of any shape in its own frame (mm), as light that runs along +z meets it.
#[derive(Debug, Clone, PartialEq)]
pub struct Freeform {
    /// The base's section: curvature and conic constant.
    base: Surface,
    /// Coefficients A₁, A₂, … of powers of r.
    powers: Vec<f64>,
    /// 1/R of a toroid (1/mm).
    rotation: Option<f64>,
    terms: Vec<Term>,
    is_fresnel: bool,
    phase: Option<PhaseProfile>,
    /// −1 where light runs against the axis.
    sense: f64,
    /// Half the clear diameter (mm); infinite when unlimited.
    pub semi_diameter: f64,
    /// Properties as a mirror; `None` for a surface that is none.
    pub mirror: Option<MirrorMount>,
}

impl FreeformSpec {
    /// The surface.
    ///
    /// # Errors
    ///
    /// A sentence on the first number or file that describes no surface.
    pub fn build(&self, resolve: Resolve<'_>) -> Result<Freeform, String> {
        let semi_diameter = checked_semi_diameter(self.semi_diameter)?;
        if !self.conic.is_finite() {
            return Err("conic must be finite".to_owned());
        }
        let curvature = vertex_curvature(self.radius, self.curvature)?;
        let rotation = match self.rotation_radius {
            None => None,
            Some(Millimetres(0.0)) => Some(0.0),
            Some(radius) => Some(
                vertex_curvature(Some(radius), None)
                    .map_err(|why| format!("rotation_radius: {why}"))?,
            ),
        };
        let terms = self.sag.iter().enumerate().map(|(i, sag)| {
            sag.build(curvature, resolve).map_err(|why| format!("sag[{i}]: {why}"))
        });
        Ok(Freeform {
            base: Surface { conic: self.conic, ..Surface::sphere(curvature) },
            powers: self.powers()?,
            rotation,
            terms: terms.collect::<Result<_, _>>()?,
            is_fresnel: self.fresnel,
            phase: self.phase.as_ref().map(|phase| phase.build(resolve)).transpose()?,
            sense: 1.0,
            semi_diameter,
            mirror: self.mirror_mount(semi_diameter)?,
        })
    }

    fn mirror_mount(&self, semi_diameter: f64) -> Result<Option<MirrorMount>, String> {
        if self.mirror {
            if self.glass.is_some() {
                return Err(
                    "a mirror has no glass behind it: leave out glass, or mirror".to_owned()
                );
            }
            let mount =
                MirrorMount::build(self.hole, self.fold, self.reflectance.as_ref(), semi_diameter)?;
            return Ok(Some(mount));
        }
        let given = [
            (self.hole.0 != 0.0, "hole"),
            (self.fold, "fold"),
            (self.reflectance.is_some(), "reflectance"),
        ];
        match given.iter().find(|given| given.0) {
            Some((_, key)) => {
                Err(format!("{key} is for mirrors: write \"mirror\": true, or leave it out"))
            }
            None => Ok(None),
        }
    }

    fn powers(&self) -> Result<Vec<f64>, String> {
        let mut powers = Vec::new();
        for (key, &value) in &self.aspheric {
            let power = key.parse::<u32>().ok().filter(|p| (1..=HIGHEST_POWER).contains(p));
            let Some(power) = power else {
                return Err(format!(
                    "aspheric has the power \"{key}\"; powers are whole numbers from 1 to {HIGHEST_POWER}"
                ));
            };
            if !value.is_finite() {
                return Err(format!("aspheric \"{key}\" must be finite"));
            }
            let slot = power as usize - 1;
            powers.resize(powers.len().max(slot + 1), 0.0);
            powers[slot] = value;
        }
        Ok(powers)
    }
}

impl Freeform {
    /// Returns the surface as seen by light that runs against the axis.
    #[must_use]
    pub fn flipped(&self) -> Self {
        Self { sense: -self.sense, ..self.clone() }
    }

    /// Curvature of the base at the vertex, as light that runs along +z meets it (1/mm).
    #[must_use]
    pub fn base_curvature(&self) -> f64 {
        self.sense * self.base.curvature
    }

    /// The curvature of its section along y at the vertex (1/mm): c + 2 A₂, and what is added to them.
    #[must_use]
    pub fn paraxial_curvature(&self) -> f64 {
        let square = self.powers.get(1).unwrap_or(&0.0);
        let zero = Dual::<Dual<f64>>::constant(0.0);
        let added = self.terms.iter().fold(zero, |sum, term| sum + term.at(vertex()));
        self.sense * (self.base.curvature + 2.0 * square + added.d[1].d[1])
    }

    /// The power of its phase along y (1/mm) at a wavelength (nm).
    #[must_use]
    pub fn phase_power(&self, wavelength: f64) -> f64 {
        self.phase.as_ref().map_or(0.0, |phase| {
            let second = phase.at::<Dual<Dual<f64>>>(vertex()).d[1].d[1];
            -phase.path_per_radian(wavelength) * second
        })
    }

    /// True if its diffraction order has a share of the light of its own.
    #[must_use]
    pub fn is_blazed(&self) -> bool {
        self.phase.as_ref().is_some_and(|phase| phase.blaze.is_some())
    }

    /// Has all light go into its order.
    pub(crate) fn lose_no_light(&mut self) {
        if let Some(phase) = &mut self.phase {
            phase.blaze = None;
        }
    }

    /// The share of light in the order of its phase at a wavelength (nm).
    #[must_use]
    pub fn efficiency(&self, wavelength: f64) -> f64 {
        self.phase.as_ref().map_or(1.0, |phase| phase.efficiency(wavelength))
    }

    /// True if its phase sends different wavelengths in different directions.
    #[must_use]
    pub fn is_dispersive(&self) -> bool {
        self.phase.as_ref().is_some_and(PhaseProfile::is_dispersive)
    }

    /// True if a turn about its axis changes nothing.
    #[must_use]
    pub fn is_round(&self) -> bool {
        self.rotation.is_none()
            && self.terms.iter().all(Term::is_round)
            && self.phase.as_ref().is_none_or(PhaseProfile::is_round)
    }

    /// True if rays meet the surface in a plane: it has no sag, or that of the grooves of a Fresnel
    /// surface.
    fn is_in_a_plane(&self) -> bool {
        let has_sag = self.base.curvature != 0.0
            || self.rotation.is_some_and(|rotation| rotation != 0.0)
            || !self.powers.is_empty()
            || !self.terms.is_empty();
        self.is_fresnel || !has_sag
    }

    /// The distance from the axis up to which it exists all around (mm).
    #[must_use]
    pub fn domain(&self) -> f64 {
        let [x, y] = self.half_size();
        let rotation = self.rotation.map_or(f64::INFINITY, |c| (1.0 / c).abs());
        self.base.domain().min(rotation).min(x).min(y)
    }

    /// Half the sizes of what is known by pictures (mm).
    fn half_size(&self) -> [f64; 2] {
        let phase = self.phase.iter().map(PhaseProfile::half_size);
        let sizes = self.terms.iter().map(Term::half_size).chain(phase);
        sizes.fold([f64::INFINITY; 2], |[x, y], [w, h]| [x.min(w), y.min(h)])
    }

    /// z at a place across the axis (mm), in the plane for a Fresnel surface; `None` where it does not exist.
    #[must_use]
    pub fn sag(&self, place: [f64; 2]) -> Option<f64> {
        let sag = if self.is_fresnel { 0.0 } else { self.height(place) };
        (self.holds(place) && sag.is_finite()).then_some(sag)
    }

    /// Words on how it differs from a sphere.
    pub(super) fn shape(&self) -> Vec<String> {
        let conic = (self.base.conic != 0.0).then(|| format!("conic {}", self.base.conic));
        let powers =
            (!self.powers.is_empty()).then(|| format!("aspheric to r^{}", self.powers.len()));
        let toroid = self.rotation.map(|c| match c {
            0.0 => "cylinder along x".to_owned(),
            c => format!("toroid about {} mm", 1.0 / c),
        });
        let fresnel = self.is_fresnel.then(|| "Fresnel".to_owned());
        let terms = self.terms.iter().map(|term| term.word().to_owned());
        let phase = self.phase.iter().map(PhaseProfile::word);
        conic
            .into_iter()
            .chain(powers)
            .chain(toroid)
            .chain(fresnel)
            .chain(terms)
            .chain(phase)
            .collect()
    }

    /// The sag (mm), in any number; beyond the domain of the base as at its edge.
    fn height<T: Real>(&self, [x, y]: [T; 2]) -> T {
        let one = T::constant(1.0);
        let mut sag = self.section([x, y]);
        if let Some(rotation) = self.rotation {
            // κ = 1/(R − f): the curvature of the circle on which this height goes along x.
            let bend = T::constant(rotation) / (one - sag.times(rotation));
            let across = bend * x;
            let root = (one - across * across).at_least(1e-24).root();
            sag = sag + across * x / (one + root);
        }
        let sag = self.terms.iter().fold(sag, |sum, term| sum + term.at([x, y]));
        sag.times(self.sense)
    }

    /// The base (mm): of revolution, or the section along y of a toroid.
    fn section<T: Real>(&self, [x, y]: [T; 2]) -> T {
        let one = T::constant(1.0);
        let (c, k) = (self.base.curvature, self.base.conic);
        let square = if self.rotation.is_some() { y * y } else { x * x + y * y };
        let root = (one - square.times((1.0 + k) * c * c)).at_least(1e-24).root();
        let mut sag = square.times(c) / (one + root);
        if !self.powers.is_empty() {
            // Odd powers by the distance itself, which has no derivative at 0.
            let mut odd = T::constant(0.0);
            let mut even = T::constant(0.0);
            for (i, &a) in self.powers.iter().enumerate().rev() {
                if i % 2 == 0 {
                    odd = odd * square + T::constant(a);
                } else {
                    even = (even + T::constant(a)) * square;
                }
            }
            sag = sag + even + odd * square.root();
        }
        sag
    }

    fn holds(&self, [x, y]: [f64; 2]) -> bool {
        let [width, height] = self.half_size();
        let square = if self.rotation.is_some() { y * y } else { x * x + y * y };
        let (c, k) = (self.base.curvature, self.base.conic);
        let on_circle = self.rotation.is_none_or(|rotation| {
            let bend = rotation / (1.0 - self.section([0.0, y]) * rotation);
            (bend * x).abs() <= 1.0
        });
        (1.0 + k) * c * c * square <= 1.0 && x.abs() <= width && y.abs() <= height && on_circle
    }

    /// The sag and its slopes along x and y.
    fn sag_and_slopes<T: Real>(&self, place: [T; 2]) -> (T, [T; 2]) {
        let sag = self.height(Dual::place(place));
        (sag.v, sag.d)
    }
}

/// The vertex, with second derivatives.
fn vertex() -> [Dual<Dual<f64>>; 2] {
    let [x, y] = Dual::place([0.0, 0.0]);
    Dual::place([x, y])
}

#[cfg(test)]
mod tests;
