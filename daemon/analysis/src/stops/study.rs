//! Study of the stops of a dataset: the law from the stops of fit runs, tested on those of holdout runs.

use dynocar_model::terms::gradient;
use dynocar_model::terms::wheel::STANDING_MPS;
use dynocar_shared::resistance::GRAVITY_MPS2;
use dynocar_shared::sample::FLAG_WHEEL_SLIDE;
use dynocar_shared::{SampleField, TrainSample};
use serde::Serialize;

use super::deceleration_curve::{DecelerationCurve, DecelerationPoint};
use super::deceleration_law::{DecelerationLaw, Gradient, StoppingDistance};
use super::find::{FindSettings, FoundBy, began_ns, cut_off_s, find, usable};
use super::friction::friction;
use super::stop_statistics::{Manner, RecordedStop, StopStatistics};
use crate::dataset::{Dataset, Role, Run};

/// How stops are found, and the assumptions on them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StudySettings {
    /// Conditions of a stop.
    pub find: FindSettings,
    /// Relative standard deviation of a stop's deceleration that is assumed beforehand.
    pub repeatability: f64,
}

/// Results of the stops of a dataset.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Study {
    /// The stops, in the order of the runs.
    pub stops: Vec<RecordedStop>,
    /// Deceleration over speed of the fit runs' stops; `None` without a stop whose brake built up.
    pub law: Option<DecelerationLaw>,
    /// How long the next stop is, from slow to fast.
    pub distances: Vec<StoppingDistance>,
    /// All stops together: from which speeds how long, how hard, and how long the train stood.
    pub day: StopStatistics,
    /// Quantities that these stops do not determine.
    pub cannot_tell: Vec<String>,
}

impl Study {
    /// Studies the stops of a dataset; predicts the next one from some speeds in m/s, or from
    /// steps of 5 m/s and the fastest when there are none.
    pub fn new(dataset: &Dataset, settings: &StudySettings, from_mps: &[f64]) -> Self {
        Study::of_all(std::slice::from_ref(dataset), settings, from_mps)
    }

    /// Studies the stops of several datasets of one train together.
    pub fn of_all(datasets: &[Dataset], settings: &StudySettings, from_mps: &[f64]) -> Self {
        let found = datasets
            .iter()
            .flat_map(|dataset| dataset.runs.iter().map(move |run| (dataset, run)))
            .flat_map(|(dataset, run)| found_in(dataset, run, settings));
        let (mut stops, curves): (Vec<RecordedStop>, Vec<DecelerationCurve>) = found.unzip();
        let is = |stop: &RecordedStop, role| stop.role == role && stop.manner == Manner::Full;
        let of_law = stops.iter().zip(curves).filter(|(stop, _)| is(stop, Role::Fit));
        let of_law: Vec<DecelerationCurve> = of_law.map(|(_, curve)| curve).collect();
        let law = DecelerationLaw::new(&of_law, settings.repeatability);
        let speeds = match (&law, from_mps) {
            (Some(law), []) => {
                let fastest = law.fastest_mps();
                let steps = (1..).map(|k| 5.0 * f64::from(k)).take_while(|it| *it < fastest);
                steps.chain([fastest]).collect()
            }
            _ => from_mps.to_vec(),
        };
        let rotating_mass_factor =
            datasets.first().map_or(0.0, |dataset| dataset.train.rotating_mass_factor);
        let predict = |speed_mps: f64, permille: f64| {
            let gradient = Gradient { permille, rotating_mass_factor };
            law.as_ref()?.stopping_distance(speed_mps, &gradient)
        };
        let distances = speeds.into_iter().filter_map(|it| predict(it, 0.0)).collect();
        for stop in stops.iter_mut().filter(|stop| is(stop, Role::Holdout)) {
            stop.predicted = predict(stop.from_mps, stop.gradient_permille.unwrap_or(0.0));
        }
        let cannot_tell = cannot_tell(datasets, &stops, law.as_ref());
        let day = StopStatistics::from_stops(&stops);
        Study { stops, distances, day, cannot_tell, law }
    }
}

