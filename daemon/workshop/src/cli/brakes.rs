//! `dynocar brakes`: the brake parameters that train protection needs, from recorded stops.

use std::path::{Path, PathBuf};

use clap::Args;
use dynocar_analysis::brakes::{
    BrakeParameters, Correction, DeclaredBrakeFigures, EtcsBrake, HEAD, SpeedSteps, TableLaw,
    corrections, lower_bound, parse, usual, wet_share, write,
};
use dynocar_analysis::dataset::{Dataset, Role};
use dynocar_analysis::parallel::of_each;
use dynocar_analysis::stops::{CutOff, DecelerationLaw, FoundBy, Gradient, Manner, Study};

use super::stops::{StudyArguments, no_stop, share, table};
use crate::brakes_page::{self, BrakesAnswer, K_DRY};
use crate::dataset;
use crate::report::PAGE_MARK;
use crate::report::html::TableColumns;
use crate::report::provenance::{Provenance, own_command_line};
use crate::run_facts::impossible;
use dynocar::cli::Failure;
use dynocar::cli::text::{TextTable, entry};
use dynocar::dataset::labelled_text;
use dynocar::output::{give, report_line, require_files, write_file, write_json};

/// Estimate a brake's ETCS parameters and stopping distances from recorded stops.
///
/// An estimate from data, and no safety case.
#[derive(Debug, Args)]
pub struct BrakesArguments {
    /// Folders of datasets with stops by all of the brake, of one train on dry rails
    #[arg(required_unless_present = "table")]
    datasets: Vec<PathBuf>,
    /// A dataset with full service stops
    #[arg(long, value_name = "DATASET")]
    service: Vec<PathBuf>,
    /// A dataset with stops on wet rails
    #[arg(long, value_name = "DATASET")]
    wet: Vec<PathBuf>,
    /// Write the parameters as OSRD's etcs_brake_params
    #[arg(long, value_name = "FILE")]
    etcs: Option<PathBuf>,
    /// Level of confidence of Kdry_rst in that file; without, the highest that is supported
    #[arg(long, value_name = "0-9", value_parser = clap::value_parser!(u32).range(0..=9))]
    ebcl: Option<u32>,
    /// Kwet_rst in that file where no wet stops are recorded
    #[arg(long, value_name = "SHARE", value_parser = share)]
    k_wet: Option<f64>,
    /// Confidence that the mean deceleration lies above the steps
    #[arg(long, value_name = "SHARE", default_value = "0.95", value_parser = confidence)]
    confidence: f64,
    /// Take the declared resistance out of the decelerations
    #[arg(long)]
    without_resistance: bool,
    /// Write the distances that 95 % of stops keep, over speed and gradient, as CSV
    #[arg(long, value_name = "FILE")]
    distances: Option<PathBuf>,
    /// Read a table of stopping distances instead, and report the brake behind it
    #[arg(long, value_name = "FILE", conflicts_with = "datasets")]
    table: Option<PathBuf>,
    #[command(flatten)]
    study: StudyArguments,
    /// Write a report for people: one HTML page that needs nothing else
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Write the result for machines; - for standard output
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
}

/// Estimates the parameters and prints them.
///
/// # Errors
///
/// A wrong dataset or table is an input failure; so are datasets without a stop by all of the brake.
pub fn execute(arguments: &BrakesArguments) -> Result<(), Failure> {
    let files = [(&arguments.json, "{"), (&arguments.etcs, "{"), (&arguments.distances, HEAD)];
    require_files(&files)?;
    require_files(&[(&arguments.report, PAGE_MARK)])?;
    if let Some(file) = &arguments.table {
        return tables(file, arguments.json.as_deref());
    }
    let (datasets, study) = studied(&arguments.datasets, arguments)?;
    if study.stops.is_empty() {
        return Err(no_stop(&arguments.datasets[0]));
    }
    let Some(law) = &study.law else { return Err(without_law(&study)) };
    let answer = answer(arguments, &datasets, &study, law)?;
    if let Some(file) = &arguments.etcs {
        let is_reached = |it: &Correction| Some(it.ebcl) == answer.ebcl && it.k_dry().is_some();
        if let Some(ebcl) = arguments.ebcl
            && !answer.parameters.k_dry.iter().any(is_reached)
        {
            return Err(Failure::Input(format!(
                "--ebcl {ebcl}: {} stops support no such level, and no [brake] units are declared",
                law.stops
            )));
        }
        write_json(file, &answer.etcs)?;
        report_line(&format!("etcs_brake_params: {}", file.display()));
    }
    if let Some(file) = &arguments.distances {
        let gamma = datasets[0].train.rotating_mass_factor;
        write_file(file, &write(&datasets[0].train.name, law, gamma))?;
        report_line(&format!("distances: {}", file.display()));
    }
    if let Some(file) = &arguments.report {
        let made =
            Provenance::new(&arguments.datasets[0], own_command_line()).map_err(Failure::input)?;
        write_file(file, &brakes_page::html(&answer, &made))?;
        report_line(&format!("report: {}", file.display()));
    }
    let gamma = datasets[0].train.rotating_mass_factor;
    Ok(give(arguments.json.as_deref(), &answer, || text(&answer, gamma))?)
}

