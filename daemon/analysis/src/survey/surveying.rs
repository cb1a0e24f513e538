//! The whole survey, step by step.

use super::alignment::{FoundCurve, LocalPlane, curves, turning_rad};
use super::banded::NotPositive;
use super::chainage::WheelsAndLag;
use super::driven_line::{Alignments, find, pass_of};
use super::learn::{LearnedProfile, acting_from_pa, learn};
use super::normal::{HeightLayout, LineCourse};
use super::observation::{BlockDifference, Prior, observations};
use super::profile::{Altitude, ProfileEvidence, is_one_of_few};
use super::recording::{RawRecording, RecordingPart, SurveyRecording, plane_of, recording_parts};
use super::trips::{NotUsed, SurveyedStop, Trip, not_used, stands, stops, trips};
use crate::parallel;
use crate::statistics::rms;

/// Lateral uncertainty in m of an alignment: the distance that the wheels roll differs from its length by this times
/// the turning.
const LATERAL_STD_M: f64 = 1.5;
/// Distance in m beyond an end of the line within which trains that start or stop there are used.
const ENDS_M: f64 = 60.0;
/// Distance in m between the altitudes that are used.
const ALTITUDE_STEP_M: f64 = 50.0;
/// Lengths in s of blocks that are tried.
const BLOCKS_S: [f64; 3] = [1.0, 2.0, 4.0];
/// Autocorrelation of the residuals below which they are noise of the speed: then the blocks are lengthened.
const ALTERNATING: f64 = -0.3;

/// Declared vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vehicle {
    /// Mass and resistance.
    pub prior: Prior,
    /// Length in m.
    pub length_m: f64,
    /// k in the declared curve resistance k/R in N/kN.
    pub curve_constant_n_per_kn_m: f64,
}

/// A line that was surveyed before.
#[derive(Clone, Debug, PartialEq)]
pub struct KnownLine {
    /// The plane of its alignments.
    pub plane: LocalPlane,
    /// Its alignments.
    pub alignments: Alignments,
}

/// Why nothing can be surveyed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SurveyError {
    /// No recording has positions.
    #[error("expected recordings with latitude and longitude, got no position by GNSS")]
    NoPositions,
    /// No fit run follows a line.
    #[error("expected fit runs along a line, got none: {what}")]
    NoLine {
        /// Value found instead.
        what: &'static str,
    },
    /// The forces show nothing.
    #[error("expected speeds and forces while moving, got none on the line")]
    NoForces,
    /// The balance has no solution.
    #[error("the balance of forces has no solution: {0}")]
    Balance(#[from] NotPositive),
}

/// Profile from the balance of forces.
#[derive(Clone, Debug)]
pub struct SurveyedProfile {
    /// The profile with the results of its estimation.
    pub learned: LearnedProfile,
    /// Curves of the growing alignment.
    pub curves: Vec<FoundCurve>,
    /// Numbers of the trips that took part, in the order of the passes.
    pub trips: Vec<usize>,
}

/// A surveyed line.
#[derive(Clone, Debug)]
pub struct Survey {
    /// The plane of the alignments.
    pub plane: LocalPlane,
    /// The alignments.
    pub alignments: Alignments,
    /// The trips, by recording and time.
    pub trips: Vec<Trip>,
    /// Parts that are not a trip.
    pub not_used: Vec<NotUsed>,
    /// The stops.
    pub stops: Vec<SurveyedStop>,
    /// Scale of the wheels and lag of the GNSS, from the GNSS itself.
    pub wheels: WheelsAndLag,
    /// Standard deviation of the wheels' scale with the uncertainty of the alignment's length.
    pub scale_std: f64,
    /// The profile; `None` on a line that was known.
    pub profile: Option<SurveyedProfile>,
}

