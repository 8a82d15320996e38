#![forbid(unsafe_code)]
//! Charts on logarithmic axes as SVG: every series is named beside its own points, a value of
//! exactly zero has a place below the axis, and the Pareto front may be drawn.
//!
//! # Map
//!
//! | module | idea |
//! |---|---|
//! | [`chart`](mod@chart) | what is shown |
//! | `axis` | from values to pixels, ticks, and the place of zero |
//! | `names` | where names go, so that none covers another |
//! | `front` | the points that no other beats on both axes |
//! | `draw` | all of it as SVG |
//! | `ink` | lines and letters in the colours of a theme |

mod axis;
pub mod chart;
mod draw;
mod front;
mod ink;
mod names;

pub use chart::{Axis, Chart, GREY, Mark, Point, Series, Stroke, Theme, side_by_side};
pub use front::front;
