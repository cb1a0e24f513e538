//! A gradient profile that is shifted against the map: true gradient(x) = map(x - shift).

use std::sync::Arc;

use dynocar_model::terms::{ModelEntry, gradient};
use dynocar_model::track::Track;
use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Hypothesis, Nature, On, OnOthers, Policy, Proposal};
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::scan::Scan;

/// Distance in m between the shifts from which a search starts.
const GRID_M: f64 = 25.0;

#[derive(Debug)]
struct Shift {
    track: Arc<Track>,
    length_m: f64,
}

/// An error of the map: the usual errors already contain it.
pub const POLICY: Policy = Policy { is_sought_with_nuisance: false, ..Policy::USUAL };

/// Proposes structures for the data at hand.
pub fn propose(scan: &Scan) -> Proposal {
    let Some(hypothesis) = shift(scan) else {
        return Err("no gradient profile over the chainage".into());
    };
    let decrease = |shift_m: f64| {
        let tuple = scan.coarse_tuple(|run, i| {
            let sample = &run.samples()[i];
            let Some(shifted) = hypothesis.gradient_permille(run, i, shift_m) else { return 0.0 };
            let change = shifted - sample.gradient_permille.unwrap_or(0.0);
            -change * scan.per_unit_resistance_mps2(sample)
        });
        scan.decrease_at_one(&tuple)
    };
    let count = (gradient::SHIFT_MAX_M / GRID_M) as i32;
    let shifts_m = (-count..=count).filter(|&k| k != 0).map(|k| GRID_M * f64::from(k));
    // Of equal ones the first.
    let tried = shifts_m.map(|shift_m| (shift_m, decrease(shift_m))).rev();
    let best = tried.max_by(|one, other| one.1.total_cmp(&other.1)).filter(|best| best.1 > 0.0);
    let start = best.map_or(1.0, |(shift_m, _)| shift_m);
    Ok(vec![Candidate::new(hypothesis, vec![start])])
}

/// The kind as one number of the whole train or line.
pub fn whole(scan: &Scan) -> Option<Candidate> {
    Some(Candidate::new(shift(scan)?, vec![0.0]))
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
    fn nature(&self) -> Nature<'_> {
        Nature {
            least: Some(gradient::SHIFT_LEAST_M),
            // About this many shifts are as different as independent ones.
            choice_cost: 2.0 * 20f64.ln(),
            on_others: OnOthers::Changes,
            ..Nature::new(EffectKind::GradientShift, &gradient::SHIFT_PARAMETERS)
        }
    }

    fn apply(&self, parameters: &[f64], On { run, first, .. }: On, forces: &mut [SampleForces]) {
        for (i, force) in (first..).zip(forces) {
            if let Some(gradient) = self.gradient_permille(run, i, parameters[0]) {
                force.gradient_permille = gradient;
            }
        }
    }

    fn entries(&self, parameters: &[f64]) -> Option<Vec<ModelEntry>> {
        Some(vec![ModelEntry::TrackNumber(gradient::SHIFT, parameters[0])])
    }
}
