//! Seidel's sums and the chromatic sums, surface by surface.
//!
//! With A = n (h c + u) of the marginal and Ā of the chief ray, the invariant H = n (u h̄ − ū h) and Δ the
//! change at a surface: `S_I` = −A² h Δ(u/n), `S_II` = −A Ā h Δ(u/n), `S_III` = −Ā² h Δ(u/n),
//! `S_IV` = −H² c Δ(1/n), `S_V` = Ā (h̄ (Ā h − H) c Δ(1/n) − Ā² h Δ(1/n²)), `C_I` = A h Δ(δn/n),
//! `C_II` = Ā h Δ(δn/n); a fourth-order difference G from the sphere of the vertex' curvature adds
//! 8 G Δn h⁴ to `S_I`, times h̄/h for each sum from there to `S_III`, and (h̄/h)³ to `S_V` (W. T. Welford,
//! *Aberrations of Optical Systems*, 1986, ch. 8 to 10; `S_V` in the form that A = 0 does no harm).
//!
//! Heights and slopes are u = dy/dz. The ideal thin lens adds nothing.

use etendue_report::Refusal;
use schemars::JsonSchema;
use serde::Serialize;

use super::AnalysisError;
use super::object::ObjectPoint;
use crate::element::Part;
use crate::train::OpticalTrain;

/// Sums of one surface, or of all (mm).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, JsonSchema)]
pub struct SeidelSums {
    /// `S_I`.
    pub spherical: f64,
    /// `S_II`.
    pub coma: f64,
    /// `S_III`.
    pub astigmatism: f64,
    /// `S_IV`: Petzval's.
    pub petzval: f64,
    /// `S_V`.
    pub distortion: f64,
    /// `C_I`: from the shortest to the longest wavelength.
    pub longitudinal_colour: f64,
    /// `C_II`.
    pub lateral_colour: f64,
}

impl SeidelSums {
    fn add(&mut self, other: &Self) {
        self.spherical += other.spherical;
        self.coma += other.coma;
        self.astigmatism += other.astigmatism;
        self.petzval += other.petzval;
        self.distortion += other.distortion;
        self.longitudinal_colour += other.longitudinal_colour;
        self.lateral_colour += other.lateral_colour;
    }
}

/// Sums of all surfaces.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct SeidelTable {
    /// The object point that the chief ray comes from, in words.
    pub field: String,
    /// Lagrange's invariant H (mm).
    pub invariant: f64,
    /// The marginal ray's slope behind the lens.
    pub image_slope: f64,
    /// Wavelengths between which the chromatic sums are (nm).
    pub colours: [f64; 2],
    /// By element.
    pub surfaces: Vec<SeidelSums>,
    /// All together.
    pub total: SeidelSums,
    /// Places of the stop at which a sum would be nothing.
    pub stop_shifts: Vec<StopShift>,
}

/// A place of the stop at which a sum is nothing, with the same marginal ray.
///
/// With the chief ray moved by Q times the marginal one, `S_II` becomes `S_II` + Q `S_I`, and `C_II` becomes
/// `C_II` + Q `C_I` (W. T. Welford, *Aberrations of Optical Systems*, 1986, ch. 8.5: stop shift).
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct StopShift {
    /// Without `coma` or without `lateral_colour`.
    pub without: &'static str,
    /// Multiple of the marginal ray by which the chief ray is moved.
    pub eccentricity: f64,
    /// z of the entrance pupil then (mm); `null` at infinity.
    pub entrance_pupil_z: Option<f64>,
    /// z at which the chief ray crosses the axis then, and where a stop can stand (mm); `null` where it
    /// crosses it in no gap, before or behind the lens.
    pub stop_z: Option<f64>,
    /// All sums then (mm).
    pub total: SeidelSums,
}

/// A paraxial ray.
#[derive(Debug, Clone, Copy)]
struct ParaxialRay {
    height: f64,
    slope: f64,
}

