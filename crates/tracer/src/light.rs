//! The lights of a scene, and how one of them is chosen for a point.
//!
//! A light is chosen by its power (W, of the mean of the three colours), a triangle of an emissive
//! mesh by its own: `π A L` for one side. Lights far away are counted by what falls onto the scene's
//! sphere of radius R: `π R² E` for parallel light, `4 π² R² L` for an environment.

use std::f64::consts::PI;
use std::sync::Arc;

use etendue_geometry::glam::DVec3;
use etendue_spectrum::{Illuminant, NoOverlap};

use crate::environment::{EnvironmentMap, MapSampler};
use crate::lamps::{self, AreaLight, EmissiveTriangle, triangle_power};
use crate::reference::{SceneView, SurfacePoint};
use crate::sampling::{DiscreteDistribution, sphere_direction, triangle_point};
use crate::spawn::Anchor;
use crate::spectral::Spectral;
use crate::{Color, Material};

/// A light of the scene, beside its emissive surfaces.
#[derive(Debug, Clone, PartialEq)]
pub struct Light {
    /// Where the light goes.
    pub kind: LightKind,
    /// Radiant intensity, irradiance or radiance, by the kind: linear RGB.
    pub color: Color,
    /// The spectrum that the colour multiplies; equal energy when absent.
    pub illuminant: Option<Illuminant>,
}

impl Light {
    /// What lights a model that brings no light of its own.
    pub const STUDIO: Self = Self {
        kind: LightKind::Environment { image: EnvironmentImage::Studio, rotation: 0.0 },
        color: [1.0; 3],
        illuminant: None,
    };

    /// The file of an environment's image.
    #[must_use]
    pub fn file(&self) -> Option<&std::path::PathBuf> {
        match &self.kind {
            LightKind::Environment { image: EnvironmentImage::File(path), .. } => Some(path),
            _ => None,
        }
    }
}

/// The kinds of lights.
#[derive(Debug, Clone, PartialEq)]
pub enum LightKind {
    /// A point (m) with an intensity.
    Point(DVec3),
    /// A point (m) with an intensity in a cone.
    Spot {
        /// Where it is (m).
        at: DVec3,
        /// Where it is aimed (unit).
        axis: DVec3,
        /// Cosine of the half-angle outside of which it is dark.
        cos_outer: f64,
        /// Cosine of the half-angle inside of which it is at its full.
        cos_inner: f64,
    },
    /// Parallel light that goes along this unit vector, with an irradiance.
    Directional(DVec3),
    /// Radiance from all around.
    Environment {
        /// Its image.
        image: EnvironmentImage,
        /// Turn about +Y (radians).
        rotation: f64,
    },
}

/// Where an environment's image comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum EnvironmentImage {
    /// There is none: alike from all sides.
    Constant,
    /// The one that lights models without a light ([`EnvironmentMap::studio`]).
    Studio,
    /// A file.
    File(std::path::PathBuf),
}

/// glTF's fall-off between a spot light's cones (`KHR_lights_punctual`): the square of the share.
fn spot_falloff(cosine: f64, cos_outer: f64, cos_inner: f64) -> f64 {
    if cosine >= cos_inner {
        return 1.0;
    }
    let share = ((cosine - cos_outer) / (cos_inner - cos_outer)).clamp(0.0, 1.0);
    share * share
}

/// A point's view of one light.
#[derive(Debug, Clone, Copy)]
pub struct LightSample {
    /// From the point to the light (unit).
    pub direction: DVec3,
    /// Density (1/sr) times the light's chance; of a light that is a point, its chance alone.
    pub pdf: f64,
    /// The light can be met by a direction in no other way.
    pub is_delta: bool,
    /// Where the light is (m); a surface knows how exactly. `None` far away.
    pub end: End,
}

/// Where a ray to a light ends.
#[derive(Debug, Clone, Copy)]
pub enum End {
    /// Nowhere.
    Far,
    /// At a point (m).
    Point(DVec3),
    /// On a triangle of a placement.
    Surface(Anchor, [u32; 2]),
}

/// All lights of a scene, ready to be chosen from.
#[derive(Debug)]
pub struct Lights {
    lights: Vec<Light>,
    /// The bands of each light, one light after the other.
    bands: Vec<f64>,
    environment: Option<Environment>,
    /// The bands by which each material's emission is multiplied, where it has an illuminant.
    tints: Vec<Option<Vec<f64>>>,
    /// For each placement, where its triangles start among the choices.
    first: Vec<Option<u32>>,
    /// Placement and triangle of each emissive triangle, behind the lights.
    triangles: Vec<[u32; 2]>,
    picker: DiscreteDistribution,
    /// The emissive triangles, where there are no other lights and each shines alike all over, and
    /// what they give off in all bands.
    lamps: Vec<AreaLight>,
    lamp_bands: Vec<f64>,
}

