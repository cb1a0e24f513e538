//! Prior of the parameters, and the information of positions on the speeds.

use nalgebra::{DMatrix, DVector};

use super::super::model::UpdatedModel;
use super::FitProblem;

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
            let weight = self.prior_deviation[i].powi(-2);
            let away = declared[i] - theta[i];
            information[(i, i)] += weight;
            score[i] += weight * away;
            cost += weight * away * away;
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
        self.take_positions(model, theta, (&mut information, &mut score), &mut cost);
        (information, score, cost)
    }

    /// Adds the information of positions on the scale of the speeds and on how late they are.
    fn take_positions(
        &self,
        model: &UpdatedModel,
        theta: &[f64],
        normal: (&mut DMatrix<f64>, &mut DVector<f64>),
        cost: &mut f64,
    ) {
        let (information, score) = normal;
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
