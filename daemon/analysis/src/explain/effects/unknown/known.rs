//! A covariate over the fit runs, the forms of it that are tried, and the numbers of these that are estimated.

use dynocar_model::terms::extra::{Covariate, CovariateFactor, Form};

use crate::explain::evidence::RunData;
use crate::explain::scan::Scan;

/// Number of bins that is too small to show anything, or share of them where there are few bins.
const FEW_BINS: usize = 8;
const FEW_SHARE: f64 = 0.03;

/// Values of a covariate over all bins of the fit runs.
pub struct KnownCovariate {
    /// The covariate.
    pub of: Covariate,
    /// By run and bin; `NaN` where it is not known.
    pub values: Vec<Vec<f64>>,
    /// Least value.
    pub low: f64,
    /// Value below which there are too few bins to show anything.
    pub least: f64,
    /// Greatest value.
    pub high: f64,
}

impl KnownCovariate {
    /// Returns the values of a covariate; `None` where it is known nowhere or does not vary.
    pub fn of(scan: &Scan, of: Covariate) -> Option<Self> {
        let of_run =
            |run: &RunData| run.bins.iter().map(|bin| run.covariate(of)[bin.middle()]).collect();
        let values: Vec<Vec<f64>> = scan.problem.runs.iter().map(of_run).collect();
        let mut known: Vec<f64> =
            values.iter().flatten().copied().filter(|value| !value.is_nan()).collect();
        let low = known.iter().copied().min_by(f64::total_cmp)?;
        let high = known.iter().copied().max_by(f64::total_cmp)?;
        let few = FEW_BINS.min((FEW_SHARE * known.len() as f64) as usize);
        let least = *known.select_nth_unstable_by(few, f64::total_cmp).1;
        let is_varied = high - low > 1e-6 && (high - low).is_finite();
        is_varied.then_some(KnownCovariate { of, values, low, least, high })
    }

    fn at(&self, share: f64) -> f64 {
        self.low + share * (self.high - self.low)
    }

    fn factor(&self, form: Form, numbers: [f64; 2]) -> CovariateFactor {
        CovariateFactor { of: self.of, form, numbers }
    }

    /// Forms with a knee at shares of the range.
    fn hinges(&self) -> Vec<CovariateFactor> {
        let span = 0.1 * (self.high - self.low);
        let knees = [0.15, 0.3, 0.45, 0.6, 0.75, 0.88];
        let both = knees.iter().flat_map(|&share| {
            [Form::Above, Form::Below].map(|form| self.factor(form, [self.at(share), span]))
        });
        both.collect()
    }

    /// Powers that are no term of a, b, c.
    pub fn powers(&self, exponents: &[f64]) -> Vec<CovariateFactor> {
        if self.low < 0.0 {
            return Vec::new();
        }
        exponents.iter().map(|&it| self.factor(Form::Power, [self.high, it])).collect()
    }

    /// Parts of the range.
    fn parts(&self) -> Vec<CovariateFactor> {
        let edges = [0.0, 0.25, 0.5, 0.75, 1.0].map(|share| self.at(share));
        let pairs = (0..4).flat_map(|from| (from + 1..5).map(move |to| (from, to)));
        pairs
            .filter_map(|(from, to)| match (from, to) {
                (0, 4) => None,
                // A form that lasts to the end of these data may last in others.
                (from, 4) => Some(self.factor(Form::From, [edges[from], 0.0])),
                (0, to) => Some(self.factor(Form::UpTo, [edges[to], 0.0])),
                (from, to) => Some(self.factor(Form::Between, [edges[from], edges[to]])),
            })
            .collect()
    }

    fn of_speed(&self) -> Vec<CovariateFactor> {
        let mut factors = self.hinges();
        factors.extend(self.powers(&[0.5, 3.0]));
        for share in [0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0] {
            let below = share * self.high;
            let least = [1.0, 2.0, 4.0].into_iter().map(|it: f64| it.max(1.1 * self.least));
            let least = least.filter(|least| 1.5 * least < below);
            factors.extend(least.map(|least| self.factor(Form::Hyperbola, [below, least])));
        }
        let over = [0.06, 0.12, 0.25].map(|share| share * self.high);
        for form in [Form::Decay, Form::Rise] {
            factors.extend(over.map(|over| self.factor(form, [over, 0.0])));
        }
        for width in [0.04, 0.08] {
            let middles = (1..10).map(|k| self.at(0.1 * f64::from(k)));
            let width = width * (self.high - self.low);
            factors.extend(middles.map(|middle| self.factor(Form::Bell, [middle, width])));
        }
        factors
    }