/// The sums of a lens for a field in y, the marginal ray at the rim of the stop.
///
/// # Errors
///
/// When a glass has no index, nothing limits the stop, or the entrance pupil is at infinity for an
/// object that is, too.
pub fn seidel(
    train: &OpticalTrain,
    object: &ObjectPoint,
    colours: [f64; 2],
) -> Result<SeidelTable, AnalysisError> {
    if train.is_graded() {
        let why = "the index of a medium changes from place to place, which third-order sums leave out; rays follow it";
        return Err(Refusal::new(why).into());
    }
    let (marginal, chief) = rays(train, object)?;
    let mut table = sums(train, object, colours, marginal, chief)?.0;
    let of = |without, across: f64, along: f64| -> Result<Option<StopShift>, AnalysisError> {
        let eccentricity = -across / along;
        if !eccentricity.is_finite() || across == 0.0 {
            return Ok(None);
        }
        let chief = ParaxialRay {
            height: chief.height + eccentricity * marginal.height,
            slope: chief.slope + eccentricity * marginal.slope,
        };
        let pupil = -chief.height / chief.slope;
        let (table, stop_z) = sums(train, object, colours, marginal, chief)?;
        let entrance_pupil_z = Some(pupil).filter(|z| z.is_finite());
        let total = table.total;
        Ok(Some(StopShift { without, eccentricity, entrance_pupil_z, stop_z, total }))
    };
    let total = table.total;
    let shifts = [
        of("coma", total.coma, total.spherical)?,
        of("lateral_colour", total.lateral_colour, total.longitudinal_colour)?,
    ];
    table.stop_shifts = shifts.into_iter().flatten().collect();
    Ok(table)
}

/// The sums of two rays at the first vertex, and z where the chief ray crosses the axis for real: before the
/// lens, in a gap, or behind it.
fn sums(
    train: &OpticalTrain,
    object: &ObjectPoint,
    colours: [f64; 2],
    mut marginal: ParaxialRay,
    mut chief: ParaxialRay,
) -> Result<(SeidelTable, Option<f64>), AnalysisError> {
    let indices = train.indices(train.wavelength())?;
    let [short, long] = [train.indices(colours[0])?, train.indices(colours[1])?];
    let n0 = indices[0];
    let invariant = n0 * (marginal.slope * chief.height - chief.slope * marginal.height);
    let mut table = SeidelTable {
        field: object.name(),
        invariant,
        image_slope: 0.0,
        colours,
        surfaces: Vec::new(),
        total: SeidelSums::default(),
        stop_shifts: Vec::new(),
    };
    let first = train.elements().first().map_or(0.0, |element| element.frame.vertex.z);
    // From a vertex to where the chief ray crosses the axis.
    let crossing = |chief: ParaxialRay| Some(-chief.height / chief.slope).filter(|z| z.is_finite());
    let mut crossed = crossing(chief).filter(|z| *z <= 0.0).map(|z| first + z);
    for (i, element) in train.elements().iter().enumerate() {
        if i > 0 {
            let before = train.elements()[i - 1].frame.vertex.z;
            let gap = element.frame.vertex.z - before;
            let inside = crossing(chief).filter(|z| (0.0..=gap).contains(z));
            crossed = crossed.or(inside.map(|z| before + z));
            marginal.height += gap * marginal.slope;
            chief.height += gap * chief.slope;
        }
        let (n, n1) = (indices[i], indices[i + 1]);
        let power = train.power(&indices, i);
        let bent = |ray: ParaxialRay| ParaxialRay {
            slope: (n * ray.slope - power * ray.height) / n1,
            ..ray
        };
        let sums = match &element.part {
            Part::Surface(surface) => {
                let dispersion = (short[i + 1] - long[i + 1]) / n1 - (short[i] - long[i]) / n;
                let shape = VertexShape {
                    curvature: surface.paraxial_curvature(),
                    quartic: quartic(surface),
                };
                at_surface([n, n1], shape, dispersion, [marginal, chief], invariant)
            }
            Part::Biconic(surface) => {
                let dispersion = (short[i + 1] - long[i + 1]) / n1 - (short[i] - long[i]) / n;
                let shape = VertexShape { curvature: surface.curvature[1], quartic: 0.0 };
                at_surface([n, n1], shape, dispersion, [marginal, chief], invariant)
            }
            // Reflection is refraction into the index −n; the sums are the same in the unfolded space.
            Part::Mirror(mirror) => {
                let shape = VertexShape {
                    curvature: mirror.surface.paraxial_curvature(),
                    quartic: quartic(&mirror.surface),
                };
                at_surface([n, -n], shape, 0.0, [marginal, chief], invariant)
            }
            // Its section along y near the axis, without what it adds farther out.
            Part::Freeform(surface) => {
                let dispersion = (short[i + 1] - long[i + 1]) / n1 - (short[i] - long[i]) / n;
                let behind = if surface.mirror.is_some() { -n } else { n1 };
                let shape = VertexShape { curvature: surface.paraxial_curvature(), quartic: 0.0 };
                at_surface([n, behind], shape, dispersion, [marginal, chief], invariant)
            }
            Part::ThinLens(_)
            | Part::Aperture(_)
            | Part::Filter(_)
            | Part::MicrolensArray(_)
            | Part::CoordinateBreak(_) => SeidelSums::default(),
        };
        table.total.add(&sums);
        table.surfaces.push(sums);
        (marginal, chief) = (bent(marginal), bent(chief));
    }
    table.image_slope = marginal.slope;
    let behind = crossing(chief).filter(|z| *z >= 0.0).map(|z| train.last_vertex() + z);
    Ok((table, crossed.or(behind)))
}

