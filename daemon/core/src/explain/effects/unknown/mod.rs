//! A residual that is real but fits no kind of the library: an extra force of some form, or in a
//! range of some covariate. The kind has no name; the form is what can be said of it.
//!
//! - [`grammar`]: which forms are tried
//! - [`form`]: a force of such a form
//! - [`band`]: a force in a range of a covariate ([`band_axis`])

mod band;
mod band_axis;
mod form;
mod grammar;

use dynocar_shared::vocabulary::EffectKind;

use super::{Effect, Proposal};
use crate::explain::scan::Scan;

/// The library comes first: what is outside must explain more than a known kind.
const OUTSIDE_COST: f64 = 10.0;
/// Bands and forms that are worth a fit.
const BANDS_MAX: usize = 2;
const FORMS_MAX: usize = 4;

/// The kind.
pub struct Unknown;

impl Effect for Unknown {
    fn kind(&self) -> EffectKind {
        EffectKind::Unknown
    }

    fn propose(&self, scan: &Scan) -> Proposal {
        let bands = band::bands(scan);
        // Whatever has a form shows in some range of some covariate too.
        let shows = bands.first().is_some_and(|(gain, band)| *gain > band.hypothesis.choice_cost());
        let forms = if shows { grammar::forms(scan) } else { Vec::new() };
        let bands = bands.into_iter().map(|(_, candidate)| candidate).take(BANDS_MAX);
        Proposal::Candidates(forms.into_iter().take(FORMS_MAX).chain(bands).collect())
    }
}
