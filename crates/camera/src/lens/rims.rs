//! Rims of a lens at several wavelengths: a ray of the scene meets its elements a little elsewhere at each.
//!
//! A ray that passes at the wavelength of a band may be cut at all the leading ones, as where the middle of the spectrum
//! passes farther inside than both its ends. Leading rays pass a lens with wider rims, therefore, as much wider as
//! wavelengths part there from the nearest leading one: any ray that passes at a band's wavelength passes the wider lens at
//! that one at least. A ray that keeps away from all rims by more than wavelengths part there, and so passes a lens with
//! narrower ones, passes at each of them; and so does one that passes at all leading wavelengths a lens with rims narrower
//! by what others part from the nearest of these, which is looked at where bands are many. What is between is traced at each
//! band's wavelength.

use etendue_optics::element::{Clip, LensRays, RayStatus};
use etendue_optics::train::{MonochromaticTrain, OpticalTrain, RimTrace, Side};
use glam::DVec3;

/// Factor on the measured parting of places, on the film and at rims, which may be greater in between.
pub(super) const SAFETY: f64 = 1.25;

/// Rays by which it is measured how far wavelengths part at rims, about.
const RAYS: usize = 1000;

/// To look at each node whether a ray keeps away from rims takes about as long as to trace it so many times.
const TRACES: usize = 4;

/// A ray of the scene.
#[derive(Clone, Copy)]
pub(super) struct SceneRay {
    /// A point on it (mm).
    pub(super) point: DVec3,
    pub(super) direction: DVec3,
}

/// A lens with wider and with narrower rims than it has.
#[derive(Debug)]
pub(super) struct RimBounds {
    /// With rims so much wider that rays which pass at a wavelength pass this one at a leading wavelength.
    pub(super) wider: OpticalTrain,
    /// That at each leading wavelength.
    pub(super) outer: Vec<MonochromaticTrain>,
    /// At each leading wavelength, with rims so much narrower that rays which pass one of them pass at all wavelengths.
    pub(super) inner: Vec<MonochromaticTrain>,
    /// The same of rays that pass each of them; `None` where bands are so few that it takes as long to trace rays at all.
    pub(super) near: Option<Vec<MonochromaticTrain>>,
}

impl RimBounds {
    /// Measures how far rays of the scene part at the rims of the lens `clear` at some wavelengths from the leading ones of
    /// `nodes` (nm), for so many bands. `None` where they do not, or where rims are no circles and polygons about an axis.
    pub(super) fn measured(
        clear: &OpticalTrain,
        nodes: &[f64],
        (wavelengths, bands): (&[f64], usize),
        (rays, lead): (&[SceneRay], f64),
    ) -> Option<Self> {
        let elements = clear.elements().len();
        clear.with_wider_rims(&vec![0.0; elements])?;
        let at = |nm: &f64| clear.at(*nm).ok();
        let lenses = nodes.iter().chain(wavelengths).map(at).collect::<Option<Vec<_>>>()?;
        let (leading, others) = lenses.split_at(nodes.len());
        // `[node][wavelength][element]`
        let mut parting = vec![vec![vec![0.0_f64; elements]; others.len()]; nodes.len()];
        for ray in rays.iter().step_by(rays.len().div_ceil(RAYS).max(1)) {
            let crossings = |lens: &MonochromaticTrain| crossings(lens, *ray, lead, elements);
            let at_nodes: Vec<_> = leading.iter().map(crossings).collect();
            let at_others: Vec<_> = others.iter().map(crossings).collect();
            for (of_node, node) in parting.iter_mut().zip(&at_nodes) {
                for (of_other, other) in of_node.iter_mut().zip(&at_others) {
                    let (Some(node), Some(other)) = (node, other) else { continue };
                    for ((most, a), b) in of_other.iter_mut().zip(node).zip(other) {
                        *most = most.max(a.distance(*b));
                    }
                }
            }
        }
        // By how much rims move: for all wavelengths, and for those to which a leading one is the nearest.
        let mut to_all = vec![vec![0.0_f64; elements]; nodes.len()];
        let mut to_near = to_all.clone();
        for other in 0..others.len() {
            let far = |node: usize| parting[node][other].iter().sum::<f64>();
            let nearest = (0..nodes.len()).min_by(|&a, &b| far(a).total_cmp(&far(b)))?;
            grow(&mut to_near[nearest], &parting[nearest][other]);
            to_all.iter_mut().zip(&parting).for_each(|(all, of_node)| grow(all, &of_node[other]));
        }
        if to_all.iter().flatten().all(|&width| width == 0.0) {
            return None;
        }
        let moved = |widths: &[f64], by: f64| {
            let by: Vec<f64> = widths.iter().map(|width| width * by).collect();
            clear.with_wider_rims(&by)
        };
        let narrowed = |widths: &[Vec<f64>]| {
            let of_nodes = nodes.iter().zip(widths);
            let narrowed = of_nodes.map(|(&nm, widths)| moved(widths, -SAFETY)?.at(nm).ok());
            narrowed.collect::<Option<Vec<_>>>()
        };
        let mut widest = vec![0.0_f64; elements];
        to_near.iter().for_each(|widths| grow(&mut widest, widths));
        let wider = moved(&widest, SAFETY)?;
        let outer = nodes.iter().map(|&nm| wider.at(nm).ok()).collect::<Option<_>>()?;
        let near = if bands > TRACES * nodes.len() { Some(narrowed(&to_near)?) } else { None };
        Some(Self { wider, outer, inner: narrowed(&to_all)?, near })
    }

    /// Takes rays of a leading wavelength out of the wider lens, and tells which of them pass at all wavelengths.
    pub(super) fn trace(&self, node: usize, rays: &mut LensRays, rims: &mut RimTrace) {
        self.outer[node].trace_within(&self.inner[node], Side::Sensor, rays, rims);
    }

    /// Takes rays back into the wider lens; with [`Self::near`], tells which of them pass at all wavelengths if they do so
    /// at each node.
    pub(super) fn trace_back(&self, node: usize, rays: &mut LensRays, rims: &mut RimTrace) {
        match &self.near {
            Some(near) => self.outer[node].trace_within(&near[node], Side::Object, rays, rims),
            None => self.outer[node].trace(Side::Object, Clip::On, rays),
        }
    }
}

/// Raises numbers to others that are greater.
fn grow(most: &mut [f64], others: &[f64]) {
    most.iter_mut().zip(others).for_each(|(most, other)| *most = most.max(*other));
}

/// Places where a ray of the scene would cross each element if there were no rims (mm); `None` where it does not.
fn crossings(
    lens: &MonochromaticTrain,
    ray: SceneRay,
    lead: f64,
    elements: usize,
) -> Option<Vec<DVec3>> {
    let SceneRay { point, direction } = ray;
    let path = lens.path(Side::Object, Clip::Off, point + direction * lead, -direction);
    (path.status == RayStatus::Exited && path.points.len() == elements).then_some(path.points)
}
