//! The lights of a scene: what each gives off, and a place on one that is chosen for a point.

mod environment;
mod plain;

use std::borrow::Cow;
use std::f64::consts::TAU;
use std::sync::Arc;

use etendue_geometry::glam::DVec3;
use etendue_spectrum::{NoOverlap, Outside};

pub(crate) use self::plain::PlainLight;
use crate::area_light::{self, AreaLight, AreaLightMotion, triangle_power};
use crate::environment::EnvironmentMap;
use crate::group::Groups;
pub(crate) use crate::light::LightBounds;
use crate::light::{Light, LightKind, power, sought_irradiance, spot_falloff};
use crate::light_sampler::{Candidate, LightQuery, LightSampler, Receiver};
use crate::light_tree::Choices;
use crate::material::Alpha;
use crate::reference::{SceneView, SurfacePoint};
use crate::sampling::{Frame, cone_direction, triangle_point};
use crate::sky::Sky;
use crate::spectral::Spectral;
use crate::surface_point::squares_at;
use crate::target::{Target, TargetKind};
use crate::{LightGroup, Material, Modulation, Paint, SceneCurve};

/// All lights of a scene, ready to be chosen from.
#[derive(Debug)]
pub struct Lights {
    lights: Vec<Light>,
    /// The bands of each light, one light after the other.
    bands: Vec<f64>,
    pub(crate) sky: Option<Sky>,
    /// The spectrum of each material's emission.
    tints: Vec<EmissionBands>,
    /// For each placement, where its triangles start among the choices.
    first: Vec<Option<u32>>,
    /// Placement and triangle of each emissive triangle, behind the lights.
    triangles: Vec<[u32; 2]>,
    sampler: LightSampler,
    /// The emissive triangles where they are at most [`area_light::MOST`] (`None` of one without area, and of one that moves),
    /// and what those that shine alike all over give off in all bands.
    area_lights: Vec<Option<AreaLight>>,
    area_light_bands: Vec<f64>,
    bounds: LightBounds,
    groups: Groups,
    /// The lights that are disks far away, such as the sun's.
    disks: Vec<usize>,
}

/// The spectrum of what a surface gives off, in bands.
#[derive(Debug)]
enum EmissionBands {
    /// That of its paint.
    Own,
    /// Its paint times an illuminant.
    Times(Vec<f64>),
    /// The squares of a checker of curves.
    Squares([Vec<f64>; 2]),
}

impl EmissionBands {
    /// The most that a band of its paint is multiplied by.
    fn most(&self) -> f64 {
        match self {
            Self::Times(tint) => tint.iter().copied().fold(0.0, f64::max),
            Self::Own | Self::Squares(_) => 1.0,
        }
    }

    /// That of a material.
    fn of(material: &Material, spectral: &Spectral) -> Result<Self, NoOverlap> {
        let Some(emission) = &material.emission else { return Ok(Self::Own) };
        match (&emission.radiance, &emission.illuminant) {
            (Paint::Cube { cube, .. }, _) => {
                cube.cube.overlaps(spectral.bands())?;
                Ok(Self::Own)
            }
            (Paint::Checker { curves: Some(curves), .. }, _) => {
                let [first, second] = &**curves;
                let bands = |one: &SceneCurve| spectral.emission(&one.curve);
                Ok(Self::Squares([bands(first)?, bands(second)?]))
            }
            (_, Some(illuminant)) => spectral.emission(illuminant).map(Self::Times),
            (_, None) => Ok(Self::Own),
        }
    }
}

