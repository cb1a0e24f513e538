//! An explanation next to the data that it explains: a copy of a recording with the verdict, the effects where they
//! act, the residual and the predicted speeds, at the moments at which the recording logs a dataset's runs.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::LazyLock;

use dynocar::cli::Failure;
use dynocar::storage::Disk;
use dynocar_analysis::explain::report::timeline::{RunTimeline, Timeline};
use mcap::McapError;
use mcap::records::MessageHeader;
use prost::Message;
use prost_types::{FileDescriptorProto, FileDescriptorSet};

use super::copying::{CopyWriter, copy};
use super::error::{AtPath, CopyError, WriteError};
use super::event::{MessageField, message};
use super::reading::{Raw, RecordingItem, Visitor};
use super::recording::trains_of;
use super::schema::{fields_of, message};

/// Why a recording is not annotated.
#[derive(Debug, thiserror::Error)]
pub enum AnnotateError {
    /// The recording cannot be copied.
    #[error(transparent)]
    Copy(#[from] CopyError),
    /// The explanation is of other data.
    #[error(transparent)]
    OtherRuns(#[from] AtPath<OtherRuns>),
}

/// A recording that is another than the one explained is wrong input.
impl From<AnnotateError> for Failure {
    fn from(error: AnnotateError) -> Self {
        match error {
            AnnotateError::Copy(error) => error.into(),
            error => Failure::input(error),
        }
    }
}

/// Runs of a recording that are not those of an explanation.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "holds {trains} trains and {runs} runs, the explanation is of one train and {explained} runs"
)]
pub struct OtherRuns {
    /// The trains in the recording.
    pub trains: usize,
    /// The runs in it.
    pub runs: usize,
    /// The number of the last run that was explained.
    pub explained: usize,
}

/// Summary of the added messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Annotated {
    /// Intervals in which an effect acts.
    pub effects: usize,
    /// Messages in all.
    pub messages: usize,
}

/// Copies a recording into a new file and adds an explanation of the dataset that it is.
///
/// # Errors
///
/// See [`AnnotateError`]; then there is no new file.
pub fn annotate(
    from: &Path,
    train: Option<u64>,
    timeline: &Timeline,
    to: &Path,
) -> Result<Annotated, AnnotateError> {
    let mut added = Annotated::default();
    copy(&Disk, &[from.into()], to, &mut SampleMoments::default(), |writer, moments| {
        let (train, runs) = runs_of(moments, train, timeline).map_err(AtPath::of(from))?;
        let annotations = Annotations::new(writer, train);
        let written = annotations.and_then(|it| it.write(timeline, &runs));
        added = written.map_err(WriteError::of(to)).map_err(CopyError::from)?;
        Ok::<(), AnnotateError>(())
    })?;
    Ok(added)
}

/// Returns the train and its runs.
fn runs_of(
    moments: &SampleMoments,
    train: Option<u64>,
    timeline: &Timeline,
) -> Result<(u64, Vec<RunMoments>), OtherRuns> {
    let explained = timeline.runs.last().map_or(0, |it| it.number as usize);
    let mut trains = moments.trains();
    trains.retain(|it| train.is_none_or(|train| *it == train));
    let [train] = trains[..] else {
        return Err(OtherRuns { trains: trains.len(), runs: 0, explained });
    };
    let runs = moments.runs(train);
    let has_all = timeline.runs.iter().all(|it| (1..=runs.len()).contains(&(it.number as usize)));
    if has_all {
        Ok((train, runs))
    } else {
        Err(OtherRuns { trains: 1, runs: runs.len(), explained })
    }
}

/// Where annotations go.
struct Annotations<'w> {
    writer: &'w mut CopyWriter,
    train: u64,
    verdict: u16,
    effect: u16,
    residual: u16,
    speed: u16,
    added: Annotated,
}

impl<'w> Annotations<'w> {
    fn new(writer: &'w mut CopyWriter, train: u64) -> Result<Self, McapError> {
        let mut channel = |name: &str, topic: String| {
            let name = format!("dynocar.{name}");
            let schema = writer.add_schema(&name, "protobuf", &DESCRIPTORS)?;
            writer.add_channel(schema, &topic, "protobuf", &BTreeMap::new())
        };
        Ok(Annotations {
            verdict: channel(Verdict::NAME, "/explain/verdict".into())?,
            effect: channel(Effect::NAME, "/explain/effects".into())?,
            residual: channel(Residual::NAME, format!("/train/{train}/explain/residual"))?,
            speed: channel(PredictedSpeed::NAME, format!("/train/{train}/explain/speed"))?,
            writer,
            train,
            added: Annotated::default(),
        })
    }