#[derive(Debug)]
struct Environment {
    index: usize,
    map: Option<(Arc<EnvironmentMap>, MapSampler)>,
    rotation: f64,
}

impl Environment {
    fn turned(&self, d: DVec3, sign: f64) -> DVec3 {
        let (sin, cos) = (sign * self.rotation).sin_cos();
        DVec3::new(cos * d.x + sin * d.z, d.y, -sin * d.x + cos * d.z)
    }

    /// In the map's frame.
    fn local(&self, d: DVec3) -> DVec3 {
        self.turned(d, -1.0)
    }

    fn world(&self, d: DVec3) -> DVec3 {
        self.turned(d, 1.0)
    }
}

impl Lights {
    /// The lights of a scene whose emissive surfaces are those of `around`; `map` is the decoded
    /// image of the environment, if it has one.
    ///
    /// # Errors
    ///
    /// When an illuminant is known at no wavelength of the bands.
    pub fn new(
        lights: &[Light],
        map: Option<Arc<EnvironmentMap>>,
        around: &SceneView<'_>,
        spectral: &Spectral,
    ) -> Result<Self, NoOverlap> {
        let count = spectral.count();
        let mut bands = vec![0.0; lights.len() * count];
        for (light, bands) in lights.iter().zip(bands.chunks_mut(count)) {
            spectral.spread(&light.color, bands);
            if let Some(illuminant) = light.illuminant {
                let tint = spectral.illuminant(illuminant)?;
                bands.iter_mut().zip(&tint).for_each(|(band, tint)| *band *= tint);
            }
        }
        let environment = lights.iter().enumerate().find_map(|(index, light)| match light.kind {
            LightKind::Environment { rotation, .. } => {
                let sampled = map.clone().map(|map| {
                    let sampler = MapSampler::new(&map);
                    (map, sampler)
                });
                Some(Environment { index, map: sampled, rotation })
            }
            _ => None,
        });
        let radius = 0.5 * around.geometry.loose_bounds().diagonal();
        let far = if radius > 0.0 { PI * radius * radius } else { PI };
        let mut powers: Vec<f64> =
            lights.iter().map(|light| power(light, far, environment.as_ref())).collect();
        let mut first = Vec::with_capacity(around.geometry.placements.len());
        let mut triangles = Vec::new();
        for (number, placement) in (0_u32..).zip(&around.geometry.placements) {
            let material = around.materials.get(placement.material as usize);
            let emits = material.is_some_and(|m| m.emission.is_some());
            first.push(if emits { u32::try_from(powers.len()).ok() } else { None });
            let Some(material) = material.filter(|_| emits) else { continue };
            let mesh = around.geometry.mesh_of(placement);
            for triangle in 0..mesh.triangles.len() {
                powers.push(triangle_power(around, placement, triangle, material));
                triangles.push([number, u32::try_from(triangle).unwrap_or(u32::MAX)]);
            }
        }
        let tint = |material: &Material| -> Result<Option<Vec<f64>>, NoOverlap> {
            match material.emission.as_ref().and_then(|e| e.illuminant) {
                Some(illuminant) => spectral.illuminant(illuminant).map(Some),
                None => Ok(None),
            }
        };
        let tints = around.materials.iter().map(tint).collect::<Result<_, _>>()?;
        let lit = powers.iter().any(|&p| p > 0.0);
        let picker =
            if lit { DiscreteDistribution::new(&powers) } else { DiscreteDistribution::default() };
        let lights = lights.to_vec();
        let (lamps, lamp_bands) = Default::default();
        let mut all =
            Self { lights, bands, environment, tints, first, triangles, picker, lamps, lamp_bands };
        all.light_lamps(around, spectral);
        Ok(all)
    }

    /// Keeps emissive triangles ready, if all that there is to choose from is of that kind.
    fn light_lamps(&mut self, around: &SceneView<'_>, spectral: &Spectral) {
        if !self.lights.is_empty() || self.is_dark() || self.triangles.len() > lamps::MOST {
            return;
        }
        let lamps: Option<Vec<AreaLight>> =
            self.triangles.iter().map(|&id| AreaLight::new(around, id)).collect();
        let Some(lamps) = lamps else { return };
        let count = spectral.count();
        let mut bands = vec![0.0; lamps.len() * count];
        for (lamp, bands) in lamps.iter().zip(bands.chunks_mut(count)) {
            let placement = &around.geometry.placements[lamp.id[0] as usize];
            let spot = SurfacePoint::corner(around.geometry, placement, lamp.id[1] as usize);
            self.emitted(around, spectral, &spot, true, bands);
        }
        (self.lamps, self.lamp_bands) = (lamps, bands);
    }