impl Lights {
    /// The lights of a scene whose emissive surfaces are those of `scene`; `map` is the decoded
    /// image of the environment, if it has one. Those that change with time are chosen by their mean over `span`, in
    /// which the camera sees light (s from the frame's time), and those that move by where they are within it.
    ///
    /// # Errors
    ///
    /// When an illuminant is known at no wavelength of the bands.
    pub fn new(
        lights: &[Light],
        map: Option<Arc<EnvironmentMap>>,
        scene: &SceneView<'_>,
        span: [f64; 2],
        spectral: &Spectral,
    ) -> Result<Self, NoOverlap> {
        let mean = |modulation: &Option<Arc<Modulation>>| {
            modulation.as_ref().map_or(1.0, |modulation| modulation.weight(span))
        };
        let count = spectral.count();
        let mut bands = vec![0.0; lights.len() * count];
        for (light, bands) in lights.iter().zip(bands.chunks_mut(count)) {
            spectral.spread(&light.color, bands);
            if let Some(illuminant) = &light.illuminant {
                let tint = spectral.emission(illuminant)?;
                bands.iter_mut().zip(&tint).for_each(|(band, tint)| *band *= tint);
            }
            if let Some(spectrum) = light.spectrum.as_ref().filter(|_| !spectral.is_rgb()) {
                bands.copy_from_slice(&spectral.bands().from_curve(spectrum, Outside::Zero)?);
            }
        }
        let sky = Sky::of(lights, map, spectral)?;
        let brightness = sky.as_ref().map_or(1.0, Sky::mean);
        let candidate = |light: &Light| {
            let mean = mean(&light.modulation);
            match light.cluster(mean * light.intensity(), scene, span) {
                Some(cluster) => Candidate::near(mean * power(light, scene), cluster),
                None => Candidate::Far { irradiance: mean * sought_irradiance(light, brightness) },
            }
        };
        let mut candidates: Vec<Candidate> = lights.iter().map(candidate).collect();
        let mut first = Vec::with_capacity(scene.geometry.placements.len());
        let mut triangles = Vec::new();
        for (number, placement) in (0_u32..).zip(&scene.geometry.placements) {
            let material = scene.materials.get(placement.material as usize);
            let emits = material.is_some_and(|m| m.emission.is_some());
            first.push(if emits { u32::try_from(candidates.len()).ok() } else { None });
            let Some(material) = material.filter(|_| emits) else { continue };
            let mesh = scene.geometry.mesh_of(placement);
            let mean = material.emission.as_ref().map_or(1.0, |e| mean(&e.modulation));
            // What moves shines as much as in the middle of that time.
            let way = AreaLightMotion::of(scene.geometry, placement, span);
            let time = if way.is_some() { 0.5 * (span[0] + span[1]) } else { 0.0 };
            for triangle in 0..mesh.triangles.len() {
                let id = [number, u32::try_from(triangle).unwrap_or(u32::MAX)];
                let power = mean * triangle_power(scene, placement, triangle, material, time);
                candidates.push(match area_light::cluster(scene, id, time, power, way.as_ref()) {
                    Some(cluster) => Candidate::near(power, cluster),
                    None => Candidate::Dark,
                });
                triangles.push(id);
            }
        }
        let tint = |material: &Material| EmissionBands::of(material, spectral);
        let tints = scene.materials.iter().map(tint).collect::<Result<_, _>>()?;
        let sampler = LightSampler::new(&candidates, scene.geometry.loose_bounds());
        let part = |group: Option<LightGroup>, modulation: &Option<Arc<Modulation>>| {
            (group.unwrap_or(LightGroup::OTHER), modulation.clone())
        };
        let of_material = |material: &Material| match &material.emission {
            Some(emission) => part(emission.group, &emission.modulation),
            None => (LightGroup::OTHER, None),
        };
        let groups = Groups::of(
            lights.iter().map(|light| part(light.group, &light.modulation)),
            scene.materials.iter().map(of_material),
        );
        let disks = (0..lights.len()).filter(|&index| lights[index].is_disk()).collect();
        let lights = lights.to_vec();
        let (area_lights, area_light_bands) = Default::default();
        let mut all = Self {
            lights,
            bands,
            sky,
            tints,
            first,
            triangles,
            sampler,
            area_lights,
            area_light_bands,
            bounds: LightBounds::NOTHING,
            groups,
            disks,
        };
        all.prepare_area_lights(scene, spectral);
        all.bounds = all.bound(scene, span);
        Ok(all)
    }

