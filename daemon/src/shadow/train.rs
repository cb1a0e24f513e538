//! One train's trials, and its change from one model to another.

use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;
use std::time::{Instant, SystemTime};

use dynocar_core::pipeline::Pipeline;
use dynocar_core::pipeline::motion::STANDING_MPS;
use dynocar_core::trial::evidence::RivalEvidence;
use dynocar_core::trial::{ModelTrials, OpenLoop, Rival};
use dynocar_shared::TrainSample;
use tracing::{info, warn};

use super::in_force::{self, with_model};
use super::record::{self, RivalEstimate, TrialFigures, TriedModel, ratio_in_words};
use super::rule::{Adopt, ModelStanding, Rule, standing};
use crate::config::{ModelsConfig, PipelineConfig, SettingRefused, TrainConfig, build_pipeline};
use crate::models::{ModelHash, ModelsError, NewDecision, TrainModels, UtcSecond};
use crate::runtime::exchange::{Exchange, Set};

/// A pipeline of the configuration, and which of the threads that serve the train runs it.
#[derive(Clone, Debug)]
pub struct PlacedPipeline {
    /// Kind, settings and name.
    pub settings: PipelineConfig,
    /// Its number in the configuration.
    pub index: u32,
    /// The thread's seat at the exchange.
    pub seat: usize,
}

/// A change that has begun.
struct Changing {
    to: ModelHash,
    since: Instant,
}

/// After so long without a thread that has seen the train stand, pipelines are taken back.
const PATIENCE_S: f64 = 0.5;

/// One train's models on trial.
pub struct ShadowTrain {
    /// The train with the model that was in force at the start.
    train: TrainConfig,
    /// By seat, then in the order in which the thread runs them.
    placed: Vec<PlacedPipeline>,
    models: TrainModels,
    settings: ModelsConfig,
    exchange: Arc<Exchange>,
    trials: ModelTrials,
    record: record::TrialRecord,
    standing: ModelStanding,
    changing: Option<Changing>,
    /// Messages already logged, so that each is logged once.
    reported: HashSet<String>,
    newest_speed_mps: f64,
    /// When the store was last changed, as far as it was looked at.
    seen: Option<Vec<SystemTime>>,
    /// Maintenance events by kind.
    events: BTreeMap<String, u64>,
}

impl ShadowTrain {
    /// Of a train with the model in force, by a store's decisions.
    pub fn new(
        train: TrainConfig,
        placed: Vec<PlacedPipeline>,
        models: TrainModels,
        settings: ModelsConfig,
        exchange: Arc<Exchange>,
    ) -> Self {
        let record = record::TrialRecord::read(models.folder());
        let open_loop = OpenLoop::new(Arc::clone(&train.model), train.track.clone());
        let ledger = record.of(train.model_hash).map(|it| it.ledger.clone()).unwrap_or_default();
        let evidence = RivalEvidence::new(settings.rule.least_gain);
        let in_force = Rival::new(train.model_hash.0, open_loop, Vec::new(), (evidence, ledger));
        let trials = ModelTrials::new(train.id, in_force, Vec::new());
        let standing =
            ModelStanding { in_force: train.model_hash, before: None, rivals: Vec::new() };
        ShadowTrain {
            train,
            placed,
            models,
            settings,
            exchange,
            trials,
            record,
            standing,
            changing: None,
            reported: HashSet::new(),
            newest_speed_mps: 0.0,
            seen: None,
            events: BTreeMap::new(),
        }
    }

    /// Returns the train's number.
    pub fn id(&self) -> u64 {
        self.train.id.0
    }

    /// Returns the model in force.
    pub fn in_force(&self) -> ModelHash {
        ModelHash(self.trials.in_force.model)
    }

    /// Takes the next sample; `unix_s` is the time of day, in s since 1970.
    pub fn take(&mut self, sample: &TrainSample, unix_s: f64) {
        self.trials.take(sample, unix_s);
        self.newest_speed_mps = sample.speed_mps;
    }

    /// Nobody drives the train now: it stands.
    pub fn note_silence(&mut self) {
        self.newest_speed_mps = 0.0;
    }

    /// Looks into the store, judges the rivals and, where a rule is to do so, decides.
    pub fn look(&mut self, now: SystemTime) {
        let changed = self.models.changed();
        if self.seen.as_ref() != Some(&changed) {
            self.read_store();
            self.seen = Some(changed);
        }
        self.judge(now);
    }

    fn read_store(&mut self) {
        let named = (self.train.candidates.as_deref(), self.settings.candidates_max);
        match standing(&self.models, self.train.text.hash(), named) {
            Ok(standing) => {
                self.standing = standing;
                self.admit();
            }
            Err(error) => self.warn_once(format!("the models on trial stay as they are: {error}")),
        }
        self.events.clear();
        for (_, event) in self.models.events().unwrap_or_default() {
            *self.events.entry(event.kind).or_default() += 1;
        }
    }