    /// The lamp for `choice`: its number, itself and its chance; `None` where lights have to be asked
    /// one by one.
    pub(crate) fn lamp(&self, choice: f64) -> Option<(usize, &AreaLight, f64)> {
        if self.lamps.is_empty() {
            return None;
        }
        let (index, _) = self.picker.pick(choice);
        Some((index, &self.lamps[index], self.picker.probability(index)))
    }

    /// What a lamp gives off in `count` bands.
    pub(crate) fn bands_of_lamp(&self, lamp: usize, count: usize) -> &[f64] {
        &self.lamp_bands[lamp * count..(lamp + 1) * count]
    }

    /// Whether [`Self::lamp`] has one.
    pub(crate) fn has_lamps(&self) -> bool {
        !self.lamps.is_empty()
    }

    /// Whether there is nothing to choose from.
    #[must_use]
    pub fn is_dark(&self) -> bool {
        self.picker.is_empty()
    }

    /// Whether a ray that nobody aimed may come upon a light: not upon points and parallel light.
    #[must_use]
    pub fn is_hittable(&self) -> bool {
        self.environment.is_some() || !self.triangles.is_empty()
    }

    /// Whether there is more than one to choose from.
    #[must_use]
    pub fn are_several(&self) -> bool {
        self.picker.len() > 1
    }

    /// Whether light comes from where nothing is.
    #[must_use]
    pub fn has_environment(&self) -> bool {
        self.environment.is_some()
    }

    /// The only light there is, when that is a point (m), with its intensity in `count` bands.
    pub(crate) fn lone_point(&self, count: usize) -> Option<(DVec3, &[f64])> {
        match self.lights[..] {
            [Light { kind: LightKind::Point(at), .. }] if self.picker.len() == 1 => {
                Some((at, self.bands_of(0, count)))
            }
            _ => None,
        }
    }

    /// How many emissive triangles there are.
    #[must_use]
    pub fn emissive_triangles(&self) -> usize {
        self.triangles.len()
    }

    fn bands_of(&self, light: usize, count: usize) -> &[f64] {
        &self.bands[light * count..(light + 1) * count]
    }

    /// Chooses a light for `from` by `choice` and a direction to it by `square` (in 0..1); its
    /// radiance (of a point: intensity over squared distance) goes to `radiance`. `None` when it does
    /// not shine there.
    pub fn sample(
        &self,
        around: &SceneView<'_>,
        spectral: &Spectral,
        from: &Anchor,
        choice: f64,
        square: [f64; 2],
        radiance: &mut [f64],
    ) -> Option<LightSample> {
        if self.picker.is_empty() {
            return None;
        }
        let (index, _) = self.picker.pick(choice);
        let chance = self.picker.probability(index);
        let Some(light) = self.lights.get(index) else {
            let [placement, triangle] = self.triangles[index - self.lights.len()];
            let place = EmissiveTriangle::new(around, placement, triangle, from.point)?;
            return self.toward_triangle(around, spectral, from, &place, square, chance, radiance);
        };
        radiance.copy_from_slice(self.bands_of(index, radiance.len()));
        let point = |at: DVec3, factor: f64, radiance: &mut [f64]| {
            let offset = at - from.point;
            let squared = offset.length_squared();
            let direction = offset.try_normalize()?;
            radiance.iter_mut().for_each(|band| *band *= factor / squared);
            Some(LightSample { direction, pdf: chance, is_delta: true, end: End::Point(at) })
        };
        match light.kind {
            LightKind::Point(at) => point(at, 1.0, radiance),
            LightKind::Spot { at, axis, cos_outer, cos_inner } => {
                let cosine = (from.point - at).try_normalize()?.dot(axis);
                let factor = spot_falloff(cosine, cos_outer, cos_inner);
                if factor > 0.0 { point(at, factor, radiance) } else { None }
            }
            LightKind::Directional(along) => {
                Some(LightSample { direction: -along, pdf: chance, is_delta: true, end: End::Far })
            }
            LightKind::Environment { .. } => {
                let environment = self.environment.as_ref()?;
                let (direction, pdf) = match &environment.map {
                    Some((_, sampler)) => {
                        let (local, pdf) = sampler.sample(square);
                        (environment.world(local), pdf)
                    }
                    None => (sphere_direction(square), 0.25 / PI),
                };
                if pdf <= 0.0 {
                    return None;
                }
                self.environment(spectral, direction, radiance);
                let pdf = pdf * chance;
                Some(LightSample { direction, pdf, is_delta: false, end: End::Far })
            }
        }
    }

