//! Errors of the braking estimators over seeded runs.

use dynocar_core::pipeline::EstimatorSettings;
use dynocar_core::pipeline::braking::intake::Quantity;
use dynocar_core::pipeline::braking::settings::{
    BrakeFactor, BrakingSettings, EStep, EkfSettings, EmSettings, LawSettings, SmootherSettings,
    WalkSettings,
};

use super::bound::Knowledge;
use super::braking::{Braking, DrawnDrift, SPEED_NOISE_MPS, Sought, WINDOW, disc_friction};
use super::braking_run::{Scored, run};
use super::seeds::Seeds;
use super::statistics::mean;

/// Lag in s of our smoother.
pub const LAG_S: f64 = 5.0;
/// The same in steps.
pub const LAG_STEPS: usize = 25;
/// Steps from the middle of a window to its end.
pub const MIDDLE_STEPS: usize = WINDOW - 1 - WINDOW / 2;

/// Runs `work` for every seed, on as many threads as the machine has.
pub fn over_seeds<T: Send>(seeds: Seeds, work: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let threads = std::thread::available_parallelism().map_or(1, |count| count.get());
    let share = seeds.count.div_ceil(threads).max(1);
    std::thread::scope(|scope| {
        let workers: Vec<_> = seeds
            .range()
            .step_by(share)
            .map(|from| {
                let work = &work;
                let until = (from + share as u64).min(seeds.range().end);
                scope.spawn(move || (from..until).map(work).collect::<Vec<_>>())
            })
            .collect();
        workers.into_iter().flat_map(|worker| worker.join().expect("a worker")).collect()
    })
}

/// Errors of one estimator over all runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Mean of |error| / truth in %.
    pub relative_percent: f64,
    /// Root mean square error.
    pub rmse: f64,
    /// Share of 95 % intervals that hold the truth.
    pub coverage: f64,
    /// Mean of (error / claimed standard deviation)².
    pub nees: f64,
    /// Standard error of `nees`, the runs being independent.
    pub nees_standard_error: f64,
}

impl Score {
    /// Degrees of freedom of a chi-square that scatters as `nees` does: the errors of one run
    /// are not independent of each other.
    pub fn nees_freedom(&self) -> f64 {
        2.0 * (self.nees / self.nees_standard_error).powi(2)
    }

    /// The errors of runs, pooled.
    pub fn of(runs: &[Vec<Scored>]) -> Self {
        let pool = |value: fn(&Scored) -> f64| {
            let values: Vec<f64> = runs.iter().flatten().map(value).collect();
            mean(&values)
        };
        let nees_of_runs: Vec<f64> = runs
            .iter()
            .filter(|run| !run.is_empty())
            .map(|run| mean(&run.iter().map(nees).collect::<Vec<_>>()))
            .collect();
        let centre = mean(&nees_of_runs);
        let squares: Vec<f64> = nees_of_runs.iter().map(|nees| (nees - centre).powi(2)).collect();
        Score {
            relative_percent: pool(|scored| 100.0 * (scored.error / scored.truth).abs()),
            rmse: pool(|scored| scored.error * scored.error).sqrt(),
            coverage: pool(|scored| {
                f64::from(u8::from(scored.error.abs() <= 1.959_964 * scored.std))
            }),
            nees: pool(nees),
            nees_standard_error: (mean(&squares) / nees_of_runs.len().max(1) as f64).sqrt(),
        }
    }
}

fn nees(scored: &Scored) -> f64 {
    (scored.error / scored.std).powi(2)
}

/// Scores an estimator over runs, once for each lag.
pub fn score<const LAGS: usize>(
    braking: &Braking,
    seeds: Seeds,
    lags_steps: [usize; LAGS],
    settings: impl Fn(u64) -> EstimatorSettings + Sync,
) -> [Score; LAGS] {
    let runs = over_seeds(seeds, |seed| run(&settings(seed), &braking.simulate(seed), lags_steps));
    std::array::from_fn(|lag| {
        Score::of(&runs.iter().map(|run| run[lag].clone()).collect::<Vec<_>>())
    })
}

/// Settings of the scenario: only positions are measured, and every estimate counts.
fn braking_settings() -> BrakingSettings {
    BrakingSettings {
        uses_speed: false,
        first_speed_std_mps: SPEED_NOISE_MPS / 3.0_f64.sqrt(),
        relative_std_max: 1e6,
        ..BrakingSettings::default()
    }
}

fn reports(sought: Sought) -> BrakeFactor {
    match sought {
        Sought::Ratio => BrakeFactor::Ratio,
        Sought::Adhesion | Sought::Friction => BrakeFactor::Friction,
    }
}

/// The papers' EM from an initial value.
pub fn em(sought: Sought, initial: f64, seed: u64, e_step: EStep) -> EstimatorSettings {
    em_with_cap(sought, initial, seed, e_step, false)
}

/// The papers' EM, with the printed cap or without.
pub fn em_with_cap(
    sought: Sought,
    initial: f64,
    seed: u64,
    e_step: EStep,
    has_printed_cap: bool,
) -> EstimatorSettings {
    let settings = EmSettings {
        braking: braking_settings(),
        initial: Some(initial),
        seed,
        e_step,
        has_printed_cap,
        reports: reports(sought),
        ..EmSettings::default()
    };
    match sought {
        Sought::Adhesion => EstimatorSettings::AdhesionEm(settings),
        Sought::Friction | Sought::Ratio => EstimatorSettings::BrakeEm(settings),
    }
}

