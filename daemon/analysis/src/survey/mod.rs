//! Survey of a line from recordings of trains that drove it with GNSS.
//!
//! A gradient from GNSS altitude is worse than no gradient: noise in a regressor attenuates its coefficient, at the
//! cost of the mass, the rotating mass or the gain of the forces. The forces themselves show the gradient: over many
//! passes, only the gradient changes the balance of forces with the place and with opposite signs in the two
//! directions.
//!
//! # Layout, in the order of reading
//!
//! - [`recording`]: recordings and their one-way parts, on a plane in metres
//! - [`alignment`], `tracking`, `centring`, `both_directions`, [`driven_line`]: the line that
//!   is driven repeatedly
//! - [`chainage`]: a chainage for every row; [`trips`]: one-way trips, and the places where they stop
//! - [`observation`], [`profile`], [`learn`]: gradient, resistance, mass,
//!   time offset and friction brake from the balance of forces; [`normal`], [`banded`]: its unknown heights,
//!   their equations and the solver
//! - [`survey()`]: all steps in order

pub mod alignment;
pub mod banded;
mod both_directions;
mod centring;
pub mod chainage;
pub mod driven_line;
pub mod learn;
pub mod normal;
pub mod observation;
pub mod profile;
pub mod recording;
mod surveying;
mod tracking;
pub mod trips;

pub use surveying::{KnownLine, Survey, SurveyError, SurveyedProfile, Vehicle, survey};
pub use trips::{NotUsed, Trip};
