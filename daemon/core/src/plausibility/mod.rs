//! Plausibility of samples: wrong units, swapped forces, reversed signs.
//!
//! The same laws judge live samples and recorded runs, both by [`Admission`](crate::pipeline::admission::Admission).
//!
//! # Layout, in the order of the work
//!
//! - `watch`: sample by sample, with [`window_balance`] (forces against acceleration) and `held_forces` (forces that are
//!   refreshed seldom)
//! - [`DetectedFaults`]: which input fault makes all figures come out as they did
//! - [`input_fault`]: the input faults, their names, severity and words
//!
//! # Diagnosis of an input fault: the fault that explains all figures
//!
//! | fault by a factor f of reported over true | forces' factor | distance by position / by speed | gradient's factor |
//! | --- | --- | --- | --- |
//! | forces | 1/f | 1 | 1 |
//! | mass | f | 1 | 1 |
//! | speed | f | 1/f | f |
//! | time | 1/f | 1/f | 1/f |
//! | position | 1 | f | not known |
//! | traction and brake exchanged | -1 | 1 | 1 |

mod held_forces;
pub mod input_fault;
pub(crate) mod watch;
pub mod window_balance;

use input_fault::STUCK_FACTOR;
pub use input_fault::{DetectedFault, InputFault, Severity};

use arrayvec::ArrayVec;
use dynocar_model::terms::masses;
use dynocar_shared::resistance::GRAVITY_MPS2;

use crate::pipeline::admission::limits::MASS;
use watch::Figures;
use window_balance::{FittedFactor, WindowBalance};

/// Factors of forces within these bounds are effects that a train can have, as is another mass.
const FORCE_FACTORS: (f64, f64) = (masses::PARAMETER.lower, masses::PARAMETER.upper);
/// Distance by position over distance by speed within these bounds is wear, gaps and drift.
const DISTANCE_RATIOS: (f64, f64) = (0.8, 1.25);
/// Factors of traction and brake that differ by less are one factor.
const SAME_FACTOR: f64 = 1.6;
/// Steps in s outside these bounds are unusual for a recorder of a train.
const USUAL_STEP_S: (f64, f64) = (0.002, 20.0);
/// Greatest share of the effort curve that a train may use, and the least that is worth a remark.
const EFFORT_SHARES: (f64, f64) = (0.02, 4.0);
/// Gradients in ‰ (root mean square) below and beyond which a wrong unit is credible.
const GRADIENT_RMS_PERMILLE: (f64, f64) = (3.0, 25.0);
/// Factors of the gradient within these bounds are effects that a train and its line can have: those of simulated runs
/// with every effect, large, lie between 0.8 and 1.3, and the gradient of a wrong place looks too large.
const GRADIENT_FACTORS: (f64, f64) = (1.0 / 1.5, 1.4);
/// Windows of a recorded run, and standard deviations from 0, that are enough to judge its gradients by the whole run.
const ALL_WINDOWS_MIN: f64 = 60.0;
const ALL_DEVIATIONS_MIN: f64 = 20.0;
/// Gradients at a wrong place or with noise look too large, too, but leave all of the scatter of the true gradients
/// that they do not explain; a wrong unit leaves less than this share of it.
const SCATTER_SHARE_MAX: f64 = 0.4;
/// A line that is read from its right end leaves less than this share of the scatter that it leaves from the wrong one.
const MIRRORED_SCATTER_MAX: f64 = 0.7;
/// Gradients of another line are no flatter (root mean square in ‰), and the motion shows less than this share of them,
/// with this number of standard deviations added.
const OTHER_LINE_PERMILLE_MIN: f64 = 2.0;
const OTHER_LINE_SHARE_MAX: f64 = 0.5;
const OTHER_LINE_DEVIATIONS: f64 = 4.0;
/// The least mean pressure in Pa of applied brakes; a pressure that is too high is out of range.
const BRAKING_PRESSURE_MIN_PA: f64 = 5e3;
/// An ordinary mean pressure in Pa of applied brakes.
const ORDINARY_PRESSURE_PA: f64 = 1e5;

/// Detected faults at most.
const DETECTED_MAX: usize = 4;

fn add(found: &mut DetectedFaults, fault: InputFault, factor: f64) {
    // Of more than there is room for, the first are the most fundamental.
    let _ = found.try_push(DetectedFault { fault, factor });
}

/// Certain faults of the input, the most fundamental first.
pub type DetectedFaults = ArrayVec<DetectedFault, DETECTED_MAX>;

