//! The pipeline that answers each of a controller's questions, for each train.

use dynocar_core::pipeline::output::candidates;
use dynocar_dataset::error::unknown;
use dynocar_shared::{Quantity, TrainId};

use super::refusals::{Checker, ConfigError};
use super::{PipelineConfig, RawQuantities};

/// The pipelines that answer a train's controller, each by its number in the configuration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Answers {
    pipeline_indices: [Option<usize>; Quantity::ALL.len()],
}

impl Answers {
    /// Determines who answers for a train: the pipeline named for the train, else the one named for all trains, else
    /// the best measured one that serves the train.
    ///
    /// # Errors
    ///
    /// When a quantity or pipeline is not known, or when the pipeline does not give the quantity
    /// or does not serve the train.
    pub(super) fn settle(
        checker: &Checker,
        train: TrainId,
        for_train: &RawQuantities,
        for_all: &RawQuantities,
        pipelines: &[PipelineConfig],
    ) -> Result<Self, ConfigError> {
        let tables = [(for_train, "trains.quantities"), (for_all, "quantities")];
        for (named, table) in tables {
            let is_unknown = |name: &&String| Quantity::from_name(name).is_none();
            if let Some(name) = named.keys().find(is_unknown) {
                let names = Quantity::ALL.iter().map(|it| it.name());
                let message = unknown("quantity", name, &format!(" in [{table}]"), names);
                let place = checker.place(&format!("{table}.{name}"), "");
                return Err(ConfigError::Malformed { place, message });
            }
        }
        let mut answers = Answers::default();
        for &quantity in Quantity::ALL {
            let can_answer =
                |it: &PipelineConfig| it.trains.contains(&train) && it.estimator.answers(quantity);
            let named = tables.iter().find_map(|(named, table)| {
                Some((named.get(quantity.name())?, format!("{table}.{quantity}")))
            });
            let pipeline_index = &mut answers.pipeline_indices[quantity as usize];
            if let Some((name, key)) = named {
                let is_named = |it: &PipelineConfig| it.name == *name && can_answer(it);
                *pipeline_index = pipelines.iter().position(is_named);
                if pipeline_index.is_none() {
                    return checker.refuse(key, name, allowed(quantity, train, pipelines));
                }
            } else {
                let of_kind = |kind| {
                    pipelines.iter().position(|it| it.estimator.kind() == kind && can_answer(it))
                };
                *pipeline_index = candidates(quantity).iter().copied().find_map(of_kind);
            }
        }
        Ok(answers)
    }

    /// Returns the number of the pipeline that answers a quantity.
    pub const fn pipeline_index(&self, quantity: Quantity) -> Option<usize> {
        self.pipeline_indices[quantity as usize]
    }

    /// One bit for each quantity that a pipeline answers.
    pub fn bits_of(&self, pipeline: usize) -> u32 {
        self.bits(|pipeline_index| pipeline_index == pipeline)
    }

    /// One bit for each quantity that any pipeline answers.
    pub fn all_bits(&self) -> u32 {
        self.bits(|_| true)
    }

    fn bits(&self, is_wanted: impl Fn(usize) -> bool) -> u32 {
        let is_set = |it: &&Quantity| self.pipeline_index(**it).is_some_and(&is_wanted);
        Quantity::ALL.iter().filter(is_set).fold(0, |bits, it| bits | it.bit())
    }
}

