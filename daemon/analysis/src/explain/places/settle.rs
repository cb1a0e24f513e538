//! Uncertainty of a place.
//!
//! An end has a posterior: the likelihood of the model with that end elsewhere, all other parameters fitted again,
//! under a flat prior over its possible values. Where the data say nothing, for example where no train braked, the
//! posterior is wide, and its middle is a better guess than the smallest place that explains the data.

use std::collections::BTreeMap;

use super::site::{Axis, IntervalEnd, Reach, Site};
use crate::explain::answer::{PlaceUncertainty, WindowUncertainty};
use crate::explain::evidence::{Fit, FitProblem, UpdatedModel};
use crate::explain::hypothesis::SharedHypothesis;
use crate::statistics::least_first;

/// Rise of the cost above the least one that rules a value out.
const FAR: f64 = 14.0;
/// Points on either side of an end at which its posterior is evaluated.
const POINTS: usize = 10;
/// Greatest rise of the cost, for each moved end, when the ends move to the medians of their posteriors.
const RISE: f64 = 1.0;

/// Posterior of an end.
struct Belief {
    median: f64,
    /// 95 % of the posterior.
    interval: [f64; 2],
}

/// Moves the ends of all places of a fit to the medians of their posteriors, fits again, and returns the uncertainty of
/// each effect's place; `None` for an effect whose place was not estimated.
pub fn settle(problem: &FitProblem, fit: &mut Fit) -> Vec<Option<PlaceUncertainty>> {
    let mut model = fit.model.clone();
    let mut known = Vec::new();
    let mut moved = 0;
    for index in 0..model.effects.len() {
        let mut uncertainty = Collected::default();
        for end in 0..model.effects[index].ends().len() {
            let effect = model.effects[index].clone();
            let end = &effect.ends()[end];
            let mut cost = |at: f64| {
                let elsewhere = effect.with_end(end, at)?;
                problem.cost_nearby(fit, &replaced(&model, index, elsewhere), end.run.as_deref())
            };
            let Some(belief) = belief(end, &mut cost) else { continue };
            uncertainty.add(problem, end, belief.interval);
            if let Some(better) = effect.with_end(end, belief.median).filter(|_| end.is_free()) {
                model.effects[index] = better;
                moved += 1;
            }
        }
        let runs = run_probability(problem, fit, &model, index);
        known.push(uncertainty.finished(runs));
    }
    if moved > 0 {
        let settled = problem.fit(&model, fit.theta.clone(), fit.noise);
        if settled.cost < fit.cost + RISE * f64::from(moved) {
            *fit = settled;
        }
    }
    known
}

impl IntervalEnd {
    fn is_free(&self) -> bool {
        matches!(self.reach, Reach::Between(..))
    }
}

fn replaced(model: &UpdatedModel, index: usize, effect: SharedHypothesis) -> UpdatedModel {
    let mut replaced = model.clone();
    replaced.effects[index] = effect;
    replaced
}

/// The posterior of an end, from the cost with the end elsewhere.
fn belief(end: &IntervalEnd, cost: &mut dyn FnMut(f64) -> Option<f64>) -> Option<Belief> {
    let mut points = vec![(end.at, cost(end.at)?)];
    match &end.reach {
        Reach::Between(low, high) => {
            for limit in [*low, *high] {
                let until = reached(end, limit, points[0].1, cost);
                for k in 1..=POINTS {
                    let at = end.at + (until - end.at) * k as f64 / POINTS as f64;
                    points.extend(cost(at).filter(|_| until != end.at).map(|cost| (at, cost)));
                }
            }
            least_first(&mut points, |it| it.0);
            Some(continuous(&points))
        }
        Reach::OneOf(values) => {
            let others = values.iter().filter(|&&value| value != end.at);
            points.extend(others.filter_map(|&at| Some((at, cost(at)?))));
            least_first(&mut points, |it| it.0);
            Some(discrete(&points))
        }
    }
}

/// The way towards a limit up to which an end is not out of the question, in doubling steps.
fn reached(
    end: &IntervalEnd,
    limit: f64,
    least: f64,
    cost: &mut dyn FnMut(f64) -> Option<f64>,
) -> f64 {
    let span = limit - end.at;
    let mut step = end.fine;
    while step < span.abs() {
        let at = end.at + step * span.signum();
        if cost(at).is_none_or(|cost| cost > least + FAR) {
            return at;
        }
        step *= 2.0;
    }
    limit
}

/// Likelihoods over their greatest.
fn weights(points: &[(f64, f64)]) -> Vec<f64> {
    let least = points.iter().map(|point| point.1).fold(f64::INFINITY, f64::min);
    points.iter().map(|point| (-0.5 * (point.1 - least)).exp()).collect()
}

/// Quantiles of a density that is linear between points.
fn continuous(points: &[(f64, f64)]) -> Belief {
    let density = weights(points);
    let mut below = vec![0.0];
    for (k, pair) in points.windows(2).enumerate() {
        let width = pair[1].0 - pair[0].0;
        below.push(below[k] + 0.5 * width * (density[k] + density[k + 1]));
    }
    let total = below[below.len() - 1];
    let quantile = |share: f64| {
        let wanted = share * total;
        let k = below.partition_point(|&sum| sum < wanted).clamp(1, below.len().max(2) - 1);
        let Some(&(high, _)) = points.get(k) else { return points[0].0 };
        let (low, part) = (points[k - 1].0, below[k] - below[k - 1]);
        if part > 0.0 { low + (high - low) * (wanted - below[k - 1]) / part } else { high }
    };
    Belief { median: quantile(0.5), interval: [quantile(0.025), quantile(0.975)] }
}