    /// Goes on with a change of models, or begins one while the train stands.
    pub fn go_on(&mut self) {
        let stands = self.newest_speed_mps.abs() <= STANDING_MPS;
        if let Some(changing) = &self.changing {
            let waited_s = changing.since.elapsed().as_secs_f64();
            if let Some(sets) = self.exchange.come_back() {
                self.complete(sets);
            } else if waited_s > PATIENCE_S && !stands {
                self.withdraw();
            }
        } else if stands && self.standing.in_force != self.in_force() {
            match in_force::permitted(&self.models, &self.settings.rule, self.standing.in_force) {
                Ok(()) => self.begin(self.standing.in_force),
                Err(error) => self.warn_once(format!("what was decided is not done: {error}")),
            }
        }
    }

    /// Maintenance events by kind.
    pub fn events(&self) -> &BTreeMap<String, u64> {
        &self.events
    }

    /// Returns the present figures of the trials.
    pub fn figures(&self) -> Vec<TrialFigures> {
        let figures = |rival: &Rival, is_in_force| TrialFigures {
            train: self.id(),
            model: ModelHash(rival.model),
            is_in_force,
            error_mps: rival.ledger.all.rmse_mps(),
            error_ratio: rival.evidence.error_ratio(),
            trips: rival.evidence.trips(),
            e_value: rival.evidence.e_value(),
        };
        let rivals = self.trials.rivals.iter().map(|rival| figures(rival, false));
        std::iter::once(figures(&self.trials.in_force, true)).chain(rivals).collect()
    }

    /// Writes the results of the trials into the record.
    pub fn write(&mut self, now: SystemTime) {
        let in_force = self.in_force();
        let against = |rival: &Rival| (rival.model != in_force.0).then_some(in_force);
        let all = std::iter::once(&self.trials.in_force).chain(&self.trials.rivals);
        let tried = all.map(|rival| TriedModel {
            model: ModelHash(rival.model),
            last: UtcSecond::from_time(now),
            against: against(rival),
            error_mps: rival.ledger.all.rmse_mps(),
            error_ratio: rival.evidence.error_ratio(),
            evidence: rival.evidence.clone(),
            ledger: rival.ledger.clone(),
            estimates: self.estimates(&rival.pipelines),
        });
        let tried = tried.collect();
        self.record.update(in_force, tried);
        if let Err(error) = self.record.write(self.models.folder()) {
            self.warn_once(format!("the trials are not kept: {error}"));
        }
    }

    /// Puts the store's rivals on trial, and removes those that are rivals no more.
    fn admit(&mut self) {
        let (in_force, standing) = (self.in_force(), self.standing.clone());
        let wanted: Vec<ModelHash> =
            std::iter::once(standing.in_force).chain(standing.rivals).collect();
        let changing = self.changing.as_ref().map(|it| it.to);
        self.trials.rivals.retain(|rival| {
            let hash = ModelHash(rival.model);
            wanted.contains(&hash) || changing == Some(hash)
        });
        for hash in wanted {
            let is_there = self.trials.rivals.iter().any(|rival| rival.model == hash.0);
            if hash == in_force || is_there {
                continue;
            }
            match self.rival(hash) {
                Ok(rival) => {
                    info!(train = self.id(), model = %hash, "on trial");
                    self.trials.rivals.push(rival);
                }
                Err(error) => self.warn_once(format!("model {hash} is not tried: {error}")),
            }
        }
    }

    fn rival(&self, hash: ModelHash) -> Result<Rival, NotTried> {
        let train = with_model(&self.models, &self.train, hash)?;
        let pipelines = self
            .placed
            .iter()
            .map(|it| build_pipeline(&it.settings, it.index, &train))
            .collect::<Result<Vec<_>, _>>()?;
        let open_loop = OpenLoop::new(Arc::clone(&train.model), train.track.clone());
        let known = self.record.of(hash);
        let least_gain = self.settings.rule.least_gain;
        let evidence = known
            .filter(|it| it.against == Some(self.in_force()))
            .map(|it| it.evidence.clone())
            .filter(|it| it.least_gain() == least_gain)
            .unwrap_or_else(|| RivalEvidence::new(least_gain));
        let ledger = known.map(|it| it.ledger.clone()).unwrap_or_default();
        Ok(Rival::new(hash.0, open_loop, pipelines, (evidence, ledger)))
    }

