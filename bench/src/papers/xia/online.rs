//! Table 4: coefficients that switch on the way, estimated online.
//!
//! Settling: km from a switch until the error of w0 at the driven speed stays below 0.1 N/kN without noise, and below 1
//! N/kN with noise, twice the best resolution of any window of 2 km; 8 km at most. The error with noise is taken from
//! km 64 on, but for the 8 km after the switch at km 82.

use dynocar_core::filter::levenberg_marquardt::ParameterBox;
use dynocar_estimators::xia::trajectory::hypothesis::{JumpHypothesis, OutlierModel};
use dynocar_estimators::xia::trajectory::noise::{LearnedNoise, NoiseModel};
use dynocar_estimators::xia::trajectory::online::{OnlineFilter, OnlineSettings, StepDoubt};
use dynocar_estimators::xia::trajectory::step::StepRule;
use dynocar_estimators::xia::wolfe_newton::{NewtonSettings, RestartSource, wolfe_newton};
use dynocar_model::force::mps2_per_n_per_kn;
use dynocar_model::train::Davis;
use dynocar_tests::chance::Chance;
use nalgebra::{Matrix3, Vector3};

use super::scenario::{
    CASES, DrivingProfile, NoiseFreeRun, ROTATING_MASS_FACTOR, SAMPLING_M, SPEED_NOISE_MPS,
    all_speeds_mps, bounds, disturbed_davis_covariance, drive, fast_speeds_mps,
};
use crate::papers::row::{PaperRow, PaperScore, Seeds, XIA, w0_std};
use crate::statistics::{mean, root_mean_square};

/// Data capacity I of the paper's window.
const WINDOW: usize = 20;
/// Steps before the noise begins, at km 64.
const NOISY_FROM: usize = 640;
/// Switches with the tolerance in N/kN of the settling: km 22 and 52 clean, km 82 noisy.
const SWITCHES: [(usize, f64); 3] = [(220, 0.1), (520, 0.1), (820, 1.0)];
/// Steps within which a method must settle.
const SETTLING_MAX: usize = 80;

/// Returns the truth of Table 4 by chainage in m.
fn table_4(chainage_m: f64) -> Davis {
    let (a, b, c) = match chainage_m / 1000.0 {
        km if km < 22.0 => (0.79, 0.002288, 0.001368),
        km if km < 52.0 => (0.49, 0.001208, 0.001368),
        km if km < 82.0 => (0.79, 0.002288, 0.001368),
        _ => (0.79, 0.002288, 0.002557),
    };
    Davis { a, b, c }
}

/// Returns the declared train: Table 3's first case, wrong everywhere in Table 4.
fn declared() -> (Davis, Vector3<f64>) {
    (CASES[0], Vector3::new(0.8, 0.02, 0.0007))
}

fn settings(davis: Davis, std: Vector3<f64>) -> OnlineSettings {
    let gain = mps2_per_n_per_kn(ROTATING_MASS_FACTOR);
    OnlineSettings {
        davis,
        davis_std: std,
        jump_evidence: 16.0,
        hypotheses: 8,
        noise: NoiseModel {
            speed_noise_mps: 0.2,
            speed_noise_range_mps: (1e-3, 1.0),
            disturbance: gain,
            disturbance_range: (0.01 * gain, 10.0 * gain),
            memory: 2000.0,
            learns_speed_noise: true,
            learns_disturbance: true,
        },
    }
}

/// An estimate after each step: coefficients and covariance; the paper's method has none.
type Estimates = Vec<(Davis, Matrix3<f64>)>;

/// Ours: the filter of `trajectory_kalman` with its default settings.
fn ours(run: &NoiseFreeRun, speeds_mps: &[f64], settings: OnlineSettings) -> Estimates {
    let mut filter = OnlineFilter::new(settings);
    filter.begin(speeds_mps[0]);
    let steps = run.steps.iter().zip(speeds_mps).zip(&speeds_mps[1..]);
    steps
        .map(|((step, &before_mps), &speed_mps)| {
            let duration_s = step.size / before_mps;
            let none = StepDoubt::default();
            filter.advance((StepRule::Distance, step), duration_s, speed_mps, &none);
            filter.davis()
        })
        .collect()
}