/// Returns the stops of a run, each with its curve.
fn found_in(
    dataset: &Dataset,
    run: &Run,
    settings: &StudySettings,
) -> Vec<(RecordedStop, DecelerationCurve)> {
    let mut all = usable(&run.samples, &run.speed_outliers);
    let stops = find(&all, dataset.train.brake.as_ref(), &settings.find);
    for stop in stops.iter().filter(|it| it.found_by == FoundBy::Speed) {
        all[*stop.samples.start()].time_ns = began_ns(&all[stop.samples.clone()]);
    }
    let studied = stops.into_iter().filter_map(|stop| {
        let end = *stop.samples.end();
        let full =
            stop.full_from.and_then(|from| DecelerationCurve::from_samples(&all[from..=end]));
        let has_slid = all[stop.samples.clone()].iter().any(|it| it.flags & FLAG_WHEEL_SLIDE != 0);
        let no_law = match has_slid {
            true => Some("the wheels slid: their speed is not the train's".into()),
            false => why_no_law(full.as_ref(), stop.found_by, settings.find.share_min),
        };
        let cut_off_s = (stop.found_by == FoundBy::Brake)
            .then(|| cut_off_s(&all[..=end], *stop.samples.start(), run.traction_source))
            .flatten();
        let (from, mut curve) = match (full, stop.full_from, &no_law) {
            (Some(curve), Some(from), None) => (from, curve),
            _ => (*stop.samples.start(), DecelerationCurve::from_samples(&all[stop.samples])?),
        };
        let samples = &all[from..=end];
        let is_full = no_law.is_none();
        let friction = match is_full {
            true => friction(samples, &curve, &dataset.train, dataset.track.as_ref()),
            false => Vec::new(),
        };
        let gradient_permille = level(&mut curve, samples, dataset);
        let moves = all[end..].iter().find(|it| it.speed_mps > STANDING_MPS);
        let dwell_s = moves.map(|it| 1e-9 * (it.time_ns - all[end].time_ns) as f64);
        let time_s = curve.points.last()?.time_s;
        let stop = RecordedStop {
            file: run.file.clone(),
            role: run.role,
            from_s: 1e-9 * samples[0].time_ns as f64,
            from_mps: curve.from_mps(),
            distance_m: curve.distance_m(),
            time_s,
            mean_deceleration_mps2: curve.from_mps() / time_s,
            dwell_s,
            gradient_permille,
            found_by: stop.found_by,
            manner: if is_full { Manner::Full } else { Manner::Modulated },
            has_slid,
            cut_off_s,
            no_law,
            decelerations: decelerations(&curve),
            predicted: None,
            friction,
        };
        Some((stop, curve))
    });
    studied.collect()
}

/// Takes the gradient, where every sample knows it, out of a stop's decelerations; its mean in ‰ along the travel.
fn level(curve: &mut DecelerationCurve, samples: &[TrainSample], dataset: &Dataset) -> Option<f64> {
    let train = &dataset.train;
    let at = |sample: &TrainSample| {
        let direction = f64::from(sample.direction);
        let on_track = || {
            let at = (sample.get(SampleField::Position)?, direction);
            gradient::along_travel_permille(dataset.track.as_deref()?, at, train.length_m, 0.0)
        };
        on_track().or_else(|| Some(direction * sample.get(SampleField::Gradient)?))
    };
    let permille: Vec<f64> = samples.iter().map(at).collect::<Option<_>>()?;
    let inertia = 1.0 + train.rotating_mass_factor;
    for (point, permille) in curve.points.iter_mut().zip(&permille) {
        point.deceleration_mps2 -= 1e-3 * GRAVITY_MPS2 * permille / inertia;
    }
    Some(permille.iter().sum::<f64>() / permille.len() as f64)
}

/// Returns why a stop shows no law of the brake; `full` is its part under all of the brake.
fn why_no_law(
    full: Option<&DecelerationCurve>,
    found_by: FoundBy,
    share_min: f64,
) -> Option<String> {
    let Some(curve) = full else {
        return Some(match found_by {
            FoundBy::Brake => {
                format!("the brake was not applied by {share_min} of its effort all the way")
            }
            FoundBy::Speed => "the speed did not keep falling: the brake was eased".into(),
        });
    };
    if curve.built_up.is_none() {
        return Some("the brake did not build up".into());
    }
    // A record of the brake says itself that it was not eased.
    let [most, eased] = curve.eased().filter(|_| found_by == FoundBy::Speed)?;
    Some(format!(
        "the brake was eased: {:.2} m/s² at {:.1} m/s, {:.2} at {:.1}",
        most.deceleration_mps2, most.speed_mps, eased.deceleration_mps2, eased.speed_mps
    ))
}

/// Returns the deceleration at whole m/s that the train passed.
fn decelerations(curve: &DecelerationCurve) -> Vec<DecelerationPoint> {
    let fastest = curve.from_mps().floor() as u32;
    let at = |k: u32| {
        let speed_mps = f64::from(k);
        Some(DecelerationPoint { speed_mps, ..*curve.at_speed(speed_mps)? })
    };
    (1..=fastest).rev().filter_map(at).collect()
}

fn cannot_tell(
    datasets: &[Dataset],
    found: &[RecordedStop],
    law: Option<&DecelerationLaw>,
) -> Vec<String> {
    let mut said = Vec::new();
    let blind = found.iter().filter(|it| it.gradient_permille.is_none()).count();
    if blind > 0 {
        said.push(format!(
            "the gradient is unknown in {blind} of {} stops, which count as level: 1 permille along a whole stop is \
             0.01 m/s² of its deceleration, and of its friction",
            found.len()
        ));
    }
    let runs = datasets.iter().flat_map(|dataset| &dataset.runs);
    let ends = runs
        .filter_map(|run| run.samples.iter().rev().find(|it| it.get(SampleField::Speed).is_some()));
    let moving = ends.filter(|it| it.speed_mps > STANDING_MPS).count();
    if moving > 0 {
        said.push(format!("how runs go on that end while the train moves: {moving}"));
    }
    let without = found.iter().filter(|it| it.no_law.is_some()).count();
    if without > 0 {
        said.push(format!(
            "the law of the brake in {without} of {} stops: how hard it was applied there is the driver's",
            found.len()
        ));
    }
    said.push("how friction divides into coefficient, pressure and ratio: only its course over speed is determined".into());
    if let Some(DecelerationLaw { stops: 1, .. }) = law {
        said.push(
            "how stops differ: one stop was recorded, and the repeatability is assumed".into(),
        );
    }
    if found.iter().any(|it| it.found_by == FoundBy::Speed) {
        said.push("how long the brake takes to build up: its command is not recorded".into());
    }
    said
}
