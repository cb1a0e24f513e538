//! From raw recordings to a dataset of trips on a surveyed line: reading, surveying or mapping, writing; and the result
//! for machines.
//!
//! - [`read`]: a dataset's runs as recordings; a line that was surveyed before
//! - [`write`](mod@write): the dataset folder with its trips

pub mod read;
pub mod write;

use std::path::{Path, PathBuf};

use dynocar::dataset::DatasetSource;
use dynocar_analysis::dataset::Dataset;
use dynocar_analysis::explain::answer::WithStd;
use dynocar_analysis::statistics::middle;
use dynocar_analysis::survey::trips::SurveyedStop;
use dynocar_analysis::survey::{NotUsed, Survey, Trip, Vehicle, survey};
use read::{Material, rows_in_order};
use serde::Serialize;
use write::{gradient_entries, late_s, trip_file, write};

use crate::dataset::load;

pub use read::SurveyFailure;

/// Distance in m below which a stop takes the name of a stop of the known line.
const SAME_STOP_M: f64 = 25.0;

/// A survey that was made and written.
pub struct Surveyed {
    /// The raw recordings.
    pub raw: Dataset,
    /// Findings of the survey.
    pub survey: Survey,
    /// The same for machines.
    pub answer: SurveyAnswer,
    /// The files of the dataset of trips.
    pub files: Vec<PathBuf>,
}

/// Surveys the raw recordings of a folder, or maps them on a line surveyed before, and writes the
/// dataset of trips.
///
/// # Errors
///
/// When the recordings or the line cannot be read, hold no line, or a file cannot be written.
pub fn survey_folder<'s>(
    source: impl Into<DatasetSource<'s>>,
    line: Option<&Path>,
    out: &Path,
) -> Result<Surveyed, SurveyFailure> {
    let source = source.into();
    let raw = load(source)?;
    let known = line.map(read::known_line).transpose()?;
    let (recordings, vehicle) = (read::recordings(&raw), read::vehicle(&raw));
    let mut survey = survey(&recordings, &vehicle, known.as_ref().map(|(known, _)| known))?;
    if let Some((_, track)) = &known {
        name_stops(&mut survey.stops, &track.survey.stops);
    }
    let material = Material { source, dataset: &raw, vehicle: &vehicle, survey: &survey, line };
    let files = write(&material, out)?;
    let answer = SurveyAnswer::new(&raw, &vehicle, &survey);
    Ok(Surveyed { raw, survey, answer, files })
}

/// Stops of a known line keep their names.
fn name_stops(stops: &mut [SurveyedStop], known: &[(f64, String)]) {
    for stop in stops {
        let away = |known: &&(f64, String)| (known.0 - stop.chainage_m).abs();
        let nearest = known.iter().min_by(|one, other| away(one).total_cmp(&away(other)));
        if let Some(nearest) = nearest.filter(|nearest| away(nearest) < SAME_STOP_M) {
            stop.name.clone_from(&nearest.1);
        }
    }
}

/// All findings of a survey.
#[derive(Debug, Serialize)]
pub struct SurveyAnswer {
    /// The line.
    pub line: SurveyedLine,
    /// The trips, in the order of the written dataset.
    pub trips: Vec<TripAnswer>,
    /// Parts that are not a trip.
    pub not_used: Vec<NotUsed>,
    /// Values learned jointly with the line; absent on a known line.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub learned: Option<LearnedAnswer>,
    /// Quantities that these recordings do not determine.
    pub cannot_tell: Vec<String>,
}

/// A line.
#[derive(Debug, Serialize)]
pub struct SurveyedLine {
    /// Length in m.
    pub length_m: f64,
    /// Its stops.
    pub stops: Vec<SurveyedStop>,
    /// Median standard deviation in ‰ of the mean gradient over 100 m; absent on a known line.
    pub gradient_std_permille: Option<f64>,
    /// Passes that it was learned from.
    pub passes: usize,
    /// True when both directions take the same way.
    pub is_one_way_for_both: bool,
}

