//! The accelerators by name: what each can do, and how it is built.

use std::sync::Arc;

use etendue_geometry::Geometry;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Accel, BuildError, BuildOptions, Bvh, Exact};

/// The accelerators by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AccelName {
    /// Intel's Embree.
    Embree,
    /// Pure Rust.
    Bvh,
    /// The f64 reference.
    Exact,
}

impl AccelName {
    /// All of them, the best first.
    pub const ALL: [Self; 3] = [Self::Embree, Self::Bvh, Self::Exact];

    /// Those that this program was built with, the best first.
    pub fn built() -> impl DoubleEndedIterator<Item = Self> {
        Self::ALL.into_iter().filter(|name| name.is_built())
    }

    /// The best that this program was built with.
    #[must_use]
    pub fn best() -> Self {
        Self::built().next().unwrap_or(Self::Bvh)
    }

    /// The accelerator of a name in scenes and commands.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|own| own.name() == name)
    }

    /// Its name in scenes and commands.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Embree => "embree",
            Self::Bvh => "bvh",
            Self::Exact => "exact",
        }
    }

    /// Its kind.
    #[must_use]
    pub const fn description(self) -> &'static str {
        match self {
            Self::Embree => "Intel's Embree",
            Self::Bvh => "Pure Rust",
            Self::Exact => "The f64 reference: slow and right",
        }
    }

    /// True if this program was built with it.
    #[must_use]
    pub const fn is_built(self) -> bool {
        match self {
            Self::Embree => cfg!(feature = "embree"),
            Self::Bvh | Self::Exact => true,
        }
    }

    /// True if it finds hits in f32, and heeds [`BuildOptions::robust`] and [`BuildOptions::refine`]; others work in f64
    /// alone.
    #[must_use]
    pub const fn has_single(self) -> bool {
        match self {
            Self::Embree => true,
            Self::Bvh | Self::Exact => false,
        }
    }

    /// Builds its structure over a scene in which nothing moves.
    ///
    /// # Errors
    ///
    /// As the accelerator's own build; [`BuildError::Library`] where this program was built without it.
    pub fn build(
        self,
        geometry: Arc<Geometry>,
        options: &BuildOptions,
    ) -> Result<Box<dyn Accel>, BuildError> {
        Ok(match self {
            Self::Embree => embree(geometry, options)?,
            Self::Bvh => Box::new(Bvh::build(geometry, options)?),
            Self::Exact => Box::new(Exact::build(geometry, options)?),
        })
    }
}

#[cfg(feature = "embree")]
fn embree(geometry: Arc<Geometry>, options: &BuildOptions) -> Result<Box<dyn Accel>, BuildError> {
    Ok(Box::new(crate::Embree::build(geometry, options)?))
}

#[cfg(not(feature = "embree"))]
fn embree(_: Arc<Geometry>, _: &BuildOptions) -> Result<Box<dyn Accel>, BuildError> {
    let message = "this program was built without Embree".to_owned();
    Err(BuildError::Library { call: "Embree", message })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn accelerators_are_called_as_scenes_write_them_and_all_are_listed() {
        for accel in AccelName::ALL {
            assert_eq!(serde_json::to_value(accel).unwrap(), accel.name());
            assert_eq!(AccelName::named(accel.name()), Some(accel));
        }
        let schema = schemars::schema_for!(AccelName).to_value();
        let words: Vec<_> =
            schema["oneOf"].as_array().unwrap().iter().map(|one| &one["const"]).collect();
        assert_eq!(json!(words), json!(AccelName::ALL.map(AccelName::name)));
    }
}
