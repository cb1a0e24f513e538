//! The file of a trip: its rows with a chainage, in SI units, forces where they act.

use std::fmt::Write as _;

use dynocar_analysis::dataset::stamps::{is_stamped_late, stamped_late};
use dynocar_analysis::dataset::{Dataset, ForceSource, Quantity, Run};
use dynocar_analysis::survey::{Survey, Trip};
use dynocar_shared::{SampleField, TrainSample};

use super::material::Material;
use super::read::rows_in_order;

/// Seconds by which forces are stamped late and are moved, 0 for none.
pub fn late_s(survey: &Survey) -> f64 {
    let Some(profile) = &survey.profile else { return 0.0 };
    let (late_s, std_s) =
        (profile.learned.profile.common.delay_s(), profile.learned.profile.common_std.delay_s());
    // A force that acts after its stamp is an actuator's delay, which is explained, not mended.
    if is_stamped_late(late_s, std_s) { late_s } else { 0.0 }
}

/// A column of the trips' files.
pub struct Column {
    /// What it holds.
    pub quantity: Quantity,
    /// Its unit.
    pub unit: &'static str,
    decimals: usize,
}

/// The columns of a dataset's trips.
pub fn columns(dataset: &Dataset) -> Vec<Column> {
    let any = |is_there: fn(&Run) -> bool| dataset.runs.iter().any(is_there);
    let has = |field: SampleField| {
        dataset.runs.iter().any(|run| run.samples.iter().any(|it| it.get(field).is_some()))
    };
    let is_signed = any(|run| run.traction_source == ForceSource::ControlForce);
    let all = [
        (Quantity::Time, "s", 3, true),
        (Quantity::Position, "m", 2, true),
        (Quantity::Speed, "m/s", 4, true),
        (Quantity::ControlForce, "N", 1, is_signed),
        (Quantity::TractionForce, "N", 1, !is_signed && has(SampleField::TractionForce)),
        (Quantity::BrakeForce, "N", 1, !is_signed && any(has_own_brake)),
        (Quantity::BrakeCylinderPressure, "Pa", 1, has(SampleField::BrakeCylinderPressure)),
        (Quantity::TractionPower, "W", 0, any(|run| run.extras.traction_power_w.is_some())),
        (Quantity::LinePower, "W", 0, any(|run| run.extras.line_power_w.is_some())),
        (Quantity::Acceleration, "m/s2", 5, has(SampleField::Acceleration)),
        (Quantity::SpecificForce, "m/s2", 5, has(SampleField::SpecificForce)),
        (Quantity::TrainMass, "kg", 1, has(SampleField::Mass)),
        (Quantity::Passengers, "1", 0, any(|run| run.extras.passengers.is_some())),
        (Quantity::AmbientTemperature, "degC", 2, has(SampleField::AmbientTemperature)),
        (Quantity::Altitude, "m", 2, any(|run| run.extras.altitude_m.is_some())),
        (Quantity::Latitude, "deg", 7, any(|run| run.extras.latitude_deg.is_some())),
        (Quantity::Longitude, "deg", 7, any(|run| run.extras.longitude_deg.is_some())),
        (Quantity::DoorOpen, "1", 0, any(|run| run.extras.door_open.is_some())),
        (Quantity::WheelSlide, "1", 0, any(|run| run.samples.iter().any(|it| it.flags != 0))),
    ];
    all.into_iter()
        .filter(|it| it.3)
        .map(|(quantity, unit, decimals, _)| Column { quantity, unit, decimals })
        .collect()
}

/// True where the brake force is more than what the pressure says.
fn has_own_brake(run: &Run) -> bool {
    !matches!(run.brake_source, ForceSource::None | ForceSource::Pressure)
}