/// Returns a confidence below certainty, which no number of stops gives.
fn confidence(text: &str) -> Result<f64, String> {
    let share = share(text)?;
    (share < 1.0).then_some(share).ok_or_else(|| "expected a share above 0 and below 1".into())
}

fn studied(
    paths: &[PathBuf],
    arguments: &BrakesArguments,
) -> Result<(Vec<Dataset>, Study), Failure> {
    let datasets: Vec<Dataset> = paths.iter().map(dataset::load).collect::<Result<_, _>>()?;
    if let Some(why) = datasets.iter().find_map(impossible) {
        return Err(Failure::Input(why));
    }
    let mut study = Study::of_all(&datasets, &arguments.study.settings(), &[]);
    if let (true, Some(law)) = (arguments.without_resistance, &mut study.law) {
        let train = &datasets[0].train;
        law.take_out(|speed_mps| {
            1e-3 * dynocar_shared::resistance::GRAVITY_MPS2
                * train.resistance.w0_n_per_kn(speed_mps)
                / (1.0 + train.rotating_mass_factor)
        });
    }
    Ok((datasets, study))
}

/// Returns the reasons why there are no parameters, and the remaining possibilities.
fn without_law(study: &Study) -> Failure {
    let mut words =
        format!("none of {} stops to fit is one by all of the brake", study.stops.len());
    let reasons = study.stops.iter().filter_map(|it| Some((it, it.no_law.as_ref()?)));
    for (stop, why) in reasons.take(5) {
        words += &format!("; {} at {:.0} s: {why}", stop.file, stop.from_s);
    }
    words += "; `dynocar stops` reports what they hold, --applied lowers what counts as all";
    Failure::Input(words)
}

fn answer(
    arguments: &BrakesArguments,
    datasets: &[Dataset],
    study: &Study,
    law: &DecelerationLaw,
) -> Result<BrakesAnswer, Failure> {
    let steps = |law: &DecelerationLaw| SpeedSteps::below(&lower_bound(law, arguments.confidence));
    let weak = || Failure::Input("the stops differ so much that no deceleration is certain".into());
    let other = |paths: &[PathBuf], what: &str| match paths {
        [] => Ok(None),
        paths => match studied(paths, arguments)?.1.law {
            Some(law) => Ok(Some(law)),
            None => Err(Failure::Input(format!("--{what}: no stop by a brake that was not eased"))),
        },
    };
    let (service, wet) = (other(&arguments.service, "service")?, other(&arguments.wet, "wet")?);
    let train = &datasets[0].train;
    let of_law = study.stops.iter().filter(|it| it.manner == Manner::Full && it.role == Role::Fit);
    let (normal_service, usual_stops) = usual(&study.stops);
    let build_up_s = |law: &DecelerationLaw| law.response.dead_time_s + law.response.build_up_s;
    let parameters = BrakeParameters {
        stops: law.stops,
        is_commanded: of_law.clone().all(|it| it.found_by == FoundBy::Brake),
        emergency: steps(law).ok_or_else(weak)?,
        service: service.as_ref().and_then(steps),
        normal_service,
        usual_stops,
        bound: lower_bound(law, arguments.confidence),
        build_up_s: build_up_s(law),
        service_build_up_s: service.as_ref().map(build_up_s),
        cut_off: CutOff::from_times(of_law.filter_map(|it| it.cut_off_s)),
        k_dry: corrections(law, train.brake_gear.components.as_ref()),
        k_wet: wet.as_ref().and_then(|wet| wet_share(law, wet)),
    };
    let supported = parameters.k_dry.iter().rev().find(|it| it.k_dry().is_some());
    let ebcl = arguments.ebcl.or(supported.map(|it| it.ebcl));
    let (etcs, rests_on) =
        EtcsBrake::new(&parameters, &DeclaredBrakeFigures { ebcl, k_wet: arguments.k_wet });
    let said = said(arguments, study, law, &parameters);
    Ok(BrakesAnswer {
        datasets: datasets.iter().map(|it| it.name.clone()).collect(),
        stops: [law.stops, study.stops.len()],
        law: law.clone(),
        parameters,
        etcs,
        rests_on,
        ebcl,
        said,
    })
}

