//! Lenses from a few lines, and single rays through them.

use anyhow::{Result, anyhow};
use etendue_geometry::glam::DVec3;
use etendue_optics::element::{Clip, LensRays, RayStatus};
use etendue_optics::train::{LensFile, OpticalTrain, Side};

/// The yellow line of helium (nm).
pub(super) const YELLOW: f64 = 587.56;

/// The lens whose elements are written in `json`.
pub(super) fn lens(json: &str) -> Result<OpticalTrain> {
    let file = LensFile::from_json(&format!(r#"{{"elements": [{json}]}}"#))?;
    Ok(file.build(&|name: &str| Err(format!("{name}: no files")))?)
}

/// Fate of a ray from the object side. A batch of one has to end as the single ray does, and
/// all numbers have to be finite.
pub(super) fn status(
    train: &OpticalTrain,
    clip: Clip,
    from: DVec3,
    along: DVec3,
) -> Result<RayStatus> {
    let at = train.at(YELLOW)?;
    let path = at.path(Side::Object, clip, from, along);
    let mut rays = LensRays::default();
    rays.push(from, along);
    at.trace(Side::Object, clip, &mut rays);
    let finite = rays.position(0).is_finite() && rays.direction(0).is_finite();
    if !finite || !path.points.iter().all(|p| p.is_finite()) {
        return Err(anyhow!("a ray from {from} along {along} has numbers that are not finite"));
    }
    if rays.status(0) != path.status {
        return Err(anyhow!(
            "a batch of one ends as {:?}, the ray as {:?}",
            rays.status(0),
            path.status
        ));
    }
    Ok(path.status)
}

/// Fate of a ray parallel to the axis at the height `y` (mm).
pub(super) fn parallel(train: &OpticalTrain, clip: Clip, y: f64) -> Result<RayStatus> {
    status(train, clip, DVec3::new(0.0, y, -5.0), DVec3::Z)
}

/// The greatest height (mm) between `low` and `high` from which parallel rays get through, to the last
/// digit: rays at `low` do and rays at `high` do not.
pub(super) fn greatest_height(
    train: &OpticalTrain,
    clip: Clip,
    [mut low, mut high]: [f64; 2],
) -> Result<f64> {
    while low.next_up() < high {
        let middle = f64::midpoint(low, high);
        if parallel(train, clip, middle)? == RayStatus::Exited {
            low = middle;
        } else {
            high = middle;
        }
    }
    Ok(low)
}
