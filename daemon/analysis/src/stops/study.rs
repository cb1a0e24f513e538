//! All of it over a dataset: the law from the stops of fit runs, tried on those held out.

use dynocar_shared::TrainSample;
use serde::Serialize;

use super::curve::Curve;
use super::find::{FindSettings, FoundBy, find};
use super::friction::{FrictionPoint, friction};
use super::law::{Law, StoppingDistance};
use crate::dataset::{Dataset, GradientSource, Role, Run};

/// How stops are found, and what is assumed of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StudySettings {
    /// What counts as a stop.
    pub find: FindSettings,
    /// Relative standard deviation of a stop's deceleration that is assumed beforehand.
    pub repeatability: f64,
}

/// A recorded stop.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordedStop {
    /// The run's file.
    pub file: String,
    /// What the run is for.
    pub role: Role,
    /// Time in s at which the brake was applied, as in the file.
    pub from_s: f64,
    /// Speed in m/s then.
    pub from_mps: f64,
    /// Distance in m from then to standstill.
    pub distance_m: f64,
    /// Time in s from then to standstill.
    pub time_s: f64,
    /// What told that the brake was applied.
    pub found_by: FoundBy,
    /// For a stop held out: what the law said of it.
    pub predicted: Option<StoppingDistance>,
    /// The friction behind it.
    pub friction: Vec<FrictionPoint>,
}

/// What the stops of a dataset say.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Study {
    /// The stops, in the order of the runs.
    pub stops: Vec<RecordedStop>,
    /// Deceleration over speed of the fit runs' stops; `None` without a stop whose brake built up.
    pub law: Option<Law>,
    /// How long the next stop is, from slow to fast.
    pub distances: Vec<StoppingDistance>,
    /// What these stops do not tell.
    pub cannot_tell: Vec<String>,
}

impl Study {
    /// Studies the stops of a dataset; predicts the next one from some speeds in m/s, or from
    /// steps of 5 m/s and the fastest when there are none.
    pub fn of(dataset: &Dataset, settings: &StudySettings, from_mps: &[f64]) -> Self {
        let found: Vec<Found> =
            dataset.runs.iter().flat_map(|run| found_in(dataset, run, settings)).collect();
        let fit = found.iter().filter(|it| it.stop.role == Role::Fit);
        let curves: Vec<Curve> = fit.map(|it| it.curve.clone()).collect();
        let law = Law::of(&curves, settings.repeatability);
        let speeds = match (&law, from_mps) {
            (Some(law), []) => {
                let fastest = law.fastest_mps();
                let steps = (1..).map(|k| 5.0 * f64::from(k)).take_while(|it| *it < fastest);
                steps.chain([fastest]).collect()
            }
            _ => from_mps.to_vec(),
        };
        let predict = |speed_mps: f64| law.as_ref()?.stopping_distance(speed_mps);
        let distances = speeds.into_iter().filter_map(predict).collect();
        let cannot_tell = cannot_tell(dataset, &found, law.as_ref());
        let stops = found.into_iter().map(|Found { mut stop, .. }| {
            stop.predicted = predict(stop.from_mps).filter(|_| stop.role == Role::Holdout);
            stop
        });
        Study { stops: stops.collect(), distances, cannot_tell, law }
    }
}

struct Found {
    stop: RecordedStop,
    curve: Curve,
}

fn found_in(dataset: &Dataset, run: &Run, settings: &StudySettings) -> Vec<Found> {
    let samples = usable(&run.samples);
    let stops = find(&samples, dataset.train.brake.as_ref(), &settings.find);
    let studied = stops.into_iter().filter_map(|stop| {
        let samples = &samples[stop.samples];
        let curve = Curve::of(samples)?;
        let friction = friction(samples, &curve, &dataset.train, dataset.track.as_ref());
        let stop = RecordedStop {
            file: run.file.clone(),
            role: run.role,
            from_s: 1e-9 * samples[0].time_ns as f64,
            from_mps: curve.from_mps(),
            distance_m: curve.distance_m(),
            time_s: curve.points.last()?.time_s,
            found_by: stop.found_by,
            predicted: None,
            friction,
        };
        Some(Found { stop, curve })
    });
    studied.collect()
}

/// The samples with a speed, each later than the one before.
fn usable(samples: &[TrainSample]) -> Vec<TrainSample> {
    let mut last_ns = i64::MIN;
    let is_usable = |sample: &&TrainSample| {
        let is_later = sample.time_ns > last_ns && sample.speed_mps.is_finite();
        last_ns = if is_later { sample.time_ns } else { last_ns };
        is_later
    };
    samples.iter().filter(is_usable).copied().collect()
}

fn cannot_tell(dataset: &Dataset, found: &[Found], law: Option<&Law>) -> Vec<String> {
    let mut said = Vec::new();
    let gradient_unknown = |run: &Run| run.gradient_source == GradientSource::Unknown;
    if dataset.runs.iter().any(gradient_unknown) {
        said.push(
            "the gradient is unknown: 1 permille along a whole stop is 0.01 m/s² of its \
             deceleration, and of its friction"
                .into(),
        );
    }
    said.push("how friction divides into coefficient, pressure and ratio: only its course over speed is told".into());
    if let Some(Law { stops: 1, .. }) = law {
        said.push(
            "how stops differ: one stop was recorded, and the repeatability is assumed".into(),
        );
    }
    if found.iter().any(|it| it.stop.found_by == FoundBy::Speed) {
        said.push("how long the brake takes to build up: its command is not recorded".into());
    }
    said
}
