//! Analysis of recorded stops with a brake whose force nobody measured: deceleration over speed, the friction
//! behind it, and the length of the next stop.
//!
//! - [`find`]: where in a run the brake was applied until the train stood
//! - [`Curve`]: speed and deceleration along one stop, from its speeds alone
//! - [`Law`]: deceleration over speed of all stops, and how much stops differ
//! - [`StoppingDistance`]: how long the next stop is, with a bound
//! - [`friction`]: the pipelines of Jin 2020 and Xie 2019 over a stop, fed with a brake of unknown force
//! - [`CutOff`]: when the traction of a braked train was gone
//! - [`Day`]: all stops together, whatever the driver wanted
//! - [`Study`]: all of it over a dataset

mod curve;
mod cut_off;
mod day;
mod find;
mod friction;
mod law;
mod recorded;
mod study;

pub use curve::{Curve, Point};
pub use cut_off::CutOff;
pub use day::{Day, DecelerationSpread, FromSpeed, Spread};
pub use find::{FindSettings, FoundBy, Stop, find};
pub use friction::{FrictionPoint, friction};
pub use law::{Gradient, Law, LawPoint, MeasuredResponse, StoppingDistance};
pub use recorded::{Manner, RecordedStop};
pub use study::{Study, StudySettings};
