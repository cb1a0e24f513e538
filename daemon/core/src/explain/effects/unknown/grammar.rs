//! Which forms an unexplained force may have: every form of one covariate, and products of two.
//!
//! A form is linear in its size, so that what it explains follows from one whitened shape; what
//! else it holds is laid out on a grid here and fitted later. The kinds of the library are not
//! tried again: a force in proportion to traction, a decay from the start, places.

use super::form::FormForce;
use crate::explain::effects::Candidate;
use crate::explain::scan::{Scan, Tuple};
use crate::terms::extra::{Covariate, Extra, Factor, Form};

/// Speed forms that products are tried with, beside its first and second power.
const BEST_FOR_PRODUCTS: usize = 3;

/// Share of the data that tells too little.
const FEW: f64 = 0.03;
/// Structures whose numbers are sought before they are fitted.
const REFINED: usize = 8;
/// Steps of that search, as shares of the range, one after the other.
const REFINING_STEPS: [f64; 4] = [0.1, 0.05, 0.025, 0.012];

/// What is known of a covariate over all bins of the fit runs.
struct Known {
    of: Covariate,
    /// By run and bin.
    values: Vec<Vec<Option<f64>>>,
    low: f64,
    /// A share of [`FEW`] of the values is less.
    least: f64,
    high: f64,
}

/// A shape that was tried.
struct Tried {
    gain: f64,
    n_per_kn: f64,
    factors: Vec<Factor>,
}

impl Known {
    /// `None` where it is known nowhere or is the same throughout.
    fn of(scan: &Scan, of: Covariate) -> Option<Self> {
        let values: Vec<Vec<Option<f64>>> = scan
            .problem
            .runs
            .iter()
            .map(|run| {
                run.bins.iter().map(|bin| run.samples()[bin.middle()].covariate(of)).collect()
            })
            .collect();
        let mut sorted: Vec<f64> = values.iter().flatten().flatten().copied().collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let (low, high) = (*sorted.first()?, *sorted.last()?);
        let least = sorted[(FEW * sorted.len() as f64) as usize];
        let is_varied = high - low > 1e-6 && (high - low).is_finite();
        is_varied.then_some(Known { of, values, low, least, high })
    }

    fn at(&self, share: f64) -> f64 {
        self.low + share * (self.high - self.low)
    }

    fn factor(&self, form: Form, numbers: [f64; 2]) -> Factor {
        Factor { of: self.of, form, numbers }
    }

    /// Forms with a knee at shares of the range.
    fn hinges(&self) -> Vec<Factor> {
        let span = 0.1 * (self.high - self.low);
        let knees = [0.15, 0.3, 0.45, 0.6, 0.75, 0.88];
        let both = knees.iter().flat_map(|&share| {
            [Form::Above, Form::Below].map(|form| self.factor(form, [self.at(share), span]))
        });
        both.collect()
    }

    /// Powers that are no term of a, b, c.
    fn powers(&self, exponents: &[f64]) -> Vec<Factor> {
        if self.low < 0.0 {
            return Vec::new();
        }
        exponents.iter().map(|&it| self.factor(Form::Power, [self.high, it])).collect()
    }

    /// Parts of the range.
    fn parts(&self) -> Vec<Factor> {
        let edges = [0.0, 0.25, 0.5, 0.75, 1.0].map(|share| self.at(share));
        let pairs = (0..4).flat_map(|from| (from + 1..5).map(move |to| (from, to)));
        pairs
            .filter_map(|(from, to)| match (from, to) {
                (0, 4) => None,
                // What lasts to the end of these data may last in others.
                (from, 4) => Some(self.factor(Form::From, [edges[from], 0.0])),
                (0, to) => Some(self.factor(Form::UpTo, [edges[to], 0.0])),
                (from, to) => Some(self.factor(Form::Between, [edges[from], edges[to]])),
            })
            .collect()
    }

    fn of_speed(&self) -> Vec<Factor> {
        let mut factors = self.hinges();
        factors.extend(self.powers(&[0.5, 3.0]));
        for share in [0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0] {
            let below = share * self.high;
            let least = [1.0, 2.0, 4.0].into_iter().map(|it: f64| it.max(1.1 * self.least));
            let least = least.filter(|least| 1.5 * least < below);
            factors.extend(least.map(|least| self.factor(Form::Hyperbola, [below, least])));
        }
        let over = [0.06, 0.12, 0.25].map(|share| share * self.high);
        factors.extend(over.map(|over| self.factor(Form::Decay, [over, 0.0])));
        for width in [0.04, 0.08] {
            let middles = (1..10).map(|k| self.at(0.1 * f64::from(k)));
            let width = width * (self.high - self.low);
            factors.extend(middles.map(|middle| self.factor(Form::Bell, [middle, width])));
        }
        factors
    }

