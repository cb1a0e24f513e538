//! What was understood, machine-readable. Units are SI and part of the keys.

use std::path::Path;

use dynocar_analysis::dataset::{
    ColumnMapping, DatasetError, DatasetHead, Diagnostic, ForceSource, GradientSource, Manifest,
    PositionSource, Quantity, Role, Run, RunEntry, RunQuality, TimeFormat,
};
use dynocar_model::terms::CORRECTIONS;
use dynocar_model::terms::extra::Extra;
use dynocar_model::track::{LinearProfile, Track};
use dynocar_model::train::{Corrections, EffortCurve, TrainModel};
use serde::{Serialize, Serializer};

use super::Understood;
use crate::run_facts::recorded;
use dynocar::cli::Failure;
use dynocar::cli::check::{self as daemon, CheckAnswer, DaemonAnswer};
use dynocar::models::Moment;

/// What was understood.
#[derive(Debug, Serialize)]
pub(super) struct Content<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    dataset: Option<DatasetAnswer<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    train: Option<TrainAnswer<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    track: Option<TrackAnswer<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    daemon: Option<DaemonAnswer<'a>>,
}

#[derive(Debug, Serialize)]
struct DatasetAnswer<'a> {
    name: &'a str,
    description: Option<&'a str>,
    columns: Vec<ColumnAnswer<'a>>,
    runs: Vec<RunAnswer<'a>>,
}

#[derive(Debug, Serialize)]
struct ColumnAnswer<'a> {
    quantity: Quantity,
    column: &'a str,
    unit: &'static str,
    /// How its cells are written, where they are times and no numbers.
    #[serde(skip_serializing_if = "Option::is_none")]
    format: Option<&'a str>,
    scale: f64,
    offset: f64,
}

#[derive(Debug, Serialize)]
struct RunAnswer<'a> {
    file: &'a str,
    role: Role,
    direction: i8,
    #[serde(flatten)]
    outcome: RunOutcome<'a>,
}

#[derive(Debug, Serialize)]
#[serde(untagged)]
enum RunOutcome<'a> {
    Read {
        mass_kg: f64,
        /// In UTC; left out where it is not known.
        #[serde(skip_serializing_if = "Option::is_none")]
        recorded: Option<Moment>,
        samples: usize,
        position_source: PositionSource,
        gradient_source: GradientSource,
        traction_source: ForceSource,
        brake_source: ForceSource,
        quality: &'a RunQuality,
        #[serde(rename = "remarks")]
        diagnostics: &'a [Diagnostic],
    },
    Failed {
        error: String,
    },
}

#[derive(Debug, Serialize)]
struct TrainAnswer<'a> {
    name: &'a str,
    mass_kg: f64,
    length_m: f64,
    cars: u32,
    rotating_mass_factor: f64,
    a: f64,
    b: f64,
    c: f64,
    curve_constant_n_per_kn_m: f64,
    tunnel_constant_n_per_kn_m: f64,
    /// Points (m/s, N).
    traction_effort: Option<&'a [(f64, f64)]>,
    brake_effort: Option<&'a [(f64, f64)]>,
    /// As in `train.toml`; `null` when nothing is corrected.
    corrections: Option<CorrectionsAnswer<'a>>,
    /// Formulas of the resistances of forms of their own.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    extra: Vec<String>,
}

/// Every correction of a train, by its key and in the order of the table.
#[derive(Debug)]
struct CorrectionsAnswer<'a>(&'a TrainModel);

impl Serialize for CorrectionsAnswer<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(CORRECTIONS.iter().map(|key| (key.name, key.declared(self.0))))
    }
}

#[derive(Debug, Serialize)]
struct TrackAnswer<'a> {
    name: &'a str,
    length_m: Option<f64>,
    /// `null`: not known.
    gradients: Option<usize>,
    gradient_range_permille: Option<(f64, f64)>,
    curves: Option<usize>,
    tunnels: Option<usize>,
    gradient_shift_m: f64,
    /// (m, ‰) that the declared gradient lacks.
    gradient_error: Vec<(f64, f64)>,
    /// The same for falling chainage, where it is another way.
    gradient_error_falling: Vec<(f64, f64)>,
    /// Steps (m, N/kN) of further resistance; `null`: not known.
    resistance: Option<Vec<(f64, f64)>>,
    /// [from_m, to_m, direction, mass factor]
    masses: Vec<[f64; 4]>,
}

