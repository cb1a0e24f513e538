//! A residual that is real but fits no kind of the library: an extra force of some form, or in a
//! range of some covariate. The kind has no name; the form is what can be said of it.
//!
//! - [`grammar`]: which forms are tried, of what is [`known`] of a covariate; [`shape`]: what they
//!   explain
//! - [`form`]: a force of such a form, of which some numbers are estimated
//! - [`band`]: a force in a range of a covariate ([`band_axis`])

mod band;
mod band_axis;
mod form;
mod grammar;
mod known;
mod shape;

use super::{Candidate, Certainty, Policy, Proposal};
use crate::explain::evidence::SCORE_MIN;
use crate::explain::scan::Scan;

/// Bands and forms that are worth a fit.
const BANDS_MAX: usize = 2;
const FORMS_MAX: usize = 4;

/// Its form is chosen among many, which the usual errors stand for.
pub const POLICY: Policy =
    Policy { certainty: Certainty::BesideUsualErrors, is_one_of_many: true, ..Policy::USUAL };

/// Whether some range of some covariate holds a force that would be accepted: whatever has a form
/// shows there too.
pub fn leaves_a_force(scan: &Scan) -> bool {
    band::bands(scan).first().is_some_and(|best| counts(scan, best))
}

/// Whether some form explains more, at its price, than this advantage.
pub fn a_form_explains_more(scan: &Scan, than: f64) -> bool {
    grammar::greatest_bic_gain(scan) > than
}

/// Whether a band explains its price, and as much more as an effect needs at least.
fn counts(scan: &Scan, (gain, band): &(f64, Candidate)) -> bool {
    let size = (scan.fit.observations().max(2) as f64).ln();
    *gain > band.hypothesis.nature().choice_cost + size + SCORE_MIN
}

/// Bands alone: what is tried beside every kind of the library.
pub fn propose_bands(scan: &Scan) -> Proposal {
    Ok(band::bands(scan).into_iter().map(|(_, candidate)| candidate).take(BANDS_MAX).collect())
}

/// Forms and bands: where the library leaves something.
pub fn propose_forms(scan: &Scan) -> Proposal {
    let forms = grammar::forms(scan).into_iter().take(FORMS_MAX);
    Ok(forms.chain(propose_bands(scan)?).collect())
}