    fn alone(&self) -> Vec<Factor> {
        match self.of {
            Covariate::Speed => self.of_speed(),
            // Places along the line are the library's and the bands'.
            Covariate::Chainage => Vec::new(),
            Covariate::TimeSinceStart | Covariate::Temperature => {
                let edges = |it: &Factor| it.form != Form::Between;
                self.hinges().into_iter().chain(self.parts().into_iter().filter(edges)).collect()
            }
            Covariate::TractionForce | Covariate::BrakeForce => {
                let mut factors = self.hinges();
                factors.extend(self.powers(&[0.5, 2.0]));
                factors
            }
        }
    }

    /// What the force of a form of the speed may be multiplied by.
    fn beside_speed(&self) -> Vec<Factor> {
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

/// The forms that explain most, one of each structure; the best first.
pub fn forms(scan: &Scan) -> Vec<Candidate> {
    let known: Vec<Known> = Covariate::ALL.iter().filter_map(|&of| Known::of(scan, of)).collect();
    let mut all: Vec<Tried> = known
        .iter()
        .flat_map(Known::alone)
        .map(|factor| tried(scan, &known, vec![factor]))
        .collect();
    sort(&mut all);
    if let Some(speed) = known.iter().find(|one| one.of == Covariate::Speed) {
        let of_speed = all.iter().filter(|it| it.factors[0].of == Covariate::Speed);
        let mut first: Vec<Factor> =
            of_speed.take(BEST_FOR_PRODUCTS).map(|it| it.factors[0]).collect();
        first.extend(speed.powers(&[1.0, 2.0]));
        let others = known.iter().filter(|one| one.of != Covariate::Speed);
        let second: Vec<Factor> = others.flat_map(Known::beside_speed).collect();
        for one in &first {
            all.extend(second.iter().map(|&other| tried(scan, &known, vec![*one, other])));
        }
        sort(&mut all);
    }
    let count = all.len() as f64;
    let mut best: Vec<Tried> = one_of_each_structure(all)
        .into_iter()
        .take(REFINED)
        .map(|one| refined(scan, &known, one))
        .collect();
    sort(&mut best);
    let candidate = |one: Tried| {
        let extra = Extra { n_per_kn: one.n_per_kn, factors: one.factors };
        let range = |factor: &Factor| {
            let range = known.iter().find(|it| it.of == factor.of);
            range.map_or([0.0, 0.0, 1.0], |it| [it.least, it.low, it.high])
        };
        let ranges: Vec<[f64; 3]> = extra.factors.iter().map(range).collect();
        FormForce::candidate(&extra, &ranges, count, scan)
    };
    best.into_iter().map(candidate).collect()
}

/// The best of each structure that explains anything; the best first.
fn one_of_each_structure(all: Vec<Tried>) -> Vec<Tried> {
    let mut seen: Vec<Vec<(Covariate, Form)>> = Vec::new();
    let mut is_new = |one: &Tried| {
        let structure: Vec<_> = one.factors.iter().map(|it| (it.of, it.form)).collect();
        let is_new = one.gain > 0.0 && !seen.contains(&structure);
        if is_new {
            seen.push(structure);
        }
        is_new
    };
    all.into_iter().filter(|one| is_new(one)).collect()
}

/// The same structure with the numbers near by that explain most.
fn refined(scan: &Scan, known: &[Known], mut best: Tried) -> Tried {
    for step in REFINING_STEPS {
        for factor in 0..best.factors.len() {
            for number in 0..best.factors[factor].form.numbers().len() {
                let Some(range) = known.iter().find(|it| it.of == best.factors[factor].of) else {
                    continue;
                };
                for way in [-step, step] {
                    let mut factors = best.factors.clone();
                    let Factor { form, numbers, .. } = &mut factors[factor];
                    let is_exponent = *form == Form::Power && number == 1;
                    let unit = if is_exponent { 5.0 } else { range.high - range.low };
                    numbers[number] += way * unit;
                    if form.refusal(*numbers).is_none() {
                        let other = tried(scan, known, factors);
                        if other.gain > best.gain {
                            best = other;
                        }
                    }
                }
            }
        }
    }
    best
}

fn sort(tried: &mut [Tried]) {
    tried.sort_by(|one, other| other.gain.total_cmp(&one.gain));
}

/// What a force of a shape explains.
fn tried(scan: &Scan, known: &[Known], factors: Vec<Factor>) -> Tried {
    let shape_of = Extra { n_per_kn: 1.0, factors: factors.clone() };
    let mut sum = Tuple::zero(scan.fit.theta.len());
    for (index, run) in scan.problem.runs.iter().enumerate() {
        let at_bin = |bin: usize| {
            let of = |of: Covariate| known.iter().find(|it| it.of == of)?.values[index][bin];
            let sample = &run.samples()[run.bins[bin].middle()];
            -scan.per_unit_resistance_mps2(sample) * shape_of.at(of).0
        };
        let shape: Vec<f64> = (0..run.bins.len()).map(at_bin).collect();
        sum.add(&scan.shape_tuple(index, &shape));
    }
    let (gain, n_per_kn) = scan.gain(&sum);
    Tried { gain, n_per_kn, factors }
}
