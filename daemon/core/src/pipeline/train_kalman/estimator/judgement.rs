//! Judgement of the estimate: status and reasons.

use dynocar_shared::{MassSource, Quantity, Reason, Status};

use super::{MOVED_MIN_S, TrainKalman};
use crate::pipeline::judge::{
    InputState, Judgement, LONG_RUN_MAX, StatusInputs, long_run_variance,
};

/// Motion in s before the mass is called known.
const MASS_MOVED_MIN_S: f64 = 3.0;
/// All quantities that this estimator answers.
const COMPLETE: u32 = Quantity::Resistance.bit() | Quantity::Mass.bit();
/// Number of innovations from which on they may be judged to be alike.
const JUDGED_MIN: f64 = 100.0;
/// Mean square from which on the likeness of innovations is judged. No speed is taken for better than
/// [`crate::pipeline::motion::SpeedNoise`] allows, so with speeds without noise innovations are small, and even the
/// smallest error of a model makes them alike.
const JUDGED_SQUARE_MIN: f64 = 0.1;

impl TrainKalman {
    pub(super) fn long_run(&self) -> f64 {
        let monitor = &self.learned.monitor;
        let variance = long_run_variance(monitor.mean_square(), monitor.correlation());
        // In any order, this many innovations add up to no more.
        variance.min(monitor.effective_count() * monitor.mean_square())
    }

    /// Innovations that are alike are made up for by wider intervals, up to a bound. Forces that fit a mass which the train
    /// cannot have leave none.
    pub(super) fn contradiction(&self) -> Option<Reason> {
        if self.learned.monitor.are_too_large() {
            return Some(Reason::InnovationsTooLarge);
        }
        let is_alike = self.learned.monitor.effective_count() >= JUDGED_MIN
            && self.learned.monitor.mean_square() >= JUDGED_SQUARE_MIN
            && self.long_run() > LONG_RUN_MAX;
        let is_outside = || {
            let declared_kg = self.load.declared_kg(self.train_kg);
            self.report.is_mass_outside(declared_kg, self.load.allowed_kg())
        };
        match is_alike {
            true => Some(Reason::InnovationsNotWhite),
            false => is_outside().then_some(Reason::AtBound),
        }
    }

    /// The quantities known after enough motion: the mass after some seconds of traction, the resistance after a while,
    /// or once the first samples confirm the kept estimate.
    pub(super) fn known_now(&self) -> u32 {
        let ready = |quantity: Quantity, after_s: f64| {
            u32::from(self.moved_s >= after_s.min(self.moved_min_s)) * quantity.bit()
        };
        let ready =
            ready(Quantity::Resistance, MOVED_MIN_S) | ready(Quantity::Mass, MASS_MOVED_MIN_S);
        self.report.known() & ready
    }

    pub(super) fn mass_source(&self) -> MassSource {
        if self.report.load_variance() < 0.5 * self.load.prior().1 {
            MassSource::Learned
        } else if self.load.is_weighed {
            MassSource::Weighed
        } else {
            MassSource::Declared
        }
    }

    /// A mass that only waits for the motion after a stop is called so. Before all quantities are known, the status
    /// does not show a contradiction of those that are.
    pub(super) fn judgement(&self, input: &InputState) -> Judgement {
        let (status, reason) = self.case(input).verdict();
        let contradiction = self.contradiction();
        let known = self.known_now();
        let is_waiting = reason == Reason::WeakExcitation
            && contradiction.is_none()
            && self.report.is_load_open()
            && known & Quantity::Resistance.bit() != 0;
        let is_sound = matches!(status, Status::Estimated | Status::Unestimated)
            && input.doubt.is_none()
            && contradiction.is_none();
        Judgement {
            status,
            reason: if is_waiting { Reason::LoadMayHaveChanged } else { reason },
            known: if is_sound { known } else { 0 },
        }
    }

    fn case(&self, input: &InputState) -> StatusInputs {
        let failure = (Status::Invalid, Reason::NumericalFailure);
        StatusInputs {
            fault: self.is_fresh_reset.then_some(failure),
            input: input.doubt,
            is_ready: self.moved_s >= self.moved_min_s.min(MASS_MOVED_MIN_S),
            is_known: self.known_now() == COMPLETE,
            lacking: Status::Unestimated,
            contradiction: self.contradiction(),
            caveat: if self.report.is_load_open() {
                Reason::LoadMayHaveChanged
            } else {
                Reason::None
            },
        }
    }
}