/// A trip.
#[derive(Debug, Serialize)]
pub struct TripAnswer {
    /// Its file in the written dataset.
    pub file: String,
    /// The recording.
    pub source: String,
    /// `fit` or `holdout`.
    pub role: &'static str,
    /// 1 while the chainage grows, -1 while it falls.
    pub direction: i8,
    /// Time in s of its first row in the recording's own count.
    pub from_s: f64,
    /// Time in s of its last row.
    pub to_s: f64,
    /// Length in m.
    pub length_m: f64,
    /// Residual in N when the profile is learned without it; absent where that cannot be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_out_residual_n: Option<f64>,
}

/// Values learned of the vehicle and its recorder.
#[derive(Debug, Serialize)]
pub struct LearnedAnswer {
    /// Nominal or empty mass in t, without rotating parts.
    pub mass_t: WithStd,
    /// The same with rotating parts, which the balance of forces shows.
    pub inertial_mass_t: WithStd,
    /// Mass of a passenger in kg, where they are counted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub passenger_mass_kg: Option<WithStd>,
    /// a, b, c in N/kN.
    pub resistance: [WithStd; 3],
    /// Recorded over true speed.
    pub speed_scale: WithStd,
    /// Seconds by which forces are stamped late; negative where they act late.
    pub force_late_s: WithStd,
    /// Seconds by which the written forces were moved.
    pub force_moved_s: f64,
    /// Age of a position at its stamp in s.
    pub position_late_s: WithStd,
    /// Friction brake in N/Pa, where it shows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub friction_brake_n_per_pa: Option<WithStd>,
    /// Pressure in Pa from which on it acts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub release_pressure_pa: Option<f64>,
    /// Variance per m of the gradient's random walk, chosen by leaving passes out.
    pub gradient_walk_per_m: f64,
    /// Scale of the residuals in N.
    pub residual_n: f64,
}

impl SurveyAnswer {
    /// Returns the answer to a survey.
    pub fn new(dataset: &Dataset, vehicle: &Vehicle, survey: &Survey) -> Self {
        let left_out = |number: usize| {
            let profile = survey.profile.as_ref()?;
            let pass = profile.trips.iter().position(|trip| *trip == number)?;
            Some(profile.learned.left_out_n[pass]).filter(|value| value.is_finite())
        };
        let trip = |(number, trip): (usize, &Trip)| {
            let run = &dataset.runs[trip.recording];
            let rows = rows_in_order(run);
            let time_s = |row: usize| run.samples[rows[row]].time_ns as f64 * 1e-9;
            TripAnswer {
                file: trip_file(number),
                source: run.file.clone(),
                role: run.role.name(),
                direction: trip.direction,
                from_s: time_s(trip.rows().start),
                to_s: time_s(trip.rows().end - 1),
                length_m: survey.alignments.chainage_per_m * trip.length_m(),
                left_out_residual_n: left_out(number),
            }
        };
        SurveyAnswer {
            line: SurveyedLine::from_survey(survey),
            trips: survey.trips.iter().enumerate().map(trip).collect(),
            not_used: survey.not_used.clone(),
            learned: LearnedAnswer::new(vehicle, survey),
            cannot_tell: cannot_tell(survey),
        }
    }
}

impl SurveyedLine {
    fn from_survey(survey: &Survey) -> Self {
        let median = survey.profile.as_ref().and_then(|profile| {
            let entries = gradient_entries(survey, profile, 1);
            middle(&mut entries.iter().map(|entry| entry.std_permille).collect::<Vec<f64>>())
        });
        SurveyedLine {
            length_m: survey.length_m(),
            stops: survey.stops.clone(),
            gradient_std_permille: median,
            passes: survey.profile.as_ref().map_or(0, |profile| profile.trips.len()),
            is_one_way_for_both: survey.alignments.is_one_track(),
        }
    }
}