fn said(
    arguments: &BrakesArguments,
    study: &Study,
    law: &DecelerationLaw,
    parameters: &BrakeParameters,
) -> Vec<String> {
    let mut said = vec![
        "an estimate from data, and no safety case: a certifier still needs the brake's design, its \
         failures, the state of wear, load and adhesion over the fleet, and tests by EN 17997-1"
            .into(),
        format!(
            "decelerations are those of the train on the level where the gradient is known, for its \
             rotating mass, with its resistance {}",
            if arguments.without_resistance { "taken out as declared" } else { "in them" }
        ),
        format!(
            "the mean deceleration lies above the steps with {:.0} % confidence; {}",
            100.0 * arguments.confidence,
            match law.stops {
                1 => "one stop shows Kdry_rst for no confidence level".into(),
                stops => format!("{stops} stops show Kdry_rst to one in {stops} and no further"),
            }
        ),
    ];
    said.push(format!("nothing is said of speeds above {:.1} m/s", law.fastest_mps()));
    let mut unless = |is_there: bool, words: &str| {
        if !is_there {
            said.push(words.into());
        }
    };
    let is_modelled = parameters.k_dry.iter().any(|it| it.modelled.is_some());
    unless(
        is_modelled,
        "beyond that only a model of components speaks (declare [brake] units and how they differ and fail)",
    );
    let is_shown = law.response.dead_time_s + law.response.build_up_s > 0.0;
    unless(is_shown, "T_brake_build_up is not shown");
    let is_weaker = |steps: &Option<SpeedSteps>| {
        let fastest = law.fastest_mps();
        steps
            .as_ref()
            .is_none_or(|it| it.distance_m(fastest) >= parameters.emergency.distance_m(fastest))
    };
    unless(
        is_weaker(&parameters.normal_service) && is_weaker(&parameters.service),
        "a service brake stops sooner than the emergency brake: other rails, loads, or not all of the brake?",
    );
    said.extend(study.cannot_tell.iter().cloned());
    said
}

fn steps_text(name: &str, steps: &SpeedSteps) -> String {
    let starts = std::iter::once(&0.0).chain(&steps.boundaries);
    let parts =
        starts.zip(&steps.values).map(|(from, value)| format!("{value:.3} from {from:.1} m/s"));
    entry("  ", &format!("{name}: {}", parts.collect::<Vec<_>>().join(", ")))
}

fn text(answer: &BrakesAnswer, gamma: f64) -> String {
    let (parameters, law) = (&answer.parameters, &answer.law);
    let mut text = format!(
        "{}: {} of {} stops are by all of the brake\n\n{}\nsteps in m/s², each below the curve\n{}",
        answer.datasets.join(", "),
        answer.stops[0],
        answer.stops[1],
        picture(parameters, law),
        steps_text("A_brake_emergency", &parameters.emergency)
    );
    let others = [
        ("A_brake_service", &parameters.service),
        ("A_brake_normal_service", &parameters.normal_service),
        ("Kwet_rst", &parameters.k_wet),
    ];
    for (name, steps) in others {
        text += &steps.as_ref().map_or(String::new(), |it| steps_text(name, it));
    }
    text += &format!(
        "  T_brake_build_up: {:.2} s ({:.2} s, then increase over {:.2} s)\n{}\nhow far stops fall short of \
         the mean\n{}",
        parameters.build_up_s,
        law.response.dead_time_s,
        law.response.build_up_s,
        parameters.cut_off.map_or(String::new(), |it| format!(
            "  T_traction_cut_off: {:.2} s (of {} stops, {:.2} to {:.2} s)\n",
            it.greatest_s, it.stops, it.least_s, it.greatest_s
        )),
        table(K_DRY, &[], parameters.k_dry.iter())
    );
    text += &format!(
        "\nstopping distance in m (and what 95 % of stops keep)\n{}\n",
        distances(law, gamma)
    );
    text += "what each value of the file (--etcs) rests on\n";
    for it in &answer.rests_on {
        let guess = if it.is_guess { " (a guess)" } else { "" };
        text += &entry("  ", &format!("{}{guess}: {}", it.key, it.rests_on));
    }
    text += "\n";
    for line in &answer.said {
        text += &entry("  ", line);
    }
    text
}

