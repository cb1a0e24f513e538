//! A residual that is real but fits no kind of the library: an extra force of some form, or in a range of some
//! covariate. The kind has no name, so that the answer states the form.
//!
//! - [`grammar`]: the forms that are tried, and the gain of each; [`known`]: the values of a covariate
//! - [`form`]: a force of such a form, of which some numbers are estimated, and whether it is more than a wrong scale of a
//!   control force
//! - [`band`]: a force in a range of a covariate

mod band;
mod form;
mod grammar;
mod known;

use super::{Candidate, Certainty, Policy, Proposal};
use crate::explain::evidence::SCORE_MIN;
use crate::explain::scan::Scan;

/// Greatest number of bands and of forms that are fitted.
const BANDS_MAX: usize = 2;
const FORMS_MAX: usize = 4;

/// Its form is chosen among many, and some form may explain the usual errors.
pub const POLICY: Policy =
    Policy { certainty: Certainty::WithNuisance, is_one_of_many: true, ..Policy::USUAL };

/// Returns whether a range of a covariate contains a force that would be accepted: any force with a form shows there
/// too.
pub fn leaves_a_force(scan: &Scan) -> bool {
    band::bands(scan).first().is_some_and(|best| counts(scan, best))
}

/// Returns whether some form explains more, at its price, than this BIC gain.
pub fn a_form_explains_more(scan: &Scan, than: f64) -> bool {
    grammar::greatest_bic_gain(scan) > than
}

/// Returns whether a band explains its price and the least acceptance score.
fn counts(scan: &Scan, (gain, band): &(f64, Candidate)) -> bool {
    let size = (scan.fit.observations().max(2) as f64).ln();
    *gain > band.hypothesis.nature().choice_cost + size + SCORE_MIN
}

/// Proposes bands alone, which are tried in the same round as the kinds of the library.
pub fn propose_bands(scan: &Scan) -> Proposal {
    Ok(band::bands(scan).into_iter().map(|(_, candidate)| candidate).take(BANDS_MAX).collect())
}

/// Proposes forms and bands, where the library leaves a force.
pub fn propose_forms(scan: &Scan) -> Proposal {
    let forms = grammar::forms(scan).into_iter().take(FORMS_MAX);
    Ok(forms.chain(propose_bands(scan)?).collect())
}