/// Judges figures.
///
/// # Real-time
///
/// Bounded work, no allocation.
pub fn diagnose(figures: &Figures) -> DetectedFaults {
    let mut found = DetectedFaults::default();
    let kinematic = kinematic(figures);
    if let Some(DetectedFault { fault: InputFault::SpeedScale, factor }) = kinematic
        && factor < STUCK_FACTOR
    {
        // Nothing can be said of forces and gradients without a speed.
        add(&mut found, InputFault::SpeedScale, factor);
        return found;
    }
    let (forces_by, gradients_by) = match kinematic {
        Some(DetectedFault { fault: InputFault::SpeedScale, factor }) => (factor, factor),
        Some(DetectedFault { fault: InputFault::TimeScale, factor }) => {
            (1.0 / factor, 1.0 / factor)
        }
        _ => (1.0, 1.0),
    };
    if let Some(DetectedFault { fault, factor }) = kinematic {
        add(&mut found, fault, factor);
    }
    let mut forces_by = forces_by;
    if let Some(ratio) = figures.mass_ratio.filter(|&ratio| MASS.is_passed(ratio, 1.0)) {
        add(&mut found, InputFault::MassScale, ratio);
        forces_by *= ratio;
    }
    of_forces(figures, forces_by, &mut found);
    if figures.are_forces_stale && found.is_empty() {
        add(&mut found, InputFault::ForcesStale, 1.0);
    }
    if kinematic.is_none() {
        of_gradient(figures, gradients_by, &mut found);
    }
    if let Some(pressure_pa) = figures.braking_pressure_pa
        && pressure_pa < BRAKING_PRESSURE_MIN_PA
    {
        add(&mut found, InputFault::PressureScale, pressure_factor(pressure_pa));
    }
    found
}

fn is_outside(value: f64, (low, high): (f64, f64)) -> bool {
    !(low..=high).contains(&value)
}

/// Returns the input fault that explains how position and speed go together.
fn kinematic(figures: &Figures) -> Option<DetectedFault> {
    let reversed = DetectedFault {
        fault: InputFault::DirectionReversed,
        factor: figures.reversed_ratio.or(figures.distance_ratio)?,
    };
    if !is_outside(-reversed.factor, DISTANCE_RATIOS) {
        return Some(reversed);
    }
    let ratio = figures.distance_ratio?;
    let factor = 1.0 / ratio.abs();
    if factor < STUCK_FACTOR {
        return Some(DetectedFault { fault: InputFault::SpeedScale, factor });
    }
    if ratio.abs() < STUCK_FACTOR {
        return Some(DetectedFault { fault: InputFault::PositionScale, factor: ratio.abs() });
    }
    if !(ratio > 0.0) || !is_outside(ratio, DISTANCE_RATIOS) {
        return None;
    }
    let candidates = [
        (InputFault::SpeedScale, 1.0 / ratio, 1.0 / ratio),
        (InputFault::TimeScale, 1.0 / ratio, ratio),
        (InputFault::PositionScale, ratio, 1.0),
    ];
    let of_forces = common_factor(figures);
    let has_usual_step = !is_outside(figures.step_s, USUAL_STEP_S);
    let is_unlikely = |fault| match fault {
        InputFault::TimeScale => has_usual_step,
        InputFault::PositionScale => !has_usual_step,
        _ => false,
    };
    let misfit = |fault: InputFault, factor: f64, expected: f64| {
        let of_unit = fault.misfit(factor)?;
        Some(match of_forces {
            Some(of_forces) if of_forces > 0.0 => of_unit + (of_forces / expected).ln().abs(),
            // The forces do not show it: a time in another unit shows in the steps.
            _ => of_unit + if is_unlikely(fault) { 1.0 } else { 0.0 },
        })
    };
    let known = candidates.into_iter().filter_map(|(fault, factor, expected)| {
        Some((misfit(fault, factor, expected)?, DetectedFault { fault, factor }))
    });
    known.min_by(|one, other| one.0.total_cmp(&other.0)).map(|(_, fault)| fault)
}

/// Returns the factor of both forces, when they have one.
fn common_factor(figures: &Figures) -> Option<f64> {
    match (figures.slopes.traction, figures.slopes.brake) {
        (Some(one), Some(other)) => {
            let ratio = one / other;
            (1.0 / SAME_FACTOR..SAME_FACTOR).contains(&ratio).then(|| {
                // The geometric mean, with their sign.
                one.signum() * (one * other).sqrt()
            })
        }
        (one, other) => one.or(other),
    }
}

