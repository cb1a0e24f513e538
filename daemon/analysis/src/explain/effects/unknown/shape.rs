//! Gain of a force of a form, and the numbers that maximise it.

use dynocar_model::terms::extra::{Covariate, CovariateFactor};

use super::known::KnownCovariate;
use super::known::{estimated, is_exponent};
use crate::explain::scan::{Scan, Tuple};

/// Steps of the search for numbers, as shares of the range, one after the other.
const REFINING_STEPS: [f64; 7] = [0.1, 0.05, 0.025, 0.012, 0.006, 0.003, 0.0015];

/// A shape that was tried.
#[derive(Clone)]
pub struct TriedShape {
    /// Decrease of the cost by it.
    pub gain: f64,
    /// The same less the price of its numbers.
    pub worth: f64,
    /// The size in N/kN with the greatest gain.
    pub n_per_kn: f64,
    /// The form.
    pub factors: Vec<CovariateFactor>,
    /// Whether exponents are held and not fitted.
    pub holds_exponents: bool,
}

/// Data on which shapes are tried.
pub struct Ground<'s> {
    scan: &'s Scan<'s>,
    /// The covariates that vary.
    pub known: Vec<KnownCovariate>,
    /// By run and bin: acceleration in m/s² by 1 N/kN.
    per_unit_mps2: Vec<Vec<f64>>,
    /// Price of a number (Schwarz).
    number_cost: f64,
}

impl<'s> Ground<'s> {
    /// Returns the data of a scan.
    pub fn of(scan: &'s Scan) -> Self {
        let known = Covariate::ALL.iter().filter_map(|&of| KnownCovariate::of(scan, of)).collect();
        let number_cost = (scan.fit.observations().max(2) as f64).ln();
        let per_unit_mps2 = scan.problem.runs.iter().map(|run| {
            let middles = run.bins.iter().map(|bin| &run.samples()[bin.middle()]);
            middles.map(|sample| scan.per_unit_resistance_mps2(sample)).collect()
        });
        Ground { scan, known, per_unit_mps2: per_unit_mps2.collect(), number_cost }
    }

    /// A covariate, where it varies.
    pub fn covariate(&self, of: Covariate) -> Option<&KnownCovariate> {
        self.known.iter().find(|known| known.of == of)
    }

    /// A factor by run and bin; none where its covariate is not known.
    pub fn values(&self, factor: &CovariateFactor) -> Vec<Vec<f64>> {
        let of_run = |covariate: &Vec<f64>| {
            let mut values = vec![1.0; covariate.len()];
            factor.multiply(covariate, &mut values);
            values
        };
        self.covariate(factor.of).into_iter().flat_map(|it| &it.values).map(of_run).collect()
    }

    /// Returns the gain of a force of these factors.
    pub fn tried(&self, factors: Vec<CovariateFactor>, holds_exponents: bool) -> TriedShape {
        let values: Vec<_> = factors.iter().map(|factor| self.values(factor)).collect();
        let values: Vec<&[Vec<f64>]> = values.iter().map(Vec::as_slice).collect();
        self.tried_at(factors, &values, holds_exponents)
    }

    /// Returns the gain of a force of factors whose values are known.
    pub fn tried_at(
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
    pub fn refined(&self, mut best: TriedShape) -> TriedShape {
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
