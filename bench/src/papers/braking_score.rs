//! Pipelines over simulated brakings, and their errors over seeded runs.

use std::sync::Arc;

use dynocar_analysis::parallel::of_each_number;
use dynocar_core::pipeline::Outcome;
use dynocar_core::pipeline::braking::intake::BrakingCoefficient;
use dynocar_core::pipeline::braking::settings::{
    BrakeFactor, BrakingSettings, EkfSettings, LawSettings, SmootherSettings,
};
use dynocar_core::pipeline::judge::InputState;
use dynocar_estimators::EstimatorSettings;
use dynocar_estimators::xie::EmSettings;
use dynocar_model::force::ResolvedSample;
use dynocar_model::train::TrainModel;
use dynocar_shared::{Parameter, ParameterSnapshot};

use super::braking::{
    Braking, BrakingMoment, PRESSURE_PA, SPEED_NOISE_MPS, STEP_S, ShareStep, WINDOW, disc_friction,
    train,
};
use super::row::{PaperRow, PaperScore, Seeds};
use crate::statistics::{mean, root_mean_square};

/// Lag in s of our smoother.
pub const LAG_S: f64 = 5.0;
/// The same in steps.
pub const LAG_STEPS: usize = 25;
/// Steps from the middle of a window to its end.
pub const MIDDLE_STEPS: usize = WINDOW - 1 - WINDOW / 2;

/// Returns the sample that a pipeline sees at a moment.
fn resolved(train: &TrainModel, moment: &BrakingMoment, is_first: bool) -> ResolvedSample {
    ResolvedSample {
        time_ns: (moment.time_s * 1e9).round() as i64,
        step_s: if is_first { 0.0 } else { STEP_S },
        position_m: Some(moment.measured_m),
        speed_mps: moment.measured_mps,
        mass_kg: train.mass_kg,
        inertial_mass_kg: train.mass_kg * (1.0 + train.rotating_mass_factor),
        weight_kn: TrainModel::weight_kn(train.mass_kg),
        traction_force_n: None,
        brake_force_n: None,
        gradient_permille: Some(0.0),
        brake_cylinder_pressure_pa: Some(PRESSURE_PA),
        ..ResolvedSample::coasting()
    }
}

/// An estimate and the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScoredBraking {
    /// The true coefficient.
    pub truth: f64,
    /// Estimate minus truth.
    pub error: f64,
    /// Its claimed standard deviation.
    pub std: f64,
}

/// Runs a pipeline over a braking and scores its updates once for each lag: as if an estimate belonged to the
/// moment that many steps before its update.
pub fn run<const LAGS: usize>(
    settings: &EstimatorSettings,
    moments: &[BrakingMoment],
    lags_steps: [usize; LAGS],
) -> [Vec<ScoredBraking>; LAGS] {
    let train = Arc::new(train());
    let mut estimator = settings.build(&train).expect("valid settings");
    let mut snapshot = ParameterSnapshot::empty();
    let mut scored = std::array::from_fn(|_| Vec::new());
    for (k, moment) in moments.iter().enumerate() {
        if estimator.update(&resolved(&train, moment, k == 0)) != Outcome::Updated {
            continue;
        }
        estimator.write(&InputState::default(), &mut snapshot);
        let Some((value, std)) = coefficient(&snapshot) else { continue };
        for (lag_steps, scored) in lags_steps.into_iter().zip(&mut scored) {
            let of = k.checked_sub(lag_steps).map(|i| &moments[i]);
            if let Some(of) = of.filter(|of| of.is_scored) {
                let error = value - of.truth;
                scored.push(ScoredBraking { truth: of.truth, error, std });
            }
        }
    }
    scored
}

/// Returns the coefficient of a snapshot, be it a number or a bound.
fn coefficient(snapshot: &ParameterSnapshot) -> Option<(f64, f64)> {
    use Parameter::{Adhesion, AdhesionLowerBound, BrakingRatio, DiscFriction};
    [Adhesion, AdhesionLowerBound, DiscFriction, BrakingRatio]
        .into_iter()
        .find_map(|parameter| Some((snapshot.value(parameter)?, snapshot.std(parameter)?)))
}

/// Runs `work` for every seed, on as many threads as the machine has.
pub fn over_seeds<T: Send>(seeds: Seeds, work: impl Fn(u64) -> T + Sync) -> Vec<T> {
    of_each_number(seeds.count, |number| work(seeds.first + number as u64))
}

