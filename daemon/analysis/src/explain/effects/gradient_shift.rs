//! A gradient profile that lies elsewhere than the map says: true gradient(x) = map(x - shift).

use std::sync::Arc;

use dynocar_model::terms::{Entry, Parameter, gradient};
use dynocar_model::track::Track;
use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Effect, Hypothesis, OnOthers, Proposal};
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::scan::Scan;

/// Shifts that a search starts from are this far apart in m.
const GRID_M: f64 = 25.0;

/// The kind.
pub struct GradientShift;

#[derive(Debug)]
struct Shift {
    track: Arc<Track>,
    length_m: f64,
}

impl Effect for GradientShift {
    fn kind(&self) -> EffectKind {
        EffectKind::GradientShift
    }

    fn propose(&self, scan: &Scan) -> Proposal {
        let Some(hypothesis) = shift(scan) else {
            return Proposal::NotTestable("no gradient profile over the chainage".into());
        };
        let mut best: Option<(f64, f64)> = None;
        let count = (gradient::SHIFT_MAX_M / GRID_M) as i32;
        for k in (-count..=count).filter(|&k| k != 0) {
            let shift_m = GRID_M * f64::from(k);
            let tuple = scan.coarse_tuple(|run, i| {
                let sample = &run.samples()[i];
                let Some(shifted) = hypothesis.gradient_permille(run, i, shift_m) else {
                    return 0.0;
                };
                let change = shifted - sample.gradient_permille.unwrap_or(0.0);
                -change * scan.per_unit_resistance_mps2(sample)
            });
            let decrease = scan.decrease_at_one(&tuple);
            if best.is_none_or(|(_, most)| decrease > most) {
                best = Some((shift_m, decrease));
            }
        }
        let Some((shift_m, _)) = best.filter(|best| best.1 > 0.0) else {
            return Proposal::Candidates(vec![Candidate::new(hypothesis, vec![1.0])]);
        };
        Proposal::Candidates(vec![Candidate::new(hypothesis, vec![shift_m])])
    }

    fn whole(&self, scan: &Scan) -> Option<Candidate> {
        Some(Candidate::new(shift(scan)?, vec![0.0]))
    }
}

/// The declared gradient elsewhere; `None` where the line has none.
fn shift(scan: &Scan) -> Option<Shift> {
    let track = scan.track.filter(|track| track.gradient().is_some())?;
    Some(Shift { track: Arc::clone(track), length_m: scan.train.length_m })
}

impl Shift {
    /// Gradient in ‰ along the travel under a shifted profile.
    fn gradient_permille(&self, run: &RunData, index: usize, shift_m: f64) -> Option<f64> {
        let sample = &run.samples()[index];
        let at = (sample.position_m?, sample.direction);
        gradient::along_travel_permille(&self.track, at, self.length_m, shift_m)
    }
}

impl Hypothesis for Shift {
    fn kind(&self) -> EffectKind {
        EffectKind::GradientShift
    }

    fn parameters(&self) -> &[Parameter] {
        &gradient::SHIFT_PARAMETERS
    }

    fn choice_cost(&self) -> f64 {
        // About so many shifts are as different as independent ones.
        2.0 * 20f64.ln()
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        parameters[0].abs() > gradient::SHIFT_LEAST_M
    }

    fn on_others(&self) -> OnOthers {
        OnOthers::Changes
    }

    fn apply(&self, parameters: &[f64], run: &RunData, first: usize, forces: &mut [SampleForces]) {
        for (i, force) in (first..).zip(forces) {
            if let Some(gradient) = self.gradient_permille(run, i, parameters[0]) {
                force.gradient_permille = gradient;
            }
        }
    }

    fn entries(&self, parameters: &[f64]) -> Option<Vec<Entry>> {
        Some(vec![Entry::TrackNumber(gradient::SHIFT, parameters[0])])
    }
}
