//! Forms that are tried for an unexplained force: every form of one covariate, and products of two.
//!
//! A form is linear in its size, so that its gain follows from one whitened shape; its other numbers are tried on a
//! grid here and fitted later. The kinds of the library are not tried again: a force in proportion to traction, a decay
//! from the start, places.

use dynocar_model::terms::extra::{Covariate, CovariateFactor, ExtraResistance, Form};

use super::form::{FormForce, choice_cost};
use super::known::{KnownCovariate, estimated, is_exponent};
use crate::explain::effects::Candidate;
use crate::explain::scan::{Scan, Tuple};
use crate::parallel;
use crate::statistics::greatest_first;

/// Number of forms of the speed that products are tried with, in addition to its first and second power.
const BEST_FOR_PRODUCTS: usize = 3;
/// Number of structures whose numbers are sought before they are fitted, and how many of these may share their first
/// factor: otherwise the variants of one structure would displace the others.
const REFINED: usize = 8;
const REFINED_ALIKE: usize = 2;
/// Exponents of the speed in a product that are tried without a fit: one number less is estimated.
const WHOLE_EXPONENTS: [f64; 2] = [1.0, 2.0];
/// Steps of the search for numbers, as shares of the range, one after the other.
const REFINING_STEPS: [f64; 7] = [0.1, 0.05, 0.025, 0.012, 0.006, 0.003, 0.0015];

/// A shape that was tried.
#[derive(Clone)]
struct TriedShape {
    /// Decrease of the cost by it.
    gain: f64,
    /// The same less the price of its numbers.
    worth: f64,
    /// The size in N/kN with the greatest gain.
    n_per_kn: f64,
    /// The form.
    factors: Vec<CovariateFactor>,
    /// Whether exponents are held and not fitted.
    holds_exponents: bool,
}

/// Data on which shapes are tried.
struct Ground<'s> {
    scan: &'s Scan<'s>,
    /// The covariates that vary.
    known: Vec<KnownCovariate>,
    /// By run and bin: acceleration in m/s² by 1 N/kN.
    per_unit_mps2: Vec<Vec<f64>>,
    /// Price of a number (Schwarz).
    number_cost: f64,
}

impl<'s> Ground<'s> {
    /// Returns the data of a scan.
    fn of(scan: &'s Scan) -> Self {
        let known = Covariate::ALL.iter().filter_map(|&of| KnownCovariate::of(scan, of)).collect();
        let number_cost = (scan.fit.observations().max(2) as f64).ln();
        let per_unit_mps2 = scan.problem.runs.iter().map(|run| {
            let middles = run.bins.iter().map(|bin| &run.samples()[bin.middle()]);
            middles.map(|sample| scan.per_unit_resistance_mps2(sample)).collect()
        });
        Ground { scan, known, per_unit_mps2: per_unit_mps2.collect(), number_cost }
    }

    /// A covariate, where it varies.
    fn covariate(&self, of: Covariate) -> Option<&KnownCovariate> {
        self.known.iter().find(|known| known.of == of)
    }

    /// A factor by run and bin; none where its covariate is not known.
    fn values(&self, factor: &CovariateFactor) -> Vec<Vec<f64>> {
        let of_run = |covariate: &Vec<f64>| {
            let mut values = vec![1.0; covariate.len()];
            factor.multiply(covariate, &mut values);
            values
        };
        self.covariate(factor.of).into_iter().flat_map(|it| &it.values).map(of_run).collect()
    }

    /// Returns the gain of a force of these factors.
    fn tried(&self, factors: Vec<CovariateFactor>, holds_exponents: bool) -> TriedShape {
        let values: Vec<_> = factors.iter().map(|factor| self.values(factor)).collect();
        let values: Vec<&[Vec<f64>]> = values.iter().map(Vec::as_slice).collect();
        self.tried_at(factors, &values, holds_exponents)
    }

    /// Returns the gain of a force of factors whose values are known.
    fn tried_at(
        &self,
        factors: Vec<CovariateFactor>,
        values: &[&[Vec<f64>]],
        holds_exponents: bool,
    ) -> TriedShape {
        let mut sum = Tuple::zero(self.scan.fit.theta.len());
        for (index, per_unit_mps2) in self.per_unit_mps2.iter().enumerate() {
            let mut shape = vec![1.0; per_unit_mps2.len()];
            for values in values {
                shape.iter_mut().zip(&values[index]).for_each(|(shape, value)| *shape *= value);
            }
            shape.iter_mut().zip(per_unit_mps2).for_each(|(shape, unit)| *shape *= -unit);
            sum.add(&self.scan.shape_tuple(index, &shape));
        }
        let (gain, n_per_kn) = self.scan.gain(&sum);
        let of_factors = factors.iter().map(|factor| estimated(factor.form, holds_exponents));
        let worth = gain - (1 + of_factors.sum::<usize>()) as f64 * self.number_cost;
        TriedShape { gain, worth, n_per_kn, factors, holds_exponents }
    }

    /// The same structure with the numbers near by that explain most.
    fn refined(&self, mut best: TriedShape) -> TriedShape {
        for step in REFINING_STEPS {
            for factor in 0..best.factors.len() {
                for number in 0..best.factors[factor].form.numbers().len() {
                    for change in [-step, step] {
                        if let Some(other) = self.moved(&best, (factor, number), change)
                            && other.gain > best.gain
                        {
                            best = other;
                        }
                    }
                }
            }
        }
        best
    }

