//! Output of an estimator: the quantities that its kind can answer, its estimate in a snapshot, and whether a controller
//! may use it: with hysteresis, since a controller that switches with every doubt drives worse than one that never
//! switches.

use dynocar_shared::snapshot::{PARAMETERS_MAX, packed_index};
use dynocar_shared::{Manoeuvre, Parameter, ParameterSnapshot, PipelineKind, Quantity};
use nalgebra::{SMatrix, SVector};

use super::InnovationMonitor;
use super::motion::BRIDGED_MAX_S;

/// Time in s for which an estimate must be good before it may be used for the first time.
const ENTER_S: f64 = 2.0;
/// Time in s of doubt after which an estimate may no longer be used.
const LEAVE_S: f64 = 0.5;
/// Time in s for which an estimate must be good after it was doubted; twice as long after each further doubt.
const RETURN_FIRST_S: f64 = 5.0;
/// The longest such time in s.
const RETURN_MAX_S: f64 = 600.0;
/// Time in s of use after which earlier doubts are forgotten.
const FORGET_S: f64 = 1200.0;

/// Whether one quantity may be used.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Switch {
    is_usable: bool,
    /// Time in s for which the estimate has contradicted the switch.
    contrary_s: f64,
    /// Time in s for which the estimate must contradict before the switch follows.
    enter_s: f64,
    /// Time in s of use since the last doubt.
    used_s: f64,
}

impl Switch {
    const OFF: Switch = Switch { is_usable: false, contrary_s: 0.0, enter_s: ENTER_S, used_s: 0.0 };

    /// Takes in whether the estimate is good; where it is not, whether it merely waits for an event, like a
    /// braking: that ends its use and is no doubt about it.
    fn see(&mut self, is_good: bool, is_awaiting: bool, step_s: f64) {
        if self.is_usable {
            self.used_s += step_s;
        }
        if is_good == self.is_usable {
            self.contrary_s = 0.0;
            return;
        }
        self.contrary_s += step_s;
        let after_s = if self.is_usable { LEAVE_S } else { self.enter_s };
        if self.contrary_s < after_s {
            return;
        }
        if self.is_usable && !is_awaiting {
            let is_forgotten = self.used_s >= FORGET_S || self.enter_s <= ENTER_S;
            self.enter_s = match is_forgotten {
                true => RETURN_FIRST_S,
                false => (2.0 * self.enter_s).min(RETURN_MAX_S),
            };
            self.used_s = 0.0;
        }
        self.is_usable = is_good;
        self.contrary_s = 0.0;
    }
}

/// Whether each quantity may be used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Usable {
    switches: [Switch; Quantity::ALL.len()],
    last_ns: Option<i64>,
    /// Time in s between the newest two samples whose times grew; a sample whose time does not grow counts as much, so
    /// that a clock that stands still leaves nothing usable.
    step_s: f64,
}

impl Default for Usable {
    fn default() -> Self {
        Usable { switches: [Switch::OFF; Quantity::ALL.len()], last_ns: None, step_s: 0.0 }
    }
}

impl Usable {
    /// Goes on where quantities, one bit each, were usable before a restart: those are with the first good estimate.
    pub fn resumed(usable: u32) -> Self {
        let mut resumed = Usable::default();
        for (switch, quantity) in resumed.switches.iter_mut().zip(Quantity::ALL) {
            if usable & quantity.bit() != 0 {
                switch.enter_s = 0.0;
            }
        }
        resumed
    }

    /// Takes in which quantities are good at a time of the controller's clock in ns, one bit each, and
    /// whether the others merely wait for an event; gives those that may be used.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn see(&mut self, good: u32, is_awaiting: bool, time_ns: i64) -> u32 {
        let before_ns = self.last_ns.replace(time_ns).unwrap_or(time_ns);
        if time_ns > before_ns {
            let step_s = time_ns.saturating_sub(before_ns) as f64 * 1e-9;
            self.step_s = step_s.min(BRIDGED_MAX_S);
        }
        let mut usable = 0;
        for (switch, quantity) in self.switches.iter_mut().zip(Quantity::ALL) {
            switch.see(good & quantity.bit() != 0, is_awaiting, self.step_s);
            usable |= u32::from(switch.is_usable) * quantity.bit();
        }
        usable
    }
}

