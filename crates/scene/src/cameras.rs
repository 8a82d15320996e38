//! The cameras that models bring along, and which one is used.

use crate::import::{CameraProjection, ImportedCamera};
use etendue_camera::{CameraSpec, Pose};
use etendue_geometry::Transform;

/// A camera of a model in the scene.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneCamera {
    /// Its name in the model; may be empty.
    pub name: String,
    /// Index of the object whose model it came with.
    pub object: u32,
    /// The camera: the model's vertical field of view (or height) is kept, and unless the scene
    /// says otherwise the picture has 1024 rows and as many columns as the model's aspect ratio
    /// asks for.
    pub spec: CameraSpec,
}

/// Origin of a scene's camera.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum CameraOrigin {
    /// The scene file gives a camera and its pose.
    Scene,
    /// It was placed so that the whole scene is in the picture.
    Framed,
    /// A model's, by its name or number.
    Model(String),
}

impl SceneCamera {
    /// The camera of a model placed by `world_from_model`; `None` when its numbers make no camera.
    pub(crate) fn new(
        camera: &ImportedCamera,
        object: u32,
        world_from_model: &Transform,
    ) -> Option<Self> {
        let world = world_from_model.then_inner(&camera.model_from_camera);
        let pose = Pose::from_node(world.linear, world.translation + world.translation_low)?;
        let spec = match camera.projection {
            CameraProjection::Perspective { yfov, aspect_ratio } => {
                let aspect = aspect_ratio.unwrap_or(1.0);
                let usable = yfov > 0.0 && yfov < std::f64::consts::PI && is_size(aspect);
                usable.then(|| CameraSpec::perspective(pose, yfov, aspect))
            }
            CameraProjection::Orthographic { xmag, ymag } => {
                let (xmag, ymag) = (xmag.abs(), ymag.abs());
                // Nodes above may scale the view's extent along up.
                let height = 2.0 * ymag * world.linear.y_axis.length();
                let usable = is_size(xmag) && is_size(ymag) && is_size(height);
                usable.then(|| CameraSpec::orthographic(pose, height, xmag / ymag))
            }
        }?;
        Some(Self { name: camera.name.clone(), object, spec })
    }
}

fn is_size(number: f64) -> bool {
    number > 0.0 && number.is_finite()
}

/// The camera called `wanted`, or the one of that number; the error lists what there is.
pub(crate) fn pick<'a>(
    cameras: &'a [SceneCamera],
    wanted: &str,
) -> Result<(usize, &'a SceneCamera), String> {
    let named = cameras.iter().position(|camera| camera.name == wanted && !wanted.is_empty());
    let index = named.or_else(|| wanted.parse().ok());
    match index.and_then(|index| Some((index, cameras.get(index)?))) {
        Some(found) => Ok(found),
        None if cameras.is_empty() => Err("no model of the scene has a camera".to_owned()),
        None => {
            let all = cameras.iter().enumerate();
            let all: Vec<String> =
                all.map(|(index, camera)| format!("{index} \"{}\"", camera.name)).collect();
            Err(format!("no such camera; there are {}", all.join(", ")))
        }
    }
}
