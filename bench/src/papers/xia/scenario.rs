//! Seeded runs of the CRH380C of Xia 2023 with assumptions for the conditions that the paper leaves open (line, forces,
//! noise), and the Cramér-Rao bound from a run's own numerical Jacobian.
//!
//! M = 981.7 t, γ = 0.06, traction up to min(520, 18240 / v) kN, 100 m sampling, white noise of 0.18 m/s on the speed
//! (more is not possible: the paper's search ends at a mean square of ε1 = 0.05, which the true coefficients must
//! reach). The truth moves by eq. 7, as the paper's own data do (mean squares of 1e-9).

use dynocar_core::filter::levenberg_marquardt::ParameterBox;
use dynocar_core::filter::triangular::{TriangularAccumulator, TriangularSystem};
use dynocar_estimators::xia::trajectory::step::TrajectoryStep;
use dynocar_estimators::xia::wolfe_newton::NewtonSettings;
use dynocar_model::force::mps2_per_n_per_kn;
use dynocar_model::simulate::motion::autoregressed;
use dynocar_model::track::{Track, TrackCurve};
use dynocar_model::train::Davis;
use dynocar_shared::resistance::GRAVITY_MPS2;
use dynocar_tests::chance::Chance;
use nalgebra::{DMatrix, Matrix3};

use crate::statistics::{self, KMH};

/// Mass in t.
pub const MASS_T: f64 = 981.7;
/// Train length in m.
pub const LENGTH_M: f64 = 400.47;
/// Rotating-mass factor γ.
pub const ROTATING_MASS_FACTOR: f64 = 0.06;
/// Sampling in m.
pub const SAMPLING_M: f64 = 100.0;
/// Standard deviation of the measured speed in m/s.
pub const SPEED_NOISE_MPS: f64 = 0.18;

/// Standard deviation in N/kN of the resistance's disturbance, where there is one.
pub const DISTURBANCE_N_PER_KN: f64 = 0.25;
/// Its correlation time in s.
pub const DISTURBANCE_S: f64 = 5.0;

/// The truth of Table 3's cases 1 to 4.
///
/// In m/s: the usual coefficients for km/h times 3.6 and 12.96.
pub const CASES: [Davis; 4] = [
    Davis { a: 0.79, b: 0.0229, c: 0.001493 },
    Davis { a: 0.2955, b: 0.0242, c: 0.00159 },
    Davis { a: 1.0501, b: 0.0253, c: 0.00140 },
    Davis { a: 0.3488, b: 0.0596, c: 0.00112 },
];

/// Returns the speeds in m/s of cruise at which w0 is compared.
pub fn fast_speeds_mps() -> Vec<f64> {
    (0..=7).map(|i| (270.0 + 5.0 * f64::from(i)) * KMH).collect()
}

/// Returns the speeds in m/s of a full profile at which w0 is compared.
pub fn all_speeds_mps() -> Vec<f64> {
    (1..=10).map(|i| 30.0 * f64::from(i) * KMH).collect()
}

/// Table 2's bounds, with room below for the true a of cases 2 and 4.
pub fn bounds() -> ParameterBox<3> {
    let mut bounds = NewtonSettings::of_the_paper().bounds;
    bounds.low[0] = 0.2;
    bounds
}

/// How the train is driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DrivingProfile {
    /// 273 to 303 km/h.
    Cruise,
    /// From 7 km/h to as much as 300 km/h and back, with traction, coasting and braking.
    Full,
}

/// A run without noise: one speed more than steps.
#[derive(Clone, Debug)]
pub struct NoiseFreeRun {
    /// Steps of 100 m.
    pub steps: Vec<TrajectoryStep>,
    /// True speeds in m/s.
    pub speeds_mps: Vec<f64>,
}

impl NoiseFreeRun {
    /// Returns the speeds with white noise from a step on.
    pub fn measured_mps(&self, noisy_from: usize, random: &mut Chance) -> Vec<f64> {
        let noise = |i: usize, random: &mut Chance| {
            if i >= noisy_from { SPEED_NOISE_MPS * random.normal() } else { 0.0 }
        };
        self.speeds_mps.iter().enumerate().map(|(i, v)| v + noise(i, random)).collect()
    }

    /// Returns the same reported forces, with a disturbance of the resistance that nobody reports: a
    /// first-order autoregression of [`DISTURBANCE_N_PER_KN`] and [`DISTURBANCE_S`].
    pub fn disturbed(&self, davis: &Davis, random: &mut Chance) -> NoiseFreeRun {
        let mut speeds_mps = vec![self.speeds_mps[0]];
        let mut disturbance = DISTURBANCE_N_PER_KN * random.normal();
        for (i, step) in self.steps.iter().enumerate() {
            let disturbed = Davis { a: davis.a + disturbance, ..*davis };
            speeds_mps.push(next_speed_mps(step, &disturbed, speeds_mps[i]));
            let kept = (-step.size / (self.speeds_mps[i] * DISTURBANCE_S)).exp();
            disturbance = autoregressed(disturbance, kept, DISTURBANCE_N_PER_KN, random.normal());
        }
        NoiseFreeRun { steps: self.steps.clone(), speeds_mps }
    }
}