/// Errors of one estimator over all runs.
#[derive(Clone, Debug)]
pub struct BrakingScore {
    errors: PaperScore,
    /// Mean of |error| / truth in %.
    pub relative_percent: f64,
    /// Mean of (error / claimed standard deviation)² of each run.
    nees_of_runs: Vec<f64>,
}

impl BrakingScore {
    /// Returns the root mean square error.
    pub fn rmse(&self) -> f64 {
        root_mean_square(&self.errors.errors)
    }

    fn nees_run_variance(&self) -> f64 {
        let centre = mean(&self.nees_of_runs);
        mean(self.nees_of_runs.iter().map(|nees| (nees - centre).powi(2)))
    }

    /// Degrees of freedom of a chi-square that scatters as the mean NEES does: the errors of one run
    /// are not independent of each other.
    pub fn nees_freedom(&self) -> f64 {
        let (nees, runs) = (self.errors.nees(), self.nees_of_runs.len() as f64);
        2.0 * nees * nees * runs / self.nees_run_variance()
    }

    /// Returns the same where all runs share one curve of the coefficient, given the score of runs that
    /// draw a curve each.
    ///
    /// The claimed variance counts with the curves that the estimator presumes; one curve is one
    /// of them, however many runs are made of it. The runs' scatter shows the noise alone, that
    /// of drawn runs noise and curve, which falls with the length of a run.
    pub fn nees_freedom_of_one_curve(&self, drawn: &BrakingScore) -> f64 {
        let runs = |it: &BrakingScore| it.nees_of_runs.len() as f64;
        let length = |it: &BrakingScore| it.errors.errors.len() as f64 / runs(it).max(1.0);
        let own = self.nees_run_variance();
        let both = drawn.nees_run_variance() * length(drawn) / length(self);
        2.0 / ((both - own).max(0.0) + own / runs(self))
    }

    /// Returns a row with coverage and consistency, with `freedom` degrees of freedom.
    pub fn row(&self, freedom: f64, row: PaperRow) -> PaperRow {
        PaperRow { nees_freedom: Some(freedom), ..self.errors.row(row) }
    }

    /// Returns the errors of runs, pooled.
    pub fn from_runs<'a>(runs: impl Iterator<Item = &'a Vec<ScoredBraking>>) -> Self {
        let (mut errors, mut relative, mut nees_of_runs) =
            (PaperScore::default(), Vec::new(), Vec::new());
        for run in runs.filter(|run| !run.is_empty()) {
            nees_of_runs.push(mean(run.iter().map(|it| (it.error / it.std).powi(2))));
            relative.extend(run.iter().map(|it| 100.0 * (it.error / it.truth).abs()));
            run.iter().for_each(|it| errors.take(it.error, it.std));
        }
        BrakingScore { errors, relative_percent: mean(&relative), nees_of_runs }
    }
}

/// Scores an estimator over runs, once for each lag.
pub fn score<const LAGS: usize>(
    braking: &Braking,
    seeds: Seeds,
    lags_steps: [usize; LAGS],
    settings: impl Fn(u64) -> EstimatorSettings + Sync,
) -> [BrakingScore; LAGS] {
    let runs = over_seeds(seeds, |seed| run(&settings(seed), &braking.simulate(seed), lags_steps));
    std::array::from_fn(|lag| BrakingScore::from_runs(runs.iter().map(|run| &run[lag])))
}

/// Settings of the scenario: only positions are measured, and every estimate counts.
fn braking_settings() -> BrakingSettings {
    BrakingSettings {
        uses_speed: false,
        first_speed_std_mps: SPEED_NOISE_MPS / 3.0_f64.sqrt(),
        relative_std_max: 1e6,
        // The papers' brakes exert the force that they report.
        demand_relative_std: 0.03,
        ..BrakingSettings::default()
    }
}

fn reports(sought: BrakingCoefficient) -> BrakeFactor {
    match sought {
        BrakingCoefficient::Ratio => BrakeFactor::Ratio,
        BrakingCoefficient::Adhesion | BrakingCoefficient::Friction => BrakeFactor::Friction,
    }
}

/// Returns the settings of the kind for adhesion, or of the similar kind for friction and braking ratio.
fn of_kind<S>(
    sought: BrakingCoefficient,
    settings: S,
    [adhesion, brake]: [fn(S) -> EstimatorSettings; 2],
) -> EstimatorSettings {
    match sought {
        BrakingCoefficient::Adhesion => adhesion(settings),
        BrakingCoefficient::Friction | BrakingCoefficient::Ratio => brake(settings),
    }
}

