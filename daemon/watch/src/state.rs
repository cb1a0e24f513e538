//! The shown state of a train and its last minutes, without any clock or channel, and advice on the next manoeuvre,
//! computed now and then.

use std::collections::VecDeque;
use std::sync::Arc;

use dynocar::observing::sample_age_s;
use dynocar_analysis::advice::noise::{NoiseSeen, davis_of};
use dynocar_analysis::advice::{for_mass, for_resistance, in_words, remedy};
use dynocar_client::Reading;
use dynocar_model::train::TrainModel;
use dynocar_shared::{
    Manoeuvre, Parameter, ParameterSnapshot, PipelineKind, Quantity, Reason, Status, TrainId,
    UseState,
};

/// Daemon of a train, as far as this program can see it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Daemon {
    /// There is no daemon, and none was seen before.
    Absent,
    /// The daemon that was seen is gone.
    Gone,
    /// A daemon that publishes this about itself.
    Serving {
        /// Its release.
        version: String,
        /// Its process.
        process_id: u32,
    },
    /// A daemon that shares no memory format with this program, or a channel that cannot be read.
    Unreadable(String),
}

/// The newest state of one pipeline.
#[derive(Clone, Debug, PartialEq)]
pub struct PipelineState {
    /// Its name in the configuration, else its kind's.
    pub name: String,
    /// The newest snapshot.
    pub snapshot: ParameterSnapshot,
    /// The status; invalid while the daemon is silent.
    pub status: Status,
    /// Why.
    pub reason: Option<Reason>,
    /// Age in s of the newest sample behind it; `None` before the first.
    pub sample_age_s: Option<f64>,
    /// The last minutes.
    pub history: PlotHistory,
}

impl PipelineState {
    /// Returns the latest snapshot and history of a pipeline; falls back to the name of its kind if it is unnamed.
    pub fn new(
        name: Option<String>,
        history: PlotHistory,
        reading: &Reading<'_>,
        now_ns: i64,
    ) -> Self {
        let snapshot = *reading.snapshot;
        PipelineState {
            name: name.unwrap_or_else(|| kind_of(&snapshot).to_owned()),
            status: reading.status(),
            reason: reading.reason(),
            sample_age_s: sample_age_s(&snapshot, now_ns),
            snapshot,
            history,
        }
    }

    /// Returns the kind's name.
    pub fn kind(&self) -> &'static str {
        kind_of(&self.snapshot)
    }

    /// Returns the status, with its reason where there is one.
    pub fn status_words(&self) -> String {
        match self.reason {
            Some(Reason::None) => self.status.to_string(),
            reason => format!("{} ({})", self.status, reason.map_or("unknown", Reason::name)),
        }
    }

    /// Returns the state of use of a quantity that it answers.
    pub fn use_of(&self, quantity: Quantity) -> UseState {
        UseState::of(self.status, self.snapshot.is_usable_for(quantity))
    }

    /// Returns why that is so, in one word; empty where there is nothing to remark.
    pub fn why(&self, quantity: Quantity) -> &'static str {
        let state = self.use_of(quantity);
        let why = state.why(self.reason);
        if why == "none" || why == state.name() { "" } else { why }
    }
}

fn kind_of(snapshot: &ParameterSnapshot) -> &'static str {
    snapshot.pipeline_kind().map_or("unknown", PipelineKind::name)
}

/// A train.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainState {
    /// Its number.
    pub id: TrainId,
    /// Its name, where the configuration gives it.
    pub name: Option<String>,
    /// Who serves it.
    pub daemon: Daemon,
    /// Time in s since the daemon's start, where it was heard of.
    pub up_s: Option<f64>,
    /// Its pipelines, by their number.
    pub pipelines: Vec<PipelineState>,
    /// Advice on the next manoeuvre and other help, the most useful first.
    pub advice: Vec<String>,
}

impl TrainState {
    /// Returns a train of which nothing has been heard.
    pub fn new(id: TrainId, name: Option<String>) -> Self {
        TrainState {
            id,
            name,
            daemon: Daemon::Absent,
            up_s: None,
            pipelines: Vec::new(),
            advice: Vec::new(),
        }
    }

    /// Returns the pipeline that answers a quantity.
    pub fn answering(&self, quantity: Quantity) -> Option<&PipelineState> {
        self.pipelines.iter().find(|it| it.snapshot.answers(quantity))
    }

    /// Returns the pipeline that watches the residual: the monitor, else the one of the resistance.
    pub fn residual(&self) -> Option<&PipelineState> {
        let monitor = |it: &&PipelineState| {
            it.snapshot.pipeline_kind() == Some(PipelineKind::ResidualMonitor)
        };
        self.pipelines.iter().find(monitor).or_else(|| self.answering(Quantity::Resistance))
    }
}

/// Points that are kept: ten minutes.
const POINTS: usize = 600;

