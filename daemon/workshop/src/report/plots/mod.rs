//! The plots of the report page, as SVG text.
//!
//! # Layout
//!
//! - [`picture`]: canvas and colours, a figure of the page or a separate file
//! - `axes`: axes, titles, text
//! - [`reading`]: readings at a pointer
//! - [`speeds`], [`series`], [`panel`], [`mod@line`], [`effort`]: the plots

mod axes;
pub mod effort;
pub mod line;
pub mod panel;
pub mod picture;
pub mod reading;
pub mod series;
pub mod speeds;

pub use picture::{Plot, PlotError, Width, as_file, colour_rules, figure, wide_and_narrow};
