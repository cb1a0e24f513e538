//! Whether the data determine a, b and c at all.

use super::answer::DavisDeviations;
use super::evidence::{Fit, FitProblem};

/// Data that take away less than this share of a coefficient's variance do not determine it.
const ESTIMATED_MIN: f64 = 0.5;

/// Speeds that spread over less than this share of the greatest are one speed.
const VARIED_MIN: f64 = 0.5;

/// Share of the variance of a, b and c before the data that the data take away: 1 where they say
/// all, 0 where they say nothing.
pub fn told_by_data(problem: &FitProblem, deviation: &[f64]) -> DavisDeviations {
    let share = |i: usize| {
        let left = deviation[i] / problem.prior_deviation(i);
        if left.is_finite() { (1.0 - left * left).clamp(0.0, 1.0) } else { 0.0 }
    };
    DavisDeviations { a: share(0), b: share(1), c: share(2) }
}

/// In words which of them the data do not determine, and what would; empty when they determine all.
pub fn undetermined(problem: &FitProblem, fit: &Fit, deviation: &[f64]) -> String {
    let DavisDeviations { a, b, c } = told_by_data(problem, deviation);
    let names = [("a", a), ("b", b), ("c", c)];
    let names: Vec<&str> =
        names.into_iter().filter(|(_, told)| *told < ESTIMATED_MIN).map(|(name, _)| name).collect();
    let mut speeds: Vec<f64> =
        problem.runs.iter().flat_map(|run| run.bins.iter().map(|bin| bin.speed_mps)).collect();
    if names.is_empty() || speeds.is_empty() {
        return String::new();
    }
    speeds.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| speeds[((speeds.len() - 1) as f64 * share) as usize];
    let (slow_mps, usual_mps, fast_mps) = (at(0.05), at(0.5), at(0.95));
    let usual = fit.theta[0] + usual_mps * (fit.theta[1] + usual_mps * fit.theta[2]);
    let advice = if fast_mps - slow_mps < VARIED_MIN * fast_mps {
        "Other speeds would determine them, best by coasting"
    } else {
        "More runs would, or quieter ones"
    };
    format!(
        " These data hardly determine {}: nine tenths of the motion lie between {slow_mps:.1} and \
         {fast_mps:.1} m/s, and what is known of {} is mostly the declared tolerance. Their sum at \
         {usual_mps:.1} m/s is {usual:.2} N/kN. {advice}.",
        names.join(", "),
        if names.len() == 1 { "it" } else { "them" },
    )
}