/// Returns the speed after a step by eq. 7; the truth's own formula, apart from the estimators'.
fn next_speed_mps(step: &TrajectoryStep, davis: &Davis, speed_mps: f64) -> f64 {
    let resistance = step.resistance_gain * davis.w0_n_per_kn(speed_mps);
    (speed_mps * speed_mps + 2.0 * step.size * (step.drive_mps2 - resistance)).sqrt()
}

/// Returns the speeds in m/s along steps from an initial speed.
pub fn speeds_mps(steps: &[TrajectoryStep], initial_mps: f64, davis: &Davis) -> Vec<f64> {
    let mut speeds = Vec::with_capacity(steps.len() + 1);
    speeds.push(initial_mps);
    for (i, step) in steps.iter().enumerate() {
        speeds.push(next_speed_mps(step, davis, speeds[i]));
    }
    speeds
}

/// Drives a run from chainage 0; the same seed gives the same line and driver.
///
/// `davis_at` gives the coefficients by chainage in m.
pub fn drive(
    profile: DrivingProfile,
    length_m: f64,
    seed: u64,
    davis_at: impl Fn(f64) -> Davis,
) -> NoiseFreeRun {
    let mut random = Chance::new(seed);
    let track = line(&mut random);
    let (mut speed_mps, phases) = match profile {
        DrivingProfile::Cruise => (288.0 * KMH, vec![]),
        DrivingProfile::Full => (7.0 * KMH, full_profile(length_m)),
    };
    let mut driver = Driver { phases, cruise_mps: speed_mps, next_change_m: 0.0 };
    let count = (length_m / SAMPLING_M) as usize;
    let mut run = NoiseFreeRun { steps: Vec::with_capacity(count), speeds_mps: vec![speed_mps] };
    for i in 0..count {
        let centre_m = SAMPLING_M * i as f64;
        let davis = davis_at(centre_m);
        let uphill = track.gradient_permille(centre_m, LENGTH_M).unwrap_or(0.0);
        let curve = 600.0 * track.curvature_per_m(centre_m, LENGTH_M).unwrap_or(0.0);
        let weight_kn = MASS_T * GRAVITY_MPS2;
        let resisting_kn = weight_kn * (davis.w0_n_per_kn(speed_mps) + uphill + curve) / 1000.0;
        let force_kn = driver.force_kn(centre_m, speed_mps, resisting_kn, &mut random);
        let inertia_t = MASS_T * (1.0 + ROTATING_MASS_FACTOR);
        let step = TrajectoryStep {
            size: SAMPLING_M,
            drive_mps2: (force_kn - weight_kn * (uphill + curve) / 1000.0) / inertia_t,
            resistance_gain: mps2_per_n_per_kn(ROTATING_MASS_FACTOR),
        };
        speed_mps = next_speed_mps(&step, &davis, speed_mps);
        run.steps.push(step);
        run.speeds_mps.push(speed_mps);
    }
    run
}

/// Gradients within ±6 ‰ and curves of 7 to 12 km radius, as on a high-speed line.
fn line(random: &mut Chance) -> Track {
    let mut gradient = Vec::new();
    let mut at_m = -1000.0;
    while at_m < 121_000.0 {
        gradient.push((at_m, 12.0 * random.uniform() - 6.0));
        at_m += 800.0 + 2200.0 * random.uniform();
    }
    let mut curves = Vec::new();
    let mut at_m = 2000.0 * random.uniform();
    while at_m < 118_000.0 {
        let end_m = at_m + 800.0 + 1500.0 * random.uniform();
        let radius_m = 7000.0 + 5000.0 * random.uniform();
        curves.push(TrackCurve { start_m: at_m, end_m, radius_m });
        at_m = end_m + 1000.0 + 5000.0 * random.uniform();
    }
    Track::new("seeded".into(), None, Some(&gradient), Some(curves), None)
        .expect("ordered, finite entries")
}

/// Phases of the driver from a distance on.
#[derive(Clone, Copy, Debug)]
enum Phase {
    Hold { speed_mps: f64 },
    Coast,
    Brake { to_mps: f64 },
}

/// From near standstill to 300 km/h, as far as the length allows, and back.
fn full_profile(length_m: f64) -> Vec<(f64, Phase)> {
    vec![
        (0.0, Phase::Hold { speed_mps: 300.0 * KMH }),
        (0.6 * length_m, Phase::Coast),
        (0.75 * length_m, Phase::Hold { speed_mps: 220.0 * KMH }),
        (0.8 * length_m, Phase::Coast),
        (length_m - 4000.0, Phase::Brake { to_mps: 7.0 * KMH }),
    ]
}

struct Driver {
    phases: Vec<(f64, Phase)>,
    cruise_mps: f64,
    next_change_m: f64,
}

