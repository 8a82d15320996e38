//! The lens cut along y and z, as lines in millimetres: for those who draw themselves.

use super::layout::{bodies, drawn_fields, end_of, fan, heights, strokes};
use crate::glass::GlassError;
use crate::train::{LensReport, OpticalTrain};

/// Points (z, y) of a line (mm): z from the first vertex towards the sensor.
type Polyline = Vec<[f64; 2]>;

/// A lens cut along y and z.
#[derive(Debug, Clone, PartialEq)]
pub struct Section {
    /// Outlines of the bodies of glass.
    pub glasses: Vec<Polyline>,
    /// The elements from the object side.
    pub elements: Vec<DrawnElement>,
    /// Field angles (degrees), and rays from infinity at each that leave the lens.
    pub fans: Vec<(f64, Vec<Polyline>)>,
    /// z of the sensor, and half the height that light reaches there (mm).
    pub sensor: Option<[f64; 2]>,
    /// The least z and y of the glass, the elements and the sensor (mm).
    pub low: [f64; 2],
    /// The greatest.
    pub high: [f64; 2],
}

/// An element in a section.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawnElement {
    /// Its lines.
    pub lines: Vec<Polyline>,
    /// z of its vertex (mm).
    pub vertex: f64,
    /// Height above the axis to which the element is drawn (mm).
    pub height: f64,
    /// True if the element is the aperture stop.
    pub is_stop: bool,
}

impl Section {
    /// The section of `train`, whose report this is.
    ///
    /// # Errors
    ///
    /// When a glass has no index at the lens' wavelength.
    pub fn new(train: &OpticalTrain, report: &LensReport) -> Result<Self, GlassError> {
        let at = train.at(train.wavelength())?;
        let end = end_of(train, report);
        let fields = drawn_fields(report);
        let fans: Vec<_> =
            fields.iter().map(|&field| fan(train, &at, report, field, end, &[])).collect();
        let heights = heights(train, &fans);
        let glasses: Vec<Polyline> =
            bodies(train, &at, &heights).into_iter().map(|body| body.outline).collect();
        let tallest = heights.iter().copied().fold(0.0, f64::max);
        let elements: Vec<DrawnElement> = train
            .elements()
            .iter()
            .zip(&heights)
            .enumerate()
            .map(|(i, (element, &height))| DrawnElement {
                // Marks of a size by themselves take a two-hundredth of the lens.
                lines: strokes(element, height, 0.005 * tallest)
                    .into_iter()
                    .map(|(l, _)| l)
                    .collect(),
                vertex: element.frame.vertex.z,
                height,
                is_stop: i == train.stop(),
            })
            .collect();
        let landed = fans.iter().flat_map(|fan| &fan.rays).filter_map(|ray| ray.last());
        let half = landed.map(|point| point[1].abs()).fold(0.05 * tallest, f64::max);
        let sensor = report.sensor_z.map(|z| [z, half]);
        let fans = fields.into_iter().zip(fans.into_iter().map(|fan| fan.rays)).collect();
        let mut section = Self { glasses, elements, fans, sensor, low: [0.0; 2], high: [end, 0.0] };
        section.measure();
        Ok(section)
    }

    /// Finds what it covers.
    fn measure(&mut self) {
        let lines = self.elements.iter().flat_map(|element| &element.lines);
        let points = lines.chain(&self.glasses).flatten().copied();
        let ends = self.sensor.into_iter().flat_map(|[z, half]| [[z, -half], [z, half]]);
        let (mut low, mut high) = (self.low, self.high);
        for point in points.chain(ends) {
            for axis in 0..2 {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        }
        (self.low, self.high) = (low, high);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::{Focus, Inquiry, LensFile};

    #[test]
    fn a_singlet_has_a_body_two_surfaces_and_a_sensor() {
        let lens = r#"{"elements": [
        {"type": "surface", "radius": 50, "thickness": 4, "glass": {"n": 1.5}, "semi_diameter": 10, "stop": true},
        {"type": "surface", "radius": -50, "semi_diameter": 10}]}"#;
        let train =
            LensFile::from_json(lens).unwrap().build(&|path: &str| Ok(path.into())).unwrap();
        let focus = Focus::Infinity;
        let report = LensReport::new(&train, &Inquiry { focus, ..Inquiry::default() }).unwrap();
        let section = Section::new(&train, &report).unwrap();
        assert_eq!((section.glasses.len(), section.elements.len()), (1, 2));
        assert_eq!([0, 1].map(|i| section.elements[i].vertex), [0.0, 4.0]);
        // The rim of the first surface: z = R − √(R² − h²).
        let rim = section.elements[0].lines[0].last().unwrap();
        assert!(
            (rim[0] - (50.0 - 2400.0_f64.sqrt())).abs() < 1e-12 && (rim[1] - 10.0).abs() < 1e-12
        );
        let [z, _] = section.sensor.unwrap();
        assert_eq!(Some(z), report.sensor_z);
        assert!(section.fans.iter().any(|(_, rays)| !rays.is_empty()));
        assert!(
            section.low[1] <= -10.0 && section.high == [z.max(section.high[0]), section.high[1]]
        );
    }
}
