//! Light-field cameras: a lens, an array of lenslets where its picture is, and a sensor behind; and the
//! views that such a camera takes.
//!
//! | module | idea |
//! |---|---|
//! | [`spec`] | the cameras of the scene file, and the distances that follow from f-numbers |
//! | [`grid`] | which lenslets make the pixels of a view, and where the sensor has them |
//! | [`views`] | the reference: the views as an ideal lens has them |
//!
//! # Views
//!
//! A pixel beside the middle of a lenslet's image sees the same part of the lens' opening through every
//! lenslet. A view takes the pixel at one offset from each: its columns and rows are those of the lenslets.
//! With S the height on the array of a slope of 1 through the entrance pupil's middle (mm), σ the slope at
//! the array per distance from the image's middle on the sensor (1/mm), and w a raw pixel's width (mm), an
//! offset of δ raw pixels to the right is a viewpoint S σ w δ (mm) to the right in the entrance pupil. Views
//! step along the rows of lenslets and across them, so that disparity is along rows and columns of a view
//! however the array is turned.
//!
//! That holds where lenslets image the opening: parallel light in front of one comes together in a pixel.
//! In a focused camera (A. Lumsdaine, T. Georgiev, "The focused plenoptic camera", 2009) it does not, and
//! [`LightField::no_views`] says so.

pub mod grid;
pub mod spec;
pub mod views;

pub use grid::{LensletGrid, LightField};
pub use spec::{LightFieldSpec, MicrolensesSpec};
pub use views::ViewGrid;
