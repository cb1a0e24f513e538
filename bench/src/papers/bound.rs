//! Posterior Cramér–Rao bound of a braking coefficient.
//!
//! For a linear model with Gaussian noise the recursion of Tichavský, Muravchik and Nehorai (1998) is the Riccati
//! recursion of the covariance, run here along the noise-free braking and independently of the filters that it judges.
//! The process noise of the scenario is uniform; a Gaussian of the same variance carries the least information, so that
//! the error of a filter that used the uniform shape could in principle fall below the bound.

use nalgebra::{Matrix4, RowVector4, Vector4};

use super::braking::{
    Braking, BrakingMoment, POSITION_NOISE_M, POSITION_STD_M, SPEED_NOISE_MPS, STEP_S, ShareStep,
    declared, disc_friction, train,
};
use dynocar_core::pipeline::braking::intake::BrakingCoefficient;
use dynocar_model::train::TrainModel;
use dynocar_shared::RailCondition;

use crate::statistics::{mean, root_mean_square};

/// Prior knowledge of the coefficient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PriorKnowledge {
    /// How the share of the declared brake force moves.
    Share(ShareStep),
    /// The curve over speed is known but for a constant scale, of this standard deviation
    /// beforehand.
    Law(f64),
}

/// The bound at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundAt {
    /// The true coefficient.
    pub truth: f64,
    /// Least standard deviation of its estimate.
    pub std: f64,
}

const SCALE: usize = 2;
const DRIFT: usize = 3;

/// One step of the recursion.
struct Step {
    predicted: Matrix4<f64>,
    filtered: Matrix4<f64>,
    jacobian: Matrix4<f64>,
}

/// Returns the bound at every scored moment, given the measurements up to `lag_steps` later.
pub fn bound(braking: &Braking, knowledge: PriorKnowledge, lag_steps: usize) -> Vec<BoundAt> {
    let moments = braking.nominal();
    let steps = forward(braking, knowledge, &moments);
    let mut bounds = Vec::new();
    for (k, moment) in moments.iter().enumerate() {
        let end = k + lag_steps;
        if !moment.is_scored || end >= steps.len() {
            continue;
        }
        let mut smoothed = steps[end].filtered;
        for step in (k..end).rev() {
            let next = &steps[step + 1];
            let inverse = next.predicted.try_inverse().expect("an invertible covariance");
            let gain = steps[step].filtered * next.jacobian.transpose() * inverse;
            smoothed = steps[step].filtered + gain * (smoothed - next.predicted) * gain.transpose();
        }
        let row = coefficient_row(braking, knowledge, moment);
        let std = (row * smoothed * row.transpose())[0].sqrt();
        bounds.push(BoundAt { truth: moment.truth, std });
    }
    bounds
}

/// Returns the known curve and its slope by speed, in units of the declared value.
fn shape(braking: &Braking, knowledge: PriorKnowledge, speed_mps: f64) -> (f64, f64) {
    let declared = declared(braking.sought);
    match (knowledge, braking.sought) {
        (PriorKnowledge::Law(_), BrakingCoefficient::Adhesion) => (
            RailCondition::Wet.adhesion(speed_mps) / declared,
            RailCondition::Wet.adhesion_slope_s_per_m(speed_mps) / declared,
        ),
        (PriorKnowledge::Law(_), BrakingCoefficient::Friction) => {
            let difference = disc_friction(speed_mps + 1e-4) - disc_friction(speed_mps - 1e-4);
            (disc_friction(speed_mps) / declared, difference / 2e-4 / declared)
        }
        _ => (1.0, 0.0),
    }
}

/// Returns how the coefficient depends on the state.
fn coefficient_row(
    braking: &Braking,
    knowledge: PriorKnowledge,
    moment: &BrakingMoment,
) -> RowVector4<f64> {
    let (value, slope) = shape(braking, knowledge, moment.speed_mps);
    RowVector4::new(0.0, slope, value, 0.0) * declared(braking.sought)
}