    /// Forms that a force may have of this covariate alone.
    pub fn alone(&self) -> Vec<CovariateFactor> {
        match self.of {
            Covariate::Speed => self.of_speed(),
            // Places along the line are the library's and the bands'.
            Covariate::Chainage => Vec::new(),
            Covariate::TimeSinceStart | Covariate::Temperature => {
                let edges = |it: &CovariateFactor| it.form != Form::Between;
                self.hinges().into_iter().chain(self.parts().into_iter().filter(edges)).collect()
            }
            Covariate::TractionForce | Covariate::BrakeForce => {
                let mut factors = self.hinges();
                factors.extend(self.powers(&[0.5, 2.0]));
                factors
            }
        }
    }

    /// Returns the factors that may multiply the force of a form of the speed.
    pub fn given_speed(&self) -> Vec<CovariateFactor> {
        let mut factors = self.parts();
        if self.of != Covariate::Chainage {
            let knees = self.hinges().into_iter();
            factors.extend(knees.filter(|factor| {
                let share = (factor.numbers[0] - self.low) / (self.high - self.low);
                (0.2..0.8).contains(&share)
            }));
            factors.push(self.factor(Form::Above, [self.low, self.high - self.low]));
        }
        factors
    }
}

/// Numbers of a form that are fitted, with their bounds for a covariate over the range from `low`
/// to `high`; below `least` there are too few data to show anything.
pub fn fitted_numbers(form: Form, [least, low, high]: [f64; 3]) -> Vec<(usize, (f64, f64))> {
    let width = high - low;
    match form {
        Form::Power => vec![(1, (0.1, 5.0))],
        Form::Hyperbola => {
            // Runs that are never slow hold no low least.
            let least_bounds = (least, (0.3 * high).max(1.5 * least));
            vec![(0, (0.05 * high, 3.0 * high)), (1, least_bounds)]
        }
        Form::Above | Form::Below => vec![(0, (low, high))],
        // Their value jumps: they are sought, not fitted.
        Form::Between | Form::From | Form::UpTo => Vec::new(),
        Form::Decay | Form::Rise => vec![(0, (0.02 * high, 3.0 * high))],
        Form::Bell => vec![(0, (low, high)), (1, (0.01 * width, 0.6 * width))],
    }
}

/// The name of a number in the answer; that of the second factor says so.
pub fn named(factor: usize, name: &'static str) -> &'static str {
    match (factor, name) {
        (0, name) => name,
        (_, "at") => "second_at",
        (_, "exponent") => "second_exponent",
        (_, "below") => "second_below",
        (_, "least") => "second_least",
        (_, "from") => "second_from",
        (_, "until") => "second_until",
        (_, "over") => "second_over",
        (_, "width") => "second_width",
        (_, other) => other,
    }
}

/// Edges of a form, which are sought and not fitted.
pub fn edges(form: Form) -> usize {
    match form {
        Form::Between => 2,
        Form::From | Form::UpTo => 1,
        _ => 0,
    }
}

/// Returns whether a number of a form is an exponent.
pub fn is_exponent(form: Form, number: usize) -> bool {
    form == Form::Power && number == 1
}

/// Numbers of a form that are estimated, edges among them.
pub fn estimated(form: Form, holds_exponents: bool) -> usize {
    let fitted = fitted_numbers(form, [0.0, 0.0, 1.0]);
    let is_free = |number: usize| !(holds_exponents && is_exponent(form, number));
    fitted.iter().filter(|(number, _)| is_free(*number)).count() + edges(form)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_in_order_however_slow_or_fast_the_runs_are() {
        for form in Form::ALL {
            for range in [[1.0, 0.8, 30.0], [12.0, 10.0, 22.0], [18.9, 18.5, 19.4]] {
                for (_, (lower, upper)) in fitted_numbers(form, range) {
                    assert!(lower < upper, "{form:?} over {range:?}: {lower} to {upper}");
                }
            }
        }
    }

    #[test]
    fn an_exponent_that_is_held_is_no_number() {
        assert_eq!([false, true].map(|held| estimated(Form::Power, held)), [1, 0]);
        assert_eq!([false, true].map(|held| estimated(Form::Between, held)), [2, 2]);
    }
}
