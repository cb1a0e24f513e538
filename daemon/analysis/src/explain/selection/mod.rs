//! The search for effects.

mod acceptance;
mod deviations;
mod nuisance;
mod outcome;
mod outside;
mod revision;
mod search;
mod small;
mod trying;

pub use acceptance::deciding_score;
pub use deviations::{
    Deviations, EFFECT_FORM_SHARE, deviations, deviations_with_nuisance, enlarged_by_scatter,
    few_runs_factor, std_with_forms, without_each_run,
};
pub use nuisance::{
    ScaleSources, deviations_given, is_certain_with_nuisance, move_to_nuisance_fit,
};
pub use outcome::{
    EffectTrial, NuisanceFit, Refusal, SearchOutcome, discounted, model_penalty, penalty,
};
pub use search::{OBSERVATIONS_MIN, Progress, Search};