    fn write(mut self, timeline: &Timeline, runs: &[RunMoments]) -> Result<Annotated, McapError> {
        let first = timeline.runs.first();
        let begin = first.and_then(|it| Some((it, it.speeds.first()?.time_s)));
        let begin_ns = begin.map_or(0, |(it, time_s)| runs[it.number as usize - 1].wall_ns(time_s));
        let verdict = Verdict {
            verdict: timeline.verdict.name().into(),
            text: timeline.statement.clone(),
            rmse_before_mps: timeline.rmse_before_mps,
            rmse_after_mps: timeline.rmse_after_mps,
        };
        self.put(self.verdict, begin_ns, &verdict)?;
        for run in &timeline.runs {
            self.run(run, &runs[run.number as usize - 1])?;
        }
        Ok(self.added)
    }

    fn run(&mut self, run: &RunTimeline, moments: &RunMoments) -> Result<(), McapError> {
        for it in &run.effects {
            let message = Effect {
                train_id: self.train,
                run_file: run.file.clone(),
                kind: it.kind.clone(),
                number: it.number,
                text: it.text.clone(),
                duration_s: it.to_s - it.from_s,
                end_ns: moments.wall_ns(it.to_s),
                begin_position_m: it.positions_m.map(|it| it[0]),
                end_position_m: it.positions_m.map(|it| it[1]),
                error_reduction: it.error_reduction,
                p_value: it.p_value,
            };
            self.put(self.effect, moments.wall_ns(it.from_s), &message)?;
            self.added.effects += 1;
        }
        for it in &run.residuals {
            let message = Residual {
                duration_s: it.to_s - it.from_s,
                residual_before_n_per_kn: it.before_n_per_kn,
                residual_after_n_per_kn: it.after_n_per_kn,
            };
            self.put(self.residual, moments.wall_ns(0.5 * (it.from_s + it.to_s)), &message)?;
        }
        for it in &run.speeds {
            let message = PredictedSpeed {
                measured_speed_mps: it.measured_mps,
                speed_before_mps: it.before_mps,
                speed_after_mps: it.after_mps,
                error_before_mps: it.before_mps - it.measured_mps,
                error_after_mps: it.after_mps - it.measured_mps,
            };
            self.put(self.speed, moments.wall_ns(it.time_s), &message)?;
        }
        Ok(())
    }

    fn put(
        &mut self,
        channel_id: u16,
        at_ns: u64,
        message: &impl Message,
    ) -> Result<(), McapError> {
        self.added.messages += 1;
        let sequence = self.added.messages as u32;
        let header = MessageHeader { channel_id, sequence, log_time: at_ns, publish_time: at_ns };
        self.writer.write_to_known_channel(&header, &message.encode_to_vec())
    }
}

/// The samples of a recording with their moments, run by run as a dataset of it has them.
#[derive(Debug, Default)]
pub struct SampleMoments {
    /// When the newest message was logged, in ns since 1970.
    logged_ns: u64,
    samples: Vec<Moment>,
}

#[derive(Clone, Copy, Debug)]
struct Moment {
    train: u64,
    run: (u32, i8),
    time_ns: i64,
    logged_ns: u64,
}

impl Visitor for SampleMoments {
    type Error = CopyError;

    fn item(&mut self, item: RecordingItem<'_>) -> Result<(), CopyError> {
        if let RecordingItem::Sample(it) = item {
            let (run, logged_ns) = ((it.run, it.direction), self.logged_ns);
            let time_ns = it.time_ns;
            self.samples.push(Moment { train: it.train_id, run, time_ns, logged_ns });
        }
        Ok(())
    }

    fn raw(&mut self, raw: &Raw<'_>) -> Result<(), CopyError> {
        self.logged_ns = raw.header.log_time;
        Ok(())
    }
}

impl SampleMoments {
    /// Returns the trains that there are samples of, in order.
    pub fn trains(&self) -> Vec<u64> {
        trains_of(self.samples.iter().map(|it| it.train))
    }