/// The answer to what was understood.
pub(super) fn answer<'a>(path: &Path, understood: &'a Understood) -> CheckAnswer<Content<'a>> {
    let errors: Vec<String> = understood.errors().map(ToString::to_string).collect();
    let first = understood.errors().next().cloned();
    let (dataset, train, track) = match understood {
        Understood::Dataset(head, runs) => {
            let DatasetHead { manifest, train, track } = &**head;
            (Some(dataset(manifest, runs)), Some(&**train), track.as_deref())
        }
        Understood::Train(train) => (None, Some(&**train), None),
        Understood::Track(track) => (None, None, Some(&**track)),
        Understood::Daemon(_) => (None, None, None),
    };
    let content = Content {
        dataset,
        train: train.map(train_answer),
        track: track.map(track_answer),
        daemon: match understood {
            Understood::Daemon(config) => Some(daemon::answer(config)),
            _ => None,
        },
    };
    CheckAnswer {
        path: path.display().to_string(),
        kind: Some(understood.kind()),
        valid: errors.is_empty(),
        errors,
        error: first.and_then(|error| Failure::from(error).answer()),
        diagnostics: understood.diagnostics(),
        content: Some(content),
    }
}

fn dataset<'a>(manifest: &'a Manifest, runs: &'a [Result<Run, DatasetError>]) -> DatasetAnswer<'a> {
    let column = |mapping: &'a ColumnMapping| ColumnAnswer {
        quantity: mapping.quantity,
        column: &mapping.column,
        unit: mapping.unit.name(),
        format: mapping.format.as_ref().map(TimeFormat::name),
        scale: mapping.scale,
        offset: mapping.offset,
    };
    let run = |(entry, run): (&'a RunEntry, &'a Result<Run, DatasetError>)| RunAnswer {
        file: &entry.file,
        role: entry.role,
        direction: entry.direction,
        outcome: match run {
            Err(error) => RunOutcome::Failed { error: error.to_string() },
            Ok(run) => RunOutcome::Read {
                mass_kg: run.mass_kg,
                recorded: recorded(run),
                samples: run.samples.len(),
                position_source: run.position_source,
                gradient_source: run.gradient_source,
                traction_source: run.traction_source,
                brake_source: run.brake_source,
                quality: &run.quality,
                diagnostics: &run.diagnostics,
            },
        },
    };
    DatasetAnswer {
        name: &manifest.name,
        description: manifest.description.as_deref(),
        columns: manifest.columns.iter().map(column).collect(),
        runs: manifest.runs.iter().zip(runs).map(run).collect(),
    }
}

fn train_answer(train: &TrainModel) -> TrainAnswer<'_> {
    TrainAnswer {
        name: &train.name,
        mass_kg: train.mass_kg,
        length_m: train.length_m,
        cars: train.cars,
        rotating_mass_factor: train.rotating_mass_factor,
        a: train.resistance.a,
        b: train.resistance.b,
        c: train.resistance.c,
        curve_constant_n_per_kn_m: train.curve_constant_n_per_kn_m,
        tunnel_constant_n_per_kn_m: train.tunnel_constant_n_per_kn_m,
        traction_effort: train.traction.as_ref().map(EffortCurve::points),
        brake_effort: train.brake.as_ref().map(EffortCurve::points),
        corrections: (train.corrections != Corrections::NONE).then_some(CorrectionsAnswer(train)),
        extra: train.extra.iter().map(Extra::law).collect(),
    }
}

fn track_answer(track: &Track) -> TrackAnswer<'_> {
    let gradient = track.gradient();
    let range = gradient.map(|profile| {
        profile.entries().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (_, permille)| {
            (low.min(permille), high.max(permille))
        })
    });
    let lacks = |profile: Option<&LinearProfile>| {
        profile.map_or_else(Vec::new, |profile| profile.entries().to_vec())
    };
    TrackAnswer {
        name: &track.name,
        length_m: track.length_m,
        gradients: gradient.map(|profile| profile.entries().len()),
        gradient_range_permille: range,
        curves: track.knows_curves().then(|| track.curves().len()),
        tunnels: track.knows_tunnels().then(|| track.tunnels().len()),
        gradient_shift_m: track.gradient_shift_m,
        gradient_error: lacks(track.gradient_error.as_ref().map(|error| &error.profile)),
        gradient_error_falling: lacks(
            track.gradient_error.as_ref().and_then(|error| error.falling.as_ref()),
        ),
        resistance: track.resistance().map(|profile| profile.entries().collect()),
        masses: track
            .masses
            .iter()
            .map(|it| [it.from_m, it.to_m, it.direction, it.mass_factor])
            .collect(),
    }
}
