//! What a lens does to a picture, measured with real rays.

mod colour;
mod distortion;
mod illumination;
mod spots;

pub use colour::{ColourShift, colour_shifts};
pub use distortion::{FieldDistortion, distortion};
pub use illumination::{
    FieldIllumination, half_field, illumination, image_circle, projected_solid_angle,
};
pub use spots::{Spot, spot};

pub use distortion::chief_height;