/// A learned value for people.
pub struct LearnedRow {
    /// Name on a terminal; empty where it does not show the value.
    pub short: &'static str,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
    /// Name and unit in all words.
    pub long: &'static str,
    /// The value.
    pub value: WithStd,
}

impl LearnedAnswer {
    /// Returns the learned values for people.
    pub fn rows(&self) -> Vec<LearnedRow> {
        let [a, b, c] = self.resistance.map(Some);
        let rows = [
            ("mass", "t", "mass, t", Some(self.mass_t)),
            ("with rotating parts", "t", "mass with rotating parts, t", Some(self.inertial_mass_t)),
            ("passenger", "kg", "mass of a passenger, kg", self.passenger_mass_kg),
            ("", "", "a, N/kN", a),
            ("", "", "b, N/kN per m/s", b),
            ("", "", "c, N/kN per (m/s)²", c),
            ("recorded / true speed", "", "recorded over true speed", Some(self.speed_scale)),
            ("forces stamped late", "s", "forces stamped late, s", Some(self.force_late_s)),
            ("positions late", "s", "positions late, s", Some(self.position_late_s)),
            ("friction brake", "N/Pa", "friction brake, N/Pa", self.friction_brake_n_per_pa),
        ];
        let known =
            |(short, unit, long, value)| Some(LearnedRow { short, unit, long, value: value? });
        rows.into_iter().filter_map(known).collect()
    }

    fn new(vehicle: &Vehicle, survey: &Survey) -> Option<Self> {
        let profile = survey.profile.as_ref()?;
        let (fitted, brake) = (&profile.learned.profile, profile.learned.brake.as_ref());
        let (common, std, prior) = (&fitted.common, &fitted.common_std, &vehicle.prior);
        let estimate = |value: f64, std: f64| WithStd { value, std };
        let mass = |factor: f64| {
            let value = factor * (prior.mass_kg / 1e3 * (1.0 + common.mass_share()));
            estimate(value, factor * (prior.mass_kg / 1e3 * std.mass_share()))
        };
        let (davis, davis_std) = (common.davis(), std.davis());
        Some(LearnedAnswer {
            mass_t: mass(1.0),
            inertial_mass_t: mass(1.0 + prior.rotating_mass_factor),
            passenger_mass_kg: prior
                .has_passengers
                .then(|| estimate(common.passenger_kg(), std.passenger_kg())),
            resistance: std::array::from_fn(|power| estimate(davis[power], davis_std[power])),
            speed_scale: estimate(1.0 / (1.0 + survey.wheels.scale.value), survey.scale_std),
            force_late_s: estimate(common.delay_s(), std.delay_s()),
            force_moved_s: late_s(survey),
            position_late_s: survey.wheels.lag_s,
            friction_brake_n_per_pa: brake.map(|brake| brake.gain_n_per_pa),
            release_pressure_pa: brake.map(|brake| brake.release_pa),
            gradient_walk_per_m: profile.learned.walk_per_m,
            residual_n: fitted.residual_n,
        })
    }
}

/// Returns the quantities that recordings of this kind leave open.
fn cannot_tell(survey: &Survey) -> Vec<String> {
    let Some(profile) = &survey.profile else { return Vec::new() };
    let mut open = vec![
        "the scale of the forces against the mass: both scale alike, gravity too",
        "the rotating mass: it stays as declared until a line is surveyed from outside",
    ];
    let is_driven =
        |direction: i8| profile.trips.iter().any(|trip| survey.trips[*trip].direction == direction);
    if !is_driven(1) || !is_driven(-1) || !survey.alignments.is_one_track() {
        open.push(
            "a mean gradient against a constant resistance: no place is driven in both \
             directions, so that only GNSS altitude and what is declared part them; curves and \
             tunnels are held by the gradient",
        );
    }
    if profile.trips.len() < 2 {
        open.push(
            "how well the profile repeats: one pass cannot be left out and predicted by others",
        );
    }
    open.into_iter().map(Into::into).collect()
}
