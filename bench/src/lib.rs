//! The measurements behind every figure that Dynocar's documents state.
//!
//! - [`cli`]: the commands of `dynocar-bench`
//! - [`drive`]: what an automatic driver gains
//! - [`estimators`]: speed of every estimator compared with peers
//! - [`explain`]: the search for undeclared effects on simulated datasets
//! - [`latency`]: sample → snapshot through real processes, compared with the floor and alternatives
//! - [`load`]: many trains against one daemon
//! - [`rig`]: what the two share
//! - [`monitor`]: what the residual monitor suspects on simulated driving, how soon and how wrongly
//! - [`output`]: results for people and for machines
//! - [`parallel`]: the same work over many cases, on some threads
//! - [`papers`]: accuracy of every estimator over seeded runs, compared with the statistical bound
//! - [`scenarios`](mod@scenarios): resistance and mass in a user's day
//! - [`survey`](mod@survey): how the work of a survey grows with passes

pub mod cli;
pub mod drive;
pub mod estimators;
pub mod explain;
pub mod latency;
pub mod load;
pub mod monitor;
pub mod output;
pub mod papers;
pub mod parallel;
pub mod rig;
pub mod scenarios;
pub mod survey;