/// Returns the bound: a single filter that is given the noise by step, that the forces are exact, and
/// where the coefficients switch.
fn informed(
    run: &NoiseFreeRun,
    speeds_mps: &[f64],
    (davis, std): (Davis, Vector3<f64>),
    noise_mps: impl Fn(usize) -> f64,
    switches: &[usize],
) -> Estimates {
    let model = NoiseModel {
        disturbance: 0.0,
        learns_speed_noise: false,
        learns_disturbance: false,
        ..settings(davis, std).noise
    };
    let no_outliers = OutlierModel { share: 1e-12, density: 0.5 };
    let mut filter = JumpHypothesis::new(&davis, &std, LearnedNoise::new(&model));
    filter.noise.speed_variance = noise_mps(0).powi(2);
    filter.anchor(speeds_mps[0]);
    (0..run.steps.len())
        .map(|i| {
            if switches.contains(&i) {
                filter.jump(&std.component_mul(&std));
            }
            let step = &run.steps[i];
            filter.noise.speed_variance = noise_mps(i + 1).powi(2);
            filter.predict(StepRule::Distance, step, step.size / run.speeds_mps[i], 0.0);
            filter.measure(speeds_mps[i + 1], &model, &no_outliers);
            (filter.davis(), filter.davis_covariance())
        })
        .collect()
}

/// Returns the paper: Algorithm 1 over the newest 20 steps, each window from the answer of the one
/// before.
fn paper(run: &NoiseFreeRun, speeds_mps: &[f64], seed: u64) -> Estimates {
    let mut source = RestartSource::new(seed);
    let mut davis = declared().0;
    let bounds = ParameterBox { ..bounds() };
    (1..=run.steps.len())
        .map(|end| {
            if let Some(first) = end.checked_sub(WINDOW) {
                // The paper's ε1 without and with noise.
                let mean_square_max = if end < NOISY_FROM { 1e-5 } else { 0.05 };
                let settings =
                    NewtonSettings { bounds, mean_square_max, ..NewtonSettings::of_the_paper() };
                davis = wolfe_newton(
                    &run.steps[first..end],
                    &speeds_mps[first..=end],
                    &davis,
                    &settings,
                    &mut source,
                )
                .davis;
            }
            (davis, Matrix3::zeros())
        })
        .collect()
}

/// Errors and settling of one method over all lines.
#[derive(Default)]
struct Following {
    errors: Vec<f64>,
    deviations: Vec<f64>,
    settling_km: [Vec<f64>; SWITCHES.len()],
}

impl Following {
    fn push(&mut self, run: &NoiseFreeRun, estimates: &Estimates) {
        let errors: Vec<f64> = estimates
            .iter()
            .enumerate()
            .map(|(i, (davis, _))| {
                let speed_mps = run.speeds_mps[i + 1];
                let truth = table_4(SAMPLING_M * i as f64);
                davis.w0_n_per_kn(speed_mps) - truth.w0_n_per_kn(speed_mps)
            })
            .collect();
        for i in (NOISY_FROM..errors.len()).filter(|i| !(820..820 + SETTLING_MAX).contains(i)) {
            self.errors.push(errors[i]);
            self.deviations.push(w0_std(&estimates[i].1, run.speeds_mps[i + 1]));
        }
        for (settling, (at, tolerance)) in self.settling_km.iter_mut().zip(SWITCHES) {
            let after = &errors[at..at + SETTLING_MAX];
            let last_bad = after.iter().rposition(|error| error.abs() > tolerance);
            settling.push(last_bad.map_or(0.0, |last| (last + 1) as f64 * SAMPLING_M / 1000.0));
        }
    }

    /// Returns the mean settling after the switches without noise, and after the one with noise.
    fn settling_km(&self) -> [f64; 2] {
        let [one, other, noisy] = self.settling_km.each_ref().map(mean);
        [0.5 * (one + other), noisy]
    }
}

/// Table 4, and the consistency of the online filter where the coefficients stay.
pub fn rows(seeds: Seeds) -> Vec<PaperRow> {
    let (davis, std) = declared();
    let (mut filter, mut bound, mut windows) =
        (Following::default(), Following::default(), Following::default());
    let paper_lines = seeds.count.div_ceil(10);
    for seed in seeds.range() {
        let run = drive(DrivingProfile::Cruise, 120e3, seed, table_4);
        let mut random = Chance::new(5000 + seed);
        let speeds = run.measured_mps(NOISY_FROM, &mut random);
        filter.push(&run, &ours(&run, &speeds, settings(davis, std)));
        let noise_mps = |i| if i >= NOISY_FROM { SPEED_NOISE_MPS } else { 1e-3 };
        let switches = SWITCHES.map(|(at, _)| at);
        let informed_filter = informed(&run, &speeds, declared(), noise_mps, &switches);
        bound.push(&run, &informed_filter);
        if seed < seeds.first + paper_lines as u64 {
            windows.push(&run, &paper(&run, &speeds, seed));
        }
    }
    let row = |quantity: &str, unit, of: &dyn Fn(&Following) -> f64, least: f64| PaperRow {
        paper_method: Some(of(&windows)),
        ours: Some(of(&filter)),
        bound: Some(least),
        ..PaperRow::new(XIA, "Table 4", quantity, unit, seeds)
            .noted(format!("paper's method: {paper_lines} lines"))
    };
    let settled = "w0 at the driven speed, noisy sections, settled";
    let least = root_mean_square(&bound.deviations);
    let clean = "settling to 0.1 N/kN after a switch, clean";
    let noisy = "settling to 1 N/kN after a switch, noisy";
    let [least_clean, least_noisy] = bound.settling_km();
    vec![
        row(settled, "N/kN", &|it| root_mean_square(&it.errors), least),
        row(clean, "km", &|it| it.settling_km()[0], least_clean),
        row(noisy, "km", &|it| it.settling_km()[1], least_noisy),
        exact_forces_row(seeds),
        disturbed_row(seeds),
    ]
}

