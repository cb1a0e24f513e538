//! Correction of the positions for an odometer's drift between the balises that correct it.
//!
//! An odometer shares the error of the wheels: just before a balise, its position is wrong by this error times the
//! distance since the last balise. Gradients, curves and tunnels are then looked up at the wrong chainage, in every run
//! at the same places.

use dynocar_model::simulate::OpenLoopRecording;

use super::positions::{
    CORRECTION_MIN_M, DISTANCE_MIN_M, Distances, END_ERROR_M, between_corrections, distances,
};

/// Least mean distance in m between corrections: closer ones are the noise of positions that come from no odometer.
const APART_MIN_M: f64 = 100.0;
/// Greatest error of an odometer, as a share of the distance.
const RATE_MAX: f64 = 0.1;
/// Least sum of all corrections that is more than chance, in standard deviations.
const CHANCE_STDS: f64 = 2.0;

/// Returns by how many m along the chainage each position of a recording is moved to remove the drift; `None` where too
/// few corrections show it.
pub(super) fn drift_m(recording: &OpenLoopRecording) -> Option<Vec<f64>> {
    let steps = distances(recording);
    let between = between_corrections(&steps);
    let (fixes, counted): (Vec<_>, Vec<_>) = between.iter().partition(|step| step.is_corrected());
    let counted_m: f64 = counted.iter().map(|step: &Distances| step.by_position_m).sum();
    let corrected_m: f64 = fixes.iter().map(|step: &Distances| step.missed_m()).sum();
    let rate = corrected_m / counted_m;
    if counted_m < DISTANCE_MIN_M.max(APART_MIN_M * fixes.len() as f64)
        || rate.abs() > RATE_MAX
        || corrected_m.abs() < CHANCE_STDS * chance_m(between, rate)
    {
        return None;
    }
    let mut moved_m = vec![0.0; recording.samples().len()];
    let direction = |step: &Distances| recording.samples()[step.to].direction;
    for way in steps.chunk_by(|one, other| direction(one) == direction(other)) {
        let mut rest = way;
        while !rest.is_empty() {
            let end = rest.iter().position(Distances::is_corrected);
            let (stretch, behind) = rest.split_at(end.unwrap_or(rest.len()));
            let length_m: f64 = stretch.iter().map(|step| step.by_position_m).sum();
            // A correction far from the usual one is an error of its own.
            let usual_m = rate * length_m;
            let fixed_m = behind.first().map(Distances::missed_m);
            let whole_m =
                fixed_m.filter(|it| (it - usual_m).abs() < END_ERROR_M).unwrap_or(usual_m);
            let mut done_m = 0.0;
            for step in stretch {
                done_m += step.by_position_m;
                moved_m[step.to] = direction(step) * whole_m * done_m / length_m.max(1.0);
            }
            rest = behind.get(1..).unwrap_or_default();
        }
    }
    Some(moved_m)
}

/// Returns the standard deviation in m of the sum of all corrections, from their scatter about those of a constant rate
/// and from the least correction that can be seen; a correction far from the usual one counts as one at its limit.
fn chance_m(between: &[Distances], rate: f64) -> f64 {
    let (mut fixes, mut square_m2, mut counted_m) = (0.0_f64, 0.0, 0.0);
    for step in between {
        if step.is_corrected() {
            fixes += 1.0;
            square_m2 += (step.missed_m() - rate * counted_m).abs().min(END_ERROR_M).powi(2);
            counted_m = 0.0;
        } else {
            counted_m += step.by_position_m;
        }
    }
    let each_m = (square_m2 / (fixes - 1.0).max(1.0)).sqrt();
    fixes.sqrt() * each_m.max(CORRECTION_MIN_M)
}

#[cfg(test)]
mod tests {
    use dynocar_model::force::ResolvedSample;

    use super::super::coasting;
    use super::*;

    /// True chainages in m of a train at 20 m/s, and its recording: wheels that count by a scale, balises that
    /// correct them, and one that is wrong by some m.
    fn recorded(scale: f64, balises_m: &[f64], wrong: (f64, f64)) -> (Vec<f64>, OpenLoopRecording) {
        let mut odometer_m = -4.0 * scale;
        let true_m = |k: i32| 4.0 * f64::from(k);
        let sample = |k: i32| {
            odometer_m += 4.0 * scale;
            let passes = |at_m: &f64| (true_m(k) - 4.0..true_m(k)).contains(at_m);
            if balises_m.iter().any(passes) {
                odometer_m = true_m(k);
            }
            if passes(&wrong.0) {
                odometer_m = true_m(k) + wrong.1;
            }
            ResolvedSample {
                time_ns: (0.2e9 * f64::from(k)) as i64,
                speed_mps: 20.0 * scale,
                position_m: Some(odometer_m),
                ..coasting()
            }
        };
        let samples = (0..2500).map(sample).collect();
        ((0..2500).map(true_m).collect(), OpenLoopRecording::new(samples).unwrap())
    }

    /// Greatest error in m of the positions with the drift taken out, in a part of the way.
    fn error_m((true_m, recording): &(Vec<f64>, OpenLoopRecording), within_m: [f64; 2]) -> f64 {
        let moved_m = drift_m(recording).expect("corrections");
        let each = recording.samples().iter().zip(&moved_m).zip(true_m);
        let within = each.filter(|(_, at_m)| (within_m[0]..within_m[1]).contains(*at_m));
        let errors =
            within.map(|((own, moved_m), at_m)| own.position_m.unwrap_or(0.0) + moved_m - at_m);
        errors.map(f64::abs).fold(0.0, f64::max)
    }

    const BALISES_M: [f64; 8] = [501.0, 1501.0, 2201.0, 3401.0, 5001.0, 6101.0, 7501.0, 9001.0];

    #[test]
    fn positions_are_true_between_balises_before_the_first_and_behind_the_last() {
        for scale in [1.015, 0.985] {
            let all = recorded(scale, &BALISES_M, (-1.0, 0.0));
            assert!(error_m(&all, [0.0, 1e4]) < 0.5);
        }
    }

    #[test]
    fn one_wrong_balise_spoils_only_what_it_moved() {
        let all = recorded(1.015, &BALISES_M, (4001.0, 80.0));
        assert!(error_m(&all, [0.0, 4000.0]) < 3.0);
        assert!(error_m(&all, [5004.0, 1e4]) < 3.0);
    }

    #[test]
    fn corrections_to_both_sides_are_those_of_balises_and_move_nothing() {
        let (_, recording) = recorded(1.0, &[], (-1.0, 0.0));
        let off_m = [0.0, 1.4, 0.1, -1.2, 1.5, -0.3, 1.1, -0.9];
        let mut samples = recording.samples().to_vec();
        for sample in &mut samples {
            let position_m = sample.position_m.expect("a position");
            let passed = BALISES_M.iter().filter(|at_m| **at_m < position_m).count();
            sample.position_m =
                Some(position_m + passed.checked_sub(1).map_or(0.0, |it| off_m[it]));
        }
        assert_eq!(drift_m(&OpenLoopRecording::new(samples).unwrap()), None);
    }

    #[test]
    fn what_nothing_corrects_stays_and_so_does_noise() {
        assert_eq!(drift_m(&recorded(1.015, &[], (-1.0, 0.0)).1), None);
        let everywhere: Vec<f64> = (0..500).map(|k| 20.0 * f64::from(k) + 1.0).collect();
        assert_eq!(drift_m(&recorded(1.3, &everywhere, (-1.0, 0.0)).1), None);
    }
}
