//! The structure of a mass change: parts, each with a mass factor of its own.

use std::sync::Arc;

use dynocar_model::terms::{ModelEntry, Parameter, masses};
use dynocar_shared::vocabulary::EffectKind;
use nalgebra::DMatrix;

use super::parts::{Along, FactorPart};
use crate::explain::answer::{FoundMassSection, Location, MassWindow, ParameterValue, RunWindow};
use crate::explain::effects::{
    Hypothesis, Nature, On, ReportContext, ReportedValues, SharedHypothesis,
};
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::places::{Axis, IntervalEnd, Reach};

/// Parts in which another mass holds.
#[derive(Clone, Debug)]
pub struct Masses {
    parts: Vec<FactorPart>,
    /// For every part, the values where its ends could be; empty where no end was chosen.
    edges: Vec<Vec<f64>>,
    parameters: Vec<Parameter>,
    /// Prior information on the factors; `None` where the parts were chosen one by one.
    information: Option<DMatrix<f64>>,
    choice_cost: f64,
}

impl Masses {
    /// Returns one part with the values where its ends could be, and twice the logarithm of the number of its
    /// alternatives.
    pub fn new(part: FactorPart, edges: Vec<f64>, choice_cost: f64) -> Self {
        let mut masses = Masses {
            parts: Vec::new(),
            edges: Vec::new(),
            parameters: Vec::new(),
            information: None,
            choice_cost: 0.0,
        };
        masses.push(part, edges, choice_cost);
        masses
    }

    /// All of some parts, none of them chosen: loads differ from each other as loads do.
    pub fn of_all(parts: Vec<FactorPart>) -> Self {
        let count = parts.len();
        let each = masses::SUSPECT.prior_std.powi(-2);
        Masses {
            edges: vec![Vec::new(); count],
            parameters: vec![masses::PARAMETER; count],
            information: Some(DMatrix::from_diagonal_element(count, count, each)),
            choice_cost: 0.0,
            parts,
        }
    }

    /// Adds a part with a factor of its own.
    pub fn push(&mut self, part: FactorPart, edges: Vec<f64>, choice_cost: f64) {
        self.parts.push(part);
        self.edges.push(edges);
        self.parameters.push(masses::PARAMETER);
        self.choice_cost += choice_cost;
    }

    /// Where another mass holds, in the order of the factors.
    pub fn parts(&self) -> &[FactorPart] {
        &self.parts
    }
}

impl Hypothesis for Masses {
    fn nature(&self) -> Nature<'_> {
        Nature {
            none: 1.0,
            prior: self.information.as_ref(),
            choice_cost: self.choice_cost,
            affine_in: Some(f64::recip),
            ..Nature::new(EffectKind::MassChange, &self.parameters)
        }
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        parameters.iter().any(|factor| (factor - 1.0).abs() > masses::LEAST_SHARE)
    }

    fn touches(&self, parameter: usize, run: &RunData) -> bool {
        self.parts[parameter].is_in(run)
    }

    fn apply(&self, parameters: &[f64], On { run, first, .. }: On, forces: &mut [SampleForces]) {
        let parts = self.parts.iter().zip(parameters);
        for (part, factor) in parts.filter(|(part, _)| part.is_in(run)) {
            for (i, force) in (first..).zip(&mut *forces) {
                if part.holds(run, i) {
                    force.mass_factor *= factor;
                }
            }
        }
    }

    fn entries(&self, parameters: &[f64]) -> Option<Vec<ModelEntry>> {
        let mut rows = Vec::new();
        for (part, &factor) in self.parts.iter().zip(parameters) {
            let FactorPart { ends: [from_m, to_m], along: Along::Line(_) } = *part else {
                return None;
            };
            let towards = part.directions().into_iter();
            rows.extend(towards.map(|towards| vec![from_m, to_m, towards, factor]));
        }
        Some(vec![ModelEntry::Rows(masses::LIST, rows)])
    }

    fn ends(&self) -> Vec<IntervalEnd> {
        let mut ends = Vec::new();
        for (part, (own, edges)) in self.parts.iter().zip(&self.edges).enumerate() {
            let (axis, run) = match &own.along {
                Along::Line(_) => (Axis::Chainage, None),
                Along::Run(file, _) => (Axis::Time, Some(file.clone())),
            };
            for (is_upper, at) in [false, true].into_iter().zip(own.ends) {
                if !edges.is_empty() {
                    let (reach, run) = (Reach::OneOf(edges.clone()), run.clone());
                    ends.push(IntervalEnd { axis, part, is_upper, at, reach, fine: 0.0, run });
                }
            }
        }
        ends
    }

    fn with_end(&self, end: &IntervalEnd, at: f64) -> Option<SharedHypothesis> {
        let mut moved = self.clone();
        moved.parts[end.part] = self.parts[end.part].with_end(end.is_upper, at)?;
        let others = self.parts.iter().enumerate().filter(|(k, _)| *k != end.part);
        let is_free = others.into_iter().all(|(_, other)| other.is_apart(&moved.parts[end.part]));
        is_free.then(|| Arc::new(moved) as SharedHypothesis)
    }

    fn place(&self) -> Location {
        let windows: Vec<RunWindow> = self.parts.iter().filter_map(FactorPart::window).collect();
        let on_line = self.parts.iter().filter(|part| matches!(part.along, Along::Line(_)));
        let intervals: Vec<[f64; 2]> = on_line.map(|part| part.ends).collect();
        Location {
            windows: (!windows.is_empty()).then_some(windows),
            intervals_m: (!intervals.is_empty()).then_some(intervals),
            ..Location::default()
        }
    }

    fn report(&self, context: &ReportContext) -> ReportedValues {
        let (mut sections, mut windows, mut deviations) = (Vec::new(), Vec::new(), Vec::new());
        for (k, part) in self.parts.iter().enumerate() {
            let (mass_factor, [from_m, to_m]) = (context.parameters[k], part.ends);
            for towards in part.directions() {
                let direction = towards as i8;
                sections.push(FoundMassSection { from_m, to_m, direction, mass_factor });
                deviations.push(context.deviations[k]);
            }
            if let Some(window) = part.window() {
                windows.push(MassWindow { window, mass_factor });
                deviations.push(context.deviations[k]);
            }
        }
        let mut reported = ReportedValues::default();
        let name = if windows.is_empty() {
            reported.values.insert("sections".into(), ParameterValue::Sections(sections));
            "sections"
        } else {
            reported.values.insert("windows".into(), ParameterValue::Windows(windows));
            "windows"
        };
        reported.deviations.insert(name.into(), ParameterValue::List(deviations));
        reported
    }
}
