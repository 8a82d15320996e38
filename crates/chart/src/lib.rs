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

mod axis;
pub mod chart;
mod draw;
mod front;
mod names;

pub use chart::{Axis, Chart, Mark, Point, Series, Theme};
pub use front::front;
