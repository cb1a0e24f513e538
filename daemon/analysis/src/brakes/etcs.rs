//! The parameters in the form of OSRD's `etcs_brake_params`, written and read.

use std::ops::RangeInclusive;

use serde::Serialize;

use super::parameters::{BrakeParameters, Correction, SpeedSteps};
use crate::dataset::DatasetError;
use crate::dataset::document::Item;

/// `etcs_brake_params` of OSRD's rolling stock.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EtcsBrake {
    /// A_brake_emergency in m/s².
    pub gamma_emergency: SpeedSteps,
    /// A_brake_service in m/s².
    pub gamma_service: SpeedSteps,
    /// A_brake_normal_service in m/s².
    pub gamma_normal_service: SpeedSteps,
    /// Kdry_rst.
    pub k_dry: SpeedSteps,
    /// Kwet_rst.
    pub k_wet: SpeedSteps,
    /// Kn+ in m/s².
    pub k_n_pos: SpeedSteps,
    /// Kn- in m/s².
    pub k_n_neg: SpeedSteps,
    /// T_traction_cut_off in s.
    pub t_traction_cut_off: f64,
    /// Build-up in s of the service brake, for the first service brake intervention.
    pub t_bs1: f64,
    /// Build-up in s of the service brake, for the second.
    pub t_bs2: f64,
    /// Build-up in s of the emergency brake.
    pub t_be: f64,
}

/// Source of a value of the form.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Basis {
    /// The value's key in the form.
    pub key: &'static str,
    /// The stops, declarations or assumptions behind it.
    pub rests_on: String,
    /// Whether no measurement or declaration stands behind it.
    pub is_guess: bool,
}

/// Declared figures that are used in addition to the stops.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DeclaredBrakeFigures {
    /// Level of confidence of Kdry_rst; `None` where none is supported.
    pub ebcl: Option<u32>,
    /// Kwet_rst where no wet stops are recorded.
    pub k_wet: Option<f64>,
}

impl EtcsBrake {
    /// Returns the parameters, and the basis of each. The form requires all of them, and factors at the boundaries of
    /// the emergency steps: an unknown parameter is replaced, and marked as a guess.
    pub fn new(found: &BrakeParameters, choice: &DeclaredBrakeFigures) -> (Self, Vec<Basis>) {
        let emergency = &found.emergency;
        let over = |value: f64| SpeedSteps::constant(value).between(&emergency.boundaries);
        let normal = found.normal_service.as_ref();
        let service = found.service.as_ref().or(normal).unwrap_or(emergency);
        let k_dry = reached(found, choice).and_then(Correction::k_dry);
        let t_bs = found.service_build_up_s.unwrap_or(found.build_up_s);
        let etcs = EtcsBrake {
            gamma_emergency: emergency.clone(),
            gamma_service: service.clone(),
            gamma_normal_service: normal.unwrap_or(service).clone(),
            k_dry: over(k_dry.unwrap_or(1.0)),
            k_wet: match &found.k_wet {
                Some(wet) => wet.between(&emergency.boundaries),
                None => over(choice.k_wet.unwrap_or(1.0)),
            },
            k_n_pos: SpeedSteps::constant(0.0),
            k_n_neg: SpeedSteps::constant(0.0),
            t_traction_cut_off: found.cut_off.map_or(0.0, |it| it.greatest_s),
            t_bs1: t_bs,
            t_bs2: t_bs,
            t_be: found.build_up_s,
        };
        let bases = [decelerations(found), factors(found, choice), times(found)];
        (etcs, bases.into_iter().flatten().collect())
    }
}

/// Returns the level that is chosen.
fn reached<'f>(
    found: &'f BrakeParameters,
    choice: &DeclaredBrakeFigures,
) -> Option<&'f Correction> {
    found.k_dry.iter().find(|it| Some(it.ebcl) == choice.ebcl)
}

fn known(key: &'static str, rests_on: impl Into<String>) -> Basis {
    Basis { key, rests_on: rests_on.into(), is_guess: false }
}

fn guess(key: &'static str, rests_on: impl Into<String>) -> Basis {
    Basis { key, rests_on: rests_on.into(), is_guess: true }
}

fn decelerations(found: &BrakeParameters) -> Vec<Basis> {
    let stops = found.stops;
    let usual = format!("the median of {} stops by less than all of the brake", found.usual_stops);
    let (normal, instead) = match &found.normal_service {
        Some(_) => (known("gamma_normal_service", usual.clone()), usual),
        None => {
            let words = "gamma_service: fewer than 3 stops by less than all of the brake";
            (guess("gamma_normal_service", words), "the emergency steps".into())
        }
    };
    let emergency = match found.is_commanded {
        true => known(
            "gamma_emergency",
            format!(
                "{stops} stops by all of the brake; their record does not tell emergency from full service"
            ),
        ),
        false => guess(
            "gamma_emergency",
            format!(
                "{stops} stops whose speed kept falling: no record of the brake shows that it was applied in full"
            ),
        ),
    };
    let service = match &found.service {
        Some(_) => known("gamma_service", "the stops of --service"),
        None => {
            let words = format!("{instead}: no full service stops are given (--service)");
            guess("gamma_service", words)
        }
    };
    vec![emergency, service, normal]
}