/// Quantiles of probabilities of single values.
fn discrete(points: &[(f64, f64)]) -> Belief {
    let probability = weights(points);
    let total: f64 = probability.iter().sum();
    let quantile = |share: f64| {
        let mut sum = 0.0;
        let reaches = |own: &f64| {
            sum += own;
            sum >= share * total
        };
        let k = probability.iter().position(reaches).unwrap_or(points.len() - 1);
        points[k].0
    };
    Belief { median: quantile(0.5), interval: [quantile(0.025), quantile(0.975)] }
}

/// For every fit run the probability that an effect acts in it, where its runs were chosen: all
/// or none is as likely beforehand.
fn run_probability(
    problem: &FitProblem,
    fit: &Fit,
    model: &UpdatedModel,
    index: usize,
) -> Option<BTreeMap<String, f64>> {
    let effect = &model.effects[index];
    let site = effect.site()?;
    let chosen = site.runs.as_ref()?;
    let mut probability = BTreeMap::new();
    for run in &problem.runs {
        let cost = |is_in: bool| {
            let mut files: Vec<String> =
                chosen.iter().filter(|file| **file != run.file).cloned().collect();
            files.extend(is_in.then(|| run.file.clone()));
            let elsewhere = effect.at_site(Site { runs: Some(files), ..site.clone() })?;
            problem.cost_nearby(fit, &replaced(model, index, elsewhere), Some(&run.file))
        };
        let (with, without) = (cost(true)?, cost(false)?);
        let known = 1.0 / (1.0 + (0.5 * (with - without)).exp());
        probability.insert(run.file.clone(), known);
    }
    Some(probability)
}

/// Intervals of ends, by chainage, window and covariate.
#[derive(Default)]
struct Collected {
    place: PlaceUncertainty,
}

impl Collected {
    fn add(&mut self, problem: &FitProblem, end: &IntervalEnd, interval: [f64; 2]) {
        let upper = usize::from(end.is_upper);
        match end.axis {
            Axis::Chainage => {
                let all = self.place.intervals_m.get_or_insert_default();
                all.resize(all.len().max(end.part + 1), [[f64::NAN; 2]; 2]);
                all[end.part][upper] = interval;
            }
            Axis::Covariate => {
                self.place.range.get_or_insert_default()[upper] = Some(interval);
            }
            Axis::Time => {
                let Some(file) = &end.run else { return };
                let run = problem.runs.iter().find(|run| run.file == *file);
                let offset_s = run.map_or(0.0, |run| run.offset_s);
                let interval_s = interval.map(|at| at + offset_s);
                let all = self.place.windows.get_or_insert_default();
                if !end.is_upper {
                    all.push(WindowUncertainty {
                        run: file.clone(),
                        t_start_s: interval_s,
                        t_end_s: None,
                    });
                } else if let Some(last) = all.last_mut() {
                    last.t_end_s = Some(interval_s);
                }
            }
        }
    }

    fn finished(mut self, runs: Option<BTreeMap<String, f64>>) -> Option<PlaceUncertainty> {
        self.place.run_probability = runs;
        (self.place != PlaceUncertainty::default()).then_some(self.place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn end(at: f64, reach: Reach) -> IntervalEnd {
        let (part, is_upper, fine) = (0, false, 0.5);
        IntervalEnd { axis: Axis::Chainage, part, is_upper, at, reach, fine, run: None }
    }

    #[test]
    fn a_normal_likelihood_gives_the_normal_interval_wherever_the_search_had_put_the_end() {
        for found in [97.0, 100.0, 104.0] {
            let mut cost = |at: f64| Some(((at - 100.0) / 5.0).powi(2));
            let known = belief(&end(found, Reach::Between(0.0, 1000.0)), &mut cost).unwrap();
            assert!((known.median - 100.0).abs() < 0.5, "{}", known.median);
            let [low, high] = known.interval;
            assert!((low - 90.2).abs() < 1.0 && (high - 109.8).abs() < 1.0, "{low} {high}");
        }
    }

    #[test]
    fn where_the_data_say_nothing_an_end_lies_in_the_middle_of_its_reach() {
        let mut cost = |at: f64| Some(if (200.0..=600.0).contains(&at) { 0.0 } else { 1e3 });
        let known = belief(&end(210.0, Reach::Between(0.0, 1000.0)), &mut cost).unwrap();
        assert!((known.median - 400.0).abs() < 40.0, "{}", known.median);
        let [low, high] = known.interval;
        assert!(low < 230.0 && high > 570.0, "{low} {high}");
    }

    #[test]
    fn an_end_at_one_of_some_stations_is_as_likely_as_its_likelihood_says() {
        let stations = Reach::OneOf(vec![0.0, 1000.0, 2000.0, 3000.0]);
        let mut sure = |at: f64| Some(if at == 1000.0 { 0.0 } else { 40.0 });
        let known = belief(&end(1000.0, stations.clone()), &mut sure).unwrap();
        assert_eq!(known.interval, [1000.0, 1000.0]);
        let mut open = |at: f64| Some(if at < 1500.0 { 0.0 } else { 40.0 });
        let known = belief(&end(1000.0, stations), &mut open).unwrap();
        assert_eq!(known.interval, [0.0, 1000.0]);
    }
}