    /// Reports which rivals are better, or decides on the first where the rule is to.
    fn judge(&mut self, now: SystemTime) {
        if self.standing.in_force != self.in_force() {
            return;
        }
        let rule = self.settings.rule.clone();
        let better: Vec<(ModelHash, String)> = self
            .trials
            .rivals
            .iter()
            .filter(|rival| rule.is_better(rival, self.trials.rivals.len()))
            .map(|rival| (ModelHash(rival.model), self.reason(rival)))
            .collect();
        for (hash, reason) in better {
            match self.models.text(hash).map(|text| rule.outside(&text)) {
                Ok(None) if rule.adopt == Adopt::WhenBetter => {
                    return self.decide(hash, reason, now);
                }
                Ok(None) => self.report_once(format!(
                    "model {hash} is better: {reason}. `dynocar models adopt {hash}` puts it in force"
                )),
                Ok(Some(outside)) => {
                    self.warn_once(format!("model {hash} is better, but out of bounds: {outside}"));
                }
                Err(error) => self.warn_once(error.to_string()),
            }
        }
    }

    fn decide(&mut self, hash: ModelHash, reason: String, now: SystemTime) {
        let what = Rule::choice(&self.standing, hash);
        let at = UtcSecond::from_time(now);
        info!(train = self.id(), model = %hash, "decided by rule: {reason}");
        let decision = NewDecision { what, by: RULE.into(), reason, at };
        match self.models.decide(&decision) {
            Ok(_) => self.read_store(),
            Err(error) => self.warn_once(format!("the decision is not written: {error}")),
        }
    }

    /// Describes the evidence for a rival.
    fn reason(&self, rival: &Rival) -> String {
        let error = |it: &Rival| it.ledger.all.rmse_mps().unwrap_or(f64::NAN);
        let ratio = rival.evidence.error_ratio().map_or("unknown".into(), ratio_in_words);
        format!(
            "open loop over 60 s {:.3} m/s, the model in force {:.3} m/s; in a typical trip {ratio} \
             its error (95 %, at all times), {} trips",
            error(rival),
            error(&self.trials.in_force),
            rival.evidence.trips()
        )
    }

    fn begin(&mut self, to: ModelHash) {
        let Some(rival) = self.trials.rivals.iter_mut().find(|it| it.model == to.0) else { return };
        let mut pipelines = std::mem::take(&mut rival.pipelines).into_iter();
        let seats = self.placed.last().map_or(0, |it| it.seat + 1);
        let set = |seat: usize| {
            let count = self.placed.iter().filter(|it| it.seat == seat).count();
            pipelines.by_ref().take(count).collect::<Set>()
        };
        self.exchange.hand_over((0..seats).map(set).collect());
        self.changing = Some(Changing { to, since: Instant::now() });
    }

    fn withdraw(&mut self) {
        let Some(changing) = &self.changing else { return };
        let Some(sets) = self.exchange.withdraw() else { return };
        if let Some(rival) = self.trials.rivals.iter_mut().find(|it| it.model == changing.to.0) {
            rival.pipelines = sets.into_iter().flatten().collect();
        }
        self.changing = None;
    }

    fn complete(&mut self, sets: Vec<Set>) {
        let (Some(changing), from) = (self.changing.take(), self.in_force()) else { return };
        let found = self.trials.rivals.iter().position(|it| it.model == changing.to.0);
        let Some(index) = found else { return };
        self.trials.change(index);
        self.trials.rivals[index].pipelines = sets.into_iter().flatten().collect();
        info!(train = self.id(), model = %changing.to, before = %from, "in force from now on");
        self.reported.clear();
        // Other candidates grew from the model that is in force now.
        self.seen = None;
    }

    fn estimates(&self, pipelines: &[Pipeline]) -> Vec<RivalEstimate> {
        let estimate = |(placed, pipeline): (&PlacedPipeline, &Pipeline)| {
            RivalEstimate::new(&placed.settings.name, pipeline.snapshot())
        };
        self.placed.iter().zip(pipelines).map(estimate).collect()
    }

    fn warn_once(&mut self, message: String) {
        if self.reported.insert(message.clone()) {
            warn!(train = self.id(), "{message}");
        }
    }

    fn report_once(&mut self, message: String) {
        // The figures in it change: once for each model.
        let about = message.split(':').next().unwrap_or_default().to_owned();
        if self.reported.insert(about) {
            info!(train = self.id(), "{message}");
        }
    }
}

/// By whom a rule's decisions are signed.
pub const RULE: &str = "rule";

/// Why a model is not tried.
#[derive(Debug, thiserror::Error)]
enum NotTried {
    #[error(transparent)]
    Models(#[from] ModelsError),
    #[error(transparent)]
    Pipeline(#[from] SettingRefused),
}
