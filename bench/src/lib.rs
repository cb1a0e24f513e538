//! The measurements behind every figure that Dynocar's documents state.
//!
//! - [`cli`]: the commands of `dynocar-bench`
//! - `drive`: the gain of an automatic driver
//! - `ending`: Ctrl-C, in every command, and the same work over many cases until then
//! - `estimators`: time of an update of every estimator and pipeline
//! - `explain`: the search for undeclared effects on simulated datasets
//! - `latency`: sample → snapshot through real processes, compared with the floor and alternatives
//! - `load`: many trains against one daemon
//! - `open_loop`: the open loop of `latency` and `load`
//! - `rig`: processes, cores and pipelines
//! - `monitor`: suspicions of the residual monitor on simulated driving, their delay and false alarms
//! - `papers`: accuracy of every estimator over seeded runs, compared with the statistical bound
//! - [`scenarios`](mod@scenarios): resistance and mass in a user's day
//! - `survey`: how the work of a survey grows with passes
//! - [`output`]: results for people and for machines, and failures
//! - `statistics`: means and quantiles over seeded runs, histograms
//!
//! # Examples
//!
//! ```
//! // The command line, as the program parses it.
//! let command = dynocar_bench::cli::command();
//! assert!(command.try_get_matches_from(["program", "--no-such-option"]).is_err());
//! ```

mod brakes;
pub mod cli;
mod drive;
mod ending;
mod estimators;
mod explain;
mod latency;
mod load;
mod monitor;
mod open_loop;
pub mod output;
mod papers;
mod rig;
pub mod scenarios;
mod statistics;
mod survey;
