//! The parameters in the form of OSRD's `etcs_brake_params`, written and read.

use serde::Serialize;

use super::parameters::Parameters;
use super::steps::Steps;
use crate::dataset::DatasetError;
use crate::dataset::document::Item;

/// `etcs_brake_params` of OSRD's rolling stock.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EtcsBrake {
    /// A_brake_emergency in m/s².
    pub gamma_emergency: Steps,
    /// A_brake_service in m/s².
    pub gamma_service: Steps,
    /// A_brake_normal_service in m/s².
    pub gamma_normal_service: Steps,
    /// Kdry_rst, where it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub k_dry: Option<Steps>,
    /// Kwet_rst, where it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub k_wet: Option<Steps>,
    /// Kn+ in m/s².
    pub k_n_pos: Steps,
    /// Kn- in m/s².
    pub k_n_neg: Steps,
    /// T_traction_cut_off in s.
    pub t_traction_cut_off: f64,
    /// Build-up in s of the service brake, for the first service brake intervention.
    pub t_bs1: f64,
    /// Build-up in s of the service brake, for the second.
    pub t_bs2: f64,
    /// Build-up in s of the emergency brake.
    pub t_be: f64,
}

impl EtcsBrake {
    /// The parameters with Kdry_rst at a level of confidence, where data or components reach it. Service steps that
    /// were not measured are the normal service, else the emergency steps.
    pub fn of(found: &Parameters, ebcl: Option<u32>, declared_k_wet: Option<f64>) -> Self {
        let k_dry = ebcl.and_then(|ebcl| found.k_dry.iter().find(|it| it.ebcl == ebcl)?.k_dry());
        // Boundaries of the factors are those of the emergency steps.
        let over = |value: f64| Steps {
            boundaries: found.emergency.boundaries.clone(),
            values: vec![value; found.emergency.values.len()],
        };
        let normal = found.normal_service.clone();
        let service = found.service.clone().or(normal.clone());
        let service = service.unwrap_or_else(|| found.emergency.clone());
        EtcsBrake {
            gamma_emergency: found.emergency.clone(),
            gamma_normal_service: normal.unwrap_or_else(|| service.clone()),
            gamma_service: service,
            k_dry: k_dry.map(over),
            k_wet: found.k_wet.clone().or(declared_k_wet.map(over)),
            k_n_pos: Steps::constant(0.0),
            k_n_neg: Steps::constant(0.0),
            t_traction_cut_off: 0.0,
            t_bs1: found.build_up_s,
            t_bs2: found.build_up_s,
            t_be: found.build_up_s,
        }
    }
}

/// Reads `etcs_brake_params`.
///
/// # Errors
///
/// Names the first value that the form does not allow.
pub fn read(root: &Item) -> Result<EtcsBrake, DatasetError> {
    let gamma = |key| steps(root, key, "a deceleration in m/s² above 0, at most 10", 1e-6);
    let factor = |key| steps(root, key, "a number from 0 to 10", 0.0);
    let known = |key| root.has(key).then(|| factor(key)).transpose();
    let time = |key| root.required(key, "a time in s from 0 to 300", 0.0..=300.0);
    Ok(EtcsBrake {
        gamma_emergency: gamma("gamma_emergency")?,
        gamma_service: gamma("gamma_service")?,
        gamma_normal_service: gamma("gamma_normal_service")?,
        k_dry: known("k_dry")?,
        k_wet: known("k_wet")?,
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
    least: f64,
) -> Result<Steps, DatasetError> {
    let item = root.need(key, "boundaries and values")?;
    let list = |name: &'static str| item.need(name, "a list of numbers");
    let boundaries = list("boundaries")?;
    let mut read = Steps::default();
    for entry in boundaries.list("boundaries", 0)? {
        let speed_mps = entry.number("a speed in m/s above 0, at most 200", 1e-9..=200.0)?;
        if read.boundaries.last().is_some_and(|last| speed_mps <= *last) {
            return Err(entry.out_of_range(&speed_mps.to_string(), "a speed above the one before"));
        }
        read.boundaries.push(speed_mps);
    }
    let values = list("values")?;
    for entry in values.list("values", 1)? {
        read.values.push(entry.number(allowed, least..=10.0)?);
    }
    if read.values.len() != read.boundaries.len() + 1 {
        let found = format!("{} values", read.values.len());
        let expected = format!("one more value than the {} boundaries", read.boundaries.len());
        return Err(values.out_of_range(&found, &expected));
    }
    Ok(read)
}
