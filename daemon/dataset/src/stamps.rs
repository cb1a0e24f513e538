//! Forces that act before their stamps: recorders that average over the time before the stamp.

/// Forces stamped late by less than this many s, or standard deviations, do not count as late.
const LATE_MIN: (f64, f64) = (0.01, 3.0);
/// A force is not taken across a longer step in s.
const STEP_MAX_S: f64 = 2.5;

/// Returns whether forces act long enough before their stamps that it counts.
pub fn is_stamped_late(late_s: f64, std_s: f64) -> bool {
    late_s > LATE_MIN.0 && late_s > LATE_MIN.1 * std_s
}

/// The force at a stamp by forces that are stamped `late_s` late: what stands `late_s` further on a
/// straight line to the next sample, `step_s` ahead.
#[inline]
pub fn stamped_late(here: f64, ahead: f64, step_s: f64, late_s: f64) -> f64 {
    let is_near = step_s > 0.0 && step_s <= STEP_MAX_S;
    if is_near { here + (late_s / step_s).min(1.0) * (ahead - here) } else { here }
}
