//! Verification of what was taken of a tolerance: places of the picture between those that were
//! looked at, and a small picture both ways.

use std::fmt;

use serde::Serialize;

use super::light::{BLOCK, differing, values};
use super::{Approximations, Field, FullView, TakenCamera, Tolerance};
use crate::{Plan, RenderError, RenderedScene, Watch};

/// The longer side of the small pictures, at most.
const SIDE: u32 = 64;

/// Errors that were found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Verified {
    /// The greatest displacement (pixels), and that which is allowed.
    pub displacement: [f64; 2],
    /// Places of the picture where it was measured.
    pub places: usize,
    /// The share of light by which 99 % of blocks of pixels differ, and that which is allowed.
    pub light: [f64; 2],
    /// The same between two pictures with everything and other random numbers: what noise alone makes.
    pub noise: f64,
    /// Blocks that were compared; none where nothing was taken.
    pub blocks: usize,
}

impl Verified {
    /// True if both deviations are within what is allowed, the light's but for its noise.
    #[must_use]
    pub fn is_within(&self) -> bool {
        let [displacement, most] = self.displacement;
        let [light, share] = self.light;
        // Independent errors add up by their squares.
        displacement <= most && light <= share.hypot(self.noise)
    }
}

impl fmt::Display for Verified {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { displacement: [displacement, pixels], places, light, noise, blocks } = self;
        if *blocks == 0 {
            return f.write_str(
                "verified: nothing was taken, so the picture is the one with everything",
            );
        }
        let [light, share] = light.map(|share| 100.0 * share);
        let is_within = if self.is_within() { "within the tolerance" } else { "MORE than allowed" };
        write!(
            f,
            "verified: {is_within}: places displaced by {displacement:.3} px at most ({pixels} allowed, {places} \
             places looked at); light differs by {light:.2} % in 99 % of {blocks} blocks ({share} allowed), where \
             noise alone makes {:.2} %",
            100.0 * noise
        )
    }
}

/// Renders a small part of the `whole` scene with everything and, as what is `rendered` in its place, with what was
/// `taken`, and compares both. They are one where all meshes are the scene's own. What is left out of meshes displaces
/// places by its bound, to which what the lens does is added.
///
/// # Errors
///
/// As a render.
pub fn verify(
    whole: RenderedScene<'_>,
    rendered: RenderedScene<'_>,
    taken: &Approximations,
    watch: &dyn Watch,
) -> Result<Verified, RenderError> {
    let RenderedScene { scene, accel, .. } = whole;
    let tolerance = Tolerance::from(taken.tolerance);
    let is_nothing = taken.camera.is_none() && taken.bounces.is_none() && taken.detail.is_none();
    if is_nothing && taken.images == 0 {
        let [displacement, light] = [[0.0, tolerance.pixels], [0.0, taken.tolerance.light.0]];
        return Ok(Verified { displacement, places: 0, light, noise: 0.0, blocks: 0 });
    }
    // Places between those that the choice was made by.
    let (mut displacement, mut places) = (0.0, 0);
    if let Some(TakenCamera { camera, finding }) = &taken.camera {
        let bands = Plan::new(scene, crate::output::Outputs::ALL).bands;
        let field = Field { rays: scene.accuracy.tolerance_rays, ..Field::BETWEEN };
        let view = FullView::new(scene, accel, &bands, field)?;
        displacement = view.finding(finding.model, camera, tolerance)?.displacement();
        places = view.places.len();
    }
    displacement += taken.detail.map_or(0.0, |detail| detail.displacement);
    // A small picture, whose pixels are blocks of the large one.
    let [width, height] = scene.camera.resolution();
    let factor = width.max(height).div_ceil(SIDE).max(BLOCK);
    let full = scene.camera.coarser(factor);
    let own = Approximations {
        camera: taken.camera.as_ref().map(|taken| TakenCamera {
            camera: taken.camera.coarser(factor),
            finding: taken.finding.clone(),
        }),
        ..taken.clone()
    };
    let samples = scene.accuracy.tolerance_samples;
    let all = values(whole, &full, samples, None, watch)?;
    let less = values(rendered, &full, samples, Some(own), watch)?;
    let mut other = scene.clone();
    other.render.seed ^= 0x9e37_79b9_7f4a_7c15;
    let other = RenderedScene { scene: &other, ..whole };
    let again = values(other, &full, samples, None, watch)?;
    Ok(Verified {
        displacement: [displacement, tolerance.pixels],
        places,
        light: [differing(&less, &all), taken.tolerance.light.0],
        noise: differing(&again, &all),
        blocks: all.len(),
    })
}
