//! Interface of an effect to everything that fits, simulates or reports it.

use std::collections::BTreeMap;
use std::sync::Arc;

use dynocar_model::terms::delay::DelayLine;
use dynocar_model::terms::speed_delay::LateSpeed;
use dynocar_model::terms::{Key, ModelEntry, Parameter};
use dynocar_shared::vocabulary::EffectKind;
use nalgebra::DMatrix;

use super::answer::{Location, ParameterValue};
use super::evidence::{RunData, SampleForces};
use super::places::{IntervalEnd, Site};

/// An effect with its structure (places, windows, runs) fixed, shared by models.
pub type SharedHypothesis = Arc<dyn Hypothesis>;

/// Estimates as the answer publishes them: values and standard deviations by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReportedValues {
    /// Values.
    pub values: BTreeMap<String, ParameterValue>,
    /// Standard deviations.
    pub deviations: BTreeMap<String, ParameterValue>,
}

impl ReportedValues {
    /// Adds a number with its standard deviation.
    pub fn push(&mut self, name: &str, value: f64, deviation: f64) {
        self.values.insert(name.into(), ParameterValue::Number(value));
        self.deviations.insert(name.into(), ParameterValue::Number(deviation));
    }
}

/// A parameter at a bound of the quantity looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtBound {
    /// Its name in the answer.
    pub name: &'static str,
    /// The bound.
    pub bound: f64,
}

/// Context that a report may need in addition to the parameters of the effect itself.
pub struct ReportContext<'a> {
    /// Parameters of the effect.
    pub parameters: &'a [f64],
    /// Their standard deviations.
    pub deviations: &'a [f64],
    /// Fitted c of the Davis formula.
    pub c: f64,
    /// Its standard deviation.
    pub c_deviation: f64,
    /// Covariance of a, b, c and the parameters of all effects, by likelihood and scatter.
    pub covariance: &'a DMatrix<f64>,
    /// Number of the effect's first parameter among them.
    pub first: usize,
    /// Mean weight of the fit runs in kN.
    pub weight_kn: f64,
    /// By how much a standard deviation that comes from the scatter between runs is enlarged.
    pub few_runs_factor: f64,
}

impl ReportContext<'_> {
    /// Returns the covariance of c with the effect's first parameter.
    pub fn c_covariance(&self) -> f64 {
        self.covariance[(2, self.first)]
    }

    /// Returns each of the effect's parameters.
    pub fn each_of(&self, parameters: &[Parameter]) -> ReportedValues {
        let mut reported = ReportedValues::default();
        for (i, parameter) in parameters.iter().enumerate() {
            reported.push(parameter.name, self.parameters[i], self.deviations[i]);
        }
        reported
    }

    /// Returns the standard deviation of the sum of the effect's parameters, which may be far less than that of each.
    pub fn deviation_of_sum(&self) -> f64 {
        let count = self.deviations.len();
        let own = self.covariance.view((self.first, self.first), (count, count));
        let added: f64 = self.deviations.iter().map(|std| std * std).sum::<f64>() - own.trace();
        (own.sum() + added.max(0.0)).max(0.0).sqrt()
    }
}

/// Influence of an effect on others that only add a resistance or a gradient.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum OnOthers {
    /// Nothing.
    Nothing,
    /// It scales the resistances and gradients that they add, all by one factor.
    Scales,
    /// It changes them in another way, or takes their place.
    Changes,
}

/// When an effect acts among others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Turn {
    /// Before the others, for example a delay of the reported forces.
    First,
    /// In the order in which they were found.
    Usual,
    /// After the others, for example a delay of the measured speed, which changes how the forces of all others appear.
    Last,
}

/// Memory of the samples before, for an effect that looks back.
#[derive(Clone, Debug, Default)]
pub struct Past {
    forces: Option<DelayLine<2>>,
    speed: Option<Box<LateSpeed>>,
}

impl Past {
    /// Traction and brake force in N behind a dead time and a lag in s; of nothing before sample number 0.
    pub fn forces(&mut self, delay_and_lag_s: [f64; 2], first: usize) -> &mut DelayLine<2> {
        let [delay_s, lag_s] = delay_and_lag_s;
        let line = self.forces.get_or_insert_with(|| DelayLine::new(delay_s, lag_s));
        if first == 0 {
            line.restart(delay_s, lag_s);
        }
        line
    }

    /// Returns the memory of the forces that acted when the measured speed was true.
    pub fn speed(&mut self, delay_and_lag_s: [f64; 2], first: usize) -> &mut LateSpeed {
        let [delay_s, lag_s] = delay_and_lag_s;
        let late = self.speed.get_or_insert_with(|| LateSpeed::new(delay_s, lag_s).into());
        if first == 0 {
            late.restart(delay_s, lag_s);
        }
        late
    }
}

