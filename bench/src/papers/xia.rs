//! Xia 2023: Davis coefficients by trajectory fit.
//!
//! - [`scenario`]: line, driver and true values from a seed, and the Cramér-Rao bound
//! - [`offline`]: Table 3 (without noise) and Figure 4 (with noise)
//! - [`online`]: Table 4 (coefficients that switch on the way)

mod offline;
mod online;
mod scenario;

use super::row::{PaperRow, Seeds};

/// Returns every line of the comparison for this paper.
///
/// Each line has `seeds` runs; where the paper's method goes over a whole line of 120 km window by window it gets a
/// tenth of them, as the row states.
pub fn rows(seeds: Seeds) -> Vec<PaperRow> {
    let mut rows = offline::convergence_rows(seeds);
    rows.extend(offline::noise_free_rows(seeds));
    rows.extend(offline::noise_rows(seeds));
    rows.extend(online::rows(seeds));
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::papers::xia::scenario::{CASES, DrivingProfile, drive};
    use crate::statistics::KMH;

    #[test]
    fn the_scenarios_keep_to_their_speeds_and_forces() {
        for (profile, length_m, low_kmh, high_kmh) in [
            (DrivingProfile::Cruise, 120e3, 268.0, 306.0),
            (DrivingProfile::Full, 40e3, 6.9, 301.0),
        ] {
            for seed in 0..5 {
                let run = drive(profile, length_m, seed, |_| CASES[0]);
                assert_eq!(run.speeds_mps.len(), run.steps.len() + 1);
                for speed_mps in &run.speeds_mps {
                    let is_within = (low_kmh * KMH..high_kmh * KMH).contains(speed_mps);
                    assert!(is_within, "{profile:?}, seed {seed}: {speed_mps} m/s");
                }
            }
        }
    }

    #[test]
    fn the_bound_is_that_of_the_estimators_own_derivatives() {
        use dynocar_estimators::xia::trajectory::fit::{
            FitSettings, MotionSegment, TrajectoryFitter,
        };
        use dynocar_estimators::xia::trajectory::step::StepRule;
        let run = drive(DrivingProfile::Full, 25e3, 1, |_| CASES[0]);
        let numerical = scenario::davis_covariance(&run, &CASES[0]);
        let settings = FitSettings {
            speed_noise_mps: Some(scenario::SPEED_NOISE_MPS),
            ..FitSettings::new(StepRule::Distance)
        };
        let segments = [MotionSegment { steps: &run.steps, speeds_mps: &run.speeds_mps }];
        let fit = TrajectoryFitter::default().fit(&segments, None, &settings).unwrap();
        for i in 0..3 {
            let ratio = fit.covariance[(i, i)] / numerical[(i, i)];
            assert!((ratio - 1.0).abs() < 1e-3, "{i}: {ratio}");
        }
    }

    #[test]
    fn a_few_runs_already_show_what_the_full_comparison_does() {
        let by = |rows: Vec<PaperRow>, unit: &str| -> Vec<f64> {
            let of_unit = rows.into_iter().filter(|row| row.unit == unit);
            of_unit.map(|row| row.ours.expect("every line has our figure")).collect()
        };
        assert!(
            by(offline::convergence_rows(Seeds::from_zero(2)), "%")
                .iter()
                .all(|share| *share == 100.0)
        );
        assert!(
            by(offline::noise_free_rows(Seeds::from_zero(2)), "N/kN")
                .iter()
                .all(|error| *error < 1e-9)
        );
        let online = online::rows(Seeds::from_zero(2));
        assert!(by(online.clone(), "N/kN")[0] < 0.2);
        assert!(by(online, "km").iter().all(|settling| *settling < 3.0));
    }
}
