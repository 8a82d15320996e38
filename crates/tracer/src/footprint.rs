//! Footprint on a surface that a sample of the picture stands for: a cone around each ray, which is as wide
//! as its share of a pixel and grows with the way.
//!
//! # Sources
//!
//! * Cones around rays: Akenine-Möller et al., "Texture Level of Detail Strategies for Real-Time Ray
//!   Tracing", *Ray Tracing Gems*, 2019, section 20.3; a plane mirror leaves the spread as it is
//!   (curved ones are taken for plane).
//! * The ellipse that a cone cuts out of a surface: Akenine-Möller et al., "Improved Shader and Texture
//!   Level of Detail Using Ray Cones", JCGT 10 (1), 2021, section 5.

use etendue_geometry::glam::DVec3;

/// Grazing rays see no more of a surface than this (a cosine).
const LEAST_COSINE: f64 = 1e-4;

/// Extent that one sample of the picture covers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pixel {
    /// A side per distance along the camera's axis, where rays pass through a point.
    Angle(f64),
    /// A side (m), where rays are parallel.
    Width(f64),
}

/// A cone around a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cone {
    /// Its width at the ray's start (m).
    pub width: f64,
    /// By how much it widens per length of the ray.
    pub spread: f64,
}

impl Cone {
    /// The cone after this way (m).
    #[must_use]
    pub fn after(self, way: f64) -> Self {
        Self { width: self.width + self.spread * way, ..self }
    }
}

/// A cone where it meets a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Footprint {
    /// The ray's unit direction.
    pub direction: DVec3,
    /// The cone's width there (m).
    pub width: f64,
}

impl Footprint {
    /// The axes of the ellipse that it covers of a triangle, by the edges from its first corner to the others (m), in the
    /// texture coordinates of its corners; `None` where it has no area.
    pub(crate) fn extent(
        &self,
        [e1, e2]: [DVec3; 2],
        [a, b, c]: [[f64; 2]; 3],
    ) -> Option<[[f64; 2]; 2]> {
        let Self { direction, width } = *self;
        let cross = e1.cross(e2);
        let squared = cross.length_squared();
        let normal = cross.try_normalize()?;
        let cosine = normal.dot(direction);
        let along = (direction - normal * cosine).try_normalize();
        let along = along.unwrap_or_else(|| normal.any_orthonormal_vector());
        let long = along * (width / cosine.abs().max(LEAST_COSINE));
        let short = normal.cross(along) * width;
        let extent = [long, short].map(|axis| {
            let x = axis.cross(e2).dot(cross) / squared;
            let y = e1.cross(axis).dot(cross) / squared;
            [0, 1].map(|k| x * (b[k] - a[k]) + y * (c[k] - a[k]))
        });
        extent.iter().flatten().all(|x| x.is_finite()).then_some(extent)
    }
}