/// Plotted values of one second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlotPoint {
    /// Unexplained force in kN, retarding positive.
    pub unexplained_kn: f64,
    /// Evidence for the suspected effect.
    pub evidence: f64,
}

/// Points, the newest last, and the rate of samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlotHistory {
    points: VecDeque<PlotPoint>,
    /// Host's time in ns and sequence number of the newest sample, a second ago.
    last: Option<(i64, u64)>,
    rate_hz: Option<f64>,
}

impl PlotHistory {
    /// Takes a point; call it once a second, with the host's time in ns.
    pub fn push(&mut self, snapshot: &ParameterSnapshot, now_ns: i64) {
        if self.points.len() == POINTS {
            self.points.pop_front();
        }
        self.points.push_back(PlotPoint {
            unexplained_kn: 1e-3 * snapshot.unexplained_force_n,
            evidence: snapshot.suspicion_evidence,
        });
        let before = self.last.replace((now_ns, snapshot.sample_sequence));
        self.rate_hz = before.and_then(|(then_ns, sequence)| {
            let samples = snapshot.sample_sequence.checked_sub(sequence)?;
            let elapsed_s = 1e-9 * (now_ns - then_ns) as f64;
            (elapsed_s > 0.0).then_some(samples as f64 / elapsed_s)
        });
    }

    /// Returns the samples a second lately.
    pub fn rate_hz(&self) -> Option<f64> {
        self.rate_hz
    }

    /// Returns the newest points, at most `count`, the oldest first.
    pub fn newest(&self, count: usize) -> impl Iterator<Item = &PlotPoint> + Clone {
        self.points.iter().skip(self.points.len().saturating_sub(count))
    }
}

/// Inputs for the advice on one train.
#[derive(Clone, Debug)]
pub struct Advisor {
    train: Option<Arc<TrainModel>>,
    noise: NoiseSeen,
}

impl Advisor {
    /// Returns an advisor for a train as it is declared, where its declaration is known.
    pub fn new(train: Option<Arc<TrainModel>>) -> Self {
        Advisor { train, noise: NoiseSeen::default() }
    }

    /// Takes in the snapshots; call it with every one or with some of them.
    pub fn see(&mut self, state: &TrainState) {
        if let Some(resistance) = state.answering(Quantity::Resistance) {
            self.noise.see(&resistance.snapshot);
        }
    }

    /// Returns the advice: the next manoeuvre for the resistance first, then other help, quantity by quantity.
    pub fn advise(&self, state: &TrainState) -> Vec<String> {
        let mut sentences = Vec::new();
        for &quantity in Quantity::ALL {
            let Some(pipeline) = state.answering(quantity) else { continue };
            let words = match remedy(pipeline.status, pipeline.reason) {
                Some(words) => Some(format!("{quantity}: {words}")),
                None => self.to_drive(quantity, pipeline, state),
            };
            sentences.extend(words);
        }
        sentences
    }

    fn to_drive(
        &self,
        quantity: Quantity,
        pipeline: &PipelineState,
        state: &TrainState,
    ) -> Option<String> {
        if !matches!(quantity, Quantity::Resistance | Quantity::Mass) {
            return lacking(quantity, pipeline);
        }
        let Some(train) = &self.train else {
            let words = "give --config FILE: what to drive next needs the train's file";
            return (quantity == Quantity::Resistance).then(|| words.to_owned());
        };
        let resistance = state.answering(Quantity::Resistance)?;
        let mass = state.answering(Quantity::Mass).filter(|it| it.status == Status::Estimated);
        let mass = mass.and_then(|it| {
            Some((it.snapshot.value(Parameter::Mass)?, it.snapshot.std(Parameter::Mass)?))
        });
        let mass = mass.unwrap_or((1e-3 * train.mass_kg, 0.0));
        let Some(noise) = self.noise.noise(&resistance.snapshot, train) else {
            return lacking(quantity, pipeline);
        };
        let advice = match quantity {
            Quantity::Mass => {
                let davis = davis_of(&resistance.snapshot)?;
                for_mass(&pipeline.snapshot, train, davis, &noise)
            }
            _ => for_resistance(&pipeline.snapshot, train, mass, &noise),
        };
        advice.map(|advice| advice.in_words())
    }
}

/// Returns the manoeuvre that a pipeline itself says it lacks, without numbers.
fn lacking(quantity: Quantity, pipeline: &PipelineState) -> Option<String> {
    let missing = pipeline.snapshot.missing_manoeuvres;
    let words: Vec<&str> = Manoeuvre::ALL
        .iter()
        .filter(|manoeuvre| missing & manoeuvre.bit() != 0)
        .map(|&manoeuvre| in_words(manoeuvre))
        .collect();
    (!words.is_empty()).then(|| format!("{quantity} needs {}", words.join(", ")))
}
