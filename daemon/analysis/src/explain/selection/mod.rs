//! The search for effects.

mod acceptance;
mod beside;
mod by_run;
mod outcome;
mod outside;
mod price;
mod refusal;
mod revision;
mod search;
mod small;
mod sources;
mod trying;

pub use acceptance::deciding_score;
pub use beside::{deviations_given, given_usual_errors, is_certain_beside};
pub use by_run::{
    Deviations, FORM_SHARE, deviations, deviations_beside, few_runs_factor, without_each_run,
};
pub use outcome::{Beside, EffectTrial, SearchOutcome};
pub use price::{discounted, model_penalty, penalty};
pub use refusal::Refusal;
pub use search::{OBSERVATIONS_MIN, Progress, Search};
pub use sources::ScaleSources;