/// Returns the papers' EM, of which these settings are given.
pub fn em(sought: BrakingCoefficient, given: EmSettings) -> EstimatorSettings {
    let settings = EmSettings { braking: braking_settings(), reports: reports(sought), ..given };
    of_kind(sought, settings, [EstimatorSettings::AdhesionEm, EstimatorSettings::BrakeEm])
}

/// Returns the papers' baseline from an initial value.
pub fn ekf(sought: BrakingCoefficient, initial: f64) -> EstimatorSettings {
    let (braking, initial, reports) = (braking_settings(), Some(initial), reports(sought));
    let settings = EkfSettings { braking, initial, reports, ..EkfSettings::default() };
    of_kind(sought, settings, [EstimatorSettings::AdhesionEkf, EstimatorSettings::BrakeEkf])
}

/// Returns our smoother.
pub fn smoother(sought: BrakingCoefficient, lag_s: f64) -> EstimatorSettings {
    let (braking, reports) = (braking_settings(), reports(sought));
    let settings = SmootherSettings { braking, lag_s, reports, ..SmootherSettings::default() };
    of_kind(
        sought,
        settings,
        [EstimatorSettings::AdhesionSmoother, EstimatorSettings::BrakeSmoother],
    )
}

/// Returns our estimator where the curve over speed is known but for its scale.
pub fn known_law(sought: BrakingCoefficient) -> EstimatorSettings {
    if sought == BrakingCoefficient::Adhesion {
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

/// Returns the step of a coefficient that the smoother assumes.
pub fn presumed(sought: BrakingCoefficient) -> ShareStep {
    SmootherSettings::default().walk(sought).into()
}

/// Returns a braking whose coefficient is drawn from the smoother's prior.
pub fn drawn_braking(sought: BrakingCoefficient) -> Braking {
    let drawn = Some(presumed(sought));
    Braking { sought, drawn, from_kmh: 300.0, to_kmh: 180.0, scored_from_kmh: 265.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::papers::braking::{JIN_TABLE_3, STEP_S, XIE_TABLE_2, XIE_TABLE_3, declared};

    /// Returns the root mean square drift of the achieved share over the scored part of a braking.
    fn drift_per_s(braking: &Braking) -> f64 {
        let moments = braking.nominal();
        let drifts: Vec<f64> = moments
            .windows(2)
            .filter(|pair| pair[1].is_scored)
            .map(|pair| (pair[1].truth - pair[0].truth) / declared(braking.sought) / STEP_S)
            .collect();
        crate::statistics::root_mean_square(&drifts)
    }

    #[test]
    fn the_drift_that_the_smoother_presumes_is_that_of_the_laws() {
        for braking in [XIE_TABLE_2, XIE_TABLE_3, JIN_TABLE_3] {
            let std_per_s = presumed(braking.sought).drift_std_per_s;
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
        let scored = |sign: f64| ScoredBraking { truth: 2.0, error: 0.02 * sign, std: 0.02 };
        let runs = [vec![scored(1.0), scored(-1.0)], vec![scored(1.0)]];
        let score = BrakingScore::from_runs(runs.iter());
        assert!((score.relative_percent - 1.0).abs() < 1e-12);
        assert!((score.rmse() - 0.02).abs() < 1e-15);
        assert!((score.errors.nees() - 1.0).abs() < 1e-12);
        assert_eq!((score.nees_run_variance(), score.nees_of_runs.len()), (0.0, 2));
    }

    #[test]
    fn one_curve_of_many_runs_leaves_the_freedom_of_one_curve() {
        // NEES of half the runs one deviation above 1, of the others below it.
        let score = |variance: f64, runs: usize, length: usize| {
            let error = |run: usize| {
                (1.0 + if run.is_multiple_of(2) { 1.0 } else { -1.0 } * variance.sqrt()).sqrt()
            };
            let scored = |run| ScoredBraking { truth: 1.0, error: error(run), std: 1.0 };
            let runs: Vec<Vec<ScoredBraking>> =
                (0..runs).map(|run| vec![scored(run); length]).collect();
            BrakingScore::from_runs(runs.iter())
        };
        let drawn = score(0.6, 200, 100);
        // Twice as long a run halves the variance of 0.6; 0.1 of it is noise.
        let freedom = score(0.1, 1000, 200).nees_freedom_of_one_curve(&drawn);
        assert!((freedom - 2.0 / 0.2001).abs() < 1e-6, "{freedom}");
        // Without a part of the curve it is the noise over all runs.
        let freedom = score(0.4, 1000, 200).nees_freedom_of_one_curve(&drawn);
        assert!((freedom - 5000.0).abs() < 1e-6, "{freedom}");
    }
}