fn of_forces(figures: &Figures, by: f64, found: &mut DetectedFaults) {
    let slopes = figures.slopes;
    if let Some(common) = common_factor(figures).map(|factor| factor / by) {
        if common < -FORCE_FACTORS.0 {
            add(found, InputFault::ForcesSwapped, common);
        } else if is_outside(common, FORCE_FACTORS) {
            let (fault, factor) = blamed(figures, common);
            add(found, fault, factor);
        }
        return;
    }
    let of_one =
        [(InputFault::TractionScale, slopes.traction), (InputFault::BrakeScale, slopes.brake)];
    for (fault, slope) in of_one {
        let Some(factor) = slope else { continue };
        let factor = factor / by;
        if is_outside(factor, FORCE_FACTORS) {
            add(found, fault, 1.0 / factor);
        }
    }
}

/// Returns who is to blame when both forces miss the acceleration by a factor: the speed where its units
/// explain it and no position was recorded with which it would go together or not, the mass where the forces are such as the effort curves
/// allow and would not be otherwise, else the forces.
fn blamed(figures: &Figures, common: f64) -> (InputFault, f64) {
    let of_forces = InputFault::ForcesScale.misfit(common).unwrap_or(f64::INFINITY);
    let has_position = figures.distance_ratio.is_some();
    let of_speed = InputFault::SpeedScale.misfit(common).filter(|_| !has_position);
    if of_speed.is_some_and(|misfit| misfit < of_forces) {
        return (InputFault::SpeedScale, common);
    }
    let shares = figures.effort_shares.iter().flatten().copied();
    let is_mass = shares.reduce(f64::max).is_some_and(|share| {
        !is_outside(share, EFFORT_SHARES) && is_outside(share * common, EFFORT_SHARES)
    });
    if is_mass { (InputFault::MassScale, common) } else { (InputFault::ForcesScale, 1.0 / common) }
}

fn of_gradient(figures: &Figures, by: f64, found: &mut DetectedFaults) {
    let is_right = |slope: f64| !is_outside(slope / by, DISTANCE_RATIOS);
    if let [Some(forth), Some(back)] = figures.gradients_by_direction
        && (is_right(forth) && is_right(-back) || is_right(-forth) && is_right(back))
    {
        add(found, InputFault::GradientAlongTravel, forth.min(back) / by);
        return;
    }
    let Some(slope) = figures.slopes.gradient else { return };
    let factor = slope / by;
    if factor < 0.0 {
        if !is_outside(-factor, DISTANCE_RATIOS) {
            add(found, InputFault::GradientSign, factor);
        }
        return;
    }
    let rms = figures.gradient_rms_permille;
    let is_credible =
        if factor > 1.0 { rms < GRADIENT_RMS_PERMILLE.0 } else { rms > GRADIENT_RMS_PERMILLE.1 };
    let is_beyond_effects = is_outside(factor, FORCE_FACTORS);
    if is_credible && is_beyond_effects && InputFault::GradientScale.misfit(1.0 / factor).is_some()
    {
        add(found, InputFault::GradientScale, 1.0 / factor);
    }
}

/// Judges the gradients of a recorded run by all of it, which shows smaller factors than a few windows do: degrees
/// that were read as per cent.
pub fn gradient_fault(all: &WindowBalance) -> Option<DetectedFault> {
    let [.., gradient] = all.fit()?;
    let FittedFactor { factor, scatter_mps2, .. } = gradient;
    let is_known = all.windows() >= ALL_WINDOWS_MIN && gradient.is_known(ALL_DEVIATIONS_MIN);
    if !is_known || factor < 0.0 || !is_outside(factor, GRADIENT_FACTORS) {
        return None;
    }
    let of_gradients_mps2 = 1e-3 * GRAVITY_MPS2 * all.gradient_rms_permille();
    let left_mps2 = of_gradients_mps2 * (1.0 - factor * factor).max(0.0).sqrt();
    let is_scale = factor > 1.0 || scatter_mps2 < SCATTER_SHARE_MAX * left_mps2;
    is_scale.then_some(DetectedFault { fault: InputFault::GradientScale, factor: 1.0 / factor })
}

/// Judges whether all runs pass a line that is described from its other end; `mirrored` holds the same windows with
/// gradients that are read so. Returns the factor of these, which is below 0 where their sign is reversed, too.
pub fn mirrored_line(all: &WindowBalance, mirrored: &WindowBalance) -> Option<f64> {
    let ([.., own], [.., other]) = (all.fit()?, mirrored.fit()?);
    let is_like_gradients = other.is_known(ALL_DEVIATIONS_MIN)
        && !is_outside(other.factor.abs(), GRADIENT_FACTORS)
        && mirrored.windows() >= ALL_WINDOWS_MIN;
    let explains_more = other.scatter_mps2 < MIRRORED_SCATTER_MAX * own.scatter_mps2;
    (is_like_gradients && explains_more).then_some(other.factor)
}

