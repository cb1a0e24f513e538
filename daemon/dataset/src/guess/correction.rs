//! Units that the values alone did not reveal, set right by how the train moves.

use dynocar_core::plausibility::InputFault;

use super::guessed::Guess;
use crate::fault_unit::concerned;
use crate::{GradientSource, Run};

impl Guess {
    /// Changes the unit of one quantity whose unit no name gives, where the runs, read as guessed,
    /// cannot be true and another unit would explain it; `None` when nothing is to be changed.
    ///
    /// Where the train's mass is no more than a default or the gradient is unknown, forces are
    /// measured against nothing (a brake that holds a train on a descent slows nothing down): they
    /// and recorded masses stay as they are.
    pub fn correct<'r>(
        &mut self,
        runs: impl IntoIterator<Item = &'r Run>,
        is_mass_known: bool,
    ) -> Option<String> {
        let of_run = |run: &'r Run| run.diagnostics.iter().map(move |diagnostic| (run, diagnostic));
        for (run, diagnostic) in runs.into_iter().flat_map(of_run) {
            let Some((detected, read_as)) = diagnostic.fault else { continue };
            let is_measured = is_mass_known && run.gradient_source != GradientSource::Unknown;
            if needs_balance(detected.fault) && !is_measured {
                continue;
            }
            let Some(unit) = detected.true_unit(&read_as) else { continue };
            let (quantities, _) = concerned(detected.fault);
            let is_open = |quantity| {
                self.column(quantity).is_some_and(|it| it.is_unit_open && it.unit == read_as)
            };
            if !quantities.iter().any(|&quantity| is_open(quantity)) {
                continue;
            }
            let words = detected.words(&read_as);
            for column in &mut self.columns {
                if quantities.contains(&column.quantity) && column.is_unit_open {
                    column.unit = unit;
                    column.doubts = vec![format!(
                        "the name gives no unit; {}, since in {} {words}",
                        unit.name(),
                        read_as.name()
                    )];
                }
            }
            return Some(words);
        }
        None
    }
}

/// True for what the balance of forces shows.
fn needs_balance(fault: InputFault) -> bool {
    matches!(
        fault,
        InputFault::MassScale
            | InputFault::ForcesScale
            | InputFault::TractionScale
            | InputFault::BrakeScale
    )
}