/// Returns the unit of a parameter in a snapshot over the unit that estimators compute in: a snapshot has the mass in
/// t, the estimators have it in kg.
pub fn contract_unit(parameter: Parameter) -> f64 {
    if parameter == Parameter::Mass { 1e-3 } else { 1.0 }
}

/// Writes parameters with values and full covariance, the mass in kg.
///
/// # Panics
///
/// At compile time when there are more parameters than a snapshot holds.
pub fn write_parameters<const N: usize>(
    snapshot: &mut ParameterSnapshot,
    parameters: [Parameter; N],
    values: &SVector<f64, N>,
    covariance: &SMatrix<f64, N, N>,
) {
    const { assert!(N <= PARAMETERS_MAX) };
    snapshot.parameter_count = N as u32;
    let units = parameters.map(contract_unit);
    for i in 0..N {
        snapshot.parameters[i] = parameters[i] as u32;
        snapshot.values[i] = units[i] * values[i];
        for j in 0..=i {
            snapshot.covariance[packed_index(i, j)] = units[i] * units[j] * covariance[(i, j)];
        }
    }
}

/// Writes the innovation statistics.
pub fn write_innovations(snapshot: &mut ParameterSnapshot, monitor: &InnovationMonitor) {
    snapshot.innovation_normalised = monitor.last();
    snapshot.innovation_mean_square = monitor.mean_square();
    snapshot.innovation_correlation = monitor.correlation();
}

/// The Davis coefficients, in their order.
pub const DAVIS: [Parameter; 3] = [Parameter::DavisA, Parameter::DavisB, Parameter::DavisC];
/// The Davis coefficients and the mass, in their order.
pub const DAVIS_AND_MASS: [Parameter; 4] =
    [Parameter::DavisA, Parameter::DavisB, Parameter::DavisC, Parameter::Mass];
/// Manoeuvre that brings data for each of them.
const MANOEUVRES: [Manoeuvre; 4] =
    [Manoeuvre::CoastSlow, Manoeuvre::VarySpeed, Manoeuvre::CoastFast, Manoeuvre::Accelerate];

/// Bits of those of [`DAVIS_AND_MASS`] that the data determine, and of the manoeuvres that bring data
/// for the others.
pub fn excitation<const N: usize>(is_known: [bool; N]) -> (u32, u32) {
    let mut bits = (0, 0);
    for (i, (is_known, manoeuvre)) in is_known.into_iter().zip(MANOEUVRES).enumerate() {
        match is_known {
            true => bits.0 |= 1 << i,
            false => bits.1 |= manoeuvre.bit(),
        }
    }
    bits
}

/// Returns the kinds that can answer a quantity, the best measured first: unless the configuration names another, the
/// first kind that the train has answers.
///
/// The order is that of `docs/scenarios.md`, then of the errors in `docs/papers.md` and of the share of misleading
/// snapshots in `docs/trust.md`; `docs/guides/reading.md` gives the figures.
pub const fn candidates(quantity: Quantity) -> &'static [PipelineKind] {
    use PipelineKind as Kind;
    match quantity {
        Quantity::Resistance => &[
            Kind::TrainKalman,
            Kind::TrajectoryKalman,
            Kind::ResistanceKalman,
            Kind::JointLeastSquares,
            Kind::VMils,
            Kind::Mils,
            Kind::RegularisedRls,
            Kind::Rls,
            Kind::Ls,
            Kind::TrajectoryNewton,
            Kind::StagedDescent,
        ],
        Quantity::Mass => {
            &[Kind::TrainKalman, Kind::MassKalman, Kind::JointLeastSquares, Kind::StagedDescent]
        }
        Quantity::Adhesion => {
            &[Kind::AdhesionLaw, Kind::AdhesionSmoother, Kind::AdhesionEkf, Kind::AdhesionEm]
        }
        Quantity::BrakeFriction | Quantity::BrakingRatio => {
            &[Kind::BrakeSmoother, Kind::BrakeEkf, Kind::BrakeEm]
        }
    }
}

