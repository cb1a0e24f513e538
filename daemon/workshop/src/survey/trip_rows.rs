//! The file of a trip: its rows with a chainage, in SI units, forces where they act.

use dynocar_analysis::dataset::{Dataset, ForceSource, Quantity, Run};
use dynocar_analysis::dataset::{is_stamped_late, stamped_late};
use dynocar_analysis::survey::{Survey, Trip};
use dynocar_shared::{SampleField, TrainSample};

use super::read::Material;
use super::read::rows_in_order;

/// Seconds by which forces are stamped late and are moved, 0 for none.
pub fn late_s(survey: &Survey) -> f64 {
    let Some(profile) = &survey.profile else { return 0.0 };
    let (late_s, std_s) =
        (profile.learned.profile.common.delay_s(), profile.learned.profile.common_std.delay_s());
    // A force that acts after its stamp is an actuator's delay, which is explained, not mended.
    if is_stamped_late(late_s, std_s) { late_s } else { 0.0 }
}

/// Where a column's values are from.
#[derive(Clone, Copy)]
enum Source {
    /// A field of the samples.
    Field(SampleField),
    /// Quantity recorded beside them.
    Extra,
    /// Made of several, see `run_csv`.
    Made,
}

/// A column of the trips' files.
#[derive(Clone, Copy)]
pub struct TripColumn {
    /// Quantity of the column.
    pub quantity: Quantity,
    /// Its unit.
    pub unit: &'static str,
    decimals: usize,
    source: Source,
}

/// Every column that there may be.
const COLUMNS: [TripColumn; 19] = {
    use Source::{Extra, Field, Made};
    [
        column(Quantity::Time, "s", 3, Made),
        column(Quantity::Position, "m", 2, Made),
        column(Quantity::Speed, "m/s", 4, Made),
        column(Quantity::ControlForce, "N", 1, Made),
        column(Quantity::TractionForce, "N", 1, Made),
        column(Quantity::BrakeForce, "N", 1, Made),
        column(Quantity::BrakeCylinderPressure, "Pa", 1, Field(SampleField::BrakeCylinderPressure)),
        column(Quantity::TractionPower, "W", 0, Extra),
        column(Quantity::LinePower, "W", 0, Extra),
        column(Quantity::Acceleration, "m/s2", 5, Field(SampleField::Acceleration)),
        column(Quantity::SpecificForce, "m/s2", 5, Field(SampleField::SpecificForce)),
        column(Quantity::TrainMass, "kg", 1, Made),
        column(Quantity::Passengers, "1", 0, Extra),
        column(Quantity::AmbientTemperature, "degC", 2, Field(SampleField::AmbientTemperature)),
        column(Quantity::Altitude, "m", 2, Extra),
        column(Quantity::Latitude, "deg", 7, Extra),
        column(Quantity::Longitude, "deg", 7, Extra),
        column(Quantity::DoorOpen, "1", 0, Extra),
        column(Quantity::WheelSlide, "1", 0, Made),
    ]
};

const fn column(
    quantity: Quantity,
    unit: &'static str,
    decimals: usize,
    source: Source,
) -> TripColumn {
    TripColumn { quantity, unit, decimals, source }
}

/// The columns of a dataset's trips.
pub fn columns(dataset: &Dataset) -> Vec<TripColumn> {
    let any = |is_there: &dyn Fn(&Run) -> bool| dataset.runs.iter().any(is_there);
    let has = |field: SampleField| any(&|run| run.samples.iter().any(|it| it.get(field).is_some()));
    let is_signed = any(&|run| run.traction_source == ForceSource::ControlForce);
    let is_there = |column: &TripColumn| match (column.source, column.quantity) {
        (Source::Field(field), _) => has(field),
        (Source::Extra, quantity) => any(&|run| run.extra(quantity).is_some()),
        (_, Quantity::ControlForce) => is_signed,
        (_, Quantity::TractionForce) => !is_signed && has(SampleField::TractionForce),
        (_, Quantity::BrakeForce) => !is_signed && any(&has_own_brake),
        (_, Quantity::TrainMass) => has(SampleField::Mass),
        (_, Quantity::WheelSlide) => any(&|run| run.samples.iter().any(|it| it.flags != 0)),
        _ => true,
    };
    COLUMNS.into_iter().filter(is_there).collect()
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
    let traction = |sample: &TrainSample| sample.get(SampleField::TractionForce);
    let own_brake = |sample: &TrainSample| {
        let friction =
            material.dataset.train.brake_gear.friction_brake.and_then(|brake| {
                Some(brake.force_n(sample.get(SampleField::BrakeCylinderPressure)?))
            });
        Some(sample.get(SampleField::BrakeForce)? - friction.unwrap_or(0.0))
    };
    let names: Vec<&str> = columns.iter().map(|column| column.quantity.name()).collect();
    let mut text = names.join(",") + "\n";
    for (row, &along_m) in trip.rows().zip(&trip.along.chainage_m) {
        let sample = &run.samples[ordered[row]];
        let next = ordered.get(row + 1).map(|&next| &run.samples[next]).filter(|_| late_s > 0.0);
        let late = |force: &dyn Fn(&TrainSample) -> Option<f64>| {
            let here = force(sample)?;
            let Some(next) = next else { return Some(here) };
            let step_s = (next.time_ns - sample.time_ns) as f64 * 1e-9;
            Some(stamped_late(here, force(next).unwrap_or(here), step_s, late_s))
        };
        let value = |column: &TripColumn| match (column.source, column.quantity) {
            (Source::Field(field), _) => sample.get(field),
            (Source::Extra, quantity) => run.extra(quantity)?[ordered[row]],
            (_, Quantity::Time) => Some(sample.time_ns as f64 * 1e-9),
            (_, Quantity::Position) => {
                Some(material.survey.alignments.chainage_m(trip.direction, along_m))
            }
            (_, Quantity::Speed) => sample.get(SampleField::Speed),
            (_, Quantity::ControlForce) => late(&|it| Some(traction(it)? - own_brake(it)?)),
            (_, Quantity::TractionForce) => late(&traction),
            (_, Quantity::BrakeForce) => late(&own_brake),
            (_, Quantity::TrainMass) => mass_kg(material, run, ordered[row]),
            (_, Quantity::WheelSlide) => Some(f64::from(sample.flags & 1)),
            _ => None,
        };
        let cell = |column: &TripColumn| {
            value(column).map_or(String::new(), |value| format!("{value:.*}", column.decimals))
        };
        text += &(columns.iter().map(cell).collect::<Vec<_>>().join(",") + "\n");
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
    let passengers = run.extra(Quantity::Passengers).and_then(|it| it[row]).unwrap_or(0.0);
    let per_passenger_kg = common.passenger_kg() - prior.passenger_kg;
    Some(declared_kg + prior.mass_kg * common.mass_share() + passengers * per_passenger_kg)
}
