//! Suspicions of the residual monitor while the practice runs are driven, one after the other.

use std::path::Path;
use std::sync::Arc;

use dynocar::dataset;
use dynocar_analysis::dataset::{Dataset, Run};
use dynocar_analysis::identify::published_samples;
use dynocar_core::pipeline::Pipeline;
use dynocar_estimators::EstimatorSettings;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{PipelineKind, TrainId};

use super::Report;
use super::truth::Truth;

/// Greatest time in s from its onset until a dragging brake must be suspected.
const NOTICED_MAX_S: f64 = 120.0;
/// Number of the passage by whose end tunnel drag must be suspected.
const PASSAGES_MAX: usize = 2;

/// The suspect after each sample of the runs in their order.
struct Watched {
    /// Run, time in s within it, chainage, suspect.
    seen: Vec<(usize, f64, Option<f64>, EffectKind)>,
}

/// Watches a dataset without effect, one with a dragging brake and one with tunnel drag.
pub fn check(report: &mut Report, folder: &Path) {
    report.note("p01: no alarm by the residual monitor", silent(folder));
    report.note("p03: the brake is suspected soon, and not before", brake(folder));
    report.note("p02: the tunnels are suspected by the second passage", tunnel(folder));
}

fn load(folder: &Path, name: &str) -> Result<Dataset, String> {
    dataset::load(&folder.join("practice").join(name)).map_err(|error| error.to_string())
}

fn watch(dataset: &Dataset) -> Result<Watched, String> {
    let settings = EstimatorSettings::default_of(PipelineKind::ResidualMonitor);
    let settings = settings.ok_or("no residual monitor")?;
    let monitor = settings.build(&dataset.train).map_err(|error| error.to_string())?;
    let (train, track) = (Arc::clone(&dataset.train), dataset.track.clone());
    let mut pipeline = Pipeline::new(TrainId(1), 0, train, track, monitor);
    let samples = published_samples(dataset, TrainId(1));
    let mut rest = samples.iter();
    let mut seen = Vec::with_capacity(samples.len());
    for (number, run) in dataset.runs.iter().enumerate() {
        let mut start_ns = None;
        for sample in rest.by_ref().take(run.samples.len()) {
            let start_ns = *start_ns.get_or_insert(sample.time_ns);
            let snapshot = pipeline.process(sample);
            let suspect = EffectKind::from_number(snapshot.suspected_effect);
            let time_s = (sample.time_ns - start_ns) as f64 * 1e-9;
            let chainage_m = sample.position_m.is_finite().then_some(sample.position_m);
            seen.push((number, time_s, chainage_m, suspect.ok_or("a kind of no name")?));
        }
    }
    Ok(Watched { seen })
}

fn silent(folder: &Path) -> Result<String, String> {
    let watched = watch(&load(folder, "p01")?)?;
    match watched.seen.iter().find(|it| it.3 != EffectKind::None) {
        None => Ok(format!("{} samples", watched.seen.len())),
        Some((run, time_s, _, kind)) => Err(format!("{kind} in run {run} at {time_s:.0} s")),
    }
}

fn brake(folder: &Path) -> Result<String, String> {
    let dataset = load(folder, "p03")?;
    let truth = Truth::read(folder, "p03")?;
    let windows = truth.windows(truth.effects.first().ok_or("no effect")?);
    let number = |file: &str| dataset.runs.iter().position(|run: &Run| run.file == file);
    let Some((first, onset_s)) = windows
        .iter()
        .filter_map(|(file, start_s, _)| Some((number(file)?, *start_s)))
        .min_by(|one, other| one.partial_cmp(other).expect("times are finite"))
    else {
        return Err("no window in a fitted run".into());
    };
    let watched = watch(&dataset)?;
    let mut before = watched.seen.iter().filter(|it| (it.0, it.1) < (first, onset_s));
    if let Some(early) = before.find(|it| it.3 != EffectKind::None) {
        return Err(format!("{} before the onset, at {:.0} s", early.3, early.1));
    }
    let noticed = watched
        .seen
        .iter()
        .find(|it| (it.0, it.1) >= (first, onset_s) && it.3 == EffectKind::DraggingBrake);
    let (run, time_s, ..) = noticed.ok_or("never suspected")?;
    let detail = format!("run {run}, {:.0} s after the onset", time_s - onset_s);
    let is_soon = *run == first && time_s - onset_s <= NOTICED_MAX_S;
    if is_soon { Ok(detail) } else { Err(detail) }
}

fn tunnel(folder: &Path) -> Result<String, String> {
    let dataset = load(folder, "p02")?;
    let track = dataset.track.clone().ok_or("no track")?;
    let watched = watch(&dataset)?;
    let (mut passages, mut was_inside, mut suspected) = (0, false, None);
    for (_, _, chainage_m, kind) in &watched.seen {
        let is_inside = chainage_m.is_some_and(|it| track.tunnel_share(it, 1.0) > Some(0.0));
        passages += usize::from(was_inside && !is_inside);
        was_inside = is_inside;
        match kind {
            EffectKind::None => {}
            EffectKind::TunnelDrag => {
                suspected.get_or_insert(passages);
            }
            other => return Err(format!("{other} after {passages} passages")),
        }
    }
    let passages = suspected.ok_or("never suspected")?;
    let detail = format!("after {passages} whole passages");
    if passages <= PASSAGES_MAX { Ok(detail) } else { Err(detail) }
}