/// One bit for each quantity that a kind can answer.
pub fn answerable(kind: PipelineKind) -> u32 {
    let can = |quantity: &&Quantity| candidates(**quantity).contains(&kind);
    Quantity::ALL.iter().filter(can).map(|quantity| quantity.bit()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MASS: u32 = Quantity::Mass.bit();

    /// Returns the changes over `duration_s` seconds at 10 Hz.
    fn changes(duration_s: u32, is_good: impl Fn(u32) -> bool) -> (u32, u32) {
        changes_of(duration_s, false, is_good)
    }

    fn changes_of(duration_s: u32, is_awaiting: bool, is_good: impl Fn(u32) -> bool) -> (u32, u32) {
        let mut usable = Usable::default();
        let (mut before, mut changes, mut last) = (0, 0, 0);
        for tick in 0..10 * duration_s {
            let good = if is_good(tick) { MASS } else { 0 };
            last = usable.see(good, is_awaiting, i64::from(tick) * 100_000_000);
            changes += u32::from(last != before);
            before = last;
        }
        (changes, last)
    }

    #[test]
    fn a_good_estimate_is_usable_after_two_seconds_and_doubted_after_half_a_second() {
        assert_eq!(changes(2, |_| true), (0, 0));
        assert_eq!(changes(3, |_| true), (1, MASS));
        assert_eq!(changes(10, |tick| tick < 96), (1, MASS), "less than half a second of doubt");
        assert_eq!(changes(10, |tick| tick < 90), (2, 0));
    }

    #[test]
    fn a_clock_that_stands_still_leaves_nothing_usable() {
        let mut usable = Usable::default();
        for tick in 0..100 {
            usable.see(MASS, false, tick * 100_000_000);
        }
        let stuck: Vec<u32> = (0..10).map(|_| usable.see(0, false, 9_900_000_000)).collect();
        assert_eq!((stuck[0], stuck[9]), (MASS, 0));
    }

    #[test]
    fn an_estimate_that_flickers_or_chatters_for_an_hour_changes_seldom() {
        assert!(changes(3600, |tick| tick % 3 != 0).0 <= 1, "flickers");
        let (often, _) = changes(3600, |tick| tick / 100 % 2 == 0);
        assert!(often <= 12, "ten seconds each way: {often}");
        let (slow, _) = changes(3600, |tick| tick / 1200 % 2 == 0);
        assert!(slow <= 12, "two minutes each way: {slow}");
    }

    #[test]
    fn an_estimate_that_waits_for_the_next_braking_is_usable_again_with_each() {
        let is_braking = |tick: u32| tick % 1000 < 200;
        let (waiting, _) = changes_of(1000, true, is_braking);
        assert_eq!(waiting, 20, "ten brakings of 20 s");
        assert!(changes(1000, is_braking).0 < 12, "a doubt each time");
    }

    #[test]
    fn what_was_usable_before_a_restart_is_with_the_first_good_estimate_and_doubted_as_ever() {
        let mut usable = Usable::resumed(MASS);
        let both = MASS | Quantity::Resistance.bit();
        assert_eq!(usable.see(both, false, 0), MASS);
        let mut at = |good: u32, tenths: i64| usable.see(good, false, tenths * 100_000_000);
        (1..=6).for_each(|tenth| {
            at(0, tenth);
        });
        let back = (7..).find(|&tenth| at(MASS, tenth) == MASS);
        assert!(
            back.is_some_and(|tenth| (56..=57).contains(&tenth)),
            "5 s after a doubt: {back:?}"
        );
    }

    #[test]
    fn a_clock_that_jumps_counts_for_no_more_than_a_gap() {
        let mut usable = Usable::default();
        usable.see(MASS, false, 0);
        assert_eq!(usable.see(MASS, false, i64::MIN), 0);
        usable.see(MASS, false, 0);
        assert_eq!(usable.see(0, false, i64::MAX), 0);
    }
}
