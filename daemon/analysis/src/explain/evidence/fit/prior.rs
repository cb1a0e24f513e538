//! Prior of the parameters, and the information of positions on the speeds.

use nalgebra::{DMatrix, DVector};

use super::super::model::UpdatedModel;
use super::super::positions::pooled_s;
use super::super::run_data::RunData;
use super::{DECLARED_FREEDOM, FitProblem, RunNormal};
use crate::statistics::median;

/// Evidence of the positions of runs on their speeds.
#[derive(Clone, Copy, Debug, Default)]
pub struct Positions {
    /// Measured distance over distance by integrated speed, with its standard deviation.
    pub distance_ratio: Option<(f64, f64)>,
    /// Seconds by which the speed is late by the position, with their standard deviation.
    pub speed_late_s: Option<(f64, f64)>,
}

/// Evidence of the positions of one run on its speeds.
#[derive(Clone, Debug, Default)]
pub struct RunPositions {
    distance_ratio: Option<(f64, f64)>,
    speed_late_s: Vec<f64>,
}

impl RunPositions {
    /// Returns the evidence of a run.
    pub fn of(run: &RunData) -> Self {
        RunPositions { distance_ratio: run.distance_ratio, speed_late_s: run.speed_late_s.clone() }
    }
}

impl Positions {
    /// Returns the evidence of runs together. Wheel creep, rounding and the places where a run starts are common to
    /// the runs: below `COMMON` nothing is seen.
    pub fn of(runs: &[RunPositions]) -> Self {
        const COMMON: f64 = 0.001;
        let own: Vec<(f64, f64)> = runs.iter().filter_map(|run| run.distance_ratio).collect();
        let mut ratios: Vec<f64> = own.iter().map(|it| it.0).collect();
        let mean_var = own.iter().map(|it| it.1.powi(2)).sum::<f64>() / own.len() as f64;
        let deviation = (mean_var / own.len() as f64 + COMMON * COMMON).sqrt();
        let parts: Vec<f64> = runs.iter().flat_map(|run| run.speed_late_s.clone()).collect();
        Positions {
            distance_ratio: median(&mut ratios).map(|ratio| (ratio, deviation)),
            speed_late_s: pooled_s(&parts),
        }
    }

    /// Adds the information of the positions on the scale and the delay of the speeds.
    pub fn add_to(&self, normal: &mut RunNormal, model: &UpdatedModel, theta: &[f64]) {
        let RunNormal { information, score, cost } = normal;
        if let Some((ratio, deviation)) = self.distance_ratio {
            let mut scale = 1.0;
            let mut at = None;
            for (effect, range) in model.effects.iter().zip(model.ranges()) {
                let own = effect.speed_scale(&theta[range.clone()]);
                if own != 1.0 || effect.nature().changes_speed_scale {
                    at = Some(range.start);
                }
                scale *= own;
            }
            let away = (ratio - 1.0 / scale) / deviation;
            *cost += away * away;
            if let Some(i) = at {
                let slope = -1.0 / (scale * scale) / deviation;
                information[(i, i)] += slope * slope;
                score[i] += slope * away;
            }
        }
        if let Some((late_s, deviation)) = self.speed_late_s {
            let effects = model.effects.iter().zip(model.ranges());
            let late = effects.filter_map(|(effect, range)| {
                Some((effect.speed_late_s(&theta[range.clone()])?, range))
            });
            let late: Vec<_> = late.collect();
            let known_s: f64 = late.iter().map(|(late_s, _)| late_s).sum();
            let away = (late_s - known_s) / deviation;
            *cost += away * away;
            let numbers: Vec<usize> = late.into_iter().flat_map(|(_, range)| range).collect();
            for &i in &numbers {
                score[i] += away / deviation;
                for &j in &numbers {
                    information[(i, j)] += deviation.powi(-2);
                }
            }
        }
    }
}

/// Returns the cost of a declaration by its error in standard deviations, and the weight by which its pull is less
/// than that of a normal error: by Student's t distribution, whose middle is that of the normal one.
fn declared_cost(deviations: f64) -> (f64, f64) {
    let count = DECLARED_FREEDOM + 1.0;
    let share = deviations * deviations / count;
    (count * share.ln_1p(), 1.0 / (1.0 + share))
}

impl FitProblem {
    /// Pull of the prior: information and score.
    pub(super) fn prior(
        &self,
        model: &UpdatedModel,
        theta: &[f64],
    ) -> (DMatrix<f64>, DVector<f64>, f64) {
        let count = theta.len();
        let (mut information, mut score) = (DMatrix::zeros(count, count), DVector::zeros(count));
        let mut cost = 0.0;
        let declared = [self.declared.a, self.declared.b, self.declared.c];
        for i in 0..3 {
            let away = declared[i] - theta[i];
            let (own_cost, weight) = declared_cost(away / self.prior_deviation[i]);
            let weight = weight * self.prior_deviation[i].powi(-2);
            information[(i, i)] += weight;
            score[i] += weight * away;
            cost += own_cost;
        }
        for (effect, range) in model.effects.iter().zip(model.ranges()) {
            let Some(own) = effect.nature().prior else { continue };
            let at = DVector::from_column_slice(&theta[range.clone()]).add_scalar(-effect.none());
            let pull = own * &at;
            cost += at.dot(&pull);
            let (start, count) = (range.start, range.len());
            let mut block = information.view_mut((start, start), (count, count));
            block += own;
            let mut part = score.rows_mut(start, count);
            part -= pull;
        }
        let mut normal = RunNormal { information, score, cost };
        self.positions.add_to(&mut normal, model, theta);
        (normal.information, normal.score, normal.cost)
    }
}
