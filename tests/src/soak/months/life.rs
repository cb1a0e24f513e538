//! The days of a train: trips, trials, learning.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use dynocar::config::{DaemonConfig, TrainConfig, build_pipeline};
use dynocar::models::{ModelHash, ModelText, NewModel, Origin, Store, TrainModels, UtcSecond};
use dynocar::runtime::exchange::Exchange;
use dynocar::shadow::in_force::with_model;
use dynocar::shadow::{ShadowTrain, record};
use dynocar_core::pipeline::Pipeline;
use dynocar_shared::{TrainId, TrainSample};
use dynocar_workshop::learn::{Bounds, Learner, LearnerSettings};

use super::story::{LifeSettings, Story};
use super::table::{Adoption, LifeOutcome};
use crate::simulator::dataset_writer::write_dataset;
use crate::simulator::run_maker::RunPlan;
use crate::simulator::{
    EffectRequest, SimulatedDataset, SimulatedWorld, SimulatorSettings, TrainType,
};

/// The train of every life.
const TRAIN: TrainId = TrainId(1);
/// The first day, 2027-01-01, in s since 1970.
const FIRST_DAY_S: u64 = 1_798_761_600;
const DAY_S: u64 = 86_400;
/// Time at which the first models of a life are made.
const MADE: UtcSecond = UtcSecond { unix_s: FIRST_DAY_S };
/// The learner looks at least so often, in days.
const LEARNS_EVERY: usize = 7;
/// Days after an adoption over which both models' errors show whether it was right.
const JUDGED_DAYS: i64 = 5;

/// One train with its world, its store and its learner.
pub struct Life<'f> {
    settings: LifeSettings,
    folder: &'f Path,
    world: SimulatedWorld,
    train: TrainConfig,
    config: DaemonConfig,
    models: TrainModels,
    shadow: ShadowTrain,
    learner: Learner,
    monitor: Pipeline,
    sequence: u64,
    outcome: LifeOutcome,
}

impl<'f> Life<'f> {
    /// Returns a life whose files lie in an empty folder.
    ///
    /// # Panics
    ///
    /// When a file cannot be written or is refused.
    pub fn begin(settings: LifeSettings, folder: &'f Path) -> Self {
        let request = EffectRequest::Kinds(settings.story.kind().into_iter().collect());
        let simulated = SimulatorSettings {
            runs: settings.days * settings.trips,
            holdout_runs: 0,
            duration_s: 600.0,
            train_type: settings.story.kind().is_none().then_some(TrainType::Regional),
            ..SimulatorSettings::new(settings.seed, request)
        };
        let world = SimulatedWorld::from_settings(&simulated);
        write_declared(&world, folder);
        std::fs::create_dir_all(folder.join("models")).expect("a store");
        std::fs::create_dir_all(folder.join("runs")).expect("a folder of runs");
        let text = format!(
            "[models]\ndirectory = \"models\"\nadopt = \"when_better\"\n\
             trips_between_mistakes = {:e}\n\
             [[trains]]\nid = 1\nfile = \"train.toml\"\ntrack = \"track.toml\"\n\
             [[pipelines]]\nkind = \"residual_monitor\"\n",
            settings.trips_between_mistakes
        );
        let config = DaemonConfig::from_text(&folder.join("daemon.toml"), &text)
            .unwrap_or_else(|error| panic!("{error}"));
        let train = config.trains[0].clone();
        let store = Store::at(&folder.join("models"));
        let models = store.train(TRAIN);
        let declared = models.put_declared(&train.text, MADE).expect("the declared model is put");
        if settings.story == Story::Nothing {
            put_others(&models, &train, declared);
        }
        let of_models = config.models.clone().expect("[models]");
        let exchange = Arc::new(Exchange::new(0));
        let shadow =
            ShadowTrain::new(train.clone(), Vec::new(), models.clone(), of_models, exchange);
        let learner = Learner::open(LearnerSettings {
            store,
            runs: folder.join("runs"),
            trains: vec![(TRAIN, train.text.clone())],
            bounds: Bounds { runs: 16, ..Bounds::default() },
            command: "dynocar-soak months".into(),
        })
        .expect("a learner");
        let monitor = build_pipeline(&config.pipelines[0], 0, &train).expect("a monitor");
        let outcome = LifeOutcome::from_settings(settings);
        let sequence = 0;
        Life {
            settings,
            folder,
            world,
            train,
            config,
            models,
            shadow,
            learner,
            monitor,
            sequence,
            outcome,
        }
    }

    /// Lives all days.
    pub fn live(mut self) -> LifeOutcome {
        for day in 0..self.settings.days {
            self.live_day(day);
        }
        self.judge_adoptions();
        let events = self.models.events().expect("the events");
        self.outcome.events = events.into_iter().map(|(_, event)| event.kind).collect();
        self.outcome
    }

