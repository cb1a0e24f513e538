//! Contents as understood, machine-readable. Units are SI and part of the keys.
#![allow(non_camel_case_types, reason = "the types of an object's values are called as their keys")]

use std::path::Path;

use dynocar_analysis::dataset::keys::{corrections, numbers_of};
use dynocar_analysis::dataset::{DatasetError, Manifest, Run, RunEntry, TimeFormat};
use dynocar_model::terms::extra::ExtraResistance;
use dynocar_model::track::{LinearProfile, Track};
use dynocar_model::train::{Corrections, EffortCurve, TrainModel};
use serde::{Serialize, Serializer};

use super::Understood;
use super::report::range;
use crate::run_facts::recorded;
use dynocar::cli::Failure;
use dynocar::cli::check::{self as daemon, CheckAnswer};

/// Makes an object of these keys, in this order; after `..` stand optional objects whose keys are added.
macro_rules! object {
    ($($key:ident: $value:expr,)* $(..$rest:ident: $more:expr,)*) => {{
        #[derive(Serialize)]
        struct Object<$($key,)* $($rest,)*> {
            $($key: $key,)*
            $(#[serde(flatten)] $rest: Option<$rest>,)*
        }
        Object { $($key: $value,)* $($rest: $more,)* }
    }};
}

/// Every correction of a train, by its key and in the order of the table.
struct CorrectionsAnswer<'a>(&'a TrainModel);

impl Serialize for CorrectionsAnswer<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let all = numbers_of(corrections::TABLE);
        serializer.collect_map(all.map(|key| (key.name, key.declared(self.0))))
    }
}

/// Returns the answer for the understood contents.
pub(super) fn answer(path: &Path, understood: &Understood) -> impl Serialize {
    let errors: Vec<String> = understood.errors().map(ToString::to_string).collect();
    let first = understood.errors().next().cloned();
    let dataset = understood.dataset.as_ref();
    let train = understood.train.as_deref();
    let track = understood.track.as_deref();
    let config = understood.daemon.as_ref();
    CheckAnswer {
        path: path.display().to_string(),
        kind: Some(understood.kind),
        valid: errors.is_empty(),
        errors,
        error: first.and_then(|error| Failure::from(error).answer()),
        diagnostics: understood.diagnostics(),
        content: Some(object! {
            ..of_dataset: dataset.map(|it| object! { dataset: of_dataset(it), }),
            ..of_train: train.map(|it| object! { train: of_train(it), }),
            ..of_track: track.map(|it| object! { track: of_track(it), }),
            ..of_daemon: config.map(|it| object! { daemon: daemon::answer(it), }),
        }),
    }
}

fn of_dataset((manifest, runs): &(Manifest, Vec<Result<Run, DatasetError>>)) -> impl Serialize {
    let columns = manifest.columns.iter().map(|mapping| {
        let format = mapping.format.as_ref().map(TimeFormat::name);
        object! {
            quantity: mapping.quantity,
            column: &mapping.column,
            unit: mapping.unit.name(),
            ..parts: (!mapping.parts.is_empty()).then(|| object! { parts: &mapping.parts, }),
            ..written: format.map(|format| object! { format: format, }),
            ..converted: Some(object! { scale: mapping.scale, offset: mapping.offset, }),
        }
    });
    object! {
        name: &manifest.name,
        description: manifest.description.as_deref(),
        columns: columns.collect::<Vec<_>>(),
        runs: manifest.runs.iter().zip(runs).map(of_run).collect::<Vec<_>>(),
    }
}

fn of_run<'a>((entry, run): (&'a RunEntry, &'a Result<Run, DatasetError>)) -> impl Serialize {
    let read = |run: &'a Run| {
        object! {
            samples: run.quality.samples(),
            position_source: run.position_source,
            gradient_source: run.gradient_source,
            traction_source: run.traction_source,
            brake_source: run.brake_source,
            quality: &run.quality,
            remarks: &run.diagnostics,
        }
    };
    let run = run.as_ref();
    object! {
        file: &entry.file,
        role: entry.role,
        direction: entry.direction,
        ..failed: run.err().map(|error| object! { error: error.to_string(), }),
        ..mass: run.ok().map(|run| object! { mass_kg: run.mass_kg, }),
        ..at: run.ok().and_then(recorded).map(|at| object! { recorded: at, }),
        ..data: run.ok().map(read),
    }
}

fn of_train(train: &TrainModel) -> impl Serialize {
    let corrections = Some(train).filter(|train| train.corrections != Corrections::NONE);
    let extra: Vec<String> = train.extra.iter().map(ExtraResistance::law).collect();
    object! {
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
        // Points (m/s, N).
        traction_effort: train.traction.as_ref().map(EffortCurve::points),
        brake_effort: train.brake.as_ref().map(EffortCurve::points),
        // As in `train.toml`; `null` when nothing is corrected.
        corrections: corrections.map(CorrectionsAnswer),
        // Formulas of the resistances of forms of their own.
        ..own: Some(extra).filter(|it| !it.is_empty()).map(|extra| object! { extra: extra, }),
    }
}

/// Returns the track for machines; `null` is not known.
fn of_track(track: &Track) -> impl Serialize {
    let gradient = track.gradient();
    let lacks = track.gradient_error.as_ref();
    let points = |profile: Option<&LinearProfile>| {
        profile.map_or_else(Vec::new, |profile| profile.entries().to_vec())
    };
    let masses = track.masses.iter();
    object! {
        name: &track.name,
        length_m: track.length_m,
        gradients: gradient.map(|profile| profile.entries().len()),
        gradient_range_permille: gradient.map(|it| range(it.entries().map(|entry| entry.1))),
        curves: track.knows_curves().then(|| track.curves().len()),
        tunnels: track.knows_tunnels().then(|| track.tunnels().len()),
        gradient_shift_m: track.gradient_shift_m,
        // (m, ‰) that the declared gradient lacks, and the same for falling chainage, where it is another way.
        gradient_error: points(lacks.map(|error| &error.profile)),
        gradient_error_falling: points(lacks.and_then(|error| error.falling.as_ref())),
        // Steps (m, N/kN) of further resistance.
        resistance: track.resistance().map(|profile| profile.entries().collect::<Vec<_>>()),
        // [from_m, to_m, direction, mass factor]
        masses: masses
            .map(|it| [it.from_m, it.to_m, it.direction, it.mass_factor])
            .collect::<Vec<_>>(),
    }
}
