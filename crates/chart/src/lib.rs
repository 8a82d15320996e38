#![forbid(unsafe_code)]
//! Charts as SVG: every series is named beside its own points, a value of exactly zero has a place
//! below a logarithmic axis, and the Pareto front may be drawn. Drawings that are no charts share their
//! paper, ink and colours.
//!
//! # Map
//!
//! | module | idea |
//! |---|---|
//! | [`chart`](mod@chart) | what is shown |
//! | `axis` | from values to pixels, ticks, and the place of zero |
//! | `canvas` | a page for drawings that are no charts |
//! | `numbers` | numbers as people write them |
//! | `names` | where names go, so that none covers another |
//! | `front` | the points that no other beats on both axes |
//! | `draw` | all of it as SVG |
//! | `ink` | lines and letters in the colours of a theme |

mod axis;
mod canvas;
pub mod chart;
mod draw;
mod front;
mod ink;
mod names;
mod numbers;

pub use canvas::Canvas;
pub use chart::{Axis, Chart, GREY, Mark, Point, Series, Stroke, Theme, side_by_side};
pub use front::front;
pub use ink::TextAnchor;
pub use numbers::{round_length, short, significant};
