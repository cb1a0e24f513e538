//! Months of one train in accelerated time: undeclared effects appear and go, and the loop of learning, trying,
//! adopting and taking back has to follow.
//!
//! No processes and no clocks: the simulator drives the trips of each day; the models on trial and the residual monitor
//! take every trip, the learner only the trips that a recorder would have kept. A rule adopts the models. Everything
//! follows from the seed.
//!
//! - [`story`]: the undeclared effect of each day
//! - [`life`]: the days
//! - [`mistakes`]: how often a model that is no better is adopted, over hundreds of years
//! - [`table`]: the outcome

pub mod life;
pub mod mistakes;
pub mod story;
pub mod table;

pub use life::Life;
pub use story::{LifeSettings, Story};
pub use table::LifeOutcome;