    #[expect(clippy::too_many_arguments, reason = "one step of `sample`, taken out to be read")]
    fn toward_triangle(
        &self,
        around: &SceneView<'_>,
        spectral: &Spectral,
        from: &Anchor,
        place: &EmissiveTriangle<'_>,
        square: [f64; 2],
        chance: f64,
        radiance: &mut [f64],
    ) -> Option<LightSample> {
        let [u, v] = triangle_point(square);
        let offset = place.corner + place.shape.edges[0] * u + place.shape.edges[1] * v;
        let direction = offset.try_normalize()?;
        let spot = SurfacePoint { weights: [1.0 - u - v, u, v], ..place.spot };
        let facing = -direction.dot(place.shape.normal);
        if !self.emitted(around, spectral, &spot, facing > 0.0, radiance) {
            return None;
        }
        let pdf = chance * offset.length_squared() / (facing.abs() * place.shape.area);
        let end = Anchor::new(
            from.point + offset,
            place.shape.normal,
            from.point,
            spot.placement,
            spot.mesh,
        );
        pdf.is_finite().then_some(LightSample {
            direction,
            pdf,
            is_delta: false,
            end: End::Surface(end, place.id),
        })
    }

    /// Radiance that a surface gives off to its front or back; `false` when it is dark.
    pub fn emitted(
        &self,
        around: &SceneView<'_>,
        spectral: &Spectral,
        spot: &SurfacePoint<'_>,
        front: bool,
        radiance: &mut [f64],
    ) -> bool {
        let number = spot.placement.material as usize;
        let emission = around.materials.get(number).and_then(|m| m.emission.as_ref());
        let Some(emission) = emission.filter(|e| front || e.two_sided) else { return false };
        let [r, g, b, _] = around.paint(&emission.radiance, spot);
        spectral.spread(&[r, g, b].map(|c| c * emission.strength), radiance);
        if let Some(tint) = &self.tints[number] {
            radiance.iter_mut().zip(tint).for_each(|(band, tint)| *band *= tint);
        }
        true
    }

    /// The density (1/sr), chance included, with which [`Self::sample`] gives the direction from
    /// `from` to `spot`, where it was met by a ray along `direction`.
    #[must_use]
    pub fn pdf_of_surface(
        &self,
        around: &SceneView<'_>,
        placement: u32,
        spot: &SurfacePoint<'_>,
        from: DVec3,
        direction: DVec3,
    ) -> f64 {
        let Some(Some(first)) = self.first.get(placement as usize) else { return 0.0 };
        if self.picker.is_empty() {
            return 0.0;
        }
        let triangle = u32::try_from(spot.triangle).unwrap_or(u32::MAX);
        let Some(place) = EmissiveTriangle::new(around, placement, triangle, from) else {
            return 0.0;
        };
        let chance = self.picker.probability(*first as usize + spot.triangle);
        let [_, u, v] = spot.weights;
        let offset = place.corner + place.shape.edges[0] * u + place.shape.edges[1] * v;
        let pdf = chance * offset.length_squared()
            / (direction.dot(place.shape.normal).abs() * place.shape.area);
        if pdf.is_finite() { pdf } else { 0.0 }
    }

    /// Radiance that comes from the unit `direction` without meeting anything; `false` when it is
    /// dark there.
    pub fn environment(&self, spectral: &Spectral, direction: DVec3, radiance: &mut [f64]) -> bool {
        let Some(environment) = &self.environment else { return false };
        let own = self.bands_of(environment.index, radiance.len());
        match &environment.map {
            None => radiance.copy_from_slice(own),
            Some((map, _)) => {
                let color = map.radiance(environment.local(direction));
                for (i, band) in radiance.iter_mut().enumerate() {
                    *band = own[i] * spectral.band(&color, i);
                }
            }
        }
        true
    }

    /// The density (1/sr), chance included, with which [`Self::sample`] gives a direction of the
    /// environment.
    #[must_use]
    pub fn pdf_of_environment(&self, direction: DVec3) -> f64 {
        let Some(environment) = self.environment.as_ref().filter(|_| !self.picker.is_empty())
        else {
            return 0.0;
        };
        let pdf = match &environment.map {
            Some((_, sampler)) => sampler.pdf(environment.local(direction)),
            None => 0.25 / PI,
        };
        pdf * self.picker.probability(environment.index)
    }
}

pub(crate) fn mean(color: &Color) -> f64 {
    (color[0] + color[1] + color[2]) / 3.0
}

/// Power of a light (W), `far` being the area (m²) that the scene shows to far lights.
fn power(light: &Light, far: f64, environment: Option<&Environment>) -> f64 {
    let own = mean(&light.color);
    match light.kind {
        LightKind::Point(_) => 4.0 * PI * own,
        LightKind::Spot { cos_outer, cos_inner, .. } => {
            // As bright as inside over the mean of both cones.
            2.0 * PI * (1.0 - 0.5 * (cos_outer + cos_inner)) * own
        }
        LightKind::Directional(_) => far * own,
        LightKind::Environment { .. } => {
            let map = environment.and_then(|e| e.map.as_ref());
            4.0 * PI * far * own * map.map_or(1.0, |(_, sampler)| sampler.mean)
        }
    }
}