/// The marginal and the chief ray at the first vertex.
fn rays(
    train: &OpticalTrain,
    object: &ObjectPoint,
) -> Result<(ParaxialRay, ParaxialRay), AnalysisError> {
    let pupil = train.paraxial(train.wavelength())?.entrance_pupil;
    let (Some(z), Some(diameter)) = (pupil.z, pupil.diameter) else {
        return Err(AnalysisError::unlimited());
    };
    let radius = 0.5 * diameter;
    Ok(match *object {
        ObjectPoint::Infinity { angles } => {
            let slope = angles[1].to_radians().tan();
            let marginal = ParaxialRay { height: radius, slope: 0.0 };
            (marginal, ParaxialRay { height: -z * slope, slope })
        }
        ObjectPoint::Near { place } => {
            let way = z - place.z;
            let (u, bar) = (radius / way, -place.y / way);
            let marginal = ParaxialRay { height: -place.z * u, slope: u };
            (marginal, ParaxialRay { height: -z * bar, slope: bar })
        }
    })
}

/// The coefficient of r⁴ by which a surface differs from the sphere of its vertex' curvature (1/mm³).
fn quartic(surface: &crate::element::Surface) -> f64 {
    let (c, sphere) = (surface.curvature, surface.paraxial_curvature());
    let own = c.powi(3) * (1.0 + surface.conic) / 8.0;
    own + surface.aspheric.get(1).unwrap_or(&0.0) - sphere.powi(3) / 8.0
}

/// Shape of a surface near its vertex.
struct VertexShape {
    /// Curvature (1/mm).
    curvature: f64,
    /// As [`quartic`] has it (1/mm³).
    quartic: f64,
}

fn at_surface(
    [n, n1]: [f64; 2],
    VertexShape { curvature: c, quartic }: VertexShape,
    dispersion: f64,
    [marginal, chief]: [ParaxialRay; 2],
    invariant: f64,
) -> SeidelSums {
    let (h, bar) = (marginal.height, chief.height);
    let a = n * (h * c + marginal.slope);
    let a_bar = n * (bar * c + chief.slope);
    // Δ(1/n), Δ(1/n²), and Δ(u/n) by them: u = A/n − h c.
    let d1 = 1.0 / n1 - 1.0 / n;
    let d2 = 1.0 / (n1 * n1) - 1.0 / (n * n);
    let change = a * d2 - h * c * d1;
    let asphere = 8.0 * quartic * (n1 - n);
    SeidelSums {
        spherical: -a * a * h * change + asphere * h.powi(4),
        coma: -a * a_bar * h * change + asphere * h.powi(3) * bar,
        astigmatism: -a_bar * a_bar * h * change + asphere * (h * bar).powi(2),
        petzval: -invariant * invariant * c * d1,
        distortion: a_bar * (bar * (a_bar * h - invariant) * c * d1 - a_bar * a_bar * h * d2)
            + asphere * h * bar.powi(3),
        longitudinal_colour: a * h * dispersion,
        lateral_colour: a_bar * h * dispersion,
    }
}