/// Returns the mean and standard deviations that the constant truths are drawn from.
fn constant_prior() -> (Davis, Vector3<f64>) {
    (CASES[0], Vector3::new(0.3, 0.01, 0.0003))
}

fn drawn((mean, std): (Davis, Vector3<f64>), random: &mut Chance) -> Davis {
    Davis {
        a: mean.a + std[0] * random.normal(),
        b: mean.b + std[1] * random.normal(),
        c: mean.c + std[2] * random.normal(),
    }
}

/// Truth, estimate and bound of a run with coefficients drawn from [`constant_prior`].
type Drawn = Option<(Davis, (Davis, Matrix3<f64>), Matrix3<f64>)>;

/// Returns a row over seeds that draw the coefficients of a run without a switch.
fn drawn_row(
    quantity: &str,
    speeds_mps: &[f64],
    seeds: Seeds,
    of_seed: impl Fn(u64, &mut Chance) -> Drawn,
) -> PaperRow {
    let mut score = PaperScore::default();
    for seed in seeds.range() {
        let mut random = Chance::new(9000 + seed);
        if let Some((truth, (davis, covariance), bound)) = of_seed(seed, &mut random) {
            score.take_resistance((&davis, &covariance), &truth, speeds_mps);
            score.take_bound(&bound, speeds_mps);
        }
    }
    score.row(PaperRow::new(XIA, "Table 4", quantity, "N/kN", seeds))
}

/// Returns a full speed profile; the forces are exact, as the filter is set to assume.
fn exact_forces_row(seeds: Seeds) -> PaperRow {
    let (mean_davis, std) = constant_prior();
    let quantity = "online, no switch: w0 over 30-300 km/h after a full profile of 40 km";
    drawn_row(quantity, &all_speeds_mps(), seeds, |seed, random| {
        let truth = drawn(constant_prior(), random);
        let run = drive(DrivingProfile::Full, 40e3, seed, |_| truth);
        let measured = run.measured_mps(0, random);
        let mut settings = settings(mean_davis, std);
        settings.noise.disturbance = 0.0;
        settings.noise.learns_disturbance = false;
        let noise_mps = |_| SPEED_NOISE_MPS;
        let (_, bound) = informed(&run, &measured, constant_prior(), noise_mps, &[]).pop()?;
        Some((truth, ours(&run, &measured, settings).pop()?, bound))
    })
}

/// Cruise under a disturbance that lasts for seconds, of which the filter knows nothing; the
/// bound knows its strength and correlation.
fn disturbed_row(seeds: Seeds) -> PaperRow {
    let (mean_davis, std) = constant_prior();
    let nominal = drive(DrivingProfile::Cruise, 120e3, 1, |_| mean_davis);
    let prior = Matrix3::from_diagonal(&std.map(|std| 1.0 / (std * std)));
    let bound = disturbed_davis_covariance(&nominal, &mean_davis)
        .try_inverse()
        .and_then(|information| (information + prior).try_inverse())
        .expect("a positive definite information");
    let quantity = "online, no switch, resistance disturbed by 0.25 N/kN for 5 s (AR 1): \
                    w0 over 270-305 km/h after 120 km";
    drawn_row(quantity, &fast_speeds_mps(), seeds, |_, random| {
        let truth = drawn(constant_prior(), random);
        let run = drive(DrivingProfile::Cruise, 120e3, 1, |_| truth).disturbed(&truth, random);
        let measured = run.measured_mps(0, random);
        Some((truth, ours(&run, &measured, settings(mean_davis, std)).pop()?, bound))
    })
}