    /// Makes ready for so many points that choose a light each.
    pub(crate) fn restart(&self, choices: &mut Choices, most: usize) {
        self.sampler.restart(choices, most);
    }

    /// Chooses a light for each of some points.
    pub(crate) fn pick(&self, choices: &mut Choices) {
        self.sampler.pick(choices);
    }

    /// Light `index` and its bands, if it is a triangle that is kept ready and shines alike all over.
    #[inline(always)]
    pub(crate) fn plain_triangle(
        &self,
        index: usize,
        count: usize,
    ) -> Option<(&AreaLight, &[f64])> {
        let number = index.checked_sub(self.lights.len())?;
        let area_light = self.area_lights.get(number)?.as_ref().filter(|own| own.is_plain)?;
        Some((area_light, &self.area_light_bands[number * count..(number + 1) * count]))
    }

    /// The number among all lights of a triangle that shines.
    #[inline]
    pub(crate) fn index_of(&self, [placement, triangle]: [u32; 2]) -> Option<usize> {
        let first = (*self.first.get(placement as usize)?)?;
        Some(first as usize + triangle as usize)
    }

    /// The chance with which [`Self::pick`] picks light `index` for a point.
    pub(crate) fn chance(&self, receiver: &Receiver, index: usize) -> f64 {
        self.sampler.chance(receiver, index)
    }

    /// Keeps emissive triangles ready.
    fn prepare_area_lights(&mut self, scene: &SceneView<'_>, spectral: &Spectral) {
        if self.is_dark() || self.triangles.len() > area_light::MOST {
            return;
        }
        let count = spectral.count();
        let mut bands = vec![0.0; self.triangles.len() * count];
        for (id, bands) in self.triangles.iter().zip(bands.chunks_mut(count)) {
            let placement = &scene.geometry.placements[id[0] as usize];
            let point = SurfacePoint::corner(scene.geometry, placement, id[1] as usize);
            self.emitted(scene, spectral, &point, true, bands);
        }
        let stands = |id: [u32; 2]| scene.geometry.placements[id[0] as usize].motion.is_none();
        let still = |&id: &[u32; 2]| AreaLight::at(scene, id, 0.0).filter(|_| stands(id));
        self.area_lights = self.triangles.iter().map(still).collect();
        self.area_light_bands = bands;
    }