/// Surveys a line, or maps recordings on a known one.
///
/// # Errors
///
/// When there are no positions, no line, or nothing to learn from.
pub fn survey(
    raws: &[RawRecording],
    vehicle: &Vehicle,
    known: Option<&KnownLine>,
) -> Result<Survey, SurveyError> {
    let plane = match known {
        Some(known) => known.plane,
        None => plane_of(raws).ok_or(SurveyError::NoPositions)?,
    };
    let recordings =
        parallel::of_each_number(raws.len(), |number| SurveyRecording::new(&raws[number], &plane));
    let cut = parallel::of_each_number(recordings.len(), |number| {
        recording_parts(number, &recordings[number])
    });
    let cut: Vec<RecordingPart> = cut.into_iter().flatten().collect();
    let mut alignments = match known {
        Some(known) => known.alignments.clone(),
        None => find(&cut, &recordings)
            .ok_or(SurveyError::NoLine { what: "no two passes follow the same way" })?,
    };
    let passes = parallel::of_each(&cut, |part| pass_of(&alignments, part, &recordings));
    let passes: Vec<_> = passes.into_iter().flatten().collect();
    let (trips, wheels) = trips(&passes, &alignments, &recordings);
    if trips.is_empty() {
        return Err(SurveyError::NoLine { what: "no recording runs along it" });
    }
    let scale_std = wheels.scale.std.hypot(length_std(&alignments));
    if known.is_none() && wheels.scale.value.abs() < 2.0 * scale_std {
        // As far as anybody can see the wheels are as declared, and a better measure of length.
        alignments.chainage_per_m = 1.0 / (1.0 + wheels.scale.value);
    }
    let profile = match known {
        Some(_) => None,
        None => Some(profile(&recordings, vehicle, &alignments, &trips, &wheels)?),
    };
    let not_used = not_used(&trips, &recordings);
    let stops = found_stops(&recordings, &alignments, &trips, known.is_some());
    Ok(Survey { plane, alignments, trips, not_used, stops, wheels, scale_std, profile })
}

/// Returns the standard deviation of an alignment's length as a share of it.
fn length_std(alignments: &Alignments) -> f64 {
    LATERAL_STD_M * turning_rad(&alignments.growing) / alignments.growing.length_m()
}

impl Survey {
    /// Returns the length in m of the line by its chainage, to the end of its last stop at least.
    pub fn length_m(&self) -> f64 {
        let ends_m = self.stops.iter().map(SurveyedStop::end_m);
        ends_m.fold(self.alignments.length_m(), f64::max)
    }
}

fn found_stops(
    recordings: &[SurveyRecording],
    alignments: &Alignments,
    trips: &[Trip],
    of_all: bool,
) -> Vec<SurveyedStop> {
    let mut found = Vec::new();
    for direction in [1, -1] {
        let own = trips.iter().filter(|it| it.direction == direction && (of_all || it.is_fit));
        let passes: Vec<Vec<f64>> = own
            .map(|trip| {
                let chainage_m: Vec<f64> = trip
                    .along
                    .chainage_m
                    .iter()
                    .map(|&along_m| alignments.chainage_m(direction, along_m))
                    .collect();
                stands(recordings[trip.recording].raw, trip.along.first_row, &chainage_m)
            })
            .collect();
        found.extend(stops(direction, &passes));
    }
    found
}

