//! Bands of a lens that run together in groups, where the scene is traced for each band.
//!
//! Where bands share the paths of the scene ([`BandPaths::Shared`]), a group would save nothing: each costs as much as a
//! scene traced once for all.

use etendue_accel::Accel;
use etendue_scene::Scene;

use super::{Field, FullView, TakenCamera, Tolerance};
use crate::{BandPaths, Plan, RenderError};

/// All bands are looked at: those at the sides of a group are farthest from where they run together.
const ALL_BANDS: Field = Field { bands: usize::MAX, rays: 64, ..Field::QUICK };

/// The name of the model.
pub(super) const NAME: &str = "grouped";

/// Number of group counts that are tried.
const TRIES: usize = 6;

/// The camera of `scene` with its bands in as few groups as stay within the tolerance; `None` where the scene is traced
/// once for all bands, or where more than half as many groups as bands are needed.
pub(super) fn fewest(
    scene: &Scene,
    plan: &Plan,
    accel: &dyn Accel,
    tolerance: Tolerance,
) -> Result<Option<TakenCamera>, RenderError> {
    let most = plan.bands.count() / 2;
    let paths = || BandPaths::of((scene, &scene.camera), &plan.bands, plan.stopping, true);
    let can_pay = || most >= 2 && matches!(paths(), BandPaths::Apart(_));
    let Some(two) = scene.camera.with_bands_grouped(2).filter(|_| can_pay()) else {
        return Ok(None);
    };
    let view = FullView::new(scene, accel, &plan.bands, ALL_BANDS)?;
    // Displacements within a group go as its width.
    let found = view.finding(NAME, &two, tolerance)?;
    if found.is_within {
        return Ok(Some(TakenCamera { camera: two, finding: found }));
    }
    let wanted = 2.0 * found.displacement() / tolerance.pixels;
    let first = match wanted.is_finite() {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "few")]
        true => (wanted.ceil() as usize).max(3),
        false => return Ok(None),
    };
    for count in (first..=most).take(TRIES) {
        let Some(camera) = scene.camera.with_bands_grouped(count) else { break };
        let finding = view.finding(NAME, &camera, tolerance)?;
        if finding.is_within {
            return Ok(Some(TakenCamera { camera, finding }));
        }
    }
    Ok(None)
}