    /// The emissive triangle of a number at a time (s from the frame's time); `None` without area.
    fn area_light(
        &self,
        scene: &SceneView<'_>,
        number: usize,
        time: f64,
    ) -> Option<Cow<'_, AreaLight>> {
        match self.area_lights.get(number) {
            Some(Some(area_light)) => Some(Cow::Borrowed(area_light)),
            _ => AreaLight::at(scene, self.triangles[number], time).map(Cow::Owned),
        }
    }

    /// True if there is nothing to choose from.
    #[must_use]
    pub fn is_dark(&self) -> bool {
        self.sampler.is_empty()
    }

    /// True if a ray that nobody aimed may come upon a light: not upon points and parallel light.
    #[must_use]
    pub fn is_hittable(&self) -> bool {
        self.sky.is_some() || !self.triangles.is_empty()
    }

    /// True if some light is a disk far away.
    pub(crate) fn has_disks(&self) -> bool {
        !self.disks.is_empty()
    }

    /// The disks far away that lie in a unit direction at a time (s from the frame's time), of which the camera itself
    /// sees those that are visible: the number of each light, and its radiance where its bands are 1 (1/sr).
    pub(crate) fn disks_in(
        &self,
        direction: DVec3,
        time: f64,
        by_camera: bool,
    ) -> impl Iterator<Item = (usize, f64)> {
        self.disks.iter().filter_map(move |&index| {
            let light = &self.lights[index];
            let LightKind::Directional { along, cos_radius, visible } = light.kind else {
                return None;
            };
            // Half the square of the chord, which narrow disks need whole.
            let apart = 0.5 * (direction + light.pose(time).direction(along)).length_squared();
            let short = 1.0 - cos_radius;
            let is_seen = (visible || !by_camera) && apart <= short;
            is_seen.then(|| (index, (TAU * short).recip()))
        })
    }

    /// Parts of their light that can be told apart, by the numbers of [`crate::transport::Parts::Groups`]: the lights of
    /// one group that change with time alike.
    #[must_use]
    pub fn parts(&self) -> &[(LightGroup, Option<Arc<Modulation>>)] {
        self.groups.parts()
    }

    /// True if any of them changes with time.
    #[must_use]
    pub fn are_modulated(&self) -> bool {
        self.parts().iter().any(|(_, modulation)| modulation.is_some())
    }

    /// The group of a surface that shines.
    pub(crate) fn group_of_placement(&self, scene: &SceneView<'_>, placement: u32) -> u32 {
        let placement = scene.geometry.placements.get(placement as usize);
        placement.map_or(0, |placement| self.groups.of_material(placement.material))
    }

    /// The group of a light of any kind.
    pub(crate) fn group_of_any(&self, scene: &SceneView<'_>, index: u32) -> u32 {
        match (index as usize).checked_sub(self.lights.len()) {
            None => self.groups.of_light(index as usize),
            Some(number) => self.group_of_placement(scene, self.triangles[number][0]),
        }
    }

    pub(crate) fn bands_of(&self, light: usize, count: usize) -> &[f64] {
        &self.bands[light * count..(light + 1) * count]
    }

    /// A place on a light that was [picked](Self::pick); its radiance (of a point its intensity) goes to `radiance`.
    #[inline(always)]
    pub(crate) fn place(
        &self,
        scene: &SceneView<'_>,
        spectral: &Spectral,
        query: &LightQuery,
        radiance: &mut [f64],
    ) -> Option<Target> {
        let LightQuery { from, choice, square, .. } = query;
        let (index, chance) = (choice.light as usize, choice.chance);
        let Some(light) = self.lights.get(index) else {
            return self.place_on_area_light(scene, spectral, query, radiance);
        };
        radiance.copy_from_slice(self.bands_of(index, radiance.len()));
        let pose = light.pose(query.time);
        match &light.kind {
            LightKind::Point(at) => Some(Target::bare(TargetKind::Point, pose.point(*at), chance)),
            &LightKind::Spot { at, axis, cos_outer, cos_inner } => {
                let (at, axis) = (pose.point(at), pose.direction(axis));
                let cosine = (*from - at).try_normalize().map_or(-1.0, |d| d.dot(axis));
                let factor = spot_falloff(cosine, cos_outer, cos_inner);
                radiance.iter_mut().for_each(|band| *band *= factor);
                (factor > 0.0).then(|| Target::bare(TargetKind::Point, at, chance))
            }
            LightKind::Projector(projector) => {
                let color = projector.toward(scene, pose.seen(*from))?;
                for (k, band) in radiance.iter_mut().enumerate() {
                    *band *= spectral.band(&color, k);
                }
                Some(Target::bare(TargetKind::Point, pose.point(projector.at), chance))
            }
            LightKind::Goniometric(measured) => {
                let intensity = measured.toward(pose.seen(*from));
                radiance.iter_mut().for_each(|band| *band *= intensity);
                let place = Target::bare(TargetKind::Point, pose.point(measured.at), chance);
                (intensity > 0.0).then_some(place)
            }
            &LightKind::Directional { along, cos_radius, .. } => {
                let toward = Frame::around(-pose.direction(along))
                    .world(cone_direction(*square, cos_radius));
                Some(Target::bare(TargetKind::Parallel, toward, chance))
            }
            // Directions to the sky, of which a scene has one, are chosen side by side.
            LightKind::Environment { .. } => None,
        }
    }

    /// The same of an emissive triangle.
    #[inline]
    fn place_on_area_light(
        &self,
        scene: &SceneView<'_>,
        spectral: &Spectral,
        query: &LightQuery,
        radiance: &mut [f64],
    ) -> Option<Target> {
        let &LightQuery { time, choice, square, .. } = query;
        let number = choice.light as usize - self.lights.len();
        let area_light = self.area_light(scene, number, time)?;
        let [u, v] = triangle_point(square);
        let count = radiance.len();
        match self.area_light_bands.get(number * count..(number + 1) * count) {
            Some(bands) if area_light.is_plain => radiance.copy_from_slice(bands),
            _ => {
                let placement = &scene.geometry.placements[area_light.id[0] as usize];
                let point =
                    SurfacePoint::corner(scene.geometry, placement, area_light.id[1] as usize);
                let point = SurfacePoint { weights: [1.0 - u - v, u, v], time, ..point };
                if !self.emitted(scene, spectral, &point, true, radiance) {
                    return None;
                }
            }
        }
        Some(Target {
            kind: TargetKind::Triangle { two_sided: area_light.two_sided },
            place: [area_light.corner[0], area_light.corner[1], area_light.across([u, v])],
            normal: area_light.shape.normal,
            magnitudes: area_light.magnitudes,
            density: choice.chance / area_light.shape.area,
        })
    }

    /// Radiance that a surface gives off to its front or back, as much as of it is there; `false` when it is dark.
    pub fn emitted(
        &self,
        scene: &SceneView<'_>,
        spectral: &Spectral,
        point: &SurfacePoint<'_>,
        front: bool,
        radiance: &mut [f64],
    ) -> bool {
        let number = point.placement.material as usize;
        let material = scene.materials.get(number);
        let Some((material, emission)) = material.and_then(|m| Some((m, m.emission.as_ref()?)))
        else {
            return false;
        };
        if !front && !emission.two_sided {
            return false;
        }
        let there = match material.alpha {
            Alpha::Opaque => 1.0,
            alpha => alpha.opacity(scene.base_tint(spectral, material, point).1),
        };
        if let Paint::Cube { cube, repeat } = &emission.radiance
            && !spectral.is_rgb()
        {
            let [u, v] = point.uv(0);
            let at = [u * repeat[0], v * repeat[1]];
            for (i, band) in radiance.iter_mut().enumerate() {
                *band = there * emission.strength * spectral.texel(cube.number, at, i);
            }
            return true;
        }
        if let (EmissionBands::Squares([a, b]), Paint::Checker { squares, .. }) =
            (&self.tints[number], &emission.radiance)
        {
            let [first, second] = squares_at(point, *squares).shares();
            for ((band, a), b) in radiance.iter_mut().zip(a).zip(b) {
                *band = there * emission.strength * (first * a + second * b);
            }
            return true;
        }
        let [r, g, b, _] = scene.paint(&emission.radiance, point);
        spectral.spread(&[r, g, b].map(|c| c * emission.strength * there), radiance);
        if let EmissionBands::Times(tint) = &self.tints[number] {
            radiance.iter_mut().zip(tint).for_each(|(band, tint)| *band *= tint);
        }
        true
    }

    /// The density (1/sr), chance included, with which [`Self::pick`] and [`Self::place`] give a receiver the direction to
    /// `point`, which a ray along `direction` from the receiver hit.
    pub(crate) fn pdf_of_surface(
        &self,
        scene: &SceneView<'_>,
        placement: u32,
        point: &SurfacePoint<'_>,
        receiver: &Receiver,
        direction: DVec3,
    ) -> f64 {
        let Some(Some(first)) = self.first.get(placement as usize) else { return 0.0 };
        if self.is_dark() {
            return 0.0;
        }
        let index = *first as usize + point.triangle;
        let number = index - self.lights.len();
        let Some(area_light) = self.area_light(scene, number, point.time) else { return 0.0 };
        let [_, u, v] = point.weights;
        let squared = area_light.offset(receiver.point, [u, v]).length_squared();
        let cosine = direction.dot(area_light.shape.normal).abs();
        let pdf = self.chance(receiver, index) * squared / (cosine * area_light.shape.area);
        if pdf.is_finite() { pdf } else { 0.0 }
    }
}