/// The text of a trip's file.
pub fn run_csv(material: &Material, trip: &Trip) -> String {
    let columns = columns(material.dataset);
    let run = &material.dataset.runs[trip.recording];
    let ordered = rows_in_order(run);
    let late_s = late_s(material.survey);
    let names: Vec<&str> = columns.iter().map(|column| column.quantity.name()).collect();
    let mut text = names.join(",") + "\n";
    for (index, row) in trip.rows().enumerate() {
        let sample = &run.samples[ordered[row]];
        let next = ordered.get(row + 1).map(|&next| &run.samples[next]);
        let along_m = trip.along.chainage_m[index];
        let position_m = material.survey.alignments.chainage_m(trip.direction, along_m);
        for (k, column) in columns.iter().enumerate() {
            let value = match column.quantity {
                Quantity::Position => Some(position_m),
                Quantity::TrainMass => mass_kg(material, run, ordered[row]),
                quantity => value(material, run, ordered[row], sample, next, late_s, quantity),
            };
            if k > 0 {
                text.push(',');
            }
            if let Some(value) = value {
                let _ = write!(text, "{value:.*}", column.decimals);
            }
        }
        text.push('\n');
    }
    text
}

/// The mass of a row with what was learned of it.
fn mass_kg(material: &Material, run: &Run, row: usize) -> Option<f64> {
    let declared_kg = run.samples[row].get(SampleField::Mass)?;
    let Some(profile) = &material.survey.profile else { return Some(declared_kg) };
    let (common, prior) = (&profile.learned.profile.common, &material.vehicle.prior);
    if prior.is_weighed {
        return Some(declared_kg);
    }
    let passengers = run.extras.passengers.as_ref().and_then(|it| it[row]).unwrap_or(0.0);
    let per_passenger_kg = common.passenger_kg() - prior.passenger_kg;
    Some(declared_kg + prior.mass_kg * common.mass_share() + passengers * per_passenger_kg)
}

#[allow(clippy::too_many_arguments)]
fn value(
    material: &Material,
    run: &Run,
    row: usize,
    sample: &TrainSample,
    next: Option<&TrainSample>,
    late_s: f64,
    quantity: Quantity,
) -> Option<f64> {
    let extra = |values: &Option<Vec<Option<f64>>>| values.as_ref()?[row];
    let late = |force: &dyn Fn(&TrainSample) -> Option<f64>| {
        let here = force(sample)?;
        let Some(next) = next.filter(|_| late_s > 0.0) else { return Some(here) };
        let step_s = (next.time_ns - sample.time_ns) as f64 * 1e-9;
        Some(stamped_late(here, force(next).unwrap_or(here), step_s, late_s))
    };
    let traction = |sample: &TrainSample| sample.get(SampleField::TractionForce);
    let own_brake = |sample: &TrainSample| {
        let friction =
            material.dataset.train.brake_gear.friction_brake.and_then(|brake| {
                Some(brake.force_n(sample.get(SampleField::BrakeCylinderPressure)?))
            });
        Some(sample.get(SampleField::BrakeForce)? - friction.unwrap_or(0.0))
    };
    match quantity {
        Quantity::Time => Some(sample.time_ns as f64 * 1e-9),
        Quantity::Speed => sample.get(SampleField::Speed),
        Quantity::ControlForce => late(&|sample| Some(traction(sample)? - own_brake(sample)?)),
        Quantity::TractionForce => late(&traction),
        Quantity::BrakeForce => late(&own_brake),
        Quantity::BrakeCylinderPressure => sample.get(SampleField::BrakeCylinderPressure),
        Quantity::Acceleration => sample.get(SampleField::Acceleration),
        Quantity::SpecificForce => sample.get(SampleField::SpecificForce),
        Quantity::AmbientTemperature => sample.get(SampleField::AmbientTemperature),
        Quantity::Passengers => extra(&run.extras.passengers),
        Quantity::TractionPower => extra(&run.extras.traction_power_w),
        Quantity::LinePower => extra(&run.extras.line_power_w),
        Quantity::Altitude => extra(&run.extras.altitude_m),
        Quantity::Latitude => extra(&run.extras.latitude_deg),
        Quantity::Longitude => extra(&run.extras.longitude_deg),
        Quantity::DoorOpen => extra(&run.extras.door_open),
        Quantity::WheelSlide => Some(f64::from(sample.flags & 1)),
        _ => None,
    }
}