impl Driver {
    fn force_kn(
        &mut self,
        travelled_m: f64,
        speed_mps: f64,
        resisting_kn: f64,
        random: &mut Chance,
    ) -> f64 {
        let phase = self.phases.iter().rev().find(|(from_m, _)| *from_m <= travelled_m);
        let phase = phase.map_or(Phase::Hold { speed_mps: self.cruise_mps }, |phase| phase.1);
        if self.phases.is_empty() && travelled_m >= self.next_change_m {
            self.cruise_mps = (272.0 + 32.0 * random.uniform()) * KMH;
            self.next_change_m = travelled_m + 3000.0 + 5000.0 * random.uniform();
        }
        let traction_max_kn = f64::min(520.0, 18_240.0 / speed_mps);
        let inertia_t = MASS_T * (1.0 + ROTATING_MASS_FACTOR);
        match phase {
            Phase::Hold { speed_mps: target_mps } => {
                let wanted_mps2 = (0.04 * (target_mps - speed_mps)).clamp(-0.2, 0.5);
                (resisting_kn + inertia_t * wanted_mps2).clamp(-300.0, traction_max_kn)
            }
            Phase::Coast => 0.0,
            Phase::Brake { to_mps } => {
                let energy = to_mps * to_mps - speed_mps * speed_mps;
                let wanted_mps2 = (0.5 * energy / SAMPLING_M).clamp(-0.4, 0.1);
                (resisting_kn + inertia_t * wanted_mps2).min(traction_max_kn)
            }
        }
    }
}

/// Returns the least covariance of (a, b, c) that an unbiased estimator can have from a run's speeds with
/// white noise, when the initial speed is not known either.
pub fn davis_covariance(run: &NoiseFreeRun, davis: &Davis) -> Matrix3<f64> {
    covariance(jacobian(run, davis)) * SPEED_NOISE_MPS.powi(2)
}

/// Returns the same where the resistance is disturbed as in [`NoiseFreeRun::disturbed`] and the disturbance's
/// strength and correlation are known: generalised least squares.
pub fn disturbed_davis_covariance(run: &NoiseFreeRun, davis: &Davis) -> Matrix3<f64> {
    let rows = jacobian(run, davis);
    let rows = DMatrix::from_fn(rows.len(), 4, |i, j| rows[i][j]);
    let count = run.speeds_mps.len();
    let mut times_s = vec![0.0];
    for (step, speed_mps) in run.steps.iter().zip(&run.speeds_mps) {
        times_s.push(times_s[times_s.len() - 1] + step.size / speed_mps);
    }
    let spread = DMatrix::from_fn(count - 1, count - 1, |i, j| {
        let apart_s: f64 = times_s[i] - times_s[j];
        DISTURBANCE_N_PER_KN.powi(2) * (-apart_s.abs() / DISTURBANCE_S).exp()
    });
    let effect = effects(run, davis);
    let mut noise = &effect * spread * effect.transpose();
    for i in 0..count {
        noise[(i, i)] += SPEED_NOISE_MPS.powi(2);
    }
    let factor = noise.cholesky().expect("white noise makes it positive definite").unpack();
    let whitened = factor.solve_lower_triangular(&rows).expect("a positive diagonal");
    covariance(whitened.row_iter().map(|row| [row[0], row[1], row[2], row[3]]))
}

/// Returns the derivatives of every speed with respect to v_0, a, b and c, by central differences of the
/// truth's own recursion rather than by the derivatives that the estimators use.
fn jacobian(run: &NoiseFreeRun, davis: &Davis) -> Vec<[f64; 4]> {
    statistics::jacobian([1e-4, 1e-4, 1e-6, 1e-8], |[dv, da, db, dc]| {
        let moved = Davis { a: davis.a + da, b: davis.b + db, c: davis.c + dc };
        speeds_mps(&run.steps, run.speeds_mps[0] + dv, &moved)
    })
}

/// Returns the derivatives of every speed with respect to 1 N/kN of resistance during each step.
fn effects(run: &NoiseFreeRun, davis: &Davis) -> DMatrix<f64> {
    let width = 1e-4;
    let count = run.speeds_mps.len();
    let mut effect = DMatrix::zeros(count, count - 1);
    for disturbed in 0..count - 1 {
        let at = |change: f64| {
            let first = Davis { a: davis.a + change, ..*davis };
            let step = &run.steps[disturbed..=disturbed];
            let after_mps = speeds_mps(step, run.speeds_mps[disturbed], &first)[1];
            speeds_mps(&run.steps[disturbed + 1..], after_mps, davis)
        };
        for (offset, (plus, minus)) in at(width).iter().zip(at(-width)).enumerate() {
            effect[(disturbed + 1 + offset, disturbed)] = (plus - minus) / (2.0 * width);
        }
    }
    effect
}

/// Covariance of the last three parameters for rows of unit variance.
fn covariance(rows: impl IntoIterator<Item = [f64; 4]>) -> Matrix3<f64> {
    let mut gathered = TriangularAccumulator::<5>::default();
    rows.into_iter().for_each(|[v, a, b, c]| gathered.push(&[v, a, b, c, 0.0]));
    let information = TriangularSystem::<3>::from_rows(&mut gathered);
    information.covariance().expect("a run that excites a, b and c")
}
