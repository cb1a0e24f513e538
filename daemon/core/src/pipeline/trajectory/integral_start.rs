//! Integral least squares: where a trajectory fit starts.
//!
//! The measured speeds in the regressors make the integrated equation of motion linear:
//!
//! ```text
//! distance  ½ ṽ_i² - Σ Δs u = ½ v_0² - Σ κ Δs (a + b ṽ + c ṽ²)
//! time        ṽ_i  - Σ Δt u =    v_0 - Σ κ Δt (a + b ṽ + c ṽ²)
//! ```
//!
//! The sums average the noise of the regressors away, where the differenced equation would
//! amplify it (29 times worse in cruise). Without noise and with the distance rule the answer
//! is exact up to round-off.

use nalgebra::Vector3;

use super::fit::Stretch;
use super::step::StepRule;
use crate::filter::levenberg_marquardt::{
    LeastSquares, Linearisation, ParameterBox, SolverSettings, minimise,
};
use crate::filter::triangular::{TriangularAccumulator, TriangularSystem};

/// The linear problem: R x + z.
struct Linear(TriangularSystem<3>);

impl LeastSquares<3> for Linear {
    fn linearise(&mut self, point: &Vector3<f64>) -> Option<Linearisation<3>> {
        let mut system = self.0;
        system.residual += system.factor * point;
        let cost = 0.5 * system.residual.norm_squared();
        cost.is_finite().then_some(Linearisation { cost, system, nested_decrease: 0.0 })
    }
}

/// (a, b, c) by integral least squares within bounds, from where the data do not say.
///
/// `None` when a number is not finite.
///
/// # Real-time
///
/// One pass over the samples, no allocation.
pub fn integral_start(
    stretches: &[Stretch<'_>],
    rule: StepRule,
    speed_noise_mps: f64,
    prior: Option<&TriangularSystem<3>>,
    bounds: &ParameterBox<3>,
    scales: &Vector3<f64>,
    from: &Vector3<f64>,
) -> Option<Vector3<f64>> {
    let mut joint = TriangularAccumulator::<4>::default();
    for stretch in stretches {
        let mut rows = integrated_rows(stretch, rule, 1.0 / speed_noise_mps);
        for row in &rows.factor()[1..] {
            joint.push(&[row[1], row[2], row[3], row[4]]);
        }
    }
    let mut system = TriangularSystem::from_rows(&mut joint);
    if let Some(prior) = prior {
        for i in 0..3 {
            system.append(prior.factor.row(i).transpose(), prior.residual[i]);
        }
    }
    let settings = SolverSettings {
        scales: *scales,
        iterations_max: 4,
        decrease_tolerance: 1e-6,
        relative_tolerance: 1e-12,
    };
    Some(minimise(&mut Linear(system), from, bounds, &settings)?.point)
}

/// Rows \[initial, a, b, c, -left side\] in standard deviations, every one weighted to m/s.
fn integrated_rows(
    stretch: &Stretch<'_>,
    rule: StepRule,
    per_deviation: f64,
) -> TriangularAccumulator<5> {
    let mut rows = TriangularAccumulator::default();
    let (mut drive, mut regressors) = (0.0, Vector3::zeros());
    for (i, &speed_mps) in stretch.speeds_mps.iter().enumerate() {
        if let Some(step) = i.checked_sub(1).map(|before| &stretch.steps[before]) {
            let before_mps = stretch.speeds_mps[i - 1];
            let resisted_mps = match rule {
                StepRule::Distance => before_mps,
                StepRule::Time => 0.5 * (before_mps + speed_mps),
            };
            let reach = step.resistance_gain * step.size;
            drive += step.size * step.drive_mps2;
            let powers = Vector3::new(1.0, resisted_mps, resisted_mps * resisted_mps);
            regressors -= powers * reach;
        }
        let (left, weight) = match rule {
            StepRule::Distance => {
                (0.5 * speed_mps * speed_mps - drive, per_deviation / speed_mps.max(0.1))
            }
            StepRule::Time => (speed_mps - drive, per_deviation),
        };
        rows.push(&[
            weight,
            regressors[0] * weight,
            regressors[1] * weight,
            regressors[2] * weight,
            -left * weight,
        ]);
    }
    rows
}