    /// Returns the runs of a train.
    pub fn runs(&self, train: u64) -> Vec<RunMoments> {
        let samples: Vec<Moment> =
            self.samples.iter().filter(|it| it.train == train).copied().collect();
        samples.chunk_by(|one, next| one.run == next.run).map(RunMoments::from_samples).collect()
    }
}

/// The moments of one run.
#[derive(Debug)]
pub struct RunMoments {
    /// The recorder's time and when it was logged, in order of time.
    moments: Vec<(i64, u64)>,
}

impl RunMoments {
    fn from_samples(samples: &[Moment]) -> Self {
        let mut moments: Vec<_> = samples.iter().map(|it| (it.time_ns, it.logged_ns)).collect();
        moments.sort_unstable();
        RunMoments { moments }
    }

    /// When a moment was that the dataset counts in s, in ns since 1970: by the nearest sample before it.
    pub fn wall_ns(&self, time_s: f64) -> u64 {
        let time_ns = (time_s * 1e9).round() as i64;
        let after = self.moments.partition_point(|it| it.0 <= time_ns);
        let (of_sample_ns, logged_ns) = self.moments[after.saturating_sub(1)];
        logged_ns.saturating_add_signed(time_ns - of_sample_ns)
    }
}

message! {
    /// Statement of `explain` about a recording.
    Verdict {
        /// none, effect, ambiguous, unknown or insufficient_data.
        1 verdict: String = string;
        /// The verdict in a sentence or two.
        2 text: String = string;
        /// RMSE of the predicted speed on the runs held out, without the effects.
        3 rmse_before_mps: Option<f64> = double optional;
        /// The same with the effects.
        4 rmse_after_mps: Option<f64> = double optional;
    }
}

message! {
    /// An effect that begins to act here.
    Effect {
        /// The train.
        1 train_id: u64 = uint64;
        /// The file of the run in the dataset that was explained.
        2 run_file: String = string;
        /// The kind's name.
        3 kind: String = string;
        /// Its place among the effects found, from 1.
        4 number: u32 = uint32;
        /// Kind, size and place in words.
        5 text: String = string;
        /// For how long it acts from here on.
        6 duration_s: f64 = double;
        /// When it ends to act, in ns since 1970 like the message's log time.
        7 end_ns: u64 = uint64;
        /// Chainage of the train's centre where it begins to act.
        8 begin_position_m: Option<f64> = double optional;
        /// Chainage of the train's centre where it ends to act.
        9 end_position_m: Option<f64> = double optional;
        /// Share of the open-loop error on the fit runs that goes when the effect is added last.
        10 error_reduction: f64 = double;
        /// Probability that the search finds as much where nothing acts.
        11 p_value: f64 = double;
    }
}

message! {
    /// The resistance that the models lack, over about 20 s; positive retards. Logged at the middle.
    Residual {
        /// The length of time.
        1 duration_s: f64 = double;
        /// Without the effects found.
        2 residual_before_n_per_kn: f64 = double;
        /// With the effects found.
        3 residual_after_n_per_kn: f64 = double;
    }
}

message! {
    /// The speed as measured, and as the models predict it from the run's first sample on.
    PredictedSpeed {
        /// Measured.
        1 measured_speed_mps: f64 = double;
        /// Predicted without the effects found.
        2 speed_before_mps: f64 = double;
        /// Predicted with the effects found.
        3 speed_after_mps: f64 = double;
        /// Predicted without the effects less measured.
        4 error_before_mps: f64 = double;
        /// Predicted with the effects less measured.
        5 error_after_mps: f64 = double;
    }
}

/// The messages with their names, meanings and fields.
pub const MESSAGES: [(&str, &str, &[MessageField]); 4] = [
    (Verdict::NAME, Verdict::MEANING, Verdict::FIELDS),
    (Effect::NAME, Effect::MEANING, Effect::FIELDS),
    (Residual::NAME, Residual::MEANING, Residual::FIELDS),
    (PredictedSpeed::NAME, PredictedSpeed::MEANING, PredictedSpeed::FIELDS),
];

/// The messages as the bytes that an MCAP schema holds.
pub static DESCRIPTORS: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let file = FileDescriptorProto {
        name: Some("dynocar/explanation.proto".into()),
        package: Some("dynocar".into()),
        syntax: Some("proto3".into()),
        message_type: MESSAGES.iter().map(|it| message(it.0, fields_of(it.2))).collect(),
        ..Default::default()
    };
    FileDescriptorSet { file: vec![file] }.encode_to_vec()
});