/// The papers' baseline from an initial value.
pub fn ekf(sought: Sought, initial: f64) -> EstimatorSettings {
    let settings = EkfSettings {
        braking: braking_settings(),
        initial: Some(initial),
        reports: reports(sought),
        ..EkfSettings::default()
    };
    match sought {
        Sought::Adhesion => EstimatorSettings::AdhesionEkf(settings),
        Sought::Friction | Sought::Ratio => EstimatorSettings::BrakeEkf(settings),
    }
}

/// Our smoother.
pub fn smoother(sought: Sought, lag_s: f64) -> EstimatorSettings {
    let settings = SmootherSettings {
        braking: braking_settings(),
        lag_s,
        reports: reports(sought),
        ..SmootherSettings::default()
    };
    match sought {
        Sought::Adhesion => EstimatorSettings::AdhesionSmoother(settings),
        Sought::Friction | Sought::Ratio => EstimatorSettings::BrakeSmoother(settings),
    }
}

/// Our estimator where the curve over speed is known but for its scale.
pub fn known_law(sought: Sought) -> EstimatorSettings {
    if sought == Sought::Adhesion {
        let settings = LawSettings { braking: braking_settings(), ..LawSettings::default() };
        return EstimatorSettings::AdhesionLaw(settings);
    }
    let friction_law = (0..=98)
        .map(|speed_mps| (f64::from(speed_mps), disc_friction(f64::from(speed_mps))))
        .collect();
    EstimatorSettings::BrakeSmoother(SmootherSettings {
        braking: braking_settings(),
        lag_s: 0.0,
        friction_law: Some(friction_law),
        ..SmootherSettings::default()
    })
}

/// What the smoother presumes of the coefficient, as the bound wants it.
pub fn smoother_knowledge(sought: Sought) -> Knowledge {
    match smoother_walk(sought) {
        WalkSettings::Drift { std_per_s, time_s } => Knowledge::Drift { std_per_s, time_s },
        WalkSettings::Scale { std_after_1_s } => Knowledge::Walk(std_after_1_s),
    }
}

fn smoother_walk(sought: Sought) -> WalkSettings {
    SmootherSettings::default().walk(match sought {
        Sought::Adhesion => Quantity::Adhesion,
        Sought::Friction => Quantity::Friction,
        Sought::Ratio => Quantity::Ratio,
    })
}

/// A braking whose coefficient is drawn from the smoother's own model.
///
/// # Panics
///
/// When the smoother presumes no drift.
pub fn drawn_braking(sought: Sought) -> Braking {
    let WalkSettings::Drift { std_per_s, time_s } = smoother_walk(sought) else {
        panic!("the smoother presumes no drift of {sought:?}");
    };
    Braking {
        sought,
        drawn: Some(DrawnDrift { std_per_s, time_s }),
        from_kmh: 300.0,
        to_kmh: 180.0,
        scored_from_kmh: 265.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::papers::braking::{JIN_TABLE_3, STEP_S, XIE_TABLE_2, XIE_TABLE_3, declared};

    /// Root mean square drift of the achieved share over the scored part of a braking.
    fn drift_per_s(braking: &Braking) -> f64 {
        let moments = braking.nominal();
        let drifts: Vec<f64> = moments
            .windows(2)
            .filter(|pair| pair[1].is_scored)
            .map(|pair| (pair[1].truth - pair[0].truth) / declared(braking.sought) / STEP_S)
            .collect();
        crate::papers::statistics::root_mean_square(&drifts)
    }

    #[test]
    fn the_drift_that_the_smoother_presumes_is_that_of_the_laws() {
        for braking in [XIE_TABLE_2, XIE_TABLE_3, JIN_TABLE_3] {
            let Knowledge::Drift { std_per_s, .. } = smoother_knowledge(braking.sought) else {
                panic!("a drift");
            };
            let ratio = drift_per_s(&braking) / std_per_s;
            assert!((0.5..2.0).contains(&ratio), "{braking:?}: {ratio}");
        }
    }

    #[test]
    fn every_seed_is_run_once_and_in_order() {
        for (first, count) in [(0, 0), (0, 1), (3, 2), (5, 7)] {
            let seeds = Seeds { first, count };
            let expected: Vec<u64> = seeds.range().collect();
            assert_eq!(over_seeds(seeds, |seed| seed), expected);
        }
    }

    #[test]
    fn a_score_of_exact_gaussian_errors_is_consistent() {
        // Errors of +- one standard deviation: NEES 1, all covered, 1 % of the truth.
        let scored = |sign: f64| Scored { time_s: 0.0, truth: 2.0, error: 0.02 * sign, std: 0.02 };
        let score = Score::of(&[vec![scored(1.0), scored(-1.0)], vec![scored(1.0)]]);
        assert!((score.relative_percent - 1.0).abs() < 1e-12);
        assert!((score.rmse - 0.02).abs() < 1e-15);
        assert!((score.nees - 1.0).abs() < 1e-12);
        assert_eq!((score.coverage, score.nees_standard_error), (1.0, 0.0));
    }
}