/// Judges whether all runs pass another line, or the line at quite another place: returns the share of its gradients that
/// their motion shows, where that is little.
pub fn other_line(all: &WindowBalance) -> Option<f64> {
    let [.., gradient] = all.fit()?;
    let FittedFactor { factor, std, .. } = gradient;
    let is_much = factor.abs() + OTHER_LINE_DEVIATIONS * std > OTHER_LINE_SHARE_MAX;
    let is_shown = all.windows() >= ALL_WINDOWS_MIN
        && gradient.is_alone()
        && all.gradient_rms_permille() > OTHER_LINE_PERMILLE_MIN;
    (is_shown && !is_much).then_some(factor)
}

/// Returns the factor of units that brings a pressure next to an ordinary one.
fn pressure_factor(pressure_pa: f64) -> f64 {
    let distance = |factor: &f64| (pressure_pa / factor / ORDINARY_PRESSURE_PA).ln().abs();
    let factors = [1e-5, 1e-3, 1e-2];
    factors
        .into_iter()
        .min_by(|one, other| distance(one).total_cmp(&distance(other)))
        .unwrap_or(1.0)
}

impl Severity {
    /// Returns the head of a line that states a diagnostic.
    pub const fn label(self) -> &'static str {
        match self {
            Severity::Fundamental => "cannot be true",
            Severity::Info | Severity::Warning => "note",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::window_balance::Slopes;
    use super::*;

    fn found(figures: Figures) -> Vec<(InputFault, String)> {
        let words = |it: &DetectedFault| (it.fault, it.to_string());
        diagnose(&Figures { step_s: 0.1, ..figures }).iter().map(words).collect()
    }

    #[test]
    fn a_speed_that_stays_at_zero_is_named_and_nothing_else() {
        let slopes = Slopes { traction: Some(0.0), brake: Some(0.0), ..Slopes::default() };
        let stuck = Figures { distance_ratio: Some(f64::INFINITY), slopes, ..Figures::default() };
        let [(InputFault::SpeedScale, words)] = &found(stuck)[..] else { panic!("one fault") };
        assert!(words.starts_with("the speed stays near 0 while the position runs on"), "{words}");
    }

    #[test]
    fn a_position_that_stands_still_is_named_while_the_train_moves() {
        let slopes = Slopes { traction: Some(1.0), brake: Some(1.0), ..Slopes::default() };
        for ratio in [0.0, -1e-14] {
            let still = Figures { distance_ratio: Some(ratio), slopes, ..Figures::default() };
            let [(InputFault::PositionScale, words)] = &found(still)[..] else {
                panic!("one fault")
            };
            assert!(words.starts_with("the position stands still"), "{words}");
        }
    }

    #[test]
    fn a_gradient_that_is_right_in_one_direction_only_is_given_along_the_travel() {
        let slopes = Slopes { gradient: Some(-0.9), ..Slopes::default() };
        for (by_direction, expected) in [
            ([Some(1.0), Some(-0.95)], InputFault::GradientAlongTravel),
            ([Some(-1.1), Some(1.0)], InputFault::GradientAlongTravel),
            ([None, Some(-0.95)], InputFault::GradientSign),
            ([Some(-1.0), Some(-0.95)], InputFault::GradientSign),
        ] {
            let gradients_by_direction = by_direction;
            let figures = Figures { slopes, gradients_by_direction, ..Figures::default() };
            let faults: Vec<InputFault> = found(figures).into_iter().map(|it| it.0).collect();
            assert_eq!(faults, [expected], "{by_direction:?}");
        }
    }

    #[test]
    fn a_position_that_falls_is_named_whatever_the_way_before() {
        let figures = |distance_ratio, reversed_ratio| Figures {
            distance_ratio,
            reversed_ratio,
            ..Figures::default()
        };
        for figures in [figures(Some(1.0), Some(-0.97)), figures(None, Some(-1.1))] {
            assert_eq!(found(figures)[0].0, InputFault::DirectionReversed);
        }
        assert!(found(figures(Some(1.0), None)).is_empty());
    }

    #[test]
    fn a_speed_with_which_the_position_agrees_has_the_right_unit() {
        let slopes = Slopes { traction: Some(3.6), brake: Some(3.6), ..Slopes::default() };
        let alone = Figures { slopes, ..Figures::default() };
        assert_eq!(found(alone)[0].0, InputFault::SpeedScale);
        let agreed = Figures { distance_ratio: Some(1.0), ..alone };
        let [(InputFault::ForcesScale, words)] = &found(agreed)[..] else { panic!("one fault") };
        assert!(words.ends_with("or the mass wrong?"), "{words}");
    }
}
