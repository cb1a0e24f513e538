//! Course of an effect over the runs: an effect that grows, fades or changes at once is shown over time, and not
//! averaged.
//!
//! Each run has its own normal equations at the finished model. A number that differs from run to run by a given course
//! (a line, or a step between two runs) is one more parameter, and follows from these equations by linear algebra: the
//! runs are not read again. Its uncertainty follows from the scatter between the runs (the sandwich estimator of White
//! 1980, each run left out as in MacKinnon and White 1985), and is never less than the likelihood allows.

use dynocar_model::terms::{Parameter, wheel};
use dynocar_shared::HALF_95;
use dynocar_shared::vocabulary::EffectKind;
use nalgebra::{Cholesky, DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::answer::{Course, CoursePart};
use super::evidence::{Fit, FitProblem, RunNormal};
use super::hypothesis::Hypothesis;

/// Least number of runs that can show a course.
const RUNS_MIN: usize = 8;
/// Least number of runs on each side of a step.
const STEP_RUNS_MIN: usize = 3;
/// Least number of runs in a shown part, and greatest number of parts.
const PART_RUNS_MIN: usize = 2;
const PARTS_MAX: usize = 6;
/// Greatest probability by chance of a change that is stated, for all courses tried together.
pub const CHANCE_MAX: f64 = 1e-3;
/// Greatest number of parameters of an effect whose courses are tried: one with more is a profile.
const NUMBERS_MAX: usize = 2;

/// First and last file of the runs that make a row of normal equations.
pub type Span = [String; 2];

/// Returns the courses of the numbers of a fitted model that change over the runs, by effect.
///
/// `spans` names the runs of the fit's normal equations, `stds` are the stated deviations of the parameters of the
/// first effects, which are looked at.
pub fn courses(
    problem: &FitProblem,
    fit: &Fit,
    spans: &[Span],
    stds: &[f64],
) -> Vec<(EffectKind, Vec<Course>)> {
    let mut all = Vec::new();
    let mut knows_scale = false;
    for (effect, range) in fit.model.effects.iter().zip(fit.model.ranges()) {
        let nature = effect.nature();
        knows_scale |= nature.changes_speed_scale;
        if !is_one_in_all_runs(&**effect) || range.end > stds.len() {
            continue;
        }
        let mut runs = fit.runs.clone();
        if nature.changes_speed_scale {
            add_positions(problem, fit.theta[range.start], range.start, &mut runs);
        }
        let prior = (&fit.prior_information, &fit.prior_score);
        let course = |(number, parameter): (usize, &Parameter)| {
            let runs = Runs { runs: &runs, prior, value: fit.theta[number], number };
            runs.course(parameter.name, stds[number], spans)
        };
        let own: Vec<Course> = range.zip(effect.parameters()).filter_map(course).collect();
        if !own.is_empty() {
            all.push((effect.kind(), own));
        }
    }
    if !knows_scale {
        let own = by_positions(problem, fit, spans);
        all.extend(own.map(|course| (EffectKind::WheelDiameter, vec![course])));
    }
    all
}

/// Returns whether an effect has the same one or two numbers in each run.
pub fn is_one_in_all_runs(effect: &dyn Hypothesis) -> bool {
    let place = effect.place();
    let is_common = place.runs.is_none() && place.windows.is_none();
    is_common && effect.parameters().len() <= NUMBERS_MAX && !effect.nature().is_one_number_a_run
}

/// Returns the course of the scale of the speeds by positions alone, where no effect of the model is about it.
fn by_positions(problem: &FitProblem, fit: &Fit, spans: &[Span]) -> Option<Course> {
    let (ratio, std) = problem.positions.distance_ratio?;
    let mut runs = vec![RunNormal::none(1); fit.runs.len()];
    add_positions(problem, ratio.recip(), 0, &mut runs);
    let prior = (&DMatrix::zeros(1, 1), &DVector::zeros(1));
    let runs = Runs { runs: &runs, prior, value: ratio.recip(), number: 0 };
    runs.course(wheel::PARAMETERS[0].name, std, spans)
}

/// Adds to each run the information of its positions on the scale of its speeds.
fn add_positions(problem: &FitProblem, scale: f64, number: usize, runs: &mut [RunNormal]) {
    for (own, run) in runs.iter_mut().zip(&problem.runs) {
        let Some((ratio, std)) = run.distance_ratio else { continue };
        let slope = -1.0 / (scale * scale) / std;
        own.information[(number, number)] += slope * slope;
        own.score[number] += slope * (ratio - 1.0 / scale) / std;
    }
}

/// Normal equations of runs, and the parameter that is examined.
struct Runs<'a> {
    runs: &'a [RunNormal],
    /// Information and score before the data.
    prior: (&'a DMatrix<f64>, &'a DVector<f64>),
    /// The parameter where it is the same in all runs, and its number.
    value: f64,
    number: usize,
}