fn factors(found: &BrakeParameters, choice: &DeclaredBrakeFigures) -> Vec<Basis> {
    let stops = found.stops;
    let k_dry = match reached(found, choice).filter(|it| it.k_dry().is_some()) {
        Some(it) if it.measured.is_some() => {
            known("k_dry", format!("level {} of {stops} stops by all of the brake", it.ebcl))
        }
        Some(it) => known("k_dry", format!("level {} of the declared components", it.ebcl)),
        None => guess(
            "k_dry",
            format!("1, for {stops} stops support no level, and no [brake] units are declared"),
        ),
    };
    let k_wet = match (&found.k_wet, choice.k_wet) {
        (Some(_), _) => known("k_wet", "the stops of --wet"),
        (None, Some(_)) => known("k_wet", "declared by --k-wet"),
        (None, None) => {
            guess("k_wet", "1, not known: no wet stops (--wet), and none declared (--k-wet)")
        }
    };
    let [pos, neg] = ["k_n_pos", "k_n_neg"].map(|key| guess(key, "0: not estimated"));
    vec![k_dry, k_wet, pos, neg]
}

fn times(found: &BrakeParameters) -> Vec<Basis> {
    let key = "t_traction_cut_off";
    let cut_off = match &found.cut_off {
        Some(it) => known(
            key,
            format!(
                "the latest of {} stops ({:.2} to {:.2} s after the brake's first sign)",
                it.stops, it.least_s, it.greatest_s
            ),
        ),
        None => guess(
            key,
            "0: no stop shows a traction force that was there at the brake's command and went",
        ),
    };
    let [first, second] = ["t_bs1", "t_bs2"].map(|key| match found.service_build_up_s {
        Some(_) => known(key, "the stops of --service"),
        None => guess(key, "t_be"),
    });
    let t_be = match found.is_commanded {
        true => known("t_be", format!("{} stops by all of the brake", found.stops)),
        false => guess("t_be", "the fall of the speed: the brake's command is not recorded"),
    };
    vec![cut_off, first, second, t_be]
}

/// Reads `etcs_brake_params`.
///
/// # Errors
///
/// Names the first value that the form does not allow.
pub fn read(root: &Item) -> Result<EtcsBrake, DatasetError> {
    let gamma = |key| steps(root, key, "a deceleration in m/s² above 0, at most 10", 1e-6..=10.0);
    let share = |key| steps(root, key, "a share from 0 to 1", 0.0..=1.0);
    let factor = |key| steps(root, key, "a number from 0 to 10", 0.0..=10.0);
    let time = |key| root.required(key, "a time in s from 0 to 300", 0.0..=300.0);
    Ok(EtcsBrake {
        gamma_emergency: gamma("gamma_emergency")?,
        gamma_service: gamma("gamma_service")?,
        gamma_normal_service: gamma("gamma_normal_service")?,
        k_dry: share("k_dry")?,
        k_wet: share("k_wet")?,
        k_n_pos: factor("k_n_pos")?,
        k_n_neg: factor("k_n_neg")?,
        t_traction_cut_off: time("t_traction_cut_off")?,
        t_bs1: time("t_bs1")?,
        t_bs2: time("t_bs2")?,
        t_be: time("t_be")?,
    })
}

fn steps(
    root: &Item,
    key: &'static str,
    allowed: &'static str,
    range: RangeInclusive<f64>,
) -> Result<SpeedSteps, DatasetError> {
    let item = root.need(key, "boundaries and values")?;
    let list = |name: &'static str| item.need(name, "a list of numbers");
    let boundaries = list("boundaries")?;
    let mut read = SpeedSteps::default();
    for entry in boundaries.list("boundaries", 0)? {
        let speed_mps = entry.number("a speed in m/s above 0, at most 200", 1e-9..=200.0)?;
        if read.boundaries.last().is_some_and(|last| speed_mps <= *last) {
            return Err(entry.out_of_range(&speed_mps.to_string(), "a speed above the one before"));
        }
        read.boundaries.push(speed_mps);
    }
    let values = list("values")?;
    for entry in values.list("values", 1)? {
        read.values.push(entry.number(allowed, range.clone())?);
    }
    if read.values.len() != read.boundaries.len() + 1 {
        let found = format!("{} values", read.values.len());
        let expected = format!("one more value than the {} boundaries", read.boundaries.len());
        return Err(values.out_of_range(&found, &expected));
    }
    Ok(read)
}