/// Returns the profile from the fit trips.
fn profile(
    recordings: &[SurveyRecording],
    vehicle: &Vehicle,
    alignments: &Alignments,
    trips: &[Trip],
    wheels: &WheelsAndLag,
) -> Result<SurveyedProfile, SurveyError> {
    let fit: Vec<usize> = (0..trips.len()).filter(|&number| trips[number].is_fit).collect();
    if fit.is_empty() {
        return Err(SurveyError::NoLine { what: "the fit runs do not follow it" });
    }
    let mut lengths_m = vec![alignments.growing.length_m()];
    if let Some(falling) = alignments.falling.as_ref().filter(|it| !it.is_same) {
        lengths_m.push(falling.alignment.length_m());
    }
    let layout = HeightLayout::new(&lengths_m, vehicle.length_m);
    let course = |&number: &usize| course(trips[number].direction, alignments);
    let courses: Vec<LineCourse> = fit.iter().map(course).collect();
    // Where each direction has an alignment of its own, its profile holds the curves' resistance too.
    let curves = if alignments.is_one_track() { curves(&alignments.growing) } else { Vec::new() };
    // True over recorded speed, when the chainage is GNSS's; else the wheels are believed.
    let speed_factor =
        if alignments.chainage_per_m == 1.0 { 1.0 + wheels.scale.value } else { 1.0 };
    let altitudes = fit.iter().zip(&courses).flat_map(|(&number, &course)| {
        altitudes(&trips[number], &recordings[trips[number].recording], course)
    });
    let mut evidence = ProfileEvidence {
        layout,
        courses: courses.clone(),
        observations: Vec::new(),
        altitudes: altitudes.collect(),
        prior: vehicle.prior,
    };
    let released_pa = acting_from_pa(recordings.iter().map(|it| it.raw).filter(|raw| raw.is_fit));
    let observe = |block_s: f64, of: &(dyn Fn(usize) -> bool + Sync)| {
        let of_pass = |(pass, &number): (usize, &usize)| {
            let trip = &trips[number];
            let raw = recordings[trip.recording].raw;
            let seen = observations(raw, &trip.along, pass as u32, block_s, speed_factor);
            let limit_m =
                alignments.of(trip.direction).map_or(0.0, |alignment| alignment.length_m());
            let on_line = |mut it: BlockDifference| {
                let at_m = courses[pass].in_block(it.along_m);
                let k = vehicle.curve_constant_n_per_kn_m;
                it.curve_n_per_kn = k * curvature(curves.iter(), at_m, vehicle.length_m);
                (-ENDS_M..=limit_m + ENDS_M).contains(&it.along_m).then_some(it)
            };
            seen.into_iter().filter_map(on_line).collect::<Vec<BlockDifference>>()
        };
        let passes: Vec<_> = fit.iter().enumerate().filter(|(pass, _)| of(*pass)).collect();
        let observations = parallel::of_each(&passes, |pass| of_pass(*pass));
        observations.into_iter().flatten().collect::<Vec<BlockDifference>>()
    };
    let of_few = |block_s: f64| observe(block_s, &|pass| is_one_of_few(pass, fit.len()));
    let block_s = shortest_block_s(&mut evidence, of_few)?;
    evidence.observations = observe(block_s, &|_| true);
    if evidence.observations.is_empty() {
        return Err(SurveyError::NoForces);
    }
    let speeds_mps: Vec<f64> = evidence.observations.iter().map(|it| it.speed_mps).collect();
    evidence.prior.speed_mps = rms(&speeds_mps);
    let learned = learn(&mut evidence, released_pa)?;
    Ok(SurveyedProfile { learned, curves, trips: fit })
}

/// Returns the length in s of the shortest blocks of which residuals do not alternate.
fn shortest_block_s(
    evidence: &mut ProfileEvidence,
    observed: impl Fn(f64) -> Vec<BlockDifference>,
) -> Result<f64, NotPositive> {
    let [shorter @ .., longest_s] = BLOCKS_S;
    for block_s in shorter {
        evidence.observations = observed(block_s);
        if evidence.observations.is_empty() {
            break;
        }
        let rough = evidence.of_few_passes().fit(1e-6, &|_| true, false)?;
        if rough.autocorrelation > ALTERNATING {
            return Ok(block_s);
        }
    }
    Ok(longest_s)
}

/// Returns where a direction lies in the profile.
fn course(direction: i8, alignments: &Alignments) -> LineCourse {
    match (direction, alignments.is_one_track()) {
        (1, _) => LineCourse { block: 0, against_from_m: None },
        (_, true) => LineCourse { block: 0, against_from_m: Some(alignments.growing.length_m()) },
        (_, false) => LineCourse { block: 1, against_from_m: None },
    }
}

/// Returns the mean curvature in 1/m along a vehicle.
fn curvature<'c>(curves: impl Iterator<Item = &'c FoundCurve>, at_m: f64, vehicle_m: f64) -> f64 {
    let (rear, front) = (at_m - 0.5 * vehicle_m, at_m + 0.5 * vehicle_m);
    let inside = |curve: &FoundCurve| {
        (front.min(curve.to_m) - rear.max(curve.from_m)).max(0.0) / (vehicle_m * curve.radius_m)
    };
    curves.map(inside).sum()
}

fn altitudes(trip: &Trip, recording: &SurveyRecording, course: LineCourse) -> Vec<Altitude> {
    let raw = recording.raw;
    let mut found: Vec<Altitude> = Vec::new();
    let rows = trip.rows();
    for fix in recording.fixes.iter().filter(|fix| rows.contains(&fix.row)) {
        let along_m = trip.along.chainage_m[fix.row - rows.start];
        let altitude_m = raw.altitude_m.get(fix.row).copied().unwrap_or(f64::NAN);
        let is_new = found.last().is_none_or(|last| along_m - last.along_m >= ALTITUDE_STEP_M);
        if altitude_m.is_finite() && is_new {
            found.push(Altitude { course, along_m, altitude_m });
        }
    }
    found
}