/// Some consecutive samples of a run, with the memory that an effect has of the samples before them.
pub struct On<'a> {
    /// The run.
    pub run: &'a RunData,
    /// Index of the first of these samples in the run.
    pub first: usize,
    /// Memory of an effect that looks back; any value where the first sample is the run's own.
    pub past: &'a mut Past,
}

/// How an effect is handled in a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Handling {
    /// Together with the others.
    Together,
    /// As a resistance of its own: it adds one in proportion to how far its first parameter is from none, and
    /// nothing else.
    Added,
    /// As gradients: each of its parameters adds one in proportion to it, and nothing else.
    Gradient,
}

/// Properties of a structure that do not depend on the values of its parameters.
#[derive(Clone, Copy)]
pub struct Nature<'h> {
    /// The kind it belongs to.
    pub kind: EffectKind,
    /// Its parameters, in order.
    pub parameters: &'h [Parameter],
    /// Key of each parameter in the file of a train, where it is a number there.
    pub keys: &'static [&'static Key],
    /// The value of each parameter at which there is no effect.
    pub none: f64,
    /// The [size](Hypothesis::size) up to which declared figures are usually no better.
    pub least: Option<f64>,
    /// Information about its parameters before the data, around no effect; `None` for a flat prior.
    pub prior: Option<&'h DMatrix<f64>>,
    /// Twice the logarithm of the number of structures it was chosen from.
    pub choice_cost: f64,
    /// Standard deviation of the first parameter by errors that all runs share, which no number
    /// of runs averages out.
    pub shared_error: f64,
    /// When it acts among others.
    pub turn: Turn,
    /// Influence on other effects that only add a resistance or a gradient.
    pub on_others: OnOthers,
    /// How it is handled where no other effect hinders that.
    pub handling: Handling,
    /// A function of each parameter in which the declared forces with this effect are affine, each by
    /// itself; `None` where there is none.
    pub affine_in: Option<fn(f64) -> f64>,
    /// True where a resistance that the effect adds depends on the speed.
    pub feels_speed: bool,
    /// True when its first parameter is the speed scale.
    pub changes_speed_scale: bool,
    /// True when the force of the effect at a sample depends on earlier samples.
    pub looks_back: bool,
    /// True when the effect depends on one number per run, such as the outside temperature: then a run is one
    /// observation of it, however long.
    pub is_one_number_a_run: bool,
    /// Whether it could act in the place of another effect.
    pub may_stand_for_others: bool,
}

impl<'h> Nature<'h> {
    /// Of a kind with these parameters, none of which does anything unusual.
    pub const fn new(kind: EffectKind, parameters: &'h [Parameter]) -> Self {
        Nature {
            kind,
            parameters,
            keys: &[],
            none: 0.0,
            least: None,
            prior: None,
            choice_cost: 0.0,
            shared_error: 0.0,
            turn: Turn::Usual,
            on_others: OnOthers::Nothing,
            handling: Handling::Together,
            affine_in: None,
            feels_speed: false,
            changes_speed_scale: false,
            looks_back: false,
            is_one_number_a_run: false,
            may_stand_for_others: true,
        }
    }
}

/// A structure that a kind proposes: everything but the values of its parameters.
pub trait Hypothesis: Send + Sync + std::fmt::Debug {
    /// Returns the properties of the structure, which do not depend on the values of its parameters.
    fn nature(&self) -> Nature<'_>;

    /// Returns the kind it belongs to.
    fn kind(&self) -> EffectKind {
        self.nature().kind
    }

    /// Returns its parameters, in order.
    fn parameters(&self) -> &[Parameter] {
        self.nature().parameters
    }

    /// Returns the value of each parameter at which there is no effect.
    fn none(&self) -> f64 {
        self.nature().none
    }

    /// Returns whether each parameter adds a gradient in proportion to it, and nothing else.
    fn is_gradient(&self) -> bool {
        self.nature().handling == Handling::Gradient
    }

    /// Changes the forces at some samples of a run, block by block from the first of all where it
    /// [looks back](Nature::looks_back).
    fn apply(&self, parameters: &[f64], on: On, forces: &mut [SampleForces]);

    /// False when a parameter changes nothing on a fit run.
    fn touches(&self, _parameter: usize, _run: &RunData) -> bool {
        true
    }

    /// The gradient in ‰ along the travel that a unit of a parameter adds at each sample of a run.
    fn gradient_permille(&self, _parameter: usize, run: &RunData, permille: &mut Vec<f64>) {
        permille.clear();
        permille.resize(run.samples().len(), 0.0);
    }