/// Returns the pipelines that may stand in place of one that cannot answer.
fn allowed(quantity: Quantity, train: TrainId, pipelines: &[PipelineConfig]) -> String {
    let can_answer =
        |it: &&PipelineConfig| it.trains.contains(&train) && it.estimator.answers(quantity);
    let names: Vec<_> = pipelines.iter().filter(can_answer).map(|it| it.name.as_str()).collect();
    let kinds: Vec<_> = candidates(quantity).iter().map(|it| it.name()).collect();
    let asked = format!("the name of a [[pipelines]] table that serves train {train}");
    match names.as_slice() {
        [] => format!("{asked}, of kind {}; there is none", kinds.join(", ")),
        names => format!("{asked} and gives {quantity}: {}", names.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::super::DaemonConfig;
    use super::*;

    const TRAIN: &str = "[train]\nname = \"t\"\nmass_t = 200.0\nlength_m = 100.0\ncars = 4\n\
                         rotating_mass_factor = 0.06\n[resistance]\na = 1.0\nb = 0.01\nc = 0.001\n";
    const PIPELINES: &str = "[[pipelines]]\nkind = \"v_mils\"\n[[pipelines]]\nkind = \"rls\"\n\
                             [[pipelines]]\nkind = \"trajectory_kalman\"\ntrains = [1]\n\
                             [[pipelines]]\nkind = \"mass_kalman\"\nname = \"mass\"\n";

    fn load(for_all: &str, for_second: &str) -> Result<DaemonConfig, ConfigError> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("train.toml"), TRAIN).unwrap();
        let text = format!(
            "[quantities]\n{for_all}\n[[trains]]\nid = 1\nfile = \"train.toml\"\n\
             [[trains]]\nid = 2\nfile = \"train.toml\"\n{for_second}\n{PIPELINES}"
        );
        DaemonConfig::from_text(&folder.path().join("daemon.toml"), &text)
    }

    fn pipeline_indices(config: &DaemonConfig, quantity: Quantity) -> [Option<usize>; 2] {
        [0, 1].map(|train| config.trains[train].answers.pipeline_index(quantity))
    }

    #[test]
    fn the_best_measured_pipeline_that_serves_a_train_answers_by_default() {
        let config = load("", "").unwrap();
        assert_eq!(pipeline_indices(&config, Quantity::Resistance), [Some(2), Some(0)]);
        assert_eq!(pipeline_indices(&config, Quantity::Mass), [Some(3); 2]);
        assert_eq!(pipeline_indices(&config, Quantity::Adhesion), [None; 2]);
        let first = config.trains[0].answers;
        assert_eq!(first.all_bits(), Quantity::Resistance.bit() | Quantity::Mass.bit());
        assert_eq!([2, 3].map(|it| first.bits_of(it)), [0b01, 0b10]);
    }

    #[test]
    fn the_configuration_may_name_another_for_all_trains_and_for_one() {
        let config =
            load("resistance = \"rls\"", "quantities = { resistance = \"v_mils\" }").unwrap();
        assert_eq!(pipeline_indices(&config, Quantity::Resistance), [Some(1), Some(0)]);
    }

    #[test]
    fn a_provider_that_cannot_answer_is_refused_with_those_that_can() {
        let cases = [
            (
                "resistance = \"resistance_kalman\"",
                "quantities.resistance = resistance_kalman: expected the name of a [[pipelines]] \
                 table that serves train 1 and gives resistance: v_mils, rls, trajectory_kalman",
            ),
            (
                "adhesn = \"rls\"",
                "unknown quantity 'adhesn' in [quantities]; did you mean 'adhesion'? (choices: \
                 'resistance', 'mass', ",
            ),
            ("mass = \"rls\"", "quantities.mass = rls: expected the name of a [[pipelines]] table"),
            (
                "adhesion = \"adhesion_law\"",
                "serves train 1, of kind adhesion_law, adhesion_smoother, adhesion_ekf, \
                 adhesion_em; there is none",
            ),
            ("resistance = \"trajectory_kalman\"", "table that serves train 2 and gives"),
            (
                "speed = \"rls\"",
                "unknown quantity 'speed' in [quantities] (choices: 'resistance', 'mass', 'adhesion'",
            ),
        ];
        for (for_all, expected) in cases {
            let message = load(for_all, "").unwrap_err().to_string();
            assert!(message.contains(expected), "expected {expected:?} in {message}");
        }
    }
}
