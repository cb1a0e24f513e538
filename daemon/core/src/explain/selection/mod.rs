//! The search for effects.

mod acceptance;
mod by_run;
mod search;
mod significance;

pub use acceptance::Refusal;
pub use by_run::{Held, deviations, leave_one_run_out};
pub use search::{OBSERVATIONS_MIN, Outcome, Progress, Search, Trial};
pub use significance::{
    AMBIGUOUS, EVIDENCE_MIN, NULL_STRENGTH, NullStrength, STRENGTH_MIN, discounted, model_penalty,
    p_value, penalty,
};