    /// A shape with one number moved by a share of its range; `None` where that is no form.
    fn moved(
        &self,
        one: &TriedShape,
        (factor, number): (usize, usize),
        change: f64,
    ) -> Option<TriedShape> {
        let range = self.covariate(one.factors[factor].of)?;
        let mut factors = one.factors.clone();
        let CovariateFactor { form, numbers, .. } = &mut factors[factor];
        let is_exponent = is_exponent(*form, number);
        if is_exponent && one.holds_exponents {
            return None;
        }
        numbers[number] += change * if is_exponent { 5.0 } else { range.high - range.low };
        form.refusal(*numbers).is_none().then(|| self.tried(factors, one.holds_exponents))
    }
}

/// Returns the greatest gain of a form beyond its price, before its numbers are fitted.
pub fn greatest_bic_gain(scan: &Scan) -> f64 {
    let all = all_tried(&Ground::of(scan));
    let first = all.first().map_or(f64::NEG_INFINITY, |best| best.worth);
    first - choice_cost(all.len() as f64)
}

/// The forms that explain most for their price, one of each first factor; the best first. None
/// where none explains its price.
pub fn forms(scan: &Scan) -> Vec<Candidate> {
    let ground = Ground::of(scan);
    let all = all_tried(&ground);
    let count = all.len() as f64;
    if all.first().is_none_or(|best| best.worth < choice_cost(count)) {
        return Vec::new();
    }
    let mut structures = alike(one_of_each_structure(all), REFINED_ALIKE);
    structures.truncate(REFINED);
    let best = parallel::of_each_owned(structures, |_, one| {
        let refined = ground.refined(one);
        let whole = with_whole_exponent(&ground, &refined);
        [Some(refined), whole]
    });
    let mut best: Vec<TriedShape> = best.into_iter().flatten().flatten().collect();
    sort(&mut best);
    let candidate = |one: TriedShape| {
        let range = |factor: &CovariateFactor| {
            let range = ground.covariate(factor.of);
            range.map_or([0.0, 0.0, 1.0], |it| [it.least, it.low, it.high])
        };
        let ranges: Vec<[f64; 3]> = one.factors.iter().map(range).collect();
        let extra = ExtraResistance { n_per_kn: one.n_per_kn, factors: one.factors };
        FormForce::candidate(&extra, one.holds_exponents, &ranges, count, scan)
    };
    alike(best, 1).into_iter().map(candidate).collect()
}

/// Products of each of some factors with each of others.
fn products(
    ground: &Ground,
    first: Vec<CovariateFactor>,
    second: Vec<CovariateFactor>,
) -> Vec<TriedShape> {
    type AtBins = (CovariateFactor, Vec<Vec<f64>>);
    let at_bins = |factors: Vec<CovariateFactor>| -> Vec<AtBins> {
        parallel::of_each_owned(factors, |_, factor| (factor, ground.values(&factor)))
    };
    let (first, second) = (at_bins(first), at_bins(second));
    parallel::of_each_number(first.len() * second.len(), |pair| {
        let (one, by_one) = &first[pair / second.len()];
        let (other, by_other) = &second[pair % second.len()];
        ground.tried_at(vec![*one, *other], &[by_one, by_other], false)
    })
}

/// Every form of one covariate, and the products; the best first.
fn all_tried(ground: &Ground) -> Vec<TriedShape> {
    let alone: Vec<CovariateFactor> = ground.known.iter().flat_map(KnownCovariate::alone).collect();
    let mut all = parallel::of_each(&alone, |factor| ground.tried(vec![*factor], false));
    sort(&mut all);
    let Some(speed) = ground.covariate(Covariate::Speed) else { return all };
    let of_speed = all.iter().filter(|it| it.factors[0].of == Covariate::Speed);
    let mut first: Vec<CovariateFactor> =
        of_speed.take(BEST_FOR_PRODUCTS).map(|it| it.factors[0]).collect();
    first.extend(speed.powers(&WHOLE_EXPONENTS));
    let others = ground.known.iter().filter(|one| one.of != Covariate::Speed);
    let second: Vec<CovariateFactor> = others.flat_map(KnownCovariate::given_speed).collect();
    all.extend(products(ground, first, second));
    sort(&mut all);
    all
}

/// The best of each structure that explains anything; the best first.
fn one_of_each_structure(all: Vec<TriedShape>) -> Vec<TriedShape> {
    let mut seen: Vec<Vec<(Covariate, Form)>> = Vec::new();
    let mut is_new = |one: &TriedShape| {
        let structure: Vec<_> = one.factors.iter().map(|it| (it.of, it.form)).collect();
        let is_new = one.gain > 0.0 && !seen.contains(&structure);
        if is_new {
            seen.push(structure);
        }
        is_new
    };
    all.into_iter().filter(|one| is_new(one)).collect()
}

/// The first of those whose first factor has the same form, as many as may be.
fn alike(tried: Vec<TriedShape>, most: usize) -> Vec<TriedShape> {
    let mut seen: Vec<(Covariate, Form)> = Vec::new();
    let mut is_kept = |one: &TriedShape| {
        let own = (one.factors[0].of, one.factors[0].form);
        seen.push(own);
        seen.iter().filter(|it| **it == own).count() <= most
    };
    tried.into_iter().filter(|one| is_kept(one)).collect()
}

/// A product of a power of the speed with the whole exponent that explains most, which is then no
/// number to be fitted; `None` of anything else.
fn with_whole_exponent(ground: &Ground, one: &TriedShape) -> Option<TriedShape> {
    if one.factors.len() < 2 || one.factors[0].form != Form::Power {
        return None;
    }
    let whole = WHOLE_EXPONENTS.map(|exponent| {
        let mut factors = one.factors.clone();
        factors[0].numbers[1] = exponent;
        ground.refined(ground.tried(factors, true))
    });
    whole.into_iter().max_by(|one, other| one.gain.total_cmp(&other.gain))
}

fn sort(tried: &mut Vec<TriedShape>) {
    greatest_first(tried, |it| it.worth);
}