fn forward(braking: &Braking, knowledge: PriorKnowledge, moments: &[BrakingMoment]) -> Vec<Step> {
    let (scale_std, share) = match knowledge {
        PriorKnowledge::Share(share) => (1.0, share),
        PriorKnowledge::Law(scale_std) => (scale_std, ShareStep::default()),
    };
    let first_speed_std = SPEED_NOISE_MPS / 3.0_f64.sqrt();
    let prior = Vector4::new(POSITION_STD_M, first_speed_std, scale_std, share.drift_std_per_s);
    let mut covariance = Matrix4::from_diagonal(&prior.component_mul(&prior));
    // A uniform step of half width w has variance w² / 3.
    let third = 3.0_f64.sqrt();
    let added_std = Vector4::new(
        POSITION_NOISE_M / third,
        SPEED_NOISE_MPS / third,
        share.share_std,
        share.gained_std_per_s,
    );
    let added = Matrix4::from_diagonal(&added_std.component_mul(&added_std));
    let mut steps = Vec::with_capacity(moments.len());
    for k in 0..moments.len() {
        let jacobian = match k {
            0 => Matrix4::identity(),
            _ => transition(braking, knowledge, &moments[k - 1]),
        };
        if k > 0 {
            covariance = jacobian * covariance * jacobian.transpose() + added;
        }
        let predicted = covariance;
        if k > 0 {
            let column = covariance.column(0).into_owned();
            covariance -=
                column * column.transpose() / (column[0] + POSITION_STD_M * POSITION_STD_M);
        }
        steps.push(Step { predicted: regular(predicted), filtered: covariance, jacobian });
    }
    steps
}

/// Returns a covariance made invertible where a component is known exactly.
fn regular(mut covariance: Matrix4<f64>) -> Matrix4<f64> {
    if covariance[(DRIFT, DRIFT)] == 0.0 {
        covariance[(DRIFT, DRIFT)] = 1.0;
    }
    covariance
}

fn transition(
    braking: &Braking,
    knowledge: PriorKnowledge,
    moment: &BrakingMoment,
) -> Matrix4<f64> {
    let davis = train().resistance;
    let gravity_mps2 = 1000.0 * TrainModel::weight_kn(1.0);
    let full_mps2 = declared(BrakingCoefficient::Adhesion) * gravity_mps2;
    let (value, slope) = shape(braking, knowledge, moment.speed_mps);
    let resistance_slope = 1e-3 * gravity_mps2 * (davis.b + 2.0 * davis.c * moment.speed_mps);
    let mut jacobian = Matrix4::identity();
    jacobian[(1, 1)] = 1.0 - STEP_S * (resistance_slope + full_mps2 * slope);
    jacobian[(1, SCALE)] = -STEP_S * full_mps2 * value;
    jacobian[(0, 1)] = 0.5 * STEP_S * (1.0 + jacobian[(1, 1)]);
    jacobian[(0, SCALE)] = 0.5 * STEP_S * jacobian[(1, SCALE)];
    if let PriorKnowledge::Share(share) = knowledge {
        jacobian[(SCALE, DRIFT)] = STEP_S;
        jacobian[(DRIFT, DRIFT)] = share.kept;
    }
    jacobian
}

/// Returns the root of the mean variance.
pub fn deviation(bounds: &[BoundAt]) -> f64 {
    root_mean_square(bounds.iter().map(|bound| bound.std))
}

/// Returns the mean of |error| / truth in % of a Gaussian error at the bound.
pub fn mean_relative_percent(bounds: &[BoundAt]) -> f64 {
    100.0 * std::f64::consts::FRAC_2_PI.sqrt() * mean(bounds.iter().map(|it| it.std / it.truth))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::papers::braking::{JIN_TABLE_3, XIE_TABLE_2};
    use crate::papers::braking_score::{LAG_S, LAG_STEPS, presumed, run, smoother};

    #[test]
    fn later_measurements_and_a_known_law_lower_the_bound() {
        for braking in [XIE_TABLE_2, JIN_TABLE_3] {
            let knowledge = PriorKnowledge::Share(presumed(braking.sought));
            let at = |lag_steps| deviation(&bound(&braking, knowledge, lag_steps));
            assert!(at(25) < at(10) && at(10) < at(0));
            let known = deviation(&bound(&braking, PriorKnowledge::Law(0.25), 0));
            assert!(known < at(25), "{known}");
        }
    }

    #[test]
    fn the_bound_of_a_law_falls_with_what_is_known_of_its_scale() {
        let at = |std| deviation(&bound(&XIE_TABLE_2, PriorKnowledge::Law(std), 0));
        assert!(at(0.01) < at(0.1) && at(0.1) < at(1.0));
    }

    #[test]
    fn the_filter_claims_what_the_independent_recursion_allows() {
        for braking in [XIE_TABLE_2, JIN_TABLE_3] {
            let moments = braking.nominal();
            let knowledge = PriorKnowledge::Share(presumed(braking.sought));
            for (lag_s, lag_steps) in [(0.0, 0), (LAG_S, LAG_STEPS)] {
                let [scored] = run(&smoother(braking.sought, lag_s), &moments, [lag_steps]);
                let bounds = bound(&braking, knowledge, lag_steps);
                assert_eq!(scored.len(), bounds.len());
                for (scored, bound) in scored.iter().zip(&bounds) {
                    assert_eq!(scored.truth, bound.truth);
                    assert!((scored.std / bound.std - 1.0).abs() < 0.01, "{scored:?} {bound:?}");
                }
            }
        }
    }
}
