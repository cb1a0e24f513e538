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
pub use beside::{deviations_given, is_certain_beside, move_beside_usual_errors};
pub use by_run::{
    Deviations, FORM_SHARE, deviations, deviations_beside, enlarged_by_scatter, few_runs_factor,
    std_with_forms, without_each_run,
};
pub use outcome::{Beside, EffectTrial, SearchOutcome};
pub use price::{discounted, model_penalty, penalty};
pub use refusal::Refusal;
pub use search::{OBSERVATIONS_MIN, Progress, Search};
pub use sources::ScaleSources;