/// Returns the deceleration over speed: the steps, the bound, and the mean.
fn picture(parameters: &BrakeParameters, law: &DecelerationLaw) -> String {
    const WIDTH: f64 = 56.0;
    let most = law.points.iter().map(|it| it.deceleration_mps2).fold(0.1, f64::max);
    let place = |value: f64| (WIDTH * value / most).round() as usize;
    let mut text =
        format!("deceleration up to {most:.2} m/s²: # steps, - to the bound, + to the mean\n");
    let step = (law.points.len() / 14).max(1);
    for (point, bound) in law.points.iter().zip(&parameters.bound).rev().step_by(step) {
        let ends = [parameters.emergency.at(point.speed_mps), bound[1], point.deceleration_mps2]
            .map(place);
        let mut line = "#".repeat(ends[0]);
        line += &"-".repeat(ends[1].saturating_sub(ends[0]));
        line += &"+".repeat(ends[2].saturating_sub(ends[1].max(ends[0])));
        text += &format!("  {:>4.0} m/s {line}\n", point.speed_mps);
    }
    text
}

fn distances(law: &DecelerationLaw, rotating_mass_factor: f64) -> TextTable {
    const PERMILLE: [f64; 5] = [-20.0, -10.0, 0.0, 10.0, 20.0];
    let mut head = vec!["from m/s".to_string()];
    head.extend(PERMILLE.map(|it| format!("{it:+.0} ‰")));
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let mut table = TextTable::new(&head, &[]);
    for speed in (1..).map(|k| 5.0 * f64::from(k)).take_while(|it| *it <= law.fastest_mps() + 0.5) {
        let mut row = vec![format!("{speed:.0}")];
        row.extend(PERMILLE.map(|permille| {
            let found = law.stopping_distance(speed, &Gradient { permille, rotating_mass_factor });
            found.map_or("-".into(), |it| {
                format!("{:.0} ({:.0})", it.distance_m, it.distance_bound_m)
            })
        }));
        table.push(row);
    }
    table
}

const TABLES: TableColumns<TableLaw> = &[
    ("brake", |it| it.name.clone()),
    ("rows", |it| it.rows.to_string()),
    ("cut off s", |it| format!("{:.2}", it.traction_cut_off_s)),
    ("build-up s", |it| format!("{:.1}", it.build_up_s)),
    ("gamma", |it| format!("{:.3}", it.rotating_mass_factor)),
    ("m/s² (m/s)", |it| {
        let shown = it.decelerations.iter().step_by(2);
        shown.map(|[speed, value]| format!("{value:.2} ({speed:.0})")).collect::<Vec<_>>().join(" ")
    }),
    ("median %", |it| format!("{:.2}", 100.0 * it.error_median)),
    ("95 % %", |it| format!("{:.1}", 100.0 * it.error_95)),
    ("worst %", |it| format!("{:.1}", 100.0 * it.error_max)),
];

/// The brakes behind the tables of a file.
fn tables(file: &Path, json: Option<&Path>) -> Result<(), Failure> {
    let (label, text) = labelled_text(file).map_err(Failure::input)?;
    let tables = parse(&text).map_err(|words| Failure::Input(format!("{label}: {words}")))?;
    let laws = of_each(&tables, |(name, rows)| TableLaw::new(name, rows));
    let none = || Failure::Input(format!("{label}: no brake stops as these rows say"));
    let laws: Vec<TableLaw> = laws.into_iter().collect::<Option<_>>().ok_or_else(none)?;
    Ok(give(json, &laws, || {
        format!(
            "brakes that stop as {label} says: speed held until traction is cut off, then a linear build-up\n{}",
            table(TABLES, &[0], laws.iter())
        )
    })?)
}
