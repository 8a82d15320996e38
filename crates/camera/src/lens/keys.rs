//! Keys that every camera with a lens has in a scene file.

/// Declares a camera with a lens by its own keys, those that say what the `lens` is, where it is in `focus` and what
/// becomes of its `light`, and by words for its `sensor`; the keys that all of them have are added.
macro_rules! lens_camera_spec {
    (
        $(#[$about:meta])*
        pub struct $name:ident {
            lens { $($(#[$lens_attribute:meta])* pub $lens_key:ident: $lens_kind:ty,)* }
            focus { $($(#[$focus_attribute:meta])* pub $focus_key:ident: $focus_kind:ty,)* }
            light { $($(#[$light_attribute:meta])* pub $light_key:ident: $light_kind:ty,)* }
            $(#[$sensor_about:meta])* sensor
        }
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields)]
        pub struct $name {
            $($(#[$lens_attribute])* pub $lens_key: $lens_kind,)*
            /// Closes the stop to this f-number: focal length over the entrance pupil's diameter,
            /// for an object at infinity.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub f_number: Option<f64>,
            $($(#[$focus_attribute])* pub $focus_key: $focus_kind,)*
            /// Losses of light in the lens; none when absent.
            #[serde(default, skip_serializing_if = "is_zero")]
            pub losses: LossesSpec,
            $($(#[$light_attribute])* pub $light_key: $light_kind,)*
            /// Pose of the entrance pupil; when absent, the whole scene is framed and what is
            /// in its middle is in focus.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub pose: Option<PoseSpec>,
            /// When rows are open to light; all together, for as long as the sensor exposes, when absent.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub shutter: Option<ShutterSpec>,
            /// Motion of the camera; it stands still when absent.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub motion: Option<CameraMotionSpec>,
            $(#[$sensor_about])*
            #[serde(default)]
            pub sensor: SensorSpec,
        }
    };
}

pub(crate) use lens_camera_spec;

/// True if a key holds what it does when it is absent, and need not be written.
pub(crate) fn is_zero<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}
