//! The unit that a diagnostic is reported in.

use dynocar_core::plausibility::InputFault;
use dynocar_model::units::Unit;

use super::manifest::Manifest;
use super::quantity::Quantity;

/// The quantities that an input fault is about, and the unit to report it in where none of them is mapped.
pub(super) fn concerned(fault: InputFault) -> (&'static [Quantity], &'static str) {
    use Quantity::*;
    match fault {
        InputFault::TimeScale => (&[Time], "s"),
        InputFault::SpeedScale => (&[Speed], "m/s"),
        InputFault::PositionScale | InputFault::DirectionReversed => (&[Position], "m"),
        InputFault::MassScale => (&[TrainMass], "t"),
        InputFault::BrakeScale => (&[BrakeForce, ControlForce], "kN"),
        InputFault::ForcesSwapped | InputFault::ForcesScale | InputFault::TractionScale => {
            (&[TractionForce, BrakeForce, ControlForce], "kN")
        }
        InputFault::GradientSign | InputFault::GradientScale => (&[Gradient], "permille"),
        InputFault::PressureScale => (&[BrakeCylinderPressure], "Pa"),
    }
}

/// The unit in which the manifest reads the quantity of a fault.
pub(super) fn read_as(manifest: &Manifest, fault: InputFault) -> Unit {
    let (quantities, otherwise) = concerned(fault);
    let mapped = quantities.iter().find_map(|&quantity| manifest.mapping(quantity));
    let name = mapped.map_or(otherwise, |mapping| mapping.unit.name());
    let dimension = fault.dimension();
    Unit::find(dimension, name).unwrap_or_else(|| Unit::base_of(dimension))
}
