#![forbid(unsafe_code)]
#![doc = include_str!("../README.md")]
//!
//! # Map
//!
//! | module | idea |
//! |---|---|
//! | [`chart`](mod@chart) | a chart: what it shows, and all of it as SVG |
//! | `axis` | from values to pixels, ticks, the place of zero, the points that no other beats, numbers as people write them |
//! | `canvas` | lines and letters in the colours of a theme, and a page for drawings that are no charts |
//! | `names` | where names go, so that none covers another |

mod axis;
mod canvas;
pub mod chart;
mod names;

pub use axis::{Axis, front, round_length, short, significant};
pub use canvas::{Canvas, Stroke, TextAnchor, Theme};
pub use chart::{Chart, GREY, Mark, Point, Series, side_by_side};
