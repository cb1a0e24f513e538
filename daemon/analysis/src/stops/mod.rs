//! Analysis of recorded stops with a brake whose force nobody measured: deceleration over speed, the friction
//! behind it, and the length of the next stop.
//!
//! - [`find`]: the spans of a run in which the brake was applied until the train stood
//! - [`DecelerationCurve`]: speed and deceleration along one stop, from its speeds alone
//! - [`DecelerationLaw`]: deceleration over speed of all stops, and the differences between stops
//! - [`StoppingDistance`]: the length of the next stop, with a bound
//! - [`friction`]: the pipelines of Jin 2020 and Xie 2019 over a stop, fed with a brake of unknown force
//! - [`CutOff`]: the moment at which the traction of a braked train ended
//! - [`StopStatistics`]: all stops together, in full or by the driver's choice
//! - [`Study`]: the whole analysis of a dataset

mod deceleration_curve;
mod deceleration_law;
mod find;
mod friction;
mod stop_statistics;
mod study;

pub use deceleration_curve::{DecelerationCurve, DecelerationPoint};
pub use deceleration_law::{
    DecelerationLaw, Gradient, LawPoint, MeasuredResponse, StoppingDistance,
};
pub use find::{CutOff, FindSettings, FoundBy, StopSpan, find};
pub use friction::{FrictionPoint, friction};
pub use stop_statistics::{
    DecelerationSpread, FromSpeed, Manner, QuantileRange, RecordedStop, StopStatistics,
};
pub use study::{Study, StudySettings};