    /// Returns the factor on the resistances and gradients of other effects, where it [scales](OnOthers::Scales) them.
    fn scale_of_others(&self, _parameters: &[f64]) -> f64 {
        1.0
    }

    /// That resistance in N/kN at each sample of a run, for a first parameter of 1 above none and given others.
    fn unit_n_per_kn(&self, _others: &[f64], run: &RunData, n_per_kn: &mut Vec<f64>) {
        n_per_kn.clear();
        n_per_kn.resize(run.samples().len(), 0.0);
    }

    /// By how much a unit of each other parameter changes that resistance, at each sample: by differences over
    /// steps.
    fn unit_slopes(&self, others: &[f64], steps: &[f64], run: &RunData, slopes: &mut [Vec<f64>]) {
        let (mut base, mut others) = (Vec::new(), others.to_vec());
        self.unit_n_per_kn(&others, run, &mut base);
        for ((k, slope), step) in slopes.iter_mut().enumerate().zip(steps) {
            let at = others[k];
            others[k] += step;
            self.unit_n_per_kn(&others, run, slope);
            others[k] = at;
            slope.iter_mut().zip(&base).for_each(|(moved, base)| *moved = (*moved - base) / step);
        }
    }

    /// Returns the measured over true speed.
    fn speed_scale(&self, _parameters: &[f64]) -> f64 {
        1.0
    }

    /// Returns by how many s the measured speed is late, the sum of its parameters; `None` for an effect that does not
    /// delay the speed.
    fn speed_late_s(&self, _parameters: &[f64]) -> Option<f64> {
        None
    }

    /// Returns the site at which it was found; `None` for an effect without a site.
    fn site(&self) -> Option<&Site> {
        None
    }

    /// Returns the same structure at another site.
    fn at_site(&self, _site: Site) -> Option<SharedHypothesis> {
        None
    }

    /// Returns where it acts.
    fn place(&self) -> Location {
        self.site().map_or_else(Location::default, Site::place)
    }

    /// Returns the ends of its places that were estimated from the speeds.
    fn ends(&self) -> Vec<IntervalEnd> {
        self.site().map_or_else(Vec::new, Site::ends)
    }

    /// Returns the same structure with one of its ends elsewhere; `None` where that makes no place.
    fn with_end(&self, end: &IntervalEnd, at: f64) -> Option<SharedHypothesis> {
        self.at_site(self.site()?.moved(end, at)?)
    }

    /// Returns the kinds that none of the runs at hand could distinguish from it.
    fn twins(&self, _parameters: &[f64]) -> &'static [EffectKind] {
        &[]
    }

    /// Returns whether it acts in certain runs only: an event, and no property of train or line.
    fn is_event(&self) -> bool {
        let place = self.place();
        place.windows.is_some() || place.runs.is_some()
    }

    /// Returns the standard deviation of each parameter by the unknown course between samples `_step_s` seconds
    /// apart; two parameters err by it in opposite ways.
    fn sampling_error(&self, _step_s: f64) -> f64 {
        0.0
    }

    /// Returns whether the effect is larger than the usual errors of declared figures.
    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        self.nature().least.is_none_or(|least| self.size(parameters).abs() > least)
    }

    /// Returns why the kind cannot have parameters like these, however strong their evidence.
    fn contradiction(&self, _parameters: &[f64]) -> Option<&'static str> {
        None
    }

    /// Returns the first parameter that lies at a bound of its range, unless that bound is the value of no effect: such
    /// data demand another effect, or do not determine this one.
    fn at_bound(&self, parameters: &[f64]) -> Option<AtBound> {
        let mut specs = self.parameters().iter().zip(parameters);
        specs.find_map(|(spec, &value)| {
            let near = |bound: &f64| (value - bound).abs() < spec.step && *bound != self.none();
            let bound = [spec.lower, spec.upper].into_iter().find(near)?;
            Some(AtBound { name: spec.name, bound })
        })
    }

    /// Returns how far it is from no effect, in the unit of its first parameter.
    fn size(&self, parameters: &[f64]) -> f64 {
        parameters[0] - self.none()
    }

    /// Returns the entries of the effect in the files of a train and a line; `None` where these cannot hold it.
    fn entries(&self, parameters: &[f64]) -> Option<Vec<ModelEntry>> {
        let each = self.nature().keys.iter().zip(parameters);
        let numbers: Vec<ModelEntry> =
            each.map(|(key, value)| ModelEntry::Number(key, *value)).collect();
        (!numbers.is_empty()).then_some(numbers)
    }

    /// Returns the law as a formula, for an effect that has no name.
    fn formula(&self, _parameters: &[f64]) -> Option<String> {
        None
    }

    /// Parameters by the names of the answer.
    fn report(&self, context: &ReportContext) -> ReportedValues {
        context.each_of(self.parameters())
    }
}