    fn live_day(&mut self, day: usize) {
        let effects = self.settings.story.effects(&self.world, self.settings.span, day);
        let mut kept = Vec::new();
        let mut is_suspected = false;
        for trip in 0..self.settings.trips {
            let plan: RunPlan = self.world.plans[day * self.settings.trips + trip].clone();
            let run = self.world.run(plan, &effects);
            let at_s = FIRST_DAY_S + DAY_S * day as u64 + 3600 * (trip as u64 + 1) / 2;
            for sample in &run.samples {
                self.sequence += 1;
                let run = run.plan.number as u32;
                let sample =
                    TrainSample { sequence: self.sequence, run, train_id: TRAIN.0, ..*sample };
                self.shadow.take(&sample, at_s as f64);
                is_suspected |= self.monitor.process(&sample).suspected_effect != 0;
            }
            self.look(at_s);
            if trip < self.settings.recorded {
                kept.push(run);
            }
        }
        let night = UNIX_EPOCH + Duration::from_secs(FIRST_DAY_S + DAY_S * day as u64 + 80_000);
        self.keep(night, kept);
        if is_suspected || day % LEARNS_EVERY == LEARNS_EVERY - 1 {
            self.learner.round(night, &|| false).expect("a round of learning");
            self.outcome.rounds += 1;
        }
        self.shadow.write(night);
        self.outcome.errors_mps.push(self.error_of(self.shadow.in_force(), day, 1));
    }

    /// Looks as the daemon's thread does while the train stands.
    fn look(&mut self, at_s: u64) {
        let before = self.shadow.in_force();
        self.shadow.note_silence();
        self.shadow.look(UNIX_EPOCH + Duration::from_secs(at_s));
        // Begun, then completed.
        self.shadow.go_on();
        self.shadow.go_on();
        let after = self.shadow.in_force();
        if after != before {
            let day = ((at_s - FIRST_DAY_S) / DAY_S) as usize;
            let (_, decision) = self.models.decisions().expect("decisions").pop().expect("one");
            let adds = self.models.stored(after).expect("the model").origin.adds();
            let is_rollback = decision.action == dynocar::models::Action::RolledBack;
            let adoption = Adoption { day, before, after, is_rollback, adds, is_right: None };
            self.outcome.adoptions.push(adoption);
            let train = with_model(&self.models, &self.train, after).expect("the model");
            self.monitor = build_pipeline(&self.config.pipelines[0], 0, &train).expect("a monitor");
            self.monitor.count_from(self.sequence);
        }
    }

    /// Writes the recorded runs of a day.
    fn keep(&self, night: SystemTime, runs: Vec<crate::simulator::SimulatedRun>) {
        if runs.is_empty() {
            return;
        }
        let folder = self.folder.join("runs").join(UtcSecond::from_time(night).day());
        write_dataset(&dataset_of(&self.world, runs), &folder).expect("a day's runs");
    }

    /// Returns the root mean square in m/s of a model's errors over some days.
    fn error_of(&self, model: ModelHash, from_day: usize, days: i64) -> Option<f64> {
        let record = record::TrialRecord::read(self.models.folder());
        let from = (FIRST_DAY_S / DAY_S) as i64 + from_day as i64;
        let (mut squares, mut samples) = (0.0, 0);
        for (_, sum) in record.of(model)?.ledger.days.range(from..from + days) {
            squares += sum.squares;
            samples += sum.samples;
        }
        (samples > 0).then(|| (squares / samples as f64).sqrt())
    }

    fn judge_adoptions(&mut self) {
        let mut adoptions = std::mem::take(&mut self.outcome.adoptions);
        for adoption in &mut adoptions {
            // The day of the change belongs to both.
            let error = |model| self.error_of(model, adoption.day, JUDGED_DAYS);
            adoption.is_right =
                error(adoption.before).zip(error(adoption.after)).map(|(old, new)| new < old);
        }
        self.outcome.adoptions = adoptions;
    }
}

/// Puts two models on trial that nothing speaks for: resistances 2 % to either side.
fn put_others(models: &TrainModels, train: &TrainConfig, declared: ModelHash) {
    for factor in [0.98, 1.02] {
        let mut table: toml::Table = train.text.train.parse().expect("the declared train");
        let resistance = table["resistance"].as_table_mut().expect("[resistance]");
        let a = factor * resistance["a"].as_float().expect("a number");
        resistance.insert("a".into(), toml::Value::Float(a));
        let text = ModelText { train: table.to_string(), track: train.text.track.clone() };
        let origin = Origin::written("Of a measurement.", Some(declared), MADE);
        let new = NewModel { text, origin, answer_json: None, report_html: None };
        models.put(&new).expect("a model is put");
    }
}

/// Returns a dataset of some runs; nothing in it reveals the truth.
fn dataset_of(
    world: &SimulatedWorld,
    runs: Vec<crate::simulator::SimulatedRun>,
) -> SimulatedDataset {
    SimulatedDataset {
        settings: world.settings.clone(),
        train: world.train.clone(),
        line: world.line.clone(),
        effects: Vec::new(),
        sensors: world.sensors,
        runs,
    }
}

/// Writes the declared files of a world, as the configuration names them.
fn write_declared(world: &SimulatedWorld, folder: &Path) {
    let files = crate::simulator::dataset_writer::dataset_files(&dataset_of(world, Vec::new()));
    for (path, text) in files {
        if path.ends_with("train.toml") || path.ends_with("track.toml") {
            std::fs::write(folder.join(path), text).expect("a declared file");
        }
    }
    let declared = folder.join("train.toml");
    let track = folder.join("track.toml");
    ModelText::read(&declared, Some(&track)).expect("the declared files");
}