impl Runs<'_> {
    /// Returns the most significant course, where its change exceeds half the 95 % interval of the common number.
    fn course(&self, parameter: &'static str, std: f64, spans: &[Span]) -> Option<Course> {
        if self.runs.len() < RUNS_MIN {
            return None;
        }
        let (change, p_value) = self.change()?;
        let is_stated = change.abs() > HALF_95 * std && p_value < CHANCE_MAX;
        is_stated.then(|| Course { parameter, parts: self.parts(spans), p_value })
    }

    /// Returns the likeliest change from the first run to the last, and the probability of as much by chance.
    fn change(&self) -> Option<(f64, f64)> {
        let count = self.runs.len();
        let line = (0..count).map(|k| k as f64 / (count - 1) as f64).collect();
        let steps = (STEP_RUNS_MIN..=count - STEP_RUNS_MIN)
            .map(|at| (0..count).map(|k| f64::from(u8::from(k >= at))).collect());
        let shapes: Vec<Vec<f64>> = std::iter::once(line).chain(steps).collect();
        let student = StudentsT::new(0.0, 1.0, count as f64 - 2.0).ok()?;
        let chance = |shape: &Vec<f64>| {
            let (change, std) = self.along(shape)?;
            let p_value = 2.0 * student.sf((change / std).abs());
            Some((change, (p_value * shapes.len() as f64).min(1.0)))
        };
        shapes.iter().filter_map(chance).min_by(|one, other| one.1.total_cmp(&other.1))
    }

    /// Returns the size of a course of a given shape, with its standard deviation, all parameters estimated with it.
    fn along(&self, shape: &[f64]) -> Option<(f64, f64)> {
        let i = self.number;
        let total = self.runs.iter().fold(self.prior.0.clone(), |sum, run| sum + &run.information);
        let factor = Cholesky::new(total)?;
        let shared: DVector<f64> =
            shape.iter().zip(self.runs).map(|(t, run)| run.information.column(i) * *t).sum();
        let weights = factor.solve(&shared);
        let own: f64 =
            shape.iter().zip(self.runs).map(|(t, run)| t * t * run.information[(i, i)]).sum();
        let information = own - shared.dot(&weights);
        // The pull of each run on the size, of which the size itself explains a part.
        let pull = |(t, run): (&f64, &RunNormal)| t * run.score[i] - weights.dot(&run.score);
        let pulls: Vec<f64> = shape.iter().zip(self.runs).map(pull).collect();
        let prior = weights.dot(self.prior.1);
        let size = (pulls.iter().sum::<f64>() - prior) / information;
        let common = factor.solve(&(self.score() - &shared * size));
        let explained = |(t, run): (&f64, &RunNormal)| {
            let mut toward = &run.information * &common;
            toward += run.information.column(i) * (t * size);
            t * toward[i] - weights.dot(&toward)
        };
        // A run pulls the size towards itself by its share of all information on the size.
        let share = |(t, run): (&f64, &RunNormal)| {
            let own = &run.information * &weights;
            (t * t * run.information[(i, i)] - 2.0 * t * own[i] + weights.dot(&own)) / information
        };
        let runs = || shape.iter().zip(self.runs);
        let (mut scatter, mut pooled) = (0.0, 0.0);
        for (pull, run) in pulls.iter().zip(runs()) {
            let (left, share) = (pull - explained(run), share(run));
            scatter += (left / (1.0 - share).max(f64::EPSILON)).powi(2) / information;
            pooled += left * left / (share * information).max(f64::MIN_POSITIVE);
        }
        // Three runs on one side of a step may agree by chance: then the scatter of all holds for them.
        pooled /= self.runs.len() as f64 - 2.0;
        let variance = scatter.max(pooled).max(1.0) / information;
        (information > 0.0).then(|| (size, variance.sqrt()))
    }

    fn score(&self) -> DVector<f64> {
        self.runs.iter().fold(self.prior.1.clone(), |sum, run| sum + &run.score)
    }

    /// Returns the number by itself in each of some parts of the runs, all others common to all.
    fn parts(&self, spans: &[Span]) -> Vec<CoursePart> {
        let (i, count) = (self.number, self.runs.len());
        let parts = (count / PART_RUNS_MIN).clamp(1, PARTS_MAX);
        let of = |k: usize| k * parts / count;
        let size = self.prior.1.len();
        // The common number stands for that of the first part.
        let place = |k: usize| if of(k) == 0 { i } else { size + of(k) - 1 };
        let mut information = DMatrix::<f64>::zeros(size + parts - 1, size + parts - 1);
        let mut score = DVector::<f64>::zeros(size + parts - 1);
        let at = |k: usize, row: usize| if row == i { place(k) } else { row };
        for (k, run) in self.runs.iter().enumerate() {
            for row in 0..size {
                score[at(k, row)] += run.score[row];
                for column in 0..size {
                    information[(at(k, row), at(k, column))] += run.information[(row, column)];
                }
            }
        }
        for row in (0..size).filter(|row| *row != i) {
            score[row] += self.prior.1[row];
            for column in (0..size).filter(|column| *column != i) {
                information[(row, column)] += self.prior.0[(row, column)];
            }
        }
        let Some(factor) = Cholesky::new(information) else { return Vec::new() };
        let (moved, covariance) = (factor.solve(&score), factor.inverse());
        let part = |part: usize| {
            let own: Vec<usize> = (0..count).filter(|k| of(*k) == part).collect();
            let (first, last) = (*own.first()?, *own.last()?);
            let number = place(first);
            Some(CoursePart {
                first_run: spans.get(first)?[0].clone(),
                last_run: spans.get(last)?[1].clone(),
                value: self.value + moved[number],
                std: covariance[(number, number)].sqrt(),
            })
        };
        (0..parts).filter_map(part).collect()
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    use super::*;

    /// Returns a number from 0 to 1.
    fn share(random: &mut ChaCha8Rng) -> f64 {
        f64::from(random.next_u32()) / f64::from(u32::MAX)
    }

    /// Normal equations of runs that see a number and a nuisance together, at both as fitted to all.
    struct Seen {
        runs: Vec<RunNormal>,
        prior: (DMatrix<f64>, DVector<f64>),
    }

    fn seen(truth: &[f64], seed: u64) -> Seen {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut noise = || (0..12).map(|_| share(&mut random)).sum::<f64>() - 6.0;
        let mut runs: Vec<RunNormal> = truth
            .iter()
            .map(|value| {
                let mut run = RunNormal::none(2);
                for _ in 0..40 {
                    let row = DVector::from_vec(vec![1.0, noise()]);
                    run.score += &row * (value + 0.5 * row[1] + noise());
                    run.information += &row * row.transpose();
                }
                run
            })
            .collect();
        let total = runs.iter().fold(DMatrix::zeros(2, 2), |sum, run| sum + &run.information);
        let pull = runs.iter().fold(DVector::zeros(2), |sum, run| sum + &run.score);
        let fitted = Cholesky::new(total).unwrap().solve(&pull);
        for run in &mut runs {
            run.score -= &run.information * &fitted;
        }
        Seen { runs, prior: (DMatrix::zeros(2, 2), DVector::zeros(2)) }
    }

    fn course(seen: &Seen) -> Option<Course> {
        let spans: Vec<Span> =
            (0..seen.runs.len()).map(|k| [k.to_string(), k.to_string()]).collect();
        let (runs, prior) = (&seen.runs[..], (&seen.prior.0, &seen.prior.1));
        Runs { runs, prior, value: 0.0, number: 0 }.course("size", 0.05, &spans)
    }

    #[test]
    fn what_grows_or_steps_is_shown_with_its_size_in_each_part() {
        for is_step in [false, true] {
            let value =
                |k: usize| if is_step { f64::from(u8::from(k >= 20)) } else { k as f64 / 29.0 };
            let truth: Vec<f64> = (0..30).map(value).collect();
            let mean = truth.iter().sum::<f64>() / 30.0;
            let mut held = 0;
            for seed in 0..20 {
                let found = course(&seen(&truth, seed)).expect("it changes");
                assert_eq!(found.parts.len(), PARTS_MAX);
                assert!(found.p_value < 1e-4, "{found:?}");
                held += found
                    .parts
                    .iter()
                    .enumerate()
                    .filter(|(part, it)| {
                        let own = &truth[5 * part..5 * part + 5];
                        let expected = own.iter().sum::<f64>() / 5.0 - mean;
                        (it.value - expected).abs() < HALF_95 * it.std
                    })
                    .count();
            }
            assert!((106..=120).contains(&held), "{held} of 120 intervals hold the truth");
        }
    }

    #[test]
    fn what_is_the_same_in_all_runs_or_scatters_without_a_course_is_not_said_to_change() {
        for count in [7, 8, 24, 64] {
            for seed in 0..100 {
                let mut random = ChaCha8Rng::seed_from_u64(1000 + seed);
                let scattered: Vec<f64> = (0..count).map(|_| share(&mut random)).collect();
                assert_eq!(course(&seen(&scattered, seed)), None, "{count} runs, seed {seed}");
            }
        }
    }
}
